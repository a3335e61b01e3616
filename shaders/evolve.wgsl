// The entry point's work: one workgroup advances one member by up to `dispatch.steps` steps towards its goal. Twin of
// src/scheme/evolve.rs. A fixed step that fails is not accepted: the member ends in its last good state. An adaptive
// step is retried with a shorter length until that is too short to mean anything.
//
// A dispatch also ends when its sweeps are used up. The attempt then pauses: the increments so far are stored, and the
// next dispatch recomputes the same rows and continues sweeping. Results do not depend on where a dispatch ends, to the
// last bit.

fn take_member(index: u32) {
    member = all_due[index];
    p = all_parameters[member];
    counters = all_counters[member];
    report = all_reports[member].report;
    counters.sweeps_k = 0u;
    counters.sweeps_x = 0u;
    let due = select(0u, counters.goal - counters.steps, counters.status == RUNNING);
    let steps = uniform_decision(min(dispatch.steps, due));
    if steps > 0u {
        load_curve(CURVE);
        dk = load_field(INCREMENTS);
        dx = load_field(INCREMENTS + 1u);
        dy = load_field(INCREMENTS + 2u);
        budget = dispatch.sweeps;
        for (var s = 0u; s < steps && budget > 0u; s++) {
            if advance() != GO_ON { break; }
        }
        storageBarrier();
        if !ADAPTIVE { store_curve(CURVE); }
        store_field(INCREMENTS, dk);
        store_field(INCREMENTS + 1u, dx);
        store_field(INCREMENTS + 2u, dy);
    }
    // Every thread has read what thread 0 now overwrites.
    storageBarrier();
    if lane == 0u {
        all_counters[member] = counters;
        all_reports[member].report = report;
    }
}

const GO_ON = 0u;
const STOP = 1u;

/// Attempts a step and handles the result; returns whether to continue, the same in every thread.
///
/// A step and an observation are each called in one place only: compilers inline the whole body of every call.
fn advance() -> u32 {
    let by = stride();
    let h = by.length;
    let parts = select(1u, 3u, ADAPTIVE);
    var solved = SOLVED;
    for (var part = uniform_decision(counters.phase / 2u); part < parts && solved == SOLVED; part++) {
        if ADAPTIVE { begin_part(part, h); }
        solved = step();
        if ADAPTIVE && solved == SOLVED { end_part(part); }
    }
    if solved == PAUSED { return STOP; }
    counters.phase = 0u;
    counters.solve_sweeps = 0u;
    var error = real(0.0);
    if ADAPTIVE && solved == SOLVED {
        error = error_of_attempt();
        if uniform_decision(select(1u, 0u, error <= p.adaptive)) == 1u {
            let next = next_length(h, error, 1.0);
            start_after_refused(next / (real(0.5) * h));
            return refuse(next, real(MIN_STEP), SINGULAR);
        }
        extrapolate();
        load_curve(CURVE);
    }
    var middle = report.now;
    if solved == SOLVED { middle = observe_step(); }
    let failure = uniform_decision(failure_of_step(solved));
    if failure != RUNNING {
        if ADAPTIVE { return refuse_failure(h, failure); }
        counters.status = failure;
        return STOP;
    }
    report.before = report.now;
    report.middle = middle;
    report.now = observed();
    record_events(h);
    follow(h);
    if ADAPTIVE {
        let next = next_length(h, error, select(real(1.0), real(MAX_GROWTH), counters.refused == 0u));
        report.progress.next = next;
        start_after_taken(next / (real(0.5) * h));
        pass_time(by);
        counters.refused = 0u;
    } else {
        start_after_fixed();
    }
    // The curve before a fixed step is stored if an output time may lie between the two.
    if ADAPTIVE || counters.steps + 1u == counters.goal { store_curve(BEFORE); }
    x = here(new_x);
    y = here(new_y);
    k = new_k;
    r = new_r;
    if ADAPTIVE { store_curve(CURVE); }
    return accepted();
}

/// Observes the middle of an adaptive step, which it returns, and then the new curve; x and y hold the curve before it.
fn observe_step() -> Observed {
    var middle = report.now;
    for (var curve = select(1u, 0u, ADAPTIVE); curve < 2u; curve++) {
        var wx = new_x;
        var wy = new_y;
        var kh = new_k;
        var rh = new_r;
        if curve == 0u {
            storageBarrier();
            let middle = windows(load_field(MIDDLE), load_field(MIDDLE + 1u));
            wx = middle.a;
            wy = middle.b;
            kh = load_field(MIDDLE + 2u);
            rh = load_field(MIDDLE + 3u);
        }
        let moved_x = here(wx) - x;
        let moved_y = here(wy) - y;
        observe(wx, wy, kh, rh, sqrt(moved_x * moved_x + moved_y * moved_y));
        if curve == 0u { middle = observed(); }
    }
    return middle;
}

fn failure_of_step(solved: u32) -> u32 {
    if solved == NOT_FINITE { return NONFINITE; }
    if solved != SOLVED { return STALLED; }
    if !is_finite() { return NONFINITE; }
    if is_singular(report.progress.turning) { return SINGULAR; }
    return RUNNING;
}

/// Retries with a step of length `next`, or ends the member for `cause` if that is below `least` of `(L/n)⁴`.
fn refuse(next: real, least: real, cause: u32) -> u32 {
    counters.rejected += 1u;
    counters.refused = 1u;
    report.progress.next = next;
    if !(least_step(least) <= next) { counters.status = cause; }
    return uniform_decision(select(STOP, GO_ON, counters.status == RUNNING));
}

/// Refuses a step of length h that failed outright; its increments may then be anything.
fn refuse_failure(h: real, cause: u32) -> u32 {
    start_nowhere();
    return refuse(real(MIN_GROWTH) * h, select(real(MIN_STEP), real(MIN_TO_SINGULAR), cause == SINGULAR), cause);
}

/// Records the steps in which the excess falls to half its start and to the relaxation threshold, and where inside
/// them.
fn record_events(h: real) {
    let length = select(real(0.0), h, ADAPTIVE);
    if counters.half_step == NEVER && report.now.excess <= p.half_at {
        counters.half_step = counters.steps;
        report.progress.half_high = report.progress.time_high;
        report.progress.half_low = report.progress.time_low;
        report.progress.half_length = length;
        report.progress.half_fraction = fraction_at(p.half_at);
    }
    // A curve whose curvature is not that of its polygon does not count as relaxed.
    let due = counters.relax_step == NEVER && report.now.excess <= p.relax_at;
    if uniform_decision(select(0u, 1u, due)) == 0u { return; }
    if gap() <= real(MAX_GAP) {
        counters.relax_step = counters.steps;
        report.progress.relax_high = report.progress.time_high;
        report.progress.relax_low = report.progress.time_low;
        report.progress.relax_length = length;
        report.progress.relax_fraction = fraction_at(p.relax_at);
    }
}

/// Where in the last step the excess fell to `excess`.
fn fraction_at(excess: real) -> real {
    let before = report.before.excess;
    if before <= excess { return real(1.0); }
    let after = report.now.excess;
    let straight = (before - excess) / (before - after);
    return select(straight, crossing(before, report.middle.excess, after, excess), ADAPTIVE);
}

/// Counts an accepted step; returns whether to continue.
fn accepted() -> u32 {
    report.progress.travel += others.z;
    counters.steps += 1u;
    if counters.relax_step != NEVER && counters.stop_when_relaxed != 0u { counters.status = RELAXED; }
    if p.look_at <= report.progress.travel && report.now.k_min <= real(0.0) { counters.goal = counters.steps; }
    if ADAPTIVE && is_at_goal() { counters.goal = counters.steps; }
    let on = counters.status == RUNNING && counters.steps < counters.goal;
    return uniform_decision(select(STOP, GO_ON, on));
}
