//! The GPU back end: adapters, the assembled shaders, the kernel with its buffers. The only place that names wgpu.

pub mod adapter;
pub mod kernel;
pub mod shader;

pub use adapter::{Capacity, Gpu};
pub use kernel::Kernel;
pub use shader::Variant;
