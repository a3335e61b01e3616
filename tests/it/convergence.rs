//! `curvelax convergence` from outside: its table, its file, its exit codes.

use std::{fs, process::Output};

use tempfile::TempDir;

use crate::common::command::curvelax;

fn convergence(home: &TempDir, arguments: &str) -> Output {
    curvelax(home.path(), &format!("convergence {arguments}"))
}

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap()
}

/// Rows of `convergence.csv`.
fn rows(home: &TempDir) -> Vec<csv::StringRecord> {
    let mut reader = csv::Reader::from_path(home.path().join("out/convergence.csv")).unwrap();
    assert_eq!(reader.headers().unwrap(), vec!["problem", "varied", "n", "tau", "tolerance", "error", "order"]);
    reader.records().map(Result::unwrap).collect()
}

#[test]
fn the_table_and_the_file_have_the_orders_of_the_scheme() {
    let home = TempDir::new().unwrap();
    let output = convergence(&home, "--problem willmore-circle --problem elastic-mode-3 --backend cpu --out out");
    let (printed, said) = (text(output.stdout), text(output.stderr));
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_eq!(said, "back end: CPU, f64 (asked for); direct solver\n");

    let rows = rows(&home);
    assert_eq!(rows.len(), 2 * (3 + 4 + 4));
    for row in &rows {
        let expected = if &row[1] == "n" { 2.0 } else { 1.0 };
        if !row[6].is_empty() {
            let order: f64 = row[6].parse().unwrap();
            // There are too few adaptive steps here to show their full order.
            let margin = if &row[1] == "tolerance" { 1.0 } else { 0.1 };
            assert!((order - expected).abs() < margin, "{row:?}");
        }
        assert!(row[5].parse::<f64>().unwrap().abs() < 0.05, "{row:?}");
        assert_eq!((row[3].is_empty(), row[4].is_empty()), (&row[1] == "tolerance", &row[1] != "tolerance"), "{row:?}");
    }
    assert_eq!(rows.iter().filter(|row| !row[6].is_empty()).count(), 2 * (2 + 2 + 2));

    let lines: Vec<&str> = printed.lines().filter(|line| !line.is_empty()).collect();
    assert_eq!(lines.len(), 1 + rows.len(), "{printed}");
    let words: Vec<&str> = lines[0].split_whitespace().collect();
    assert_eq!(words, ["problem", "varied", "n", "tau", "tolerance", "error", "order"]);
    assert!(lines[1].starts_with("willmore-circle  n"), "{printed}");
}

#[test]
fn every_problem_is_solved_by_default_with_and_without_a_file() {
    let home = TempDir::new().unwrap();
    let output = convergence(&home, "--backend cpu");
    assert_eq!(output.status.code(), Some(0), "{}", text(output.stderr));
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
    let printed = text(output.stdout);
    for problem in curvelax::truth::problems() {
        let of_it = printed.lines().filter(|line| line.split_whitespace().next() == Some(&problem.name));
        assert_eq!(of_it.count(), 11, "{}", problem.name);
    }
}

#[test]
fn f32_and_sweeps_are_taken_where_asked_for() {
    let home = TempDir::new().unwrap();
    for (arguments, nodes) in [("--precision f32", "200"), ("--solver gauss-seidel", "100")] {
        let output =
            convergence(&home, &format!("--problem ellipse-area --backend cpu --quiet --force --out out {arguments}"));
        assert_eq!(output.status.code(), Some(0), "{}", text(output.stderr));
        assert_eq!((text(output.stdout).as_str(), text(output.stderr).as_str()), ("", ""));
        let largest = rows(&home).into_iter().filter(|row| &row[1] == "n").map(|row| row[2].to_owned()).next_back();
        assert_eq!(largest.as_deref(), Some(nodes), "{arguments}");
    }
}

#[test]
fn a_wrong_request_is_refused_by_name() {
    let home = TempDir::new().unwrap();
    fs::create_dir(home.path().join("old")).unwrap();
    for (arguments, parts) in [
        ("--problem lemniscat", ["error: --problem lemniscat: ", "did you mean `lemniscate`?"]),
        ("--problem circle", ["error: --problem circle: ", "there are willmore-circle, "]),
        ("--solver gauss", ["invalid value 'gauss'", "gauss-seidel"]),
        ("--precision f16", ["invalid value 'f16'", "f32, f64"]),
        ("--backend cuda", ["invalid value 'cuda'", "auto, gpu, cpu"]),
        ("--adapter abacus --backend cpu", ["error: --adapter abacus: ", "leave out --adapter"]),
        ("--adapter abacus", ["error: --adapter abacus: ", "curvelax adapters"]),
        ("--problems lemniscate", ["--problems", "similar argument exists: '--problem'"]),
        ("--backend cpu --out old", ["error: --out old: already exists", "--force"]),
        ("lemniscate", ["unexpected argument 'lemniscate'", "Usage"]),
    ] {
        let output = convergence(&home, arguments);
        let said = text(output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert_eq!(text(output.stdout), "", "{arguments}");
        for part in parts {
            assert!(said.contains(part), "{arguments}: no {part:?} in: {said}");
        }
    }
    assert_eq!(fs::read_dir(home.path().join("old")).unwrap().count(), 0);
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
}

/// --force replaces files of this command, but not of another one.
#[test]
fn a_folder_holds_the_files_of_one_command() {
    let home = TempDir::new().unwrap();
    let out = home.path().join("out");
    let names = || {
        let entries = fs::read_dir(&out).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    fs::create_dir(&out).unwrap();
    for name in ["run.json", "summary.csv", "mine.txt"] {
        fs::write(out.join(name), "old").unwrap();
    }
    let force = "--problem ellipse-area --backend cpu --quiet --force --out out";
    let output = convergence(&home, force);
    let said = text(output.stderr);
    assert!(output.status.code() == Some(2) && said.contains("curvelax run wrote run.json there"), "{said}");
    assert_eq!(names(), ["mine.txt", "run.json", "summary.csv"]);
    fs::remove_file(out.join("run.json")).unwrap();
    fs::remove_file(out.join("summary.csv")).unwrap();
    fs::write(out.join("convergence.csv"), "old").unwrap();
    let output = convergence(&home, force);
    assert_eq!(output.status.code(), Some(0), "{}", text(output.stderr));
    assert_eq!(names(), ["convergence.csv", "mine.txt"]);
    assert_ne!(fs::read_to_string(out.join("convergence.csv")).unwrap(), "old");
}

/// A number in a field of a row of `work_precision.csv`.
fn number(row: &csv::StringRecord, field: usize) -> f64 {
    row[field].parse().unwrap_or_else(|e| panic!("{row:?}: field {field}: {e}"))
}

#[test]
fn higher_orders_take_fewer_solves_for_an_error_and_fixed_steps_are_of_first_order() {
    let home = TempDir::new().unwrap();
    let output = convergence(&home, "--work-precision --solver direct --backend cpu --out out");
    let (printed, said) = (text(output.stdout), text(output.stderr));
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("32 perturbed 2:1 ellipses"), "{said}");

    let out = home.path().join("out");
    let mut reader = csv::Reader::from_path(out.join("work_precision.csv")).unwrap();
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 4 + 5 * 5);
    assert_eq!(printed.lines().filter(|line| line.starts_with("direct ")).count(), rows.len(), "{printed}");
    let of_order = |order: &str| rows.iter().filter(|row| &row[3] == order).collect::<Vec<_>>();
    for pair in of_order("1").windows(2) {
        let [tau, error, solves] = [1, 4, 5].map(|field| number(pair[0], field) / number(pair[1], field));
        let order = error.ln() / tau.ln();
        assert!((order - 1.0).abs() < 0.15 && (solves * tau - 1.0).abs() < 0.05, "{pair:?}");
    }
    // A tighter tolerance costs solves and takes away error. Between two orders only the cost is comparable.
    for order in ["2", "3", "4", "5", "6"] {
        let rows = of_order(order);
        assert!(rows.windows(2).all(|pair| number(pair[0], 5) < number(pair[1], 5)), "{rows:?}");
        assert!(number(rows[4], 4) < 1e-2 * number(rows[0], 4), "{rows:?}");
    }
    let finest = ["2", "3", "4", "5", "6"].map(|order| number(of_order(order)[4], 5));
    assert!(finest.windows(2).all(|pair| pair[1] < 0.9 * pair[0]), "{finest:?}");
    assert!(rows.iter().all(|row| number(row, 7) > 0.0 && number(row, 6) == 0.0), "{rows:?}");

    let picture = fs::read_to_string(out.join("work_precision.svg")).unwrap();
    assert!(picture.contains("order up to 6") && picture.contains("time per member (ms)"));
    assert_eq!(convergence(&home, "--work-precision --problem lemniscate").status.code(), Some(2));
}
