//! The pentadiagonal system for the increments of x and y. Twin of `shaders/position.wgsl`.
//!
//! The paper's coefficients 𝓐…𝓔 of eq. (4), new r, q, k, old α. Node i lies between segments i and i+1, so the
//! term with φ uses `(φ(k_i) + φ(k_{i+1}))/2` in both 𝓑 and 𝓓; the paper prints `φ(k_{i-1})` in 𝓑, which gives
//! decay rates that do not converge (`docs/method.md`). `𝓒 = q_i/τ - (𝓐+𝓑+𝓓+𝓔)`, so the residual of the old
//! state is `-Σ_j off_ij (x_j - x_i)`.

use super::{Curve, Parameters, Workspace};
use crate::{number::Number, solver::Row};

/// Fills `work.position` from the old positions and the new lengths and curvatures.
pub fn assemble<N: Number>(old: &Curve<N>, p: &Parameters<N>, work: &mut Workspace<N>) {
    let rate = p.tau.recip();
    for i in 0..old.len() {
        let [_, _, r, rp, _] = work.new.r.window(i);
        let q = (r + rp) * N::of(0.5);
        let off = off_diagonals(p, work.new.k.window(i), work.ir.window(i), work.iq.window(i), work.alpha[i]);
        let [a, b, d, e] = off;
        let c = q * rate - (a + b + d + e);
        let (row, inverse) = Row::normalised(a, b, c, d, e, p.tau * work.iq[i]);
        work.position.rows[i] = row;
        work.position.rhs[0][i] = residual(off, old.x.window(i)) * inverse;
        work.position.rhs[1][i] = residual(off, old.y.window(i)) * inverse;
    }
}

#[inline(always)]
fn off_diagonals<N: Number>(
    p: &Parameters<N>,
    [_, _, k, kp, _]: [N; 5],
    [_, irm, ir, irp, irpp]: [N; 5],
    [_, iqm, iq, iqp, _]: [N; 5],
    alpha: N,
) -> [N; 4] {
    let half = N::of(0.5);
    let a = ir * iqm * irm;
    let e = irp * iqp * irpp;
    let middle = ir * iq * irp;
    let low = ir * ir * (iqm + iq);
    let high = irp * irp * (iq + iqp);
    let phi = half * (p.phi(k) + p.phi(kp));
    let drift = half * alpha - N::of(0.75) * ((kp * kp - k * k) * iq);
    let b = (phi * ir + drift) - (middle + low + a);
    let d = (phi * irp - drift) - (middle + high + e);
    [a, b, d, e]
}

#[inline(always)]
fn residual<N: Number>([a, b, d, e]: [N; 4], [mm, m, x, p, pp]: [N; 5]) -> N {
    -(a * (mm - x) + b * (m - x) + d * (p - x) + e * (pp - x))
}
