//! A member's run: steps, acceptance, status and relaxation events. Twin of `shaders/evolve.wgsl`.
//!
//! Members of a [`Group`] run side by side, one per lane of a number: they run the same instructions, and every
//! decision is made for each of them. With a plain `f64` this is one member alone, the reference. A member does not
//! depend on the others, to the last bit.

use super::{
    Branches, Parameters, State, Status, Workspace, decay, extrapolation,
    member::{Counters, NEVER},
    observe::{self, Glance},
    pace::{self, Stride},
    run::{Run, Taken},
    start::Start,
    state::{self, STATE_FIELDS},
    step::{self, Method, Stepped},
};
use crate::{
    number::{Mask, Number, Real},
    solver::{Blocks, Solves, by_solver},
};

/// Members that take the same branches of the scheme, and so can run side by side.
pub struct Group<'a, 'b, T> {
    runs: &'a mut [&'b mut Run<T>],
    branches: Branches,
}

impl<'a, 'b, T: Real> Group<'a, 'b, T> {
    /// Sorts members into groups of at most `most`.
    pub fn of(runs: &'a mut [&'b mut Run<T>], most: usize) -> Vec<Group<'a, 'b, T>> {
        let branches = |run: &Run<T>| run.parameters.branches();
        runs.sort_by_key(|run| branches(run));
        let alike = runs.chunk_by_mut(|one, other| branches(one) == branches(other));
        let groups = alike.flat_map(|alike| alike.chunks_mut(most));
        groups.map(|runs| Group { branches: branches(runs[0]), runs }).collect()
    }
}

/// Members side by side, one per lane.
pub struct Team<N: Number> {
    state: State<N>,
    parameters: Parameters<N>,
    /// Excess of `state.curve`.
    excess: N,
    /// Turning number at the start.
    turning: N,
    strides: Vec<Stride<N::Real>>,
    work: Workspace<N>,
}

/// Result of an attempted step.
struct Attempt<N: Number> {
    stepped: Stepped<N>,
    /// Error of an adaptive step; 0 for a fixed one.
    error: N,
    /// Excess in the middle of an adaptive step.
    middle: N,
    seen: Glance<N>,
    excess: N,
}

/// Advances a running member by at most `attempts` steps towards its goal, including refused ones.
///
/// A fixed step that fails (stalled, not finite, singular) ends the member in its last good state. An adaptive step is
/// retried with a shorter length until that is too short to mean anything. A step that is too inaccurate at every
/// length follows a curve that n nodes do not resolve; this counts as singular.
pub fn evolve<T: Real>(run: &mut Run<T>, method: &Method, team: &mut Team<T>, attempts: u32) {
    let branches = run.parameters.branches();
    let alone = Group { runs: &mut [run], branches };
    by_solver!(method.solver, S => evolve_abreast::<T, S>(alone, method, team, attempts))
}

/// Advances a group of at most as many members as there are lanes by the solver `S`. Returns early when less than half
/// of them are still running, since the others would pay for idle lanes.
#[inline(always)]
pub fn evolve_abreast<N: Number, S: Solves>(group: Group<N::Real>, method: &Method, team: &mut Team<N>, attempts: u32) {
    let Group { runs, branches } = group;
    let adaptive = branches.adaptive;
    let mut live = N::Mask::all_of(false);
    let mut running = 0;
    for (lane, run) in runs.iter_mut().enumerate() {
        run.counters.sweeps_k = 0;
        run.counters.sweeps_x = 0;
        let runs = run.counters.is_running();
        live.set_lane(lane, runs);
        running += usize::from(runs);
    }
    let Some(first) = runs.iter().position(|run| run.counters.is_running()) else { return };
    for lane in 0..N::LANES {
        // A lane without a member copies the first one.
        team.take_in(lane, if live.lane(lane) { &*runs[lane] } else { &*runs[first] });
    }
    let enough = running.div_ceil(2);
    for made in 1..=attempts {
        let attempt = team.attempt::<S>(runs, live, branches, method);
        team.conclude::<S>(runs, live, adaptive, &attempt);
        let all_leave = made == attempts || runs.iter().filter(|run| run.counters.is_running()).count() < enough;
        for lane in 0..runs.len() {
            if live.lane(lane) && (all_leave || !runs[lane].counters.is_running()) {
                team.let_out(lane, runs[lane], adaptive);
                live.set_lane(lane, false);
            }
        }
        if all_leave {
            return;
        }
    }
}

impl<N: Number> Team<N> {
    /// Allocates room for members whose rings are cut by `blocks`, whatever the solver.
    pub fn new(blocks: Blocks) -> Team<N> {
        Team::with(Workspace::new(blocks))
    }

    /// Allocates room to advance members by the solver `S`.
    pub fn for_solver<S: Solves>(blocks: Blocks) -> Team<N> {
        Team::with(Workspace::for_solver::<S>(blocks))
    }

    /// Returns the approximate bytes of [`Team::for_solver`] for rings of `n` nodes.
    pub fn bytes<S: Solves>(n: usize) -> usize {
        (STATE_FIELDS + Workspace::<N>::numbers::<S>()) * n * size_of::<N>()
    }

    fn with(work: Workspace<N>) -> Team<N> {
        let stride = Stride { length: N::Real::of(0.0), high: N::Real::of(0.0), low: N::Real::of(0.0), last: false };
        Team {
            state: State::zeros(work.blocks.n),
            parameters: Parameters::default(),
            excess: N::default(),
            turning: N::default(),
            strides: vec![stride; N::LANES],
            work,
        }
    }

    /// Copies a member into a lane.
    #[inline(always)]
    fn take_in(&mut self, lane: usize, run: &Run<N::Real>) {
        let from = run.state.fields();
        for (to, from) in self.state.fields_mut().into_iter().zip(from).take(state::NEEDED_FIELDS) {
            for i in 0..from.len() {
                to[i].set_lane(lane, from[i]);
            }
            to.close();
        }
        self.parameters.set_lane(lane, &run.parameters);
        self.excess.set_lane(lane, run.report.now.excess);
        self.turning.set_lane(lane, run.report.progress.turning);
    }

    /// Copies a member back from its lane, with its report.
    #[inline(always)]
    fn let_out(&self, lane: usize, run: &mut Run<N::Real>, adaptive: bool) {
        for (from, to) in self.state.fields().into_iter().zip(run.state.fields_mut()) {
            for i in 0..from.len() {
                to[i] = from[i].lane(lane);
            }
            to.close();
        }
        run.report_on(self.work.blocks, adaptive);
    }

    /// Makes a fixed step, or the three steps of an adaptive one, in all lanes.
    ///
    /// The step is called in one place only, since its whole body is inlined there.
    #[inline(always)]
    fn attempt<S: Solves>(
        &mut self,
        runs: &mut [&mut Run<N::Real>],
        live: N::Mask,
        branches: Branches,
        method: &Method,
    ) -> Attempt<N> {
        let adaptive = branches.adaptive;
        let Team { state, parameters, excess, strides, work, .. } = self;
        let mut h = parameters.tau;
        if adaptive {
            for (lane, run) in runs.iter().enumerate() {
                strides[lane] = pace::stride(&run.report.progress, &run.parameters);
                h.set_lane(lane, strides[lane].length);
            }
        }
        let half = N::of(0.5);
        let mut ok = live;
        let none = N::of(0.0);
        let mut all = Stepped { sweeps_k: none, sweeps_x: none, solved: live, finite: live };
        for part in 0..if adaptive { 3 } else { 1 } {
            parameters.tau = if part == 0 { h } else { half * h };
            let from = if part == 2 { &state.before } else { &state.curve };
            let stepped = step::step_by::<N, S>(from, &mut state.increments, parameters, branches, ok, method, work);
            // An earlier failure determines the cause; its lane makes no more sweeps.
            all.finite = all.finite.and(stepped.finite.or(ok.not()));
            all.solved = all.solved.and(stepped.solved.or(ok.not()));
            all.sweeps_k += N::select(ok, stepped.sweeps_k, none);
            all.sweeps_x += N::select(ok, stepped.sweeps_x, none);
            ok = all.finite.and(all.solved);
            if !ok.any() {
                break;
            }
            if adaptive && part < 2 {
                let kept = if part == 0 { &mut state.middle } else { &mut state.before };
                std::mem::swap(kept, &mut work.new);
                if S::FACTS.sweeps {
                    Start::after_part(part).put(&mut state.increments, &mut state.earlier);
                }
            }
        }
        parameters.tau = h;
        let (mut error, mut middle) = (none, none);
        if adaptive {
            let followed = excess.le(parameters.follow_to).not();
            error = extrapolation::error_of_attempt(&state.middle, &work.new, followed);
            extrapolation::extrapolate(&mut state.middle, &state.before, &mut work.new);
            let sums = observe::sums(&state.middle, parameters, work.blocks);
            middle = observe::excess(sums.length, sums.area, parameters);
        }
        let seen = observe::glance(&state.curve, &work.new, work.blocks);
        let excess = observe::excess(seen.length, seen.area, parameters);
        Attempt { stepped: all, error, middle, seen, excess }
    }

    /// Decides for every member whether to accept the step, and records its results.
    #[inline(always)]
    fn conclude<S: Solves>(
        &mut self,
        runs: &mut [&mut Run<N::Real>],
        live: N::Mask,
        adaptive: bool,
        attempt: &Attempt<N>,
    ) {
        let n = self.work.blocks.n;
        let gap = self.gap_at_threshold(runs, live, attempt.excess);
        let exact = attempt.error.le(self.parameters.adaptive);
        let (finite, singular) =
            (attempt.seen.is_finite(), attempt.seen.is_singular(self.turning, &self.parameters, n));
        let mut kept = N::Mask::all_of(false);
        let mut start = Start::after_fixed();
        for (lane, run) in runs.iter_mut().enumerate() {
            if !live.lane(lane) {
                continue;
            }
            count_sweeps(&mut run.counters, &attempt.stepped, lane);
            let (stride, error) = (self.strides[lane], attempt.error.lane(lane));
            let of_solves = failure_of_solves(&attempt.stepped, lane);
            let failure = of_solves.or(failure_of_curve(finite.lane(lane), singular.lane(lane)));
            if adaptive && of_solves.is_none() && !exact.lane(lane) {
                kept.set_lane(lane, true);
                start.set_lane(lane, refuse_inaccurate(run, n, stride.length, error));
            } else if let Some(cause) = failure {
                kept.set_lane(lane, true);
                if adaptive {
                    start.set_lane(lane, refuse_failure(run, n, stride.length, cause));
                } else {
                    run.counters.status = cause as u32;
                }
            } else {
                let taken = Taken {
                    h: if adaptive { stride.length } else { N::Real::of(0.0) },
                    before: self.excess.lane(lane),
                    middle: attempt.middle.lane(lane),
                    after: attempt.excess.lane(lane),
                    gap: gap.lane(lane),
                };
                record_events(run, &taken);
                decay::follow(run, &taken);
                if adaptive {
                    start.set_lane(lane, lengthen(run, stride, error));
                }
                accepted(run, taken.after, &attempt.seen, lane, adaptive);
            }
        }
        if S::FACTS.sweeps {
            start.put(&mut self.state.increments, &mut self.state.earlier);
        }
        self.accept(kept, attempt.excess);
    }

    /// The gap between k and the polygon of the new curves, if one of them may have relaxed. It costs a fifth of a
    /// direct step, and is computed once.
    #[inline(always)]
    fn gap_at_threshold(&self, runs: &[&mut Run<N::Real>], live: N::Mask, excess: N) -> N {
        let mut waiting = N::Mask::all_of(false);
        for (lane, run) in runs.iter().enumerate() {
            waiting.set_lane(lane, run.counters.relax_step == NEVER);
        }
        let at_threshold = excess.le(self.parameters.relax_at).and(live).and(waiting);
        if at_threshold.any() { observe::gap(&self.work.new) } else { N::of(0.0) }
    }

    /// Accepts the new curves, except in the lanes that keep theirs.
    #[inline(always)]
    fn accept(&mut self, kept: N::Mask, excess: N) {
        let Team { state, work, .. } = self;
        if kept.any() {
            work.new.put(kept, &state.curve);
        }
        self.excess = N::select(kept, self.excess, excess);
        std::mem::swap(&mut state.before, &mut state.curve);
        std::mem::swap(&mut state.curve, &mut work.new);
    }
}

#[inline(always)]
fn count_sweeps<N: Number>(counters: &mut Counters, stepped: &Stepped<N>, lane: usize) {
    counters.sweeps_k = counters.sweeps_k.saturating_add(stepped.sweeps_k.lane(lane).to_f64() as u32);
    counters.sweeps_x = counters.sweeps_x.saturating_add(stepped.sweeps_x.lane(lane).to_f64() as u32);
}

/// The failure of the solves of a step, if any.
#[inline(always)]
fn failure_of_solves<N: Number>(stepped: &Stepped<N>, lane: usize) -> Option<Status> {
    match (stepped.finite.lane(lane), stepped.solved.lane(lane)) {
        (false, _) => Some(Status::Nonfinite),
        (true, false) => Some(Status::Stalled),
        (true, true) => None,
    }
}

/// The failure of a curve after a solved step, if any.
fn failure_of_curve(finite: bool, singular: bool) -> Option<Status> {
    match (finite, singular) {
        (false, _) => Some(Status::Nonfinite),
        (true, true) => Some(Status::Singular),
        (true, false) => None,
    }
}

/// Retries with a step of length `next`, or ends the member for `cause` if that is below `least` of `(L/n)⁴`.
fn refuse<T: Real>(run: &mut Run<T>, n: usize, next: T, least: f64, cause: Status) {
    run.counters.rejected += 1;
    run.counters.refused = 1;
    run.report.progress.next = next;
    let least = pace::least_step(run.report.now.length, T::of(n as f64), least, &run.parameters);
    if !least.le(next) {
        run.counters.status = cause as u32;
    }
}

/// Refuses a step of length h that failed outright; its increments may then be anything.
fn refuse_failure<T: Real>(run: &mut Run<T>, n: usize, h: T, cause: Status) -> Start<T> {
    let least = if cause == Status::Singular { pace::MIN_TO_SINGULAR } else { pace::MIN_STEP };
    refuse(run, n, T::of(pace::MIN_GROWTH) * h, least, cause);
    Start::nowhere()
}

/// Refuses a step of length h whose error is too large.
fn refuse_inaccurate<T: Real>(run: &mut Run<T>, n: usize, h: T, error: T) -> Start<T> {
    let next = pace::next_length(h, error, 1.0, &run.parameters);
    refuse(run, n, next, pace::MIN_STEP, Status::Singular);
    Start::after_refused(next / (T::of(0.5) * h))
}

/// Records the steps in which the excess falls to half its start and to the relaxation threshold, and where inside
/// them. A curve whose curvature is not that of its polygon does not count as relaxed.
fn record_events<T: Real>(run: &mut Run<T>, taken: &Taken<T>) {
    let Run { report, counters, parameters: p, .. } = run;
    let progress = &mut report.progress;
    if counters.half_step == NEVER && taken.after.le(p.half_at) {
        counters.half_step = counters.steps;
        (progress.half_high, progress.half_low) = (progress.time_high, progress.time_low);
        (progress.half_length, progress.half_fraction) = (taken.h, fraction_at(taken, p.half_at, p));
    }
    let due = counters.relax_step == NEVER && taken.after.le(p.relax_at);
    if due && taken.gap.le(T::of(observe::MAX_GAP)) {
        counters.relax_step = counters.steps;
        (progress.relax_high, progress.relax_low) = (progress.time_high, progress.time_low);
        (progress.relax_length, progress.relax_fraction) = (taken.h, fraction_at(taken, p.relax_at, p));
    }
}

/// Where in the last step the excess fell to `excess`; at its end if it already had before.
fn fraction_at<T: Real>(&Taken { before, middle, after, .. }: &Taken<T>, excess: T, p: &Parameters<T>) -> T {
    if before.le(excess) {
        T::of(1.0)
    } else if p.adaptive.le(T::of(0.0)) {
        (before - excess) / (before - after)
    } else {
        extrapolation::crossing(before, middle, after, excess)
    }
}

/// Advances the clock by an accepted adaptive step, and chooses the length of the next one.
fn lengthen<T: Real>(run: &mut Run<T>, stride: Stride<T>, error: T) -> Start<T> {
    let Run { parameters, counters, report, .. } = run;
    let progress = &mut report.progress;
    let most_growth = if counters.refused == 0 { pace::MAX_GROWTH } else { 1.0 };
    progress.next = pace::next_length(stride.length, error, most_growth, parameters);
    let start = Start::after_taken(progress.next / (T::of(0.5) * stride.length));
    pace::pass_time(progress, stride, parameters);
    counters.refused = 0;
    start
}

/// Counts an accepted step, and decides whether the member continues.
#[inline(always)]
fn accepted<N: Number>(run: &mut Run<N::Real>, excess: N::Real, seen: &Glance<N>, lane: usize, adaptive: bool) {
    let Run { parameters, counters, report, .. } = run;
    let progress = &mut report.progress;
    (report.now.excess, report.now.length) = (excess, seen.length.lane(lane));
    counters.steps += 1;
    progress.travel += seen.farthest.lane(lane);
    if counters.relax_step != NEVER && counters.stop_when_relaxed != 0 {
        counters.status = Status::Relaxed as u32;
    }
    let concave = N::Real::of(0.0).le(seen.minus_k_min.lane(lane));
    let looked_at = parameters.look_at.le(progress.travel) && concave;
    if looked_at || (adaptive && pace::is_at_goal(progress, parameters)) {
        counters.goal = counters.steps;
    }
}
