//! `curvelax plot`: the pictures of a finished run, drawn again from its files.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use super::{
    flags, note,
    paper::{PaperFlags, Prints},
    print,
};
use crate::{
    error::Result,
    files::{
        OutputFolder, Owner, names,
        part_file::PartFile,
        reader::{self, Finished},
    },
    paper::{Printer, missing_letters},
    report::pictures::FinishedRun,
    results::EnsembleStatistics,
};

const EXAMPLES: &str = "\
Examples:
  curvelax plot ellipses
  curvelax plot ellipses --out pictures
  curvelax plot ellipses --format pdf --out figures
  curvelax plot ellipses --format png,pdf --width page --dpi 300

Draws DIR/plots/*.svg and DIR/report.html from run.json, summary.csv, members.csv, levels.csv, mean_excess.csv and
plots/portraits.json in DIR, or with --format plots/*.png and plots/*.pdf. The same version of the program writes the
same bytes as the run.

Pictures as png and pdf are for papers: white, as wide as a column, with text of 7 points and without title and
sentences, which belong in the caption. The text of a pdf can be selected. Journals ask for columns of 84 to 90 mm and
for pages of 170 to 190 mm.";

/// Redraw the plots and the report of a finished run.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct PlotArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    run: PathBuf,
    #[command(flatten)]
    paper: PaperFlags,
    /// Folder for the pictures, which must not exist yet [default: that of the run]
    #[arg(long, value_name = "DIR", help_heading = flags::OUTPUT)]
    out: Option<PathBuf>,
    /// Write into an existing --out DIR, replacing earlier pictures
    #[arg(long, help_heading = flags::OUTPUT)]
    force: bool,
    /// Print no table: only errors
    #[arg(long, help_heading = flags::OUTPUT)]
    quiet: bool,
}

impl Prints {
    /// The files of plots that may be written.
    fn names(&self) -> impl Iterator<Item = String> {
        let of = |(extension, _): &(&'static str, _)| {
            let extension = *extension;
            names::PICTURES.into_iter().filter_map(move |name| names::on_paper(name, extension))
        };
        self.formats.iter().flat_map(of)
    }

    /// Writes the pictures of a run; returns their files, and letters that could not be drawn.
    fn write(&self, study: &FinishedRun, folder: &OutputFolder) -> Result<(Vec<PartFile>, BTreeSet<char>)> {
        let (mut files, mut missing) = (Vec::new(), BTreeSet::new());
        if self.formats.is_empty() {
            return Ok((files, missing));
        }
        let printer = Printer::default();
        for picture in study.on_paper(self.width.pixels())? {
            let made = self.of(&printer, (&picture.title, &picture.svg), &mut missing)?;
            for (extension, content) in made {
                if let Some(name) = names::on_paper(picture.name, extension) {
                    files.push(folder.write(&name, content)?);
                }
            }
        }
        Ok((files, missing))
    }
}

/// Runs the command.
pub fn plot(args: PlotArgs) -> Result<()> {
    let (prints, on_screen) = (args.paper.prints()?, args.paper.on_screen());
    // Before the folder is opened, which would create a missing one.
    reader::provenance(&args.run)?;
    let (out, force, owner) = match &args.out {
        Some(out) if !is_same(out, &args.run) => (out, args.force, Owner::Pictures),
        Some(out) => (out, args.force, Owner::PicturesOfRun),
        None => (&args.run, true, Owner::PicturesOfRun),
    };
    let names = names::PICTURES.into_iter().filter(|_| on_screen).map(String::from).chain(prints.names());
    let folder = OutputFolder::open_for(out, force, owner, names.collect())?;
    let Finished { provenance, mut tally, excess, explained, films } = Finished::read(&args.run)?;
    if films.is_empty() && !args.quiet {
        note(&format!("note: no {} in {}: without pictures of members", names::PORTRAITS, args.run.display()));
    }
    let statistics = &EnsembleStatistics::new(&provenance.spec, &mut tally)?;
    let (provenance, tally) = (&provenance, &tally);
    let study = FinishedRun { provenance, tally, statistics, excess: &excess, explained: &explained, films: &films };
    let pictures = if on_screen { study.pictures()? } else { Vec::new() };
    let mut files: Vec<PartFile> =
        pictures.iter().map(|(name, text)| folder.write(name, text)).collect::<Result<_>>()?;
    let (printed, missing) = prints.write(&study, &folder)?;
    files.extend(printed);
    let names = files.iter().map(PartFile::name).collect::<Vec<_>>().join(", ");
    folder.publish_all(files)?;
    if args.quiet {
        return Ok(());
    }
    missing_letters(&missing).iter().for_each(|missing_letters| note(&format!("note: {missing_letters}")));
    print(&format!("results    {}: {names}\n", out.display()))
}

/// Whether both paths lead to the same folder.
fn is_same(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(one), Ok(other)) if one == other)
}
