//! The rates and the step that suit a curve: multiples of the rate at which its excess decays once it is nearly round.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use crate::request::spec::{DEFAULT_OMEGA, DEFAULT_TAU};
use curvelax_curve::polygon;

/// The radius R that the rates below go by: of the circle of equal area, or of equal length if the curve is not simple,
/// when its area means nothing.
pub fn radius(nodes: &[DVec2]) -> f64 {
    let by_length = polygon::length(nodes) / TAU;
    let by_area = (polygon::signed_area(nodes).abs() / PI).sqrt();
    if polygon::turning_number(nodes).abs() == 1 { by_area } else { by_length }
}

/// 24/R⁴, the rate at which the excess of a nearly round curve of this radius decays under surface diffusion.
pub fn relaxation_rate(radius: f64) -> f64 {
    24.0 / radius.powi(4)
}

/// ω of `--omega auto` at a relaxation rate: 1/6 of it, the paper's ω = 1 for a circle of the area of its 2:1 ellipse.
pub fn own_omega(rate: f64) -> f64 {
    rate / 6.0
}

/// τ of `--tau auto` at a relaxation rate: 1/1000 of 1/ω, the paper's τ = 0.001 for the same circle.
pub fn own_tau(rate: f64) -> f64 {
    DEFAULT_TAU / (own_omega(rate) / DEFAULT_OMEGA)
}

/// The largest κ allowed for n nodes at a relaxation rate: n²/100 times it.
///
/// A pull that is strong compared with the relaxation undoes the redistribution, and the mesh falls apart. For the
/// nonconvex curve this happens at 20, 60 and 200 times the rate for n = 32, 64 and 100 (docs/internals/method.md).
pub fn strongest_pull(rate: f64, n: usize) -> f64 {
    (n as f64 / 10.0).powi(2) * rate
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Family, Spec};

    #[test]
    fn the_own_speed_and_step_of_a_curve_are_the_papers_for_its_ellipse_and_scale_with_the_curve() {
        let own = |shape: &str| {
            let spec = Spec { shape: shape.parse().unwrap(), amplitude: 0.0.into(), points: 400, ..Spec::default() };
            let rate = relaxation_rate(radius(&Family::new(&spec).unwrap().member(0).unwrap().nodes));
            [own_omega(rate), own_tau(rate)]
        };
        let ([omega, tau], [slow, long]) = (own("ellipse:2,1"), own("ellipse:64,32"));
        assert!((omega - 1.0).abs() < 1e-3 && (tau / 1e-3 - 1.0).abs() < 1e-3);
        assert_eq!([slow, long], [omega / 32_f64.powi(4), tau * 32_f64.powi(4)]);
        // Of an immersed curve, by its length.
        assert!(own("lemniscate:1").into_iter().all(f64::is_finite));
    }
}
