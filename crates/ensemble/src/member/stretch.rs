//! The stretch of a curve along its principal axes, at constant area, to a given reduced area 4πA/L², and the area and
//! length of starts for which both are given.
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
use curvelax_flow::forcing::{Conserved, Forcing};

use super::outline_curve::samples;
use crate::Spec;

/// The largest |s|: e² is the ratio of the axes for s = 1.
const MOST: f64 = 6.0;
const HALVINGS: u32 = 80;
/// A reduced area that is missed by less is reached: the samples of a circle are a polygon.
const NEAR: f64 = 1e-6;

/// What is kept is that of the nodes if these are off by no more, relatively: the first step moves them there, as those
/// that are evenly spaced on a curve of that area and length.
const NEAR_KEPT: f64 = 4e-3;

/// A linear map about a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    centre: DVec2,
    map: DMat2,
}

/// The sizes that are given for the starts of members.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sizes {
    /// 4πA/L², by `--reduced-area`.
    ReducedArea(f64),
    /// What is kept, by `--conserve-at`.
    Kept(Conserved, [f64; 2]),
}

impl Sizes {
    /// Those of the members of a cell of `spec`, at the typical values.
    pub(super) fn of(spec: &Spec) -> Option<Sizes> {
        let Forcing { conserved, kept, .. } = spec.typical().forcing;
        match conserved {
            Some(conserved) if spec.conserve_at.is_some() => Some(Sizes::Kept(conserved, kept)),
            _ => spec.reduced_area.as_ref().map(|drawn| Sizes::ReducedArea(*drawn.typical())),
        }
    }

    /// The reduced area, if it is given.
    pub(super) fn reduced_area(self) -> Option<f64> {
        match self {
            Sizes::ReducedArea(reduced) => Some(reduced),
            Sizes::Kept(Conserved::AreaAndLength, [area, length]) => Some(4.0 * PI * area / (length * length)),
            Sizes::Kept(..) => None,
        }
    }

    /// Whether nodes have to be fitted.
    pub(super) fn are_kept(self) -> bool {
        matches!(self, Sizes::Kept(..))
    }

    /// Scales a polygon about the origin until it has what is kept, after a stretch if that is both, unless it is near
    /// it: adaptive steps cannot make up for more.
    ///
    /// # Errors
    /// [`Error::Request`] for a polygon without an area.
    pub(super) fn fit(self, nodes: &mut [DVec2]) -> Result<()> {
        let Sizes::Kept(conserved, [area, length]) = self else { return Ok(()) };
        let off =
            [polygon::signed_area(nodes) / area, polygon::length(nodes) / length].map(|ratio| (ratio - 1.0).abs());
        let is_near = |kept: bool, off: f64| !kept || off <= NEAR_KEPT;
        if is_near(conserved.keeps_area(), off[0]) && is_near(conserved.keeps_length(), off[1]) {
            return Ok(());
        }
        if let (Some(reduced), 1 | -1) = (self.reduced_area(), polygon::turning_number(nodes)) {
            let stretch = Squeeze::of(nodes).nearest(reduced);
            nodes.iter_mut().for_each(|node| *node = stretch.apply(*node));
        }
        let (own_area, own_length) = (polygon::signed_area(nodes), polygon::length(nodes));
        let scale = match conserved {
            Conserved::Length => length / own_length,
            // The loops of an eight cancel, whatever is left of their area.
            _ if own_area > polygon::NO_AREA * own_length * own_length && polygon::turning_number(nodes) != 0 => {
                (area / own_area).sqrt()
            }
            _ => return Err(self.refused("a curve whose loops cancel has no area to keep", "use another --shape")),
        };
        nodes.iter_mut().for_each(|node| *node *= scale);
        Ok(())
    }

    /// What is wrong with them, and what to do.
    fn refused(self, problem: &str, remedy: &str) -> Error {
        match self {
            Sizes::ReducedArea(reduced) => Error::value("reduced-area", number(reduced), problem, remedy),
            Sizes::Kept(_, kept) => {
                // The other one is 0.
                let numbers: Vec<String> = kept.into_iter().filter(|kept| *kept != 0.0).map(number).collect();
                Error::value("conserve-at", numbers.join(","), problem, remedy)
            }
        }
    }
}

/// A polygon by its edges along its longer axis and across it.
struct Squeeze {
    centre: DVec2,
    axis: DVec2,
    edges: Vec<(f64, f64)>,
    area: f64,
    /// The s at which it is shortest.
    roundest: f64,
}

impl Squeeze {
    fn of(points: &[DVec2]) -> Squeeze {
        let centre = polygon::area_centroid(points);
        let axis = longer_axis(points, centre);
        let edges = polygon::edges(points).map(|edge| (axis.dot(edge), axis.perp_dot(edge))).collect();
        let mut own = Squeeze { centre, axis, edges, area: polygon::signed_area(points).abs(), roundest: 0.0 };
        // The sign of dL/ds.
        let part = |(a, b): (f64, f64)| (a * a - b * b) / a.hypot(b).max(f64::MIN_POSITIVE);
        own.roundest = halved([-MOST, MOST], |s| own.each(s).map(part).sum::<f64>() > 0.0);
        own
    }

    fn each(&self, s: f64) -> impl Iterator<Item = (f64, f64)> {
        let (long, short) = (s.exp(), (-s).exp());
        self.edges.iter().map(move |(a, b)| (a * long, b * short))
    }

    fn length(&self, s: f64) -> f64 {
        self.each(s).map(|(a, b)| a.hypot(b)).sum()
    }

    /// The reduced area after a stretch.
    fn reduced_area(&self, s: f64) -> f64 {
        4.0 * PI * self.area / self.length(s).powi(2)
    }

    /// The stretch to this reduced area, or to the next one that it has.
    fn nearest(&self, reduced: f64) -> Stretch {
        let wanted = (4.0 * PI * self.area / reduced).sqrt();
        let s = halved([self.roundest, self.roundest + MOST], |s| self.length(s) >= wanted);
        let turn = DMat2::from_cols(self.axis, self.axis.perp());
        let map = turn * DMat2::from_diagonal(DVec2::new(s.exp(), (-s).exp())) * turn.transpose();
        Stretch { centre: self.centre, map }
    }
}

impl Stretch {
    /// The one that gives `curve`, perturbed by `factor`, the reduced area of `sizes`, for member `index`; none if what
    /// is kept is near.
    ///
    /// # Errors
    /// [`Error::Request`] if the curve crosses itself, or is never so round.
    pub(super) fn to(
        (reduced, sizes): (f64, Sizes),
        curve: &BaseCurve,
        factor: &RadialFactor,
        index: u64,
    ) -> Result<Option<Stretch>> {
        let points = samples(curve, |point| factor.apply(curve.centroid(), point));
        if polygon::turning_number(&points).abs() != 1 {
            return Err(sizes.refused("a curve that is not simple has no reduced area", "use another --shape"));
        }
        let squeeze = Squeeze::of(&points);
        let (own, most) = (squeeze.reduced_area(0.0), squeeze.reduced_area(squeeze.roundest));
        if sizes.are_kept() && (own / reduced - 1.0).abs() <= NEAR_KEPT {
            return Ok(None);
        }
        if reduced > most * (1.0 + NEAR) {
            let most = rounded(most, 4);
            let (of, remedy) = match sizes {
                Sizes::ReducedArea(_) => ("", "use a lower one"),
                Sizes::Kept(..) => (" as 4 pi A/L^2", "use a longer L"),
            };
            let problem = format!("member {index} has at most {most}{of} whatever its stretch");
            return Err(sizes.refused(&problem, &format!("{remedy}, a smaller --amplitude or another --shape")));
        }
        Ok(Some(squeeze.nearest(reduced)))
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
    use std::f64::consts::TAU;

    fn stretched(shape: &str, reduced: f64) -> Result<Vec<DVec2>> {
        let curve = shape.parse::<Shape>().unwrap().resolve().unwrap();
        let factor = RadialFactor::new(2, [(0.1, 0.3), (0.05, 1.0)]);
        let curve =
            Stretch::to((reduced, Sizes::ReducedArea(reduced)), &curve, &factor, 7)?.unwrap().of(&curve, &factor);
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
        let [round, half] = [1.0, 0.5].map(|reduced| (reduced, Sizes::ReducedArea(reduced)));
        let round = Stretch::to(round, &curve, &none, 0).unwrap().unwrap();
        assert!(round.apply(DVec2::X).distance(DVec2::X) < 1e-2);
        let error = stretched("circle:1", 0.9999).unwrap_err().to_string();
        assert!(error.starts_with("--reduced-area 0.9999: member 7 has at most 0.9"), "{error}");
        let eight = "lemniscate:1".parse::<Shape>().unwrap().resolve().unwrap();
        assert!(Stretch::to(half, &eight, &none, 0).unwrap_err().to_string().contains("not simple"));
    }

    #[test]
    fn nodes_are_fitted_to_what_is_kept() {
        let ellipse = || -> Vec<DVec2> {
            (0..60).map(|i| DVec2::from_angle(0.3 + TAU * f64::from(i) / 60.0) * DVec2::new(2.0, 1.0)).collect()
        };
        let sizes = |nodes: &[DVec2]| [polygon::signed_area(nodes), polygon::length(nodes)];
        let start = sizes(&ellipse());
        for (conserved, kept) in [
            (Conserved::Area, [0.5, 0.0]),
            (Conserved::Area, [100.0, 0.0]),
            (Conserved::Length, [0.0, 1.0]),
            (Conserved::AreaAndLength, [3.0, 9.0]),
            (Conserved::AreaAndLength, [3.0, 6.2]),
        ] {
            let mut nodes = ellipse();
            Sizes::Kept(conserved, kept).fit(&mut nodes).unwrap();
            let found = sizes(&nodes);
            let off = [0, 1].map(|i| (found[i] / kept[i] - 1.0).abs() < 1e-12);
            assert_eq!(off, [conserved.keeps_area(), conserved.keeps_length()], "{kept:?}: {found:?}");
        }
        // Nodes that are near are left to the first step.
        let near = Sizes::Kept(Conserved::AreaAndLength, start.map(|size| 1.003 * size));
        let mut nodes = ellipse();
        near.fit(&mut nodes).unwrap();
        assert_eq!(nodes, ellipse());
        let mut eight: Vec<DVec2> = (0..64)
            .map(|i| TAU * (f64::from(i) + 0.5) / 64.0)
            .map(|t| DVec2::new(t.sin(), (2.0 * t).sin() - 0.1 * t.cos()))
            .collect();
        let error = Sizes::Kept(Conserved::Area, [1.0, 0.0]).fit(&mut eight).unwrap_err().to_string();
        assert!(error.starts_with("--conserve-at 1: a curve whose loops cancel"), "{error}");
    }
}
