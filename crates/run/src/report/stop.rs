//! Asks a run to stop, from another thread.

use std::{
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
    time::Instant,
};

use curvelax_base::error::Error;

/// Why a run is to stop early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Ctrl-C.
    Interrupt,
    /// SIGTERM: the machine, or a scheduler, needs the resources.
    Terminate,
    /// SIGHUP: its terminal is closed.
    Hangup,
    /// `--max-time`.
    MaxTime,
}

impl Cause {
    /// The error with which the run ends; `so_far` says what has been done.
    pub fn error(self, so_far: &str) -> Error {
        let (kind, name): (fn(String) -> Error, _) = match self {
            Cause::Interrupt => (Error::Interrupted, "Ctrl-C"),
            Cause::Terminate => (Error::Stopped, "SIGTERM"),
            Cause::Hangup => (Error::Stopped, "SIGHUP"),
            Cause::MaxTime => (Error::Stopped, "--max-time"),
        };
        kind(format!("stopped by {name}{so_far}"))
    }
}

/// Shared between a run and those who may stop it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    asked: OnceLock<(Cause, Instant)>,
    begun: AtomicBool,
    kept: AtomicBool,
}

impl Stop {
    /// Asks the run to stop; the first cause counts.
    pub fn ask(&self, cause: Cause) {
        self.0.asked.get_or_init(|| (cause, Instant::now()));
    }

    /// Why and when it was asked.
    pub fn asked(&self) -> Option<(Cause, Instant)> {
        self.0.asked.get().copied()
    }

    /// Whether there is a run that can be resumed; before it, nothing is saved.
    pub fn has_begun(&self) -> bool {
        self.0.begun.load(Ordering::Acquire)
    }

    /// Records that a run has begun.
    pub(super) fn set_begun(&self) {
        self.0.begun.store(true, Ordering::Release);
    }

    /// Whether all results finished when the run was asked to stop are saved.
    pub fn is_kept(&self) -> bool {
        self.0.kept.load(Ordering::Acquire)
    }

    /// Records that finished results are saved.
    pub(super) fn set_kept(&self) {
        if self.asked().is_some() {
            self.0.kept.store(true, Ordering::Release);
        }
    }
}
