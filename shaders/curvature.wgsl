// The system for the increment of k: the equations of the block. Twin of crates/flow/src/scheme/curvature.rs.

fn curvature_equation() {
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
    let row_c = (here(r_new) * rate - rkb) - (row_a + row_b + row_d + row_e);
    let bk = b(k);
    let forcing = (b(plus1(wk)) - bk) * iqh - (bk - b(minus1(wk))) * iqm;
    let stiff = row_a * (minus2(wk) - k) + row_b * (minus1(wk) - k) + row_d * (plus1(wk) - k) + row_e * (plus2(wk) - k);
    normalise(row_a, row_b, row_c, row_d, row_e, tau * irh);
    rhs_x = (forcing + rkb * k - stiff) * inverse;
}
