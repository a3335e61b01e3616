//! The CSV files: one header, floats that read back exactly, empty fields for unknown values, sorted by member.
//!
//! A float that is not finite is unknown. There are no clock times: equal runs give equal bytes.
//!
//! A column is a line of `columns!`. [`Table::row`] writes its field and [`TableReader`](super::TableReader) reads it;
//! how is in `column.rs`, by kind.

use csv::{Writer, WriterBuilder};

use super::{
    column::{Field, TableRow, columns, row},
    names,
    part_file::{Mark, PartFile},
};
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{LevelRow, Outcome, SeriesRow, Snapshot};
use curvelax_study::results::{explained::ExplainedRow, tally::MeanExcess};

/// Bytes gathered before they are written.
const BUFFER: usize = 1 << 16;

columns! { Outcome, names::SUMMARY:
    member: whole = member, "index of the member, from 0";
    cell: whole = cell, "index of its cell, from 0";
    status: status = status, "how the member ended";
    t_end: time = t_end, "time of the member's last state, at most the final time";
    steps: whole = steps, "accepted steps";
    rejected: whole = rejected, "adaptive steps that were refused";
    sweeps_k: whole = sweeps_k, "Gauss-Seidel sweeps on the curvature systems, 0 with the direct solver";
    sweeps_x: whole = sweeps_x, "Gauss-Seidel sweeps on the position systems";
    t_relax: event = t_relax, "first time at which the excess reaches `relax-to` times its start, or `relax-at`, and k agrees with the polygon, interpolated inside the step; with `--conserve area,length` the time after which |E - E_end| stays below `relax-to` times its maximum over the run, empty if E returns close to this threshold";
    t_half: event = t_half, "first time at which the excess reaches half its start; with `--conserve area,length` likewise by the energy";
    rate: optional = rate, "slope of -ln excess against time while the excess falls from a tenth to a thousandth of its start; for Willmore flow against ln(1 + 2t/R₀⁴); empty below 8 points";
    rate_r2: optional = rate_r2, "share of the variance of ln excess that the line explains";
    length_start: number = start.length, "length of the initial polygon";
    length_end: number = end.length, "length of the last polygon";
    area_start: number = start.area, "signed area of the initial polygon, positive counter-clockwise";
    area_end: number = end.area, "signed area of the last polygon";
    excess_start: number = start.excess, "L²/(4πA) - (n/π)·tan(π/n) of the initial polygon, 0 on a regular one; of a crystal E²/(4|W|A) minus that of n nodes on its Wulff shape, |W| being the area of the one whose support function is γ";
    excess_end: number = end.excess, "the same of the last polygon";
    energy_start: number = start.energy, "∮(½k² + λ) ds at the start; λ is 0 unless the flow is elastic; of a crystal ∮γ ds";
    energy_end: number = end.energy, "the same at the end";
    k_min: number = end.k_min, "smallest curvature of the last state";
    k_max: number = end.k_max, "largest curvature of the last state";
    turning: signed = end.turning, "turning number of the last polygon";
    mesh_ratio: number = end.mesh_ratio, "longest over shortest edge of the last polygon";
    metric_drift: number = end.metric_drift, "max |r_i - |e_i||/|e_i| of the last state: largest relative difference between the segment lengths r that the scheme evolves and those of the polygon";
    self_crossing: event = self_crossing, "time at which the polygon was first seen to cross itself, which does not stop the member";
    solves: whole = solves, "steps of the scheme that were computed, each a solve for k and one for x and y: 1 for a fixed step, 1 + 2 + … + J for an adaptive one of order J, also if it was refused";
    t_limit: event = t_limit, "with `--refine`: t_relax in the limit of many nodes and short steps";
    t_error: optional = t_error, "half-width of the 95 % interval of t_limit; for outlines it includes the change of the time when the corner radius is doubled";
    order: optional = order, "observed order of t_relax in 1/n, 2 for a smooth curve; empty where differences do not fall";
    label: word = label, "name of its outline; empty if it has none";
    group: word = group, "value of the property `--group-by` of its outline";
    points: whole = points, "nodes of the finest level that t_limit, or else t_vanish_limit, rests on; without both those of the member";
    t_data_error: optional = t_data_error, "with `--refine`, of outlines of 12 data points or more: change of the time, at `points` nodes, when every second data point is left out";
    wulff_distance: optional = wulff_distance, "of a crystal: largest error of the support function of the last polygon, centred, against the Wulff shape of its area, as a length";
    t_vanish: event = t_vanish, "time at which a driving force has shrunk it to a point: it is followed to a tenth of its length (a crystal until it is at rest, at the latest to a quarter), and the rest is that of a circle; t_end is then a little earlier";
    reduced_area: optional = reduced_area, "with `--conserve`: 4πA/L² of the last polygon";
    t_vanish_limit: event = t_vanish_limit, "with `--refine`: t_vanish in the limit of many nodes and short steps; empty where the last excess is above 10⁻³, since the rest of its life is not that of a circle";
    t_vanish_error: optional = t_vanish_error, "half-width of the 95 % interval of t_vanish_limit; for outlines as in t_error";
}

columns! { LevelRow, names::LEVELS:
    member: whole = member, "index of the member";
    level: whole = level, "1: n/2 nodes; 2: n/√2; 3: n; with `--refine`, of members that need more, 4: √2 n; 5: 2n; and so on up to 1600 nodes; of outlines 100 more, on its finest one: with every second data point, and 200 more: with twice the corner radius";
    cell: whole = cell, "index of its cell";
    points: whole = points, "nodes";
    adaptive: optional = adaptive, "tolerance of the steps: a tenth of that of the run, 1e-4 with fixed steps";
    precision: precision = precision, "number type: above 400 nodes f64 on the CPU where the run is in f32";
    status: status = status, "how the member ended";
    t_relax: event = t_relax, "as in `summary.csv`";
    solves: whole = solves, "as in `summary.csv`";
    turn: number = turn, "largest angle by which the tangent of the initial curve turns at a node, in rad: above 0.5 the nodes do not resolve it";
    excess_start: number = excess_start, "as in `summary.csv`, at these nodes";
    t_vanish: event = t_vanish, "as in `summary.csv`";
    length_start: number = length_start, "as in `summary.csv`, at these nodes";
    energy_start: number = energy_start, "as in `summary.csv`, at these nodes";
    energy_end: number = energy_end, "as in `summary.csv`, at these nodes";
}

row! {
    /// A row of `rates.csv`: the fitted rate of a member, and that of linear theory.
    RateRow, names::RATES:
    member: whole, "index of the member";
    cell: whole, "index of its cell";
    rate: optional, "as in `summary.csv`";
    rate_r2: optional, "as in `summary.csv`";
    rate_theory: optional, "decay rate of the excess by linear theory of the slowest mode, twice that of its amplitude: 24/R⁴ for mode 2 and surface diffusion; for elastic flow at the radius while the rate is fitted; empty where there is none";
    rate_ratio: optional, "rate / rate_theory";
}

row! {
    /// A row of `events.csv`: the time of an event of a member, or until when it was not seen.
    EventRow, names::EVENTS:
    member: whole, "index of the member";
    cell: whole, "index of its cell";
    event: word, "name of the event";
    t: time, "first time at which its condition holds, found inside the step; of a censored one, when the member ended";
    censored: whole, "0: it happened at t; 1: it had not happened by then";
    t_limit: event, "with `--refine`: t in the limit of many nodes and short steps";
    t_error: event, "half-width of the 95 % interval of t_limit";
}

row! {
    /// A row of `event_levels.csv`: the time of an event of a member at a level.
    EventLevelRow, names::EVENT_LEVELS:
    member: whole, "index of the member";
    level: whole, "as in `levels.csv`";
    cell: whole, "index of its cell";
    event: word, "name of the event";
    t: event, "first time at which its condition holds; empty if it was not seen";
}

columns! { SeriesRow, names::SERIES:
    member: whole = member, "index of the member";
    t: time = t, "time";
    length: number = at.length, "length of the polygon";
    area: number = at.area, "signed area of the polygon";
    excess: number = at.excess, "as in `summary.csv`";
    energy: number = at.energy, "as in `summary.csv`";
    k_min: number = at.k_min, "smallest curvature";
    k_max: number = at.k_max, "largest curvature";
    mesh_ratio: number = at.mesh_ratio, "longest over shortest edge";
    metric_drift: number = at.metric_drift, "max |r_i - |e_i||/|e_i|";
}

row! {
    /// A row of `snapshots.csv`: a node of a member at a time.
    NodeRow, names::SNAPSHOTS:
    member: whole, "index of the member";
    t: time, "time";
    i: whole, "node, from 1 to n";
    x: number, "x coordinate of the node";
    y: number, "y coordinate of the node";
    k: number, "signed curvature of the segment that ends at the node";
    r: number, "length of the segment that ends at the node, as the scheme evolves it";
}

columns! { MeanExcess, names::MEAN_EXCESS:
    cell: whole = cell, "index of the cell";
    t: time = t, "time, one of 33 that are dense at the start";
    members: whole = members, "members of the cell that reached t";
    mean: optional = mean, "their mean excess";
    sd: optional = sd, "its standard deviation";
    q05: optional = q05, "its 5 % quantile, rounded to 1 %";
    median: optional = median, "its median, rounded to 1 %";
    q95: optional = q95, "its 95 % quantile, rounded to 1 %";
}

columns! { ExplainedRow, names::EXPLAINED:
    cell: whole = cell, "index of the cell";
    time: word = time, "what is explained: t_limit with `--refine`, t_relax, t_half, or the name of an event";
    feature: word = feature, "a column of `members.csv`, best first; or together: a regression on the chosen ones";
    members: whole = members, "members that reached the time";
    censored: whole = censored, "members without it: they ended before, or are vesicles without a relaxation time";
    spearman: optional = spearman, "rank correlation of feature and time";
    r2: optional = r2, "share of the variance of the time that a straight line explains; of the regression cross-validated";
    chosen: rank = chosen, "place of the feature in the regression, from 1, empty if it is not in it; of the regression how many it has";
    logarithm: word = logarithm, "what entered by its logarithm: time, or both time and feature; times over more than a factor of 30 do";
}

/// A table that grows row by row.
pub struct Table {
    // Flushes when dropped.
    writer: Writer<PartFile>,
}

impl Table {
    /// Begins a table of such rows, or continues after those in `file`.
    pub fn new<R: TableRow>(file: PartFile) -> Result<Table> {
        Table::with_header(file, R::COLUMNS.iter().map(|column| column.name))
    }

    /// Begins a table with these headings, or continues after the rows in `file`.
    pub(super) fn with_header<'a>(file: PartFile, names: impl Iterator<Item = &'a str>) -> Result<Table> {
        let begins = file.is_empty();
        let writer = WriterBuilder::new().has_headers(false).buffer_capacity(BUFFER).from_writer(file);
        let mut table = Table { writer };
        if begins {
            table.write(names.map(Field::Word))?;
        }
        Ok(table)
    }

    /// Returns its length and checksum, once it is on disk.
    pub fn mark(&mut self) -> Result<Mark> {
        self.writer.flush().map_err(Error::io("cannot write", self.writer.get_ref().target()))?;
        self.writer.get_ref().mark()
    }

    /// Sets whether to keep its rows if the run fails.
    pub fn keep(&self, keep: bool) {
        self.writer.get_ref().keep(keep);
    }

    /// Its name in its folder.
    pub(super) fn name(&self) -> &str {
        self.writer.get_ref().name()
    }

    /// Completes the table on disk, ready for its final name.
    pub fn ready(self) -> Result<PartFile> {
        let target = self.writer.get_ref().target().to_path_buf();
        let file = self.writer.into_inner().map_err(|e| Error::io("cannot write", &target)(e.into_error()))?;
        file.sync()?;
        Ok(file)
    }

    /// Writes the fields of a row.
    pub(super) fn write<'a>(&mut self, fields: impl Iterator<Item = Field<'a>>) -> Result<()> {
        let row: Vec<Field<'_>> = fields.collect();
        self.writer.serialize(row).map_err(|e| Error::io("cannot write", self.writer.get_ref().target())(e.into()))
    }

    /// Writes a row.
    pub fn row<R: TableRow>(&mut self, record: &R) -> Result<()> {
        self.write(R::COLUMNS.iter().map(|column| (column.write)(record)))
    }

    /// Writes a whole table into `file`, ready for its final name.
    pub fn of<R: TableRow>(file: PartFile, rows: &[R]) -> Result<PartFile> {
        let mut table = Table::new::<R>(file)?;
        rows.iter().try_for_each(|row| table.row(row))?;
        table.ready()
    }
}

impl RateRow {
    /// The row of a member, if it has a rate.
    pub fn of(member: &Outcome) -> Option<RateRow> {
        let Outcome { member, cell, rate, rate_r2, rate_theory, .. } = *member;
        let rate_ratio = rate_theory.map(|theory| rate.unwrap_or_default() / theory);
        rate.map(|_| RateRow { member, cell, rate, rate_r2, rate_theory, rate_ratio })
    }
}

impl EventRow {
    /// The rows of a member with the events of these names, with limits if it is `refined`.
    pub fn of<'a>(member: &'a Outcome, names: &'a [String], refined: bool) -> impl Iterator<Item = EventRow> + 'a {
        let row = move |(i, (event, seen)): (usize, (&String, &Option<f64>))| {
            let limit = member.limit_of_event(i).filter(|_| refined);
            EventRow {
                member: member.member,
                cell: member.cell,
                event: event.clone(),
                t: seen.unwrap_or(member.t_end),
                censored: u64::from(seen.is_none()),
                t_limit: limit.map(|limit| limit.t),
                t_error: limit.map(|limit| limit.error),
            }
        };
        names.iter().zip(&member.events).enumerate().map(row)
    }
}

impl EventLevelRow {
    /// The rows of a member at a level, with the events of these names.
    pub fn of<'a>(of: &'a LevelRow, names: &'a [String]) -> impl Iterator<Item = EventLevelRow> + 'a {
        let LevelRow { member, level, cell, events, .. } = of;
        let row = |(event, t): (&String, &Option<f64>)| EventLevelRow {
            member: *member,
            level: *level,
            cell: *cell,
            event: event.clone(),
            t: *t,
        };
        names.iter().zip(events).map(row)
    }
}

impl NodeRow {
    /// The rows of a snapshot, i = 1…n.
    pub fn of(Snapshot { member, t, x, y, k, r }: &Snapshot) -> impl Iterator<Item = NodeRow> {
        let nodes = x.iter().zip(y).zip(k).zip(r);
        (1..).zip(nodes).map(|(i, (((x, y), k), r))| NodeRow { member: *member, t: *t, i, x: *x, y: *y, k: *k, r: *r })
    }
}

#[cfg(test)]
pub(crate) mod tests;
