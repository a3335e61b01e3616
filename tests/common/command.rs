//! The program in a folder, with any arguments: the only place where the tests of `tests/it` start it.

use std::{
    env, fs,
    io::Write,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread,
    time::Duration,
};

use tempfile::NamedTempFile;

/// Settings of the user that change what the program or a driver prints or how it computes, by the beginnings of their
/// names. Those that choose the drivers of GPUs are not among them: tests in this process see the same GPUs.
const SETTINGS: [&str; 16] = [
    "CLICOLOR",
    "COLUMNS",
    "CURVELAX_",
    "LINES",
    "MESA_DEBUG",
    "MESA_LOG",
    "NO_COLOR",
    "RAYON_NUM_THREADS",
    "RUST_LOG",
    "RUST_MIN_STACK",
    "SLURM_",
    "TERM",
    "VK_INSTANCE_LAYERS",
    "VK_LOADER_DEBUG",
    "VK_LOADER_LAYERS_",
    "WGPU_",
];
/// How often a run may be over before it is stopped. One that cannot be stopped is over each time.
const TRIES: u32 = 100;

/// The built program.
pub fn binary() -> PathBuf {
    assert_cmd::cargo::cargo_bin("curvelax")
}

/// The program in the folder `home`, without the settings of whoever runs the tests.
pub fn program(home: &Path) -> Command {
    without_settings(Command::new(binary()), home)
}

/// `curvelax ARGUMENTS` in the folder `home`.
pub fn command(home: &Path, arguments: &str) -> Command {
    let mut command = program(home);
    command.args(arguments.split_whitespace());
    command
}

/// A script of `shell`, such as sh, in which `"$0"` is the program.
pub fn script(shell: &str, home: &Path, script: &str) -> Command {
    let mut shell = without_settings(Command::new(shell), home);
    shell.args(["-c", script]).arg(binary());
    shell
}

/// The program with the usual response to a signal such as `HUP`, even if it is ignored where the tests run, as under
/// nohup or in the background of a shell. `None` if `env` cannot do that.
pub fn handling(home: &Path, signal: &str) -> Option<Command> {
    let option = format!("--default-signal={signal}");
    let mut probe = Command::new("env");
    let resets = probe.args([&option, "true"]).stderr(Stdio::null()).status().is_ok_and(|status| status.success());
    if !resets {
        eprintln!("`env {option}` does not work here: SIG{signal} is not tested");
        return None;
    }
    let mut command = without_settings(Command::new("env"), home);
    command.arg(option).arg(binary());
    Some(command)
}

/// Whether a variable of this name is a setting of the user.
pub fn is_setting(name: &str) -> bool {
    SETTINGS.iter().any(|start| name.starts_with(start))
}

/// Takes the user's settings from a command, and lets it run in `home`.
pub fn without_settings(mut command: Command, home: &Path) -> Command {
    for (name, _) in env::vars_os().filter(|(name, _)| name.to_str().is_some_and(is_setting)) {
        command.env_remove(name);
    }
    // A software GPU may be slow on a busy machine.
    command.env("CURVELAX_GPU_PATIENCE", "1000000");
    // Without XDG_RUNTIME_DIR a layer of Mesa prints a message on stderr.
    command.current_dir(home).env("XDG_RUNTIME_DIR", home).stdin(Stdio::null());
    command
}

/// Runs `curvelax ARGUMENTS` in the folder `home`.
pub fn curvelax(home: &Path, arguments: &str) -> Output {
    command(home, arguments).output().unwrap()
}

/// Does the same for arguments that must succeed, and returns what is on stdout.
#[track_caller]
pub fn done(home: &Path, arguments: &str) -> String {
    let output = curvelax(home, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Sends a signal such as `TERM` to a child, which may be over by now.
pub fn signal(child: &mut Child, name: &str) {
    // Its number may be that of another process once its end is known.
    if child.try_wait().unwrap().is_none() {
        // Every shell has this command, while some systems have no program of this name.
        let mut kill = Command::new("sh");
        kill.args(["-c", "kill -s \"$0\" \"$1\"", name, &child.id().to_string()]);
        kill.stderr(Stdio::null()).status().expect("sh");
    }
}

/// Starts the command and sends it a signal as soon as `is_time`, which is asked again and again with what is on
/// stderr. There is no time limit: only the end of the program ends the wait, so that no machine is too slow or, for a
/// run that is long enough, too fast.
pub fn signalled_when(command: &mut Command, name: &str, mut is_time: impl FnMut(&str) -> bool) -> Output {
    // Files can be read while the program runs, and do not block it when they are full.
    let [out, err] = [(); 2].map(|()| NamedTempFile::new().unwrap());
    let said = || String::from_utf8_lossy(&fs::read(err.path()).unwrap()).into_owned();
    let mut child = command.stdout(out.reopen().unwrap()).stderr(err.reopen().unwrap()).spawn().unwrap();
    // It is there already when the time comes, as the run may be a short one.
    let mut sender = Command::new("sh");
    sender.args(["-c", "read _ && kill -s \"$0\" \"$1\"", name, &child.id().to_string()]).stderr(Stdio::null());
    let mut sender = sender.stdin(Stdio::piped()).spawn().expect("sh");
    while !is_time(&said()) && child.try_wait().unwrap().is_none() {
        thread::sleep(Duration::from_millis(1));
    }
    // The number of a child whose end is known may be that of another process.
    let go = sender.stdin.take();
    if let (Some(mut go), None) = (go, child.try_wait().unwrap()) {
        go.write_all(b"\n").unwrap();
    }
    sender.wait().unwrap();
    let status = child.wait().unwrap();
    let [stdout, stderr] = [&out, &err].map(|file| fs::read(file.path()).unwrap());
    Output { status, stdout, stderr }
}

/// Starts `curvelax ARGUMENTS` and asks it to end by SIGTERM as soon as `is_time`.
pub fn stopped_when(home: &Path, arguments: &str, mut is_time: impl FnMut() -> bool) -> Output {
    signalled_when(&mut command(home, arguments), "TERM", |_| is_time())
}

/// Starts `curvelax ARGUMENTS` and asks it to end by SIGTERM once it has said `words` on stderr.
pub fn stopped_after(home: &Path, arguments: &str, words: &str) -> Output {
    signalled_when(&mut command(home, arguments), "TERM", |said| said.contains(words))
}

/// Leaves in the folder `out` of `home` a run that was stopped as soon as it could be resumed. A run that was over
/// before is begun again.
#[track_caller]
pub fn stopped_run(home: &Path, arguments: &str, out: &str) -> Output {
    let state = home.join(out).join(".curvelax.state");
    for _ in 0..TRIES {
        let output = stopped_when(home, &format!("{arguments} --out {out}"), || state.exists());
        if output.status.code() != Some(0) {
            assert_eq!(output.status.code(), Some(75), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
            return output;
        }
        fs::remove_dir_all(home.join(out)).unwrap();
    }
    panic!("{arguments}: not stopped in {TRIES} tries");
}
