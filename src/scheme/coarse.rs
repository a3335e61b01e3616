//! What multigrid needs to know of the two systems to discretise them on coarser rings. Twin of `shaders/coarse.wgsl`.
//!
//! Both are `ρu + ∂⁴u + p ∂²u + w ∂u`: that of k lives on segments, q apart and r long, with ρ = 1/τ - kβ, p = 0 and
//! w = -α; that of x on nodes, r apart and q long, with ρ = 1/τ, p = φ and w = -α + ³⁄₂ ∂_s k². Coarse systems are only
//! corrected by, so α is taken as the mean over the cell.

use super::{Curve, Parameters, Workspace};
use crate::number::Number;

/// The terms of the curvature system, from the old state and the new lengths.
pub fn curvature<N: Number>(old: &Curve<N>, p: &Parameters<N>, work: &mut Workspace<N>) {
    let levels = &mut work.curvature_levels;
    levels.rate = p.tau.recip();
    for i in 0..old.len() {
        let [_, _, r, rp, _] = work.new.r.window(i);
        let [_, alpha_m, alpha, _, _] = work.alpha.window(i);
        levels.terms.spacing[i] = (r + rp) * N::of(0.5);
        levels.terms.cell[i] = r;
        levels.terms.mass[i] = levels.rate - work.rkb[i] * work.ir[i];
        levels.terms.second[i] = N::of(0.0);
        levels.terms.first[i] = -(N::of(0.5) * (alpha_m + alpha));
    }
    levels.terms.close();
}

/// The terms of the position system, from the new lengths and curvatures.
pub fn position<N: Number>(p: &Parameters<N>, work: &mut Workspace<N>) {
    let levels = &mut work.position_levels;
    levels.rate = p.tau.recip();
    for i in 0..work.blocks.n {
        let [_, _, r, rp, _] = work.new.r.window(i);
        let [_, _, k, kp, _] = work.new.k.window(i);
        levels.terms.spacing[i] = rp;
        levels.terms.cell[i] = (r + rp) * N::of(0.5);
        levels.terms.mass[i] = levels.rate;
        levels.terms.second[i] = N::of(0.5) * (p.phi(k) + p.phi(kp));
        levels.terms.first[i] = N::of(1.5) * ((kp * kp - k * k) * work.iq[i]) - work.alpha[i];
    }
    levels.terms.close();
}
