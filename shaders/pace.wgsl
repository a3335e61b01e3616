// Adaptive time: the length of the next step, and a clock that loses nothing. Twin of src/scheme/pace.rs.

const SAFETY = 0.95;
const MAX_GROWTH = 4.0;
const MIN_GROWTH = 0.25;
const MIN_STEP = 1e-12;
const MIN_TO_SINGULAR = 1e-3;

/// A step to attempt: its length, the high and the low part of that, and whether it reaches the final time.
struct Stride { length: real, high: real, low: real, last: bool }

/// The next step: the requested length, half of the remaining time, or all of it.
fn stride() -> Stride {
    let next = report.progress.next;
    let left = (p.end_high - report.progress.time_high) + (p.end_low - report.progress.time_low);
    if left <= next { return Stride(left, 0.0, 0.0, true); }
    let half = real(0.5) * left;
    // An accepted step of one tick may ask for slightly less.
    let wanted = max(select(next, half, half <= next), p.time_tick);
    let high = floor(wanted / p.time_unit) * p.time_unit;
    let low = floor((wanted - high) / p.time_tick) * p.time_tick;
    return Stride(high + low, high, low, false);
}

/// Advances the clock.
fn pass_time(by: Stride) {
    report.progress.taken = by.length;
    if by.last {
        report.progress.time_high = p.end_high;
        report.progress.time_low = p.end_low;
        return;
    }
    report.progress.time_high += by.high;
    report.progress.time_low += by.low;
    if p.time_unit <= report.progress.time_low {
        report.progress.time_low += -p.time_unit;
        report.progress.time_high += p.time_unit;
    }
}

fn is_at_goal() -> bool {
    return (p.goal_high - report.progress.time_high) + (p.goal_low - report.progress.time_low) <= real(0.0);
}

/// The length after a step of `length` with error `error`; the error scales with the square of the length.
fn next_length(length: real, error: real, most_growth: real) -> real {
    let growth = real(SAFETY) * sqrt(p.adaptive / max(error, real(1e-6) * p.adaptive));
    return length * min(max(growth, real(MIN_GROWTH)), most_growth);
}

/// The shortest step to try, `share` of `(L/n)⁴`.
fn least_step(share: real) -> real {
    let edge = report.now.length / real(NODES);
    return max(share * (edge * edge) * (edge * edge), p.time_tick);
}
