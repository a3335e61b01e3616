// The structs shared with the host, one entry per resident member. Twin of crates/flow/src/scheme/member.rs.

/// Parameters of a member: levels at which it pauses, the law, the step, sweeps, thresholds, adaptive steps and their
/// times.
struct Parameters {
    low: Observed,
    high: Observed,
    law: array<real, 32>,
    tau: real,
    omega: real,
    redistribution: real,
    pull: real,
    geometric: real,
    tolerance: real,
    sor: real,
    polygon_ratio: real,
    r_offset: real,
    relax_at: real,
    half_at: real,
    follow_to: real,
    least_length: real,
    look_at: real,
    adaptive: real,
    time_unit: real,
    time_tick: real,
    goal_high: real,
    goal_low: real,
    end_high: real,
    end_low: real,
    clock_end: real,
    fit_from: real,
    fit_to: real,
    growth: real,
    watched: real,
}

/// Observables of one curve.
struct Observed {
    length: real,
    area: real,
    excess: real,
    energy: real,
    k_min: real,
    k_max: real,
    mesh_ratio: real,
    metric_drift: real,
}

/// A member's time, and the times of its events.
struct Progress {
    turning: real,
    travel: real,
    time_high: real,
    time_low: real,
    taken: real,
    taken_before: real,
    next: real,
    aim: real,
    slope: real,
    bend: real,
    relax_high: real,
    relax_low: real,
    relax_length: real,
    relax_fraction: real,
    half_high: real,
    half_low: real,
    half_length: real,
    half_fraction: real,
}

/// The line fitted to ln excess.
struct Decay {
    x: real,
    y: real,
    mean_x: real,
    mean_y: real,
    xx: real,
    xy: real,
    yy: real,
}

/// A member's report at the end of a dispatch, except for the recorded excess.
struct Report {
    before: Observed,
    now: Observed,
    progress: Progress,
    decay: Decay,
}

/// The complete report.
struct Record {
    report: Report,
    excess_at: array<real, TIMES>,
}

/// Integers of a member. `status` is 0 while it is running; `phase` and `solve_sweeps` say where an attempt was paused.
struct Counters {
    status: u32,
    steps: u32,
    rejected: u32,
    refused: u32,
    order: u32,
    solves: u32,
    goal: u32,
    stop_when_relaxed: u32,
    relax_step: u32,
    half_step: u32,
    sweeps_k: u32,
    sweeps_x: u32,
    phase: u32,
    solve_sweeps: u32,
    fit_points: u32,
    fit_over: u32,
    noted: u32,
    passed: u32,
}

const RUNNING = 0u;
const RELAXED = 1u;
const SINGULAR = 3u;
const NONFINITE = 4u;
const STALLED = 5u;
const NEVER = 0xffffffffu;

/// Parameters of one dispatch.
struct Dispatch {
    /// Steps of the paper after which the dispatch pauses, if need be in the middle of an adaptive step.
    steps: u32,
    /// Maximum number of sweeps per system.
    max_sweeps: u32,
    /// Highest order of an adaptive step.
    most_order: u32,
    /// Sweeps after which the dispatch pauses, if need be in the middle of a solve.
    sweeps: u32,
    /// BLOCKS, as a number unknown to compilers: they would unroll every loop over the blocks.
    blocks: u32,
    /// Groups in which maxima are taken: about the root of BLOCKS.
    groups: u32,
    /// NODES and FOURS, where the kernel is not made for one size.
    nodes: u32,
    fours: u32,
    /// The cosine and the sine of π/n.
    half_cosine: f32,
    half_sine: f32,
}

@group(0) @binding(0) var<uniform> dispatch: Dispatch;
@group(0) @binding(1) var<storage, read> all_parameters: array<Parameters>;
@group(0) @binding(2) var<storage, read_write> all_counters: array<Counters>;
@group(0) @binding(3) var<storage, read_write> all_reports: array<Record>;
/// STATE_FIELDS fields of BLOCKS rows each.
@group(0) @binding(4) var<storage, read_write> all_states: array<vec>;

/// The members that this dispatch advances, one per workgroup.
@group(0) @binding(5) var<storage, read> all_due: array<u32>;

/// Index of this workgroup's member. Its parameters are read where they are needed: copies of them in every thread
/// would take the registers of its nodes. Its counters and its report are read and written by thread 0 alone, so they
/// need no barrier; what other threads must know of them, thread 0 says in a `Plan` or a decision.
var<private> member: u32;
/// Length of the current step of the paper.
var<private> tau: real;
/// Offset of the curve at its start.
var<private> curve: u32;
/// The row of this thread's block in the first field of the member.
var<private> first_row: u32;
/// `member`, for `find_member`.
var<workgroup> resident: u32;

/// Finds the member again, where a step begins and between its solves: or else compilers compute the addresses of all
/// fields once for a dispatch, and keep them, and the parameters, in registers.
fn find_member() {
    member = resident;
    first_row = row_in(member * STATE_FIELDS);
}
