//! The GPU back end: adapters, assembled shaders, and the kernel with its batches of slots. The only place that names
//! wgpu; what a browser needs, too, does without it: the shaders, the mirror of the buffers, the budget of a dispatch.

#[cfg(feature = "program")]
pub mod abandoned;
#[cfg(feature = "program")]
pub mod adapter;
#[cfg(feature = "program")]
mod batch;
mod budget;
mod capacity;
#[cfg(feature = "program")]
mod clock;
#[cfg(feature = "program")]
pub mod kernel;
pub mod mirror;
#[cfg(feature = "program")]
mod nodes;
#[cfg(feature = "program")]
mod patience;
#[cfg(feature = "program")]
mod pipeline;
pub mod shader;

#[cfg(feature = "program")]
pub use adapter::Gpu;
pub use budget::Budget;
pub use capacity::Capacity;
#[cfg(feature = "program")]
pub use kernel::Kernel;
#[cfg(feature = "program")]
pub use nodes::{LOADS_DRIVERS, may_have_hardware};
#[cfg(feature = "program")]
pub use patience::patience;
pub use shader::Variant;
