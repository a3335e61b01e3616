//! The CSV files: one header, floats that read back exactly, unknown is empty, sorted by member.
//!
//! A float that is not finite is unknown. No clock times here: equal runs give equal bytes.

use std::marker::PhantomData;

use csv::{Writer, WriterBuilder};
use serde::Serialize;

use super::{
    part_file::{Mark, PartFile},
    place::Place,
};
use crate::results::tally::MeanExcess;
use crate::{
    ensemble::{Outcome, SeriesRow, Snapshot},
    error::{Error, Result},
    truth::Row,
};

/// Columns of `summary.csv`.
pub const SUMMARY: &str = "member,cell,status,t_end,steps,rejected,sweeps_k,sweeps_x,t_relax,t_half,rate,rate_r2,\
    length_start,length_end,area_start,area_end,excess_start,excess_end,energy_start,energy_end,k_min,k_max,turning,\
    mesh_ratio,metric_drift,self_crossing";
const RATES: &str = "member,cell,rate,rate_r2,rate_theory,rate_ratio";
/// Columns of `mean_excess.csv`.
pub const MEAN_EXCESS: &str = "cell,t,members,mean,sd";
const SERIES: &str = "member,t,length,area,excess,energy,k_min,k_max,mesh_ratio,metric_drift";
const SNAPSHOTS: &str = "member,t,i,x,y,k,r";
const CONVERGENCE: &str = "problem,varied,n,tau,tolerance,error,order";

/// Bytes gathered before they are written.
const BUFFER: usize = 1 << 16;

/// What a table has in its columns.
pub trait Kind {
    /// Their names.
    const COLUMNS: &str;
}

/// A table that grows row by row.
pub struct Table<K> {
    // Flushes when dropped.
    writer: Writer<PartFile>,
    kind: PhantomData<K>,
}

impl<K: Kind> Table<K> {
    /// Begins a table with its header, or goes on with the rows that are in `file`.
    pub fn new(file: PartFile) -> Result<Self> {
        let begins = file.is_empty();
        let writer = WriterBuilder::new().has_headers(false).buffer_capacity(BUFFER).from_writer(file);
        let mut table = Table { writer, kind: PhantomData };
        if begins {
            table.write(K::COLUMNS.split(',').collect::<Vec<_>>())?;
        }
        Ok(table)
    }

    /// How far it has grown, once that is on disk.
    pub fn mark(&mut self) -> Result<Mark> {
        self.writer.flush().map_err(Error::io("cannot write", self.writer.get_ref().target()))?;
        self.writer.get_ref().mark()
    }

    /// Whether its rows are worth keeping if the run fails.
    pub fn keep(&self, keep: bool) {
        self.writer.get_ref().keep(keep);
    }

    /// The temporary name under which its rows lie.
    pub fn part(&self) -> &Place {
        self.writer.get_ref().part()
    }

    /// The whole table, on disk and ready for its final name.
    pub fn ready(self) -> Result<PartFile> {
        let target = self.writer.get_ref().target().to_path_buf();
        let file = self.writer.into_inner().map_err(|e| Error::io("cannot write", &target)(e.into_error()))?;
        file.sync()?;
        Ok(file)
    }

    fn write(&mut self, row: impl Serialize) -> Result<()> {
        self.writer.serialize(row).map_err(|e| Error::io("cannot write", self.writer.get_ref().target())(e.into()))
    }
}

macro_rules! kinds {
    ($($(#[$outer:meta])* $table:ident of $kind:ident: $columns:expr;)*) => {$(
        #[doc(hidden)]
        pub enum $kind {}

        impl Kind for $kind {
            const COLUMNS: &str = $columns;
        }

        $(#[$outer])*
        pub type $table = Table<$kind>;
    )*};
}

kinds! {
    /// `summary.csv`: one row a member.
    SummaryTable of Summary: SUMMARY;
    /// `rates.csv`: the fitted rate of each member that has one, beside that of linear theory.
    RateTable of Rates: RATES;
    /// `series.csv`: the observables of each member over time.
    SeriesTable of Series: SERIES;
    /// `snapshots.csv`: the nodes of each member at given times.
    SnapshotTable of Snapshots: SNAPSHOTS;
    /// `mean_excess.csv`: the mean excess of each cell over time.
    ExcessTable of Excess: MEAN_EXCESS;
    /// `convergence.csv`: errors and orders against exact solutions.
    ConvergenceTable of Convergence: CONVERGENCE;
}

/// Columns of `summary.csv`.
#[derive(Serialize)]
struct SummaryRow {
    member: u64,
    cell: u64,
    status: &'static str,
    t_end: Option<f64>,
    steps: u64,
    rejected: u64,
    sweeps_k: u64,
    sweeps_x: u64,
    t_relax: Option<f64>,
    t_half: Option<f64>,
    rate: Option<f64>,
    rate_r2: Option<f64>,
    length_start: Option<f64>,
    length_end: Option<f64>,
    area_start: Option<f64>,
    area_end: Option<f64>,
    excess_start: Option<f64>,
    excess_end: Option<f64>,
    energy_start: Option<f64>,
    energy_end: Option<f64>,
    k_min: Option<f64>,
    k_max: Option<f64>,
    turning: i32,
    mesh_ratio: Option<f64>,
    metric_drift: Option<f64>,
    self_crossing: Option<f64>,
}

impl SummaryTable {
    /// Writes the row of one member.
    pub fn row(&mut self, member: &Outcome) -> Result<()> {
        let Outcome { start, end, .. } = member;
        self.write(SummaryRow {
            member: member.member,
            cell: member.cell,
            status: member.status.name(),
            t_end: known(member.t_end),
            steps: member.steps,
            rejected: member.rejected,
            sweeps_k: member.sweeps_k,
            sweeps_x: member.sweeps_x,
            t_relax: member.t_relax.and_then(known),
            t_half: member.t_half.and_then(known),
            rate: member.rate.and_then(known),
            rate_r2: member.rate_r2.and_then(known),
            length_start: known(start.length),
            length_end: known(end.length),
            area_start: known(start.area),
            area_end: known(end.area),
            excess_start: known(start.excess),
            excess_end: known(end.excess),
            energy_start: known(start.energy),
            energy_end: known(end.energy),
            k_min: known(end.k_min),
            k_max: known(end.k_max),
            turning: end.turning,
            mesh_ratio: known(end.mesh_ratio),
            metric_drift: known(end.metric_drift),
            self_crossing: member.self_crossing.and_then(known),
        })
    }
}

impl RateTable {
    /// Writes the row of one member, if it has a rate.
    pub fn row(&mut self, member: &Outcome) -> Result<()> {
        let Outcome { member, cell, rate, rate_r2, rate_theory, .. } = *member;
        let Some(rate) = rate else { return Ok(()) };
        let ratio = rate_theory.map(|theory| rate / theory).and_then(known);
        self.write((member, cell, rate, rate_r2.and_then(known), rate_theory.and_then(known), ratio))
    }
}

/// Writes `mean_excess.csv`.
pub fn mean_excess(file: PartFile, rows: &[MeanExcess]) -> Result<PartFile> {
    let mut table = ExcessTable::new(file)?;
    rows.iter().try_for_each(|row| table.write(row))?;
    table.ready()
}

impl SeriesTable {
    /// Writes one row.
    pub fn row(&mut self, row: &SeriesRow) -> Result<()> {
        let at = &row.at;
        let scalars = [at.length, at.area, at.excess, at.energy, at.k_min, at.k_max, at.mesh_ratio, at.metric_drift];
        self.write((row.member, row.t, scalars.map(known)))
    }
}

impl SnapshotTable {
    /// Writes one row a node, i = 1…n.
    pub fn snapshot(&mut self, snapshot: &Snapshot) -> Result<()> {
        let Snapshot { member, t, x, y, k, r } = snapshot;
        let nodes = x.iter().zip(y).zip(k).zip(r);
        for (i, (((x, y), k), r)) in (1_u64..).zip(nodes) {
            self.write((member, t, i, [x, y, k, r].map(|value| known(*value))))?;
        }
        Ok(())
    }
}

/// `convergence.csv`, the whole table: one row a run, τ or the tolerance of adaptive steps empty.
pub fn convergence(file: PartFile, rows: &[Row]) -> Result<PartFile> {
    let mut table = ConvergenceTable::new(file)?;
    for Row { problem, varied, at, error, order, .. } in rows {
        let tau = at.tolerance.is_none().then_some(at.tau);
        table.write((problem, varied.name(), at.n as u64, tau, at.tolerance, error, order))?;
    }
    table.ready()
}

fn known(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{
        ensemble::{Observables, Status},
        files::OutputFolder,
    };

    fn outcome(start: Observables, end: Observables) -> Outcome {
        Outcome {
            member: 3,
            cell: 0,
            status: Status::Relaxed,
            t_end: 0.5,
            steps: 500,
            rejected: 7,
            sweeps_k: 1234,
            sweeps_x: 987,
            t_relax: Some(0.1 + 0.2),
            t_half: None,
            rate: Some(6.5),
            rate_r2: None,
            rate_theory: None,
            start,
            end,
            self_crossing: Some(0.25),
        }
    }

    fn observables() -> Observables {
        Observables {
            length: 9.688448220547675,
            area: 6.5,
            excess: 1e-300,
            energy: -0.0,
            k_min: f64::MIN_POSITIVE / 8.0,
            k_max: f64::MAX,
            mesh_ratio: 1.0,
            metric_drift: 1.0 / 3.0,
            turning: -1,
        }
    }

    /// The text of the file that `fill` writes.
    fn written(name: &str, fill: impl FnOnce(PartFile) -> Result<PartFile>) -> String {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let file = fill(folder.file(name).unwrap()).unwrap();
        fs::read_to_string(file.part().at()).unwrap()
    }

    fn summary(rows: &[Outcome]) -> String {
        written("summary.csv", |file| {
            let mut table = SummaryTable::new(file)?;
            rows.iter().try_for_each(|row| table.row(row))?;
            table.ready()
        })
    }

    #[test]
    fn the_summary_has_these_bytes() {
        let end = Observables { length: 8.5, area: 6.0, turning: 1, excess: f64::NAN, ..Default::default() };
        let text = summary(&[outcome(Observables { length: 9.0, energy: f64::INFINITY, ..Default::default() }, end)]);
        assert_eq!(
            text,
            "member,cell,status,t_end,steps,rejected,sweeps_k,sweeps_x,t_relax,t_half,rate,rate_r2,length_start,\
             length_end,area_start,area_end,excess_start,excess_end,energy_start,energy_end,k_min,k_max,turning,\
             mesh_ratio,metric_drift,self_crossing\n\
             3,0,relaxed,0.5,500,7,1234,987,0.30000000000000004,,6.5,,9.0,8.5,0.0,6.0,0.0,,,0.0,0.0,0.0,1,0.0,0.0,0.25\n"
        );
    }

    #[test]
    fn an_empty_table_is_a_header() {
        assert_eq!(summary(&[]), format!("{SUMMARY}\n"));
    }

    #[test]
    fn rates_and_mean_excess_have_these_bytes() {
        let text = written("rates.csv", |file| {
            let mut table = RateTable::new(file)?;
            let at = Observables::default();
            for rate_theory in [None, Some(6.0)] {
                table.row(&Outcome { rate: Some(6.0), rate_r2: Some(0.5), rate_theory, ..outcome(at, at) })?;
            }
            table.row(&Outcome { rate: None, ..outcome(at, at) })?;
            table.ready()
        });
        assert_eq!(text, "member,cell,rate,rate_r2,rate_theory,rate_ratio\n3,0,6.0,0.5,,\n3,0,6.0,0.5,6.0,1.0\n");
        let two = MeanExcess { cell: 0, t: 0.0, members: 2, mean: Some(0.375), sd: Some(0.1767766952966369) };
        let one = MeanExcess { t: 0.5, members: 1, mean: Some(0.5), sd: None, ..two };
        let text = written("mean_excess.csv", |file| mean_excess(file, &[two, one]));
        assert_eq!(text, "cell,t,members,mean,sd\n0,0.0,2,0.375,0.1767766952966369\n0,0.5,1,0.5,\n");
    }

    #[test]
    fn series_and_snapshots_have_these_bytes() {
        let text = written("series.csv", |file| {
            let mut table = SeriesTable::new(file)?;
            table.row(&SeriesRow { member: 1, t: 0.01, at: Observables { k_max: f64::NAN, ..observables() } })?;
            table.ready()
        });
        assert_eq!(
            text,
            "member,t,length,area,excess,energy,k_min,k_max,mesh_ratio,metric_drift\n\
             1,0.01,9.688448220547675,6.5,1e-300,-0.0,2.781342323134e-309,,1.0,0.3333333333333333\n"
        );
        let text = written("snapshots.csv", |file| {
            let mut table = SnapshotTable::new(file)?;
            let (x, y) = (vec![1.0, 2.0], vec![3.0, 4.0]);
            table.snapshot(&Snapshot { member: 1, t: 0.25, x, y, k: vec![5.0, 6.0], r: vec![7.0, 8.0] })?;
            table.ready()
        });
        assert_eq!(text, "member,t,i,x,y,k,r\n1,0.25,1,1.0,3.0,5.0,7.0\n1,0.25,2,2.0,4.0,6.0,8.0\n");
    }

    #[test]
    fn a_table_of_convergence_has_these_bytes() {
        let row = |error, order| Row {
            problem: "lemniscate".into(),
            varied: crate::truth::Varied::Step,
            at: crate::truth::Resolution { n: 100, tau: 0.25, tolerance: None },
            status: Status::Unfinished,
            error,
            order,
        };
        let text = written("convergence.csv", |file| convergence(file, &[row(Some(-0.1), Some(1.5)), row(None, None)]));
        assert_eq!(
            text,
            "problem,varied,n,tau,tolerance,error,order\nlemniscate,tau,100,0.25,,-0.1,1.5\nlemniscate,tau,100,0.25,,,\n"
        );
    }

    #[test]
    fn floats_read_back_to_the_same_bits() {
        let text = summary(&[outcome(observables(), observables())]);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let columns = reader.headers().unwrap().clone();
        let row = reader.records().next().unwrap().unwrap();
        let bits = |column: &str| {
            let field = columns.iter().zip(&row).find(|(name, _)| *name == column).unwrap().1;
            field.parse::<f64>().unwrap().to_bits()
        };
        let at = observables();
        for (column, value) in [
            ("t_relax", 0.1 + 0.2),
            ("length_start", at.length),
            ("area_end", at.area),
            ("excess_start", at.excess),
            ("energy_end", at.energy),
            ("k_min", at.k_min),
            ("k_max", at.k_max),
            ("mesh_ratio", at.mesh_ratio),
            ("metric_drift", at.metric_drift),
        ] {
            assert_eq!(bits(column), value.to_bits(), "{column}");
        }
    }

    #[test]
    fn a_table_goes_on_after_its_mark_and_is_kept_as_it_is_told() {
        let home = tempfile::tempdir().unwrap();
        let text = |name: &str| fs::read_to_string(home.path().join(name)).unwrap();
        let one = outcome(observables(), observables());
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let mut table = SummaryTable::new(folder.file("summary.csv").unwrap()).unwrap();
        let lone = SeriesTable::new(folder.file("series.csv").unwrap()).unwrap();
        table.row(&one).unwrap();
        let mark = table.mark().unwrap();
        table.row(&Outcome { member: 4, ..one.clone() }).unwrap();
        table.keep(true);
        drop((table, lone));
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 2, "the lock and one table");
        assert_eq!(text(".summary.csv.part").lines().count(), 3);

        folder.check(&mark).unwrap();
        let mut again = SummaryTable::new(folder.file_again(&mark).unwrap()).unwrap();
        again.row(&Outcome { member: 5, ..one.clone() }).unwrap();
        let straight = summary(&[one.clone(), Outcome { member: 5, ..one }]);
        let mark = again.mark().unwrap();
        assert_eq!((mark.length, mark.crc), (straight.len() as u64, crc32c::crc32c(straight.as_bytes())));
        again.keep(false);
        drop((again, folder));
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
    }
}
