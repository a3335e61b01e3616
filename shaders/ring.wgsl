// The ring of nodes, cut into blocks: which nodes or blocks are adjacent, and what a thread knows of its neighbours.
// Twin of crates/flow/src/solver/ring.rs. All arithmetic on indices of nodes and blocks is here. Addresses in storage
// buffers are computed in state.wgsl and trace_on.wgsl. The scheme sees positions and curvatures by their differences
// only, and forms them only here.
//
// A thread owns one block of four or three consecutive nodes, stored in the components of a `vec`; a node's colour is
// its place in the block. For a block of three the fourth component repeats the first node of the next block: it is
// computed too, but never written, summed or judged. The workgroup is filled up to whole subgroups with spare threads
// that repeat the last block and write nothing of it: lavapipe loses the registers of a partly filled subgroup when a
// loop with barriers ends.

/// Nodes of a member, blocks of four nodes, which come first, and the number of blocks. 0: the dispatch says it, and a
/// kernel serves all sizes that take as many threads.
override NODES: u32;
override FOURS: u32;
override BLOCKS: u32;
/// Threads: at least one per block, in whole subgroups.
override THREADS: u32;
/// Rows of an array with one row per block.
override ROWS: u32;

fn is_for_one_size() -> bool {
    return NODES != 0u;
}

fn node_count() -> u32 {
    if is_for_one_size() { return NODES; }
    return dispatch.nodes;
}

fn four_count() -> u32 {
    if is_for_one_size() { return FOURS; }
    return dispatch.fours;
}

fn block_count() -> u32 {
    if is_for_one_size() { return BLOCKS; }
    return dispatch.blocks;
}

/// This thread, its block, and the first node of the block.
var<private> lane: u32;
var<private> block: u32;
var<private> first: u32;
/// Number of nodes that it owns: 4, 3, or 0 for a spare thread.
var<private> owns: u32;
/// Whether its block and the one before have four nodes.
var<private> is_four: bool;
var<private> before_is_four: bool;
/// The blocks on either side.
var<private> before: u32;
var<private> after: u32;

fn take_block(thread: u32) {
    lane = thread;
    block = min(thread, block_count() - 1u);
    before = (block + block_count() - 1u) % block_count();
    after = (block + 1u) % block_count();
    is_four = block < four_count();
    before_is_four = before < four_count();
    first = select(3u * block + four_count(), 4u * block, is_four);
    owns = select(0u, select(3u, 4u, is_four), thread < block_count());
}

/// Whether any block has three nodes.
fn has_threes() -> bool {
    return four_count() < block_count();
}

/// The row of the block in a field, and in the field that is `by` fields after that of `row`.
fn row_in(field: u32) -> u32 {
    return field * block_count() + block;
}
fn row_after(row: u32, by: u32) -> u32 {
    return row + by * block_count();
}

/// The group of the block, for taking maxima.
fn group() -> u32 {
    return block % dispatch.groups;
}

// The direct solve halves the ring of blocks round by round: in each round every second remaining block, `stride`
// apart, leaves. `stride` is a power of two, so that masks stand for remainders, which take GPUs thirty instructions.

/// Whether the block leaves the ring in this round.
fn leaves(stride: u32) -> bool {
    return stride == (block & (2u * stride - 1u));
}

/// Whether it stays in the ring after this round.
fn stays(stride: u32) -> bool {
    return (block & (2u * stride - 1u)) == 0u;
}

/// Whether the block before it in the ring leaves. In a ring of an odd number the first and the last block both stay.
fn before_leaves(stride: u32) -> bool {
    return block > 0u || ((block_count() - 1u) & stride) != 0u;
}

/// Whether the block after it in the ring leaves.
fn after_leaves(stride: u32) -> bool {
    return block + stride < block_count();
}

/// The block before it in the ring.
fn before_by(stride: u32) -> u32 {
    return select(block - stride, (block_count() - 1u) & ~(stride - 1u), block == 0u);
}

/// The block after it in the ring.
fn after_by(stride: u32) -> u32 {
    return select(0u, block + stride, block + stride < block_count());
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
/// The field at i+3, except for the last node: first+6 is outside the window, and first+5 replaces it.
fn plus3(w: Window) -> vec { return vec(w.high.yzw, w.high.w); }

/// The window of a block between the blocks before and after it.
fn window(of_before: vec, own: vec, of_after: vec) -> Window {
    let tail = select(of_before.yz, of_before.zw, before_is_four);
    let high = select(vec(own.z, of_after.xyz), vec(own.zw, of_after.xy), is_four);
    return Window(vec(tail, own.xy), high);
}

/// How much a field at i-1, i, i+1, i+2 exceeds its value at the node before.
struct Rises { minus1: vec, here: vec, plus1: vec, plus2: vec }

fn rises(w: Window) -> Rises {
    return Rises(minus1(w) - minus2(w), here(w) - minus1(w), plus1(w) - here(w), plus2(w) - plus1(w));
}

/// The same for places.
fn rises_of_places(w: Window) -> Rises {
    return Rises(
        apart(minus2(w), minus1(w)), apart(minus1(w), here(w)), apart(here(w), plus1(w)), apart(plus1(w), plus2(w)),
    );
}

/// By how much the square of a field at i+1 exceeds the one at i.
fn rise_of_square(w: Window) -> vec {
    let at = here(w);
    let next = plus1(w);
    return next * next - at * at;
}

/// The window of a block between the tail of the block before and the front of the block after, two nodes each. The
/// fourth component of a block of three has no second neighbour in it; the first one replaces it.
fn narrow_window(tail: vec2<real>, own: vec, front: vec2<real>) -> Window {
    return Window(vec(tail, own.xy), select(vec(own.z, front, front.y), vec(own.zw, front), is_four));
}

/// The last two nodes of the block, of two fields.
fn tails(a: vec, b: vec) -> vec {
    return select(vec(a.yz, b.yz), vec(a.zw, b.zw), is_four);
}

/// The last two nodes of the block before, of two fields.
fn tails_before(a: Window, b: Window) -> vec {
    return vec(a.low.xy, b.low.xy);
}

/// The first two nodes of the block after, of two fields.
fn fronts_after(a: Window, b: Window) -> vec {
    return tails(a.high, b.high);
}

/// The two nodes after the third one of the block, with `front` the first two nodes of the block after.
fn after_third(own: vec, front: vec2<real>) -> vec2<real> {
    return select(front, vec2(own.w, front.x), is_four);
}

/// `v` with the last node of the ring set to zero.
fn without_last_node(v: vec) -> vec {
    if block < block_count() - 1u { return v; }
    return select(vec(v.xy, 0.0, v.w), vec(v.xyz, 0.0), is_four);
}
