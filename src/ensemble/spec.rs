//! The spec: everything that determines a run, under the names that flags and TOML keys share.

use serde::{Deserialize, Serialize};

use crate::{
    curve::{Modes, Sampling, Shape},
    flow::Flow,
};

/// Which solver takes the periodic pentadiagonal systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Gauss–Seidel sweeps, the paper's.
    GaussSeidel,
    /// Periodic pentadiagonal elimination.
    Direct,
}

/// The order in which a Gauss–Seidel sweep visits the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Colour by colour: what the kernel does.
    Coloured,
    /// Node by node, as the paper does (CPU only).
    Lexicographic,
}

/// Where the members are advanced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BackendChoice {
    /// A hardware GPU if there is one, else the CPU.
    Auto,
    /// A GPU, a software one included.
    Gpu,
    /// The CPU back end.
    Cpu,
}

/// The number type of the state and of all arithmetic on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// A complete description of an ensemble and of the method that relaxes it.
///
/// `Default` is the paper's first example as an ensemble: 256 perturbed 2:1 ellipses under surface diffusion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Spec {
    /// Number of members.
    pub curves: u64,
    /// Nodes per member, `n`.
    pub points: usize,
    /// Seed of the ensemble.
    pub seed: u64,
    /// The curve that is perturbed.
    pub shape: Shape,
    /// How nodes are placed on it.
    pub sampling: Sampling,
    /// σ of the random perturbation; 0 for none.
    pub amplitude: f64,
    /// Modes of the random perturbation.
    pub modes: Modes,
    /// p: mode m has standard deviation σ·m^-p.
    pub decay: f64,
    /// The law of motion.
    pub flow: Flow,
    /// Fixed time step.
    pub tau: f64,
    /// Final time.
    pub t_end: f64,
    /// ω, speed of the redistribution towards equal spacing, in 1/time.
    pub omega: f64,
    /// No tangential redistribution (α = 0).
    pub no_redistribution: bool,
    /// Solver of the pentadiagonal systems.
    pub solver: Solver,
    /// Order of the sweeps.
    pub order: Order,
    /// Residual tolerance of the sweeps relative to the increment; by precision if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Over-relaxation factor; 1 is plain Gauss–Seidel.
    pub sor: f64,
    /// Sweeps per system after which a member is `stalled`.
    pub max_sweeps: u32,
    /// Where to run.
    pub backend: BackendChoice,
    /// Part of the name of the GPU adapter to take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adapter: Option<String>,
    /// Number type; f64 where the device has it if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<Precision>,
    /// A member is relaxed when its excess is at most this fraction of its start.
    pub relax_to: f64,
    /// End a member when it is relaxed.
    pub stop_when_relaxed: bool,
    /// Interval between rows of `series.csv`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<f64>,
    /// Times of `snapshots.csv`.
    pub snapshots: Vec<f64>,
    /// Run only these members.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub only: Option<Vec<u64>>,
    /// Threads of the CPU back end; all cores if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<usize>,
}

impl Default for Spec {
    fn default() -> Spec {
        Spec {
            curves: 256,
            points: 100,
            seed: 1,
            shape: Shape::Ellipse { a: 2.0, b: 1.0 },
            sampling: Sampling::Arclength,
            amplitude: 0.05,
            modes: Modes { low: 2, high: 8 },
            decay: 1.0,
            flow: Flow::SurfaceDiffusion,
            tau: 1e-3,
            t_end: 2.0,
            omega: 1.0,
            no_redistribution: false,
            solver: Solver::GaussSeidel,
            order: Order::Coloured,
            tolerance: None,
            sor: 1.0,
            max_sweeps: 50_000,
            backend: BackendChoice::Auto,
            adapter: None,
            precision: None,
            relax_to: 0.01,
            stop_when_relaxed: false,
            series: None,
            snapshots: Vec::new(),
            only: None,
            threads: None,
        }
    }
}
