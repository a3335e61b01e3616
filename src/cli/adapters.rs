//! `curvelax adapters`: what this machine offers, and which adapter `auto` takes and why.

use crate::error::{Error, Result};

/// List the GPU adapters, their features and limits, and which one `--backend auto` takes and why.
#[derive(clap::Args)]
pub struct AdaptersArgs {}

// HOOK(lead): print the listing.
pub fn adapters(AdaptersArgs {}: AdaptersArgs) -> Result<()> {
    Err(Error::Failed("`curvelax adapters` is not connected yet".into()))
}
