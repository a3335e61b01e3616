//! Every kernel as other compilers read it: WGSL, SPIR-V, Metal and HLSL.
//!
//!     cargo run --release --example kernels -- --points 100 --out kernels
//!
//! Writes `SOLVER[-adaptive][-geometric|-crystal][-forced][-subgroup]-PRECISION-nN` with the endings `.wgsl`, `.spv`,
//! `.metal` and `.hlsl`. WGSL has `override` constants for its sizes; the other formats have them filled in.
//! `kernels.json` names the constants of each kernel with their values. In front of a kernel of one subgroup, WGSL by
//! the standard wants `enable subgroups;`, which naga refuses. Metal and HLSL are written in f32 only: Metal has no
//! f64, and naga's HLSL is tested without.

use std::{
    collections::BTreeMap,
    error::Error,
    fs,
    path::{Path, PathBuf},
};

use clap::Parser;
use curvelax::{
    backend::gpu::{Variant, shader},
    number::Real,
    solver::Blocks,
};
use naga::{
    back::{hlsl, msl, pipeline_constants::process_overrides, spv},
    proc::{BoundsCheckPolicies, BoundsCheckPolicy},
    valid::{Capabilities, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator},
};

/// Threads of a subgroup: those of NVIDIA's GPUs, and of AMD's since RDNA.
const SUBGROUP: u32 = 32;

#[derive(Parser)]
struct Arguments {
    /// Nodes of a curve.
    #[arg(long, default_value_t = 100)]
    points: usize,
    /// Folder for the files; created if it is missing.
    #[arg(long)]
    out: PathBuf,
}

const TOO_FEW: &str = "--points: too few";

type Constants = BTreeMap<String, f64>;
pub(crate) type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let Arguments { points, out } = Arguments::parse();
    let count = write_all(points, &out)?;
    let lanes = 100.0 * shader::lanes_in_use(Blocks::new(points).ok_or(TOO_FEW)?, SUBGROUP);
    println!("{count} kernels in {}; {lanes:.0} % of the lanes are in use at n = {points}", out.display());
    Ok(())
}

/// Writes all kernels; returns their number.
pub(crate) fn write_all(points: usize, out: &Path) -> Outcome<usize> {
    let blocks = Blocks::new(points).ok_or(TOO_FEW)?;
    fs::create_dir_all(out)?;
    let fits = |variant: &Variant| !variant.subgroup || blocks.count() <= SUBGROUP as usize;
    let constants = shader::constants(shader::sizes(blocks, SUBGROUP, true));
    let constants: Constants = constants.iter().map(|(name, value)| (name.to_string(), *value)).collect();
    let mut written = BTreeMap::new();
    for variant in Variant::all().into_iter().filter(|variant| !variant.traced).filter(fits) {
        written.insert(write::<f32>(out, points, variant, &constants)?, &constants);
        written.insert(write::<f64>(out, points, variant, &constants)?, &constants);
    }
    fs::write(out.join("kernels.json"), serde_json::to_string_pretty(&written)? + "\n")?;
    Ok(written.len())
}

/// Writes one kernel in all formats; returns the stem of its files.
fn write<T: Real>(folder: &Path, points: usize, variant: Variant, constants: &Constants) -> Outcome<String> {
    let adaptive = if variant.adaptive { "-adaptive" } else { "" };
    let subgroup = if variant.subgroup { "-subgroup" } else { "" };
    let geometric = match (variant.crystal, variant.geometric) {
        (true, _) => "-crystal",
        (false, true) => "-geometric",
        (false, false) => "",
    };
    let forced = if variant.forced { "-forced" } else { "" };
    let stem = format!("{}{adaptive}{geometric}{forced}{subgroup}-{}-n{points}", variant.solver.name(), T::NAME);
    let file = |ending: &str| folder.join(format!("{stem}.{ending}"));

    let source = shader::source::<T>(variant);
    fs::write(file("wgsl"), &source)?;

    let module = naga::front::wgsl::parse_str(&source)?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::FLOAT64 | Capabilities::SUBGROUP);
    validator.subgroup_stages(ShaderStages::COMPUTE).subgroup_operations(SubgroupOperationSet::all());
    let info = validator.validate(&module)?;
    let constants = constants.iter().map(|(name, value)| (name.clone(), *value)).collect();
    let (module, info) = process_overrides(&module, &info, None, &constants)?;

    let words = spv::write_vec(&module, &info, &as_wgpu_asks(), None)?;
    fs::write(file("spv"), words.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<u8>>())?;
    if T::NAME == "f32" {
        let options = msl::Options { fake_missing_bindings: true, lang_version: (2, 4), ..Default::default() };
        fs::write(file("metal"), msl::write_string(&module, &info, &options, &Default::default())?.0)?;
        let shader_model = hlsl::ShaderModel::V6_0;
        let options = hlsl::Options { fake_missing_bindings: true, shader_model, ..Default::default() };
        let mut text = String::new();
        hlsl::Writer::new(&mut text, &options, &Default::default()).write(&module, &info, None)?;
        fs::write(file("hlsl"), text)?;
    }
    Ok(stem)
}

/// SPIR-V as wgpu hands it to a driver: indices restricted, loops bounded, workgroup memory as it is found.
pub(crate) fn as_wgpu_asks() -> spv::Options<'static> {
    let policies = BoundsCheckPolicies {
        index: BoundsCheckPolicy::Restrict,
        // Of drivers with robustBufferAccess2, which hardware has.
        buffer: BoundsCheckPolicy::Unchecked,
        ..Default::default()
    };
    spv::Options {
        lang_version: (1, 3),
        bounds_check_policies: policies,
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: true,
        ..Default::default()
    }
}
