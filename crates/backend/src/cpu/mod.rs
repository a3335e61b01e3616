//! The CPU back end: the scheme itself, with members in the lanes of vector instructions and groups of members spread
//! over threads.
//!
//! Every call regroups the running members, so that no lane stays idle for long. A member's results do not depend on
//! its group, to the last bit. There are two batches of slots: while threads advance one, the host handles the other.

pub use curvelax_vectors::Vectors;

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

use rayon::prelude::*;

use super::Backend;
use curvelax_base::{
    error::{Error, Result},
    threads::{self, HostThreads},
};
use curvelax_flow::{
    scheme::{
        Parameters, State,
        evolve::Evolves,
        member::{Counters, Report},
        run::{Group, Run},
        state::STATE_FIELDS,
        step::Method,
    },
    solver::{Blocks, Solver},
};
use curvelax_vectors::Workers;

/// Resident groups per thread and batch: enough that threads finish together, few enough that members finish in order.
const GROUPS_PER_THREAD: usize = 4;
/// Minimum number of resident members per thread and batch.
const SLOTS_PER_THREAD: usize = 8;
/// While one is being advanced, the host handles the other.
const BATCHES: usize = 2;
/// Bytes per thread: members with very many nodes get fewer lanes, slots and batches so that they fit.
const ROOM: usize = 128 << 20;

/// Target time for a batch, so that progress shows; far more than usual n need.
const ADVANCE_TIME: Duration = Duration::from_secs(1);

/// Maximum steps between two checks of the members, so that stops are reached soon.
fn most_steps(solver: Solver) -> u32 {
    if solver.sweeps() { 64 } else { 256 }
}

/// Members of `n` nodes in numbers of type `T`.
pub struct CpuBackend<T> {
    batches: Vec<CpuBatch<T>>,
    slots: usize,
    method: Method,
    workers: Arc<dyn Workers<T>>,
    pool: Arc<rayon::ThreadPool>,
    /// Steps of the next batch; results do not depend on it, to the last bit.
    steps: u32,
    /// The time that a batch should take.
    time: Duration,
}

/// A number with vector code.
pub trait Vectorised: Evolves {
    /// Creates workers of `threads` threads for rings cut by `blocks`; none if the processor lacks the vectors.
    #[doc(hidden)]
    fn workers(vectors: Vectors, solver: Solver, blocks: Blocks, threads: usize) -> Option<Box<dyn Workers<Self>>>;
}

impl Vectorised for f64 {
    fn workers(vectors: Vectors, solver: Solver, blocks: Blocks, threads: usize) -> Option<Box<dyn Workers<f64>>> {
        curvelax_vectors_f64::workers(vectors, solver, blocks, threads)
    }
}

impl Vectorised for f32 {
    fn workers(vectors: Vectors, solver: Solver, blocks: Blocks, threads: usize) -> Option<Box<dyn Workers<f32>>> {
        curvelax_vectors_f32::workers(vectors, solver, blocks, threads)
    }
}

/// The members in one part of the slots.
type Members<T> = Vec<Option<Box<Run<T>>>>;

/// Returned members, and the time they took.
type Back<T> = (Members<T>, Duration);

/// One part of the slots.
struct CpuBatch<T> {
    /// Empty while the batch is being advanced.
    members: Members<T>,
    /// Channel on which the members come back.
    coming: Option<Receiver<Back<T>>>,
    /// The members that came back.
    back: Option<Back<T>>,
}

impl<T: Vectorised> CpuBackend<T> {
    /// Creates a back end on `threads` threads (0: all cores), with the widest vectors of the processor.
    pub fn new(blocks: Blocks, method: Method, threads: usize) -> Result<Self> {
        Self::with_vectors(blocks, method, threads, Vectors::widest())
    }

    /// Like [`CpuBackend::new`], for `members` members: with vectors no wider than the members fill and than memory
    /// allows.
    pub fn for_members(blocks: Blocks, method: Method, threads: usize, members: u64) -> Result<Self> {
        let workers = |vectors: &Vectors| Some((*vectors, T::workers(*vectors, method.solver, blocks, 1)?));
        let crews: Vec<_> = Vectors::ALL.iter().filter(|vectors| vectors.are_available()).filter_map(workers).collect();
        let fits = crews.iter().filter(|(_, workers)| workers.bytes_of_team() <= ROOM);
        let most = fits.map(|(_, workers)| workers.lanes()).max().unwrap_or(1);
        let enough = crews.iter().map(|(_, workers)| workers.lanes()).filter(|lanes| *lanes as u64 >= members).min();
        let lanes = enough.map_or(most, |enough| enough.min(most));
        let widest = crews.iter().rfind(|(_, workers)| workers.lanes() == lanes).map(|(vectors, _)| *vectors);
        Self::with_vectors(blocks, method, threads, widest.unwrap_or(Vectors::None))
    }

    /// Like [`CpuBackend::new`], with `vectors`, which the processor must have.
    pub fn with_vectors(blocks: Blocks, method: Method, threads: usize, vectors: Vectors) -> Result<Self> {
        // A panic shows as a batch that does not come back.
        let pool = threads::pool(threads)?;
        let threads = pool.current_num_threads();
        let none = || Error::Failed(format!("this processor has no vectors of {vectors:?}"));
        let workers = T::workers(vectors, method.solver, blocks, threads).ok_or_else(none)?;
        let of_member = STATE_FIELDS * blocks.n * size_of::<T>();
        let batches = if BATCHES * workers.lanes() * of_member <= ROOM { BATCHES } else { 1 };
        let usual = SLOTS_PER_THREAD.max(GROUPS_PER_THREAD * workers.lanes());
        let slots = threads * usual.min((ROOM / of_member / batches).max(workers.lanes()));
        let batch = || CpuBatch { members: (0..slots).map(|_| None).collect(), coming: None, back: None };
        Ok(CpuBackend {
            batches: (0..batches).map(|_| batch()).collect(),
            slots: batches * slots,
            method,
            workers: workers.into(),
            pool,
            steps: 1,
            time: ADVANCE_TIME,
        })
    }

    /// Gets room for all of `members` members in one batch, which is advanced for `time`, or a step of each if that
    /// takes longer: all of them move at once, for somebody who watches.
    pub fn for_display(mut self, members: usize, time: Duration) -> Self {
        self.batches = vec![CpuBatch { members: (0..members).map(|_| None).collect(), coming: None, back: None }];
        (self.slots, self.time) = (members, time);
        self
    }

    /// Returns the number of threads in use.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    fn place(&mut self, slot: usize) -> &mut Option<Box<Run<T>>> {
        let size = self.slots / self.batches.len();
        &mut self.batches[slot / size].members[slot % size]
    }

    fn run(&self, slot: usize) -> &Run<T> {
        let size = self.slots / self.batches.len();
        self.batches[slot / size].members[slot % size].as_ref().expect("an occupied slot")
    }
}

impl<T: Vectorised> Backend for CpuBackend<T> {
    fn slots(&self) -> usize {
        self.slots
    }

    fn abreast(&self) -> usize {
        self.workers.lanes() * self.threads()
    }

    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        *self.place(slot) = Some(Box::new(run.convert()));
        Ok(())
    }

    fn load_all(&mut self, runs: Vec<(usize, Run<f64>)>, threads: &HostThreads) -> Result<()> {
        for (slot, run) in threads.map(runs, |(slot, run)| (slot, Box::new(run.convert()))) {
            *self.place(slot) = Some(run);
        }
        Ok(())
    }

    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        let run = self.place(slot).as_mut().expect("an occupied slot");
        run.counters.goal = goal;
        run.parameters = parameters.convert();
    }

    fn clear(&mut self, slot: usize) {
        *self.place(slot) = None;
    }

    fn batches(&self) -> usize {
        self.batches.len()
    }

    fn start(&mut self, batch: usize) -> Result<()> {
        let batch = &mut self.batches[batch];
        let mut members = std::mem::take(&mut batch.members);
        let (back, coming) = channel();
        batch.coming = Some(coming);
        let (workers, method, attempts) = (Arc::clone(&self.workers), self.method, self.steps);
        threads::hand_over(&self.pool, move || {
            let started = Instant::now();
            let mut running: Vec<&mut Run<T>> =
                members.iter_mut().flatten().map(|run| &mut **run).filter(|run| run.counters.is_running()).collect();
            let groups = Group::of(&mut running, workers.lanes());
            groups.into_par_iter().for_each(|group| workers.advance(group, &method, attempts));
            // If no receiver is left, the run has ended.
            let _ = back.send((members, started.elapsed()));
        });
        Ok(())
    }

    fn is_back(&mut self, batch: usize, most: Duration) -> bool {
        let CpuBatch { coming, back, .. } = &mut self.batches[batch];
        if let (None, Some(coming)) = (&back, coming) {
            match coming.recv_timeout(most) {
                Ok(members) => *back = Some(members),
                Err(RecvTimeoutError::Timeout) => return false,
                // `finish` reports this.
                Err(RecvTimeoutError::Disconnected) => {}
            }
        }
        true
    }

    fn finish(&mut self, batch: usize) -> Result<()> {
        let batch = &mut self.batches[batch];
        let Some(coming) = batch.coming.take() else { return Ok(()) };
        let back = batch.back.take().map_or_else(|| coming.recv(), Ok);
        let (members, took) = back.map_err(|_| Error::Failed("a thread of the CPU back end has panicked".into()))?;
        batch.members = members;
        let share = self.time.as_secs_f64() / took.as_secs_f64().max(1e-6);
        let steps = (f64::from(self.steps) * share) as u32;
        self.steps = steps.clamp(1, 2 * self.steps).min(most_steps(self.method.solver));
        Ok(())
    }

    fn counters(&self, slot: usize) -> Counters {
        self.run(slot).counters
    }

    fn report(&self, slot: usize) -> Report<f64> {
        self.run(slot).report.convert()
    }

    fn state(&mut self, slot: usize) -> Result<State<f64>> {
        Ok(self.run(slot).state.convert())
    }
}
