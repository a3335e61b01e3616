//! The kernel with its slots: resident members, one workgroup each, in one or two batches.
//!
//! With two batches, the device advances one while the host collects and refills the other. Each batch has its own
//! buffers, so that the device never waits between them.

use std::time::{Duration, Instant};

use super::{
    adapter::{Gpu, OpenGpu},
    batch::{Batch, Landed, Reading, staging},
    clock::Moment,
};
use curvelax_backend::{
    Backend,
    gpu::{
        Variant,
        mirror::{Caps, Mirror, state_numbers, to_rows},
    },
};
use curvelax_base::{
    error::{Error, Result},
    text::{bytes, plural},
    threads::HostThreads,
};
use curvelax_flow::{
    number::Real,
    scheme::{
        Parameters, State,
        extrapolation::MOST_ORDER,
        member::{Counters, Report},
        run::Run,
    },
    solver::{Blocks, Solver},
};

use super::patience;
pub use super::pipeline::compile;
pub use curvelax_backend::gpu::{Budget, mirror::DISPATCH_FIELDS};

/// Maximum slots of a batch; more resident members gain nothing.
const MAX_SLOTS: usize = 8192;
/// Minimum members of a batch if there are two: enough for the threads of a software GPU, or to fill a large GPU, which
/// holds some thousand at once, several times over.
const MIN_SLOTS: [usize; 2] = [32, 4096];

/// A compiled kernel and resident members of `n` nodes in numbers of type `T`.
pub struct Kernel<T> {
    gpu: OpenGpu,
    pipeline: wgpu::ComputePipeline,
    batches: Vec<Batch<T>>,
    slots_per_batch: usize,
    caps: Caps,
    solver: Solver,
    watched: bool,
    budget: Budget,
    most: Budget,
    fixed: bool,
    limit: Duration,
    /// When the last dispatch ended.
    ended: Moment,
}

impl<T: Real> Kernel<T> {
    /// Compiles the kernel for rings cut by `blocks` and makes room for up to `members` members.
    pub fn new(gpu: &Gpu, blocks: Blocks, members: usize, max_sweeps: u32, variant: Variant) -> Result<Self> {
        let batches = if members < 2 * MIN_SLOTS[usize::from(gpu.is_hardware())] { 1 } else { 2 };
        Self::in_batches(gpu, blocks, [batches, members.div_ceil(batches)], max_sweeps, variant)
    }

    /// Like [`Kernel::new`], with the given number of batches and at most the given number of slots in each.
    pub fn in_batches(
        gpu: &Gpu,
        blocks: Blocks,
        [batches, slots]: [usize; 2],
        max_sweeps: u32,
        variant: Variant,
    ) -> Result<Self> {
        let limits = gpu.limits();
        let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let fit = (binding / (state_numbers(blocks) * size_of::<T>()) as u64) as usize;
        let slots = slots.min(fit).min(MAX_SLOTS).min(limits.max_compute_workgroups_per_dimension as usize).max(1);
        gpu.capacity()
            .check_size::<T>(blocks, variant.solver)
            .map_err(|e| Error::Request(format!("n = {} needs {e}", blocks.n)))?;
        Self::with_slots(gpu, blocks, [batches, slots], max_sweeps, variant)
    }

    /// Like [`Kernel::in_batches`], with exactly the given slots, for which the device may not have room.
    ///
    /// # Errors
    /// [`Error::Device`] with their bytes.
    pub fn with_slots(
        gpu: &Gpu,
        blocks: Blocks,
        [batches, slots]: [usize; 2],
        max_sweeps: u32,
        variant: Variant,
    ) -> Result<Self> {
        let most = Budget::most(gpu.is_hardware(), blocks, variant);
        let (device, pipeline) = gpu.pipeline::<T>(blocks, variant)?;
        device.check()?;
        let batch = || Batch::new(&device, &pipeline, blocks, slots, variant.traced);
        let batches: Vec<Batch<T>> = (0..batches).map(|_| batch()).collect();
        if let Some(fault) = device.fault() {
            let (members, n) = (batches.len() * slots, blocks.n);
            let size = bytes(batches.iter().map(Batch::bytes).sum());
            let what = format!("{members} {} of {n} points", plural(members as u64, "member"));
            return Err(device.error(&format!("no room for {what}, {size}: {fault}")));
        }
        let ended = device.now();
        Ok(Kernel {
            gpu: device,
            pipeline,
            batches,
            slots_per_batch: slots,
            caps: Caps { max_sweeps, most_order: MOST_ORDER },
            solver: variant.solver,
            watched: variant.watched,
            budget: Budget::first(variant.solver, most),
            most,
            fixed: false,
            limit: patience()?,
            ended,
        })
    }

    /// Fixes the budget of a dispatch, which otherwise follows the time that dispatches take.
    pub fn with_budget(mut self, budget: Budget) -> Self {
        self.budget =
            Budget { steps: budget.steps.clamp(1, self.most.steps), sweeps: budget.sweeps.clamp(1, self.most.sweeps) };
        self.fixed = true;
        self
    }

    /// Changes the caps on the sweeps of a solve and on the order of a step.
    pub fn with_caps(mut self, max_sweeps: u32, most_order: u32) -> Self {
        self.caps = Caps { max_sweeps, most_order };
        self
    }

    /// Abandons a dispatch after `limit` instead of two minutes.
    pub fn with_limit(mut self, limit: Duration) -> Self {
        self.limit = limit;
        self
    }

    /// Returns the time of the dispatch in progress that counts towards the limit, to test it.
    #[doc(hidden)]
    pub fn spent(&self, batch: usize) -> Option<Duration> {
        self.batches[batch].since().map(|since| since.later(self.ended).spent())
    }

    /// Time left for a batch started at a given moment. A device runs one dispatch after another, so the time counts
    /// from the start of this one or the end of the one before, whichever is later.
    fn left(&self) -> impl Fn(Moment) -> Duration + use<T> {
        let (limit, ended) = (self.limit, self.ended);
        move |since| limit.saturating_sub(since.later(ended).spent())
    }

    /// Overwrites the trace with NaN, so that nothing stale passes as a result.
    pub fn poison_trace(&mut self) -> Result<()> {
        for buffer in self.batches.iter().filter_map(Batch::trace) {
            let numbers = vec![T::of(f64::NAN); buffer.size() as usize / size_of::<T>()];
            self.gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&numbers));
        }
        self.gpu.check()
    }

    /// Returns the traced fields of the last dispatch, `[slot][field][node]`; empty if the kernel is not traced.
    pub fn trace(&self) -> Result<Vec<f64>> {
        let reads: Vec<_> =
            self.batches.iter().filter_map(Batch::trace).map(|buffer| (buffer, 0, buffer.size())).collect();
        Ok(self.read(&reads)?.into_iter().map(T::to_f64).collect())
    }

    fn read(&self, reads: &[(&wgpu::Buffer, u64, u64)]) -> Result<Vec<T>> {
        if reads.is_empty() {
            return Ok(Vec::new());
        }
        let staging = staging(&self.gpu.device, reads.iter().map(|read| read.2).sum());
        let encoder = self.gpu.device.create_command_encoder(&Default::default());
        let since = self.gpu.now();
        let reading = Reading::submit(&self.gpu, encoder, &staging, reads);
        let bytes = reading.wait(&self.gpu, since, self.left())?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    fn place(&self, slot: usize) -> (&Batch<T>, usize) {
        (&self.batches[slot / self.slots_per_batch], slot % self.slots_per_batch)
    }

    fn place_mut(&mut self, slot: usize) -> (&mut Mirror<T>, usize) {
        (self.batches[slot / self.slots_per_batch].mirror_mut(), slot % self.slots_per_batch)
    }
}

impl<T: Real> Backend for Kernel<T> {
    fn slots(&self) -> usize {
        self.batches.len() * self.slots_per_batch
    }

    fn batches(&self) -> usize {
        self.batches.len()
    }

    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        self.load_all(vec![(slot, run.clone())], &HostThreads::new(1))
    }

    fn load_all(&mut self, runs: Vec<(usize, Run<f64>)>, threads: &HostThreads) -> Result<()> {
        if !self.watched && runs.iter().any(|(_, run)| run.parameters.branches().watched) {
            return Err(Error::Failed("a member waits for a level, and the kernel was compiled without levels".into()));
        }
        let blocks = self.batches[0].mirror().blocks();
        let prepared = threads.map(runs, |(slot, run)| {
            let run = run.convert();
            let rows = to_rows(blocks, &run.state);
            (slot, run, rows)
        });
        // Neighbours go to the device together.
        let are_neighbours =
            |a: &(usize, _, _), b: &(usize, _, _)| b.0 == a.0 + 1 && !b.0.is_multiple_of(self.slots_per_batch);
        for together in prepared.chunk_by(are_neighbours) {
            let first = together[0].0;
            let batch = &mut self.batches[first / self.slots_per_batch];
            batch.load(&self.gpu, first % self.slots_per_batch, together.iter().map(|(_, run, rows)| (run, &rows[..])));
        }
        self.gpu.check()
    }

    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        let (mirror, slot) = self.place_mut(slot);
        mirror.set_parameters(slot, &parameters.convert());
        mirror.set_counters(slot, |counters| counters.goal = goal);
    }

    fn clear(&mut self, slot: usize) {
        // A goal that has already been reached: the slot is never due.
        let (mirror, slot) = self.place_mut(slot);
        mirror.set_counters(slot, |counters| *counters = Counters::default());
    }

    fn start(&mut self, batch: usize) -> Result<()> {
        self.batches[batch].start(&self.gpu, &self.pipeline, self.budget, self.caps);
        self.gpu.check()
    }

    fn is_back(&mut self, batch: usize, most: Duration) -> bool {
        let Some(since) = self.batches[batch].since() else { return true };
        let (asked, left) = (Instant::now(), self.left());
        loop {
            let slice = most.saturating_sub(asked.elapsed()).min(left(since));
            // `finish` abandons a batch whose time is over.
            if self.batches[batch].is_back(&self.gpu, slice) || left(since).is_zero() {
                return true;
            }
            if asked.elapsed() >= most {
                return false;
            }
        }
    }

    fn finish(&mut self, batch: usize) -> Result<()> {
        let left = self.left();
        let Some(Landed { since, took }) = self.batches[batch].finish(&self.gpu, left)? else { return Ok(()) };
        // Without a clock of the device, the time until the host asked.
        let took = took.unwrap_or_else(|| since.later(self.ended).elapsed());
        self.ended = self.gpu.now();
        if !self.fixed {
            let used_up = self.batches[batch].mirror().has_used_up();
            self.budget = self.budget.after(took, used_up, self.solver, self.most);
        }
        Ok(())
    }

    fn counters(&self, slot: usize) -> Counters {
        let (batch, slot) = self.place(slot);
        batch.mirror().counters(slot)
    }

    fn report(&self, slot: usize) -> Report<f64> {
        let (batch, slot) = self.place(slot);
        batch.mirror().report(slot).convert()
    }

    fn states(&mut self, slots: &[usize]) -> Result<Vec<State<f64>>> {
        let places = slots.iter().map(|slot| self.place(*slot));
        let reads: Vec<_> = places.map(|(batch, slot)| batch.state_at(slot)).collect();
        let Some((_, _, bytes)) = reads.first() else { return Ok(Vec::new()) };
        let length = *bytes as usize / size_of::<T>();
        let numbers = self.read(&reads)?;
        Ok(numbers.chunks_exact(length).map(|rows| self.batches[0].mirror().state_of(rows).convert()).collect())
    }

    fn state(&mut self, slot: usize) -> Result<State<f64>> {
        Ok(self.states(&[slot])?.remove(0))
    }
}
