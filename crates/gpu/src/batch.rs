//! A batch of slots: its buffers, the host's [`Mirror`] of the small ones, and at most one dispatch in progress.

use std::{
    sync::mpsc::{Receiver, channel},
    time::Duration,
};

use super::{abandoned, adapter::OpenGpu, clock::Moment};
use curvelax_backend::gpu::{
    Budget,
    mirror::{Binding, Caps, Mirror},
};
use curvelax_base::error::Result;
use curvelax_flow::{number::Real, scheme::run::Run, solver::Blocks};

/// Slots side by side in one dispatch.
pub(super) struct Batch<T> {
    /// The buffers, in the order of their bindings.
    bound: Vec<wgpu::Buffer>,
    /// One for reading back.
    staging: wgpu::Buffer,
    bindings: wgpu::BindGroup,
    mirror: Mirror<T>,
    clock: Option<DeviceClock>,
    flight: Option<Flight>,
}

/// A dispatch in progress.
struct Flight {
    since: Moment,
    back: Reading,
}

/// A dispatch that is done.
pub(super) struct Landed {
    /// When it was started.
    pub since: Moment,
    /// How long it took by the clock of the device, if that has one.
    pub took: Option<Duration>,
}

/// The device's clock, read where a dispatch begins and where it ends.
struct DeviceClock {
    times: wgpu::QuerySet,
    ticks: wgpu::Buffer,
    nanoseconds_per_tick: f64,
}

impl DeviceClock {
    const BYTES: u64 = 2 * wgpu::QUERY_SIZE as u64;

    /// A clock of `device`, if it has one.
    fn new(device: &OpenGpu) -> Option<DeviceClock> {
        let nanoseconds_per_tick = f64::from(device.queue.get_timestamp_period());
        device.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| DeviceClock {
            times: device.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            ticks: device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("ticks"),
                size: Self::BYTES,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            nanoseconds_per_tick,
        })
    }

    fn writes(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.times,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// The time between the two readings, if the clock ran.
    fn between(&self, bytes: &[u8]) -> Option<Duration> {
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(bytes);
        let passed = ticks[1].checked_sub(ticks[0]).filter(|passed| *passed > 0)?;
        Some(Duration::from_nanos((passed as f64 * self.nanoseconds_per_tick) as u64))
    }
}

/// A copy to the host in progress.
pub(super) struct Reading {
    submission: wgpu::SubmissionIndex,
    staging: wgpu::Buffer,
    bytes: u64,
    mapped: Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
}

impl<T: Real> Batch<T> {
    /// Allocates room for `slots` members.
    pub fn new(device: &OpenGpu, pipeline: &wgpu::ComputePipeline, blocks: Blocks, slots: usize, traced: bool) -> Self {
        let bound = buffers::<T>(&device.device, blocks, slots, traced);
        let entries: Vec<_> = (0..)
            .zip(&bound)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("evolve"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let mirror = Mirror::new(blocks, slots);
        Batch {
            bound,
            staging: staging(&device.device, mirror.bytes_back() as u64 + DeviceClock::BYTES),
            bindings,
            mirror,
            clock: DeviceClock::new(device),
            flight: None,
        }
    }

    /// Returns the bytes of its buffers.
    pub fn bytes(&self) -> u64 {
        self.bound.iter().chain([&self.staging]).map(wgpu::Buffer::size).sum()
    }

    pub fn mirror(&self) -> &Mirror<T> {
        &self.mirror
    }

    pub fn mirror_mut(&mut self) -> &mut Mirror<T> {
        &mut self.mirror
    }

    /// Returns where the state of `slot` is stored.
    pub fn state_at(&self, slot: usize) -> (&wgpu::Buffer, u64, u64) {
        let (offset, bytes) = self.mirror.state_at(slot);
        (&self.bound[Binding::States as usize], offset, bytes)
    }

    pub fn trace(&self) -> Option<&wgpu::Buffer> {
        self.bound.get(Binding::Trace as usize)
    }

    /// Puts members, each with the rows of its state, into consecutive slots.
    pub fn load<'a>(
        &mut self,
        device: &OpenGpu,
        first: usize,
        members: impl ExactSizeIterator<Item = (&'a Run<T>, &'a [T])>,
    ) {
        let (states, offset, bytes) = self.state_at(first);
        let all = wgpu::BufferSize::new(bytes * members.len() as u64);
        // A fault is reported to the device.
        let mut view = all.and_then(|all| device.queue.write_buffer_with(states, offset, all));
        for (i, (run, rows)) in members.enumerate() {
            self.mirror.load(first + i, run);
            if let Some(view) = &mut view {
                let from = i * bytes as usize;
                view.slice(from..from + bytes as usize).copy_from_slice(bytemuck::cast_slice(rows));
            }
        }
    }

    /// Dispatches the members that are due, if any.
    pub fn start(&mut self, device: &OpenGpu, pipeline: &wgpu::ComputePipeline, budget: Budget, caps: Caps) {
        let due = self.mirror.look();
        if due == 0 {
            return;
        }
        let Batch { mirror, bound, staging, clock, .. } = self;
        mirror.upload(budget, caps, |binding, offset, bytes| {
            device.queue.write_buffer(&bound[binding as usize], offset, bytes);
        });
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let timestamp_writes = clock.as_ref().map(DeviceClock::writes);
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("evolve"), timestamp_writes });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(due, 1, 1);
        drop(pass);
        if let Some(clock) = clock {
            encoder.resolve_query_set(&clock.times, 0..2, &clock.ticks, 0);
        }
        let reads = [Binding::Counters, Binding::Reports].map(|binding| &bound[binding as usize]);
        let reads: Vec<_> = reads.into_iter().chain(clock.as_ref().map(|clock| &clock.ticks)).collect();
        let reads: Vec<_> = reads.into_iter().map(|buffer| (buffer, 0, buffer.size())).collect();
        let back = Reading::submit(device, encoder, staging, &reads);
        self.flight = Some(Flight { since: device.now(), back });
    }

    /// Returns when the dispatch in progress was started.
    pub fn since(&self) -> Option<Moment> {
        self.flight.as_ref().map(|flight| flight.since)
    }

    /// Waits for the dispatch, but no longer than `most`. Returns whether nothing is left to wait for, even because of
    /// a fault, which `finish` reports.
    pub fn is_back(&self, device: &OpenGpu, most: Duration) -> bool {
        let Some(Flight { back, .. }) = &self.flight else { return true };
        device.wait(&back.submission, most).unwrap_or(true)
    }

    /// Waits for the dispatch, if there is one, while it has time `left`, and reads its records.
    pub fn finish(&mut self, device: &OpenGpu, left: impl Fn(Moment) -> Duration) -> Result<Option<Landed>> {
        let Some(Flight { since, back }) = self.flight.take() else {
            self.mirror.forget_sweeps();
            return Ok(None);
        };
        let bytes = back.wait(device, since, left)?;
        let idle = |slot| device.error(&format!("a dispatch did nothing for the member in slot {slot}"));
        let (records, ticks) = bytes.split_at(self.mirror.bytes_back());
        self.mirror.take(records).map_err(idle)?;
        let took = self.clock.as_ref().and_then(|clock| clock.between(ticks));
        Ok(Some(Landed { since, took }))
    }
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
        while !device.wait(&self.submission, left(since))? {
            if left(since).is_zero() {
                let seconds = since.elapsed().as_secs_f64();
                // To release a device, wgpu waits until it is idle.
                abandoned::abandon(device.clone());
                return Err(device.error(&format!("a dispatch did not end in {seconds:.3} s and is given up")));
            }
        }
        let failed = |what: String| device.error(&what);
        // Another thread that waits for this device may have taken the news, and be about to pass it on.
        match self.mapped.recv_timeout(left(since).max(Duration::from_secs(1))) {
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

/// The buffers of a batch, in the order of their bindings.
fn buffers<T: Real>(device: &wgpu::Device, blocks: Blocks, slots: usize, traced: bool) -> Vec<wgpu::Buffer> {
    let buffer = |binding: Binding| {
        let kind = match binding {
            Binding::Dispatch => wgpu::BufferUsages::UNIFORM,
            _ => wgpu::BufferUsages::STORAGE,
        };
        let usage = kind | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let (label, size) = (Some(binding.name()), binding.bytes::<T>(blocks, slots) as u64);
        device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
    };
    Binding::ALL.into_iter().filter(|binding| traced || *binding != Binding::Trace).map(buffer).collect()
}
