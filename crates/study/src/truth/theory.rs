//! A circle and a small mode on it, by linear theory along R(t).

use curvelax_flow::flow::Flow;

/// Steps of the fourth-order quadrature below; its error is far below 1e-10 for decays of about 1.
const STEPS: u32 = 1000;

/// A circle and a small mode on it at the final time.
#[derive(Clone, Copy, Debug)]
pub struct CircleMode {
    /// Radius at the final time.
    pub radius: f64,
    /// `ln(a(0)/a(t))` of the amplitude a, a length.
    pub decay: f64,
}

/// Returns the circle of radius `radius` with a small mode `m` after the time `end`: `R' = -b(1/R)` and
/// `∫ rate_m(R(t)) dt`, by the classical Runge–Kutta method.
pub fn circle_mode(flow: &Flow, radius: f64, m: u32, end: f64) -> CircleMode {
    let slope = |r: f64| -flow.b(1.0 / r);
    let h = end / f64::from(STEPS);
    (0..STEPS).fold(CircleMode { radius, decay: 0.0 }, |CircleMode { radius: r, decay }, _| {
        let s1 = slope(r);
        let s2 = slope(r + 0.5 * h * s1);
        let s3 = slope(r + 0.5 * h * s2);
        let s4 = slope(r + h * s3);
        let after = r + h / 6.0 * (s1 + 2.0 * s2 + 2.0 * s3 + s4);
        let [first, middle, last] = [r, r + 0.5 * h * s2, after].map(|r| flow.linear_rate(m, r));
        CircleMode { radius: after, decay: decay + h / 6.0 * (first + 4.0 * middle + last) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `R(t) = (R₀⁴ + 2t)^(1/4)`, and for modes `(1 + 2t/R₀⁴)^(-(m²-1)(m²-3/2)/2)`.
    #[test]
    fn the_linear_theory_of_willmore_flow_is_the_closed_form() {
        for (m, radius, end) in [(2, 1.0_f64, 0.1), (3, 1.3, 0.02)] {
            let found = circle_mode(&Flow::Willmore, radius, m, end);
            let m2 = f64::from(m * m);
            let exact = 0.5 * (m2 - 1.0) * (m2 - 1.5) * (1.0 + 2.0 * end / radius.powi(4)).ln();
            assert!((found.radius - (radius.powi(4) + 2.0 * end).powf(0.25)).abs() < 1e-12, "{found:?}");
            assert!((found.decay / exact - 1.0).abs() < 1e-8, "mode {m}: {found:?} instead of {exact}");
        }
    }

    #[test]
    fn on_a_circle_at_rest_the_decay_is_exponential() {
        let found = circle_mode(&Flow::Elastic(0.5), 1.0, 3, 0.01);
        assert!((found.radius - 1.0).abs() < 1e-14 && (found.decay - 0.64).abs() < 1e-12, "{found:?}");
    }
}
