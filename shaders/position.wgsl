// The system for the increments of x and y: the equations of the block. Twin of crates/flow/src/scheme/position.rs.

fn position_equation() {
    if CRYSTAL {
        position_of_crystal();
        return;
    }
    read_law();
    let wk = k_window;
    let kh = here(wk);
    let kp = plus1(wk);
    let irm = minus1(ir);
    let irh = here(ir);
    let irp = plus1(ir);
    let irpp = plus2(ir);
    let iqm = minus1(iq);
    let iqh = here(iq);
    let iqp = plus1(iq);
    let row_a = irh * iqm * irm;
    let row_e = irp * iqp * irpp;
    let middle = irh * iqh * irp;
    let low = irh * irh * (iqm + iqh);
    let high = irp * irp * (iqh + iqp);
    let mean_phi = damped(real(0.5) * (phi(kh) + phi(kp)));
    let drift = real(0.5) * alpha - real(0.75) * (rise_of_square(wk) * iqh);
    let row_b = (mean_phi * irh + drift) - (middle + low + row_a);
    let row_d = (mean_phi * irp - drift) - (middle + high + row_e);
    let q = dual_length();
    let rate = real(1.0) / tau;
    let row_c = q * rate - (row_a + row_b + row_d + row_e);
    normalise(row_a, row_b, row_c, row_d, row_e, tau * iqh);
    settle();
    let old = windows(load_field(curve), load_field(curve + 1u));
    if GEOMETRIC {
        let force = of_polygon(old.a, old.b, Directions());
        rhs_x = force.x * inverse;
        rhs_y = force.y * inverse;
        return;
    }
    rhs_x = -stiff_position(rises_of_places(old.a)) * inverse;
    rhs_y = -stiff_position(rises_of_places(old.b)) * inverse;
}

/// The rows times an unknown of these windows.
fn position_applied(w: Window) -> vec {
    let q = dual_length();
    return q * (real(1.0) / tau) * here(w) + stiff_position(rises(w));
}

/// The part of that in which an unknown is seen by its differences, as differences of its second derivative.
fn stiff_position(by: Rises) -> vec {
    let wk = k_window;
    let irh = here(ir);
    let irp = plus1(ir);
    let iqh = here(iq);
    let slope = rounded(by.here * irh);
    let slope_after = rounded(by.plus1 * irp);
    let bend_before = rounded((slope - rounded(by.minus1 * minus1(ir))) * minus1(iq));
    let rise = slope_after - slope;
    let bend = rounded(rise * iqh);
    let bend_after = rounded((rounded(by.plus2 * plus2(ir)) - slope_after) * plus1(iq));
    let stiff = rounded((bend_after - bend) * irp) - rounded((bend - bend_before) * irh);
    let mean_phi = damped(real(0.5) * (phi(here(wk)) + phi(plus1(wk))));
    let drift = real(0.5) * alpha - real(0.75) * (rise_of_square(wk) * iqh);
    return stiff + (mean_phi * rise - drift * (by.here + by.plus1));
}

/// Half the length of the segments at a node.
fn dual_length() -> vec { return (length_of(here(r_new)) + length_of(plus1(r_new))) * real(0.5); }

/// φ, or what stands for it where forces act.
fn damped(phi: vec) -> vec {
    if FORCED { return vec(damping); }
    return phi;
}

/// The equations of a crystal, with `phi = M w k` and the drift `(M ∂w k + ∂(M w k))/2`.
fn position_of_crystal() {
    settle();
    let old = windows(load_field(curve), load_field(curve + 1u));
    let given = directions(old.a, old.b);
    let wk = k_window;
    let kh = here(wk);
    let kp = plus1(wk);
    let irm = minus1(ir);
    let irh = here(ir);
    let irp = plus1(ir);
    let irpp = plus2(ir);
    let before = given.before.stiffness * minus1(iq);
    let at = given.there.stiffness * here(iq);
    let after = given.after.stiffness * plus1(iq);
    let w = given.stiffness * kh;
    let wp = given.stiffness_after * kp;
    let s = given.mobile * irh;
    let sp = given.mobile_after * irp;
    let phi_here = given.mobile * (w * kh);
    let phi_after = given.mobile_after * (wp * kp);
    let current = given.there.diffusivity * (wp - w);
    let mean = damped(real(0.5) * (phi_here + phi_after));
    let turned = real(0.5) * ((kh + kp) * current) + (phi_after - phi_here);
    let drift = real(0.5) * (alpha - turned * here(iq));
    let both = at * (s + sp);
    let row_a = s * irm * before;
    let row_e = sp * irpp * after;
    let row_b = (mean * irh + drift) - (irh * (both + s * before) + row_a);
    let row_d = (mean * irp - drift) - (irp * (both + sp * after) + row_e);
    let q = dual_length();
    let rate = real(1.0) / tau;
    let row_c = q * rate - (row_a + row_b + row_d + row_e);
    normalise(row_a, row_b, row_c, row_d, row_e, tau * here(iq));
    let force = of_polygon(old.a, old.b, given);
    rhs_x = force.x * inverse;
    rhs_y = force.y * inverse;
}
