//! The program in a folder, with any arguments.

use std::{path::Path, process::Output};

use assert_cmd::Command;

/// Runs `curvelax ARGUMENTS` in the folder `home`.
pub fn curvelax(home: &Path, arguments: &str) -> Output {
    let mut command = Command::cargo_bin("curvelax").unwrap();
    // Without this a layer of Mesa prints a message on stderr.
    command.current_dir(home).env("XDG_RUNTIME_DIR", home).args(arguments.split_whitespace()).output().unwrap()
}

/// Does the same for arguments that must succeed, and returns what is on stdout.
#[track_caller]
pub fn done(home: &Path, arguments: &str) -> String {
    let output = curvelax(home, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}
