//! A member's run: steps, acceptance, status and relaxation events. Twin of `shaders/evolve.wgsl`.

use super::{
    Parameters, State, Workspace,
    observe::{self, Curve, Maxima, Sums},
    parameters::{Counters, NEVER, Report},
    step::{self, Method},
};
use crate::{
    ensemble::Status,
    number::{BIG, Real},
};

/// One member on its way: everything that a dispatch reads and writes.
#[derive(Clone, Debug)]
pub struct Run<T> {
    /// The curve.
    pub state: State<T>,
    /// What governs it.
    pub parameters: Parameters<T>,
    /// Its counters.
    pub counters: Counters,
    /// Its report; the excess of the last accepted state is the start of the next step's events.
    pub report: Report<T>,
}

/// Advances a running member by at most `steps` steps towards its goal.
///
/// A step that fails (stalled, not finite, singular) is not accepted: the member ends in its last good state.
pub fn evolve<T: Real>(run: &mut Run<T>, method: &Method, work: &mut Workspace<T>, steps: u32) {
    run.counters.sweeps_k = 0;
    run.counters.sweeps_x = 0;
    for _ in 0..steps.min(run.counters.goal - run.counters.steps) {
        if run.counters.status != 0 {
            break;
        }
        let stepped = step::step(&run.state, &run.parameters, method, work);
        run.counters.sweeps_k += stepped.sweeps_k.to_f64() as u32;
        run.counters.sweeps_x += stepped.sweeps_x.to_f64() as u32;
        let new = Curve { x: &work.x, y: &work.y, k: &work.k, r: &work.r };
        let sums = observe::sums(new, &run.parameters, work.blocks);
        let maxima = observe::maxima(new);
        let failure = if !stepped.finite || !is_finite(&sums) {
            Some(Status::Nonfinite)
        } else if !stepped.solved {
            Some(Status::Stalled)
        } else if is_singular(&sums, &maxima, run.report.turning, T::of(work.blocks.n as f64)) {
            Some(Status::Singular)
        } else {
            None
        };
        if let Some(status) = failure {
            run.counters.status = status as u32;
            break;
        }
        step::accept(&mut run.state, work);
        record_events(run, &sums);
        report(run, &sums, &maxima);
        run.counters.steps += 1;
        if run.counters.relax_step != NEVER && run.counters.stop_when_relaxed != 0 {
            run.counters.status = Status::Relaxed as u32;
        }
    }
}

fn is_finite<T: Real>(sums: &Sums<T>) -> bool {
    let big = T::of(BIG);
    sums.length.le(big) && sums.area.abs().le(big) && sums.energy.abs().le(big)
}

fn is_singular<T: Real>(sums: &Sums<T>, maxima: &Maxima<T>, turning: T, n: T) -> bool {
    let mean_edge = sums.length / n;
    let resolved = maxima.turn.le(T::of(observe::MAX_TURN));
    let apart = (T::of(observe::MIN_EDGE) * mean_edge).le(-maxima.minus_shortest);
    !(resolved && apart && sums.turning == turning)
}

/// Notes the steps in which the excess falls to half its start and to the relaxation threshold, and where inside them.
fn record_events<T: Real>(run: &mut Run<T>, sums: &Sums<T>) {
    let (before, after) = (run.report.excess, observe::excess(sums, &run.parameters));
    if run.counters.half_step == NEVER && after.le(run.parameters.half_at) {
        run.counters.half_step = run.counters.steps;
        run.report.half_fraction = (before - run.parameters.half_at) / (before - after);
    }
    if run.counters.relax_step == NEVER && after.le(run.parameters.relax_at) {
        run.counters.relax_step = run.counters.steps;
        run.report.relax_fraction = (before - run.parameters.relax_at) / (before - after);
    }
    run.report.excess = after;
}

fn report<T: Real>(run: &mut Run<T>, sums: &Sums<T>, maxima: &Maxima<T>) {
    let report = &mut run.report;
    report.length = sums.length;
    report.area = sums.area;
    report.energy = sums.energy;
    report.k_min = -maxima.minus_k_min;
    report.k_max = maxima.k_max;
    report.mesh_ratio = maxima.longest / -maxima.minus_shortest;
    report.metric_drift = maxima.drift;
    report.turning = sums.turning;
}
