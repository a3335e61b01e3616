//! What multigrid needs to know of the two systems to discretise them on coarser rings. Twin of `shaders/coarse.wgsl`.
//!
//! Both are `ρu + ∂⁴u + p ∂²u + w ∂u`: that of k lives on segments, q apart and r long, with ρ = 1/τ - kβ, p = 0 and
//! w = -α; that of x on nodes, r apart and q long, with ρ = 1/τ, p = φ and w = -α + ³⁄₂ ∂_s k². Coarse systems are only
//! corrected by, so α is taken as the mean over the cell.

use super::{Branches, Motion, Parameters};
use crate::{
    number::Number,
    solver::{Ring, multigrid::Levels},
};

/// The terms of the curvature system, from the motion of the old curve and the new lengths.
#[inline(always)]
pub fn curvature<N: Number>(motion: &Motion<N>, r: &Ring<N>, p: &Parameters<N>, levels: &mut Levels<N, 1>) {
    levels.rate = p.tau.recip();
    for i in 0..r.len() {
        let [_, _, own, next, _] = r.window(i);
        let [_, alpha_m, alpha, _, _] = motion.alpha.window(i);
        levels.terms.spacing[i] = (own + next) * N::of(0.5);
        levels.terms.cell[i] = own;
        levels.terms.mass[i] = levels.rate - motion.rkb[i] * motion.ir[i];
        levels.terms.second[i] = N::of(0.0);
        levels.terms.first[i] = -(N::of(0.5) * (alpha_m + alpha));
    }
    levels.terms.close();
}

/// The terms of the position system, from the motion of the old curve and the new lengths and curvatures.
#[inline(always)]
pub fn position<N: Number>(
    motion: &Motion<N>,
    r: &Ring<N>,
    k: &Ring<N>,
    p: &Parameters<N>,
    branches: Branches,
    levels: &mut Levels<N, 2>,
) {
    levels.rate = p.tau.recip();
    let law = p.law(branches);
    for i in 0..r.len() {
        let [_, _, own, next, _] = r.window(i);
        let [_, _, here, after, _] = k.window(i);
        levels.terms.spacing[i] = next;
        levels.terms.cell[i] = (own + next) * N::of(0.5);
        levels.terms.mass[i] = levels.rate;
        levels.terms.second[i] = N::of(0.5) * (law.phi(here) + law.phi(after));
        levels.terms.first[i] = N::of(1.5) * ((after * after - here * here) * motion.iq[i]) - motion.alpha[i];
    }
    levels.terms.close();
}
