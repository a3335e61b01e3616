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
pub mod plot;
pub mod progress;
pub mod provenance;
pub mod study;
pub mod style;
pub mod svg;
pub mod tables;
pub mod tally;
pub mod text;
pub mod trace;

use std::{
    path::PathBuf,
    time::{Duration, Instant, SystemTime},
};

pub use ensemble::EnsembleStatistics;
pub use folder::OutputFolder;
pub use gallery::Panel;

use crate::{
    backend::Platform,
    ensemble::{Ended, Outcome, Portrait, Sink, Spec},
    error::{Error, Result},
};
use document::Document;
use progress::{Progress, duration};
use study::Study;
use tables::{SeriesTable, SnapshotTable, SummaryTable};
use tally::Tally;
use text::plural;

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
    series: Option<SeriesTable>,
    snapshots: Option<SnapshotTable>,
    folder: OutputFolder,
    tally: Tally,
    panels: Vec<Panel>,
    /// The same members on their way.
    watched: Vec<page::Trajectory>,
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
    /// Opens the tables that `spec` asks for.
    pub fn begin(folder: OutputFolder, spec: &Spec, quiet: bool) -> Result<Report> {
        Ok(Report {
            total: spec.member_count(),
            before: 0,
            summary: SummaryTable::begin(folder.file(folder::SUMMARY)?)?,
            series: spec.series.map(|_| SeriesTable::begin(folder.file(folder::SERIES)?)).transpose()?,
            snapshots: match spec.snapshots.is_empty() {
                true => None,
                false => Some(SnapshotTable::begin(folder.file(folder::SNAPSHOTS)?)?),
            },
            folder,
            tally: Tally::default(),
            panels: Vec::new(),
            watched: Vec::new(),
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
    pub fn finish(self, spec: &Spec, platform: &Platform, warnings: &[String], form: Form) -> Result<String> {
        // In reverse order they are dropped: the folder last, after its files.
        let Report { folder, tally, panels, watched, progress, started, clock, summary, series, snapshots, .. } = self;
        progress.finish();
        let wall = clock.elapsed();
        let statistics = &EnsembleStatistics::new(spec, &tally)?;
        let mut names = vec![folder::SUMMARY, folder::ENSEMBLE];
        let mut files = vec![summary.ready()?, folder.write(folder::ENSEMBLE, &statistics.to_csv(spec)?)?];
        if let Some(series) = series {
            files.push(series.ready()?);
            names.push(folder::SERIES);
        }
        if let Some(snapshots) = snapshots {
            files.push(snapshots.ready()?);
            names.push(folder::SNAPSHOTS);
        }
        let gallery = (!panels.is_empty()).then(|| gallery::draw(&panels));
        let study = Study { spec, platform, tally: &tally, statistics, warnings, started, wall };
        let charts = study.charts();
        let page = study.page(&charts, gallery.as_deref(), &watched)?;
        for (name, text) in charts.iter().map(|chart| (chart.name, &chart.figure.svg)).chain([(folder::REPORT, &page)])
        {
            files.push(folder.write(name, text)?);
        }
        names.push(folder::REPORT);
        if let Some(gallery) = gallery {
            files.push(folder.write(folder::CURVES, &gallery)?);
        }
        names.push(PLOTS);
        let provenance = provenance::Provenance::new(spec, platform, &tally, warnings, started, wall);
        let run = folder.write(folder::RUN, &provenance.to_json()?)?;
        names.push(folder::RUN);
        folder.publish(files, run)?;
        let (tally, folder, files) = (&tally, folder.path(), &names[..]);
        match form {
            Form::Overview => {
                let overview = overview::Overview { spec, platform, tally, statistics, wall, folder, files };
                Ok(overview.to_string())
            }
            Form::Json => Document::new(&provenance, spec, statistics, folder, files).to_json(),
        }
    }
}

impl Sink for Report {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        let Ended { outcome, series, snapshots, portrait, mollified, unresolved } = ended;
        if let Some(table) = &mut self.series {
            series.iter().try_for_each(|row| table.row(row))?;
        }
        if let Some(table) = &mut self.snapshots {
            snapshots.iter().try_for_each(|snapshot| table.snapshot(snapshot))?;
        }
        self.summary.row(outcome)?;
        self.tally.add(outcome);
        self.tally.add_series(outcome.cell, series);
        self.tally.add_aside(mollified, *unresolved);
        if let Some(Portrait { before, frames, after }) = portrait.clone() {
            let Outcome { member, status, t_relax, .. } = *outcome;
            self.watched.push(study::trajectory(outcome, &before, frames, &after));
            self.panels.push(Panel { member, status, t_relax, before, after });
        }
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
    use crate::ensemble::{Mollified, Observables, SeriesRow, Snapshot, Status};

    fn files(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = entries.collect();
        names.sort();
        names
    }

    /// A report into `out` that has received one member.
    fn report(out: &Path, spec: &Spec, portrait: Option<Portrait>) -> Report {
        let mut report = Report::begin(OutputFolder::open(out, true).unwrap(), spec, true).unwrap();
        let row = SeriesRow { member: 0, t: 0.0, at: Observables::default() };
        let snapshot = Snapshot { member: 0, t: 0.0, x: vec![1.0], y: vec![2.0], k: vec![3.0], r: vec![4.0] };
        let outcome = tally::tests::outcome(0, Status::Relaxed, Some(0.5));
        report
            .member(&Ended {
                outcome,
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
        let tables = ["ensemble.csv", "plots", "report.html", "run.json", "series.csv", "snapshots.csv", "summary.csv"];
        assert_eq!(files(&out), tables);
        assert_eq!(files(&out.join("plots")), ["curves.svg", "mesh.svg", "relaxation.svg", "survival.svg"]);
        for name in [folder::SUMMARY, folder::SERIES, folder::SNAPSHOTS] {
            assert_eq!(fs::read_to_string(out.join(name)).unwrap().lines().count(), 2, "{name}");
        }
        assert!(
            overview
                .contains("summary.csv, ensemble.csv, series.csv, snapshots.csv, report.html, plots/*.svg, run.json"),
            "{overview}"
        );

        let few = Spec::default();
        report(&out, &few, None).finish(&few, &platform, &["a warning".into()], Form::Overview).unwrap();
        assert_eq!(files(&out), ["ensemble.csv", "plots", "report.html", "run.json", "summary.csv"]);
        assert_eq!(files(&out.join("plots")), ["mesh.svg", "relaxation.svg", "survival.svg"]);
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
