//! The kernel on a GPU: adapters, pipelines, and slots in batches. The only crate that names wgpu.

pub mod abandoned;
pub mod adapter;
mod batch;
mod clock;
mod device;
pub mod kernel;
mod nodes;
mod patience;
mod pipeline;

pub use adapter::Gpu;
pub use device::Device;
pub use kernel::Kernel;
pub use nodes::{LOADS_DRIVERS, may_have_hardware};
pub use patience::patience;
