//! `curvelax plot`: the pictures of a finished run, drawn again from its files.

use std::path::{Path, PathBuf};

use super::{note, print};
use crate::{
    error::Result,
    files::{
        OutputFolder, Owner, names,
        reader::{self, Finished},
    },
    report::pictures::FinishedRun,
    results::EnsembleStatistics,
};

const EXAMPLES: &str = "\
Examples:
  curvelax plot ellipses
  curvelax plot ellipses --out pictures

Draws DIR/plots/*.svg and DIR/report.html from run.json, summary.csv, members.csv, levels.csv, mean_excess.csv and
plots/portraits.json in DIR. The same version of the program writes the same bytes as the run.";

/// Redraw the plots and the report of a finished run.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct PlotArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    run: PathBuf,
    /// Folder for the pictures, which must not exist yet [default: that of the run]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into an existing --out DIR, replacing earlier pictures
    #[arg(long)]
    force: bool,
    /// Print no table: only errors
    #[arg(long)]
    quiet: bool,
}

/// Runs the command.
pub fn plot(args: PlotArgs) -> Result<()> {
    // Before the folder is opened, which would create a missing one.
    reader::provenance(&args.run)?;
    let (out, force, owner) = match &args.out {
        Some(out) if !is_same(out, &args.run) => (out, args.force, Owner::Pictures),
        Some(out) => (out, args.force, Owner::PicturesOfRun),
        None => (&args.run, true, Owner::PicturesOfRun),
    };
    let folder = OutputFolder::open_for(out, force, owner, names::PICTURES.map(String::from).into())?;
    let Finished { provenance, mut tally, excess, explained, films } = Finished::read(&args.run)?;
    if films.is_empty() && !args.quiet {
        note(&format!("note: no {} in {}: without pictures of members", names::PORTRAITS, args.run.display()));
    }
    let statistics = &EnsembleStatistics::new(&provenance.spec, &mut tally)?;
    let (provenance, tally) = (&provenance, &tally);
    let study = FinishedRun { provenance, tally, statistics, excess: &excess, explained: &explained, films: &films };
    let pictures = study.pictures()?;
    let files = pictures.iter().map(|(name, text)| folder.write(name, text)).collect::<Result<_>>()?;
    folder.publish_all(files)?;
    if args.quiet {
        return Ok(());
    }
    let names: Vec<&str> = pictures.iter().map(|(name, _)| *name).collect();
    print(&format!("results    {}: {}\n", out.display(), names.join(", ")))
}

/// Whether both paths lead to the same folder.
fn is_same(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(one), Ok(other)) if one == other)
}
