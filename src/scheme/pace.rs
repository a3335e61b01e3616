//! Adaptive time: the length of the next step, and a clock that loses nothing. Twin of `shaders/pace.wgsl`.
//!
//! A time is the sum of a high and a low part, both multiples of powers of two: the high part of `time_unit`, the low
//! part, below `time_unit`, of `time_tick`. Steps are rounded down to multiples of `time_tick`, so both additions are
//! exact in every precision, however many and however small the steps are. Nothing here relies on the order in which
//! a compiler adds.

use super::{Parameters, member::Progress};
use crate::number::Real;

/// Fraction taken of the step length that is predicted to meet the tolerance.
pub const SAFETY: f64 = 0.95;
/// Maximum ratio of a step to the one before.
pub const MAX_GROWTH: f64 = 4.0;
/// Minimum ratio of a step to the one before; the ratio after a failure.
pub const MIN_GROWTH: f64 = 0.25;
/// A step below this multiple of `(L/n)⁴`, far below all time scales of a curve that n nodes resolve, ends the member.
pub const MIN_STEP: f64 = 1e-12;
/// Like [`MIN_STEP`], for a step that is accurate but ends in a singular curve: shorter ones only creep towards the
/// bound that it passed, until rounding holds them there.
pub const MIN_TO_SINGULAR: f64 = 1e-3;

/// A step to attempt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stride<T> {
    /// Its length.
    pub length: T,
    /// Its high part.
    pub high: T,
    /// Its low part.
    pub low: T,
    /// Whether it reaches the final time.
    pub last: bool,
}

/// Returns the next step: the requested length, half of the remaining time, or all of it.
pub fn stride<T: Real>(progress: &Progress<T>, p: &Parameters<T>) -> Stride<T> {
    let left = (p.end_high - progress.time_high) + (p.end_low - progress.time_low);
    if left.le(progress.next) {
        return Stride { length: left, high: T::of(0.0), low: T::of(0.0), last: true };
    }
    let half = T::of(0.5) * left;
    // An accepted step of one tick may ask for slightly less.
    let wanted = (if half.le(progress.next) { half } else { progress.next }).max(p.time_tick);
    let high = (wanted / p.time_unit).floor() * p.time_unit;
    let low = ((wanted - high) / p.time_tick).floor() * p.time_tick;
    Stride { length: high + low, high, low, last: false }
}

/// Advances the clock by `stride`.
pub fn pass_time<T: Real>(progress: &mut Progress<T>, stride: Stride<T>, p: &Parameters<T>) {
    progress.taken = stride.length;
    if stride.last {
        (progress.time_high, progress.time_low) = (p.end_high, p.end_low);
        return;
    }
    progress.time_high += stride.high;
    progress.time_low += stride.low;
    if p.time_unit.le(progress.time_low) {
        progress.time_low += -p.time_unit;
        progress.time_high += p.time_unit;
    }
}

/// Returns whether the clock has reached the goal.
pub fn is_at_goal<T: Real>(progress: &Progress<T>, p: &Parameters<T>) -> bool {
    ((p.goal_high - progress.time_high) + (p.goal_low - progress.time_low)).le(T::of(0.0))
}

/// Returns the length after a step of `length` with error `error`; the error scales with the square of the length.
pub fn next_length<T: Real>(length: T, error: T, most_growth: f64, p: &Parameters<T>) -> T {
    // A zero error allows any growth.
    let growth = T::of(SAFETY) * (p.adaptive / error.max(T::of(1e-6) * p.adaptive)).sqrt();
    length * growth.max(T::of(MIN_GROWTH)).min(T::of(most_growth))
}

/// Returns the shortest step to try, `share` of `(L/n)⁴`.
pub fn least_step<T: Real>(length: T, n: T, share: f64, p: &Parameters<T>) -> T {
    let edge = length / n;
    (T::of(share) * (edge * edge) * (edge * edge)).max(p.time_tick)
}
