//! The standard normal law.

/// The quantile of the standard normal law at `u` in (0, 1), good to 16 digits.
///
/// Wichura's algorithm AS 241 (PPND16, Applied Statistics 37, 1988).
pub fn normal_quantile(u: f64) -> f64 {
    let centred = u - 0.5;
    if centred.abs() <= 0.425 {
        let r = 0.180625 - centred * centred;
        return centred * ratio(&CENTRE, r);
    }
    let tail = if centred < 0.0 { u } else { 1.0 - u };
    let r = (-tail.ln()).sqrt();
    let size = if r <= 5.0 { ratio(&TAIL, r - 1.6) } else { ratio(&FAR_TAIL, r - 5.0) };
    if centred < 0.0 { -size } else { size }
}

/// The ratio of two polynomials, with coefficients from the highest power down.
fn ratio([over, under]: &[[f64; 8]; 2], r: f64) -> f64 {
    let [over, under] = [over, under].map(|of| of.iter().fold(0.0, |sum, c| sum * r + c));
    over / under
}

#[rustfmt::skip]
const CENTRE: [[f64; 8]; 2] = [
    [2509.0809287301227, 33430.57558358813, 67265.7709270087,
     45921.95393154987, 13731.69376550946, 1971.5909503065513,
     133.14166789178438, 3.3871328727963665],
    [5226.495278852854, 28729.085735721943, 39307.89580009271,
     21213.794301586597, 5394.196021424751, 687.1870074920579,
     42.31333070160091, 1.0],
];
#[rustfmt::skip]
const TAIL: [[f64; 8]; 2] = [
    [0.0007745450142783414, 0.022723844989269184, 0.2417807251774506,
     1.2704582524523684, 3.6478483247632045, 5.769497221460691,
     4.630337846156546, 1.4234371107496835],
    [1.0507500716444169e-9, 0.0005475938084995345, 0.015198666563616457,
     0.14810397642748008, 0.6897673349851, 1.6763848301838038,
     2.053191626637759, 1.0],
];
#[rustfmt::skip]
const FAR_TAIL: [[f64; 8]; 2] = [
    [2.0103343992922881e-7, 2.7115555687434876e-5, 0.0012426609473880784,
     0.026532189526576124, 0.29656057182850487, 1.7848265399172913,
     5.463784911164114, 6.657904643501103],
    [2.0442631033899397e-15, 1.421511758316446e-7, 1.8463183175100548e-5,
     0.0007868691311456133, 0.014875361290850615, 0.1369298809227358,
     0.599832206555888, 1.0],
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::distribution::SMALLEST;

    #[test]
    fn the_normal_quantile_is_the_inverse_of_the_error_function() {
        let pinned = [(0.9, 1.2815515655446008), (0.001, -3.090232306167813), (1e-10, -6.361340902404056)];
        for (u, z) in pinned {
            assert!((normal_quantile(u) - z).abs() < 4e-16 * z.abs(), "{u}: {}", normal_quantile(u));
        }
        assert_eq!(normal_quantile(0.5), 0.0);
        for k in 1..400 {
            // Both tails down to the smallest number that is drawn, and the middle.
            for u in [f64::from(k) / 400.0, SMALLEST.powf(f64::from(k) / 400.0)] {
                let z = normal_quantile(u);
                let back = 0.5 * libm::erfc(-z / std::f64::consts::SQRT_2);
                assert!((back / u - 1.0).abs() < 1e-13, "{u}: {back}");
                assert!((normal_quantile(1.0 - u) + z).abs() < 1e-15 + 1e-15 / u.min(1.0 - u), "{u}");
            }
        }
    }
}
