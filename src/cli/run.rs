//! `curvelax run`: arguments → spec → members → files.

use std::path::PathBuf;

use super::{dry_run, flags, manner::MannerFlags, print, print_json};
use crate::{
    ensemble::Spec,
    error::{Error, Result},
    estimate::Estimate,
    files::{Existing, OutputFolder},
    session::{self, Host, Work},
};

const EXAMPLES: &str = "\
Examples:
  curvelax run --out ellipses
      256 perturbed 2:1 ellipses under surface diffusion, with the paper's n, τ and ω
  curvelax run --flow willmore --curves 10000 --stop-when-relaxed --out willmore
  curvelax run --accurate --out accurate
      the same ellipses, each time with its limit for n → ∞ and its error
  curvelax run --accurate --relax-at 0.01 --shape file:island.csv --out island
  curvelax run --accurate --accuracy 1e-3 --out thousandth
      as many members as the median needs
  curvelax run --curves 8 --tau 1e-4 --print-spec > spec.toml
  curvelax run spec.toml --seed 2 --out second
  curvelax run spec.toml --shard 3/8 --resume --out shards/3
      an eighth of the members, for curvelax merge; the same line resumes it after an interruption
  curvelax run spec.toml --dry-run

The keys of SPEC.toml are the names of the flags; a flag overrides the file.";

/// Simulate one ensemble.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct RunArgs {
    /// Spec file; keys that it does not set have their defaults
    #[arg(value_name = "SPEC.toml")]
    spec: Option<PathBuf>,
    #[command(flatten)]
    flags: flags::SpecFlags,
    /// Folder for the results, which must not exist yet
    #[arg(long, value_name = "DIR", required_unless_present_any = ["print_spec", "dry_run"], help_heading = flags::OUTPUT)]
    out: Option<PathBuf>,
    /// Write into an existing DIR, replacing the earlier run in it. A folder that holds anything else is refused
    #[arg(long, help_heading = flags::OUTPUT)]
    force: bool,
    /// Resume the run in DIR if it was interrupted, leave it if it is finished, start it if there is none. The same line
    /// then starts and restarts a job
    #[arg(long, conflicts_with_all = ["force", "dry_run", "print_spec"], help_heading = flags::OUTPUT)]
    resume: bool,
    #[command(flatten)]
    manner: MannerFlags,
    /// Predict memory, disk space, steps and time of the run from a pilot of some two seconds of work, and stop
    #[arg(long, conflicts_with = "print_spec", help_heading = flags::OUTPUT)]
    dry_run: bool,
    /// Print the resolved spec and stop
    #[arg(long, conflicts_with = "json", help_heading = flags::OUTPUT)]
    print_spec: bool,
}

/// Runs the command.
pub fn run(args: RunArgs) -> Result<()> {
    let spec = resolve(args.spec, args.flags)?;
    let asked = spec.backend;
    let runs = !(args.print_spec || args.dry_run);
    // Rounds and pilots take time, too.
    let manner = if spec.accuracy.is_some() || args.dry_run { Some(args.manner.manner()?) } else { None };
    // A name that cannot be used is told before the rounds, which may take minutes.
    if let (true, Some(out)) = (runs && !args.resume, &args.out) {
        OutputFolder::check_place(out, args.force)?;
    }
    let spec = session::planned(spec, manner.as_ref(), &args.manner)?;
    let work = Work::new(spec)?;
    if args.print_spec {
        return print(&work.study.spec().to_toml()?);
    }
    let flags = args.manner;
    work.study.note().into_iter().for_each(|note| flags.say(&format!("note: {note}")));
    if args.dry_run {
        work.warnings().iter().for_each(|warning| flags.say(&format!("warning: {warning}")));
        let stopped = || {
            let (cause, _) = manner.as_ref()?.stop.asked()?;
            Some(cause.error(" in the pilot: nothing is saved"))
        };
        let estimate = Estimate::new(&work.study, work.choices, flags.checkpoint_every(), &stopped)?;
        return match (flags.json, flags.quiet) {
            (true, _) => print_json(&estimate),
            (false, false) => print(&dry_run::table(&estimate, &work.study.cells()[0].spec)),
            (false, true) => Ok(()),
        };
    }
    let out = args.out.ok_or_else(|| Error::Request("--out DIR: a run needs a folder for its results".into()))?;
    flags.check_name(&out)?;
    let begun = if args.resume { session::begun(&out)? } else { None };
    if let Some(begun) = begun {
        return match session::resume_like(begun, &work.study, asked, &flags)? {
            Some(completed) => flags.completed(completed),
            None => flags.finished(&out),
        };
    }
    let manner = manner.map_or_else(|| flags.manner(), Ok)?;
    let existing = if args.resume { Existing::Filled } else { args.force.into() };
    flags.completed(session::begin(work, &out, existing, manner, &flags)?)
}

/// The spec file, overlaid with the flags.
fn resolve(file: Option<PathBuf>, flags: flags::SpecFlags) -> Result<Spec> {
    let mut spec = file.map_or_else(|| Spec::from_toml("").map_err(Error::Request), |path| Spec::read(&path))?;
    flags.check_sweeps()?;
    flags.overlay(&mut spec);
    Ok(spec)
}
