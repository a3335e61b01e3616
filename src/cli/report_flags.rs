//! Flags of `run` and `resume` that affect how a run reports and stops, not its results.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use super::{flags, note, parsers, print, print_json, signals};
use crate::{
    error::{Error, Result},
    files::{
        names,
        reader::{self, Finished},
    },
    report::{Progress, ReportOptions, ResultFormat, Stop, complete::listed, document::Document},
    results::{EnsembleStatistics, RunVerdict},
    session::{Completed, Host},
};

/// A run that is asked to stop has this time to reach a point where all its work is saved.
const PATIENCE: Duration = Duration::from_millis(2500);

/// Options that affect how a run reports and stops, not its results.
#[derive(clap::Args)]
pub struct ReportFlags {
    /// Print no progress, notes or table: only errors, and the results if --json is given
    #[arg(long, help_heading = flags::OUTPUT)]
    pub quiet: bool,
    /// Print the results as one JSON document instead of the table
    #[arg(long, help_heading = flags::OUTPUT)]
    pub json: bool,
    /// Exit with code 3 if any member fails: if its status is singular, nonfinite or stalled
    #[arg(long, help_heading = flags::OUTPUT)]
    strict: bool,
    /// Stop after this time, such as 90, 90s, 5m or 1h30m, with exit code 75; `curvelax resume` continues
    #[arg(long, value_name = "DURATION", value_parser = parsers::duration, allow_hyphen_values = true, help_heading = flags::OUTPUT)]
    max_time: Option<Duration>,
    /// Interval between checkpoints for `curvelax resume`: a run that is killed loses at most one and a half times this
    /// much work
    #[arg(
        long, value_name = "DURATION", value_parser = parsers::duration, allow_hyphen_values = true, default_value = "5s",
        help_heading = flags::OUTPUT
    )]
    pub checkpoint_every: Duration,
}

impl ReportFlags {
    /// Reports the end of the run in `out`: the one that was just completed, or one that was finished before.
    ///
    /// # Errors
    /// As [`RunVerdict::check`], and those of reading the run.
    pub fn ended(&self, completed: Option<Completed>, out: &Path) -> Result<()> {
        let verdict = match completed {
            Some(Completed { text, verdict }) => {
                if self.json || !self.quiet {
                    print(&text)?;
                }
                verdict
            }
            None => self.finished(out)?,
        };
        verdict.check(self.strict, &out.join(names::SUMMARY))
    }

    /// Prints the results of the finished run in `out` as JSON, if requested, and returns whether it holds what was
    /// asked for.
    fn finished(&self, out: &Path) -> Result<RunVerdict> {
        let provenance = reader::provenance(out)?;
        if !self.json && !RunVerdict::needs_statistics(&provenance) {
            return Ok(RunVerdict::new(&provenance, None));
        }
        let Finished { mut tally, .. } = Finished::read(out)?;
        let statistics = EnsembleStatistics::new(&provenance.spec, &mut tally)?;
        if self.json {
            let files = listed(|name| out.join(name).exists());
            print_json(&Document::new(&provenance, &statistics, out, &files))?;
        }
        Ok(RunVerdict::new(&provenance, Some(&statistics)))
    }
}

impl Host for ReportFlags {
    /// Prints the line on stderr, unless quiet.
    fn say(&self, line: &str) {
        if !self.quiet {
            note(line)
        }
    }

    fn form(&self) -> ResultFormat {
        if self.json { ResultFormat::Json } else { ResultFormat::Overview }
    }

    fn options(&self) -> Result<ReportOptions> {
        let stop = Stop::default();
        signals::watch(&stop, self.max_time)?;
        Ok(self.options_with(stop))
    }

    fn options_with(&self, stop: Stop) -> ReportOptions {
        let (since, progress, every) = (Instant::now(), Progress::new(self.quiet), self.checkpoint_every);
        ReportOptions { since, progress, every, stop, patience: PATIENCE, see: Box::new(|_| ()) }
    }
}

/// Checks that results in `out` can be printed, as `json` if that is set.
///
/// # Errors
/// [`Error::Request`] for a name that JSON cannot represent.
pub fn check_name(json: bool, out: &Path) -> Result<()> {
    match json && out.to_str().is_none() {
        true => Err(Error::value(
            "out",
            out.display(),
            "not UTF-8, which JSON requires",
            "use another folder, or leave --json out",
        )),
        false => Ok(()),
    }
}
