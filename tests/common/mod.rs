//! Shared parts of the integration tests: a curve that is stepped by hand, and measures of it.
#![allow(dead_code, missing_docs)] // every test file uses a different part of it

pub mod browser;
pub mod command;
pub mod polygons;
pub mod program;

use std::f64::consts::TAU;

use curvelax::scheme::evolve::Evolves;
use curvelax::{
    curve::{BaseCurve, Outline},
    scheme::{
        Parameters, State, Workspace,
        extrapolation::MOST_ORDER,
        observe::{self, CurveSums},
        step::{Method, Steps},
    },
    solver::{Blocks, Order, Solver},
};
use glam::DVec2;

pub const DIRECT: Method =
    Method { solver: Solver::Direct, order: Order::Coloured, max_sweeps: 1, most_order: MOST_ORDER };
pub const SWEEPS: Method = Method { solver: Solver::GaussSeidel, max_sweeps: 1_000_000, ..DIRECT };

/// n nodes at `u = i/n`, i = 1…n.
pub fn nodes(n: usize, curve: impl Fn(f64) -> DVec2) -> Vec<DVec2> {
    (1..=n).map(|i| curve(TAU * i as f64 / n as f64)).collect()
}

/// The paper's ellipse, axes 2 and 1, equal-parameter nodes.
pub fn ellipse(n: usize) -> Vec<DVec2> {
    nodes(n, |u| DVec2::new(2.0 * u.cos(), u.sin()))
}

/// The circle `radius·(1 + amplitude·cos mθ)`.
pub fn wavy_circle(n: usize, radius: f64, m: u32, amplitude: f64) -> Vec<DVec2> {
    nodes(n, |u| radius * (1.0 + amplitude * (f64::from(m) * u).cos()) * DVec2::from_angle(u))
}

/// A curve with everything needed to step it.
pub struct Stepper<T: Evolves> {
    pub state: State<T>,
    pub work: Workspace<T>,
    p: Parameters<T>,
    method: Method,
}

impl<T: Evolves> Stepper<T> {
    pub fn new(nodes: &[DVec2], p: &Parameters<f64>, method: Method) -> Stepper<T> {
        Stepper {
            state: State::from_nodes(nodes),
            work: Workspace::new(Blocks::new(nodes.len()).unwrap()),
            p: p.convert(),
            method,
        }
    }

    /// Makes one step, which must succeed.
    #[track_caller]
    pub fn step(&mut self) {
        let stepped = Steps::step(&self.state.curve, &mut self.state.increments, &self.p, &self.method, &mut self.work);
        assert!(stepped.solved && stepped.finite, "a system was not solved");
        std::mem::swap(&mut self.state.curve, &mut self.work.new);
    }

    #[track_caller]
    pub fn steps(mut self, steps: usize) -> Stepper<T> {
        (0..steps).for_each(|_| self.step());
        self
    }

    pub fn sums(&self) -> CurveSums<T> {
        observe::sums(&self.state.curve, &self.p, self.p.kind_of_law(), self.work.blocks)
    }

    pub fn positions(&self) -> Vec<DVec2> {
        self.state.curve.positions().collect()
    }
}

/// Largest distance between nodes of the same index.
pub fn distance(a: &[DVec2], b: &[DVec2]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

/// Mean distance of the nodes from the origin.
pub fn radius(nodes: &[DVec2]) -> f64 {
    nodes.iter().map(|node| node.length()).sum::<f64>() / nodes.len() as f64
}

/// Amplitude of mode m of the radius as a function of the angle, by the trapezium rule.
pub fn mode(nodes: &[DVec2], m: u32) -> f64 {
    let n = nodes.len();
    let mean = radius(nodes);
    let wave = |i: usize| {
        let node = nodes[i % n];
        (node.length() - mean) * DVec2::from_angle(f64::from(m) * node.to_angle())
    };
    let sum: DVec2 = (0..n).map(|i| nodes[i].angle_to(nodes[(i + 1) % n]) * (wave(i) + wave(i + 1))).sum();
    sum.length() / TAU
}

/// Slope of the least-squares line through the points.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let [xy, xx] = points.iter().fold([0.0; 2], |s, p| [s[0] + (p.0 - x) * (p.1 - y), s[1] + (p.0 - x).powi(2)]);
    xy / xx
}

/// The outline with these corners.
pub fn file(corners: &[DVec2]) -> BaseCurve {
    let text: String = corners.iter().map(|p| format!("{:?},{:?}\n", p.x, p.y)).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("outline.csv");
    std::fs::write(&path, text).unwrap();
    BaseCurve::from_outline(Outline::read(&path).unwrap())
}

/// Two unit discs joined by a bar.
pub fn dumbbell(half_length: f64, half_width: f64) -> Vec<DVec2> {
    let end = std::f64::consts::PI - half_width.asin();
    let arc = |j: i32| DVec2::new(half_length, 0.0) + DVec2::from_angle(end * f64::from(j - 100) / 100.0);
    let right: Vec<DVec2> = (0..=200).map(arc).collect();
    right.iter().copied().chain(right.iter().map(|p| -*p)).collect()
}
