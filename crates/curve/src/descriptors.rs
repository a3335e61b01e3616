//! Fourier descriptors: numbers that describe the shape of a closed polygon, whatever its place, size, direction and
//! first node.
//!
//! # Theory
//!
//! A closed curve z(s) of length L in the complex plane, with s its arclength, has the coefficients
//!
//! ```text
//! Z_m = 1/L ∫ z(s) e^{-2πims/L} ds.
//! ```
//!
//! For a polygon they are exact sums over its edges, however unequal these are (F. P. Kuhl and C. R. Giardina, *Comput.
//! Graph. Image Process.* 18, 1982, 236; here in complex form): with unit edge directions u_p from s_{p-1} to s_p,
//!
//! ```text
//! Z_m = L/(2πm)² Σ_p u_p (e^{-2πims_p/L} - e^{-2πims_{p-1}/L}),   m ≠ 0.
//! ```
//!
//! A translation changes only Z_0; a rotation and another first node turn the others; a scale multiplies them. The
//! ratios |Z_m|/|Z_1| are therefore invariant (C. T. Zahn and R. Z. Roskies, *IEEE Trans. Comput.* C-21, 1972, 269, use
//! the same invariances for the tangent angle). A curve with k-fold symmetry has only Z_{1+jk}, and a ripple of mode k
//! on a circle shows in the two nearest of them. Descriptor k joins these:
//!
//! ```text
//! d_k = √(|Z_{1+k}|² + |Z_{1-k}|²) / |Z_1|.
//! ```
//!
//! A circle has none, an ellipse even ones. A radius 1 + ε cos kθ has d_k = ε √((1 + 1/k²)/2) for small ε.

use std::f64::consts::TAU;

use glam::DVec2;

use super::polygon::edges;

/// The first and the last k: mode 1 is a translation.
pub const DESCRIPTORS: std::ops::RangeInclusive<u32> = 2..=8;

/// Number of descriptors.
pub const DESCRIPTOR_COUNT: usize = 7;

/// A smaller descriptor is the rounding of a curve that has none.
const ROUNDING: f64 = 1e-13;

/// The descriptors d_2 … d_8 of a closed polygon; NaN if it has no Z_1, as a polygon without length.
pub fn descriptors(points: &[DVec2]) -> [f64; DESCRIPTOR_COUNT] {
    /// The highest order, 1 + 8.
    const ORDERS: usize = DESCRIPTOR_COUNT + 2;
    let length: f64 = edges(points).map(DVec2::length).sum();
    // Sums of order m at index m - 1, of m and of -m.
    let mut sums = [[DVec2::ZERO; 2]; ORDERS];
    let mut s = 0.0;
    let mut before = [DVec2::X; ORDERS];
    for edge in edges(points) {
        let own = edge.length();
        if own == 0.0 {
            continue;
        }
        s += own;
        let direction = edge / own;
        let turn = DVec2::from_angle(-TAU * s / length);
        let mut power = DVec2::X;
        for (before, [positive, negative]) in before.iter_mut().zip(&mut sums) {
            power = power.rotate(turn);
            let step = power - *before;
            *positive += direction.rotate(step);
            // The power of -m is the conjugate one.
            *negative += direction.rotate(DVec2::new(step.x, -step.y));
            *before = power;
        }
    }
    let size = |m: usize, sign: usize| sums[m - 1][sign].length() / (m * m) as f64;
    let first = size(1, 0);
    std::array::from_fn(|i| {
        let k = i + 2;
        let descriptor = size(k + 1, 0).hypot(size(k - 1, 1)) / first;
        match descriptor {
            _ if !descriptor.is_finite() => f64::NAN,
            _ if descriptor < ROUNDING => 0.0,
            _ => descriptor,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon::turn_round;

    fn radial(n: usize, radius: impl Fn(f64) -> f64) -> Vec<DVec2> {
        (1..=n).map(|i| TAU * i as f64 / n as f64).map(|t| radius(t) * DVec2::from_angle(t)).collect()
    }

    fn assert_near(found: &[f64], expected: &[f64], bound: f64) {
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() <= bound, "{found} is not {expected} ± {bound}");
        }
    }

    #[test]
    fn a_ripple_of_a_circle_shows_in_its_own_descriptor() {
        let epsilon = 1e-4;
        for k in DESCRIPTORS {
            let found = descriptors(&radial(4000, |t| 1.0 + epsilon * (f64::from(k) * t + 0.3).cos()));
            for (at, d) in DESCRIPTORS.zip(found) {
                let own = epsilon * (0.5 * (1.0 + 1.0 / f64::from(k * k))).sqrt();
                let expected = if at == k { own } else { 0.0 };
                assert!((d - expected).abs() < 1e-3 * epsilon, "mode {k}: descriptor {at} is {d}, not {expected}");
            }
        }
    }

    #[test]
    fn place_size_direction_and_first_node_do_not_matter() {
        let curve = radial(101, |t| 1.0 + 0.2 * (2.0 * t).cos() + 0.1 * (3.0 * t).sin() + 0.05 * (5.0 * t).cos());
        let own = descriptors(&curve);
        assert!(own[0] > 0.1 && own[1] > 0.05);
        let turn = DVec2::from_angle(1.234);
        let mut moved: Vec<DVec2> = curve.iter().map(|p| 7.5 * p.rotate(turn) + DVec2::new(30.0, -4.0)).collect();
        moved.rotate_left(37);
        assert_near(&descriptors(&moved), &own, 1e-13);
        // More nodes on the same edges are the same curve.
        let halves = |pair: (&DVec2, &DVec2)| [*pair.0, 0.3 * *pair.0 + 0.7 * *pair.1];
        let fine: Vec<DVec2> = curve.iter().zip(curve.iter().cycle().skip(1)).flat_map(halves).collect();
        assert_near(&descriptors(&fine), &own, 1e-13);
        // Another shape has others.
        let other = descriptors(&radial(101, |t| 1.0 + 0.2 * (2.0 * t).cos() + 0.1 * (4.0 * t).sin()));
        assert!((other[1] - own[1]).abs() > 0.05);
        // A mirror image is run through the other way round.
        let mut mirrored: Vec<DVec2> = curve.iter().map(|p| DVec2::new(-p.x, p.y)).collect();
        turn_round(&mut mirrored);
        assert_near(&descriptors(&mirrored), &own, 1e-13);
    }

    #[test]
    fn a_square_has_the_descriptors_of_its_exact_coefficients() {
        // By hand: Z_m of a square is proportional to 1/m² for m = 1 + 4j and 0 for all others.
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(DVec2::from);
        let [four, eight] = [(25.0_f64, 9.0_f64), (81.0, 49.0)].map(|(a, b)| (1.0 / a).hypot(1.0 / b));
        assert_near(&descriptors(&square), &[0.0, 0.0, four, 0.0, 0.0, 0.0, eight], 1e-15);
    }

    #[test]
    fn a_point_has_no_descriptors() {
        assert!(descriptors(&[DVec2::ONE; 3]).iter().all(|d| d.is_nan()));
    }
}
