//! The rate at which the excess of a nearly round curve falls, by linear theory along its own radius.
//!
//! Circles of surface diffusion are at rest and those of Willmore flow grow by a law of their own, so the area at the
//! start decides: [`Spec::rate_in_theory`]. Circles of elastic flow with length penalty λ approach R = 1/√(2λ) more
//! slowly than their modes decay. The rate is then that of the radius while it is fitted:
//!
//! ```text
//! u = R²,  du/dt = 1/u - 2λ,    -d ln(excess)/dt = 2 (rate_m(R) + R'/R)
//! ```
//!
//! since the excess scales as the square of the mode's amplitude over the radius, and rate_m is that of the amplitude
//! ([`Flow::linear_rate`]). R starts as that of the circle of the initial area. The excess is matched where it is
//! known, at t_relax or t_half, and the rate is the slope of the least-squares line through the window of the fit.

use crate::{MemberValues, Outcome, Spec};
use curvelax_flow::flow::Flow;

/// Steps of the classical Runge–Kutta method in which excess or R² change by a factor of about e. The rate is then
/// right to 10⁻³.
const STEPS: f64 = 24.0;
/// Excess over its start at the top and the bottom of the window of the fit.
const WINDOW: [f64; 2] = [1e-1, 1e-3];
/// Distance in ln excess at which a point counts as on the edge of the window.
const NEAR: f64 = 1e-9;

/// The rate that a member of a cell with this spec should have by linear theory; `None` without one.
pub fn rate_of(spec: &Spec, outcome: &Outcome) -> Option<f64> {
    let values = &spec.values_of(outcome.member, outcome.cell).ok()?;
    match *values.flow {
        Flow::Elastic(penalty) if penalty > 0.0 && !values.forcing.acts() => {
            let decay = Decline::new(spec, values, outcome.start.area)?;
            // Theory knows no mobility: its time is that of length⁴.
            let (t, level) = decay.known_point(spec, outcome);
            let rate = outcome.rate.and_then(|_| decay.rate_in_window((spec.mobility() * t, level)));
            rate.map(|rate| spec.mobility() * rate)
        }
        Flow::Elastic(_) if !values.forcing.acts() => None,
        _ => spec.rate_in_theory(values, [outcome.start.area, outcome.start.length]),
    }
}

/// The rate at the time `t` of a curve of the typical values with this area at the start.
pub fn rate_at(spec: &Spec, area: f64, t: f64) -> Option<f64> {
    let values = spec.typical();
    spec.rate_in_theory(&values, [area, f64::NAN]).or_else(|| {
        let decline = Decline::new(spec, &values, area)?;
        decline.radius_squared(spec.mobility() * t).map(|u| spec.mobility() * decline.rate(u))
    })
}

/// A circle of elastic flow with a small mode.
struct Decline<'a> {
    flow: &'a Flow,
    penalty: f64,
    mode: u32,
    /// R² at the start.
    start: f64,
}

impl Decline<'_> {
    fn new<'a>(spec: &Spec, values: &'a MemberValues, area: f64) -> Option<Decline<'a>> {
        let Flow::Elastic(penalty) = *values.flow else { return None };
        if values.forcing.acts() {
            return None;
        }
        let mode = spec.slowest_mode(values)?;
        let start = area.abs() / std::f64::consts::PI;
        let known = penalty > 0.0 && start > 0.0 && start.is_finite();
        known.then_some(Decline { flow: &values.flow, penalty, mode, start })
    }

    /// d(R²)/dt.
    fn growth(&self, u: f64) -> f64 {
        1.0 / u - 2.0 * self.penalty
    }

    /// -d ln(excess)/dt.
    fn rate(&self, u: f64) -> f64 {
        2.0 * self.flow.linear_rate(self.mode, u.sqrt()) + self.growth(u) / u
    }

    /// R² after another `h`.
    fn step(&self, u: f64, h: f64) -> f64 {
        let s1 = self.growth(u);
        let s2 = self.growth(u + 0.5 * h * s1);
        let s3 = self.growth(u + 0.5 * h * s2);
        let s4 = self.growth(u + h * s3);
        u + h / 6.0 * (s1 + 2.0 * s2 + 2.0 * s3 + s4)
    }

    /// A step that changes neither R² nor the excess much.
    fn length(&self, u: f64) -> f64 {
        1.0 / (STEPS * (self.rate(u).abs() + self.growth(u).abs() / u))
    }

    /// R² at the time `t`; `None` if the numbers leave the range of f64.
    fn radius_squared(&self, t: f64) -> Option<f64> {
        let (mut u, mut left) = (self.start, t);
        while left > 0.0 {
            let h = self.length(u).min(left);
            let next = self.step(u, h);
            if !(h > 0.0 && next > 0.0 && next.is_finite()) {
                return None;
            }
            // At rest.
            if (next - u).abs() <= 4.0 * f64::EPSILON * u {
                break;
            }
            (u, left) = (next, left - h);
        }
        Some(u)
    }

    /// A time at which the excess is known, and its logarithm over that of the start.
    fn known_point(&self, spec: &Spec, outcome: &Outcome) -> (f64, f64) {
        let share = spec.threshold(outcome.start.excess) / outcome.start.excess;
        // Of an outline the threshold may be a share of another excess.
        let relaxed = outcome.t_relax.filter(|_| outcome.label.is_empty());
        let relaxed = relaxed.filter(|t| *t > 0.0 && share > 0.0 && share < 1.0).map(|t| (t, share.ln()));
        relaxed.or(outcome.t_half.map(|t| (t, 0.5_f64.ln()))).unwrap_or((0.0, 0.0))
    }

    /// The slope of the line through -ln excess at evenly spaced times in the window of the fit, for a curve with
    /// ln(excess/start) = `level` at `t`.
    fn rate_in_window(&self, (t, level): (f64, f64)) -> Option<f64> {
        let [top, bottom] = WINDOW.map(f64::ln);
        let mut at = Point { t, u: self.radius_squared(t)?, level };
        // Back to the top of the window if the known point is below it, or on to it, then to its bottom.
        while at.level < top - NEAR && at.t > 0.0 {
            at = self.moved(at, -self.length(at.u).min((top - at.level) / self.rate(at.u)).min(at.t))?;
        }
        while at.level > top + NEAR {
            at = self.moved(at, self.length(at.u).min((at.level - top) / self.rate(at.u)))?;
        }
        let mut line = Vec::new();
        while at.level > bottom + NEAR {
            let next = self.moved(at, self.length(at.u).min((at.level - bottom) / self.rate(at.u)))?;
            line.push((next.t - at.t, 0.5 * (at.t + next.t), 0.5 * (at.level + next.level)));
            at = next;
        }
        let weight: f64 = line.iter().map(|(w, ..)| w).sum();
        let mean_t = line.iter().map(|(w, t, _)| w * t).sum::<f64>() / weight;
        let [ty, tt] = line.iter().fold([0.0; 2], |[ty, tt], (w, t, y)| {
            let t = t - mean_t;
            [ty + w * t * y, tt + w * t * t]
        });
        Some(-ty / tt).filter(|rate| rate.is_finite())
    }

    /// The point a time `h` away; `None` if the numbers leave the range of f64, or nothing moves.
    fn moved(&self, Point { t, u, level }: Point, h: f64) -> Option<Point> {
        let next = self.step(u, h);
        let level = level - 0.5 * h * (self.rate(u) + self.rate(next));
        (next > 0.0 && level.is_finite() && t + h != t).then_some(Point { t: t + h, u: next, level })
    }
}

/// A circle while it grows.
#[derive(Clone, Copy)]
struct Point {
    t: f64,
    /// R².
    u: f64,
    /// ln(excess/start).
    level: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Observables;

    fn of(spec: &Spec, outcome: &Outcome) -> Option<f64> {
        rate_of(spec, outcome)
    }

    fn member(penalty: f64, radius: f64, t_relax: Option<f64>, t_half: Option<f64>) -> (Spec, Outcome) {
        let spec = Spec { flow: Flow::Elastic(penalty).into(), ..Spec::default() };
        let area = std::f64::consts::PI * radius * radius;
        let start = Observables { area, excess: 1e-3, ..Observables::default() };
        (spec, Outcome { start, t_relax, t_half, rate: Some(1.0), ..Outcome::default() })
    }

    #[test]
    fn at_rest_the_rate_is_constant() {
        for (penalty, radius, expected) in [(0.5, 1.0, 18.0), (0.125, 2.0, 18.0 / 16.0)] {
            let (spec, outcome) = member(penalty, radius, None, None);
            for outcome in [outcome.clone(), Outcome { t_half: Some(0.02), ..outcome.clone() }] {
                let found = of(&spec, &outcome).unwrap();
                assert!((found / expected - 1.0).abs() < 1e-9, "{found}");
            }
            assert!((rate_at(&spec, outcome.start.area, 3.0).unwrap() / expected - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_circle_far_from_rest_has_the_rate_of_its_own_radius() {
        let (penalty, radius) = (0.05, 1.0);
        // The circle at rest is 3.16 times as large, so its modes are 100 times as slow.
        let (spec, outcome) = member(penalty, radius, None, None);
        let free = of(&spec, &outcome).unwrap();
        assert!(free > 3.0 && 18.0 * (2.0 * penalty).powi(2) < 0.2, "{free}");
        // Later in time the circle is larger and the mode slower.
        let later = of(&spec, &Outcome { t_relax: Some(2.0), ..outcome.clone() }).unwrap();
        assert!(later < 0.7 * free, "{later} {free}");
        // The known point decides, not the start: with λ → 0 the law is algebraic, ln excess ~ -8 ln(1 + 2t).
        let (spec, outcome) = member(1e-9, radius, None, None);
        let slope = |t: f64| 16.0 / (1.0 + 2.0 * t);
        let found = rate_at(&spec, outcome.start.area, 0.3).unwrap();
        assert!((found / slope(0.3) - 1.0).abs() < 1e-6, "{found} {}", slope(0.3));
        let found = of(&spec, &outcome).unwrap();
        let [first, last] = [1e-1_f64, 1e-3].map(|share| 0.5 * (share.powf(-0.125) - 1.0));
        assert!(slope(last) < found && found < slope(first), "{found}");
        let line: Vec<(f64, f64)> = (0..=10_000)
            .map(|i| first + (last - first) * f64::from(i) / 1e4)
            .map(|t| (t, 8.0 * (1.0 + 2.0 * t).ln()))
            .collect();
        let expected = curvelax_statistics::Line::fit(&line).unwrap().unwrap().slope;
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }

    #[test]
    fn numbers_of_any_size_end() {
        for (penalty, area) in [(1e-300, 1e-200), (1e200, 1e200), (1.0, 1e-300), (1.0, 1e300), (1e-5, f64::MAX)] {
            for t_relax in [None, Some(1e-300), Some(1.0), Some(1e300)] {
                let (spec, mut outcome) = member(penalty, 1.0, t_relax, Some(1e-200));
                outcome.start.area = area;
                let found = of(&spec, &outcome);
                assert!(found.is_none_or(f64::is_finite), "{penalty} {area} {t_relax:?}: {found:?}");
                assert!(rate_at(&spec, area, 1e300).is_none_or(|rate| !rate.is_nan()));
            }
        }
    }

    #[test]
    fn without_a_fitted_rate_or_a_penalty_there_is_none() {
        let (spec, outcome) = member(0.5, 1.0, None, None);
        assert_eq!(of(&spec, &Outcome { rate: None, ..outcome.clone() }), None);
        assert_eq!(of(&Spec { flow: Flow::Elastic(-0.5).into(), ..spec.clone() }, &outcome), None);
        assert_eq!(of(&Spec { flow: Flow::SurfaceDiffusion.into(), ..spec }, &outcome), Some(24.0));
    }
}
