// The system for the increments of x and y: the equations of the block. Twin of crates/flow/src/scheme/position.rs.

/// What the stiff terms are weighted by: the bends at the nodes i-1, i and i+1, their differences on the segments i and
/// i+1, phi, or what stands for it where forces act, and the drift.
struct Weights { bend_before: vec, bend: vec, bend_after: vec, rise: vec, rise_after: vec, phi: vec, drift: vec }
var<private> weights: Weights;

fn position_equation() {
    if !CRYSTAL {
        weights = weights_of_paper();
        divide_by_diagonal(row_of_paper());
    }
    settle();
    let old = windows(load_field(curve), load_field(curve + 1u));
    if CRYSTAL {
        let given = directions(old.a, old.b);
        weights = weights_of_crystal(given);
        divide_by_diagonal(row_of_crystal());
        let force = of_polygon(old.a, old.b, given);
        rhs_x = force.x * inverse;
        rhs_y = force.y * inverse;
        return;
    }
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
    let slope = rounded(by.here * here(ir));
    let slope_after = rounded(by.plus1 * plus1(ir));
    let bend_before = rounded((slope - rounded(by.minus1 * minus1(ir))) * weights.bend_before);
    let rise = slope_after - slope;
    let bend = rounded(rise * weights.bend);
    let bend_after = rounded((rounded(by.plus2 * plus2(ir)) - slope_after) * weights.bend_after);
    let stiff = rounded((bend_after - bend) * weights.rise_after) - rounded((bend - bend_before) * weights.rise);
    return stiff + (weights.phi * rise - weights.drift * (by.here + by.plus1));
}

/// Half the length of the segments at a node.
fn dual_length() -> vec { return (length_of(here(r_new)) + length_of(plus1(r_new))) * real(0.5); }

/// φ, or what stands for it where forces act.
fn damped(phi: vec) -> vec {
    if FORCED { return vec(damping); }
    return phi;
}

fn weights_of_paper() -> Weights {
    read_law();
    let wk = k_window;
    let mean_phi = damped(real(0.5) * (phi(here(wk)) + phi(plus1(wk))));
    let drift = real(0.5) * alpha - real(0.75) * (rise_of_square(wk) * here(iq));
    return Weights(minus1(iq), here(iq), plus1(iq), here(ir), plus1(ir), mean_phi, drift);
}

/// The same of a crystal, with `phi = M w k` and the drift `(M ∂w k + ∂(M w k))/2`.
fn weights_of_crystal(given: Directions) -> Weights {
    let wk = k_window;
    let kh = here(wk);
    let kp = plus1(wk);
    let w = given.stiffness * kh;
    let wp = given.stiffness_after * kp;
    let phi_here = given.mobile * (w * kh);
    let phi_after = given.mobile_after * (wp * kp);
    let current = given.there.diffusivity * (wp - w);
    let mean = damped(real(0.5) * (phi_here + phi_after));
    let turned = real(0.5) * ((kh + kp) * current) + (phi_after - phi_here);
    let drift = real(0.5) * (alpha - turned * here(iq));
    return Weights(
        given.before.stiffness * minus1(iq), given.there.stiffness * here(iq), given.after.stiffness * plus1(iq),
        given.mobile * here(ir), given.mobile_after * plus1(ir), mean, drift,
    );
}

/// The entries of rows beside the diagonal.
struct OffDiagonal { a: vec, b: vec, d: vec, e: vec }

fn row_of_paper() -> OffDiagonal {
    let irm = minus1(ir);
    let irh = here(ir);
    let irp = plus1(ir);
    let irpp = plus2(ir);
    let iqm = weights.bend_before;
    let iqh = weights.bend;
    let iqp = weights.bend_after;
    let row_a = irh * iqm * irm;
    let row_e = irp * iqp * irpp;
    let middle = irh * iqh * irp;
    let low = irh * irh * (iqm + iqh);
    let high = irp * irp * (iqh + iqp);
    let row_b = (weights.phi * irh + weights.drift) - (middle + low + row_a);
    let row_d = (weights.phi * irp - weights.drift) - (middle + high + row_e);
    return OffDiagonal(row_a, row_b, row_d, row_e);
}

fn row_of_crystal() -> OffDiagonal {
    let irm = minus1(ir);
    let irh = here(ir);
    let irp = plus1(ir);
    let irpp = plus2(ir);
    let before = weights.bend_before;
    let after = weights.bend_after;
    let s = weights.rise;
    let sp = weights.rise_after;
    let both = weights.bend * (s + sp);
    let row_a = s * irm * before;
    let row_e = sp * irpp * after;
    let row_b = (weights.phi * irh + weights.drift) - (irh * (both + s * before) + row_a);
    let row_d = (weights.phi * irp - weights.drift) - (irp * (both + sp * after) + row_e);
    return OffDiagonal(row_a, row_b, row_d, row_e);
}

fn divide_by_diagonal(row: OffDiagonal) {
    let q = dual_length();
    let rate = real(1.0) / tau;
    let row_c = q * rate - (row.a + row.b + row.d + row.e);
    normalise(row.a, row.b, row_c, row.d, row.e, tau * here(iq));
}
