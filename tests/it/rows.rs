//! Rows that wait for their members to end: on disk if they are many, and in the tables with the same bytes as in a run
//! that was never interrupted.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    time::{Duration, Instant},
};

use curvelax::{
    Error, Result,
    ensemble::{
        Ended, Extent, RunProgress, SeriesRow, Sink, SinkRequest, Snapshot, Spec, Study,
        request::spec::{BackendChoice, Store},
    },
    files::{
        OutputFolder,
        state::checkpoint::{self, Origin},
    },
    placement,
    report::{Progress, ReportOptions, ResultFormat, RunReport, Stop},
    simulate::resume,
};

/// A report whose run is stopped when its patience is over.
struct Impatient<'a> {
    report: &'a mut RunReport,
    patience: u32,
    /// It does not wait for the members in progress.
    at_once: bool,
    /// It waits for a checkpoint.
    waits: bool,
    spilled: u64,
}

impl Impatient<'_> {
    fn stopped(&self) -> Error {
        Error::Stopped("enough".into())
    }
}

impl Sink for Impatient<'_> {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.report.member(ended)
    }

    fn spill(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        self.spilled += 1;
        self.report.spill(series, snapshots)
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        self.report.progress(done, total, share)?;
        if self.at_once && self.patience == 0 { Err(self.stopped()) } else { Ok(()) }
    }

    fn next_request(&mut self) -> SinkRequest {
        self.patience = self.patience.saturating_sub(1);
        match self.patience {
            0 if !self.at_once => return SinkRequest::Stop(self.stopped()),
            patience => self.waits |= patience.is_multiple_of(3),
        }
        if self.waits { SinkRequest::Checkpoint } else { SinkRequest::Continue }
    }

    fn checkpoint(&mut self, progress: &RunProgress) -> Result<()> {
        self.waits = false;
        self.report.checkpoint(progress)
    }
}

fn options() -> ReportOptions {
    ReportOptions {
        since: Instant::now(),
        progress: Progress::Quiet,
        every: Duration::from_secs(1000),
        stop: Stop::default(),
        patience: Duration::from_secs(2),
        see: Box::new(|_| ()),
    }
}

/// Runs `spec` into `out` in pieces of `patience` or more checks; returns the number of pieces, and how often rows were
/// spilled.
fn run(spec: &Spec, out: &Path, patience: u32) -> Result<(u32, u64)> {
    let mut study = Study::new(spec.clone())?;
    let choices = placement::choose_all(&study)?;
    placement::settle(&mut study, &choices);
    let (choice, cells) = (&choices[0], study.cells());
    let origin = Origin::new(&study, choice.platform(study.spec()))?;
    let mut report = RunReport::begin(OutputFolder::open(out, false)?, &study, origin, options())?;
    let (mut progress, mut spilled) = (RunProgress::default(), 0);
    for piece in 1.. {
        // More each time, so that the run ends although some of its work is lost.
        let patience = patience.saturating_add(piece / 4);
        let mut sink = Impatient { report: &mut report, patience, at_once: piece % 3 == 0, waits: false, spilled: 0 };
        let (mut backend, _) = choice.open_for(cells, &placement::OpeningWatch::default())?;
        let done = resume(cells, choice.precision, backend.as_mut(), 2, progress, &mut sink);
        spilled += sink.spilled;
        match done {
            Err(Error::Stopped(_)) => assert!(report.give_up()),
            done => {
                done?;
                report.finish(study.spec(), &[], ResultFormat::Overview)?;
                return Ok((piece, spilled));
            }
        }
        let state = fs::metadata(out.join(".curvelax.state")).expect("a state").len();
        assert!(state < 5 << 20, "a state of {state} bytes");
        let folder = OutputFolder::open_again(out)?;
        let kept = checkpoint::find(&folder)?.expect("a run that was interrupted");
        (report, progress) = RunReport::resume(folder, &study, kept, options())?;
    }
    unreachable!("it ends")
}

/// All files below a folder, by name; `run.json` has the time of the run.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name().into_string().unwrap())).unwrap();
        match path.is_dir() {
            true => all.extend(content(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes))),
            false if name == "run.json" || name == "report.html" => {}
            false => drop(all.insert(name, fs::read(&path).unwrap())),
        }
    }
    all
}

fn same_in_pieces(spec: Spec, table: &str) {
    let spec = Spec { curves: 11, adaptive: Some(0.1), t_end: Some(1.0.into()), backend: BackendChoice::Cpu, ..spec };
    let home = tempfile::tempdir().unwrap();
    let [whole, pieces] = ["whole", "pieces"].map(|name| home.path().join(name));
    let (_, straight) = run(&spec, &whole, u32::MAX / 2).unwrap();
    let (count, spilled) = run(&spec, &pieces, 3).unwrap();
    assert!(count > 3 && spilled >= 11, "{count} pieces, {spilled} times");
    assert!(straight > 0, "as many rows as these do not stay in memory");
    let (whole, pieces) = (content(&whole), content(&pieces));
    assert!(whole.contains_key(table), "{:?}", whole.keys());
    assert_eq!(whole.keys().collect::<Vec<_>>(), pieces.keys().collect::<Vec<_>>());
    let differ: Vec<&String> = whole.keys().filter(|name| whole[*name] != pieces[*name]).collect();
    assert!(differ.is_empty(), "{differ:?}");
}

#[test]
fn a_series_of_many_rows_is_that_of_a_straight_run_however_often_it_is_interrupted() {
    // 25 000 rows of 88 bytes.
    same_in_pieces(Spec { points: 34, series: Some(4e-5), snapshots: vec![0.0, 0.5], ..Spec::default() }, "series.csv");
}

#[test]
fn a_store_of_many_snapshots_is_that_of_a_straight_run_however_often_it_is_interrupted() {
    let snapshots = (0..=1500).map(|i| f64::from(i) / 1500.0).collect();
    let spec = Spec { points: 34, snapshots, store: Store::Zarr, ..Spec::default() };
    same_in_pieces(spec, "snapshots.zarr/x/c.0.0.0");
}
