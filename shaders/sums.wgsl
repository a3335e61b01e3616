// Sums and maxima over a block, and sums over the ring of blocks. In Rust, `Sums` (crates/flow/src/solver/ring.rs) adds
// node after node, in the same order.

/// One row per block, for sums over the ring.
var<workgroup> partials: array<vec, ROWS>;
/// A decision for the whole workgroup.
var<workgroup> verdict: u32;

/// `v` with the component that is not owned set to zero.
fn owned(v: vec) -> vec {
    return vec(v.xyz, select(real(0.0), v.w, owns == 4u));
}

/// Sum over the block, in node order.
fn block_sum(v: vec) -> real {
    let own = owned(v);
    return own.x + own.y + own.z + own.w;
}

/// Largest component over the block of values that are not negative.
fn block_max(v: vec) -> real {
    let own = owned(v);
    return max(max(own.x, own.y), max(own.z, own.w));
}

/// Largest owned component, of either sign.
fn block_max_signed(v: vec) -> real {
    return max(max(v.x, v.y), select(v.z, max(v.z, v.w), owns == 4u));
}

/// Properties of a curve, known once its nodes are.
struct Summary { sums: vec, extremes: vec, others: vec }

/// Four sums over the ring from the sums over each block, added in block order.
fn ring_sums(part: vec) -> vec {
    if owns > 0u { partials[lane] = part; }
    workgroupBarrier();
    return sum_of_partials();
}

/// The sum of all rows of `partials`, in order. A kernel for one size adds eight in a round of the loop, since its
/// counter, and the one that naga gives every loop, cost more than an addition. lavapipe's compiler takes a quarter
/// longer then, for the 36 reads.
///
/// The bound of the loop is read from the dispatch: a constant one is unrolled, which takes lavapipe's compiler as long
/// as everything else together, and does not run faster.
fn sum_of_partials() -> vec {
    var sum = vec(0.0);
    var t = 0u;
    for (; is_for_one_size() && t + 8u <= dispatch.blocks; t += 8u) {
        sum = sum + partials[t] + partials[t + 1u] + partials[t + 2u] + partials[t + 3u];
        sum = sum + partials[t + 4u] + partials[t + 5u] + partials[t + 6u] + partials[t + 7u];
    }
    for (; t < dispatch.blocks; t++) { sum = sum + partials[t]; }
    return sum;
}

/// The sum over the blocks before this one, added in block order.
fn sum_before(part: real) -> real {
    if owns > 0u { partials[lane].x = part; }
    workgroupBarrier();
    var sum = real(0.0);
    var t = 0u;
    for (; t + 4u <= block; t += 4u) {
        sum = sum + partials[t].x + partials[t + 1u].x + partials[t + 2u].x + partials[t + 3u].x;
    }
    if t < block { sum = sum + partials[t].x; }
    if t + 1u < block { sum = sum + partials[t + 1u].x; }
    if t + 2u < block { sum = sum + partials[t + 2u].x; }
    return sum;
}

/// The value in thread 0, for every thread, in a form on which control flow may depend.
fn uniform_decision(value: u32) -> u32 {
    if lane == 0u { verdict = value; }
    return workgroupUniformLoad(&verdict);
}
