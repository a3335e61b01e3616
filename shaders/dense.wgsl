// What lies inside an adaptive step: a polynomial through both of its ends. Twin of crates/flow/src/scheme/dense.rs.

const RESOLVED = 131072.0;
const BISECTIONS = 54u;
const EARLY_LOOK = 0.0625;
const LATE_LOOK = 0.9375;

/// A value and its first and second derivative.
struct Jet { value: real, slope: real, bend: real }

/// The polynomial of degree 5 with given values and derivatives at both ends of a step, with time from 0 to 1.
struct Arc { start: Jet, end: Jet }

/// The cubic with a value at the start, and value and derivatives at the end.
fn arc_first(start: real, end: Jet) -> Arc {
    let cube = end.value - start - end.slope + real(0.5) * end.bend;
    let slope = end.slope - end.bend + real(3.0) * cube;
    return Arc(Jet(start, slope, end.bend - real(6.0) * cube), end);
}

/// The value at a fraction of the step.
fn arc_at(arc: Arc, at: real) -> real {
    let powers = arc_powers(arc);
    let a = arc.start;
    let bend = real(0.5) * a.bend;
    return a.value + at * (a.slope + at * (bend + at * (powers.third + at * (powers.fourth + at * powers.fifth))));
}

/// Coefficients of the third, fourth and fifth power.
struct Powers { third: real, fourth: real, fifth: real }

fn arc_powers(arc: Arc) -> Powers {
    let a = arc.start;
    let b = arc.end;
    let half = real(0.5);
    let three = real(3.0);
    let rise = b.value - a.value;
    let third = real(10.0) * rise - real(6.0) * a.slope - real(4.0) * b.slope + half * (b.bend - three * a.bend);
    let fourth = real(8.0) * a.slope + real(7.0) * b.slope - real(15.0) * rise + half * (three * a.bend) - b.bend;
    let fifth = real(6.0) * rise - three * (a.slope + b.slope) + half * (b.bend - a.bend);
    return Powers(third, fourth, fifth);
}

/// How much of the value and the derivatives at each end goes into the value at a fraction of a step of length h. Those
/// at its start are in units of the step before, of length `shorter`; 0 if there was none.
fn arc_weights(at: real, h: real, shorter: real) -> Arc {
    let none = Jet();
    let one = Jet(1.0, 0.0, 0.0);
    let sloped = Jet(0.0, 1.0, 0.0);
    let bent = Jet(0.0, 0.0, 1.0);
    if shorter <= real(0.0) {
        let end = Jet(
            arc_at(arc_first(0.0, one), at), arc_at(arc_first(0.0, sloped), at), arc_at(arc_first(0.0, bent), at),
        );
        return Arc(Jet(arc_at(arc_first(1.0, none), at), 0.0, 0.0), end);
    }
    let ratio = h / shorter;
    let slope = ratio * arc_at(Arc(sloped, none), at);
    let bend = ratio * ratio * arc_at(Arc(bent, none), at);
    let end = Jet(arc_at(Arc(none, one), at), arc_at(Arc(none, sloped), at), arc_at(Arc(none, bent), at));
    return Arc(Jet(arc_at(Arc(one, none), at), slope, bend), end);
}

/// The slope at a fraction of the step.
fn arc_slope_at(arc: Arc, at: real) -> real {
    let powers = arc_powers(arc);
    let a = arc.start;
    let higher = real(4.0) * powers.fourth + at * (real(5.0) * powers.fifth);
    return a.slope + at * (a.bend + at * (real(3.0) * powers.third + at * higher));
}

/// Whether the value falls at the start and rises at the end.
fn arc_dips(arc: Arc) -> bool { return !(real(0.0) <= arc.start.slope || arc.end.slope <= real(0.0)); }

/// The fraction of the step up to which the value falls: less than 1 if it rises at the end.
fn arc_turn(arc: Arc) -> real {
    var low = real(0.0);
    var high = real(1.0);
    if !arc_dips(arc) { return high; }
    for (var i = 0u; i < BISECTIONS; i++) {
        let middle = real(0.5) * (low + high);
        if arc_slope_at(arc, middle) <= real(0.0) { low = middle; } else { high = middle; }
    }
    return low;
}

/// The fraction of the step at which the value falls to `aim`, which lies between those at the start and at `end`.
fn arc_crossing(arc: Arc, aim: real, end: real) -> real {
    var low = real(0.0);
    var high = end;
    for (var i = 0u; i < BISECTIONS; i++) {
        let middle = real(0.5) * (low + high);
        if arc_at(arc, middle) <= aim { high = middle; } else { low = middle; }
    }
    return high;
}

/// Whether all derivatives are finite and of a size that the step can have.
fn arc_is_tame(arc: Arc) -> bool {
    let most = real(BIG);
    let at_start = abs(arc.start.slope) <= most && abs(arc.start.bend) <= most;
    return at_start && abs(arc.end.slope) <= most && abs(arc.end.bend) <= most;
}

const STRAIGHT = 0u;
const EXPONENTIAL = 1u;
const SMOOTH = 2u;

/// The excess inside a step: on a straight line; its logarithm, relative to the start, on a straight line to `fallen`;
/// or on `arc`.
struct Fall { kind: u32, fallen: real, arc: Arc }

/// The fall in an adaptive step of length h, with the derivatives of ln excess at its end.
fn fall_of(h: real, decline: vec2<real>) -> Fall {
    let report = &all_reports[member].report;
    let before = report.before.excess;
    let after = report.now.excess;
    if before <= real(0.0) || after <= real(0.0) { return Fall(); }
    let fallen = ln_ratio(before, after);
    let end = Jet(fallen, decline.x, decline.y);
    var arc = arc_first(0.0, end);
    if !(report.progress.taken <= real(0.0)) {
        let ratio = h / report.progress.taken;
        arc = Arc(Jet(0.0, ratio * report.progress.slope, ratio * ratio * report.progress.bend), end);
    }
    let resolved = is_by_polygon() || real(RESOLVED * EPSILON) <= after;
    return Fall(select(EXPONENTIAL, SMOOTH, resolved && arc_is_tame(arc)), fallen, arc);
}

/// The last accepted step.
struct Taken { h: real, before: real, after: real, fall: Fall }

/// The excess at a fraction of the step.
fn taken_inside(taken: Taken, at: real) -> real {
    if taken.fall.kind == STRAIGHT { return taken.before + at * (taken.after - taken.before); }
    var fallen = at * taken.fall.fallen;
    if taken.fall.kind == SMOOTH { fallen = arc_at(taken.fall.arc, at); }
    return taken.before * exponential(vec(fallen)).x;
}

/// The fraction of the step at which the excess falls to `excess`; its end if it already had before.
fn taken_fraction_at(taken: Taken, excess: real) -> real {
    if taken.before <= excess { return real(1.0); }
    if taken.fall.kind == STRAIGHT { return (taken.before - excess) / (taken.before - taken.after); }
    let aim = ln_ratio(taken.before, excess);
    if taken.fall.kind == EXPONENTIAL { return aim / taken.fall.fallen; }
    var end = real(1.0);
    if !(taken.after <= excess) { end = arc_turn(taken.fall.arc); }
    return arc_crossing(taken.fall.arc, aim, end);
}

/// Whether the excess falls to `excess`, even if it then rises again.
fn taken_falls_to(taken: Taken, excess: real) -> bool {
    if taken.after <= excess { return true; }
    if taken.fall.kind != SMOOTH || excess <= real(0.0) || !arc_dips(taken.fall.arc) { return false; }
    let end = arc_turn(taken.fall.arc);
    return !(real(1.0) <= end) && arc_at(taken.fall.arc, end) <= ln_ratio(taken.before, excess);
}

/// A field inside the step of an attempt, which ends at `end`, by the weights that `w` is.
fn field_inside(w: Arc, field: u32, end: vec) -> vec {
    var begin = load_field(CURVE + field);
    if is_of_places(field) { begin = coordinate(begin); }
    return w.start.value * begin + w.start.slope * load_field(SLOPE + field)
        + w.start.bend * load_field(BEND + field) + w.end.value * end
        + w.end.slope * load_field(SLOPE_BEFORE + field) + w.end.bend * load_field(BEND_BEFORE + field);
}
