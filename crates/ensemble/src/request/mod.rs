//! The request: what a run shall do, under the names that flags and TOML keys share, checked before any work starts.

mod choices;
pub mod drawn;
pub mod event;
mod reading;
mod seed;
pub mod shard;
pub mod spec;
pub mod sweep;
mod units;
pub(crate) mod validate;
mod values;

pub use drawn::Drawn;
pub use event::Event;
pub use shard::Shard;
pub use spec::Spec;
pub(crate) use values::{DRAWN, drawn_names};
pub use values::{MAX_NAMED, MemberValues};
