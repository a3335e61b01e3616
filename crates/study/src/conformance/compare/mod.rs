//! The two comparisons: [everything that one step computes](stages()), and [what whole runs leave](runs).

mod device;
mod ends;
mod levels;
mod row;
mod scales;
mod setup;
mod stages;
mod twin;

pub use super::cases::MEMBERS;
pub(super) use device::to_their_goals;
pub use device::{Left, on_gpu, on_gpu_by};
pub(super) use ends::compare_ends;
pub use ends::{ADAPTIVE_STEPS, runs};
pub use levels::events;
pub use row::ConformanceRow;
pub use setup::{MAX_SWEEPS, Tamper};
pub use stages::stages;
