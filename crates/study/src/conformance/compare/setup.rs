//! The inputs of both sides of a comparison.

use curvelax_base::error::{Error, Result};
use curvelax_flow::scheme::evolve::Evolves;
use curvelax_flow::{
    scheme::{Workspace, run::Run, step::Method},
    solver::{Blocks, Solver},
};

/// Maximum number of sweeps in these comparisons.
pub const MAX_SWEEPS: u32 = 200_000;

/// Moves one node of one member on the GPU side by `by`, relative to the radius; the comparison must then fail.
#[derive(Clone, Copy, Debug)]
pub struct Tamper {
    /// The member.
    pub member: usize,
    /// The node.
    pub node: usize,
    /// How far.
    pub by: f64,
}

impl Tamper {
    /// Moves the node.
    pub fn apply(self, launches: &mut [Run<f64>]) {
        let curve = &mut launches[self.member].state.curve;
        for coordinate in [&mut curve.x, &mut curve.y] {
            coordinate[self.node] *= 1.0 + self.by;
            coordinate.close();
        }
    }
}

pub(super) fn method(solver: Solver) -> Method {
    Method::coloured(solver, MAX_SWEEPS)
}

pub(super) fn blocks(n: usize) -> Result<Blocks> {
    Blocks::new(n).ok_or_else(|| Error::Failed(format!("n = {n}: a ring has at least 6 nodes")))
}

/// Creates a workspace that stores the systems, whatever the solver.
pub(super) fn traced_workspace<T: Evolves>(n: usize) -> Result<Workspace<T>> {
    Ok(Workspace { traced: true, ..Workspace::new(blocks(n)?) })
}
