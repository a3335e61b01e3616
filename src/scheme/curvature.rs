//! The pentadiagonal system for the increment of the curvature. Twin of `shaders/curvature.wgsl`.
//!
//! The paper's coefficients a…e, f of eq. (2), new r and q, old k, β and `r·k·β` on the diagonal, for
//! `δ = k_new - k_old`. With `s = r_i/τ - (r k β)_i` the diagonal is `c = s - (a+b+d+e)`, so the residual of the
//! old state is a sum of differences:
//! `f - M k = ∂b + (r k β)_i k_i - Σ_j off_ij (k_j - k_i)`.

use super::{Curve, Parameters, Workspace};
use crate::{number::Number, solver::Row};

/// Fills `work.curvature` from the old state and the new lengths.
pub fn assemble<N: Number>(old: &Curve<N>, p: &Parameters<N>, work: &mut Workspace<N>) {
    let rate = p.tau.recip();
    for i in 0..old.len() {
        let (row, rhs) = row(
            p,
            rate,
            old.k.window(i),
            work.ir.window(i),
            work.iq.window(i),
            work.alpha.window(i),
            [work.new.r[i], work.rkb[i]],
        );
        work.curvature.rows[i] = row;
        work.curvature.rhs[0][i] = rhs;
    }
}

#[inline(always)]
fn row<N: Number>(
    p: &Parameters<N>,
    rate: N,
    [kmm, km, k, kp, kpp]: [N; 5],
    [_, irm, ir, irp, _]: [N; 5],
    [iqmm, iqm, iq, iqp, _]: [N; 5],
    [_, alpha_m, alpha, _, _]: [N; 5],
    [r, rkb]: [N; 2],
) -> (Row<N>, N) {
    let half = N::of(0.5);
    let a = iqm * irm * iqmm;
    let e = iq * irp * iqp;
    let middle = ir * iq * iqm;
    let low = iqm * iqm * (ir + irm);
    let high = iq * iq * (ir + irp);
    let b = half * alpha_m - (middle + low + a);
    let d = -(half * alpha) - (middle + high + e);
    let c = (r * rate - rkb) - (a + b + d + e);
    let bk = p.b(k);
    let forcing = (p.b(kp) - bk) * iq - (bk - p.b(km)) * iqm;
    let stiff = a * (kmm - k) + b * (km - k) + d * (kp - k) + e * (kpp - k);
    let (row, inverse) = Row::normalised(a, b, c, d, e, p.tau * ir);
    (row, (forcing + rkb * k - stiff) * inverse)
}
