//! Studies: from a checked spec to the results of its members, and what they say.
//!
//! | module | holds |
//! |---|---|
//! | [`placement`] | which back end a spec gets, and why |
//! | [`relax`](fn@relax) | from a study to the results of its members |
//! | [`conformance`] | the GPU compared with the CPU, stage by stage and over whole runs |
//! | [`truth`] | problems with exact solutions, and the error and order against them |
//! | [`results`] | sums, statistics by cell, the record of the run |
//! | [`accuracy`] | nodes, tolerance and members for `--accuracy` |

pub mod accuracy;
pub mod conformance;
pub mod placement;
mod relax;
pub mod results;
#[doc(hidden)]
pub mod samples;
pub mod truth;

pub use relax::relax;
