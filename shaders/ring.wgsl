// The ring of nodes: the only index arithmetic, and the exchange between threads. Twin of src/solver/ring.rs.
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

/// Fields that neighbours need, one value a node.
var<workgroup> ring_a: array<real, NODES>;
var<workgroup> ring_b: array<real, NODES>;
/// One row a block, for sums and maxima over the ring.
var<workgroup> partials: array<vec, BLOCKS>;
/// A decision for the whole workgroup.
var<workgroup> verdict: u32;

/// This thread, and the first node of its block.
var<private> lane: u32;
var<private> first: u32;
/// Nodes that it owns: 4, 3, or 0 for a spare thread.
var<private> owns: u32;
/// Nodes first-2 ... first+1 and first+2 ... first+5, wrapped.
var<private> near_low: vec4<u32>;
var<private> near_high: vec4<u32>;

fn take_block(thread: u32) {
    lane = thread;
    let block = min(thread, BLOCKS - 1u);
    first = select(3u * block + FOURS, 4u * block, block < FOURS);
    owns = select(0u, select(3u, 4u, block < FOURS), thread < BLOCKS);
    near_low = (vec4<u32>(0u, 1u, 2u, 3u) + vec4<u32>(first + NODES - 2u)) % vec4<u32>(NODES);
    near_high = (vec4<u32>(2u, 3u, 4u, 5u) + vec4<u32>(first)) % vec4<u32>(NODES);
}

/// A field on the nodes first-2 ... first+5.
struct Window { low: vec, high: vec }

/// The field at i-2, i-1, i, i+1, i+2 for the four nodes i of the block.
fn minus2(w: Window) -> vec { return w.low; }
fn minus1(w: Window) -> vec { return vec(w.low.yzw, w.high.x); }
fn here(w: Window) -> vec { return vec(w.low.zw, w.high.xy); }
fn plus1(w: Window) -> vec { return vec(w.low.w, w.high.xyz); }
fn plus2(w: Window) -> vec { return w.high; }

fn read_a() -> Window {
    return Window(
        vec(ring_a[near_low.x], ring_a[near_low.y], ring_a[near_low.z], ring_a[near_low.w]),
        vec(ring_a[near_high.x], ring_a[near_high.y], ring_a[near_high.z], ring_a[near_high.w]),
    );
}

fn read_b() -> Window {
    return Window(
        vec(ring_b[near_low.x], ring_b[near_low.y], ring_b[near_low.z], ring_b[near_low.w]),
        vec(ring_b[near_high.x], ring_b[near_high.y], ring_b[near_high.z], ring_b[near_high.w]),
    );
}

fn write_a(v: vec) {
    if owns == 0u { return; }
    ring_a[first] = v.x;
    ring_a[first + 1u] = v.y;
    ring_a[first + 2u] = v.z;
    if owns == 4u { ring_a[first + 3u] = v.w; }
}

fn write_b(v: vec) {
    if owns == 0u { return; }
    ring_b[first] = v.x;
    ring_b[first + 1u] = v.y;
    ring_b[first + 2u] = v.z;
    if owns == 4u { ring_b[first + 3u] = v.w; }
}

/// Shares two fields: afterwards read_a and read_b see them, and earlier readers are done.
fn share(a: vec, b: vec) {
    workgroupBarrier();
    write_a(a);
    write_b(b);
    workgroupBarrier();
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

/// Four sums over the ring from the sums over each block, added in block order; `before` gets those of earlier blocks.
fn ring_sums(part: vec, before: ptr<function, vec>) -> vec {
    workgroupBarrier();
    if owns > 0u { partials[lane] = part; }
    workgroupBarrier();
    var total = vec(0.0);
    for (var t = 0u; t < BLOCKS; t++) {
        if t == lane { *before = total; }
        total = total + partials[t];
    }
    return total;
}

/// Four maxima over the ring from the maxima over each block.
fn ring_maxima(part: vec) -> vec {
    workgroupBarrier();
    if owns > 0u { partials[lane] = part; }
    workgroupBarrier();
    var largest = partials[0];
    for (var t = 1u; t < BLOCKS; t++) {
        largest = max(largest, partials[t]);
    }
    return largest;
}

/// The value that thread 0 holds, for every thread, in a way that control flow may depend on.
fn uniform_decision(value: u32) -> u32 {
    workgroupBarrier();
    if lane == 0u { verdict = value; }
    return workgroupUniformLoad(&verdict);
}
