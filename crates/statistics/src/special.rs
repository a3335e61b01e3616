//! Tails of the chi-square and the normal distribution.
//!
//! The former is an incomplete gamma function: series and continued fraction as in Abramowitz and Stegun 6.5.29 and
//! 6.5.31, the latter by Lentz's method.
//!
//! A probability that is too small for a normal f64 is returned as [`LEAST`], so that none is ever 0: an event that was
//! seen is not impossible.

/// The smallest probability that is returned.
pub const LEAST: f64 = f64::MIN_POSITIVE;

/// Returns P(X > x) for X chi-square with `degrees_of_freedom` > 0; 1 at x ≤ 0, and at least [`LEAST`].
///
/// The relative error is below 1e-13 for up to 200 degrees of freedom, and grows in proportion beyond.
pub fn chi_square_tail(x: f64, degrees_of_freedom: usize) -> f64 {
    if x <= 0.0 { 1.0 } else { upper_gamma(degrees_of_freedom as f64 / 2.0, x / 2.0).max(LEAST) }
}

/// Returns P(|Z| > |z|) for Z standard normal, at least [`LEAST`].
pub fn normal_tails(z: f64) -> f64 {
    libm::erfc(z.abs() / std::f64::consts::SQRT_2).max(LEAST)
}

/// Q(a, x) = Γ(a, x)/Γ(a) for a > 0, x > 0.
fn upper_gamma(a: f64, x: f64) -> f64 {
    let front = (a * x.ln() - x - libm::lgamma(a)).exp();
    // Each converges fast on its side. On the left, Q is not small, so 1 - P loses no digits.
    if x < a + 1.0 { 1.0 - front * lower_series(a, x) } else { front * upper_fraction(a, x) }
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

/// The number of terms grows as √a near x = a; a million degrees of freedom need about 3000.
const MAX_TERMS: u32 = 100_000;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_is_that_of_mpmath_to_thirteen_digits() {
        // (x, degrees of freedom, mpmath 1.4.1 with 60 digits)
        let known = [
            (0.01, 1, 0.920344325445942),
            (1.0, 1, 0.3173105078629141),
            (3.841458820694124, 1, 0.05000000000000006),
            (16.8, 1, 4.153330286677667e-05),
            (60.0, 1, 9.485737571073848e-15),
            (0.5, 2, 0.7788007830714049),
            (9.21, 2, 0.010001702004705479),
            (1.0, 3, 0.8012519569012008),
            (7.815, 3, 0.04999390297488389),
            (80.0, 3, 3.069277486172417e-17),
            (0.3, 4, 0.9898141728888165),
            (5.0, 4, 0.2872974951836458),
            (3.0, 7, 0.8850022316431506),
            (14.1, 7, 0.049431074100403295),
            (150.0, 7, 4.0598800327763293e-29),
            (40.0, 63, 0.9895217674632926),
            (65.0, 63, 0.4068700121555521),
            (240.0, 63, 1.8107355643108074e-22),
            (150.0, 200, 0.996647558501813),
            (201.0, 200, 0.4668286137525534),
            (203.0, 200, 0.42757305368346665),
            (400.0, 200, 1.843893649711574e-15),
        ];
        for (x, degrees, expected) in known {
            let found = chi_square_tail(x, degrees);
            assert!((found / expected - 1.0).abs() < 1e-13, "{x} {degrees}: {found:e}, not {expected:e}");
            let other = chi_square_tail(x * (1.0 + 1e-11), degrees);
            assert!((other / expected - 1.0).abs() > 1e-13 || expected > 0.99, "{x} {degrees}: blind");
        }
    }

    #[test]
    fn the_tail_is_a_probability_everywhere() {
        for degrees in [1, 2, 3, 7, 50, 1001, 100_000] {
            for x in [-1.0, 0.0, 1e-300, 1e-3, 1.0, 999.0, 1001.0, 1e5, 1.01e5, 1e9, f64::MAX] {
                let tail = chi_square_tail(x, degrees);
                assert!((LEAST..=1.0).contains(&tail), "{x} {degrees}: {tail}");
            }
        }
    }

    #[test]
    fn both_tails_of_the_normal_distribution_are_that_of_chi_square_with_one_degree() {
        for z in [0.0, 0.3, -1.0, 1.959963984540054, 5.0, -12.0, 30.0] {
            let (found, expected) = (normal_tails(z), chi_square_tail(z * z, 1));
            assert!((found / expected - 1.0).abs() < 1e-12, "{z}: {found:e}, not {expected:e}");
        }
        assert_eq!(normal_tails(-50.0), LEAST);
    }
}
