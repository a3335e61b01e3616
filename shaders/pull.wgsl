// The turn of the polygon, and the pull of k and r towards it. Twin of crates/flow/src/scheme/pull.rs.

/// The turn of the polygon at both ends of a segment together, the length over which it turns, and the segment's own.
struct Turn { angle: vec, span: vec, edge: vec }

fn turn(wx: Window, wy: Window) -> Turn {
    let x = rises_of_places(wx);
    let y = rises_of_places(wy);
    let before = edge(x.minus1, y.minus1);
    let own = edge(x.here, y.here);
    let after = edge(x.plus1, y.plus1);
    let span = real(0.5) * before.length + own.length + real(0.5) * after.length;
    return Turn(vertex_turn(before, own) + vertex_turn(own, after), span, own.length);
}

/// Pulls the new curvatures and lengths of a step.
fn pull() {
    let rate = all_parameters[member].pull * tau;
    let share = rate / (real(1.0) + rate);
    let turned = turn(new_x, new_y);
    new_k += share * (turned.angle / turned.span - new_k);
    new_r += share * ((turned.edge - vec(all_parameters[member].r_offset)) - new_r);
}
