//! curvelax relaxes ensembles of plane curves by fourth-order geometric flows.

pub mod cli;
pub mod curve;
pub mod ensemble;
pub mod error;
pub mod flow;
pub mod report;

pub use error::{Error, Result};
