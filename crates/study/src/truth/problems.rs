//! The single table of problems: each with its exact solution and the measured quantity. What bounds their errors, and
//! the known mistake that fails each bound, is with the tests (`tests/cases/truth/controls.rs`).

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use super::{Measure, circle_mode};
use curvelax_base::error::{Error, Result, did_you_mean};
use curvelax_curve::{BaseCurve, Sampling};
use curvelax_ensemble::request::spec::Precision;
use curvelax_flow::{
    crystal::Energy,
    flow::Flow,
    forcing::{Conserved, Drive, Forcing},
};

/// Length of the lemniscate of half-width 1: 4·∫₀¹ dx/√(1-x⁴).
const LEMNISCATE: f64 = 5.244_115_108_584_239;

/// How finely a problem is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Nodes.
    pub n: usize,
    /// Time step τ, of fixed steps.
    pub tau: Option<f64>,
    /// Local error tolerance of adaptive steps, which replace these.
    pub tolerance: Option<f64>,
}

/// Time at which the lemniscate of half-width 1 vanishes under surface diffusion: `a(t) = (1 - 24t)^(1/4)`.
pub const LEMNISCATE_LIFE: f64 = 1.0 / 24.0;

/// Length of the 2:1 ellipse at t = 0.1 under surface diffusion: an independent spectral solution, to all digits.
const ELLIPSE_LENGTH: f64 = 9.357_700_6;

/// A curve at the start of a problem, as a function of `u ∈ [0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartCurve {
    /// A circle traversed `turns` times.
    Circle {
        /// Radius R.
        radius: f64,
        /// Turning number.
        turns: u32,
    },
    /// `r = 1 + a·cos mθ` with a small a that depends on the precision.
    Mode(u32),
    /// The Wulff shape of `CRYSTAL` with a small wave that keeps its form.
    Wulff,
    /// `(2 cos 2πu, sin 2πu)`.
    Ellipse,
    /// `(cos v, sin v cos v)/(1 + sin² v)`, v = 2πu: of half-width 1 and turning number 0.
    Lemniscate,
}

/// The energy of the crystal, a small wave on its Wulff shape that keeps its form, by the factors of cos 2ψ, cos 6ψ, …
/// in the support function, and the rate at which it decays: an eigenvector of the theory of
/// `docs/internals/method.md#crystals`.
const CRYSTAL: &str = "cos:4,0.03";
const CRYSTAL_WAVE: [f64; 5] = [1.0, -3.401_574_638e-2, 9.336_140_23e-4, -2.003_020_95e-5, 1.715_918_6e-7];
const CRYSTAL_SIZE: f64 = 5e-3;
const CRYSTAL_RATE: f64 = 15.427_810_720;

/// What a flow has besides its own law.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Beside {
    /// Nothing.
    #[default]
    Nothing,
    /// A surface energy that depends on the direction.
    Energy(Energy),
    /// A driving force.
    Drive(Drive),
    /// Something is kept.
    Conserved(Conserved),
}

/// A problem with an exact solution.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Its name on the command line.
    pub name: String,
    /// The law of motion.
    pub flow: Flow,
    /// What acts beside it.
    pub beside: Beside,
    /// The start.
    pub curve: StartCurve,
    /// Final time.
    pub t_end: f64,
    /// The quantity measured at the final time.
    pub measure: Measure,
    /// Its exact value.
    pub exact: f64,
}

impl Problem {
    /// Returns the problem of this name.
    ///
    /// # Errors
    /// [`Error::Request`] with the nearest name if there is none.
    pub fn named(name: &str) -> Result<Problem> {
        let mut all = problems();
        match all.iter().position(|problem| problem.name == name) {
            Some(index) => Ok(all.swap_remove(index)),
            None => {
                let names: Vec<&str> = all.iter().map(|problem| problem.name.as_str()).collect();
                let meant = did_you_mean(name, names.iter().copied());
                let problem = format!("there is no such problem{meant}");
                Err(Error::value("problem", name, &problem, &format!("there are {}", names.join(", "))))
            }
        }
    }

    /// Returns the resolution of n nodes and `steps` equal steps.
    pub fn in_steps(&self, n: usize, steps: u32) -> Resolution {
        Resolution { n, tau: Some(self.t_end / f64::from(steps)), tolerance: None }
    }
}

impl StartCurve {
    /// Relative amplitude of a small mode. The terms neglected by linear theory are of its square, rounding is of its
    /// inverse.
    fn amplitude(precision: Precision) -> f64 {
        if precision == Precision::F32 { 1e-2 } else { 1e-4 }
    }

    /// Returns the curve for a run in `precision`.
    pub fn resolve(self, precision: Precision) -> BaseCurve {
        match self {
            StartCurve::Circle { radius, turns } => {
                let whole = TAU * f64::from(turns);
                BaseCurve::from_formula(move |u| radius * DVec2::from_angle(whole * u))
            }
            StartCurve::Mode(m) => {
                let a = StartCurve::amplitude(precision);
                let radius = move |theta: f64| 1.0 + a * (f64::from(m) * theta).cos();
                BaseCurve::from_formula(move |u| radius(TAU * u) * DVec2::from_angle(TAU * u))
            }
            StartCurve::Wulff => {
                // Steps see the errors of the whole curve, so that a wave that is far smaller is lost in them. The
                // terms that are neglected are of its square.
                let (a, energy) = (StartCurve::amplitude(precision).max(CRYSTAL_SIZE), crystal());
                BaseCurve::from_formula(move |u| {
                    let psi = TAU * u;
                    let normal = DVec2::from_angle(psi);
                    let waves = CRYSTAL_WAVE.iter().zip([2.0, 6.0, 10.0, 14.0, 18.0]);
                    let wave = |(size, m): (&f64, f64)| {
                        let (sine, cosine) = (m * psi).sin_cos();
                        a * size * (cosine * normal - m * sine * normal.perp())
                    };
                    energy.wulff_point(psi) + waves.map(wave).sum::<DVec2>()
                })
            }
            StartCurve::Ellipse => BaseCurve::from_formula(|u| DVec2::new(2.0, 1.0) * DVec2::from_angle(TAU * u)),
            StartCurve::Lemniscate => BaseCurve::from_formula(|u| {
                let (sin, cos) = (TAU * u).sin_cos();
                DVec2::new(cos, sin * cos) / (1.0 + sin * sin)
            }),
        }
    }

    /// Returns the spacing of the nodes: for a circle and its modes equal in the angle, for the others along the curve.
    pub fn sampling(self) -> Sampling {
        match self {
            StartCurve::Circle { .. } | StartCurve::Mode(_) => Sampling::Parameter,
            StartCurve::Wulff | StartCurve::Ellipse | StartCurve::Lemniscate => Sampling::Arclength,
        }
    }
}

/// Returns all problems.
pub fn problems() -> Vec<Problem> {
    let mut all = circles();
    all.extend((2..=6).flat_map(modes));
    all.extend(ellipse());
    all.push(lemniscate());
    all.extend(driven());
    all.extend(kept());
    all.push(crystal_wave());
    all
}

/// Circles, once and twice round: the second has twice the turning number and must move like the first.
fn circles() -> Vec<Problem> {
    let circle = |name: &str, flow: Flow, turns: u32, exact: f64| Problem {
        name: name.into(),
        flow,
        beside: Beside::Nothing,
        curve: StartCurve::Circle { radius: 1.0, turns },
        t_end: 1.0,
        measure: Measure::Radius,
        exact,
    };
    let grown = 3.0_f64.powf(0.25);
    vec![
        circle("willmore-circle", Flow::Willmore, 1, grown),
        circle("willmore-double-circle", Flow::Willmore, 2, grown),
        circle("elastic-circle", Flow::Elastic(0.5), 1, 1.0),
        circle("surface-diffusion-double-circle", Flow::SurfaceDiffusion, 2, 1.0),
    ]
}

/// A small mode m of the unit circle under each kind of flow, until it has decayed to about 1/e.
fn modes(m: u32) -> [Problem; 4] {
    let m2 = f64::from(m * m);
    let mode = |name: &str, flow: Flow, exact: &dyn Fn(f64) -> f64| {
        let t_end = 1.0 / flow.linear_rate(m, 1.0);
        Problem {
            name: format!("{name}-mode-{m}"),
            flow,
            beside: Beside::Nothing,
            curve: StartCurve::Mode(m),
            t_end,
            measure: Measure::Decay(m),
            exact: exact(t_end),
        }
    };
    let polynomial = Flow::Polynomial(vec![3.0, -1.0, 0.2, 0.1]);
    let along = polynomial.clone();
    [
        mode("surface-diffusion", Flow::SurfaceDiffusion, &|t| m2 * (m2 - 1.0) * t),
        mode("willmore", Flow::Willmore, &|t| 0.5 * (m2 - 1.0) * (m2 - 1.5) * (1.0 + 2.0 * t).ln()),
        mode("elastic", Flow::Elastic(0.5), &|t| (m2 - 1.0).powi(2) * t),
        mode("polynomial", polynomial, &|t| circle_mode(&along, 1.0, m, t).decay),
    ]
}

/// Surface diffusion conserves the area of an ellipse; and its length during the run.
fn ellipse() -> [Problem; 2] {
    [("ellipse-area", Measure::Area, TAU), ("ellipse-length", Measure::Length, ELLIPSE_LENGTH)].map(
        |(name, measure, exact)| Problem {
            name: name.into(),
            flow: Flow::SurfaceDiffusion,
            beside: Beside::Nothing,
            curve: StartCurve::Ellipse,
            t_end: 0.1,
            measure,
            exact,
        },
    )
}

/// The lemniscate shrinks like `a(t) = (1 - 24t)^(1/4)`; here at 95 % of its life.
fn lemniscate() -> Problem {
    let left: f64 = 0.05;
    Problem {
        name: "lemniscate".into(),
        flow: Flow::SurfaceDiffusion,
        beside: Beside::Nothing,
        curve: StartCurve::Lemniscate,
        t_end: (1.0 - left) * LEMNISCATE_LIFE,
        measure: Measure::Length,
        exact: LEMNISCATE * left.powf(0.25),
    }
}

/// A circle that is driven inwards, and a small mode 3 of one that is driven outwards: ln(a(0)/a(t)) is
/// m²(m²-1)/(3|F|) (1/R(0)³ - 1/R(t)³).
fn driven() -> [Problem; 2] {
    let of = |name: &str, force: f64, curve: StartCurve, t_end: f64, measure: Measure, exact: f64| Problem {
        name: name.into(),
        flow: Flow::SurfaceDiffusion,
        beside: Beside::Drive(Drive::Constant(force)),
        curve,
        t_end,
        measure,
        exact,
    };
    let (force, m2, t_end) = (10.0_f64, 9.0, 0.02);
    let decay = m2 * (m2 - 1.0) / (3.0 * force) * (1.0 - (1.0 + force * t_end).powi(-3));
    [
        of("driven-circle", 0.5, StartCurve::Circle { radius: 1.0, turns: 1 }, 0.5, Measure::Area, 0.5625 * PI),
        of("driven-mode-3", -force, StartCurve::Mode(3), t_end, Measure::Decay(3), decay),
    ]
}

/// A small mode 2 under Willmore flow that keeps the area, and so the circle, or the length.
fn kept() -> [Problem; 2] {
    [("area-kept-mode-2", Conserved::Area), ("length-kept-mode-2", Conserved::Length)].map(|(name, conserved)| {
        let forcing = Forcing { conserved: Some(conserved), ..Forcing::default() };
        Problem {
            name: name.into(),
            flow: Flow::Willmore,
            beside: Beside::Conserved(conserved),
            curve: StartCurve::Mode(2),
            t_end: 1.0 / forcing.linear_rate(&Flow::Willmore, 2, 1.0),
            measure: Measure::Decay(2),
            exact: 1.0,
        }
    })
}

/// The energy of the crystal.
fn crystal() -> Energy {
    CRYSTAL.parse().expect("a valid energy")
}

/// A small wave on a Wulff shape, until it has decayed to 1/e.
fn crystal_wave() -> Problem {
    Problem {
        name: "crystal-wave".into(),
        flow: Flow::SurfaceDiffusion,
        beside: Beside::Energy(crystal()),
        curve: StartCurve::Wulff,
        t_end: 1.0 / CRYSTAL_RATE,
        measure: Measure::Decay(2),
        exact: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_name_is_answered_with_the_nearest() {
        assert_eq!(Problem::named("lemniscate").unwrap().curve, StartCurve::Lemniscate);
        let message = Problem::named("wilmore-circle").unwrap_err().to_string();
        assert!(message.starts_with("--problem wilmore-circle: "), "{message}");
        assert!(message.contains("did you mean `willmore-circle`?"), "{message}");
    }

    #[test]
    fn names_are_unique() {
        let names: Vec<String> = problems().into_iter().map(|problem| problem.name).collect();
        for (i, name) in names.iter().enumerate() {
            assert!(!names[..i].contains(name), "{name}");
        }
    }

    #[test]
    fn the_curves_have_the_size_that_their_problems_say() {
        let length = |curve: StartCurve| {
            let curve = curve.resolve(Precision::F64);
            let nodes: Vec<DVec2> = (0..20_000).map(|i| curve.point(f64::from(i) / 20_000.0)).collect();
            curvelax_curve::polygon::length(&nodes)
        };
        assert!((length(StartCurve::Lemniscate) - LEMNISCATE).abs() < 1e-6);
        assert!((length(StartCurve::Circle { radius: 0.5, turns: 2 }) - TAU).abs() < 1e-6);
        assert!((length(StartCurve::Ellipse) - 9.688_448_220_547_675).abs() < 1e-6);
        assert!((length(StartCurve::Mode(5)) - TAU).abs() < 1e-6);
    }
}
