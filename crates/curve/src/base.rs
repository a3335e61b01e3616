//! A shape ready for evaluation: a closed formula, or a spline, which may be a polygon, as a map of `u ∈ [0, 1]`.

use std::sync::Arc;

use glam::DVec2;

use super::{Outline, Spline, polygon};

/// Parameters at which a formula's area centroid is computed. The polygon's error is of second order: 1e-7 of the size
/// here. The number is fixed, because the centroid is the centre of the perturbation and a member must be the same
/// curve whatever its number of nodes.
const CENTROID_SAMPLES: usize = 1 << 14;

/// A closed plane curve, counter-clockwise if it has an orientation, at any parameter `u ∈ [0, 1]`.
#[derive(Clone)]
pub struct BaseCurve {
    kind: CurveKind,
    centroid: DVec2,
    cusps: Vec<f64>,
}

#[derive(Clone)]
enum CurveKind {
    Formula(Arc<dyn Fn(f64) -> DVec2 + Send + Sync>),
    /// A curve that was made from an outline: the polygon itself is a spline with corners alone.
    Outline {
        outline: Arc<Outline>,
        spline: Arc<Spline>,
        simple: bool,
    },
}

impl BaseCurve {
    /// Creates the curve `u ↦ formula(u)`, of period 1.
    pub fn from_formula(formula: impl Fn(f64) -> DVec2 + Send + Sync + 'static) -> BaseCurve {
        let samples: Vec<DVec2> = (0..CENTROID_SAMPLES).map(|j| formula(j as f64 / CENTROID_SAMPLES as f64)).collect();
        let centroid = polygon::area_centroid(&samples);
        BaseCurve { kind: CurveKind::Formula(Arc::new(formula)), centroid, cusps: Vec::new() }
    }

    /// Adds cusps at the parameters `cusps`, increasing multiples of 1/32 between 0 and 1.
    ///
    /// Equal spacing puts a node on each, since a cusp between two nodes would be cut off. `u = 0` is always a node.
    pub fn with_cusps(self, cusps: &[f64]) -> BaseCurve {
        BaseCurve { cusps: cusps.to_vec(), ..self }
    }

    /// Creates the closed polygon of a file; `u` is the fraction of its length from the first vertex.
    pub fn from_outline(outline: impl Into<Arc<Outline>>) -> BaseCurve {
        let outline = outline.into();
        let (points, simple) = (outline.vertices(), outline.is_simple());
        let centroid = polygon::area_centroid(points);
        let spline = Spline::new(points, &vec![true; points.len()]).into();
        BaseCurve { kind: CurveKind::Outline { outline, spline, simple }, centroid, cusps: Vec::new() }
    }

    /// Creates a curve that was made from an outline; `simple` says that it does not cross itself.
    pub fn from_spline(outline: Arc<Outline>, spline: Spline, simple: bool) -> BaseCurve {
        let mut samples: Vec<DVec2> = spline.subdivision(CENTROID_SAMPLES).map(|(_, point)| point).collect();
        samples.pop();
        let centroid = polygon::area_centroid(&samples);
        BaseCurve { kind: CurveKind::Outline { outline, spline: spline.into(), simple }, centroid, cusps: Vec::new() }
    }

    /// Returns whether it does not cross itself, as far as this is known: a formula counts as simple.
    pub fn is_simple(&self) -> bool {
        match &self.kind {
            CurveKind::Formula(_) => true,
            CurveKind::Outline { simple, .. } => *simple,
        }
    }

    /// Returns the point at `u ∈ [0, 1]`.
    pub fn point(&self, u: f64) -> DVec2 {
        match &self.kind {
            CurveKind::Formula(formula) => formula(u),
            CurveKind::Outline { spline, .. } => spline.point(u),
        }
    }

    /// Returns the centroid of the enclosed area: exact for a polygon, to 1e-7 of its size for a formula.
    pub fn centroid(&self) -> DVec2 {
        self.centroid
    }

    /// Returns the parameters between 0 and 1 on which equal spacing puts nodes.
    pub fn cusps(&self) -> &[f64] {
        &self.cusps
    }

    /// Returns the outline that the curve was made from, if there is one.
    pub fn outline(&self) -> Option<&Arc<Outline>> {
        match &self.kind {
            CurveKind::Formula(_) => None,
            CurveKind::Outline { outline, .. } => Some(outline),
        }
    }

    /// Returns `(u, point)` once round, with the first point again at `u = 1`. There are at least `pieces` pieces, and
    /// every vertex of a polygon and every point of a spline is included, so that no corner is cut.
    pub fn subdivision(&self, pieces: usize) -> Box<dyn Iterator<Item = (f64, DVec2)> + '_> {
        match &self.kind {
            CurveKind::Formula(formula) => {
                let at = move |j: usize| (j as f64 / pieces as f64, formula((j % pieces) as f64 / pieces as f64));
                Box::new((0..=pieces).map(at))
            }
            CurveKind::Outline { spline, .. } => Box::new(spline.subdivision(pieces)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centroid_of_a_formula_is_that_of_its_area() {
        // r = 1 + a cos θ has its area centroid at x = a(1 + a²/4)/(1 + a²/2): ∫r³ cos θ / 3 over ∫r² / 2.
        let a = 0.4_f64;
        let curve = BaseCurve::from_formula(move |u| {
            let direction = DVec2::from_angle(std::f64::consts::TAU * u);
            direction * (1.0 + a * direction.x) + DVec2::new(10.0, -5.0)
        });
        let exact = DVec2::new(10.0 + a * (1.0 + a * a / 4.0) / (1.0 + a * a / 2.0), -5.0);
        assert!(curve.centroid().distance(exact) < 1e-7, "{} {exact}", curve.centroid());
    }

    #[test]
    fn a_subdivision_starts_and_ends_at_the_same_point() {
        let curve = BaseCurve::from_formula(|u| DVec2::from_angle(std::f64::consts::TAU * u));
        let samples: Vec<_> = curve.subdivision(7).collect();
        assert_eq!(samples.len(), 8);
        assert_eq!((samples[0].0, samples[7].0), (0.0, 1.0));
        assert_eq!(samples[0].1, samples[7].1);
    }

    fn polygon<const N: usize>(points: [(f64, f64); N]) -> BaseCurve {
        BaseCurve::from_outline(Outline::from_points(&points.map(DVec2::from)).unwrap())
    }

    #[test]
    fn the_parameter_of_a_polygon_is_its_share_of_the_length() {
        let rectangle = polygon([(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 1.0)]);
        let expected = [(0.0, 0.0, 0.0), (0.25, 2.0, 0.0), (0.375, 3.0, 0.0), (0.5, 3.0, 1.0), (0.9375, 0.0, 0.5)];
        for (u, x, y) in expected {
            assert!(rectangle.point(u).distance(DVec2::new(x, y)) < 1e-15, "u = {u}");
        }
        assert_eq!(rectangle.point(1.0), rectangle.point(0.0));
    }

    #[test]
    fn a_subdivision_contains_every_vertex_and_lies_on_the_polygon() {
        let triangle = polygon([(0.0, 0.0), (10.0, 0.0), (0.0, 0.1)]);
        for pieces in [1, 2, 50] {
            let samples: Vec<_> = triangle.subdivision(pieces).collect();
            assert!(samples.len() > pieces);
            for vertex in triangle.outline().unwrap().vertices() {
                assert!(samples.iter().any(|(_, p)| p == vertex), "{vertex} of {pieces}");
            }
            assert!(samples.windows(2).all(|pair| pair[0].0 < pair[1].0));
            assert!(samples.iter().all(|(u, p)| triangle.point(*u).distance(*p) < 1e-14));
        }
    }
}
