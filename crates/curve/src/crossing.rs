//! Tests whether a closed polygon crosses itself, by a tree of boxes over its edges, in about n log n.
//!
//! Neighbouring edges of a curve are close to each other, so runs of consecutive edges form a good hierarchy without
//! any sorting: the leaves are the boxes around single edges, every other box holds two runs of half its length.
//! A search for meeting edges descends into a pair of runs only if their boxes overlap. Unlike a uniform grid,
//! this adapts to outlines with a million points in one bay and ten on the open coast. Many long edges across each
//! other cost n², but there a meeting pair is found at once. The worst case, n², is long slanted edges side by side,
//! such as a comb of needles; [`crossing_within`] gives up on it.

use glam::DVec2;

/// Returns a pair of edges `(i, j)`, i < j, that cross or touch, or `None` if the polygon is embedded.
///
/// Edge i runs from vertex i to vertex i+1 (indices from 0, the last edge leads back to vertex 0). Neighbouring
/// edges share a vertex and meet only if one folds back onto the other. Which pair is returned is
/// fixed by the polygon but has no further meaning. The signs of areas are computed in f64 without error bounds, so
/// a touch is exact only if its coordinates are.
pub fn crossing(points: &[DVec2]) -> Option<(usize, usize)> {
    crossing_within(points, u64::MAX).unwrap_or_default()
}

/// Like [`crossing`], or returns [`Undecided`] after comparing `comparisons` pairs of boxes, some ten nanoseconds each.
pub fn crossing_within(points: &[DVec2], comparisons: u64) -> Result<Option<(usize, usize)>, Undecided> {
    if points.len() < 3 {
        return Ok(None);
    }
    let mut left = comparisons;
    match BoxTree::over_edges(points).meeting_pair(1, 1, points, &mut left) {
        None if left == 0 => Err(Undecided),
        found => Ok(found),
    }
}

/// Unknown whether the polygon crosses itself: too many of its edges are side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Undecided;

/// Returns the smallest distance between two strands of the polygon that run in opposite directions, or `limit` if that
/// is less.
///
/// A simple curve first touches itself where two strands of opposite directions meet. Until its nodes have moved half
/// this far it therefore stays simple, except for hairpins of less than three edges.
pub fn clearance(points: &[DVec2], limit: f64) -> f64 {
    let directions = BoxTree::over(points.len(), |i| {
        let (a, b) = edge(points, i);
        Bounds { low: b - a, high: b - a }
    });
    let mut nearest = limit;
    BoxTree::over_edges(points).nearest_opposed(1, 1, points, &directions, &mut nearest);
    nearest
}

/// An axis-parallel box; empty while `low` exceeds `high`.
#[derive(Clone, Copy)]
struct Bounds {
    low: DVec2,
    high: DVec2,
}

impl Bounds {
    const EMPTY: Bounds = Bounds { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY };

    fn union(self, other: Bounds) -> Bounds {
        Bounds { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    fn distance(self, other: Bounds) -> f64 {
        (self.low - other.high).max(other.low - self.high).max(DVec2::ZERO).length()
    }

    /// A lower bound on the dot products of vectors from the two boxes, even rounded ones: rounding is monotonic.
    fn least_dot(self, other: Bounds) -> f64 {
        let least = |x: [f64; 2], y: [f64; 2]| (x[0] * y[0]).min(x[0] * y[1]).min((x[1] * y[0]).min(x[1] * y[1]));
        least([self.low.x, self.high.x], [other.low.x, other.high.x])
            + least([self.low.y, self.high.y], [other.low.y, other.high.y])
    }

    fn overlaps(self, other: Bounds) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}

/// Boxes in heap order: the root at 1, the children of `node` at `2·node` and `2·node + 1`, leaves from `leaves` on.
struct BoxTree {
    boxes: Vec<Bounds>,
    leaves: usize,
}

impl BoxTree {
    fn over_edges(points: &[DVec2]) -> BoxTree {
        BoxTree::over(points.len(), |i| {
            let (a, b) = edge(points, i);
            Bounds { low: a.min(b), high: a.max(b) }
        })
    }

    fn over(count: usize, leaf: impl Fn(usize) -> Bounds) -> BoxTree {
        let leaves = count.next_power_of_two();
        let mut boxes = vec![Bounds::EMPTY; 2 * leaves];
        for i in 0..count {
            boxes[leaves + i] = leaf(i);
        }
        for node in (1..leaves).rev() {
            boxes[node] = boxes[2 * node].union(boxes[2 * node + 1]);
        }
        BoxTree { boxes, leaves }
    }

    /// Searches the runs under `a` and `b`, two nodes of one level with `a <= b`, until no comparisons are left.
    fn meeting_pair(&self, a: usize, b: usize, points: &[DVec2], left: &mut u64) -> Option<(usize, usize)> {
        *left = left.saturating_sub(1);
        if *left == 0 || !self.boxes[a].overlaps(self.boxes[b]) {
            return None;
        }
        if a >= self.leaves {
            let (i, j) = (a - self.leaves, b - self.leaves);
            return (i != j && edges_meet(points, i, j)).then_some((i, j));
        }
        let swapped = (a != b).then_some((2 * a + 1, 2 * b));
        let pairs = [(2 * a, 2 * b), (2 * a + 1, 2 * b + 1), (2 * a, 2 * b + 1)].into_iter().chain(swapped);
        pairs.into_iter().find_map(|(x, y)| self.meeting_pair(x, y, points, left))
    }

    /// Lowers `nearest` to the distance of the opposed edges under `a` and `b`, two nodes of one level with `a <= b`.
    /// `directions` bounds the edges as vectors: nearby runs of a smooth curve mostly turn too little to contain an
    /// opposed pair.
    fn nearest_opposed(&self, a: usize, b: usize, points: &[DVec2], directions: &BoxTree, nearest: &mut f64) {
        // Empty boxes are infinitely far.
        if self.boxes[a].distance(self.boxes[b]) >= *nearest
            || directions.boxes[a].least_dot(directions.boxes[b]) >= 0.0
        {
            return;
        }
        if a >= self.leaves {
            let (i, j) = (a - self.leaves, b - self.leaves);
            let apart = (j - i).min(i + points.len() - j);
            let ((p, q), (r, s)) = (edge(points, i), edge(points, j));
            if apart > 2 && (q - p).dot(s - r) < 0.0 {
                let ends = [(p, r, s), (q, r, s), (r, p, q), (s, p, q)];
                *nearest = ends.into_iter().map(|(x, y, z)| distance_to(x, y, z)).fold(*nearest, f64::min);
            }
            return;
        }
        self.nearest_opposed(2 * a, 2 * b, points, directions, nearest);
        self.nearest_opposed(2 * a + 1, 2 * b + 1, points, directions, nearest);
        self.nearest_opposed(2 * a, 2 * b + 1, points, directions, nearest);
        if a != b {
            self.nearest_opposed(2 * a + 1, 2 * b, points, directions, nearest);
        }
    }
}

/// Distance of a point from the segment `ab`.
fn distance_to(point: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let share = ((point - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    point.distance(a + share * along)
}

fn edge(points: &[DVec2], i: usize) -> (DVec2, DVec2) {
    (points[i], points[(i + 1) % points.len()])
}

/// Whether edges i < j of the polygon meet anywhere but in the vertex that neighbours share.
fn edges_meet(points: &[DVec2], i: usize, j: usize) -> bool {
    let ((a, b), (c, d)) = (edge(points, i), edge(points, j));
    if j == i + 1 {
        folds_back(a, b, d)
    } else if i == 0 && j + 1 == points.len() {
        folds_back(c, a, b)
    } else {
        segments_meet(a, b, c, d)
    }
}

/// Whether the path a → b → c returns along itself.
fn folds_back(a: DVec2, b: DVec2, c: DVec2) -> bool {
    (a - b).perp_dot(c - b) == 0.0 && (a - b).dot(c - b) > 0.0
}

/// Whether the closed segments `ab` and `cd` have a point in common.
fn segments_meet(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
    let (c_side, d_side) = (side(a, b, c), side(a, b, d));
    let (a_side, b_side) = (side(c, d, a), side(c, d, b));
    let split = |s: f64, t: f64| (s > 0.0 && t < 0.0) || (s < 0.0 && t > 0.0);
    if split(c_side, d_side) && split(a_side, b_side) {
        return true;
    }
    let touches = |s: f64, p: DVec2, q: DVec2, r: DVec2| s == 0.0 && (p - r).dot(q - r) <= 0.0;
    touches(c_side, a, b, c) || touches(d_side, a, b, d) || touches(a_side, c, d, a) || touches(b_side, c, d, b)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use curvelax_base::random::Stream;

    #[test]
    fn the_clearance_is_that_of_all_pairs() {
        let seed = 20_261_121;
        for member in 0..300 {
            let points = random_polygon(seed, member);
            let n = points.len();
            let mut nearest = 10.0_f64;
            for j in 0..n {
                for i in 0..j {
                    let ((p, q), (r, s)) = (edge(&points, i), edge(&points, j));
                    if (j - i).min(i + n - j) > 2 && (q - p).dot(s - r) < 0.0 {
                        for (x, y, z) in [(p, r, s), (q, r, s), (r, p, q), (s, p, q)] {
                            nearest = nearest.min(distance_to(x, y, z));
                        }
                    }
                }
            }
            assert_eq!(clearance(&points, 10.0), nearest, "member {member}");
        }
        let strip = polygon([(0.0, 0.0), (9.0, 0.0), (9.0, 0.5), (9.0, 1.0), (0.0, 1.0), (0.0, 0.5)]);
        assert_eq!(clearance(&strip, 10.0), 1.0);
    }

    fn polygon<const N: usize>(points: [(f64, f64); N]) -> Vec<DVec2> {
        points.map(DVec2::from).into()
    }

    fn brute_force(points: &[DVec2]) -> bool {
        (0..points.len()).any(|j| (0..j).any(|i| edges_meet(points, i, j)))
    }

    /// A star-shaped polygon, embedded by construction, with some vertices moved afterwards.
    fn random_polygon(seed: u64, member: u64) -> Vec<DVec2> {
        let stream = Stream::new(seed, member, 0);
        let n = 3 + (member % 61) as usize;
        let noise = 7.0 * (member % 5) as f64 / n as f64;
        (0..n)
            .map(|i| {
                let [radius, _] = stream.uniforms(3 * i as u32);
                let push = DVec2::from(stream.uniforms(3 * i as u32 + 1)) - 0.5;
                DVec2::from_angle(TAU * i as f64 / n as f64) * (0.4 + radius) + noise * push
            })
            .collect()
    }

    #[test]
    fn the_tree_agrees_with_brute_force_on_random_polygons() {
        let seed = 20_261_120;
        let mut crossed = 0;
        for member in 0..2000 {
            let points = random_polygon(seed, member);
            let found = crossing(&points);
            assert_eq!(found.is_some(), brute_force(&points), "seed {seed}, polygon {member}");
            if let Some((i, j)) = found {
                assert!(i < j && edges_meet(&points, i, j), "seed {seed}, polygon {member}: edges {i} and {j}");
                crossed += 1;
            }
        }
        assert!((400..1600).contains(&crossed), "seed {seed}: {crossed} of 2000 cross, the test has lost its point");
    }

    #[test]
    fn a_bow_tie_crosses_in_its_two_long_edges() {
        assert_eq!(crossing(&polygon([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])), Some((0, 2)));
    }

    #[test]
    fn segments_meet_when_any_of_their_four_ends_touches() {
        let [a, b, top, middle] = [(0.0, 0.0), (2.0, 0.0), (1.0, 3.0), (1.0, 0.0)].map(DVec2::from);
        for (p, q) in [(top, middle), (middle, top)] {
            assert!(segments_meet(a, b, p, q) && segments_meet(p, q, a, b));
        }
        let beyond = DVec2::new(3.0, 0.0);
        assert!(!segments_meet(a, b, beyond, top) && !segments_meet(top, beyond, b, a));
        assert!(segments_meet(a, b, middle, beyond) && !segments_meet(a, middle, b, beyond));
    }

    #[test]
    fn a_vertex_on_another_edge_and_a_repeated_vertex_are_touches() {
        let on_edge = polygon([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 0.0), (0.0, 2.0)]);
        let repeated = polygon([(0.0, 0.0), (2.0, -1.0), (2.0, 1.0), (0.0, 0.0), (-2.0, 1.0), (-2.0, -1.0)]);
        assert!(crossing(&on_edge).is_some());
        assert!(crossing(&repeated).is_some());
    }

    #[test]
    fn a_spike_meets_itself_and_a_straight_vertex_does_not() {
        let spike = polygon([(0.0, 0.0), (1.0, 0.0), (3.0, 0.0), (1.0, 0.0), (0.0, 1.0)]);
        let closing_spike = polygon([(2.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)]);
        let straight = polygon([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]);
        assert!(crossing(&spike).is_some());
        assert_eq!(crossing(&closing_spike), Some((0, 4)));
        assert_eq!(crossing(&straight), None);
        assert_eq!(crossing(&polygon([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])), None);
    }

    /// Needles side by side at 45 degrees: all boxes overlap.
    fn aslant_comb(needles: usize) -> Vec<DVec2> {
        let aslant = DVec2::from_angle(TAU / 8.0);
        let teeth = (0..2 * needles).map(|i| DVec2::new(i as f64 / needles as f64, (i % 2) as f64));
        let bar = [DVec2::new(2.0, -0.5), DVec2::new(0.0, -0.5)];
        teeth.chain(bar).map(|p| p.rotate(aslant)).collect()
    }

    #[test]
    fn a_search_ends_at_its_bound() {
        assert_eq!(crossing(&aslant_comb(300)), None);
        assert_eq!(crossing_within(&aslant_comb(300), 10_000_000), Ok(None));
        assert_eq!(crossing_within(&aslant_comb(300), 10_000), Err(Undecided));
        let bow = polygon([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        assert_eq!(crossing_within(&bow, 1000), Ok(Some((0, 2))));
        assert_eq!(crossing_within(&aslant_comb(500_000), 20_000_000), Err(Undecided));
    }

    #[test]
    fn only_runs_with_overlapping_boxes_are_searched() {
        // 200 000 edges of a wavy circle are 2e10 pairs; with the tree, a few comparisons per edge.
        let n = 200_000;
        let mut points: Vec<DVec2> = (0..n)
            .map(|i| {
                let angle = TAU * f64::from(i) / f64::from(n);
                DVec2::from_angle(angle) * (1.0 + 0.3 * (40.0 * angle).cos())
            })
            .collect();
        assert_eq!(crossing_within(&points, 20_000_000), Ok(None));
        points[70_000] = points[170_000] * 1.5;
        assert!(crossing(&points).is_some());
    }
}
