// A direct solve inside the workgroup, in place of the sweeps. Its independent check is src/solver/direct.rs.
//
// Every block keeps its last two unknowns `s` and eliminates the others: its first two nodes become
// `m = c - P p - S s`, with `p` the last two unknowns of the block before. What remains is a ring of pairs,
// `L p + D s + U s' = g`. The last pair borders a chain of the others, which parallel cyclic reduction solves in
// log2(BLOCKS) rounds: in each, every pair eliminates its neighbours at the current stride. No pivoting: the systems
// are perturbations of 1 + (positive) D^4.

/// 2x2 matrices are kept as (m00, m01, m10, m11), pairs for x and y together as (x0, x1, y0, y1).
/// Chain coefficients of every pair, divided by its own: towards lower and higher blocks, right-hand sides, border.
var<workgroup> chain_low: array<vec, BLOCKS>;
var<workgroup> chain_high: array<vec, BLOCKS>;
var<workgroup> chain_rhs: array<vec, BLOCKS>;
var<workgroup> chain_border: array<vec, BLOCKS>;

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

fn invert(m: vec) -> vec {
    return vec(m.w, -m.y, -m.z, m.x) / (m.x * m.w - m.y * m.z);
}

/// Solves for `u` alone, or for `u` and `v`.
fn solve(both: bool, negligible: real) -> u32 {
    if !both { rhs_y = vec(0.0); }
    sweeps = 0u;
    let interior = eliminate_interior();
    let row = pair_row(interior);
    let own = solve_pairs(row);
    workgroupBarrier();
    if owns == 4u { put_pair(2u, own); }
    if owns == 3u { put_pair(1u, own); }
    workgroupBarrier();
    let before = vec(ring_a[near_low.x], ring_a[near_low.y], ring_b[near_low.x], ring_b[near_low.y]);
    let m = interior.c - apply(interior.p, before) - apply(interior.s, own);
    let four = is_four();
    u = select(vec(m.x, own.xy, 0.0), vec(m.xy, own.xy), four);
    v = select(vec(m.z, own.zw, 0.0), vec(m.zw, own.zw), four);
    let size = max(block_max(bounded_abs(u)), block_max(bounded_abs(v)));
    let largest = ring_maxima(vec(size, 0.0, 0.0, 0.0));
    return uniform_decision(select(NOT_FINITE, SOLVED, largest.x <= real(BIG)));
}

/// Whether the block has four nodes; a spare thread computes along with the last block.
fn is_four() -> bool {
    return min(lane, BLOCKS - 1u) < FOURS;
}

fn put_pair(at: u32, pair: vec) {
    ring_a[first + at] = pair.x;
    ring_a[first + at + 1u] = pair.y;
    ring_b[first + at] = pair.z;
    ring_b[first + at + 1u] = pair.w;
}

fn eliminate_interior() -> Interior {
    let a = row_of.a;
    let b = row_of.b;
    let d = row_of.d;
    let e = row_of.e;
    if is_four() {
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

/// The rows of the block's pair, with its own interior and that of the next block put in.
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
    if is_four() {
        from_before = vec(0.0);
        from_interior = vec(a.z, b.z, 0.0, a.w);
        own = vec(1.0, d.z, b.w, 1.0);
        from_next = vec(e.z, 0.0, d.w, e.w);
        rhs = vec(rhs_x.zw, rhs_y.zw);
    }
    workgroupBarrier();
    if owns > 0u {
        chain_low[lane] = interior.p;
        chain_high[lane] = interior.s;
        chain_rhs[lane] = interior.c;
    }
    workgroupBarrier();
    let next = (min(lane, BLOCKS - 1u) + 1u) % BLOCKS;
    let row = PairRow(
        from_before - multiply(from_interior, interior.p),
        own - multiply(from_interior, interior.s) - multiply(from_next, chain_low[next]),
        -multiply(from_next, chain_high[next]),
        rhs - apply(from_interior, interior.c) - apply(from_next, chain_rhs[next]),
    );
    workgroupBarrier();
    return row;
}

/// The pair of this block: the chain of all but the last block by cyclic reduction, then the last one as its border.
fn solve_pairs(row: PairRow) -> vec {
    let last = BLOCKS - 1u;
    let inverse = invert(row.own);
    var low = multiply(inverse, row.low);
    var high = multiply(inverse, row.high);
    var rhs = apply(inverse, row.rhs);
    var border = vec(0.0);
    if lane == 0u {
        border = low;
        low = vec(0.0);
    }
    if lane + 1u == last {
        border = border + high;
        high = vec(0.0);
    }
    if lane < last { put_chain(low, high, rhs, border); }
    for (var stride = 1u; stride < last; stride = 2u * stride) {
        workgroupBarrier();
        var reduced = vec(1.0, 0.0, 0.0, 1.0);
        var new_low = vec(0.0);
        var new_high = vec(0.0);
        if lane < last && lane >= stride {
            let at = lane - stride;
            reduced = reduced - multiply(low, chain_high[at]);
            new_low = -multiply(low, chain_low[at]);
            rhs = rhs - apply(low, chain_rhs[at]);
            border = border - multiply(low, chain_border[at]);
        }
        if lane + stride < last {
            let at = lane + stride;
            reduced = reduced - multiply(high, chain_low[at]);
            new_high = -multiply(high, chain_high[at]);
            rhs = rhs - apply(high, chain_rhs[at]);
            border = border - multiply(high, chain_border[at]);
        }
        let scale = invert(reduced);
        low = multiply(scale, new_low);
        high = multiply(scale, new_high);
        rhs = apply(scale, rhs);
        border = multiply(scale, border);
        workgroupBarrier();
        if lane < last { put_chain(low, high, rhs, border); }
    }
    workgroupBarrier();
    if lane == last {
        let before = last - 1u;
        let own = row.own - multiply(row.low, chain_border[before]) - multiply(row.high, chain_border[0]);
        let left = row.rhs - apply(row.low, chain_rhs[before]) - apply(row.high, chain_rhs[0]);
        chain_rhs[last] = apply(invert(own), left);
    }
    workgroupBarrier();
    let end = chain_rhs[last];
    return select(rhs - apply(border, end), end, lane >= last);
}

fn put_chain(low: vec, high: vec, rhs: vec, border: vec) {
    chain_low[lane] = low;
    chain_high[lane] = high;
    chain_rhs[lane] = rhs;
    chain_border[lane] = border;
}
