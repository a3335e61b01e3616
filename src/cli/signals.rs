//! Ctrl-C, SIGTERM, SIGHUP and `--max-time` ask a run to stop; one that does not answer is ended.

use std::{thread, time::Duration};

use super::note;
use crate::report::{Cause, Stop};

/// A run that was asked to stop has so long to come to its end.
const PATIENCE: Duration = Duration::from_secs(4);
/// Whoever reads what is said has so long to take it.
const LAST_WORD: Duration = Duration::from_millis(100);

/// Passes on to `stop` whatever asks this process to end, from now on; and the end of `most`.
pub fn watch(stop: &Stop, most: Option<Duration>) {
    system::watch(stop);
    if let Some(most) = most {
        let stop = stop.clone();
        thread::spawn(move || {
            thread::sleep(most);
            ask(&stop, Cause::MaxTime);
        });
    }
}

/// Asks once, then ends the process; whatever is running there, its state is on disk.
fn ask(stop: &Stop, cause: Cause) {
    stop.ask(cause);
    let stop = stop.clone();
    thread::spawn(move || {
        thread::sleep(PATIENCE);
        leave(&stop);
    });
}

fn leave(stop: &Stop) {
    if let Some((cause, _)) = stop.asked() {
        let error = cause.error(" at once; curvelax resume goes on from the last state");
        let line = format!("error: {error}");
        // Not here: the run may be stuck in a line of its own that nobody reads.
        thread::spawn(move || note(&line));
        thread::sleep(LAST_WORD);
        system::exit(error.exit_code());
    }
}

#[cfg(unix)]
mod system {
    use std::{
        fs,
        sync::{Arc, atomic::AtomicBool},
        time::Instant,
    };

    use signal_hook::{
        consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ},
        flag,
        iterator::Signals,
        low_level,
    };

    use super::*;

    /// A run that is asked to stop twice has so long to keep what is finished.
    const SHORT_PATIENCE: Duration = Duration::from_millis(1000);

    pub fn watch(stop: &Stop) {
        // So that a file that grows too large is an error as any other.
        let _ = flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
        // Where signals cannot be had the process ends as it would without them.
        let ignored = ignored();
        let heard = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
        let Ok(mut signals) = Signals::new(heard) else { return };
        let stop = stop.clone();
        thread::spawn(move || {
            for signal in signals.forever() {
                match stop.asked() {
                    Some(_) => leave_soon(&stop),
                    None if signal == SIGINT => ask(&stop, Cause::Interrupt),
                    None if signal == SIGHUP => ask(&stop, Cause::Hangup),
                    None => ask(&stop, Cause::Terminate),
                }
            }
        });
    }

    /// Those that whoever started the process wants it to ignore, such as `nohup`: bit i - 1 for the signal i. Only Linux tells.
    fn ignored() -> u64 {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
    }

    /// Ends the process as soon as what is finished is kept.
    fn leave_soon(stop: &Stop) {
        let asked = Instant::now();
        while !stop.is_kept() && asked.elapsed() < SHORT_PATIENCE {
            thread::sleep(Duration::from_millis(5));
        }
        leave(stop);
    }

    /// Without what the C library does at the end, which drivers take ill while they are at work.
    pub fn exit(code: u8) {
        low_level::exit(code.into());
    }
}

#[cfg(not(unix))]
mod system {
    use super::*;

    /// The system ends the process; a run loses what is younger than its state.
    pub fn watch(_: &Stop) {}

    pub fn exit(code: u8) {
        std::process::exit(code.into());
    }
}
