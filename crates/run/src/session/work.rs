//! A study in progress: the request, where it is computed, and how it is carried out.

use std::path::{Path, PathBuf};

use super::{Completed, Host};
use crate::report::RunReport;
use curvelax_backend::{Backend, DeviceKind};
use curvelax_base::{
    error::{Error, Result},
    text::quoted,
};
use curvelax_ensemble::{
    Cell, Ended, Extent, Judged, LevelRow, Outlines, SeriesRow, Sink, Snapshot, Spec, Standing, Study, Wish, simulate,
};
use curvelax_study::placement::{self, Choice, OpeningWatch, Platform};

/// A study that is ready to run, with the back end of each stage.
pub struct Work {
    /// The resolved study, with everything that the choices decided.
    pub study: Study,
    /// The back ends of its stages.
    pub choices: Vec<Choice>,
    /// The request, and the directory to which its paths are relative.
    asked: (Spec, PathBuf),
    /// The back end of the first cells of the study itself, once it is known to open; none if it opens again at no cost.
    opened: Option<Option<Box<dyn Backend>>>,
}

impl Work {
    /// Checks everything that can be wrong with `spec` on this machine.
    pub fn new(spec: Spec) -> Result<Work> {
        Work::new_from(spec, Path::new(""), &Outlines::default())
    }

    /// Does the same as [`Work::new`], with the outlines that are `known`; other paths in the spec are relative to the
    /// directory `base`.
    pub fn new_from(spec: Spec, base: &Path, known: &Outlines) -> Result<Work> {
        let mut study = Study::new_from(spec.clone(), base, known)?;
        let choices = placement::choose_all(&study)?;
        placement::settle(&mut study, &choices);
        Ok(Work { study, choices, asked: (spec, base.into()), opened: None })
    }

    /// Replaces the reason of the choices.
    pub fn because(mut self, reason: &str) -> Work {
        self.choices = self.choices.into_iter().map(|choice| choice.because(reason.into())).collect();
        self
    }

    /// Opens the back end of the first cells of the study itself, and returns where it is. If that is not the GPU that
    /// was chosen, the work becomes that of a request for the CPU, whose precision and tolerance may differ.
    pub fn open(&mut self, host: &dyn Host) -> Result<Platform> {
        let (cells, choice) = self.first();
        let (backend, platform) = open(cells, choice, host)?;
        if choice.device().kind() != platform.backend {
            host.say(&format!("note: on the CPU instead: {}", platform.reason));
            let (asked, base) = &self.asked;
            let spec = Spec { backend: platform.backend.into(), adapter: None, ..asked.clone() };
            *self = Work::new_from(spec, &base.clone(), &self.study.outlines())?.because(&platform.reason);
            self.opened = Some(None);
            return Ok(self.platform());
        }
        // One on the CPU is opened when its turn comes: it would only hold memory while the levels run.
        self.opened = Some((platform.backend == DeviceKind::Gpu).then_some(backend));
        Ok(platform)
    }

    /// The first cells of the study itself, and their back end.
    fn first(&self) -> (&[Cell], &Choice) {
        let own = self.study.own_stage();
        (&self.study.cells()[self.study.stages()[own].range.clone()], &self.choices[own])
    }

    /// Returns whether the CPU may take over if the GPU fails.
    pub fn may_fall_back(&self) -> bool {
        self.first().1.may_fall_back()
    }

    /// What the user should know about the study and where it is computed.
    pub fn warnings(&self) -> Vec<String> {
        self.study.warnings().into_iter().chain(self.first().1.warning()).collect()
    }

    /// Where everything is computed, except perhaps the pilot.
    pub fn platform(&self) -> Platform {
        let (cells, choice) = self.first();
        choice.platform(&cells[0].spec)
    }

    /// Runs the remaining work, and publishes all results. If a GPU fails from which the CPU may take over, the run is
    /// always saved.
    ///
    /// # Errors
    /// Those of the run, and [`Error::Request`] if `standing` does not match the report.
    pub fn carry_out(self, mut report: RunReport, standing: Standing, host: &dyn Host) -> Result<Completed> {
        let before: u64 = self.study.stages().iter().take(report.stage()).map(|stage| stage.members).sum();
        let (told, rows) = (before.saturating_add(standing.next), report.rows());
        if told != rows {
            let path = report.folder().display();
            return Err(Error::Request(format!(
                "{path}: the checkpoint counts {told} members, but the table has \
                                               {rows}"
            )));
        }
        let early = [&self.warnings()[..], report.moves()].concat();
        early.iter().for_each(|warning| host.say(&format!("warning: {warning}")));
        let (out, falls_back) = (report.folder().to_path_buf(), self.may_fall_back());
        let Work { study, choices, opened, .. } = self;
        let done = advance(&study, choices, opened, standing, &mut report, host);
        if let Err(error) = done {
            match report.explain(error) {
                Error::Device(fault) if falls_back => {
                    report.leave();
                    return Err(Error::Device(fault));
                }
                error => {
                    if report.give_up() {
                        kept(&out, &error, host);
                    }
                    return Err(error);
                }
            }
        }
        let late = report.warnings();
        let (text, verdict) =
            report.finish(study.spec(), &early, host.form()).inspect_err(|error| kept(&out, error, host))?;
        late.iter().for_each(|warning| host.say(&format!("warning: {warning}")));
        Ok(Completed { text, verdict, out })
    }
}

/// Says how to resume a run that failed, unless the error does.
fn kept(out: &Path, error: &Error, host: &dyn Host) {
    if !matches!(error, Error::Stopped(_) | Error::Interrupted(_) | Error::Lost(_)) {
        let on_cpu = if matches!(error, Error::Device(_)) { ", with --backend cpu on the CPU" } else { "" };
        host.say(&format!("note: the run was saved: curvelax resume {} continues it{on_cpu}", quoted(out)));
    }
}

/// Opens the back end chosen for a cohort.
fn open(cohort: &[Cell], choice: &Choice, host: &dyn Host) -> Result<(Box<dyn Backend>, Platform)> {
    host.say(&choice.sentence(&cohort[0].spec));
    let watch = OpeningWatch { tell: &|what| host.say(&format!("note: {what}")), go_on: &|| host.go_on() };
    choice.open_watched(cohort, &watch)
}

/// Runs one stage after another, from `standing` in the report's current one; `opened` is as in [`Work`].
fn advance(
    study: &Study,
    choices: Vec<Choice>,
    mut opened: Option<Option<Box<dyn Backend>>>,
    mut standing: Standing,
    report: &mut RunReport,
    host: &dyn Host,
) -> Result<()> {
    let (own, mut levels) = (study.own_stage(), report.take_levels());
    for (i, (stage, choice)) in study.stages().iter().zip(choices).enumerate().skip(report.stage()) {
        let cells = study.cells_of(stage)?;
        // A run that has begun stays on its device.
        let choice = choice.after(report.platform());
        let precision = choice.precision();
        let mut backend = match opened.take_if(|_| i == own) {
            Some(Some(backend)) => backend,
            // Of levels nothing is said: they are where the study is, or a pilot.
            None if stage.level.is_none() => open(&cells, &choice, host)?.0,
            _ => choice.open_for(&cells)?.0,
        };
        report.begin_stage(i);
        let standing = std::mem::take(&mut standing);
        let mut shown = Shown { report, host };
        let mut sink = Judged { level: stage.level, cells: &cells, levels: &mut levels, sink: &mut shown };
        simulate::resume(&cells, precision, backend.as_mut(), study.portraits(stage), standing, &mut sink)?;
    }
    Ok(())
}

/// The report of a run whose host sees the snapshots.
struct Shown<'a> {
    report: &'a mut RunReport,
    host: &'a dyn Host,
}

impl Sink for Shown<'_> {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.host.see(&ended.rows.snapshots);
        self.report.member(ended)
    }

    fn level(&mut self, row: &LevelRow) -> Result<()> {
        self.report.level(row)
    }

    fn spill(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        self.host.see(snapshots);
        self.report.spill(series, snapshots)
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        self.report.progress(done, total, share)
    }

    fn wish(&mut self) -> Wish {
        self.report.wish()
    }

    fn checkpoint(&mut self, standing: &Standing) -> Result<()> {
        self.report.checkpoint(standing)
    }
}
