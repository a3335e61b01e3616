//! Periodic pentadiagonal systems on a ring of nodes: the rows, Gauss–Seidel sweeps, alone or in V-cycles, and a direct solve.

pub mod direct;
pub mod gauss_seidel;
pub mod multigrid;
pub mod ring;
pub mod system;

use serde::{Deserialize, Serialize};

pub use gauss_seidel::Order;
pub use ring::{Blocks, Ring};
pub use system::{Row, System};

/// Which solver takes the periodic pentadiagonal systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
    pub fn sweeps(self) -> bool {
        self != Solver::Direct
    }
}
