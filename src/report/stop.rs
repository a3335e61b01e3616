//! A run is asked to stop, from another thread.

use std::{
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
    time::Instant,
};

use crate::error::Error;

/// Why a run is to stop before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Ctrl-C.
    Interrupt,
    /// SIGTERM: the machine, or a scheduler, takes its place back.
    Terminate,
    /// SIGHUP: its terminal is gone.
    Hangup,
    /// `--max-time`.
    MaxTime,
}

impl Cause {
    /// The error that a run ends with; `so_far` says what is done.
    pub fn error(self, so_far: &str) -> Error {
        let message = format!("stopped by {}{so_far}", self.name());
        match self {
            Cause::Interrupt => Error::Interrupted(message),
            Cause::Terminate | Cause::Hangup | Cause::MaxTime => Error::Stopped(message),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Cause::Interrupt => "Ctrl-C",
            Cause::Terminate => "SIGTERM",
            Cause::Hangup => "SIGHUP",
            Cause::MaxTime => "--max-time",
        }
    }
}

/// Shared between a run and whoever may stop it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    asked: OnceLock<(Cause, Instant)>,
    kept: AtomicBool,
}

impl Stop {
    /// Asks the run to stop; the first cause counts.
    pub fn ask(&self, cause: Cause) {
        self.0.asked.get_or_init(|| (cause, Instant::now()));
    }

    /// Why and when it was asked to.
    pub fn asked(&self) -> Option<(Cause, Instant)> {
        self.0.asked.get().copied()
    }

    /// Whether nothing that was finished when the run was asked to stop would be lost if its process ended now.
    pub fn is_kept(&self) -> bool {
        self.0.kept.load(Ordering::Acquire)
    }

    /// Says that what is finished is kept.
    pub(super) fn set_kept(&self) {
        if self.asked().is_some() {
            self.0.kept.store(true, Ordering::Release);
        }
    }
}
