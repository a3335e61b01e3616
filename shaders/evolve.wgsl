// The entry point: one workgroup takes one member through up to `dispatch.steps` steps towards its goal. Twin of
// src/scheme/evolve.rs. A step that fails is not accepted: the member ends in its last good state.
//
// A dispatch also ends when its sweeps are used up. The step then pauses: the increments so far are stored, and the
// next dispatch computes the same rows again and sweeps on, so that no bit depends on where a dispatch ended.

var<private> report: Report;

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
        load_state();
        budget = dispatch.sweeps;
        for (var s = 0u; s < steps && budget > 0u; s++) {
            if advance() != RUNNING { break; }
        }
        storageBarrier();
        store_state();
    }
    // Every thread has read what thread 0 now overwrites.
    storageBarrier();
    if lane == 0u {
        all_counters[member] = counters;
        all_reports[member] = report;
    }
}

/// One step and its consequences; returns the member's status, or PAUSED, the same in every thread.
fn advance() -> u32 {
    let solved = step();
    if solved == PAUSED { return PAUSED; }
    counters.phase = STEP_BEGINS;
    counters.solve_sweeps = 0u;
    if solved == SOLVED {
        observe(new_x, new_y, new_k, here(r_new));
    }
    let failure = uniform_decision(failure_of_step(solved));
    counters.status = failure;
    if failure == RUNNING {
        accept();
        record_events();
        fill_report();
        counters.steps += 1u;
        if counters.relax_step != NEVER && counters.stop_when_relaxed != 0u {
            counters.status = RELAXED;
        }
    }
    return uniform_decision(counters.status);
}

fn failure_of_step(solved: u32) -> u32 {
    if solved == NOT_FINITE { return NONFINITE; }
    if solved != SOLVED { return STALLED; }
    if !sums_are_finite() { return NONFINITE; }
    if is_singular(report.turning) { return SINGULAR; }
    return RUNNING;
}

/// Notes the steps in which the excess falls to half its start and to the relaxation threshold, and where inside them.
fn record_events() {
    let before = report.excess;
    let after = excess_of_sums();
    if counters.half_step == NEVER && after <= p.half_at {
        counters.half_step = counters.steps;
        report.half_fraction = (before - p.half_at) / (before - after);
    }
    if counters.relax_step == NEVER && after <= p.relax_at {
        counters.relax_step = counters.steps;
        report.relax_fraction = (before - p.relax_at) / (before - after);
    }
    report.excess = after;
}

fn fill_report() {
    report.length = sums.x;
    report.area = sums.y;
    report.energy = sums.z;
    report.k_min = -k_range.y;
    report.k_max = k_range.x;
    report.mesh_ratio = extremes.z / -extremes.w;
    report.metric_drift = extremes.y;
    report.turning = sums.w;
}

fn load_state() {
    x = load_field(0u);
    y = load_field(1u);
    k = load_field(2u);
    r = load_field(3u);
    dk = load_field(4u);
    dx = load_field(5u);
    dy = load_field(6u);
}

fn store_state() {
    store_field(0u, x);
    store_field(1u, y);
    store_field(2u, k);
    store_field(3u, r);
    store_field(4u, dk);
    store_field(5u, dx);
    store_field(6u, dy);
}
