//! One member's way through a run, seen from the host: where it starts, where it pauses next, what it leaves.
//!
//! A member is advanced in units of its own size: lengths are divided by a power of two near its radius and times by
//! the fourth power of that, which rounds nothing, so that no threshold of the scheme and no range of a precision
//! depends on the unit in which a user measures.

use glam::DVec2;

use crate::{
    curve::{clearance, crossing, polygon},
    ensemble::{
        Ended, Member, Observables, Outcome, Paused, Portrait, Rows, SeriesRow, Snapshot, Spec, Status,
        member::{relaxation_rate, strongest_pull},
        spec::{Pace, Precision, Pull, Sor},
    },
    error::{Error, Result},
    schedule::{self, Clock, Output, Outputs, Ticks},
    scheme::{
        Curve, Parameters, State, extrapolation,
        member::{self, Counters, Decay, NEVER, Observed, Report},
        run::Run,
        state::STATE_FIELDS,
    },
    solver::Ring,
};

/// Excess below which a curve is a regular polygon to rounding: such a member is relaxed at time 0.
const ROUND: f64 = 1e-13;
/// An excess is a difference of numbers near 1: below this many ε a threshold lies in its rounding.
const RESOLUTION: f64 = 128.0;
/// A threshold that no excess reaches.
const NO_THRESHOLD: f64 = -1.0;
/// The rate is fitted while the excess is between these fractions of its start. Adaptive steps follow the shape to the
/// end of the fit, or to half the threshold.
const FITTED: [f64; 2] = [1e-3, 1e-1];
/// A fit with fewer points says nothing.
const MIN_POINTS: u32 = 8;
/// A curve that has shrunk to this fraction of its length is gone.
const SHRUNK: f64 = 1e-3;
/// The first adaptive step in units of the fourth power of the shortest segment, the fastest time scale there is.
const FIRST_STEP: f64 = 0.1;
/// `--pull auto`: κ in units of the member's relaxation rate.
const PULL_PER_RATE: f64 = 4.0;
/// Adaptive steps to a tolerance of 1 after which a member is stalled; their number goes with its root. Curves that
/// relax take some 3 to 30; one that creeps, because only tiny steps can be solved, would never end.
const MAX_STEPS: f64 = 1000.0;
/// Steps in a time 1/ω besides: a curve at rest takes one or two, since lengths approach their mean explicitly.
const MAX_STEPS_AT_REST: f64 = 4.0;
/// Shares of a spacing that nodes go at most between two looks at a curve about to cross itself.
const LOOKS_PER_SPACING: f64 = 16.0;
/// Ticks of the clock in the first adaptive step at least.
const FIRST_TICKS: f64 = 16.0;

/// What can be said of the relaxation of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// Its excess is followed to the threshold.
    Followed,
    /// It is at or under the threshold from the start, or a regular polygon.
    Round,
    /// It is so nearly round that its threshold lies in the rounding of the precision.
    Unresolved,
    /// It is no simple curve: whatever its excess, it does not relax to a circle.
    Immersed,
}

/// How the time of a member passes.
#[derive(Clone, Copy, Debug)]
enum Time {
    Fixed(Clock),
    Adaptive(Ticks),
}

impl Time {
    /// The unit of the clock of [`decay`], for a member advanced in lengths of `unit`.
    fn unit(self, unit: f64) -> f64 {
        match self {
            Time::Fixed(clock) => clock.tau,
            Time::Adaptive(_) => unit.powi(4),
        }
    }
}

/// A resident member.
pub struct Trajectory<'a> {
    member: Member,
    /// A power of two near the member's radius: the unit of length in which it is advanced.
    unit: f64,
    t_end: f64,
    time: Time,
    launch: Run<f64>,
    /// Output times, and how many of them are behind the member.
    outputs: &'a Outputs,
    served: usize,
    counters: Counters,
    report: Report<f64>,
    start: Observables,
    rows: Rows,
    /// Times and the nodes that are drawn, in the user's frame.
    frames: Vec<(f64, Vec<DVec2>)>,
    sweeps: [u64; 2],
    course: Course,
    rate_theory: Option<f64>,
    /// When the polygon was first seen to cross itself.
    crossed: Option<f64>,
    portrait: bool,
}

impl<'a> Trajectory<'a> {
    /// A member at its start; serves the output times that are due there.
    pub fn new(member: Member, spec: &Spec, precision: Precision, outputs: &'a Outputs) -> Trajectory<'a> {
        let unit = unit_of(&member.nodes);
        let nodes: Vec<DVec2> = member.nodes.iter().map(|node| *node / unit).collect();
        let mut parameters = parameters(spec, &nodes, unit, spec.tolerance_at(precision));
        let mut launch = Run::new(State::from_nodes(&nodes), parameters);
        let turning = launch.report.progress.turning;
        let start = Observables::new(&launch.report.now, turning, unit);
        let resolution = RESOLUTION * precision.epsilon();
        let limit = spec.threshold(start.excess);
        let course = match limit {
            _ if start.excess <= ROUND => Course::Round,
            _ if turning.abs() != 1.0 => Course::Immersed,
            limit if start.excess <= limit => Course::Round,
            limit if limit < resolution => Course::Unresolved,
            _ => Course::Followed,
        };
        let reachable = course != Course::Immersed && start.excess > ROUND;
        let threshold = |excess: f64| if reachable && excess >= resolution { excess } else { NO_THRESHOLD };
        parameters.relax_at = if course == Course::Followed { limit } else { NO_THRESHOLD };
        parameters.half_at = threshold(0.5 * start.excess);
        parameters.follow_to = (FITTED[0] * start.excess).min(0.5 * limit).max(resolution);
        parameters.fit_from = threshold(FITTED[1] * start.excess);
        parameters.fit_to = (FITTED[0] * start.excess).max(resolution);
        parameters.least_length = SHRUNK * launch.report.now.length;
        let mut status = beyond(&parameters, precision).then_some(Status::Nonfinite);
        let time = match spec.pace() {
            Pace::Fixed(tau) => Time::Fixed(Clock::new(tau, spec.t_end)),
            Pace::Adaptive(tolerance) => {
                let (times, end) = (schedule::times(precision), spec.t_end / unit.powi(4));
                status = status.or(match end {
                    end if end < *times.start() => Some(Status::Nonfinite),
                    end if end > *times.end() => Some(Status::Stalled),
                    _ => None,
                });
                let end = end.clamp(*times.start(), *times.end());
                let ticks = Ticks::new(end, precision);
                parameters.adaptive = tolerance;
                (parameters.time_unit, parameters.time_tick) = (ticks.unit, ticks.tick);
                (parameters.end_high, parameters.end_low) = ticks.split(end);
                let shortest = launch.state.curve.r.nodes().iter().copied().fold(f64::INFINITY, f64::min);
                launch.report.progress.next = (FIRST_STEP * shortest.powi(4)).max(FIRST_TICKS * ticks.tick);
                Time::Adaptive(ticks)
            }
        };
        let clock = time.unit(unit);
        parameters.clock_end = spec.t_end / clock;
        parameters.growth =
            spec.flow.growth(start.area).map_or(0.0, |growth| (growth / clock).min(*schedule::range(precision).end()));
        launch.parameters = parameters;
        launch.counters.stop_when_relaxed = spec.stop_when_relaxed.into();
        let mut trajectory = Trajectory {
            member,
            unit,
            t_end: spec.t_end,
            time,
            outputs,
            served: 0,
            counters: launch.counters,
            report: launch.report,
            launch,
            start,
            rows: Rows::default(),
            frames: Vec::new(),
            sweeps: [0; 2],
            course,
            rate_theory: spec.rate_in_theory(start.area),
            crossed: None,
            portrait: false,
        };
        if course == Course::Round && spec.stop_when_relaxed {
            status = Some(Status::Relaxed);
        }
        trajectory.counters.status = status.map_or(0, |status| status as u32);
        let state = std::mem::replace(&mut trajectory.launch.state, State::zeros(0));
        trajectory.look(&state.curve);
        // At the start one row and one snapshot are due.
        trajectory.serve(Some(&state), usize::MAX);
        trajectory.launch.state = state;
        trajectory
    }

    /// What the back end needs to start the member, or to go on with it. Its state is there from now on, and not here.
    pub fn launch(&mut self) -> Run<f64> {
        let (goal, parameters) = self.aim();
        let state = std::mem::replace(&mut self.launch.state, State::zeros(0));
        let mut run = Run { state, parameters, counters: self.launch.counters, report: self.launch.report };
        if self.needs_aim() {
            run.counters.goal = goal;
        }
        run
    }

    /// The member between two dispatches, with what the back end has of it.
    pub fn pause(&self, counters: Counters, report: Report<f64>, state: &State<f64>) -> Paused {
        Paused {
            counters,
            report,
            state: state.to_numbers(),
            sweeps: self.sweeps,
            served: self.served as u64,
            rows: self.rows.clone(),
            frames: self.frames.clone(),
            crossed: self.crossed,
            look_at: self.launch.parameters.look_at,
        }
    }

    /// Puts a member that has just been made where it was [paused](Trajectory::pause).
    ///
    /// # Errors
    /// [`Error::Request`] where that was not this member.
    pub fn resume_from(&mut self, paused: Paused) -> Result<()> {
        let Paused { counters, report, state, sweeps, served, rows, frames, crossed, look_at } = paused;
        let (index, numbers) = (self.member.index, STATE_FIELDS * self.member.nodes.len());
        let served = usize::try_from(served).unwrap_or(usize::MAX);
        if state.len() != numbers || served > self.outputs.len() || counters.status != 0 {
            return Err(Error::Request(format!(
                "member {index} in the state is not that of the spec: {} numbers of {numbers}, {served} output times of \
                 {}, status {}",
                state.len(),
                self.outputs.len(),
                counters.status
            )));
        }
        self.launch.state = State::from_numbers(&state);
        (self.launch.counters, self.launch.report, self.launch.parameters.look_at) = (counters, report, look_at);
        (self.rows, self.frames) = (rows, frames);
        (self.served, self.crossed) = (served, crossed);
        self.sweeps = sweeps;
        self.take(counters, &report);
        Ok(())
    }

    /// Takes what the back end reports.
    pub fn observe(&mut self, counters: Counters, report: &Report<f64>) {
        self.sweeps[0] += u64::from(counters.sweeps_k);
        self.sweeps[1] += u64::from(counters.sweeps_x);
        self.take(counters, report);
        let creeps = self.counters.status == 0 && !self.is_at_end() && counters.steps >= self.most_steps();
        let failed = Status::ALL.iter().any(|status| status.is_failure() && *status as u32 == self.counters.status);
        if creeps || (failed && self.is_timed_too_coarsely()) {
            self.counters.status = Status::Stalled as u32;
        }
    }

    /// Whether no step that the clock can count was as short as the curve needed at its start.
    fn is_timed_too_coarsely(&self) -> bool {
        let Time::Adaptive(ticks) = self.time else { return false };
        let edge = self.start.length / self.unit / self.member.nodes.len() as f64;
        ticks.tick > FIRST_STEP * edge.powi(4)
    }

    fn take(&mut self, counters: Counters, report: &Report<f64>) {
        self.counters = counters;
        // Until the first step is accepted the start is known better here, in f64.
        if counters.steps > 0 {
            self.report = *report;
        }
    }

    /// Accepted steps after which the member has stalled.
    fn most_steps(&self) -> u32 {
        match self.time {
            Time::Fixed(_) => u32::MAX,
            Time::Adaptive(_) => {
                let p = &self.launch.parameters;
                let turnovers = p.redistribution * p.omega * (p.end_high + p.end_low);
                (MAX_STEPS / p.adaptive.sqrt() + MAX_STEPS_AT_REST * turnovers).ceil() as u32
            }
        }
    }

    /// Whether the member has ended.
    pub fn is_over(&self) -> bool {
        self.counters.status != 0 || self.is_at_end()
    }

    fn is_at_end(&self) -> bool {
        let (progress, p) = (&self.report.progress, &self.launch.parameters);
        match self.time {
            Time::Fixed(clock) => self.counters.steps >= clock.steps,
            Time::Adaptive(_) => (progress.time_high, progress.time_low) == (p.end_high, p.end_low),
        }
    }

    /// Time of the last accepted state.
    pub fn now(&self) -> f64 {
        let progress = &self.report.progress;
        match self.time {
            _ if self.is_at_end() => self.t_end,
            Time::Fixed(clock) => clock.time(self.counters.steps),
            Time::Adaptive(_) => (progress.time_high + progress.time_low) * self.unit.powi(4),
        }
    }

    /// Share of its time that has passed.
    pub fn share(&self) -> f64 {
        self.now() / self.t_end
    }

    /// Keeps the nodes at both ends of the run.
    pub fn keep_portrait(&mut self, keep: bool) {
        self.portrait = keep;
    }

    /// Whether [`Trajectory::end`] wants the last state.
    pub fn keeps_portrait(&self) -> bool {
        self.portrait
    }

    /// Whether [`Trajectory::serve`] needs the state: for a snapshot, or for a look at the curve.
    pub fn wants_state(&self) -> bool {
        let mut due = self.outputs.from(self.served).take_while(|output| self.place(output.t).is_some());
        self.is_look_due() || due.any(|output| output.snapshot || output.frame)
    }

    /// Serves the output times that the last step has reached, and looks at the curve where that is due; `state` is
    /// needed if [`Trajectory::wants_state`]. Returns whether all are served: no more are while `most` bytes of rows, or
    /// more, are in memory.
    pub fn serve(&mut self, state: Option<&State<f64>>, most: usize) -> bool {
        if let (true, Some(state)) = (self.is_look_due(), state) {
            self.look(&state.curve);
        }
        while let Some(output) = self.outputs.get(self.served)
            && let Some(fraction) = self.place(output.t)
        {
            if self.rows.bytes() >= most {
                return false;
            }
            self.emit(&output, fraction, state);
            self.served += 1;
        }
        true
    }

    /// Its rows so far.
    pub fn rows(&mut self) -> &mut Rows {
        &mut self.rows
    }

    /// How far in the last step the time `t` lies, in (0, 1]; none where the step has not reached it.
    fn place(&self, t: f64) -> Option<f64> {
        match self.time {
            Time::Fixed(clock) => {
                let (step, fraction) = clock.locate(t);
                (step <= self.counters.steps).then_some(fraction)
            }
            Time::Adaptive(ticks) => {
                let progress = &self.report.progress;
                let (high, low) = ticks.split(t / self.unit.powi(4));
                let past = (progress.time_high - high) + (progress.time_low - low);
                let step = progress.taken.max(f64::MIN_POSITIVE);
                (past >= 0.0 || self.is_at_end()).then(|| (1.0 - past / step).clamp(0.0, 1.0))
            }
        }
    }

    fn emit(&mut self, output: &Output, fraction: f64, state: Option<&State<f64>>) {
        let (member, t) = (self.member.index, output.t);
        if output.series {
            let Report { before, middle, now, progress, .. } = &self.report;
            let at = self.between(fraction, &before.to_numbers(), &middle.to_numbers(), &now.to_numbers());
            let at = Observables::new(&Observed::from_numbers(&at), progress.turning, self.unit);
            self.rows.series.push(SeriesRow { member, t, at });
        }
        if let (true, Some(state)) = (output.snapshot || output.frame, state) {
            let State { before, middle, curve, .. } = state;
            let field = |of: fn(&Curve<f64>) -> &Ring<f64>, unit: f64, origin: f64| {
                let nodes = self.between(fraction, of(before).nodes(), of(middle).nodes(), of(curve).nodes());
                nodes.into_iter().map(|v| v * unit + origin).collect()
            };
            let (unit, origin) = (self.unit, self.member.origin);
            let snapshot = Snapshot {
                member,
                t,
                x: field(|curve| &curve.x, unit, origin.x),
                y: field(|curve| &curve.y, unit, origin.y),
                k: field(|curve| &curve.k, 1.0 / unit, 0.0),
                r: field(|curve| &curve.r, unit, 0.0),
            };
            if output.frame {
                let nodes = snapshot.x.iter().zip(&snapshot.y).map(|(x, y)| DVec2::new(*x, *y));
                self.frames.push((t, nodes.step_by(Portrait::stride(snapshot.x.len())).collect()));
            }
            if output.snapshot {
                self.rows.snapshots.push(snapshot);
            }
        }
    }

    /// Values inside the last step, interpolated as accurately as the step itself: a fixed one, of first order, by a
    /// straight line, an adaptive one by the parabola through its middle.
    fn between(&self, fraction: f64, before: &[f64], middle: &[f64], now: &[f64]) -> Vec<f64> {
        if fraction == 1.0 {
            return now.to_vec();
        }
        let values = before.iter().zip(middle).zip(now);
        match self.time {
            Time::Fixed(_) => values.map(|((a, _), b)| a + fraction * (b - a)).collect(),
            Time::Adaptive(_) => values.map(|((a, m), b)| extrapolation::inside(*a, *m, *b, fraction)).collect(),
        }
    }

    fn is_look_due(&self) -> bool {
        self.crossed.is_none()
            && self.report.progress.travel >= self.launch.parameters.look_at
            && self.report.now.k_min <= 0.0
    }

    /// Looks whether the polygon crosses itself, and sets how far its nodes may go before the next look.
    ///
    /// A curve whose tangent turns once and always to one side is simple, so the back end pauses only members whose
    /// curvature changes sign.
    fn look(&mut self, curve: &Curve<f64>) {
        let progress = &self.report.progress;
        let nodes: Vec<DVec2> = curve.positions().collect();
        let changes_sign = self.report.now.k_min <= 0.0;
        if progress.turning.abs() != 1.0 || (changes_sign && crossing(&nodes).is_some()) {
            self.crossed = Some(self.now());
            self.launch.parameters.look_at = crate::number::BIG;
            return;
        }
        let length = self.report.now.length;
        let far = if changes_sign { 0.5 * clearance(&nodes, length) } else { 0.0 };
        let least = length / (LOOKS_PER_SPACING * nodes.len() as f64);
        self.launch.parameters.look_at = progress.travel + far.max(least);
    }

    /// Where to run to next, as a number of steps and the parameters on the way; none where the goal still stands.
    pub fn next_aim(&self) -> Option<(u32, Parameters<f64>)> {
        self.needs_aim().then(|| self.aim())
    }

    fn needs_aim(&self) -> bool {
        self.counters.steps >= self.counters.goal
    }

    fn aim(&self) -> (u32, Parameters<f64>) {
        let steps = self.counters.steps;
        let mut parameters = self.launch.parameters;
        let output = self.outputs.get(self.served).map(|output| output.t);
        let goal = match self.time {
            Time::Fixed(clock) => {
                let goal = output.map_or(clock.steps, |t| clock.locate(t).0);
                let ends_short = clock.ends_short() && goal == clock.steps;
                let before_last = ends_short && steps + 1 < clock.steps;
                let tau = if ends_short && !before_last { clock.last() } else { clock.tau };
                parameters.tau = tau / self.unit.powi(4);
                if before_last { clock.steps - 1 } else { goal }
            }
            Time::Adaptive(ticks) => {
                let end = (parameters.end_high, parameters.end_low);
                let split = |t: f64| if t >= self.t_end { end } else { ticks.split(t / self.unit.powi(4)) };
                (parameters.goal_high, parameters.goal_low) = output.map_or(end, split);
                self.most_steps()
            }
        };
        (goal, parameters)
    }

    /// Slope of the line fitted to -ln excess, in 1/time, or against the logarithm of time where the excess falls as a
    /// power of it; and the share of the variance that the line explains.
    fn rate(&self) -> Option<(f64, f64)> {
        let Decay { xx, xy, yy, .. } = self.report.decay;
        let clock = if self.launch.parameters.growth > 0.0 { 1.0 } else { self.time.unit(self.unit) };
        let (rate, r2) = (-xy / xx / clock, xy * xy / (xx * yy));
        (self.counters.fit_points >= MIN_POINTS && rate.is_finite() && r2.is_finite()).then_some((rate, r2))
    }

    /// The excess at the times of [`schedule::grid`](crate::schedule::grid) that the member has reached.
    fn excess(&self) -> Vec<f64> {
        let noted = &self.report.excess_at[..(self.counters.noted as usize).min(member::TIMES)];
        let end = self.is_at_end().then_some(self.report.now.excess);
        [self.start.excess].into_iter().chain(noted.iter().copied()).chain(end).collect()
    }

    /// What the member leaves; `last` is its last state, for the portrait.
    pub fn end(mut self, last: Option<&State<f64>>) -> Ended {
        let frames = std::mem::take(&mut self.frames);
        let progress = &self.report.progress;
        let inside = |step: u32, [high, low, length, fraction]: [f64; 4]| match (self.time, step) {
            (_, NEVER) => None,
            (Time::Fixed(clock), step) => Some(clock.inside(step, fraction)),
            (Time::Adaptive(_), _) => Some((high + (low + fraction * length)) * self.unit.powi(4)),
        };
        let p = progress;
        let relaxed = inside(self.counters.relax_step, [p.relax_high, p.relax_low, p.relax_length, p.relax_fraction]);
        let halved = inside(self.counters.half_step, [p.half_high, p.half_low, p.half_length, p.half_fraction]);
        let t_relax = if self.course == Course::Round { Some(0.0) } else { relaxed };
        let t_half = if self.start.excess <= ROUND { Some(0.0) } else { halved };
        let failed = Status::ALL.into_iter().find(|status| *status as u32 == self.counters.status);
        let status = failed.unwrap_or(if t_relax.is_some() { Status::Relaxed } else { Status::Unfinished });
        let (rate, rate_r2) = self.rate().unzip();
        let (origin, unit) = (self.member.origin, self.unit);
        let portrait = self.portrait.then(|| {
            let before: Vec<DVec2> = self.member.nodes.iter().map(|node| *node + origin).collect();
            let placed = |state: &State<f64>| state.curve.positions().map(|node| node * unit + origin).collect();
            let after = last.map_or_else(|| before.clone(), placed);
            Portrait { before, frames, after }
        });
        let outcome = Outcome {
            member: self.member.index,
            cell: self.member.cell,
            status,
            t_end: self.now(),
            steps: self.counters.steps.into(),
            rejected: self.counters.rejected.into(),
            sweeps_k: self.sweeps[0],
            sweeps_x: self.sweeps[1],
            t_relax,
            t_half,
            rate,
            rate_r2,
            rate_theory: self.rate_theory,
            start: self.start,
            end: Observables::new(&self.report.now, progress.turning, unit),
            self_crossing: self.crossed,
        };
        Ended {
            excess: self.excess(),
            outcome,
            rows: self.rows,
            portrait,
            mollified: self.member.mollified,
            unresolved: self.course == Course::Unresolved,
        }
    }
}

/// The power of two next below the radius of the circle of the same length.
fn unit_of(nodes: &[DVec2]) -> f64 {
    (polygon::length(nodes) / std::f64::consts::TAU).log2().floor().exp2()
}

/// Whether the law, a rate or the fixed step of a member is no number of a precision: too large, or a step too short.
fn beyond(p: &Parameters<f64>, precision: Precision) -> bool {
    let range = schedule::range(precision);
    let law = [p.c1, p.c2, p.c3, p.c4, p.c5, p.c6, p.c7, p.c8, p.length_penalty];
    let rates = [p.redistribution * p.omega, p.pull, p.tau];
    let too_large = law.into_iter().chain(rates).any(|number| number.is_nan() || number.abs() > *range.end());
    too_large || (p.tau != 0.0 && p.tau < *range.start())
}

/// The parameters of a member in units of `unit`, thresholds and times aside.
fn parameters(spec: &Spec, nodes: &[DVec2], unit: f64, tolerance: f64) -> Parameters<f64> {
    let time = unit.powi(4);
    let of_flow = Parameters::of_flow(&spec.flow, 1.0);
    // b(k) has the dimension of 1/length³.
    let law = |j: i32, c: f64| c * unit.powi(3 - j);
    Parameters {
        c1: law(1, of_flow.c1),
        c2: law(2, of_flow.c2),
        c3: law(3, of_flow.c3),
        c4: law(4, of_flow.c4),
        c5: law(5, of_flow.c5),
        c6: law(6, of_flow.c6),
        c7: law(7, of_flow.c7),
        c8: law(8, of_flow.c8),
        tau: if let Pace::Fixed(tau) = spec.pace() { tau / time } else { 0.0 },
        omega: spec.omega * time,
        redistribution: f64::from(u8::from(!spec.no_redistribution)),
        pull: match spec.pull {
            Pull::Rate(rate) => rate * time,
            Pull::Auto => (PULL_PER_RATE * relaxation_rate(nodes)).min(strongest_pull(nodes)),
        },
        tolerance,
        sor: match spec.sor {
            Sor::Factor(factor) => factor,
            Sor::Auto => 0.0,
        },
        length_penalty: of_flow.length_penalty * unit * unit,
        polygon_ratio: polygon::regular_ratio(nodes.len()),
        ..of_flow
    }
}
