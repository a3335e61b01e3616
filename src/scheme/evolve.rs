//! A member's run: steps, acceptance, status and relaxation events. Twin of `shaders/evolve.wgsl`.

use glam::DVec2;

use super::{
    Parameters, State, Status, Workspace,
    observe::{self, Curve, Maxima, Sums},
    parameters::{Counters, NEVER, Report},
    step::{self, Method},
};
use crate::number::{BIG, Real};

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

/// Where a member starts, in f64 whatever the precision of its run.
#[derive(Clone, Debug)]
pub struct Launch {
    /// The n nodes, counter-clockwise, near the origin.
    pub nodes: Vec<DVec2>,
    /// What governs it.
    pub parameters: Parameters<f64>,
    /// Steps to make at first.
    pub goal: u32,
    /// End it when it is relaxed.
    pub stop_when_relaxed: bool,
    /// Excess of the nodes.
    pub excess: f64,
    /// Turning number of the nodes.
    pub turning: i32,
}

impl<T: Real> Run<T> {
    /// A member at its start, rounded to the precision of the run.
    pub fn new(launch: &Launch) -> Run<T> {
        let parameters: Vec<T> = launch.parameters.to_numbers().into_iter().map(T::of).collect();
        Run {
            state: State::from_nodes(&launch.nodes),
            parameters: Parameters::from_numbers(&parameters),
            counters: Counters {
                goal: launch.goal,
                stop_when_relaxed: launch.stop_when_relaxed.into(),
                relax_step: NEVER,
                half_step: NEVER,
                ..Counters::default()
            },
            report: Report {
                excess: T::of(launch.excess),
                turning: T::of(f64::from(launch.turning)),
                ..Report::default()
            },
        }
    }
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
        run.counters.sweeps_k = run.counters.sweeps_k.saturating_add(stepped.sweeps_k.to_f64() as u32);
        run.counters.sweeps_x = run.counters.sweeps_x.saturating_add(stepped.sweeps_x.to_f64() as u32);
        let new = Curve { x: &work.x, y: &work.y, k: &work.k, r: &work.r };
        let sums = observe::sums(new, &run.parameters, work.blocks);
        let maxima = observe::maxima(new);
        let failure = if !stepped.finite {
            Some(Status::Nonfinite)
        } else if !stepped.solved {
            Some(Status::Stalled)
        } else if !is_finite(&sums) {
            Some(Status::Nonfinite)
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
        run.report.observe(&sums, &maxima);
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
    let measured = maxima.drift.le(T::of(observe::MAX_DRIFT));
    !(resolved && apart && measured && sums.turning == turning)
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
