// Adaptive time: the length of the next step, and a clock that loses nothing. Twin of crates/flow/src/scheme/pace.rs.

const SAFETY = 0.9;
const MAX_GROWTH = 8.0;
const MIN_GROWTH = 0.1;
const AFTER_FAILURE = 0.25;
const AFTER_REFUSAL = 0.7;
const AFTER_REFUSALS = 0.3;
const ROUNDING = 8.0;
const FALLS = 0.8;
const RISES = 0.9;
const MIN_STEP = 1e-12;
const MIN_TO_SINGULAR = 1e-3;
/// Largest weight of the systems of a step, in units of `h/(L/n)⁴`.
const WEIGHT = 16.0;
/// Length of a step, as a share of the longest one, above which its solutions are refined once, twice, three times.
const ONCE = 1e-5;
const TWICE = 1e-3;
const THRICE = 1e-2;
const BEHIND = 0.03125;
const NEAREST_AIM = 0.125;

/// A step to attempt: its length, the high and the low part of that, and whether it reaches the final time.
struct Stride { length: real, high: real, low: real, last: bool }

/// Whether the next step ends where the member is expected to relax, unless that is near its start.
fn is_aimed() -> bool {
    let progress = &all_reports[member].report.progress;
    return real(NEAREST_AIM) * progress.next <= progress.aim && !(progress.next <= progress.aim);
}

/// The next step: the requested length, half of the remaining time, or all of it.
fn stride() -> Stride {
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    let next = select(report.progress.next, report.progress.aim, is_aimed());
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
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    report.progress.taken_before = report.progress.taken;
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
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    return (p.goal_high - report.progress.time_high) + (p.goal_low - report.progress.time_low) <= real(0.0);
}

/// The largest error of a step of length h of a curve of length `length`: an error below the rounding of the solves
/// says nothing. Where solves are refined only that of the parts remains.
fn allowed(h: real, length: real) -> real {
    if REFINED { return tolerance(); }
    let edge = length / real(node_count());
    return max(real(4.0 * ROUNDING * EPSILON) * (sqrt(h) / (edge * edge)), all_parameters[member].adaptive);
}

/// The ratio of the next step to one of order `order` with error `error`, where `most` is allowed.
fn growth(error: real, order: u32, most: real) -> real {
    let ratio = most / max(error, real(1e-12) * most);
    let root = exponential(vec(ln_ratio(1.0, ratio) / real(order))).x;
    return min(max(real(SAFETY) * root, real(MIN_GROWTH)), real(MAX_GROWTH));
}

/// The length of a step that ends shortly behind the place where ln excess has fallen by `-fall`, or 0 if it does not
/// fall. Slope and bend of ln excess are in units of `taken`.
fn aim(fall: real, slope: real, bend: real, taken: real) -> real {
    if !(slope <= real(0.0)) { return real(0.0); }
    // Where the parabola turns round before it, as if it touched.
    let square = max(slope * slope + real(2.0) * bend * fall, real(0.0));
    return real(1.0 + BEHIND) * (real(2.0) * fall / (slope - sqrt(square))) * taken;
}

/// A length and an order.
struct Choice { length: real, order: u32 }

/// The work of a step of order `order` and of this ratio to the last one, for the same progress.
fn work(order: u32, ratio: real) -> real { return real(parts(order)) / ratio; }

/// The length and the order after a step of length `length` and order `order`, with the errors of that order
/// and of the one below.
fn choose(length: real, order: u32, errors: vec2<real>, most_growth: real, most: real) -> Choice {
    let own = min(growth(errors.x, order, most), most_growth);
    if order > LEAST_ORDER {
        let lower = min(growth(errors.y, order - 1u, most), most_growth);
        if work(order - 1u, lower) <= real(FALLS) * work(order, own) { return Choice(length * lower, order - 1u); }
        if work(order - 1u, lower) <= work(order, own) / real(RISES) { return Choice(length * own, order); }
    }
    if order == dispatch.most_order || most_growth <= real(1.0) { return Choice(length * own, order); }
    let longer = real(parts(order + 1u)) / real(parts(order));
    return Choice(length * min(own * longer, most_growth), order + 1u);
}

/// The longest step that short numbers can solve for: the largest weight of its systems, WEIGHT times `h/(L/n)⁴`, times
/// ε is the error of a solution, and above 1 no refinement helps.
fn longest_step(length: real) -> real {
    let edge = length / real(node_count());
    return real(1.0 / (WEIGHT * EPSILON)) * (edge * edge) * (edge * edge);
}

/// How often the solutions of a step of length h are refined.
fn refinements(h: real, length: real) -> u32 {
    let share = h / longest_step(length);
    return select(1u, 0u, share <= real(ONCE)) + select(1u, 0u, share <= real(TWICE)) + select(1u, 0u, share <= real(THRICE));
}

/// The shortest step to try, `share` of `(L/n)⁴`.
fn least_step(share: real) -> real {
    let edge = all_reports[member].report.now.length / real(node_count());
    return max(share * (edge * edge) * (edge * edge), all_parameters[member].time_tick);
}
