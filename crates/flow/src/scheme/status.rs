//! How a member ends: the codes that the kernel and its twin write to [`Counters`](super::member::Counters).
//!
//! A step decides on failure in `evolve.rs`. The host decides on members that end as they start, creep, vanish, or
//! reach their final time, in `crates/ensemble/src/trajectory`.

use serde::{Deserialize, Serialize};

/// How a member ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Status {
    /// Its excess reached the threshold.
    Relaxed = 1,
    /// The final time came first, so far.
    #[default]
    Unfinished = 2,
    /// Curvature times spacing became too large, an edge vanished, the metric was lost, or the turning number changed;
    /// or no adaptive step was short enough for the tolerance.
    Singular = 3,
    /// A value was not finite.
    Nonfinite = 4,
    /// The sweep cap was reached, or the sweeps diverged; or adaptive steps stayed so short that the run would never
    /// end.
    Stalled = 5,
    /// A driving force made it shrink to a point.
    Vanished = 6,
}

impl Status {
    /// All statuses, in the order in which tables list them.
    pub const ALL: [Status; 6] =
        [Status::Relaxed, Status::Unfinished, Status::Singular, Status::Nonfinite, Status::Stalled, Status::Vanished];

    /// Returns whether the member ended early without having relaxed.
    pub fn is_failure(self) -> bool {
        matches!(self, Status::Singular | Status::Nonfinite | Status::Stalled)
    }

    /// Returns the word used in `summary.csv`.
    pub fn name(self) -> &'static str {
        ["relaxed", "unfinished", "singular", "nonfinite", "stalled", "vanished"][self as usize - 1]
    }
}
