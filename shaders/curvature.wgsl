// The system for the increment of k: the equations of the block. Twin of crates/flow/src/scheme/curvature.rs.

fn curvature_equation() {
    if CRYSTAL {
        curvature_of_crystal();
        return;
    }
    let wk = k_window;
    let k = here(wk);
    let irm = minus1(ir);
    let irh = here(ir);
    let irp = plus1(ir);
    let iqmm = minus2(iq);
    let iqm = minus1(iq);
    let iqh = here(iq);
    let iqp = plus1(iq);
    let row_a = iqm * irm * iqmm;
    let row_e = iqh * irp * iqp;
    let middle = irh * iqh * iqm;
    let low = iqm * iqm * (irh + irm);
    let high = iqh * iqh * (irh + irp);
    let row_b = real(0.5) * alpha_before - (middle + low + row_a);
    let row_d = -(real(0.5) * alpha) - (middle + high + row_e);
    let rate = real(1.0) / tau;
    let row_c = (length_of(here(r_new)) * rate - rkb) - (row_a + row_b + row_d + row_e);
    let rise = rises(Window(b(wk.low), b(wk.high)));
    let forcing = rise.plus1 * iqh - rise.here * iqm;
    normalise(row_a, row_b, row_c, row_d, row_e, tau * irh);
    let by = rises(wk);
    rhs_x = (forcing + rkb * k - stiff_curvature(by, by)) * inverse;
}

/// The rows times an unknown of these windows.
fn curvature_applied(w: Window) -> vec {
    let by = rises(w);
    var weighted_by = by;
    if CRYSTAL { weighted_by = weighted_rises(w); }
    return (length_of(here(r_new)) * (real(1.0) / tau) - rkb) * here(w) + stiff_curvature(by, weighted_by);
}

/// The part of that in which an unknown u is seen by its differences, as differences of the second derivative of w; w
/// is u, of a crystal g u.
fn stiff_curvature(by: Rises, weighted_by: Rises) -> vec {
    let iqm = minus1(iq);
    let iqh = here(iq);
    let through = conductance();
    let first = rounded(weighted_by.here * through.minus1);
    let second = rounded(weighted_by.plus1 * through.here);
    let bend_before = rounded((first - rounded(weighted_by.minus1 * through.minus2)) * minus1(ir));
    let bend = rounded((second - first) * here(ir));
    let bend_after = rounded((rounded(weighted_by.plus2 * through.plus1) - second) * plus1(ir));
    let own = rounded((bend - bend_before) * iqm);
    let next = rounded((bend_after - bend) * iqh);
    let advection = real(0.5) * (alpha_before * by.here + alpha * by.plus1);
    return (next - own) - advection;
}

/// The rises of g u.
fn weighted_rises(w: Window) -> Rises {
    return rises(Window(rounded(stiffness.low * w.low), rounded(stiffness.high * w.high)));
}

/// The equations of a crystal: the stiff terms are those of w = g k, with M at the nodes.
fn curvature_of_crystal() {
    let k = here(k_window);
    let through = conductance();
    let irm = minus1(ir);
    let irh = here(ir);
    let irp = plus1(ir);
    let iqm = minus1(iq);
    let iqh = here(iq);
    let before = real(0.5) * alpha_before;
    let after = real(0.5) * alpha;
    let row_a = iqm * irm * through.minus2;
    let row_e = iqh * irp * through.plus1;
    let row_b = -(through.minus1 * (irh * iqh + iqm * (irh + irm)) + row_a);
    let row_d = -(through.here * (irh * iqm + iqh * (irh + irp)) + row_e);
    let stiff = stiff_curvature(rises(k_window), rises(weighted));
    let rate = real(1.0) / tau;
    let row_c = (length_of(here(r_new)) * rate - rkb) - (before - after) - (row_a + row_b + row_d + row_e) * here(stiffness);
    let rhs = rkb * k - stiff;
    normalise(
        row_a * minus2(stiffness), row_b * minus1(stiffness) + before, row_c, row_d * plus1(stiffness) - after,
        row_e * plus2(stiffness), tau * irh,
    );
    rhs_x = rhs * inverse;
}
