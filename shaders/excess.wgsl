// The distance of a curve from equilibrium: the quotient of length, or surface energy, and area above that of the
// polygon at rest. Twin of crates/flow/src/scheme/excess.rs.

/// Terms of the series of a root of unity after the first.
const ROOT_TERMS = 5u;
/// The place of 4π, or 4|W|, in the law.
const QUOTIENT = 22u;
/// The place of what an edge of a crystal is compared with: the energy of one at rest, twice its share of the area, and
/// by how much their quotient exceeds the least one.
const AT_REST = 29u;

/// Whether the excess and its derivatives are computed by the regular polygon next to the curve.
fn is_by_polygon() -> bool {
    return IS_SHORT && !CRYSTAL;
}

/// Coordinates of the nodes i-1 and i.
struct Corner { before_x: vec, x: vec, before_y: vec, y: vec }

fn corner(wx: Window, wy: Window) -> Corner {
    return Corner(coordinate(minus1(wx)), coordinate(here(wx)), coordinate(minus1(wy)), coordinate(here(wy)));
}

/// `x_{i-1} × x_i`.
fn cross(wx: Window, wy: Window) -> vec {
    let at = corner(wx, wy);
    if IS_SHORT { return at.before_x * rises_of_places(wy).here - rises_of_places(wx).here * at.before_y; }
    return at.before_x * at.y - at.x * at.before_y;
}

/// `L²/(4π|A|)`, least at equilibrium.
fn quotient(length: real, area: real) -> real {
    return length * length / (all_parameters[member].law[QUOTIENT] * abs(area));
}

/// The regular polygon next to the new curve, with which it is compared node by node where numbers are short: its
/// centre c, the factor G of ωⁱ in its nodes and that in its unit tangents, the length of its edges, its area, of a
/// crystal that at rest.
struct Regular { centre: vec2<real>, radius: vec2<real>, tangent: vec2<real>, edge: real, area: real }
var<private> regular: Regular;

fn regular_near(x: vec, y: vec) -> Regular {
    let unit = root();
    let turned_back = vec(block_sum(x * unit.x + y * unit.y), block_sum(y * unit.x - x * unit.y), 0.0, 0.0);
    let all = ring_sums(vec(block_sum(x), block_sum(y), turned_back.xy)) / real(node_count());
    let size = sqrt(all.z * all.z + all.w * all.w);
    var along = vec2<real>(1.0, 0.0);
    if !(size <= real(0.0)) { along = all.zw / size; }
    let cosine = real(dispatch.half_cosine);
    let sine = real(dispatch.half_sine);
    let tangent = vec2(along.x * sine - along.y * cosine, along.x * cosine + along.y * sine);
    var share = (sine * cosine) * (size * size);
    if CRYSTAL { share = real(0.5) * all_parameters[member].law[AT_REST + 1u]; }
    return Regular(all.xy, all.zw, tangent, (sine + sine) * size, real(node_count()) * share);
}

/// L', L'', 2A' and 2A'' in units of a length that grows as the polygon would.
fn regular_changes() -> vec {
    let unit = root();
    let nodes = turned(regular.radius, unit);
    let tangents = turned(regular.tangent, unit);
    var slope_x = load_field(SLOPE_BEFORE);
    var slope_y = load_field(SLOPE_BEFORE + 1u);
    var bend_x = load_field(BEND_BEFORE);
    var bend_y = load_field(BEND_BEFORE + 1u);
    let slopes = windows(slope_x, slope_y);
    settle();
    let bends = windows(bend_x, bend_y);
    let radius = regular.radius;
    let outwards = vec(
        block_sum(slope_x * nodes.x + slope_y * nodes.y), block_sum(bend_x * nodes.x + bend_y * nodes.y), 0.0, 0.0,
    );
    let growth = ring_sums(outwards).xy / (real(node_count()) * (radius.x * radius.x + radius.y * radius.y));
    let ex = rises_of_places(new_x).here;
    let ey = rises_of_places(new_y).here;
    let fx = relative(ex, rises(slopes.a).here, growth);
    let fy = relative(ey, rises(slopes.b).here, growth);
    let gx = relative_bend(ex, fx, rises(bends.a).here, growth);
    let gy = relative_bend(ey, fy, rises(bends.b).here, growth);
    let x = coordinate(here(new_x)) - vec(regular.centre.x);
    let y = coordinate(here(new_y)) - vec(regular.centre.y);
    let ux = relative(x, slope_x, growth);
    let uy = relative(y, slope_y, growth);
    let sx = relative_bend(x, ux, bend_x, growth);
    let sy = relative_bend(y, uy, bend_y, growth);
    let inverse = vec(1.0) / sqrt(ex * ex + ey * ey);
    // The unit vector along the edge, and by how much it differs from the polygon's.
    let nx = ex * inverse;
    let ny = ey * inverse;
    let cx = nx - tangents.x;
    let cy = ny - tangents.y;
    let dx = x - nodes.x;
    let dy = y - nodes.y;
    let wx = ex - regular.edge * tangents.x;
    let wy = ey - regular.edge * tangents.y;
    let across = nx * fy - ny * fx;
    let stretch = cx * fx + cy * fy;
    let bent = across * across * inverse + (cx * gx + cy * gy);
    let area = (dx * fy - dy * fx) + (ux * wy - uy * wx);
    let area_bend = (dx * gy - dy * gx) + (sx * wy - sy * wx) + real(2.0) * (ux * fy - uy * fx);
    settle();
    return ring_sums(vec(block_sum(stretch), block_sum(bent), block_sum(area), block_sum(area_bend)));
}

/// By how much the length of an edge exceeds its own part along the polygon's, and `d_{i-1} × d_i` of the differences d
/// from the polygon's nodes, of a crystal by how much `(x_i - c) × e_i` exceeds that at rest; in long numbers the
/// length of the edge and `x_{i-1} × x_i`.
struct Exceeded { longer: vec, more: vec }

fn exceeded(wx: Window, wy: Window, own: Edge) -> Exceeded {
    if !IS_SHORT { return Exceeded(own.length, cross(wx, wy)); }
    let unit = root();
    let tangents = turned(regular.tangent, unit);
    let nodes = turned(regular.radius, unit);
    let along = tangents.x * own.x + tangents.y * own.y;
    let across = tangents.x * own.y - tangents.y * own.x;
    let longer = select(across * across / (own.length + along), own.length - along, along <= vec(0.0));
    let x = coordinate(here(wx)) - vec(regular.centre.x);
    let y = coordinate(here(wy)) - vec(regular.centre.y);
    if CRYSTAL { return Exceeded(longer, (x * own.y - y * own.x) - vec(all_parameters[member].law[AT_REST + 1u])); }
    let dx = x - nodes.x;
    let dy = y - nodes.y;
    let more = dx * (own.y - regular.edge * tangents.y) - dy * (own.x - regular.edge * tangents.x);
    return Exceeded(longer, more);
}

/// The distance from equilibrium by the sums of that.
fn excess(longer: real, more: real, dearer: real) -> real {
    let p = &all_parameters[member];
    let plain = quotient(total_tension(), sums.y) - p.polygon_ratio;
    if !IS_SHORT { return plain; }
    if CRYSTAL {
        let energy_at_rest = real(node_count()) * p.law[AT_REST];
        let known = !(sums.y <= real(0.0) || energy_at_rest <= real(0.0));
        let energy = dearer / energy_at_rest;
        let wider = real(0.5) * more / regular.area;
        let over = (p.law[AT_REST + 2u] + energy * (real(2.0) + energy)) - wider;
        return select(plain, p.polygon_ratio * over / (real(1.0) + wider), known);
    }
    let own = real(node_count()) * regular.edge;
    let unit = p.law[QUOTIENT];
    let over = longer * (own + own + longer) - p.polygon_ratio * unit * (real(0.5) * more);
    return select(over / (unit * sums.y), plain, sums.y <= real(0.0));
}

/// The first derivative of a place or an edge in units of a length that grows at these two derivatives.
fn relative(at: vec, slope: vec, growth: vec2<real>) -> vec {
    return slope - growth.x * at;
}

/// The second, by the first.
fn relative_bend(at: vec, slope: vec, bend: vec, growth: vec2<real>) -> vec {
    return bend - growth.y * at - real(2.0) * growth.x * slope;
}

/// `z w` of complex numbers.
fn turned(z: vec2<real>, w: Complex) -> Complex {
    return Complex(z.x * w.x - z.y * w.y, z.x * w.y + z.y * w.x);
}

/// ωⁱ, an n-th root of unity, at the nodes: by the nearest quarter of a turn, which is at most π/4 away.
fn root() -> Complex {
    let i = vec4(first) + vec4(0u, 1u, 2u, 3u);
    let quarter = (8u * i + node_count()) / (2u * node_count());
    let past = vec4<i32>(4u * i) - vec4<i32>(quarter * node_count());
    let angle = real(1.5707963267948966) / real(node_count()) * vec(past);
    let square = angle * angle;
    var sine = vec(1.0);
    var cosine = vec(1.0);
    for (var left = ROOT_TERMS; left > 0u; left--) {
        let factor = real(2u * left);
        sine = vec(1.0) - square / (factor * (factor + real(1.0))) * sine;
        cosine = vec(1.0) - square / (factor * (factor - real(1.0))) * cosine;
    }
    sine = angle * sine;
    let is_odd = (quarter & vec4(1u)) != vec4(0u);
    let is_opposite = (quarter & vec4(2u)) != vec4(0u);
    let x = select(cosine, -sine, is_odd);
    let y = select(sine, cosine, is_odd);
    return Complex(select(x, -x, is_opposite), select(y, -y, is_opposite));
}
