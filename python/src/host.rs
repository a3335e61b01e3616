//! The Python side of a run: its progress goes to a function, and Ctrl-C stops it.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use curvelax::{
    ensemble::Snapshot,
    report::{Cause, Progress, ReportOptions, ResultFormat, Stop},
    session::Host,
};
use pyo3::prelude::*;

use crate::seen::SnapshotBuffer;

/// Time between two looks at Python: its lock is not free.
const PERIOD: Duration = Duration::from_millis(50);
/// A run that is asked to stop has this time to reach a point where all its work is saved: no caller waits longer than
/// a second in a notebook.
const PATIENCE: Duration = Duration::from_millis(600);
/// Time between checkpoints.
const EVERY: Duration = Duration::from_secs(5);

/// The functions that are called during a run.
pub struct Notebook {
    shared: Arc<Shared>,
    /// When Python was last asked whether to continue.
    asked: Mutex<Option<Instant>>,
}

struct Shared {
    progress: Py<PyAny>,
    say: Py<PyAny>,
    stop: Stop,
    seen: Mutex<SnapshotBuffer>,
    /// What was raised in Python during the run.
    raised: Mutex<Option<PyErr>>,
}

/// A poisoned lock holds nothing worse than a half-told story.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Calls into Python; what is raised there stops the run.
    fn ask(&self, call: impl FnOnce(Python<'_>) -> PyResult<()>) {
        let told = Python::attach(|py| py.check_signals().and_then(|()| call(py)));
        if let Err(raised) = told {
            lock(&self.raised).get_or_insert(raised);
            self.stop.ask(Cause::Interrupt);
        }
    }
}

impl Notebook {
    /// Tells `progress` and `say`.
    pub fn new(progress: Py<PyAny>, say: Py<PyAny>) -> Notebook {
        let shared = Shared { progress, say, stop: Stop::default(), seen: Mutex::default(), raised: Mutex::default() };
        Notebook { shared: shared.into(), asked: Mutex::default() }
    }

    /// Moves out what was raised in Python.
    pub fn raised(&self) -> Option<PyErr> {
        lock(&self.shared.raised).take()
    }

    /// Raises what was raised in Python while the run ended, and Ctrl-C.
    ///
    /// # Errors
    /// Those.
    pub fn check_calls(&self, py: Python<'_>) -> PyResult<()> {
        self.raised().map_or_else(|| py.check_signals(), Err)
    }

    /// Moves out the snapshots.
    pub fn seen(&self) -> SnapshotBuffer {
        std::mem::take(&mut *lock(&self.shared.seen))
    }
}

impl Host for Notebook {
    fn say(&self, line: &str) {
        self.shared.ask(|py| self.shared.say.call1(py, (line,)).map(drop));
    }

    fn form(&self) -> ResultFormat {
        ResultFormat::Overview
    }

    fn options(&self) -> curvelax::Result<ReportOptions> {
        Ok(self.options_with(self.shared.stop.clone()))
    }

    fn options_with(&self, stop: Stop) -> ReportOptions {
        let (shared, seeing, mut last) = (self.shared.clone(), self.shared.clone(), None::<Instant>);
        let told = move |done: u64, total: u64, share: f64| {
            if last.is_none_or(|last| last.elapsed() >= PERIOD) {
                last = Some(Instant::now());
                shared.ask(|py| shared.progress.call1(py, (done, total, share)).map(drop));
            }
        };
        ReportOptions {
            since: Instant::now(),
            progress: Progress::Callback(Box::new(told)),
            every: EVERY,
            stop,
            patience: PATIENCE,
            see: Box::new(move |snapshots: &[Snapshot]| lock(&seeing.seen).add(snapshots)),
        }
    }

    fn may_continue(&self) -> curvelax::Result<()> {
        let is_due = lock(&self.asked).is_none_or(|last| last.elapsed() >= PERIOD);
        if is_due {
            *lock(&self.asked) = Some(Instant::now());
            self.shared.ask(|_| Ok(()));
        }
        match self.shared.stop.asked() {
            Some((cause, _)) => Err(cause.error(" before the run began: nothing is saved")),
            None => Ok(()),
        }
    }
}
