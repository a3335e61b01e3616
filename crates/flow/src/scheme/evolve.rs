//! A member's run: steps, acceptance, status and relaxation events. Twin of `shaders/evolve.wgsl`.
//!
//! Members of a [`Group`] run side by side, one per lane of a number: they run the same instructions, and every
//! decision is made for each of them. With a plain `f64` this is one member alone, the reference. A member does not
//! depend on the others, to the last bit.

use super::{
    Branches, Parameters, State, Status, Workspace, decay,
    dense::{Arc, Fall, LOOKS, RESOLVED, Taken},
    excess,
    extrapolation::{self, AllShares, SHARED_PARTS},
    forcing,
    member::{Counters, NEVER, Observed},
    observe::{self, Glance},
    pace::{self, Allowed, Stride},
    run::{Group, Run},
    start,
    state::{self, CURVE_FIELDS, INCREMENT_FIELDS, LASTING_FIELDS, STATE_FIELDS},
    step::{self, Method, Stepped, Steps},
};
use crate::{
    number::{Mask, Number, Real, ln_ratio},
    solver::{Blocks, Solves, by_solver},
};

/// Members side by side, one per lane.
pub struct Team<N: Number> {
    state: State<N>,
    parameters: Parameters<N>,
    /// Excess of `state.curve`.
    excess: N,
    /// Turning number at the start.
    turning: N,
    strides: Vec<Stride<N::Real>>,
    shares: AllShares<N::Real>,
    work: Workspace<N>,
}

/// Result of an attempted step.
struct Attempt<N: Number> {
    stepped: Stepped<N>,
    /// Errors of an adaptive step, of its order and of the one below; 0 for a fixed one.
    errors: [N; 2],
    /// First and second derivative of ln excess at the end of an adaptive step.
    decline: [N; 2],
    seen: Glance<N>,
}

/// A number for which members are advanced, compiled here and not again in every crate that runs members.
pub trait Evolves: Steps {
    /// Advances a running member by at most `attempts` steps towards its goal, including refused ones.
    ///
    /// A fixed step that fails (stalled, not finite, singular) ends the member in its last good state. An adaptive step
    /// is retried with a shorter length until that is too short to mean anything. A step that is too inaccurate at
    /// every length follows a curve that n nodes do not resolve; this counts as singular.
    fn evolve(run: &mut Run<Self>, method: &Method, team: &mut Team<Self>, attempts: u32);
}

macro_rules! evolves {
    ($($real:ident)*) => {
        $(
            impl Evolves for $real {
                fn evolve(run: &mut Run<$real>, method: &Method, team: &mut Team<$real>, attempts: u32) {
                    let branches = run.parameters.branches();
                    let alone = Group { runs: &mut [run], branches };
                    by_solver!(method.solver, S => evolve_abreast::<$real, S>(alone, method, team, attempts));
                }
            }
        )*
    };
}

evolves!(f64 f32);

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
        team.conclude::<S>(runs, live, branches, method.most_order, &attempt);
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
        Team {
            state: State::zeros(work.blocks.n),
            parameters: Parameters::default(),
            excess: N::default(),
            turning: N::default(),
            strides: vec![Stride::default(); N::LANES],
            shares: AllShares::computed(),
            work,
        }
    }

    /// Copies a member into a lane.
    #[inline(always)]
    fn take_in(&mut self, lane: usize, run: &Run<N::Real>) {
        let from = run.state.fields();
        for (to, from) in self.state.fields_mut().zip(from).take(state::NEEDED_FIELDS) {
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
        let fields = self.state.fields().zip(run.state.fields_mut()).take(LASTING_FIELDS);
        for (field, (from, to)) in fields.enumerate() {
            // An adaptive step begins without increments; those of its last row depend on the orders of other lanes.
            if adaptive && (CURVE_FIELDS..CURVE_FIELDS + INCREMENT_FIELDS).contains(&field) {
                continue;
            }
            for i in 0..from.len() {
                to[i] = from[i].lane(lane);
            }
            to.close();
        }
        run.report_on(self.work.blocks);
    }

    /// Makes a fixed step, or the parts of an adaptive one, in all lanes.
    #[inline(always)]
    fn attempt<S: Solves>(
        &mut self,
        runs: &mut [&mut Run<N::Real>],
        live: N::Mask,
        branches: Branches,
        method: &Method,
    ) -> Attempt<N> {
        let (h, orders, most) = self.strides(runs, live, branches.adaptive);
        let stepped = self.make_parts::<S>(runs, live, branches, method, [h, orders], most);
        let Team { state, parameters, work, .. } = self;
        let (mut errors, mut decline) = ([N::of(0.0); 2], [N::of(0.0); 2]);
        if branches.adaptive {
            extrapolation::finish_attempt(state, &mut work.new);
            let (old, by) = (state.curve.nodes(), state.before.nodes());
            let (law, blocks) = (branches.law, work.blocks);
            forcing::correct(old, by, &mut work.new, parameters, law, blocks, &mut work.gradients);
        }
        let seen = observe::glance(&state.curve, &work.new, parameters, branches.law, work.blocks);
        if branches.adaptive {
            let followed = self.excess.le(parameters.follow_to).not();
            let (gaps, blocks) = (&state.gaps, work.blocks);
            errors =
                extrapolation::errors_of_attempt(gaps, &work.new, seen.length, followed, parameters, branches, blocks);
            let (slope, bend) = (&state.slope_before, &state.bend_before);
            decline = observe::decline(&work.new, slope, bend, &seen, parameters, branches.law, work.blocks);
        }
        Attempt { stepped, errors, decline, seen }
    }

    /// The lengths of the next steps, their orders and the highest one.
    #[inline(always)]
    fn strides(&mut self, runs: &[&mut Run<N::Real>], live: N::Mask, adaptive: bool) -> (N, N, u32) {
        let (mut h, mut orders, mut most) = (self.parameters.tau, N::of(1.0), 1);
        if adaptive {
            for (lane, run) in runs.iter().enumerate() {
                self.strides[lane] = pace::stride(&run.report.progress, &run.parameters);
                h.set_lane(lane, self.strides[lane].length);
                orders.set_lane(lane, N::Real::of(f64::from(run.counters.order)));
                if N::IS_SHORT {
                    let (length, n) = (run.report.now.length, N::Real::of(self.work.blocks.n as f64));
                    let refinements = pace::refinements(self.strides[lane].length, length, n);
                    self.work.refinements.set_lane(lane, N::Real::of(f64::from(refinements)));
                }
                if live.lane(lane) {
                    most = run.counters.order.max(most);
                }
            }
        }
        (h, orders, most)
    }

    /// Makes the parts of steps of length h, row by row. Lanes of a lower order, and lanes that have failed, stand by.
    ///
    /// The step is called in one place only, since its whole body is inlined there.
    #[inline(always)]
    fn make_parts<S: Solves>(
        &mut self,
        runs: &[&mut Run<N::Real>],
        live: N::Mask,
        branches: Branches,
        method: &Method,
        [h, orders]: [N; 2],
        most: u32,
    ) -> Stepped<N> {
        let Team { state, parameters, work, shares, .. } = self;
        let none = N::of(0.0);
        let mut all = Stepped { sweeps_k: none, sweeps_x: none, solved: live, finite: live };
        let mut ok = live;
        if branches.adaptive {
            extrapolation::begin_attempt(state, branches);
        }
        for row in 1..=most {
            let busy = ok.and(N::of(f64::from(row)).le(orders));
            let parts = if branches.adaptive { extrapolation::divisions::<N::Real>(row) } else { 1 };
            parameters.tau = h / N::of(f64::from(parts));
            for part in 1..=parts {
                let busy = busy.and(ok);
                if branches.adaptive && S::FACTS.sweeps {
                    start_part(state, runs, parameters.tau, part);
                }
                let from = if part == 1 { &state.curve } else { &state.part };
                let stepped =
                    step::step_by::<N, S>(from, &mut state.increments, parameters, branches, busy, method, work);
                // An earlier failure determines the cause; its lane makes no more sweeps.
                all.finite = all.finite.and(stepped.finite.or(busy.not()));
                all.solved = all.solved.and(stepped.solved.or(busy.not()));
                all.sweeps_k += N::select(busy, stepped.sweeps_k, none);
                all.sweeps_x += N::select(busy, stepped.sweeps_x, none);
                ok = all.finite.and(all.solved);
                if branches.adaptive && ok.any() {
                    let left = parts - part;
                    if left < SHARED_PARTS {
                        let shares = shares.in_lanes(runs, row, left);
                        extrapolation::add_part(state, &work.new, left, &shares, busy, branches);
                    }
                    std::mem::swap(&mut state.part, &mut work.new);
                }
            }
            if !ok.any() {
                break;
            }
        }
        parameters.tau = h;
        all
    }

    /// Decides for every member whether to accept the step, and records its results.
    #[inline(always)]
    fn conclude<S: Solves>(
        &mut self,
        runs: &mut [&mut Run<N::Real>],
        live: N::Mask,
        branches: Branches,
        most_order: u32,
        attempt: &Attempt<N>,
    ) {
        let (n, adaptive) = (self.work.blocks.n, branches.adaptive);
        let [at_level, passed] =
            if branches.watched { self.at_levels(runs, branches) } else { [N::Mask::all_of(false); 2] };
        let gap = self.gap_at_threshold(runs, live, attempt.seen.excess, adaptive);
        let (finite, singular) =
            (attempt.seen.is_finite(), attempt.seen.is_singular(self.turning, &self.parameters, n));
        let mut kept = N::Mask::all_of(false);
        for (lane, run) in runs.iter_mut().enumerate() {
            if !live.lane(lane) {
                continue;
            }
            count_sweeps(&mut run.counters, &attempt.stepped, lane);
            let (stride, errors) = (self.strides[lane], attempt.errors.map(|error| error.lane(lane)));
            run.counters.solves += if adaptive { extrapolation::parts::<N::Real>(run.counters.order) } else { 1 };
            let Stepped { solved, finite: solves_finite, .. } = attempt.stepped;
            let of_solves = failure(solves_finite.lane(lane), solved.lane(lane), Status::Stalled);
            let failure = of_solves.or(failure(finite.lane(lane), !singular.lane(lane), Status::Singular));
            let length = run.report.now.length;
            let allowed = adaptive.then(|| Allowed {
                error: pace::allowed(
                    stride.length,
                    length,
                    N::Real::of(n as f64),
                    &run.parameters,
                    branches.is_refined::<N>(),
                ),
                order: most_order,
            });
            if let Some(allowed) = allowed
                && of_solves.is_none()
                && !errors[0].le(allowed.error)
            {
                kept.set_lane(lane, true);
                refuse_inaccurate(run, n, stride.length, errors, allowed);
            } else if let Some(cause) = failure {
                kept.set_lane(lane, true);
                if adaptive {
                    refuse_failure(run, n, stride.length, cause);
                } else {
                    run.counters.status = cause as u32;
                }
            } else {
                let excess = [self.excess.lane(lane), attempt.seen.excess.lane(lane)];
                let decline = attempt.decline.map(|of| of.lane(lane));
                let taken = taken(run, stride, excess, decline, gap.lane(lane), adaptive);
                record_events(run, &taken, adaptive);
                decay::follow(run, &taken);
                if let Some(allowed) = allowed {
                    lengthen(run, n, stride, errors, decline, allowed);
                    aim_at_relaxation(run, taken.before, taken.after);
                }
                accepted(run, taken.after, &attempt.seen, lane, adaptive);
                run.counters.passed = passed.lane(lane).into();
                if at_level.lane(lane) || passed.lane(lane) {
                    run.counters.goal = run.counters.steps;
                }
            }
        }
        if S::FACTS.sweeps && !adaptive {
            start::after_step(&mut self.state.increments, &mut self.state.earlier);
        }
        self.accept(kept, attempt.seen.excess, adaptive);
    }

    /// The gap between k and the polygon of the new curves, if one of them may have relaxed. It costs a fifth of a
    /// direct step, and is computed a few times.
    #[inline(always)]
    fn gap_at_threshold(&self, runs: &[&mut Run<N::Real>], live: N::Mask, excess: N, adaptive: bool) -> N {
        let mut waiting = N::Mask::all_of(false);
        for (lane, run) in runs.iter().enumerate() {
            waiting.set_lane(lane, run.counters.relax_step == NEVER);
        }
        let near = excess.le(N::of(nearness(adaptive)) * self.parameters.relax_at).and(live).and(waiting);
        if near.any() { observe::gap(&self.work.new) } else { N::of(0.0) }
    }

    /// Where an observable of the new curves has reached a level at which the member pauses, and where one may have
    /// done so inside an adaptive step and left it again.
    #[inline(always)]
    fn at_levels(&mut self, runs: &[&mut Run<N::Real>], branches: Branches) -> [N::Mask; 2] {
        let adaptive = branches.adaptive;
        let Team { state, parameters, strides, work, .. } = self;
        let mut seen = [Observed::default(); 2 + LOOKS.len()];
        let last = seen.len() - 1;
        // In a loop, since the whole body of an observation is inlined.
        for look in if adaptive { 0..=last } else { last..=last } {
            if look != 0 && look != last {
                let mut weights = Arc::default();
                for (lane, run) in runs.iter().enumerate() {
                    let (h, before) = (strides[lane].length, run.report.progress.taken);
                    weights.set_lane(lane, Arc::weights(N::Real::of(LOOKS[look - 1]), h, before));
                }
                weights.look(state, &work.new);
            }
            let curve = match look {
                0 => &state.curve,
                look if look == last => &work.new,
                _ => &state.part,
            };
            let sums = observe::sums(curve, parameters, branches.law, work.blocks);
            seen[look] = observe::observed(&sums, curve, parameters);
        }
        let passed = if adaptive { observe::passes_level(&seen, parameters) } else { N::Mask::all_of(false) };
        [observe::reaches_level(&seen[last], parameters), passed]
    }

    /// Accepts the new curves, except in the lanes that keep theirs.
    #[inline(always)]
    fn accept(&mut self, kept: N::Mask, excess: N, adaptive: bool) {
        let Team { state, work, .. } = self;
        if kept.any() {
            work.new.put(kept, &state.curve);
            if adaptive {
                state.slope_before.put(kept, &state.slope);
                state.bend_before.put(kept, &state.bend);
            }
        }
        self.excess = N::select(kept, self.excess, excess);
        std::mem::swap(&mut state.before, &mut state.curve);
        std::mem::swap(&mut state.curve, &mut work.new);
        if adaptive {
            std::mem::swap(&mut state.slope_before, &mut state.slope);
            std::mem::swap(&mut state.bend_before, &mut state.bend);
        }
    }
}

/// Where the solves of a part of length tau start.
#[inline(always)]
fn start_part<N: Number>(state: &mut State<N>, runs: &[&mut Run<N::Real>], tau: N, part: u32) {
    if part > 1 {
        return start::after_step(&mut state.increments, &mut state.earlier);
    }
    let mut ratio = N::of(0.0);
    for (lane, run) in runs.iter().enumerate() {
        let taken = run.report.progress.taken;
        let never = taken.le(N::Real::of(0.0));
        ratio.set_lane(lane, if never { taken } else { tau.lane(lane) / taken });
    }
    start::begin_row(state, ratio);
}

/// An accepted step.
fn taken<T: Real>(
    run: &Run<T>,
    stride: Stride<T>,
    [before, after]: [T; 2],
    decline: [T; 2],
    gap: T,
    adaptive: bool,
) -> Taken<T> {
    if !adaptive {
        return Taken { h: T::of(0.0), before, after, fall: Fall::Straight, gap };
    }
    let h = stride.length;
    let exact = excess::is_by_polygon::<T>(run.parameters.kind_of_law());
    Taken { h, before, after, fall: Fall::of(&run.report.progress, h, [before, after], decline, exact), gap }
}

#[inline(always)]
fn count_sweeps<N: Number>(counters: &mut Counters, stepped: &Stepped<N>, lane: usize) {
    counters.sweeps_k = counters.sweeps_k.saturating_add(stepped.sweeps_k.lane(lane).to_f64() as u32);
    counters.sweeps_x = counters.sweeps_x.saturating_add(stepped.sweeps_x.lane(lane).to_f64() as u32);
}

/// The failure of solves, or of the curve after them, if any: of what is finite but not `sound` it is `unsound`.
fn failure(finite: bool, sound: bool, unsound: Status) -> Option<Status> {
    match (finite, sound) {
        (false, _) => Some(Status::Nonfinite),
        (true, false) => Some(unsound),
        (true, true) => None,
    }
}

/// Retries with a step of length `next`, or ends the member for `cause` if that is below `least` of `(L/n)⁴`.
fn refuse<T: Real>(run: &mut Run<T>, n: usize, next: T, least: f64, cause: Status) {
    run.counters.rejected += 1;
    run.counters.refused += 1;
    run.report.progress.next = next;
    let least = pace::least_step(run.report.now.length, T::of(n as f64), least, &run.parameters);
    if !least.le(next) {
        run.counters.status = cause as u32;
    }
}

/// Refuses a step of length h that failed outright.
fn refuse_failure<T: Real>(run: &mut Run<T>, n: usize, h: T, cause: Status) {
    // In short numbers a curve that grows creeps towards the end of its coordinates.
    let creeps = cause == Status::Singular || (T::IS_SHORT && cause == Status::Nonfinite);
    let least = if creeps { pace::MIN_TO_SINGULAR } else { pace::MIN_STEP };
    refuse(run, n, T::of(pace::AFTER_FAILURE) * h, least, cause);
}

/// Refuses a step of length h whose error is too large.
fn refuse_inaccurate<T: Real>(run: &mut Run<T>, n: usize, h: T, errors: [T; 2], allowed: Allowed<T>) {
    let most = T::of(if run.counters.refused == 0 { pace::AFTER_REFUSAL } else { pace::AFTER_REFUSALS });
    let (next, order) = pace::choose(h, run.counters.order, errors, most, allowed);
    run.counters.order = order;
    refuse(run, n, next, pace::MIN_STEP, Status::Singular);
}

/// Excess after a step, as a multiple of a threshold, up to which it may have reached the threshold.
fn nearness(adaptive: bool) -> f64 {
    if adaptive { observe::NEAR } else { 1.0 }
}

/// Records the steps in which the excess falls to half its start and to the relaxation threshold, and where inside
/// them. A curve whose curvature is not that of its polygon does not count as relaxed.
fn record_events<T: Real>(run: &mut Run<T>, taken: &Taken<T>, adaptive: bool) {
    let Run { report, counters, parameters: p, .. } = run;
    let progress = &mut report.progress;
    if counters.half_step == NEVER && taken.falls_to(p.half_at) {
        counters.half_step = counters.steps;
        (progress.half_high, progress.half_low) = (progress.time_high, progress.time_low);
        (progress.half_length, progress.half_fraction) = (taken.h, taken.fraction_at(p.half_at));
    }
    let near = counters.relax_step == NEVER && taken.after.le(T::of(nearness(adaptive)) * p.relax_at);
    if near && taken.falls_to(p.relax_at) && taken.gap.le(T::of(observe::MAX_GAP)) {
        counters.relax_step = counters.steps;
        (progress.relax_high, progress.relax_low) = (progress.time_high, progress.time_low);
        (progress.relax_length, progress.relax_fraction) = (taken.h, taken.fraction_at(p.relax_at));
    }
}

/// Advances the clock by an accepted adaptive step, and chooses the length and the order of the next one.
fn lengthen<T: Real>(
    run: &mut Run<T>,
    n: usize,
    stride: Stride<T>,
    errors: [T; 2],
    [slope, bend]: [T; 2],
    allowed: Allowed<T>,
) {
    let Run { parameters, counters, report, .. } = run;
    let progress = &mut report.progress;
    // A step that was shorter than its error allowed tells little of the next one.
    if !pace::is_aimed(progress) {
        let most_growth = T::of(if counters.refused == 0 { pace::MAX_GROWTH } else { 1.0 });
        (progress.next, counters.order) = pace::choose(stride.length, counters.order, errors, most_growth, allowed);
        if T::IS_SHORT {
            progress.next = progress.next.min(pace::longest_step(report.now.length, T::of(n as f64)));
        }
    }
    (progress.slope, progress.bend) = (slope, bend);
    pace::pass_time(progress, stride, parameters);
    counters.refused = 0;
}

/// Aims the next step at the place where the excess, which has fallen from `before` to `excess`, falls to the
/// relaxation threshold, by its slope if that is more than rounding. In short numbers, whose excess has more digits
/// than its slope, otherwise by that fall.
fn aim_at_relaxation<T: Real>(run: &mut Run<T>, before: T, excess: T) {
    let Run { parameters: p, counters, report, .. } = run;
    let progress = &mut report.progress;
    progress.aim = T::of(0.0);
    let by_polygon = excess::is_by_polygon::<T>(p.kind_of_law());
    let resolved = by_polygon || T::of(RESOLVED * T::EPSILON).le((excess * progress.slope).abs());
    let is_ahead = counters.relax_step == NEVER && !excess.le(p.relax_at) && !p.relax_at.le(T::of(0.0));
    if is_ahead && (resolved || T::IS_SHORT) {
        let [slope, bend] =
            if resolved { [progress.slope, progress.bend] } else { [ln_ratio(before, excess), T::of(0.0)] };
        progress.aim = pace::aim(ln_ratio(excess, p.relax_at), slope, bend, progress.taken);
    }
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
