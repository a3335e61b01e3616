//! Every shader, without any GPU: valid in both precisions, translated for every API, laid out as the host expects, and
//! free of constructs that WGSL silently gets wrong.

use std::collections::BTreeMap;

use curvelax::{
    backend::gpu::{Variant, kernel, shader},
    crystal::{MOST_WAVES, WAVE},
    ensemble::Status,
    flow::{DIFFUSIVITY_WAVES, ENERGY_UNIT, ENERGY_WAVES, LAW, LENGTH_PENALTY, QUOTIENT},
    forcing::{CONSERVED, DRIVE, FEEDBACK, FEEDBACK_AREA, KEPT_AREA, KEPT_LENGTH},
    number::{BIG, LN_HALVINGS, LN_TERMS, Real, place},
    scheme::{
        decay, dense,
        excess::{AT_REST, ROOT_TERMS},
        extrapolation,
        forcing::{DAMPING, ROUNDING_OF_SIZES, ROUNDS},
        member::{self, Counters, Decay, NEVER, Observed, Parameters, Progress, Report},
        observe::{MAX_DRIFT, MAX_GAP, MAX_TURN, MIN_EDGE, NEAR},
        pace,
        state::{CURVE_FIELDS, LASTING_FIELDS, NEEDED_FIELDS, STATE_FIELDS},
        step::NEGLIGIBLE,
    },
    solver::{
        Blocks, Solver,
        gauss_seidel::{AUTO_SCALE, MAX_CHECKS, SWEEPS_PER_CHECK},
        refinement, sweeps,
    },
};
use naga::{
    AddressSpace, Module, TypeInner,
    back::{hlsl, msl, spv},
    valid::{Capabilities, ModuleInfo, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator},
};

/// Threads of a subgroup.
const SUBGROUP: u32 = 32;
const SWEEPS: Variant = Variant::of(Solver::GaussSeidel);

/// The sources of all kernels one after another.
fn all_sources<T: Real>() -> String {
    Variant::all().into_iter().map(shader::source::<T>).collect()
}

fn capabilities<T: Real>() -> Capabilities {
    let f64 = if T::NAME == "f64" { Capabilities::FLOAT64 } else { Capabilities::empty() };
    f64 | Capabilities::SUBGROUP
}

/// Parses and validates a source; an error names the shader's own file and line.
fn validated<T: Real>(
    source: &str,
    variant: Variant,
    capabilities: Capabilities,
) -> Result<(Module, ModuleInfo), String> {
    let at = |line: usize| {
        shader::locate::<T>(line, variant).map_or(String::new(), |(file, line)| format!("{file}:{line}: "))
    };
    let module = naga::front::wgsl::parse_str(source).map_err(|error| {
        let line = error.location(source).map_or(0, |location| location.line_number as usize);
        format!("{}{}", at(line), error.message())
    })?;
    let mut validator = Validator::new(ValidationFlags::all(), capabilities);
    validator.subgroup_stages(ShaderStages::COMPUTE).subgroup_operations(SubgroupOperationSet::all());
    let info = validator.validate(&module).map_err(|error| {
        let line = error.location(source).map_or(0, |location| location.line_number as usize);
        format!("{}{}", at(line), error.emit_to_string(source))
    })?;
    Ok((module, info))
}

/// The module with its sizes filled in for rings of `n` nodes.
fn sized<T: Real>(n: usize, variant: Variant) -> (Module, ModuleInfo) {
    let (module, info) = validated::<T>(&shader::source::<T>(variant), variant, capabilities::<T>()).unwrap();
    let sizes = shader::sizes(Blocks::new(n).unwrap(), SUBGROUP, variant.for_one_size);
    let constants = shader::constants(sizes);
    let constants = constants.iter().map(|(name, value)| (name.to_string(), *value)).collect();
    let (module, info) = naga::back::pipeline_constants::process_overrides(&module, &info, None, &constants).unwrap();
    (module.into_owned(), info.into_owned())
}

#[test]
fn every_shader_is_valid_in_both_precisions() {
    for variant in Variant::all() {
        validated::<f32>(&shader::source::<f32>(variant), variant, capabilities::<f32>()).unwrap();
        validated::<f64>(&shader::source::<f64>(variant), variant, capabilities::<f64>()).unwrap();
    }
    // Negative control: f64 is refused unless requested.
    assert!(validated::<f64>(&shader::source::<f64>(SWEEPS), SWEEPS, Capabilities::empty()).is_err());
}

#[test]
fn an_error_names_the_shader_file_and_line() {
    let source = shader::source::<f32>(SWEEPS).replacen("fn pull() {", "fn pull() { nonsense;", 1);
    let message = validated::<f32>(&source, SWEEPS, Capabilities::empty()).unwrap_err();
    let line = include_str!("../../shaders/pull.wgsl").lines().position(|line| line == "fn pull() {").unwrap() + 1;
    assert!(message.starts_with(&format!("pull.wgsl:{line}:")), "{message}");
}

#[test]
fn every_file_in_the_folder_is_part_of_the_kernel() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/shaders");
    let source = all_sources::<f32>() + &all_sources::<f64>();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "wgsl") {
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(source.contains(&text), "{} is in no kernel", path.display());
        }
    }
}

#[test]
fn f32_translates_for_every_api_and_f64_for_vulkan() {
    for (n, variant) in
        [6, 100, 257].into_iter().flat_map(|n| Variant::all().into_iter().map(move |variant| (n, variant)))
    {
        let (module, info) = sized::<f32>(n, variant);
        let options = spv::Options { lang_version: (1, 3), ..Default::default() };
        spv::write_vec(&module, &info, &options, None).unwrap();
        msl::write_string(
            &module,
            &info,
            &msl::Options { fake_missing_bindings: true, lang_version: (2, 4), ..Default::default() },
            &Default::default(),
        )
        .unwrap();
        let mut text = String::new();
        let shader_model = hlsl::ShaderModel::V6_0;
        let options = hlsl::Options { fake_missing_bindings: true, shader_model, ..Default::default() };
        hlsl::Writer::new(&mut text, &options, &Default::default()).write(&module, &info, None).unwrap();
        assert!(text.contains("evolve"));

        let (module, info) = sized::<f64>(n, variant);
        spv::write_vec(&module, &info, &spv::Options { lang_version: (1, 3), ..Default::default() }, None).unwrap();
    }
}

/// Name → (field, offset) and size of every struct.
fn structs(module: &Module) -> BTreeMap<String, (Vec<(String, u32)>, u32)> {
    let mut found = BTreeMap::new();
    for (_, ty) in module.types.iter() {
        if let (Some(name), TypeInner::Struct { members, span }) = (&ty.name, &ty.inner) {
            let fields = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect();
            found.insert(name.clone(), (fields, *span));
        }
    }
    found
}

fn layouts_agree<T: Real>() {
    let (module, _) = validated::<T>(&shader::source::<T>(SWEEPS), SWEEPS, capabilities::<T>()).unwrap();
    let found = structs(&module);
    let number = size_of::<T>() as u32;
    let expect = |name: &str, fields: &[&str], step: u32| {
        let expected: Vec<_> = (0..).zip(fields).map(|(i, field)| (field.to_string(), i * step)).collect();
        assert_eq!(found[name], (expected, fields.len() as u32 * step), "{name} in {}", T::NAME);
    };
    // The first two fields are structs, and the third is an array.
    let (levels, law) = (Observed::<T>::LEN as u32, LAW as u32);
    let starts = [0, levels, 2 * levels].into_iter().chain(2 * levels + law..).map(|start| start * number);
    let fields = Parameters::<T>::FIELDS.iter().map(|field| field.to_string()).zip(starts).collect();
    assert_eq!(found["Parameters"], (fields, Parameters::<T>::LEN as u32 * number), "Parameters in {}", T::NAME);
    expect("Observed", Observed::<T>::FIELDS, number);
    expect("Progress", Progress::<T>::FIELDS, number);
    expect("Decay", Decay::<T>::FIELDS, number);
    use std::mem::offset_of;
    let parts = [
        ("before", offset_of!(Report<T>, before)),
        ("now", offset_of!(Report<T>, now)),
        ("progress", offset_of!(Report<T>, progress)),
        ("decay", offset_of!(Report<T>, decay)),
    ];
    let parts = parts.map(|(part, offset)| (part.to_string(), offset as u32)).to_vec();
    let noted = offset_of!(Report<T>, excess_at) as u32;
    assert_eq!(found["Report"], (parts, noted), "Report in {}", T::NAME);
    let record = vec![("report".to_string(), 0), ("excess_at".to_string(), noted)];
    assert_eq!(found["Record"], (record, Report::<T>::LEN as u32 * number), "Record in {}", T::NAME);
    // Every one is a line of its text in TOML.
    let counters = toml::to_string(&Counters::default()).unwrap();
    let counters: Vec<&str> = counters.lines().map(|line| line.split_once(" = ").unwrap().0).collect();
    expect("Counters", &counters, 4);
    assert_eq!(size_of::<Counters>(), 4 * counters.len());
    expect("Dispatch", &kernel::DISPATCH_FIELDS, 4);
}

#[test]
fn the_structs_shared_with_the_host_have_its_layout() {
    layouts_agree::<f32>();
    layouts_agree::<f64>();
    use std::mem::offset_of;
    assert_eq!(offset_of!(Counters, goal), 24);
    assert_eq!(offset_of!(Counters, solve_sweeps), 4 * 13);
    assert_eq!(offset_of!(Parameters<f64>, law), 8 * 2 * Observed::<f64>::LEN);
    assert_eq!(offset_of!(Parameters<f64>, tau), 8 * (2 * Observed::<f64>::LEN + LAW));
    assert_eq!(size_of::<Report<f32>>(), 4 * Report::<f32>::LEN);
}

#[test]
fn bindings_are_found_by_name_where_the_host_puts_them() {
    for variant in Variant::all() {
        let (module, _) = validated::<f32>(&shader::source::<f32>(variant), variant, capabilities::<f32>()).unwrap();
        let mut bound = BTreeMap::new();
        for (_, variable) in module.global_variables.iter() {
            if let Some(binding) = &variable.binding {
                assert_eq!(binding.group, 0);
                bound.insert(binding.binding, variable.name.clone().unwrap());
            }
        }
        let mut expected = vec!["dispatch", "all_parameters", "all_counters", "all_reports", "all_states", "all_due"];
        if variant.traced {
            expected.push("traces");
        }
        assert_eq!(bound.into_values().collect::<Vec<_>>(), expected);
    }
}

/// All variants, for one size and for many.
fn both_kinds() -> Vec<Variant> {
    Variant::all().into_iter().flat_map(|own| [own, Variant { for_one_size: false, ..own }]).collect()
}

#[test]
fn workgroup_memory_is_what_the_host_counts() {
    for (n, variant) in
        [6, 7, 100, 257, 1024].into_iter().flat_map(|n| both_kinds().into_iter().map(move |variant| (n, variant)))
    {
        let blocks = Blocks::new(n).unwrap();
        let rows = if variant.for_one_size { blocks.count() } else { shader::threads(blocks, SUBGROUP) };
        let (module, _) = sized::<f64>(n, variant);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).unwrap();
        let in_workgroup = module.global_variables.iter().filter(|(_, v)| v.space == AddressSpace::WorkGroup);
        let bytes: u32 = in_workgroup.map(|(_, v)| layouter[v.ty].size).sum();
        let counted = shader::workgroup_bytes::<f64>(rows, variant);
        assert!(bytes as usize == counted, "n = {n}: {bytes}, counted {counted}");
        if n <= 512 && variant.for_one_size && variant.solver == Solver::GaussSeidel {
            assert!(counted <= 16_384, "n = {n} exceeds what every WebGPU device has: {counted}");
        }
    }
}

/// The text of all shaders without comments.
fn code() -> String {
    let source = all_sources::<f64>() + &all_sources::<f32>();
    source.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// f64 transcendentals pass validation and return garbage, and f32 ones in hardware differ from Rust's.
fn transcendental(module: &Module) -> Option<naga::MathFunction> {
    use naga::{Expression, MathFunction as M};
    let functions = module.functions.iter().map(|(_, f)| f).chain(module.entry_points.iter().map(|e| &e.function));
    let banned = |fun: &M| {
        matches!(
            fun,
            M::Exp
                | M::Exp2
                | M::Log
                | M::Log2
                | M::Pow
                | M::Sin
                | M::Cos
                | M::Tan
                | M::Sinh
                | M::Cosh
                | M::Tanh
                | M::Asin
                | M::Acos
                | M::Atan
                | M::Atan2
                | M::Asinh
                | M::Acosh
                | M::Atanh
                | M::InverseSqrt
                | M::Fma
        )
    };
    functions.flat_map(|f| f.expressions.iter().map(|(_, e)| e)).find_map(|e| match e {
        Expression::Math { fun, .. } if banned(fun) => Some(*fun),
        _ => None,
    })
}

#[test]
fn no_transcendental_function_is_used() {
    for variant in Variant::all() {
        let (module, _) = validated::<f64>(&shader::source::<f64>(variant), variant, capabilities::<f64>()).unwrap();
        assert_eq!(transcendental(&module), None);
    }
    // Negative control.
    let with = naga::front::wgsl::parse_str("fn f(x: f32) -> f32 { return exp(x); }").unwrap();
    assert!(transcendental(&with).is_some());
}

/// A comparison of a value with itself, meant to detect NaN: it is optimised away.
fn self_comparison(code: &str) -> Option<&str> {
    let spaced = code.replace("!=", " != ").replace("==", " == ");
    let words: Vec<&str> = spaced.split([' ', '\n', '(', ')', ';', '{', '}']).filter(|word| !word.is_empty()).collect();
    let compared = words.windows(3).find(|w| ["!=", "=="].contains(&w[1]) && w[0] == w[2])?[0];
    code.find(compared).map(|at| &code[at..at + compared.len()])
}

#[test]
fn nan_is_never_looked_for_by_comparing_a_value_with_itself() {
    assert_eq!(self_comparison(&code()), None);
    for bad in ["if (x != x) {", "x!=x", "!(x == x)"] {
        assert_eq!(self_comparison(bad), Some("x"), "{bad}");
    }
}

/// Value of `const NAME = …;` in the shaders, the same wherever it is.
fn constant(name: &str) -> f64 {
    let start = format!("const {name} = ");
    let code = code();
    let mut lines = code.lines().filter(|line| line.starts_with(&start));
    let line = lines.next().unwrap_or_else(|| panic!("no constant {name}"));
    assert!(lines.all(|other| other == line), "{name} has several values");
    let text = line[start.len()..].trim_end_matches(';').trim_end_matches(['u', 'i']);
    text.strip_prefix("0x")
        .map_or_else(|| text.parse().unwrap(), |hex| f64::from(u32::from_str_radix(hex, 16).unwrap()))
}

#[test]
fn the_constants_of_shaders_and_host_are_equal() {
    let table = [
        ("BIG", BIG),
        ("ORIGIN", f64::from(place::ORIGIN)),
        ("RIM", f64::from(place::RIM)),
        ("OUTSIDE", f64::from(place::OUTSIDE)),
        ("PER_UNIT", place::PER_UNIT.into()),
        ("STEP", place::STEP.into()),
        ("FARTHEST", place::FARTHEST.into()),
        ("BEYOND", place::BEYOND),
        ("MAX_TURN", MAX_TURN),
        ("MIN_EDGE", MIN_EDGE),
        ("MAX_DRIFT", MAX_DRIFT),
        ("MAX_GAP", MAX_GAP),
        ("NEAR", NEAR),
        ("ROOT_TERMS", f64::from(ROOT_TERMS)),
        ("SAFETY", pace::SAFETY),
        ("MAX_GROWTH", pace::MAX_GROWTH),
        ("BEHIND", pace::BEHIND),
        ("NEAREST_AIM", pace::NEAREST_AIM),
        ("MIN_GROWTH", pace::MIN_GROWTH),
        ("MIN_STEP", pace::MIN_STEP),
        ("WEIGHT", pace::WEIGHT),
        ("MIN_TO_SINGULAR", pace::MIN_TO_SINGULAR),
        ("PARTS", member::PARTS as f64),
        ("TIMES", member::TIMES as f64),
        ("LN_HALVINGS", f64::from(LN_HALVINGS)),
        ("LN_TERMS", f64::from(LN_TERMS)),
        ("STATE_FIELDS", STATE_FIELDS as f64),
        ("INCREMENTS", CURVE_FIELDS as f64),
        ("EARLIER", (CURVE_FIELDS + 3) as f64),
        ("SLOPE", (CURVE_FIELDS + 6) as f64),
        ("BEND", (2 * CURVE_FIELDS + 6) as f64),
        ("BEFORE", NEEDED_FIELDS as f64),
        ("SLOPE_BEFORE", (NEEDED_FIELDS + CURVE_FIELDS) as f64),
        ("BEND_BEFORE", (NEEDED_FIELDS + 2 * CURVE_FIELDS) as f64),
        ("PART", LASTING_FIELDS as f64),
        ("GAPS", (LASTING_FIELDS + CURVE_FIELDS) as f64),
        ("NODE_GAPS", (LASTING_FIELDS + 2 * CURVE_FIELDS) as f64),
        ("NODE_WEIGHT", extrapolation::NODE_WEIGHT),
        ("LEAST_ORDER", f64::from(extrapolation::LEAST_ORDER)),
        ("SHARED_PARTS", f64::from(extrapolation::SHARED_PARTS)),
        ("AFTER_FAILURE", pace::AFTER_FAILURE),
        ("AFTER_REFUSAL", pace::AFTER_REFUSAL),
        ("AFTER_REFUSALS", pace::AFTER_REFUSALS),
        ("ROUNDING", pace::ROUNDING),
        ("NOISE", extrapolation::NOISE),
        ("NOISE_OF_SCALE", extrapolation::NOISE_OF_SCALE),
        ("ONCE", pace::ONCE),
        ("TWICE", pace::TWICE),
        ("THRICE", pace::THRICE),
        ("AT_REST", AT_REST as f64),
        ("NOISE_OF_POLYGON", extrapolation::NOISE_OF_POLYGON),
        ("FALLS", pace::FALLS),
        ("RISES", pace::RISES),
        ("POINTS", f64::from(decay::POINTS)),
        ("RESOLVED", dense::RESOLVED),
        ("BISECTIONS", f64::from(dense::BISECTIONS)),
        ("EARLY_LOOK", dense::LOOKS[0]),
        ("LATE_LOOK", dense::LOOKS[1]),
        ("NEGLIGIBLE", NEGLIGIBLE),
        ("SWEEPS_PER_CHECK", f64::from(SWEEPS_PER_CHECK)),
        ("MAX_CHECKS", MAX_CHECKS),
        ("SETTLED", refinement::SETTLED),
        ("AUTO_SCALE", AUTO_SCALE),
        ("FLOOR", sweeps::FLOOR),
        ("NEVER", f64::from(NEVER)),
        ("RUNNING", 0.0),
        ("RELAXED", f64::from(Status::Relaxed as u32)),
        ("SINGULAR", f64::from(Status::Singular as u32)),
        ("NONFINITE", f64::from(Status::Nonfinite as u32)),
        ("STALLED", f64::from(Status::Stalled as u32)),
        ("HALF_OVER_PI", 0.5 / std::f64::consts::PI),
        ("LENGTH_PENALTY", LENGTH_PENALTY as f64),
        ("QUOTIENT", QUOTIENT as f64),
        ("ENERGY_WAVES", ENERGY_WAVES as f64),
        ("DIFFUSIVITY_WAVES", DIFFUSIVITY_WAVES as f64),
        ("ENERGY_UNIT", ENERGY_UNIT as f64),
        ("DRIVE", DRIVE as f64),
        ("FEEDBACK", FEEDBACK as f64),
        ("FEEDBACK_AREA", FEEDBACK_AREA as f64),
        ("CONSERVED", CONSERVED as f64),
        ("KEPT_AREA", KEPT_AREA as f64),
        ("KEPT_LENGTH", KEPT_LENGTH as f64),
        ("ROUNDS", ROUNDS as f64),
        ("DAMPING", DAMPING),
        ("ROUNDING_OF_SIZES", ROUNDING_OF_SIZES),
        ("TAU", std::f64::consts::TAU),
        ("MOST_WAVES", MOST_WAVES as f64),
        ("WAVE", WAVE as f64),
        ("TRACE_FIELDS", shader::TRACE_FIELDS as f64),
        ("CURVE", 0.0),
    ];
    for (name, value) in table {
        assert_eq!(constant(name), value, "{name}");
    }
    // What a variant is, and the status of a solve, or of the loop over steps, inside the kernel; the host never sees
    // it.
    let of_the_kernel = [
        "IS_SHORT",
        "REFINED",
        "IN_ROUNDS",
        "UNSOLVED",
        "SOLVED",
        "NOT_FINITE",
        "DIVERGED",
        "PAUSED",
        "REFUSED",
        "ACCEPTED",
        "AT_GOAL",
        "MAY_RELAX",
        "IS_DUE",
        "STRAIGHT",
        "EXPONENTIAL",
        "SMOOTH",
    ];
    let known = |name: &&str| table.iter().any(|(known, _)| known == name) || of_the_kernel.contains(name);
    let code = code();
    let names = code.lines().filter_map(|line| line.strip_prefix("const ")?.split([' ', ':']).next());
    let unknown: Vec<&str> = names.filter(|name| !known(name)).collect();
    assert_eq!(unknown, [""; 0], "constants of the shaders that are compared with nothing");
}

/// A device of wgpu's back end that computes nothing and checks everything.
fn noop_device() -> wgpu::Device {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::NOOP;
    descriptor.backend_options.noop.enable = true;
    let instance = wgpu::Instance::new(descriptor);
    let adapter = pollster::block_on(instance.request_adapter(&Default::default())).unwrap();
    let asked = wgpu::DeviceDescriptor {
        required_features: adapter.features() & (wgpu::Features::SHADER_F64 | wgpu::Features::SUBGROUP),
        // WebGPU's default limits, which every device has.
        ..Default::default()
    };
    pollster::block_on(adapter.request_device(&asked)).unwrap().0
}

/// The error of building the pipeline and binding `buffers` storage buffers after the uniform one.
fn pipeline_error<T: Real>(device: &wgpu::Device, n: usize, variant: Variant, buffers: u32) -> Option<String> {
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let sizes = shader::sizes(Blocks::new(n).unwrap(), SUBGROUP, variant.for_one_size);
    let pipeline = kernel::compile::<T>(device, sizes, variant);
    let buffer = |usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size: 4096, usage, mapped_at_creation: false })
    };
    let (uniform, storage) = (buffer(wgpu::BufferUsages::UNIFORM), buffer(wgpu::BufferUsages::STORAGE));
    let resource = |binding| if binding == 0 { uniform.as_entire_binding() } else { storage.as_entire_binding() };
    let entries: Vec<_> =
        (0..=buffers).map(|binding| wgpu::BindGroupEntry { binding, resource: resource(binding) }).collect();
    let layout = pipeline.get_bind_group_layout(0);
    let _ = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries });
    pollster::block_on(scope.pop()).map(|error| error.to_string())
}

#[test]
fn pipelines_are_built_and_bound_without_any_gpu() {
    let device = noop_device();
    assert!(device.features().contains(wgpu::Features::SHADER_F64));
    for n in [6, 7, 64, 100, 257] {
        for variant in Variant::all() {
            let buffers = 5 + u32::from(variant.traced);
            assert_eq!(pipeline_error::<f32>(&device, n, variant, buffers), None, "f32, n = {n}");
            assert_eq!(pipeline_error::<f64>(&device, n, variant, buffers), None, "f64, n = {n}");
            // Negative control: a missing buffer is detected.
            assert!(pipeline_error::<f32>(&device, n, variant, buffers - 1).is_some());
        }
    }
}

#[test]
fn the_noop_back_end_never_passes_for_an_adapter() {
    assert!(curvelax::backend::gpu::Gpu::list().iter().all(|gpu| gpu.api() != "Noop"));
}
