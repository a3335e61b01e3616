//! The pentadiagonal system for the increment of the curvature. Twin of `shaders/curvature.wgsl`.
//!
//! The paper's coefficients a…e, f of eq. (2), new r and q, old k, β and `r·k·β` on the diagonal, for
//! `δ = k_new - k_old`. With `s = r_i/τ - (r k β)_i` the diagonal is `c = s - (a+b+d+e)`, so the residual of the
//! old state is a sum of differences:
//! `f - M k = ∂b + (r k β)_i k_i - Σ_j off_ij (k_j - k_i)`.
//!
//! Of a crystal, the stiff terms are those of w = g k with M at the nodes: a constant w is in their kernel, a constant
//! k is not.

use super::{Curve, Parameters, forces, state::Motion};
use crate::{
    number::Number,
    solver::{Equation, Equations, Ring},
};

/// The equations, from the old curve, its motion and the new lengths.
pub struct Curvature<'a, N> {
    old: &'a Curve<N>,
    pub(super) new: &'a Curve<N>,
    pub(super) motion: &'a Motion<N>,
    p: &'a Parameters<N>,
    /// 1/τ.
    pub(super) rate: N,
}

impl<'a, N: Number> Curvature<'a, N> {
    /// Returns the system of a step of `p.tau` from `old`, with the lengths of `new`.
    #[inline(always)]
    pub fn new(old: &'a Curve<N>, new: &'a Curve<N>, motion: &'a Motion<N>, p: &'a Parameters<N>) -> Self {
        Curvature { old, new, motion, p, rate: p.tau.recip() }
    }
}

impl<N: Number> Equations<N, 1> for Curvature<'_, N> {
    #[inline(always)]
    fn equation(&self, i: usize) -> Equation<N, 1> {
        if self.motion.law.kind.is_crystal() {
            return self.of_crystal(i);
        }
        let [_, irm, ir, irp, _] = self.motion.ir.window(i);
        let [iqmm, iqm, iq, iqp, _] = self.motion.iq.window(i);
        let [_, alpha_m, alpha, _, _] = self.motion.alpha.window(i);
        let [_, rise_of_b, rise_of_bp, _] = self.motion.b.rises(i);
        let (r, rkb) = (self.p.length_of(self.new.r[i]), self.motion.rkb[i]);
        let half = N::of(0.5);
        let a = iqm * irm * iqmm;
        let e = iq * irp * iqp;
        let middle = ir * iq * iqm;
        let low = iqm * iqm * (ir + irm);
        let high = iq * iq * (ir + irp);
        let b = half * alpha_m - (middle + low + a);
        let d = -(half * alpha) - (middle + high + e);
        let c = (r * self.rate - rkb) - (a + b + d + e);
        let forcing = rise_of_bp * iq - rise_of_b * iqm;
        let rises = self.old.k.rises(i);
        let stiff = self.stiff_curvature(i, rises, rises);
        Equation { a, b, c, d, e, rhs: [forcing + rkb * self.old.k[i] - stiff], time_over_length: self.p.tau * ir }
    }

    #[inline(always)]
    fn applied(&self, i: usize, unknown: &Ring<N>) -> N {
        let own = self.p.length_of(self.new.r[i]) * self.rate - self.motion.rkb[i];
        let rises = unknown.rises(i);
        let weighted = if self.motion.law.kind.is_crystal() { self.weighted_rises(i, unknown) } else { rises };
        own * unknown[i] + self.stiff_curvature(i, rises, weighted)
    }
}

impl<N: Number> Curvature<'_, N> {
    /// `Σ_j off_ij (u_j - u_i)` for the [rises](Ring::rises) of u and of w, as differences of `∂²w`; w is u, of a
    /// crystal g u.
    #[inline(always)]
    fn stiff_curvature(&self, i: usize, [_, here, after, _]: [N; 4], weighted: [N; 4]) -> N {
        let [_, irm, ir, irp, _] = self.motion.ir.window(i);
        let [_, iqm, iq, _, _] = self.motion.iq.window(i);
        let [pmm, pm, p, pp, _] = forces::conductance(self.motion, i);
        let [_, alpha_m, alpha, _, _] = self.motion.alpha.window(i);
        let [rise_before, rise, rise_after, rise_last] = weighted;
        let (first, second) = ((rise * pm).rounded(), (rise_after * p).rounded());
        let bend_before = ((first - (rise_before * pmm).rounded()) * irm).rounded();
        let bend = ((second - first) * ir).rounded();
        let bend_after = (((rise_last * pp).rounded() - second) * irp).rounded();
        let (own, next) = (((bend - bend_before) * iqm).rounded(), ((bend_after - bend) * iq).rounded());
        (next - own) - N::of(0.5) * (alpha_m * here + alpha * after)
    }

    /// The [rises](Ring::rises) of g u.
    #[inline(always)]
    fn weighted_rises(&self, i: usize, unknown: &Ring<N>) -> [N; 4] {
        let (g, mut all) = (self.motion.stiffness.window(i), unknown.window(i));
        for j in 0..5 {
            all[j] = (g[j] * all[j]).rounded();
        }
        [all[1] - all[0], all[2] - all[1], all[3] - all[2], all[4] - all[3]]
    }

    /// The equation of a crystal.
    #[inline(always)]
    fn of_crystal(&self, i: usize) -> Equation<N, 1> {
        let [gmm, gm, g, gp, gpp] = self.motion.stiffness.window(i);
        let [_, irm, ir, irp, _] = self.motion.ir.window(i);
        let [_, iqm, iq, _, _] = self.motion.iq.window(i);
        let [pmm, pm, p, pp, _] = forces::conductance(self.motion, i);
        let [_, alpha_m, alpha, _, _] = self.motion.alpha.window(i);
        let (r, rkb) = (self.p.length_of(self.new.r[i]), self.motion.rkb[i]);
        let half = N::of(0.5);
        let (before, after) = (half * alpha_m, half * alpha);
        let a = iqm * irm * pmm;
        let e = iq * irp * pp;
        let b = -(pm * (ir * iq + iqm * (ir + irm)) + a);
        let d = -(p * (ir * iqm + iq * (ir + irp)) + e);
        let stiff = self.stiff_curvature(i, self.old.k.rises(i), self.motion.weighted.rises(i));
        let c = (r * self.rate - rkb) - (before - after) - (a + b + d + e) * g;
        let rhs = rkb * self.old.k[i] - stiff;
        let (a, b, d, e) = (a * gmm, b * gm + before, d * gp - after, e * gpp);
        Equation { a, b, c, d, e, rhs: [rhs], time_over_length: self.p.tau * ir }
    }
}
