//! From a spec to a finished folder of results: what the command line and the Python package share.
//!
//! [`planned`] chooses what `accuracy` leaves open, [`Work`] checks a spec and chooses where it is computed, and
//! [`begin`] runs it. [`resume()`] continues an interrupted run.

mod resume;
mod work;

use std::path::{Path, PathBuf};

pub use resume::{ResumePlace, begun, resume, resume_like};
pub use work::Work;

use crate::{
    files::{Existing, OutputFolder},
    report::{Form, Manner, RunReport, Stop, checkpoint::Origin},
};
use curvelax_base::error::Result;
use curvelax_ensemble::{Snapshot, Spec, Standing};
use curvelax_study::{accuracy, results::RunVerdict};

/// Who has a run carried out: a user at a command line, or a program.
pub trait Host {
    /// Hears a line about the run: `note: …`, `warning: …`, or what happens now.
    fn say(&self, line: &str);
    /// The form of the text at the end.
    fn form(&self) -> Form;
    /// Makes a run stoppable from now on.
    ///
    /// # Errors
    /// If the system has no means for it.
    fn manner(&self) -> Result<Manner>;
    /// The manner of a run that `stop` stops.
    fn manner_with(&self, stop: Stop) -> Manner;
    /// Asked several times a second while a run is prepared; an error ends it.
    ///
    /// # Errors
    /// [`Error::Interrupted`](curvelax_base::error::Error::Interrupted) or the like, if the host wants no run any more.
    fn go_on(&self) -> Result<()> {
        Ok(())
    }
    /// Sees snapshots of a member, in time order and before they are stored. Those that a resumed run has stored
    /// earlier are not seen again.
    fn see(&self, _snapshots: &[Snapshot]) {}
}

/// A run that is complete.
#[derive(Debug)]
pub struct Completed {
    /// The results in the host's form.
    pub text: String,
    /// How it ended as a whole.
    pub verdict: RunVerdict,
    /// Folder of the results.
    pub out: PathBuf,
}

/// Replaces `accuracy` in `spec` by the nodes, tolerance and members that reach it, found in rounds that `manner` may
/// stop.
///
/// # Errors
/// [`Error::Request`](curvelax_base::error::Error::Request) if it cannot be reached, and
/// [`Error::Interrupted`](curvelax_base::error::Error::Interrupted) or [`Error::Stopped`](curvelax_base::error::Error::Stopped) if asked to stop.
pub fn planned(spec: Spec, manner: Option<&Manner>, host: &dyn Host) -> Result<Spec> {
    let stopped = || {
        if let Err(error) = host.go_on() {
            return Some(error);
        }
        let (cause, _) = manner?.stop.asked()?;
        Some(cause.error(" in the rounds of --accuracy, before the run began: nothing is saved"))
    };
    accuracy::plan(spec, |round| host.say(&round.to_string()), stopped)
}

/// Runs `work` in the folder at `out`.
///
/// # Errors
/// Those of the folder, the device and the run.
pub fn begin(mut work: Work, out: &Path, existing: Existing, manner: Manner, host: &dyn Host) -> Result<Completed> {
    let folder = OutputFolder::open(out, existing)?;
    let platform = work.open(host)?;
    let origin = Origin::new(&work.study, platform)?;
    let report = RunReport::begin(folder, &work.study, origin, manner)?;
    resume::carry_out(work, report, Standing::default(), host)
}
