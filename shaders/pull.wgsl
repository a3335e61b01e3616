// The turn of the polygon, and the pull of k and r towards it. Twin of crates/flow/src/scheme/pull.rs.

/// The turn of the polygon at both ends of a segment together, the length over which it turns, and the segment's own.
struct Turn { angle: vec, span: vec, edge: vec }

fn turn(wx: Window, wy: Window) -> Turn {
    // Edges that end at nodes i-1, i, i+1.
    let dx = minus1(wx) - minus2(wx);
    let dy = minus1(wy) - minus2(wy);
    let ex = here(wx) - minus1(wx);
    let ey = here(wy) - minus1(wy);
    let fx = plus1(wx) - here(wx);
    let fy = plus1(wy) - here(wy);
    let d = sqrt(dx * dx + dy * dy);
    let e = sqrt(ex * ex + ey * ey);
    let f = sqrt(fx * fx + fy * fy);
    let before = twice_sin_atan((dx * ey - dy * ex) / (d * e + (dx * ex + dy * ey)));
    let after = twice_sin_atan((ex * fy - ey * fx) / (e * f + (ex * fx + ey * fy)));
    return Turn(before + after, real(0.5) * d + e + real(0.5) * f, e);
}

/// Pulls the new curvatures and lengths of a step.
fn pull() {
    let rate = all_parameters[member].pull * tau;
    let share = real(1.0) / (real(1.0) + rate);
    let turned = turn(new_x, new_y);
    new_k = (new_k + rate * (turned.angle / turned.span)) * share;
    new_r = (new_r + rate * turned.edge) * share;
}
