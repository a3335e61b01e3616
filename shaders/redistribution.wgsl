// Velocity, tangential redistribution and the new lengths. Twin of src/scheme/redistribution.rs.

/// r k beta of the old state.
var<private> rkb: vec;
/// Tangential velocity at the nodes, and at the nodes before them.
var<private> alpha: vec;
var<private> alpha_before: vec;
/// New lengths on the window of the block.
var<private> r_new: Window;
/// 1/r and 1/q there, of the old lengths, then of the new ones.
var<private> ir: Window;
var<private> iq: Window;

fn velocity(wk: Window) -> vec {
    return b(k) - ((plus1(wk) - k) * here(iq) - (k - minus1(wk)) * minus1(iq)) * here(ir);
}

/// Fills the variables above; returns the length L of the old state.
fn redistribute() -> real {
    share(k, r);
    reciprocals(read_b());
    let beta = velocity(read_a());
    trace(0u, beta);
    rkb = r * k * beta;
    var unused = vec(0.0);
    let sums = ring_sums(vec(block_sum(r), block_sum(rkb), 0.0, 0.0), &unused);
    let length = sums.x;
    let mean_rkb = sums.y / length;
    let mean_length = length / real(NODES);
    var next: vec;
    if p.redistribution > real(0.5) {
        tangential_velocity(mean_rkb, mean_length);
        let rate = p.omega * (mean_length * here(ir) - vec(1.0)) - vec(mean_rkb);
        next = r * exponential(p.tau * rate);
    } else {
        alpha = vec(0.0);
        alpha_before = vec(0.0);
        next = r * exponential(-(p.tau * (k * beta)));
    }
    trace(1u, alpha);
    share(next, next);
    r_new = read_a();
    reciprocals(r_new);
    return length;
}

/// alpha by a running sum that restarts from the sum of whole blocks.
fn tangential_velocity(mean_rkb: real, mean_length: real) {
    let growth = rkb - r * mean_rkb + p.omega * (vec(mean_length) - r);
    var earlier = vec(0.0);
    ring_sums(vec(block_sum(growth), 0.0, 0.0, 0.0), &earlier);
    let before = earlier.x;
    let two = growth.x + growth.y;
    let three = two + growth.z;
    alpha = vec(before + growth.x, before + two, before + three, before + (three + growth.w));
    alpha_before = vec(before, alpha.xyz);
    if lane == BLOCKS - 1u {
        if owns == 4u { alpha.w = real(0.0); } else { alpha.z = real(0.0); }
    }
}

/// 1/r and 1/q from one division: of the two, which are of one size, 1/(r q).
fn reciprocals(w: Window) {
    let low_q = (w.low + minus1(w)) * real(0.5);
    // The last q would need first+6; no row asks for it, and its r serves as well.
    let high_q = (w.high + vec(w.high.yzw, w.high.w)) * real(0.5);
    let low = vec(1.0) / (w.low * low_q);
    let high = vec(1.0) / (w.high * high_q);
    ir = Window(low * low_q, high * high_q);
    iq = Window(low * w.low, high * w.high);
}
