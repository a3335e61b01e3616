//! The bytes of each table, and tables that continue after a mark.

use std::fs;

use super::*;
use crate::OutputFolder;
use curvelax_ensemble::{Observables, Status};
use curvelax_statistics::Limit;

fn outcome(start: Observables, end: Observables) -> Outcome {
    Outcome {
        member: 3,
        status: Status::Relaxed,
        t_end: 0.5,
        steps: 500,
        rejected: 7,
        sweeps_k: 1234,
        sweeps_x: 987,
        t_relax: Some(0.1 + 0.2),
        rate: Some(6.5),
        start,
        end,
        self_crossing: Some(0.25),
        solves: 600,
        t_limit: Some(0.5),
        t_error: Some(0.125),
        ..Outcome::default()
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
pub fn written(name: &str, fill: impl FnOnce(PartFile) -> Result<PartFile>) -> String {
    let home = tempfile::tempdir().unwrap();
    let folder = OutputFolder::open(home.path(), true).unwrap();
    let file = fill(folder.file(name).unwrap()).unwrap();
    fs::read_to_string(file.part().at()).unwrap()
}

fn summary(rows: &[Outcome]) -> String {
    written("summary.csv", |file| {
        let mut table = Table::new::<Outcome>(file)?;
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
         mesh_ratio,metric_drift,self_crossing,solves,t_limit,t_error,order,label,group,points,t_data_error,\
         wulff_distance,t_vanish,reduced_area,t_vanish_limit,t_vanish_error\n\
         3,0,relaxed,0.5,500,7,1234,987,0.30000000000000004,,6.5,,9.0,8.5,0.0,6.0,0.0,,,0.0,0.0,0.0,1,0.0,0.0,0.25,600,0.5,0.125,,,,0,,,,,,\n"
    );
}

#[test]
fn an_empty_table_is_a_header() {
    assert_eq!(summary(&[]).lines().count(), 1);
}

#[test]
fn events_have_these_bytes() {
    let at = Observables::default();
    let limit = Limit { t: 0.25, error: 0.5, fixed: 0.0, order: None, asymptotic: true, relative: 0.0 };
    let (events, judged_events) = (vec![Some(0.1 + 0.2), None], vec![Some(limit), None]);
    let member = Outcome { events, judged_events, ..outcome(at, at) };
    let names = ["convex".to_string(), "slow".to_string()];
    assert!(EventRow::of(&member, &names, false).all(|row| row.t_limit.is_none() && row.t_error.is_none()));
    let text = written("events.csv", |file| Table::of(file, &EventRow::of(&member, &names, true).collect::<Vec<_>>()));
    assert_eq!(
        text,
        "member,cell,event,t,censored,t_limit,t_error\n3,0,convex,0.30000000000000004,0,0.25,0.5\n3,0,slow,0.5,1,,\n"
    );
}

#[test]
fn rates_and_mean_excess_have_these_bytes() {
    let text = written("rates.csv", |file| {
        let mut table = Table::new::<RateRow>(file)?;
        let at = Observables::default();
        for rate_theory in [None, Some(6.0)] {
            let member = Outcome { rate: Some(6.0), rate_r2: Some(0.5), rate_theory, ..outcome(at, at) };
            table.row(&RateRow::of(&member).unwrap())?;
        }
        assert_eq!(RateRow::of(&Outcome { rate: None, ..outcome(at, at) }), None);
        table.ready()
    });
    assert_eq!(text, "member,cell,rate,rate_r2,rate_theory,rate_ratio\n3,0,6.0,0.5,,\n3,0,6.0,0.5,6.0,1.0\n");
    let quantiles = MeanExcess { q05: Some(0.25), median: Some(0.375), q95: Some(0.5), ..MeanExcess::default() };
    let two = MeanExcess { members: 2, mean: Some(0.375), sd: Some(0.1767766952966369), ..quantiles };
    let one = MeanExcess { t: 0.5, members: 1, mean: Some(0.5), sd: None, q05: None, ..two };
    let text = written("mean_excess.csv", |file| Table::of(file, &[two, one]));
    assert_eq!(
        text,
        "cell,t,members,mean,sd,q05,median,q95\n0,0.0,2,0.375,0.1767766952966369,0.25,0.375,0.5\n0,0.5,1,0.5,,,0.375,0.5\n"
    );
}

#[test]
fn series_and_snapshots_have_these_bytes() {
    let text = written("series.csv", |file| {
        let mut table = Table::new::<SeriesRow>(file)?;
        table.row(&SeriesRow { member: 1, t: 0.01, at: Observables { k_max: f64::NAN, ..observables() } })?;
        table.ready()
    });
    assert_eq!(
        text,
        "member,t,length,area,excess,energy,k_min,k_max,mesh_ratio,metric_drift\n\
         1,0.01,9.688448220547675,6.5,1e-300,-0.0,2.781342323134e-309,,1.0,0.3333333333333333\n"
    );
    let text = written("snapshots.csv", |file| {
        let mut table = Table::new::<NodeRow>(file)?;
        let (x, y) = (vec![1.0, 2.0], vec![3.0, 4.0]);
        let snapshot = Snapshot { member: 1, t: 0.25, x, y, k: vec![5.0, 6.0], r: vec![7.0, 8.0] };
        NodeRow::of(&snapshot).try_for_each(|row| table.row(&row))?;
        table.ready()
    });
    assert_eq!(text, "member,t,i,x,y,k,r\n1,0.25,1,1.0,3.0,5.0,7.0\n1,0.25,2,2.0,4.0,6.0,8.0\n");
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
fn a_table_continues_after_its_mark_and_is_written_as_requested() {
    let home = tempfile::tempdir().unwrap();
    let text = |name: &str| fs::read_to_string(home.path().join(name)).unwrap();
    let one = outcome(observables(), observables());
    let folder = OutputFolder::open(home.path(), true).unwrap();
    let mut table = Table::new::<Outcome>(folder.file("summary.csv").unwrap()).unwrap();
    let lone = Table::new::<SeriesRow>(folder.file("series.csv").unwrap()).unwrap();
    table.row(&one).unwrap();
    let mark = table.mark().unwrap();
    table.row(&Outcome { member: 4, ..one.clone() }).unwrap();
    table.keep(true);
    drop((table, lone));
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 2, "the lock and one table");
    assert_eq!(text(".summary.csv.part").lines().count(), 3);

    folder.check(&mark).unwrap();
    let mut again = Table::new::<Outcome>(folder.file_again(&mark).unwrap()).unwrap();
    again.row(&Outcome { member: 5, ..one.clone() }).unwrap();
    let straight = summary(&[one.clone(), Outcome { member: 5, ..one }]);
    let mark = again.mark().unwrap();
    assert_eq!((mark.length, mark.crc), (straight.len() as u64, crc32c::crc32c(straight.as_bytes())));
    again.keep(false);
    drop((again, folder));
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
}
