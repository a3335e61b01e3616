//! Everything a member leaves behind.

use serde::{Deserialize, Serialize};

use crate::{Features, Mollified, Outcome, Portrait, Rows};

/// Everything a member leaves behind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ended {
    /// Its row of the summary.
    pub outcome: Outcome,
    /// What was drawn for it, and its shape at the start.
    pub features: Features,
    /// Its excess at the times of [`grid`](crate::schedule::grid) that it reached.
    pub excess: Vec<f64>,
    /// Its rows of the series, and its snapshots.
    pub rows: Rows,
    /// Its nodes at both ends, if asked for.
    pub portrait: Option<Portrait>,
    /// How its corners were rounded off before the run.
    pub mollified: Mollified,
    /// Its threshold is below the rounding of the precision, so its relaxation time is unknown.
    pub unresolved: bool,
}
