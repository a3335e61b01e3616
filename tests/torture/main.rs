//! Whatever happens to a run, its files end as if nothing had, or it says what was wrong.
//!
//! Within `cargo test` at a small scale; `tests/torture/run` takes the full one (TORTURE=full). Every test counts its cases,
//! and a table of all stands at the end. Times are random, from TORTURE_SEED, which is printed.
#![cfg_attr(not(target_os = "linux"), allow(dead_code, unused_imports))]

#[cfg(target_os = "linux")]
mod attacks;
#[cfg(target_os = "linux")]
mod calls;
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

/// Processes, signals and disks are asked for here as Linux knows them.
#[cfg(not(target_os = "linux"))]
fn main() {
    println!("torture: only on Linux");
}
