//! `curvelax run`: request → plan → study and placement → session → report.

use std::path::PathBuf;

use super::{
    dry_run, flags, print,
    report_flags::{ReportFlags, check_name},
};
use crate::{
    ensemble::Spec,
    error::{Error, Result},
    files::{Existing, OutputFolder},
    session::{self, Host, PlacedStudy},
};

const EXAMPLES: &str = "\
Examples:
  curvelax run --out ellipses
      256 perturbed 2:1 ellipses under surface diffusion, with the paper's n, τ and ω
  curvelax run --flow willmore --curves 10000 --stop-when-relaxed --out willmore
  curvelax run --accurate --out accurate
      the same ellipses, each time with its limit for n → ∞ and its error
  curvelax run --accurate --relax-at 0.01 --shape file:island.csv --curves 1 --amplitude 0 --out island
  curvelax run --accurate --accuracy 1e-3 --out thousandth
      as many members as the median needs
  curvelax run --curves 8 --tau 1e-4 --print-spec > spec.toml
  curvelax run spec.toml --seed 2 --out second
  curvelax run spec.toml --shard 3/8 --resume --out shards/3
      an eighth of the members, for curvelax merge; the same command resumes it after an interruption
  curvelax run spec.toml --dry-run

Distributions, for any number in --shape, --flow, --energy, --diffusivity, --drive, --amplitude, --decay and
--reduced-area; each member has a number of its own:
  uniform(A..B)  loguniform(A..B)  normal(MEAN,SD)  halfnormal(SD)  gamma(SHAPE,SCALE)  weibull(SHAPE,SCALE)
  lognormal(MEDIAN,SIGMA)             SIGMA is the standard deviation of the natural logarithm
  choice(A,B,...)  empirical(A,B,...)     one of these values; a number between two neighbours among them
  each(A,B,...)  table(FILE,COLUMN)       a value for each member, in their order
  DISTRIBUTION in A..B                    one of the distributions down to lognormal, cut at bounds

R in a default is the radius of the circle whose area is that of the member.
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
    /// Resume the run in DIR if it was interrupted, leave it if it is finished, start it if there is none. The same
    /// command then starts and restarts a job
    #[arg(long, conflicts_with_all = ["force", "dry_run", "print_spec"], help_heading = flags::OUTPUT)]
    resume: bool,
    #[command(flatten)]
    options: ReportFlags,
    /// Predict memory, disk space, steps and time of the run from a pilot of some two seconds of work, and stop. With
    /// --accuracy the trial rounds, which choose what is run, are run first
    #[arg(long, conflicts_with = "print_spec", help_heading = flags::OUTPUT)]
    dry_run: bool,
    /// Print the resolved spec and stop
    #[arg(long, conflicts_with = "json", help_heading = flags::OUTPUT)]
    print_spec: bool,
}

/// Runs the command.
pub fn run(args: RunArgs) -> Result<()> {
    let RunArgs { spec, flags, out, force, resume, options: host, dry_run, print_spec } = args;
    let request = request(spec, flags)?;
    let asked = request.backend;
    // Rounds and pilots take time, too.
    let options = if request.accuracy.is_some() || dry_run { Some(host.options()?) } else { None };
    // A name that cannot be used is told before the rounds, which may take minutes.
    if let (false, Some(out)) = (print_spec || dry_run || resume, &out) {
        OutputFolder::check_place(out, force)?;
    }
    let placed = PlacedStudy::plan(request, options.as_ref(), &host)?;
    if print_spec {
        return print(&placed.study.spec().to_toml()?);
    }
    placed.study.note().into_iter().for_each(|note| host.say(&format!("note: {note}")));
    if let (true, Some(options)) = (dry_run, &options) {
        return dry_run::dry_run(placed, &options.stop, &host);
    }
    let out = out.ok_or_else(|| Error::Request("--out DIR: a run needs a folder for its results".into()))?;
    check_name(host.json, &out)?;
    let begun = if resume { session::begun(&out)? } else { None };
    let completed = match begun {
        Some(begun) => session::resume_like(begun, &placed.study, asked, &host)?,
        None => {
            let options = options.map_or_else(|| host.options(), Ok)?;
            let existing = if resume { Existing::Filled } else { force.into() };
            Some(session::begin(placed, &out, existing, options, &host)?)
        }
    };
    host.ended(completed, &out)
}

/// The spec file, overlaid with the flags.
fn request(file: Option<PathBuf>, flags: flags::SpecFlags) -> Result<Spec> {
    let mut spec = file.map_or_else(|| Spec::from_toml("").map_err(Error::Request), |path| Spec::read(&path))?;
    flags.check_sweeps()?;
    flags.overlay(&mut spec)?;
    Ok(spec)
}
