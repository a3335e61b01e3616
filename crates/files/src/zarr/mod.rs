//! `snapshots.zarr`: the snapshots as arrays x, y, k, r of member × time × node, in Zarr's format 3.
//!
//! An array is a folder with a `zarr.json` and raw little-endian chunks `c.I.J.K`. A chunk is written as soon as the
//! members that fill it have ended, so memory does not grow with the ensemble. Snapshots after the end of a member are
//! NaN. Equal runs give equal bytes.
//!
//! The format: <https://zarr-specs.readthedocs.io/en/latest/v3/core/>. Metadata is consolidated as in zarr-python;
//! dimension names, units and flags follow xarray and the CF conventions.

mod array;
mod chunks;
mod layout;
mod mark;
mod reading;
mod store;
#[cfg(test)]
mod tests;

pub use layout::{attributes, bytes_held, times};
pub use mark::StoreMark;
pub use reading::StoredMembers;
pub use store::SnapshotStore;
