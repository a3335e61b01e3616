// Places of short numbers: integers in the bits of the number, multiples of 2⁻²⁷ of the member's unit. Twin of
// crates/flow/src/number/place.rs.

/// The bits of the place at 0. All places are then normal numbers, which no device alters.
const ORIGIN = 0x40000000i;
/// Steps from there to the rim: 7.875 units. What would be beyond is at the rim.
const RIM = 0x3f000000i;
/// Steps from there to the first places whose coordinates count as not finite: 7.5 units. A curve that grows comes to
/// them before it touches the rim.
const OUTSIDE = 0x3c000000i;
/// Steps in a unit.
const PER_UNIT = 134217728.0;
/// The length of a step.
const STEP = 7.450580596923828e-9;
/// Largest increment, in steps: the sum with a place is below 2³¹.
const FARTHEST = 1073741824.0;
/// The coordinate of places that count as not finite: its square is infinite.
const BEYOND = 1e30;

fn steps(place: vec) -> vec4<i32> {
    return bitcast<vec4<i32>>(place) - ORIGIN;
}

fn held(steps: vec4<i32>) -> vec {
    return bitcast<vec4<f32>>(clamp(steps, vec4(-RIM), vec4(RIM)) + ORIGIN);
}

/// How far it is to a place from another.
fn apart(origin: vec, to: vec) -> vec {
    return vec(bitcast<vec4<i32>>(to) - bitcast<vec4<i32>>(origin)) * STEP;
}

/// A place after an increment.
fn moved(place: vec, by: vec) -> vec {
    let way = by * PER_UNIT;
    let end = steps(place) + vec4<i32>(round(way));
    return held(select(vec4(RIM), end, abs(way) <= vec(FARTHEST)));
}

/// The coordinate of a place.
fn coordinate(place: vec) -> vec {
    let at = steps(place);
    return select(vec(BEYOND), vec(at) * STEP, abs(at) < vec4(OUTSIDE));
}

/// The place at a coordinate.
fn placed(at: vec) -> vec {
    return moved(held(vec4(0i)), at);
}
