//! Flags of `run` and `resume` that affect how a run reports and stops, not its results.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use super::{flags, note, parsers, print, signals};
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
    checkpoint_every: Duration,
}

impl ReportFlags {
    /// Checks that the results in `out` can be printed as requested.
    ///
    /// # Errors
    /// [`Error::Request`] for a name that JSON cannot represent.
    pub fn check_name(&self, out: &Path) -> Result<()> {
        check_name(self.json, out)
    }

    /// Reports the end of the run in `out`: the one that was just completed, or one that was finished before.
    ///
    /// # Errors
    /// As [`RunVerdict::check`], and those of reading the run.
    pub fn ended(&self, completed: Option<Completed>, out: &Path) -> Result<()> {
        match completed {
            Some(completed) => self.completed(completed),
            None => self.finished(out),
        }
    }

    /// Reports on the finished run in `out` as at its end: its results as JSON, if requested, and
    /// whether it holds what was asked for.
    fn finished(&self, out: &Path) -> Result<()> {
        let provenance = reader::provenance(out)?;
        let verdict = match self.json || RunVerdict::needs_statistics(&provenance) {
            false => RunVerdict::new(&provenance, None),
            true => {
                let Finished { mut tally, .. } = Finished::read(out)?;
                let statistics = EnsembleStatistics::new(&provenance.spec, &mut tally)?;
                if self.json {
                    let files = listed(|name| out.join(name).exists());
                    print(&Document::new(&provenance, &provenance.spec, &statistics, out, &files).to_json()?)?;
                }
                RunVerdict::new(&provenance, Some(&statistics))
            }
        };
        verdict.check(self.strict, &out.join(names::SUMMARY))
    }

    /// Prints the results of a run that was just completed.
    fn completed(&self, Completed { text, verdict, out }: Completed) -> Result<()> {
        if self.json || !self.quiet {
            print(&text)?;
        }
        verdict.check(self.strict, &out.join(names::SUMMARY))
    }

    /// The interval between checkpoints.
    pub fn checkpoint_every(&self) -> Duration {
        self.checkpoint_every
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
        ReportOptions { since, progress, every, stop, patience: PATIENCE }
    }
}

/// Does the same as [`ReportFlags::check_name`], if `json` is set.
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
