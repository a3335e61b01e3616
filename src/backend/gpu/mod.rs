//! The GPU back end: adapters, assembled shaders, and the kernel with its batches of slots. The only place that names
//! wgpu.

pub mod abandoned;
pub mod adapter;
mod batch;
mod budget;
mod clock;
pub mod kernel;
mod nodes;
mod pipeline;
pub mod shader;

pub use adapter::{Capacity, Gpu};
pub use kernel::Kernel;
pub use nodes::{LOADS_DRIVERS, may_have_hardware};
pub use shader::Variant;
