// Coloured Gauss–Seidel sweeps, and when they have done enough. Twin of what src/solver/gauss_seidel.rs shares with
// src/solver/multigrid.rs.
//
// Rows and right-hand sides stay in registers; only the unknowns are in workgroup memory. In phase c every thread
// updates the node of colour c in its block; a barrier ends the phase. A neighbour value is read once a sweep where
// no phase in between can have changed it.

/// Over-relaxation of the solve at hand.
var<private> sor: real;

/// A solve that neither ended nor reached the cap has run out of this dispatch's sweeps.
fn paused_or(ended: u32) -> u32 {
    if ended != UNSOLVED || sweeps >= dispatch.max_sweeps { return ended; }
    counters.solve_sweeps = sweeps;
    return PAUSED;
}

/// Largest scaled row sum; more than BIG where an entry or a right-hand side is not finite. Times EPSILON it is the
/// tolerance below which a scaled residual is rounding error.
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

/// One sweep over ring_a.
fn sweep_one() {
    let um1 = ring_a[near_low.y];
    u.x = relax(0u, rhs_x.x, ring_a[near_low.x], um1, u.x, u.y, u.z);
    if owns > 0u { ring_a[first] = u.x; }
    workgroupBarrier();
    let up3 = ring_a[near_high.y];
    u.y = relax(1u, rhs_x.y, um1, u.x, u.y, u.z, up3);
    if owns > 0u { ring_a[first + 1u] = u.y; }
    workgroupBarrier();
    let up4 = ring_a[near_high.z];
    u.z = relax(2u, rhs_x.z, u.x, u.y, u.z, up3, up4);
    if owns > 0u { ring_a[first + 2u] = u.z; }
    workgroupBarrier();
    if owns == 4u {
        u.w = relax(3u, rhs_x.w, u.y, u.z, u.w, up4, ring_a[near_high.w]);
        ring_a[first + 3u] = u.w;
    }
    workgroupBarrier();
}

/// One sweep over ring_a and ring_b.
fn sweep_two() {
    let um1 = ring_a[near_low.y];
    let vm1 = ring_b[near_low.y];
    u.x = relax(0u, rhs_x.x, ring_a[near_low.x], um1, u.x, u.y, u.z);
    v.x = relax(0u, rhs_y.x, ring_b[near_low.x], vm1, v.x, v.y, v.z);
    if owns > 0u {
        ring_a[first] = u.x;
        ring_b[first] = v.x;
    }
    workgroupBarrier();
    let up3 = ring_a[near_high.y];
    let vp3 = ring_b[near_high.y];
    u.y = relax(1u, rhs_x.y, um1, u.x, u.y, u.z, up3);
    v.y = relax(1u, rhs_y.y, vm1, v.x, v.y, v.z, vp3);
    if owns > 0u {
        ring_a[first + 1u] = u.y;
        ring_b[first + 1u] = v.y;
    }
    workgroupBarrier();
    let up4 = ring_a[near_high.z];
    let vp4 = ring_b[near_high.z];
    u.z = relax(2u, rhs_x.z, u.x, u.y, u.z, up3, up4);
    v.z = relax(2u, rhs_y.z, v.x, v.y, v.z, vp3, vp4);
    if owns > 0u {
        ring_a[first + 2u] = u.z;
        ring_b[first + 2u] = v.z;
    }
    workgroupBarrier();
    if owns == 4u {
        u.w = relax(3u, rhs_x.w, u.y, u.z, u.w, up4, ring_a[near_high.w]);
        v.w = relax(3u, rhs_y.w, v.y, v.z, v.w, vp4, ring_b[near_high.w]);
        ring_a[first + 3u] = u.w;
        ring_b[first + 3u] = v.w;
    }
    workgroupBarrier();
}

/// own + sor (rhs - row . u) for the node in component j of the block.
fn relax(j: u32, rhs: real, m2: real, m1: real, own: real, p1: real, p2: real) -> real {
    let left = rhs - row_of.a[j] * m2 - row_of.b[j] * m1 - row_of.d[j] * p1 - row_of.e[j] * p2 - own;
    return own + sor * left;
}
