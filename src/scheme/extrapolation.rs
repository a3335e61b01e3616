//! The adaptive step: one step of the paper's scheme compared with two half steps. Twin of
//! `shaders/extrapolation.wgsl`.
//!
//! With A the result of one step of length h and B that of two steps of h/2, the scheme of first order makes errors
//! `c h²` and `c h²/2`. So `A - B` measures the error, `2B - A` is of second order, and so is, in the middle,
//! `B₁ + (B - A)/2` with B₁ the first half step. Every part is the paper's step; lengths, which are positive, are
//! extrapolated as `r_B²/r_A`.

use super::Curve;
use crate::number::{BIG, Number, Real};

/// The difference between the whole step and the two half steps, in k and in ln r.
///
/// The difference in k is relative to the largest |k|. While the shape is followed, i.e. until the excess is
/// negligible, it is relative to the geometric mean of the largest |k| and the spread of k: a curve close to a circle
/// must not lose its modes in a tolerance measured by the circle.
#[inline(always)]
pub fn error_of_attempt<N: Number>(whole: &Curve<N>, halves: &Curve<N>, followed: N::Mask) -> N {
    let low = N::of(-2.0 * BIG);
    let (mut gap_k, mut gap_r, mut k_max, mut minus_k_min) = (N::of(0.0), N::of(0.0), low, low);
    for i in 0..whole.len() {
        gap_k = gap_k.max((halves.k[i] - whole.k[i]).bounded_abs());
        gap_r = gap_r.max((halves.r[i] / whole.r[i] - N::of(1.0)).bounded_abs());
        k_max = k_max.max(halves.k[i]);
        minus_k_min = minus_k_min.max(-halves.k[i]);
    }
    let size = k_max.max(minus_k_min);
    let spread = (k_max + minus_k_min).min(size);
    let scale = N::select(followed, (size * spread).sqrt(), size);
    (gap_k / scale).bounded_abs().max(gap_r)
}

/// Puts the extrapolated curve into `halves` and the curve in the middle of the step into `whole`.
#[inline(always)]
pub fn extrapolate<N: Number>(whole: &mut Curve<N>, first: &Curve<N>, halves: &mut Curve<N>) {
    let half = N::of(0.5);
    for i in 0..whole.len() {
        between(&mut whole.x[i], first.x[i], &mut halves.x[i]);
        between(&mut whole.y[i], first.y[i], &mut halves.y[i]);
        between(&mut whole.k[i], first.k[i], &mut halves.k[i]);
        let (a, b) = (whole.r[i], halves.r[i]);
        whole.r[i] = first.r[i] + half * (b - a);
        halves.r[i] = b * b / a;
    }
    for curve in [whole, halves] {
        curve.x.close();
        curve.y.close();
        curve.k.close();
        curve.r.close();
    }
}

/// Replaces A by the value in the middle of the step, and B by the one at its end, from A, B₁ and B.
#[inline(always)]
fn between<N: Number>(a: &mut N, b1: N, b: &mut N) {
    let gap = *b - *a;
    *a = b1 + N::of(0.5) * gap;
    *b += gap;
}

/// A quantity at the fraction `at` of a step, on the parabola through its values `start`, `middle` and `end`.
pub fn inside<T: Real>(start: T, middle: T, end: T, at: T) -> T {
    let (two, four) = (T::of(2.0), T::of(4.0));
    let slope = four * middle - T::of(3.0) * start - end;
    let bend = two * (start - two * middle + end);
    start + at * (slope + at * bend)
}

/// The fraction of a step at which a quantity that goes from `start` over `middle` to `end` first falls to `target`;
/// `start > target >= end`.
pub fn crossing<T: Real>(start: T, middle: T, end: T, target: T) -> T {
    let (zero, two, four) = (T::of(0.0), T::of(2.0), T::of(4.0));
    // The parabola through the three: above + slope θ + bend θ².
    let above = start - target;
    let slope = four * middle - T::of(3.0) * start - end;
    let bend = two * (start - two * middle + end);
    let discriminant = slope * slope - four * bend * above;
    let root = two * above / (discriminant.max(zero).sqrt() - slope);
    let straight = above / (start - end);
    let inside = zero.le(discriminant) && zero.le(root) && root.le(T::of(1.0));
    if inside { root } else { straight }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_s_crossing_is_found_and_a_wild_one_falls_back_to_a_straight_line() {
        let decay = |t: f64| (-0.5 * t).exp();
        let at = crossing(1.0, decay(0.5), decay(1.0), decay(0.3));
        assert!((at - 0.3).abs() < 2e-3, "{at}");
        assert_eq!(crossing(1.0, 0.75, 0.5, 0.5), 1.0);
        assert_eq!(crossing(2.0, 1.5, 1.0, 1.25), 0.75);
        let wild = crossing(1.0, 9.0, 0.0, 0.5);
        assert!((0.0..=1.0).contains(&wild), "{wild}");
        assert_eq!(crossing(1.0, f64::NAN, 0.0, 0.5), 0.5);
    }
}
