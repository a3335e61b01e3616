// The structs shared with the host, one entry a resident member. Twin of src/scheme/parameters.rs.

/// Parameters of a member: coefficients of b(k), time step, redistribution, sweeps, thresholds.
struct Parameters {
    c1: real, c2: real, c3: real, c4: real, c5: real, c6: real, c7: real, c8: real,
    tau: real,
    omega: real,
    redistribution: real,
    tolerance: real,
    sor: real,
    length_penalty: real,
    polygon_ratio: real,
    relax_at: real,
    half_at: real,
}

/// What a member reports when a dispatch ends.
struct Report {
    length: real,
    area: real,
    excess: real,
    energy: real,
    k_min: real,
    k_max: real,
    mesh_ratio: real,
    metric_drift: real,
    turning: real,
    relax_fraction: real,
    half_fraction: real,
}

/// Integers of a member. `status` is 0 while it is running; `phase` and `solve_sweeps` say where a step was paused.
struct Counters {
    status: u32,
    steps: u32,
    goal: u32,
    stop_when_relaxed: u32,
    relax_step: u32,
    half_step: u32,
    sweeps_k: u32,
    sweeps_x: u32,
    phase: u32,
    solve_sweeps: u32,
}

const RUNNING = 0u;
const RELAXED = 1u;
const SINGULAR = 3u;
const NONFINITE = 4u;
const STALLED = 5u;
const NEVER = 0xffffffffu;

/// What one dispatch asks for.
struct Dispatch {
    /// Steps at most.
    steps: u32,
    /// Sweeps a system at most.
    max_sweeps: u32,
    /// Sweeps after which the dispatch pauses, in the middle of a solve if need be.
    sweeps: u32,
}

const STATE_FIELDS = 7u;

@group(0) @binding(0) var<uniform> dispatch: Dispatch;
@group(0) @binding(1) var<storage, read> all_parameters: array<Parameters>;
@group(0) @binding(2) var<storage, read_write> all_counters: array<Counters>;
@group(0) @binding(3) var<storage, read_write> all_reports: array<Report>;
/// Fields x, y, k, r and the last increments of k, x, y, NODES numbers each.
@group(0) @binding(4) var<storage, read_write> all_states: array<real>;

/// Index of this workgroup's member, and its parameters.
var<private> member: u32;
var<private> p: Parameters;
var<private> counters: Counters;
/// Its nodes in this thread's block: the state at the start of a step.
var<private> x: vec;
var<private> y: vec;
var<private> k: vec;
var<private> r: vec;
/// Increments of the last step: where the next solve starts.
var<private> dk: vec;
var<private> dx: vec;
var<private> dy: vec;

fn load_field(field: u32) -> vec {
    let base = (member * STATE_FIELDS + field) * NODES;
    return vec(
        all_states[base + near_low.z], all_states[base + near_low.w],
        all_states[base + near_high.x], all_states[base + near_high.y],
    );
}

fn store_field(field: u32, v: vec) {
    let base = (member * STATE_FIELDS + field) * NODES + first;
    if owns == 0u { return; }
    all_states[base] = v.x;
    all_states[base + 1u] = v.y;
    all_states[base + 2u] = v.z;
    if owns == 4u { all_states[base + 3u] = v.w; }
}
