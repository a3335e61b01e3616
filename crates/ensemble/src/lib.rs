//! The ensemble: the request ([`Spec`]), its members with their random numbers, and the result of each member
//! ([`Outcome`]).

pub mod member;
pub mod outcome;
pub mod request;
pub mod schedule;
pub mod simulate;
pub mod study;
mod theory;
pub mod trajectory;

pub use member::{Family, Member, Mollified, Outlines, Treated, Variation};
pub use outcome::{
    Ended, Extent, Feature, Features, LevelRow, LevelTimes, Observables, Outcome, Paused, Portrait, RefinementLevel,
    Rows, RunProgress, SeriesRow, Sink, SinkRequest, Snapshot, Status,
};
pub use request::{Drawn, Event, MemberValues, Shard, Spec};
pub use study::{Cell, LevelSink, Study};
