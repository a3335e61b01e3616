//! An interrupted run continues where it stopped, and writes exactly the files it would have written.

use std::path::{Path, PathBuf};

use super::{Completed, Host, Work};
use crate::{
    files::{OutputFolder, names},
    report::{
        Manner, RunReport,
        checkpoint::{self, Head, Saved},
        outlines, reader,
    },
};
use curvelax_base::{
    error::{Error, Result},
    text::quoted,
};
use curvelax_ensemble::{Outlines, Spec, Standing, Study, request::spec::BackendChoice};

/// Resumes the run in the folder at `path`. `None` means that it is finished.
///
/// # Errors
/// [`Error::Request`] if there is no run, or if it would continue elsewhere without being asked to; and those of the
/// run.
pub fn resume(path: &Path, place: ResumePlace, host: &dyn Host) -> Result<Option<Completed>> {
    let folder = OutputFolder::open_again(path)?;
    let saved = checkpoint::find(&folder)?;
    resume_in(folder, saved, place, host)
}

/// The run that was begun in the folder at `path`, if any: its folder, and its checkpoint unless it is complete.
///
/// # Errors
/// Those of [`resume()`].
pub fn begun(path: &Path) -> Result<Option<(OutputFolder, Option<Saved>)>> {
    let there = |name: &&str| path.join(name).exists();
    if ![names::STATE, names::STATE_OLD, names::RUN].iter().any(there) {
        return Ok(None);
    }
    let folder = OutputFolder::open_again(path)?;
    let saved = checkpoint::find(&folder)?;
    Ok(Some((folder, saved)))
}

/// Resumes a run that was [begun], if it has the same spec. `None` means that it is finished.
///
/// # Errors
/// [`Error::Request`] for a run of another spec, and those of [`resume()`].
pub fn resume_like(
    (folder, saved): (OutputFolder, Option<Saved>),
    study: &Study,
    asked: BackendChoice,
    host: &dyn Host,
) -> Result<Option<Completed>> {
    let (path, spec) = (folder.path().display().to_string(), study.spec());
    let own = match &saved {
        Some(saved) => Spec::from_toml(&saved.head.origin.spec).map_err(|e| state_spec(&e))?,
        None => reader::provenance(folder.path())?.spec,
    };
    // Where it continues is checked separately, and the number of threads makes no difference.
    if let Some((key, here, there)) = spec.difference(&own, &["backend", "adapter", "threads"]) {
        return Err(Error::Request(format!(
            "--resume: the run in {path} has another spec: {key} is {there} there and {here} here; use another folder"
        )));
    }
    if let Some(Saved { head: Head { origin, .. }, .. }) = &saved {
        // The outline of this name may be another one here.
        origin.check_outlines(study)?;
        let there = origin.platform.backend;
        if asked != BackendChoice::Auto && asked != there.into() {
            return Err(Error::Request(format!(
                "--resume: the run in {path} is on the {there}; leave out --backend, or move it with curvelax resume \
                 {} --backend",
                quoted(folder.path())
            )));
        }
    }
    resume_in(folder, saved, ResumePlace { threads: spec.threads, ..ResumePlace::default() }, host)
}

/// Carries out `work`. If a GPU fails that `--backend auto` chose, the run continues on the CPU from its last checkpoint,
/// as by `resume --backend cpu`.
pub fn carry_out(work: Work, report: RunReport, standing: Standing, host: &dyn Host) -> Result<Completed> {
    let falls_back = work.may_fall_back();
    let (path, stop) = (report.folder().to_path_buf(), report.stop().clone());
    match work.carry_out(report, standing, host) {
        Err(Error::Device(fault)) if falls_back => {
            let why = format!("the GPU failed: {fault}");
            host.say(&format!("note: on the CPU from here on: {why}"));
            let folder = OutputFolder::open_again(&path)?;
            let Some(saved) = checkpoint::find(&folder)? else { return Err(Error::Device(fault)) };
            let place = ResumePlace { backend: Some(BackendChoice::Cpu), why: Some(why), ..ResumePlace::default() };
            continue_in(folder, saved, place, host.manner_with(stop), host)
        }
        done => done,
    }
}

/// Where a run is to continue, if not where it was.
#[derive(Default)]
pub struct ResumePlace {
    /// The back end.
    pub backend: Option<BackendChoice>,
    /// A part of the name of the GPU adapter.
    pub adapter: Option<String>,
    /// Threads of the CPU back end.
    pub threads: Option<usize>,
    /// Why, if not because it was requested.
    pub why: Option<String>,
}

fn resume_in(
    folder: OutputFolder,
    saved: Option<Saved>,
    place: ResumePlace,
    host: &dyn Host,
) -> Result<Option<Completed>> {
    let Some(saved) = saved else {
        folder.tidy()?;
        host.say(&format!("note: the run in {} is finished: nothing is left to do", folder.path().display()));
        return Ok(None);
    };
    // Before a device is looked for, which takes time.
    let manner = host.manner()?;
    continue_in(folder, saved, place, manner, host).map(Some)
}

/// Continues the run in `folder` from a checkpoint.
fn continue_in(
    mut folder: OutputFolder,
    mut saved: Saved,
    mut place: ResumePlace,
    manner: Manner,
    host: &dyn Host,
) -> Result<Completed> {
    let path = folder.path().to_path_buf();
    if let Some(fault) = &saved.note {
        host.say(&format!("warning: {}: {fault}", path.display()));
    }
    let origin = &mut saved.head.origin;
    let base = PathBuf::from(&origin.base);
    let known = outlines::find(&folder, origin).unwrap_or_else(|fault| {
        host.say(&format!("warning: {}: {fault}", path.display()));
        Outlines::default()
    });
    if known.is_empty() && !origin.outlines.is_empty() {
        folder.make_absolute()?;
        check_base(&base)?;
    }
    let began = origin.platform.clone();
    let elsewhere = place.backend.is_some() || place.adapter.is_some();
    let (new_threads, why) = (place.threads.is_some(), place.why.take());
    let work = spec(&origin.spec, place)
        .and_then(|spec| Work::new_from(spec, &base, &known))
        .map_err(|error| origin.explain(error))?;
    let work = if why.is_some() { work.because("the GPU failed") } else { work };
    origin.check_outlines(&work.study)?;
    let mut here = work.platform();
    here.reason = why.unwrap_or_else(|| began.reason.clone());
    if !here.computes_like(&began) {
        if !elsewhere {
            return Err(Error::Request(format!(
                "the run began on {}; here it would continue on {}, where digits differ; add --backend {} to accept \
                 that",
                began.name(),
                here.name(),
                here.backend
            )));
        }
        origin.moves.push(format!("the run began on {} and continued on {}", began.name(), here.name()));
        origin.spec = work.study.spec().to_toml()?;
        origin.platform = here;
    } else if new_threads {
        (origin.platform.threads, origin.spec) = (here.threads, work.study.spec().to_toml()?);
    }
    let (report, standing) = RunReport::resume(folder, &work.study, saved, manner)?;
    host.say(&format!("resuming: {} of {} members are in the table", report.members(), work.study.member_count()));
    carry_out(work, report, standing, host)
}

/// The spec of the checkpoint, with the changes by this command line.
fn spec(text: &str, ResumePlace { backend, adapter, threads, .. }: ResumePlace) -> Result<Spec> {
    let mut spec = Spec::from_toml(text).map_err(|e| state_spec(&e))?;
    if backend.is_some() || adapter.is_some() {
        spec.backend = backend.unwrap_or(BackendChoice::Gpu);
        spec.adapter = adapter;
    }
    if threads.is_some() {
        spec.threads = threads;
    }
    Ok(spec)
}

fn state_spec(fault: &str) -> Error {
    Error::Request(format!("the spec in the state: {fault}"))
}

/// Checks that paths in the spec can be relative to `base`.
fn check_base(base: &Path) -> Result<()> {
    // Names in it are found only if it is a folder with search permission.
    base.join(".").metadata().map(drop).map_err(|e| {
        let base = base.display();
        Error::Request(format!("{base}: the run was begun in this folder, and its outline is named from there ({e})"))
    })
}
