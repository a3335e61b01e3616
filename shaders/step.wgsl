// One step of the paper's scheme, from the state in registers to the new one beside it. Twin of src/scheme/step.rs.

/// Share of the rounding error of an unknown below which an error of its increment is not worth a sweep.
const NEGLIGIBLE = 0.1;
const HALF_OVER_PI = 0.15915494309189535;

/// The new state, and the windows of its nodes.
var<private> new_k: vec;
var<private> new_x: Window;
var<private> new_y: Window;
/// Sweeps of the step's two solves.
var<private> step_sweeps: vec2<u32>;

/// Computes the new state; returns SOLVED, UNSOLVED or NOT_FINITE. The old state stays until `accept`.
fn step() -> u32 {
    let length = redistribute();
    let radius = length * real(HALF_OVER_PI);
    let rounding = real(NEGLIGIBLE * EPSILON);

    assemble_curvature();
    trace_system(3u);
    trace(8u, rhs_x);
    u = dk;
    let for_k = solve_one(rounding / radius);
    dk = u;
    step_sweeps = vec2<u32>(sweeps, 0u);
    if for_k != SOLVED { return for_k; }
    trace(9u, dk);
    new_k = k + dk;

    share(new_k, new_k);
    assemble_position(read_a());
    trace_system(10u);
    trace(15u, rhs_x);
    trace(16u, rhs_y);
    u = dx;
    v = dy;
    let for_x = solve_two(rounding * radius);
    dx = u;
    dy = v;
    step_sweeps.y = sweeps;
    if for_x != SOLVED { return for_x; }
    trace(17u, dx);
    trace(18u, dy);
    share(x + dx, y + dy);
    new_x = read_a();
    new_y = read_b();
    return SOLVED;
}

fn trace_system(field: u32) {
    trace(field, row_of.a);
    trace(field + 1u, row_of.b);
    trace(field + 2u, row_of.d);
    trace(field + 3u, row_of.e);
    trace(field + 4u, row_of.weight);
}

fn accept() {
    x = here(new_x);
    y = here(new_y);
    k = new_k;
    r = here(r_new);
}
