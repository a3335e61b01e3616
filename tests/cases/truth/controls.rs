//! How the problems of the table are tested: at which resolution, within which bound, and which known mistake must fail
//! it (`docs/internals/method.md#exact-facts-that-tests-use`).

use std::f64::consts::{PI, TAU};

use curvelax::{
    ensemble::request::spec::Precision,
    truth::{Beside, Problem, Resolution},
};

/// The test of a problem.
pub struct Control {
    /// The value that a mistake would give.
    pub mistaken: f64,
    /// The mistake.
    pub mistake: &'static str,
    /// Bound on the error relative to the exact value.
    pub bound: ErrorBound,
    /// Nodes: enough to detect the mistake.
    n: usize,
    steps: u32,
    /// Final time of the problem.
    t_end: f64,
}

/// Largest relative error, as a sum: `space·(100/n)² + time·(100/steps) + rounding`.
pub struct ErrorBound {
    /// Error at n = 100 with a vanishing step.
    space: f64,
    /// Error of 100 steps with a vanishing spacing.
    pub time: f64,
    /// Error of f32, and of sweeps that end at its tolerance.
    single: f64,
}

impl Control {
    /// The test of `problem`.
    pub fn of(problem: &Problem) -> Control {
        let &Problem { t_end, exact, .. } = problem;
        let name = problem.name.as_str();
        let (family, m) = name.split_once("-mode-").unwrap_or((name, "0"));
        let m = m.parse::<u32>().expect("a mode");
        let m2 = f64::from(m * m);
        let grown = 3.0_f64.powf(0.25);
        let (mistaken, mistake) = match family {
            "willmore-circle" | "willmore-double-circle" => (2.0_f64.powf(0.25), "R⁴ grows by t"),
            "elastic-circle" | "surface-diffusion-double-circle" => (grown, "the circle grows as under Willmore flow"),
            "surface-diffusion" => (m2 * m2 * t_end, "the rate m⁴ of a straight line"),
            "willmore" if m == 2 => (exact + 0.25 * (1.0 + 2.0 * t_end).ln(), "the amplitude over R"),
            "willmore" => (m2 / (m2 - 1.5) * exact, "b = 0 in the rate"),
            "elastic" => (m2 * (m2 - 1.0) * t_end, "the rate m²(m²-1) of surface diffusion"),
            "polynomial" => (m2 * (m2 - 1.0) * t_end, "b = 0"),
            "ellipse-area" => (1.06 * TAU, "the drift of sweeps that end too early"),
            "ellipse-length" => (TAU * 2.0_f64.sqrt(), "the circle of the same area"),
            "lemniscate" => (exact * ((1.0 - 20.0 * t_end) / 0.05).powf(0.25), "extinct at a⁴/20"),
            "driven-circle" => (0.5 * PI, "the area falls at the rate F L(0)"),
            "driven" => (m2 * (m2 - 1.0) * t_end, "a circle that does not grow"),
            "area-kept" => (9.0 * t_end, "the rate (m²-1)² of a kept length"),
            "length-kept" => (7.5 * t_end, "the rate (m²-1)(m²-3/2) of a kept area"),
            "crystal-wave" => {
                let Beside::Energy(energy) = problem.beside else { panic!("a crystal without its energy") };
                (12.0 * (PI / energy.wulff_area()).powi(2) * t_end, "the rate of a circle of that area")
            }
            _ => panic!("{name}: no test"),
        };
        let (space, time, single) = match family {
            "willmore-circle" => (2.5e-4, 1.3e-3, 1e-4),
            "willmore-double-circle" => (1e-3, 1.3e-3, 1e-4),
            "elastic-circle" => (5.6e-4, 1e-6, 1e-4),
            "surface-diffusion-double-circle" => (1.7e-3, 1e-6, 1e-4),
            "ellipse-area" => (8.5e-4, 1e-4, 1e-4),
            "ellipse-length" => (8e-5, 4.2e-4, 1e-5),
            "lemniscate" => (5.3e-3, 5e-2, 1e-3),
            // Nodes of a regular polygon move exactly, whatever the step.
            "driven-circle" => (8.5e-4, 1e-9, 1e-4),
            "driven" => (6.5e-3, 2.4e-2, 4e-3),
            "area-kept" => (3.5e-3, 4.5e-2, 4e-3),
            "length-kept" => (3.3e-3, 3.75e-2, 4e-3),
            "crystal-wave" => (6.5e-3, 7e-3, 4e-3),
            // The implicit step is off by half a step's decay, and the fourth differences by O(m²h²).
            _ => (2.5e-3 + 8.7e-4 * m2, 6e-3, 4e-3),
        };
        let n = if m < 4 { 66 } else { 198 };
        let steps = if m > 0 || family == "crystal-wave" { 100 } else { 200 };
        Control { mistaken, mistake, bound: ErrorBound { space, time, single }, n, steps, t_end }
    }

    /// The resolution at which the problem is tested.
    pub fn resolution(&self) -> Resolution {
        Resolution { n: self.n, tau: Some(self.t_end / f64::from(self.steps)), tolerance: None }
    }

    /// The bound on the error relative to the exact value at a resolution; without fixed steps that of one step.
    pub fn bound_at(&self, at: Resolution, precision: Precision) -> f64 {
        let ErrorBound { space, time, single } = self.bound;
        let rounding = if precision == Precision::F32 { single } else { 1e-9 };
        space * (100.0 / at.n as f64).powi(2) + time * 100.0 / (self.t_end / at.tau.unwrap_or(self.t_end)) + rounding
    }
}
