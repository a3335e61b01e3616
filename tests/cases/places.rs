//! The integers in which f32 holds places, of the shaders on every adapter against those of Rust: a million random
//! operands, and those at the edges.

use curvelax::{
    backend::gpu::Gpu,
    number::place::{NodePlace, ORIGIN, OUTSIDE, RIM, STEP},
};
use libtest_mimic::{Failed, Trial};
use wgpu::util::DeviceExt;

/// The operations of the file on one place after another; the results of each operand after those of another.
const MAIN: &str = "
@group(0) @binding(0) var<storage, read> places: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> ways: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> results: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    let to = moved(places[i], ways[i]);
    results[4u * i] = to;
    results[4u * i + 1u] = apart(places[i], to);
    results[4u * i + 2u] = coordinate(places[i]);
    results[4u * i + 3u] = placed(ways[i]);
}
";
/// Vectors of four operands.
const VECTORS: usize = 1 << 18;
/// Vectors of a dispatch.
const AT_ONCE: usize = 1 << 14;

pub fn trials() -> Vec<Trial> {
    let adapters = Gpu::list();
    let names = adapters.iter().enumerate().map(|(index, gpu)| (index, gpu.name().to_owned()));
    names
        .map(|(index, name)| {
            let name = format!("integers of places agree on adapter {index}, {name}");
            Trial::test(name, move || {
                let text = curvelax_shaders::PLACE_FIXED.1;
                agree(index, text)?;
                // The controls: increments that are cut off, and places that wrap round.
                for (right, wrong) in [("round(way)", "trunc(way)"), ("clamp(steps, vec4(-RIM), vec4(RIM))", "steps")] {
                    let broken = text.replace(right, wrong);
                    if broken == text || agree(index, &broken).is_ok() {
                        return Err(format!("{wrong} makes no difference").into());
                    }
                }
                Ok(())
            })
        })
        .collect()
}

/// A place as its bits, and an increment.
fn operands() -> Vec<(f32, f32)> {
    let place = |steps: i32| f32::from_bits((ORIGIN + steps) as u32);
    let edges = [0, 1, -1, RIM, -RIM, RIM - 1, 1 - RIM, OUTSIDE, OUTSIDE - 1, -OUTSIDE, 0x00ff_ffff, 0x0100_0001];
    let ways =
        [0.0, -0.0, STEP, -STEP, 0.5 * STEP, 1.5 * STEP, -2.5 * STEP, 1e-30, 1.0, -1.0, 7.9, -7.9, 8.0, -8.0, 8.1];
    let far = [1e3, -1e30, f32::INFINITY, f32::NEG_INFINITY];
    let mut all: Vec<(f32, f32)> =
        edges.into_iter().flat_map(|at| ways.into_iter().chain(far).map(move |by| (place(at), by))).collect();
    let mut state = 7_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 32) as u32
    };
    while all.len() < 4 * VECTORS {
        let at = (i64::from(next()) * 2 * i64::from(RIM) / (1 << 32)) as i32 - RIM;
        let (digits, halvings) = (next() as i32 as f32 / i32::MAX as f32, next() % 32);
        all.push((place(at), 8.0 * digits * 0.5_f32.powi(halvings as i32)));
    }
    all
}

/// Whether the operations of this text agree.
fn agree(index: usize, text: &str) -> Result<(), Failed> {
    let operands = operands();
    let numbers = |of: fn(&(f32, f32)) -> f32| operands.iter().map(of).collect::<Vec<f32>>();
    let found = compute(index, text, &numbers(|pair| pair.0), &numbers(|pair| pair.1))?;
    let mut rounded = 0;
    for (i, (place, way)) in operands.iter().enumerate() {
        let at = |result: usize| found[16 * (i / 4) + 4 * result + i % 4];
        let to = f32::moved(*place, *way);
        let wrong = |what: &str, found: f32, expected: f32| {
            let bits = [*place, found, expected].map(f32::to_bits);
            Err(format!("{what} of {:#x} and {way:e}: {:#x}, not {:#x}", bits[0], bits[1], bits[2]).into())
        };
        // Sums are exact. A device may round an integer that has more digits than a number up or down.
        for (what, found, expected) in [("moved", at(0), to), ("placed", at(3), f32::placed(*way))] {
            if found.to_bits() != expected.to_bits() {
                return wrong(what, found, expected);
            }
        }
        for (what, found, expected) in
            [("apart", at(1), f32::apart(*place, to)), ("coordinate", at(2), f32::coordinate(*place))]
        {
            if found != expected && (found - expected).abs() > f32::EPSILON * expected.abs() {
                return wrong(what, found, expected);
            }
            rounded += u32::from(found != expected);
        }
    }
    println!("{} operands, {rounded} results rounded otherwise", operands.len());
    Ok(())
}

/// The results of the text on the adapter.
fn compute(index: usize, text: &str, places: &[f32], ways: &[f32]) -> Result<Vec<f32>, Failed> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    let adapters = pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(wgpu::Backends::PRIMARY));
    let name = Gpu::list()[index].name().to_owned();
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name == name).ok_or("no such adapter")?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
    let text = format!("alias real = f32; alias vec = vec4<real>;\n{text}{MAIN}");
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let mut all = Vec::new();
    for (places, ways) in places.chunks(4 * AT_ONCE).zip(ways.chunks(4 * AT_ONCE)) {
        let filled = |numbers: &[f32]| {
            let (contents, usage) = (bytemuck::cast_slice(numbers), wgpu::BufferUsages::STORAGE);
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
        };
        let size = 16 * places.len() as u64;
        let empty = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let results = empty(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let staging = empty(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let buffers = [filled(places), filled(ways), results.clone()];
        let entries: Vec<wgpu::BindGroupEntry> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = &pipeline.get_bind_group_layout(0);
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries });
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups((places.len() / 256) as u32, 1, 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&results, 0, &staging, 0, size);
        queue.submit([encoder.finish()]);
        staging.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        device.poll(wgpu::PollType::wait_indefinitely())?;
        all.extend_from_slice(bytemuck::cast_slice(&staging.slice(..).get_mapped_range()?));
    }
    Ok(all)
}
