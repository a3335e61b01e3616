//! The incomplete gamma functions and their inverse.
//!
//! Series and continued fraction as in Abramowitz and Stegun 6.5.29 and 6.5.31, the latter by Lentz's method.

/// Terms of the continued fraction, of which far fewer are needed where it is used.
const MAX_TERMS: u32 = 100_000;
/// Halvings of an interval of logarithms: its ends then are neighbours.
const HALVINGS: u32 = 80;

/// Returns Q(a, x) = Γ(a, x)/Γ(a) for a > 0, x > 0.
///
/// The relative error is below 1e-13 for a up to 100, and grows in proportion beyond.
pub fn upper(a: f64, x: f64) -> f64 {
    both(a, x)[1]
}

/// Returns P(a, x) = 1 - Q(a, x) for a > 0; 0 at x ≤ 0.
pub fn lower(a: f64, x: f64) -> f64 {
    if x <= 0.0 { 0.0 } else { both(a, x)[0] }
}

/// P and Q. Series and fraction converge fast, each on its side, where the other function is not small: its difference
/// from 1 loses no digits.
fn both(a: f64, x: f64) -> [f64; 2] {
    let front = (a * x.ln() - x - libm::lgamma(a)).exp();
    if x < a + 1.0 {
        let lower = front * lower_series(a, x);
        [lower, 1.0 - lower]
    } else {
        let upper = front * upper_fraction(a, x);
        [1.0 - upper, upper]
    }
}

/// Σ_j x^j / (a (a+1) … (a+j))
fn lower_series(a: f64, x: f64) -> f64 {
    let (mut term, mut sum, mut next) = (1.0 / a, 1.0 / a, a);
    while term > sum * (0.1 * f64::EPSILON) {
        next += 1.0;
        term *= x / next;
        sum += term;
    }
    sum
}

/// 1/(x+1-a - 1(1-a)/(x+3-a - 2(2-a)/(x+5-a - …))); all denominators are positive for x ≥ a + 1.
fn upper_fraction(a: f64, x: f64) -> f64 {
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (f64::INFINITY, 1.0 / b);
    let mut fraction = d;
    for j in 1..MAX_TERMS {
        let j = f64::from(j);
        let numerator = -j * (j - a);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    fraction
}

/// Returns the x at which P(a, x) is `u`, for a > 0 and u in (0, 1).
pub fn quantile(a: f64, u: f64) -> f64 {
    // P is below x^a/Γ(a + 1), so the quantile is above where that is u; Chernoff bounds it from above.
    let mut low = (u.ln() + libm::lgamma(a + 1.0)) / a;
    let mut high = (a + 2.0 * (a * -(-u).ln_1p()).sqrt() - 2.0 * (-u).ln_1p()).max(f64::MIN_POSITIVE).ln();
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        // From the nearer end, where a tail may be thin.
        let is_below = match u < 0.5 {
            true => lower(a, middle.exp()) < u,
            false => upper(a, middle.exp()) > 1.0 - u,
        };
        if is_below { low = middle } else { high = middle }
    }
    (0.5 * (low + high)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_functions_add_up_to_one_and_have_their_closed_forms() {
        for x in [1e-3, 0.3, 1.0, 2.5, 20.0] {
            assert!((lower(1.0, x) + (-x).exp_m1()).abs() < 1e-15, "{x}");
            assert!((lower(0.5, x) - libm::erf(x.sqrt())).abs() < 1e-14, "{x}");
            for a in [0.01, 0.7, 3.0, 40.0] {
                assert!((lower(a, x) + upper(a, x) - 1.0).abs() < 1e-14, "{a}, {x}");
            }
        }
        assert_eq!(lower(2.0, -1.0), 0.0);
    }

    #[test]
    fn the_quantile_is_the_inverse_in_both_tails() {
        for a in [0.1, 0.3, 1.0, 7.5, 300.0, 1e4] {
            for u in [1e-9, 1e-3, 0.2, 0.5, 0.8, 0.999, 1.0 - 1e-9] {
                let x = quantile(a, u);
                let found = if u < 0.5 { lower(a, x) / u } else { upper(a, x) / (1.0 - u) };
                assert!(x > 0.0 && (found - 1.0).abs() < 1e-9, "{a}, {u}: {x} {found}");
            }
        }
    }
}
