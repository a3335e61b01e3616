// Velocity, tangential redistribution and the new lengths. Twin of src/scheme/redistribution.rs.

/// r k beta of the old state.
var<private> rkb: vec;
/// Tangential velocity at the nodes, and at the nodes before them.
var<private> alpha: vec;
var<private> alpha_before: vec;
/// The old k and x on the window of the block: exchanged together with lengths, used by the systems.
var<private> k_window: Window;
var<private> x_window: Window;
/// New lengths, 1/r and 1/q on the window of the block.
var<private> r_new: Window;
var<private> ir: Window;
var<private> iq: Window;

fn velocity(wk: Window, wr: Window) -> vec {
    let q = (here(wr) + plus1(wr)) * real(0.5);
    let qm = (minus1(wr) + here(wr)) * real(0.5);
    let up = (plus1(wk) - k) / q;
    let down = (k - minus1(wk)) / qm;
    return b(k) - (up - down) / r;
}

/// Fills the variables above; returns the length L of the old state.
fn redistribute() -> real {
    let old = windows(k, r);
    k_window = old.a;
    let beta = velocity(old.a, old.b);
    trace(0u, beta);
    rkb = r * k * beta;
    let sums = ring_sums(vec(block_sum(r), block_sum(rkb), 0.0, 0.0)).all;
    let length = sums.x;
    let mean_rkb = sums.y / length;
    let mean_length = length / real(NODES);
    var growth = -(p.tau * (k * beta));
    if p.redistribution > real(0.5) {
        tangential_velocity(mean_rkb, mean_length);
        let rate = p.omega * (vec(mean_length) / r - vec(1.0)) - vec(mean_rkb);
        growth = p.tau * rate;
    } else {
        alpha = vec(0.0);
        alpha_before = vec(0.0);
    }
    trace(1u, alpha);
    let next = windows(r * exponential(growth), x);
    r_new = next.a;
    x_window = next.b;
    reciprocals();
    return length;
}

/// alpha by a running sum that restarts from the sum of whole blocks.
fn tangential_velocity(mean_rkb: real, mean_length: real) {
    let growth = rkb - r * mean_rkb + p.omega * (vec(mean_length) - r);
    let start = ring_sums(vec(block_sum(growth), 0.0, 0.0, 0.0)).earlier.x;
    let two = growth.x + growth.y;
    let three = two + growth.z;
    alpha = vec(start + growth.x, start + two, start + three, start + (three + growth.w));
    alpha_before = vec(start, alpha.xyz);
    if block == BLOCKS - 1u {
        if is_four { alpha.w = real(0.0); } else { alpha.z = real(0.0); }
    }
}

fn reciprocals() {
    ir = Window(vec(1.0) / r_new.low, vec(1.0) / r_new.high);
    let low = (r_new.low + minus1(r_new)) * real(0.5);
    // The last q would need first+6; no row asks for it.
    let high = (r_new.high + vec(r_new.high.yzw, r_new.high.w)) * real(0.5);
    iq = Window(vec(1.0) / low, vec(1.0) / high);
}
