//! What a run leaves for people and programs: tables, plots and provenance in a folder, and an overview.
//!
//! A [`Report`] is opened before the work starts, so that a folder that cannot be written costs nothing. It is the
//! [`Sink`] of the simulation: rows stream to disk, and only a few numbers per member stay in memory.

pub mod folder;
pub mod gallery;
pub mod overview;
pub mod progress;
pub mod provenance;
pub mod svg;
pub mod tables;
pub mod tally;

use std::time::{Instant, SystemTime};

pub use folder::OutputFolder;
pub use gallery::Panel;
pub use provenance::Platform;

use crate::{
    ensemble::{Outcome, SeriesRow, Sink, Snapshot, Spec},
    error::Result,
};
use progress::Progress;
use tables::{SeriesTable, SnapshotTable, SummaryTable};
use tally::Tally;

/// Everything that is written about one run.
// The tables come before the folder: dropped first, they leave it empty for its own clean-up.
pub struct Report {
    summary: SummaryTable,
    series: Option<SeriesTable>,
    snapshots: Option<SnapshotTable>,
    folder: OutputFolder,
    tally: Tally,
    progress: Progress,
    started: SystemTime,
    clock: Instant,
}

impl Report {
    /// Opens the tables that `spec` asks for.
    pub fn begin(folder: OutputFolder, spec: &Spec, quiet: bool) -> Result<Report> {
        Ok(Report {
            summary: SummaryTable::begin(folder.file(folder::SUMMARY)?)?,
            series: spec.series.map(|_| SeriesTable::begin(folder.file(folder::SERIES)?)).transpose()?,
            snapshots: match spec.snapshots.is_empty() {
                true => None,
                false => Some(SnapshotTable::begin(folder.file(folder::SNAPSHOTS)?)?),
            },
            folder,
            tally: Tally::default(),
            progress: Progress::new(quiet),
            started: SystemTime::now(),
            clock: Instant::now(),
        })
    }

    /// The file that keeps the rows of the members that ended, should the run fail now; none if there are none.
    pub fn kept_rows(&self) -> Option<String> {
        (self.tally.members() > 0).then(|| self.summary.part().display().to_string())
    }

    /// Puts every file under its final name, `run.json` last, and returns the overview for stdout.
    pub fn finish(self, spec: &Spec, platform: &Platform, panels: &[Panel], warnings: &[String]) -> Result<String> {
        let Report { summary, series, snapshots, folder, tally, progress, started, clock } = self;
        progress.finish();
        let wall = clock.elapsed();
        folder.remove_earlier()?;
        let mut files = vec![folder::SUMMARY];
        summary.finish()?;
        if let Some(series) = series {
            series.finish()?;
            files.push(folder::SERIES);
        }
        if let Some(snapshots) = snapshots {
            snapshots.finish()?;
            files.push(folder::SNAPSHOTS);
        }
        if !panels.is_empty() {
            folder.write(folder::CURVES, &gallery::draw(panels))?;
            files.push(folder::CURVES);
        }
        let provenance = provenance::Provenance::new(spec, platform, &tally, warnings, started, wall);
        folder.write(folder::RUN, &provenance.to_json()?)?;
        files.push(folder::RUN);
        Ok(overview::Overview { spec, platform, tally: &tally, wall, folder: folder.path(), files: &files }.to_string())
    }
}

impl Sink for Report {
    fn member(&mut self, outcome: &Outcome, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<()> {
        if let Some(table) = &mut self.series {
            series.iter().try_for_each(|row| table.row(row))?;
        }
        if let Some(table) = &mut self.snapshots {
            snapshots.iter().try_for_each(|snapshot| table.snapshot(snapshot))?;
        }
        self.summary.row(outcome)?;
        self.tally.add(outcome);
        Ok(())
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) {
        self.progress.show(done, total, share);
    }
}
