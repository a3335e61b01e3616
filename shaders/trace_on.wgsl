// The kernel of the conformance test writes the results of every stage, for the host to compare with its twin.

/// TRACE_FIELDS fields of NODES numbers per member; the host lists them in crates/backend/src/bounds.rs.
@group(0) @binding(6) var<storage, read_write> traces: array<real>;

const TRACE_FIELDS = 20u;

fn trace(field: u32, value: vec) {
    let base = (member * TRACE_FIELDS + field) * node_count() + first;
    if owns == 0u { return; }
    traces[base] = value.x;
    traces[base + 1u] = value.y;
    traces[base + 2u] = value.z;
    if owns == 4u { traces[base + 3u] = value.w; }
}
