//! Problems with an exact solution, the error of a run against it, and the order at which that error falls.
//!
//! # Theory
//!
//! Circles stay circles: `R' = -b(1/R)`, which is `R = (R₀⁴ + 2t)^(1/4)` under Willmore flow and rest at
//! `R = 1/√(2λ)` under elastic flow. A small mode on a circle, `r = R + a·cos mθ`, has to first order in a
//!
//! ```text
//! a' = -(m²-1)·(m²/R⁴ + b′(1/R)/R²)·a
//! ```
//!
//! where a is the amplitude itself and not a/R: `β N` moves the radius by `-β`, and
//! `k = 1/R + (m²-1)·a·cos mθ/R²` to first order. A lemniscate shrinks under surface diffusion without changing its
//! shape. Surface diffusion keeps the area of every curve.
//!
//! # Practice
//!
//! A [`Problem`] is a value: flow, curve, final time, the measured quantity, and its exact value. [`problems`] is the
//! single table of them, for the tests on every back end and for `curvelax convergence`. [`Problem::solve`] runs it at
//! a [`Resolution`] like any other run; a [`ConvergenceStudy`] refines one number. [`WorkPrecision`] measures what an
//! error of the relaxation time costs. A [`Referee`] solves the flow of any smooth curve by another method; a
//! [`RefereeRow`] compares a relaxation time with it.

mod convergence;
mod fourier;
mod measure;
mod problems;
mod referee;
mod refereed;
mod theory;
mod work_precision;

pub use convergence::{ConvergenceRow, ConvergenceStudy, Solved, Varied, studies};
pub use measure::{Measure, mode_amplitude};
pub use problems::{Beside, LEMNISCATE_LIFE, Problem, Resolution, StartCurve, problems};
pub use referee::{Referee, Truth};
pub use refereed::{RefereeRow, limits, one_curve, relaxation_truth};
pub use theory::{CircleMode, circle_mode};
pub use work_precision::{Stepping, WorkPrecision, WorkRow};
