// One step of the paper's scheme, from the curve in registers to the new one next to it. Twin of
// crates/flow/src/scheme/step.rs.

/// Fraction of the rounding error of an unknown below which an error of its increment is not worth a sweep.
const NEGLIGIBLE = 0.1;
const HALF_OVER_PI = 0.15915494309189535;
/// Whether solutions are refined.
const REFINED = IS_SHORT && ADAPTIVE;
/// Whether they are by rounds of sweeps.
const IN_ROUNDS = REFINED && SWEEPS;

/// The new curve, with the windows of its nodes.
var<private> new_k: vec;
var<private> new_r: vec;
var<private> new_x: Window;
var<private> new_y: Window;

/// What is left to do, the same in every thread: how the last solve ended, the systems that the attempt has solved, the
/// sweeps made for the next one, the steps of the paper and the sweeps that this dispatch may still make, and how often
/// direct solutions are refined.
struct Course { ended: u32, phase: u32, solve_sweeps: u32, steps: u32, sweeps: u32, refinements: u32 }

/// Forgets what the last step and the last attempt have left in private variables: compilers do not see that nothing
/// reads it again, and would keep it in registers.
fn forget() {
    k_window = Window();
    r_new = Window();
    ir = Window();
    iq = Window();
    stiffness = Window();
    weighted = Window();
    weights = Weights();
    mobile_there = Window();
    rkb = vec();
    alpha = vec();
    alpha_before = vec();
    row_of = Rows();
    rhs_x = vec();
    rhs_y = vec();
    inverse = vec();
    u = vec();
    v = vec();
    new_x = Window();
    new_y = Window();
    new_k = vec();
    new_r = vec();
    sums = vec();
    extremes = vec();
    others = vec();
    displacement = vec();
    distance = 0.0;
    multiplier = 0.0;
    force = 0.0;
    damping = 0.0;
}

/// Computes the curve a time tau later, redistributed if `moves`. An odd phase means that the curvature is solved.
fn step(begun: Course, moves: bool) -> Course {
    var course = begun;
    find_member();
    forget();
    var length = real(0.0);
    if !IN_ROUNDS { length = redistribute(moves); }

    var positions = (begun.phase & 1u) != 0u;
    // Without a solve in between, others may still read what was exchanged last.
    if positions {
        if !IN_ROUNDS { settle(); }
        u = load_field(INCREMENTS);
    } else if !IN_ROUNDS {
        begin_curvature();
    }
    // The two solves share a call, since compilers inline the body of every call.
    var round = 0u;
    loop {
        if IN_ROUNDS {
            if course.sweeps == 0u {
                course.ended = PAUSED;
                return course;
            }
            // Before every round, so that what its equations need takes no registers while it sweeps.
            multiplier = real(0.0);
            length = redistribute(moves);
        }
        if positions {
            begin_positions(round);
        } else if IN_ROUNDS || round > 0u {
            curvature_equation();
        }
        let is_rest = IN_ROUNDS || round > 0u;
        if REFINED && is_rest { leave_the_rest(positions); }
        let radius = length * real(HALF_OVER_PI);
        let rounding = real(NEGLIGIBLE * EPSILON);
        let negligible = select(rounding / radius, rounding * radius, positions);
        let done = solve(positions, negligible, course.solve_sweeps, course.sweeps);
        let made = done.sweeps - course.solve_sweeps;
        if SWEEPS { count_sweeps(positions, made); }
        course.sweeps -= min(course.sweeps, made);
        course.ended = done.ended;
        course.solve_sweeps = done.sweeps;
        if REFINED {
            let change = largest();
            gather(positions, is_rest);
            course = judge_round(course, change, negligible);
            round += 1u;
            if continues(course, round) { continue; }
            round = 0u;
        }
        if positions { end_positions(); } else { end_curvature(); }
        if course.ended != SOLVED { return course; }
        course.phase += 1u;
        course.solve_sweeps = 0u;
        if positions { break; }
        positions = true;
    }
    let x = load_field(curve);
    let y = load_field(curve + 1u);
    if FORCED {
        let by = push(x, y);
        correct(x, y, by);
    } else {
        let nodes = windows(advanced(0u, x, u), advanced(1u, y, v));
        new_x = nodes.a;
        new_y = nodes.b;
    }
    displaced(x, y);
    new_r = here(r_new);
    if all_parameters[member].pull > real(0.0) { pull(); }
    trace(2u, new_r);
    trace(19u, new_k);
    return course;
}

fn begin_curvature() {
    curvature_equation();
    trace_system(3u);
    trace(8u, rhs_x);
    if SWEEPS && !IN_ROUNDS { u = load_field(INCREMENTS); }
}

fn end_curvature() {
    if SWEEPS && !IN_ROUNDS { store_field(INCREMENTS, u); }
    trace(9u, u);
}

fn count_sweeps(positions: bool, made: u32) {
    if lane != 0u { return; }
    let counters = &all_counters[member];
    if positions { counters.sweeps_x += made; } else { counters.sweeps_k += made; }
}

/// Takes what the increments so far give from the right-hand sides.
fn leave_the_rest(positions: bool) {
    settle();
    if positions {
        let given = windows(load_field(INCREMENTS + 1u), load_field(INCREMENTS + 2u));
        rhs_x -= position_applied(given.a) * inverse;
        rhs_y -= position_applied(given.b) * inverse;
    } else {
        rhs_x -= curvature_applied(lone_window(load_field(INCREMENTS))) * inverse;
    }
}

/// Stores the increments, `more` than those before or the first ones.
fn gather(positions: bool, more: bool) {
    let field = select(INCREMENTS, INCREMENTS + 1u, positions);
    if more { u += load_field(field); }
    store_field(field, u);
    if !positions { return; }
    if more { v += load_field(INCREMENTS + 2u); }
    store_field(INCREMENTS + 2u, v);
}

fn begin_positions(round: u32) {
    find_member();
    if round == 0u { new_k = advanced(2u, load_field(curve + 2u), u); }
    // Others may still read what the last round exchanged.
    if IN_ROUNDS || round > 0u { settle(); }
    // Lengths are exchanged again, so that their windows take no registers in the first solve.
    let exchanged = windows(new_k, here(r_new));
    k_window = exchanged.a;
    r_new = exchanged.b;
    reciprocals(r_new);
    position_equation();
    trace_system(10u);
    trace(15u, rhs_x);
    trace(16u, rhs_y);
    if SWEEPS && !IN_ROUNDS {
        u = load_field(INCREMENTS + 1u);
        v = load_field(INCREMENTS + 2u);
    }
}

fn end_positions() {
    if SWEEPS && !IN_ROUNDS {
        store_field(INCREMENTS + 1u, u);
        store_field(INCREMENTS + 2u, v);
    }
    trace(17u, u);
    trace(18u, v);
}

fn trace_system(field: u32) {
    trace(field, row_of.a);
    trace(field + 1u, row_of.b);
    trace(field + 2u, row_of.d);
    trace(field + 3u, row_of.e);
    trace(field + 4u, row_of.weight);
}
