// A pentadiagonal system in registers, every row divided by its diagonal entry. Twin of
// crates/flow/src/solver/system.rs.

/// Row i: a u[i-2] + b u[i-1] + u[i] + d u[i+1] + e u[i+2] = rhs.
var<private> row_of: Rows;
/// Right-hand sides; the curvature system uses only the first.
var<private> rhs_x: vec;
var<private> rhs_y: vec;
/// 1/diagonal.
var<private> inverse: vec;

struct Rows { a: vec, b: vec, d: vec, e: vec, weight: vec }

fn normalise(a: vec, b: vec, c: vec, d: vec, e: vec, time_over_length: vec) {
    inverse = vec(1.0) / c;
    row_of = Rows(a * inverse, b * inverse, d * inverse, e * inverse, time_over_length * c);
}

/// rhs - (row . u) for the block.
fn residual(rhs: vec, w: Window) -> vec {
    return rhs - row_of.a * minus2(w) - row_of.b * minus1(w) - row_of.d * plus1(w) - row_of.e * plus2(w) - here(w);
}

/// The largest of the unknowns of the block.
fn largest() -> real { return block_max(max(bounded_abs(u), bounded_abs(v))); }

/// How a solve ended.
const UNSOLVED = 0u;
const SOLVED = 1u;
const NOT_FINITE = 2u;
const DIVERGED = 3u;
const PAUSED = 99u;

/// How a solve ended, and the sweeps that it has made over all dispatches.
struct Solve { ended: u32, sweeps: u32 }

/// The unknowns of the block: where sweeps start, then the result. The curvature system has only `u`.
var<private> u: vec;
var<private> v: vec;
