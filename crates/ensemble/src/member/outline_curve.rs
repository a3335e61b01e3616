//! From the points of an outline to the curve that is perturbed and sampled: interpolation, and corners that are
//! rounded off.
//!
//! Neither depends on the nodes of a member, so times at more and more nodes have a limit: that of this curve. What
//! rounding and the points themselves do to a time is measured by other curves of the same outline, its
//! [variations](Variation).
//!
//! Corners are rounded on many more nodes than members have, `KNOTS` on the radius that no corner is to be sharper
//! than, by rounds of an implicit step of `x_t = -x_ssss` and equal spacing, as in [`mollifier`](super::mollifier). A
//! step moves points near corners only: a smooth arc of radius r by the share `(radius/r)⁴`. The nodes are scaled about
//! their centroid until they enclose the area of the outline again, and a spline through them is the curve. Outlines
//! without corners are left as they are, however sharp a smooth tip may be: its shape is given by points.
//!
//! Equal steps of `-x_ssss` take area away at a corner, with the cube of its curvature. Each round gives that back
//! where it was, spread over about twice the radius, as surface diffusion would not have taken it: what is left of
//! rounding is then a few times smaller. The length is not given back. A share of the excess at the start,
//! `--relax-to`, is therefore one of the excess of the outline before its corners are rounded: for a coast that is most
//! of it.

use std::{f64::consts::PI, sync::Arc};

use super::mollifier::{Mollified, Treated, put_back, sharpest_turn, smoothed};
use crate::Spec;
use glam::DVec2;

use curvelax_curve::{
    BaseCurve, Interpolation, Outline, RadialFactor, Sampler, Sampling, Spline, crossing, polygon, resample,
};

/// Nodes on the smallest radius.
const KNOTS: f64 = 4.0;
/// κ of one round, in units of the fourth power of the spacing of these nodes.
const STRENGTH: f64 = 4.0;
/// The same of the step that spreads the area that a round took away: over about twice the radius.
const SPREAD: f64 = 16.0 * KNOTS * KNOTS * KNOTS * KNOTS;
/// Samples between two nodes by which the area of the spline is measured.
const FINE: usize = 8;
/// Rounds before giving up.
const MAX_ROUNDS: u32 = 400;
/// Least samples by which a curve is measured.
const SAMPLES: usize = 4096;

/// Another curve of the same outline, by which a time is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variation {
    /// Through every second point.
    HalfThePoints,
    /// With corners rounded to twice the radius.
    TwiceTheRadius,
}

impl Variation {
    /// All of them.
    pub const ALL: [Variation; 2] = [Variation::HalfThePoints, Variation::TwiceTheRadius];
}

/// How outlines become curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Treatment {
    interpolation: Interpolation,
    rounding: f64,
    variation: Option<Variation>,
}

/// What an outline has become.
#[derive(Clone)]
pub(super) struct OutlineCurve {
    pub(super) curve: BaseCurve,
    /// The curve before its corners were rounded off, if they were.
    given: Option<BaseCurve>,
    pub(super) treated: Treated,
}

impl OutlineCurve {
    /// A curve that is no outline.
    pub(super) fn of(curve: BaseCurve) -> OutlineCurve {
        OutlineCurve { curve, given: None, treated: Treated::default() }
    }

    /// The excess before corners were rounded off, if they were, of the curve stretched by `factor`; none if it crosses
    /// itself.
    pub(super) fn given_excess(&self, factor: &RadialFactor) -> Option<f64> {
        let given = self.given.as_ref().filter(|given| given.is_simple())?;
        let centre = self.curve.centroid();
        let points = samples(given, |point| factor.apply(centre, point));
        let (length, area) = (polygon::length(&points), polygon::signed_area(&points));
        Some(length * length / (4.0 * PI * area) - 1.0).filter(|excess| *excess > 0.0)
    }
}

impl Treatment {
    /// That of the outlines of a spec.
    pub fn of(spec: &Spec, variation: Option<Variation>) -> Treatment {
        // The points are the nodes.
        let as_it_is = spec.sampling == Sampling::Points;
        Treatment {
            interpolation: if as_it_is { Interpolation::Polygon } else { spec.interpolation() },
            rounding: if as_it_is { 0.0 } else { spec.rounding() },
            variation,
        }
    }

    /// The curve of an outline.
    pub(super) fn curve(&self, outline: &Arc<Outline>) -> OutlineCurve {
        let half = match self.variation {
            Some(Variation::HalfThePoints) => outline.halved().map(Arc::new),
            _ => None,
        };
        let (curve, corners) = self.interpolation.curve(half.as_ref().unwrap_or(outline));
        let treated =
            Treated { points: outline.vertices().len() as u32, corners: corners as u32, ..Treated::default() };
        if corners == 0 || self.rounding == 0.0 {
            return OutlineCurve { treated, ..OutlineCurve::of(curve) };
        }
        let factor = if self.variation == Some(Variation::TwiceTheRadius) { 2.0 } else { 1.0 };
        let (round, area_change) = rounded(&curve, outline, factor * self.rounding);
        OutlineCurve { curve: round, given: Some(curve), treated: Treated { rounded: true, area_change, ..treated } }
    }

    /// Corners of the curve of an outline before they are rounded off.
    pub(super) fn corners(&self, outline: &Arc<Outline>) -> u32 {
        self.interpolation.curve(outline).1 as u32
    }

    /// Whether the variation makes another curve of an outline whose curve has so many `corners`.
    pub fn varies(&self, outline: &Outline, corners: u32, variation: Variation) -> bool {
        match variation {
            Variation::HalfThePoints => outline.halved().is_some(),
            Variation::TwiceTheRadius => self.rounding > 0.0 && corners > 0,
        }
    }
}

/// Points of a curve by which it is measured, each `moved`.
pub(super) fn samples(curve: &BaseCurve, moved: impl Fn(DVec2) -> DVec2) -> Vec<DVec2> {
    let mut points: Vec<DVec2> = curve.subdivision(SAMPLES).map(|(_, point)| moved(point)).collect();
    points.pop();
    points
}

/// The curve with corners rounded to a radius of at least `share` of its length, and the relative change of area that
/// was put back. Rounds end before the first crossing.
fn rounded(curve: &BaseCurve, outline: &Arc<Outline>, share: f64) -> (BaseCurve, f64) {
    let knots = (KNOTS / share).ceil() as usize;
    let Ok(sampler) = Sampler::new(curve.clone(), Sampling::Arclength, knots) else { return (curve.clone(), 0.0) };
    let (none, simple) = (RadialFactor::default(), curve.is_simple());
    let mut nodes = sampler.sample(&none);
    let mut rounds = 0;
    while sharpest_turn(&nodes) > 1.0 / KNOTS && rounds < MAX_ROUNDS {
        let next = resample(&with_local_area(&nodes, smoothed(&nodes, STRENGTH)));
        if simple && crossing(&next).is_some() {
            break;
        }
        nodes = next;
        rounds += 1;
    }
    let through = |nodes: &[DVec2]| {
        let spline = Spline::new(nodes, &vec![false; nodes.len()]);
        BaseCurve::from_spline(Arc::clone(outline), spline, simple)
    };
    // The spline encloses more than the polygon through its nodes.
    let curve = through(&nodes);
    let samples: Vec<DVec2> = curve.subdivision(FINE * knots).map(|(_, point)| point).collect();
    let area_change = polygon::signed_area(&samples) / sampler.area(&none) - 1.0;
    if !simple && area_change.abs() >= Mollified::DISTORTED {
        return (curve, area_change);
    }
    put_back(area_change, &mut nodes);
    (through(&nodes), area_change)
}

/// The nodes `after` a step, moved along their normals so that the area that the step took away comes back where it
/// did.
fn with_local_area(before: &[DVec2], after: Vec<DVec2>) -> Vec<DVec2> {
    let n = after.len();
    // Outward, as long as the part of the curve that belongs to a node.
    let normal = |i: usize| -0.5 * (after[(i + 1) % n] - after[(i + n - 1) % n]).perp();
    let lost: Vec<DVec2> = (0..n).map(|i| DVec2::new((before[i] - after[i]).dot(normal(i)), 0.0)).collect();
    let spread = smoothed(&lost, SPREAD);
    let moved = |i: usize| after[i] + normal(i) * (spread[i].x / normal(i).length_squared().max(f64::MIN_POSITIVE));
    (0..n).map(moved).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn treatment(text: &str) -> Treatment {
        Treatment::of(&Spec::from_toml(text).unwrap(), None)
    }

    /// A five-pointed star.
    fn star() -> Arc<Outline> {
        let corner = |j: usize| DVec2::from_angle(PI * j as f64 / 5.0) * if j.is_multiple_of(2) { 1.0 } else { 0.3 };
        Outline::from_points(&(0..10).map(corner).collect::<Vec<_>>()).unwrap().into()
    }

    /// Smallest radius of the circles through three of `n` nodes in a row, over the length.
    fn smallest_radius(curve: &BaseCurve, n: usize) -> f64 {
        let sampler = Sampler::new(curve.clone(), Sampling::Arclength, n).unwrap();
        1.0 / (n as f64 * sharpest_turn(&sampler.sample(&RadialFactor::default())))
    }

    #[test]
    fn corners_get_the_radius_that_is_asked_for_and_the_outline_keeps_its_area() {
        for share in [0.002, 0.005, 0.01] {
            let made = treatment(&format!("rounding = {share}")).curve(&star());
            let radius = smallest_radius(&made.curve, 8000);
            assert!(radius > 0.8 * share && radius < 2.0 * share, "{share}: {radius}");
            let sampler = Sampler::new(made.curve.clone(), Sampling::Arclength, 8000).unwrap();
            let area = sampler.area(&RadialFactor::default()) / polygon::signed_area(star().vertices());
            assert!((area - 1.0).abs() < 1e-4, "{share}: {area}");
            assert!(made.treated.rounded && made.treated.corners == 10 && made.treated.points == 10);
        }
        // The control.
        let sharp = treatment("rounding = 0").curve(&star());
        assert!(smallest_radius(&sharp.curve, 8000) < 1e-4 && !sharp.treated.rounded);
    }

    #[test]
    fn the_excess_before_rounding_is_that_of_the_outline() {
        let none = RadialFactor::default();
        let vertices = star().vertices().to_vec();
        let (length, area) = (polygon::length(&vertices), polygon::signed_area(&vertices));
        let exact = length * length / (4.0 * PI * area) - 1.0;
        for share in [0.002, 0.01] {
            let found = treatment(&format!("rounding = {share}")).curve(&star()).given_excess(&none).unwrap();
            assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
        }
        assert_eq!(treatment("rounding = 0").curve(&star()).given_excess(&none), None);
    }

    #[test]
    fn variations_are_those_of_outlines_that_they_change() {
        let ring: Vec<DVec2> = (0..40).map(|i| DVec2::from_angle(PI * f64::from(i) / 20.0)).collect();
        let ring = Arc::new(Outline::from_points(&ring).unwrap());
        let varied = |text: &str, outline: &Arc<Outline>| {
            let treatment = treatment(text);
            Variation::ALL.map(|of| treatment.varies(outline, treatment.corners(outline), of))
        };
        assert_eq!(varied("", &ring), [true, false]);
        assert_eq!(varied("interpolate = 'polygon'", &ring), [true, true]);
        assert_eq!(varied("", &star()), [false, true]);
        assert_eq!(varied("rounding = 0", &star()), [false, false]);
    }
}
