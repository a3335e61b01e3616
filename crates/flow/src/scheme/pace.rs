//! Adaptive time: the length of the next step, and a clock that loses nothing. Twin of `shaders/pace.wgsl`.
//!
//! A time is the sum of a high and a low part, both multiples of powers of two: the high part of `time_unit`, the low
//! part, below `time_unit`, of `time_tick`. Steps are rounded down to multiples of `time_tick`, so both additions are
//! exact in every precision, however many and however small the steps are. Nothing here relies on the order in which
//! a compiler adds.

use super::{
    Parameters,
    extrapolation::{LEAST_ORDER, parts, tolerance},
    member::Progress,
};
use crate::number::{Real, ln_ratio};

/// Fraction taken of the step length that is predicted to meet the tolerance.
pub const SAFETY: f64 = 0.9;
/// Maximum ratio of a step to the one before.
pub const MAX_GROWTH: f64 = 8.0;
/// Minimum ratio of a step to the one before.
pub const MIN_GROWTH: f64 = 0.1;
/// The ratio after a failure.
pub const AFTER_FAILURE: f64 = 0.25;
/// Maximum ratio to a step that was refused.
pub const AFTER_REFUSAL: f64 = 0.7;
/// The same if the one before it was refused, too: where a curve has just begun, errors do not fall as the order says.
pub const AFTER_REFUSALS: f64 = 0.3;
/// Rounding of a step of the lowest order, in units of ε and of the root of the largest weight of its systems.
pub const ROUNDING: f64 = 8.0;
/// The order falls where the lower one makes the same progress for this fraction of the work.
pub const FALLS: f64 = 0.8;
/// The order rises where the lower one makes the same progress for no less than this multiple of the work.
pub const RISES: f64 = 0.9;
/// A step below this multiple of `(L/n)⁴`, far below all time scales of a curve that n nodes resolve, ends the member.
pub const MIN_STEP: f64 = 1e-12;
/// Like [`MIN_STEP`], for a step that is accurate but ends in a singular curve: shorter ones only creep towards the
/// bound that it passed, until rounding holds them there.
pub const MIN_TO_SINGULAR: f64 = 1e-3;

/// Largest weight of the systems of a step, in units of `h/(L/n)⁴`.
pub const WEIGHT: f64 = 16.0;

/// Length of a step, as a share of the longest one, above which its solutions are refined. Without, a solution is off
/// by about that share of itself.
pub const ONCE: f64 = 1e-5;
/// The same, above which they are refined twice.
pub const TWICE: f64 = 1e-3;
/// The same, above which they are refined three times.
pub const THRICE: f64 = 1e-2;

/// How far behind the predicted place of an event a step ends, as a share of the way there.
pub const BEHIND: f64 = 1.0 / 32.0;
/// Nearest place that a step is aimed at, as a share of the length that its error allows.
pub const NEAREST_AIM: f64 = 0.125;

/// A step to attempt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

/// What a step may have.
#[derive(Clone, Copy, Debug)]
pub struct Allowed<T> {
    /// Largest error.
    pub error: T,
    /// Highest order.
    pub order: u32,
}

/// Returns whether the next step ends where the member is expected to relax. A place near its start is left there: what
/// lies near an end is as exact as the end, and a short step would tell nothing of the next one but rounding.
pub fn is_aimed<T: Real>(progress: &Progress<T>) -> bool {
    let Progress { next, aim, .. } = *progress;
    (T::of(NEAREST_AIM) * next).le(aim) && !next.le(aim)
}

/// Returns the next step: the requested length, half of the remaining time, or all of it.
pub fn stride<T: Real>(progress: &Progress<T>, p: &Parameters<T>) -> Stride<T> {
    let next = if is_aimed(progress) { progress.aim } else { progress.next };
    let left = (p.end_high - progress.time_high) + (p.end_low - progress.time_low);
    if left.le(next) {
        return Stride { length: left, high: T::of(0.0), low: T::of(0.0), last: true };
    }
    let half = T::of(0.5) * left;
    // An accepted step of one tick may ask for slightly less.
    let wanted = (if half.le(next) { half } else { next }).max(p.time_tick);
    let high = (wanted / p.time_unit).floor() * p.time_unit;
    let low = ((wanted - high) / p.time_tick).floor() * p.time_tick;
    Stride { length: high + low, high, low, last: false }
}

/// Advances the clock by `stride`.
pub fn pass_time<T: Real>(progress: &mut Progress<T>, stride: Stride<T>, p: &Parameters<T>) {
    progress.taken_before = progress.taken;
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

/// Returns the largest error of a step of length h of a curve of length `length` with n nodes: an error below the
/// rounding of the solves says nothing. The largest weight of their systems is about 16h/(L/n)⁴. Where solves are
/// `refined` only that of the parts remains.
pub fn allowed<T: Real>(h: T, length: T, n: T, p: &Parameters<T>, refined: bool) -> T {
    if refined {
        return tolerance(p);
    }
    let edge = length / n;
    (T::of(4.0 * ROUNDING * T::EPSILON) * (h.sqrt() / (edge * edge))).max(p.adaptive)
}

/// Returns the ratio of the next step to one of order `order` with error `error`, which scales with that power of the
/// length, where `allowed` is allowed.
pub fn growth<T: Real>(error: T, order: u32, allowed: T) -> T {
    // A zero error allows any growth.
    let ratio = allowed / error.max(T::of(1e-12) * allowed);
    let root = (ln_ratio(T::of(1.0), ratio) / T::of(f64::from(order))).exponential();
    (T::of(SAFETY) * root).max(T::of(MIN_GROWTH)).min(T::of(MAX_GROWTH))
}

/// Returns the length of a step that ends shortly behind the place where ln excess has fallen by `-fall`, or 0 if it
/// does not fall: the ends of a step are more exact than what lies inside. Slope and bend of ln excess are in units of
/// `taken`.
pub fn aim<T: Real>(fall: T, slope: T, bend: T, taken: T) -> T {
    let two = T::of(2.0);
    if !slope.le(T::of(0.0)) {
        return T::of(0.0);
    }
    // Where the parabola turns round before it, as if it touched.
    let square = (slope * slope + two * bend * fall).max(T::of(0.0));
    T::of(1.0 + BEHIND) * (two * fall / (slope - square.sqrt())) * taken
}

/// Returns the work of a step of order `order` and of this ratio to the last one, for the same progress.
fn work<T: Real>(order: u32, ratio: T) -> T {
    T::of(f64::from(parts::<T>(order))) / ratio
}

/// Returns the length and the order after a step of length `length` and order `order`, with the errors of that order
/// and of the one below: of the two, and the one above, the order that makes the most progress for its work. The order
/// only rises if the step may grow.
pub fn choose<T: Real>(length: T, order: u32, errors: [T; 2], most_growth: T, allowed: Allowed<T>) -> (T, u32) {
    let own = growth(errors[0], order, allowed.error).min(most_growth);
    if order > LEAST_ORDER {
        let lower = growth(errors[1], order - 1, allowed.error).min(most_growth);
        if work(order - 1, lower).le(T::of(FALLS) * work(order, own)) {
            return (length * lower, order - 1);
        }
        if work(order - 1, lower).le(work(order, own) / T::of(RISES)) {
            return (length * own, order);
        }
    }
    if order == allowed.order || most_growth.le(T::of(1.0)) {
        return (length * own, order);
    }
    // The next order is taken to need as much work for the same progress.
    let longer = T::of(f64::from(parts::<T>(order + 1))) / T::of(f64::from(parts::<T>(order)));
    (length * (own * longer).min(most_growth), order + 1)
}

/// Returns the longest step that short numbers can solve for: the largest weight of its systems, [`WEIGHT`] times
/// `h/(L/n)⁴`, times ε is the error of a solution, and above 1 no refinement helps.
pub fn longest_step<T: Real>(length: T, n: T) -> T {
    let edge = length / n;
    T::of(1.0 / (WEIGHT * T::EPSILON)) * (edge * edge) * (edge * edge)
}

/// Returns how often the solutions of a step of length h are [refined](crate::solver::refinement): the more often, the
/// larger the weights of their systems.
pub fn refinements<T: Real>(h: T, length: T, n: T) -> u32 {
    let share = h / longest_step(length, n);
    [ONCE, TWICE, THRICE].map(|most| u32::from(!share.le(T::of(most)))).iter().sum()
}

/// Returns the shortest step to try, `share` of `(L/n)⁴`.
pub fn least_step<T: Real>(length: T, n: T, share: f64, p: &Parameters<T>) -> T {
    let edge = length / n;
    (T::of(share) * (edge * edge) * (edge * edge)).max(p.time_tick)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_are_refined_the_more_often_the_longer_the_step() {
        let (length, n) = (6.0, 100.0);
        let most = longest_step::<f32>(length, n);
        let often = [1e-6, 1e-4, 5e-3, 0.5, f32::NAN].map(|share| refinements(share * most, length, n));
        assert_eq!(often, [0, 1, 2, 3, 3]);
    }

    #[test]
    fn a_step_ends_shortly_behind_where_the_excess_falls_to_a_threshold() {
        let behind = 1.0 + BEHIND;
        // Along a line; along a parabola that falls by 1.5 at 1, ever faster or ever more slowly.
        for (slope, bend) in [(-1.5, 0.0), (-1.0, -1.0), (-2.0, 1.0)] {
            assert_eq!(aim(-1.5, slope, bend, 0.25), 0.25 * behind, "{slope} {bend}");
        }
        // It turns round before it: as if it touched.
        assert_eq!(aim(-3.0, -2.0, 1.0, 0.25), 0.75 * behind);
        for wild in [[0.5, 0.0], [f64::NAN, 0.0]] {
            assert_eq!(aim(-1.5, wild[0], wild[1], 0.25), 0.0, "{wild:?}");
        }
    }
}
