//! Interpolation: how a curve runs between the points of an outline.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{BaseCurve, Outline, Spline, crossing};

/// How a curve runs between the points of an outline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// As a cubic spline, with corners where the direction turns by more than
    /// [`MAX_SMOOTH_TURN`](super::MAX_SMOOTH_TURN); as a polygon if all points are corners, or if the spline would
    /// cross itself where the polygon does not.
    #[default]
    Auto,
    /// As a cubic spline without corners.
    Spline,
    /// Straight.
    Polygon,
}

/// Samples between two points by which the spline is searched for crossings, and most samples in all: so many points
/// are so close that the spline is next to the polygon.
const SAMPLES: usize = 8;
const MAX_SAMPLES: usize = 200_000;

impl Interpolation {
    /// Names in flags and files.
    pub const NAMES: [&str; 3] = ["auto", "spline", "polygon"];

    /// Returns the word used on the command line.
    pub fn name(self) -> &'static str {
        Interpolation::NAMES[self as usize]
    }

    /// The curve through the points of `outline`, with the number of its corners.
    pub fn curve(self, outline: &Arc<Outline>) -> (BaseCurve, usize) {
        let points = outline.vertices();
        let polygon = || (BaseCurve::from_outline(Arc::clone(outline)), points.len());
        let spline = match self {
            Interpolation::Polygon => return polygon(),
            Interpolation::Auto => Spline::with_corners(points),
            Interpolation::Spline => Spline::new(points, &vec![false; points.len()]),
        };
        let corners = spline.corners();
        if corners == points.len() {
            return polygon();
        }
        let simple = outline.is_simple() && !crosses(&spline, points.len());
        if self == Interpolation::Auto && simple != outline.is_simple() {
            return polygon();
        }
        (BaseCurve::from_spline(Arc::clone(outline), spline, simple), corners)
    }
}

/// Whether samples of a spline through `points` points cross themselves.
fn crosses(spline: &Spline, points: usize) -> bool {
    let pieces = points * SAMPLES;
    let mut samples: Vec<_> = spline.subdivision(pieces).map(|(_, point)| point).collect();
    samples.pop();
    pieces <= MAX_SAMPLES && crossing(&samples).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use std::f64::consts::TAU;

    fn outline(points: &[(f64, f64)]) -> Arc<Outline> {
        let points: Vec<DVec2> = points.iter().copied().map(DVec2::from).collect();
        Outline::from_points(&points).unwrap().into()
    }

    #[test]
    fn automatic_is_a_spline_where_points_are_close_and_a_polygon_where_all_are_corners() {
        let ring = |n: i32| {
            let angle = |i: i32| TAU * f64::from(i) / f64::from(n);
            outline(&(0..n).map(|i| (angle(i).cos(), angle(i).sin())).collect::<Vec<_>>())
        };
        let off = |curve: &BaseCurve| {
            let gap = |i: i32| (curve.point(f64::from(i) / 1001.0).length() - 1.0).abs();
            (0..1001).map(gap).fold(0.0, f64::max)
        };
        for (n, how, corners, gap) in [
            (13, Interpolation::Auto, 0, 0.0..1e-3),
            (12, Interpolation::Auto, 12, 3e-2..4e-2),
            (12, Interpolation::Spline, 0, 0.0..1e-3),
            (40, Interpolation::Auto, 0, 0.0..1e-5),
            (40, Interpolation::Polygon, 40, 3e-3..4e-3),
        ] {
            let (curve, found) = how.curve(&ring(n));
            assert!(found == corners && gap.contains(&off(&curve)), "{n} {how:?}: {found}, {:e}", off(&curve));
        }
    }

    #[test]
    fn a_spline_that_would_cross_is_only_made_if_it_is_asked_for() {
        // A bow of two sides that nearly touch: few points on the inner one, between which a spline swings out, and
        // many on the outer one, which has the same corners.
        let corner = |i: i32| DVec2::from_angle(TAU * f64::from(i) / 14.0);
        let outer =
            (0..8).rev().flat_map(|i| (0..10).map(move |j| corner(i + 1).lerp(corner(i), 0.1 * f64::from(j)) * 1.005));
        let inner = (0..=8).map(corner);
        let points: Vec<(f64, f64)> = inner.chain(outer).map(|p| (p.x, p.y)).collect();
        let thin = outline(&points);
        assert!(thin.is_simple());
        let (auto, corners) = Interpolation::Auto.curve(&thin);
        assert!(auto.is_simple() && corners == points.len(), "{corners}");
        let (asked, corners) = Interpolation::Spline.curve(&thin);
        assert!(!asked.is_simple() && corners == 0);
    }
}
