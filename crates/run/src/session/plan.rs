//! What is to run: a spec in which the rounds of `--accuracy` have made their choices.

use std::path::PathBuf;

use super::{Host, PlacedStudy};
use crate::report::Manner;
use curvelax_base::error::Result;
use curvelax_ensemble::{Outlines, Spec, Study, request::spec::BackendChoice};
use curvelax_study::accuracy;

/// What is to run, not yet checked against this machine.
#[derive(Clone)]
pub struct Plan {
    pub(super) spec: Spec,
    /// The directory to which paths in the spec are relative; empty for the current one.
    pub(super) base: PathBuf,
    /// Outlines that need not be read again.
    pub(super) known: Outlines,
}

impl Plan {
    /// Plans `request`: replaces `accuracy` by the nodes, tolerance and members that reach it, found in rounds that
    /// `manner` may stop.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if it cannot be reached, and
    /// [`Error::Interrupted`](curvelax_base::error::Error::Interrupted) or
    /// [`Error::Stopped`](curvelax_base::error::Error::Stopped) if asked to stop.
    pub fn new(request: Spec, manner: Option<&Manner>, host: &dyn Host) -> Result<Plan> {
        let stopped = || {
            if let Err(error) = host.go_on() {
                return Some(error);
            }
            let (cause, _) = manner?.stop.asked()?;
            Some(cause.error(" in the rounds of --accuracy, before the run began: nothing is saved"))
        };
        let spec = accuracy::plan(request, |round| host.say(&round.to_string()), stopped)?;
        Ok(Plan { spec, base: PathBuf::new(), known: Outlines::default() })
    }

    /// Checks everything that can be wrong with the plan on this machine, and chooses where it is computed.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) for what is wrong.
    pub fn place(self) -> Result<PlacedStudy> {
        let study = Study::new_from(self.spec.clone(), &self.base, &self.known)?;
        PlacedStudy::new(self, study)
    }

    /// The same plan for the CPU, whose precision and tolerance may differ.
    pub fn on_cpu(self, known: Outlines) -> Plan {
        let spec = Spec { backend: BackendChoice::Cpu, adapter: None, ..self.spec };
        Plan { spec, base: self.base, known }
    }
}
