//! What the program leaves in the output folder when the disk or the folder does not let it finish.
#![cfg(unix)]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use tempfile::TempDir;

/// Runs `curvelax run ARGUMENTS` where no file can grow beyond `limit` blocks of 512 or 1024 bytes, as on a full disk.
fn curvelax(home: &Path, limit: &str, arguments: &str) -> Output {
    let program = assert_cmd::cargo::cargo_bin("curvelax");
    let small = "--backend cpu --points 32 --tau 1e-4 --t-end 2e-4 --quiet";
    // Ignored, the signal of the limit becomes an error of the write.
    let script = format!("trap '' XFSZ; ulimit -f {limit}; exec \"$0\" run {small} {arguments}");
    Command::new("sh").args(["-c", &script]).arg(program).current_dir(home).output().unwrap()
}

/// 400 members are more than the buffer of the table, so that a write fails during the run; 50 are less, and it fails
/// at the end.
#[test]
fn a_full_disk_leaves_the_rows_that_it_took_and_says_where() {
    for curves in [400, 50] {
        let home = TempDir::new().unwrap();
        let output = curvelax(home.path(), "4", &format!("--curves {curves} --out out"));
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("note: the members that ended are kept in out/.summary.csv.part\n"), "{message}");
        assert!(message.contains("error: cannot write out/summary.csv: "), "{message}");
        let kept = fs::read_to_string(home.path().join("out/.summary.csv.part")).unwrap();
        assert!(kept.lines().count() > 3, "{kept}");
        assert_eq!(fs::read_dir(home.path().join("out")).unwrap().count(), 1);
    }
}

#[test]
fn a_disk_that_is_full_for_the_pictures_leaves_the_tables_and_they_can_be_drawn_later() {
    // In blocks: too few for the portraits, and too few for the page.
    for (limit, missing) in [("8", "plots/portraits.json"), ("60", "report.html")] {
        let home = TempDir::new().unwrap();
        let out = home.path().join("out");
        let before = curvelax(home.path(), "unlimited", "--curves 3 --seed 2 --out out");
        assert_eq!(before.status.code(), Some(0));
        let output = curvelax(home.path(), limit, "--curves 2 --out out --force");
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.starts_with(&format!("error: cannot write out/{missing}: ")), "{message}");
        assert!(
            message.ends_with("; the tables in out are complete: make room, then curvelax plot out\n"),
            "{message}"
        );
        assert_eq!(fs::read_to_string(out.join("summary.csv")).unwrap().lines().count(), 3);
        // Of the run, and not of the one before.
        assert!(fs::read_to_string(out.join("run.json")).unwrap().contains("\"members\": 2"));
        assert!(!out.join("report.html").exists() && !out.join("plots/curves.svg").exists());
        assert!(
            fs::read_dir(&out).unwrap().all(|entry| !entry.unwrap().file_name().to_string_lossy().contains("part"))
        );

        let program = assert_cmd::cargo::cargo_bin("curvelax");
        let drawn = Command::new(program).args(["plot", "out", "--quiet"]).current_dir(home.path()).status().unwrap();
        assert!(drawn.success() && out.join("report.html").exists());
        assert_eq!(out.join("plots/curves.svg").exists(), missing == "report.html");
    }
}

#[test]
fn nothing_is_said_to_be_kept_that_is_not() {
    let home = TempDir::new().unwrap();
    let output = curvelax(home.path(), "0", "--curves 400 --out new/out");
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(!message.contains("note: "), "{message}");
    assert!(!home.path().join("new").exists(), "{message}");
}

#[test]
fn a_run_that_cannot_finish_leaves_the_earlier_results() {
    let home = TempDir::new().unwrap();
    let first = curvelax(home.path(), "unlimited", "--curves 2 --series 1e-4 --out out");
    assert_eq!(first.status.code(), Some(0), "{}", String::from_utf8_lossy(&first.stderr));
    let names =
        ["summary.csv", "series.csv", "plots/curves.svg", "run.json"].map(|name| home.path().join("out").join(name));
    let before = names.each_ref().map(|name| fs::read(name).unwrap());
    let second = curvelax(home.path(), "4", "--curves 50 --out out --force");
    assert_eq!(second.status.code(), Some(1));
    for (name, text) in names.iter().zip(before) {
        assert!(fs::read(name).is_ok_and(|now| now == text), "{}", name.display());
    }
}
