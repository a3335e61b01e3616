// One step of the paper's scheme, from the curve in registers to the new one beside it. Twin of src/scheme/step.rs.

/// Share of the rounding error of an unknown below which an error of its increment is not worth a sweep.
const NEGLIGIBLE = 0.1;
const HALF_OVER_PI = 0.15915494309189535;

/// The new curve, with the windows of its nodes.
var<private> new_k: vec;
var<private> new_r: vec;
var<private> new_x: Window;
var<private> new_y: Window;

/// Computes the curve a time p.tau later; returns how its solves ended. An odd phase says that the curvature is solved.
fn step() -> u32 {
    let length = redistribute();
    let radius = length * real(HALF_OVER_PI);
    let rounding = real(NEGLIGIBLE * EPSILON);

    if uniform_decision(counters.phase & 1u) == 0u {
        let for_k = step_curvature(rounding / radius);
        if for_k != SOLVED { return for_k; }
        counters.phase += 1u;
        counters.solve_sweeps = 0u;
    }
    new_k = k + dk;
    let for_x = step_position(rounding * radius);
    if for_x != SOLVED { return for_x; }
    let moved = windows(x + dx, y + dy);
    new_x = moved.a;
    new_y = moved.b;
    new_r = here(r_new);
    if p.pull > real(0.0) { pull(); }
    trace(2u, new_r);
    trace(19u, new_k);
    counters.phase += 1u;
    counters.solve_sweeps = 0u;
    return SOLVED;
}

fn step_curvature(negligible: real) -> u32 {
    assemble_curvature();
    trace_system(3u);
    trace(8u, rhs_x);
    let before = counters.solve_sweeps;
    u = dk;
    let ended = solve_one(negligible);
    dk = u;
    counters.sweeps_k += sweeps - before;
    trace(9u, dk);
    return ended;
}

fn step_position(negligible: real) -> u32 {
    let exchanged = windows(new_k, y);
    assemble_position(exchanged.a, exchanged.b);
    trace_system(10u);
    trace(15u, rhs_x);
    trace(16u, rhs_y);
    let before = counters.solve_sweeps;
    u = dx;
    v = dy;
    let ended = solve_two(negligible);
    dx = u;
    dy = v;
    counters.sweeps_x += sweeps - before;
    trace(17u, dx);
    trace(18u, dy);
    return ended;
}

fn trace_system(field: u32) {
    trace(field, row_of.a);
    trace(field + 1u, row_of.b);
    trace(field + 2u, row_of.d);
    trace(field + 3u, row_of.e);
    trace(field + 4u, row_of.weight);
}
