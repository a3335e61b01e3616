//! What is to run, and where: a spec in which the rounds of `--accuracy` have made their choices, checked.

use std::path::PathBuf;

use super::host::Host;
use crate::report::ReportOptions;
use curvelax_backend::{Backend, DeviceKind};
use curvelax_base::error::Result;
use curvelax_ensemble::{Cell, Outlines, Spec, Study, request::spec::BackendChoice};
use curvelax_study::{
    accuracy,
    placement::{self, ChosenBackend, OpeningWatch, Platform},
};

/// A plan that this machine can carry out: the study, with the back end of each stage.
pub struct PlacedStudy {
    /// The spec that it was made from.
    planned: Spec,
    /// The directory to which paths in the spec are relative; empty for the current one.
    base: PathBuf,
    /// The resolved study, with everything that the choices decided.
    pub study: Study,
    /// The back ends of its stages, not yet opened.
    pub choices: Vec<ChosenBackend>,
}

/// The back end of the first cells of a study itself.
pub(super) enum FirstBackend {
    /// Opened when its turn comes, which the host is told of.
    Unopened,
    /// The host was told of it. It opens again at no cost, and would only hold memory while the levels run.
    Announced,
    /// Open.
    Open(Box<dyn Backend>),
}

impl PlacedStudy {
    /// Plans `request`: replaces `accuracy` by the nodes, tolerance and members that reach it, found in rounds that
    /// `options` may stop; and checks everything that can be wrong with it on this machine.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if it cannot be reached, and for what is wrong;
    /// [`Error::Interrupted`](curvelax_base::error::Error::Interrupted) or
    /// [`Error::Stopped`](curvelax_base::error::Error::Stopped) if asked to stop.
    pub fn plan(request: Spec, options: Option<&ReportOptions>, host: &dyn Host) -> Result<PlacedStudy> {
        let stopped = || {
            if let Err(error) = host.may_continue() {
                return Some(error);
            }
            let (cause, _) = options?.stop.asked()?;
            Some(cause.error(" in the rounds of --accuracy, before the run began: nothing is saved"))
        };
        let spec = accuracy::plan(request, |round| host.say(&round.to_string()), stopped)?;
        PlacedStudy::of(spec, PathBuf::new(), &Outlines::default())
    }

    /// Checks a planned spec, whose paths are relative to `base`, and chooses where it is computed. The outlines that
    /// are `known` are not read again.
    pub(super) fn of(planned: Spec, base: PathBuf, known: &Outlines) -> Result<PlacedStudy> {
        let mut study = Study::new_from(planned.clone(), &base, known)?;
        let choices = placement::choose_all(&study)?;
        placement::settle(&mut study, &choices);
        Ok(PlacedStudy { planned, base, study, choices })
    }

    /// Replaces the reason of the choices.
    pub(super) fn because(self, reason: &str) -> PlacedStudy {
        let choices =
            self.choices.into_iter().map(|choice| ChosenBackend { reason: reason.into(), ..choice }).collect();
        PlacedStudy { choices, ..self }
    }

    /// Opens the back end of the first cells of the study itself. If the GPU that was chosen cannot be used, returns
    /// the same plan on the CPU.
    pub(super) fn open(self, host: &dyn Host) -> Result<(PlacedStudy, FirstBackend)> {
        let (cells, choice) = self.first();
        let (backend, platform) = open(cells, choice, host)?;
        if choice.device.kind() != platform.backend {
            host.say(&format!("note: on the CPU instead: {}", platform.reason));
            // Its precision and tolerance may differ.
            let spec = Spec { backend: BackendChoice::Cpu, adapter: None, ..self.planned };
            let on_cpu = PlacedStudy::of(spec, self.base, self.study.outlines())?;
            return Ok((on_cpu.because(&platform.reason), FirstBackend::Announced));
        }
        let first = match platform.backend {
            DeviceKind::Cpu => FirstBackend::Announced,
            _ => FirstBackend::Open(backend),
        };
        Ok((self, first))
    }

    /// The first cells of the study itself, and their back end.
    fn first(&self) -> (&[Cell], &ChosenBackend) {
        let own = self.study.own_stage();
        (&self.study.cells()[self.study.stages()[own].range.clone()], &self.choices[own])
    }

    /// Returns whether the CPU may take over if the GPU fails.
    pub(super) fn may_fall_back(&self) -> bool {
        self.first().1.or_cpu
    }

    /// What the user should know about the study and where it is computed.
    pub fn warnings(&self) -> Vec<String> {
        self.study.warnings().into_iter().chain(self.first().1.warning()).collect()
    }

    /// Where everything is computed, except perhaps the pilot.
    pub(super) fn platform(&self) -> Platform {
        let (cells, choice) = self.first();
        choice.platform(&cells[0].spec)
    }
}

/// Opens the back end chosen for a cohort, and tells the host.
pub(super) fn open(cohort: &[Cell], choice: &ChosenBackend, host: &dyn Host) -> Result<(Box<dyn Backend>, Platform)> {
    choice.open_for(cohort, &OpeningWatch { tell: &|what| host.say(what), may_continue: &|| host.may_continue() })
}
