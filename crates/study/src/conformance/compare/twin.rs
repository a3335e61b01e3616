//! A member's run on the CPU, with what its bounds depend on.

use super::{device::Left, scales::Scales, setup::blocks};
use curvelax_base::error::Result;
use curvelax_flow::{
    number::{Real, ln_ratio},
    scheme::{
        evolve::{Evolves, Team, evolve},
        extrapolation::LEAST_ORDER,
        member::NEVER,
        pace,
        run::Run,
        step::Method,
    },
};

/// Rounding of the first derivative of ln excess over a step, in units of ε over the excess: the weights of the
/// differences amplify it.
const OF_SLOPE: f64 = 1024.0;

/// A member's run on the CPU.
pub(super) struct Twin {
    pub(super) left: Left,
    /// Its longest step.
    pub(super) longest: f64,
    /// The largest decrease of the excess in one step.
    pub(super) steepest: f64,
    /// The largest way of a node in one step.
    pub(super) farthest: f64,
    /// By how much the rounding of its decay may move the end of a step that is aimed at the threshold.
    pub(super) aimed: f64,
    /// The highest order of a step.
    pub(super) order: u32,
}

impl Twin {
    /// The effect of rounding on the length of a step inside the run of `launch`, relative to the longest: that of the
    /// error estimate, and that of the aim; none with fixed steps.
    pub(super) fn estimate(&self, launch: &Run<f64>, scales: &Scales, rounding: f64) -> f64 {
        let tolerance = launch.parameters.adaptive;
        if tolerance == 0.0 {
            return 0.0;
        }
        rounding * scales.stiffness() / tolerance + self.aimed / scales.parameters.tau
    }
}

/// Runs the twin of `launch` to its goal.
pub(super) fn twin<T: Evolves>(launch: &Run<f64>, method: &Method, n: usize) -> Result<Twin> {
    let mut run: Run<T> = launch.convert();
    let (mut longest, mut steepest, mut order) = (0.0_f64, 0.0_f64, LEAST_ORDER);
    let (mut farthest, mut aimed) = (0.0_f64, 0.0_f64);
    let mut work = Team::new(blocks(n)?);
    while run.counters.is_running() {
        let [before, travel] = [run.report.now.excess, run.report.progress.travel].map(T::to_f64);
        order = order.max(run.counters.order);
        evolve(&mut run, method, &mut work, 1);
        steepest = steepest.max((run.report.now.excess.to_f64() - before).abs());
        longest = longest.max(run.report.progress.taken.to_f64());
        farthest = farthest.max(run.report.progress.travel.to_f64() - travel);
        aimed = aimed.max(aim_moves(&run));
    }
    let left = Left { state: run.state.convert(), counters: run.counters, report: run.report.convert() };
    Ok(Twin { left, longest, steepest, farthest, aimed, order })
}

/// By how much rounding may move the end of the next step if it is aimed at the threshold.
fn aim_moves<T: Real>(run: &Run<T>) -> f64 {
    let (progress, excess, relax_at) = (&run.report.progress, run.report.now.excess, run.parameters.relax_at);
    if run.counters.relax_step != NEVER || progress.taken.le(T::of(0.0)) || excess.le(relax_at) {
        return 0.0;
    }
    let aim = pace::aim(ln_ratio(excess, relax_at), progress.slope, progress.bend, progress.taken).to_f64();
    let relative = OF_SLOPE * T::EPSILON / (excess.to_f64() * progress.slope.to_f64().abs());
    if aim == progress.next.to_f64() { aim * relative.min(1.0) } else { 0.0 }
}
