// Sums and maxima of a curve, and what they determine. Twin of crates/flow/src/scheme/observe.rs.

/// |k| r at which a curve counts as unresolved.
const MAX_TURN = 2.0;
/// Ratio of the shortest edge to the mean below which an edge counts as vanished.
const MIN_EDGE = 1e-5;
/// Metric drift above which the scheme's lengths say nothing about the polygon.
const MAX_DRIFT = 1.0;
/// Gap between k and the polygon's turn above which no member counts as relaxed.
const MAX_GAP = 0.5;
/// Excess at the end of an adaptive step, as a multiple of a threshold, above which nobody looks for a dip below it.
const NEAR = 4.0;

/// Sums of the new curve: length, area, energy, turning. Of a crystal, in place of the energy the sum of gamma |e|.
var<private> sums: vec;
/// Maxima of the new curve: |k| r, metric drift, longest edge, minus the shortest edge.
var<private> extremes: vec;
/// Largest curvature, minus the smallest, largest displacement of a node.
var<private> others: vec;

/// Distance of the new curve from equilibrium.
var<private> distance: real;

/// What the excess compares with the area: the length, of a crystal its surface energy.
fn total_tension() -> real {
    if CRYSTAL { return sums.z; }
    return sums.x;
}

/// The energy that is reported.
fn energy_of_sums() -> real {
    if CRYSTAL { return all_parameters[member].law[ENERGY_UNIT] * sums.z; }
    return sums.z;
}

/// How far the nodes of the new curve have moved.
var<private> displacement: vec;

fn displaced(x: vec, y: vec) {
    let moved_x = apart(x, here(new_x));
    let moved_y = apart(y, here(new_y));
    displacement = sqrt(moved_x * moved_x + moved_y * moved_y);
}

/// Whether the sums and the curvature are finite.
fn is_finite() -> bool {
    let big = real(BIG);
    return sums.x <= big && abs(sums.y) <= big && extremes.x <= big;
}

/// Whether the curve has become singular: it is unresolved, an edge has vanished, its lengths mean nothing, it has
/// shrunk, or its turning number is no longer `turning`.
fn is_singular(turning: real) -> bool {
    let mean_edge = sums.x / real(node_count());
    let resolved = extremes.x <= real(MAX_TURN);
    let apart = real(MIN_EDGE) * mean_edge <= -extremes.w;
    let measured = extremes.y <= real(MAX_DRIFT);
    let extended = all_parameters[member].least_length <= sums.x;
    return !(resolved && apart && measured && extended && sums.w == turning);
}

/// The first and the second derivative of ln excess along an adaptive step, by those of the nodes of the new curve.
fn decline() -> vec2<real> {
    var all = vec();
    if is_by_polygon() { all = regular_changes(); } else { all = changes(); }
    let length = total_tension();
    let half = real(0.5);
    let growth = all.x / length;
    let widening = half * all.z / sums.y;
    let slope_of_ratio = real(2.0) * growth - widening;
    let bend_of_ratio = real(2.0) * (all.y / length - growth * growth)
        - (half * all.w / sums.y - widening * widening);
    let over = quotient(length, sums.y) / distance;
    let falls = over * slope_of_ratio;
    return vec2(falls, over * (bend_of_ratio + slope_of_ratio * slope_of_ratio) - falls * falls);
}

/// L', L'', 2A' and 2A''. Of a crystal, `γ|e|` stands for the length of an edge.
fn changes() -> vec {
    let slope = windows(load_field(SLOPE_BEFORE), load_field(SLOPE_BEFORE + 1u));
    settle();
    let bend = windows(load_field(BEND_BEFORE), load_field(BEND_BEFORE + 1u));
    let ex = rises_of_places(new_x).here;
    let ey = rises_of_places(new_y).here;
    let fx = rises(slope.a).here;
    let fy = rises(slope.b).here;
    let gx = rises(bend.a).here;
    let gy = rises(bend.b).here;
    let inverse = vec(1.0) / sqrt(ex * ex + ey * ey);
    var stretch = (ex * fx + ey * fy) * inverse;
    var bent = (fx * fx + fy * fy + (ex * gx + ey * gy) - stretch * stretch) * inverse;
    if CRYSTAL {
        let tx = ex * inverse;
        let ty = ey * inverse;
        let given = tension(Complex(tx, ty));
        let across = tx * fy - ty * fx;
        stretch = given.energy * (tx * fx + ty * fy) + given.turned * across;
        let pulled = given.energy * (tx * gx + ty * gy) + given.turned * (tx * gy - ty * gx);
        bent = given.stiffness * (across * across) * inverse + pulled;
    }
    let at = corner(new_x, new_y);
    let area = (minus1(slope.a) * at.y - here(slope.a) * at.before_y)
        + (at.before_x * here(slope.b) - at.x * minus1(slope.b));
    let area_bend = (minus1(bend.a) * at.y - here(bend.a) * at.before_y)
        + (at.before_x * here(bend.b) - at.x * minus1(bend.b))
        + real(2.0) * (minus1(slope.a) * here(slope.b) - here(slope.a) * minus1(slope.b));
    return ring_sums(vec(block_sum(stretch), block_sum(bent), block_sum(area), block_sum(area_bend)));
}

/// The largest difference between the angle by which the new curvature turns the tangent over a segment and the angle
/// by which the new polygon turns there.
fn gap() -> real {
    if ADAPTIVE { settle(); }
    let turned = turn(new_x, new_y);
    let apart = bounded_abs(new_k * turned.span - turned.angle);
    return ring_maxima(vec(block_max(apart), 0.0, 0.0, 0.0)).x;
}

/// +1 (-1) if the edge vector turns from e to f across the positive x axis, the short way round.
fn winding(ex: vec, ey: vec, fx: vec, fy: vec) -> vec {
    let side = ex * fy - fx * ey;
    let e_below = select(vec(0.0), vec(1.0), ey <= vec(0.0));
    let f_below = select(vec(0.0), vec(1.0), fy <= vec(0.0));
    let left = select(vec(1.0), vec(0.0), side <= vec(0.0));
    let right = select(vec(1.0), vec(0.0), vec(0.0) <= side);
    return e_below * (vec(1.0) - f_below) * left - (vec(1.0) - e_below) * f_below * right;
}

/// Observes the curve given by the windows of x and y and the nodes of k and r; `moved` is how far its nodes moved.
fn observe(wx: Window, wy: Window, kh: vec, stored: vec, moved: vec) {
    let rh = length_of(stored);
    let x = rises_of_places(wx);
    let y = rises_of_places(wy);
    let own = edge(x.here, y.here).length;
    var energy = vec(0.0);
    if CRYSTAL {
        energy = tension(tangent_of(edge(x.here, y.here))).energy * own - vec(all_parameters[member].law[AT_REST]);
    } else {
        energy = energy_density(kh) * rh;
        if FORCED && all_parameters[member].law[CONSERVED] > real(0.0) {
            energy = energy_at_vertex(edge(x.here, y.here), edge(x.plus1, y.plus1));
        }
    }
    let turning = winding(x.here, y.here, x.plus1, y.plus1);
    if IS_SHORT {
        settle();
        regular = regular_near(coordinate(here(wx)), coordinate(here(wy)));
    }
    let over = exceeded(wx, wy, edge(x.here, y.here));
    let part = vec(block_sum(over.longer), block_sum(over.more), block_sum(energy), block_sum(turning));
    let shortest = -bounded_abs(own);
    let extremes_of_block = vec(
        block_max(bounded_abs(kh * rh)),
        block_max(bounded_abs((rh - own) / own)),
        block_max(bounded_abs(own)),
        block_max_signed(shortest),
    );
    let others_of_block = vec(block_max_signed(kh), block_max_signed(-kh), block_max(bounded_abs(moved)), 0.0);
    settle();
    let all = ring_summary(part, extremes_of_block, others_of_block);
    let length = real(node_count()) * regular.edge + all.sums.x;
    sums = vec(length, regular.area + real(0.5) * all.sums.y, all.sums.zw);
    if CRYSTAL { sums.z = real(node_count()) * all_parameters[member].law[AT_REST] + all.sums.z; }
    extremes = all.extremes;
    others = all.others;
    distance = excess(all.sums.x, all.sums.y, all.sums.z);
}

/// Derives the observables from the last `observe`.
fn observed() -> Observed {
    return Observed(
        sums.x, sums.y, distance, energy_of_sums(), -others.y, others.x, extremes.z / -extremes.w, extremes.y,
    );
}

/// Whether an observable has reached a level at which the member pauses.
fn reaches_level(at: Observed) -> bool {
    let p = &all_parameters[member];
    let fell = at.length <= p.low.length || at.area <= p.low.area || at.excess <= p.low.excess
        || at.energy <= p.low.energy || at.k_min <= p.low.k_min || at.k_max <= p.low.k_max
        || at.mesh_ratio <= p.low.mesh_ratio || at.metric_drift <= p.low.metric_drift;
    let rose = p.high.length <= at.length || p.high.area <= at.area || p.high.excess <= at.excess
        || p.high.energy <= at.energy || p.high.k_min <= at.k_min || p.high.k_max <= at.k_max
        || p.high.mesh_ratio <= at.mesh_ratio || p.high.metric_drift <= at.metric_drift;
    return fell || rose;
}

/// Whether a value above `level` at both ends of a step may have reached it inside, by the values at the start, at the
/// two looks and at the end: if it is there at a look, or if the lines through the first two and through the last two
/// values meet at or below it. A value that turns once does not fall below those lines.
fn falls_inside(start: real, early: real, late: real, end: real, level: real) -> bool {
    let fall = start - early;
    let rise = end - late;
    let first = early - level;
    let last = late - level;
    let there = first <= real(0.0) || last <= real(0.0);
    let turns = !(fall <= real(0.0) || rise <= real(0.0));
    return there || (turns && first * rise + last * fall <= real((LATE_LOOK - EARLY_LOOK) / EARLY_LOOK) * (fall * rise));
}

/// Whether a value may have reached one of its levels inside a step.
fn passes(start: real, early: real, late: real, end: real, low: real, high: real) -> bool {
    return falls_inside(start, early, late, end, low) || falls_inside(-start, -early, -late, -end, -high);
}

/// The observables of the last attempt near its start and near its end.
struct Looks { early: Observed, late: Observed }

/// Whether an observable may have reached a level inside a step from `a` to `d` and left it again, by those at both
/// ends and at the two looks. Where the host looks closely, it may turn out that none has.
fn passes_level(a: Observed, looks: Looks, d: Observed) -> bool {
    let p = &all_parameters[member];
    let b = looks.early;
    let c = looks.late;
    return passes(a.length, b.length, c.length, d.length, p.low.length, p.high.length)
        || passes(a.area, b.area, c.area, d.area, p.low.area, p.high.area)
        || passes(a.excess, b.excess, c.excess, d.excess, p.low.excess, p.high.excess)
        || passes(a.energy, b.energy, c.energy, d.energy, p.low.energy, p.high.energy)
        || passes(a.k_min, b.k_min, c.k_min, d.k_min, p.low.k_min, p.high.k_min)
        || passes(a.k_max, b.k_max, c.k_max, d.k_max, p.low.k_max, p.high.k_max)
        || passes(a.mesh_ratio, b.mesh_ratio, c.mesh_ratio, d.mesh_ratio, p.low.mesh_ratio, p.high.mesh_ratio)
        || passes(
            a.metric_drift, b.metric_drift, c.metric_drift, d.metric_drift, p.low.metric_drift, p.high.metric_drift,
        );
}

/// Observes the curve inside the step of an attempt near its start and near its end.
fn look_inside() -> Looks {
    var looks = Looks();
    for (var look = 0u; look < 2u; look++) {
        let weights = arc_weights(select(real(LATE_LOOK), real(EARLY_LOOK), look == 0u), plan.length, plan.taken);
        settle();
        let nodes = windows(
            placed(field_inside(weights, 0u, coordinate(here(new_x)))),
            placed(field_inside(weights, 1u, coordinate(here(new_y)))),
        );
        let ks = field_inside(weights, 2u, new_k);
        observe(nodes.a, nodes.b, ks, field_inside(weights, 3u, new_r), vec(0.0));
        if look == 0u { looks.early = observed(); } else { looks.late = observed(); }
    }
    return looks;
}
