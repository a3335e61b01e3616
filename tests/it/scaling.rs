//! A curve scaled by s gives the same results with times scaled by s⁴, whatever s: in metres as in nanometres.

use std::{fs, path::Path};

use glam::DVec2;

use crate::common::{
    command::done,
    program::{Done, Row, number, run_with},
};

/// A power of two loses no bits.
const EXACT: [f64; 5] = [1.0, 9.313225746154785e-10, 0.125, 1024.0, 1073741824.0];
const OTHERS: [f64; 5] = [1e-9, 1e-6, 0.1, 3.0, 1e9];
/// Steps that need no number from the user.
const PACES: [&str; 2] = ["--adaptive --pull auto --t-end auto", "--tau auto --solver direct --t-end auto"];
/// Columns with the power of the length that they are measured in.
const COLUMNS: [(&str, i32); 19] = [
    ("t_end", 4),
    ("steps", 0),
    ("rejected", 0),
    ("t_relax", 4),
    ("t_half", 4),
    ("rate", -4),
    ("rate_r2", 0),
    ("length_start", 1),
    ("length_end", 1),
    ("area_start", 2),
    ("area_end", 2),
    ("excess_start", 0),
    ("excess_end", 0),
    ("energy_start", -1),
    ("energy_end", -1),
    ("k_min", -1),
    ("k_max", -1),
    ("mesh_ratio", 0),
    ("metric_drift", 0),
];
/// Columns that must agree to rounding if the scale is not a power of two.
const SOLID: [&str; 7] = ["t_relax", "t_half", "length_start", "length_end", "area_start", "area_end", "excess_start"];

/// Bound of what differs by rounding alone, in f64.
const ROUNDING: f64 = 1e-8;

/// A table of points `s` times as large.
fn outline(points: &[DVec2], s: f64) -> String {
    points.iter().fold("x,y\n".to_string(), |text, p| text + &format!("{},{}\n", s * p.x, s * p.y))
}

fn nonconvex() -> Vec<DVec2> {
    crate::common::nodes(300, |u| {
        let (sine, cosine) = u.sin_cos();
        let bays = sine * (0.2 + sine * (3.0 * u).sin().powi(2));
        DVec2::new(cosine, 0.5 * sine + cosine.sin() + bays)
    })
}

fn island() -> Vec<DVec2> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/islands/jamaica.csv");
    let text = fs::read_to_string(path).unwrap();
    let point = |line: &str| {
        let (x, y) = line.split_once(',')?;
        Some(DVec2::new(x.trim().parse().ok()?, y.trim().parse().ok()?))
    };
    text.lines().filter_map(point).collect()
}

/// A run whose cells are the curve `name` at the scales `scales`.
fn scaled(name: &str, scales: &[f64], flags: &str) -> Done {
    let (mut files, mut shapes) = (Vec::new(), Vec::new());
    for (i, s) in scales.iter().enumerate() {
        shapes.push(match name {
            "ellipse" => format!("ellipse:{},{}", 2.0 * s, s),
            "circle" => format!("circle:{s}"),
            _ => format!("file:{i}.csv"),
        });
        let points = match name {
            "nonconvex" => nonconvex(),
            _ => island(),
        };
        files.push((format!("{i}.csv"), outline(&points, *s)));
    }
    let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    let sweep = format!("--sweep shape={} --common-random-numbers", shapes.join(";"));
    run_with(&files, &format!("--curves 3 --points 64 --amplitude 0.1 --relax-to 0.1 {flags} {sweep}"))
}

/// The rows of every cell of a run.
fn cells(done: &Done, count: usize) -> Vec<Vec<Row>> {
    let rows = done.summary();
    (0..count).map(|cell| rows.iter().filter(|row| row["cell"] == cell.to_string()).cloned().collect()).collect()
}

/// What a row says once lengths are divided by s, and how far it may be off: nothing if s is a power of two.
fn assert_scaled(what: &str, one: &Row, large: &Row, s: f64, bound: f64) {
    assert_eq!(one["status"], large["status"], "{what}, scaled by {s}");
    // Rounding in f32 may decide whether the last step ends at t_relax or, where that is near its start, continues.
    let ends_elsewhere =
        bound > ROUNDING && (number(large, "t_end") / s.powi(4) / number(one, "t_end") - 1.0).abs() > bound;
    for (column, power) in COLUMNS {
        if bound > 0.0 && (!SOLID.contains(&column) || (ends_elsewhere && column == "length_end")) {
            continue;
        }
        if one[column].is_empty() || large[column].is_empty() {
            assert_eq!(one[column], large[column], "{what}, scaled by {s}: {column}");
            continue;
        }
        let (expected, found) = (number(one, column), number(large, column) / s.powi(power));
        let gap = (found - expected).abs();
        assert!(gap <= bound * expected.abs(), "{what}, scaled by {s}: {column} {found:e}, not {expected:e}");
    }
}

#[test]
fn a_curve_of_any_size_relaxes_as_one_of_unit_size() {
    for name in ["ellipse", "circle", "nonconvex", "island"] {
        for pace in PACES {
            for (precision, bound) in [("f64", ROUNDING), ("f32", 1e-2)] {
                let what = format!("{name} {pace} {precision}");
                let scales = [&EXACT[..], &OTHERS].concat();
                let all = cells(&scaled(name, &scales, &format!("{pace} --precision {precision}")), scales.len());
                assert!(all[0].iter().all(|row| row["status"] == "relaxed"), "{what}: {:?}", all[0]);
                for (s, rows) in scales.iter().zip(&all) {
                    let bound = if EXACT.contains(s) { 0.0 } else { bound };
                    for (one, large) in all[0].iter().zip(rows) {
                        assert_scaled(&what, one, large, *s, bound);
                    }
                }
            }
        }
    }
}

/// The negative control: a rate of its own makes the same curve another problem at another size.
#[test]
fn a_number_for_a_rate_is_for_one_size_only() {
    let flags = format!("{} --omega 1", PACES[0]);
    let [one, small] = &cells(&scaled("ellipse", &[1.0, 0.125], &flags), 2)[..] else { panic!("two cells") };
    let times = |rows: &[Row], s: f64| rows.iter().map(|row| number(row, "t_relax") / s.powi(4)).collect::<Vec<_>>();
    assert_ne!(times(one, 1.0), times(small, 0.125));
}

#[test]
fn a_run_of_a_tiny_or_huge_curve_draws_its_pictures_and_repeats_from_its_spec() {
    for s in [1e-9, 1e9] {
        let shape = format!("--shape ellipse:{},{}", 2.0 * s, s);
        let done = run_with(&[], &format!("--curves 5 --points 40 --adaptive --pull auto --t-end auto {shape}"));
        for plot in ["curves", "excess", "relaxation"] {
            let svg = done.text(&format!("plots/{plot}.svg"));
            assert!(!["NaN", "inf", "0.00000000"].iter().any(|word| svg.contains(word)), "{plot} at {s}");
        }
        // Its spec has numbers in place of auto, and makes the same tables.
        let run: serde_json::Value = serde_json::from_str(&done.text("run.json")).unwrap();
        let t_end = run["spec"]["t-end"].as_f64().unwrap();
        assert_eq!(run["spec"]["stop-when-relaxed"], true);
        let flags = format!("--adaptive --pull auto --omega auto --stop-when-relaxed --t-end {t_end:e}");
        let again = run_with(&[], &format!("--curves 5 --points 40 {flags} {shape}"));
        for table in ["summary.csv", "ensemble.csv", "mean_excess.csv"] {
            assert_eq!(done.text(table), again.text(table), "{table} at {s}");
        }
    }
}

#[test]
fn a_member_that_does_not_relax_ends_at_the_cap() {
    // b = -2/9 k³ leaves the lemniscate where it is, for (L/2π)⁴; b = -2 k³ makes mode 2 of a circle grow.
    for (flags, cap) in [
        ("--shape lemniscate:1 --amplitude 0 --flow poly:0,0,-0.2222222222222222 --sampling parameter", 0.485),
        ("--shape flower:2:0.02 --amplitude 0 --flow poly:0,0,-2", 6.0 * 100_f64.ln() / 24.0),
    ] {
        let rows =
            run_with(&[], &format!("--curves 1 --points 64 --adaptive --pull auto --t-end auto {flags}")).summary();
        assert_eq!(rows[0]["status"], "unfinished", "{flags}");
        // Up to its rounding, and to the nodes.
        let t_end = number(&rows[0], "t_end");
        assert!((0.98..1.03).contains(&(t_end / cap)), "{flags}: {t_end} instead of {cap}");
    }
}

#[test]
fn shards_with_times_by_size_merge_to_the_whole_run() {
    let home = tempfile::tempdir().unwrap();
    let program = |arguments: &str| done(home.path(), &format!("{arguments} --quiet"));
    let study = "--backend cpu --threads 1 --curves 5 --points 34 --tau auto --solver direct --t-end auto --sweep \
                 shape=ellipse:2,1;circle:0.001;lemniscate:1";
    program(&format!("run {study} --out whole"));
    for shard in 0..3 {
        program(&format!("run {study} --shard {shard}/3 --out {shard}"));
    }
    program("merge 0 1 2 --out merged");
    let text = |folder: &str, name: &str| fs::read_to_string(home.path().join(folder).join(name)).unwrap();
    for name in ["summary.csv", "ensemble.csv", "mean_excess.csv", "plots/excess.svg"] {
        assert_eq!(text("whole", name), text("merged", name), "{name}");
    }
    // Each cell has its own times.
    let excess = text("whole", "mean_excess.csv");
    let last = |cell: &str| excess.lines().rfind(|line| line.starts_with(cell)).unwrap().to_owned();
    assert_ne!(last("0,").split(',').nth(1), last("1,").split(',').nth(1));
}

/// Every default that is meant for unit size gives way where no number says otherwise.
#[test]
fn a_small_curve_relaxes_with_the_defaults() {
    for shape in ["circle:0.1", "ellipse:0.2,0.1", "ellipse:2e-6,1e-6", "ellipse:200,100"] {
        for flags in ["--solver direct", "--adaptive", "--adaptive --pull auto"] {
            let rows = run_noted(&format!("--curves 4 --shape {shape} {flags}"));
            assert!(rows.iter().all(|row| row["status"] == "relaxed"), "{shape} {flags}: {rows:?}");
        }
    }
}

/// A run whose note about its times is not an error.
fn run_noted(arguments: &str) -> Vec<Row> {
    let done = run_with(&[], arguments);
    done.summary()
}

/// The radius of a circle under Willmore flow, R⁴ = R₀⁴ + 2Bt, and the rate of a small mode, 2·12·B/R⁴, in micrometres
/// and hours; a tenth of the mobility takes ten times as long.
#[test]
fn times_are_in_the_unit_of_the_mobility() {
    let circle = |mobility: &str, t_end: &str| {
        let flags = "--curves 1 --amplitude 0 --shape circle:5 --flow willmore --adaptive=1e-4 --pull auto";
        let done =
            run_with(&[], &format!("{flags} --units um,h --mobility {mobility} --t-end {t_end} --series {t_end}"));
        let rows = done.rows("series.csv");
        (number(&rows[0], "area"), number(&rows[1], "area"), done)
    };
    let grown = |mobility: f64, t: f64| ((625.0 + 2.0 * mobility * t) / 625.0_f64).sqrt();
    let (before, after, _) = circle("0.5", "400");
    assert!((after / before / grown(0.5, 400.0) - 1.0).abs() < 1e-3, "{}", after / before);
    // The negative control: without the mobility the circle would grow more.
    assert!((after / before / grown(1.0, 400.0) - 1.0).abs() > 0.05);
    let (_, slow, _) = circle("0.05", "4000");
    assert!((slow / after - 1.0).abs() < 1e-9, "{slow} {after}");

    let mode = "--curves 2 --shape flower:2:0.01 --amplitude 0 --points 200 --pull auto --relax-to 1e-4";
    for pace in ["--adaptive=1e-5 --t-end auto", "--tau auto --solver direct --t-end auto"] {
        let done = run_with(&[], &format!("{mode} {pace} --mobility 2e-3 --units µm,s"));
        let row = &done.summary()[0];
        let exact = 24.0 * 2e-3;
        assert!((number(row, "rate") / exact - 1.0).abs() < 0.01, "{pace}: {}", row["rate"]);
        assert!((number(row, "t_relax") * exact / 1e4_f64.ln() - 1.0).abs() < 0.01, "{pace}: {}", row["t_relax"]);
        // The axes, the page and run.json say so.
        assert!(done.text("plots/excess.svg").contains("s)") && !done.text("plots/excess.svg").contains("length⁴"));
        assert!(!done.text("report.html").contains("length⁴"));
        let run: serde_json::Value = serde_json::from_str(&done.text("run.json")).unwrap();
        assert_eq!((&run["spec"]["units"], &run["spec"]["mobility"]), (&"µm,s".into(), &2e-3.into()));
    }
}

#[test]
fn rates_and_times_given_as_numbers_are_in_the_unit_of_the_mobility_too() {
    let rows = |flags: &str| run_with(&[], &format!("--curves 2 --points 48 {flags}")).summary();
    let plain = "--omega 2 --pull 30 --t-end 1 --series 0.25";
    let slow = "--mobility 0.25 --omega 0.5 --pull 7.5 --t-end 4 --series 1";
    for (pace, long) in [("--adaptive", "--adaptive"), ("--tau 1e-3 --solver direct", "--tau 4e-3 --solver direct")] {
        let (one, other) = (rows(&format!("{pace} {plain}")), rows(&format!("{long} {slow}")));
        for (a, b) in one.iter().zip(&other) {
            assert_eq!(number(a, "t_relax") * 4.0, number(b, "t_relax"), "{pace}");
            assert_eq!(number(a, "rate"), number(b, "rate") * 4.0, "{pace}");
            assert_eq!((&a["steps"], &a["length_end"]), (&b["steps"], &b["length_end"]), "{pace}");
        }
    }
}
