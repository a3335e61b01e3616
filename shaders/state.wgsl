// The state of a member: its fields, loaded and stored. Twin of crates/flow/src/scheme/state.rs.
// Increments are added to a curve, and changes of one formed, only here.

const STATE_FIELDS = 42u;
/// Offsets of the curves in a state, four fields each: x, y, k, r. The increments of k, x and y follow the first one,
/// and then what sweeps remember next to them.
const CURVE = 0u;
const INCREMENTS = 4u;
const EARLIER = 7u;
/// The first and second derivative of the curve at the end of the last adaptive step, in units of that step.
const SLOPE = 10u;
const BEND = 14u;
/// The curve before the last step, and its derivatives. During an attempt: the change that it makes so far, and those
/// at its end.
const BEFORE = 18u;
const SLOPE_BEFORE = 22u;
const BEND_BEFORE = 26u;
/// During an attempt: the curve at the end of the last part.
const PART = 30u;
/// During an attempt: its errors, of k and r, of its order and of the one below; then those of x and y.
const GAPS = 34u;
const NODE_GAPS = 38u;

/// The length of segments, of which `stored` is in the state.
fn length_of(stored: vec) -> vec { return stored + vec(all_parameters[member].r_offset); }

/// Whether the entries of a field of a curve are places.
fn is_of_places(field: u32) -> bool {
    return field < 2u;
}

/// Entries of this field of a curve after an increment.
fn advanced(field: u32, old: vec, increment: vec) -> vec {
    if is_of_places(field) { return moved(old, increment); }
    return old + increment;
}

/// How entries of this field of a curve have changed.
fn change_from(field: u32, old: vec, now: vec) -> vec {
    if is_of_places(field) { return apart(old, now); }
    return now - old;
}

/// A field in this thread's block. Nobody else loads what its owner stores, so no barrier is needed. Only spare threads
/// do, and may get anything: what they compute reaches no other thread.
fn load_field(field: u32) -> vec {
    return all_states[row_after(first_row, field)];
}

/// The last component of a block of three repeats its third node.
fn store_field(field: u32, v: vec) {
    if owns > 0u { all_states[row_after(first_row, field)] = vec(v.xyz, select(v.z, v.w, is_four)); }
}

fn copy_curve(to: u32, source: u32) {
    for (var field = 0u; field < 4u; field++) { store_field(to + field, load_field(source + field)); }
}

fn store_fields(base: u32, xs: vec, ys: vec, ks: vec, rs: vec) {
    store_field(base, xs);
    store_field(base + 1u, ys);
    store_field(base + 2u, ks);
    store_field(base + 3u, rs);
}

/// Edges, and their lengths.
struct Edge { x: vec, y: vec, length: vec }

fn edge(x: vec, y: vec) -> Edge {
    return Edge(x, y, sqrt(x * x + y * y));
}

/// Twice the sine of half the angle from an edge to the next one.
fn vertex_turn(e: Edge, f: Edge) -> vec {
    return twice_sin_atan((e.x * f.y - e.y * f.x) / (e.length * f.length + (e.x * f.x + e.y * f.y)));
}
