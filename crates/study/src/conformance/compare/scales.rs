//! The natural scales of a member, relative to which its errors are bounded.

use super::setup::{method, traced_workspace};
use crate::conformance::bounds::NaturalScale;
use curvelax_base::error::Result;
use curvelax_flow::{
    scheme::{Curve, Parameters, Workspace, run::Run, step::Steps},
    solver::Solver,
};

/// Natural scales of one member, from its first step in f64.
pub(super) struct Scales {
    curve: Curve<f64>,
    pub(super) parameters: Parameters<f64>,
    work: Workspace<f64>,
}

impl Scales {
    pub(super) fn of(launch: &Run<f64>) -> Result<Scales> {
        let mut run = launch.clone();
        let mut work = traced_workspace(run.state.curve.len())?;
        let increments = &mut run.state.increments;
        Steps::step(&run.state.curve, increments, &run.parameters, &method(Solver::Direct), &mut work);
        Ok(Scales { curve: run.state.curve, parameters: run.parameters, work })
    }

    /// The amplification of rounding by a solve: the root of the largest weight.
    pub(super) fn stiffness(&self) -> f64 {
        (self.get(NaturalScale::SolvedCurvature) / self.get(NaturalScale::Curvature)).max(1.0)
    }

    pub(super) fn get(&self, scale: NaturalScale) -> f64 {
        scale.of(&self.curve, &self.parameters, &self.work)
    }
}
