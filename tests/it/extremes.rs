//! Numbers at the ends of their ranges: seeds beyond the integers of TOML, curves and times beyond those of a
//! precision. Each is refused before the run, or ends its member with a status; everything written reads back.

use std::{fs, process::Output};

use crate::common::{
    command::curvelax,
    program::{Row, number, run_with},
};
use tempfile::TempDir;

/// The first seed that is not a number in TOML, and the last of all.
const SEEDS: [u64; 2] = [1 << 63, u64::MAX];
/// A study that ends at once.
const SMALL: &str = "--curves 4 --points 34 --tau 1e-3 --t-end 0.01 --solver direct --backend cpu --quiet";

/// The output on stdout and on stderr, if it ended with this code.
#[track_caller]
fn said(output: &Output, code: i32) -> [String; 2] {
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(code), "{err}");
    [out, err]
}

#[test]
fn every_seed_is_run_printed_swept_cut_into_shards_and_merged() {
    for seed in SEEDS {
        let home = TempDir::new().unwrap();
        let path = home.path();
        let done = |arguments: &str| said(&curvelax(path, arguments), 0);
        let [printed, _] = done(&format!("run {SMALL} --seed {seed} --print-spec"));
        fs::write(path.join("spec.toml"), &printed).unwrap();
        assert_eq!(done("run spec.toml --print-spec")[0], printed);
        done("run spec.toml --quiet --out whole");
        for line in ["resume whole", "run spec.toml --quiet --resume --out whole", "plot whole"] {
            done(line);
        }
        for shard in 0..2 {
            done(&format!("run {SMALL} --seed {seed} --shard {shard}/2 --out s{shard}"));
        }
        done("merge s0 s1 --out merged");
        done(&format!("run {SMALL} --sweep seed=7,{seed} --common-random-numbers --out swept"));
        let rows = |run: &str, first: usize| -> Vec<String> {
            let text = fs::read_to_string(path.join(run).join("summary.csv")).unwrap();
            let results = |line: &str| line.split(',').skip(2).collect::<Vec<_>>().join(",");
            text.lines().skip(1 + first).take(4).map(results).collect()
        };
        assert_eq!(rows("merged", 0), rows("whole", 0));
        assert_eq!(rows("swept", 4), rows("whole", 0));
        assert_ne!(rows("swept", 0), rows("whole", 0), "the seed does not matter");
        let run: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(path.join("whole/run.json")).unwrap()).unwrap();
        assert_eq!(run["seed"], seed);
        // Shards with two different seeds are not of one study.
        done(&format!("run {SMALL} --seed {} --shard 1/2 --out other", seed - 1));
        let [_, err] = said(&curvelax(path, "merge s0 other --out mixed"), 2);
        assert!(err.contains("seed is "), "{err}");
    }
}

#[test]
fn what_is_no_seed_is_refused_with_the_range() {
    let home = TempDir::new().unwrap();
    for text in ["seed = -1", "seed = '-1'", "seed = '18446744073709551616'", "seed = 'one'", "seed = 1.5"] {
        fs::write(home.path().join("spec.toml"), text).unwrap();
        let [_, err] = said(&curvelax(home.path(), "run spec.toml --print-spec"), 2);
        assert!(err.contains("expected a whole number from 0 to 18446744073709551615"), "{text}: {err}");
    }
}

#[test]
fn a_curve_whose_times_are_no_numbers_is_refused_with_its_cell_before_the_run() {
    let home = TempDir::new().unwrap();
    fs::write(home.path().join("q.csv"), "x,y\n1e-160,0\n0,5e-161\n-1e-160,0\n0,-5e-161\n").unwrap();
    for line in ["--adaptive", "", "--adaptive --precision f32", "--dry-run"] {
        let line = format!("run --sweep shape=ellipse:2,1;file:q.csv {line} --backend cpu --out out");
        let [_, err] = said(&curvelax(home.path(), &line), 2);
        for part in ["--shape file:q.csv: the outline extends over no more than 2e-160", "shape = file:q.csv)"] {
            assert!(err.contains(part), "{part:?} is not in: {err}");
        }
        assert!(!home.path().join("out").exists(), "{line}");
    }
    for times in ["--t-end 1e-320 --tau 1e-320", "--t-end 1e-301 --adaptive", "--t-end 1e301 --adaptive --omega 0"] {
        let [_, err] = said(&curvelax(home.path(), &format!("run {times} --out out")), 2);
        assert!(err.contains("--t-end ") && err.contains("1e-300 to 1e300"), "{err}");
    }
}

/// Runs one member, which must leave a row that reads back, and draws it again from its files.
#[track_caller]
fn one(arguments: &str) -> Row {
    let line = format!("--curves 1 --points 34 {arguments}");
    let done = run_with(&[], &line);
    said(&curvelax(done.home.path(), "plot out"), 0);
    let row = done.summary().remove(0);
    assert!(number(&row, "t_end") >= 0.0, "{line}: {row:?}");
    row
}

#[test]
fn a_time_that_the_clock_cannot_count_stalls_the_member_within_its_steps() {
    for precision in ["f32", "f64"] {
        for solver in ["direct", "gauss-seidel"] {
            for (member, tolerance) in [
                ("--shape circle:1e-15 --omega 1 --t-end 2", 1e-3),
                ("--omega 0 --t-end 1e100", 1e-3),
                ("--t-end 1e184 --omega 0", 0.1),
            ] {
                let line = format!("{member} --adaptive={tolerance} --precision {precision} --solver {solver}");
                let row = one(&line);
                assert_eq!((row["status"].as_str(), number(&row, "t_end")), ("stalled", 0.0), "{line}");
                assert!(number(&row, "steps") == 0.0 && number(&row, "rejected") < 100.0, "{line}");
            }
        }
    }
    // Controls: a time that it can count, and a curve that is already singular.
    for (line, status) in [
        ("--shape circle:1e-15 --adaptive --t-end 1e-60 --stop-when-relaxed", "relaxed"),
        ("--omega 0 --t-end 1e4 --adaptive --pull auto --stop-when-relaxed", "relaxed"),
        ("--shape lemniscate:1 --amplitude 0 --adaptive", "singular"),
        ("--shape lemniscate:0.1 --amplitude 0 --adaptive --precision f32", "singular"),
    ] {
        assert_eq!(one(line)["status"], status, "{line}");
    }
}

#[test]
fn a_curve_too_large_to_move_in_its_time_stays_where_it_is() {
    for (precision, shapes) in
        [("f32", &["circle:1e6", "ellipse:3e7,1e7"][..]), ("f64", &["circle:1e12", "ellipse:1e15,1e15", "circle:1e25"])]
    {
        for steps in ["--adaptive", "--solver direct", "", "--adaptive --solver gauss-seidel"] {
            for shape in shapes {
                let line = format!("--shape {shape} --omega 0 {steps} --precision {precision} --t-end 0.1");
                let row = one(&line);
                assert_eq!((row["status"].as_str(), row["t_end"].as_str()), ("unfinished", "0.1"), "{line}");
                let [before, after] = ["area_start", "area_end"].map(|column| number(&row, column));
                assert!((after / before - 1.0).abs() < 1e-5, "{line}: {row:?}");
            }
        }
    }
}

#[test]
fn a_law_or_a_step_beyond_the_precision_ends_the_member_as_nonfinite() {
    for line in [
        "--shape circle:1e-15 --precision f32 --t-end 2",
        "--shape circle:1e-30 --t-end 1e200 --tau 1e199 --omega 0",
        "--shape circle:1e-12 --flow poly:0,0,0,0,0,0,0,1 --precision f32 --adaptive --t-end 1e-48",
        "--shape circle:1e-30 --flow poly:0,0,0,0,0,0,0,1e200 --adaptive --t-end 1e-120",
        "--shape circle:1e9 --omega 1e5 --precision f32 --adaptive --t-end 1e4",
        "--shape circle:1e12 --omega 0 --precision f32 --adaptive",
        "--shape circle:1e12 --omega 0 --precision f32",
    ] {
        for solver in ["direct", "gauss-seidel"] {
            let row = one(&format!("{line} --solver {solver}"));
            assert_eq!((row["status"].as_str(), row["steps"].as_str()), ("nonfinite", "0"), "{line}");
        }
    }
}
