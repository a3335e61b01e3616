// Numbers: `real` is f32 or f64, chosen by the line that the host prepends. Twin of crates/flow/src/number.rs.

alias vec = vec4<real>;

/// Whether numbers have so few digits that sums, differences and solves must be made with care.
const IS_SHORT = EPSILON > 1e-10;

/// Values above this bound count as not finite. `!(abs(x) <= BIG)` also holds for NaN; `x != x` never does.
const BIG = 1e18;

/// |v|, or 2 BIG if that is NaN or above BIG, so that maxima can be taken safely.
fn bounded_abs(v: vec) -> vec {
    return select(vec(2.0 * BIG), abs(v), abs(v) <= vec(BIG));
}

/// Halvings and terms of the logarithm.
const LN_HALVINGS = 64u;
const LN_TERMS = 10u;

/// e^x for |x| <= 40, clamped beyond: reduction by ln 2, then a Horner polynomial. WGSL's own exp is garbage in f64.
fn exponential(v: vec) -> vec {
    let parts = exponential_parts(v);
    return ldexp(parts.more + vec(1.0), vec4<i32>(parts.power));
}

/// `e^x - 1` for the same x, with all its digits where x is small.
fn exponential_less_one(v: vec) -> vec {
    let parts = exponential_parts(v);
    let scale = ldexp(vec(1.0), vec4<i32>(parts.power));
    return parts.more * scale + (scale - vec(1.0));
}

/// a and n with `e^x = (1 + a) 2ⁿ`.
struct ExponentialParts { more: vec, power: vec }

fn exponential_parts(v: vec) -> ExponentialParts {
    let x = min(max(v, vec(-40.0)), vec(40.0));
    let n = floor(x * real(1.4426950408889634) + vec(0.5));
    let reduced = (x - n * real(0.693359375)) - n * real(-2.1219444005469058e-4);
    var sum = vec(1.0 / 6227020800.0);
    sum = sum * reduced + vec(1.0 / 479001600.0);
    sum = sum * reduced + vec(1.0 / 39916800.0);
    sum = sum * reduced + vec(1.0 / 3628800.0);
    sum = sum * reduced + vec(1.0 / 362880.0);
    sum = sum * reduced + vec(1.0 / 40320.0);
    sum = sum * reduced + vec(1.0 / 5040.0);
    sum = sum * reduced + vec(1.0 / 720.0);
    sum = sum * reduced + vec(1.0 / 120.0);
    sum = sum * reduced + vec(1.0 / 24.0);
    sum = sum * reduced + vec(1.0 / 6.0);
    sum = sum * reduced + vec(0.5);
    sum = sum * reduced + vec(1.0);
    return ExponentialParts(sum * reduced, n);
}

/// The number itself, which no compiler merges with the sum that takes it, since it would have to know that it is not
/// clamped: where nodes share the product of which it is the result, they must see the same one.
fn rounded(v: vec) -> vec {
    if IS_SHORT { return max(v, vec(-2.0 * BIG)); }
    return v;
}

/// Twice the sine of half the angle whose half has the tangent v.
fn twice_sin_atan(v: vec) -> vec {
    let t = min(max(v, vec(-1e9)), vec(1e9));
    return real(2.0) * (t / sqrt(vec(1.0) + t * t));
}

/// ln(b/a) of positive numbers; WGSL has no logarithm in f64.
fn ln_ratio(a: real, b: real) -> real {
    var q = b / a;
    var whole = real(0.0);
    for (var halving = 0u; halving < LN_HALVINGS; halving++) {
        if !(real(0.7071067811865476) <= q) {
            q = real(2.0) * q;
            whole = whole - real(0.6931471805599453);
        } else if !(q <= real(1.4142135623730951)) {
            q = real(0.5) * q;
            whole = whole + real(0.6931471805599453);
        } else {
            break;
        }
    }
    let z = (q - real(1.0)) / (q + real(1.0));
    let square = z * z;
    var sum = real(0.0);
    for (var left = LN_TERMS; left > 0u; left--) {
        sum = sum * square + real(1.0) / real(2u * left - 1u);
    }
    return whole + real(2.0) * (z * sum);
}
