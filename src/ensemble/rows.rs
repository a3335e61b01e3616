//! The rows of a member that has not left its run yet: in memory, and where its sink has put them.

use serde::{Deserialize, Serialize};

use super::{SeriesRow, Snapshot};

/// Where rows lie that a sink took: what it answers to [`Sink::spill`](super::Sink::spill).
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
    /// Where the sink has put the first of them; a sink that takes none has all of them below.
    pub spilled: Vec<Extent>,
    /// Rows of the series.
    pub series: Vec<SeriesRow>,
    /// Snapshots.
    pub snapshots: Vec<Snapshot>,
}

impl Rows {
    /// Bytes of those in memory.
    pub fn bytes(&self) -> usize {
        let points = self.snapshots.first().map_or(0, |first| first.x.len());
        bytes_of(self.series.capacity(), self.snapshots.len(), points)
    }
}

/// Bytes of so many rows of the series and snapshots, each of four numbers a node, of `points` nodes.
pub fn bytes_of(series: usize, snapshots: usize, points: usize) -> usize {
    series * size_of::<SeriesRow>() + snapshots * (size_of::<Snapshot>() + 4 * points * size_of::<f64>())
}
