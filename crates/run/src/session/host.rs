//! The caller of a run.

use crate::report::{ReportOptions, ResultFormat, Stop};
use curvelax_base::error::Result;

/// The caller of a run: a user at a command line, or a program.
pub trait Host {
    /// Receives a line about the run: `note: …`, `warning: …`, or what happens now.
    fn say(&self, line: &str);
    /// The form of the text at the end.
    fn form(&self) -> ResultFormat;
    /// Makes a run stoppable from now on.
    ///
    /// # Errors
    /// If the system has no means for it.
    fn options(&self) -> Result<ReportOptions>;
    /// The options of a run that `stop` stops.
    fn options_with(&self, stop: Stop) -> ReportOptions;
    /// Asked several times a second while a run is prepared; an error ends it.
    ///
    /// # Errors
    /// [`Error::Interrupted`](curvelax_base::error::Error::Interrupted) or the like, if the host wants no run any more.
    fn may_continue(&self) -> Result<()> {
        Ok(())
    }
}
