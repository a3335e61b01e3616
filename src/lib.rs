//! curvelax relaxes ensembles of closed plane curves by fourth-order geometric flows
//!
//! ```text
//! ∂_t x = β N + α T,    β = -∂²_s k + b(k),    b(0) = 0,
//! ```
//!
//! by the semi-implicit Lagrangian scheme of K. Mikula and D. Ševčovič, *Numerical aspects of evolution of plane
//! curves satisfying the fourth order geometric equation*. It runs on the CPU and, through WGSL and wgpu, on a GPU.
//! `README.md` describes the program, `docs/method.md` the scheme.
//!
//! # Notation
//!
//! | symbol | meaning | place |
//! |---|---|---|
//! | n, i = 1…n | number of nodes; a node (index i-1 in arrays, periodic) | |
//! | x | position | node |
//! | k, r | signed curvature, > 0 on a circle; length, as the scheme evolves it | segment [x_{i-1}, x_i] |
//! | q | (r_i + r_{i+1})/2 | node |
//! | T, N | unit tangent; unit inward normal, det(T, N) = 1; curves run counter-clockwise | |
//! | β, α | normal velocity; tangential velocity, which only moves nodes along the curve | segment; node |
//! | τ, ω | time step; speed of the redistribution of nodes, in 1/time | |
//! | L, A | length and signed area of the polygon x | |
//! | excess | L²/(4πA) - (n/π)·tan(π/n), 0 on the regular polygon | |
//!
//! Lengths are in the user's unit and times in its fourth power.
//!
//! # Modules
//!
//! Each module uses only those above it (`tests/it/modules_depend_downward.rs`).
//!
//! | module | holds |
//! |---|---|
//! | [`error`] | what, where, numbers, remedy, exit code |
//! | `wgsl` | the files of `shaders/`, compiled in |
//! | `guard`, `threads` | panics of other crates become errors; every thread is started here |
//! | `input`, `text`, [`random`] | files opened for reading; numbers as text; random numbers addressed by key |
//! | [`number`] | the number type of the scheme |
//! | [`flow`] | the law b(k) |
//! | [`curve`] | plane curves in f64: shapes, perturbation, sampling, measures |
//! | [`solver`] | periodic pentadiagonal systems: rows, sweeps, direct solution |
//! | [`statistics`] | censored times, their mean and median with intervals, tests between groups, fits |
//! | [`scheme`] | the paper's step, one file per stage, named as in `shaders/` |
//! | [`backend`] | slots in which members advance, on the CPU or a GPU |
//! | [`ensemble`] | the spec, its members, the result of a member |
//! | `schedule`, `trajectory`, [`simulate`] | steps and output times; one member's trajectory; the loop over all |
//! | [`conformance`] | the GPU compared with the CPU, stage by stage and over whole runs |
//! | [`placement`] | which back end a spec gets, and why |
//! | [`relax`](fn@relax) | from a study to the results of its members |
//! | [`truth`] | problems with exact solutions, and the error and order against them |
//! | [`results`] | the results of a study: sums, statistics by cell, the record of the run |
//! | `accuracy` | nodes, tolerance and members for `--accuracy` |
//! | `draw` | SVG, axes and charts from plain numbers |
//! | `files` | the folder of results: who may write there, and what each file holds |
//! | `report` | a run's sink: tables, checkpoints, merge, `report.html` |
//! | `session` | from a spec to a finished folder, for the program and the Python package |
//! | `bench`, `estimate`, `figures` | speed of a back end; cost of a run; the paper's figures |
//! | `cli` | the commands |
//!
//! # Example
//!
//! A [`Spec`](ensemble::Spec) says what to run, a [`Study`](ensemble::Study) is a checked spec, and [`relax`](fn@relax)
//! hands the results of its members to a [`Sink`](ensemble::Sink), such as a `Vec`. An ellipse under surface diffusion
//! keeps its area and loses length:
//!
//! ```
//! use curvelax::{ensemble::{Spec, Study}, relax};
//!
//! let study = Study::new(Spec { curves: 1, amplitude: 0.0.into(), t_end: Some(0.2.into()), ..Spec::default() })?;
//! let mut members = Vec::new();
//! relax(&study, &mut members)?;
//! let (start, end) = (members[0].outcome.start, members[0].outcome.end);
//! assert!((end.area / start.area - 1.0).abs() < 1e-3 && end.length < 0.96 * start.length);
//! # Ok::<(), curvelax::Error>(())
//! ```

// What only the program uses.
#![cfg_attr(not(feature = "program"), allow(dead_code, unused_macros))]

pub mod backend;
pub mod conformance;
pub mod curve;
pub mod ensemble;
pub mod error;
pub mod flow;
pub mod number;
#[cfg(feature = "program")]
pub mod placement;
pub mod random;
#[cfg(feature = "program")]
pub mod results;
pub mod scheme;
pub mod simulate;
pub mod solver;
pub mod statistics;
#[cfg(feature = "program")]
pub mod truth;

// Public only for the program, and for the project's own tests, benchmarks and fuzzing.
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod bench;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod draw;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod figures;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod files;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub mod schedule;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod session;
#[doc(hidden)]
pub mod trajectory;

#[cfg(feature = "program")]
mod accuracy;
#[cfg(feature = "program")]
mod estimate;
mod guard;
mod input;
#[cfg(feature = "program")]
mod relax;
mod text;
mod threads;
mod wgsl;

pub use error::{Error, Result};
#[cfg(feature = "program")]
pub use relax::relax;
