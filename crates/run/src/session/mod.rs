//! From a spec to a finished folder of results: what the command line and the Python package share.
//!
//! The way of a run: a request is a [`Spec`](curvelax_ensemble::Spec); a [`PlacedStudy`] is the checked plan, in which
//! rounds have made the choices that it leaves to them, with a back end for each stage; a session carries it out and
//! reports. [`begin`] starts a run, [`resume()`] continues one, and both end here: a run that loses a GPU that was not
//! requested is resumed on the CPU.

mod host;
mod placed;
mod resume;
mod run;

use std::path::Path;

pub use host::Host;
pub use placed::PlacedStudy;
pub use resume::{Begun, ResumePlace, begun};
pub use run::Completed;

use crate::report::ReportOptions;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Study, request::spec::BackendChoice};
use curvelax_files::{Existing, OutputFolder};
use run::Session;

/// Runs `placed` in the folder at `out`.
///
/// # Errors
/// Those of the folder, the device and the run.
pub fn begin(
    placed: PlacedStudy,
    out: &Path,
    existing: Existing,
    options: ReportOptions,
    host: &dyn Host,
) -> Result<Completed> {
    let folder = OutputFolder::open(out, existing)?;
    complete(Session::begin(placed, folder, options, host)?, host)
}

/// Resumes the run in the folder at `path`. `None` means that it is finished.
///
/// # Errors
/// [`Error::Request`] if there is no run, or if it would continue elsewhere without being asked to; and those of the
/// run.
pub fn resume(path: &Path, place: ResumePlace, host: &dyn Host) -> Result<Option<Completed>> {
    let resumed = Begun::open(path)?.resume(place, None, host)?;
    resumed.map(|session| complete(session, host)).transpose()
}

/// Resumes a run that was [begun], if it has the same spec. `None` means that it is finished.
///
/// # Errors
/// [`Error::Request`] for a run of another spec, and those of [`resume()`].
pub fn resume_like(begun: Begun, study: &Study, asked: BackendChoice, host: &dyn Host) -> Result<Option<Completed>> {
    begun.check_same(study, asked)?;
    let place = ResumePlace { threads: study.spec().threads, ..ResumePlace::default() };
    begun.resume(place, None, host)?.map(|session| complete(session, host)).transpose()
}

/// Carries out `session`. If a GPU fails that `--backend auto` chose, the run continues on the CPU from its last
/// checkpoint, as by `resume --backend cpu`.
fn complete(session: Session, host: &dyn Host) -> Result<Completed> {
    let Session { placed, report, .. } = &session;
    let (falls_back, path, stop) =
        (placed.may_fall_back(), report.folder.path().to_path_buf(), report.options.stop.clone());
    match session.carry_out(host) {
        Err(Error::Device(fault)) if falls_back => {
            let why = format!("the GPU failed: {fault}");
            host.say(&format!("note: on the CPU from here on: {why}"));
            let place = ResumePlace { backend: Some(BackendChoice::Cpu), why: Some(why), ..ResumePlace::default() };
            match Begun::open(&path)?.resume(place, Some(stop), host)? {
                Some(session) => session.carry_out(host),
                None => Err(Error::Device(fault)),
            }
        }
        done => done,
    }
}
