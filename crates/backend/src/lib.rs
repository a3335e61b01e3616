//! Back ends, which advance members: slots for resident members, on the CPU or on a GPU.
//!
//! A back end knows nothing of an ensemble. It holds as many members as it has slots, advances each towards the step it
//! is aimed at, and reports; its caller fills, collects and refills.

pub mod bounds;
pub mod cpu;
mod device_kind;
pub mod gpu;

use std::time::Duration;

pub use device_kind::DeviceKind;

use curvelax_base::{error::Result, threads::HostThreads};
use curvelax_flow::scheme::{
    Parameters, State,
    member::{Counters, Report},
    run::Run,
};

/// Members being advanced side by side.
pub trait Backend {
    /// Returns the number of members that are resident at once.
    fn slots(&self) -> usize;

    /// Returns roughly how many members are advanced at the same time; with fewer, part of the machine is idle.
    fn abreast(&self) -> usize {
        self.slots().div_ceil(8)
    }

    /// Puts a member into a slot, replacing any member there.
    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()>;

    /// Puts members into slots, as [`load`](Backend::load) does; what a back end makes of them first is spread over
    /// `threads`.
    fn load_all(&mut self, runs: Vec<(usize, Run<f64>)>, _threads: &HostThreads) -> Result<()> {
        runs.iter().try_for_each(|(slot, run)| self.load(*slot, run))
    }

    /// Lets the member in `slot` continue under `parameters` until it has made `goal` steps or pauses by itself.
    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>);

    /// Empties a slot.
    fn clear(&mut self, slot: usize);

    /// Returns the number of equal consecutive parts of the slots that can be advanced separately: while one is being
    /// advanced, the host can handle another.
    fn batches(&self) -> usize;

    /// Starts to advance a batch; its slots must not be touched until `finish`.
    fn start(&mut self, batch: usize) -> Result<()>;

    /// Waits until the batch has advanced, but no longer than `most`; returns whether it has. Back ends with short
    /// waits may leave them to `finish`.
    fn is_back(&mut self, _batch: usize, _most: Duration) -> bool {
        true
    }

    /// Waits until the batch has advanced.
    fn finish(&mut self, batch: usize) -> Result<()>;

    /// Advances every running member that is short of its goal by some steps.
    fn advance(&mut self) -> Result<()> {
        (0..self.batches()).try_for_each(|batch| self.start(batch))?;
        (0..self.batches()).try_for_each(|batch| self.finish(batch))
    }

    /// Returns the counters after the last `advance`; the sweeps are those of that call.
    fn counters(&self, slot: usize) -> Counters;

    /// Returns the report after the last `advance`.
    fn report(&self, slot: usize) -> Report<f64>;

    /// Returns the state of a member, read back and widened.
    fn state(&mut self, slot: usize) -> Result<State<f64>>;

    /// Returns the states of several members of a batch that is not being advanced.
    fn states(&mut self, slots: &[usize]) -> Result<Vec<State<f64>>> {
        slots.iter().map(|slot| self.state(*slot)).collect()
    }
}
