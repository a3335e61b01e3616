//! What a run takes of memory and disk space, from the sizes of its rows and of what is resident.

use crate::report::gallery::MAX_PANELS;
use curvelax_ensemble::{
    Cell, Portrait,
    request::spec::{Store, Tables},
    simulate::{MAX_HELD, states_at_once},
};
use curvelax_flow::scheme::{member, state::STATE_FIELDS};
use curvelax_study::results::{
    explained::{CONSIDERED, DRAWN, FeaturedMember, MIN_MEMBERS, PICTURED, TIMES},
    tally::Rate,
};

/// Memory of the idle program, in bytes.
const PROGRAM_BYTES: u64 = 10_000_000;
/// Bytes of rows that show in the peak of a pilot.
pub const MANY_ROWS: u64 = 4_000_000;
/// Numbers per node of a resident member: its state on the back end, and its initial nodes on the host.
const POOL_NUMBERS: usize = STATE_FIELDS + 4;
/// The same while a checkpoint is saved: the paused member, and its bytes.
const KEPT_NUMBERS: usize = 2 * STATE_FIELDS;
/// Bytes per node that is drawn of the page and its pictures: the digits of the portraits, twice, and of the gallery,
/// three times. 26 kB a node were measured in all at 100 to 600 nodes, of which [`PORTRAIT_COPIES`] are 19.
const PAGE_BYTES: usize = 7_000;
/// Copies of the nodes of the members drawn.
const PORTRAIT_COPIES: usize = 3;
/// Copies of the numbers of the members whose times are explained. Measured.
const EXPLAINED_COPIES: f64 = 2.0;
/// Additional bytes if rows go to disk before their members end: rows are written and read again. Measured.
const SPILL_BYTES: u64 = 6_000_000;

/// Bytes of a row of a table, measured: floats have 17 digits. A row of the snapshots is a node.
const SUMMARY_ROW: f64 = 341.0;
const RATES_ROW: f64 = 80.0;
pub const EVENT_ROW: f64 = 38.0;
pub const LEVEL_ROW: f64 = 55.0;
const SERIES_ROW: f64 = 166.0;
const NODE_ROW: f64 = 88.0;
/// Bytes of the tables of a cell: its statistics and its mean excess.
const CELL_BYTES: f64 = 2500.0;
/// Bytes of a number in the table of features, and of a row on what explains the times.
const FEATURE_BYTES: f64 = 20.3;
const EXPLAINED_ROW: f64 = 68.0;
/// Bytes of a member's dot against one feature, in the plot and in the page.
const DOT_BYTES: f64 = 160.0;
/// Bytes of plots and page, measured: without the members that are drawn, and for each of their nodes.
const PLOTS_BYTES: f64 = 100_000.0;
const DRAWN_NODE_BYTES: f64 = 355.0;
/// Bytes of the files that describe a store and of its last, partly filled chunks.
const STORE_BYTES: f64 = 50_000.0;
/// Bytes of a table as Parquet for each byte as CSV. Measured: 0.45 to 0.48 of those with many rows.
const PARQUET_SHARE: f64 = 0.47;

/// Bytes of the output folder at the end, with so many rows of the series and nodes of snapshots in all.
pub fn disk(cells: &[Cell], members: u64, rated: f64, series: f64, nodes: f64) -> u64 {
    let Some(Cell { spec, .. }) = cells.first() else { return 0 };
    let (nodes, store) = match spec.store {
        Store::Zarr if nodes == 0.0 => (0.0, 0.0),
        Store::Csv => (nodes * NODE_ROW, 0.0),
        // x, y, k and r.
        Store::Zarr => (0.0, STORE_BYTES + nodes * 4.0 * size_of::<f64>() as f64),
    };
    let shown: usize = cells.iter().map(|cell| cell.family.points().min(Portrait::MAX_NODES)).sum();
    let drawn = members.min(MAX_PANELS as u64) as f64 * shown as f64 / cells.len() as f64;
    let events = spec.event.len() as f64 * EVENT_ROW;
    let tables = members as f64 * (SUMMARY_ROW + rated * RATES_ROW + events) + series * SERIES_ROW + nodes;
    let features = spec.cell_features().len() as f64;
    let (explained, dots) = explained(features, cells.len() as f64, members as f64);
    let tables = tables + members as f64 * features * FEATURE_BYTES + explained + cells.len() as f64 * CELL_BYTES;
    let parquet = if spec.tables == Tables::Parquet { PARQUET_SHARE * tables } else { 0.0 };
    (tables + parquet + store + dots + PLOTS_BYTES + drawn * DRAWN_NODE_BYTES) as u64
}

/// Bytes of what explains the times, if cells have enough members: the table, and dots in pictures.
fn explained(features: f64, cells: f64, members: f64) -> (f64, f64) {
    let rows = TIMES.len() as f64 * cells;
    match members < MIN_MEMBERS as f64 * cells {
        true => (rows * EXPLAINED_ROW, 0.0),
        false => (rows * features * EXPLAINED_ROW, members.min(DRAWN as f64) * PICTURED as f64 * DOT_BYTES),
    }
}

/// The members of a stage that are in memory at once.
#[derive(Clone, Copy, Debug)]
pub struct Residents {
    /// Nodes of a member.
    pub n: usize,
    /// Members in the pool, of which some slots may stay empty.
    pub slots: usize,
    /// Members that are resident at once.
    pub count: usize,
    /// Bytes of the rows of one of them.
    pub rows: f64,
    /// Bytes of the chunks of the store that are being filled.
    pub chunks: u64,
}

impl Residents {
    fn pool(&self, members: usize) -> u64 {
        numbers(POOL_NUMBERS * self.n * members)
    }

    /// Bytes of the rows in memory. Above [`MAX_HELD`] for the whole pool, rows go to disk.
    pub fn rows(&self) -> u64 {
        (self.rows * self.count as f64).min(MAX_HELD as f64) as u64
    }

    /// States of up to `members` that are read back at once.
    fn read_back(&self, members: usize) -> u64 {
        numbers(STATE_FIELDS * self.n * members.min(states_at_once(self.n)))
    }

    /// Bytes that these members took in a pilot, which draws none of them.
    pub fn in_pilot(&self, reads_back: bool) -> u64 {
        let back = if reads_back { self.read_back(self.count) } else { 0 };
        self.pool(self.count) + self.rows() + back
    }

    /// Bytes that they take in the run. Checkpoints may be saved during it (`kept`). Members that are `drawn` are read
    /// back for each of their pictures.
    fn in_run(&self, drawn: usize, kept: bool) -> u64 {
        let full = self.count.min(self.slots);
        let spilling = if self.rows() < MAX_HELD as u64 { 0 } else { SPILL_BYTES };
        let passing = match kept {
            true => numbers(KEPT_NUMBERS * self.n * full) + self.read_back(full),
            false => self.read_back(drawn.min(full)),
        };
        self.pool(full) + passing + self.rows() + spilling + self.chunks
    }
}

fn numbers(count: usize) -> u64 {
    (count * size_of::<f64>()) as u64
}

/// Peak resident size in bytes of a run of `members` of up to `n` nodes, whose stages have these residents one after
/// another. `program` is what the process takes without any; checkpoints may be saved during the run (`kept`).
///
/// The peak is at the end of the run, with a full pool and the tally, or after it, with the statistics and the charts
/// but no pool. For each member the tally has its time and two numbers of half size about its mesh; for a fraction
/// `rated` also its rate and that of theory. Times are sorted in place, and rates one number at a time; the number that
/// is drawn replaces them. A chart sorts the numbers that it shows. Before that, the times of the first members of a
/// cell are [explained](explaining).
pub fn memory(
    program: u64,
    members: u64,
    rated: f64,
    n: usize,
    explained: u64,
    stages: &[Residents],
    kept: bool,
) -> u64 {
    let drawn = usize::try_from(members).unwrap_or(usize::MAX).min(MAX_PANELS);
    let shown = n.div_ceil(Portrait::stride(n));
    let portraits = numbers(2 * shown * (member::PARTS + 1) * drawn);
    let page = (PAGE_BYTES * shown * drawn / MAX_PANELS) as u64;
    let rated = (rated * members as f64) as u64;
    let tally = members * (size_of::<f64>() + 2 * size_of::<f32>()) as u64 + rated * size_of::<Rate>() as u64;
    let [fitted, charted] = [rated, members.saturating_sub(rated)].map(|count| count * size_of::<f64>() as u64);
    let statistics = fitted.max(charted);
    let resident = stages.iter().map(|stage| stage.in_run(drawn, kept)).max().unwrap_or(0);
    let reporting = PORTRAIT_COPIES as u64 * portraits + page + statistics.max(explained);
    program + tally + (resident + portraits).max(reporting)
}

/// Bytes of the first members of a cell, each with so many features, while it is explained what their times depend on.
/// Of those that have times, a fraction `timed`, the numbers are copied.
pub fn explaining(members_of_cell: u64, features: usize, timed: f64) -> u64 {
    let numbers = (features * size_of::<f64>()) as f64;
    let each = size_of::<FeaturedMember>() as f64 + numbers * (1.0 + EXPLAINED_COPIES * timed);
    (members_of_cell.min(CONSIDERED as u64) as f64 * each) as u64
}

/// Peak resident size of this process without the members of its largest pilot. It is not asked of a pilot that `held`
/// many rows: how many of them at once depends on the lengths of its steps.
pub fn program(in_pilots: u64, held: bool) -> u64 {
    peak_resident().filter(|_| !held).map_or(PROGRAM_BYTES, |peak| peak.saturating_sub(in_pilots))
}

/// Maximum resident size of this process so far, in bytes, if the system reports it.
pub fn peak_resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes << 10)
}
