//! The CPU back end: the scheme itself, members abreast in the lanes of vector instructions, groups of them spread over
//! threads.
//!
//! Every call groups the members that are running anew, so that no lane is idle for long; no bit of a member depends on
//! its group.

mod vectors;

pub use vectors::{Vectorised, Vectors};

use rayon::prelude::*;

use super::Backend;
use crate::{
    error::{Error, Result},
    scheme::{
        Parameters, State,
        evolve::{Run, is_running},
        parameters::{Counters, Report},
        step::Method,
    },
    solver::{Blocks, Solver},
};
use vectors::Crew;

/// Resident groups per thread: enough that threads end together, few enough that members end in order.
const GROUPS_PER_THREAD: usize = 8;
/// Resident members per thread at least.
const SLOTS_PER_THREAD: usize = 16;

/// Steps between two looks at the members, so that progress shows and stops are reached soon.
fn steps_per_advance(solver: Solver) -> u32 {
    match solver {
        Solver::Direct => 256,
        Solver::GaussSeidel | Solver::Multigrid => 64,
    }
}

/// Members of `n` nodes in numbers of type `T`.
pub struct CpuBackend<T> {
    slots: Vec<Option<Box<Run<T>>>>,
    method: Method,
    crew: Box<dyn Crew<T>>,
    pool: rayon::ThreadPool,
}

impl<T: Vectorised> CpuBackend<T> {
    /// A back end on `threads` threads (0: all cores), with the widest vectors that the processor has.
    pub fn new(blocks: Blocks, method: Method, threads: usize) -> Result<Self> {
        Self::with_vectors(blocks, method, threads, Vectors::widest())
    }

    /// The same with `vectors`, which the processor must have.
    pub fn with_vectors(blocks: Blocks, method: Method, threads: usize, vectors: Vectors) -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|e| Error::Failed(format!("cannot start {threads} threads: {e}; try --threads 1")))?;
        let threads = pool.current_num_threads();
        let crew = T::crew(vectors, method.solver, blocks, threads)?;
        let slots = threads * SLOTS_PER_THREAD.max(GROUPS_PER_THREAD * crew.lanes());
        Ok(CpuBackend { slots: (0..slots).map(|_| None).collect(), method, crew, pool })
    }

    /// Threads in use.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    fn run(&self, slot: usize) -> &Run<T> {
        self.slots[slot].as_ref().expect("an occupied slot")
    }
}

impl<T: Vectorised> Backend for CpuBackend<T> {
    fn slots(&self) -> usize {
        self.slots.len()
    }

    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        self.slots[slot] = Some(Box::new(run.convert()));
        Ok(())
    }

    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        let run = self.slots[slot].as_mut().expect("an occupied slot");
        run.counters.goal = goal;
        run.parameters = parameters.convert();
    }

    fn clear(&mut self, slot: usize) {
        self.slots[slot] = None;
    }

    fn advance(&mut self) -> Result<()> {
        let (crew, method) = (&self.crew, &self.method);
        let mut running: Vec<&mut Run<T>> =
            self.slots.iter_mut().flatten().map(|run| &mut **run).filter(|run| is_running(&run.counters)).collect();
        let attempts = steps_per_advance(method.solver);
        self.pool.install(|| {
            running.par_chunks_mut(crew.lanes()).for_each(|group| crew.advance(group, method, attempts));
        });
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
