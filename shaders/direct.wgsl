// A direct solve inside the workgroup, instead of sweeps. Its independent check is crates/flow/src/solver/direct.rs.
//
// Every block keeps its last two unknowns `s` and eliminates the others: its first two nodes become
// `m = c - P p - S s`, with `p` the last two unknowns of the block before. This leaves a ring of pairs,
// `L p + D s + U s' = g`. Cyclic reduction solves it: in each round every second pair of the ring is eliminated from
// its neighbours, after ceil(log2(BLOCKS)) rounds one is left, and as many rounds back give the others. A ring of an
// odd number keeps its first and its last pair, which become neighbours, so that it needs no border and no padding. No
// pivoting: the systems are perturbations of 1 + (positive) D^4.

/// 2x2 matrices are stored as (m00, m01, m10, m11), pairs for x and y together as (x0, x1, y0, y1).
/// The interiors of the blocks, with `partials`. They have their own arrays, so that nobody waits for the readers of
/// what was exchanged before the solve.
var<workgroup> interior_p: array<vec, ROWS>;
var<workgroup> interior_s: array<vec, ROWS>;
/// The right-hand sides of the rows of pairs that have left the ring, next to their coefficients in `ring_a` and
/// `ring_b`, all divided by their own matrix; in the end all pairs.
var<workgroup> ring_rhs: array<vec, ROWS>;

/// The largest increment of k in the block.
var<private> largest_k: real;

/// The first two nodes of the block as a function of the pairs around them.
struct Interior { c: vec, p: vec, s: vec }

/// One pair's row of the ring.
struct PairRow { low: vec, own: vec, high: vec, rhs: vec }

fn multiply(a: vec, b: vec) -> vec {
    return vec(a.x * b.x + a.y * b.z, a.x * b.y + a.y * b.w, a.z * b.x + a.w * b.z, a.z * b.y + a.w * b.w);
}

fn apply(m: vec, v: vec) -> vec {
    return vec(m.x * v.x + m.y * v.y, m.z * v.x + m.w * v.y, m.x * v.z + m.y * v.w, m.z * v.z + m.w * v.w);
}

/// c - a b, each term subtracted for itself: GPUs fuse it with its product.
fn less_product(c: vec, a: vec, b: vec) -> vec {
    return vec(
        c.x - a.x * b.x - a.y * b.z, c.y - a.x * b.y - a.y * b.w,
        c.z - a.z * b.x - a.w * b.z, c.w - a.z * b.y - a.w * b.w,
    );
}

/// c - m v, likewise.
fn less_applied(c: vec, m: vec, v: vec) -> vec {
    return vec(
        c.x - m.x * v.x - m.y * v.y, c.y - m.z * v.x - m.w * v.y,
        c.z - m.x * v.z - m.y * v.w, c.w - m.z * v.z - m.w * v.w,
    );
}

fn invert(m: vec) -> vec {
    return vec(m.w, -m.y, -m.z, m.x) * (real(1.0) / (m.x * m.w - m.y * m.z));
}

/// Solves for `u` alone, or for `u` and `v`. Whether `u` alone is finite is judged with the positions, which saves a
/// pass over all blocks.
fn solve(both: bool, negligible: real, made: u32, most: u32) -> Solve {
    if !both { rhs_y = vec(0.0); }
    solve_rows();
    if !both {
        largest_k = block_max(bounded_abs(u));
        return Solve(SOLVED, 0u);
    }
    let size = max(largest_k, max(block_max(bounded_abs(u)), block_max(bounded_abs(v))));
    // Or it would live on to the next step.
    largest_k = real(0.0);
    let largest = ring_maxima(vec(size, 0.0, 0.0, 0.0));
    return Solve(uniform_decision(select(NOT_FINITE, SOLVED, largest.x <= real(BIG))), 0u);
}

/// How a solution ended does not depend on how much it changed.
fn judge_round(begun: Course, change: real, negligible: real) -> Course { return begun; }

/// Whether to refine again after `round` solves.
fn continues(course: Course, round: u32) -> bool {
    return course.ended == SOLVED && round <= course.refinements;
}

fn solve_rows() {
    let interior = eliminate_interior();
    let own = solve_ring(pair_row(interior));
    let m = less_applied(less_applied(interior.c, interior.p, ring_rhs[before]), interior.s, own);
    u = select(vec(m.x, own.xy, 0.0), vec(m.xy, own.xy), is_four);
    v = select(vec(m.z, own.zw, 0.0), vec(m.zw, own.zw), is_four);
}

fn eliminate_interior() -> Interior {
    let a = row_of.a;
    let b = row_of.b;
    let d = row_of.d;
    let e = row_of.e;
    if is_four {
        let inverse = invert(vec(1.0, d.x, b.y, 1.0));
        return Interior(
            apply(inverse, vec(rhs_x.xy, rhs_y.xy)),
            multiply(inverse, vec(a.x, b.x, 0.0, a.y)),
            multiply(inverse, vec(e.x, 0.0, d.y, e.y)),
        );
    }
    // The second node of a block of three is the first of its pair.
    return Interior(vec(rhs_x.x, 0.0, rhs_y.x, 0.0), vec(a.x, b.x, 0.0, 0.0), vec(d.x, e.x, -1.0, 0.0));
}

/// The rows of the block's pair, with its own interior and that of the next block substituted.
fn pair_row(interior: Interior) -> PairRow {
    let a = row_of.a;
    let b = row_of.b;
    let d = row_of.d;
    let e = row_of.e;
    var from_before = vec(0.0, a.y, 0.0, 0.0);
    var from_interior = vec(b.y, 0.0, a.z, 0.0);
    var own = vec(1.0, d.y, b.z, 1.0);
    var from_next = vec(e.y, 0.0, d.z, e.z);
    var rhs = vec(rhs_x.yz, rhs_y.yz);
    if is_four {
        from_before = vec(0.0);
        from_interior = vec(a.z, b.z, 0.0, a.w);
        own = vec(1.0, d.z, b.w, 1.0);
        from_next = vec(e.z, 0.0, d.w, e.w);
        rhs = vec(rhs_x.zw, rhs_y.zw);
    }
    if owns > 0u {
        interior_p[lane] = interior.p;
        interior_s[lane] = interior.s;
        partials[lane] = interior.c;
    }
    workgroupBarrier();
    return PairRow(
        less_product(from_before, from_interior, interior.p),
        less_product(less_product(own, from_interior, interior.s), from_next, interior_p[after]),
        multiply(-from_next, interior_s[after]),
        less_applied(less_applied(rhs, from_interior, interior.c), from_next, partials[after]),
    );
}

/// The pair of this block, once all are in `ring_rhs`. One barrier per round: a pair is written once as a row, when it
/// leaves the ring, and once as a solution, and nobody reads it in a round in which it is written.
fn solve_ring(row: PairRow) -> vec {
    var low = row.low;
    var own = row.own;
    var high = row.high;
    var rhs = row.rhs;
    var stride = 1u;
    // The bound is BLOCKS, see `sum_of_partials`.
    for (; stride < dispatch.blocks; stride = 2u * stride) {
        if leaves(stride) {
            let inverse = invert(own);
            low = multiply(inverse, low);
            high = multiply(inverse, high);
            rhs = apply(inverse, rhs);
            if owns > 0u {
                ring_a[lane] = low;
                ring_b[lane] = high;
                ring_rhs[lane] = rhs;
            }
        }
        workgroupBarrier();
        if stays(stride) {
            if before_leaves(stride) {
                let at = before_by(stride);
                own = less_product(own, low, ring_b[at]);
                rhs = less_applied(rhs, low, ring_rhs[at]);
                low = multiply(-low, ring_a[at]);
            }
            if after_leaves(stride) {
                let at = after_by(stride);
                own = less_product(own, high, ring_a[at]);
                rhs = less_applied(rhs, high, ring_rhs[at]);
                high = multiply(-high, ring_b[at]);
            }
        }
    }
    // The last pair is its own neighbour.
    if block == 0u { rhs = apply(invert(own + low + high), rhs); }
    if lane == 0u { ring_rhs[0] = rhs; }
    for (stride = stride / 2u; stride > 0u; stride = stride / 2u) {
        workgroupBarrier();
        if leaves(stride) {
            rhs = less_applied(less_applied(rhs, low, ring_rhs[before_by(stride)]), high, ring_rhs[after_by(stride)]);
            if owns > 0u { ring_rhs[lane] = rhs; }
        }
    }
    workgroupBarrier();
    return rhs;
}
