// The adaptive step: rows of ever more of the paper's steps, extrapolated to order J. Twin of
// crates/flow/src/scheme/extrapolation.rs.

const LEAST_ORDER = 2u;
const SHARED_PARTS = 3u;
/// Weight of an error of the nodes over one of the curvature, both relative.
const NODE_WEIGHT = 20.0;
/// Rounding of a step in short numbers, in units of ε: the least tolerance, and errors that say nothing.
const NOISE = 50.0;
const NOISE_OF_SCALE = 20.0;
/// The same of the curvature of a polygon, towards which a curve may be pulled, in units of `(n/L)²`.
const NOISE_OF_POLYGON = 2.2351741790771484e-9;

/// The parts of a row.
fn divisions(row: u32) -> u32 {
    let beyond = select(0u, max(row, 3u) - 3u, IS_SHORT);
    return row + beyond * (beyond + 1u) / 2u;
}

/// The steps of the paper that a step of order `order` makes.
fn parts(order: u32) -> u32 {
    let beyond = select(0u, max(order, 3u) - 3u, IS_SHORT);
    return order * (order + 1u) / 2u + beyond * (beyond + 1u) * (beyond + 2u) / 6u;
}

/// The weight of `row` in the combination of the rows from `lowest` to `order`.
fn weight(row: u32, lowest: u32, order: u32) -> real {
    let own = real(divisions(row));
    var weight = select(real(0.0), real(1.0), lowest <= row && row <= order);
    for (var other = lowest; other <= order; other++) {
        if other != row { weight = weight * (own / (own - real(divisions(other)))); }
    }
    return weight;
}

/// How much of the change up to the end of a part goes into the curve at the end of the step, its first and second
/// derivative, and the errors of order J-1 and J-2.
struct Shares { value: real, slope: real, bend: real, gap: real, lower_gap: real }

/// The shares of a part of `row`, `left` parts before its end.
fn shares_of(row: u32, left: u32, order: u32) -> Shares {
    let own = real(divisions(row));
    let whole = weight(row, 1u, order);
    let upper = weight(row, LEAST_ORDER, order);
    let square = own * own * upper;
    if left == 1u { return Shares(0.0, -(own * whole), -(square + square), 0.0, 0.0); }
    if left == 2u { return Shares(0.0, 0.0, square, 0.0, 0.0); }
    var lower = real(0.0);
    if order > LEAST_ORDER { lower = weight(row, 1u, order - 1u) - weight(row, LEAST_ORDER, order - 1u); }
    return Shares(whole, own * whole, square, whole - upper, lower);
}

/// Prepares the combinations of an attempt: nothing has changed yet.
fn begin_attempt() {
    for (var field = BEFORE; field < PART; field++) { store_field(field, vec(0.0)); }
    for (var field = GAPS; field < select(NODE_GAPS, STATE_FIELDS, GEOMETRIC); field++) { store_field(field, vec(0.0)); }
}

/// The row to which a part belongs, and the parts of the row after it.
struct Place { row: u32, left: u32 }

fn place_of(part: u32) -> Place {
    var row = 1u;
    while parts(row) <= part { row++; }
    return Place(row, parts(row) - 1u - part);
}

/// Prepares a part of an attempt. The plan is read where it is needed, so that it takes no registers.
fn begin_part(part: u32) {
    let place = place_of(part);
    let count = divisions(place.row);
    tau = plan.length / real(count);
    curve = select(PART, CURVE, place.left + 1u == count);
}

/// Stores the curve at the end of a part, adds it to the combinations, and prepares the solves of the next part.
fn end_part(part: u32) {
    // Others may still read what was exchanged last.
    settle();
    store_fields(PART, here(new_x), here(new_y), new_k, new_r);
    let place = place_of(part);
    if place.left < SHARED_PARTS { add_part(place.left, shares_of(place.row, place.left, plan.order)); }
    if place.left > 0u { after_step(); } else { begin_row(plan.length / real(divisions(place.row + 1u)), plan.taken); }
}

/// Adds the curve at the end of a part, `left` parts before the end of its row.
fn add_part(left: u32, shares: Shares) {
    let change_x = change_from(0u, load_field(CURVE), here(new_x));
    let change_y = change_from(1u, load_field(CURVE + 1u), here(new_y));
    let change_k = change_from(2u, load_field(CURVE + 2u), new_k);
    let change_r = change_from(3u, load_field(CURVE + 3u), new_r);
    add_share(BEND_BEFORE, shares.bend, change_x, change_y, change_k, change_r);
    if left < 2u { add_share(SLOPE_BEFORE, shares.slope, change_x, change_y, change_k, change_r); }
    if left > 0u { return; }
    add_share(BEFORE, shares.value, change_x, change_y, change_k, change_r);
    store_field(GAPS, load_field(GAPS) + shares.gap * change_k);
    store_field(GAPS + 1u, load_field(GAPS + 1u) + shares.gap * change_r);
    store_field(GAPS + 2u, load_field(GAPS + 2u) + shares.lower_gap * change_k);
    store_field(GAPS + 3u, load_field(GAPS + 3u) + shares.lower_gap * change_r);
    if !GEOMETRIC { return; }
    store_field(NODE_GAPS, load_field(NODE_GAPS) + shares.gap * change_x);
    store_field(NODE_GAPS + 1u, load_field(NODE_GAPS + 1u) + shares.gap * change_y);
    store_field(NODE_GAPS + 2u, load_field(NODE_GAPS + 2u) + shares.lower_gap * change_x);
    store_field(NODE_GAPS + 3u, load_field(NODE_GAPS + 3u) + shares.lower_gap * change_y);
}

fn add_share(base: u32, share: real, change_x: vec, change_y: vec, change_k: vec, change_r: vec) {
    store_field(base, load_field(base) + share * change_x);
    store_field(base + 1u, load_field(base + 1u) + share * change_y);
    store_field(base + 2u, load_field(base + 2u) + share * change_k);
    store_field(base + 3u, load_field(base + 3u) + share * change_r);
}

/// Puts the curve at the end of the step into the registers of the new curve.
fn finish_attempt() {
    let x = load_field(CURVE);
    let y = load_field(CURVE + 1u);
    let nodes = windows(advanced(0u, x, load_field(BEFORE)), advanced(1u, y, load_field(BEFORE + 1u)));
    new_x = nodes.a;
    new_y = nodes.b;
    if FORCED { correct(x, y, Moves(load_field(BEFORE), load_field(BEFORE + 1u))); }
    displaced(x, y);
    new_k = advanced(2u, load_field(CURVE + 2u), load_field(BEFORE + 2u));
    new_r = advanced(3u, load_field(CURVE + 3u), load_field(BEFORE + 3u));
}

/// The largest differences between orders, of k and r, of the order of the attempt and of the one below; of x and y, of
/// both orders.
struct LargestGaps { fields: vec, nodes: vec }

fn gaps_of_attempt() -> LargestGaps {
    let ir = vec(1.0) / length_of(new_r);
    let fields = ring_maxima(vec(
        block_max(bounded_abs(load_field(GAPS))), block_max(bounded_abs(load_field(GAPS + 1u) * ir)),
        block_max(bounded_abs(load_field(GAPS + 2u))), block_max(bounded_abs(load_field(GAPS + 3u) * ir)),
    ));
    if !GEOMETRIC { return LargestGaps(fields, vec(0.0)); }
    settle();
    var nodes = vec();
    if IS_SHORT {
        let count = real(max(owns, 1u));
        let means = bounded_abs(vec(
            block_sum(load_field(NODE_GAPS)), block_sum(load_field(NODE_GAPS + 1u)),
            block_sum(load_field(NODE_GAPS + 2u)), block_sum(load_field(NODE_GAPS + 3u)),
        ) / count);
        nodes = vec(max(means.x, means.y), max(means.z, means.w), 0.0, 0.0);
    } else {
        let own = max(bounded_abs(load_field(NODE_GAPS)), bounded_abs(load_field(NODE_GAPS + 1u)));
        let lower = max(bounded_abs(load_field(NODE_GAPS + 2u)), bounded_abs(load_field(NODE_GAPS + 3u)));
        nodes = vec(block_max(own), block_max(lower), 0.0, 0.0);
    }
    return LargestGaps(fields, ring_maxima(nodes));
}

/// The tolerance of a step whose solves are refined, or the rounding of its parts if that is larger.
fn tolerance() -> real {
    return max(all_parameters[member].adaptive, real(NOISE * EPSILON));
}

/// The errors of order J-1 and J-2, of the new curve, which is observed.
fn errors_of_attempt(largest: LargestGaps) -> vec2<real> {
    let m = largest.fields;
    let size = max(others.x, others.y);
    let spread = min(others.x + others.y, size);
    var scale = select(sqrt(size * spread), size, all_reports[member].report.now.excess <= all_parameters[member].follow_to);
    // Errors below the rounding of k and of the nodes, which does not know how round the curve is, say nothing.
    if IS_SHORT {
        var noise = size * real(NOISE_OF_SCALE * EPSILON);
        if all_parameters[member].pull > real(0.0) {
            let edge = sums.x / real(node_count());
            noise += real(NOISE_OF_POLYGON) / (edge * edge);
        }
        scale = max(scale, noise / tolerance());
    }
    let relative = bounded_abs(m / scale);
    let errors = vec2(max(relative.x, m.y), max(relative.z, m.w));
    if !GEOMETRIC { return errors; }
    let unit = sums.x * (scale / size) * real(HALF_OVER_PI / NODE_WEIGHT);
    return max(errors, bounded_abs(largest.nodes / unit).xy);
}

/// Makes what an accepted attempt has combined the state of the member.
fn keep_attempt() {
    for (var field = 0u; field < 8u; field++) {
        let kept = load_field(SLOPE + field);
        store_field(SLOPE + field, load_field(SLOPE_BEFORE + field));
        store_field(SLOPE_BEFORE + field, kept);
    }
    copy_curve(BEFORE, CURVE);
    keep_step();
}
