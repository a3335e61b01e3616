//! `curvelax plot`: the pictures of a finished run, drawn again from its files.

use std::path::{Path, PathBuf};

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
    /// The files of plots for papers that may be written.
    fn names(&self) -> impl Iterator<Item = String> {
        let of = |extension| names::PICTURES.into_iter().filter_map(move |name| names::on_paper(name, extension));
        self.on_paper().flat_map(of)
    }

    /// Writes the pictures of a run for papers.
    fn write_run(&mut self, study: &FinishedRun, folder: &OutputFolder) -> Result<Vec<PartFile>> {
        let mut files = Vec::new();
        let Some(pixels) = self.pixels() else { return Ok(files) };
        for picture in study.on_paper(pixels)? {
            for (extension, content) in self.of(&picture.title, &picture.svg)? {
                if let Some(name) = names::on_paper(picture.name, extension) {
                    files.push(folder.write(&name, content)?);
                }
            }
        }
        Ok(files)
    }
}

/// Runs the command.
pub fn plot(args: PlotArgs) -> Result<()> {
    let mut prints = args.paper.prints()?;
    // Before the folder is opened, which would create a missing one.
    reader::provenance(&args.run)?;
    let (out, force, owner) = match &args.out {
        Some(out) if !is_same(out, &args.run) => (out, args.force, Owner::Pictures),
        Some(out) => (out, args.force, Owner::PicturesOfRun),
        None => (&args.run, true, Owner::PicturesOfRun),
    };
    let names = names::PICTURES.into_iter().filter(|_| prints.on_screen).map(String::from).chain(prints.names());
    let folder = OutputFolder::open_for(out, force, owner, names.collect())?;
    let Finished { provenance, mut tally, excess, explained, films } = Finished::read(&args.run)?;
    if films.is_empty() && !args.quiet {
        note(&format!("note: no {} in {}: without pictures of members", names::PORTRAITS, args.run.display()));
    }
    let statistics = &EnsembleStatistics::new(&provenance.spec, &mut tally)?;
    let (provenance, tally) = (&provenance, &tally);
    let study = FinishedRun { provenance, tally, statistics, excess: &excess, explained: &explained, films: &films };
    let pictures = if prints.on_screen { study.pictures()? } else { Vec::new() };
    let mut files: Vec<PartFile> =
        pictures.iter().map(|(name, text)| folder.write(name, text)).collect::<Result<_>>()?;
    files.extend(prints.write_run(&study, &folder)?);
    let names = files.iter().map(PartFile::name).collect::<Vec<_>>().join(", ");
    folder.publish_all(files)?;
    if args.quiet {
        return Ok(());
    }
    prints.note_missing();
    print(&format!("results    {}: {names}\n", out.display()))
}

/// Whether both paths lead to the same folder.
fn is_same(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(one), Ok(other)) if one == other)
}
