//! The decay of a member's excess: the line fitted to its logarithm, and its values at the times of a grid. Twin of
//! `shaders/decay.wgsl`.
//!
//! Times are in units of the member's clock: fixed steps, or its own unit of time if steps are adaptive. The logarithm
//! is accumulated from step to step, so that no difference of large numbers is taken.

use super::{
    Parameters,
    dense::Taken,
    member::{PARTS, TIMES},
    run::Run,
};
use crate::number::Real;

/// Maximum number of halvings that bring a ratio near 1.
pub const HALVINGS: u32 = 64;
/// Points that an adaptive step adds to the fit.
pub const POINTS: u32 = 8;
/// Terms of the series of the logarithm; the last is below 10⁻¹⁶.
pub const TERMS: u32 = 10;

/// The `part`-th time of the grid, as a fraction of the run: dense at the start, where curves change most.
pub fn share<T: Real>(part: usize) -> T {
    let share = T::of(part as f64) / T::of(PARTS as f64);
    share * share * share
}

/// Records what an accepted step adds.
pub(super) fn follow<T: Real>(run: &mut Run<T>, taken: &Taken<T>) {
    let (from, to) = clock(run, taken);
    let fitted = run.counters.fit_points > 0 || taken.after.le(run.parameters.fit_from);
    if fitted && run.parameters.adaptive.le(T::of(0.0)) {
        fit(run, [from, to], [taken.before, taken.after]);
    } else if fitted {
        let (mut time, mut excess) = (from, taken.before);
        for point in 1..=POINTS {
            let share = T::of(f64::from(point)) / T::of(f64::from(POINTS));
            let (next, below) = (from + share * taken.h, taken.inside(share));
            fit(run, [time, next], [excess, below]);
            (time, excess) = (next, below);
        }
    }
    note(run, from, to, taken);
}

/// Start and end of the step.
fn clock<T: Real>(run: &Run<T>, taken: &Taken<T>) -> (T, T) {
    let (progress, p) = (&run.report.progress, &run.parameters);
    if p.adaptive.le(T::of(0.0)) {
        let from = T::of(f64::from(run.counters.steps));
        return (from, (from + T::of(1.0)).min(p.clock_end));
    }
    let from = progress.time_high + progress.time_low;
    (from, from + taken.h)
}

/// Adds the excess at the end of a step, or of a part of an adaptive one, to the fit while it is inside the window: from the
/// first time in the window to the first time below it.
fn fit<T: Real>(run: &mut Run<T>, [from, to]: [T; 2], [before, after]: [T; 2]) {
    let Run { report, counters, parameters: p, .. } = run;
    let decay = &mut report.decay;
    if counters.fit_over != 0 || (counters.fit_points == 0 && !after.le(p.fit_from)) {
        return;
    }
    if !p.fit_to.le(after) {
        counters.fit_over = 1;
        return;
    }
    if counters.fit_points > 0 {
        decay.x += abscissa(from, to, p);
        decay.y += ln_ratio(before, after);
    }
    if !after.le(p.fit_from) {
        return;
    }
    counters.fit_points += 1;
    // B. P. Welford's update of means and sums of squares (1962).
    let count = T::of(f64::from(counters.fit_points));
    let (dx, dy) = (decay.x - decay.mean_x, decay.y - decay.mean_y);
    decay.mean_x += dx / count;
    decay.mean_y += dy / count;
    decay.xx += dx * (decay.x - decay.mean_x);
    decay.xy += dx * (decay.y - decay.mean_y);
    decay.yy += dy * (decay.y - decay.mean_y);
}

/// The change of the abscissa over the step: its length, or the change of the logarithm where the excess falls as a
/// power of `growth + t`.
fn abscissa<T: Real>(from: T, to: T, p: &Parameters<T>) -> T {
    if p.growth.le(T::of(0.0)) { to - from } else { ln_ratio(p.growth + from, p.growth + to) }
}

/// Records the excess at the grid times inside the step.
fn note<T: Real>(run: &mut Run<T>, from: T, to: T, taken: &Taken<T>) {
    let Run { report, counters, parameters: p, .. } = run;
    while (counters.noted as usize) < TIMES {
        let time = share::<T>(counters.noted as usize + 1) * p.clock_end;
        if !time.le(to) {
            return;
        }
        let inside = ((time - from) / (to - from)).max(T::of(0.0)).min(T::of(1.0));
        report.excess_at[counters.noted as usize] = taken.inside(inside);
        counters.noted += 1;
    }
}

/// `ln(b/a)` of positive numbers, by halvings and `2·artanh((q-1)/(q+1))` of the rest; WGSL has no logarithm in f64.
pub fn ln_ratio<T: Real>(a: T, b: T) -> T {
    let (one, half, two) = (T::of(1.0), T::of(0.5), T::of(2.0));
    let ln_2 = T::of(std::f64::consts::LN_2);
    let (mut q, mut whole) = (b / a, T::of(0.0));
    let (low, high) = (T::of(std::f64::consts::FRAC_1_SQRT_2), T::of(std::f64::consts::SQRT_2));
    for _ in 0..HALVINGS {
        if !low.le(q) {
            q = two * q;
            whole = whole - ln_2;
        } else if !q.le(high) {
            q = half * q;
            whole += ln_2;
        } else {
            break;
        }
    }
    let z = (q - one) / (q + one);
    let square = z * z;
    let mut sum = T::of(0.0);
    for term in (0..TERMS).rev() {
        sum = sum * square + one / T::of(f64::from(2 * term + 1));
    }
    whole + two * (z * sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst_ln<T: Real>() -> f64 {
        let mut worst = 0.0_f64;
        for j in -400..=400 {
            let (a, b) = (T::of(0.3), T::of((f64::from(j) * 0.03 + 0.01).exp()));
            let exact = (b.to_f64() / a.to_f64()).ln();
            worst = worst.max((ln_ratio(a, b).to_f64() - exact).abs() / (T::EPSILON * exact.abs().max(1.0)));
        }
        worst
    }

    #[test]
    fn the_logarithm_is_accurate_in_both_precisions() {
        assert!(worst_ln::<f64>() < 3.0, "{}", worst_ln::<f64>());
        assert!(worst_ln::<f32>() < 3.0, "{}", worst_ln::<f32>());
        assert_eq!(ln_ratio(2.0, 2.0), 0.0);
    }

    #[test]
    fn times_are_dense_at_the_start_and_end_at_the_end() {
        assert_eq!((share::<f64>(0), share::<f64>(16), share::<f64>(PARTS)), (0.0, 0.125, 1.0));
        assert_eq!(f64::from(share::<f32>(31)), share::<f64>(31), "exact in every precision");
    }
}
