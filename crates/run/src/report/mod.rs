//! The output of a run for people and programs: tables, plots and provenance in a folder, and an overview.
//!
//! A [`RunReport`] is opened before the work starts, so that no work is lost to a folder that cannot be written. It is
//! the [`Sink`] of the simulation: rows stream to disk, and only a few numbers per member stay in memory.

pub mod complete;
pub mod document;
pub mod gallery;
mod members_layout;
pub mod merge;
pub mod movie;
pub mod overview;
pub mod page;
pub mod pictures;
pub mod progress;
pub mod stop;
pub mod words;

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

pub use complete::ResultFormat;
pub use progress::Progress;
pub use stop::{Cause, Stop};

use complete::Complete;
use curvelax_base::{
    error::Result,
    text::{duration, plural, quoted},
};
use curvelax_ensemble::{
    Ended, Extent, LevelRow, LevelTimes, RunProgress, SeriesRow, Sink, SinkRequest, Snapshot, Spec, Study,
};
use curvelax_files::{
    OutputFolder,
    growing::Growing,
    portraits::Film,
    reader,
    state::{
        checkpoint::{self, CheckpointHead, Origin, Saved},
        outlines, shard,
    },
};
use curvelax_study::results::{RunVerdict, tally::Tally};

/// Checkpoints use at most one part in `SHARE_OF_STATES` of the time of a run.
const SHARE_OF_STATES: u32 = 20;

/// How a report works; the results do not depend on it.
pub struct ReportOptions {
    /// When the run was asked for: what comes before its members takes time, too.
    pub since: Instant,
    /// Where the progress is shown.
    pub progress: Progress,
    /// Time between two checkpoints.
    pub every: Duration,
    /// The means to stop the run.
    pub stop: Stop,
    /// Time after which a run that was asked to stop is ended even if it has not reached a point where all its work can
    /// be saved.
    pub patience: Duration,
    /// Sees the snapshots of members, in time order and before they are stored. Those that a resumed run has stored
    /// earlier are not seen again.
    pub see: SnapshotWatch,
}

/// Someone who looks at snapshots.
pub type SnapshotWatch = Box<dyn FnMut(&[Snapshot])>;

/// Everything written about a run.
// The tables come before the folder: dropped first, they leave it empty for its clean-up.
pub struct RunReport {
    growing: Growing,
    pub(crate) folder: OutputFolder,
    /// The spec, where the run is computed, and where it was before.
    pub(crate) origin: Origin,
    /// Nodes per member.
    points: usize,
    pub(crate) tally: Tally,
    /// The first members.
    films: Vec<Film>,
    /// Relaxation times at the levels, by the rows of an earlier session.
    pub(crate) levels: LevelTimes,
    /// Members of the study.
    members: u64,
    /// Members of each stage; of a finer one none before it begins.
    stages: Vec<u64>,
    /// Index of the current stage, from 0.
    pub(crate) stage: usize,
    pub(crate) options: ReportOptions,
    /// Wall time before the interruption.
    earlier: Duration,
    /// When the last checkpoint was complete, and how long it took.
    kept: (Instant, Duration),
    /// Whether the checkpoint contains any work.
    has_begun: bool,
}

impl RunReport {
    /// Opens the tables of a study, and saves the first checkpoint, from which a killed run resumes.
    pub fn begin(folder: OutputFolder, study: &Study, origin: Origin, options: ReportOptions) -> Result<RunReport> {
        let growing = Growing::begin(&folder, study.spec(), study.points())?;
        let mut report = RunReport::new(folder, growing, study, origin, options);
        let first = RunProgress { resident: Some(BTreeMap::new()), ..RunProgress::default() };
        match outlines::save(&report.folder, study.outlines()).and_then(|()| report.checkpoint(&first)) {
            Ok(()) => Ok(report),
            Err(error) => {
                let error = report.folder.explain(error);
                report.give_up();
                Err(error)
            }
        }
    }

    /// Resumes the report of an interrupted run; returns the progress of the run.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if its files are not those of the study.
    pub fn resume(
        folder: OutputFolder,
        study: &Study,
        kept: Saved,
        options: ReportOptions,
    ) -> Result<(RunReport, RunProgress)> {
        let Saved { head, progress, note } = kept;
        let CheckpointHead { origin, wall, stage, tables, store, rows, supplement, films } = head;
        let stage = stage as usize;
        let growing = Growing::resume(&folder, study.spec(), study.points(), &tables, store.as_ref(), rows.as_ref())?;
        if note.is_some() {
            folder.forget_last_state()?;
        }
        let place = |name: &str| folder.part(name);
        let levels = reader::levels(&place, study.spec())?;
        let tally = reader::rows(&place, study.spec(), &levels, supplement)?;
        let mut report = RunReport::new(folder, growing, study, origin, options);
        // Which members were to run at finer levels follows from their rows.
        let finer = study.stages().iter().zip(&mut report.stages).take(stage + 1).filter(|(of, _)| of.is_selective());
        finer.for_each(|(of, members)| *members = study.members_of(of, &levels));
        (report.films, report.earlier, report.stage) = (films, wall, stage);
        (report.tally, report.levels, report.has_begun) = (tally, levels, true);
        Ok((report, progress))
    }

    fn new(folder: OutputFolder, growing: Growing, study: &Study, origin: Origin, options: ReportOptions) -> RunReport {
        options.stop.set_begun();
        RunReport {
            growing,
            folder,
            origin,
            points: study.points(),
            tally: Tally::of(study.spec(), &LevelTimes::default()),
            films: Vec::new(),
            levels: LevelTimes::default(),
            members: study.member_count(),
            stages: study.stages().iter().map(|stage| if stage.is_selective() { 0 } else { stage.members }).collect(),
            stage: 0,
            options,
            earlier: Duration::ZERO,
            kept: (Instant::now(), Duration::ZERO),
            has_begun: false,
        }
    }

    /// Begins stage number `stage`, of so many members; all members of earlier ones have ended.
    pub fn begin_stage(&mut self, stage: usize, members: u64) {
        self.stage = stage;
        self.stages[stage] = members;
    }

    /// Members of the stages before the current one.
    pub fn before(&self) -> u64 {
        self.stages.iter().take(self.stage).sum()
    }

    /// Rows that are written, of members and of levels.
    pub fn rows(&self) -> u64 {
        self.tally.members() + self.tally.levels
    }

    /// Ends a run that failed. Its checkpoint and its rows are kept, or removed if they contain no work. Returns
    /// whether the run can be resumed.
    pub fn give_up(mut self) -> bool {
        // A folder that was taken away is not touched any more.
        let wanted = self.has_begun || self.options.stop.asked().is_some() || self.folder.check_claim().is_err();
        // A checkpoint that cannot be removed needs its rows.
        let stays = wanted || self.folder.forget_states().is_err();
        self.growing.keep(stays);
        stays
    }

    /// Leaves a run that failed to another session, which continues from its last checkpoint, even if that is the
    /// first one.
    pub fn leave(mut self) {
        self.growing.keep(true);
    }

    /// Returns the head of a checkpoint, once everything is on disk.
    fn head(&mut self) -> Result<CheckpointHead> {
        let (tables, store, rows) = self.growing.mark()?;
        Ok(CheckpointHead {
            origin: self.origin.clone(),
            wall: self.wall(),
            stage: self.stage as u64,
            tables,
            store,
            rows,
            supplement: self.tally.supplement.clone(),
            films: self.films.clone(),
        })
    }

    fn wall(&self) -> Duration {
        self.earlier.saturating_add(self.options.since.elapsed())
    }

    fn so_far(&self) -> String {
        let (rows, all) = (self.tally.members(), plural(self.members, "member"));
        format!(
            " after {}; {rows} of {} {all} finished; curvelax resume {} continues",
            duration(self.wall().as_secs_f64()),
            self.members,
            quoted(self.folder.path()),
        )
    }

    /// Gives all files their final names with [`Complete::publish`]; `early` are the warnings given before.
    pub fn finish(mut self, spec: &Spec, early: &[String], form: ResultFormat) -> Result<(String, RunVerdict)> {
        // All rows are written: a run killed from now on only needs to draw its pictures again.
        let next = self.rows() - self.before();
        self.checkpoint(&RunProgress { next, resident: Some(BTreeMap::new()), ..RunProgress::default() })?;
        let shard = match spec.shard {
            Some(_) => Some(shard::to_bytes(&CheckpointHead { rows: None, ..self.head()? }, self.points, early)?),
            None => None,
        };
        let wall = self.wall();
        // Dropped in reverse order: the folder last, after its files.
        let RunReport { folder, tally, films, options, origin, growing, .. } = self;
        options.progress.finish();
        let (files, store, spill) = growing.ready()?;
        let Origin { platform, started, .. } = &origin;
        let warnings = &[early, &tally.warnings()].concat();
        let complete = Complete { spec, platform, tally, films: &films, warnings, started: *started, wall };
        let published = complete.publish(&folder, files, store, shard.as_deref(), form);
        let done = published.and_then(|published| folder.forget_states().map(|()| published));
        if done.is_ok() {
            // No checkpoint refers to it any more.
            spill.iter().for_each(|spill| spill.keep(false));
        }
        done.map_err(|error| folder.explain(error))
    }
}

impl Sink for RunReport {
    fn level(&mut self, row: &LevelRow) -> Result<()> {
        self.growing.add_level(row)?;
        self.tally.levels += 1;
        self.has_begun = true;
        Ok(())
    }

    fn member(&mut self, ended: &Ended) -> Result<()> {
        let Ended { outcome, portrait, mollified, unresolved, excess, .. } = ended;
        (self.options.see)(&ended.rows.snapshots);
        // The tally may refuse it, so it comes first: rows that are written can always be read back.
        self.tally.add(outcome)?;
        self.growing.add(ended)?;
        self.has_begun = true;
        self.tally.add_excess(outcome.cell, excess);
        self.tally.add_supplement(mollified, *unresolved);
        self.films.extend(portrait.as_ref().map(|portrait| Film::new(outcome, portrait)));
        Ok(())
    }

    fn spill(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        (self.options.see)(snapshots);
        self.growing.spill(&self.folder, series, snapshots).map(Some)
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        let (before, all) = (self.before(), self.stages.iter().sum::<u64>());
        let share = (before as f64 + share * total as f64) / all.max(1) as f64;
        self.options.progress.show(before + done, all, share, if all == self.members { "member" } else { "run" });
        match self.options.stop.asked() {
            Some((cause, when)) if when.elapsed() > self.options.patience => Err(cause.error(&self.so_far())),
            _ => Ok(()),
        }
    }

    fn next_request(&mut self) -> SinkRequest {
        let (since, took) = self.kept;
        match self.options.stop.asked() {
            Some((cause, _)) => SinkRequest::Stop(cause.error(&self.so_far())),
            None if since.elapsed() >= self.options.every.max(SHARE_OF_STATES * took) => SinkRequest::Checkpoint,
            None => SinkRequest::Continue,
        }
    }

    fn checkpoint(&mut self, so_far: &RunProgress) -> Result<()> {
        let begun = Instant::now();
        let head = self.head()?;
        let known;
        let resident = match &so_far.resident {
            Some(resident) => resident,
            None => {
                known = checkpoint::in_progress(&self.folder, self.stage as u64, so_far);
                &known
            }
        };
        self.folder.keep_state(&checkpoint::to_bytes(&head, so_far, resident)?)?;
        self.growing.keep(true);
        self.has_begun |= !so_far.early.is_empty() || !resident.is_empty();
        self.kept = (Instant::now(), begun.elapsed());
        self.options.stop.set_kept();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use glam::DVec2;

    use super::*;
    use curvelax_ensemble::{
        Features, Mollified, Observables, Portrait, Rows, Status,
        request::spec::{Store, Tables},
    };
    use curvelax_files::names;
    use curvelax_study::samples::{outcome, platform};

    fn files(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = entries.collect();
        names.sort();
        names
    }

    const PATIENCE: Duration = Duration::from_millis(300);

    fn options(stop: &Stop) -> ReportOptions {
        let (since, every) = (Instant::now(), Duration::from_secs(1000));
        let (stop, see) = (stop.clone(), Box::new(|_: &[Snapshot]| ()));
        ReportOptions { since, progress: Progress::Quiet, every, stop, patience: PATIENCE, see }
    }

    fn begun(out: &Path, spec: &Spec, stop: &Stop) -> RunReport {
        let study = Study::new(spec.clone()).unwrap();
        let origin = Origin::new(&study, platform()).unwrap();
        RunReport::begin(OutputFolder::open(out, true).unwrap(), &study, origin, options(stop)).unwrap()
    }

    #[test]
    fn the_wall_time_includes_what_came_before_the_members() {
        let (home, hour) = (tempfile::tempdir().unwrap(), Duration::from_secs(3600));
        let study = Study::new(Spec { curves: 2, ..Spec::default() }).unwrap();
        let wall = |since: Instant, out: &str| {
            let folder = OutputFolder::open(&home.path().join(out), true).unwrap();
            let options = ReportOptions { since, ..options(&Stop::default()) };
            RunReport::begin(folder, &study, Origin::new(&study, platform()).unwrap(), options).unwrap().wall()
        };
        let now = Instant::now();
        // The clock may have begun less than an hour ago.
        let before = now.checked_sub(hour).unwrap_or(now);
        assert!(wall(before, "rounds") >= now - before && wall(Instant::now(), "none") < hour);
    }

    /// Nodes of the members in these tests.
    const POINTS: usize = 6;

    /// The result of a member.
    fn ended(member: u64, portrait: Option<Portrait>) -> Ended {
        let of = |value| vec![value; POINTS];
        Ended {
            outcome: outcome(member, Status::Relaxed, Some(0.5)),
            features: Features(vec![0.5; 26]),
            excess: vec![0.2, 0.1],
            rows: Rows {
                spilled: Vec::new(),
                series: vec![SeriesRow { member, t: 0.0, at: Observables::default() }],
                snapshots: vec![Snapshot { member, t: 0.0, x: of(1.0), y: of(2.0), k: of(3.0), r: of(4.0) }],
            },
            portrait,
            mollified: Mollified::default(),
            unresolved: false,
        }
    }

    /// A report in `out` that has received one member.
    fn report(out: &Path, spec: &Spec, portrait: Option<Portrait>) -> RunReport {
        let mut report = begun(out, spec, &Stop::default());
        report.member(&ended(0, portrait)).unwrap();
        report
    }

    #[test]
    fn a_finished_report_leaves_the_files_asked_for_and_no_others() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let triangle = vec![DVec2::ZERO, DVec2::X, DVec2::Y];
        let portrait = Portrait { before: triangle.clone(), frames: Vec::new(), after: triangle };

        let all = Spec { series: Some(0.1), snapshots: vec![0.0], tables: Tables::Parquet, ..Spec::default() };
        let (overview, _) = report(&out, &all, Some(portrait)).finish(&all, &[], ResultFormat::Overview).unwrap();
        let tables = ["ensemble.csv", "explained.csv", "levels.csv", "mean_excess.csv", "members.csv"];
        let always = [&tables[..], &["plots", "rates.csv", "report.html", "run.json"]].concat();
        let csv = [&always[..], &["series.csv", "snapshots.csv", "summary.csv"]].concat();
        let parquet = csv.iter().filter_map(|name| names::as_parquet(name));
        let mut both: Vec<String> = csv.iter().map(|name| name.to_string()).chain(parquet).collect();
        both.sort_unstable();
        assert_eq!((files(&out), both.len()), (both.clone(), csv.len() + 9));
        let charts = [
            "distribution.svg",
            "excess.svg",
            "features.svg",
            "mesh.svg",
            "portraits.json",
            "rate.svg",
            "relaxation.svg",
        ];
        let plots = [&charts[..], &["survival.svg"]].concat();
        assert_eq!(files(&out.join("plots")), [&["curves.svg"], &plots[..]].concat());
        for (name, rows) in [(names::SUMMARY, 1), (names::MEMBERS, 1), (names::SERIES, 1), (names::SNAPSHOTS, POINTS)] {
            assert_eq!(fs::read_to_string(out.join(name)).unwrap().lines().count(), 1 + rows, "{name}");
        }
        assert!(
            overview.contains(
                "summary.csv, members.csv, ensemble.csv, explained.csv, rates.csv, levels.csv, mean_excess.csv, series.csv, \
                 snapshots.csv, *.parquet, report.html, plots/*.svg"
            ),
            "{overview}"
        );

        let few = Spec::default();
        report(&out, &few, None).finish(&few, &["a warning".into()], ResultFormat::Overview).unwrap();
        assert_eq!(files(&out), [&always[..], &["summary.csv"]].concat());
        assert_eq!(files(&out.join("plots")), plots);
        assert!(fs::read_to_string(out.join("run.json")).unwrap().contains("a warning"));
    }

    #[test]
    fn a_run_that_is_asked_to_stop_says_so_and_waits_only_so_long() {
        let home = tempfile::tempdir().unwrap();
        let (spec, stop) = (Spec::default(), Stop::default());
        let mut running = begun(&home.path().join("out"), &spec, &stop);
        running.member(&ended(0, None)).unwrap();
        assert!(matches!(running.next_request(), SinkRequest::Continue) && running.progress(1, 256, 0.1).is_ok());
        let before = Instant::now();
        stop.ask(Cause::MaxTime);
        stop.ask(Cause::Interrupt);
        let SinkRequest::Stop(error) = running.next_request() else { panic!("it continues") };
        assert_eq!(error.exit_code(), 75, "the first cause counts");
        assert!(error.to_string().starts_with("stopped by --max-time after "), "{error}");
        assert!(error.to_string().contains("; 1 of 256 members finished; curvelax resume "), "{error}");
        // If this thread had to wait long, its patience may be over.
        let continues = running.progress(1, 256, 0.1).is_ok();
        assert!((continues || before.elapsed() > PATIENCE) && !stop.is_kept());
        running.checkpoint(&RunProgress { next: 1, ..RunProgress::default() }).unwrap();
        assert!(stop.is_kept());
        std::thread::sleep(PATIENCE);
        assert_eq!(running.progress(1, 256, 0.1).unwrap_err().exit_code(), 75);
        assert_eq!(Cause::Interrupt.error("").exit_code(), 130);
    }

    #[test]
    fn a_checkpoint_is_requested_when_it_is_due() {
        let home = tempfile::tempdir().unwrap();
        let (spec, stop) = (Spec::default(), Stop::default());
        let mut running = begun(&home.path().join("out"), &spec, &stop);
        let hour = Duration::from_secs(3600);
        running.options.every = hour;
        running.kept = (Instant::now(), Duration::ZERO);
        assert!(matches!(running.next_request(), SinkRequest::Continue));
        running.options.every = Duration::ZERO;
        assert!(matches!(running.next_request(), SinkRequest::Checkpoint));
        // A checkpoint that took long is not saved again soon.
        running.kept.1 = hour;
        assert!(matches!(running.next_request(), SinkRequest::Continue));
    }

    #[test]
    fn a_report_continues_from_its_state_to_the_same_bytes() {
        let home = tempfile::tempdir().unwrap();
        let csv = Spec {
            curves: 3,
            points: POINTS,
            amplitude: 0.0.into(),
            series: Some(0.1),
            snapshots: vec![0.0],
            tables: Tables::Parquet,
            ..Spec::default()
        };
        let zarr = Spec { store: Store::Zarr, ..csv.clone() };
        for (name, spec) in [("csv", csv), ("zarr", zarr)] {
            let [straight, broken] = ["straight", "broken"].map(|way| home.path().join(name).join(way));
            let mut whole = begun(&straight, &spec, &Stop::default());
            (0..3).for_each(|member| whole.member(&ended(member, None)).unwrap());
            whole.finish(&spec, &[], ResultFormat::Overview).unwrap();

            let mut first = begun(&broken, &spec, &Stop::default());
            first.member(&ended(0, None)).unwrap();
            let early = BTreeMap::from([(2, ended(2, None))]);
            first.checkpoint(&RunProgress { next: 1, early, resident: Some(BTreeMap::new()) }).unwrap();
            // Not in the checkpoint: to be cut off.
            first.member(&ended(1, None)).unwrap();
            assert!(first.give_up(), "there is something to continue with");
            let folder = OutputFolder::open_again(&broken).unwrap();
            let kept = checkpoint::find(&folder).unwrap().unwrap();
            assert_eq!(kept.note, None);
            let study = Study::new(spec.clone()).unwrap();
            let (mut second, so_far) = RunReport::resume(folder, &study, kept, options(&Stop::default())).unwrap();
            assert_eq!((so_far.next, second.tally.members()), (1, 1));
            second.member(&ended(1, None)).unwrap();
            second.member(&so_far.early[&2]).unwrap();
            second.finish(&spec, &[], ResultFormat::Overview).unwrap();
            let is_table = |name: &String| name.ends_with("csv") || name.ends_with("parquet");
            let tables: Vec<String> = files(&straight).into_iter().filter(is_table).collect();
            assert_eq!(tables.len(), if name == "csv" { 18 } else { 16 });
            assert_eq!(files(&straight), files(&broken));
            for name in tables {
                let bytes = |folder: &Path| fs::read(folder.join(&name)).unwrap();
                assert!(bytes(&straight) == bytes(&broken), "{name}");
            }
            if name == "zarr" {
                for chunk in ["x/c.0.0.0", "k/c.0.0.0", "status/c.0", "zarr.json"] {
                    let bytes = |folder: &Path| fs::read(folder.join(names::STORE).join(chunk)).unwrap();
                    assert_eq!(bytes(&straight), bytes(&broken), "{chunk}");
                }
            }
        }
    }

    #[test]
    fn a_run_that_fails_keeps_its_state_unless_there_is_nothing_in_it() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        assert!(!begun(&out, &Spec::default(), &Stop::default()).give_up());
        assert_eq!(files(home.path()), [""; 0]);
        assert!(report(&out, &Spec::default(), None).give_up());
        let parts = ["levels", "members", "rates", "summary"].map(|name| format!(".{name}.csv.part"));
        assert_eq!(files(&out), [&[".curvelax.state".to_owned()], &parts[..]].concat());
        // Nothing has ended, but the run was asked to stop, which is not a failure.
        let stop = Stop::default();
        let running = begun(&home.path().join("stopped"), &Spec::default(), &stop);
        stop.ask(Cause::Terminate);
        assert!(running.give_up());
    }
}
