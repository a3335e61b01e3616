// Sums and maxima over a block, and sums over the ring of blocks. In Rust, `Sums` (src/solver/ring.rs) adds node after
// node, in the same order.

/// One row per block, for sums over the ring.
var<workgroup> partials: array<vec, BLOCKS>;
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

/// Sums over the ring: of the blocks before this one, and of all.
struct Sums { earlier: vec, all: vec }

/// Properties of a curve, known once its nodes are.
struct Summary { sums: vec, extremes: vec, others: vec }

/// Four sums over the ring from the sums over each block, added in block order.
///
/// The bound of the loop is read from the dispatch: a constant one is unrolled, which takes lavapipe's compiler as long
/// as everything else together, and does not run faster.
fn ring_sums(part: vec) -> Sums {
    if owns > 0u { partials[lane] = part; }
    workgroupBarrier();
    var sums = Sums(vec(0.0), vec(0.0));
    for (var t = 0u; t < dispatch.blocks; t++) {
        sums.earlier = select(sums.earlier, sums.all, t == block);
        sums.all = sums.all + partials[t];
    }
    return sums;
}

/// The value in thread 0, for every thread, in a form on which control flow may depend.
fn uniform_decision(value: u32) -> u32 {
    if lane == 0u { verdict = value; }
    return workgroupUniformLoad(&verdict);
}
