// The law b(k) = c1 k + ... + c8 k^8 and phi(k) = k^2 - b(k)/k, by Horner's rule without division. Twin of
// src/scheme/flow.rs.

fn b(curvature: vec) -> vec {
    return b_over_k(curvature) * curvature;
}

fn phi(curvature: vec) -> vec {
    return curvature * curvature - b_over_k(curvature);
}

fn b_over_k(curvature: vec) -> vec {
    var sum = vec(p.c8);
    sum = sum * curvature + vec(p.c7);
    sum = sum * curvature + vec(p.c6);
    sum = sum * curvature + vec(p.c5);
    sum = sum * curvature + vec(p.c4);
    sum = sum * curvature + vec(p.c3);
    sum = sum * curvature + vec(p.c2);
    return sum * curvature + vec(p.c1);
}
