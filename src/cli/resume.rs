//! `curvelax resume`: an interrupted run continues where it stopped, and writes exactly the files it would have
//! written.

use std::path::PathBuf;

use super::{
    flags::MACHINE,
    parsers,
    report_flags::{ReportFlags, check_name},
};
use crate::{
    ensemble::request::spec::BackendChoice,
    error::Result,
    session::{self, ResumePlace},
};

const EXAMPLES: &str = "\
Examples:
  curvelax resume ellipses
  curvelax resume ellipses --max-time 1h
  curvelax resume ellipses --backend cpu
      continues on the CPU, wherever it began: the last digits then differ from those of an uninterrupted run

A run that was killed, was stopped or failed resumes from its last checkpoint: a kill loses at most one and a half times
--checkpoint-every of work. Members that have ended are not computed again. All files end up as those of an uninterrupted
run, byte for byte except the times in run.json.";

/// Resume an interrupted run.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct ResumeArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    run: PathBuf,
    /// Continue here instead of where the run began; the last digits then differ [default: where it began]
    #[arg(long, value_name = "WHERE", value_parser = parsers::word::<BackendChoice>(), help_heading = MACHINE)]
    backend: Option<BackendChoice>,
    /// Continue on this GPU adapter, given by a part of its name [default: the one on which it began]
    #[arg(long, value_name = "NAME", help_heading = MACHINE)]
    adapter: Option<String>,
    /// Threads that prepare and analyse members and, on the CPU, advance them [default: as in the spec, otherwise all
    /// cores]
    #[arg(long, value_name = "COUNT", value_parser = parsers::whole::<usize>, allow_hyphen_values = true, help_heading = MACHINE)]
    threads: Option<usize>,
    #[command(flatten)]
    options: ReportFlags,
}

/// Runs the command.
pub fn resume(args: ResumeArgs) -> Result<()> {
    let ResumeArgs { run, backend, adapter, threads, options } = args;
    check_name(options.json, &run)?;
    let place = ResumePlace { backend, adapter, threads, why: None };
    options.ended(session::resume(&run, place, &options)?, &run)
}
