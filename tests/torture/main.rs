//! Whatever happens to a run, its final files are as if nothing had happened, or it reports what was wrong.
//!
//! `cargo test` runs these tests at a small scale, `tests/torture/run` at full scale (TORTURE=full). Every test counts
//! its cases, and a table of all is printed at the end. Times are random, from TORTURE_SEED, which is printed.
#![cfg_attr(not(target_os = "linux"), allow(dead_code, unused_imports))]

#[cfg(target_os = "linux")]
mod attacks;
#[cfg(target_os = "linux")]
mod calls;
#[cfg(target_os = "linux")]
#[path = "../common/command.rs"]
#[allow(dead_code)] // the waits, which other tests use
mod command;
#[cfg(target_os = "linux")]
mod controls;
#[cfg(target_os = "linux")]
mod differential;
#[cfg(target_os = "linux")]
mod folder;
#[cfg(target_os = "linux")]
mod hostile;
#[cfg(target_os = "linux")]
mod kills;
#[cfg(target_os = "linux")]
mod order;
#[cfg(target_os = "linux")]
mod program;
#[cfg(target_os = "linux")]
mod races;
#[cfg(target_os = "linux")]
mod random;
#[cfg(target_os = "linux")]
mod signals;
#[cfg(target_os = "linux")]
mod sizes;
#[cfg(target_os = "linux")]
mod soak;
#[cfg(target_os = "linux")]
mod space;
#[cfg(target_os = "linux")]
mod state;
#[cfg(target_os = "linux")]
mod study;
#[cfg(target_os = "linux")]
mod suite;
#[cfg(target_os = "linux")]
mod surroundings;
#[cfg(target_os = "linux")]
mod threads;

#[cfg(target_os = "linux")]
use suite::{Found, Outcome};

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    suite::main()
}

/// Processes, signals and disks are used here as on Linux.
#[cfg(not(target_os = "linux"))]
fn main() {
    println!("torture: only on Linux");
}
