//! What a run needs to resume, and a merge from a shard: binary, sealed, and refused by a program of another layout.

pub mod checkpoint;
pub mod envelope;
pub mod fingerprint;
pub mod outlines;
pub mod shard;
