//! The compute pipeline, specialised for a ring, or for all of as many threads, a precision and a variant.

use curvelax_backend::gpu::{
    Variant,
    shader::{self, KernelSizes},
};
use curvelax_flow::number::Real;

/// The key of a pipeline: its sizes, number and variant.
pub(super) type Key = (KernelSizes, &'static str, Variant);

/// Compiles the pipeline.
///
/// The driver caches compiled code across processes (Mesa in `MESA_SHADER_CACHE_DIR`, NVIDIA in its ComputeCache);
/// wgpu's own pipeline cache needs `unsafe`, see `docs/internals/decisions.md`.
pub fn compile<T: Real>(device: &wgpu::Device, sizes: KernelSizes, variant: Variant) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("evolve"),
        source: wgpu::ShaderSource::Wgsl(shader::source::<T>(variant).into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("evolve"),
        layout: None,
        module: &module,
        entry_point: Some("evolve"),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &shader::constants(sizes),
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    })
}
