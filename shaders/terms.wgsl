// What multigrid needs from the two systems: rho u + u'''' + p u'' + w u'. Twin of crates/flow/src/scheme/terms.rs.

/// Distance to the next node, length of the cell, rho, p and w for the nodes of the block.
var<private> term_spacing: vec;
var<private> term_cell: vec;
var<private> term_mass: vec;
var<private> term_second: vec;
var<private> term_first: vec;

fn curvature_terms() {
    let rate = real(1.0) / tau;
    let r_here = here(r_new);
    term_spacing = (r_here + plus1(r_new)) * real(0.5);
    term_cell = r_here;
    term_mass = vec(rate) - rkb * here(ir);
    term_second = vec(0.0);
    term_first = -(real(0.5) * (alpha_before + alpha));
}

/// `wk`: the new curvatures.
fn position_terms(wk: Window) {
    let rate = real(1.0) / tau;
    let kh = here(wk);
    let kp = plus1(wk);
    let rp = plus1(r_new);
    term_spacing = rp;
    term_cell = (here(r_new) + rp) * real(0.5);
    term_mass = vec(rate);
    term_second = real(0.5) * (phi(kh) + phi(kp));
    term_first = real(1.5) * ((kp * kp - kh * kh) * here(iq)) - alpha;
}
