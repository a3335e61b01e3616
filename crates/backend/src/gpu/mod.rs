//! What every host of the kernel needs, with wgpu or in a browser: its source, the mirror of its buffers, and how much
//! work fits a dispatch.

mod budget;
mod capacity;
pub mod mirror;
pub mod shader;

pub use budget::Budget;
pub use capacity::Capacity;
pub use shader::Variant;
