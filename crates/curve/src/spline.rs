//! A closed cubic spline through points, with corners at some of them.
//!
//! *Theory.* Piece i is a cubic of a parameter that grows by the chord `h_i` from point i to point i + 1, with the
//! second derivatives `M_i` and `M_{i+1}` at its ends. The first derivative is continuous at a smooth point if
//!
//! ```text
//! h_{i-1} M_{i-1} + 2(h_{i-1} + h_i) M_i + h_i M_{i+1} = 6 (e_i/h_i - e_{i-1}/h_{i-1}),   e_i = p_{i+1} - p_i.
//! ```
//!
//! At a corner pieces end: the second derivative of the last piece is constant, `M_i = M_{i-1}` seen from before and
//! `M_{i+1}` seen from behind. An arc thus keeps its curvature up to its end, and a piece between two corners is
//! straight.
//!
//! The parameter goes with the chord, not with its root. A chord differs from its arc in third order alone, so the
//! spline is exact to fourth order whatever the spacing of the points; with the root, which is called centripetal, it
//! is of second order (`points_at_unequal_distances_are_interpolated_to_fourth_order`). The root prevents loops where
//! the direction turns sharply, but there are corners.

use glam::DVec2;

use super::polygon;

/// Largest turn of the direction at a point, in rad, that is not a corner: half a radian, about 29°. A circle needs 13
/// points. Where the direction turns by more, points do not say what is between them.
pub const MAX_SMOOTH_TURN: f64 = 0.5;

/// Nodes and weights of Gauss's rule with five points on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_25),
    (0.5, 0.284_444_444_444_444_45),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_25),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// A closed curve of cubics through points.
#[derive(Clone, Debug)]
pub struct Spline {
    pieces: Vec<CubicPiece>,
    /// Length from point 0 to each point, and finally the total length.
    reached: Vec<f64>,
    corners: usize,
}

/// A cubic from `start` to `end`; `bends` are the second derivatives at its ends times a sixth of the squared chord.
#[derive(Clone, Copy, Debug)]
struct CubicPiece {
    start: DVec2,
    end: DVec2,
    bends: [DVec2; 2],
}

impl CubicPiece {
    /// The point at the share `t` of its parameter.
    fn point(&self, t: f64) -> DVec2 {
        let (s, [first, last]) = (1.0 - t, self.bends);
        self.start.lerp(self.end, t) + first * (s * s * s - s) + last * (t * t * t - t)
    }

    /// The derivative by `t`.
    fn velocity(&self, t: f64) -> DVec2 {
        let (s, [first, last]) = (1.0 - t, self.bends);
        self.end - self.start + first * (1.0 - 3.0 * s * s) + last * (3.0 * t * t - 1.0)
    }

    fn length(&self) -> f64 {
        match self.bends == [DVec2::ZERO; 2] {
            true => self.start.distance(self.end),
            false => GAUSS.iter().map(|(t, weight)| weight * self.velocity(*t).length()).sum(),
        }
    }
}

impl Spline {
    /// Creates the spline through at least three `points`, neighbours of which differ, with corners where `is_corner`.
    ///
    /// # Panics
    /// With fewer points, or unequal numbers.
    pub fn new(points: &[DVec2], is_corner: &[bool]) -> Spline {
        Spline::over(points, is_corner, DVec2::length)
    }

    /// With a parameter that grows along each edge by `growth`.
    fn over(points: &[DVec2], is_corner: &[bool], growth: impl Fn(DVec2) -> f64) -> Spline {
        let n = points.len();
        assert!(n >= 3 && is_corner.len() == n, "a closed curve has three points or more");
        let edges: Vec<DVec2> = (0..n).map(|i| points[(i + 1) % n] - points[i]).collect();
        let chords: Vec<f64> = edges.iter().map(|edge| growth(*edge)).collect();
        let row = |i: usize| {
            let (before, next) = ((i + n - 1) % n, (i + 1) % n);
            if is_corner[i] {
                return SplineRow { outer: [0.0; 2], diagonal: 1.0, right: DVec2::ZERO };
            }
            let [a, c] = [chords[before], chords[i]];
            let mut row =
                SplineRow { outer: [a, c], diagonal: 2.0 * (a + c), right: 6.0 * (edges[i] / c - edges[before] / a) };
            for (outer, end) in row.outer.iter_mut().zip([before, next]) {
                if is_corner[end] {
                    row.diagonal += std::mem::take(outer);
                }
            }
            row
        };
        let second = solve(&(0..n).map(row).collect::<Vec<_>>());
        let piece = |i: usize| {
            let next = (i + 1) % n;
            let bends = match [is_corner[i], is_corner[next]] {
                [true, true] => [DVec2::ZERO; 2],
                [true, false] => [second[next]; 2],
                [false, true] => [second[i]; 2],
                [false, false] => [second[i], second[next]],
            };
            let share = chords[i] * (chords[i] / 6.0);
            CubicPiece { start: points[i], end: points[next], bends: bends.map(|bend| bend * share) }
        };
        let pieces: Vec<CubicPiece> = (0..n).map(piece).collect();
        let reached = polygon::cumulated(pieces.iter().map(CubicPiece::length));
        Spline { pieces, reached, corners: is_corner.iter().filter(|corner| **corner).count() }
    }

    /// Creates the spline through `points` with corners where the direction turns by more than [`MAX_SMOOTH_TURN`].
    ///
    /// # Panics
    /// As [`Spline::new`].
    pub fn with_corners(points: &[DVec2]) -> Spline {
        let n = points.len();
        let edge = |i: usize| points[(i + 1) % n] - points[i % n];
        let is_corner = |i: usize| edge(i + n - 1).angle_to(edge(i)).abs() > MAX_SMOOTH_TURN;
        Spline::new(points, &(0..n).map(is_corner).collect::<Vec<_>>())
    }

    /// Returns the number of corners.
    pub fn corners(&self) -> usize {
        self.corners
    }

    /// Returns the length.
    pub fn length(&self) -> f64 {
        self.reached[self.pieces.len()]
    }

    /// Returns the point at `u ∈ [0, 1]`: at the points the fraction of the length, from the first, and between them
    /// linear in the parameter.
    pub fn point(&self, u: f64) -> DVec2 {
        let target = u * self.length();
        let n = self.pieces.len();
        let piece = self.reached[1..n].partition_point(|&reached| reached <= target);
        let share = (target - self.reached[piece]) / (self.reached[piece + 1] - self.reached[piece]);
        self.pieces[piece].point(share)
    }

    /// Returns `(u, point)` once round: every point of the spline, and between them pieces no longer than about `length
    /// / pieces`.
    pub(super) fn subdivision(&self, pieces: usize) -> impl Iterator<Item = (f64, DVec2)> {
        let length = self.length();
        let along = move |(i, piece): (usize, &CubicPiece)| {
            let (piece, start, end) = (*piece, self.reached[i], self.reached[i + 1]);
            let parts = ((end - start) / length * pieces as f64).ceil().max(1.0);
            (0..parts as usize).map(move |j| {
                let share = j as f64 / parts;
                ((start + share * (end - start)) / length, piece.point(share))
            })
        };
        self.pieces.iter().enumerate().flat_map(along).chain([(1.0, self.pieces[0].start)])
    }
}

/// An equation `outer[0]·M_{i-1} + diagonal·M_i + outer[1]·M_{i+1} = right`, with a dominant diagonal.
#[derive(Clone, Copy)]
struct SplineRow {
    outer: [f64; 2],
    diagonal: f64,
    right: DVec2,
}

/// Solves a closed ring of at least three equations: elimination of a chain, with the coupling across its ends as a
/// correction of rank one (Sherman and Morrison).
fn solve(rows: &[SplineRow]) -> Vec<DVec2> {
    let n = rows.len();
    let (before_first, after_last) = (rows[0].outer[0], rows[n - 1].outer[1]);
    let shift = -rows[0].diagonal;
    let diagonal = |i: usize| match i {
        0 => rows[0].diagonal - shift,
        i if i == n - 1 => rows[i].diagonal - before_first * (after_last / shift),
        i => rows[i].diagonal,
    };
    let border = |i: usize| match i {
        0 => shift,
        i if i == n - 1 => after_last,
        _ => 0.0,
    };
    // Of each row: the factor of the next unknown, the right-hand side, and that of the border.
    let mut chain: Vec<(f64, DVec2, f64)> = Vec::with_capacity(n);
    for (i, row) in rows.iter().enumerate() {
        let (factor, right, edge) = chain.last().copied().unwrap_or_default();
        let before = if i == 0 { 0.0 } else { row.outer[0] };
        let pivot = diagonal(i) - before * factor;
        chain.push((row.outer[1] / pivot, (row.right - before * right) / pivot, (border(i) - before * edge) / pivot));
    }
    for i in (0..n - 1).rev() {
        let (_, right, edge) = chain[i + 1];
        let own = &mut chain[i];
        own.1 -= own.0 * right;
        own.2 -= own.0 * edge;
    }
    let across = before_first / shift;
    let (_, first, first_edge) = chain[0];
    let (_, last, last_edge) = chain[n - 1];
    let correction = (first + across * last) / (1.0 + first_edge + across * last_edge);
    chain.iter().map(|(_, right, edge)| *right - *edge * correction).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    /// Points of an ellipse at distances of which every second one is half as large.
    fn ellipse(n: usize) -> Vec<DVec2> {
        let angle = |i: usize| TAU * (i as f64 + if i % 2 == 1 { 1.0 / 3.0 } else { 0.0 }) / n as f64;
        (0..n).map(|i| DVec2::new(1.5 * angle(i).cos(), angle(i).sin())).collect()
    }

    /// Largest distance from the ellipse.
    fn gap(spline: &Spline) -> f64 {
        let off = |(_, p): (f64, DVec2)| ((p / DVec2::new(1.5, 1.0)).length() - 1.0).abs();
        spline.subdivision(20_000).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn the_equations_are_solved_whatever_the_ring() {
        let rows: Vec<SplineRow> = (0..7)
            .map(|i| SplineRow {
                outer: [0.3 + 0.1 * f64::from(i), 1.0 - 0.1 * f64::from(i)],
                diagonal: 2.7 + 0.2 * f64::from(i),
                right: DVec2::new(f64::from(i), 1.0 - f64::from(i * i)),
            })
            .collect();
        for n in 3..=7 {
            let found = solve(&rows[..n]);
            for (i, row) in rows[..n].iter().enumerate() {
                let left =
                    row.outer[0] * found[(i + n - 1) % n] + row.diagonal * found[i] + row.outer[1] * found[(i + 1) % n];
                assert!(left.distance(row.right) < 1e-13, "{n} {i}: {left} {}", row.right);
            }
        }
    }

    #[test]
    fn points_at_unequal_distances_are_interpolated_to_fourth_order() {
        let [coarse, fine] = [40, 80].map(|n| gap(&Spline::with_corners(&ellipse(n))));
        let order = (coarse / fine).log2();
        assert!(coarse < 1e-4 && order > 3.7, "{coarse:e} {fine:e}: order {order}");
        // The controls: the root of the chord, and the polygon, are of second order.
        let centripetal = |n| gap(&Spline::over(&ellipse(n), &vec![false; n], |edge| edge.length().sqrt()));
        let polygon = |n| gap(&Spline::new(&ellipse(n), &vec![true; n]));
        for [coarse, fine] in [[80, 160].map(centripetal), [40, 80].map(polygon)] {
            let order = (coarse / fine).log2();
            assert!(coarse > 1e-4 && order < 2.4, "{coarse:e} {fine:e}: order {order}");
        }
    }

    #[test]
    fn it_passes_through_its_points_and_is_smooth_there() {
        let points = ellipse(40);
        let spline = Spline::with_corners(&points);
        assert_eq!(spline.corners(), 0);
        let n = points.len();
        for (i, point) in points.iter().enumerate() {
            let (piece, next) = (spline.pieces[i], spline.pieces[(i + 1) % n]);
            assert_eq!(piece.start, *point);
            assert!(piece.point(1.0).distance(next.start) < 1e-15);
            let [before, after] = [piece.velocity(1.0), next.velocity(0.0)];
            let chord = |p: &CubicPiece| p.start.distance(p.end);
            assert!((before / chord(&piece)).distance(after / chord(&next)) < 1e-13, "{i}");
            assert!(spline.point(spline.reached[i] / spline.length()).distance(*point) < 1e-13, "{i}");
        }
        assert_eq!(spline.point(0.0), spline.point(1.0).lerp(spline.point(0.0), 1.0));
    }

    #[test]
    fn its_length_is_that_of_its_samples() {
        let spline = Spline::with_corners(&ellipse(60));
        let samples: Vec<DVec2> = spline.subdivision(100_000).map(|(_, p)| p).collect();
        let length = polygon::length(&samples);
        assert!((spline.length() / length - 1.0).abs() < 1e-8, "{} {length}", spline.length());
    }

    #[test]
    fn straight_sides_stay_straight_and_corners_corners() {
        let side = |from: DVec2, to: DVec2| (0..5).map(move |i| from.lerp(to, f64::from(i * i) / 25.0));
        let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let square: Vec<DVec2> = (0..4).flat_map(|i| side(corners[i], corners[(i + 1) % 4])).collect();
        let spline = Spline::with_corners(&square);
        assert_eq!(spline.corners(), 4);
        let off = |p: DVec2| [p.x, p.y, 1.0 - p.x, 1.0 - p.y].map(f64::abs).into_iter().fold(f64::INFINITY, f64::min);
        assert!(spline.subdivision(1000).all(|(_, p)| off(p) < 1e-15));
        assert!((spline.length() - 4.0).abs() < 1e-14);
        // Without corners it swings out.
        let all_smooth = Spline::new(&square, &[false; 20]);
        assert!(all_smooth.subdivision(1000).any(|(_, p)| off(p) > 1e-2));
    }

    #[test]
    fn an_arc_between_corners_keeps_its_curvature() {
        // A half disk: its arc is of third order at its ends, and exact to a few 1e-5 at this spacing.
        let arc: Vec<DVec2> = (0..=30).map(|i| DVec2::from_angle(PI * f64::from(i) / 30.0)).collect();
        let spline = Spline::with_corners(&arc);
        assert_eq!(spline.corners(), 2);
        let on_arc = |p: &DVec2| p.y > 1e-9;
        let worst = spline
            .subdivision(5000)
            .map(|(_, p)| p)
            .filter(on_arc)
            .map(|p| (p.length() - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(worst < 6e-5, "{worst:e}");
    }
}
