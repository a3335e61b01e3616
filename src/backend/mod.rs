//! Where members are advanced: slots for resident members, on the CPU or on a GPU.
//!
//! A back end knows nothing of an ensemble. It holds as many members as it has slots, takes each towards the
//! step it is aimed at, and reports; [`simulate`](crate::simulate) fills, collects and refills.

pub mod cpu;
pub mod device;
pub mod gpu;

use std::time::Duration;

pub use device::{Device, DeviceKind};

use crate::{
    error::Result,
    scheme::{
        Parameters, State,
        member::{Counters, Report},
        run::Run,
    },
};

/// Members on their way, side by side.
pub trait Backend {
    /// How many members are resident at once.
    fn slots(&self) -> usize;

    /// How many members are advanced at the same time, about: fewer leave some of the machine idle.
    fn abreast(&self) -> usize {
        self.slots().div_ceil(8)
    }

    /// Puts a member into a slot, in place of whatever was there.
    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()>;

    /// Lets the member in `slot` run on under `parameters` until it has made `goal` steps or pauses by itself.
    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>);

    /// Empties a slot.
    fn clear(&mut self, slot: usize);

    /// Equal parts of the slots, one after the other, that can be advanced on their own: while one is on its way, the host
    /// has time for another.
    fn batches(&self) -> usize;

    /// Begins to advance a batch; until `finish` its slots are left alone.
    fn start(&mut self, batch: usize) -> Result<()>;

    /// Waits until the batch has advanced, but no longer than `most`; whether it has. Where waits are short by nature, it
    /// may leave them to `finish`.
    fn is_back(&mut self, _batch: usize, _most: Duration) -> bool {
        true
    }

    /// Waits until the batch has advanced.
    fn finish(&mut self, batch: usize) -> Result<()>;

    /// Takes every member that is running and short of its goal some steps further.
    fn advance(&mut self) -> Result<()> {
        (0..self.batches()).try_for_each(|batch| self.start(batch))?;
        (0..self.batches()).try_for_each(|batch| self.finish(batch))
    }

    /// Counters after the last `advance`; the sweeps are those of that call.
    fn counters(&self, slot: usize) -> Counters;

    /// The report after the last `advance`.
    fn report(&self, slot: usize) -> Report<f64>;

    /// The state of a member, read back and widened.
    fn state(&mut self, slot: usize) -> Result<State<f64>>;

    /// The states of several members of a batch that is not on its way.
    fn states(&mut self, slots: &[usize]) -> Result<Vec<State<f64>>> {
        slots.iter().map(|slot| self.state(*slot)).collect()
    }
}
