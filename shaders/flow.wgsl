// The law b(k) = c1 k + ... + c8 k^8 and phi(k) = k^2 - b(k)/k, by Horner's rule without division. Twin of
// crates/flow/src/scheme/flow.rs.

struct Law { c1: real, c2: real, c3: real, c4: real, c5: real, c6: real, c7: real, c8: real }

/// The coefficients, for the values that follow.
var<private> law: Law;

/// Reads the coefficients, once for k and once for the positions, so that no solve holds them in registers.
fn read_law() {
    let p = &all_parameters[member];
    law = Law(p.c1, p.c2, p.c3, p.c4, p.c5, p.c6, p.c7, p.c8);
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
