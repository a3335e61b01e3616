//! `curvelax bench`: the requested rows, consistent numbers, and wrong requests refused.

use std::process::Output;

use curvelax::solver::Solver;
use serde_json::Value;

use crate::common::command::curvelax;

const QUICK: &str = "--seconds 0.06 --repeats 3 --quiet";

fn bench(arguments: &str) -> Output {
    let home = tempfile::TempDir::new().unwrap();
    curvelax(home.path(), &format!("bench {arguments}"))
}

/// The rows of `bench ARGUMENTS --json`, which must succeed with nothing on stderr.
#[track_caller]
fn rows(arguments: &str) -> Vec<Value> {
    let output = bench(&format!("{arguments} {QUICK} --json"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.is_empty(), "{arguments}: {said}");
    let benches: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(benches["repeats"], 3);
    benches["rows"].as_array().expect("rows").clone()
}

#[track_caller]
fn number(row: &Value, path: &str) -> f64 {
    row.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number {path} in {row}"))
}

#[test]
fn every_solver_and_precision_on_the_cpu_has_a_row_whose_numbers_agree() {
    let rows = rows("--backend cpu --points 24,50 --threads 1");
    let case = |row: &Value| format!("{} {} {} {}", row["backend"], row["solver"], row["precision"], row["points"]);
    let cases: Vec<String> = rows.iter().map(case).collect();
    let expected = ["24", "50"].iter().flat_map(|n| {
        let solvers = Solver::NAMES.into_iter().rev();
        solvers.flat_map(move |s| ["f64", "f32"].map(|p| format!("\"cpu\" \"{s}\" \"{p}\" {n}")))
    });
    assert_eq!(cases, expected.collect::<Vec<_>>());
    for row in &rows {
        assert!(row["failed"].is_null() && row["adapter"].is_null(), "{row}");
        assert_eq!(row["threads"], 1);
        assert!(number(row, "/curve_steps") > 0.0 && number(row, "/curves") > 0.0, "{row}");
        let [median, min, max] = ["median", "min", "max"].map(|of| number(row, &format!("/steps_per_second/{of}")));
        assert!(0.0 < min && min <= median && median <= max, "{row}");
        assert_eq!(row["steps_per_second"]["windows"].as_array().unwrap().len(), 3);
        let per_node = 1e9 / (median * number(row, "/points"));
        assert!((number(row, "/nanoseconds_per_node") / per_node - 1.0).abs() < 1e-12, "{row}");
        match row["solver"].as_str() {
            Some("direct") => assert!(row["sweeps_per_step"].is_null(), "{row}"),
            // Curves at rest need none.
            _ => assert!(number(row, "/sweeps_per_step") > 0.5, "{row}"),
        }
    }
}

#[test]
fn adaptive_steps_are_measured_with_solvers_that_profit_from_them() {
    let rows = rows("--backend cpu --precision f64 --points 32 --adaptive --curves 2");
    let solvers: Vec<_> = rows.iter().map(|row| row["solver"].as_str().unwrap()).collect();
    assert_eq!(solvers, ["direct"]);
    for row in &rows {
        assert_eq!((&row["curves"], row["adaptive"].as_f64()), (&Value::from(2), Some(1e-3)));
        // The shortest attempt, of order 2, makes one step and two of half the length.
        assert!(row["curve_steps"].as_u64().unwrap() >= 3 * 2, "{row}");
    }
}

#[test]
fn a_case_that_cannot_run_has_its_reason_in_its_row_and_the_others_continue() {
    let rows = rows("--backend cpu --solver direct --precision f32 --points 401,32");
    let reason = rows[0]["failed"].as_str().expect("a reason");
    assert!(reason.contains("verified against f64 up to"), "{reason}");
    assert!(rows[0]["steps_per_second"].is_null() && rows[0]["curve_steps"] == 0, "{}", rows[0]);
    assert!(rows[1]["failed"].is_null() && number(&rows[1], "/curve_steps") > 0.0, "{}", rows[1]);
}

#[test]
fn the_table_has_a_line_for_each_row_under_a_header() {
    let output = bench(&format!("--backend cpu --solver direct --points 32 --threads 1 {QUICK}"));
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3, "{text}");
    assert!(lines[0].starts_with("back end") && lines[0].contains("curve-steps/s"), "{text}");
    for (line, precision) in lines[1..].iter().zip(["f64", "f32"]) {
        assert!(line.starts_with("cpu, 1 thread ") && line.contains(precision), "{text}");
        assert_eq!(line.len(), lines[0].len(), "not aligned: {text}");
    }
}

#[test]
fn a_wrong_request_is_refused_with_the_flag_and_a_remedy() {
    for (arguments, parts) in [
        ("--seconds 0", &["--seconds 0: ", "use up to"][..]),
        ("--seconds NaN", &["--seconds NaN: "]),
        ("--seconds 1e9", &["--seconds 1000000000: "]),
        ("--repeats 0", &["--repeats 0: ", "use 1 to"]),
        ("--points 6", &["--points 6: ", "use 8 or more"]),
        ("--points 100,3", &["--points 3: "]),
        ("--curves 0", &["--curves 0: "]),
        ("--threads 0", &["--threads 0: "]),
        ("--adaptive 7", &["--adaptive 7: "]),
        ("--adapter voodoo", &["--adapter voodoo: no such adapter"]),
        ("--adapter voodoo --backend cpu", &["--adapter voodoo: ", "leave out --adapter"]),
        ("--backend cuda", &["cpu, gpu"]),
        ("--backend auto", &["cpu, gpu"]),
        ("--solver dirct", &["'direct'"]),
        ("--precision f16", &["f32, f64"]),
        ("--points many", &["not a whole number"]),
        ("--backend cpu --precision f32 --points 401", &["--points 401: f32 was verified"]),
    ] {
        let output = bench(&format!("{arguments} --quiet"));
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(output.stdout.is_empty(), "{arguments}");
        for part in parts {
            assert!(message.contains(part), "{arguments}: no {part:?} in: {message}");
        }
    }
}
