//! Runs: from a spec to a finished folder.
//!
//! | module | holds |
//! |---|---|
//! | [`files`] | the folder of results: who may write there, and what each file holds |
//! | [`report`] | a run's sink: tables, checkpoints, merge, `report.html` |
//! | [`session`] | a run from its request to its folder, for the program and the Python package |
//! | [`estimate`] | what a run will cost |
//! | [`figures`] | the paper's figures |

pub mod estimate;
pub mod figures;
pub mod files;
pub mod report;
pub mod session;
