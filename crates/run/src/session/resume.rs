//! An interrupted run continues where it stopped, and writes exactly the files it would have written.

use std::path::{Path, PathBuf};

use super::{host::Host, placed::PlacedStudy, run::Session};
use crate::report::Stop;
use curvelax_base::{
    error::{Error, Result},
    text::quoted,
};
use curvelax_ensemble::{Outlines, Spec, Study, request::spec::BackendChoice};
use curvelax_files::{
    OutputFolder, names, reader,
    state::{
        checkpoint::{self, CheckpointHead, Origin, Saved},
        outlines,
    },
};
use curvelax_study::placement::Platform;

/// A run that was begun.
pub struct Begun {
    folder: OutputFolder,
    /// Its checkpoint, unless it is complete.
    saved: Option<Saved>,
}

/// The run that was begun in the folder at `path`, if any.
///
/// # Errors
/// Those of [`resume()`](super::resume()).
pub fn begun(path: &Path) -> Result<Option<Begun>> {
    let there = |name: &&str| path.join(name).exists();
    match [names::STATE, names::STATE_OLD, names::RUN].iter().any(there) {
        true => Begun::open(path).map(Some),
        false => Ok(None),
    }
}

/// Where a run is to continue, if not where it was.
#[derive(Default)]
pub struct ResumePlace {
    /// The back end.
    pub backend: Option<BackendChoice>,
    /// A part of the name of the GPU adapter.
    pub adapter: Option<String>,
    /// Threads of the host and of the CPU back end.
    pub threads: Option<usize>,
    /// Why, if not because it was requested.
    pub why: Option<String>,
}

impl Begun {
    /// The run in the folder at `path`.
    ///
    /// # Errors
    /// [`Error::Request`] if there is none.
    pub(super) fn open(path: &Path) -> Result<Begun> {
        let folder = OutputFolder::open_again(path)?;
        let saved = checkpoint::find(&folder)?;
        Ok(Begun { folder, saved })
    }

    /// Checks that the run is that of `study`, and on the back end that was asked for.
    ///
    /// # Errors
    /// [`Error::Request`] with the first difference.
    pub(super) fn check_same(&self, study: &Study, asked: BackendChoice) -> Result<()> {
        let (path, spec) = (self.folder.path().display(), study.spec());
        let own = match &self.saved {
            Some(saved) => Spec::from_toml(&saved.head.origin.spec).map_err(|e| state_spec(&e))?,
            None => reader::provenance(self.folder.path())?.spec,
        };
        // Where it continues is checked separately, and the number of threads makes no difference.
        if let Some((key, here, there)) = spec.difference(&own, &["backend", "adapter", "threads"]) {
            return Err(Error::Request(format!(
                "--resume: the run in {path} has another spec: {key} is {there} there and {here} here; use another folder"
            )));
        }
        if let Some(Saved { head: CheckpointHead { origin, .. }, .. }) = &self.saved {
            // The outline of this name may be another one here.
            origin.check_outlines(study)?;
            let there = origin.platform.backend;
            if asked != BackendChoice::Auto && asked != there.into() {
                return Err(Error::Request(format!(
                    "--resume: the run in {path} is on the {there}; leave out --backend, or move it with curvelax resume \
                     {} --backend",
                    quoted(self.folder.path())
                )));
            }
        }
        Ok(())
    }

    /// The session that continues the run from its checkpoint, by the means to `stop` it that there are already, or by
    /// new ones of the host; `None` if it is finished.
    pub(super) fn resume(self, place: ResumePlace, stop: Option<Stop>, host: &dyn Host) -> Result<Option<Session>> {
        let Begun { mut folder, saved } = self;
        let Some(mut saved) = saved else {
            folder.tidy()?;
            host.say(&format!("note: the run in {} is finished: nothing is left to do", folder.path().display()));
            return Ok(None);
        };
        // Before a device is looked for, which takes time.
        let options = stop.map_or_else(|| host.options(), |stop| Ok(host.options_with(stop)))?;
        let path = folder.path().to_path_buf();
        let warn = |fault: &str| host.say(&format!("warning: {}: {fault}", path.display()));
        saved.note.iter().for_each(|fault| warn(fault));
        let origin = &mut saved.head.origin;
        let base = PathBuf::from(&origin.base);
        let known = outlines::find(&folder, origin).unwrap_or_else(|fault| {
            warn(&fault);
            Outlines::default()
        });
        if known.is_empty() && !origin.outlines.is_empty() {
            folder.make_absolute()?;
            check_base(&base)?;
        }
        let placed = spec(&origin.spec, &place)
            .and_then(|spec| PlacedStudy::of(spec, base, &known))
            .map_err(|error| origin.explain(error))?;
        let placed = match &place {
            ResumePlace { why: Some(_), .. } => placed.because("the GPU failed"),
            // The spec of a run names its back end even if the user did not.
            ResumePlace { backend: None, adapter: None, .. } => placed.because(&origin.platform.reason),
            _ => placed,
        };
        origin.check_outlines(&placed.study)?;
        settle(origin, &placed, place)?;
        Session::resume(placed, folder, saved, options, host).map(Some)
    }
}

/// Writes to the origin of a run where it continues.
///
/// # Errors
/// [`Error::Request`] if digits differ there, unless that was requested.
fn settle(origin: &mut Origin, placed: &PlacedStudy, place: ResumePlace) -> Result<()> {
    let ResumePlace { backend, adapter, threads, why } = place;
    let began = origin.platform.clone();
    let here = Platform { reason: why.unwrap_or_else(|| began.reason.clone()), ..placed.platform() };
    if !here.computes_like(&began) {
        if backend.is_none() && adapter.is_none() {
            return Err(Error::Request(format!(
                "the run began on {}; here it would continue on {}, where digits differ; add --backend {} to accept \
                 that",
                began.name(),
                here.name(),
                here.backend
            )));
        }
        origin.moves.push(format!("the run began on {} and continued on {}", began.name(), here.name()));
        origin.spec = placed.study.spec().to_toml()?;
        origin.platform = here;
    } else if threads.is_some() {
        (origin.platform.threads, origin.spec) = (here.threads, placed.study.spec().to_toml()?);
    }
    Ok(())
}

/// The spec of the checkpoint, with the changes by this command line.
fn spec(text: &str, ResumePlace { backend, adapter, threads, .. }: &ResumePlace) -> Result<Spec> {
    let mut spec = Spec::from_toml(text).map_err(|e| state_spec(&e))?;
    if backend.is_some() || adapter.is_some() {
        spec.backend = backend.unwrap_or(BackendChoice::Gpu);
        spec.adapter = adapter.clone();
    }
    if threads.is_some() {
        spec.threads = *threads;
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
