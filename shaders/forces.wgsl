// The forces on a curve: beta, and b(k) = c1 k + ... + c8 k^8 and phi(k) = k^2 - b(k)/k by Horner's rule without division;
// the density of the energy. Twin of crates/flow/src/scheme/law.rs and crates/flow/src/scheme/forces.rs.

/// The place of the length penalty in the law, after the coefficients.
const LENGTH_PENALTY = 8u;

struct Law { c1: real, c2: real, c3: real, c4: real, c5: real, c6: real, c7: real, c8: real }

/// The coefficients, for the values that follow.
var<private> law: Law;

/// Reads the coefficients, once for k and once for the positions, so that no solve holds them in registers.
fn read_law() {
    let p = &all_parameters[member].law;
    law = Law(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]);
}

fn b(curvature: vec) -> vec {
    return b_over_k(curvature) * curvature;
}

fn phi(curvature: vec) -> vec {
    return curvature * curvature - b_over_k(curvature);
}

fn b_over_k(curvature: vec) -> vec {
    var sum = vec(law.c8);
    sum = sum * curvature + vec(law.c7);
    sum = sum * curvature + vec(law.c6);
    sum = sum * curvature + vec(law.c5);
    sum = sum * curvature + vec(law.c4);
    sum = sum * curvature + vec(law.c3);
    sum = sum * curvature + vec(law.c2);
    return sum * curvature + vec(law.c1);
}

/// beta for the old curvatures, with their window `wk`.
fn velocity(k: vec, wk: Window) -> vec {
    read_law();
    let rise = rises(wk);
    return b(k) - (rise.plus1 * here(iq) - rise.here * minus1(iq)) * here(ir);
}

/// The curvature at the node between two edges: `2 sin(θ/2)` of the angle θ there over half the length of both.
fn bent(before: Edge, after: Edge) -> vec {
    return vertex_turn(before, after) / (real(0.5) * (before.length + after.length));
}

struct Force { x: vec, y: vec }

/// `q (βN + αT)` at the nodes of the old polygon: the second difference of its own curvature and b along the inward
/// normal to the chord between the neighbours, and alpha along the chord.
fn of_polygon(wx: Window, wy: Window) -> Force {
    let x = rises_of_places(wx);
    let y = rises_of_places(wy);
    let e = edge(x.here, y.here);
    let f = edge(x.plus1, y.plus1);
    let own = bent(e, f);
    let rise = own - bent(edge(x.minus1, y.minus1), e);
    let next = bent(f, edge(x.plus2, y.plus2)) - own;
    let along_x = e.x + f.x;
    let along_y = e.y + f.y;
    let inward = real(0.5) * (e.length + f.length) * b(own) - (next / f.length - rise / e.length);
    let across = inward / sqrt(along_x * along_x + along_y * along_y);
    let sliding = real(0.5) * alpha;
    return Force(sliding * along_x - across * along_y, sliding * along_y + across * along_x);
}

/// The energy of a unit of length.
fn energy_density(k: vec) -> vec {
    return real(0.5) * (k * k) + vec(all_parameters[member].law[LENGTH_PENALTY]);
}
