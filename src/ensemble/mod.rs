//! The ensemble: what was asked for ([`Spec`]), its members and their random numbers, and what a member's
//! run leaves behind ([`Outcome`]).

pub mod member;
pub mod mollifier;
pub mod outcome;
pub mod rows;
mod seed;
pub mod shard;
pub mod spec;
pub mod standing;
pub mod study;
pub mod sweep;
mod validate;

pub use member::{Family, Member};
pub use mollifier::Mollified;
pub use outcome::{Ended, Observables, Outcome, Portrait, SeriesRow, Sink, Snapshot, Status, Wish};
pub use rows::{Extent, Rows};
pub use shard::Shard;
pub use spec::Spec;
pub use standing::{Paused, Standing};
pub use study::Cell;
