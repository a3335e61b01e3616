//! A session: a study that is being carried out, from its beginning or from a checkpoint to its end or an interruption.

use std::{mem, path::Path};

use super::{
    host::Host,
    placed::{FirstBackend, PlacedStudy, open},
};
use crate::report::{ReportOptions, RunReport};
use curvelax_base::{
    error::{Error, Result},
    text::quoted,
};
use curvelax_ensemble::{LevelSink, RunProgress, Study, simulate};
use curvelax_files::{
    OutputFolder,
    state::checkpoint::{Origin, Saved},
};
use curvelax_study::{
    placement::{ChosenBackend, OpeningWatch},
    results::RunVerdict,
};

/// A run that is complete.
#[derive(Debug)]
pub struct Completed {
    /// The results in the host's form.
    pub text: String,
    /// How it ended as a whole.
    pub verdict: RunVerdict,
}

/// A study that is being carried out.
pub struct Session {
    pub(super) placed: PlacedStudy,
    first: FirstBackend,
    pub(super) report: RunReport,
    /// The progress in the report's current stage.
    progress: RunProgress,
}

impl Session {
    /// Opens the back end of `placed`, and the report in `folder`.
    pub fn begin(
        placed: PlacedStudy,
        folder: OutputFolder,
        options: ReportOptions,
        host: &dyn Host,
    ) -> Result<Session> {
        let (placed, first) = placed.open(host)?;
        let origin = Origin::new(&placed.study, placed.platform())?;
        let report = RunReport::begin(folder, &placed.study, origin, options)?;
        Ok(Session { placed, first, report, progress: RunProgress::default() })
    }

    /// Opens the report in `folder` again, at the checkpoint `saved`.
    pub fn resume(
        placed: PlacedStudy,
        folder: OutputFolder,
        saved: Saved,
        options: ReportOptions,
        host: &dyn Host,
    ) -> Result<Session> {
        let (report, progress) = RunReport::resume(folder, &placed.study, saved, options)?;
        let (members, all) = (report.tally.members(), placed.study.member_count());
        host.say(&format!("resuming: {members} of {all} members finished"));
        Ok(Session { placed, first: FirstBackend::Unopened, report, progress })
    }

    /// Runs the remaining work, and publishes all results. If a GPU fails from which the CPU may take over, the run is
    /// always saved.
    ///
    /// # Errors
    /// Those of the run, and [`Error::Request`] if the progress does not match the report.
    pub fn carry_out(self, host: &dyn Host) -> Result<Completed> {
        self.check_rows()?;
        let early = [&self.placed.warnings()[..], &self.report.origin.moves].concat();
        early.iter().for_each(|warning| host.say(&format!("warning: {warning}")));
        let (out, falls_back) = (self.report.folder.path().to_path_buf(), self.placed.may_fall_back());
        let Session { placed: PlacedStudy { study, choices, .. }, first, mut report, progress } = self;
        if let Err(error) = advance(&study, choices, first, progress, &mut report, host) {
            return Err(ended(report, error, falls_back, &out, host));
        }
        let late = report.tally.warnings();
        let (text, verdict) =
            report.finish(study.spec(), &early, host.form()).inspect_err(|error| kept(&out, error, host))?;
        late.iter().for_each(|warning| host.say(&format!("warning: {warning}")));
        Ok(Completed { text, verdict })
    }

    /// Checks that the checkpoint counts as many members as have rows.
    fn check_rows(&self) -> Result<()> {
        let (told, rows) = (self.report.before().saturating_add(self.progress.next), self.report.rows());
        if told == rows {
            return Ok(());
        }
        let path = self.report.folder.path().display();
        Err(Error::Request(format!("{path}: the checkpoint counts {told} members, but the table has {rows}")))
    }
}

/// Closes the report of a run that ended with `error`, and returns its cause.
fn ended(report: RunReport, error: Error, falls_back: bool, out: &Path, host: &dyn Host) -> Error {
    let error = report.folder.explain(error);
    if falls_back && matches!(error, Error::Device(_)) {
        report.leave();
    } else if report.give_up() {
        kept(out, &error, host);
    }
    error
}

/// Says how to resume a run that failed, unless the error does.
fn kept(out: &Path, error: &Error, host: &dyn Host) {
    if !matches!(error, Error::Stopped(_) | Error::Interrupted(_) | Error::Lost(_)) {
        let on_cpu = if matches!(error, Error::Device(_)) { ", with --backend cpu on the CPU" } else { "" };
        host.say(&format!("note: the run was saved: curvelax resume {} continues it{on_cpu}", quoted(out)));
    }
}

/// Runs one stage after another, from `progress` in the report's current one; `first` is the back end of the study's
/// own.
fn advance(
    study: &Study,
    choices: Vec<ChosenBackend>,
    first: FirstBackend,
    mut progress: RunProgress,
    report: &mut RunReport,
    host: &dyn Host,
) -> Result<()> {
    let (own, mut first, mut levels) = (study.own_stage(), Some(first), mem::take(&mut report.levels));
    for (i, (stage, choice)) in study.stages().iter().zip(choices).enumerate().skip(report.stage) {
        let cells = study.cells_of(stage, &levels)?;
        // No member needs these nodes.
        if cells.is_empty() {
            continue;
        }
        // A run that has begun stays on its device.
        let choice = choice.after(&report.origin.platform);
        let precision = choice.precision;
        let mut backend = match first.take_if(|_| i == own) {
            Some(FirstBackend::Open(backend)) => backend,
            Some(FirstBackend::Announced) => choice.open_for(&cells, &OpeningWatch::default())?.0,
            // Of levels nothing is said: they are where the study is, or a pilot.
            _ if stage.level.is_some() => choice.open_for(&cells, &OpeningWatch::default())?.0,
            _ => open(&cells, &choice, host)?.0,
        };
        report.begin_stage(i, cells.iter().map(|cell| cell.spec.member_count()).sum());
        let progress = mem::take(&mut progress);
        let mut sink = LevelSink { level: stage.level, precision, cells: &cells, levels: &mut levels, sink: report };
        simulate::resume(&cells, precision, backend.as_mut(), study.portraits(stage), progress, &mut sink)?;
    }
    Ok(())
}
