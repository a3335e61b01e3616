// Where sweeps start: increments predicted from those of the last two solves. Twin of src/scheme/start.rs.

fn start_nowhere() {
    dk = vec(0.0);
    dx = vec(0.0);
    dy = vec(0.0);
    if !SWEEPS { return; }
    store_field(EARLIER, dk);
    store_field(EARLIER + 1u, dx);
    store_field(EARLIER + 2u, dy);
}

fn start_after_fixed() { start_put(2.0, -1.0, 1.0, 0.0); }

/// `ratio`: the next whole step over half the one before.
fn start_after_taken(ratio: real) { start_put(ratio * (real(1.0) + ratio), -(ratio * ratio), ratio, 0.0); }

fn start_after_refused(ratio: real) {
    let from_end = ratio - real(2.0);
    start_put(ratio * (real(1.0) + from_end), -(ratio * from_end), -ratio, real(2.0) * ratio);
}

/// After the whole step (part 0) and after the first half.
fn start_after_part(part: u32) {
    start_put(select(real(0.0), real(0.25), part == 0u), select(real(0.5), real(0.25), part == 0u), 1.0, 0.0);
}

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
