//! Ensembles of outlines, as a user meets them: every outline a member with its label, copies of them, groups, and what
//! is refused.

use std::{collections::BTreeMap, f64::consts::TAU, fs, path::Path};

use curvelax::backend::gpu::Gpu;

use crate::common::command::{curvelax, done, stopped_run};
use tempfile::TempDir;

/// Outlines in the files of [`home`].
const GRAINS: usize = 7;

#[track_caller]
fn refused(home: &Path, arguments: &str, parts: &[&str]) {
    let output = curvelax(home, &format!("run {arguments} --out out"));
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
    assert!(parts.iter().all(|part| message.contains(part)), "{arguments}: {message}");
    assert!(!home.join("out").exists() && message.lines().count() == 1, "{arguments}: {message}");
}

/// Points of grain `j`: of radius 0.5 to 2, with waves that differ from grain to grain.
fn grain(j: usize) -> Vec<[f64; 2]> {
    let radius = 0.5 + 0.25 * j as f64;
    let point = |i: usize| {
        let angle = TAU * i as f64 / 48.0;
        let wave = 1.0 + 0.1 * (2.0 * angle + j as f64).cos() + 0.02 * j as f64 * (3.0 * angle).cos();
        [100.0 + radius * wave * angle.cos(), radius * wave * angle.sin()]
    };
    (0..48).map(point).collect()
}

/// A folder with the grains as features of `grains.geojson`, and one by one in `csv`.
fn home() -> TempDir {
    let home = TempDir::new().unwrap();
    fs::create_dir(home.path().join("csv")).unwrap();
    let mut features = Vec::new();
    for j in 0..GRAINS {
        let points = grain(j);
        let text: String = points.iter().map(|[x, y]| format!("{x:?},{y:?}\n")).collect();
        fs::write(home.path().join(format!("csv/grain-{j}.csv")), text).unwrap();
        let ring: Vec<[f64; 2]> = points.iter().chain(&points[..1]).copied().collect();
        let mut properties = serde_json::json!({ "name": format!("grain {j}, \"{}\"", j * j) });
        if j != 3 {
            properties["phase"] = if j % 2 == 0 { "alpha".into() } else { "beta".into() };
        }
        let geometry = serde_json::json!({ "type": "Polygon", "coordinates": [ring] });
        features.push(serde_json::json!({ "type": "Feature", "properties": properties, "geometry": geometry }));
    }
    let all = serde_json::json!({ "type": "FeatureCollection", "crs": null, "features": features });
    fs::write(home.path().join("grains.geojson"), all.to_string()).unwrap();
    home
}

/// The rows of a table under their headings.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut table = csv::Reader::from_path(path).unwrap();
    let names: Vec<String> = table.headers().unwrap().iter().map(String::from).collect();
    let row = |row: csv::StringRecord| names.iter().cloned().zip(row.iter().map(String::from)).collect();
    table.records().map(|record| row(record.unwrap())).collect()
}

/// All files of a run but `run.json` and `shard.state`, by name.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for folder in [folder.to_path_buf(), folder.join("plots")] {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            if path.is_file() && !["run.json", "shard.state"].contains(&&*name) {
                all.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    all
}

const RUN: &str = "--backend cpu --adaptive=1e-3 --points 40 --t-end auto";

#[test]
fn every_outline_is_a_member_that_is_the_same_alone() {
    let home = home();
    let home = home.path();
    done(home, &format!("run --shape file:grains.geojson {RUN} --out features"));
    done(home, &format!("run --shape files:csv/*.csv {RUN} --out files"));
    let (features, files) = (rows(&home.join("features/summary.csv")), rows(&home.join("files/summary.csv")));
    assert_eq!((features.len(), files.len()), (GRAINS, GRAINS));
    for j in 0..GRAINS {
        assert_eq!(features[j]["label"], format!("grain {j}, \"{}\"", j * j));
        assert_eq!(files[j]["label"], format!("grain-{j}"));
        let t_end = &features[j]["t_end"];
        assert!(features[j]["status"] == "relaxed" && features[j]["t_relax"] == files[j]["t_relax"], "{j} at {t_end}");
        // The final time of the cell is that of the largest one.
        let spec = fs::read_to_string(home.join("features/run.json")).unwrap();
        let spec: serde_json::Value = serde_json::from_str(&spec).unwrap();
        let t_end = spec["spec"]["t-end"].as_f64().unwrap();
        let alone = format!("run --shape file:csv/grain-{j}.csv --curves 1 --amplitude 0 {RUN} --out alone --force");
        done(home, &alone.replace("--t-end auto", &format!("--t-end {t_end:?} --stop-when-relaxed")));
        let alone = rows(&home.join("alone/summary.csv"));
        assert_eq!(alone[0]["label"], format!("grain-{j}"));
        for column in ["t_relax", "t_half", "rate", "excess_start", "area_end", "k_max", "solves"] {
            assert_eq!(alone[0][column], features[j][column], "{column} of {j}");
        }
    }
    // The control: other grains have other times.
    assert_ne!(features[0]["t_relax"], features[1]["t_relax"]);
}

#[test]
fn copies_are_perturbed_and_rank_after_all_outlines() {
    let home = home();
    let home = home.path();
    done(home, &format!("run --shape file:grains.geojson --curves 3 {RUN} --out copies"));
    done(home, &format!("run --shape file:grains.geojson --curves 3 --amplitude 0 {RUN} --out equal"));
    let (copies, equal) = (rows(&home.join("copies/summary.csv")), rows(&home.join("equal/summary.csv")));
    assert_eq!((copies.len(), equal.len()), (3 * GRAINS, 3 * GRAINS));
    for j in 0..GRAINS {
        for copy in [GRAINS, 2 * GRAINS] {
            assert_eq!(copies[j]["label"], copies[j + copy]["label"]);
            assert_eq!(equal[j]["t_relax"], equal[j + copy]["t_relax"]);
            assert_ne!(copies[j]["t_relax"], copies[j + copy]["t_relax"]);
        }
    }
    let spec = done(home, "run --shape file:grains.geojson --print-spec");
    assert!(spec.contains("curves = 1\noutlines = 7\n") && spec.contains("amplitude = 0.0"), "{spec}");
    fs::write(home.join("spec.toml"), spec).unwrap();
    let again = done(home, "run spec.toml --print-spec");
    assert_eq!(again, fs::read_to_string(home.join("spec.toml")).unwrap());
    let perturbed = done(home, "run --shape file:grains.geojson --curves 256 --print-spec");
    assert!(
        perturbed.contains("curves = 256\noutlines = 7\n") && perturbed.contains("amplitude = 0.05"),
        "{perturbed}"
    );
}

#[test]
fn groups_are_the_ensembles_of_their_members() {
    let home = home();
    let home = home.path();
    let run = format!("run --shape file:grains.geojson --curves 9 --group-by phase --refine --modes 2..=4 {RUN}");
    let said = done(home, &format!("{run} --out all"));
    let groups = rows(&home.join("all/groups.csv"));
    let names: Vec<&str> = groups.iter().map(|row| &*row["group"]).collect();
    assert_eq!(names, ["(none)", "alpha", "beta"]);
    let summary = rows(&home.join("all/summary.csv"));
    for group in &groups {
        let members = summary.iter().filter(|row| row["group"] == group["group"]).map(|row| row["member"].clone());
        let members: Vec<String> = members.collect();
        assert_eq!(group["members"], members.len().to_string());
        done(home, &format!("{run} --only {} --out some --force", members.join(",")));
        let alone = &rows(&home.join("some/ensemble.csv"))[0];
        for (name, value) in group.iter().filter(|(name, _)| *name != "group") {
            assert_eq!(value, &alone[name], "{name} of {}", group["group"]);
        }
    }
    assert_ne!(groups[1]["t_relax_median"], groups[2]["t_relax_median"]);
    assert!(said.contains("phase alpha: t_limit median ") && said.contains("\ngroups "), "{said}");
    let svg = fs::read_to_string(home.join("all/plots/groups.svg")).unwrap();
    assert!(svg.contains("alpha") && svg.contains("by phase"));
    let page = fs::read_to_string(home.join("all/report.html")).unwrap();
    assert!(page.contains("<p class=\"title\">By phase: t_limit; ") && page.contains("beta"));
    // Pictures are drawn again without the files of the outlines.
    fs::remove_file(home.join("grains.geojson")).unwrap();
    let before = content(&home.join("all"));
    fs::remove_file(home.join("all/plots/groups.svg")).unwrap();
    done(home, "plot all");
    assert_eq!(content(&home.join("all")), before);
}

#[test]
fn copies_of_an_outline_are_paired_between_cells_not_compared_as_independent_draws() {
    let home = home();
    let home = home.path();
    let grouped = format!("run --shape file:grains.geojson --group-by phase {RUN} --out");
    let output = curvelax(home, &format!("{grouped} copies --curves 20"));
    let [table, said] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(table.contains("groups     not compared: members are copies of the same outlines"), "{table}");
    assert!(said.contains("they hold for these outlines, not for a population"), "{said}");
    assert!(said.contains("the outline `grain 3, \"9\"` of 7 have no property phase"), "{said}");
    let once = curvelax(home, &format!("{grouped} once"));
    let [table, said] = [once.stdout, once.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(!table.contains("copies") && !said.contains("not for a population"), "{table}{said}");
    let swept = done(home, &format!("run --shape file:grains.geojson --sweep omega=auto,0 {RUN} --out swept"));
    assert!(swept.contains("pairs ") && !swept.contains("log-rank"), "{swept}");
}

#[test]
fn shards_of_outlines_merge_into_the_run() {
    let home = home();
    let home = home.path();
    let run = format!("run --shape files:csv/*.csv --curves 2 --group-by file --refine --modes 2..=4 {RUN}");
    done(home, &format!("{run} --out whole"));
    for shard in 0..3 {
        done(home, &format!("{run} --shard {shard}/3 --out part-{shard}"));
    }
    done(home, "merge part-0 part-1 part-2 --out merged --quiet");
    let (whole, merged) = (content(&home.join("whole")), content(&home.join("merged")));
    assert!(whole.contains_key("groups.csv") && whole.contains_key("summary.csv"));
    for (name, bytes) in &whole {
        assert!(merged.get(name) == Some(bytes), "{name} differs");
    }
    // The control.
    assert_ne!(content(&home.join("part-0"))["summary.csv"], whole["summary.csv"]);
}

#[test]
fn a_run_of_outlines_continues_with_those_that_it_read() {
    let home = home();
    let home = home.path();
    let run = format!("run --shape files:csv/*.csv --curves 200 --threads 1 {RUN} --quiet");
    stopped_run(home, &run, "stopped");
    // Neither one more nor one that has changed makes a difference to it.
    let triangle = "0,0\n1,0\n0,1\n";
    let original = fs::read(home.join("csv/grain-2.csv")).unwrap();
    ["csv/grain-9.csv", "csv/grain-2.csv"].iter().for_each(|name| fs::write(home.join(name), triangle).unwrap());
    done(home, "resume stopped --quiet");
    done(home, &format!("{run} --out changed"));
    fs::remove_file(home.join("csv/grain-9.csv")).unwrap();
    fs::write(home.join("csv/grain-2.csv"), original).unwrap();
    done(home, &format!("{run} --out at-once"));
    assert_eq!(content(&home.join("stopped")), content(&home.join("at-once")));
    // They do to a new one.
    assert_ne!(content(&home.join("changed")), content(&home.join("at-once")));
}

#[test]
fn outlines_of_very_different_sizes_all_relax_in_their_own_times() {
    let home = TempDir::new().unwrap();
    let home = home.path();
    for (name, size) in [("small", 1e-3), ("middle", 1.0), ("large", 300.0)] {
        let text: String = grain(1).iter().map(|[x, y]| format!("{:?},{:?}\n", size * (x - 100.0), size * y)).collect();
        fs::write(home.join(format!("{name}.csv")), text).unwrap();
    }
    let output = curvelax(home, "run --shape files:*.csv --adaptive=1e-3 --points 40 --backend cpu --out out");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(0) && said.contains("used --t-end auto"), "{said}");
    let times: BTreeMap<String, f64> = rows(&home.join("out/summary.csv"))
        .into_iter()
        .map(|row| (row["label"].clone(), row["t_relax"].parse().unwrap()))
        .collect();
    for (name, size) in [("small", 1e-3_f64), ("large", 300.0)] {
        let ratio = times[name] / (times["middle"] * size.powi(4));
        assert!((ratio - 1.0).abs() < 1e-9, "{name}: {ratio}");
    }
}

#[test]
fn an_accuracy_is_asked_of_each_outline() {
    let home = home();
    let home = home.path();
    let shape = "run --shape file:grains.geojson --accurate --points 64 --backend cpu --quiet";
    let errors = |out: &str| -> Vec<f64> {
        let number = |row: &BTreeMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
        let rows = rows(&home.join(out).join("summary.csv"));
        rows.iter().map(|row| number(row, "t_error") / number(row, "t_limit")).collect()
    };
    done(home, &format!("{shape} --out before"));
    let (before, goal) = (errors("before"), 2e-5);
    assert!(before.iter().any(|error| *error > goal), "{before:?}");
    done(home, &format!("{shape} --accuracy {goal} --out reached"));
    let reached = errors("reached");
    assert!(reached.len() == GRAINS && reached.iter().all(|error| *error <= goal), "{reached:?}");
    // Their number is given, and n was chosen.
    let run: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(home.join("reached/run.json")).unwrap()).unwrap();
    assert!(run["spec"]["points"].as_u64().is_some_and(|points| points > 64), "{}", run["spec"]);
}

#[test]
fn wrong_requests_are_one_clear_message_before_any_work() {
    let home = home();
    let home = home.path();
    fs::write(home.join("csv/triangle.txt"), "0,0\n1,0\n0,1\n").unwrap();
    for (arguments, parts) in [
        ("--shape files:none/*.csv", &["there is no folder none in "][..]),
        ("--shape files:csv/*.csv --group-by phase", &["--group-by phase: no outline has such a property", "file"]),
        ("--shape file:grains.geojson --group-by phse", &["they have name, phase, file"]),
        ("--group-by phase", &["the shape is one curve"]),
        ("--outlines 3", &["--outlines 3: the shape ellipse:2,1 is one curve"]),
        ("--shape file:grains.geojson --outlines 6", &["--outlines 6: file:grains.geojson has 7 outlines"]),
        ("--shape file:grains.geojson --curves 0", &["--curves 0"]),
        ("--shape file:grains.geojson --curves 200000000", &["--curves 200000000: ", "1400000000 members"]),
        ("--shape files:csv/* --sampling points", &["`grain-0` has 48 points, `triangle` 3"]),
        ("--sweep shape=file:grains.geojson;ellipse:2,1", &["a shape that is one curve; run them apart"]),
        ("--sweep shape=files:csv/*.csv;files:csv/*", &["has 7 outlines, files:csv/* 8 outlines"]),
        ("--shape file:grains.geojson --only 7", &["--only"]),
    ] {
        refused(home, arguments, parts);
    }
    // clap says two lines more.
    let empty = curvelax(home, "run --shape files: --out out");
    assert!(empty.status.code() == Some(2) && String::from_utf8_lossy(&empty.stderr).contains("no pattern given"));
    // A valid neighbour of these.
    done(home, &format!("run --sweep shape=file:grains.geojson;files:csv/*.csv {RUN} --out out"));
    assert_eq!(rows(&home.join("out/summary.csv")).len(), 2 * GRAINS);
}

#[test]
fn labels_that_other_programs_misread_are_written_as_they_are_with_one_warning_each() {
    let home = TempDir::new().unwrap();
    let names = ["NA", "=1+1", "None", "@a"];
    let rows: String = names.iter().map(|name| format!("0,0,{name}\n1,0,{name}\n1,1,{name}\n0,2,{name}\n")).collect();
    fs::write(home.path().join("odd.csv"), format!("x,y,label\n{rows}")).unwrap();
    let line = "run --backend cpu --shape file:odd.csv --points 20 --tau 1e-3 --t-end 2e-3 --solver direct --out out";
    let output = curvelax(home.path(), line);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{message}");
    for said in [
        "the label `NA` and 1 other would be a missing value to pandas: read the tables with keep_default_na=False",
        "the label `=1+1` and 1 other may be evaluated as a formula by a spreadsheet: import the column label as text",
    ] {
        assert_eq!(message.matches(&format!("warning: {said}")).count(), 1, "{message}");
    }
    let labels: Vec<String> =
        self::rows(&home.path().join("out/summary.csv")).iter().map(|row| row["label"].clone()).collect();
    assert_eq!(labels, names);
}

/// The 1.5:1 ellipse by `n` points.
fn ellipse(n: usize) -> String {
    let point = |i: usize| TAU * i as f64 / n as f64;
    (0..n).map(|i| format!("{:?},{:?}\n", 1.5 * point(i).cos(), point(i).sin())).collect()
}

#[test]
fn a_smooth_outline_by_few_points_has_the_time_of_the_curve() {
    let home = TempDir::new().unwrap();
    let home = home.path();
    let run = "run --accurate --backend cpu --curves 1 --amplitude 0 --quiet";
    let row = |out: &str| rows(&home.join(out).join("summary.csv")).remove(0);
    let number = |row: &BTreeMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
    done(home, &format!("{run} --shape ellipse:1.5,1 --points 200 --out truth"));
    let (truth, row_of_truth) = (number(&row("truth"), "t_limit"), row("truth"));
    assert_eq!(row_of_truth["t_data_error"], "");
    for (points, bound) in [(40, 1e-3), (60, 3e-4), (100, 1e-4)] {
        fs::write(home.join("ellipse.csv"), ellipse(points)).unwrap();
        let output = curvelax(home, &format!("{run} --shape file:ellipse.csv --out by-points --force"));
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(0) && !said.contains("warning"), "{said}");
        let own = row("by-points");
        let error = (number(&own, "t_limit") - truth).abs();
        assert!(error < bound * truth && error < number(&own, "t_error"), "{points}: {error:e}");
        assert!(number(&own, "t_data_error") < bound * truth, "{points}: {own:?}");
        // The control: the polygon is another curve, and says so.
        done(home, &format!("{run} --shape file:ellipse.csv --interpolate polygon --out straight --force"));
        let straight = row("straight");
        assert!((number(&straight, "t_limit") - truth).abs() > bound * truth, "{points}: {straight:?}");
        assert!(number(&straight, "t_data_error") > bound * truth, "{points}: {straight:?}");
    }
}

#[test]
fn keys_of_outlines_are_refused_where_there_is_none() {
    let home = home();
    let home = home.path();
    for (arguments, parts) in [
        ("--interpolate spline", &["--interpolate spline: the shape ellipse:2,1 is a formula"][..]),
        ("--sweep rounding=0.001,0.002", &["--rounding (swept): the shape ellipse:2,1 is a formula"]),
        ("--shape files:csv/*.csv --rounding 1", &["--rounding 1: not a radius", "0.0001 to 0.02"]),
        ("--shape files:csv/*.csv --sampling points --rounding 0.002", &["the nodes are the points"]),
    ] {
        refused(home, arguments, parts);
    }
}

/// A star of five points, whose tips and dents are corners.
fn star() -> String {
    let radius = |i: usize| if i.is_multiple_of(2) { 1.0 } else { 0.55 };
    let point = |i: usize| (TAU * i as f64 / 10.0).sin_cos();
    (0..10).map(|i| format!("{:?},{:?}\n", radius(i) * point(i).1, radius(i) * point(i).0)).collect()
}

#[test]
fn the_overview_says_what_outlines_were_taken_as_and_the_dry_run_counts_their_other_curves() {
    let home = TempDir::new().unwrap();
    let home = home.path();
    fs::write(home.join("round.csv"), ellipse(60)).unwrap();
    fs::write(home.join("star.csv"), star()).unwrap();
    let run = "run --accurate --backend cpu --points 64 --shape files:*.csv";
    let line = |flags: &str| {
        let told = done(home, &format!("{run} {flags} --out out --force"));
        told.lines().find_map(|line| Some(line.strip_prefix("outlines   ")?.to_owned())).unwrap()
    };
    let told = line("");
    assert!(
        told.starts_with(
            "1 interpolated by a spline, 1 interpolated as a polygon; corners of 1 were rounded: the area changed by"
        ),
        "{told}"
    );
    assert_eq!(line("--interpolate polygon --rounding 0"), "2 interpolated as a polygon");
    // The ellipse by half the points, and the star with twice the radius: levels 103 and 203 and their like.
    let varied = |flags: &str| {
        let estimate = done(home, &format!("{run} {flags} --dry-run --json"));
        serde_json::from_str::<serde_json::Value>(&estimate).unwrap()["varied_members"].as_u64().unwrap()
    };
    assert_eq!([varied(""), varied("--rounding 0"), varied("--refine=false")], [2, 1, 0]);
    done(home, &format!("{run} --out out --force"));
    let rows = rows(&home.join("out/levels.csv"));
    assert_eq!(rows.iter().filter(|row| row["level"].parse::<u64>().unwrap() > 100).count(), 2);
}

#[test]
fn outlines_have_their_times_and_errors_on_a_gpu_too() {
    if Gpu::list().is_empty() {
        assert!(std::env::var_os("ALLOW_NO_GPU").is_some(), "no adapter; ALLOW_NO_GPU=1 allows for that");
        return;
    }
    let home = TempDir::new().unwrap();
    let home = home.path();
    fs::write(home.join("round.csv"), ellipse(60)).unwrap();
    fs::write(home.join("star.csv"), star()).unwrap();
    let rows_on = |backend: &str| {
        done(
            home,
            &format!("run --accurate --points 64 --shape files:*.csv --backend {backend} --quiet --out {backend}"),
        );
        rows(&home.join(backend).join("summary.csv"))
    };
    for (cpu, gpu) in rows_on("cpu").iter().zip(&rows_on("gpu")) {
        for column in ["t_limit", "t_error"] {
            let [cpu, gpu] = [cpu, gpu].map(|row| row[column].parse::<f64>().unwrap());
            assert!((cpu - gpu).abs() <= 1e-6 * cpu, "{column}: {cpu} {gpu}");
        }
        assert_eq!((&cpu["points"], cpu["t_data_error"].is_empty()), (&gpu["points"], gpu["t_data_error"].is_empty()));
    }
}
