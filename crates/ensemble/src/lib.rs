//! The ensemble: the request ([`Spec`]), its members with their random numbers, and the result of each member
//! ([`Outcome`]).

pub mod drawn;
pub mod ended;
pub mod event;
pub mod features;
mod horizon;
pub mod judged;
pub mod levels;
pub mod member;
pub mod mollifier;
pub mod outcome;
mod outlines;
pub mod rates;
pub mod rows;
pub mod schedule;
mod seed;
pub mod shard;
pub mod simulate;
pub mod sink;
pub mod spec;
pub mod standing;
pub mod study;
pub mod sweep;
pub mod theory;
mod times;
pub mod trajectory;
mod units;
mod validate;
mod values;

pub use drawn::Drawn;
pub use ended::Ended;
pub use event::Event;
pub use features::{Feature, Features};
pub use judged::Judged;
pub use levels::{LevelRow, LevelTimes, RefinementLevel};
pub use member::{Family, Member};
pub use mollifier::Mollified;
pub use outcome::{Observables, Outcome, Portrait, SeriesRow, Snapshot, Status};
pub use outlines::Outlines;
pub use rows::{Extent, Rows};
pub use shard::Shard;
pub use sink::{Sink, Wish};
pub use spec::Spec;
pub use standing::{Paused, Standing};
pub use study::{Cell, Study};
pub use values::MemberValues;
