// The decay of a member's excess: the line fitted to its logarithm, and its values at the times of a grid. Twin of
// crates/flow/src/scheme/decay.rs.

const PARTS = 32u;
const TIMES = 31u;
const POINTS = 8u;

/// Records what an accepted step adds; it is not yet counted.
fn follow(taken: Taken) {
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    let counters = &all_counters[member];
    var start = real(counters.steps);
    var end = min(start + real(1.0), p.clock_end);
    if ADAPTIVE {
        start = report.progress.time_high + report.progress.time_low;
        end = start + taken.h;
    }
    if counters.fit_points > 0u || taken.after <= p.fit_from {
        var time = start;
        var excess = taken.before;
        let points = select(1u, POINTS, ADAPTIVE);
        for (var point = 1u; point <= points; point++) {
            var next = end;
            var below = taken.after;
            if ADAPTIVE {
                let share = real(point) / real(POINTS);
                next = start + share * taken.h;
                below = taken_inside(taken, share);
            }
            fit(time, next, excess, below);
            time = next;
            excess = below;
        }
    }
    note(start, end, taken);
}

/// Adds the excess at the end of a step, or of a part of an adaptive one, to the fit while it is inside the window.
fn fit(start: real, end: real, before: real, after: real) {
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    let counters = &all_counters[member];
    if counters.fit_over != 0u || (counters.fit_points == 0u && !(after <= p.fit_from)) { return; }
    if !(p.fit_to <= after) {
        counters.fit_over = 1u;
        return;
    }
    if counters.fit_points > 0u {
        report.decay.x += abscissa(start, end);
        report.decay.y += ln_ratio(before, after);
    }
    if !(after <= p.fit_from) { return; }
    counters.fit_points += 1u;
    let count = real(counters.fit_points);
    let dx = report.decay.x - report.decay.mean_x;
    let dy = report.decay.y - report.decay.mean_y;
    report.decay.mean_x += dx / count;
    report.decay.mean_y += dy / count;
    report.decay.xx += dx * (report.decay.x - report.decay.mean_x);
    report.decay.xy += dx * (report.decay.y - report.decay.mean_y);
    report.decay.yy += dy * (report.decay.y - report.decay.mean_y);
}

/// The change of the abscissa over the step.
fn abscissa(start: real, end: real) -> real {
    let p = &all_parameters[member];
    if p.growth <= real(0.0) { return end - start; }
    return ln_ratio(p.growth + start, p.growth + end);
}

/// Records the excess at the grid times inside the step.
fn note(start: real, end: real, taken: Taken) {
    let p = &all_parameters[member];
    let counters = &all_counters[member];
    while counters.noted < TIMES {
        let share = real(counters.noted + 1u) / real(PARTS);
        let time = share * share * share * p.clock_end;
        if !(time <= end) { return; }
        let at = min(max((time - start) / (end - start), real(0.0)), real(1.0));
        let excess = taken_inside(taken, at);
        all_reports[member].excess_at[counters.noted] = excess;
        counters.noted += 1u;
    }
}
