//! `curvelax adapters`: the devices of this machine, and which adapter `auto` uses and why.

use serde::Serialize;

use super::{flags, print, print_json};
use crate::{
    backend::gpu::Gpu,
    ensemble::{
        Spec,
        request::spec::{BackendChoice, Precision},
    },
    error::Result,
    placement::{self, MAX_POINTS_F32},
};

const EXAMPLES: &str = "\
Examples:
  curvelax adapters
  curvelax adapters --json";

/// List the GPU adapters, their features and limits, and which one `--backend auto` uses and why.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct AdaptersArgs {
    /// Print the list as JSON
    #[arg(long, help_heading = flags::OUTPUT)]
    json: bool,
}

/// The devices, and the choice of `auto`.
#[derive(Serialize)]
struct Listing {
    curvelax: &'static str,
    adapters: Vec<Adapter>,
    auto: Auto,
}

/// An adapter, with its limits for the solver of the default run.
#[derive(Serialize)]
struct Adapter {
    name: String,
    hardware: bool,
    device_type: String,
    api: String,
    driver: String,
    /// Maximum nodes of a member; null if there is no f64.
    max_points_f32: usize,
    max_points_f64: Option<usize>,
    workgroup_threads: usize,
    workgroup_bytes: usize,
    subgroup: u32,
    binding_bytes: u64,
}

/// The choice of `--backend auto` for the default run.
#[derive(Serialize)]
struct Auto {
    backend: BackendChoice,
    adapter: Option<String>,
    precision: Option<Precision>,
    sentence: String,
}

/// Prints the listing.
pub fn adapters(args: AdaptersArgs) -> Result<()> {
    let spec = Spec::default();
    let adapters: Vec<Adapter> = Gpu::list().iter().map(|gpu| Adapter::new(gpu, &spec)).collect();
    let choice = placement::choose(&spec)?;
    let mut settled = spec.clone();
    choice.settle_place(&mut settled);
    let Spec { backend, adapter, precision, .. } = settled;
    let auto = Auto { backend, adapter, precision, sentence: choice.sentence(&spec) };
    if args.json {
        return print_json(&Listing { curvelax: curvelax_base::VERSION, adapters, auto });
    }
    let mut text: String = adapters.iter().enumerate().map(|(number, adapter)| adapter.describe(number)).collect();
    if adapters.is_empty() {
        text += &format!("no GPU adapter: {}\n", placement::why_no_adapter());
    }
    print(&format!("{text}\n--backend auto, for the default run: {}\n", auto.sentence))
}

impl Adapter {
    fn new(gpu: &Gpu, spec: &Spec) -> Adapter {
        let capacity = gpu.capacity();
        Adapter {
            name: gpu.name().into(),
            hardware: gpu.is_hardware(),
            device_type: gpu.device_type(),
            api: gpu.api(),
            driver: gpu.driver(),
            max_points_f32: capacity.max_points::<f32>(spec.solver()).min(MAX_POINTS_F32),
            max_points_f64: gpu.has_f64().then(|| capacity.max_points::<f64>(spec.solver())),
            workgroup_threads: capacity.threads,
            workgroup_bytes: capacity.workgroup_bytes,
            subgroup: capacity.subgroup,
            binding_bytes: gpu.limits().max_storage_buffer_binding_size,
        }
    }

    fn describe(&self, number: usize) -> String {
        let kind = if self.hardware { "hardware" } else { "software" };
        let f64_points = self.max_points_f64.map_or(String::new(), |most| format!(", {most} in f64"));
        let rows = [
            ("kind", format!("{kind}, {}, {}", self.device_type, self.api)),
            ("driver", self.driver.clone()),
            ("precisions", if self.max_points_f64.is_some() { "f32, f64" } else { "f32" }.into()),
            ("points", format!("at most {} in f32{f64_points}", self.max_points_f32)),
            (
                "workgroup",
                format!(
                    "{} threads, {} bytes, subgroups of {}",
                    self.workgroup_threads, self.workgroup_bytes, self.subgroup
                ),
            ),
            ("binding", format!("{} bytes", self.binding_bytes)),
        ];
        let rows: String = rows.iter().map(|(label, value)| format!("  {label:<12}{value}\n")).collect();
        format!("{number}  {}\n{rows}", self.name)
    }
}
