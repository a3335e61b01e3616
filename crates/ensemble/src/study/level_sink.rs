//! Between a run and its sink: members of a level become rows, and those of the study get what the levels tell of them.

use crate::{
    Cell, Ended, Extent, LevelRow, LevelTimes, Outcome, RunProgress, SeriesRow, Sink, SinkRequest, Snapshot, Spec,
    outcome::levels::RefinementLevel, study::cell_of,
};
use curvelax_base::error::{Error, Result};
use curvelax_flow::number::Precision;

/// Hands the members of a level to a sink as rows, and those of the study with what the levels tell of them.
pub struct LevelSink<'a> {
    /// The level that runs, if it is not the study itself.
    pub level: Option<RefinementLevel>,
    /// The numbers in which it computes.
    pub precision: Precision,
    /// Its cells.
    pub cells: &'a [Cell],
    /// The times so far.
    pub levels: &'a mut LevelTimes,
    /// Receives everything.
    pub sink: &'a mut dyn Sink,
}

impl LevelSink<'_> {
    fn cell(&self, ended: &Outcome) -> Result<&Spec> {
        let none = || Error::Failed(format!("member {} is of no cell that runs", ended.member));
        cell_of(self.cells, ended).map(|cell| &cell.spec).ok_or_else(none)
    }
}

impl Sink for LevelSink<'_> {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        match self.level {
            Some(level) => {
                let row = LevelRow::new(level, self.cell(&ended.outcome)?, self.precision, &ended.outcome);
                self.levels.add(&row).map_err(|e| Error::Failed(format!("levels: expected {e}")))?;
                self.sink.level(&row)
            }
            None if !self.levels.has(ended.outcome.member) => self.sink.member(ended),
            None => {
                let mut judged = ended.clone();
                self.levels.judge(self.cell(&ended.outcome)?, &mut judged.outcome);
                self.sink.member(&judged)
            }
        }
    }

    fn spill(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        self.sink.spill(series, snapshots)
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        self.sink.progress(done, total, share)
    }

    fn next_request(&mut self) -> SinkRequest {
        self.sink.next_request()
    }

    fn checkpoint(&mut self, progress: &RunProgress) -> Result<()> {
        self.sink.checkpoint(progress)
    }
}
