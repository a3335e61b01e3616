//! Iterative refinement of a solution, where numbers have few digits.
//!
//! A solve in f32 is off by some `16τ/h⁴·ε` of itself, most of it in the slowest modes, which the residual hardly shows
//! unless it is computed by differences of differences ([`Equations::applied`]). What it leaves is solved for by the
//! same matrix, and added. A direct solver does so as often as it is told. Sweeps continue by rounds until one changes
//! the solution by no more than their tolerance, or than its rounding.

use super::{
    Blocks, Equation, Equations, Memory, Ring, Solves,
    sweeps::{self, Control, Swept},
};
use crate::number::{BIG, Mask, Number};

/// Change of a solution by a round of sweeps, in units of ε, up to which it is rounding. At 2 rounds without end were
/// seen.
pub const SETTLED: f64 = 8.0;

/// The equations for what a solution lacks.
pub struct Remaining<'a, N, E, const F: usize> {
    /// The equations.
    pub of: &'a E,
    /// The solution.
    pub unknown: [&'a Ring<N>; F],
}

impl<N: Number, E: Equations<N, F>, const F: usize> Equations<N, F> for Remaining<'_, N, E, F> {
    #[inline(always)]
    fn equation(&self, i: usize) -> Equation<N, F> {
        let mut own = self.of.equation(i);
        for f in 0..F {
            own.rhs[f] = own.rhs[f] - self.of.applied(i, self.unknown[f]);
        }
        own
    }

    #[inline(always)]
    fn applied(&self, i: usize, unknown: &Ring<N>) -> N {
        self.of.applied(i, unknown)
    }
}

/// Solves `equations`, and refines the solution if `control` says so; `lacks` is room for what it lacks. Sweeps start
/// from `unknown`.
#[inline(always)]
pub fn solve<N: Number, S: Solves, const F: usize>(
    equations: &impl Equations<N, F>,
    mut unknown: [&mut Ring<N>; F],
    memory: &mut Memory<N, F>,
    lacks: &mut [Ring<N>; F],
    blocks: Blocks,
    control: &Control<N>,
    mut live: N::Mask,
) -> Swept<N> {
    if !N::IS_SHORT || (S::FACTS.sweeps && !control.refined) {
        return S::solve(equations, unknown, memory, blocks, control, live);
    }
    let mut all = Swept { sweeps: N::of(0.0), converged: live, finite: live };
    let mut made = 0;
    if !S::FACTS.sweeps {
        all = S::solve(equations, unknown.each_mut().map(|ring| &mut **ring), memory, blocks, control, live);
        live = live.and(all.converged).and(N::of(1.0).le(control.refinements));
        made = 1;
    }
    while live.any() {
        let now = unknown.each_ref().map(|ring| &**ring);
        let swept = S::round(equations, now, lacks.each_mut(), memory, blocks, control, all.sweeps, live);
        all.sweeps += swept.sweeps;
        all.converged = all.converged.and(swept.converged.or(live.not()));
        all.finite = all.finite.and(swept.finite.or(live.not()));
        for f in 0..F {
            for i in 0..blocks.n {
                unknown[f][i] = N::select(live, unknown[f][i] + lacks[f][i], unknown[f][i]);
            }
            unknown[f].close();
        }
        live = live.and(all.converged);
        if S::FACTS.sweeps {
            let [change, size] = [sweeps::largest(&lacks.each_mut()), sweeps::largest(&unknown)];
            let (solved, unsolved) = judge_round(change, size, control);
            all.converged = all.converged.and(live.not().or(solved).or(unsolved));
            live = live.and(unsolved);
        } else {
            live = live.and(control.refinements.le(N::of(f64::from(made))).not());
        }
        made += 1;
    }
    all
}

/// Judges a round of sweeps by the largest change that it made to the unknown, and the largest of that: whether it is
/// solved, and whether more rounds may do so. A round leaves less than half of what there was, so less than its change.
#[inline(always)]
fn judge_round<N: Number>(change: N, size: N, control: &Control<N>) -> (N::Mask, N::Mask) {
    let tolerance = control.tolerance.max(N::of(SETTLED * N::EPSILON));
    let solved = change.le((tolerance * size).max(control.negligible));
    (solved, change.le(N::of(BIG)).and(solved.not()))
}
