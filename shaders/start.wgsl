// Where sweeps start: increments predicted from those of the last two solves. Twin of src/scheme/start.rs.

fn start_after_step() { start_put(2.0, -1.0, 1.0, 0.0); }

/// Puts `a` times the increments plus `b` times the remembered ones into the increments, and `c`, `d` times into the
/// remembered ones, which are in EARLIER.
fn start_put(a: real, b: real, c: real, d: real) {
    if !SWEEPS { return; }
    let last_k = dk;
    let last_x = dx;
    let last_y = dy;
    let before_k = load_field(EARLIER);
    let before_x = load_field(EARLIER + 1u);
    let before_y = load_field(EARLIER + 2u);
    dk = a * last_k + b * before_k;
    dx = a * last_x + b * before_x;
    dy = a * last_y + b * before_y;
    store_field(EARLIER, c * last_k + d * before_k);
    store_field(EARLIER + 1u, c * last_x + d * before_x);
    store_field(EARLIER + 2u, c * last_y + d * before_y);
}

/// Puts the start of the first part of a row, of length tau, by the derivatives at the end of the last step.
fn begin_row(tau: real) {
    if !SWEEPS { return; }
    let taken = report.progress.taken;
    var ratio = taken;
    if !(taken <= real(0.0)) { ratio = tau / taken; }
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
