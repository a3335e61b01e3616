//! The results of a study: sums over members as they end, statistics by cell, and the record of the run.

pub mod cells;
pub mod comparison;
pub mod discretisation;
pub mod explained;
pub mod provenance;
mod remedies;
pub mod scaling;
pub mod shortfall;
pub mod tally;
pub mod times;
pub mod treatment;
pub mod verdict;

pub use cells::EnsembleStatistics;
pub use comparison::CellComparison;
pub use explained::Explained;
pub use verdict::RunVerdict;
