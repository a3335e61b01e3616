// Tangential redistribution and the new lengths. Twin of crates/flow/src/scheme/redistribution.rs.

/// r k beta of the old state.
var<private> rkb: vec;
/// Tangential velocity at the nodes, and at the nodes before them.
var<private> alpha: vec;
var<private> alpha_before: vec;
/// The curvatures on the window of the block: the old ones, exchanged together with lengths; for the positions the new
/// ones.
var<private> k_window: Window;
/// What is stored of the new lengths on the window of the block.
var<private> r_new: Window;
/// 1/r and 1/q on that window, of the old lengths, then of the new ones.
var<private> ir: Window;
var<private> iq: Window;

/// Fills the variables above, with tangential velocity if `moves`; returns the length L of the old state.
fn redistribute(moves: bool) -> real {
    let k = load_field(curve + 2u);
    let stored = load_field(curve + 3u);
    let r = length_of(stored);
    let old = windows(k, stored);
    k_window = old.a;
    reciprocals(old.b);
    var beta = velocity(k, k_window);
    if FORCED { beta = act(k, r, beta); }
    trace(0u, beta);
    rkb = r * k * beta;
    let sums = ring_sums(vec(block_sum(r), block_sum(rkb), 0.0, 0.0));
    let length = sums.x;
    let mean_rkb = sums.y / length;
    let mean_length = length / real(node_count());
    var growth = -(tau * (k * beta));
    if moves {
        tangential_velocity(r, mean_rkb, mean_length);
        let rate = all_parameters[member].omega * (mean_length * here(ir) - vec(1.0)) - vec(mean_rkb);
        growth = tau * rate;
    } else {
        alpha = vec(0.0);
        alpha_before = vec(0.0);
    }
    trace(1u, alpha);
    r_new = lone_window(grown(stored, growth));
    reciprocals(r_new);
    return length;
}

/// alpha by a running sum that restarts from the sum of whole blocks.
fn tangential_velocity(r: vec, mean_rkb: real, mean_length: real) {
    let growth = rkb - r * mean_rkb + all_parameters[member].omega * (vec(mean_length) - r);
    // Others may still read the last sums.
    workgroupBarrier();
    let start = sum_before(block_sum(growth));
    let two = growth.x + growth.y;
    let three = two + growth.z;
    let running = vec(start + growth.x, start + two, start + three, start + (three + growth.w));
    alpha_before = vec(start, running.xyz);
    alpha = without_last_node(running);
}

/// What is stored of a length that grows by the factor e^growth.
fn grown(stored: vec, growth: vec) -> vec {
    let length = length_of(stored);
    if IS_SHORT { return stored + length * exponential_less_one(growth); }
    return length * exponential(growth) - vec(all_parameters[member].r_offset);
}

/// 1/r and 1/q from one division, 1/(r q), since both are of the same size. In short numbers each by itself: the last q
/// is not right, and neighbours must see the same 1/r, to the last bit.
fn reciprocals(stored: Window) {
    let w = Window(length_of(stored.low), length_of(stored.high));
    let low_q = (w.low + minus1(w)) * real(0.5);
    // No row needs the last q.
    let high_q = (w.high + plus3(w)) * real(0.5);
    if IS_SHORT {
        ir = Window(vec(1.0) / w.low, vec(1.0) / w.high);
        iq = Window(vec(1.0) / low_q, vec(1.0) / high_q);
        return;
    }
    let low = vec(1.0) / (w.low * low_q);
    let high = vec(1.0) / (w.high * high_q);
    ir = Window(low * low_q, high * high_q);
    iq = Window(low * w.low, high * w.high);
}
