//! Members that a driving force shrinks to a point.
//!
//! The steps that follow a curve to a point are ever shorter. It is therefore followed to a share of its length, at
//! which it pauses as for an event. By then it is round, since its relaxation time falls as the fourth power of its
//! radius and its life as the first, and what is left is the [life of a circle](vanishes_after).
//!
//! A crystal comes to rest long before, while steps follow it ever more slowly, and their errors add up. It is followed
//! until by theory its shape is that at rest, and is so, at the most to a quarter of its length. What is left is that
//! of a circle, too, since the ratio of area and length no longer changes: its area falls at the rate F L.
//!
//! An adaptive step must not pass the end of that life: nodes would cross the centre, and the curve would grow again,
//! upside down. Steps therefore end where half of what is left has passed, and again at half of the rest.

use std::f64::consts::{PI, TAU};

use crate::{
    Observables,
    theory::vanishing::{LITTLE_EXCESS, vanishes_after},
};
use curvelax_flow::{
    flow::Flow,
    forcing::Forcing,
    number::Precision,
    scheme::{Parameters, member::Observed},
};

/// Share of the length of a curve at which it ends; that of a crystal, whose edges grow apart on the way, at the
/// latest. Events and snapshots until then are found.
const LEFT: f64 = 0.1;
const CRYSTAL_LEFT: f64 = 0.25;
/// A crystal is at rest when by theory what its shape is off has fallen by this power of e, and its excess is little.
const AT_REST: f64 = 10.0;
/// The next level of one that is not, over the last.
const LOWER: f64 = 0.9;
/// The part of the life of a curve after which steps end.
const PART: f64 = 0.5;

/// A member that may vanish.
#[derive(Clone, Debug)]
pub(super) struct Vanishing {
    flow: Flow,
    forcing: Forcing,
    /// The radius of n nodes on a circle over 2A/L.
    outer: f64,
    /// The length at which it is decided, in the member's unit, a number of the run's precision.
    level: f64,
    /// The lowest one.
    least: f64,
    precision: Precision,
    /// When half of what was left will have passed, in the member's unit; infinite if it does not vanish.
    pub(super) until: f64,
}

impl Vanishing {
    /// That of a driven simple curve with the observables `start` of so many nodes, in lengths of `unit`.
    pub(super) fn new(
        flow: Flow,
        forcing: Forcing,
        (start, points): (&Observables, usize),
        unit: f64,
        precision: Precision,
    ) -> Option<Vanishing> {
        let may = forcing.drive.is_some() && start.turning.abs() == 1;
        may.then(|| {
            let left = if flow.is_crystal() { CRYSTAL_LEFT } else { LEFT };
            let least = left * start.length;
            let level = length_at_rest(&flow, &forcing, start).map_or(least, |length| length.max(least));
            let outer = (PI / points as f64).cos().recip();
            let [level, least] = [level, least].map(|length| precision.rounded(length / unit));
            let mut own = Vanishing { flow, forcing, outer, level, least, precision, until: 0.0 };
            own.look_ahead(0.0, start, unit);
            own
        })
    }

    /// Sets the time of the next look, from the time `now` of a curve.
    pub(super) fn look_ahead(&mut self, now: f64, at: &Observables, unit: f64) {
        let left = self.left(at).map(|left| left / unit.powi(4));
        self.until = left.map_or(f64::INFINITY, |left| now + PART * left);
    }

    /// Lets the member pause at the level.
    pub(super) fn aim(&self, parameters: &mut Parameters<f64>) {
        parameters.watched = 1.0;
        parameters.low.length = parameters.low.length.max(self.level);
    }

    /// Whether the curve vanishes, as far as its start tells.
    pub(super) fn is_expected(&self) -> bool {
        self.until.is_finite()
    }

    pub(super) fn is_due(&self, now: &Observed<f64>) -> bool {
        now.length <= self.level
    }

    /// Whether a curve that is due is to be followed on, to a lower level.
    pub(super) fn is_put_off(&mut self, now: &Observed<f64>) -> bool {
        now.excess > LITTLE_EXCESS && self.lower(now)
    }

    /// Lowers the level below the length of a curve, and says whether that can be.
    pub(super) fn lower(&mut self, now: &Observed<f64>) -> bool {
        while self.is_due(now) && self.level > self.least {
            self.level = self.precision.rounded((LOWER * self.level).max(self.least));
        }
        !self.is_due(now)
    }

    /// The time that is left to a curve, for unit mobility. Its area falls at the rate F times its length, so 2A/L is
    /// the radius that lasts as long; on a circle its nodes are a little outside.
    pub(super) fn left(&self, at: &Observables) -> Option<f64> {
        vanishes_after(&self.flow, &self.forcing, self.outer * (2.0 * at.area.abs() / at.length))
    }
}

/// The length of a crystal when it is at rest by theory: a mode that falls at the rate `λ(R) ~ R⁻⁴` has fallen by the
/// power `λT/3 ((R₀/R)³ - 1)` of e on the way from R₀ to R, if T is the life of a circle that shrinks evenly.
fn length_at_rest(flow: &Flow, forcing: &Forcing, start: &Observables) -> Option<f64> {
    let radius = (start.area.abs() / PI).sqrt();
    let life = vanishes_after(flow, forcing, radius).filter(|_| flow.is_crystal())?;
    let falls = flow.linear_rate(2, radius) * life;
    Some(TAU * radius * (1.0 + 3.0 * AT_REST / falls).cbrt().recip())
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_flow::crystal::Crystal;

    #[test]
    fn a_driven_simple_curve_pauses_at_a_tenth_of_its_length() {
        let start = Observables { length: 8.0, area: 4.0, turning: 1, ..Observables::default() };
        let of = |drive: Option<&str>, start: &Observables| {
            let forcing = Forcing { drive: drive.map(|drive| drive.parse().unwrap()), ..Forcing::default() };
            Vanishing::new(Flow::SurfaceDiffusion, forcing, (start, 4), 2.0, Precision::F32)
        };
        let own = of(Some("0.5"), &start).unwrap();
        let mut parameters = Parameters::default();
        parameters.low.length = -1.0;
        own.aim(&mut parameters);
        assert_eq!((parameters.watched, parameters.low.length), (1.0, f64::from(0.4_f32)));
        // A square with 2A/L = 1 has a radius of √2, and is looked at after 1 of 2√2, in units of the fourth power of
        // 2.
        assert!((own.until - 2_f64.sqrt() / 16.0).abs() < 1e-12);
        // An event at a longer length comes first.
        parameters.low.length = 3.0;
        own.aim(&mut parameters);
        assert_eq!(parameters.low.length, 3.0);
        let at = |length| Observed { length, ..Observed::default() };
        assert!(own.is_due(&at(0.3)) && !own.is_due(&at(0.5)));
        let radius = 0.7_f64;
        let (length, area) = (4.0 * 2_f64.sqrt() * radius, 2.0 * radius * radius);
        let left = own.left(&Observables { length, area, ..start }).unwrap();
        assert!((left - 1.4).abs() < 1e-12, "{left}");
        assert!(of(None, &start).is_none() && of(Some("0.5"), &Observables { turning: 0, ..start }).is_none());
    }

    #[test]
    fn a_crystal_pauses_when_by_theory_it_is_at_rest_and_later_if_it_is_not() {
        let start = Observables { length: 2.2 * PI, area: PI, turning: 1, ..Observables::default() };
        let of = |drive: &str| {
            let flow = Flow::Crystal("cos:4,0".parse().map(|energy| Crystal { energy, ..Crystal::default() }).unwrap());
            let forcing = Forcing { drive: Some(drive.parse().unwrap()), ..Forcing::default() };
            Vanishing::new(flow, forcing, (&start, 64), 1.0, Precision::F64).unwrap()
        };
        // λ = 12 on a circle of radius 1, whose life is 1/F.
        for (force, share) in [(0.1, 1.25_f64), (1.0, 3.5)] {
            let own = of(&format!("{force}"));
            assert!((own.level / (TAU / share.cbrt()) - 1.0).abs() < 1e-6, "{force}: {}", own.level / TAU);
        }
        assert_eq!(of("1e4").level, 0.25 * start.length);
        let mut own = of("0.1");
        let at = |length, excess| Observed { length, excess, ..Observed::default() };
        let level = own.level;
        assert!(!own.is_put_off(&at(level, 1e-4)) && own.level == level);
        assert!(own.is_put_off(&at(level, 1e-2)) && own.level == 0.9 * level);
        assert!(own.is_put_off(&at(0.8 * level, 1e-2)) && (own.level / (0.729 * level) - 1.0).abs() < 1e-12);
        // At a quarter nothing is put off.
        assert!(!own.is_put_off(&at(0.2 * start.length, 1e-2)) && own.level == own.least);
    }
}
