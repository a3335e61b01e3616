//! The output folder when the disk or the folder does not let the program finish.
#![cfg(unix)]

use std::{fs, path::Path, process::Output};

use tempfile::TempDir;

use crate::common::command::{self, done, script};

const NOTE: &str = "note: the run was saved: curvelax resume out continues it\n";

/// Runs `curvelax run ARGUMENTS` where no file can grow beyond `limit` blocks of 512 or 1024 bytes, as on a full disk.
fn curvelax(home: &Path, limit: &str, arguments: &str) -> Output {
    let small = "run --backend cpu --points 32 --tau 1e-4 --t-end 2e-4";
    limited(home, limit, &format!("{small} {arguments}"))
}

fn limited(home: &Path, limit: &str, arguments: &str) -> Output {
    // A limit that is lower already cannot be raised.
    if limit == "unlimited" {
        return command::curvelax(home, arguments);
    }
    script("sh", home, &format!("ulimit -f {limit} && exec \"$0\" {arguments}")).output().unwrap()
}

/// 400 members exceed the buffer of a table, first of that with the longest rows, so that a write fails during the run;
/// 50 do not, and it fails at the end.
#[test]
fn a_run_on_a_full_disk_continues_when_there_is_room() {
    for (curves, first) in [(400, "members.csv"), (50, "summary.csv")] {
        let home = TempDir::new().unwrap();
        let output = curvelax(home.path(), "4", &format!("--curves {curves} --out out"));
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(NOTE), "{message}");
        assert!(message.contains(&format!("error: cannot write out/{first}: ")), "{message}");
        let quiet = curvelax(home.path(), "4", &format!("--curves {curves} --out quiet --quiet"));
        let message = String::from_utf8(quiet.stderr).unwrap();
        assert!(message.starts_with(&format!("error: cannot write quiet/{first}: ")), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
        let resumed = limited(home.path(), "unlimited", "resume out --quiet");
        assert_eq!(resumed.status.code(), Some(0), "{}", String::from_utf8_lossy(&resumed.stderr));
        assert_eq!(
            curvelax(home.path(), "unlimited", &format!("--curves {curves} --out whole")).status.code(),
            Some(0)
        );
        let tables = ["summary.csv", "members.csv", "levels.csv", "rates.csv", "ensemble.csv", "explained.csv"];
        for name in tables.into_iter().chain(["mean_excess.csv", "report.html"]) {
            let text = |run: &str| fs::read(home.path().join(run).join(name)).unwrap();
            assert!(text("out") == text("whole"), "{curves} members: {name}");
        }
    }
}

#[test]
fn a_disk_that_is_full_for_the_pictures_leaves_the_tables_and_they_can_be_drawn_later() {
    // In blocks: too few for the page.
    let home = TempDir::new().unwrap();
    let out = home.path().join("out");
    let before = curvelax(home.path(), "unlimited", "--curves 3 --seed 2 --out out");
    assert_eq!(before.status.code(), Some(0));
    let output = curvelax(home.path(), "60", "--curves 2 --out out --force");
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("error: cannot write out/report.html: "), "{message}");
    assert!(message.ends_with("; the tables in out are complete, some pictures are missing\n"), "{message}");
    assert!(message.contains(NOTE), "{message}");
    assert_eq!(fs::read_to_string(out.join("summary.csv")).unwrap().lines().count(), 3);
    // From this run, not the previous one.
    assert!(fs::read_to_string(out.join("run.json")).unwrap().contains("\"members\": 2"));
    assert!(!out.join("report.html").exists() && !out.join("plots/curves.svg").exists());
    assert!(fs::read_dir(&out).unwrap().all(|entry| !entry.unwrap().file_name().to_string_lossy().contains("part")));

    done(home.path(), "plot out --quiet");
    assert!(out.join("report.html").exists());
    assert!(out.join("plots/curves.svg").exists());
    assert!(limited(home.path(), "unlimited", "resume out --quiet").status.success());
    assert!(out.join("plots/curves.svg").exists() && !out.join(".curvelax.state").exists());
}

#[test]
fn nothing_is_said_to_be_kept_that_is_not() {
    let home = TempDir::new().unwrap();
    let output = curvelax(home.path(), "0", "--curves 400 --out new/out");
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(!message.contains("was saved"), "{message}");
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

#[test]
fn pictures_and_merges_on_a_full_disk_end_with_a_message() {
    let home = TempDir::new().unwrap();
    for shard in 0..2 {
        let output = curvelax(home.path(), "unlimited", &format!("--curves 4 --shard {shard}/2 --out shard-{shard}"));
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    }
    done(home.path(), "merge shard-0 shard-1 --out all --quiet");
    for command in ["plot all", "plot all --out pictures", "animate all", "merge shard-0 shard-1 --out again"] {
        let output = limited(home.path(), "4", command);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{command}: {message}");
        assert!(message.contains("cannot write "), "{command}: {message}");
    }
}
