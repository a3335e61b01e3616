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
use crate::number::{Real, ln_ratio};

/// Points that an adaptive step adds to the fit.
pub const POINTS: u32 = 8;

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

/// Adds the excess at the end of a step, or of a part of an adaptive one, to the fit while it is inside the window:
/// from the first time in the window to the first time below it.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_dense_at_the_start_and_end_at_the_end() {
        assert_eq!((share::<f64>(0), share::<f64>(16), share::<f64>(PARTS)), (0.0, 0.125, 1.0));
        assert_eq!(f64::from(share::<f32>(31)), share::<f64>(31), "exact in every precision");
    }
}
