//! A member's run on the CPU, with what its bounds depend on.

use super::{device::Left, setup::blocks};
use curvelax_base::error::Result;
use curvelax_flow::scheme::{
    evolve::{Evolves, Team, evolve},
    extrapolation::LEAST_ORDER,
    run::Run,
    step::Method,
};

/// A member's run on the CPU.
pub(super) struct Twin {
    pub(super) left: Left,
    /// Its longest step.
    pub(super) longest: f64,
    /// The largest decrease of the excess in one step.
    pub(super) steepest: f64,
    /// The highest order of a step.
    pub(super) order: u32,
}

/// Runs the twin of `launch` to its goal.
pub(super) fn twin<T: Evolves>(launch: &Run<f64>, method: &Method, n: usize) -> Result<Twin> {
    let mut run: Run<T> = launch.convert();
    let (mut longest, mut steepest, mut order) = (0.0_f64, 0.0_f64, LEAST_ORDER);
    let mut work = Team::new(blocks(n)?);
    while run.counters.is_running() {
        let before = run.report.now.excess.to_f64();
        order = order.max(run.counters.order);
        evolve(&mut run, method, &mut work, 1);
        steepest = steepest.max((run.report.now.excess.to_f64() - before).abs());
        longest = longest.max(run.report.progress.taken.to_f64());
    }
    let left = Left { state: run.state.convert(), counters: run.counters, report: run.report.convert() };
    Ok(Twin { left, longest, steepest, order })
}
