//! Who may open a folder, and what opening and leaving it changes.

use std::{fs, path::Path};

use super::OutputFolder;
use crate::{
    claim::LOCK,
    names::{RUN, SUMMARY},
};

/// A `run.json` that an earlier run left.
pub const OLD: &str = "{\"curvelax\": \"0.1.0\"}";

pub(super) fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn what_exists_is_refused_without_force() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("file");
    fs::write(&file, "mine").unwrap();
    for (path, force) in [(home.path(), false), (&file, false), (&file, true), (&file.join("below"), true)] {
        let error = OutputFolder::open(path, force).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().starts_with(&format!("--out {}: ", path.display())), "{error}");
    }
    assert_eq!(names(home.path()), ["file"]);
}

#[test]
fn parents_made_for_nothing_are_removed_and_others_are_not() {
    let home = tempfile::tempdir().unwrap();
    fs::create_dir(home.path().join("old")).unwrap();
    drop(OutputFolder::open(&home.path().join("old/new/out"), false).unwrap());
    assert_eq!(names(&home.path().join("old")), [""; 0]);
    let endless = "x".repeat(1000);
    OutputFolder::open(&home.path().join("new/deep").join(endless), false).unwrap_err();
    assert_eq!(names(home.path()), ["old"]);

    let path = home.path().join("through/../out");
    let folder = OutputFolder::open(&path, false).unwrap();
    folder.write(RUN, "new").unwrap().finish().unwrap();
    drop(folder);
    assert_eq!(names(&path), [RUN], "a folder in use keeps its name");
}

#[test]
fn one_run_at_a_time_writes_into_a_folder() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let first = OutputFolder::open(&out, false).unwrap();
    let rows = first.file(SUMMARY).unwrap();
    let error = OutputFolder::open(&out, true).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("a run is writing here"), "{error}");
    assert_eq!(names(&out), [LOCK, ".summary.csv.part"], "the first run is not disturbed");
    drop((rows, first));
    assert_eq!(names(home.path()), [""; 0]);

    // As left by a killed run.
    fs::create_dir(&out).unwrap();
    fs::write(out.join(LOCK), "").unwrap();
    drop(OutputFolder::open(&out, true).unwrap());
    assert_eq!(names(&out), [""; 0]);
}

#[test]
fn pictures_that_cannot_be_replaced_are_found_before_anything_is_lost() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    // In the way of every new file, also for root.
    fs::create_dir_all(out.join("plots/.curvelax.part")).unwrap();
    fs::write(out.join(RUN), OLD).unwrap();
    let error = OutputFolder::open(&out, true).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("cannot be written"), "{error}");
    assert_eq!(fs::read_to_string(out.join(RUN)).unwrap(), OLD);
    fs::remove_dir(out.join("plots/.curvelax.part")).unwrap();
    drop(OutputFolder::open(&out, true).unwrap());
    assert_eq!(names(&out), ["plots", RUN]);
}
