//! Sums and maxima of a curve, from which its report, its status and its events follow. Twin of
//! `shaders/observe.wgsl`.
//!
//! Length, area and turning number are those of the polygon x; the energy uses the scheme's k and r.

use super::{Curve, Parameters, pull};
use crate::{number::Number, solver::Blocks};

/// `|k|·r` from which on a curve counts as not resolved: its tangent turns by 2 rad from segment to segment.
pub const MAX_TURN: f64 = 2.0;
/// Shortest over mean edge below which an edge counts as vanished.
pub const MIN_EDGE: f64 = 1e-5;
/// Metric drift above which the scheme's lengths say nothing about the polygon: with far too large a step k and r
/// lose x, and the polygon shrinks to a point that would look round.
pub const MAX_DRIFT: f64 = 1.0;
/// Gap between k and the polygon's turn, in rad, above which no member counts as relaxed: its curvature, which moves it,
/// is not that of the polygon, which looks round.
pub const MAX_GAP: f64 = 0.5;

/// The four sums, in the order of the kernel's `vec4`.
#[derive(Clone, Copy, Debug)]
pub struct Sums<N> {
    /// `Σ |e_i|`.
    pub length: N,
    /// `½ Σ x_{i-1} × x_i`.
    pub area: N,
    /// `Σ (½k_i² + λ) r_i`.
    pub energy: N,
    /// Windings of the edge vector round the origin.
    pub turning: N,
}

/// The maxima; a value that is not finite shows as more than [`BIG`](crate::number::BIG).
#[derive(Clone, Copy, Debug)]
pub struct Maxima<N> {
    /// `max |k_i| r_i`.
    pub turn: N,
    /// `max |r_i - |e_i|| / |e_i|`.
    pub drift: N,
    /// Longest edge.
    pub longest: N,
    /// Minus the shortest edge.
    pub minus_shortest: N,
    /// Largest curvature.
    pub k_max: N,
    /// Minus the smallest curvature.
    pub minus_k_min: N,
}

/// Sums over the ring.
pub fn sums<N: Number>(curve: &Curve<N>, p: &Parameters<N>, blocks: Blocks) -> Sums<N> {
    let half = N::of(0.5);
    Sums {
        length: blocks.sum(|i| edge(curve, i)[2]),
        area: half
            * blocks.sum(|i| {
                let ([_, xm, x, ..], [_, ym, y, ..]) = (curve.x.window(i), curve.y.window(i));
                xm * y - x * ym
            }),
        energy: blocks.sum(|i| {
            let k = curve.k[i];
            (half * (k * k) + p.length_penalty) * curve.r[i]
        }),
        turning: blocks.sum(|i| winding(curve, i)),
    }
}

/// Maxima over the ring.
pub fn maxima<N: Number>(curve: &Curve<N>) -> Maxima<N> {
    let low = N::of(-2.0 * crate::number::BIG);
    let mut m = Maxima { turn: low, drift: low, longest: low, minus_shortest: low, k_max: low, minus_k_min: low };
    for i in 0..curve.x.len() {
        let (k, r, e) = (curve.k[i], curve.r[i], edge(curve, i)[2]);
        m.turn = m.turn.max((k * r).bounded_abs());
        m.drift = m.drift.max(((r - e) / e).bounded_abs());
        m.longest = m.longest.max(e.bounded_abs());
        m.minus_shortest = m.minus_shortest.max(-e.bounded_abs());
        m.k_max = m.k_max.max(k);
        m.minus_k_min = m.minus_k_min.max(-k);
    }
    m
}

/// `L²/(4π|A|)` above that of the regular polygon.
#[inline(always)]
pub fn excess<N: Number>(sums: &Sums<N>, p: &Parameters<N>) -> N {
    sums.length * sums.length / (N::of(4.0 * std::f64::consts::PI) * sums.area.abs()) - p.polygon_ratio
}

/// Largest gap between the angle by which the curvature turns the tangent over a segment, from middle to middle of its
/// neighbours, and the angle by which the polygon turns there.
pub fn gap<N: Number>(curve: &Curve<N>) -> N {
    let mut gap = N::of(0.0);
    for i in 0..curve.len() {
        let [angle, span] = pull::turn(curve, i);
        gap = gap.max((curve.k[i] * span - angle).bounded_abs());
    }
    gap
}

/// Largest way that a node went from `old` to `new`.
pub fn farthest<N: Number>(old: &Curve<N>, new: &Curve<N>) -> N {
    let mut farthest = N::of(0.0);
    for i in 0..old.len() {
        let (dx, dy) = (new.x[i] - old.x[i], new.y[i] - old.y[i]);
        farthest = farthest.max((dx * dx + dy * dy).sqrt().bounded_abs());
    }
    farthest
}

/// Edge that ends at node i: `[Δx, Δy, |e|]`.
#[inline(always)]
pub fn edge<N: Number>(curve: &Curve<N>, i: usize) -> [N; 3] {
    let ([_, xm, x, ..], [_, ym, y, ..]) = (curve.x.window(i), curve.y.window(i));
    let (dx, dy) = (x - xm, y - ym);
    [dx, dy, (dx * dx + dy * dy).sqrt()]
}

/// +1 (-1) where the edge vector turns from `e_i` to `e_{i+1}` across the positive x axis, the short way round.
#[inline(always)]
fn winding<N: Number>(curve: &Curve<N>, i: usize) -> N {
    let ([_, xm, x, xp, _], [_, ym, y, yp, _]) = (curve.x.window(i), curve.y.window(i));
    let (ex, ey, fx, fy) = (x - xm, y - ym, xp - x, yp - y);
    let (zero, one) = (N::of(0.0), N::of(1.0));
    let side = ex * fy - fx * ey;
    let e_below = N::select(ey.le(zero), one, zero);
    let f_below = N::select(fy.le(zero), one, zero);
    let left = N::select(side.le(zero), zero, one);
    let right = N::select(zero.le(side), zero, one);
    // Upwards across the axis with the origin on the left, or downwards with it on the right.
    e_below * (one - f_below) * left - (one - e_below) * f_below * right
}
