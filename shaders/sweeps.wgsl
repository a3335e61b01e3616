// Coloured Gauss–Seidel sweeps and their stopping criterion, for gauss_seidel.wgsl. Twin of
// crates/flow/src/solver/sweeps.rs.
//
// Rows, right-hand sides and unknowns stay in registers. Neighbours of a block of four need its first two nodes (its
// front) and its last two (its tail), and the first two need none of another block's first two. So colours 0 and 1 are
// one phase, colours 2 and 3 another, and a sweep has two exchanges, with the results of four. Only a block of three
// needs the front after it between its first and its second node, which costs a third exchange if there is one.

/// Over-relaxation of the current solve.
var<private> sor: real;
/// The tails of the block before, of u and v, and the fronts of the block after, at the current stage of a sweep.
var<private> behind: vec;
var<private> ahead: vec;

/// Begins sweeps from `u` and `v`: exchanges them with the adjacent blocks.
fn start_sweeps() {
    let start = windows(u, v);
    behind = tails_before(start.a, start.b);
    ahead = fronts_after(start.a, start.b);
}

/// A solve that neither ended nor reached the cap has used up this dispatch's sweeps.
fn paused_or(ended: u32, sweeps: u32) -> Solve {
    let is_over = ended != UNSOLVED || sweeps >= dispatch.max_sweeps;
    return Solve(select(PAUSED, ended, is_over), sweeps);
}

/// Tolerance below which a scaled residual is rounding error, in units of EPSILON times the size of the system.
const FLOOR = 2.0;

/// Largest scaled row sum; more than BIG if an entry or a right-hand side is not finite.
fn system_size(rhs: vec) -> real {
    let terms = vec(1.0) + abs(row_of.a) + abs(row_of.b) + abs(row_of.d) + abs(row_of.e);
    let finite = bounded_abs(rhs) <= vec(BIG);
    let sizes = select(vec(2.0 * BIG), bounded_abs(row_of.weight * terms), finite);
    return ring_maxima(vec(block_max(sizes), 0.0, 0.0, 0.0)).x;
}

fn finite_or_not(size: real) -> u32 {
    return uniform_decision(select(NOT_FINITE, UNSOLVED, size <= real(BIG)));
}

fn judge(error: real, increment: real, tolerance: real, negligible: real) -> u32 {
    let norms = ring_maxima(vec(error, increment, 0.0, 0.0));
    let bound = max(tolerance * norms.y, negligible);
    var ended = UNSOLVED;
    if !(norms.x <= real(BIG)) {
        ended = DIVERGED;
    } else if norms.x <= bound {
        ended = SOLVED;
    }
    return uniform_decision(ended);
}

/// One sweep over u.
fn sweep_one() {
    u.x = relax(0u, rhs_x.x, behind.x, behind.y, u.x, u.y, u.z);
    if has_threes() { ahead = pass_down_early(vec(u.xy, v.xy)); }
    u.y = relax(1u, rhs_x.y, behind.y, u.x, u.y, u.z, after_third(u, ahead.xy).x);
    ahead = pass_down(vec(u.xy, v.xy));
    let next = after_third(u, ahead.xy);
    u.z = relax(2u, rhs_x.z, u.x, u.y, u.z, next.x, next.y);
    u.w = select(u.w, relax(3u, rhs_x.w, u.y, u.z, u.w, ahead.x, ahead.y), is_four);
    behind = pass_up(tails(u, v));
}

/// One sweep over u and v, with the exchanges of one.
fn sweep_two() {
    u.x = relax(0u, rhs_x.x, behind.x, behind.y, u.x, u.y, u.z);
    v.x = relax(0u, rhs_y.x, behind.z, behind.w, v.x, v.y, v.z);
    if has_threes() { ahead = pass_down_early(vec(u.xy, v.xy)); }
    u.y = relax(1u, rhs_x.y, behind.y, u.x, u.y, u.z, after_third(u, ahead.xy).x);
    v.y = relax(1u, rhs_y.y, behind.w, v.x, v.y, v.z, after_third(v, ahead.zw).x);
    ahead = pass_down(vec(u.xy, v.xy));
    let next_u = after_third(u, ahead.xy);
    let next_v = after_third(v, ahead.zw);
    u.z = relax(2u, rhs_x.z, u.x, u.y, u.z, next_u.x, next_u.y);
    v.z = relax(2u, rhs_y.z, v.x, v.y, v.z, next_v.x, next_v.y);
    u.w = select(u.w, relax(3u, rhs_x.w, u.y, u.z, u.w, ahead.x, ahead.y), is_four);
    v.w = select(v.w, relax(3u, rhs_y.w, v.y, v.z, v.w, ahead.z, ahead.w), is_four);
    behind = pass_up(tails(u, v));
}

/// own + sor (rhs - row . u) for the node in component j of the block.
fn relax(j: u32, rhs: real, m2: real, m1: real, own: real, p1: real, p2: real) -> real {
    let left = rhs - row_of.a[j] * m2 - row_of.b[j] * m1 - row_of.d[j] * p1 - row_of.e[j] * p2 - own;
    return own + sor * left;
}
