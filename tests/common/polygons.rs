//! Random simple polygons, like those of users: polygon `index` is always the same one.
//!
//! Five families alternate. Each is simple by construction, except for coasts, each corner of which is tested before it
//! is accepted. All are then stretched to an aspect of 1 to 8, rotated, and traversed in either direction from any
//! corner.

use std::{collections::HashMap, f64::consts::TAU};

use curvelax::{curve::crossing, random::Stream};
use glam::DVec2;

/// Minimum and maximum number of corners.
pub const CORNERS: std::ops::RangeInclusive<usize> = 5..=200;
/// Maximum ratio of the sides of the box round a polygon, before it is rotated.
pub const MAX_ASPECT: f64 = 8.0;
const SEED: u64 = 20_261_121;

/// Kinds of polygons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Family {
    /// Random radii at increasing angles: spikes about a centre.
    Star,
    /// A band of one width rolled up for half a turn to four turns, with gaps of another width.
    Spiral,
    /// Teeth and tines, blunt or pointed, on a bar.
    Comb,
    /// Squares joined into a random tree, corners moved.
    Tree,
    /// A pentagon whose edges are broken at random repeatedly.
    Coast,
}

impl Family {
    pub const ALL: [Family; 5] = [Family::Star, Family::Spiral, Family::Comb, Family::Tree, Family::Coast];
}

/// Polygon `index`.
pub fn random(index: u64) -> (Family, Vec<DVec2>) {
    let family = Family::ALL[(index % Family::ALL.len() as u64) as usize];
    let mut draws = Draws { stream: Stream::new(SEED, index, 0), next: 0 };
    let corners = match family {
        Family::Star => star(&mut draws),
        Family::Spiral => spiral(&mut draws),
        Family::Comb => comb(&mut draws),
        Family::Tree => tree(&mut draws),
        Family::Coast => coast(&mut draws),
    };
    (family, placed(corners, &mut draws))
}

/// A sequence of random numbers.
struct Draws {
    stream: Stream,
    next: u32,
}

impl Draws {
    /// Uniform between `low` and `high`.
    fn real(&mut self, low: f64, high: f64) -> f64 {
        self.next += 1;
        low + (high - low) * self.stream.uniforms(self.next)[0]
    }

    /// Uniform in the logarithm, so that small values are as frequent as large ones.
    fn size(&mut self, low: f64, high: f64) -> f64 {
        self.real(low.ln(), high.ln()).exp()
    }

    /// An integer from `low` to `high`, both included.
    fn count(&mut self, low: usize, high: usize) -> usize {
        self.real(low as f64, high as f64 + 1.0) as usize
    }

    /// Like [`Draws::size`], in integers.
    fn scale(&mut self, low: usize, high: usize) -> usize {
        self.size(low as f64, high as f64 + 1.0) as usize
    }
}

fn placed(mut corners: Vec<DVec2>, draws: &mut Draws) -> Vec<DVec2> {
    let low = corners.iter().fold(DVec2::INFINITY, |low, p| low.min(*p));
    let high = corners.iter().fold(DVec2::NEG_INFINITY, |high, p| high.max(*p));
    let stretch = DVec2::new(draws.size(1.0, MAX_ASPECT), 1.0) / (high - low);
    let direction = DVec2::from_angle(draws.real(0.0, TAU));
    for corner in &mut corners {
        *corner = ((*corner - low) * stretch).rotate(direction);
    }
    if draws.count(0, 1) == 1 {
        corners.reverse();
    }
    let first = draws.count(0, corners.len() - 1);
    corners.rotate_left(first);
    corners
}

fn star(draws: &mut Draws) -> Vec<DVec2> {
    let n = draws.scale(*CORNERS.start(), *CORNERS.end());
    let innermost = draws.real(0.1, 0.9);
    // Neighbouring angles differ by less than π, so the centre is visible from every corner.
    (0..n)
        .map(|i| {
            let angle = TAU * (i as f64 + draws.real(0.0, 0.8)) / n as f64;
            draws.real(innermost, 1.0) * DVec2::from_angle(angle)
        })
        .collect()
}

fn spiral(draws: &mut Draws) -> Vec<DVec2> {
    // Corners lie on the same rays in every turn, and along a ray the radius grows, so chords do not meet.
    let rays_per_turn = draws.count(4, 24);
    let rays = draws.count(rays_per_turn / 2 + 1, (4 * rays_per_turn).min(98));
    let (start, half_width) = (draws.real(0.7, 3.0), draws.size(0.03, 0.45));
    let side = |i: usize, offset: f64| {
        let turns = i as f64 / rays_per_turn as f64;
        (start + turns + offset) * DVec2::from_angle(TAU * turns)
    };
    let inner = (0..=rays).rev().map(|i| side(i, -half_width));
    (0..=rays).map(|i| side(i, half_width)).chain(inner).collect()
}

fn comb(draws: &mut Draws) -> Vec<DVec2> {
    let teeth = draws.scale(1, 40);
    let (bar, thinnest) = (draws.real(0.05, 0.5), draws.size(0.03, 1.0));
    let mut corners = vec![DVec2::ZERO];
    let mut x = 0.0;
    for _ in 0..teeth {
        let (left, width) = (x + draws.size(thinnest, 1.0), draws.size(thinnest, 1.0));
        let height = teeth as f64 * draws.real(0.1, 1.0);
        let (from, to) = (left + width * draws.real(0.0, 0.5), left + width * draws.real(0.5, 1.0));
        corners.push(DVec2::new(left, 0.0));
        corners.push(DVec2::new(from, height));
        if draws.count(0, 2) > 0 {
            corners.push(DVec2::new(to, height));
        }
        x = left + width;
        corners.push(DVec2::new(x, 0.0));
    }
    let (end, below) = (x + draws.size(thinnest, 1.0), -bar * teeth as f64);
    corners.extend([DVec2::new(end, 0.0), DVec2::new(end, below), DVec2::new(0.0, below)]);
    corners
}

fn tree(draws: &mut Draws) -> Vec<DVec2> {
    let sides = [(1, 0), (0, 1), (-1, 0), (0, -1)];
    let mut cells = vec![(0, 0)];
    for _ in 0..draws.scale(2, 300) {
        let (x, y) = cells[draws.count(0, cells.len() - 1)];
        let (dx, dy) = sides[draws.count(0, 3)];
        // The new square may touch its parent and whatever its parent touches, but nothing next to it or beyond.
        let free = |(i, j)| !cells.contains(&(x + i * dx - j * dy, y + i * dy + j * dx));
        let apart = [(1, 0), (1, 1), (1, -1), (2, 0), (2, 1), (2, -1)].into_iter().all(free);
        if apart && cells.len() < 90 {
            cells.push((x + dx, y + dy));
        }
    }
    // Sides without a neighbour, each from its first to its second end with the square on the left.
    let mut next = HashMap::new();
    for &(x, y) in &cells {
        for (i, (dx, dy)) in sides.into_iter().enumerate() {
            if !cells.contains(&(x + dx, y + dy)) {
                let end = |(cx, cy): (i32, i32)| (x + (dx + cx + 1) / 2, y + (dy + cy + 1) / 2);
                let (px, py) = sides[(i + 1) % 4];
                next.insert(end((-px, -py)), end((px, py)));
            }
        }
    }
    let mut lattice = vec![(0, 0)];
    let first = *next.keys().min().unwrap();
    lattice[0] = first;
    while next[lattice.last().unwrap()] != first {
        lattice.push(next[lattice.last().unwrap()]);
    }
    let move_by = draws.real(0.0, 0.24);
    let n = lattice.len();
    let turns = |i: &usize| {
        let [a, b, c] = [i + n - 1, *i, i + 1].map(|j| lattice[j % n]);
        (b.0 - a.0, b.1 - a.1) != (c.0 - b.0, c.1 - b.1)
    };
    // Sides that are not neighbours are 1 apart, so corners moved by less than ½ keep them apart.
    let corner = |i: usize| {
        let shift = DVec2::new(draws.real(-move_by, move_by), draws.real(-move_by, move_by));
        DVec2::new(f64::from(lattice[i].0), f64::from(lattice[i].1)) + shift
    };
    let mut corners: Vec<DVec2> = (0..n).filter(turns).map(corner).collect();
    if corners.len() < *CORNERS.start() {
        corners.insert(1, corners[0].lerp(corners[1], 0.5));
    }
    corners
}

fn coast(draws: &mut Draws) -> Vec<DVec2> {
    let n = draws.scale(*CORNERS.start(), *CORNERS.end());
    let roughness = draws.real(0.2, 1.0);
    let mut corners: Vec<DVec2> = (0..5).map(|i| DVec2::from_angle(TAU * f64::from(i) / 5.0)).collect();
    while corners.len() < n {
        let i = draws.count(0, corners.len() - 1);
        let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
        let across = draws.real(-roughness, roughness) * (b - a).perp();
        corners.insert(i + 1, a.lerp(b, draws.real(0.2, 0.8)) + across);
        if crossing(&corners).is_some() {
            corners.remove(i + 1);
        }
    }
    corners
}
