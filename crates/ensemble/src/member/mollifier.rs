//! Corners that n nodes cannot resolve are rounded off for these nodes before a run, as little as needed.
//!
//! The curve of an outline has [rounded corners](super::outline_curve) that enough nodes resolve. Fewer nodes can turn
//! by up to π there. The scheme's first steps then merge the nodes, whatever τ is. An outline sampled by arclength
//! therefore goes through rounds of `(I + κ D⁴) x_new = x_old`, where `D⁴` is the periodic fourth difference in the
//! node index (an implicit step of surface diffusion of duration `κ·spacing⁴`). After each round the nodes are spaced
//! equally again. The rounds end when no node turns by more than [`MAX_VERTEX_TURN`]. Without the new spacing, nodes
//! would crowd at a tip, and a sharp one would need hundreds of rounds. The effect reaches a few spacings far, so it
//! vanishes as n grows.
//!
//! Times go as the fourth power of the size, so a lost per cent of the area costs two per cent of the time. Nodes that
//! were changed are therefore scaled about their centroid until they enclose the area of the outline itself, not that
//! of the polygon through the nodes before, which depends on where the nodes were. The rounds and the change of area
//! before scaling are reported. Nodes that cross themselves are not scaled: their area is a difference.
//!
//! A part of the outline that is thinner than the spacing rules out equal spacing, small turns and no crossing at once.
//! The rounds then stop before the first crossing, and the problem is reported. If parts of the outline at least four
//! spacings apart along it are at least one spacing apart in the plane, no turn above the bound and no crossing remains
//! (checked on random polygons in `tests/it/polygons.rs`).

use glam::DVec2;
use serde::{Deserialize, Serialize};

use curvelax_curve::{crossing, polygon, resample};
use curvelax_flow::solver::{Ring, Row, System, direct};

/// Largest turn at a node that is left alone, in rad; a larger one merges nodes in the first steps of a run.
pub const MAX_VERTEX_TURN: f64 = 1.5;
/// κ of one round; a larger one rounds off more than needed.
const STRENGTH: f64 = 0.1;
/// Rounds before giving up. A curve that still turns has no side that n nodes resolve; its status will say so.
const MAX_ROUNDS: u32 = 100;

/// What was done to an outline, for reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Treated {
    /// Points of the outline; 0 if the curve is not one.
    pub points: u32,
    /// Those of them that are corners.
    pub corners: u32,
    /// Whether corners were rounded off, and relative change of the area by that, before it was put back.
    pub rounded: bool,
    /// See there.
    pub area_change: f64,
}

/// How rounding off changed a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mollified {
    /// Rounds made; 0 if the curve was left alone.
    pub rounds: u32,
    /// Relative change of the outline's area, before the nodes were scaled to put it back.
    pub area_change: f64,
    /// A node still turns by more than [`MAX_VERTEX_TURN`].
    pub sharp: bool,
    /// The nodes cross themselves, though the outline does not.
    pub crossed: bool,
    /// What was done to the outline before it was sampled.
    pub outline: Treated,
}

impl Mollified {
    /// Relative change of area before scaling, above which the curve counts as a different one.
    pub const DISTORTED: f64 = 0.1;

    /// Whether the change of area is above [`Mollified::DISTORTED`].
    pub fn distorted(&self) -> bool {
        self.area_change.abs() > Mollified::DISTORTED
    }
}

/// Rounds off the corners of `nodes` (n ≥ 6) where they are too sharp for the scheme. `simple` says that the outline
/// does not cross itself, so the nodes should not either. `area` computes the outline's own signed area, which nodes
/// that were changed get back.
pub fn mollify(nodes: &mut Vec<DVec2>, area: impl FnOnce() -> f64, simple: bool) -> Mollified {
    let crosses = |nodes: &[DVec2]| simple && crossing(nodes).is_some();
    let sharp = |nodes: &[DVec2]| sharpest_turn(nodes) > MAX_VERTEX_TURN;
    let mut done = Mollified { sharp: sharp(nodes), crossed: crosses(nodes), ..Mollified::default() };
    while (done.sharp || done.crossed) && done.rounds < MAX_ROUNDS {
        let next = resample(&smoothed(nodes, STRENGTH));
        let crossed = crosses(&next);
        if crossed && !done.crossed {
            break;
        }
        *nodes = next;
        done = Mollified { rounds: done.rounds + 1, sharp: sharp(nodes), crossed, ..done };
    }
    if done.rounds > 0 {
        done.area_change = polygon::signed_area(nodes) / area() - 1.0;
        // Loops of an outline that crosses itself can cancel, and their small area says nothing about the size.
        if simple && !done.crossed || !done.distorted() {
            put_back(done.area_change, nodes);
        }
    }
    done
}

/// Scales `nodes` about their centroid so that a relative change of their area is undone.
pub(super) fn put_back(area_change: f64, nodes: &mut [DVec2]) {
    let (centre, factor) = (polygon::area_centroid(nodes), (1.0 + area_change).sqrt().recip());
    if factor.is_finite() {
        nodes.iter_mut().for_each(|node| *node = centre + (*node - centre) * factor);
    }
}

/// Largest turn of the polygon at a node, in rad.
pub(super) fn sharpest_turn(nodes: &[DVec2]) -> f64 {
    let edges: Vec<DVec2> = polygon::edges(nodes).collect();
    let before = edges.iter().cycle().skip(edges.len() - 1);
    before.zip(&edges).map(|(a, b)| a.angle_to(*b).abs()).fold(0.0, f64::max)
}

/// One implicit step on the node index with this κ.
pub(super) fn smoothed(nodes: &[DVec2], strength: f64) -> Vec<DVec2> {
    let n = nodes.len();
    let (outer, inner) = (strength, -4.0 * strength);
    let diagonal = 1.0 + 6.0 * strength;
    let row = Row { a: outer / diagonal, b: inner / diagonal, d: inner / diagonal, e: outer / diagonal, weight: 1.0 };
    let rhs = [nodes.iter().map(|p| p.x / diagonal).collect(), nodes.iter().map(|p| p.y / diagonal).collect()];
    let (mut x, mut y) = (Ring::zeros(n), Ring::zeros(n));
    direct::solve(&System { rows: vec![row; n], rhs }, [&mut x, &mut y], &mut direct::Factor::new(n));
    x.nodes().iter().zip(y.nodes()).map(|(x, y)| DVec2::new(*x, *y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn star(spikes: usize, n: usize) -> Vec<DVec2> {
        let corner = |j: usize| {
            let radius = if j.is_multiple_of(2) { 1.0 } else { 0.2 };
            DVec2::from_angle(std::f64::consts::PI * j as f64 / spikes as f64) * radius
        };
        let corners: Vec<DVec2> = (0..2 * spikes).map(corner).collect();
        let at = |i: usize| {
            let s = i as f64 / n as f64 * corners.len() as f64;
            let j = s as usize;
            corners[j % corners.len()].lerp(corners[(j + 1) % corners.len()], s.fract())
        };
        (1..=n).map(at).collect()
    }

    #[test]
    fn a_smooth_curve_is_left_alone() {
        let mut circle: Vec<DVec2> =
            (0..50).map(|i| DVec2::from_angle(0.04 * std::f64::consts::PI * i as f64)).collect();
        let before = circle.clone();
        assert_eq!(mollify(&mut circle, || unreachable!(), true), Mollified::default());
        assert_eq!(circle, before);
    }

    #[test]
    fn sharp_corners_end_up_below_the_bound_and_the_effect_vanishes_with_n() {
        let change = |n| {
            let mut nodes = star(5, n);
            assert!(sharpest_turn(&nodes) > 2.0);
            // Ten triangles with sides 1 and 0.2 at an angle of π/5.
            let area = (0.2 * std::f64::consts::PI).sin();
            let done = mollify(&mut nodes, || area, true);
            assert!((polygon::signed_area(&nodes) / area - 1.0).abs() < 1e-12);
            assert!(!done.sharp && !done.crossed && done.distorted() == (done.area_change.abs() > 0.1));
            assert!(done.rounds > 0 && sharpest_turn(&nodes) <= MAX_VERTEX_TURN);
            assert_eq!(nodes.len(), n);
            done.area_change.abs()
        };
        let (coarse, fine) = (change(100), change(400));
        println!("at n = 100 {coarse:.3} of the area is lost before scaling, at 400 {fine:.4}");
        assert!(coarse < 0.1 && fine < 0.25 * coarse, "{coarse} {fine}");
    }

    /// A strip of length 1 with square ends; the first of its `n` nodes is a fraction of an edge after its corner.
    fn strip(width: f64, n: usize) -> Vec<DVec2> {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, width), (0.0, width)].map(DVec2::from);
        let fine: Vec<DVec2> = (0..4)
            .flat_map(|j| (0..5000).map(move |i| corners[j].lerp(corners[(j + 1) % 4], f64::from(i) / 5000.0)))
            .collect();
        resample(&fine).into_iter().skip(77).step_by(20_000 / n).collect()
    }

    #[test]
    fn a_strip_thinner_than_the_spacing_is_reported_and_not_crossed() {
        for n in [50, 100] {
            let spacing = 2.0 / n as f64;
            let mut thin = strip(0.1 * spacing, n);
            let area = polygon::signed_area(&thin);
            let done = mollify(&mut thin, || area, true);
            assert!(done.sharp && sharpest_turn(&thin) > MAX_VERTEX_TURN, "{n}: {done:?}");
            assert!(!done.crossed && crossing(&thin).is_none(), "{n}: {done:?}");
            let mut wide = strip(2.0 * spacing, n);
            let area = polygon::signed_area(&wide);
            let done = mollify(&mut wide, || area, true);
            assert!(!done.sharp && !done.crossed && crossing(&wide).is_none(), "{n}: {done:?}");
        }
    }

    #[test]
    fn nodes_that_cross_are_distinguished_from_an_outline_that_does() {
        let bow = |n: i32| {
            let corners = [(0.0, 0.0), (3.0, 3.0), (3.0, 0.0), (0.0, 1.0)].map(DVec2::from);
            (0..4 * n).map(move |i| {
                let (j, share) = ((i / n) as usize, f64::from(i % n) / f64::from(n));
                corners[j].lerp(corners[(j + 1) % 4], share)
            })
        };
        let mut nodes: Vec<DVec2> = bow(20).collect();
        let area = polygon::signed_area(&nodes);
        assert!(!mollify(&mut nodes, || area, false).crossed && crossing(&nodes).is_some());
        let mut nodes: Vec<DVec2> = bow(20).collect();
        let done = mollify(&mut nodes, || area, true);
        assert!(done.crossed == crossing(&nodes).is_some(), "{done:?}");
    }
}
