//! A study in progress, for `run` and `resume`: the request, where it is computed, and how it is carried out.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use super::{flags, note, print, signals};
use crate::{
    backend::{Backend, DeviceKind},
    ensemble::{Cell, Judged, Spec, Standing, Study},
    error::{Error, Result},
    files::names,
    placement::{self, Choice, Platform},
    report::{Form, Manner, RunReport, Stop, complete::listed, document::Document, reader::Finished},
    results::EnsembleStatistics,
    simulate::resume,
    text::{plural, quoted},
};

/// How a run goes about its work: nothing of it changes a result.
#[derive(clap::Args)]
pub struct MannerFlags {
    /// Print no progress, notes or table: only errors, and the results if --json is given
    #[arg(long, help_heading = flags::OUTPUT)]
    pub quiet: bool,
    /// Print the results as one JSON document instead of the table
    #[arg(long, help_heading = flags::OUTPUT)]
    pub json: bool,
    /// Exit with code 3 if a member ends neither relaxed nor unfinished
    #[arg(long, help_heading = flags::OUTPUT)]
    strict: bool,
    /// Stop after this time, such as 90, 90s, 5m or 1h30m, with exit code 75; `curvelax resume` continues
    #[arg(long, value_name = "DURATION", value_parser = flags::duration, allow_hyphen_values = true, help_heading = flags::OUTPUT)]
    max_time: Option<Duration>,
    /// Interval between checkpoints for `curvelax resume`: a run that is killed loses at most this much work
    #[arg(
        long, value_name = "DURATION", value_parser = flags::duration, allow_hyphen_values = true, default_value = "5s",
        help_heading = flags::OUTPUT
    )]
    checkpoint_every: Duration,
}

impl MannerFlags {
    /// Prints a line on stderr, unless quiet.
    pub fn say(&self, line: &str) {
        if !self.quiet {
            note(line)
        }
    }

    /// Checks that the results in `out` can be printed as requested.
    ///
    /// # Errors
    /// [`Error::Request`] for a name that JSON cannot represent.
    pub fn check_name(&self, out: &Path) -> Result<()> {
        check_name(self.json, out)
    }

    /// Says about the finished run in `out` what is asked of one: its results as JSON, and whether members failed.
    ///
    /// # Errors
    /// As [`MannerFlags::check_failed`], and those of reading the run.
    pub fn finished(&self, out: &Path) -> Result<()> {
        if !self.json && !self.strict {
            return Ok(());
        }
        let Finished { provenance, mut tally, .. } = Finished::read(out)?;
        let (failed, members) = (tally.failed(), tally.members());
        if self.json {
            let statistics = EnsembleStatistics::new(&provenance.spec, &mut tally)?;
            let files = listed(|name| out.join(name).exists());
            print(&Document::new(&provenance, &provenance.spec, &statistics, out, &files).to_json()?)?;
        }
        self.check_failed(failed, members, out)
    }

    /// Checks that no member failed, if that is asked for.
    ///
    /// # Errors
    /// [`Error::Strict`] with how many did.
    fn check_failed(&self, failed: u64, members: u64, out: &Path) -> Result<()> {
        match failed {
            1.. if self.strict => Err(Error::Strict(format!(
                "--strict: {failed} of {members} {} ended neither relaxed nor unfinished; see `status` in {}",
                plural(members, "member"),
                out.join(names::SUMMARY).display()
            ))),
            _ => Ok(()),
        }
    }

    /// The interval between checkpoints.
    pub fn checkpoint_every(&self) -> Duration {
        self.checkpoint_every
    }

    /// Makes the run stoppable from now on.
    pub fn manner(&self) -> Result<Manner> {
        let stop = Stop::default();
        signals::watch(&stop, self.max_time)?;
        Ok(self.manner_with(stop))
    }

    /// The manner of a run that `stop` stops.
    pub fn manner_with(&self, stop: Stop) -> Manner {
        Manner { quiet: self.quiet, every: self.checkpoint_every, stop }
    }
}

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
        Work::new_from(spec, Path::new(""))
    }

    /// Does the same as [`Work::new`], with paths in the spec relative to the directory `base`.
    pub fn new_from(spec: Spec, base: &Path) -> Result<Work> {
        let mut study = Study::new_from(spec.clone(), base)?;
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
    pub fn open(&mut self, flags: &MannerFlags) -> Result<Platform> {
        let (cells, choice) = self.first();
        let (backend, platform) = open(cells, choice, flags)?;
        if choice.device().kind() != platform.backend {
            flags.say(&format!("note: on the CPU instead: {}", platform.reason));
            let (asked, base) = &self.asked;
            let spec = Spec { backend: platform.backend.into(), adapter: None, ..asked.clone() };
            *self = Work::new_from(spec, &base.clone())?.because(&platform.reason);
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
    pub fn carry_out(self, mut report: RunReport, standing: Standing, flags: &MannerFlags) -> Result<()> {
        let before: u64 = self.study.stages().iter().take(report.stage()).map(|stage| stage.members).sum();
        let (told, rows) = (before.saturating_add(standing.next), report.rows());
        if told != rows {
            let path = report.folder().display();
            return Err(Error::Request(format!(
                "{path}: the checkpoint counts {told} members, but the table has \
                                               {rows}"
            )));
        }
        let early = [&self.study.warnings()[..], report.moves()].concat();
        early.iter().for_each(|warning| flags.say(&format!("warning: {warning}")));
        let (out, falls_back) = (report.folder().to_path_buf(), self.may_fall_back());
        let Work { study, choices, opened, .. } = self;
        let done = advance(&study, choices, opened, standing, &mut report, flags);
        if let Err(error) = done {
            match report.explain(error) {
                Error::Device(fault) if falls_back => {
                    report.leave();
                    return Err(Error::Device(fault));
                }
                error => {
                    if report.give_up() {
                        kept(&out, &error, flags);
                    }
                    return Err(error);
                }
            }
        }
        let (late, failed) = (report.warnings(), report.failed());
        let form = if flags.json { Form::Json } else { Form::Overview };
        let text = report.finish(study.spec(), &early, form).inspect_err(|error| kept(&out, error, flags))?;
        late.iter().for_each(|warning| flags.say(&format!("warning: {warning}")));
        if flags.json || !flags.quiet {
            print(&text)?;
        }
        flags.check_failed(failed, study.member_count(), &out)
    }
}

/// Does the same as [`MannerFlags::check_name`], if `json` is set.
pub fn check_name(json: bool, out: &Path) -> Result<()> {
    match json && out.to_str().is_none() {
        true => Err(Error::value(
            "out",
            out.display(),
            "not UTF-8, which JSON requires",
            "use another folder, or leave --json out",
        )),
        false => Ok(()),
    }
}

/// Says how to resume a run that failed, unless the error does.
fn kept(out: &Path, error: &Error, flags: &MannerFlags) {
    if !matches!(error, Error::Stopped(_) | Error::Interrupted(_) | Error::Lost(_)) {
        let on_cpu = if matches!(error, Error::Device(_)) { ", with --backend cpu on the CPU" } else { "" };
        flags.say(&format!("note: the run was saved: curvelax resume {} continues it{on_cpu}", quoted(out)));
    }
}

/// Opens the back end chosen for a cohort.
fn open(cohort: &[Cell], choice: &Choice, flags: &MannerFlags) -> Result<(Box<dyn Backend>, Platform)> {
    flags.say(&choice.sentence(&cohort[0].spec));
    choice.open_for_and_tell(cohort, &|what| flags.say(&format!("note: {what}")))
}

/// Runs one stage after another, from `standing` in the report's current one; `opened` is as in [`Work`].
fn advance(
    study: &Study,
    choices: Vec<Choice>,
    mut opened: Option<Option<Box<dyn Backend>>>,
    mut standing: Standing,
    report: &mut RunReport,
    flags: &MannerFlags,
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
            None if stage.level.is_none() => open(&cells, &choice, flags)?.0,
            _ => choice.open_for(&cells)?.0,
        };
        report.begin_stage(i);
        let standing = std::mem::take(&mut standing);
        let mut sink = Judged { level: stage.level, cells: &cells, levels: &mut levels, sink: report };
        resume(&cells, precision, backend.as_mut(), study.portraits(stage), standing, &mut sink)?;
    }
    Ok(())
}
