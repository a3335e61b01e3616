//! Where a run sends what its members leave, and what it asks between two dispatches.

use super::{Ended, Extent, Rows, SeriesRow, Snapshot, Standing};
use crate::error::{Error, Result};

/// What a sink wishes of a run between two dispatches.
#[derive(Debug)]
pub enum Wish {
    /// To go on.
    Continue,
    /// To be told where the run stands, and to go on.
    Checkpoint,
    /// To be told where the run stands, and to end with this error.
    Stop(Error),
}

/// Receives everything that the members leave.
pub trait Sink {
    /// A member has ended; called exactly once per member, in member order.
    fn member(&mut self, ended: &Ended) -> Result<()>;
    /// Takes rows of a member that has not left, in time order, when more of them are in memory than should be. They come
    /// back with the member as what this returns, also in a run that goes on from a standing; none where it has no place.
    fn spill(&mut self, _series: &[SeriesRow], _snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        Ok(None)
    }
    /// `done` of `total` members have ended; `share` ∈ [0, 1] of the work is done. Called after every dispatch, and
    /// during long ones: an error stops the run.
    fn progress(&mut self, _done: u64, _total: u64, _share: f64) -> Result<()> {
        Ok(())
    }
    /// What it wishes now; asked after every dispatch, and during long ones.
    fn wish(&mut self) -> Wish {
        Wish::Continue
    }
    /// Where the run stands: as was wished for, or as it comes to a bad end.
    fn checkpoint(&mut self, _standing: &Standing) -> Result<()> {
        Ok(())
    }
}

/// Collects what members leave, in member order.
impl Sink for Vec<Ended> {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.push(ended.clone());
        Ok(())
    }
}

impl Rows {
    /// Hands those in memory to `sink`; whether it has taken them.
    pub fn spill(&mut self, sink: &mut dyn Sink) -> Result<bool> {
        if self.series.is_empty() && self.snapshots.is_empty() {
            return Ok(true);
        }
        let Some(extent) = sink.spill(&self.series, &self.snapshots)? else { return Ok(false) };
        self.spilled.push(extent);
        (self.series, self.snapshots) = (Vec::new(), Vec::new());
        Ok(true)
    }
}
