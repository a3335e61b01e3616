//! Sampling: n nodes on a curve, i = 1…n, equally spaced in the parameter or along the curve.
//!
//! Whatever does not depend on the member is tabulated once: the base curve's nodes, or a fine subdivision of it with
//! the direction of each sample from the centre. A member then costs one radial factor per sample.
//!
//! Equal spacing inverts the cumulative chord length of the *perturbed* samples. Within a piece the
//! parameter is interpolated linearly, and the curve itself is evaluated there: nodes thus lie on the curve up to
//! rounding, and only their spacing is approximate (to 5e-4 of itself on the smooth shapes that have a formula).
//!
//! Each cusp of a formula becomes a node. Every arc between cusps gets its share of the n nodes, rounded, equally
//! spaced. Spacings therefore differ by at most half a node per arc, and not at all if the arcs are equal and their
//! number divides n.

use std::sync::Arc;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::{BaseCurve, MAX_POINTS, Outline, RadialFactor, polygon};
use curvelax_base::error::Error;

/// Samples per node, and their minimum number, for measuring equal spacing. Halving it doubles the
/// error of the spacing; the time to create a member is proportional to it.
const SAMPLES_PER_NODE: usize = 32;
const MIN_SAMPLES: usize = 4096;
/// Maximum bytes of tabulated samples. More samples, as for 50 000 nodes, are instead computed twice for every member.
const LARGEST_TABLE: usize = 64 << 20;

/// How nodes are placed on a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// At u = i/n, the paper's. On a file's polygon `u` is the fraction of its length before perturbation.
    Parameter,
    /// Equally spaced along the perturbed curve; node n at u = 0.
    Arclength,
    /// A file's own points, in its order.
    Points,
}

/// A base curve prepared for sampling into n nodes, whatever its perturbation.
pub struct Sampler {
    curve: BaseCurve,
    nodes: usize,
    plan: Plan,
}

enum Plan {
    /// The base curve's nodes, each mapped.
    Fixed(Vec<DVec2>),
    /// A fine subdivision, mapped and measured for each member.
    Measured(Vec<CurvePoint>),
    /// A subdivision into this many pieces, too many for a table.
    Passing(usize),
}

/// A point of the base curve with its parameter and its direction from the centre.
#[derive(Clone, Copy)]
struct CurvePoint {
    u: f64,
    point: DVec2,
    direction: DVec2,
}

impl Sampler {
    /// Prepares `curve` for `nodes` nodes; with [`Sampling::Points`] the file's own number is used instead.
    ///
    /// # Errors
    /// [`Error::Request`] if `nodes` is not in 3 to [`MAX_POINTS`], or `Points` is requested for a curve that is not a
    /// file.
    pub fn new(curve: BaseCurve, sampling: Sampling, nodes: usize) -> Result<Sampler, Error> {
        if !(3..=MAX_POINTS).contains(&nodes) {
            let allowed = format!("allowed are 3 to {MAX_POINTS}");
            return Err(Error::value("points", nodes, "out of range", &allowed));
        }
        let plan = match (sampling, curve.outline()) {
            (Sampling::Parameter, _) => {
                Plan::Fixed((1..=nodes).map(|i| curve.point(i as f64 / nodes as f64)).collect())
            }
            (Sampling::Arclength, _) if pieces(nodes) * size_of::<CurvePoint>() > LARGEST_TABLE => {
                Plan::Passing(pieces(nodes))
            }
            (Sampling::Arclength, _) => Plan::Measured(samples(&curve, pieces(nodes)).collect()),
            (Sampling::Points, Some(outline)) => Plan::Fixed(outline.vertices().to_vec()),
            (Sampling::Points, None) => {
                let problem = "only a file has points of its own";
                let allowed = "use --shape file:PATH, parameter or arclength";
                return Err(Error::value("sampling", "points", problem, allowed));
            }
        };
        let nodes = if let Plan::Fixed(points) = &plan { points.len() } else { nodes };
        Ok(Sampler { curve, nodes, plan })
    }

    /// Returns the number of nodes n.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Returns its curve.
    pub fn curve(&self) -> &BaseCurve {
        &self.curve
    }

    /// Returns the polygon of its curve, if it is one.
    pub fn outline(&self) -> Option<&Arc<Outline>> {
        self.curve.outline()
    }

    /// Returns the bytes of the tables for `nodes` nodes, without the vertices of an outline.
    pub fn bytes(sampling: Sampling, nodes: usize) -> usize {
        match sampling {
            Sampling::Parameter | Sampling::Points => nodes * size_of::<DVec2>(),
            Sampling::Arclength => {
                Some(pieces(nodes) * size_of::<CurvePoint>()).filter(|of| *of <= LARGEST_TABLE).unwrap_or(0)
            }
        }
    }

    /// Returns the nodes i = 1…n, at index i-1, of the curve stretched by `factor` about its area centroid.
    pub fn sample(&self, factor: &RadialFactor) -> Vec<DVec2> {
        let centre = self.curve.centroid();
        match &self.plan {
            Plan::Fixed(points) => points.iter().map(|p| factor.apply(centre, *p)).collect(),
            Plan::Measured(samples) => {
                let passed: Vec<(f64, f64)> = measured(samples.iter().copied(), factor, centre).collect();
                self.equally_spaced(|| passed.iter().copied(), factor)
            }
            Plan::Passing(pieces) => {
                let walk = || measured(samples(&self.curve, *pieces), factor, centre);
                self.equally_spaced(walk, factor)
            }
        }
    }

    /// Returns the signed area of the curve stretched by `factor`, from the samples by which its length is measured:
    /// that of an outline does not depend on the number of nodes.
    pub fn area(&self, factor: &RadialFactor) -> f64 {
        let centre = self.curve.centroid();
        match &self.plan {
            Plan::Fixed(points) => enclosed(points.iter().map(|p| factor.apply(centre, *p))),
            Plan::Measured(samples) => {
                enclosed(mapped(samples.iter().copied(), factor, centre).map(|(_, point)| point))
            }
            Plan::Passing(pieces) => {
                enclosed(mapped(samples(&self.curve, *pieces), factor, centre).map(|(_, point)| point))
            }
        }
    }

    /// Places nodes by the samples that `walk` yields: the parameter of each, and the length up to it.
    fn equally_spaced<I>(&self, walk: impl Fn() -> I, factor: &RadialFactor) -> Vec<DVec2>
    where
        I: Iterator<Item = (f64, f64)>,
    {
        let centre = self.curve.centroid();
        let arcs = self.arcs(walk());
        let mut rest = walk();
        // The samples around the target.
        let [mut before, mut after] = [(); 2].map(|()| rest.next().unwrap_or_default());
        let mut arc = 0;
        let parameter = |i: usize| {
            while arcs[arc + 1].0 <= i {
                arc += 1;
            }
            let [(first, start), (last, end)] = [arcs[arc], arcs[arc + 1]];
            let target = start + (i - first) as f64 * ((end - start) / (last - first) as f64);
            while after.1 < target
                && let Some(next) = rest.next()
            {
                (before, after) = (after, next);
            }
            let share = (target - before.1) / (after.1 - before.1);
            before.0 + share * (after.0 - before.0)
        };
        (1..self.nodes).map(parameter).chain([0.0]).map(|u| factor.apply(centre, self.curve.point(u))).collect()
    }

    /// Node number and length at the start, at each cusp and at the end, where node n is node 0 again.
    fn arcs(&self, walk: impl Iterator<Item = (f64, f64)>) -> Vec<(usize, f64)> {
        let (n, cusps) = (self.nodes, self.curve.cusps());
        let (mut starts, mut length) = (Vec::new(), 0.0);
        for (u, reached) in walk {
            while cusps.get(starts.len()).is_some_and(|cusp| u >= *cusp) {
                starts.push(reached);
            }
            length = reached;
        }
        let mut arcs = vec![(0, 0.0)];
        // With fewer nodes than arcs the cusps cannot all be nodes.
        for (left, start) in (1..=cusps.len()).rev().zip(starts).filter(|_| n > cusps.len()) {
            let (previous, _) = arcs[arcs.len() - 1];
            let node = (start / length * n as f64).round() as usize;
            arcs.push((node.clamp(previous + 1, n - left), start));
        }
        arcs.push((n, length));
        arcs
    }
}

/// The parameter of each sample, and the length up to it on the curve stretched by `factor`.
fn measured(
    samples: impl Iterator<Item = CurvePoint>,
    factor: &RadialFactor,
    centre: DVec2,
) -> impl Iterator<Item = (f64, f64)> {
    let (mut previous, mut sum) = (None, 0.0);
    mapped(samples, factor, centre).map(move |(u, point)| {
        sum += previous.replace(point).map_or(0.0, |p: DVec2| p.distance(point));
        (u, sum)
    })
}

/// The parameter of each sample, and its place on the curve stretched by `factor`.
fn mapped(
    samples: impl Iterator<Item = CurvePoint>,
    factor: &RadialFactor,
    centre: DVec2,
) -> impl Iterator<Item = (f64, DVec2)> {
    samples.map(move |s| (s.u, factor.apply_towards(s.direction, centre, s.point)))
}

/// The signed area of a polygon that is not stored.
fn enclosed(points: impl Iterator<Item = DVec2>) -> f64 {
    let (mut first, mut previous, mut double) = (None, DVec2::ZERO, 0.0);
    for point in points {
        let arm = point - *first.get_or_insert(point);
        double += previous.perp_dot(arm);
        previous = arm;
    }
    0.5 * double
}

/// Minimum number of pieces for measuring a curve of `nodes` nodes.
fn pieces(nodes: usize) -> usize {
    MIN_SAMPLES.max(SAMPLES_PER_NODE * nodes)
}

fn samples(curve: &BaseCurve, pieces: usize) -> impl Iterator<Item = CurvePoint> {
    let centre = curve.centroid();
    let directed =
        move |(u, point): (f64, DVec2)| CurvePoint { u, point, direction: (point - centre).normalize_or_zero() };
    curve.subdivision(pieces).map(directed)
}

/// Returns equally many nodes, equally spaced along the closed polygon `nodes`; the last one stays fixed.
pub fn resample(nodes: &[DVec2]) -> Vec<DVec2> {
    let n = nodes.len();
    let closed: Vec<DVec2> = nodes[n - 1..].iter().chain(nodes).copied().collect();
    let reached = polygon::cumulated(closed.windows(2).map(|pair| pair[0].distance(pair[1])));
    let spacing = reached[n] / n as f64;
    let mut piece = 0;
    let at = |i: usize| {
        let target = i as f64 * spacing;
        while piece + 1 < n && reached[piece + 1] < target {
            piece += 1;
        }
        closed[piece].lerp(closed[piece + 1], (target - reached[piece]) / (reached[piece + 1] - reached[piece]))
    };
    (1..n).map(at).chain([nodes[n - 1]]).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::Shape;

    fn sampler(shape: &str, sampling: Sampling, nodes: usize) -> Sampler {
        Sampler::new(shape.parse::<Shape>().unwrap().resolve().unwrap(), sampling, nodes).unwrap()
    }

    fn island() -> &'static str {
        "file:../../examples/islands/jamaica.csv"
    }

    #[test]
    fn resampling_spaces_nodes_equally_on_the_polygon() {
        let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y, DVec2::new(0.0, 0.5), DVec2::new(0.0, 0.25)];
        let nodes = resample(&square);
        assert_eq!(nodes.len(), 6);
        assert_eq!(nodes[5], square[5]);
        let spacing = 4.0 / 6.0;
        assert!(nodes[0].distance(DVec2::new(spacing - 0.25, 0.0)) < 1e-12, "{}", nodes[0]);
        assert!(nodes[4].distance(DVec2::new(0.0, 0.25 + spacing)) < 1e-12, "{}", nodes[4]);
    }

    #[test]
    fn samples_that_are_not_tabulated_give_the_same_nodes_to_the_last_bit() {
        let law = crate::RadialFactor::default();
        for shape in ["ellipse:2,1", "astroid", island()] {
            let table = sampler(shape, Sampling::Arclength, 101);
            let passing = Sampler { plan: Plan::Passing(pieces(101)), ..sampler(shape, Sampling::Arclength, 101) };
            assert!(matches!(table.plan, Plan::Measured(_)));
            assert!(table.sample(&law) == passing.sample(&law), "{shape}");
        }
        let large = sampler("circle:1", Sampling::Arclength, 60_000);
        assert!(matches!(large.plan, Plan::Passing(_)) && Sampler::bytes(Sampling::Arclength, 60_000) == 0);
    }

    #[test]
    fn equal_parameters_reproduce_the_reference_nodes() {
        let reference = include_str!("../../../tests/data/reference/ref_sd_ellipse_2_1_n100_tau1e-3.csv");
        let rows: Vec<Vec<f64>> = reference
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|field| field.parse().unwrap()).collect())
            .filter(|row: &Vec<f64>| row[0] == 0.0)
            .collect();
        assert_eq!(rows.len(), 100);
        let nodes = sampler("ellipse:2,1", Sampling::Parameter, 100).sample(&RadialFactor::default());
        for row in rows {
            let node = nodes[row[1] as usize - 1];
            assert!(node.distance(DVec2::new(row[2], row[3])) < 1e-15, "node {}", row[1]);
        }
    }

    #[test]
    fn arclength_nodes_are_equally_spaced_along_the_perturbed_curve() {
        let factor = RadialFactor::new(2, [(0.1, 0.3), (-0.15, 2.0)]);
        for shape in ["ellipse:2,1", "nonconvex", "flower:3:0.3"] {
            // Enough nodes that the chords' deficit, (κh)²/24, is below the error of the interpolation.
            let nodes = sampler(shape, Sampling::Arclength, 16_001).sample(&factor);
            assert!(polygon::mesh_ratio(&nodes) < 1.0005, "{shape} {}", polygon::mesh_ratio(&nodes));
        }
        let circle = sampler("circle:1", Sampling::Arclength, 101).sample(&RadialFactor::default());
        assert!(polygon::mesh_ratio(&circle) < 1.0 + 1e-9);
    }

    #[test]
    fn the_area_is_that_of_the_perturbed_curve_and_not_of_its_nodes() {
        let none = RadialFactor::default();
        for nodes in [16, 1000] {
            let own = sampler(island(), Sampling::Arclength, nodes);
            let outline = polygon::signed_area(own.outline().unwrap().vertices());
            assert!((own.area(&none) / outline - 1.0).abs() < 1e-13, "{nodes}");
            // ∫ (1 + a cos 3θ)² / 2 dθ = π (1 + a²/2).
            let circle = sampler("circle:1", Sampling::Arclength, nodes);
            let stretched = circle.area(&RadialFactor::new(3, [(0.2, 0.5)]));
            assert!((stretched / (PI * 1.02) - 1.0).abs() < 1e-5, "{nodes}: {stretched}");
        }
        let passing = Sampler { plan: Plan::Passing(pieces(16)), ..sampler(island(), Sampling::Arclength, 16) };
        assert_eq!(passing.area(&none), sampler(island(), Sampling::Arclength, 16).area(&none));
        let points = sampler(island(), Sampling::Points, 16);
        assert!((points.area(&none) / passing.area(&none) - 1.0).abs() < 1e-13);
    }

    #[test]
    fn arclength_nodes_lie_on_the_curve_and_end_at_its_start() {
        let factor = RadialFactor::new(3, [(0.2, 0.5)]);
        let nodes = sampler("ellipse:2,1", Sampling::Arclength, 97).sample(&factor);
        for node in &nodes {
            let stretch = 1.0 + 0.2 * (3.0 * node.to_angle() + 0.5).cos();
            let on_ellipse = *node / stretch;
            let gap = (on_ellipse.x / 2.0).powi(2) + on_ellipse.y.powi(2) - 1.0;
            assert!(gap.abs() < 1e-13, "{gap:e} at {node}");
        }
        assert!(nodes[96].distance(DVec2::new(2.0 * (1.0 + 0.2 * 0.5_f64.cos()), 0.0)) < 1e-14);
    }

    #[test]
    fn each_cusp_of_an_astroid_is_a_node_whatever_their_number_and_its_perturbation() {
        let cusps = [DVec2::Y, -DVec2::X, -DVec2::Y, DVec2::X];
        for n in [6, 64, 97, 100, 101, 102, 103, 256, 1001] {
            let astroid = sampler("astroid", Sampling::Arclength, n);
            let nodes = astroid.sample(&RadialFactor::default());
            for (j, cusp) in (1..).zip(cusps) {
                let near = (0..n).min_by(|a, b| nodes[*a].distance(cusp).total_cmp(&nodes[*b].distance(cusp))).unwrap();
                assert!(nodes[near].distance(cusp) < 1e-15, "{n}: {} misses {cusp}", nodes[near]);
                assert!((near + 1).abs_diff(j * n / 4) <= 1, "{n}: cusp {j} is node {}", near + 1);
            }
            let ratio = polygon::mesh_ratio(&nodes);
            let unequal = if n.is_multiple_of(4) { 0.0 } else { 8.0 / n as f64 };
            assert!(n < 50 || ratio < 1.01 + unequal, "{n}: {ratio}");
            let factor = RadialFactor::new(2, [(0.2, 1.0), (0.3, 2.0)]);
            let stretched = astroid.sample(&factor);
            for cusp in cusps.map(|cusp| factor.apply(DVec2::ZERO, cusp)) {
                assert!(stretched.iter().any(|node| node.distance(cusp) < 1e-14), "{n}: {cusp}");
            }
        }
        assert_eq!(sampler("astroid", Sampling::Arclength, 3).sample(&RadialFactor::default()).len(), 3);
        let own = sampler("astroid", Sampling::Parameter, 102).sample(&RadialFactor::default());
        assert!(own.iter().all(|node| node.distance(DVec2::Y) > 1e-4));
    }

    #[test]
    fn arclength_nodes_of_an_unperturbed_polygon_share_its_length_equally() {
        let none = RadialFactor::default();
        let by_length = sampler(island(), Sampling::Arclength, 100).sample(&none);
        let by_parameter = sampler(island(), Sampling::Parameter, 100).sample(&none);
        for (a, b) in by_length.iter().zip(&by_parameter) {
            assert!(a.distance(*b) < 1e-12);
        }
    }

    #[test]
    fn a_perturbed_polygon_is_measured_through_all_its_corners() {
        let factor = RadialFactor::new(2, [(0.2, 0.0)]);
        let coarse = sampler(island(), Sampling::Arclength, 1000).sample(&factor);
        let fine = sampler(island(), Sampling::Arclength, 20_000).sample(&factor);
        for (i, node) in coarse.iter().enumerate() {
            assert!(node.distance(fine[20 * i + 19]) < 1e-6, "node {}", i + 1);
        }
    }

    #[test]
    fn a_file_s_own_points_are_the_nodes_in_order() {
        let own = sampler(island(), Sampling::Points, 100);
        let nodes = own.sample(&RadialFactor::default());
        assert_eq!((own.nodes(), nodes.len()), (47, 47));
        assert_eq!(nodes[0], DVec2::new(0.032240, 0.656819));
        // The file runs clockwise, so its last point is the second node.
        assert_eq!(nodes[1], DVec2::new(-0.135410, 0.673176));
    }

    #[test]
    fn points_of_a_formula_and_absurd_numbers_of_nodes_are_refused() {
        let refusal = |sampling, nodes| {
            let curve = "nonconvex".parse::<Shape>().unwrap().resolve().unwrap();
            Sampler::new(curve, sampling, nodes).err().unwrap().to_string()
        };
        assert!(refusal(Sampling::Points, 100).contains("--sampling points: only a file"));
        assert!(refusal(Sampling::Parameter, 0).contains("--points 0: out of range; allowed are 3 to 1000000"));
        assert!(refusal(Sampling::Arclength, usize::MAX).contains("--points"));
    }
}
