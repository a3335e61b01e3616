// The rings of multigrid: their sizes, their places in the arrays, and which nodes are adjacent, above or below.
// Twin of crates/flow/src/solver/multigrid/levels.rs.
//
// Level l is a ring of NODES >> l nodes, down to COARSEST or fewer. The finest one stays in registers, block by block,
// and its fields are shared in the rings for the way down. The coarser ones are stored consecutively in the arrays
// below, and the nodes of each are distributed over all threads. Data for the transfer between two levels is stored
// with the coarser one.

const COARSEST = 5u;

alias pair = vec2<real>;

/// Entries a, b, d, e of the rows, and the factor from a residual integrated over the cell, times tau, to a right-hand
/// side.
var<workgroup> coarse_rows: array<vec, COARSE>;
var<workgroup> coarse_share: array<real, COARSE>;
/// Unknowns for the two right-hand sides. While the level is built: spacing and rho.
var<workgroup> coarse_value: array<pair, COARSE>;
/// Their residuals integrated over cells, then right-hand sides. While the level is built: p and w.
var<workgroup> coarse_held: array<pair, COARSE>;
/// Weights of coarse nodes j-1 ... j+2 at the finer node between j and j+1.
var<workgroup> coarse_weights: array<vec, COARSE>;
/// The same for the last node of an odd ring, one after another.
var<workgroup> odd_weights: array<vec, ODD_RINGS>;

/// A level: how often the finest ring was halved, its nodes, and where it starts in the arrays, which exclude the
/// finest level.
struct Level { depth: u32, nodes: u32, at: u32 }

fn is_odd(ring: Level) -> bool {
    return ring.nodes % 2u == 1u;
}

fn finest() -> Level {
    return Level(0u, NODES, 0u);
}

/// The place of an odd ring among the odd ones: level l is odd if bit l of NODES is set.
fn odd_place(ring: Level) -> u32 {
    return countOneBits(NODES & ((1u << ring.depth) - 1u));
}

/// The next coarser level.
fn coarser(fine: Level) -> Level {
    return Level(fine.depth + 1u, fine.nodes / 2u, select(fine.at + fine.nodes, 0u, fine.depth == 0u));
}

/// The next finer level of one below the first coarse level.
fn finer(coarse: Level) -> Level {
    let depth = coarse.depth - 1u;
    let nodes = NODES >> depth;
    return Level(depth, nodes, coarse.at - nodes);
}

/// Coarse rings below the finest one.
fn coarse_rings() -> u32 {
    var depth = 1u;
    while (NODES >> depth) > COARSEST { depth++; }
    return depth;
}

/// `count`, in a form that compilers cannot predict: they would unroll the nested loops over levels, nodes and colours,
/// and take up to a minute.
fn at_run_time(count: u32) -> u32 {
    return select(count, 0u, dispatch.max_sweeps == 0u);
}

/// The node `by` nodes before node j, and the one after it.
fn node_before(ring: Level, j: u32, by: u32) -> u32 { return (j + ring.nodes - by) % ring.nodes; }
fn node_after(ring: Level, j: u32, by: u32) -> u32 { return (j + by) % ring.nodes; }

fn last_node(ring: Level) -> u32 {
    return ring.nodes - 1u;
}

/// Coarse node j on the finer ring, and the node between j and j+1 there.
fn fine_node(j: u32) -> u32 { return 2u * j; }
fn node_between(j: u32) -> u32 { return 2u * j + 1u; }

/// Whether the finer ring has two nodes between coarse node j and the next one: an odd ring, at its end.
fn has_two_between(fine: Level, j: u32) -> bool {
    return is_odd(fine) && j == fine.nodes / 2u - 1u;
}

/// Whether node i is the second one of those two.
fn is_second_between(fine: Level, i: u32) -> bool {
    return is_odd(fine) && i == fine.nodes - 1u;
}

/// Coarse node t of the four around the second of those two.
fn around_second(coarse: Level, t: u32) -> u32 {
    return node_after(coarse, coarse.nodes - 2u, t);
}

/// Whether node i is a coarse node.
fn is_coarse(fine: Level, i: u32) -> bool {
    return i % 2u == 0u && !is_second_between(fine, i);
}

/// The coarse node at node i, or the one before it.
fn coarse_node(fine: Level, i: u32) -> u32 {
    return min(i / 2u, fine.nodes / 2u - 1u);
}

/// First node of a thread's block, and its number of nodes.
struct Part { first: u32, nodes: u32 }

/// The block of a coarse ring that this thread sweeps.
fn coarse_block(ring: Level) -> Part {
    let threes = (4u - ring.nodes % 4u) % 4u;
    let fours = (ring.nodes - 3u * threes) / 4u;
    let start = select(3u * lane + fours, 4u * lane, lane < fours);
    return Part(start, select(select(0u, 3u, lane < fours + threes), 4u, lane < fours));
}

/// The colour swept in this phase: one after another, cyclically.
fn colour_in(phase: u32) -> u32 {
    return phase % 4u;
}

/// Whether a later colour reads what this phase writes in other blocks. Nodes of colours 2 and 3 read no other block's,
/// and neither do those of colours 0 and 1 if all blocks have four nodes.
fn ends_pass(ring: Level, phase: u32) -> bool {
    return phase % 2u == 1u || (phase % 4u == 0u && ring.nodes % 4u != 0u);
}

/// Two shared fields at node i of the finest level.
fn shared_at(i: u32) -> pair {
    return pair(ring_a[block_of(i)][colour_of(i)], ring_b[block_of(i)][colour_of(i)]);
}

/// Two fields of a level, the finest from the rings.
fn value_at(ring: Level, i: u32) -> pair {
    if ring.depth == 0u { return shared_at(i); }
    return coarse_value[ring.at + i];
}

fn held_at(ring: Level, i: u32) -> pair {
    if ring.depth == 0u { return shared_at(i); }
    return coarse_held[ring.at + i];
}
