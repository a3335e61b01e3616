//! curvelax relaxes ensembles of closed plane curves by fourth-order geometric flows
//!
//! ```text
//! ∂_t x = β N + α T,    β = -∂²_s k + b(k),    b(0) = 0,
//! ```
//!
//! by the semi-implicit Lagrangian scheme of K. Mikula and D. Ševčovič, *Numerical aspects of evolution of plane
//! curves satisfying the fourth order geometric equation*. It runs on the CPU and, through WGSL and wgpu, on a GPU.
//! `README.md` is about the program, `docs/method.md` about the scheme.
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
//! | β, α | normal velocity; tangential velocity, which moves nodes along the curve only | segment; node |
//! | τ, ω | time step; speed of the redistribution of nodes, in 1/time | |
//! | L, A | length and signed area of the polygon x | |
//! | excess | L²/(4πA) - (n/π)·tan(π/n), 0 on the regular polygon | |
//!
//! Lengths are in the user's unit and times in its fourth power.
//!
//! # Modules
//!
//! Each uses only those above it (`tests/modules_depend_downward.rs`).
//!
//! | module | holds |
//! |---|---|
//! | [`error`] | what, where, numbers, remedy, exit code |
//! | `wgsl` | the files of `shaders/`, compiled in |
//! | `guard`, `threads` | panics of other crates become errors; every thread is started here |
//! | `input`, `text`, [`random`] | files opened for reading; numbers as people read them; random numbers addressed by key |
//! | [`number`] | the number that the scheme is generic over |
//! | [`flow`] | the law b(k) |
//! | [`curve`] | plane curves in f64: shapes, perturbation, sampling, measures |
//! | [`solver`] | periodic pentadiagonal systems: rows, sweeps, direct solution |
//! | [`statistics`] | censored times, their mean and median with intervals, tests between groups, fits |
//! | [`scheme`] | the paper's step, one file a stage, with the stems of `shaders/` |
//! | [`backend`] | slots in which members are advanced, on the CPU or a GPU |
//! | [`ensemble`] | the spec, its members, what a member leaves |
//! | [`schedule`], [`trajectory`], [`simulate`] | steps and output times; one member's way; the loop over all |
//! | [`conformance`] | the GPU compared with the CPU, stage by stage and over whole runs |
//! | [`placement`] | which back end a spec gets, and why |
//! | [`truth`] | problems with exact solutions, and the error and order against them |
//! | [`results`] | what the members of a study add up to: sums, statistics by cell, the record of the run |
//! | [`draw`] | SVG, axes and charts from plain numbers |
//! | [`files`] | the folder of results: who may write there, and what each file holds |
//! | [`report`] | a run's sink: tables, checkpoints, merge, `report.html` |
//! | [`mod@bench`], [`estimate`], [`figures`] | how fast a back end is; what a run will take; the paper's figures |
//! | [`cli`] | the commands |
//!
//! # Example
//!
//! A run is a [`Spec`](ensemble::Spec), validated once, whose members are handed to a [`Sink`](ensemble::Sink). One
//! ellipse under surface diffusion keeps its area and loses length:
//!
//! ```
//! use curvelax::{
//!     ensemble::{Cell, Ended, Family, Sink, Spec, Status, spec::{BackendChoice, Solver}},
//!     placement,
//!     simulate::simulate,
//! };
//!
//! struct Check;
//!
//! impl Sink for Check {
//!     fn member(&mut self, ended: &Ended) -> curvelax::Result<()> {
//!         let (start, end) = (ended.outcome.start, ended.outcome.end);
//!         assert!((end.area / start.area - 1.0).abs() < 1e-3);
//!         assert!(end.length < 0.96 * start.length);
//!         assert_eq!(ended.outcome.status, Status::Unfinished);
//!         Ok(())
//!     }
//! }
//!
//! let spec = Spec {
//!     curves: 1,
//!     amplitude: 0.0,
//!     t_end: 0.2,
//!     solver: Solver::Direct.into(),
//!     backend: BackendChoice::Cpu,
//!     ..Spec::default()
//! };
//! let spec = spec.validate()?;
//! let family = Family::new(&spec)?;
//! let choice = placement::choose(&spec, family.points())?;
//! let precision = choice.precision();
//! let (mut backend, _) = choice.open(&spec, family.points())?;
//! simulate(&[Cell::only(spec, family)], precision, backend.as_mut(), 0, &mut Check)?;
//! # Ok::<(), curvelax::Error>(())
//! ```

pub mod backend;
pub mod bench;
pub mod cli;
pub mod conformance;
pub mod curve;
pub mod draw;
pub mod ensemble;
pub mod error;
pub mod estimate;
pub mod figures;
pub mod files;
pub mod flow;
mod guard;
mod input;
pub mod number;
pub mod placement;
pub mod random;
pub mod report;
pub mod results;
pub mod schedule;
pub mod scheme;
pub mod simulate;
pub mod solver;
pub mod statistics;
mod text;
mod threads;
pub mod trajectory;
pub mod truth;
mod wgsl;

pub use error::{Error, Result};
