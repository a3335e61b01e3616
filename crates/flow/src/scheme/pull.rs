//! The metric pull: k and r relax towards the polygon's own curvatures and lengths. Twin of `shaders/pull.wgsl`.
//!
//! The scheme's three unknowns r, k and x drift apart, since each has its own equation, and nothing in the paper
//! reconnects them. After a step of length τ the pull sets
//! `k_i ← k_i + s(k_i(x) - k_i)` and `r_i ← r_i + s(|e_i| - r_i)` with `s = κτ/(1 + κτ)`, an implicit step of
//! `k̇ = κ(k(x) - k)`, with `k_i(x)` the turn of the polygon between the neighbours of segment i over
//! `|e_{i-1}|/2 + |e_i| + |e_{i+1}|/2`. It is written as an increment, since the rounding of `1/(1 + κτ)` as a factor
//! would scale all k and r alike, step by step, and single precision shows that.
//! A vertex of angle θ turns by 2 sin(θ/2): a regular polygon then has the curvature 1/R of its circumscribed circle,
//! and the position equation leaves it at rest. With θ itself, k is larger by θ²/24 and circles grow for ever.
//! κ = 0 is the paper's scheme.

use super::{
    Branches, Curve, Parameters,
    state::{edge, vertex_turn},
};
use crate::number::Number;

/// Returns the turn of the polygon at both ends of segment i together, and the length over which it turns.
#[inline(always)]
pub fn turn<N: Number>(curve: &Curve<N>, i: usize) -> [N; 2] {
    let n = curve.len();
    let (before, own, after) =
        (edge(curve.nodes(), (i + n - 1) % n), edge(curve.nodes(), i), edge(curve.nodes(), (i + 1) % n));
    let half = N::of(0.5);
    [vertex_turn(before, own) + vertex_turn(own, after), half * before[2] + own[2] + half * after[2]]
}

/// Pulls the new k and r of a step towards `curve`'s polygon.
#[inline(always)]
pub fn pull<N: Number>(curve: &mut Curve<N>, p: &Parameters<N>, branches: Branches) {
    if !branches.pulled {
        return;
    }
    let rate = p.pull * p.tau;
    let share = rate / (N::of(1.0) + rate);
    for i in 0..curve.len() {
        let [angle, span] = turn(curve, i);
        let (k, r, own) = (curve.k[i], curve.r[i], edge(curve.nodes(), i)[2] - p.r_offset);
        curve.k[i] = k + share * (angle / span - k);
        curve.r[i] = r + share * (own - r);
    }
    curve.k.close();
    curve.r.close();
}
