// Driving forces, and the area and length that are kept. Twin of crates/flow/src/scheme/forcing.rs.

/// The places of F, of C and A0 of a feedback, of what is kept and of the area and length at which it is kept.
const DRIVE = 23u;
const FEEDBACK = 24u;
const FEEDBACK_AREA = 25u;
const CONSERVED = 26u;
const KEPT_AREA = 27u;
const KEPT_LENGTH = 28u;
/// Rounds of a correction.
const ROUNDS = 4u;
/// -φ of the position equation where forces act, in units of (2π/L)².
const DAMPING = 4.0;
/// Rounding of an area and a length of short numbers, in units of EPSILON and of themselves.
const ROUNDING_OF_SIZES = 16.0;
const TAU = 6.283185307179586;

/// F + p of this step.
var<private> force: real;
/// What stands for φ in the position equation where forces act.
var<private> damping: real;

/// beta with F + lambda k + p, for the old curvatures and lengths; lambda joins the law.
fn act(k: vec, r: vec, beta: vec) -> vec {
    settle();
    let old = windows(load_field(curve), load_field(curve + 1u));
    let area = sizes(old.a, old.b).x;
    workgroupBarrier();
    let first = ring_sums(vec(block_sum(r), block_sum(r * k), block_sum(r * k * k), block_sum(r * beta)));
    workgroupBarrier();
    let flow_turned = ring_sums(vec(block_sum(r * k * beta), 0.0, 0.0, 0.0)).x;
    // Others may still read it.
    workgroupBarrier();
    let p = &all_parameters[member].law;
    let drive = p[DRIVE] + p[FEEDBACK] * (area - p[FEEDBACK_AREA]);
    let moved = first.w + drive * first.x;
    let turned = flow_turned + drive * first.y;
    let by = balanced(first, -moved, -turned);
    force = drive + by.x;
    let around = real(TAU) / first.x;
    damping = real(-DAMPING) * (around * around);
    multiplier = by.y;
    law.c1 += multiplier;
    return beta + (vec(force) + multiplier * k);
}

/// Increments of x and y.
struct Moves { x: vec, y: vec }

/// Adds a time tau of the force, along the inward normals of circles through the old nodes, to the increments of x and
/// y; moves the nodes of the new curve.
fn push(x: vec, y: vec) -> Moves {
    settle();
    let old = windows(x, y);
    let ex = rises_of_places(old.a);
    let ey = rises_of_places(old.b);
    let ee = ex.here * ex.here + ey.here * ey.here;
    let ff = ex.plus1 * ex.plus1 + ey.plus1 * ey.plus1;
    let along_x = ff * ex.here + ee * ex.plus1;
    let along_y = ff * ey.here + ee * ey.plus1;
    let across = (tau * force) / sqrt(along_x * along_x + along_y * along_y);
    let by = Moves(u - across * along_y, v + across * along_x);
    settle();
    let nodes = windows(moved(x, by.x), moved(y, by.y));
    new_x = nodes.a;
    new_y = nodes.b;
    return by;
}

/// Moves the nodes of the new curve, which are `by` from the old ones, along the gradients of its area and its length
/// to those that are kept.
fn correct(old_x: vec, old_y: vec, by: Moves) {
    let x = rises_of_places(new_x);
    let y = rises_of_places(new_y);
    let e = edge(x.here, y.here);
    let f = edge(x.plus1, y.plus1);
    let ax = real(0.5) * (e.y + f.y);
    let ay = -(real(0.5) * (e.x + f.x));
    let by_e = vec(1.0) / e.length;
    let by_f = vec(1.0) / f.length;
    let lx = e.x * by_e - f.x * by_f;
    let ly = e.y * by_e - f.y * by_f;
    let part = vec(block_sum(ax * ax + ay * ay), block_sum(ax * lx + ay * ly), block_sum(lx * lx + ly * ly), 0.0);
    let squares = ring_sums(part);
    let p = &all_parameters[member].law;
    let targets = vec2<real>(p[KEPT_AREA], p[KEPT_LENGTH]);
    var due = targets;
    if IS_SHORT {
        let old = windows(old_x, old_y);
        due = beyond_rounding(targets, sizes(old.a, old.b));
    }
    var along = vec2<real>(0.0, 0.0);
    for (var round = 0u; round < ROUNDS; round++) {
        // Others may still read the last sums.
        workgroupBarrier();
        var lacks = due;
        if IS_SHORT { lacks -= change_of_sizes(old_x, old_y); } else { lacks -= sizes(new_x, new_y); }
        along += balanced(squares, lacks.x, lacks.y);
        let nodes = windows(
            moved(old_x, by.x + (along.x * ax + along.y * lx)), moved(old_y, by.y + (along.x * ay + along.y * ly)),
        );
        new_x = nodes.a;
        new_y = nodes.b;
    }
}

/// Solves `(x y; y z) u = (s; t)`, with x, y, z of `m`, for what is kept, the area and the length: the other unknown is
/// 0. On a circle both equations are one, and the length gives way.
fn balanced(m: vec, s: real, t: real) -> vec2<real> {
    let kept = u32(all_parameters[member].law[CONSERVED]);
    let area_kept = real(kept & 1u);
    let length_kept = real(kept >> 1u);
    let share = area_kept * (m.y / m.x);
    let own = m.z - share * m.y;
    let least = real(ROOT_EPSILON) * m.z;
    let v = length_kept * ((t - share * s) * own / (own * own + least * least));
    return vec2(area_kept * ((s - m.y * v) / m.x), v);
}

/// The area and the length of a polygon.
fn sizes(wx: Window, wy: Window) -> vec2<real> {
    let length = edge(rises_of_places(wx).here, rises_of_places(wy).here).length;
    let all = ring_sums(vec(block_sum(cross(wx, wy)), block_sum(length), 0.0, 0.0));
    return vec2(real(0.5) * all.x, all.y);
}

/// By how much area and length fall short of `targets`, beyond what they are rounded.
fn beyond_rounding(targets: vec2<real>, own: vec2<real>) -> vec2<real> {
    let missing = targets - own;
    let rounding = real(ROUNDING_OF_SIZES * EPSILON) * abs(targets);
    return missing - max(min(missing, rounding), -rounding);
}

/// By how much area and length of the new polygon exceed those of the old one, by how far its nodes have moved.
fn change_of_sizes(old_x: vec, old_y: vec) -> vec2<real> {
    let half = real(0.5);
    let dx = apart(old_x, here(new_x));
    let dy = apart(old_y, here(new_y));
    let moves = windows(dx, dy);
    let x = rises_of_places(new_x);
    let y = rises_of_places(new_y);
    let by_x = rises(moves.a);
    let by_y = rises(moves.b);
    let mx = x.here - half * by_x.here;
    let my = y.here - half * by_y.here;
    let next_x = x.plus1 - half * by_x.plus1;
    let next_y = y.plus1 - half * by_y.plus1;
    let twice_mean = edge(x.here, y.here).length + edge(x.here - by_x.here, y.here - by_y.here).length;
    let longer = (by_x.here * mx + by_y.here * my) / twice_mean;
    let all = ring_sums(vec(block_sum(dx * (my + next_y) - dy * (mx + next_x)), block_sum(longer + longer), 0.0, 0.0));
    return vec2(half * all.x, all.y);
}
