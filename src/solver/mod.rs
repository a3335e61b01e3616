//! Periodic pentadiagonal systems on a ring of nodes: the rows, Gauss–Seidel sweeps, and a direct solve.

pub mod direct;
pub mod gauss_seidel;
pub mod ring;
pub mod system;

use serde::{Deserialize, Serialize};

pub use gauss_seidel::Order;
pub use ring::{Blocks, Ring};
pub use system::{Row, System};

/// Which solver takes the periodic pentadiagonal systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Gauss–Seidel sweeps, the paper's.
    GaussSeidel,
    /// Periodic pentadiagonal elimination.
    Direct,
}
