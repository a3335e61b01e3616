//! Lines, steps and bands through any number of points, thinned to visible detail and clipped to a frame.
//!
//! Points are in pixels, from left to right.

use std::fmt::Write;

use glam::DVec2;

use super::svg::coordinate;

/// Points of all lines of a picture together, at about 14 bytes each.
const BUDGET: f64 = 4000.0;

/// Maximum pixels omitted between two points of each of `lines` lines across `extent` pixels.
pub fn tolerance(lines: usize, extent: f64) -> f64 {
    (lines as f64 * extent / BUDGET).max(0.4)
}

/// The first and the last of `points`, and as many in between as are `least` apart along x.
pub fn thinned(points: &[DVec2], least: f64) -> Vec<DVec2> {
    let mut kept: Vec<DVec2> = Vec::new();
    for (i, point) in points.iter().enumerate() {
        let last = i + 1 == points.len();
        if last || kept.last().is_none_or(|before| point.x - before.x >= least) {
            kept.push(*point);
        }
    }
    kept
}

/// The corners of a step line that changes at `points`; changes smaller than `least` wait for the next.
pub fn steps(points: impl IntoIterator<Item = DVec2>, least: f64) -> Vec<DVec2> {
    let mut corners: Vec<DVec2> = Vec::new();
    let mut points = points.into_iter().peekable();
    while let Some(point) = points.next() {
        let Some(before) = corners.last().copied() else {
            corners.push(point);
            continue;
        };
        if points.peek().is_none() || (point.y - before.y).abs() >= least {
            corners.push(DVec2::new(point.x, before.y));
            corners.push(point);
        }
    }
    corners
}

/// Path data of the open line through `points`.
pub fn path(points: &[DVec2]) -> String {
    let mut data = String::new();
    let mut before = ["", ""].map(str::to_owned);
    for (i, point) in points.iter().enumerate() {
        let [x, y] = point.to_array().map(coordinate);
        // Writing into a string cannot fail.
        let _ = match (i, x == before[0], y == before[1]) {
            (0, ..) => write!(data, "M{x} {y}"),
            (_, true, true) => Ok(()),
            (_, false, true) => write!(data, "H{x}"),
            (_, true, false) => write!(data, "V{y}"),
            _ => write!(data, "L{x} {y}"),
        };
        before = [x, y];
    }
    data
}

/// Path data of the area between two lines.
pub fn band(high: &[DVec2], low: &[DVec2]) -> String {
    let outline: Vec<DVec2> = high.iter().chain(low.iter().rev()).copied().collect();
    if outline.len() < 3 { String::new() } else { path(&outline) + "Z" }
}

/// The parts of a line inside the rectangle from `low` to `high`.
pub fn clipped(points: &[DVec2], low: DVec2, high: DVec2) -> Vec<Vec<DVec2>> {
    let mut parts: Vec<Vec<DVec2>> = Vec::new();
    for pair in points.windows(2) {
        let Some((a, b)) = segment(pair[0], pair[1], low, high) else { continue };
        match parts.last_mut() {
            Some(part) if part.last() == Some(&a) => part.push(b),
            _ => parts.push(vec![a, b]),
        }
    }
    parts
}

/// The part of a segment inside the rectangle from `low` to `high` (Liang and Barsky).
fn segment(a: DVec2, b: DVec2, low: DVec2, high: DVec2) -> Option<(DVec2, DVec2)> {
    let along = b - a;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        for (room, rate) in [(a[axis] - low[axis], -along[axis]), (high[axis] - a[axis], along[axis])] {
            if rate == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if rate < 0.0 {
                enter = enter.max(room / rate);
            } else {
                leave = leave.min(room / rate);
            }
        }
    }
    // Ends that are inside stay unchanged, so that parts join.
    let at = |s: f64| {
        if s == 0.0 {
            a
        } else if s == 1.0 {
            b
        } else {
            a + s * along
        }
    };
    (enter < leave).then(|| (at(enter), at(leave)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[(f64, f64)]) -> Vec<DVec2> {
        list.iter().map(|(x, y)| DVec2::new(*x, *y)).collect()
    }

    #[test]
    fn steps_go_across_and_then_up() {
        let corners = steps(points(&[(0.0, 0.0), (1.0, 0.1), (2.0, 1.0), (3.0, 1.2)]), 0.5);
        assert_eq!(corners, points(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (3.0, 1.0), (3.0, 1.2)]));
        assert_eq!(path(&corners), "M0 0H2V1H3V1.2");
        assert_eq!(path(&steps([], 0.5)), "");
    }

    #[test]
    fn a_million_points_become_few() {
        let wave = |i: usize| DVec2::new(600.0 * i as f64 / 1e6, 100.0 + 90.0 * (i as f64 / 1e5).sin());
        let points: Vec<DVec2> = (0..=1_000_000).map(wave).collect();
        let kept = thinned(&points, tolerance(8, 600.0));
        assert!((300..600).contains(&kept.len()), "{}", kept.len());
        assert_eq!((kept.first(), kept.last()), (points.first(), points.last()));
        assert!(steps(points, tolerance(8, 600.0)).len() < 2000);
    }

    #[test]
    fn a_line_is_cut_where_it_leaves_the_frame() {
        let line = points(&[(-1.0, 1.0), (1.0, 1.0), (3.0, 3.0), (5.0, 1.0), (9.0, 1.0)]);
        let parts = clipped(&line, DVec2::ZERO, DVec2::new(6.0, 2.0));
        let expected = [points(&[(0.0, 1.0), (1.0, 1.0), (2.0, 2.0)]), points(&[(4.0, 2.0), (5.0, 1.0), (6.0, 1.0)])];
        assert_eq!(parts, expected);
        assert!(clipped(&points(&[(5.0, 3.0), (7.0, 1.5)]), DVec2::ZERO, DVec2::new(6.0, 2.0)).is_empty());
        assert!(clipped(&points(&[(0.0, 3.0), (6.0, 3.0)]), DVec2::ZERO, DVec2::new(6.0, 2.0)).is_empty());
    }

    #[test]
    fn a_band_goes_there_and_back() {
        let [high, low] = [&[(0.0, 2.0), (4.0, 2.0)], &[(0.0, 1.0), (4.0, 1.0)]].map(|list| points(list));
        assert_eq!(band(&high, &low), "M0 2H4V1H0Z");
        assert_eq!(band(&[], &[]), "");
    }
}
