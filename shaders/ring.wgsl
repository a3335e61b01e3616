// The ring of nodes: the only index arithmetic, and what a thread knows of its neighbours. Twin of src/solver/ring.rs.
//
// A thread owns one block of four or three consecutive nodes, kept in the components of a `vec`; a node's colour is
// its place in the block. For a block of three the fourth component repeats the first node of the next block: it is
// computed along and never written, summed or judged. The workgroup is filled up to whole subgroups with spare threads
// that compute along with the last block and write nothing: lavapipe loses the registers of a subgroup that is only
// partly filled when a loop with barriers ends.

/// Nodes of a member.
override NODES: u32;
/// Blocks of four nodes; they come first.
override FOURS: u32;
/// Blocks.
override BLOCKS: u32;
/// Threads: at least one a block, in whole subgroups.
override THREADS: u32;
/// Nodes of all coarser rings together, for multigrid.
override COARSE: u32;

/// One row a block, for sums over the ring.
var<workgroup> partials: array<vec, BLOCKS>;

/// This thread, its block, and the first node of that.
var<private> lane: u32;
var<private> block: u32;
var<private> first: u32;
/// Nodes that it owns: 4, 3, or 0 for a spare thread.
var<private> owns: u32;
/// Whether its block and the one before have four nodes.
var<private> is_four: bool;
var<private> before_is_four: bool;
/// The blocks on either side.
var<private> before: u32;
var<private> after: u32;

fn take_block(thread: u32) {
    lane = thread;
    block = min(thread, BLOCKS - 1u);
    before = (block + BLOCKS - 1u) % BLOCKS;
    after = (block + 1u) % BLOCKS;
    is_four = block < FOURS;
    before_is_four = before < FOURS;
    first = select(3u * block + FOURS, 4u * block, is_four);
    owns = select(0u, select(3u, 4u, is_four), thread < BLOCKS);
}

/// Whether any block has three nodes.
fn has_threes() -> bool {
    return FOURS < BLOCKS;
}

/// A field on the nodes first-2 ... first+5.
struct Window { low: vec, high: vec }

/// The windows of two fields.
struct Windows { a: Window, b: Window }

/// The field at i-2, i-1, i, i+1, i+2 for the four nodes i of the block.
fn minus2(w: Window) -> vec { return w.low; }
fn minus1(w: Window) -> vec { return vec(w.low.yzw, w.high.x); }
fn here(w: Window) -> vec { return vec(w.low.zw, w.high.xy); }
fn plus1(w: Window) -> vec { return vec(w.low.w, w.high.xyz); }
fn plus2(w: Window) -> vec { return w.high; }

/// The window of a block between the blocks before and after it.
fn window(of_before: vec, own: vec, of_after: vec) -> Window {
    let tail = select(of_before.yz, of_before.zw, before_is_four);
    let high = select(vec(own.z, of_after.xyz), vec(own.zw, of_after.xy), is_four);
    return Window(vec(tail, own.xy), high);
}

/// The last two nodes of the block, of two fields.
fn tails(a: vec, b: vec) -> vec {
    return select(vec(a.yz, b.yz), vec(a.zw, b.zw), is_four);
}

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

/// What is summed over the ring: the blocks before this one, and all.
struct Sums { earlier: vec, all: vec }

/// What is known of a curve after its new nodes are.
struct Summary { sums: vec, extremes: vec, others: vec }

/// Four sums over the ring from the sums over each block, added in block order.
///
/// The bound of the loop is read from the dispatch: a constant one is unrolled, which takes lavapipe's compiler as long as
/// everything else together, and runs no faster.
fn ring_sums(part: vec) -> Sums {
    workgroupBarrier();
    if owns > 0u { partials[lane] = part; }
    workgroupBarrier();
    var sums = Sums(vec(0.0), vec(0.0));
    for (var t = 0u; t < dispatch.blocks; t++) {
        sums.earlier = select(sums.earlier, sums.all, t == block);
        sums.all = sums.all + partials[t];
    }
    return sums;
}
