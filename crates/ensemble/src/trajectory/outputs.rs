//! A member's output during the run: rows, snapshots and frames at output times, and the search for crossings.

use glam::DVec2;

use super::{Time, Trajectory};
use crate::{Observables, Portrait, Rows, SeriesRow, Snapshot, schedule::Output};
use curvelax_curve::{clearance, crossing};
use curvelax_flow::{
    scheme::{
        Curve, State, dense,
        member::{Observed, Progress, Report},
        observe,
    },
    solver::{Blocks, Ring},
};

/// Checks for crossings per spacing that nodes move, in a curve about to cross itself.
const LOOKS_PER_SPACING: f64 = 16.0;
/// Halvings that find a crossing inside the part of a step that it is in.
const LOOKS_PER_CROSSING: u32 = 10;

impl Trajectory<'_> {
    /// Returns whether [`Trajectory::serve`] needs the state: for a snapshot, for what lies inside an adaptive step,
    /// also an event, or to check for crossings.
    pub fn wants_state(&self) -> bool {
        let mut due = self.outputs.from(self.at.served as usize).take_while(|output| self.place(output.t).is_some());
        self.is_look_due() || self.events_need_state() || due.any(|output| self.needs_curve(&output))
    }

    /// Whether an output is made from a curve: all but the rows of fixed steps, for which two reports do.
    fn needs_curve(&self, output: &Output) -> bool {
        output.snapshot || output.frame || matches!(self.time, Time::Adaptive(_))
    }

    /// Serves the output times and finds the events that the last step has reached, and checks for crossings if due;
    /// `state` is needed if [`Trajectory::wants_state`]. Returns whether all are served: it stops while `most` bytes of
    /// rows or more are in memory.
    pub fn serve(&mut self, state: Option<&State<f64>>, most: usize) -> bool {
        if let (true, Some(state)) = (self.is_look_due(), state) {
            self.look(state);
        }
        self.locate_events(state);
        while let Some(output) = self.outputs.get(self.at.served as usize)
            && let Some(fraction) = self.place(output.t)
        {
            if self.at.rows.bytes() >= most {
                return false;
            }
            self.emit(&output, fraction, state);
            self.at.served += 1;
        }
        true
    }

    /// Returns the rows so far.
    pub fn rows(&mut self) -> &mut Rows {
        &mut self.at.rows
    }

    /// Where in the last step the time `t` is, in (0, 1]; `None` if the step has not reached it.
    fn place(&self, t: f64) -> Option<f64> {
        match self.time {
            Time::Fixed(clock) => {
                let (step, fraction) = clock.locate(t);
                (step <= self.at.counters.steps).then_some(fraction)
            }
            Time::Adaptive(ticks) => {
                let progress = &self.at.report.progress;
                let (high, low) = ticks.split(t / self.time_unit);
                let past = (progress.time_high - high) + (progress.time_low - low);
                let step = progress.taken.max(f64::MIN_POSITIVE);
                (past >= 0.0 || self.is_at_end()).then(|| (1.0 - past / step).clamp(0.0, 1.0))
            }
        }
    }

    fn emit(&mut self, output: &Output, fraction: f64, state: Option<&State<f64>>) {
        let (member, t, unit) = (self.member.index, output.t, self.unit);
        let curve = state.filter(|_| self.needs_curve(output)).map(|state| self.curve_at(fraction, state));
        if output.series || output.energy {
            let at = match (&curve, self.time) {
                (Some(curve), Time::Adaptive(_)) => self.observe_inside(fraction, curve),
                _ => self.report_at(fraction),
            };
            let at = Observables::new(&at, self.at.report.progress.turning, unit);
            if output.series {
                self.at.rows.series.push(SeriesRow { member, t, at });
            }
            if let (true, Some(settling)) = (output.energy, &mut self.settling) {
                settling.energies.push([t, at.energy]);
            }
        }
        if let (true, Some(curve)) = (output.snapshot || output.frame, curve) {
            let origin = self.member.origin;
            let field = |field: &Ring<f64>, unit: f64, origin: f64| {
                field.nodes().iter().map(|v| v * unit + origin).collect::<Vec<f64>>()
            };
            let snapshot = Snapshot {
                member,
                t,
                x: field(&curve.x, unit, origin.x),
                y: field(&curve.y, unit, origin.y),
                k: field(&curve.k, 1.0 / unit, 0.0),
                r: field(&curve.r, unit, unit * self.launch.parameters.r_offset),
            };
            if output.frame {
                let nodes = snapshot.x.iter().zip(&snapshot.y).map(|(x, y)| DVec2::new(*x, *y));
                self.at.frames.push((t, nodes.step_by(Portrait::stride(snapshot.x.len())).collect()));
            }
            if output.snapshot {
                self.at.rows.snapshots.push(snapshot);
            }
        }
    }

    /// The curve inside the last step, as accurate as the step itself: for a fixed one, of first order, on a straight
    /// line.
    pub(super) fn curve_at(&self, fraction: f64, state: &State<f64>) -> Curve<f64> {
        match self.time {
            Time::Fixed(_) => {
                let mut curve = state.curve.clone();
                for (end, start) in curve.fields_mut().into_iter().zip(state.before.fields()) {
                    for i in 0..start.len() {
                        end[i] = between(start[i], end[i], fraction);
                    }
                    end.close();
                }
                curve
            }
            Time::Adaptive(_) => dense::inside(state, &self.at.report.progress, fraction),
        }
    }

    /// Observes a curve inside the last step.
    pub(super) fn observe_inside(&self, fraction: f64, curve: &Curve<f64>) -> Observed<f64> {
        if fraction == 1.0 {
            return self.at.report.now;
        }
        let blocks = Blocks::new(curve.len()).expect("a ring of 6 nodes or more");
        observe::observe(curve, &self.launch.parameters, blocks)
    }

    /// The observables inside the last fixed step, on a straight line.
    fn report_at(&self, fraction: f64) -> Observed<f64> {
        let Report { before, now, .. } = &self.at.report;
        let ends = before.to_numbers().into_iter().zip(now.to_numbers());
        let numbers: Vec<f64> = ends.map(|(start, end)| between(start, end, fraction)).collect();
        Observed::from_numbers(&numbers)
    }

    fn is_look_due(&self) -> bool {
        self.at.crossed.is_none()
            && self.at.report.progress.travel >= self.launch.parameters.look_at
            && self.at.report.now.k_min <= 0.0
    }

    /// Checks whether the polygon crosses itself, and sets how far its nodes may move before the next check.
    ///
    /// A curve whose tangent turns once and always to one side is simple, so the back end pauses only members whose
    /// curvature changes sign. An adaptive step is long: it is gone through from where a crossing is possible, as far
    /// at a time as none is.
    pub(super) fn look(&mut self, state: &State<f64>) {
        let Progress { turning, travel, taken, .. } = self.at.report.progress;
        let moved = farthest(&state.before, &state.curve);
        let adaptive = matches!(self.time, Time::Adaptive(_)) && taken > 0.0 && moved > 0.0;
        let mut at =
            if adaptive { (1.0 - (travel - self.launch.parameters.look_at) / moved).clamp(0.0, 1.0) } else { 1.0 };
        let mut simple_at = 0.0;
        loop {
            let curve = self.curve_at(at, state);
            let nodes: Vec<DVec2> = curve.positions().collect();
            let changes_sign = curve.k.nodes().iter().any(|k| *k <= 0.0);
            if turning.abs() != 1.0 || (changes_sign && crossing(&nodes).is_some()) {
                let first =
                    if adaptive && turning.abs() == 1.0 { self.first_crossing([simple_at, at], state) } else { at };
                self.at.crossed = Some(self.now() - (1.0 - first) * taken * self.time_unit);
                self.launch.parameters.look_at = curvelax_flow::number::BIG;
                return;
            }
            let length = self.at.report.now.length;
            let far = if changes_sign { 0.5 * clearance(&nodes, length) } else { 0.0 };
            let far = far.max(length / (LOOKS_PER_SPACING * nodes.len() as f64));
            if at >= 1.0 {
                self.launch.parameters.look_at = travel + far;
                return;
            }
            simple_at = at;
            at = (at + far / moved).min(1.0);
        }
    }

    /// Where inside the last step the polygon first crosses itself, between a simple curve and one that does.
    fn first_crossing(&self, [mut simple, mut crossed]: [f64; 2], state: &State<f64>) -> f64 {
        for _ in 0..LOOKS_PER_CROSSING {
            let middle = 0.5 * (simple + crossed);
            let nodes: Vec<DVec2> = self.curve_at(middle, state).positions().collect();
            if crossing(&nodes).is_some() { crossed = middle } else { simple = middle }
        }
        crossed
    }
}

/// A number inside a step, on a straight line; at its end exactly the last one.
fn between(start: f64, end: f64, fraction: f64) -> f64 {
    if fraction == 1.0 { end } else { start + fraction * (end - start) }
}

/// The largest displacement of a node.
fn farthest(from: &Curve<f64>, to: &Curve<f64>) -> f64 {
    from.positions().zip(to.positions()).map(|(a, b)| a.distance(b)).fold(0.0, f64::max)
}
