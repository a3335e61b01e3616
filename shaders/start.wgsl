// Where sweeps start: increments predicted from those of the last two solves. Twin of src/scheme/start.rs.

/// After a step of the paper: extrapolates its increments to the next one of the same length, and remembers them in
/// EARLIER.
fn after_step() {
    if !SWEEPS { return; }
    let last_k = dk;
    let last_x = dx;
    let last_y = dy;
    dk = real(2.0) * last_k - load_field(EARLIER);
    dx = real(2.0) * last_x - load_field(EARLIER + 1u);
    dy = real(2.0) * last_y - load_field(EARLIER + 2u);
    store_field(EARLIER, last_k);
    store_field(EARLIER + 1u, last_x);
    store_field(EARLIER + 2u, last_y);
}

/// Puts the start of the first part of a row, of length `first`, by the derivatives at the end of the last step, of
/// length `taken`.
fn begin_row(first: real, taken: real) {
    if !SWEEPS { return; }
    var ratio = taken;
    if !(taken <= real(0.0)) { ratio = first / taken; }
    let first_k = ratio * load_own(SLOPE + 2u);
    let first_x = ratio * load_own(SLOPE);
    let first_y = ratio * load_own(SLOPE + 1u);
    let square = ratio * ratio;
    dk = first_k + square * load_own(BEND + 2u);
    dx = first_x + square * load_own(BEND);
    dy = first_y + square * load_own(BEND + 1u);
    store_field(EARLIER, first_k);
    store_field(EARLIER + 1u, first_x);
    store_field(EARLIER + 2u, first_y);
}
