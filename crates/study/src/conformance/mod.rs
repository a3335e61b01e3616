//! Conformance: the kernel against its CPU twin, stage by stage and over whole runs.
//!
//! *Theory.* The kernel and the CPU do the same operations in the same order, so they differ only where a compiler
//! fuses or reassociates: by a few roundings of each quantity's natural scale. A bound is `k · ε · scale`; the
//! factors are in one table ([`bounds`]), with the reason for each scale.
//!
//! *Practice.* [`stages`] compares everything that one step computes, [`runs`] the curve after many steps, fixed or
//! adaptive ones, [`events`] where members pause at levels. They use an ensemble in which every member has its
//! own curve, flow, τ and ω ([`members`]). `curvelax check` prints the table; `tests/cases/conformance` asserts it,
//! with a negative control for each comparison. A run that begins on a GPU compares a few members first
//! ([`self_test`](self_test::self_test)).

pub mod cases;
pub mod compare;
pub mod self_test;

pub use curvelax_backend::bounds;

pub use cases::{Driven, adaptive_members, members};
pub use compare::{ConformanceRow, Tamper, events, runs, stages};
pub use self_test::self_test;
