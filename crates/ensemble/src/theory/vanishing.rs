//! When a driven circle has shrunk to a point.
//!
//! Its radius falls at the rate `b(1/R) + F`, so that its life is the integral of the inverse over the radius:
//!
//! ```text
//! t = ∫₀ᴿ dR / (b(1/R) + F(πR²))
//! ```
//!
//! Under surface diffusion and a constant force that is R/F. The area of any simple curve falls at the rate F L or
//! faster than that of the circle of the same area, which so lives longest.

use std::f64::consts::PI;

use curvelax_flow::{flow::Flow, forcing::Forcing};

/// Excess up to which a curve is so near its shape at rest that what is left of its life is that of this shape.
pub(crate) const LITTLE_EXCESS: f64 = 1e-3;

/// Parts into which the radius is cut, with four points each.
const PANELS: u32 = 32;
/// Places and weights of Gauss's rule with four points on [-1, 1].
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// The time after which a circle of this radius has shrunk to a point, for unit mobility; `None` without a driving
/// force, or if it comes to rest before, or grows.
pub fn vanishes_after(flow: &Flow, forcing: &Forcing, radius: f64) -> Option<f64> {
    let drive = forcing.drive?;
    let half = 0.5 * radius / f64::from(PANELS);
    let mut t = 0.0;
    for panel in 0..PANELS {
        for (place, weight) in GAUSS {
            let r = half * (f64::from(2 * panel + 1) + place);
            let pace = flow.b(1.0 / r) + drive.at(PI * r * r);
            if !(pace > 0.0 && r > 0.0) {
                return None;
            }
            t += weight * half / pace;
        }
    }
    Some(t).filter(|t| t.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(flow: &str, drive: &str, radius: f64) -> Option<f64> {
        let forcing = Forcing { drive: Some(drive.parse().unwrap()), ..Forcing::default() };
        vanishes_after(&flow.parse().unwrap(), &forcing, radius)
    }

    #[test]
    fn a_driven_circle_vanishes_at_its_radius_over_the_force() {
        for (radius, force) in [(1.0, 0.5), (3.0, 7.0), (1e-6, 2.0)] {
            let t = after("surface-diffusion", &force.to_string(), radius).unwrap();
            assert!((t / (radius / force) - 1.0).abs() < 1e-14, "{t}");
        }
        // R' = -c/R - F has R - (c/F) ln(1 + F R/c) = F t.
        let (c, force) = (2.0, 0.5);
        let t = after("poly:2", "0.5", 1.5).unwrap();
        assert!((t - (1.5 - c / force * (1.0_f64 + force * 1.5 / c).ln()) / force).abs() < 1e-12, "{t}");
        // A feedback that shrinks ever faster: R' = -g (a - πR²).
        let (gain, area, radius) = (0.3_f64, 20.0_f64, 1.0_f64);
        let root = (area / PI).sqrt();
        let exact = ((root + radius) / (root - radius)).ln() / (2.0 * gain * PI * root);
        assert!((after("surface-diffusion", "feedback:-0.3,20", radius).unwrap() / exact - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_circle_that_grows_or_comes_to_rest_does_not_vanish() {
        // Willmore flow pushes small circles back, and a feedback stops at its area.
        for (flow, drive) in [
            ("surface-diffusion", "-0.5"),
            ("surface-diffusion", "0"),
            ("willmore", "9"),
            ("surface-diffusion", "feedback:1,2"),
        ] {
            assert_eq!(after(flow, drive, 1.0), None, "{flow} {drive}");
        }
        assert_eq!(vanishes_after(&Flow::SurfaceDiffusion, &Forcing::default(), 1.0), None);
    }
}
