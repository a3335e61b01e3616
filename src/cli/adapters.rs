//! `curvelax adapters`: what this machine offers, and which adapter `auto` takes and why.

use super::print;
use crate::{
    backend::{self, choose::MAX_POINTS_F32, gpu::Gpu},
    ensemble::Spec,
    error::Result,
};

/// List the GPU adapters, their features and limits, and which one `--backend auto` takes and why.
#[derive(clap::Args)]
pub struct AdaptersArgs {}

/// Prints the listing.
pub fn adapters(AdaptersArgs {}: AdaptersArgs) -> Result<()> {
    let found = Gpu::list();
    let spec = Spec::default();
    let mut text = String::new();
    for gpu in &found {
        text += &describe(gpu, &spec);
    }
    if found.is_empty() {
        text += "no GPU adapter; Debian's software GPU is the package mesa-vulkan-drivers\n";
    }
    let choice = backend::choose(&spec, spec.points)?;
    print(&format!("{text}\n--backend auto, for the default run: {}\n", choice.sentence(&spec)))
}

fn describe(gpu: &Gpu, spec: &Spec) -> String {
    let (limits, capacity) = (gpu.limits(), gpu.capacity());
    let kind = if gpu.is_hardware() { "hardware" } else { "software" };
    let points = match gpu.has_f64() {
        true => format!(
            "{} in f32, {} in f64",
            capacity.max_points::<f32>(spec.solver()).min(MAX_POINTS_F32),
            capacity.max_points::<f64>(spec.solver())
        ),
        false => format!("{} in f32", capacity.max_points::<f32>(spec.solver()).min(MAX_POINTS_F32)),
    };
    let rows = [
        ("kind", format!("{kind}, {}, {}", gpu.device_type(), gpu.api())),
        ("driver", gpu.driver()),
        ("precisions", if gpu.has_f64() { "f32, f64" } else { "f32" }.into()),
        ("points", format!("at most {points}")),
        (
            "workgroup",
            format!(
                "{} threads, {} bytes, subgroups of {}",
                capacity.threads, capacity.workgroup_bytes, capacity.subgroup
            ),
        ),
        ("binding", format!("{} bytes", limits.max_storage_buffer_binding_size)),
    ];
    let rows: String = rows.iter().map(|(label, value)| format!("  {label:<12}{value}\n")).collect();
    format!("{}\n{rows}", gpu.name())
}
