// Coloured Gauss–Seidel sweeps to a residual, and those of a round. Twin of
// crates/flow/src/solver/gauss_seidel.rs; the sweeps are in sweeps.wgsl.

const SWEEPS_PER_CHECK = 8u;

/// Sweeps `u` for rhs_x and, if `both`, `v` for rhs_y. Earlier dispatches have made `made` sweeps; this one may make
/// `most` more. Where solutions are refined, makes one round.
fn solve(both: bool, negligible: real, made: u32, most: u32) -> Solve {
    if REFINED { return sweep_round(both, made); }
    if both { return solve_two(negligible, made, most); }
    return solve_one(negligible, made, most);
}

/// Sweeps `u` for rhs_x.
fn solve_one(negligible: real, made: u32, most: u32) -> Solve {
    let p = &all_parameters[member];
    v = vec(0.0);
    settle();
    start_sweeps();
    let size = system_size(rhs_x);
    sor = select(p.sor, over_relaxation(size), p.sor <= real(0.0));
    let tolerance = max(p.tolerance, real(FLOOR * EPSILON) * size);
    var ended = finite_or_not(size);
    var sweeps = made;
    var left = most;
    while ended == UNSOLVED && sweeps < dispatch.max_sweeps && left > 0u {
        let batch = min(SWEEPS_PER_CHECK, dispatch.max_sweeps - sweeps);
        for (var s = 0u; s < batch; s++) { sweep_one(); }
        sweeps += batch;
        left -= min(left, batch);
        let error = bounded_abs(row_of.weight * residual(rhs_x, narrow_window(behind.xy, u, ahead.xy)));
        ended = judge(block_max(error), block_max(bounded_abs(u)), tolerance, negligible);
    }
    return paused_or(ended, sweeps);
}

/// Sweeps `u` for rhs_x and `v` for rhs_y, with the barriers of one.
fn solve_two(negligible: real, made: u32, most: u32) -> Solve {
    let p = &all_parameters[member];
    settle();
    start_sweeps();
    let size = system_size(max(bounded_abs(rhs_x), bounded_abs(rhs_y)));
    sor = select(p.sor, over_relaxation(size), p.sor <= real(0.0));
    let tolerance = max(p.tolerance, real(FLOOR * EPSILON) * size);
    var ended = finite_or_not(size);
    var sweeps = made;
    var left = most;
    while ended == UNSOLVED && sweeps < dispatch.max_sweeps && left > 0u {
        let batch = min(SWEEPS_PER_CHECK, dispatch.max_sweeps - sweeps);
        for (var s = 0u; s < batch; s++) { sweep_two(); }
        sweeps += batch;
        left -= min(left, batch);
        let error_u = bounded_abs(row_of.weight * residual(rhs_x, narrow_window(behind.xy, u, ahead.xy)));
        let error_v = bounded_abs(row_of.weight * residual(rhs_y, narrow_window(behind.zw, v, ahead.zw)));
        let increment = max(bounded_abs(u), bounded_abs(v));
        ended = judge(block_max(max(error_u, error_v)), block_max(increment), tolerance, negligible);
    }
    return paused_or(ended, sweeps);
}

/// Sweeps `u` and, if `both`, `v` from zero, as many times as a round has sweeps. It ends there: what the rows give of
/// the residual is rounding long before a refined solution is done.
fn sweep_round(both: bool, made: u32) -> Solve {
    let p = &all_parameters[member];
    u = vec(0.0);
    v = vec(0.0);
    behind = vec(0.0);
    ahead = vec(0.0);
    settle();
    var rhs = bounded_abs(rhs_x);
    if both { rhs = max(rhs, bounded_abs(rhs_y)); }
    let size = system_size(rhs);
    sor = select(p.sor, over_relaxation(size), p.sor <= real(0.0));
    let count = uniform_decision(select(0u, sweeps_of_round(size), size <= real(BIG)));
    if count == 0u { return Solve(NOT_FINITE, made); }
    // Part of a round would tell nothing.
    if count > dispatch.max_sweeps - made { return Solve(DIVERGED, made); }
    if both {
        for (var s = 0u; s < count; s++) { sweep_two(); }
    } else {
        for (var s = 0u; s < count; s++) { sweep_one(); }
    }
    return Solve(UNSOLVED, made + count);
}

/// The sweeps of a round, which with the over-relaxation of its size leaves less than half of what the unknown lacks.
fn sweeps_of_round(size: real) -> u32 {
    return SWEEPS_PER_CHECK * u32(min(max(sqrt(real(AUTO_SCALE) * size), real(1.0)), real(MAX_CHECKS)));
}

/// The most sweeps of a round, in units of SWEEPS_PER_CHECK.
const MAX_CHECKS = 1024.0;

/// Change of a solution by a round, in units of EPSILON, up to which it is rounding.
const SETTLED = 8.0;

/// Judges a round that has changed the unknowns by `change`.
fn judge_round(begun: Course, change: real, negligible: real) -> Course {
    var course = begun;
    if course.ended != UNSOLVED { return course; }
    let tolerance = max(all_parameters[member].tolerance, real(SETTLED * EPSILON));
    course.ended = judge(change, largest(), tolerance, negligible);
    return course;
}

/// Whether another round is due.
fn continues(course: Course, round: u32) -> bool {
    return course.ended == UNSOLVED;
}

/// The over-relaxation that needs about the fewest sweeps for a system of this size.
fn over_relaxation(size: real) -> real {
    let g = sqrt(sqrt(real(AUTO_SCALE) * size));
    return max(real(2.0) * (g / (real(1.0) + g)), real(1.0));
}

const AUTO_SCALE = 0.625;
