//! One line of the table of comparisons.

use serde::Serialize;

use super::device::Left;
use crate::conformance::bounds::Bound;
use curvelax_flow::scheme::evolve::Evolves;
use curvelax_flow::solver::Solver;

/// What the kernel and its twin leave of a member. What is compared is taken from both by one function, so that one
/// side cannot be passed twice.
pub(super) struct Sides<'a> {
    pub(super) member: usize,
    pub(super) on_gpu: &'a Left,
    pub(super) on_cpu: &'a Left,
}

impl Sides<'_> {
    /// Adds to a line what `of` takes from both.
    pub(super) fn compare(&self, row: &mut ConformanceRow, scale: f64, bound: f64, of: impl Fn(&Left) -> Vec<f64>) {
        row.add(self.member, scale, bound, &of(self.on_gpu), &of(self.on_cpu));
    }
}

/// One line of the table: the worst case of a quantity over all members and nodes.
#[derive(Clone, Debug, Serialize)]
pub struct ConformanceRow {
    /// The quantity.
    pub quantity: &'static str,
    /// Solver of the systems.
    pub solver: Solver,
    /// `f32` or `f64`.
    pub precision: &'static str,
    /// Nodes per member.
    pub n: usize,
    /// Steps before the comparison; with adaptive steps, the maximum over the members.
    pub steps: u32,
    /// Whether the steps were adaptive.
    pub adaptive: bool,
    /// Natural scale where the error is worst.
    pub scale: f64,
    /// The difference with the largest fraction of its bound.
    pub error: f64,
    /// The bound there, `k · ε · scale`.
    pub bound: f64,
    /// Member and node of the largest difference.
    pub at: (usize, usize),
}

impl ConformanceRow {
    /// Returns whether the error is within its bound; false for NaN, and for a row that compared nothing.
    pub fn passes(&self) -> bool {
        self.error <= self.bound && self.bound.is_finite()
    }

    /// Whether nothing was compared.
    pub(in crate::conformance) fn is_empty(&self) -> bool {
        self.bound == f64::INFINITY
    }

    /// Returns the error as a fraction of its bound.
    pub fn share(&self) -> f64 {
        if self.error == 0.0 { 0.0 } else { self.error / self.bound }
    }

    pub(super) fn begin<T: Evolves>(bound: &Bound, solver: Solver, n: usize, steps: u32) -> ConformanceRow {
        ConformanceRow {
            quantity: bound.quantity,
            solver,
            precision: T::NAME,
            n,
            steps,
            adaptive: false,
            scale: 1.0,
            error: f64::NAN,
            bound: f64::INFINITY,
            at: (0, 0),
        }
    }

    /// Adds a member; the larger fraction of the bound wins, and NaN always wins.
    pub(super) fn add(&mut self, member: usize, scale: f64, bound: f64, ours: &[f64], theirs: &[f64]) {
        assert!(!ours.is_empty() && ours.len() == theirs.len(), "{}: sides of different length", self.quantity);
        for (node, (a, b)) in ours.iter().zip(theirs).enumerate() {
            let error = (a - b).abs();
            let first = self.is_empty();
            let share = if error == 0.0 { 0.0 } else { error / bound };
            if first || error.is_nan() || share > self.share() {
                (self.scale, self.error, self.bound, self.at) = (scale, error, bound, (member, node));
            }
            if error.is_nan() {
                return;
            }
        }
    }
}
