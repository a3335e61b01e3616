//! Ctrl-C, SIGTERM, SIGHUP and `--max-time` ask a run to stop; a run that does not respond is ended.
//!
//! Two threads do all of it. Both are started before the run, because the system may have no thread left when one is
//! needed. One receives the signals and prints the last message; the other watches the time and ends the process.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    thread,
    time::{Duration, Instant},
};

pub use system::{exit, outlive_full_files};

use super::note;
use crate::{
    error::Result,
    report::{Cause, Stop},
};
use curvelax_base::threads;

/// Time for a run to end after it was asked to stop.
const PATIENCE: Duration = Duration::from_secs(4);
/// Time for a run to save finished work after it was asked to stop twice.
const SHORT_PATIENCE: Duration = Duration::from_millis(1000);
/// Time for the reader of stderr to accept the last message.
const LAST_WORD: Duration = Duration::from_millis(100);

/// Receives signals and forwards those that ask for the end, until closed.
type SignalListener = Box<dyn FnOnce(&mut dyn FnMut(Cause)) + Send>;
/// Ends the reception.
type ListenerHandle = Box<dyn FnOnce() + Send>;

/// From now on, forwards requests to end this process to `stop`; also when the time `most` is over.
///
/// # Errors
/// [`Error::Failed`](crate::Error::Failed) if the system has no threads or no pipe for it.
pub fn watch(stop: &Stop, most: Option<Duration>) -> Result<()> {
    let (forward, close) = system::listener()?;
    let (ask, asked) = channel();
    let (to_stop, at_end) = (stop.clone(), stop.clone());
    threads::start("clock", move || clock(&at_end, &asked, most, close))?;
    threads::start("signals", move || {
        forward(&mut |cause| {
            to_stop.ask(cause);
            // The clock is gone if the process is ending.
            let _ = ask.send(());
        });
        if let Some(error) = last_word(&to_stop) {
            // The clock does not wait for the message, as no one may read it.
            note(&format!("error: {error}"));
        }
    })?;
    Ok(())
}

/// The error of a process that is ended, if it was asked to stop.
fn last_word(stop: &Stop) -> Option<crate::Error> {
    let (cause, _) = stop.asked()?;
    Some(cause.error(match stop.has_begun() {
        true => " at once; curvelax resume continues from the last checkpoint",
        false => " at once: nothing is saved",
    }))
}

/// Waits until the run is `asked` to stop or `most` is over, and then for its end. When time is up, whatever is still
/// running is ended, after `close` ended the reception of signals: a checkpoint is on disk.
fn clock(stop: &Stop, asked: &Receiver<()>, most: Option<Duration>, close: impl FnOnce()) {
    match most.map_or_else(|| asked.recv().map_err(Into::into), |most| asked.recv_timeout(most)) {
        Ok(()) => {}
        Err(RecvTimeoutError::Timeout) => stop.ask(Cause::MaxTime),
        Err(RecvTimeoutError::Disconnected) => return,
    }
    match asked.recv_timeout(PATIENCE) {
        Ok(()) => wait_until_kept(stop),
        Err(RecvTimeoutError::Timeout) => {}
        Err(RecvTimeoutError::Disconnected) => return,
    }
    if let Some(error) = last_word(stop) {
        close();
        thread::sleep(LAST_WORD);
        system::exit(error.exit_code());
    }
}

fn wait_until_kept(stop: &Stop) {
    let asked = Instant::now();
    while !stop.is_kept() && asked.elapsed() < SHORT_PATIENCE {
        thread::sleep(Duration::from_millis(5));
    }
}

#[cfg(unix)]
mod system {
    use std::{
        fs,
        sync::{Arc, atomic::AtomicBool},
    };

    use signal_hook::{
        consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ},
        flag,
        iterator::Signals,
        low_level,
    };

    use super::*;
    use crate::Error;

    pub fn listener() -> Result<(SignalListener, ListenerHandle)> {
        let ignored = ignored();
        let received = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
        let mut signals = Signals::new(received).map_err(|e| {
            Error::Failed(format!(
                "cannot receive signals: {e}; raise the limit of open files (ulimit -n), or close some"
            ))
        })?;
        let closing = signals.handle();
        let forward = move |ask: &mut dyn FnMut(Cause)| {
            for signal in signals.forever() {
                ask(match signal {
                    SIGINT => Cause::Interrupt,
                    SIGHUP => Cause::Hangup,
                    _ => Cause::Terminate,
                });
            }
        };
        Ok((Box::new(forward), Box::new(move || closing.close())))
    }

    /// The signals that the parent process wants ignored, as with `nohup`: bit i - 1 for signal i. Available on Linux
    /// only.
    fn ignored() -> u64 {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
    }

    /// Makes a file that grows too large an ordinary error.
    pub fn outlive_full_files() {
        let _ = flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
    }

    /// Exits without the C library's clean-up, which active drivers do not tolerate.
    pub fn exit(code: u8) {
        low_level::exit(code.into());
    }
}

/// The system ends the process; a run loses the work since its last checkpoint.
#[cfg(not(unix))]
mod system {
    use super::*;

    pub fn listener() -> Result<(SignalListener, ListenerHandle)> {
        let (closing, closed) = channel::<()>();
        let forward = move |_: &mut dyn FnMut(Cause)| {
            let _ = closed.recv();
        };
        let close = move || {
            let _ = closing.send(());
        };
        Ok((Box::new(forward), Box::new(close)))
    }

    pub fn outlive_full_files() {}

    pub fn exit(code: u8) {
        std::process::exit(code.into());
    }
}
