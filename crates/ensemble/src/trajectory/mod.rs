//! One member's trajectory through a run, seen from the host: where it starts, where it pauses next, its results.
//!
//! A member is advanced in units of its own size: lengths are divided by a power of two near its radius and times by
//! the fourth power of that, without rounding, so that no threshold of the scheme and no range of a precision
//! depends on the user's unit. Times are also multiplied by the mobility, here and nowhere else: outside they are the
//! user's, inside those of unit mobility.

mod end;
mod events;
mod outputs;
mod settling;
mod start;
mod vanishing;
mod watch;

use glam::DVec2;

use settling::Settling;
pub(crate) use settling::settling_times;
use vanishing::Vanishing;
use watch::{Watch, aim_at_levels};

use crate::{
    Member, Observables, Paused, Status,
    schedule::{Clock, Outputs, Ticks},
    theory::vanishing::LITTLE_EXCESS,
};
use curvelax_base::error::{Error, Result};
use curvelax_flow::{
    equilibrium::Equilibrium,
    scheme::{
        Parameters, State,
        member::{Counters, Report},
        run::Run,
        state::STATE_FIELDS,
    },
};

/// The fourth power of the shortest segment is the fastest time scale there is, and a clock must be able to count this
/// multiple of it.
const FASTEST: f64 = 0.1;
/// The first adaptive step in the same unit. A smooth curve could take a longer one. A rough curve would refuse it, and
/// what comes of a step that is far too long depends on roundings.
const FIRST_STEP: f64 = 3.0;
/// Maximum number of adaptive steps to an error of 1; it scales with the inverse fourth root of the error, and a member
/// that exceeds it is stalled. Curves that relax take some 1 to 50, and nonconvex ones that the force of the polygon
/// moves up to 300; one that creeps, because only tiny steps can be solved, would not end in reasonable time.
const MAX_STEPS: f64 = 1000.0;
/// Further steps per time 1/ω: a curve at rest takes one or two, since lengths approach their mean explicitly.
const MAX_STEPS_AT_REST: f64 = 4.0;

/// What can be said about the relaxation of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// Its excess is followed to the threshold.
    Followed,
    /// It is at or below the threshold from the start, or a regular polygon.
    Round,
    /// It is so nearly round that its threshold is within the rounding of the precision.
    Unresolved,
    /// It is not a simple curve: whatever its excess, it does not relax to a circle.
    Immersed,
    /// It keeps its excess; its energy is followed to the end.
    Settling,
}

/// How a member's time advances.
#[derive(Clone, Copy, Debug)]
enum Time {
    Fixed(Clock),
    Adaptive(Ticks),
}

impl Time {
    /// Unit of the clock of [`decay`](curvelax_flow::scheme::decay), for a member advanced in times of `unit`.
    fn unit(self, unit: f64) -> f64 {
        match self {
            Time::Fixed(clock) => clock.tau,
            Time::Adaptive(_) => unit,
        }
    }
}

/// Where the lengths of a back end are in the user's frame.
#[derive(Clone, Copy, Debug)]
pub struct UserFrame {
    unit: f64,
    origin: DVec2,
}

impl UserFrame {
    /// Returns the nodes of a state.
    pub fn nodes(self, state: &State<f64>) -> Vec<DVec2> {
        state.curve.positions().map(|node| node * self.unit + self.origin).collect()
    }
}

/// A resident member.
pub struct Trajectory<'a> {
    member: Member,
    /// A power of two near the member's radius: the unit of length in which it is advanced.
    unit: f64,
    /// The fourth power of that over the mobility: the unit of time.
    time_unit: f64,
    t_end: f64,
    time: Time,
    launch: Run<f64>,
    /// Output times.
    outputs: &'a Outputs,
    start: Observables,
    /// How far it is, except what is elsewhere here: its state, its events, and what comes next.
    at: Paused,
    course: Course,
    /// The events of its spec, in their order.
    watches: Vec<Watch>,
    /// Whether to store the nodes at both ends of the run.
    pub(crate) portrait: bool,
    /// What its flow relaxes curves to.
    equilibrium: Equilibrium,
    /// Whether it may shrink to a point, driven by a force.
    vanishing: Option<Vanishing>,
    /// When it did.
    t_vanish: Option<f64>,
    /// Its energy, if that decides on its relaxation.
    settling: Option<Settling>,
    /// Whether it keeps its area or its length.
    conserved: bool,
}

impl Trajectory<'_> {
    /// Returns what the back end needs to start or continue the member; its state is then held there only.
    pub fn launch(&mut self) -> Run<f64> {
        let (goal, parameters) = self.aim();
        let state = std::mem::replace(&mut self.launch.state, State::zeros(0));
        let mut run = Run { state, parameters, counters: self.launch.counters, report: self.launch.report };
        if self.needs_aim() {
            run.counters.goal = goal;
        }
        run
    }

    /// Returns the member between two dispatches, with the back end's data.
    pub fn pause(&self, counters: Counters, report: Report<f64>, state: &State<f64>) -> Paused {
        Paused {
            counters,
            report,
            state: state.to_numbers(),
            events: self.watches.iter().map(|watch| watch.t).collect(),
            look_at: self.launch.parameters.look_at,
            until: self.vanishing.as_ref().map_or(0.0, |own| own.until),
            energies: self.settling.as_ref().map_or(Vec::new(), |own| own.energies.clone()),
            ..self.at.clone()
        }
    }

    /// Continues a newly created member where it was [paused](Trajectory::pause).
    ///
    /// # Errors
    /// [`Error::Request`] if a different member was paused.
    pub fn resume_from(&mut self, paused: Paused) -> Result<()> {
        let (index, numbers) = (self.member.index, STATE_FIELDS * self.member.nodes.len());
        let Paused { counters, report, look_at, until, .. } = paused;
        let [state, events] = [paused.state.len(), paused.events.len()];
        let (outputs, watches) = (self.outputs.len(), self.watches.len());
        if state != numbers || paused.served > outputs as u64 || counters.status != 0 || events != watches {
            return Err(Error::Request(format!(
                "member {index} in the state is not that of the spec: {state} numbers of {numbers}, {} output times of \
                 {outputs}, {events} events of {watches}, status {}",
                paused.served, counters.status
            )));
        }
        self.watches.iter_mut().zip(&paused.events).for_each(|(watch, t)| watch.t = *t);
        self.launch.state = State::from_numbers(&paused.state);
        (self.launch.counters, self.launch.report, self.launch.parameters.look_at) = (counters, report, look_at);
        if let Some(own) = &mut self.settling {
            own.energies.clone_from(&paused.energies);
        }
        self.at = Paused { report: self.at.report, state: Vec::new(), ..paused };
        self.take(counters, &report);
        if let Some(own) = &mut self.vanishing {
            own.until = until;
        }
        // One that is so small continues because it does not vanish in time, or was not at rest.
        let (now, report) = (Observables::new(&self.at.report.now, 1.0, self.unit), &self.at.report.now);
        let in_time = |own: &Vanishing| self.vanishes_at(own, &now).is_some();
        let gone = self.vanishing.as_ref().is_some_and(|own| own.is_due(report) && !in_time(own));
        self.vanishing.take_if(|own| gone || !own.lower(report));
        Ok(())
    }

    /// Processes a report of the back end.
    pub fn observe(&mut self, counters: Counters, report: &Report<f64>) {
        self.at.sweeps[0] += u64::from(counters.sweeps_k);
        self.at.sweeps[1] += u64::from(counters.sweeps_x);
        self.take(counters, report);
        let creeps = self.at.counters.status == 0 && !self.is_at_end() && counters.steps >= self.most_steps();
        let failed = Status::ALL.iter().any(|status| status.is_failure() && *status as u32 == self.at.counters.status);
        if creeps || (failed && self.is_timed_too_coarsely()) {
            self.at.counters.status = Status::Stalled as u32;
        }
        self.look_whether_it_vanishes();
    }

    /// Whether even the shortest step that the clock can count was longer than the curve needed at its start.
    fn is_timed_too_coarsely(&self) -> bool {
        let Time::Adaptive(ticks) = self.time else { return false };
        let edge = self.start.length / self.unit / self.member.nodes.len() as f64;
        ticks.tick > FASTEST * edge.powi(4)
    }

    /// Ends the member if it is at the length at which that is decided, and vanishes before its final time.
    fn look_whether_it_vanishes(&mut self) {
        let now = Observables::new(&self.at.report.now, 1.0, self.unit);
        let at = &self.at.report.now;
        let due = |own: &mut Vanishing| self.at.counters.status == 0 && own.is_due(at) && !own.is_put_off(at);
        // Sides that have met end the flow: what is left has not the life of a circle.
        let met = at.excess > LITTLE_EXCESS && (self.at.crossed.is_some() || now.area * self.start.area <= 0.0);
        if met && self.vanishing.as_mut().is_some_and(due) {
            self.at.counters.status = Status::Singular as u32;
        } else if let Some(own) = self.vanishing.take_if(due) {
            self.t_vanish = self.vanishes_at(&own, &now);
            if self.t_vanish.is_some() {
                self.at.counters.status = Status::Vanished as u32;
            }
        }
        let time = self.at.report.progress.time_high + self.at.report.progress.time_low;
        if let Some(own) = self.vanishing.as_mut().filter(|own| own.until <= time) {
            own.look_ahead(time, &now, self.unit);
        }
    }

    /// When a curve like this vanishes, if that is before its final time.
    fn vanishes_at(&self, own: &Vanishing, now: &Observables) -> Option<f64> {
        // The unit of time over that of length to the fourth is the inverse mobility.
        let inverse_mobility = self.time_unit / self.unit.powi(4);
        own.left(now).map(|left| self.now() + left * inverse_mobility).filter(|t| *t <= self.t_end)
    }

    fn take(&mut self, counters: Counters, report: &Report<f64>) {
        self.at.counters = counters;
        // Until the first step is accepted, the host knows the start better, in f64.
        if counters.steps > 0 {
            self.at.report = *report;
        }
    }

    /// Maximum number of accepted steps before the member is stalled.
    fn most_steps(&self) -> u32 {
        match self.time {
            Time::Fixed(_) => u32::MAX,
            Time::Adaptive(_) => {
                let p = &self.launch.parameters;
                let turnovers = p.redistribution * p.omega * (p.end_high + p.end_low);
                (MAX_STEPS / p.adaptive.sqrt().sqrt() + MAX_STEPS_AT_REST * turnovers).ceil() as u32
            }
        }
    }

    /// Returns whether the member has ended.
    pub fn is_over(&self) -> bool {
        self.at.counters.status != 0 || self.is_at_end()
    }

    fn is_at_end(&self) -> bool {
        let (progress, p) = (&self.at.report.progress, &self.launch.parameters);
        match self.time {
            Time::Fixed(clock) => self.at.counters.steps >= clock.steps,
            Time::Adaptive(_) => (progress.time_high, progress.time_low) == (p.end_high, p.end_low),
        }
    }

    /// Returns the time of the last accepted state.
    pub fn now(&self) -> f64 {
        let progress = &self.at.report.progress;
        match self.time {
            _ if self.is_at_end() => self.t_end,
            Time::Fixed(clock) => clock.time(self.at.counters.steps),
            Time::Adaptive(_) => (progress.time_high + progress.time_low) * self.time_unit,
        }
    }

    /// Returns the index of the member.
    pub fn index(&self) -> u64 {
        self.member.index
    }

    /// Returns how its states are placed in the user's frame.
    pub fn placing(&self) -> UserFrame {
        UserFrame { unit: self.unit, origin: self.member.origin }
    }

    /// Returns the fraction of its time that has passed.
    pub fn share(&self) -> f64 {
        self.now() / self.t_end
    }

    /// Returns the next goal, as a number of steps, and the parameters until then; `None` if the goal is unchanged.
    pub fn next_aim(&self) -> Option<(u32, Parameters<f64>)> {
        self.needs_aim().then(|| self.aim())
    }

    fn needs_aim(&self) -> bool {
        self.at.counters.steps >= self.at.counters.goal
    }

    fn aim(&self) -> (u32, Parameters<f64>) {
        let steps = self.at.counters.steps;
        let mut parameters = self.launch.parameters;
        aim_at_levels(&mut parameters, &self.watches);
        if let Some(vanishing) = &self.vanishing {
            vanishing.aim(&mut parameters);
        }
        let output = self.outputs.get(self.at.served as usize).map(|output| output.t);
        let goal = match self.time {
            Time::Fixed(clock) => {
                let goal = output.map_or(clock.steps, |t| clock.locate(t).0);
                let ends_short = clock.ends_short() && goal == clock.steps;
                let before_last = ends_short && steps + 1 < clock.steps;
                let tau = if ends_short && !before_last { clock.last() } else { clock.tau };
                parameters.tau = tau / self.time_unit;
                if before_last { clock.steps - 1 } else { goal }
            }
            Time::Adaptive(ticks) => {
                let end = (parameters.end_high, parameters.end_low);
                let split = |t: f64| if t >= self.t_end { end } else { ticks.split(t / self.time_unit) };
                let goal = output.map_or(end, split);
                let until = self.vanishing.as_ref().map_or(f64::INFINITY, |own| own.until);
                let until = if until * self.time_unit >= self.t_end { end } else { ticks.split(until) };
                (parameters.end_high, parameters.end_low) = until;
                (parameters.goal_high, parameters.goal_low) = if is_before(until, goal) { until } else { goal };
                self.most_steps()
            }
        };
        (goal, parameters)
    }
}

/// Whether a time in two parts is before another.
fn is_before(one: (f64, f64), other: (f64, f64)) -> bool {
    (one.0 - other.0) + (one.1 - other.1) < 0.0
}
