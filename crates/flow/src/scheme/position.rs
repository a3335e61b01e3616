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
    p: &'a Parameters<N>,
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
        p: &'a Parameters<N>,
        branches: Branches,
    ) -> Self {
        Position { old, new, motion, geometric: branches.geometric, p, rate: p.tau.recip() }
    }
}

impl<N: Number> Equations<N, 2> for Position<'_, N> {
    #[inline(always)]
    fn equation(&self, i: usize) -> Equation<N, 2> {
        let (q, iq) = (self.dual_length(i), self.motion.iq[i]);
        let weights = self.weights(i);
        let off = if self.motion.law.kind.is_crystal() {
            self.row_of_crystal(i, weights)
        } else {
            self.row_of_paper(i, weights)
        };
        let [a, b, d, e] = off;
        let c = q * self.rate - (a + b + d + e);
        let rhs = match self.geometric {
            true => forces::of_polygon(self.old, self.motion, i),
            false => [
                -self.stiff_position(i, self.old.x.rises_of_places(i), weights),
                -self.stiff_position(i, self.old.y.rises_of_places(i), weights),
            ],
        };
        Equation { a, b, c, d, e, rhs, time_over_length: self.p.tau * iq }
    }

    #[inline(always)]
    fn applied(&self, i: usize, unknown: &Ring<N>) -> N {
        self.dual_length(i) * self.rate * unknown[i] + self.stiff_position(i, unknown.rises(i), self.weights(i))
    }
}

/// What the stiff terms at a node are weighted by.
#[derive(Clone, Copy)]
struct Weights<N> {
    /// Of the bends at the node before, there and at the node after.
    bends: [N; 3],
    /// Of the differences of those on the two segments.
    rises: [N; 2],
    /// φ, or what stands for it where forces act.
    phi: N,
    drift: N,
}

impl<N: Number> Position<'_, N> {
    /// `Σ_j off_ij (u_j - u_i)` for the [rises](Ring::rises) of u, as differences of `∂²u`.
    #[inline(always)]
    fn stiff_position(&self, i: usize, [before, here, after, last]: [N; 4], weights: Weights<N>) -> N {
        let [_, irm, ir, irp, irpp] = self.motion.ir.window(i);
        let Weights { bends: [at_before, at, at_after], rises: [own, next], phi, drift } = weights;
        let (slope, slope_after) = ((here * ir).rounded(), (after * irp).rounded());
        let bend_before = ((slope - (before * irm).rounded()) * at_before).rounded();
        let rise = slope_after - slope;
        let bend = (rise * at).rounded();
        let bend_after = (((last * irpp).rounded() - slope_after) * at_after).rounded();
        let stiff = ((bend_after - bend) * next).rounded() - ((bend - bend_before) * own).rounded();
        stiff + (phi * rise - drift * (here + after))
    }

    /// Half the length of the segments at node i.
    #[inline(always)]
    fn dual_length(&self, i: usize) -> N {
        let [_, _, r, rp, _] = self.new.r.window(i);
        (self.p.length_of(r) + self.p.length_of(rp)) * N::of(0.5)
    }

    /// φ, or what stands for it where forces act.
    #[inline(always)]
    fn damped(&self, phi: N) -> N {
        if self.motion.law.kind.is_forced() { self.motion.damping } else { phi }
    }

    #[inline(always)]
    fn weights(&self, i: usize) -> Weights<N> {
        if self.motion.law.kind.is_crystal() { self.weights_of_crystal(i) } else { self.weights_of_paper(i) }
    }

    #[inline(always)]
    fn weights_of_paper(&self, i: usize) -> Weights<N> {
        let [_, _, k, kp, _] = self.new.k.window(i);
        let [_, _, ir, irp, _] = self.motion.ir.window(i);
        let [_, iqm, iq, iqp, _] = self.motion.iq.window(i);
        let half = N::of(0.5);
        let phi = self.damped(half * (self.motion.law.phi(k) + self.motion.law.phi(kp)));
        let drift = half * self.motion.alpha[i] - N::of(0.75) * (self.new.k.rise_of_square(i) * iq);
        Weights { bends: [iqm, iq, iqp], rises: [ir, irp], phi, drift }
    }

    /// The same of a crystal, with `φ = M w k` and the drift `½(M ∂w k + ∂(M w k))`.
    #[inline(always)]
    fn weights_of_crystal(&self, i: usize) -> Weights<N> {
        let motion = self.motion;
        let [_, _, k, kp, _] = self.new.k.window(i);
        let [_, _, g, gp, _] = motion.stiffness.window(i);
        let [_, _, ir, irp, _] = motion.ir.window(i);
        let [_, iqm, iq, iqp, _] = motion.iq.window(i);
        let [_, gm_there, g_there, gp_there, _] = motion.stiffness_there.window(i);
        let half = N::of(0.5);
        let (w, wp) = (g * k, gp * kp);
        let mut rises = [ir, irp];
        let (mut phi, mut phi_after, mut current) = (w * k, wp * kp, wp - w);
        if motion.law.kind.is_diffusive() {
            let [_, _, mobile, mobile_after, _] = motion.mobile.window(i);
            rises = [mobile * ir, mobile_after * irp];
            (phi, phi_after) = (mobile * phi, mobile_after * phi_after);
            current = motion.mobile_there[i] * current;
        }
        let mean = self.damped(half * (phi + phi_after));
        let turned = half * ((k + kp) * current) + (phi_after - phi);
        let drift = half * (motion.alpha[i] - turned * iq);
        Weights { bends: [gm_there * iqm, g_there * iq, gp_there * iqp], rises, phi: mean, drift }
    }

    /// 𝓐, 𝓑, 𝓓 and 𝓔.
    #[inline(always)]
    fn row_of_paper(&self, i: usize, Weights { bends: [iqm, iq, iqp], phi, drift, .. }: Weights<N>) -> [N; 4] {
        let [_, irm, ir, irp, irpp] = self.motion.ir.window(i);
        let a = ir * iqm * irm;
        let e = irp * iqp * irpp;
        let middle = ir * iq * irp;
        let low = ir * ir * (iqm + iq);
        let high = irp * irp * (iq + iqp);
        [a, (phi * ir + drift) - (middle + low + a), (phi * irp - drift) - (middle + high + e), e]
    }

    /// The same of a crystal.
    #[inline(always)]
    fn row_of_crystal(&self, i: usize, weights: Weights<N>) -> [N; 4] {
        let [_, irm, ir, irp, irpp] = self.motion.ir.window(i);
        let Weights { bends: [before, here, after], rises: [s, sp], phi, drift } = weights;
        let both = here * (s + sp);
        let a = s * irm * before;
        let e = sp * irpp * after;
        let b = (phi * ir + drift) - (ir * (both + s * before) + a);
        let d = (phi * irp - drift) - (irp * (both + sp * after) + e);
        [a, b, d, e]
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::DVec2;

    use super::{
        super::{
            State, Workspace,
            curvature::Curvature,
            step::{Method, Steps},
        },
        *,
    };
    use crate::{
        crystal::Crystal,
        flow::Flow,
        forcing::{Drive, Forcing},
        solver::{Blocks, Solver},
    };

    const NODES: usize = 24;

    /// By how much the rows times an unknown differ from what is [applied](Equations::applied) to it, relative to that.
    fn mismatch_of<const F: usize>(equations: &impl Equations<f64, F>) -> f64 {
        let unknown = Ring::from_nodes((0..NODES).map(|i| (7.0 * i as f64).sin()));
        let mut worst = 0.0_f64;
        for i in 0..NODES {
            let [mm, m, own, next, last] = unknown.window(i);
            let Equation { a, b, c, d, e, .. } = equations.equation(i);
            let product = a * mm + b * m + c * own + d * next + e * last;
            worst = worst.max((equations.applied(i, &unknown) / product - 1.0).abs());
        }
        worst
    }

    /// That of the systems for k and for the positions.
    fn mismatches(flow: &Flow, forcing: &Forcing, geometric: bool) -> [f64; 2] {
        let n = NODES;
        let at = |i: usize| TAU * i as f64 / n as f64;
        let nodes: Vec<DVec2> = (0..n).map(|i| DVec2::from_angle(at(i)) * (1.0 + 0.2 * (3.0 * at(i)).sin())).collect();
        let mut p = Parameters { geometric: f64::from(u8::from(geometric)), ..Parameters::of_flow(flow, 0.1) };
        forcing.write(&mut p.law, 1.0);
        let mut state = State::<f64>::from_nodes(&nodes);
        let mut work = Workspace::new(Blocks::new(n).unwrap());
        let State { curve, increments, .. } = &mut state;
        Steps::step(curve, increments, &p, &Method::coloured(Solver::Direct, 1), &mut work);
        [
            mismatch_of(&Curvature::new(curve, &work.new, &work.motion, &p)),
            mismatch_of(&Position::new(curve, &work.new, &work.motion, &p, p.branches())),
        ]
    }

    #[test]
    fn what_is_applied_to_an_unknown_is_the_matrix() {
        let driven = Forcing { drive: Some(Drive::Constant(0.3)), ..Forcing::default() };
        let free = Forcing::default();
        let waves = Crystal { energy: "cos:4,0.03,5".parse().unwrap(), diffusivity: "cos:2,0.3".parse().unwrap() };
        let stiff = Crystal { energy: "cos:4,0.03".parse().unwrap(), ..Crystal::default() };
        let (elastic, crystals) = (Flow::Elastic(0.3), [waves, stiff].map(Flow::Crystal));
        let plain = [(&elastic, &free, false), (&elastic, &free, true), (&elastic, &driven, true)];
        for (flow, forcing, geometric) in plain.into_iter().chain(crystals.iter().map(|flow| (flow, &free, true))) {
            let mismatches = mismatches(flow, forcing, geometric);
            assert!(mismatches.iter().all(|of| *of < 1e-10), "{flow}, {forcing:?}: {mismatches:?}");
        }
    }
}
