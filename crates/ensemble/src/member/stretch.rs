//! The stretch of a curve along its principal axes, at constant area, to a given reduced area 4πA/L².
//!
//! By a factor e^s along the longer axis and e^-s across it the length is a convex function of s, so that it has one
//! minimum. The s beyond that at which it is the wanted one is found by halving.

use std::f64::consts::PI;

use glam::{DMat2, DVec2};

use curvelax_base::{
    error::{Error, Result},
    text::{number, rounded},
};
use curvelax_curve::{BaseCurve, RadialFactor, polygon};

/// Samples by which a curve is measured.
const SAMPLES: usize = 4096;
/// The largest |s|: e² is the ratio of the axes for s = 1.
const MOST: f64 = 6.0;
const HALVINGS: u32 = 80;
/// A reduced area that is missed by less is reached: the samples of a circle are a polygon.
const NEAR: f64 = 1e-6;

/// A linear map about a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    centre: DVec2,
    map: DMat2,
}

impl Stretch {
    /// The one that gives `curve`, perturbed by `factor`, this reduced area, for member `index`.
    ///
    /// # Errors
    /// [`Error::Request`] if the curve crosses itself, or is never so round.
    pub(super) fn to(reduced: f64, curve: &BaseCurve, factor: &RadialFactor, index: u64) -> Result<Stretch> {
        let mut points: Vec<DVec2> =
            curve.subdivision(SAMPLES).map(|(_, point)| factor.apply(curve.centroid(), point)).collect();
        points.pop();
        let refused = |problem: &str, remedy: &str| Err(Error::value("reduced-area", number(reduced), problem, remedy));
        if polygon::turning_number(&points).abs() != 1 {
            return refused("a curve that is not simple has none", "use another --shape");
        }
        let centre = polygon::area_centroid(&points);
        let axis = longer_axis(&points, centre);
        let (along, across): (Vec<f64>, Vec<f64>) =
            polygon::edges(&points).map(|edge| (axis.dot(edge), axis.perp_dot(edge))).unzip();
        let each = |s: f64| {
            let (long, short) = (s.exp(), (-s).exp());
            along.iter().zip(&across).map(move |(a, b)| (a * long, b * short))
        };
        let length = |s: f64| each(s).map(|(a, b)| a.hypot(b)).sum::<f64>();
        // The sign of dL/ds.
        let rises =
            |s: f64| each(s).map(|(a, b)| (a * a - b * b) / a.hypot(b).max(f64::MIN_POSITIVE)).sum::<f64>() > 0.0;
        let roundest = halved([-MOST, MOST], rises);
        let wanted = (4.0 * PI * polygon::signed_area(&points).abs() / reduced).sqrt();
        let least = length(roundest);
        if wanted < least * (1.0 - 0.5 * NEAR) {
            let most = rounded(reduced * (wanted / least).powi(2), 4);
            let problem = format!("member {index} has at most {most} whatever its stretch");
            return refused(&problem, "use a lower one, a smaller --amplitude or another --shape");
        }
        let s = halved([roundest, roundest + MOST], |s| length(s) >= wanted);
        let turn = DMat2::from_cols(axis, axis.perp());
        let map = turn * DMat2::from_diagonal(DVec2::new(s.exp(), (-s).exp())) * turn.transpose();
        Ok(Stretch { centre, map })
    }

    pub(super) fn apply(&self, point: DVec2) -> DVec2 {
        self.centre + self.map * (point - self.centre)
    }

    /// The stretched curve.
    pub(super) fn of(self, curve: &BaseCurve, factor: &RadialFactor) -> BaseCurve {
        let (curve, factor) = (curve.clone(), factor.clone());
        BaseCurve::from_formula(move |u| self.apply(factor.apply(curve.centroid(), curve.point(u))))
    }
}

/// Where between two places a condition begins to hold.
fn halved([mut before, mut after]: [f64; 2], holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (before + after);
        if holds(middle) { after = middle } else { before = middle }
    }
    after
}

/// The direction in which the points are farthest from `centre`, by their second moments.
fn longer_axis(points: &[DVec2], centre: DVec2) -> DVec2 {
    let (difference, mixed) = points.iter().fold((0.0, 0.0), |(difference, mixed), point| {
        let DVec2 { x, y } = *point - centre;
        (difference + x * x - y * y, mixed + 2.0 * x * y)
    });
    DVec2::from_angle(0.5 * f64::atan2(mixed, difference))
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_curve::Shape;

    fn stretched(shape: &str, reduced: f64) -> Result<Vec<DVec2>> {
        let curve = shape.parse::<Shape>().unwrap().resolve().unwrap();
        let factor = RadialFactor::new(2, [(0.1, 0.3), (0.05, 1.0)]);
        let curve = Stretch::to(reduced, &curve, &factor, 7)?.of(&curve, &factor);
        let mut points: Vec<DVec2> = curve.subdivision(20_000).map(|(_, point)| point).collect();
        points.pop();
        Ok(points)
    }

    #[test]
    fn a_curve_is_stretched_to_its_reduced_area_and_keeps_its_area() {
        for (shape, reduced) in [("ellipse:2,1", 0.6), ("ellipse:1,3", 0.9), ("nonconvex", 0.3), ("circle:1", 0.05)] {
            let area = |points: &[DVec2]| polygon::signed_area(points);
            let points = stretched(shape, reduced).unwrap();
            let found = 4.0 * PI * area(&points) / polygon::length(&points).powi(2);
            assert!((found / reduced - 1.0).abs() < 1e-5, "{shape}: {found}");
            let other = stretched(shape, 0.2).unwrap();
            assert!((area(&points) / area(&other) - 1.0).abs() < 1e-6, "{shape}");
        }
    }

    #[test]
    fn a_circle_is_stretched_to_an_ellipse_and_one_that_is_never_so_round_is_refused() {
        let curve = "circle:2".parse::<Shape>().unwrap().resolve().unwrap();
        let none = RadialFactor::default();
        let round = Stretch::to(1.0, &curve, &none, 0).unwrap();
        assert!(round.apply(DVec2::X).distance(DVec2::X) < 1e-2);
        let error = stretched("circle:1", 0.9999).unwrap_err().to_string();
        assert!(error.starts_with("--reduced-area 0.9999: member 7 has at most 0.9"), "{error}");
        let eight = "lemniscate:1".parse::<Shape>().unwrap().resolve().unwrap();
        assert!(Stretch::to(0.5, &eight, &none, 0).unwrap_err().to_string().contains("not simple"));
    }
}
