//! Coloured sweeps inside a V-cycle on the ring: the number of sweeps hardly depends on τ/h⁴.
//!
//! *Theory.* Sweeps damp oscillations from node to node and leave the smooth part. This is solved for on a ring with
//! half the nodes, in the same way, down to a ring of at most [`COARSEST`] nodes that is solved densely.
//!
//! - **Coarse nodes** are every second one: 0, 2, 4… An odd ring has two nodes between its last coarse node and its
//!   first. A gap is then at most twice as wide as the others, however often the ring is halved.
//! - **Interpolation** is cubic through the four nearest coarse nodes, by Lagrange's formula with the true spacings, so
//!   it does not depend on even or odd rings and works on any mesh; with equal spacings it is (-1, 9, 9, -1)/16. Linear
//!   interpolation is not enough for an operator of fourth order. Residuals, integrated over the cells of their nodes,
//!   are restricted by its transpose.
//! - **Coarse systems** are the equation rediscretised: `ρu + ∂⁴u + p ∂²u + w ∂u` with the merged spacings and the
//!   averaged fields of [`Terms`]. Both systems of the scheme have this form, and every level is pentadiagonal.
//! - **Cycle.** Residual of the finest level; down to the coarsest without sweeps, since a correction starts from zero
//!   and its residual is its right-hand side; then up with sweeps on every level. Moving all sweeps after the
//!   correction changes no convergence factor, and saves the residuals of all but the finest level.
//!
//! *Practice.* [`Levels`] is created once per ring and filled for every solve. The stopping criterion is that of
//! [`gauss_seidel`](super::gauss_seidel); sweeps are those of the finest level. Each part has a file: the sizes of the
//! rings, the systems on them (`coarse`), the transfer between two of them (`transfer`), and the cycle. Twin of
//! `shaders/multigrid.wgsl`.

mod coarse;
mod cycle;
mod levels;
mod transfer;

#[cfg(test)]
mod tests;

use super::{
    ring::{Blocks, Ring},
    sweeps::{Control, Swept, Target, coloured_sweep},
    system::System,
};
use crate::number::{Mask, Number};

pub use coarse::{BALANCE, Discretisation, Levels, Terms};
pub use cycle::COARSE_SWEEPS;
pub use levels::{COARSEST, coarse_nodes, odd_rings};

/// Sweeps of the finest level per cycle.
pub const SWEEPS_PER_CYCLE: u32 = 2;

/// Sweeps `unknown` inside V-cycles until its residual is small, in the lanes that are `live`. Finished lanes stay
/// unchanged.
#[inline(always)]
pub fn solve<N: Number, const F: usize>(
    system: &System<N, F>,
    mut unknown: [&mut Ring<N>; F],
    blocks: Blocks,
    control: &Control<N>,
    live: N::Mask,
    levels: &mut Levels<N, F>,
) -> Swept<N> {
    let target = Target::of(system, control);
    let mut swept = Swept { sweeps: N::of(0.0), converged: N::Mask::all_of(false), finite: target.finite };
    levels.build();
    let mut done = 0;
    loop {
        let (converged, unsolved) = target.judge(levels.residual(system, &unknown));
        swept.converged = converged;
        let active = live.and(target.finite).and(unsolved);
        if done >= control.max_sweeps || !active.any() {
            return swept;
        }
        levels.correct(&mut unknown, active);
        let sweeps = SWEEPS_PER_CYCLE.min(control.max_sweeps - done);
        for _ in 0..sweeps {
            coloured_sweep(system, &mut unknown, blocks, N::of(1.0), active);
        }
        done += sweeps;
        swept.sweeps += N::select(active, N::of(f64::from(sweeps)), N::of(0.0));
    }
}
