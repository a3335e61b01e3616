//! The kernel with its buffers: slots of resident members, one workgroup each.
//!
//! The host keeps a mirror of the small arrays (parameters, counters, reports) and uploads it before a dispatch
//! where it changed; after a dispatch counters and reports come back, states only when asked for.

use std::time::Duration;

use super::{
    adapter::{Device, Gpu},
    shader::{self, Variant},
};
use crate::{
    backend::Backend,
    error::{Error, Result},
    number::Real,
    scheme::{
        Parameters, State,
        evolve::Run,
        parameters::{Counters, Report},
        state::STATE_FIELDS,
    },
    solver::{Blocks, Solver, gauss_seidel::SWEEPS_PER_CHECK},
};

/// A dispatch aims to last this long: short enough for every watchdog, long enough to hide its overhead.
const DISPATCH_TIME: Duration = Duration::from_millis(40);
/// A dispatch that takes longer than this is given up.
const DISPATCH_LIMIT: Duration = Duration::from_secs(120);
/// Slots at most; more members resident at once gain nothing.
const MAX_SLOTS: usize = 8192;

/// Fields that a traced kernel keeps per member; `conformance::bounds::STAGES` names them in their order.
pub const TRACE_FIELDS: usize = 20;

/// Field names of what one dispatch asks for, in memory order.
pub const DISPATCH_FIELDS: [&str; 4] = ["steps", "max_sweeps", "sweeps", "blocks"];

/// What one dispatch asks for.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Dispatch {
    steps: u32,
    max_sweeps: u32,
    sweeps: u32,
    blocks: u32,
}

/// How much one dispatch may do. No bit of a result depends on it: a dispatch that runs out pauses, even inside a
/// solve, and the next one goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Steps per member.
    pub steps: u32,
    /// Sweeps per member, rounded up to the next look at the residual.
    pub sweeps: u32,
}

/// llvmpipe leaves all loops of a shader, without a word, once they have made 65 535 iterations together.
const SOFTWARE_ITERATIONS: u32 = 50_000;

impl Budget {
    /// The most that one dispatch may do on this adapter.
    fn most(gpu: &Gpu, blocks: Blocks, adaptive: bool) -> Budget {
        if gpu.is_hardware() {
            return Budget { steps: 1 << 20, sweeps: 1 << 24 };
        }
        // A sweep is one iteration; a look at the residual walks over all blocks, and a step does so ten times, an adaptive
        // one, which is three of the paper's, forty times.
        let walk = blocks.count() as u32 + 1;
        let walks = if adaptive { 40 } else { 10 };
        let sweeps = SOFTWARE_ITERATIONS / 2 * SWEEPS_PER_CHECK / (SWEEPS_PER_CHECK + walk);
        Budget { steps: (SOFTWARE_ITERATIONS / 2 / (walks * walk)).max(1), sweeps: sweeps.max(SWEEPS_PER_CHECK) }
    }
}

/// Compiled kernel and resident members of `n` nodes in numbers of type `T`.
pub struct Kernel<T> {
    gpu: Device,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    buffers: Buffers,
    blocks: Blocks,
    max_sweeps: u32,
    budget: Budget,
    most: Budget,
    fixed: bool,
    solver: Solver,
    parameters: Vec<T>,
    counters: Vec<Counters>,
    reports: Vec<Report<T>>,
    changed: bool,
}

struct Buffers {
    dispatch: wgpu::Buffer,
    parameters: wgpu::Buffer,
    counters: wgpu::Buffer,
    reports: wgpu::Buffer,
    states: wgpu::Buffer,
    trace: Option<wgpu::Buffer>,
    staging: wgpu::Buffer,
}

impl<T: Real> Kernel<T> {
    /// Compiles the kernel for rings cut by `blocks` and makes room for up to `members` members.
    pub fn new(gpu: &Gpu, blocks: Blocks, members: usize, max_sweeps: u32, variant: Variant) -> Result<Self> {
        let limits = gpu.limits();
        let state_bytes = STATE_FIELDS * blocks.n * size_of::<T>();
        let trace_bytes = if variant.traced { TRACE_FIELDS * blocks.n * size_of::<T>() } else { 0 };
        let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let fit = (binding / state_bytes.max(trace_bytes) as u64) as usize;
        let slots = members.min(fit).min(MAX_SLOTS).min(limits.max_compute_workgroups_per_dimension as usize).max(1);
        gpu.capacity()
            .check_size::<T>(blocks, variant.solver)
            .map_err(|e| Error::Request(format!("n = {} needs {e}", blocks.n)))?;
        let most = Budget::most(gpu, blocks, variant.adaptive);
        let device = gpu.open()?;
        let pipeline = compile::<T>(&device.device, blocks, gpu.subgroups()[usize::from(!variant.subgroup)], variant);
        let buffers = Buffers::new(&device.device, slots, state_bytes, trace_bytes, size_of::<T>());
        let bindings = buffers.bind(&device.device, &pipeline);
        device.check()?;
        Ok(Kernel {
            gpu: device,
            pipeline,
            bindings,
            buffers,
            blocks,
            max_sweeps,
            budget: match variant.solver {
                Solver::GaussSeidel => Budget { sweeps: 256, ..most },
                Solver::Direct => Budget { steps: 1, ..most },
            },
            solver: variant.solver,
            most,
            fixed: false,
            parameters: vec![T::of(0.0); slots * Parameters::<T>::FIELDS.len()],
            counters: vec![Counters::default(); slots],
            reports: vec![Report::default(); slots],
            changed: true,
        })
    }

    /// Fixes what a dispatch may do; otherwise it follows the time that dispatches take.
    pub fn with_budget(mut self, budget: Budget) -> Self {
        self.budget =
            Budget { steps: budget.steps.clamp(1, self.most.steps), sweeps: budget.sweeps.clamp(1, self.most.sweeps) };
        self.fixed = true;
        self
    }

    /// Overwrites the trace with NaN, so that nothing stale passes for a result.
    pub fn poison_trace(&mut self) -> Result<()> {
        if let Some(buffer) = &self.buffers.trace {
            let numbers = vec![T::of(f64::NAN); buffer.size() as usize / size_of::<T>()];
            self.gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&numbers));
        }
        self.gpu.check()
    }

    /// The traced fields of the last dispatch, `[slot][field][node]`; empty if the kernel is not traced.
    pub fn trace(&mut self) -> Result<Vec<f64>> {
        let Some(buffer) = self.buffers.trace.clone() else { return Ok(Vec::new()) };
        let numbers: Vec<T> = self.read(&buffer, 0, buffer.size())?;
        Ok(numbers.into_iter().map(T::to_f64).collect())
    }

    fn set_parameters<U: Real>(&mut self, slot: usize, parameters: &Parameters<U>) {
        let fields = Parameters::<T>::FIELDS.len();
        self.parameters[slot * fields..(slot + 1) * fields].copy_from_slice(&parameters.convert::<T>().to_numbers());
    }

    fn upload(&mut self) {
        let Budget { steps, sweeps } = self.budget;
        let asked = Dispatch { steps, max_sweeps: self.max_sweeps, sweeps, blocks: self.blocks.count() as u32 };
        self.gpu.queue.write_buffer(&self.buffers.dispatch, 0, bytemuck::bytes_of(&asked));
        if std::mem::take(&mut self.changed) {
            let reports: Vec<T> = self.reports.iter().flat_map(Report::to_numbers).collect();
            self.gpu.queue.write_buffer(&self.buffers.parameters, 0, bytemuck::cast_slice(&self.parameters));
            self.gpu.queue.write_buffer(&self.buffers.counters, 0, bytemuck::cast_slice(&self.counters));
            self.gpu.queue.write_buffer(&self.buffers.reports, 0, bytemuck::cast_slice(&reports));
        }
    }

    fn dispatch(&mut self) -> wgpu::CommandEncoder {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(self.counters.len() as u32, 1, 1);
        drop(pass);
        encoder
    }

    /// Runs `encoder`, then copies `bytes` of each buffer to the host.
    fn submit_and_read(
        &mut self,
        mut encoder: wgpu::CommandEncoder,
        reads: &[(&wgpu::Buffer, u64, u64)],
    ) -> Result<Vec<u8>> {
        let total: u64 = reads.iter().map(|read| read.2).sum();
        if total > self.buffers.staging.size() {
            self.buffers.staging = staging(&self.gpu.device, total);
        }
        let staging = &self.buffers.staging;
        let mut at = 0;
        for (buffer, offset, bytes) in reads {
            encoder.copy_buffer_to_buffer(buffer, *offset, staging, at, *bytes);
            at += bytes;
        }
        self.gpu.queue.submit([encoder.finish()]);
        let slice = staging.slice(..total);
        let (send, receive) = std::sync::mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |mapped| drop(send.send(mapped)));
        let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(DISPATCH_LIMIT) };
        let polled = self.gpu.device.poll(wait);
        self.gpu.check()?;
        let failed = |what: String| Error::Device(format!("GPU: {what}; try --backend cpu"));
        polled.map_err(|e| failed(format!("a dispatch did not end in {} s ({e})", DISPATCH_LIMIT.as_secs())))?;
        match receive.try_recv() {
            Ok(Ok(())) => {}
            other => return Err(failed(format!("results could not be read back ({other:?})"))),
        }
        let view = slice.get_mapped_range().map_err(|e| failed(format!("results could not be mapped ({e})")))?;
        let bytes = view.to_vec();
        drop(view);
        staging.unmap();
        Ok(bytes)
    }

    fn read(&mut self, buffer: &wgpu::Buffer, offset: u64, bytes: u64) -> Result<Vec<T>> {
        let encoder = self.gpu.device.create_command_encoder(&Default::default());
        let bytes = self.submit_and_read(encoder, &[(buffer, offset, bytes)])?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    /// Every member that was due has made a step or a sweep, or ended: a kernel that does nothing must not be awaited.
    fn check_progress(&self, before: &[Counters]) -> Result<()> {
        let stuck = before.iter().zip(&self.counters).position(|(old, new)| {
            let due = old.status == 0 && old.steps < old.goal;
            let position = |c: &Counters| (c.status, c.steps, c.rejected, c.phase, c.solve_sweeps);
            due && position(old) == position(new) && new.sweeps_k + new.sweeps_x == 0
        });
        match stuck {
            None => Ok(()),
            Some(slot) => Err(Error::Device(format!(
                "GPU: a dispatch did nothing for the member in slot {slot}; see `curvelax check`, or try --backend cpu"
            ))),
        }
    }

    /// Doubles or shrinks the work of the next dispatch towards [`DISPATCH_TIME`]: its sweeps, or its steps where there
    /// are no sweeps.
    fn tune(&mut self, took: Duration) {
        let share = DISPATCH_TIME.as_secs_f64() / took.as_secs_f64().max(1e-6);
        let next = |now: u32, most: u32| ((f64::from(now) * share) as u32).clamp(1, 2 * now).min(most);
        match self.solver {
            _ if self.fixed => {}
            Solver::GaussSeidel => self.budget.sweeps = next(self.budget.sweeps, self.most.sweeps),
            Solver::Direct => self.budget.steps = next(self.budget.steps, self.most.steps),
        }
    }
}

impl<T: Real> Backend for Kernel<T> {
    fn slots(&self) -> usize {
        self.counters.len()
    }

    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        let run: Run<T> = run.convert();
        let numbers = run.state.to_numbers();
        let offset = slot * numbers.len() * size_of::<T>();
        self.gpu.queue.write_buffer(&self.buffers.states, offset as u64, bytemuck::cast_slice(&numbers));
        self.set_parameters(slot, &run.parameters);
        self.counters[slot] = run.counters;
        self.reports[slot] = run.report;
        self.changed = true;
        self.gpu.check()
    }

    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        self.set_parameters(slot, parameters);
        self.counters[slot].goal = goal;
        self.changed = true;
    }

    fn clear(&mut self, slot: usize) {
        // A goal that is reached already: the workgroup ends at once.
        self.counters[slot] = Counters::default();
        self.changed = true;
    }

    fn advance(&mut self) -> Result<()> {
        self.upload();
        let started = std::time::Instant::now();
        let encoder = self.dispatch();
        let (counters, reports) = (self.buffers.counters.clone(), self.buffers.reports.clone());
        let reads = [(&counters, 0, counters.size()), (&reports, 0, reports.size())];
        let bytes = self.submit_and_read(encoder, &reads)?;
        self.tune(started.elapsed());
        let (counters, reports) = bytes.split_at(counters.size() as usize);
        let before = std::mem::replace(&mut self.counters, bytemuck::pod_collect_to_vec(counters));
        self.check_progress(&before)?;
        let numbers: Vec<T> = bytemuck::pod_collect_to_vec(reports);
        self.reports = numbers.chunks_exact(Report::<T>::LEN).map(Report::from_numbers).collect();
        Ok(())
    }

    fn counters(&self, slot: usize) -> Counters {
        self.counters[slot]
    }

    fn report(&self, slot: usize) -> Report<f64> {
        self.reports[slot].convert()
    }

    fn state(&mut self, slot: usize) -> Result<State<f64>> {
        let bytes = (STATE_FIELDS * self.blocks.n * size_of::<T>()) as u64;
        let states = self.buffers.states.clone();
        let numbers = self.read(&states, slot as u64 * bytes, bytes)?;
        Ok(State::from_numbers(&numbers).convert())
    }
}

/// The compute pipeline, specialised for a ring and a precision.
pub fn compile<T: Real>(
    device: &wgpu::Device,
    blocks: Blocks,
    subgroup: u32,
    variant: Variant,
) -> wgpu::ComputePipeline {
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
            constants: &shader::constants(blocks, subgroup),
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    })
}

fn staging(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
    device.create_buffer(&wgpu::BufferDescriptor { label: Some("staging"), size, usage, mapped_at_creation: false })
}

impl Buffers {
    fn new(device: &wgpu::Device, slots: usize, state_bytes: usize, trace_bytes: usize, number: usize) -> Buffers {
        let buffer = |label, bytes: usize, kind| {
            let usage = kind | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
            let size = bytes as u64;
            device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        let storage = wgpu::BufferUsages::STORAGE;
        let counters = slots * size_of::<Counters>();
        let reports = slots * Report::<f64>::LEN * number;
        Buffers {
            dispatch: buffer("dispatch", size_of::<Dispatch>(), wgpu::BufferUsages::UNIFORM),
            parameters: buffer("parameters", slots * Parameters::<f64>::FIELDS.len() * number, storage),
            counters: buffer("counters", counters, storage),
            reports: buffer("reports", reports, storage),
            states: buffer("states", slots * state_bytes, storage),
            trace: (trace_bytes > 0).then(|| buffer("trace", slots * trace_bytes, storage)),
            staging: staging(device, (counters + reports) as u64),
        }
    }

    fn bind(&self, device: &wgpu::Device, pipeline: &wgpu::ComputePipeline) -> wgpu::BindGroup {
        let mut buffers = vec![&self.dispatch, &self.parameters, &self.counters, &self.reports, &self.states];
        buffers.extend(&self.trace);
        let entries: Vec<_> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = pipeline.get_bind_group_layout(0);
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("evolve"),
            layout: &layout,
            entries: &entries,
        })
    }
}
