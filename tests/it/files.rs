//! The tables of a run: output times, columns, numbers that read back, specs that repeat a run.

use curvelax::{
    backend::cpu::CpuBackend,
    ensemble::{Cell, Ended, Family, Spec, request::spec::Precision},
    simulate::simulate,
    solver::Blocks,
};

use glam::DVec2;
use tempfile::TempDir;

use crate::common::{
    SWEEPS,
    command::done,
    program::{Row, column, number, positions, run, run_with},
};

/// Prime numbers of members and nodes, more members than slots, output times on and between steps.
const MIXED: &str = "--curves 41 --points 61 --t-end 0.05 --series 0.0071 --snapshots 0,0.0123,0.05";

#[test]
fn the_printed_spec_repeats_the_run_of_the_flags() {
    let flags = "--curves 5 --points 53 --tau 0.0007 --t-end 0.03 --flow elastic:0.3 --omega 0.5 --sampling parameter \
                 --shape flower:3:0.2 --amplitude 0.02 --modes 3..=6 --decay 0.5 --solver direct --relax-to 0.5 \
                 --series 0.004 --snapshots 0.01,0.03 --stop-when-relaxed --threads 1";
    let home = TempDir::new().unwrap();
    let printed = done(home.path(), &format!("run --backend cpu --print-spec {flags}"));
    let (by_flags, by_file) = (run(flags), run_with(&[("spec.toml", &printed)], "spec.toml"));
    assert!(by_flags.texts() == by_file.texts(), "{printed}");
    assert!(run(&flags.replace("0.0007", "0.0008")).texts() != by_file.texts());
}

#[test]
fn the_spec_in_run_json_repeats_the_run() {
    let first = run(&format!("{MIXED} --only 2,5 --tolerance 1e-6"));
    let json: serde_json::Value = serde_json::from_str(&first.text("run.json")).unwrap();
    let spec: Spec = serde_json::from_value(json["spec"].clone()).unwrap();
    let again = run_with(&[("spec.toml", &spec.to_toml().unwrap())], "spec.toml");
    assert!(again.texts() == first.texts());
    assert_eq!((&json["members"], &json["members_by_status"]["unfinished"]), (&2.into(), &2.into()));
    assert_eq!((&json["platform"]["backend"], &json["precision"]), (&"cpu".into(), &"f64".into()));
}

#[test]
fn rows_come_at_the_times_asked_for() {
    // Neither the interval nor the final time is a multiple of τ = 0.001.
    let done = run("--curves 3 --points 41 --t-end 0.0217 --series 0.0013 --snapshots 0,0.00155,0.0217");
    let summary = done.summary();
    assert!(summary.iter().all(|row| row["t_end"] == "0.0217" && row["steps"] == "22"), "{summary:?}");
    for member in 0..3 {
        let of_member = |row: &Row| row["member"] == member.to_string();
        let series: Vec<Row> = done.rows("series.csv").into_iter().filter(of_member).collect();
        let asked: Vec<f64> = (0..=16).map(|row| f64::from(row) * 0.0013).collect();
        assert_eq!(column(&series, "t"), asked);
        let length = column(&series, "length");
        assert!(length.windows(2).all(|pair| pair[1] < pair[0]), "{length:?}");

        let snapshots: Vec<Row> = done.rows("snapshots.csv").into_iter().filter(of_member).collect();
        for (chunk, t) in snapshots.chunks(41).zip([0.0, 0.00155, 0.0217]) {
            assert!(chunk.iter().all(|row| number(row, "t") == t));
            assert!(chunk.iter().zip(1..).all(|(row, i): (_, u32)| row["i"] == i.to_string()));
        }
        assert_eq!(snapshots.len(), 3 * 41);
        // The first row of the series and the last snapshot are the two ends in the summary.
        let ends = &summary[member];
        assert_eq!((&series[0]["length"], &series[0]["excess"]), (&ends["length_start"], &ends["excess_start"]));
        let last: Vec<DVec2> = positions(&snapshots[82..]);
        let (found, told) = (curvelax::curve::polygon::length(&last), number(ends, "length_end"));
        assert!((found / told - 1.0).abs() < 1e-13, "{found} {told}");
    }
}

#[test]
fn the_last_step_is_as_short_as_the_final_time_demands() {
    let common = "--curves 3 --points 41 --solver direct --series 0.0217";
    let short = run(&format!("{common} --t-end 0.0217")).summary();
    // A longer run passes that time inside a step of full length.
    let long: Vec<Row> = run(&format!("{common} --t-end 0.03")).rows("series.csv");
    for (short, long) in short.iter().zip(long.iter().filter(|row| row["t"] == "0.0217")) {
        for name in ["length", "area", "excess", "energy"] {
            let (end, inside) = (number(short, &format!("{name}_end")), number(long, name));
            eprintln!("{name}: {end} by a short step, {inside} inside a whole one");
            assert!((end / inside - 1.0).abs() < 1e-4, "{name}: {end} {inside}");
        }
    }
    assert_eq!(long.len(), 6);
}

const SERIES_COLUMNS: [&str; 8] =
    ["length", "area", "excess", "energy", "k_min", "k_max", "mesh_ratio", "metric_drift"];

#[test]
fn a_row_inside_a_step_lies_on_the_line_between_its_ends() {
    let common = "--curves 2 --points 41 --t-end 0.02 --tau 0.001 --solver direct";
    let steps = run(&format!("{common} --series 0.001 --snapshots 0.004,0.005")).rows("series.csv");
    let inside = run(&format!("{common} --series 0.00125 --snapshots 0.0045")).rows("series.csv");
    let (steps, inside) = (&steps[..21], &inside[..17]);
    for row in inside {
        let (step, fraction) = ((number(row, "t") / 0.001 + 1e-9).floor(), (number(row, "t") / 0.001).fract());
        if !(1e-9..1.0 - 1e-9).contains(&fraction) {
            continue;
        }
        for name in SERIES_COLUMNS {
            let [a, b] = [0, 1].map(|next| number(&steps[step as usize + next], name));
            let error = number(row, name) - (a + fraction * (b - a));
            assert!(error.abs() < 1e-12 * (1.0 + b.abs()), "{name} at {}: {error:e}", row["t"]);
        }
    }
}

#[test]
fn interpolated_rows_are_as_near_to_small_steps_as_rows_on_steps() {
    let common = "--curves 1 --points 41 --t-end 0.3 --series 0.0125 --solver direct --amplitude 0";
    let exact = column(&run(&format!("{common} --tau 0.00003125")).rows("series.csv"), "excess");
    let error = |tau: &str| -> Vec<f64> {
        let found = column(&run(&format!("{common} --tau {tau}")).rows("series.csv"), "excess");
        assert_eq!(found.len(), 25);
        found.iter().zip(&exact).map(|(found, exact)| (found - exact).abs()).collect()
    };
    // Every second time is in the middle of a step of 0.005, and every time at the end of a step of 0.0025.
    let (coarse, fine) = (error("0.005"), error("0.0025"));
    eprintln!("{coarse:?}\n{fine:?}");
    for i in 4..25 {
        let ratio = coarse[i] / fine[i];
        assert!((1.6..2.4).contains(&ratio), "row {i}: {:e} and {:e}", coarse[i], fine[i]);
    }
}

#[test]
fn the_files_have_the_columns_of_the_manual() {
    let done = run("--curves 2 --points 33 --t-end 0.003 --series 0.001 --snapshots 0.002");
    let header = |name| done.text(name).lines().next().unwrap().to_owned();
    assert_eq!(
        header("summary.csv"),
        "member,cell,status,t_end,steps,rejected,sweeps_k,sweeps_x,t_relax,t_half,rate,rate_r2,length_start,\
         length_end,area_start,area_end,excess_start,excess_end,energy_start,energy_end,k_min,k_max,turning,\
         mesh_ratio,metric_drift,self_crossing,solves,t_limit,t_error,order,label,group,points,t_data_error,wulff_distance,t_vanish,reduced_area,\
         t_vanish_limit,t_vanish_error"
    );
    assert_eq!(
        header("levels.csv"),
        "member,level,cell,points,adaptive,precision,status,t_relax,solves,turn,excess_start,t_vanish,length_start,energy_start,energy_end"
    );
    assert_eq!(header("series.csv"), "member,t,length,area,excess,energy,k_min,k_max,mesh_ratio,metric_drift");
    assert_eq!(header("snapshots.csv"), "member,t,i,x,y,k,r");
    for row in done.summary() {
        assert_eq!((&*row["status"], &*row["t_relax"], &*row["t_half"]), ("unfinished", "", ""));
    }
}

#[test]
fn every_number_in_the_files_is_the_one_that_was_computed() {
    let spec = Spec {
        curves: 7,
        points: 37,
        t_end: Some(0.15.into()),
        relax_to: Some(0.6),
        series: Some(0.01),
        snapshots: vec![0.0, 0.0123],
        ..Spec::default()
    };
    let spec = spec.validate().unwrap();
    let done = run_with(&[("spec.toml", &spec.to_toml().unwrap())], "spec.toml");
    let mut backend = CpuBackend::<f64>::new(Blocks::new(37).unwrap(), SWEEPS, 1).unwrap();
    let mut members: Vec<Ended> = Vec::new();
    let family = Family::new(&spec).unwrap();
    simulate(&[Cell::only(spec.clone(), family)], Precision::F64, &mut backend, 0, &mut members).unwrap();

    let read = |row: &Row, names: &[&str]| -> Vec<Option<u64>> {
        names.iter().map(|name| (!row[*name].is_empty()).then(|| number(row, name).to_bits())).collect()
    };
    let bits = |values: &[f64]| -> Vec<Option<u64>> { values.iter().map(|value| Some(value.to_bits())).collect() };
    for (row, ended) in done.summary().iter().zip(&members) {
        let o = &ended.outcome;
        let (s, e) = (&o.start, &o.end);
        assert_eq!(read(row, &["t_relax", "t_half"]), [o.t_relax, o.t_half].map(|t| t.map(f64::to_bits)));
        let names = ["t_end", "length_start", "area_start", "excess_start", "energy_start"];
        assert_eq!(read(row, &names), bits(&[o.t_end, s.length, s.area, s.excess, s.energy]));
        let names = ["length_end", "area_end", "excess_end", "energy_end", "k_min", "k_max", "mesh_ratio"];
        assert_eq!(read(row, &names), bits(&[e.length, e.area, e.excess, e.energy, e.k_min, e.k_max, e.mesh_ratio]));
        assert_eq!(read(row, &["metric_drift"]), bits(&[e.metric_drift]));
        assert_eq!([&row["steps"], &row["sweeps_k"]], [&o.steps.to_string(), &o.sweeps_k.to_string()]);
    }
    assert!(members.iter().any(|ended| ended.outcome.t_relax.is_some()));

    let features = spec.cell_features();
    let names: Vec<&str> = features.iter().map(|feature| &*feature.name).collect();
    for (row, ended) in done.rows("members.csv").iter().zip(&members) {
        assert_eq!(read(row, &names), bits(&ended.features.0));
    }

    let series = done.rows("series.csv");
    let computed: Vec<_> = members.iter().flat_map(|ended| &ended.rows.series).collect();
    assert_eq!(series.len(), computed.len());
    for (row, c) in series.iter().zip(computed) {
        let at = &c.at;
        let values = [at.length, at.area, at.excess, at.energy, at.k_min, at.k_max, at.mesh_ratio, at.metric_drift];
        assert_eq!(read(row, &SERIES_COLUMNS), bits(&values));
        assert_eq!(number(row, "t").to_bits(), c.t.to_bits());
    }
    let snapshots = done.rows("snapshots.csv");
    let computed: Vec<_> = members.iter().flat_map(|ended| &ended.rows.snapshots).collect();
    assert_eq!(snapshots.len(), 37 * computed.len());
    for (i, row) in snapshots.iter().enumerate() {
        let (c, i) = (computed[i / 37], i % 37);
        assert_eq!(read(row, &["t", "x", "y", "k", "r"]), bits(&[c.t, c.x[i], c.y[i], c.k[i], c.r[i]]));
    }
}

#[test]
fn outputs_at_the_final_time_are_written_whatever_its_rounding() {
    let done = run("--curves 1 --tau 1e-6 --t-end 1e-5 --series 1e-6 --snapshots 1e-5 --solver direct");
    let text = done.text("series.csv");
    assert_eq!(text.lines().count(), 12);
    assert_eq!(number(&done.rows("series.csv")[10], "t"), 1e-5);
    assert_eq!(done.text("snapshots.csv").lines().count(), 101);
}
