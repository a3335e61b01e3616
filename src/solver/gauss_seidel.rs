//! Gauss–Seidel sweeps to a residual, the paper's solver.
//!
//! *Theory.* The unknown is the increment over a step, started from a prediction ([`Start`](crate::scheme::start::Start)).
//! A sweep replaces `u_i` by `u_i + ω_SOR·residual_i`; ω_SOR = 1 is Gauss–Seidel. The slow modes of a fourth-order
//! operator hardly show in the residual: their eigenvalue is only q/τ. So the residual is scaled by τ/q, which bounds the error of just these modes, and the sweeps stop when
//! `max (τ/q)|residual| ≤ tolerance · max|u|`, or when that error is below the rounding of the unknown itself, or
//! when the residual is all rounding (f32 reaches that at a tolerance of about 16·ε·τ/h⁴).
//! Stopping on the update instead stops hundreds of times too early.
//!
//! *Practice.* Coloured order gives the kernel its parallelism and needs the same number of sweeps as the
//! lexicographic order of the paper. Twin of `shaders/gauss_seidel.wgsl`: same order, same arithmetic.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{
    ring::{self, Blocks, COLOURS, Ring},
    system::{Row, System},
};
use crate::number::{BIG, Mask, Number};

/// Sweeps between two looks at the residual; a look costs about as much as a sweep.
pub const SWEEPS_PER_CHECK: u32 = 8;

/// The order in which a sweep visits the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Colour by colour: what the kernel does.
    Coloured,
    /// Node by node, as the paper does (CPU only).
    Lexicographic,
}

/// When to stop, and how to sweep.
#[derive(Clone, Copy, Debug)]
pub struct Control<N> {
    /// Bound of the scaled residual relative to the largest increment.
    pub tolerance: N,
    /// Absolute error that is not worth a sweep: a fraction of the rounding error of the unknown.
    pub negligible: N,
    /// ω_SOR; 0 to have it chosen by the size of the system.
    pub sor: N,
    /// Sweeps after which the solve gives up.
    pub max_sweeps: u32,
    /// Order of a sweep.
    pub order: Order,
}

/// What a solve did.
#[derive(Clone, Copy, Debug)]
pub struct Swept<N: Number> {
    /// Sweeps made, per lane.
    pub sweeps: N,
    /// Where the residual reached its bound; false after the cap, or where the sweeps diverged.
    pub converged: N::Mask,
    /// Where the system itself was finite; no sweep is made of one that is not.
    pub finite: N::Mask,
}

/// When the sweeps on a system have done enough.
pub(super) struct Target<N: Number> {
    /// See [`size`].
    pub size: N,
    tolerance: N,
    negligible: N,
    /// Whether the system is finite.
    pub finite: N::Mask,
}

impl<N: Number> Target<N> {
    #[inline(always)]
    pub fn of<const F: usize>(system: &System<N, F>, control: &Control<N>) -> Target<N> {
        let size = size(system);
        let tolerance = control.tolerance.max(N::of(N::EPSILON) * size);
        Target { size, tolerance, negligible: control.negligible, finite: size.le(N::of(BIG)) }
    }

    /// Whether an error that is bounded by the scaled residual is small enough for increments of this size.
    #[inline(always)]
    pub fn is_met(&self, [error, increment]: [N; 2]) -> N::Mask {
        self.finite.and(error.le((self.tolerance * increment).max(self.negligible)))
    }
}

/// Sweeps `unknown` (one ring per right-hand side) until its residual is small, in the lanes that are `live`. Lanes that are
/// done stay as they are.
#[inline(always)]
pub fn solve<N: Number, const F: usize>(
    system: &System<N, F>,
    mut unknown: [&mut Ring<N>; F],
    blocks: Blocks,
    control: &Control<N>,
    live: N::Mask,
) -> Swept<N> {
    let target = Target::of(system, control);
    let sor = N::select(control.sor.le(N::of(0.0)), over_relaxation(target.size), control.sor);
    let mut active = live.and(target.finite);
    let mut swept = Swept { sweeps: N::of(0.0), converged: N::Mask::all_of(false), finite: target.finite };
    let mut done = 0;
    while done < control.max_sweeps && active.any() {
        let sweeps = SWEEPS_PER_CHECK.min(control.max_sweeps - done);
        for _ in 0..sweeps {
            match control.order {
                Order::Coloured => coloured_sweep(system, &mut unknown, blocks, sor, active),
                Order::Lexicographic => lexicographic_sweep(system, &mut unknown, sor, active),
            }
        }
        done += sweeps;
        swept.sweeps += N::select(active, N::of(f64::from(sweeps)), N::of(0.0));
        let norms = norms(system, &unknown);
        swept.converged = target.is_met(norms);
        active = active.and(norms[0].le(N::of(BIG))).and(swept.converged.not());
    }
    swept
}

/// The over-relaxation that needs about the fewest sweeps for a system of this [`size`]: 2g/(1 + g) with
/// g = (⅝·size)^¼, about (10 τ/h⁴)^¼, measured (`docs/method.md`).
#[inline(always)]
fn over_relaxation<N: Number>(size: N) -> N {
    let g = (N::of(AUTO_SCALE) * size).sqrt().sqrt();
    (N::of(2.0) * (g / (N::of(1.0) + g))).max(N::of(1.0))
}

/// The ⅝ in the over-relaxation of its own choice.
pub const AUTO_SCALE: f64 = 0.625;

/// A sweep, colour by colour.
#[inline(always)]
pub(super) fn coloured_sweep<N: Number, const F: usize>(
    system: &System<N, F>,
    unknown: &mut [&mut Ring<N>; F],
    blocks: Blocks,
    sor: N,
    active: N::Mask,
) {
    let mut relaxation = Relaxation::new(system, unknown, sor, active);
    for colour in 0..COLOURS {
        for (range, stride) in blocks.of_colour(colour) {
            relaxation.every(stride, range);
        }
        relaxation.close();
    }
}

/// A sweep node by node.
#[inline(always)]
fn lexicographic_sweep<N: Number, const F: usize>(
    system: &System<N, F>,
    unknown: &mut [&mut Ring<N>; F],
    sor: N,
    active: N::Mask,
) {
    let n = system.rows.len();
    let mut relaxation = Relaxation::new(system, unknown, sor, active);
    relaxation.every(1, 0..n - 2);
    // Only the last two nodes read ghosts that this sweep has changed.
    relaxation.close();
    relaxation.every(1, n - 2..n);
    relaxation.close();
}

/// What a sweep reads and writes, as slices: their places then stay in registers.
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
        // Lanes that are done move by 0: a masked store is slow on many processors.
        Relaxation { rows: &system.rows, rhs, padded, sor: N::select(active, sor, N::of(0.0)) }
    }

    /// Relaxes every `stride`-th node of a range.
    #[inline(always)]
    fn every(&mut self, stride: usize, range: Range<usize>) {
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

/// Largest scaled row sum; more than [`BIG`] where an entry or a right-hand side is not finite.
///
/// Times ε it is the tolerance below which a scaled residual is rounding error: no sweep, and no direct solve, gets
/// further.
#[inline(always)]
fn size<N: Number, const F: usize>(system: &System<N, F>) -> N {
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

/// `[max weight·|residual|, max |u|]` over nodes and right-hand sides; not finite shows as more than [`BIG`].
#[inline(always)]
fn norms<N: Number, const F: usize>(system: &System<N, F>, unknown: &[&mut Ring<N>; F]) -> [N; 2] {
    let mut norms = [N::of(0.0); 2];
    for (f, u) in unknown.iter().enumerate() {
        for i in 0..system.rows.len() {
            let error = system.rows[i].weight * system.residual(f, i, u);
            norms = [norms[0].max(error.bounded_abs()), norms[1].max(u[i].bounded_abs())];
        }
    }
    norms
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::{direct, system::tests::test_system};

    fn control(order: Order, sor: f64) -> Control<f64> {
        Control { tolerance: 1e-12, negligible: 0.0, sor, max_sweeps: 100_000, order }
    }

    fn worst_difference(order: Order, sor: f64, n: usize) -> f64 {
        let system = test_system(n, 3.0);
        let blocks = Blocks::new(n).unwrap();
        let mut exact = [Ring::zeros(n), Ring::zeros(n)];
        let [x, y] = &mut exact;
        direct::solve(&system, [x, y], &mut direct::Factor::new(n));
        let mut swept = [Ring::zeros(n), Ring::zeros(n)];
        let [u, v] = &mut swept;
        assert!(solve(&system, [u, v], blocks, &control(order, sor), true).converged);
        (0..2)
            .flat_map(|f| (0..n).map(move |i| (f, i)))
            .map(|(f, i)| (swept[f][i] - exact[f][i]).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn both_orders_reach_the_direct_solution_for_every_kind_of_n() {
        for n in [6, 7, 8, 9, 10, 11, 13, 99, 100, 101] {
            for (order, sor) in [(Order::Coloured, 1.0), (Order::Coloured, 1.6), (Order::Lexicographic, 1.0)] {
                let worst = worst_difference(order, sor, n);
                assert!(worst < 1e-10, "n = {n}, {order:?}, sor {sor}: {worst:e}");
            }
        }
    }

    #[test]
    fn over_relaxation_of_its_own_choice_is_near_the_best_one() {
        for stiffness in [0.1, 1.0, 10.0, 100.0, 1000.0] {
            let system = test_system(100, stiffness);
            let sweeps = |sor| {
                let mut u = [Ring::zeros(100), Ring::zeros(100)];
                let control = Control { tolerance: 1e-5, ..control(Order::Coloured, sor) };
                let swept = solve(&system, u.each_mut(), Blocks::new(100).unwrap(), &control, true);
                assert!(swept.converged, "stiffness {stiffness}, sor {sor}");
                swept.sweeps
            };
            let best = (20..39).map(|j| sweeps(0.05 * f64::from(j))).fold(f64::INFINITY, f64::min);
            let (own, plain) = (sweeps(0.0), sweeps(1.0));
            println!("stiffness {stiffness}: {own} sweeps, {best} at best, {plain} plain");
            assert!(own <= 1.5 * best + 8.0, "stiffness {stiffness}: {own} sweeps, {best} at best");
            assert!(own <= plain);
        }
    }

    #[test]
    fn the_cap_is_reported_as_not_converged() {
        let system = test_system(64, 30.0);
        let mut u = [Ring::zeros(64), Ring::zeros(64)];
        let [x, y] = &mut u;
        let control = Control { max_sweeps: 6, ..control(Order::Coloured, 1.0) };
        let swept = solve(&system, [x, y], Blocks::new(64).unwrap(), &control, true);
        assert!(!swept.converged && swept.finite);
        assert_eq!(swept.sweeps, 6.0);
    }

    #[test]
    fn sweeps_that_diverge_end_before_the_cap() {
        let system = test_system(64, 3.0);
        let mut u = [Ring::zeros(64), Ring::zeros(64)];
        let [x, y] = &mut u;
        let swept = solve(&system, [x, y], Blocks::new(64).unwrap(), &control(Order::Coloured, 2.5), true);
        assert!(!swept.converged && swept.finite);
        assert!(swept.sweeps < 10_000.0, "{} sweeps", swept.sweeps);
    }

    #[test]
    fn no_sweep_is_made_of_a_system_that_is_not_finite() {
        let mut system = test_system(64, 3.0);
        system.rhs[1][17] = f64::NAN;
        let mut u = [Ring::zeros(64), Ring::zeros(64)];
        let [x, y] = &mut u;
        let swept = solve(&system, [x, y], Blocks::new(64).unwrap(), &control(Order::Coloured, 1.0), true);
        assert!(!swept.converged && !swept.finite);
        assert_eq!(swept.sweeps, 0.0);
    }
}
