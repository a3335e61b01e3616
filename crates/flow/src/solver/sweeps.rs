//! Coloured Gauss–Seidel sweeps and their stopping criterion, for [`gauss_seidel`](super::gauss_seidel). Twin of
//! `shaders/sweeps.wgsl`: same order, same arithmetic.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{
    ring::{self, Blocks, COLOURS, Ring},
    system::{Row, System},
};
use crate::number::{BIG, Mask, Number};

/// The order in which a sweep visits the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Colour by colour, as the kernel does.
    Coloured,
    /// Node by node, as the paper does (CPU only).
    Lexicographic,
}

/// When to stop, and how to sweep.
#[derive(Clone, Copy, Debug)]
pub struct Control<N> {
    /// Bound on the scaled residual relative to the largest increment.
    pub tolerance: N,
    /// Absolute error that is not worth a sweep: a fraction of the rounding error of the unknown.
    pub negligible: N,
    /// ω_SOR; 0 to choose it by the size of the system.
    pub sor: N,
    /// Maximum sweeps before the solve gives up.
    pub max_sweeps: u32,
    /// Order of a sweep.
    pub order: Order,
    /// Whether solutions are [refined](super::refinement), in short numbers.
    pub refined: bool,
    /// How often one by a direct solver is, per lane.
    pub refinements: N,
}

/// Result of a solve.
#[derive(Clone, Copy, Debug)]
pub struct Swept<N: Number> {
    /// Sweeps made, per lane.
    pub sweeps: N,
    /// Whether the residual reached its bound, or a round was made; false after the cap, or if the sweeps diverged.
    pub converged: N::Mask,
    /// Whether the system itself was finite; a system that is not is not swept.
    pub finite: N::Mask,
}

impl<N: Number> Swept<N> {
    /// Returns the result of a solver that makes no sweeps.
    #[inline(always)]
    pub fn without_sweeps(finite: N::Mask) -> Self {
        Swept { sweeps: N::of(0.0), converged: finite, finite }
    }
}

/// The stopping criterion for the sweeps on a system.
pub(super) struct Target<N: Number> {
    /// See [`system_size`].
    pub size: N,
    tolerance: N,
    negligible: N,
    /// Whether the system is finite.
    pub finite: N::Mask,
}

/// Tolerance below which a scaled residual is rounding error, in units of ε times the size of the system: no sweep,
/// and no direct solve, gets further. At half of it, sweeps with over-relaxation were seen not to end in f32.
pub const FLOOR: f64 = 2.0;

/// Largest scaled row sum; more than [`BIG`] if an entry or a right-hand side is not finite.
#[inline(always)]
fn system_size<N: Number, const F: usize>(system: &System<N, F>) -> N {
    let mut largest = N::of(0.0);
    for (i, row) in system.rows.iter().enumerate() {
        let terms = N::of(1.0) + row.a.abs() + row.b.abs() + row.d.abs() + row.e.abs();
        largest = largest.max((row.weight * terms).bounded_abs());
        for rhs in &system.rhs {
            let huge = rhs[i].bounded_abs().le(N::of(BIG)).not();
            largest = N::select(huge, N::of(2.0 * BIG), largest);
        }
    }
    largest
}

impl<N: Number> Target<N> {
    #[inline(always)]
    pub fn of<const F: usize>(system: &System<N, F>, control: &Control<N>) -> Target<N> {
        let size = system_size(system);
        let tolerance = control.tolerance.max(N::of(FLOOR * N::EPSILON) * size);
        Target { size, tolerance, negligible: control.negligible, finite: size.le(N::of(BIG)) }
    }

    /// Judges `[error, increment]`, a bound of the error by the scaled residual and the largest increment: whether the
    /// error is small enough, and whether more sweeps may make it so.
    #[inline(always)]
    pub fn judge(&self, [error, increment]: [N; 2]) -> (N::Mask, N::Mask) {
        let solved = self.finite.and(error.le((self.tolerance * increment).max(self.negligible)));
        (solved, error.le(N::of(BIG)).and(solved.not()))
    }
}

/// `[max weight·|residual|, max |u|]` over nodes and right-hand sides; a value that is not finite shows as more than
/// [`BIG`].
#[inline(always)]
pub(super) fn norms<N: Number, const F: usize>(system: &System<N, F>, unknown: &[&mut Ring<N>; F]) -> [N; 2] {
    let mut norms = [N::of(0.0); 2];
    for (f, u) in unknown.iter().enumerate() {
        for i in 0..system.rows.len() {
            let error = system.rows[i].weight * system.residual(f, i, u);
            norms = [norms[0].max(error.bounded_abs()), norms[1].max(u[i].bounded_abs())];
        }
    }
    norms
}

/// `max |u|` over nodes and unknowns.
#[inline(always)]
pub(super) fn largest<N: Number, const F: usize>(unknown: &[&mut Ring<N>; F]) -> N {
    let mut largest = N::of(0.0);
    for u in unknown {
        for i in 0..u.len() {
            largest = largest.max(u[i].bounded_abs());
        }
    }
    largest
}

/// Sweeps once, in the lanes that are active.
#[inline(always)]
pub(super) fn sweep<N: Number, const F: usize>(
    system: &System<N, F>,
    unknown: &mut [&mut Ring<N>; F],
    blocks: Blocks,
    order: Order,
    sor: N,
    active: N::Mask,
) {
    let mut relaxation = Relaxation::new(system, unknown, sor, active);
    match order {
        Order::Coloured => {
            for colour in 0..COLOURS {
                for (range, stride) in blocks.of_colour(colour) {
                    relaxation.relax(stride, range);
                }
                relaxation.close();
            }
        }
        Order::Lexicographic => {
            // Only the last two nodes read ghosts that this sweep has changed.
            for range in [0..blocks.n - 2, blocks.n - 2..blocks.n] {
                relaxation.relax(1, range);
                relaxation.close();
            }
        }
    }
}

/// The data of a sweep as slices, whose addresses then stay in registers.
struct Relaxation<'a, N: Number, const F: usize> {
    rows: &'a [Row<N>],
    rhs: [&'a [N]; F],
    padded: [Option<&'a mut [N]>; F],
    sor: N,
}

impl<'a, N: Number, const F: usize> Relaxation<'a, N, F> {
    #[inline(always)]
    fn new(system: &'a System<N, F>, unknown: &'a mut [&mut Ring<N>; F], sor: N, active: N::Mask) -> Self {
        let (mut rhs, mut padded) = ([&[][..]; F], [const { None }; F]);
        for (f, ring) in unknown.iter_mut().enumerate() {
            rhs[f] = &system.rhs[f][..];
            padded[f] = Some(ring.padded_mut());
        }
        // Finished lanes move by 0: a masked store is slow on many processors.
        Relaxation { rows: &system.rows, rhs, padded, sor: N::select(active, sor, N::of(0.0)) }
    }

    /// Relaxes every `stride`-th node of a range.
    #[inline(always)]
    fn relax(&mut self, stride: usize, range: Range<usize>) {
        let mut i = range.start;
        while i < range.end {
            let row = self.rows[i];
            for f in 0..F {
                let Some(padded) = &mut self.padded[f] else { continue };
                let u = &mut padded[i..i + 5];
                u[2] += self.sor * row.residual(self.rhs[f][i], [u[0], u[1], u[2], u[3], u[4]]);
            }
            i += stride;
        }
    }

    #[inline(always)]
    fn close(&mut self) {
        for padded in self.padded.iter_mut().flatten() {
            ring::close(padded);
        }
    }
}
