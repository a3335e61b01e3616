//! curvelax relaxes ensembles of closed plane curves by fourth-order geometric flows
//!
//! ```text
//! ∂_t x = β N + α T,    β = -∂²_s k + b(k),    b(0) = 0,
//! ```
//!
//! by the semi-implicit Lagrangian scheme of K. Mikula and D. Ševčovič, *Numerical aspects of evolution of plane
//! curves satisfying the fourth order geometric equation*. It runs on the CPU and, through WGSL and wgpu, on a GPU.
//! `README.md` describes the program, `docs/internals/method.md` the scheme.
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
//! # Crates
//!
//! This crate is the program, and gathers the others. Each can be used alone, with those above it:
//!
//! | crate | modules here | holds |
//! |---|---|---|
//! | `curvelax-shaders` | | the files of `shaders/`, compiled in |
//! | `curvelax-base` | [`error`], [`random`] | errors with what, where, numbers and remedy; input files, text, random numbers by key, threads |
//! | `curvelax-flow` | [`number`], [`flow`], [`equilibrium`], [`solver`], [`scheme`] | the paper: the law b(k) and what it relaxes to, periodic pentadiagonal systems, the step |
//! | `curvelax-backend` | [`backend`] | slots in which members advance: the CPU, and the source of the kernel |
//! | `curvelax-gpu` | [`backend::gpu`] | the kernel through wgpu |
//! | `curvelax-curve` | [`curve`] | plane curves in f64: shapes, outlines, perturbation, sampling, measures |
//! | `curvelax-statistics` | [`statistics`] | censored times, their mean and median with intervals, tests between groups, fits |
//! | `curvelax-ensemble` | [`ensemble`], [`simulate`] | the spec, its members, their trajectories and results |
//! | `curvelax-study` | [`placement`], [`relax`](fn@relax), [`conformance`], [`truth`], [`results`] | from a spec to results, on the device that suits it; exact solutions; what results say |
//! | `curvelax-draw` | | SVG, axes and charts from plain numbers |
//! | `curvelax-paper` | | the same as PNG and PDF, with a font of its own |
//! | `curvelax-files` | | the folder of a run: tables, stores, checkpoints, shards, and their readers |
//! | `curvelax-run` | | from a spec to a finished folder: sessions, reports, merges, estimates |
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

pub use curvelax_base::{Error, Result, error, random};
pub use curvelax_curve as curve;
pub use curvelax_ensemble as ensemble;
pub use curvelax_ensemble::simulate;
pub use curvelax_flow::{crystal, equilibrium, flow, forcing, number, scheme, solver};
pub use curvelax_statistics as statistics;
pub use curvelax_study::{conformance, placement, relax, results, truth};

/// Back ends, which advance members: slots for resident members, on the CPU or on a GPU.
pub mod backend {
    pub use curvelax_backend::{Backend, DeviceKind, cpu};
    pub use curvelax_gpu::Device;

    /// The kernel and what runs it.
    pub mod gpu {
        pub use curvelax_backend::gpu::*;
        pub use curvelax_gpu::*;
    }
}

// Public only for the program, and for the project's own tests, benchmarks and fuzzing.
#[doc(hidden)]
pub mod bench;
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub use curvelax_draw as draw;
#[doc(hidden)]
pub use curvelax_ensemble::{schedule, trajectory};
#[doc(hidden)]
pub use curvelax_files as files;
#[doc(hidden)]
pub use curvelax_paper as paper;
#[doc(hidden)]
pub use curvelax_run::{estimate, figures, report, session};

use curvelax_base::text;
