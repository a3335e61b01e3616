//! Starts the program like a user, waits for it, signals it and kills it.

use std::{
    fs,
    io::Read,
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::OnceLock,
    thread::{JoinHandle, sleep, spawn},
    time::{Duration, Instant},
};

pub use crate::command::binary;
use crate::command::without_settings;

/// Interval between checks of a process.
const GLANCE: Duration = Duration::from_millis(1);
/// No process of these tests runs this long on any machine; one that does hangs.
pub const HANGS: Duration = Duration::from_secs(12 * 3600);
/// A tick of the processor time in `/proc`, on every relevant machine.
const TICK: Duration = Duration::from_millis(10);

/// `curvelax ARGUMENTS` in the folder `home`.
pub fn curvelax(home: &Path, arguments: &str) -> Command {
    through(home, &[], arguments)
}

/// The same, started by another program such as `strace`.
pub fn through(home: &Path, starter: &[&str], arguments: &str) -> Command {
    let mut words = handling().iter().chain(starter).map(PathBuf::from).chain([binary()]);
    let mut command = without_settings(Command::new(words.next().unwrap()), home);
    command.args(words).args(arguments.split_whitespace());
    command
}

/// A starter that makes a program receive signals: if these tests run in the background of a shell they ignore Ctrl-C,
/// which is inherited. Empty if there is no such starter.
fn handling() -> &'static [&'static str] {
    const ENV: [&str; 2] = ["env", "--default-signal=INT,HUP,TERM"];
    static HAS_ENV: OnceLock<bool> = OnceLock::new();
    if *HAS_ENV.get_or_init(|| succeeds(Command::new(ENV[0]).args([ENV[1], "true"]))) { &ENV } else { &[] }
}

/// Whether `program` can be started.
pub fn is_there(program: &str) -> bool {
    succeeds(Command::new(program).arg("--version"))
}

fn succeeds(command: &mut Command) -> bool {
    let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// The entry of `/proc/PROCESS/status` called `name`, such as `VmRSS:`.
pub fn status(process: u32, name: &str) -> Option<String> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    Some(status.lines().find_map(|line| line.strip_prefix(name))?.trim().to_string())
}

/// A started program; killed when it is dropped.
pub struct Running {
    child: Child,
    /// Reads its stderr: a pipe, so that file limits do not apply to messages.
    said: Option<JoinHandle<Vec<u8>>>,
    since: Instant,
}

/// The result of a program.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub signal: Option<i32>,
    /// On stderr.
    pub said: String,
}

impl Running {
    /// Starts `command`; its stdout is discarded unless it was redirected.
    #[track_caller]
    pub fn start(command: &mut Command) -> Running {
        Running::start_with(command.stdout(Stdio::null()))
    }

    /// Starts `command` with its own stdout.
    #[track_caller]
    pub fn start_with(command: &mut Command) -> Running {
        let child = command.stdin(Stdio::null()).stderr(Stdio::piped()).spawn();
        let mut child = child.unwrap_or_else(|e| panic!("{command:?}: {e}"));
        let mut stderr = child.stderr.take().unwrap();
        let said = spawn(move || {
            let mut said = Vec::new();
            stderr.read_to_end(&mut said).unwrap();
            said
        });
        Running { child, said: Some(said), since: Instant::now() }
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Time since its start.
    pub fn age(&self) -> Duration {
        self.since.elapsed()
    }

    pub fn is_over(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    /// Waits until it has ended, or `enough` is true; returns whether it is still running.
    pub fn wait_until(&mut self, mut enough: impl FnMut(&Running) -> bool) -> bool {
        while !self.is_over() {
            assert!(self.age() < HANGS, "hangs");
            if enough(self) {
                return true;
            }
            sleep(GLANCE);
        }
        false
    }

    /// `kill -s NAME`.
    pub fn signal(&self, name: &str) {
        signal(name, &[self]);
    }

    /// Whether it has a handler for the signal `number`: before that, the signal ends it.
    pub fn handles(&self, number: i32) -> bool {
        let caught = status(self.id(), "SigCgt:").and_then(|mask| u64::from_str_radix(&mask, 16).ok());
        caught.is_some_and(|mask| mask >> (number - 1) & 1 == 1)
    }

    /// Whether SIGSTOP has paused it.
    pub fn is_held(&self) -> bool {
        status(self.id(), "State:").is_some_and(|state| state.starts_with('T'))
    }

    /// Whether it has a file of this name open.
    pub fn has_open(&self, name: &str) -> bool {
        let files = fs::read_dir(format!("/proc/{}/fd", self.id())).into_iter().flatten().flatten();
        files.filter_map(|file| fs::read_link(file.path()).ok()).any(|path| path.ends_with(name))
    }

    /// The processor time it has used so far.
    pub fn worked(&self) -> Option<Duration> {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.id())).ok()?;
        // After the name of the program, from the third field; these are the 14th and the 15th.
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let ticks = |field: usize| fields.get(field - 3)?.parse::<u32>().ok();
        Some(TICK * (ticks(14)? + ticks(15)?))
    }

    /// Repeats `what` until it ends; also returns the processor time it uses from now on.
    #[track_caller]
    pub fn end_while(mut self, mut what: impl FnMut(&Running)) -> (Ended, Duration) {
        let before = self.worked().unwrap_or_default();
        let mut last = before;
        self.wait_until(|running| {
            what(running);
            last = running.worked().unwrap_or(last);
            false
        });
        (self.end(), last.saturating_sub(before))
    }

    pub fn kill(mut self) -> Ended {
        let _ = self.child.kill();
        self.end()
    }

    /// Waits for its end. It must not panic, whatever was done to it.
    #[track_caller]
    pub fn end(mut self) -> Ended {
        self.wait_until(|_| false);
        let status = self.child.wait().unwrap();
        let said = self.said.take().unwrap().join().unwrap();
        let ended =
            Ended { code: status.code(), signal: status.signal(), said: String::from_utf8_lossy(&said).into_owned() };
        let panicked = ended.code == Some(101) || ended.signal == Some(6) || ended.said.contains("panicked");
        assert!(!panicked, "a panic: {ended:?}");
        ended
    }
}

/// `kill -s NAME` for all at once.
pub fn signal(name: &str, all: &[&Running]) {
    let ids = all.iter().map(|running| running.id().to_string());
    // They may have ended. Every shell has this command, while some systems have no program of this name.
    let mut kill = Command::new("sh");
    let _ = kill.args(["-c", "kill -s \"$0\" \"$@\"", name]).args(ids).stderr(Stdio::null()).status();
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Ended {
    /// The lines that begin with `error: `.
    pub fn errors(&self) -> Vec<&str> {
        self.said.lines().filter(|line| line.starts_with("error: ")).collect()
    }

    /// Whether the message is that there is nothing to resume.
    pub fn had_not_begun(&self) -> bool {
        let is_said = |words: &str| self.said.contains(words);
        self.code == Some(2) && is_said("--force") && (is_said("had not started") || is_said("no run was started here"))
    }
}
