//! The program in a folder, with any arguments.

use std::{
    path::Path,
    process::{self, Output, Stdio},
    thread,
    time::Duration,
};

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

/// Starts `curvelax ARGUMENTS` and asks it to end by SIGTERM as soon as `is_time`, which is asked again and again. There is
/// no time limit: only the end of the program ends the wait, so that no machine is too slow or, for a run that is long
/// enough, too fast.
#[cfg(unix)]
pub fn stopped_when(home: &Path, arguments: &str, mut is_time: impl FnMut() -> bool) -> Output {
    let mut command = process::Command::new(assert_cmd::cargo::cargo_bin("curvelax"));
    command.current_dir(home).env("XDG_RUNTIME_DIR", home).args(arguments.split_whitespace());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    while !is_time() && child.try_wait().unwrap().is_none() {
        thread::sleep(Duration::from_millis(1));
    }
    // It may be over by now.
    let _ = process::Command::new("kill").args(["-TERM", &child.id().to_string()]).stderr(Stdio::null()).status();
    child.wait_with_output().unwrap()
}

/// Does the same to a run that begins in the folder `out`, once it can be resumed.
#[cfg(unix)]
#[track_caller]
pub fn stopped_run(home: &Path, arguments: &str, out: &str) {
    let state = home.join(out).join(".curvelax.state");
    let output = stopped_when(home, &format!("{arguments} --out {out}"), || state.exists());
    assert_eq!(output.status.code(), Some(75), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
}
