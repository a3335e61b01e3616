//! `snapshots.zarr`: the snapshots as arrays x, y, k, r of member × time × node, in Zarr's format 3.
//!
//! An array is a folder with a `zarr.json` and raw little-endian chunks `c.I.J.K`, which are written as soon as the
//! members that fill them have ended: what is in memory does not grow with the ensemble. A snapshot that a member did not
//! live to see is NaN. Equal runs give equal bytes.
//!
//! The format: <https://zarr-specs.readthedocs.io/en/latest/v3/core/>. Metadata is consolidated as zarr-python does it,
//! and dimension names, units and flags are those that xarray and the CF conventions know.

mod array;
mod chunks;
mod layout;
mod mark;
mod reading;
mod store;
#[cfg(test)]
mod tests;

pub use mark::StoreMark;
pub use reading::StoredMembers;
pub use store::SnapshotStore;
