//! `curvelax resume`: an interrupted run goes on where it was, to the very files that it would have written.

use std::path::{Path, PathBuf};

use super::{
    flags::{self, BACKENDS, MACHINE},
    note,
    run::{MannerFlags, Work},
};
use crate::{
    backend::Platform,
    ensemble::{Spec, spec::BackendChoice},
    error::{Error, Result},
    report::{OutputFolder, Report, checkpoint},
};

const EXAMPLES: &str = "\
Examples:
  curvelax resume ellipses
  curvelax resume ellipses --max-time 1h
  curvelax resume ellipses --backend cpu
      goes on on the CPU, whatever it began on: digits then differ from those of an uninterrupted run

A run that was killed, stopped or failed goes on from its last state, at most --checkpoint-every old. Members that have ended
are not computed again, and all files end as those of an uninterrupted run, byte for byte but for the times in run.json.";

/// Continue an interrupted run.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct ResumeArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    run: PathBuf,
    /// Go on here instead of where the run began; digits then differ [default: where it began]
    #[arg(long, value_name = "WHERE", value_parser = flags::word::<BackendChoice>(BACKENDS), help_heading = MACHINE)]
    backend: Option<BackendChoice>,
    /// Go on on this GPU adapter, by a part of its name [default: the one on which it began]
    #[arg(long, value_name = "NAME", help_heading = MACHINE)]
    adapter: Option<String>,
    /// Threads of the CPU back end [default: those of its spec, or all cores]
    #[arg(long, value_name = "COUNT", value_parser = flags::whole::<usize>, allow_hyphen_values = true, help_heading = MACHINE)]
    threads: Option<usize>,
    #[command(flatten)]
    manner: MannerFlags,
}

/// Runs the command.
pub fn resume(args: ResumeArgs) -> Result<()> {
    let flags = args.manner;
    let mut folder = OutputFolder::open_again(&args.run)?;
    let Some(mut kept) = checkpoint::find(&folder)? else {
        folder.tidy()?;
        flags.say(&format!("note: the run in {} is finished: nothing is left to do", args.run.display()));
        return Ok(());
    };
    // Before a device is looked for, which takes its time.
    let manner = flags.manner();
    if let Some(fault) = &kept.note {
        note(&format!("warning: {}: {fault}", args.run.display()));
    }
    let origin = &mut kept.head.origin;
    if !origin.outlines.is_empty() {
        folder.make_absolute()?;
        go_to(Path::new(&origin.base))?;
        origin.check_outlines()?;
    }
    let began = origin.platform.clone();
    let elsewhere = args.backend.is_some() || args.adapter.is_some();
    let work = Work::new(spec(&origin.spec, args.backend, args.adapter, args.threads)?)?;
    let mut here = work.platform();
    here.reason = began.reason.clone();
    if !here.computes_like(&began) {
        if !elsewhere {
            return Err(Error::Request(format!(
                "the run is on {}, and here it would go on on {}, where digits differ; add --backend {} if it should",
                name(&began),
                name(&here),
                here.backend
            )));
        }
        origin.moves.push(format!("the run was on {} and went on on {}", name(&began), name(&here)));
        origin.spec = work.spec.to_toml()?;
        origin.platform = here;
    } else if args.threads.is_some() {
        (origin.platform.threads, origin.spec) = (here.threads, work.spec.to_toml()?);
    }
    let (report, standing) = Report::go_on(folder, &work.spec, work.cells[0].spec.points, kept, manner)?;
    flags.say(&format!("resuming: {} of {} members are in the table", report.members(), work.spec.member_count()));
    work.carry_out(report, standing, &flags)
}

/// The spec of the state, with what this command line asks for instead.
fn spec(text: &str, backend: Option<BackendChoice>, adapter: Option<String>, threads: Option<usize>) -> Result<Spec> {
    let mut spec = Spec::from_toml(text).map_err(|e| Error::Request(format!("the spec in the state: {e}")))?;
    if backend.is_some() || adapter.is_some() {
        spec.backend = backend.unwrap_or(BackendChoice::Gpu);
        spec.adapter = adapter;
    }
    if threads.is_some() {
        spec.threads = threads;
    }
    spec.validate()
}

/// Where paths in the spec begin.
fn go_to(base: &Path) -> Result<()> {
    std::env::set_current_dir(base).map_err(|e| {
        let base = base.display();
        Error::Request(format!("{base}: the run was begun in this folder, and its outline is named from there ({e})"))
    })
}

fn name(platform: &Platform) -> String {
    let parts = [Some(platform.backend.as_str()), platform.adapter.as_deref(), platform.driver.as_deref()];
    parts.into_iter().flatten().collect::<Vec<_>>().join(" ")
}
