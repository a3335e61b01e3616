//! The compiled half of the Python package `curvelax`: runs, without the interpreter's lock, and what is known of a
//! finished run. The other half, `curvelax/*.py`, makes frames and exceptions of it.

mod finished;
mod host;
mod keys;
mod seen;

use std::sync::OnceLock;

use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*};

/// Raises `error` as the exception of `curvelax._errors` for its exit code; what was `raised` in Python meanwhile goes
/// first.
fn raise(py: Python<'_>, error: curvelax::Error, raised: Option<PyErr>) -> PyErr {
    let of_code = |name: &str| -> PyResult<PyErr> {
        let class = py.import("curvelax._errors")?.getattr(name)?;
        let words = py.import("curvelax._words")?.call_method1("in_python", (error.to_string(),))?;
        Ok(PyErr::from_value(class.call1((words,))?))
    };
    let name = match error {
        curvelax::Error::Request(_) => "RequestError",
        curvelax::Error::Interrupted(_) => "Interrupted",
        _ => "RunError",
    };
    match raised {
        Some(raised) if !raised.is_instance_of::<PyKeyboardInterrupt>(py) => raised,
        _ => of_code(name).unwrap_or_else(|failed| failed),
    }
}

/// Refuses a process that was forked from one in which curvelax has worked: the threads of a process are not forked,
/// and would be waited for without end.
///
/// # Errors
/// `RequestError`.
fn unforked(py: Python<'_>) -> PyResult<()> {
    static OWN: OnceLock<u32> = OnceLock::new();
    let here = std::process::id();
    if *OWN.get_or_init(|| here) == here {
        return Ok(());
    }
    let problem = "this process was forked from one in which curvelax has run, and has none of its threads; start \
                   processes by spawn or forkserver, such as multiprocessing.get_context(\"spawn\")";
    Err(raise(py, curvelax::Error::Request(problem.into()), None))
}

#[pymodule]
mod _curvelax {
    use std::{
        ffi::OsString,
        path::{Path, PathBuf},
    };

    use curvelax::{
        files::{Existing, OutputFolder, names},
        session::{self, Completed, Host, PlacedStudy, ResumePlace},
    };
    use pyo3::{
        prelude::*,
        types::{PyAny, PyDict},
    };

    use super::{host::Notebook, keys::Keys, raise, unforked};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }

    /// Runs the program with `arguments`, the first of which is its name; returns the exit code.
    #[pyfunction]
    fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
        py.detach(|| curvelax::cli::main(arguments))
    }

    /// How a folder that exists is treated, by name.
    fn treatment(existing: &str) -> Existing {
        match existing {
            "filled" => Existing::Filled,
            existing => Existing::from(existing == "replaced"),
        }
    }

    /// Checks that a run may write into the folder `out`, which is `refused`, `filled` or `replaced` if it exists.
    #[pyfunction]
    fn check_place(py: Python<'_>, out: PathBuf, existing: &str) -> PyResult<()> {
        OutputFolder::check_place(&out, treatment(existing)).map_err(|error| raise(py, error, None))
    }

    /// Runs the file `spec`, or the defaults, with `keys` instead of its own in the folder `out`, and returns the
    /// overview and the snapshots.
    ///
    /// `existing` is as in `check_place`. `progress` is called with the runs of members that have ended, all runs and
    /// the share of the work done; `say` with notes and warnings.
    #[pyfunction]
    fn run(
        py: Python<'_>,
        spec: Option<PathBuf>,
        keys: &Bound<'_, PyDict>,
        out: PathBuf,
        existing: &str,
        progress: Py<PyAny>,
        say: Py<PyAny>,
    ) -> PyResult<(String, SnapshotBuffer)> {
        unforked(py)?;
        let keys = Keys::read(spec.as_deref(), keys)?;
        let existing = treatment(existing);
        let host = Notebook::new(progress, say);
        let done = py.detach(|| {
            let spec = keys.spec()?;
            let options = host.options()?;
            OutputFolder::check_place(&out, existing)?;
            let placed = PlacedStudy::plan(spec, Some(&options), &host)?;
            placed.study.note().into_iter().for_each(|note| host.say(&format!("note: {note}")));
            session::begin(placed, &out, existing, options, &host)
        });
        let completed = done.map_err(|error| raise(py, error, host.raised()))?;
        tell_verdict(&host, &completed, &out);
        host.check_calls(py)?;
        Ok((completed.text, host.seen()))
    }

    /// Warns if a run does not hold what was asked for, where the program has exit code 3: its results are there to
    /// look at.
    fn tell_verdict(host: &Notebook, completed: &Completed, out: &Path) {
        if let Err(error) = completed.verdict.check(false, &out.join(names::SUMMARY)) {
            host.say(&format!("warning: {error}"));
        }
    }

    /// Resumes the run in the folder `out`. Returns the overview, or `None` if the run is finished.
    #[pyfunction]
    fn resume(py: Python<'_>, out: PathBuf, progress: Py<PyAny>, say: Py<PyAny>) -> PyResult<Option<String>> {
        unforked(py)?;
        let host = Notebook::new(progress, say);
        let done = py.detach(|| session::resume(&out, ResumePlace::default(), &host));
        let completed = done.map_err(|error| raise(py, error, host.raised()))?;
        completed.iter().for_each(|completed| tell_verdict(&host, completed, &out));
        host.check_calls(py)?;
        Ok(completed.map(|completed| completed.text))
    }

    #[pymodule_export]
    use super::finished::FinishedRun;
    #[pymodule_export]
    use super::seen::SnapshotBuffer;
}
