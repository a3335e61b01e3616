//! A batch of slots: its buffers, the host's mirror of the small ones, and at most one dispatch in progress.
//!
//! Before a dispatch, the changed part of the mirror is uploaded together with the list of members that are due; only
//! they get a workgroup. Afterwards their counters and reports come back.

use std::{
    sync::mpsc::{Receiver, channel},
    time::Duration,
};

use super::{
    abandoned,
    adapter::{OpenGpu, Waited},
    budget::Budget,
    clock::Moment,
    shader::TRACE_FIELDS,
};
use crate::{
    error::Result,
    number::Real,
    scheme::{
        Parameters,
        member::{Counters, Report},
        run::Run,
        state::{STATE_FIELDS, State},
    },
    solver::Blocks,
};

/// Field names of the parameters of one dispatch, in memory order.
pub const DISPATCH_FIELDS: [&str; 6] = ["steps", "max_sweeps", "most_order", "sweeps", "blocks", "groups"];

/// Parameters of one dispatch.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Dispatch {
    steps: u32,
    max_sweeps: u32,
    most_order: u32,
    sweeps: u32,
    blocks: u32,
    groups: u32,
}

/// What members may do.
#[derive(Clone, Copy)]
pub(super) struct Caps {
    /// Maximum sweeps per system.
    pub max_sweeps: u32,
    /// Highest order of an adaptive step.
    pub most_order: u32,
}

/// Slots side by side in one dispatch.
pub(super) struct Batch<T> {
    buffers: Buffers,
    bindings: wgpu::BindGroup,
    blocks: Blocks,
    parameters: Vec<T>,
    counters: Vec<Counters>,
    reports: Vec<Report<T>>,
    changed: Vec<bool>,
    due: Vec<u32>,
    flight: Option<Flight>,
}

/// Numbers of a state in device memory: for every field a row of four per block.
pub(super) fn state_numbers(blocks: Blocks) -> usize {
    STATE_FIELDS * 4 * blocks.count()
}

/// Converts a state to rows; the last number of a block of three repeats its third node.
fn to_rows<T: Real>(blocks: Blocks, state: &State<T>) -> Vec<T> {
    let row = |field: &[T], (first, nodes): (usize, usize)| [0, 1, 2, 3].map(|c| field[first + c.min(nodes - 1)]);
    let numbers = state.to_numbers();
    let fields = numbers.chunks_exact(blocks.n);
    fields.flat_map(|field| blocks.iter().flat_map(move |block| row(field, block))).collect()
}

/// A dispatch in progress.
struct Flight {
    since: Moment,
    back: Reading,
}

/// A copy to the host in progress.
pub(super) struct Reading {
    submission: wgpu::SubmissionIndex,
    staging: wgpu::Buffer,
    bytes: u64,
    mapped: Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
}

struct Buffers {
    dispatch: wgpu::Buffer,
    parameters: wgpu::Buffer,
    counters: wgpu::Buffer,
    reports: wgpu::Buffer,
    states: wgpu::Buffer,
    due: wgpu::Buffer,
    trace: Option<wgpu::Buffer>,
    staging: wgpu::Buffer,
}

impl<T: Real> Batch<T> {
    /// Allocates room for `slots` members.
    pub fn new(device: &OpenGpu, pipeline: &wgpu::ComputePipeline, blocks: Blocks, slots: usize, traced: bool) -> Self {
        let buffers = Buffers::new::<T>(&device.device, blocks, slots, traced);
        Batch {
            bindings: buffers.bind(&device.device, pipeline),
            buffers,
            blocks,
            parameters: vec![T::of(0.0); slots * Parameters::<T>::FIELDS.len()],
            counters: vec![Counters::default(); slots],
            reports: vec![Report::default(); slots],
            changed: vec![true; slots],
            due: Vec::new(),
            flight: None,
        }
    }

    /// Returns the bytes of its buffers.
    pub fn bytes(&self) -> u64 {
        let Buffers { dispatch, parameters, counters, reports, states, due, trace, staging } = &self.buffers;
        let all = [dispatch, parameters, counters, reports, states, due, staging].into_iter().chain(trace);
        all.map(wgpu::Buffer::size).sum()
    }

    pub fn counters(&self, slot: usize) -> Counters {
        self.counters[slot]
    }

    pub fn report(&self, slot: usize) -> &Report<T> {
        &self.reports[slot]
    }

    /// Returns where the state of `slot` is stored.
    pub fn state_at(&self, slot: usize) -> (&wgpu::Buffer, u64, u64) {
        let bytes = (state_numbers(self.blocks) * size_of::<T>()) as u64;
        (&self.buffers.states, slot as u64 * bytes, bytes)
    }

    /// Returns the state that is stored in `rows`.
    pub fn state_of(&self, rows: &[T]) -> State<T> {
        let nodes = |((_, nodes), row): ((usize, usize), &[T])| row[..nodes].to_vec();
        let of_field = |field: &[T]| self.blocks.iter().zip(field.chunks_exact(4)).flat_map(nodes).collect::<Vec<T>>();
        let numbers: Vec<T> = rows.chunks_exact(4 * self.blocks.count()).flat_map(of_field).collect();
        State::from_numbers(&numbers)
    }

    pub fn trace(&self) -> Option<&wgpu::Buffer> {
        self.buffers.trace.as_ref()
    }

    pub fn load(&mut self, device: &OpenGpu, slot: usize, run: &Run<T>) {
        let (states, offset, _) = self.state_at(slot);
        device.queue.write_buffer(states, offset, bytemuck::cast_slice(&to_rows(self.blocks, &run.state)));
        self.counters[slot] = run.counters;
        self.reports[slot] = run.report;
        self.set_parameters(slot, &run.parameters);
    }

    pub fn set_parameters(&mut self, slot: usize, parameters: &Parameters<T>) {
        let fields = Parameters::<T>::FIELDS.len();
        self.parameters[slot * fields..(slot + 1) * fields].copy_from_slice(&parameters.to_numbers());
        self.changed[slot] = true;
    }

    pub fn set_counters(&mut self, slot: usize, change: impl FnOnce(&mut Counters)) {
        change(&mut self.counters[slot]);
        self.changed[slot] = true;
    }

    /// Dispatches the members that are due, if any.
    pub fn start(&mut self, device: &OpenGpu, pipeline: &wgpu::ComputePipeline, budget: Budget, caps: Caps) {
        self.due.clear();
        self.due.extend((0..).zip(&self.counters).filter(|(_, counters)| counters.is_running()).map(|(slot, _)| slot));
        if self.due.is_empty() {
            return;
        }
        self.upload(&device.queue, budget, caps);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(self.due.len() as u32, 1, 1);
        drop(pass);
        let Buffers { counters, reports, staging, .. } = &self.buffers;
        let reads = [counters, reports].map(|buffer| (buffer, 0, buffer.size()));
        self.flight = Some(Flight { since: device.now(), back: Reading::submit(device, encoder, staging, &reads) });
    }

    /// Returns when the dispatch in progress was started.
    pub fn since(&self) -> Option<Moment> {
        self.flight.as_ref().map(|flight| flight.since)
    }

    /// Waits for the dispatch, but no longer than `most`. Returns whether nothing is left to wait for, even because of
    /// a fault, which `finish` reports.
    pub fn is_back(&self, device: &OpenGpu, most: Duration) -> bool {
        let Some(Flight { back, .. }) = &self.flight else { return true };
        !matches!(device.wait(&back.submission, most), Ok(Waited::OnItsWay))
    }

    /// Waits for the dispatch while it has time `left`, and reads its records; returns when it was started.
    pub fn finish(&mut self, device: &OpenGpu, left: impl Fn(Moment) -> Duration) -> Result<Option<Moment>> {
        let Some(Flight { since, back }) = self.flight.take() else {
            self.forget_sweeps();
            return Ok(None);
        };
        let bytes = back.wait(device, since, left)?;
        let (counters, reports) = bytes.split_at(self.buffers.counters.size() as usize);
        let counters: Vec<Counters> = bytemuck::pod_collect_to_vec(counters);
        let reports: Vec<T> = bytemuck::pod_collect_to_vec(reports);
        self.forget_sweeps();
        for slot in self.due.iter().map(|slot| *slot as usize) {
            check_progress(device, slot, &self.counters[slot], &counters[slot])?;
            self.counters[slot] = counters[slot];
            self.reports[slot] = Report::from_numbers(&reports[slot * Report::<T>::LEN..(slot + 1) * Report::<T>::LEN]);
        }
        Ok(Some(since))
    }

    /// Members that were not due have made no sweeps.
    fn forget_sweeps(&mut self) {
        for counters in &mut self.counters {
            (counters.sweeps_k, counters.sweeps_x) = (0, 0);
        }
    }

    fn upload(&mut self, queue: &wgpu::Queue, Budget { steps, sweeps }: Budget, caps: Caps) {
        let blocks = self.blocks.count() as u32;
        let Caps { max_sweeps, most_order } = caps;
        let asked = Dispatch { steps, max_sweeps, most_order, sweeps, blocks, groups: blocks.isqrt() };
        queue.write_buffer(&self.buffers.dispatch, 0, bytemuck::bytes_of(&asked));
        queue.write_buffer(&self.buffers.due, 0, bytemuck::cast_slice(&self.due));
        // From the first changed slot to the last: needless uploads in between only write back what came from the
        // device.
        let Some(first) = self.changed.iter().position(|changed| *changed) else { return };
        let end = self.changed.iter().rposition(|changed| *changed).map_or(first, |last| last + 1);
        self.changed[first..end].fill(false);
        let reports: Vec<T> = self.reports[first..end].iter().flat_map(Report::to_numbers).collect();
        let fields = Parameters::<T>::FIELDS.len();
        let write = |buffer: &wgpu::Buffer, bytes: usize, data: &[u8]| {
            queue.write_buffer(buffer, (first * bytes) as u64, data);
        };
        let Buffers { parameters, counters, reports: of_reports, .. } = &self.buffers;
        write(
            parameters,
            fields * size_of::<T>(),
            bytemuck::cast_slice(&self.parameters[first * fields..end * fields]),
        );
        write(counters, size_of::<Counters>(), bytemuck::cast_slice(&self.counters[first..end]));
        write(of_reports, Report::<T>::LEN * size_of::<T>(), bytemuck::cast_slice(&reports));
    }
}

/// Checks that a due member has made a step or a sweep, or ended: a kernel that does nothing must not be waited for.
fn check_progress(device: &OpenGpu, slot: usize, before: &Counters, after: &Counters) -> Result<()> {
    let position = |c: &Counters| (c.status, c.steps, c.rejected, c.phase, c.solve_sweeps);
    if position(before) == position(after) && after.sweeps_k + after.sweeps_x == 0 {
        return Err(device.error(&format!("a dispatch did nothing for the member in slot {slot}")));
    }
    Ok(())
}

impl Reading {
    /// Runs `encoder`, then copies `bytes` of each buffer to the host through `staging`.
    pub fn submit(
        device: &OpenGpu,
        mut encoder: wgpu::CommandEncoder,
        staging: &wgpu::Buffer,
        reads: &[(&wgpu::Buffer, u64, u64)],
    ) -> Reading {
        let mut at = 0;
        for (buffer, offset, bytes) in reads {
            encoder.copy_buffer_to_buffer(buffer, *offset, staging, at, *bytes);
            at += bytes;
        }
        let submission = device.queue.submit([encoder.finish()]);
        let (send, mapped) = channel();
        staging.slice(..at).map_async(wgpu::MapMode::Read, move |result| drop(send.send(result)));
        Reading { submission, staging: staging.clone(), bytes: at, mapped }
    }

    /// Waits for the copy, in progress `since` then, while there is time `left`.
    pub fn wait(self, device: &OpenGpu, since: Moment, left: impl Fn(Moment) -> Duration) -> Result<Vec<u8>> {
        while device.wait(&self.submission, left(since))? == Waited::OnItsWay {
            if left(since).is_zero() {
                let seconds = since.elapsed().as_secs_f64();
                // To release a device, wgpu waits until it is idle.
                abandoned::abandon(device.clone());
                return Err(device.error(&format!("a dispatch did not end in {seconds:.3} s and is given up")));
            }
        }
        let failed = |what: String| device.error(&what);
        match self.mapped.try_recv() {
            Ok(Ok(())) => {}
            other => return Err(failed(format!("results could not be read back ({other:?})"))),
        }
        let slice = self.staging.slice(..self.bytes);
        let view = slice.get_mapped_range().map_err(|e| failed(format!("results could not be mapped ({e})")))?;
        let bytes = view.to_vec();
        drop(view);
        self.staging.unmap();
        Ok(bytes)
    }
}

/// A buffer that the host can read.
pub(super) fn staging(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
    device.create_buffer(&wgpu::BufferDescriptor { label: Some("staging"), size, usage, mapped_at_creation: false })
}

impl Buffers {
    fn new<T: Real>(device: &wgpu::Device, blocks: Blocks, slots: usize, traced: bool) -> Buffers {
        let buffer = |label, bytes: usize, kind| {
            let usage = kind | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
            let size = bytes as u64;
            device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        let storage = wgpu::BufferUsages::STORAGE;
        let numbers = |label, count: usize| buffer(label, slots * count * size_of::<T>(), storage);
        let counters = buffer("counters", slots * size_of::<Counters>(), storage);
        let reports = numbers("reports", Report::<T>::LEN);
        Buffers {
            dispatch: buffer("dispatch", size_of::<Dispatch>(), wgpu::BufferUsages::UNIFORM),
            parameters: numbers("parameters", Parameters::<T>::FIELDS.len()),
            staging: staging(device, counters.size() + reports.size()),
            counters,
            reports,
            states: numbers("states", state_numbers(blocks)),
            due: buffer("due", slots * size_of::<u32>(), storage),
            trace: traced.then(|| numbers("trace", TRACE_FIELDS * blocks.n)),
        }
    }

    fn bind(&self, device: &wgpu::Device, pipeline: &wgpu::ComputePipeline) -> wgpu::BindGroup {
        let Buffers { dispatch, parameters, counters, reports, states, due, trace, .. } = self;
        let buffers = [dispatch, parameters, counters, reports, states, due].into_iter().chain(trace);
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
