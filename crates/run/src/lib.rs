//! Runs: from a spec to a finished folder.
//!
//! | module | holds |
//! |---|---|
//! | [`report`] | a run's sink: overview, pictures, movies, `report.html`; merge |
//! | [`session`] | a run from its request to its folder, for the program and the Python package |
//! | [`estimate`] | what a run will cost |
//! | [`figures`] | the paper's figures |

pub mod estimate;
pub mod figures;
pub mod report;
pub mod session;
