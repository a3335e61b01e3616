//! The pentadiagonal system for the increments of x and y. Twin of `shaders/position.wgsl`.
//!
//! The paper's coefficients 𝓐…𝓔 of eq. (4), new r, q, k, old α. Node i lies between segments i and i+1, so the
//! term with φ uses `(φ(k_i) + φ(k_{i+1}))/2` in both 𝓑 and 𝓓; the paper prints `φ(k_{i-1})` in 𝓑, which gives
//! decay rates that do not converge (`docs/internals/method.md`). `𝓒 = q_i/τ - (𝓐+𝓑+𝓓+𝓔)`, so the residual of the old
//! state is `-Σ_j off_ij (x_j - x_i)`.
//!
//! A crystal has g at the nodes and M on the segments in them, and is moved by the force of the polygon only.

use super::{Branches, Curve, Parameters, forces, state::Motion};
use crate::{
    number::Number,
    solver::{Equation, Equations, Ring},
};

/// The equations, from the old positions and the new lengths and curvatures.
pub struct Position<'a, N> {
    old: &'a Curve<N>,
    pub(super) new: &'a Curve<N>,
    pub(super) motion: &'a Motion<N>,
    geometric: bool,
    tau: N,
    /// 1/τ.
    pub(super) rate: N,
}

impl<'a, N: Number> Position<'a, N> {
    /// Returns the system of a step of `p.tau` from `old`, with the lengths and curvatures of `new`.
    #[inline(always)]
    pub fn new(
        old: &'a Curve<N>,
        new: &'a Curve<N>,
        motion: &'a Motion<N>,
        p: &Parameters<N>,
        branches: Branches,
    ) -> Self {
        Position { old, new, motion, geometric: branches.geometric, tau: p.tau, rate: p.tau.recip() }
    }
}

impl<N: Number> Equations<N, 2> for Position<'_, N> {
    #[inline(always)]
    fn equation(&self, i: usize) -> Equation<N, 2> {
        let [_, _, r, rp, _] = self.new.r.window(i);
        let iq = self.motion.iq[i];
        let q = (r + rp) * N::of(0.5);
        let off = if self.motion.law.kind.is_crystal() { self.of_crystal(i) } else { self.of_paper(i) };
        let [a, b, d, e] = off;
        let c = q * self.rate - (a + b + d + e);
        let rhs = match self.geometric {
            true => forces::of_polygon(self.old, self.motion, i),
            false => [
                -self.stiff_position(i, self.old.x.rises_of_places(i)),
                -self.stiff_position(i, self.old.y.rises_of_places(i)),
            ],
        };
        Equation { a, b, c, d, e, rhs, time_over_length: self.tau * iq }
    }

    #[inline(always)]
    fn applied(&self, i: usize, unknown: &Ring<N>) -> N {
        let [_, _, r, rp, _] = self.new.r.window(i);
        (r + rp) * N::of(0.5) * self.rate * unknown[i] + self.stiff_position(i, unknown.rises(i))
    }
}

impl<N: Number> Position<'_, N> {
    /// `Σ_j off_ij (u_j - u_i)` for the [rises](Ring::rises) of u, as differences of `∂²u`.
    #[inline(always)]
    fn stiff_position(&self, i: usize, [before, here, after, last]: [N; 4]) -> N {
        let [_, _, k, kp, _] = self.new.k.window(i);
        let [_, irm, ir, irp, irpp] = self.motion.ir.window(i);
        let [_, iqm, iq, iqp, _] = self.motion.iq.window(i);
        let half = N::of(0.5);
        let (slope, slope_after) = (here * ir, after * irp);
        let bend_before = (slope - before * irm) * iqm;
        let rise = slope_after - slope;
        let bend = rise * iq;
        let bend_after = (last * irpp - slope_after) * iqp;
        let stiff = (bend_after - bend) * irp - (bend - bend_before) * ir;
        let phi = half * (self.motion.law.phi(k) + self.motion.law.phi(kp));
        let drift = half * self.motion.alpha[i] - N::of(0.75) * (self.new.k.rise_of_square(i) * iq);
        stiff + (phi * rise - drift * (here + after))
    }

    /// 𝓐, 𝓑, 𝓓 and 𝓔.
    #[inline(always)]
    fn of_paper(&self, i: usize) -> [N; 4] {
        let [_, _, k, kp, _] = self.new.k.window(i);
        let [_, irm, ir, irp, irpp] = self.motion.ir.window(i);
        let [_, iqm, iq, iqp, _] = self.motion.iq.window(i);
        let half = N::of(0.5);
        let a = ir * iqm * irm;
        let e = irp * iqp * irpp;
        let middle = ir * iq * irp;
        let low = ir * ir * (iqm + iq);
        let high = irp * irp * (iq + iqp);
        let phi = match self.motion.law.kind.is_forced() {
            true => self.motion.damping,
            false => half * (self.motion.law.phi(k) + self.motion.law.phi(kp)),
        };
        let drift = half * self.motion.alpha[i] - N::of(0.75) * (self.new.k.rise_of_square(i) * iq);
        [a, (phi * ir + drift) - (middle + low + a), (phi * irp - drift) - (middle + high + e), e]
    }

    /// The same of a crystal, with `φ = M w k` and the drift `½(M ∂w k + ∂(M w k))`.
    #[inline(always)]
    fn of_crystal(&self, i: usize) -> [N; 4] {
        let motion = self.motion;
        let [_, _, k, kp, _] = self.new.k.window(i);
        let [_, _, g, gp, _] = motion.stiffness.window(i);
        let [_, irm, ir, irp, irpp] = motion.ir.window(i);
        let [_, iqm, iq, iqp, _] = motion.iq.window(i);
        let [_, gm_there, g_there, gp_there, _] = motion.stiffness_there.window(i);
        let half = N::of(0.5);
        let (before, here, after) = (gm_there * iqm, g_there * iq, gp_there * iqp);
        let (w, wp) = (g * k, gp * kp);
        let (mut s, mut sp) = (ir, irp);
        let (mut phi, mut phi_after, mut current) = (w * k, wp * kp, wp - w);
        if motion.law.kind.is_diffusive() {
            let [_, _, mobile, mobile_after, _] = motion.mobile.window(i);
            (s, sp) = (mobile * ir, mobile_after * irp);
            (phi, phi_after) = (mobile * phi, mobile_after * phi_after);
            current = motion.mobile_there[i] * current;
        }
        let mean = if motion.law.kind.is_forced() { motion.damping } else { half * (phi + phi_after) };
        let turned = half * ((k + kp) * current) + (phi_after - phi);
        let drift = half * (motion.alpha[i] - turned * iq);
        let both = here * (s + sp);
        let a = s * irm * before;
        let e = sp * irpp * after;
        let b = (mean * ir + drift) - (ir * (both + s * before) + a);
        let d = (mean * irp - drift) - (irp * (both + sp * after) + e);
        [a, b, d, e]
    }
}
