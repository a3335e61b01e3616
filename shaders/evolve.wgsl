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
    if uniform_decision(due) > 0u {
        load_curve(CURVE);
        dk = load_field(INCREMENTS);
        dx = load_field(INCREMENTS + 1u);
        dy = load_field(INCREMENTS + 2u);
        budget = dispatch.sweeps;
        steps_left = dispatch.steps;
        while steps_left > 0u && budget > 0u {
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

/// Steps of the paper before the dispatch pauses.
var<private> steps_left: u32;

const GO_ON = 0u;
const STOP = 1u;

/// Attempts a step and handles the result; returns whether to continue, the same in every thread.
///
/// A step and an observation are each called in one place only: compilers inline the whole body of every call.
fn advance() -> u32 {
    let by = stride();
    let h = by.length;
    let count = uniform_decision(select(1u, parts(counters.order), ADAPTIVE));
    if ADAPTIVE && counters.phase == 0u && counters.solve_sweeps == 0u {
        begin_attempt();
        begin_row(h);
    }
    var solved = SOLVED;
    var part = uniform_decision(counters.phase / 2u);
    for (; part < count && solved == SOLVED && steps_left > 0u; part++) {
        if ADAPTIVE { begin_part(part, h); }
        solved = step();
        if ADAPTIVE && solved == SOLVED { end_part(part, h); }
        steps_left--;
    }
    if solved == PAUSED || (solved == SOLVED && part < count) { return STOP; }
    counters.phase = 0u;
    counters.solve_sweeps = 0u;
    counters.solves += count;
    if ADAPTIVE && solved == SOLVED { finish_attempt(); }
    var errors = vec2<real>(0.0, 0.0);
    if solved == SOLVED {
        let moved_x = here(new_x) - x;
        let moved_y = here(new_y) - y;
        observe(new_x, new_y, new_k, new_r, sqrt(moved_x * moved_x + moved_y * moved_y));
        if ADAPTIVE {
            errors = errors_of_attempt();
            if uniform_decision(select(1u, 0u, errors.x <= allowed(h))) == 1u { return refuse_inaccurate(h, errors); }
        }
    }
    let failure = uniform_decision(failure_of_step(solved));
    if failure != RUNNING {
        if ADAPTIVE { return refuse_failure(h, failure); }
        counters.status = failure;
        return STOP;
    }
    report.before = report.now;
    report.now = observed();
    var taken = Taken(0.0, report.before.excess, report.now.excess, Fall());
    var declines = vec2<real>(0.0, 0.0);
    if ADAPTIVE {
        declines = decline();
        taken.h = h;
        taken.fall = fall_of(h, declines);
    }
    record_events(taken);
    follow(taken);
    if ADAPTIVE {
        lengthen(by, errors, declines);
        keep_attempt();
    } else {
        after_step();
        // The curve before the step is stored if an output time may lie between the two.
        if counters.steps + 1u == counters.goal { store_curve(BEFORE); }
    }
    x = here(new_x);
    y = here(new_y);
    k = new_k;
    r = new_r;
    return accepted();
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
    counters.refused += 1u;
    report.progress.next = next;
    if !(least_step(least) <= next) { counters.status = cause; }
    return uniform_decision(select(STOP, GO_ON, counters.status == RUNNING));
}

/// Refuses a step of length h that failed outright.
fn refuse_failure(h: real, cause: u32) -> u32 {
    let least = select(real(MIN_STEP), real(MIN_TO_SINGULAR), cause == SINGULAR);
    return refuse(real(AFTER_FAILURE) * h, least, cause);
}

/// Refuses a step of length h whose error is too large.
fn refuse_inaccurate(h: real, errors: vec2<real>) -> u32 {
    let most = select(real(AFTER_REFUSALS), real(AFTER_REFUSAL), counters.refused == 0u);
    let next = choose(h, counters.order, errors, most, allowed(h));
    counters.order = next.order;
    return refuse(next.length, real(MIN_STEP), SINGULAR);
}

/// Records the steps in which the excess falls to half its start and to the relaxation threshold, and where inside
/// them.
fn record_events(taken: Taken) {
    if counters.half_step == NEVER && report.now.excess <= p.half_at {
        counters.half_step = counters.steps;
        report.progress.half_high = report.progress.time_high;
        report.progress.half_low = report.progress.time_low;
        report.progress.half_length = taken.h;
        report.progress.half_fraction = taken_fraction_at(taken, p.half_at);
    }
    // A curve whose curvature is not that of its polygon does not count as relaxed.
    let due = counters.relax_step == NEVER && report.now.excess <= p.relax_at;
    if uniform_decision(select(0u, 1u, due)) == 0u { return; }
    if gap() <= real(MAX_GAP) {
        counters.relax_step = counters.steps;
        report.progress.relax_high = report.progress.time_high;
        report.progress.relax_low = report.progress.time_low;
        report.progress.relax_length = taken.h;
        report.progress.relax_fraction = taken_fraction_at(taken, p.relax_at);
    }
}

/// Advances the clock by an accepted adaptive step, and chooses the length and the order of the next one.
fn lengthen(by: Stride, errors: vec2<real>, declines: vec2<real>) {
    let most_growth = select(real(1.0), real(MAX_GROWTH), counters.refused == 0u);
    let next = choose(by.length, counters.order, errors, most_growth, allowed(by.length));
    report.progress.next = next.length;
    counters.order = next.order;
    report.progress.slope = declines.x;
    report.progress.bend = declines.y;
    pass_time(by);
    counters.refused = 0u;
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
