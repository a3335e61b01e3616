//! The curve towards which a flow relaxes closed curves, and the distance from it: the excess.
//!
//! Relaxation times, rates, events and the theory of both ask the flow for its [`Equilibrium`]. An anisotropic surface
//! energy has another one, the Wulff shape, with that energy in place of the length.

use std::f64::consts::PI;

use crate::number::Number;

/// The shape of a curve at rest, of any size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Equilibrium {
    /// The circle; among n-gons the regular one.
    Circle,
}

impl Equilibrium {
    /// The name of the distance from it, in a sentence: "the excess, …".
    pub const fn excess_in_words(self) -> &'static str {
        match self {
            Equilibrium::Circle => "L²/(4πA) above that of a regular polygon",
        }
    }

    /// Returns `L²/(4πA)` of a curve: least at equilibrium.
    #[inline(always)]
    pub fn quotient<N: Number>(self, length: N, area: N) -> N {
        match self {
            Equilibrium::Circle => length * length / (N::of(4.0 * PI) * area),
        }
    }

    /// Returns that of n ≥ 3 nodes at equilibrium: `(n/π)·tan(π/n)` of the regular n-gon.
    ///
    /// The quotient alone would leave a relaxed polygon 1 + π²/(3n²) above a circle's 1 for ever.
    pub fn least_quotient(self, n: usize) -> f64 {
        let n = n as f64;
        match self {
            Equilibrium::Circle => n / PI * (PI / n).tan(),
        }
    }

    /// Returns the excess of a polygon of `n` nodes: 0 at equilibrium, and above 0 for every other embedded
    /// counter-clockwise polygon. Dimensionless.
    pub fn excess(self, length: f64, area: f64, n: usize) -> f64 {
        self.quotient(length, area) - self.least_quotient(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_polygon_has_no_excess_and_an_ellipse_its_own() {
        for n in [3, 4, 100, 1001_usize] {
            let (sine, cosine) = (PI / n as f64).sin_cos();
            let of = |radius: f64| (2.0 * n as f64 * radius * sine, n as f64 * radius * radius * sine * cosine);
            for (length, area) in [of(1.0), of(1e-3)] {
                assert!(Equilibrium::Circle.excess(length, area, n).abs() < 1e-13, "{n}");
            }
        }
        // A 2:1 ellipse of many nodes.
        let excess = Equilibrium::Circle.excess(9.688_448_220_547_675, 2.0 * PI, 1_000_000);
        assert!((excess - (9.688_448_220_547_675_f64.powi(2) / (8.0 * PI * PI) - 1.0)).abs() < 1e-11, "{excess}");
    }
}
