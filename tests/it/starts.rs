//! The program is started in one place, which keeps the settings of whoever runs the tests away from it.

use std::{fs, path::Path};

use crate::common::command::is_setting;

/// What names the built program.
const NAMES: [&str; 2] = [concat!("cargo", "_bin"), concat!("CARGO_BIN", "_EXE")];
/// The one place.
const PLACE: &str = "common/command.rs";

/// The files of a folder below `tests` that start the program themselves.
fn starters(folder: &str) -> Vec<String> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let files = fs::read_dir(tests.join(folder)).unwrap().map(|entry| entry.unwrap().path());
    let starts = |path: &Path| {
        let text = fs::read_to_string(path).unwrap_or_default();
        NAMES.iter().any(|name| text.contains(name))
    };
    let name = |path: &Path| format!("{folder}/{}", path.file_name().unwrap().to_str().unwrap());
    files.filter(|path| starts(path)).map(|path| name(&path)).collect()
}

#[test]
fn the_program_is_started_in_one_place() {
    let folders = ["common", "it", "cases", "cases/conformance", "cases/faults"];
    let all: Vec<String> = folders.into_iter().flat_map(starters).collect();
    assert!(all.iter().any(|file| file == PLACE), "{all:?}");
    let others: Vec<&String> = all.iter().filter(|file| *file != PLACE).collect();
    assert!(others.is_empty(), "{others:?}: use common::command::program");
}

#[test]
fn settings_of_users_are_distinguished_from_those_that_a_program_needs() {
    for name in ["NO_COLOR", "CLICOLOR_FORCE", "MESA_LOG_FILE", "RAYON_NUM_THREADS", "SLURM_ARRAY_TASK_MIN", "TERM"] {
        assert!(is_setting(name), "{name}");
    }
    for name in ["PATH", "HOME", "TMPDIR", "VK_DRIVER_FILES", "VK_ICD_FILENAMES", "LD_LIBRARY_PATH"] {
        assert!(!is_setting(name), "{name}");
    }
}
