//! curvelax relaxes ensembles of plane curves by fourth-order geometric flows.

pub mod backend;
pub mod cli;
pub mod conformance;
pub mod curve;
pub mod ensemble;
pub mod error;
pub mod flow;
pub mod number;
pub mod report;
pub mod schedule;
pub mod scheme;
pub mod simulate;
pub mod solver;
pub mod trajectory;

pub use error::{Error, Result};
