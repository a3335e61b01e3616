//! Gauss–Seidel sweeps to a residual, the paper's solver, and those of a round of a [refinement](super::refinement).
//!
//! *Theory.* The unknown is the increment over a step, started from a prediction ([`start`](crate::scheme::start)). A
//! sweep replaces `u_i` by `u_i + ω_SOR·residual_i`; ω_SOR = 1 is Gauss–Seidel. The slow modes of a fourth-order
//! operator hardly show in the residual: their eigenvalue is only q/τ. The residual is therefore scaled by τ/q, which
//! bounds the error of just these modes, and the sweeps stop when `max (τ/q)|residual| ≤ tolerance · max|u|`, or when
//! that error is below the rounding of the unknown itself, or when the residual is all rounding (f32 reaches that at a
//! tolerance of about 16·ε·τ/h⁴). Stopping on the update would stop hundreds of times too early.
//!
//! *Practice.* Coloured order gives the kernel its parallelism and needs the same number of sweeps as the
//! lexicographic order of the paper. The sweeps themselves are in [`sweeps`](super::sweeps). Twin of
//! `shaders/gauss_seidel.wgsl`: same order, same arithmetic.

use super::{
    ring::{Blocks, Ring},
    sweeps::{Control, Swept, Target, norms, sweep},
    system::System,
};
use crate::number::{Mask, Number};

/// Sweeps between two checks of the residual; a check costs about as much as a sweep.
pub const SWEEPS_PER_CHECK: u32 = 8;

/// Sweeps `unknown` (one ring per right-hand side) until its residual is small, in the lanes that are `live`. Finished
/// lanes stay unchanged.
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
            sweep(system, &mut unknown, blocks, control.order, sor, active);
        }
        done += sweeps;
        swept.sweeps += N::select(active, N::of(f64::from(sweeps)), N::of(0.0));
        let (converged, unsolved) = target.judge(norms(system, &unknown));
        swept.converged = converged;
        active = active.and(unsolved);
    }
    swept
}

/// Sweeps `lacks` from zero, as many times as a round has sweeps, in the lanes that are `live`. It ends there: what the
/// rows give of the residual is rounding long before a refined solution is done.
#[inline(always)]
pub fn sweep_round<N: Number, const F: usize>(
    system: &System<N, F>,
    mut lacks: [&mut Ring<N>; F],
    blocks: Blocks,
    control: &Control<N>,
    made: N,
    live: N::Mask,
) -> Swept<N> {
    let target = Target::of(system, control);
    let sor = N::select(control.sor.le(N::of(0.0)), over_relaxation(target.size), control.sor);
    let sweeps = sweeps_of_round(target.size);
    // Part of a round would tell nothing.
    let fits = live.and(target.finite).and((made + sweeps).le(N::of(f64::from(control.max_sweeps))));
    for ring in &mut lacks {
        ring.padded_mut().fill(N::of(0.0));
    }
    let mut done = 0;
    loop {
        let active = fits.and(sweeps.le(N::of(f64::from(done))).not());
        if !active.any() {
            break;
        }
        sweep(system, &mut lacks, blocks, control.order, sor, active);
        done += 1;
    }
    Swept { sweeps: N::select(fits, sweeps, N::of(0.0)), converged: fits, finite: target.finite }
}

/// The sweeps of a round: [`SWEEPS_PER_CHECK`] times √(⅝·size), which with the [over-relaxation](over_relaxation) of
/// its size leaves less than half of what the unknown lacks.
#[inline(always)]
fn sweeps_of_round<N: Number>(size: N) -> N {
    let checks = (N::of(AUTO_SCALE) * size).sqrt().max(N::of(1.0)).min(N::of(MAX_CHECKS)).small_floor();
    N::of(f64::from(SWEEPS_PER_CHECK)) * checks
}

/// The most sweeps of a round, in units of [`SWEEPS_PER_CHECK`]: a dispatch pauses only between two rounds.
pub const MAX_CHECKS: f64 = 1024.0;

/// The over-relaxation that needs about the fewest sweeps for a system of this size: 2g/(1 + g) with g = (⅝·size)^¼,
/// about (10 τ/h⁴)^¼, measured (`docs/internals/method.md`).
#[inline(always)]
fn over_relaxation<N: Number>(size: N) -> N {
    let g = (N::of(AUTO_SCALE) * size).sqrt().sqrt();
    (N::of(2.0) * (g / (N::of(1.0) + g))).max(N::of(1.0))
}

/// The ⅝ in the automatic over-relaxation.
pub const AUTO_SCALE: f64 = 0.625;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::{Order, direct, sweeps::largest, system::tests::test_system};

    fn control(order: Order, sor: f64) -> Control<f64> {
        Control { tolerance: 1e-12, negligible: 0.0, sor, max_sweeps: 100_000, order, refined: false, refinements: 0.0 }
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

    /// What a round of sweeps leaves of what was there.
    fn left_by_a_round(stiffness: f64, sor: f64) -> f64 {
        let (n, system) = (100, test_system(100, stiffness));
        let rings = || [Ring::zeros(n), Ring::zeros(n)];
        let [mut exact, mut lacks] = [rings(), rings()];
        direct::solve(&system, exact.each_mut(), &mut direct::Factor::new(n));
        let control = Control { max_sweeps: 1_000_000, ..control(Order::Coloured, sor) };
        let swept = sweep_round(&system, lacks.each_mut(), Blocks::new(n).unwrap(), &control, 0.0, true);
        assert!(swept.converged && swept.finite);
        let most = largest(&exact.each_mut());
        for (f, i) in (0..2).flat_map(|f| (0..n).map(move |i| (f, i))) {
            lacks[f][i] -= exact[f][i];
        }
        println!(
            "stiffness {stiffness}, sor {sor}: {} sweeps leave {:e}",
            swept.sweeps,
            largest(&lacks.each_mut()) / most
        );
        largest(&lacks.each_mut()) / most
    }

    /// A member at rest in f32 may take steps five times as stiff as the last.
    #[test]
    fn a_round_of_sweeps_leaves_less_than_half() {
        for stiffness in [0.1, 10.0, 100.0, 1e3, 1e4, 2e4, 5e4, 1e5] {
            assert!(left_by_a_round(stiffness, 0.0) < 0.5);
        }
        assert!(left_by_a_round(1e4, 1.0) > 0.5, "the control");
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
