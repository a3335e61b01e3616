//! Periodic pentadiagonal systems on a ring of nodes: the rows, Gauss–Seidel sweeps, alone or in V-cycles, and a direct solve.

pub mod direct;
pub mod gauss_seidel;
pub mod multigrid;
pub mod ring;
pub mod system;

use serde::{Deserialize, Serialize};

pub use gauss_seidel::Order;
pub use ring::{Blocks, Ring, Sums};
pub use system::{Equation, Equations, Row, System};

/// Which solver takes the periodic pentadiagonal systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Gauss–Seidel sweeps, the paper's.
    GaussSeidel,
    /// The same sweeps inside V-cycles.
    Multigrid,
    /// Periodic pentadiagonal elimination.
    Direct,
}

impl Solver {
    /// All of them.
    pub const ALL: [Solver; 3] = [Solver::GaussSeidel, Solver::Multigrid, Solver::Direct];

    /// As in flags and files.
    pub fn name(self) -> &'static str {
        match self {
            Solver::GaussSeidel => "gauss-seidel",
            Solver::Multigrid => "multigrid",
            Solver::Direct => "direct",
        }
    }

    /// Whether it sweeps until a tolerance is met.
    pub const fn sweeps(self) -> bool {
        !matches!(self, Solver::Direct)
    }
}

/// A solver as a type, for code that is compiled for one solver at a time.
pub trait Solves {
    /// Which one.
    const SOLVER: Solver;
}

/// [`Solver::GaussSeidel`] as a type.
pub struct Sweeps;
/// [`Solver::Multigrid`] as a type.
pub struct Cycles;
/// [`Solver::Direct`] as a type.
pub struct Elimination;

impl Solves for Sweeps {
    const SOLVER: Solver = Solver::GaussSeidel;
}
impl Solves for Cycles {
    const SOLVER: Solver = Solver::Multigrid;
}
impl Solves for Elimination {
    const SOLVER: Solver = Solver::Direct;
}
