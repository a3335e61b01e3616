//! The CPU back end: the scheme itself, members spread over threads.

use rayon::prelude::*;

use super::Backend;
use crate::{
    error::{Error, Result},
    number::Real,
    scheme::{
        Parameters, State, Workspace,
        evolve::{Run, evolve},
        parameters::{Counters, Report},
        step::Method,
    },
    solver::Blocks,
};

/// Resident members per thread: enough that threads end together, few enough that members end in order.
const SLOTS_PER_THREAD: usize = 16;
/// Steps between two looks at the members, so that progress shows and stops are reached soon.
const STEPS_PER_ADVANCE: u32 = 64;

/// Members of `n` nodes in numbers of type `T`.
pub struct CpuBackend<T> {
    slots: Vec<Option<Box<Slot<T>>>>,
    blocks: Blocks,
    method: Method,
    pool: rayon::ThreadPool,
}

struct Slot<T> {
    run: Run<T>,
    work: Workspace<T>,
}

impl<T: Real> CpuBackend<T> {
    /// A back end on `threads` threads (0: all cores).
    pub fn new(blocks: Blocks, method: Method, threads: usize) -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|e| Error::Failed(format!("cannot start {threads} threads: {e}; try --threads 1")))?;
        let slots = SLOTS_PER_THREAD * pool.current_num_threads();
        Ok(CpuBackend { slots: (0..slots).map(|_| None).collect(), blocks, method, pool })
    }

    /// Threads in use.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    fn run(&self, slot: usize) -> &Run<T> {
        &self.slots[slot].as_ref().expect("an occupied slot").run
    }
}

impl<T: Real> Backend for CpuBackend<T> {
    fn slots(&self) -> usize {
        self.slots.len()
    }

    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        let run = run.convert();
        match &mut self.slots[slot] {
            Some(slot) => slot.run = run,
            empty => *empty = Some(Box::new(Slot { run, work: Workspace::new(self.blocks) })),
        }
        Ok(())
    }

    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        let run = &mut self.slots[slot].as_mut().expect("an occupied slot").run;
        run.counters.goal = goal;
        run.parameters = parameters.convert();
    }

    fn clear(&mut self, slot: usize) {
        self.slots[slot] = None;
    }

    fn advance(&mut self) -> Result<()> {
        let (slots, method) = (&mut self.slots, &self.method);
        self.pool.install(|| {
            slots
                .par_iter_mut()
                .flatten()
                .for_each(|slot| evolve(&mut slot.run, method, &mut slot.work, STEPS_PER_ADVANCE));
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
