// The entry point: one workgroup takes one member through up to `dispatch.steps` steps towards its goal. Twin of
// src/scheme/evolve.rs. A fixed step that fails is not accepted: the member ends in its last good state. An adaptive one
// is tried again with a shorter step, until that is too short to mean anything.
//
// A dispatch also ends when its sweeps are used up. The attempt then pauses: the increments so far are stored, and the
// next dispatch computes the same rows again and sweeps on, so that no bit depends on where a dispatch ended.

@compute @workgroup_size(THREADS)
fn evolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    member = group.x;
    take_block(thread);
    p = all_parameters[member];
    counters = all_counters[member];
    report = all_reports[member];
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
        if p.adaptive <= real(0.0) { store_curve(CURVE); }
        store_field(INCREMENTS, dk);
        store_field(INCREMENTS + 1u, dx);
        store_field(INCREMENTS + 2u, dy);
    }
    // Every thread has read what thread 0 now overwrites.
    storageBarrier();
    if lane == 0u {
        all_counters[member] = counters;
        all_reports[member] = report;
    }
}

const GO_ON = 0u;
const STOP = 1u;

/// One attempt at a step and its consequences; returns whether to go on, the same in every thread.
fn advance() -> u32 {
    if uniform_decision(select(0u, 1u, p.adaptive > real(0.0))) == 1u { return adaptive_step(); }
    return fixed_step();
}

fn fixed_step() -> u32 {
    let solved = step();
    if solved == PAUSED { return STOP; }
    counters.phase = 0u;
    counters.solve_sweeps = 0u;
    if solved == SOLVED { observe_new(); }
    let failure = uniform_decision(failure_of_step(solved));
    counters.status = failure;
    if failure != RUNNING { return STOP; }
    let before = report.now;
    report.before = before;
    report.now = observed();
    let after = report.now.excess;
    record_events(
        0.0,
        (before.excess - p.half_at) / (before.excess - after),
        (before.excess - p.relax_at) / (before.excess - after),
    );
    // The curve before the last step towards a goal is kept: an output time may lie between the two.
    if counters.steps + 1u == counters.goal { store_curve(BEFORE); }
    x = here(new_x);
    y = here(new_y);
    k = new_k;
    r = new_r;
    return accepted();
}

fn adaptive_step() -> u32 {
    let by = stride();
    let h = by.length;
    let solved = attempt(h);
    if solved == PAUSED { return STOP; }
    counters.phase = 0u;
    counters.solve_sweeps = 0u;
    if solved != SOLVED { return refuse_failure(h, failure_of_step(solved)); }
    let error = error_of_attempt();
    if uniform_decision(select(1u, 0u, error <= p.adaptive)) == 1u {
        let next = next_length(h, error, 1.0);
        stretch(next / (real(0.5) * h));
        return refuse(next, STALLED);
    }
    extrapolate();
    load_curve(CURVE);
    observe_new();
    let failure = uniform_decision(failure_of_step(SOLVED));
    if failure != RUNNING { return refuse_failure(h, failure); }
    report.before = report.now;
    report.now = observed();
    let moved = others.w;
    report.middle = observe_middle();
    others.w = moved;
    let e = vec(report.before.excess, report.middle.excess, report.now.excess, 0.0);
    record_events(h, crossing(e.x, e.y, e.z, p.half_at), crossing(e.x, e.y, e.z, p.relax_at));
    let next = next_length(h, error, select(real(1.0), real(MOST_GROWTH), counters.refused == 0u));
    report.progress.next = next;
    stretch(next / (real(0.5) * h));
    pass_time(by);
    counters.refused = 0u;
    store_curve(BEFORE);
    store_fields(CURVE, here(new_x), here(new_y), new_k, new_r);
    let on = accepted();
    if is_at_goal() { counters.goal = counters.steps; }
    return uniform_decision(max(on, select(GO_ON, STOP, counters.goal == counters.steps)));
}

/// Observes the new curve; x and y hold the curve before the step.
fn observe_new() {
    let moved_x = here(new_x) - x;
    let moved_y = here(new_y) - y;
    observe(new_x, new_y, new_k, new_r, sqrt(moved_x * moved_x + moved_y * moved_y));
}

fn failure_of_step(solved: u32) -> u32 {
    if solved == NOT_FINITE { return NONFINITE; }
    if solved != SOLVED { return STALLED; }
    if !sums_are_finite() { return NONFINITE; }
    if is_singular(report.progress.turning) { return SINGULAR; }
    return RUNNING;
}

/// Tries again with a step of length `next`, or gives the member up for `cause`.
fn refuse(next: real, cause: u32) -> u32 {
    counters.rejected += 1u;
    counters.refused = 1u;
    report.progress.next = next;
    if !(least_step() <= next) { counters.status = cause; }
    return uniform_decision(select(STOP, GO_ON, counters.status == RUNNING));
}

/// Refuses a step of length h that failed outright; after that the increments may be anything.
fn refuse_failure(h: real, cause: u32) -> u32 {
    dk = vec(0.0);
    dx = vec(0.0);
    dy = vec(0.0);
    return refuse(real(LEAST_GROWTH) * h, cause);
}

/// Notes the steps in which the excess falls to half its start and to the relaxation threshold, and where inside them.
fn record_events(length: real, half_fraction: real, relax_fraction: real) {
    if counters.half_step == NEVER && report.now.excess <= p.half_at {
        counters.half_step = counters.steps;
        report.progress.half_high = report.progress.time_high;
        report.progress.half_low = report.progress.time_low;
        report.progress.half_length = length;
        report.progress.half_fraction = half_fraction;
    }
    if counters.relax_step == NEVER && report.now.excess <= p.relax_at {
        counters.relax_step = counters.steps;
        report.progress.relax_high = report.progress.time_high;
        report.progress.relax_low = report.progress.time_low;
        report.progress.relax_length = length;
        report.progress.relax_fraction = relax_fraction;
    }
}

/// Counts the step that was taken; returns whether to go on.
fn accepted() -> u32 {
    report.progress.travel += others.w;
    counters.steps += 1u;
    if counters.relax_step != NEVER && counters.stop_when_relaxed != 0u { counters.status = RELAXED; }
    if p.look_at <= report.progress.travel && report.now.k_min <= real(0.0) { counters.goal = counters.steps; }
    let on = counters.status == RUNNING && counters.steps < counters.goal;
    return uniform_decision(select(STOP, GO_ON, on));
}
