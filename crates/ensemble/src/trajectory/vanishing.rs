//! Members that a driving force shrinks to a point.
//!
//! The steps that follow a curve to a point are ever shorter. It is therefore followed to a share of its length, at which
//! it pauses as for an [event](super::events). By then it is round, since its relaxation time falls as the fourth power of its
//! radius and its life as the first, and what is left is the [life of a circle](vanishes_after).

use super::Trajectory;
use crate::{Observables, Status, theory::vanishing::vanishes_after};
use curvelax_flow::{
    flow::Flow,
    forcing::Forcing,
    number::Precision,
    scheme::{Parameters, member::Observed},
};

/// Share of the length of a curve at which it ends. A force of 10/R³ still makes it round by then.
const LEFT: f64 = 0.05;

/// A member that may vanish.
#[derive(Clone, Debug)]
pub(super) struct Vanishing {
    flow: Flow,
    forcing: Forcing,
    /// The length at which it is decided, in the member's unit, a number of the run's precision.
    level: f64,
}

impl Vanishing {
    /// That of a driven simple curve with the observables `start`, in lengths of `unit`.
    pub(super) fn new(
        flow: Flow,
        forcing: Forcing,
        start: &Observables,
        unit: f64,
        precision: Precision,
    ) -> Option<Vanishing> {
        let may = forcing.drive.is_some() && start.turning.abs() == 1;
        may.then(|| Vanishing { flow, forcing, level: precision.rounded(LEFT * start.length / unit) })
    }

    /// Lets the member pause at the level.
    pub(super) fn aim(&self, parameters: &mut Parameters<f64>) {
        parameters.watched = 1.0;
        parameters.low_length = parameters.low_length.max(self.level);
    }

    pub(super) fn is_due(&self, now: &Observed<f64>) -> bool {
        now.length <= self.level
    }

    /// The time that is left to a curve of this length and area, for unit mobility. The area falls at the rate F times the length,
    /// so 2A/L is the radius that lasts as long.
    fn left(&self, length: f64, area: f64) -> Option<f64> {
        vanishes_after(&self.flow, &self.forcing, 2.0 * area / length)
    }
}

impl Trajectory<'_> {
    /// Ends the member if it is at the length at which that is decided, and vanishes before its final time.
    pub(super) fn look_whether_it_vanishes(&mut self) {
        let due = |own: &mut Vanishing| self.counters.status == 0 && own.is_due(&self.report.now);
        let Some(own) = self.vanishing.take_if(due) else { return };
        let now = Observables::new(&self.report.now, 1.0, self.unit);
        // The unit of time over that of length to the fourth is the inverse mobility.
        let inverse_mobility = self.time_unit / self.unit.powi(4);
        let at = own.left(now.length, now.area.abs()).map(|left| self.now() + left * inverse_mobility);
        self.t_vanish = at.filter(|t| *t <= self.t_end);
        if self.t_vanish.is_some() {
            self.counters.status = Status::Vanished as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driven_simple_curve_pauses_at_a_twentieth_of_its_length() {
        let start = Observables { length: 8.0, turning: 1, ..Observables::default() };
        let of = |drive: Option<&str>, start: &Observables| {
            let forcing = Forcing { drive: drive.map(|drive| drive.parse().unwrap()), ..Forcing::default() };
            Vanishing::new(Flow::SurfaceDiffusion, forcing, start, 2.0, Precision::F32)
        };
        let own = of(Some("0.5"), &start).unwrap();
        let mut parameters = Parameters { low_length: -1.0, ..Parameters::default() };
        own.aim(&mut parameters);
        assert_eq!((parameters.watched, parameters.low_length), (1.0, f64::from(0.2_f32)));
        // An event at a longer length comes first.
        parameters.low_length = 3.0;
        own.aim(&mut parameters);
        assert_eq!(parameters.low_length, 3.0);
        let at = |length| Observed { length, ..Observed::default() };
        assert!(own.is_due(&at(0.1)) && !own.is_due(&at(0.3)));
        let radius = 0.7_f64;
        let left = own.left(std::f64::consts::TAU * radius, std::f64::consts::PI * radius * radius).unwrap();
        assert!((left - 1.4).abs() < 1e-12, "{left}");
        assert!(of(None, &start).is_none() && of(Some("0.5"), &Observables { turning: 0, ..start }).is_none());
    }
}
