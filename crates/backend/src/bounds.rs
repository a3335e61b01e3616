//! The single table of tolerances: quantity, natural scale, factor. Measured maxima are in
//! `docs/internals/conformance.md`.

use crate::gpu::shader::TRACE_FIELDS;
use curvelax_flow::{
    number::Real,
    scheme::{Curve, Parameters, Workspace, member::Observed},
    solver::Row as Coefficients,
};

/// Largest n at which f32 was verified against f64 (docs/internals/precision.md).
pub const MAX_POINTS_F32: usize = 400;

/// The unit of a bound: the size of the terms whose rounding the quantity inherits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NaturalScale {
    /// Largest of `|k|/r²` (the terms of a second difference) and `|b(k)|`.
    Velocity,
    /// `Σ|r k β| + ω L`: α is a running sum.
    Tangential,
    /// Longest segment.
    Length,
    /// 1: rows are divided by their diagonal.
    One,
    /// Largest weight `(τ/q)·c`.
    Weight,
    /// Largest `|k|`.
    Curvature,
    /// Largest `|k|` times the root of the largest weight: a solve amplifies rounding, the more the stiffer it is.
    SolvedCurvature,
    /// Radius of the circle of the same length.
    Position,
    /// Longest segment times the root of the largest weight.
    SolvedPosition,
    /// Area of the circle of the same length.
    Area,
    /// `Σ k² r + λ L`.
    Energy,
    /// Radius over the shortest segment: edges are differences of positions.
    Mesh,
}

/// A quantity of one step: its name, its scale, and the factor k.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// The quantity.
    pub quantity: &'static str,
    /// What its rounding errors are measured in.
    pub scale: NaturalScale,
    /// k on a software adapter, which rounds as Rust does.
    software: f64,
}

/// k on hardware, which may fuse `a*b + c`, over that on a software adapter.
const ON_HARDWARE: f64 = 4.0;

const fn bound(quantity: &'static str, scale: NaturalScale, software: f64) -> Bound {
    Bound { quantity, scale, software }
}

/// The stages of a step, in the order of the kernel's trace.
pub const STAGES: [Bound; TRACE_FIELDS] = [
    bound("β", NaturalScale::Velocity, 4.0),
    bound("α", NaturalScale::Tangential, 4.0),
    bound("r", NaturalScale::Length, 4.0),
    bound("a", NaturalScale::One, 8.0),
    bound("b", NaturalScale::One, 8.0),
    bound("d", NaturalScale::One, 8.0),
    bound("e", NaturalScale::One, 8.0),
    bound("weight of k", NaturalScale::Weight, 8.0),
    bound("right-hand side of k", NaturalScale::Curvature, 8.0),
    bound("δk", NaturalScale::SolvedCurvature, 16.0),
    bound("𝓐", NaturalScale::One, 8.0),
    bound("𝓑", NaturalScale::One, 8.0),
    bound("𝓓", NaturalScale::One, 8.0),
    bound("𝓔", NaturalScale::One, 8.0),
    bound("weight of x", NaturalScale::Weight, 8.0),
    bound("right-hand side of x", NaturalScale::Length, 8.0),
    bound("right-hand side of y", NaturalScale::Length, 8.0),
    bound("δx", NaturalScale::SolvedPosition, 16.0),
    bound("δy", NaturalScale::SolvedPosition, 16.0),
    bound("k", NaturalScale::SolvedCurvature, 16.0),
];

/// The curve after a run.
pub const FIELDS: [Bound; 4] = [
    bound("x", NaturalScale::Position, 16.0),
    bound("y", NaturalScale::Position, 16.0),
    bound("k", NaturalScale::SolvedCurvature, 16.0),
    bound("r", NaturalScale::Length, 16.0),
];

/// The members' reports after a run: the fields of `Observed`, then the turning number and the travel.
pub const REPORT: [Bound; Observed::<f64>::FIELDS.len() + 2] = [
    bound("length", NaturalScale::Position, 16.0),
    bound("area", NaturalScale::Area, 16.0),
    bound("excess", NaturalScale::One, 16.0),
    bound("energy", NaturalScale::Energy, 16.0),
    bound("k_min", NaturalScale::SolvedCurvature, 16.0),
    bound("k_max", NaturalScale::SolvedCurvature, 16.0),
    bound("mesh ratio", NaturalScale::Mesh, 16.0),
    bound("metric drift", NaturalScale::Mesh, 16.0),
    bound("turning", NaturalScale::One, 0.0),
    bound("travel", NaturalScale::Position, 16.0),
];

/// What a run records of the decay of its excess: the values at the times of the grid, and the fitted rate.
///
/// The error of an excess is its rounding and, inside an adaptive run, the effect of a changed step length. The error
/// of its logarithm is that over the excess; the error of the slope of a line is twice that over the time it spans.
pub const DECAY: [Bound; 2] =
    [bound("excess on the way", NaturalScale::One, 16.0), bound("fitted rate", NaturalScale::One, 32.0)];

/// What adaptive runs leave in addition to their ends: the last step's start and middle, step lengths, and event times.
///
/// All of these depend on where a step happened to begin or end. The error of the error estimate is a rounding of the
/// solve, ε·√w with w the largest weight, as often as the combination of the rows amplifies it, so relative to the
/// tolerance; the relative error of a step length is a fraction of that. A quantity inside the run is off by this
/// fraction of its change over a step, in addition to its own scale.
pub const PACE: [Bound; 6] = [
    bound("last step's start", NaturalScale::Position, 16.0),
    bound("its middle", NaturalScale::Position, 16.0),
    bound("report of its start", NaturalScale::One, 16.0),
    bound("last step", NaturalScale::One, 4.0),
    bound("next step", NaturalScale::One, 4.0),
    bound("t_half, t_relax", NaturalScale::One, 1.0),
];

/// The time at which a watched observable reaches its level: a multiple of the time that the observable needs for its
/// rounding, by its bound in [`REPORT`], and of the effect of a changed step length.
pub const EVENT: Bound = bound("event", NaturalScale::One, 1.0);

/// The growth of roundings over steps: like a random walk, since the flow itself damps them.
pub fn growth(steps: u32) -> f64 {
    f64::from(steps).sqrt()
}

/// Returns the bound of the difference between the times at which the excess of a member falls to a level in a kernel
/// and in its twin, after `steps` fixed steps in numbers of type `T` (see [`EVENT`]); there it falls by `slope` per
/// time.
///
/// ```
/// use curvelax_backend::bounds::excess_time;
///
/// // Four times the steps, twice the rounding; half the slope, twice the time that it takes.
/// let bound = excess_time::<f32>(false, 100, 0.5);
/// assert_eq!([excess_time::<f32>(false, 400, 0.5), excess_time::<f32>(false, 100, 0.25)], [2.0 * bound; 2]);
/// ```
pub fn excess_time<T: Real>(hardware: bool, steps: u32, slope: f64) -> f64 {
    let excess = REPORT.iter().find(|bound| bound.quantity == "excess").map_or(f64::NAN, |own| own.factor(hardware));
    EVENT.factor(hardware) * excess * T::EPSILON * growth(steps) / slope
}

impl Bound {
    /// Returns the factor k for this kind of adapter.
    pub fn factor(&self, hardware: bool) -> f64 {
        if hardware { ON_HARDWARE * self.software } else { self.software }
    }
}

impl NaturalScale {
    /// Returns the scale of one member, from the curve before the step and the results of the step.
    pub fn of(self, curve: &Curve<f64>, p: &Parameters<f64>, work: &Workspace<f64>) -> f64 {
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let k = || largest(&mut curve.k.nodes().iter().map(|k| k.abs()));
        let lengths = || curve.r.nodes().iter().map(|stored| p.length_of(*stored));
        let longest = || largest(&mut lengths());
        let weight = |rows: &[Coefficients<f64>]| largest(&mut rows.iter().map(|row| row.weight));
        let length: f64 = lengths().sum();
        match self {
            NaturalScale::Velocity => {
                let shortest = lengths().fold(f64::INFINITY, f64::min);
                k() / (shortest * shortest) + p.law(p.branches().law).b(k()).abs()
            }
            NaturalScale::Tangential => work.motion.rkb.iter().map(|v| v.abs()).sum::<f64>() + p.omega * length,
            NaturalScale::Length => longest(),
            NaturalScale::One => 1.0,
            NaturalScale::Weight => weight(&work.curvature.system.rows).max(weight(&work.position.system.rows)),
            NaturalScale::Curvature => k(),
            NaturalScale::SolvedCurvature => k() * weight(&work.curvature.system.rows).sqrt(),
            NaturalScale::Position => length / std::f64::consts::TAU,
            NaturalScale::Area => length * length / (4.0 * std::f64::consts::PI),
            NaturalScale::Energy => {
                curve.k.nodes().iter().zip(lengths()).map(|(k, r)| k * k * r).sum::<f64>() + p.length_penalty() * length
            }
            NaturalScale::Mesh => {
                let shortest = lengths().fold(f64::INFINITY, f64::min);
                length / std::f64::consts::TAU / shortest
            }
            NaturalScale::SolvedPosition => longest() * weight(&work.position.system.rows).sqrt(),
        }
    }
}
