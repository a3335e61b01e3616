//! Members that have ended, until the sink has them in member order.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use crate::{Ended, Paused, RunProgress, Sink, SinkRequest};
use curvelax_base::error::Result;

/// Interval at which the sink is notified, and may stop the run, during longer dispatches.
pub const MAX_WAIT: Duration = Duration::from_millis(200);

/// Members that have ended, held until those before them have.
pub(super) struct Queue {
    pub total: u64,
    pub ended: u64,
    pub next: u64,
    pub early: BTreeMap<u64, Ended>,
    /// When the progress was last saved, or the run began.
    pub saved: Instant,
    /// Whether the sink has saved the progress of the run, to the last member.
    pub kept: bool,
    /// When the sink was last notified of the progress.
    pub told: Instant,
}

impl Queue {
    /// Reports the progress to the sink, which may end the run at once.
    pub fn tell(&mut self, share: f64, sink: &mut dyn Sink) -> Result<()> {
        self.told = Instant::now();
        let work = self.ended as f64 + share;
        sink.progress(self.ended, self.total, work / self.total as f64)
    }

    pub fn leave(&mut self, rank: u64, ended: Ended, sink: &mut dyn Sink) -> Result<()> {
        self.ended += 1;
        self.kept = false;
        self.early.insert(rank, ended);
        while let Some(ended) = self.early.remove(&self.next) {
            sink.member(&ended)?;
            self.next += 1;
        }
        Ok(())
    }

    /// Saves the members that have ended, and the unfinished ones if known.
    pub fn checkpoint(&mut self, resident: Option<BTreeMap<u64, Paused>>, sink: &mut dyn Sink) -> Result<()> {
        let progress = RunProgress { next: self.next, early: std::mem::take(&mut self.early), resident };
        let done = sink.checkpoint(&progress);
        self.kept = done.is_ok() && progress.resident.is_some();
        self.saved = Instant::now();
        self.early = progress.early;
        done
    }

    /// If the run is to stop, saves at once what is known, since members in progress may never end.
    pub fn checkpoint_before_the_stop(&mut self, sink: &mut dyn Sink) -> Result<bool> {
        let stops = matches!(sink.next_request(), SinkRequest::Stop(_));
        if stops {
            self.checkpoint(None, sink)?;
        }
        Ok(stops)
    }
}
