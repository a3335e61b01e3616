//! A member's output during the run: rows, snapshots and frames at output times, and the search for crossings.

use glam::DVec2;

use super::{Time, Trajectory};
use crate::{
    curve::{clearance, crossing},
    ensemble::{Observables, Portrait, Rows, SeriesRow, Snapshot},
    schedule::Output,
    scheme::{
        Curve, State, extrapolation,
        member::{Observed, Report},
    },
    solver::Ring,
};

/// Checks for crossings per spacing that nodes move, in a curve about to cross itself.
const LOOKS_PER_SPACING: f64 = 16.0;

impl Trajectory<'_> {
    /// Returns whether [`Trajectory::serve`] needs the state: for a snapshot, or to check for crossings.
    pub fn wants_state(&self) -> bool {
        let mut due = self.outputs.from(self.served).take_while(|output| self.place(output.t).is_some());
        self.is_look_due() || due.any(|output| output.snapshot || output.frame)
    }

    /// Serves the output times that the last step has reached, and checks for crossings if due; `state` is
    /// needed if [`Trajectory::wants_state`]. Returns whether all are served: it stops while `most` bytes of rows or
    /// more are in memory.
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

    /// Returns the rows so far.
    pub fn rows(&mut self) -> &mut Rows {
        &mut self.rows
    }

    /// Where in the last step the time `t` is, in (0, 1]; `None` if the step has not reached it.
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

    /// Values inside the last step, interpolated as accurately as the step itself: for a fixed one, of first order, by
    /// a straight line, for an adaptive one by the parabola through its middle.
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

    /// Checks whether the polygon crosses itself, and sets how far its nodes may move before the next check.
    ///
    /// A curve whose tangent turns once and always to one side is simple, so the back end pauses only members whose
    /// curvature changes sign.
    pub(super) fn look(&mut self, curve: &Curve<f64>) {
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
}
