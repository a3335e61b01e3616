//! One member's way through a run, seen from the host: where it starts, which step it aims at, what it leaves.

use glam::DVec2;

use crate::{
    curve::polygon,
    ensemble::{Ended, Member, Observables, Outcome, Portrait, SeriesRow, Snapshot, Spec, Status, spec::Precision},
    schedule::{Clock, Stop},
    scheme::{
        Parameters, State,
        evolve::Launch,
        observe::{self, Curve},
        parameters::{Counters, NEVER, Report},
    },
    solver::{Blocks, Ring},
};

/// Excess below which a curve is a regular polygon to rounding: such a member is relaxed at time 0.
const ROUND: f64 = 1e-13;
/// An excess is a difference of numbers near 1: below this many ε a threshold lies in its rounding.
const RESOLUTION: f64 = 128.0;
/// A threshold that no excess reaches.
const NO_THRESHOLD: f64 = -1.0;

/// What can be said of the relaxation of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// Its excess is followed to the threshold.
    Followed,
    /// It is a regular polygon from the start.
    Round,
    /// It is so nearly round that its threshold lies in the rounding of the precision.
    Unresolved,
    /// It is no simple curve: whatever its excess, it does not relax to a circle.
    Immersed,
}

/// A resident member.
pub struct Trajectory<'a> {
    member: Member,
    launch: Launch,
    clock: Clock,
    /// Output times still to come.
    stops: &'a [Stop],
    counters: Counters,
    start: Observables,
    now: Observables,
    /// Observables, and the state where a snapshot will need it, at the step before the next output time.
    before: Option<(Observables, Option<State<f64>>)>,
    series: Vec<SeriesRow>,
    snapshots: Vec<Snapshot>,
    sweeps: [u64; 2],
    course: Course,
    /// Where inside their steps the member relaxed and its excess halved.
    fractions: [f64; 2],
    portrait: bool,
}

impl<'a> Trajectory<'a> {
    /// A member at its start; serves the output times that are due there.
    pub fn new(member: Member, spec: &Spec, precision: Precision, clock: Clock, stops: &'a [Stop]) -> Trajectory<'a> {
        let mut parameters = parameters(spec, member.nodes.len(), spec.tolerance_at(precision));
        let state = State::<f64>::from_nodes(&member.nodes);
        let start = observe_start(&state, &parameters);
        let resolution = RESOLUTION * precision.epsilon();
        let course = match spec.relax_to * start.excess {
            _ if start.excess <= ROUND => Course::Round,
            _ if start.turning.abs() != 1 => Course::Immersed,
            threshold if threshold < resolution => Course::Unresolved,
            _ => Course::Followed,
        };
        let reachable = !matches!(course, Course::Round | Course::Immersed);
        let threshold = |excess: f64| if reachable && excess >= resolution { excess } else { NO_THRESHOLD };
        parameters.relax_at = threshold(spec.relax_to * start.excess);
        parameters.half_at = threshold(0.5 * start.excess);
        let launch = Launch {
            nodes: member.nodes.clone(),
            parameters,
            goal: 0,
            stop_when_relaxed: spec.stop_when_relaxed,
            excess: start.excess,
            turning: start.turning,
        };
        let counters = Counters { relax_step: NEVER, half_step: NEVER, ..Counters::default() };
        let mut trajectory = Trajectory {
            member,
            launch,
            clock,
            stops,
            counters,
            start,
            now: start,
            before: None,
            series: Vec::new(),
            snapshots: Vec::new(),
            sweeps: [0; 2],
            course,
            fractions: [0.0; 2],
            portrait: false,
        };
        if course == Course::Round && spec.stop_when_relaxed {
            trajectory.counters.status = Status::Relaxed as u32;
        }
        trajectory.serve(Some(&state));
        trajectory
    }

    /// What the back end needs to start the member.
    pub fn launch(&self) -> Launch {
        let (goal, tau) = self.next_goal().unwrap_or((0, self.clock.tau));
        let mut launch = self.launch.clone();
        launch.goal = goal;
        launch.parameters.tau = tau;
        launch
    }

    /// Takes what the back end reports.
    pub fn observe(&mut self, counters: Counters, report: &Report<f64>) {
        self.sweeps[0] += u64::from(counters.sweeps_k);
        self.sweeps[1] += u64::from(counters.sweeps_x);
        self.counters = counters;
        // Until the first step is accepted the report holds nothing but its start.
        if counters.steps > 0 {
            self.now = report.into();
        }
        self.fractions = [report.relax_fraction, report.half_fraction];
    }

    /// Whether the member has ended.
    pub fn is_over(&self) -> bool {
        self.counters.status != 0 || self.counters.steps >= self.clock.steps
    }

    /// Share of its steps that are done.
    pub fn share(&self) -> f64 {
        f64::from(self.counters.steps) / f64::from(self.clock.steps)
    }

    /// Keeps the nodes at both ends of the run.
    pub fn keep_portrait(&mut self, keep: bool) {
        self.portrait = keep;
    }

    /// Whether [`Trajectory::end`] wants the last state.
    pub fn keeps_portrait(&self) -> bool {
        self.portrait
    }

    /// Whether an output time that can be served now, or the one after this step, needs the state.
    pub fn wants_state(&self) -> bool {
        self.due().any(|stop| stop.snapshot)
    }

    /// Output times that need what is known after the current step: those behind it, and those in the next step.
    fn due(&self) -> impl Iterator<Item = &Stop> {
        self.stops.iter().take_while(|stop| stop.step <= self.counters.steps)
    }

    /// Serves the output times that the current step has reached; `state` is needed where one of them is a snapshot.
    pub fn serve(&mut self, state: Option<&State<f64>>) {
        let steps = self.counters.steps;
        while let Some(stop) = self.stops.first().copied() {
            if stop.fraction == 0.0 && stop.step == steps {
                self.emit(&stop, self.now, state.cloned());
            } else if stop.fraction > 0.0 && stop.step + 1 == steps {
                self.emit_inside(&stop, state);
            } else {
                break;
            }
            self.stops = &self.stops[1..];
        }
        if self.stops.first().is_some_and(|stop| stop.fraction > 0.0 && stop.step == steps) {
            let keep = self.due().any(|stop| stop.snapshot);
            self.before = Some((self.now, state.filter(|_| keep).cloned()));
        }
    }

    /// Linear interpolation between the steps around an output time: as accurate as the scheme, which is of first order.
    fn emit_inside(&mut self, stop: &Stop, state: Option<&State<f64>>) {
        let Some((before, state_before)) = &self.before else { return };
        let between = |a: f64, b: f64| a + stop.fraction * (b - a);
        let (a, b) = (before, &self.now);
        let at = Observables {
            length: between(a.length, b.length),
            area: between(a.area, b.area),
            excess: between(a.excess, b.excess),
            energy: between(a.energy, b.energy),
            k_min: between(a.k_min, b.k_min),
            k_max: between(a.k_max, b.k_max),
            mesh_ratio: between(a.mesh_ratio, b.mesh_ratio),
            metric_drift: between(a.metric_drift, b.metric_drift),
            turning: b.turning,
        };
        let inside = state_before.as_ref().zip(state).map(|(a, b)| {
            let numbers: Vec<f64> =
                a.to_numbers().into_iter().zip(b.to_numbers()).map(|(a, b)| between(a, b)).collect();
            State::from_numbers(&numbers)
        });
        self.emit(stop, at, inside);
    }

    fn emit(&mut self, stop: &Stop, at: Observables, state: Option<State<f64>>) {
        let (member, t) = (self.member.index, stop.t);
        if stop.series {
            self.series.push(SeriesRow { member, t, at });
        }
        if let (true, Some(state)) = (stop.snapshot, state) {
            let origin = self.member.origin;
            let field = |ring: &Ring<f64>, offset: f64| ring.nodes().iter().map(|v| v + offset).collect();
            self.snapshots.push(Snapshot {
                member,
                t,
                x: field(&state.x, origin.x),
                y: field(&state.y, origin.y),
                k: field(&state.k, 0.0),
                r: field(&state.r, 0.0),
            });
        }
    }

    /// The step to run to next, and the step length on the way; none where the current goal still stands.
    pub fn next_goal(&self) -> Option<(u32, f64)> {
        let (steps, total) = (self.counters.steps, self.clock.steps);
        if steps < self.counters.goal {
            return None;
        }
        let output = self.stops.first().map_or(total, |stop| if stop.step > steps { stop.step } else { stop.step + 1 });
        let goal = output.min(total);
        if self.clock.ends_short() && goal == total {
            return Some(if steps + 1 < total { (total - 1, self.clock.tau) } else { (total, self.clock.last()) });
        }
        Some((goal, self.clock.tau))
    }

    /// What the member leaves; `last` is its last state, for the portrait.
    pub fn end(self, last: Option<&State<f64>>) -> Ended {
        let event = |step: u32, fraction: f64| match (self.course, step) {
            (Course::Round, _) => Some(0.0),
            (_, NEVER) => None,
            _ => Some(self.clock.inside(step, fraction)),
        };
        let t_relax = event(self.counters.relax_step, self.fractions[0]);
        let t_half = event(self.counters.half_step, self.fractions[1]);
        let failed = Status::ALL.into_iter().find(|status| *status as u32 == self.counters.status);
        let status = failed.unwrap_or(if t_relax.is_some() { Status::Relaxed } else { Status::Unfinished });
        let origin = self.member.origin;
        let portrait = self.portrait.then(|| {
            let before: Vec<DVec2> = self.member.nodes.iter().map(|node| *node + origin).collect();
            let after = last.map_or(before.clone(), |state| state.positions().map(|node| node + origin).collect());
            Portrait { before, after }
        });
        let outcome = Outcome {
            member: self.member.index,
            status,
            t_end: self.clock.time(self.counters.steps),
            steps: self.counters.steps.into(),
            sweeps_k: self.sweeps[0],
            sweeps_x: self.sweeps[1],
            t_relax,
            t_half,
            start: self.start,
            end: self.now,
        };
        Ended {
            outcome,
            series: self.series,
            snapshots: self.snapshots,
            portrait,
            mollified: self.member.mollified,
            unresolved: self.course == Course::Unresolved,
        }
    }
}

/// The parameters of a member with `n` nodes, thresholds aside.
fn parameters(spec: &Spec, n: usize, tolerance: f64) -> Parameters<f64> {
    Parameters {
        omega: spec.omega,
        redistribution: f64::from(u8::from(!spec.no_redistribution)),
        tolerance,
        sor: spec.sor,
        polygon_ratio: polygon::regular_ratio(n),
        ..Parameters::of_flow(&spec.flow, spec.tau)
    }
}

/// Observables of the initial curve, in f64 whatever the precision of the run.
fn observe_start(state: &State<f64>, p: &Parameters<f64>) -> Observables {
    let blocks = Blocks::new(state.len()).expect("n was validated");
    let curve = Curve { x: &state.x, y: &state.y, k: &state.k, r: &state.r };
    let (sums, maxima) = (observe::sums(curve, p, blocks), observe::maxima(curve));
    let mut report = Report { excess: observe::excess(&sums, p), ..Report::default() };
    report.observe(&sums, &maxima);
    Observables::from(&report)
}
