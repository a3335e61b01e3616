//! Tangential redistribution and the new lengths. Twin of `shaders/redistribution.wgsl`.
//!
//! From the old state, with `q_i = (r_i + r_{i+1})/2`:
//!
//! - `β_i = -(1/r_i)·((k_{i+1}-k_i)/q_i - (k_i-k_{i-1})/q_{i-1}) + b(k_i)`, the paper's eq. (1), by
//!   [`forces`], with what [`forcing`] adds;
//! - `α_i = α_{i-1} + r_i k_i β_i - r_i B + ω(M - r_i)`, eq. (5), with `B = Σ r k β / L`, `M = L/n`,
//!   `α_0 = α_n = 0`;
//! - `r_i ← r_i·exp(τ(-B + ω(M/r_i - 1)))`, eq. (3) for `η = ln r`; without redistribution α = 0 and
//!   `r_i ← r_i·exp(-τ k_i β_i)`.

use super::{Branches, Curve, Parameters, forces, forcing, state::Motion};
use crate::{
    number::Number,
    solver::{Blocks, Ring, Sums},
};

/// Fills `motion` and the lengths `r` from the old curve; returns its length `L = Σr`.
#[inline(always)]
pub fn redistribute<N: Number>(
    old: &Curve<N>,
    p: &Parameters<N>,
    branches: Branches,
    blocks: Blocks,
    motion: &mut Motion<N>,
    r: &mut Ring<N>,
) -> N {
    let n = N::of(old.len() as f64);
    reciprocals(&old.r, p, motion);
    forces::fill(old, p, branches.law, motion);
    let mut sums = Sums::new(blocks);
    for i in 0..old.len() {
        let beta = forces::velocity(motion, old.k.rises(i), i);
        let length = p.length_of(old.r[i]);
        let rkb = length * old.k[i] * beta;
        motion.beta[i] = beta;
        motion.rkb[i] = rkb;
        sums.add(i, [length, rkb]);
    }
    let [length, mut sum_rkb] = sums.totals();
    if branches.law.is_forced() {
        sum_rkb = forcing::act(old, p, branches.law, length, blocks, motion);
    }
    let (mean_rkb, mean_length) = (sum_rkb / length, length / n);
    if branches.redistributed {
        tangential_velocity(old, p, [mean_rkb, mean_length], blocks, motion);
        for i in 0..old.len() {
            let rate = p.omega * (mean_length * motion.ir[i] - N::of(1.0)) - mean_rkb;
            r[i] = grown(old.r[i], p.tau * rate, p);
        }
    } else {
        for i in 0..old.len() {
            motion.alpha[i] = N::of(0.0);
            r[i] = grown(old.r[i], -(p.tau * (old.k[i] * motion.beta[i])), p);
        }
    }
    motion.alpha.close();
    r.close();
    reciprocals(r, p, motion);
    length
}

/// Computes α by a running sum that restarts from the sum of whole blocks, like the kernel's prefix sum.
#[inline(always)]
fn tangential_velocity<N: Number>(
    old: &Curve<N>,
    p: &Parameters<N>,
    [mean_rkb, mean_length]: [N; 2],
    blocks: Blocks,
    motion: &mut Motion<N>,
) {
    let mut sum = Sums::new(blocks);
    for i in 0..old.len() {
        let r = p.length_of(old.r[i]);
        sum.add(i, [motion.rkb[i] - r * mean_rkb + p.omega * (mean_length - r)]);
        [motion.alpha[i]] = sum.so_far();
    }
    motion.alpha[old.len() - 1] = N::of(0.0);
}

/// Returns what is stored of a length that grows by the factor `e^growth`.
#[inline(always)]
fn grown<N: Number>(stored: N, growth: N, p: &Parameters<N>) -> N {
    let length = p.length_of(stored);
    if N::IS_SHORT {
        stored + length * growth.exponential_less_one()
    } else {
        length * growth.exponential() - p.r_offset
    }
}

/// Computes `1/r` and `1/q` from one division, `1/(r q)`, since both are of the same size. In short numbers each by
/// itself: neighbours must see the same `1/r`, to the last bit, and in the kernel not all see q.
#[inline(always)]
fn reciprocals<N: Number>(r: &Ring<N>, p: &Parameters<N>, motion: &mut Motion<N>) {
    for i in 0..r.len() {
        let [_, _, own, next, _] = r.window(i);
        let (own, next) = (p.length_of(own), p.length_of(next));
        let q = (own + next) * N::of(0.5);
        if N::IS_SHORT {
            (motion.ir[i], motion.iq[i]) = (own.recip(), q.recip());
            continue;
        }
        let inverse = (own * q).recip();
        (motion.ir[i], motion.iq[i]) = (inverse * q, inverse * own);
    }
    motion.ir.close();
    motion.iq.close();
}
