// The forces on a curve: beta, and b(k) = c1 k + ... + c8 k^8 and phi(k) = k^2 - b(k)/k by Horner's rule without
// division; the density of the energy; g = gamma + gamma'' and M of a crystal by powers of the tangent. Twin of
// crates/flow/src/scheme/law.rs and crates/flow/src/scheme/forces.rs.

/// The place of the length penalty in the law, after the coefficients.
const LENGTH_PENALTY = 8u;
/// The places of the waves of a crystal: of its energy, and of its mobility; their number, and the numbers of one.
const ENERGY_WAVES = 9u;
const DIFFUSIVITY_WAVES = 15u;
const MOST_WAVES = 2u;
const WAVE = 3u;
/// The place of the factor by which its surface energy is reported.
const ENERGY_UNIT = 21u;

struct Law { c1: real, c2: real, c3: real, c4: real, c5: real, c6: real, c7: real, c8: real }

/// The coefficients, for the values that follow.
var<private> law: Law;

/// lambda, which is added to c1 where the length is kept.
var<private> multiplier: real;

/// Reads the coefficients, once for k and once for the positions, so that no solve holds them in registers.
fn read_law() {
    let p = &all_parameters[member].law;
    law = Law(select(p[0], p[0] + multiplier, FORCED), p[1], p[2], p[3], p[4], p[5], p[6], p[7]);
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

/// Complex numbers.
struct Complex { x: vec, y: vec }

/// What gamma + gamma'' and M are on segments, in the direction of their unit tangents, less 1; and the powers that
/// they come from.
struct Directed {
    stiffness: vec,
    diffusivity: vec,
    energy_powers: array<Complex, MOST_WAVES>,
    diffusivity_powers: array<Complex, MOST_WAVES>,
}

/// The same at the nodes between two segments.
struct Between { stiffness: vec, diffusivity: vec }

/// m of a wave of the function whose waves begin at `place`; 0: there is none.
fn mode_of(place: u32, wave: u32) -> u32 {
    return u32(all_parameters[member].law[place + wave * WAVE]);
}

fn directed(tangent: Complex) -> Directed {
    var all = Directed();
    for (var i = 0u; i < MOST_WAVES; i++) {
        let mode = mode_of(ENERGY_WAVES, i);
        if mode != 0u {
            let z = power(tangent, mode);
            all.energy_powers[i] = z;
            all.stiffness += stiffening(mode) * part(ENERGY_WAVES, i, z);
        }
        let other = mode_of(DIFFUSIVITY_WAVES, i);
        if other != 0u {
            let z = power(tangent, other);
            all.diffusivity_powers[i] = z;
            all.diffusivity += part(DIFFUSIVITY_WAVES, i, z);
        }
    }
    return all;
}

/// gamma + gamma'' and M in the direction that halves the angle between two tangents.
fn between(earlier: Directed, later: Directed) -> Between {
    // Parameters can only be indexed by constants.
    var ahead = earlier;
    var behind = later;
    var all = Between(vec(1.0), vec(1.0));
    for (var i = 0u; i < MOST_WAVES; i++) {
        let mode = mode_of(ENERGY_WAVES, i);
        if mode != 0u {
            let z = halfway(ahead.energy_powers[i], behind.energy_powers[i]);
            all.stiffness += stiffening(mode) * part(ENERGY_WAVES, i, z);
        }
        if mode_of(DIFFUSIVITY_WAVES, i) != 0u {
            let z = halfway(ahead.diffusivity_powers[i], behind.diffusivity_powers[i]);
            all.diffusivity += part(DIFFUSIVITY_WAVES, i, z);
        }
    }
    return all;
}

/// gamma, gamma' and gamma + gamma'' in the direction of unit tangents.
struct Tension { energy: vec, turned: vec, stiffness: vec }

fn tension(tangent: Complex) -> Tension {
    var all = Tension(vec(1.0), vec(0.0), vec(1.0));
    for (var i = 0u; i < MOST_WAVES; i++) {
        let mode = mode_of(ENERGY_WAVES, i);
        if mode != 0u {
            let z = power(tangent, mode);
            let at = ENERGY_WAVES + i * WAVE;
            let a = all_parameters[member].law[at + 1u];
            let b = all_parameters[member].law[at + 2u];
            let wave = part(ENERGY_WAVES, i, z);
            all.energy += wave;
            all.turned += real(mode) * (b * z.x - a * z.y);
            all.stiffness += stiffening(mode) * wave;
        }
    }
    return all;
}

/// `1 - m^2`, the factor of a wave in gamma + gamma''.
fn stiffening(mode: u32) -> real {
    let m = real(mode);
    return real(1.0) - m * m;
}

/// `a Re z + b Im z`.
fn part(place: u32, wave: u32, z: Complex) -> vec {
    let at = place + wave * WAVE;
    return all_parameters[member].law[at + 1u] * z.x + all_parameters[member].law[at + 2u] * z.y;
}

/// `z^m` of complex numbers, m >= 1, by squaring.
fn power(z: Complex, mode: u32) -> Complex {
    var re = z.x;
    var im = z.y;
    var bit = firstLeadingBit(mode);
    while bit > 0u {
        bit -= 1u;
        let twice = re * im;
        re = (re - im) * (re + im);
        im = twice + twice;
        if ((mode >> bit) & 1u) != 0u {
            let next = re * z.x - im * z.y;
            im = re * z.y + im * z.x;
            re = next;
        }
    }
    return Complex(re, im);
}

/// The unit numbers halfway between two, along the circle.
fn halfway(a: Complex, b: Complex) -> Complex {
    let dx = b.x - a.x;
    let dy = b.y - a.y;
    let share = real(0.5) + real(0.0625) * (dx * dx + dy * dy);
    return Complex(share * (a.x + b.x), share * (a.y + b.y));
}

/// The unit tangents of edges.
fn tangent_of(given: Edge) -> Complex {
    let inverse = vec(1.0) / given.length;
    return Complex(given.x * inverse, given.y * inverse);
}

/// g and w = g k on the segments of the old polygon, and M at its nodes, for the curvatures of a crystal.
var<private> stiffness: Window;
var<private> weighted: Window;
var<private> mobile_there: Window;

fn fill_directions(k: vec) {
    settle();
    let old = windows(load_field(curve), load_field(curve + 1u));
    let x = rises_of_places(old.a);
    let y = rises_of_places(old.b);
    let own = directed(tangent_of(edge(x.here, y.here)));
    let there = between(own, directed(tangent_of(edge(x.plus1, y.plus1))));
    let g = vec(1.0) + own.stiffness;
    settle();
    let exchanged = windows(g, g * k);
    stiffness = exchanged.a;
    weighted = exchanged.b;
    settle();
    mobile_there = lone_window(there.diffusivity);
}

/// beta for the old curvatures, with their window `wk`.
fn velocity(k: vec, wk: Window) -> vec {
    if CRYSTAL {
        fill_directions(k);
        let through = conductance();
        let rise = rises(weighted);
        return (rise.here * through.minus1 - rise.plus1 * through.here) * here(ir);
    }
    read_law();
    let rise = rises(wk);
    return b(k) - (rise.plus1 * here(iq) - rise.here * minus1(iq)) * here(ir);
}

/// M/q at the nodes i-2 ... i+1, with M = 1 but for a crystal.
struct Conductance { minus2: vec, minus1: vec, here: vec, plus1: vec }

fn conductance() -> Conductance {
    if !CRYSTAL { return Conductance(minus2(iq), minus1(iq), here(iq), plus1(iq)); }
    return Conductance(
        minus2(mobile_there) * minus2(iq), minus1(mobile_there) * minus1(iq), here(mobile_there) * here(iq),
        plus1(mobile_there) * plus1(iq),
    );
}

/// What the position equation of a crystal needs: g and M on the segments i and i+1, at the nodes i-1, i and i+1.
struct Directions {
    stiffness: vec, stiffness_after: vec, mobile: vec, mobile_after: vec,
    before: Between, there: Between, after: Between,
}

fn directions(wx: Window, wy: Window) -> Directions {
    let x = rises_of_places(wx);
    let y = rises_of_places(wy);
    let before = directed(tangent_of(edge(x.minus1, y.minus1)));
    let own = directed(tangent_of(edge(x.here, y.here)));
    let next = directed(tangent_of(edge(x.plus1, y.plus1)));
    let last = directed(tangent_of(edge(x.plus2, y.plus2)));
    return Directions(
        vec(1.0) + own.stiffness, vec(1.0) + next.stiffness, vec(1.0) + own.diffusivity, vec(1.0) + next.diffusivity,
        between(before, own), between(own, next), between(next, last),
    );
}

/// The curvature at the node between two edges: `2 sin(θ/2)` of the angle θ there over half the length of both.
fn bent(before: Edge, after: Edge) -> vec {
    return rounded(vertex_turn(before, after) / (real(0.5) * (before.length + after.length)));
}

struct Force { x: vec, y: vec }

/// `q (βN + αT)` at the nodes of the old polygon: the second difference of its own curvature and b along the inward
/// normal to the chord between the neighbours, and alpha along the chord. Of a crystal, g times that curvature, and M.
fn of_polygon(wx: Window, wy: Window, given: Directions) -> Force {
    let x = rises_of_places(wx);
    let y = rises_of_places(wy);
    let e = edge(x.here, y.here);
    let f = edge(x.plus1, y.plus1);
    var before = bent(edge(x.minus1, y.minus1), e);
    var own = bent(e, f);
    var after = bent(f, edge(x.plus2, y.plus2));
    if CRYSTAL {
        before = rounded(given.before.stiffness * before);
        own = rounded(given.there.stiffness * own);
        after = rounded(given.after.stiffness * after);
    }
    let rise = own - before;
    let next = after - own;
    let along_x = e.x + f.x;
    let along_y = e.y + f.y;
    var inward = vec(0.0);
    if CRYSTAL {
        inward = rounded(given.mobile * (rise / e.length)) - rounded(given.mobile_after * (next / f.length));
    } else {
        inward = real(0.5) * (e.length + f.length) * b(own) - (rounded(next / f.length) - rounded(rise / e.length));
    }
    let across = inward / sqrt(along_x * along_x + along_y * along_y);
    let sliding = real(0.5) * alpha;
    return Force(sliding * along_x - across * along_y, sliding * along_y + across * along_x);
}

/// The energy of the polygon at the nodes between two edges, with `½ 2sin(θ/2) 2tan(θ/2)` over the length there.
fn energy_at_vertex(e: Edge, f: Edge) -> vec {
    let turned = vertex_turn(e, f);
    let square = turned * turned;
    let length = real(0.5) * (e.length + f.length);
    let bending = real(0.5) * square / (sqrt(vec(1.0) - real(0.25) * square) * length);
    return bending + all_parameters[member].law[LENGTH_PENALTY] * length;
}

/// The energy of a unit of length.
fn energy_density(k: vec) -> vec {
    return real(0.5) * (k * k) + vec(all_parameters[member].law[LENGTH_PENALTY]);
}
