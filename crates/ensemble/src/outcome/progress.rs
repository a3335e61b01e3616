//! The progress of a run: what its members have left behind, and all that is needed to resume the others exactly.

use std::collections::BTreeMap;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{Features, Mollified, Outcome, Portrait, SeriesRow, Snapshot};
use curvelax_flow::scheme::member::{Counters, Report};

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

/// Where a sink has stored rows: the answer of [`Sink::spill`](crate::Sink::spill).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Extent {
    /// First byte.
    pub at: u64,
    /// Bytes.
    pub length: u64,
    /// Their CRC-32C.
    pub crc: u32,
}

/// The rows of one member, in time order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rows {
    /// Where the sink has put the first of them; empty if the sink accepts none.
    pub spilled: Vec<Extent>,
    /// Rows of the series.
    pub series: Vec<SeriesRow>,
    /// Snapshots.
    pub snapshots: Vec<Snapshot>,
}

impl Rows {
    /// Bytes of the rows in memory.
    pub fn bytes(&self) -> usize {
        let points = self.snapshots.first().map_or(0, |first| first.x.len());
        bytes_of(self.series.capacity(), self.snapshots.len(), points)
    }
}

/// Bytes of `series` rows of the series and `snapshots` snapshots of `points` nodes, at four numbers a node.
pub fn bytes_of(series: usize, snapshots: usize, points: usize) -> usize {
    series * size_of::<SeriesRow>() + snapshots * (size_of::<Snapshot>() + 4 * points * size_of::<f64>())
}

/// The members of a run by rank, from 0: the order in which they are handed to the sink.
///
/// Members of rank below `next` have been handed over. A member listed nowhere is at its start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunProgress {
    /// The first member that has not been handed to the sink.
    pub next: u64,
    /// Members that ended before one of lower rank.
    pub early: BTreeMap<u64, Ended>,
    /// Members in progress; `None` if they cannot be read back, so that those saved last remain valid.
    pub resident: Option<BTreeMap<u64, Paused>>,
}

/// A member in progress, as it was between two dispatches.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Paused {
    /// Its counters in the back end.
    pub counters: Counters,
    /// Its report there.
    pub report: Report<f64>,
    /// All fields of its [`State`](curvelax_flow::scheme::State) there, one after another: for each node
    /// [`STATE_FIELDS`](curvelax_flow::scheme::state::STATE_FIELDS) numbers.
    pub state: Vec<f64>,
    /// Sweeps so far, on curvature and on position systems.
    pub sweeps: [u64; 2],
    /// How many of its output times it has reached.
    pub served: u64,
    /// Its rows so far.
    pub rows: Rows,
    /// Its portrait so far, with times.
    pub frames: Vec<(f64, Vec<DVec2>)>,
    /// When it was first found to cross itself.
    pub crossed: Option<f64>,
    /// The times of its events so far, in the order of the spec.
    pub events: Vec<Option<f64>>,
    /// Travel at which it is next checked for crossings.
    pub look_at: f64,
    /// Time at which steps end because a driven member might vanish in them.
    pub until: f64,
    /// Times and energies so far, if these decide on its relaxation.
    pub energies: Vec<[f64; 2]>,
}
