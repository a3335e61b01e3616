//! What every crate of curvelax uses: errors that name what, where, the numbers and the remedy; files opened for
//! reading; numbers as text, and intervals that say what they cover; random numbers addressed by key; threads and
//! guards against panics of other crates.

pub mod drawable;
pub mod error;
pub mod gamma;
pub mod guard;
pub mod input;
pub mod interval;
pub mod random;
pub mod text;
pub mod threads;

pub use error::{Error, Result};

/// The version of the program, and of the files that it writes.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
