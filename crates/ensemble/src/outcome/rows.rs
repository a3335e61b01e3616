//! The rows of a member that is still running: in memory, and where its sink has put them.

use serde::{Deserialize, Serialize};

use crate::{SeriesRow, Snapshot};

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
