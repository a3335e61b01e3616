//! What a run leaves for people and programs: tables, plots and provenance in a folder, and an overview.
//!
//! A [`Report`] is opened before the work starts, so that a folder that cannot be written costs nothing. It is the
//! [`Sink`] of the simulation: rows stream to disk, and only a few numbers per member stay in memory.

pub mod axis;
pub mod chart;
pub mod charts;
pub mod document;
pub mod ensemble;
pub mod folder;
pub mod gallery;
pub mod overview;
pub mod page;
pub mod part_folder;
pub mod plot;
pub mod portraits;
pub mod progress;
pub mod provenance;
pub mod reader;
pub mod study;
pub mod style;
pub mod svg;
pub mod tables;
pub mod tally;
pub mod text;
pub mod trace;
pub mod zarr;

use std::{
    path::PathBuf,
    time::{Duration, Instant, SystemTime},
};

pub use ensemble::EnsembleStatistics;
pub use folder::OutputFolder;

use crate::{
    backend::Platform,
    ensemble::{Ended, Sink, Spec, spec::Store},
    error::{Error, Result},
};
use document::Document;
use portraits::Film;
use progress::{Progress, duration};
use provenance::Provenance;
use study::Study;
use tables::{RateTable, SeriesTable, SnapshotTable, SummaryTable};
use tally::Tally;
use text::plural;
use zarr::SnapshotStore;

/// What is said on stdout of a run that is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A table and some lines for people.
    Overview,
    /// One document for programs.
    Json,
}

/// How the overview names the pictures.
const PLOTS: &str = "plots/*.svg";

/// Everything that is written about one run.
// The tables come before the folder: dropped first, they leave it empty for its own clean-up.
pub struct Report {
    summary: SummaryTable,
    rates: RateTable,
    series: Option<SeriesTable>,
    snapshots: Option<SnapshotTable>,
    store: Option<SnapshotStore>,
    folder: OutputFolder,
    tally: Tally,
    /// The first members.
    films: Vec<Film>,
    /// Members of the whole study, and those of earlier simulations.
    total: u64,
    before: u64,
    progress: Progress,
    started: SystemTime,
    clock: Instant,
    /// When the run is to stop at the latest, from its start.
    most: Option<Duration>,
}

impl Report {
    /// Opens the tables that `spec` asks for. `points` is the number of nodes of a member, which matters only where all
    /// have the same.
    pub fn begin(folder: OutputFolder, spec: &Spec, points: usize, quiet: bool) -> Result<Report> {
        let stored = |store: Store| spec.store == store && !spec.snapshots.is_empty();
        Ok(Report {
            total: spec.member_count(),
            before: 0,
            summary: SummaryTable::begin(folder.file(folder::SUMMARY)?)?,
            rates: RateTable::begin(folder.file(folder::RATES)?)?,
            series: spec.series.map(|_| SeriesTable::begin(folder.file(folder::SERIES)?)).transpose()?,
            snapshots: match stored(Store::Csv) {
                true => Some(SnapshotTable::begin(folder.file(folder::SNAPSHOTS)?)?),
                false => None,
            },
            store: match stored(Store::Zarr) {
                true => Some(SnapshotStore::begin(folder.store(folder::STORE)?, spec, points)?),
                false => None,
            },
            folder,
            tally: Tally::default(),
            films: Vec::new(),
            progress: Progress::new(quiet),
            started: SystemTime::now(),
            clock: Instant::now(),
            most: None,
        })
    }

    /// Stops the run with [`Error::Stopped`] when it has taken `most`, from now on.
    pub fn stop_after(&mut self, most: Duration) {
        self.most = Some(self.clock.elapsed() + most);
    }

    /// The members that come now are simulated by themselves; those before have all ended.
    pub fn next_company(&mut self) {
        self.before = self.tally.members();
    }

    /// Where the rows of the members that ended lie until the report is finished. If the file is there when the report
    /// is gone, the run has failed and they are kept.
    pub fn kept_rows(&self) -> PathBuf {
        self.summary.part().to_path_buf()
    }

    /// What the user should know about the results so far.
    pub fn warnings(&self) -> Vec<String> {
        self.tally.warnings()
    }

    /// How many members ended neither relaxed nor unfinished.
    pub fn failed(&self) -> u64 {
        self.tally.failed()
    }

    /// Puts every file under its final name, once all are on disk, and returns the text for stdout.
    ///
    /// Where only the pictures cannot be written the tables are published all the same, with an error that says so.
    pub fn finish(self, spec: &Spec, platform: &Platform, warnings: &[String], form: Form) -> Result<String> {
        // In reverse order they are dropped: the folder last, after its files.
        let Report { folder, tally, films, progress, started, clock, .. } = self;
        let (summary, rates, series) = (self.summary, self.rates, self.series);
        let (snapshots, store) = (self.snapshots, self.store);
        progress.finish();
        let wall = clock.elapsed();
        let statistics = &EnsembleStatistics::new(spec, &tally)?;
        let mut names = vec![folder::SUMMARY, folder::ENSEMBLE, folder::RATES, folder::MEAN_EXCESS];
        // The rows of the members first: where the disk fills up they are what is kept.
        let summary = summary.ready()?;
        let ensemble = folder.write(folder::ENSEMBLE, &statistics.to_csv(spec)?)?;
        let excess = &tally.mean_excess(spec)?;
        let mean_excess = tables::mean_excess(folder.file(folder::MEAN_EXCESS)?, excess)?;
        let mut files = vec![summary, ensemble, rates.ready()?, mean_excess];
        if let Some(series) = series {
            files.push(series.ready()?);
            names.push(folder::SERIES);
        }
        if let Some(snapshots) = snapshots {
            files.push(snapshots.ready()?);
            names.push(folder::SNAPSHOTS);
        }
        let store = store.map(SnapshotStore::ready).transpose()?;
        if store.is_some() {
            names.push(folder::STORE);
        }
        let provenance = &Provenance::new(spec, platform, &tally, warnings, started, wall);
        let run = folder.write(folder::RUN, &provenance.to_json()?)?;
        let study = Study { provenance, tally: &tally, statistics, excess, films: &films };
        let mut drawn = Vec::new();
        let done = (|| {
            drawn.push(folder.write(folder::PORTRAITS, &portraits::to_json(&films)?)?);
            for (name, text) in study.pictures()? {
                drawn.push(folder.write(name, &text)?);
            }
            Ok(())
        })();
        if done.is_err() {
            // All but what pictures are drawn from.
            drawn.truncate(1);
        }
        folder.publish(files.into_iter().chain(drawn).collect(), store, run)?;
        done.map_err(|error: Error| {
            let folder = folder.path().display();
            Error::Failed(format!(
                "{error}; the tables in {folder} are complete: make room, then curvelax plot {folder}"
            ))
        })?;
        names.extend([folder::REPORT, PLOTS, folder::RUN]);
        let (tally, folder, files) = (&tally, folder.path(), &names[..]);
        match form {
            Form::Overview => {
                let overview = overview::Overview { spec, platform, tally, statistics, wall, folder, files };
                Ok(overview.to_string())
            }
            Form::Json => Document::new(provenance, spec, statistics, folder, files).to_json(),
        }
    }
}

impl Sink for Report {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        let Ended { outcome, series, snapshots, portrait, mollified, unresolved, excess } = ended;
        if let Some(table) = &mut self.series {
            series.iter().try_for_each(|row| table.row(row))?;
        }
        if let Some(table) = &mut self.snapshots {
            snapshots.iter().try_for_each(|snapshot| table.snapshot(snapshot))?;
        }
        if let Some(store) = &mut self.store {
            store.member(outcome.status, snapshots)?;
        }
        self.summary.row(outcome)?;
        self.rates.row(outcome)?;
        self.tally.add(outcome);
        self.tally.add_excess(outcome.cell, excess);
        self.tally.add_aside(mollified, *unresolved);
        self.films.extend(portrait.as_ref().map(|portrait| Film::new(outcome, portrait)));
        Ok(())
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        let share = (self.before as f64 + share * total as f64) / self.total.max(1) as f64;
        let done = self.before + done;
        self.progress.show(done, self.total, share);
        match self.most {
            // What is done is written, however long that took.
            Some(most) if done < self.total && self.clock.elapsed() >= most => {
                let (rows, all) = (self.tally.members(), plural(self.total, "member"));
                Err(Error::Stopped(format!(
                    "--max-time: stopped after {} with {rows} of {} {all} in the table; take more time, or fewer members",
                    duration(self.clock.elapsed().as_secs_f64()),
                    self.total,
                )))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use glam::DVec2;

    use super::*;
    use crate::ensemble::{Mollified, Observables, Portrait, SeriesRow, Snapshot, Status};

    fn files(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = entries.collect();
        names.sort();
        names
    }

    /// A report into `out` that has received one member.
    fn report(out: &Path, spec: &Spec, portrait: Option<Portrait>) -> Report {
        let mut report = Report::begin(OutputFolder::open(out, true).unwrap(), spec, 1, true).unwrap();
        let row = SeriesRow { member: 0, t: 0.0, at: Observables::default() };
        let snapshot = Snapshot { member: 0, t: 0.0, x: vec![1.0], y: vec![2.0], k: vec![3.0], r: vec![4.0] };
        let outcome = tally::tests::outcome(0, Status::Relaxed, Some(0.5));
        report
            .member(&Ended {
                outcome,
                excess: vec![0.2, 0.1],
                series: vec![row],
                snapshots: vec![snapshot],
                portrait,
                mollified: Mollified::default(),
                unresolved: false,
            })
            .unwrap();
        report
    }

    #[test]
    fn a_finished_report_leaves_the_files_asked_for_and_no_others() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let platform = provenance::tests::platform();
        let triangle = vec![DVec2::ZERO, DVec2::X, DVec2::Y];
        let portrait = Portrait { before: triangle.clone(), frames: Vec::new(), after: triangle };

        let all = Spec { series: Some(0.1), snapshots: vec![0.0], ..Spec::default() };
        let overview = report(&out, &all, Some(portrait)).finish(&all, &platform, &[], Form::Overview).unwrap();
        let always = ["ensemble.csv", "mean_excess.csv", "plots", "rates.csv", "report.html", "run.json"];
        assert_eq!(files(&out), [&always[..], &["series.csv", "snapshots.csv", "summary.csv"]].concat());
        let plots = ["excess.svg", "mesh.svg", "portraits.json", "rate.svg", "relaxation.svg", "survival.svg"];
        assert_eq!(files(&out.join("plots")), [&["curves.svg"], &plots[..]].concat());
        for name in [folder::SUMMARY, folder::SERIES, folder::SNAPSHOTS] {
            assert_eq!(fs::read_to_string(out.join(name)).unwrap().lines().count(), 2, "{name}");
        }
        assert!(
            overview.contains(
                "ensemble.csv, rates.csv, mean_excess.csv, series.csv, snapshots.csv, report.html, plots/*.svg"
            ),
            "{overview}"
        );

        let few = Spec::default();
        report(&out, &few, None).finish(&few, &platform, &["a warning".into()], Form::Overview).unwrap();
        assert_eq!(files(&out), [&always[..], &["summary.csv"]].concat());
        assert_eq!(files(&out.join("plots")), plots);
        assert!(fs::read_to_string(out.join("run.json")).unwrap().contains("a warning"));
    }

    #[test]
    fn a_run_stops_when_its_time_is_over_and_not_before() {
        let home = tempfile::tempdir().unwrap();
        let spec = Spec::default();
        let mut running = report(&home.path().join("out"), &spec, None);
        running.progress(1, 256, 0.1).unwrap();
        running.stop_after(Duration::from_secs(1000));
        running.progress(1, 256, 0.1).unwrap();
        running.stop_after(Duration::ZERO);
        let error = running.progress(1, 256, 0.1).unwrap_err();
        assert_eq!(error.exit_code(), 75);
        assert!(error.to_string().contains("with 1 of 256 members in the table"), "{error}");
        // All have ended: there is nothing to stop.
        running.progress(256, 256, 1.0).unwrap();
    }

    #[test]
    fn a_run_that_fails_keeps_the_members_that_ended() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let failed = report(&out, &Spec::default(), None);
        let kept = failed.kept_rows();
        drop(failed);
        assert_eq!(files(&out), [".summary.csv.part"]);
        assert_eq!(fs::read_to_string(kept).unwrap().lines().count(), 2);
    }
}
