//! The levels of observables that a member watches, one for each event of its spec, and thresholds that rounding hides.

use crate::{
    Event,
    request::event::{Condition, Observable},
};
use curvelax_flow::{
    number::{BIG, Precision},
    scheme::{Parameters, member::Observed},
};

/// Excess below which a curve is a regular polygon up to rounding: such a member is relaxed at time 0.
pub(super) const ROUND: f64 = 1e-13;
/// An excess is a difference of numbers near 1: a threshold below this multiple of ε is within its rounding.
const RESOLUTION: f64 = 128.0;
/// The same in f32, where it is computed by the differences from a regular polygon: there the nodes are rounded by some
/// 1/300 of the amplitude of the shape.
const RESOLUTION_SHORT: f64 = 1.0;
/// The same of crystals in f32, whose energies and areas are compared with those at rest.
const RESOLUTION_OF_CRYSTALS: f64 = 16.0;

/// An excess below which a threshold lies in the rounding of the precision.
pub(super) fn resolution(precision: Precision, is_crystal: bool) -> f64 {
    let multiple = match (precision, is_crystal) {
        (Precision::F64, _) => RESOLUTION,
        (Precision::F32, false) => RESOLUTION_SHORT,
        (Precision::F32, true) => RESOLUTION_OF_CRYSTALS,
    };
    multiple * precision.epsilon()
}

/// A condition of one member.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch {
    observable: Observable,
    falls: bool,
    /// The level in the member's units, a number of the run's precision. NaN if that cannot resolve it: it is never
    /// reached.
    level: f64,
    /// When it was reached.
    pub(super) t: Option<f64>,
}

impl Watch {
    /// The watches of a member that starts with the observables `start`, in lengths of `unit`.
    pub(super) fn of(
        events: &[Event],
        start: &Observed<f64>,
        unit: f64,
        precision: Precision,
        resolution: f64,
    ) -> Vec<Watch> {
        let watch = |Event { condition, .. }: &Event| {
            let Condition { observable, falls, .. } = *condition;
            let level = precision.rounded(condition.threshold_in(unit, start));
            let is_excess = observable == Observable::Excess;
            // As for t_half: the excess of a regular polygon is rounding.
            let is_round = is_excess && falls && start.excess <= ROUND;
            let watch = Watch { observable, falls, level: if level.abs() <= BIG { level } else { f64::NAN }, t: None };
            if is_round || watch.is_reached_by(start) {
                return Watch { t: Some(0.0), ..watch };
            }
            let is_lost = is_excess && level < resolution;
            Watch { level: if is_lost { f64::NAN } else { watch.level }, ..watch }
        };
        events.iter().map(watch).collect()
    }

    pub(super) fn is_pending(&self) -> bool {
        self.t.is_none() && !self.level.is_nan()
    }

    /// Positive before the level, 0 or negative from there on.
    pub(super) fn distance(&self, at: &Observed<f64>) -> f64 {
        let value = self.observable.of(at);
        if self.falls { value - self.level } else { self.level - value }
    }

    fn is_reached_by(&self, at: &Observed<f64>) -> bool {
        self.distance(at) <= 0.0
    }

    pub(super) fn is_due(&self, now: &Observed<f64>) -> bool {
        self.t.is_none() && self.is_reached_by(now)
    }

    /// Where between two reports it is reached, on a straight line.
    pub(super) fn on_line(&self, before: &Observed<f64>, now: &Observed<f64>) -> f64 {
        let (start, end) = (self.distance(before), self.distance(now));
        if start <= 0.0 { 0.0 } else { start / (start - end) }
    }
}

/// Sets the levels at which the member pauses: the nearest one of each observable on each side.
pub(super) fn aim_at_levels(parameters: &mut Parameters<f64>, watches: &[Watch]) {
    let (mut low, mut high) = ([-BIG; Observable::ALL.len()], [BIG; Observable::ALL.len()]);
    for Watch { observable, falls, level, .. } in watches.iter().filter(|watch| watch.is_pending()) {
        let place = *observable as usize;
        if *falls {
            low[place] = low[place].max(*level);
        } else {
            high[place] = high[place].min(*level);
        }
    }
    parameters.watched = f64::from(u8::from(watches.iter().any(Watch::is_pending)));
    (parameters.low, parameters.high) = (Observed::from_numbers(&low), Observed::from_numbers(&high));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_level_of_each_side_is_aimed_at() {
        let start = Observed { length: 8.0, k_max: 4.0, excess: 0.5, ..Observed::default() };
        let events: Vec<Event> = [
            "a = length <= 6",
            "b = length <= 7",
            "c = k_max >= 9",
            "d = k_max >= 5",
            "e = excess <= 0.5",
            "f = excess <= 1e-20",
        ]
        .iter()
        .map(|text| text.parse().unwrap())
        .collect();
        let mut watches = Watch::of(&events, &start, 1.0, Precision::F64, 1e-14);
        // One holds from the start, one is below the rounding.
        assert_eq!(watches.iter().map(|watch| watch.t).collect::<Vec<_>>(), [None, None, None, None, Some(0.0), None]);
        let mut p = Parameters::default();
        aim_at_levels(&mut p, &watches);
        assert_eq!((p.watched, p.low.length, p.high.length, p.high.k_max), (1.0, 7.0, BIG, 5.0));
        assert_eq!((p.low.excess, p.low.k_min, p.high.area), (-BIG, -BIG, BIG));
        watches[1].t = Some(0.1);
        aim_at_levels(&mut p, &watches);
        assert_eq!((p.low.length, p.high.k_max), (6.0, 5.0));
        watches.iter_mut().for_each(|watch| watch.t = Some(0.1));
        aim_at_levels(&mut p, &watches);
        assert_eq!((p.watched, p.low.length), (0.0, -BIG));
    }

    #[test]
    fn levels_are_in_the_units_of_the_member_and_in_numbers_of_the_run() {
        let events = ["a = length <= 6.4".parse().unwrap(), "b = k_max <= 0.1".parse().unwrap()];
        let start = Observed { length: 8.0, k_max: 4.0, ..Observed::default() };
        let levels =
            |precision| Watch::of(&events, &start, 4.0, precision, 1e-14).iter().map(|w| w.level).collect::<Vec<_>>();
        assert_eq!(levels(Precision::F64), [1.6, 0.4]);
        assert_eq!(levels(Precision::F32), [f64::from(1.6_f32), f64::from(0.4_f32)]);
    }
}
