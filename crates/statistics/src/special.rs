//! Tails of the chi-square, the normal and the beta distribution.
//!
//! The first is an incomplete gamma function. The last is an incomplete beta function: the continued fraction 26.5.8 of
//! Abramowitz and Stegun, by Lentz's method.
//!
//! A probability that is too small for a normal f64 is returned as [`LEAST`], so that none is ever 0: an event that was
//! seen is not impossible.

use curvelax_base::gamma;

/// The smallest probability that is returned.
pub const LEAST: f64 = f64::MIN_POSITIVE;

/// Returns P(X > x) for X chi-square with `degrees_of_freedom` > 0; 1 at x ≤ 0, and at least [`LEAST`].
///
/// The relative error is below 1e-13 for up to 200 degrees of freedom, and grows in proportion beyond.
pub fn chi_square_tail(x: f64, degrees_of_freedom: usize) -> f64 {
    if x <= 0.0 { 1.0 } else { gamma::upper(degrees_of_freedom as f64 / 2.0, x / 2.0).max(LEAST) }
}

/// Returns P(|Z| > |z|) for Z standard normal, at least [`LEAST`].
pub fn normal_tails(z: f64) -> f64 {
    libm::erfc(z.abs() / std::f64::consts::SQRT_2).max(LEAST)
}

/// Returns P(X ≤ x) for X with the law Beta(a, b), a > 0, b > 0; for whole numbers that of at most b - 1 successes
/// among a + b - 1 draws with the probability 1 - x.
///
/// The relative error is below 1e-12 for a + b up to 1000, and grows in proportion beyond.
pub fn beta_share(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    let powers = a * x.ln() + b * (-x).ln_1p();
    let front = (powers + libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b)).exp();
    // The fraction converges fast below the mean.
    if x < (a + 1.0) / (a + b + 2.0) {
        front * beta_fraction(x, a, b) / a
    } else {
        1.0 - front * beta_fraction(1.0 - x, b, a) / b
    }
}

/// 1/(1 + d₁/(1 + d₂/(1 + …))) with d_2m = m(b-m)x/((a+2m-1)(a+2m)), d_2m+1 = -(a+m)(a+b+m)x/((a+2m)(a+2m+1)).
fn beta_fraction(x: f64, a: f64, b: f64) -> f64 {
    let coefficient = |j: u32| {
        let (m, place) = (f64::from(j / 2), a + f64::from(j));
        match j % 2 {
            0 => m * (b - m) * x / ((place - 1.0) * place),
            _ => -(a + m) * (a + b + m) * x / ((place - 1.0) * place),
        }
    };
    let (mut c, mut d, mut fraction) = (1.0, 0.0, 1.0);
    for j in 1..MAX_TERMS {
        let numerator = coefficient(j);
        d = 1.0 / (1.0 + numerator * d);
        c = 1.0 + numerator / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    1.0 / fraction
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

    #[test]
    fn the_share_of_a_beta_law_is_that_of_mpmath() {
        // (a, b, x, mpmath 1.3.0 with 40 digits, digits that rounding leaves)
        let known = [
            (1.0, 1.0, 0.3, 0.3, 1e-13),
            (6.0, 1.0, 0.5, 0.015625, 1e-13),
            (4.0, 3.0, 0.5, 0.34375, 1e-13),
            (0.5, 2.25, 0.1, 0.4855879234426, 1e-12),
            (12.5, 7.75, 0.6, 0.4234148955396275, 1e-13),
            (71.0, 2.0, 0.95, 0.11923050191295986, 1e-13),
            (500.5, 480.25, 0.5, 0.25884413617294956, 1e-11),
            (1e4, 1.02e4, 0.5, 0.920_321_232_740_766_7, 1e-10),
            (5e6, 5.0031e6, 0.5, 0.836_494_998_584_235_4, 1e-7),
            (99001.0, 1000.0, 0.99, 0.4957313120278771, 1e-9),
            (2.0, 1000.0, 0.004, 0.909_153_452_322_052_3, 1e-12),
            (3.0, 400.0, 0.0001, 1.0430265865357733e-5, 1e-12),
            (40.0, 1.0, 0.999, 0.960_770_210_735_811_8, 1e-13),
        ];
        for (a, b, x, expected, bound) in known {
            let found = beta_share(x, a, b);
            assert!((found / expected - 1.0).abs() < bound, "{a} {b} {x}: {found:e}, not {expected:e}");
            let other = beta_share(x * (1.0 - 1e-5), a, b);
            assert!((other / expected - 1.0).abs() > bound, "{a} {b} {x}: blind");
        }
        assert_eq!([-1.0, 0.0, 1.0, 2.0].map(|x| beta_share(x, 2.0, 3.0)), [0.0, 0.0, 1.0, 1.0]);
    }
}
