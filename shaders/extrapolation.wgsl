// The adaptive step: one step of the paper's scheme compared with two half steps. Twin of src/scheme/extrapolation.rs.

/// Prepares part 0, 1 or 2 of an attempt of length h: the whole step, the first half, the second half.
fn begin_part(part: u32, h: real) {
    p.tau = select(real(0.5) * h, h, part == 0u);
    load_curve(select(CURVE, BEFORE, part == 2u));
}

/// Stores the result of a part: the whole step in MIDDLE, the first half in BEFORE, the second half in registers.
fn end_part(part: u32) {
    if part == 2u { return; }
    store_fields(select(BEFORE, MIDDLE, part == 0u), here(new_x), here(new_y), new_k, new_r);
    start_after_part(part);
}

/// The difference between the whole step and the two half steps.
fn error_of_attempt() -> real {
    storageBarrier();
    let gap_k = bounded_abs(new_k - load_field(MIDDLE + 2u));
    let gap_r = bounded_abs(new_r / load_field(MIDDLE + 3u) - vec(1.0));
    let m = ring_maxima(vec(block_max(gap_k), block_max(gap_r), block_max_signed(new_k), block_max_signed(-new_k)));
    let size = max(m.z, m.w);
    let spread = min(m.z + m.w, size);
    let scale = select(sqrt(size * spread), size, report.now.excess <= p.follow_to);
    return max(bounded_abs(vec(m.x / scale)).x, m.y);
}

/// Puts the extrapolated curve into the registers of the new curve and the curve in the middle of the step into MIDDLE.
fn extrapolate() {
    let gap_x = here(new_x) - load_field(MIDDLE);
    let gap_y = here(new_y) - load_field(MIDDLE + 1u);
    let gap_k = new_k - load_field(MIDDLE + 2u);
    let whole_r = load_field(MIDDLE + 3u);
    let gap_r = new_r - whole_r;
    let middle_x = load_field(BEFORE) + real(0.5) * gap_x;
    let middle_y = load_field(BEFORE + 1u) + real(0.5) * gap_y;
    let middle_k = load_field(BEFORE + 2u) + real(0.5) * gap_k;
    let middle_r = load_field(BEFORE + 3u) + real(0.5) * gap_r;
    storageBarrier();
    store_fields(MIDDLE, middle_x, middle_y, middle_k, middle_r);
    new_k = new_k + gap_k;
    new_r = new_r * new_r / whole_r;
    let moved = windows(here(new_x) + gap_x, here(new_y) + gap_y);
    new_x = moved.a;
    new_y = moved.b;
}

/// A quantity at the fraction `at` of a step, on the parabola through its values `start`, `middle` and `end`.
fn inside(start: real, middle: real, end: real, at: real) -> real {
    let slope = real(4.0) * middle - real(3.0) * start - end;
    let bend = real(2.0) * (start - real(2.0) * middle + end);
    return start + at * (slope + at * bend);
}

/// The fraction of a step at which a quantity that goes from `start` over `middle` to `end` first falls to `at`.
fn crossing(start: real, middle: real, end: real, at: real) -> real {
    let above = start - at;
    let slope = real(4.0) * middle - real(3.0) * start - end;
    let bend = real(2.0) * (start - real(2.0) * middle + end);
    let discriminant = slope * slope - real(4.0) * bend * above;
    let root = real(2.0) * above / (sqrt(max(discriminant, real(0.0))) - slope);
    let straight = above / (start - end);
    return select(straight, root, real(0.0) <= discriminant && real(0.0) <= root && root <= real(1.0));
}
