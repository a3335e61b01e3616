//! Where a run sends the results of its members, and what it asks between two dispatches.

use crate::{Ended, Extent, LevelRow, Rows, RunProgress, SeriesRow, Snapshot};
use curvelax_base::error::{Error, Result};

/// What a sink wants from a run between two dispatches.
#[derive(Debug)]
pub enum SinkRequest {
    /// Continue.
    Continue,
    /// Report a checkpoint, then continue.
    Checkpoint,
    /// Report a checkpoint, then end with this error.
    Stop(Error),
}

/// Receives all results of the members.
pub trait Sink {
    /// A member has ended; called exactly once per member, in member order.
    fn member(&mut self, ended: &Ended) -> Result<()>;
    /// A member has ended at a [level](crate::RefinementLevel): before the members themselves, level by level in member
    /// order.
    fn level(&mut self, _row: &LevelRow) -> Result<()> {
        Ok(())
    }
    /// Stores rows of a member that is still running, in time order, when too many are in memory. The extent returned
    /// comes back with the member, also after the run was resumed. `None` if the sink has no place for them.
    fn spill(&mut self, _series: &[SeriesRow], _snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        Ok(None)
    }
    /// Reports that `done` of `total` members have ended, and a fraction `share` ∈ [0, 1] of the work is done. Called
    /// after every dispatch, and during long ones: an error stops the run.
    fn progress(&mut self, _done: u64, _total: u64, _share: f64) -> Result<()> {
        Ok(())
    }
    /// What the sink wants now; asked after every dispatch, and during long ones.
    fn next_request(&mut self) -> SinkRequest {
        SinkRequest::Continue
    }
    /// Receives the progress of the run: on request, or when the run fails.
    fn checkpoint(&mut self, _progress: &RunProgress) -> Result<()> {
        Ok(())
    }
}

/// Collects the results in member order.
impl Sink for Vec<Ended> {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.push(ended.clone());
        Ok(())
    }
}

impl Rows {
    /// Hands the rows in memory to `sink`, and returns whether it stored them.
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
