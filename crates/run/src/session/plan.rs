//! What is to run: a spec in which the rounds of `--accuracy` have made their choices.

use std::path::PathBuf;

use super::host::Host;
use crate::report::ReportOptions;
use curvelax_base::error::Result;
use curvelax_ensemble::{Outlines, Spec, request::spec::BackendChoice};
use curvelax_study::accuracy;

/// What is to run, not yet checked against this machine.
#[derive(Clone)]
pub struct RunPlan {
    pub(super) spec: Spec,
    /// The directory to which paths in the spec are relative; empty for the current one.
    pub(super) base: PathBuf,
    /// Outlines that need not be read again.
    pub(super) known: Outlines,
}

impl RunPlan {
    /// Plans `request`: replaces `accuracy` by the nodes, tolerance and members that reach it, found in rounds that
    /// `options` may stop.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if it cannot be reached, and
    /// [`Error::Interrupted`](curvelax_base::error::Error::Interrupted) or
    /// [`Error::Stopped`](curvelax_base::error::Error::Stopped) if asked to stop.
    pub fn new(request: Spec, options: Option<&ReportOptions>, host: &dyn Host) -> Result<RunPlan> {
        let stopped = || {
            if let Err(error) = host.may_continue() {
                return Some(error);
            }
            let (cause, _) = options?.stop.asked()?;
            Some(cause.error(" in the rounds of --accuracy, before the run began: nothing is saved"))
        };
        let spec = accuracy::plan(request, |round| host.say(&round.to_string()), stopped)?;
        Ok(RunPlan { spec, base: PathBuf::new(), known: Outlines::default() })
    }

    /// The same plan for the CPU, whose precision and tolerance may differ.
    pub fn on_cpu(self, known: Outlines) -> RunPlan {
        let spec = Spec { backend: BackendChoice::Cpu, adapter: None, ..self.spec };
        RunPlan { spec, base: self.base, known }
    }
}
