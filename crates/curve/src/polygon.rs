//! Measures of closed polygons: length, area, centroid, turning number, mesh ratio.
//!
//! A polygon is the slice of its n ≥ 1 vertices; the edge from the last back to the first closes it. All areas
//! are signed, positive counter-clockwise. Sums are taken about the first vertex, not about the coordinate
//! origin, so a small curve far away keeps its digits.

use glam::DVec2;

/// Fraction of `L²` below which an area is rounding. The sums below have errors of about 1e-16·L²; a sliver of relative
/// width 1e-11 is still a curve.
pub const NO_AREA: f64 = 1e-12;

/// Returns the n edge vectors; the last leads back to the first vertex.
pub fn edges(points: &[DVec2]) -> impl Iterator<Item = DVec2> + '_ {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| *b - *a)
}

/// Each edge with the one after it.
fn turns(points: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> {
    edges(points).zip(edges(points).chain(edges(points)).skip(1))
}

/// Returns the length `L`.
pub fn length(points: &[DVec2]) -> f64 {
    edges(points).map(DVec2::length).sum()
}

/// Returns the sums of the lengths of none, one, two and all pieces of a line.
pub fn cumulated(lengths: impl Iterator<Item = f64>) -> Vec<f64> {
    let sums = lengths.scan(0.0, |sum, length| {
        *sum += length;
        Some(*sum)
    });
    [0.0].into_iter().chain(sums).collect()
}

/// Returns the signed area `A = ½ Σ x_i × x_{i+1}`, positive counter-clockwise.
pub fn signed_area(points: &[DVec2]) -> f64 {
    0.5 * fan(points).map(|(a, b)| a.perp_dot(b)).sum::<f64>()
}

/// The triangles of the fan about the first vertex, as their two far corners relative to it.
fn fan(points: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    points.windows(2).map(|pair| (pair[0] - points[0], pair[1] - points[0]))
}

/// Returns the centroid of the enclosed area, each part counted as often as the polygon winds round it.
///
/// A figure-eight whose loops cancel has no area and thus no centroid; if they nearly cancel, the centroid is far
/// away. If it is outside the bounding box of the points, the centroid of the line itself is returned.
pub fn area_centroid(points: &[DVec2]) -> DVec2 {
    let length = length(points);
    let double_area = 2.0 * signed_area(points);
    if double_area.abs() > 2.0 * NO_AREA * length * length {
        let moment: DVec2 = fan(points).map(|(a, b)| a.perp_dot(b) * (a + b)).sum();
        let centroid = points[0] + moment / (3.0 * double_area);
        let within = |(low, high): (DVec2, DVec2)| centroid.clamp(low, high) == centroid;
        if bounds(points.iter().copied()).is_some_and(within) {
            return centroid;
        }
    }
    let moment: DVec2 = points.iter().zip(edges(points)).map(|(p, e)| e.length() * (*p - points[0] + 0.5 * e)).sum();
    if length > 0.0 { points[0] + moment / length } else { points[0] }
}

/// Returns the lower left and upper right corner of the bounding box of the points, if there are any.
pub fn bounds(points: impl IntoIterator<Item = DVec2>) -> Option<(DVec2, DVec2)> {
    points.into_iter().map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.min(p), high.max(p)))
}

/// Returns the turning number, the number of revolutions of the edge direction: +1 for an embedded counter-clockwise
/// polygon, 0 for a figure-eight.
///
/// At each node the direction turns by less than π, so the hodograph (the closed polygon of the edge vectors) goes
/// round the origin as often as the direction does. Its winding number is the number of its edges that cross the
/// positive x-axis upwards minus those that cross it downwards: integers and signs, no angle. A node that turns by
/// exactly π has no sense of turning and is not counted.
pub fn turning_number(points: &[DVec2]) -> i32 {
    let crossing = |(d, e): (DVec2, DVec2)| match (d.y <= 0.0, e.y <= 0.0) {
        (true, false) if d.perp_dot(e) > 0.0 => 1,
        (false, true) if d.perp_dot(e) < 0.0 => -1,
        _ => 0,
    };
    turns(points).map(crossing).sum()
}

/// Returns the largest angle by which the direction turns at a node, in radians, from 0 to π.
pub fn largest_turn(points: &[DVec2]) -> f64 {
    turns(points).map(|(d, e)| d.angle_to(e).abs()).fold(0.0, f64::max)
}

/// Returns the ratio of the longest to the shortest edge; infinite if an edge has no length.
pub fn mesh_ratio(points: &[DVec2]) -> f64 {
    let (shortest, longest) = edges(points)
        .map(DVec2::length)
        .fold((f64::INFINITY, 0.0_f64), |(low, high), edge| (low.min(edge), high.max(edge)));
    longest / shortest
}

/// Sine of a turn to the right that still counts as straight: nodes on one side of a polygon are on a line up to
/// rounding.
const STRAIGHT: f64 = 1e-12;

/// Returns whether the polygon is convex and counter-clockwise: it goes round once and turns right at no node.
pub fn is_convex(points: &[DVec2]) -> bool {
    let turns_right = |(d, e): (DVec2, DVec2)| d.perp_dot(e) < -STRAIGHT * d.length() * e.length();
    turning_number(points) == 1 && !turns(points).any(turns_right)
}

/// Reverses the orientation of the polygon and keeps its first vertex first.
pub fn turn_round(points: &mut [DVec2]) {
    if let [_, rest @ ..] = points {
        rest.reverse();
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    fn sampled(n: usize, curve: impl Fn(f64) -> (f64, f64)) -> Vec<DVec2> {
        (1..=n).map(|i| curve(TAU * i as f64 / n as f64).into()).collect()
    }

    fn assert_near(found: f64, expected: f64, bound: f64) {
        assert!((found - expected).abs() <= bound, "{found} is not {expected} ± {bound}");
    }

    #[test]
    fn a_regular_polygon_has_its_length_and_area() {
        for n in [3, 7, 100] {
            let polygon = sampled(n, |t| (5.0 + 2.0 * t.cos(), 2.0 * t.sin() - 3.0));
            let m = n as f64;
            assert_near(length(&polygon), 4.0 * m * (PI / m).sin(), 1e-13);
            assert_near(signed_area(&polygon), 2.0 * m * (TAU / m).sin(), 1e-13);
            assert_near(area_centroid(&polygon).distance(DVec2::new(5.0, -3.0)), 0.0, 1e-14);
            assert_near(mesh_ratio(&polygon), 1.0, 1e-12);
            assert_eq!(turning_number(&polygon), 1);
        }
    }

    #[test]
    fn a_polygon_is_convex_while_it_turns_left_and_goes_round_once() {
        let dented = |depth: f64| {
            sampled(100, |t| ((1.0 + depth * (3.0 * t).cos()) * t.cos(), (1.0 + depth * (3.0 * t).cos()) * t.sin()))
        };
        // A ripple of mode k leaves a circle convex up to the amplitude 1/(k² - 1).
        assert!(is_convex(&dented(0.09)) && !is_convex(&dented(0.15)));
        let square: Vec<DVec2> = (0..40)
            .map(|i| f64::from(i % 10) * 0.1)
            .zip(0..40)
            .map(|(t, i)| match i / 10 {
                0 => DVec2::new(t, 0.0),
                1 => DVec2::new(1.0, t),
                2 => DVec2::new(1.0 - t, 1.0),
                _ => DVec2::new(0.0, 1.0 - t),
            })
            .map(|p| p.rotate(DVec2::from_angle(0.1)))
            .collect();
        assert!(is_convex(&square));
        let mut clockwise = square;
        turn_round(&mut clockwise);
        assert!(!is_convex(&clockwise));
        // Twice round is not convex, though every turn is to the left.
        assert!(!is_convex(&sampled(101, |t| ((2.0 * t).cos(), (2.0 * t).sin()))));
    }

    #[test]
    fn the_measures_of_an_ellipse_converge_to_the_integrals() {
        let ellipse = sampled(20_000, |t| (2.0 * t.cos(), t.sin()));
        assert_near(length(&ellipse), 9.688_448_220_547_675, 1e-6);
        assert_near(signed_area(&ellipse), TAU, 1e-6);
        assert_near(mesh_ratio(&ellipse), 2.0, 1e-6);
    }

    #[test]
    fn a_small_curve_far_away_keeps_its_digits() {
        let far = sampled(100, |t| (1e6 + t.cos(), 1e6 + t.sin()));
        assert_near(signed_area(&far), 50.0 * (TAU / 100.0).sin(), 1e-8);
        assert_near(area_centroid(&far).distance(DVec2::splat(1e6)), 0.0, 1e-8);
    }

    #[test]
    fn the_centroid_weighs_area_and_not_nodes() {
        let half_sampled: Vec<DVec2> =
            [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 0.5), (2.0, 1.0), (0.0, 1.0)].map(DVec2::from).into();
        assert_near(area_centroid(&half_sampled).distance(DVec2::new(1.0, 0.5)), 0.0, 1e-15);
    }

    #[test]
    fn a_figure_eight_turns_by_nothing_and_has_the_centroid_of_its_line() {
        let eight = sampled(101, |t| (3.0 + t.sin(), 1.0 + t.sin() * t.cos()));
        assert_eq!(turning_number(&eight), 0);
        assert_near(signed_area(&eight), 0.0, 1e-14);
        assert_near(area_centroid(&eight).distance(DVec2::new(3.0, 1.0)), 0.0, 1e-13);
    }

    #[test]
    fn loops_that_nearly_cancel_have_the_centroid_of_their_line() {
        let eight = |bulge: f64| sampled(1001, |t| (t.sin() * (1.0 + bulge * t.sin()), t.sin() * t.cos()));
        let slightly = eight(1e-6);
        assert!(signed_area(&slightly).abs() > NO_AREA * length(&slightly).powi(2));
        assert!(area_centroid(&slightly).length() < 1e-5, "{}", area_centroid(&slightly));
    }

    #[test]
    fn a_doubly_covered_circle_turns_twice_and_backwards_it_turns_minus_twice() {
        let mut double = sampled(101, |t| ((2.0 * t).cos(), (2.0 * t).sin()));
        assert_eq!(turning_number(&double), 2);
        let first = double[0];
        turn_round(&mut double);
        assert_eq!((turning_number(&double), double[0]), (-2, first));
    }

    #[test]
    fn the_turning_number_does_not_depend_on_the_direction_of_the_axes() {
        for j in 0..360 {
            let spin = DVec2::from_angle(f64::from(j).to_radians());
            let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|p| DVec2::from(p).rotate(spin));
            assert_eq!(turning_number(&square), 1, "{j} degrees");
        }
    }

    #[test]
    fn a_vanished_edge_makes_the_mesh_ratio_infinite() {
        let points = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(DVec2::from);
        assert_eq!(mesh_ratio(&points), f64::INFINITY);
    }
}
