//! A member's run: steps, acceptance, status and relaxation events. Twin of `shaders/evolve.wgsl`.

use super::{
    Curve, Increments, Parameters, State, Status, Workspace, extrapolation,
    observe::{self, Maxima, Sums},
    pace,
    parameters::{Counters, NEVER, Observed, Report},
    step::{self, Method, Stepped},
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
    /// Its report; the excess of the last accepted curve is the start of the next step's events.
    pub report: Report<T>,
}

impl<T: Real> Run<T> {
    /// A member at its start, with no step to make and no events behind it.
    pub fn new(state: State<T>, parameters: Parameters<T>) -> Run<T> {
        let blocks = crate::solver::Blocks::new(state.curve.len()).expect("a ring of 6 nodes or more");
        let sums = observe::sums(&state.curve, &parameters, blocks);
        let now = Observed::new(&sums, &observe::maxima(&state.curve), &parameters);
        let mut report = Report { before: now, middle: now, now, ..Report::default() };
        report.progress.turning = sums.turning;
        let counters = Counters { relax_step: NEVER, half_step: NEVER, ..Counters::default() };
        Run { state, parameters, counters, report }
    }

    /// The same member in another precision, rounded.
    pub fn convert<U: Real>(&self) -> Run<U> {
        Run {
            state: self.state.convert(),
            parameters: self.parameters.convert(),
            counters: self.counters,
            report: self.report.convert(),
        }
    }
}

/// Advances a running member by at most `attempts` steps, refused ones included, towards its goal.
///
/// A fixed step that fails (stalled, not finite, singular) ends the member in its last good state. An adaptive one
/// is tried again with a shorter step, until that is too short to mean anything; one that is too inaccurate at every
/// length follows a curve that n nodes do not resolve, which is singular.
pub fn evolve<T: Real>(run: &mut Run<T>, method: &Method, work: &mut Workspace<T>, attempts: u32) {
    run.counters.sweeps_k = 0;
    run.counters.sweeps_x = 0;
    let adaptive = !run.parameters.adaptive.le(T::of(0.0));
    for _ in 0..attempts {
        if run.counters.status != 0 || run.counters.steps >= run.counters.goal {
            break;
        }
        if adaptive { adaptive_step(run, method, work) } else { fixed_step(run, method, work) }
    }
}

fn fixed_step<T: Real>(run: &mut Run<T>, method: &Method, work: &mut Workspace<T>) {
    let Run { state, parameters, counters, .. } = run;
    let stepped = step::step(&state.curve, &mut state.increments, parameters, method, work);
    counters.sweeps_k = counters.sweeps_k.saturating_add(stepped.sweeps_k.to_f64() as u32);
    counters.sweeps_x = counters.sweeps_x.saturating_add(stepped.sweeps_x.to_f64() as u32);
    match observed(run, work, stepped) {
        Ok((sums, maxima)) => {
            run.report.before = run.report.now;
            run.report.now = Observed::new(&sums, &maxima, &run.parameters);
            record_events(run, T::of(0.0), &work.new);
            accept(run, work);
        }
        Err(status) => run.counters.status = status as u32,
    }
}

fn adaptive_step<T: Real>(run: &mut Run<T>, method: &Method, work: &mut Workspace<T>) {
    let stride = pace::stride(&run.report.progress, &run.parameters);
    let h = stride.length;
    let stepped = extrapolation::attempt(run, method, work, h);
    if !(stepped.finite && stepped.solved) {
        let cause = if stepped.finite { Status::Stalled } else { Status::Nonfinite };
        return refuse_failure(run, work, h, cause);
    }
    let followed = extrapolation::follows(run.report.now.excess, &run.parameters);
    let error = extrapolation::error(&run.state.middle, &work.new, followed);
    if !error.le(run.parameters.adaptive) {
        let next = pace::next_length(h, error, 1.0, &run.parameters);
        run.state.increments.stretch(next / (T::of(0.5) * h));
        return refuse(run, work, next, pace::LEAST_STEP, Status::Singular);
    }
    extrapolation::extrapolate(&mut run.state.middle, &run.state.before, &mut work.new);
    let (sums, maxima) = match observed(run, work, stepped) {
        Ok(observed) => observed,
        Err(cause) => return refuse_failure(run, work, h, cause),
    };
    let middle = &run.state.middle;
    let middle_sums = observe::sums(middle, &run.parameters, work.blocks);
    let report = &mut run.report;
    report.before = report.now;
    report.middle = Observed::new(&middle_sums, &observe::maxima(middle), &run.parameters);
    report.now = Observed::new(&sums, &maxima, &run.parameters);
    record_events(run, h, &work.new);
    let most_growth = if run.counters.refused == 0 { pace::MOST_GROWTH } else { 1.0 };
    let progress = &mut run.report.progress;
    progress.next = pace::next_length(h, error, most_growth, &run.parameters);
    run.state.increments.stretch(progress.next / (T::of(0.5) * h));
    pace::pass(progress, stride, &run.parameters);
    run.counters.refused = 0;
    accept(run, work);
    if pace::at_goal(&run.report.progress, &run.parameters) {
        run.counters.goal = run.counters.steps;
    }
}

/// The sums and maxima of the new curve, or why it is refused.
fn observed<T: Real>(run: &Run<T>, work: &Workspace<T>, stepped: Stepped<T>) -> Result<(Sums<T>, Maxima<T>), Status> {
    let sums = observe::sums(&work.new, &run.parameters, work.blocks);
    let maxima = observe::maxima(&work.new);
    if !stepped.finite {
        Err(Status::Nonfinite)
    } else if !stepped.solved {
        Err(Status::Stalled)
    } else if !is_finite(&sums) {
        Err(Status::Nonfinite)
    } else if is_singular(&sums, &maxima, run, T::of(work.blocks.n as f64)) {
        Err(Status::Singular)
    } else {
        Ok((sums, maxima))
    }
}

fn is_finite<T: Real>(sums: &Sums<T>) -> bool {
    let big = T::of(BIG);
    sums.length.le(big) && sums.area.abs().le(big) && sums.energy.abs().le(big)
}

fn is_singular<T: Real>(sums: &Sums<T>, maxima: &Maxima<T>, run: &Run<T>, n: T) -> bool {
    let mean_edge = sums.length / n;
    let resolved = maxima.turn.le(T::of(observe::MAX_TURN));
    let apart = (T::of(observe::MIN_EDGE) * mean_edge).le(-maxima.minus_shortest);
    let measured = maxima.drift.le(T::of(observe::MAX_DRIFT));
    let extended = run.parameters.least_length.le(sums.length);
    !(resolved && apart && measured && extended && sums.turning == run.report.progress.turning)
}

/// Tries again with a step of length `next`, or gives the member up for `cause` where that is below `least` of `(L/n)⁴`.
fn refuse<T: Real>(run: &mut Run<T>, work: &Workspace<T>, next: T, least: f64, cause: Status) {
    run.counters.rejected += 1;
    run.counters.refused = 1;
    run.report.progress.next = next;
    let least = pace::least_step(run.report.now.length, T::of(work.blocks.n as f64), least, &run.parameters);
    if !least.le(next) {
        run.counters.status = cause as u32;
    }
}

/// Refuses a step of length `h` that failed outright; after that the increments may be anything.
fn refuse_failure<T: Real>(run: &mut Run<T>, work: &Workspace<T>, h: T, cause: Status) {
    run.state.increments = Increments::zeros(work.blocks.n);
    let least = if cause == Status::Singular { pace::LEAST_TO_SINGULAR } else { pace::LEAST_STEP };
    refuse(run, work, T::of(pace::LEAST_GROWTH) * h, least, cause);
}

/// Notes the steps in which the excess falls to half its start and to the relaxation threshold, and where inside them.
/// A curve whose curvature is not that of its polygon does not count as relaxed.
fn record_events<T: Real>(run: &mut Run<T>, length: T, new: &Curve<T>) {
    let Run { report, counters, parameters, .. } = run;
    let excess = report.now.excess;
    let half = fraction_at(report, parameters.half_at, parameters);
    let relaxed = fraction_at(report, parameters.relax_at, parameters);
    let progress = &mut report.progress;
    if counters.half_step == NEVER && excess.le(parameters.half_at) {
        counters.half_step = counters.steps;
        (progress.half_high, progress.half_low) = (progress.time_high, progress.time_low);
        (progress.half_length, progress.half_fraction) = (length, half);
    }
    let due = counters.relax_step == NEVER && excess.le(parameters.relax_at);
    if due && observe::gap(new).le(T::of(observe::MAX_GAP)) {
        counters.relax_step = counters.steps;
        (progress.relax_high, progress.relax_low) = (progress.time_high, progress.time_low);
        (progress.relax_length, progress.relax_fraction) = (length, relaxed);
    }
}

/// Where in the last step the excess fell to `excess`; at its end if it was there before.
fn fraction_at<T: Real>(report: &Report<T>, excess: T, p: &Parameters<T>) -> T {
    let (before, middle, after) = (report.before.excess, report.middle.excess, report.now.excess);
    if before.le(excess) {
        T::of(1.0)
    } else if p.adaptive.le(T::of(0.0)) {
        (before - excess) / (before - after)
    } else {
        extrapolation::crossing(before, middle, after, excess)
    }
}

/// Takes the curve that the step computed.
fn accept<T: Real>(run: &mut Run<T>, work: &mut Workspace<T>) {
    let Run { state, parameters, counters, report } = run;
    report.progress.travel += observe::farthest(&state.curve, &work.new);
    std::mem::swap(&mut state.before, &mut state.curve);
    std::mem::swap(&mut state.curve, &mut work.new);
    counters.steps += 1;
    if counters.relax_step != NEVER && counters.stop_when_relaxed != 0 {
        counters.status = Status::Relaxed as u32;
    }
    if parameters.look_at.le(report.progress.travel) && report.now.k_min.le(T::of(0.0)) {
        counters.goal = counters.steps;
    }
}
