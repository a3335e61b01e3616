//! The program as a user runs it: one run in a separate folder, and its tables.

use std::{collections::HashMap, fs};

use glam::DVec2;
use tempfile::TempDir;

use super::command;

/// The tables of a run.
pub const FILES: [&str; 4] = ["summary.csv", "members.csv", "series.csv", "snapshots.csv"];

/// A finished run in a separate folder.
pub struct Done {
    pub home: TempDir,
}

/// A row by column name.
pub type Row = HashMap<String, String>;

/// Runs `curvelax run ARGUMENTS --backend cpu`; `files` are in the folder where it runs. It must succeed, or say that
/// every member failed if that is so.
#[track_caller]
pub fn run_with(files: &[(&str, &str)], arguments: &str) -> Done {
    let home = TempDir::new().unwrap();
    for (name, text) in files {
        fs::write(home.path().join(name), text).unwrap();
    }
    let mut command = command::program(home.path());
    command.arg("run").args(arguments.split_whitespace()).args(["--backend", "cpu", "--quiet", "--out", "out"]);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let code = output.status.code();
    let ended =
        (code == Some(0) && said.is_empty()) || (code == Some(3) && said.starts_with("error: every member failed"));
    assert!(ended, "{arguments}: {said}");
    let done = Done { home };
    let failed = |row: &Row| ["singular", "nonfinite", "stalled"].contains(&&*row["status"]);
    assert_eq!(code == Some(3), done.summary().iter().all(failed), "{arguments}: {said}");
    done
}

#[track_caller]
pub fn run(arguments: &str) -> Done {
    run_with(&[], arguments)
}

impl Done {
    pub fn path(&self) -> std::path::PathBuf {
        self.home.path().join("out")
    }

    #[track_caller]
    pub fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn texts(&self) -> [String; 4] {
        FILES.map(|name| self.text(name))
    }

    pub fn rows(&self, name: &str) -> Vec<Row> {
        let mut reader = csv::Reader::from_path(self.path().join(name)).unwrap();
        let header = reader.headers().unwrap().clone();
        let row = |record: csv::StringRecord| header.iter().zip(&record).map(|(k, v)| (k.into(), v.into())).collect();
        reader.records().map(|record| row(record.unwrap())).collect()
    }

    pub fn summary(&self) -> Vec<Row> {
        self.rows("summary.csv")
    }

    /// The lines of `name` that belong to `members`.
    pub fn lines_of(&self, name: &str, members: &[u64]) -> Vec<String> {
        let of_member = |line: &&str| members.iter().any(|m| line.split(',').next() == Some(&m.to_string()));
        self.text(name).lines().skip(1).filter(of_member).map(str::to_owned).collect()
    }
}

#[track_caller]
pub fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} is {:?}", row[column]))
}

pub fn column(rows: &[Row], name: &str) -> Vec<f64> {
    rows.iter().map(|row| number(row, name)).collect()
}

pub fn positions(rows: &[Row]) -> Vec<DVec2> {
    rows.iter().map(|row| DVec2::new(number(row, "x"), number(row, "y"))).collect()
}
