//! Velocity, tangential redistribution and the new lengths. Twin of `shaders/redistribution.wgsl`.
//!
//! From the old state, with `q_i = (r_i + r_{i+1})/2`:
//!
//! - `β_i = -(1/r_i)·((k_{i+1}-k_i)/q_i - (k_i-k_{i-1})/q_{i-1}) + b(k_i)`, the paper's eq. (1);
//! - `α_i = α_{i-1} + r_i k_i β_i - r_i B + ω(M - r_i)`, eq. (5), with `B = Σ r k β / L`, `M = L/n`,
//!   `α_0 = α_n = 0`;
//! - `r_i ← r_i·exp(τ(-B + ω(M/r_i - 1)))`, eq. (3) for `η = ln r`; without redistribution α = 0 and
//!   `r_i ← r_i·exp(-τ k_i β_i)`.

use super::{Curve, Parameters, Workspace};
use crate::number::{Mask, Number};

/// Fills β, r·k·β, α and the new r (with 1/r and 1/q) of `work`; returns the length `L = Σr` of the old old.
pub fn redistribute<N: Number>(old: &Curve<N>, p: &Parameters<N>, work: &mut Workspace<N>) -> N {
    let n = old.len();
    for i in 0..n {
        let beta = velocity(p, old.k.window(i), old.r.window(i));
        work.beta[i] = beta;
        work.rkb[i] = old.r[i] * old.k[i] * beta;
    }
    let length = work.blocks.sum(|i| old.r[i]);
    let mean_rkb = work.blocks.sum(|i| work.rkb[i]) / length;
    let mean_length = length / N::of(n as f64);
    // Members side by side in lanes have it or not together.
    if N::of(0.5).le(p.redistribution).any() {
        tangential_velocity(old, p, mean_rkb, mean_length, work);
        for i in 0..n {
            let r = old.r[i];
            let rate = p.omega * (mean_length / r - N::of(1.0)) - mean_rkb;
            work.new.r[i] = r * (p.tau * rate).exp();
        }
    } else {
        for i in 0..n {
            work.alpha[i] = N::of(0.0);
            work.new.r[i] = old.r[i] * (-(p.tau * (old.k[i] * work.beta[i]))).exp();
        }
    }
    work.alpha.close();
    work.new.r.close();
    reciprocals(work);
    length
}

#[inline(always)]
fn velocity<N: Number>(p: &Parameters<N>, [_, km, k, kp, _]: [N; 5], [_, rm, r, rp, _]: [N; 5]) -> N {
    let half = N::of(0.5);
    let q = (r + rp) * half;
    let qm = (rm + r) * half;
    p.b(k) - ((kp - k) / q - (k - km) / qm) / r
}

/// α by a running sum that restarts from the sum of whole blocks, as the kernel's prefix sum does.
fn tangential_velocity<N: Number>(
    old: &Curve<N>,
    p: &Parameters<N>,
    mean_rkb: N,
    mean_length: N,
    work: &mut Workspace<N>,
) {
    let growth = |i: usize| {
        let r = old.r[i];
        work.rkb[i] - r * mean_rkb + p.omega * (mean_length - r)
    };
    let mut before = N::of(0.0);
    for (start, length) in work.blocks.iter() {
        let mut part = growth(start);
        work.alpha[start] = before + part;
        for i in start + 1..start + length {
            part += growth(i);
            work.alpha[i] = before + part;
        }
        before += part;
    }
    work.alpha[old.len() - 1] = N::of(0.0);
}

fn reciprocals<N: Number>(work: &mut Workspace<N>) {
    for i in 0..work.blocks.n {
        let [_, _, r, rp, _] = work.new.r.window(i);
        work.ir[i] = r.recip();
        work.iq[i] = ((r + rp) * N::of(0.5)).recip();
    }
    work.ir.close();
    work.iq.close();
}
