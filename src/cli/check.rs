//! `curvelax check`: does the GPU compute what the CPU computes, on this machine?

use crate::error::{Error, Result};

/// Compare the GPU with the CPU on this machine's adapters, as a table; exit code 1 on failure.
#[derive(clap::Args)]
pub struct CheckArgs {}

// HOOK(lead): run the conformance cases and print their table.
pub fn check(CheckArgs {}: CheckArgs) -> Result<()> {
    Err(Error::Failed("`curvelax check` is not connected yet".into()))
}
