//! The curve towards which a flow relaxes closed curves, and the distance from it: the excess.
//!
//! Relaxation times, rates, events and the theory of both ask the flow for its [`Equilibrium`]. An anisotropic surface
//! energy has another one, the Wulff shape, with that energy in place of the length.

use std::f64::consts::PI;

use glam::DVec2;

use crate::crystal::Energy;

/// The shape of a curve at rest, of any size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Equilibrium {
    /// The circle; among n-gons the regular one.
    Circle,
    /// The Wulff shape of a surface energy.
    Wulff(Energy),
}

impl Equilibrium {
    /// The name of the distance from it, in a sentence: "the excess, …".
    pub const fn excess_in_words(self) -> &'static str {
        match self {
            Equilibrium::Circle => "L²/(4πA) above that of a regular polygon",
            Equilibrium::Wulff(_) => "E²/(4|W|A) above that of the Wulff shape",
        }
    }

    /// Returns |W|, the area of the shape whose support function is the surface energy: the unit circle's, π.
    pub fn area(self) -> f64 {
        match self {
            Equilibrium::Circle => PI,
            Equilibrium::Wulff(energy) => energy.wulff_area(),
        }
    }

    /// Returns `E²/(4|W|A)` of a curve of surface energy E, which is the length L of isotropic curves: least at
    /// equilibrium.
    pub fn quotient(self, tension: f64, area: f64) -> f64 {
        tension * tension / (4.0 * self.area() * area)
    }

    /// Returns that of n ≥ 3 nodes at equilibrium: `(n/π)·tan(π/n)` of the regular n-gon; of a Wulff shape with evenly
    /// spaced nodes.
    ///
    /// The quotient alone would leave a relaxed polygon 1 + π²/(3n²) above a circle's 1 permanently.
    pub fn least_quotient(self, n: usize) -> f64 {
        match self {
            Equilibrium::Circle => {
                let n = n as f64;
                n / PI * (PI / n).tan()
            }
            Equilibrium::Wulff(energy) => {
                let nodes = energy.wulff_nodes(n);
                let cross = |i: usize| nodes[i].perp_dot(nodes[(i + 1) % n]);
                self.quotient(energy.of_polygon(&nodes), 0.5 * (0..n).map(cross).sum::<f64>())
            }
        }
    }

    /// Returns the excess of a polygon of `n` nodes: 0 at equilibrium, and above 0 for every other embedded
    /// counter-clockwise polygon. Dimensionless.
    pub fn excess(self, tension: f64, area: f64, n: usize) -> f64 {
        self.quotient(tension, area) - self.least_quotient(n)
    }

    /// Returns the surface energy of a closed polygon; of an isotropic one its length.
    pub fn tension(self, nodes: &[DVec2]) -> f64 {
        match self {
            Equilibrium::Circle => {
                let n = nodes.len();
                (0..n).map(|i| nodes[i].distance(nodes[(i + 1) % n])).sum()
            }
            Equilibrium::Wulff(energy) => energy.of_polygon(nodes),
        }
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
