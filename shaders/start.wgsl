// Where sweeps start: increments predicted from those of the last two solves. Twin of crates/flow/src/scheme/start.rs.

/// After a step of the paper: extrapolates its increments to the next one of the same length, and remembers them in
/// EARLIER.
fn after_step() {
    if !SWEEPS { return; }
    for (var field = 0u; field < 3u; field++) {
        let last = load_field(INCREMENTS + field);
        store_field(INCREMENTS + field, real(2.0) * last - load_field(EARLIER + field));
        store_field(EARLIER + field, last);
    }
}

/// Puts the start of the first part of a row, of length `first`, by the derivatives at the end of the last step, of
/// length `taken`.
fn begin_row(first: real, taken: real) {
    if !SWEEPS { return; }
    var ratio = taken;
    if !(taken <= real(0.0)) { ratio = first / taken; }
    let square = ratio * ratio;
    for (var field = 0u; field < 3u; field++) {
        // Increments are of k, x and y, derivatives of x, y and k.
        let derived = select(field - 1u, 2u, field == 0u);
        let change = ratio * load_field(SLOPE + derived);
        store_field(INCREMENTS + field, change + square * load_field(BEND + derived));
        store_field(EARLIER + field, change);
    }
}
