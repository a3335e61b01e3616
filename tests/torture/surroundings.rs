//! The environment of a run: folders that cannot be written or vanish, closed outputs, other languages and clocks.

use std::{
    fs,
    io::Read,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::OnceLock,
};

use tempfile::TempDir;

use crate::{
    Found, Outcome,
    calls::must_be_a_decent_end,
    command::{script, without_settings},
    program::{Ended, Running, binary, curvelax},
    space::Disk,
    study::{Attempt, Study},
};

/// A user without rights, to whom root changes, since no folder is closed to root.
const UNPRIVILEGED: [&str; 4] = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"];

/// A run as a user who is bound by permissions.
pub struct Unprivileged {
    /// A copy that this user may start, wherever the program was built.
    program: PathBuf,
    pub home: TempDir,
    is_root: bool,
}

impl Unprivileged {
    pub fn new() -> Unprivileged {
        let home = TempDir::new().unwrap();
        let program = home.path().join("curvelax");
        // Not by this process: children that other tests start at this moment would have the copy open for writing, and
        // a program that is open for writing cannot be started.
        let copied = Command::new("cp").arg(binary()).arg(&program).status().unwrap();
        assert!(copied.success(), "{}", program.display());
        set_mode(&program, 0o755);
        set_mode(home.path(), 0o777);
        Unprivileged { program, home, is_root: is_root() }
    }

    /// What such a user is missing here, if anything: setpriv, a temporary folder to enter and to start programs in, or
    /// permissions that bind.
    pub fn is_missing() -> Option<&'static str> {
        static WORKS: OnceLock<bool> = OnceLock::new();
        let works = WORKS.get_or_init(|| {
            let unprivileged = Unprivileged::new();
            let closed = unprivileged.home.path().join("closed");
            fs::create_dir(&closed).unwrap();
            set_mode(&closed, 0o555);
            let script = "\"$0\" --version && touch mine && ! touch closed/other";
            let output = unprivileged.command(&["sh", "-c", script]).arg(&unprivileged.program).output();
            let works = output.as_ref().is_ok_and(|output| output.status.success());
            if !works {
                eprintln!("as a user without rights: {output:?}");
            }
            works
        });
        (!works).then_some("user without rights who can start a program in a temporary folder")
    }

    fn go(&self, umask: &str, arguments: &str) -> Ended {
        self.start(umask, arguments).end()
    }

    pub fn start(&self, umask: &str, arguments: &str) -> Running {
        let script = format!("umask {umask}; exec \"$0\" {arguments}");
        Running::start(self.command(&["sh", "-c", &script]).arg(&self.program))
    }

    /// A command run by this user.
    pub fn command(&self, words: &[&str]) -> Command {
        let starter: &[&str] = if self.is_root { &UNPRIVILEGED } else { &["env"] };
        let mut command = without_settings(Command::new(starter[0]), self.home.path());
        command.args(&starter[1..]).args(words);
        command
    }

    /// Copies a folder into this user's, who may read all of it, whatever the mask of the tests' own user.
    fn copy(&self, from: &Path, name: &str) -> PathBuf {
        let to = self.home.path().join(name);
        crate::folder::copy(from, &to);
        let readable = Command::new("chmod").args(["-R", "a+rX"]).arg(&to).status().unwrap();
        assert!(readable.success());
        to
    }
}

fn is_root() -> bool {
    let output = Command::new("id").arg("-u").output().unwrap();
    output.stdout == b"0\n"
}

/// Whether no permission binds this process, as usually with root.
fn is_unbound() -> bool {
    let home = TempDir::new().unwrap();
    let path = home.path().join("closed");
    fs::write(&path, "").unwrap();
    set_mode(&path, 0);
    fs::File::options().read(true).write(true).open(path).is_ok()
}

fn set_mode(path: &Path, mode: u32) {
    fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
}

/// A read-only folder: a run is refused there, and a resumed one keeps its checkpoint.
pub fn folders_that_cannot_be_written(study: &Study) -> Outcome {
    let unprivileged = Unprivileged::new();
    let closed = unprivileged.home.path().join("closed");
    fs::create_dir(&closed).unwrap();
    set_mode(&closed, 0o555);
    let ended = unprivileged.go("022", &format!("run {} --out closed/out", study.arguments));
    assert!(ended.code == Some(2) && ended.errors()[0].contains("closed/out"), "{ended:?}");
    let ended = unprivileged.go("022", &format!("run {} --out closed --force", study.arguments));
    assert!(ended.code == Some(2) && ended.errors()[0].contains("closed"), "{ended:?}");
    let ended = unprivileged.go("022", "resume closed");
    assert!(ended.code == Some(2) && ended.errors()[0].contains("closed"), "{ended:?}");
    assert_eq!(fs::read_dir(&closed).unwrap().count(), 0);

    let attempt = Attempt::interrupted(study);
    let before = attempt.names();
    let out = unprivileged.copy(&attempt.out(), "out");
    set_mode(&out, 0o555);
    let ended = unprivileged.go("022", "resume out");
    assert!(matches!(ended.code, Some(1 | 2)) && ended.errors()[0].contains("out"), "{ended:?}");
    assert!(out.join(".curvelax.state").exists());
    let after: Vec<String> = crate::folder::content(&out).into_keys().collect();
    assert_eq!(after, before);
    set_mode(&out, 0o777);
    attempt.must_end_well(ended);
    Found::new(4, "refused by name, nothing lost")
}

/// A file system mounted read-only: not even root writes there.
pub fn read_only_disk(study: &Study) -> Outcome {
    let attempt = Attempt::new(study);
    let disk = Disk::mount(attempt.home.path(), "size=64m").ok_or("cannot mount")?;
    let mut running = attempt.start();
    running.wait_until(|_| attempt.has_state());
    let ended = running.kill();
    let before = attempt.names();
    assert!(disk.remount("ro"));
    let refused = attempt.resume().end();
    let code = must_be_a_decent_end(&refused, &format!("{refused:?}"));
    assert!(code != 0 && attempt.names() == before, "{refused:?}");
    let other = Running::start(&mut curvelax(attempt.home.path(), &attempt.run().replace("out out", "out out2"))).end();
    assert!(other.code == Some(2) && other.errors()[0].contains("out2"), "{other:?}");
    assert!(disk.remount("rw"));
    attempt.must_end_well(ended);
    Found::new(2, "refused by name, nothing lost")
}

/// A mask that removes all rights from new files.
pub fn no_rights_for_new_files(study: &Study) -> Outcome {
    let unprivileged = Unprivileged::new();
    let out = unprivileged.home.path().join("out");
    let ended = unprivileged.go("777", &format!("run {} --quiet --out out", study.arguments));
    assert!(ended.code == Some(2) && ended.errors()[0].contains("out"), "{ended:?}");
    assert!(!out.exists(), "a folder was left");
    // Files that their owner may only write are enough for a run; reading them again gives an error that says so.
    let ended = unprivileged.go("477", &format!("run {} --quiet --out out", study.arguments));
    must_be_a_decent_end(&ended, &format!("{ended:?}"));
    let attempt = Attempt::new(study);
    if is_unbound() {
        let masked = format!("umask 777; exec \"$0\" {}", attempt.run());
        let ended = Running::start(&mut script("sh", attempt.home.path(), &masked)).end();
        assert_eq!(ended.code, Some(0), "{ended:?}");
        attempt.must_be_the_reference(&[format!("{ended:?}")]);
    }
    Found::new(3, "refused by name, or 0 differing bytes")
}

/// `rm -rf` while the run writes there.
pub fn vanished_folder(study: &Study, cases: usize, seed: u64) -> Outcome {
    let mut random = crate::random::Random::new(seed);
    let (mut failed, mut all) = (0, 0);
    // A run may end before its folder vanishes.
    while failed < cases {
        all += 1;
        let attempt = Attempt::new(study);
        let mut running = attempt.start();
        let time = study.reference().took.mul_f64(random.real());
        running.wait_until(|running| running.age() >= time && attempt.has_state());
        // Until the run detects it, it may create files again.
        let mut tries = 0;
        while fs::remove_dir_all(attempt.out()).is_err() && tries < 1000 {
            tries += 1;
        }
        let ended = running.end();
        failed += usize::from(must_be_a_decent_end(&ended, &format!("after {time:?} (seed {seed}): {ended:?}")) == 1);
        let resumed = attempt.resume().end();
        let code = must_be_a_decent_end(&resumed, &format!("{resumed:?}"));
        assert!(code != 0 || ended.code == Some(0), "{ended:?} {resumed:?}");
    }
    Found::new(all, format!("a named error in {failed}, 0 panics"))
}

/// Output without a reader: pipes without a reader, closed streams, a full device.
pub fn no_reader_of_the_output(study: &Study) -> Outcome {
    let talkative = |attempt: &Attempt| attempt.run().replace("--quiet ", "");
    let shells = ["exec \"$0\" ARGUMENTS >&-", "exec \"$0\" ARGUMENTS 2>&-", "exec \"$0\" ARGUMENTS >&- 2>&- <&-"];
    for shell in shells {
        let attempt = Attempt::new(study);
        let closed = shell.replace("ARGUMENTS", &talkative(&attempt));
        let ended = Running::start(&mut script("sh", attempt.home.path(), &closed)).end();
        assert_eq!(ended.code, Some(0), "{closed}: {ended:?}");
        attempt.must_be_the_reference(&[closed]);
    }
    for (stdout, stderr) in [(true, false), (false, true), (true, true)] {
        for json in ["", " --json"] {
            let attempt = Attempt::new(study);
            let mut command = curvelax(attempt.home.path(), &(talkative(&attempt) + json));
            let piped = |closed: bool| if closed { Stdio::piped() } else { Stdio::null() };
            let mut child = command.stdin(Stdio::null()).stdout(piped(stdout)).stderr(piped(stderr)).spawn().unwrap();
            // The reader stops.
            drop((child.stdout.take(), child.stderr.take()));
            let status = child.wait().unwrap();
            assert_eq!(status.code(), Some(0), "closed: stdout {stdout}, stderr {stderr}: {status:?}");
            attempt.must_be_the_reference(&[format!("stdout {stdout}, stderr {stderr}")]);
        }
    }
    let attempt = Attempt::new(study);
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = curvelax(attempt.home.path(), &talkative(&attempt));
    let ended = Running::start_with(command.stdout(full)).end();
    assert!(ended.code == Some(1) && ended.errors()[0].contains("stdout"), "{ended:?}");
    attempt.must_be_the_reference(&[format!("{ended:?}")]);
    Found::new(10, "0 differing bytes; a full stdout is named")
}

/// Other decimal signs, other letters, unknown locales.
pub fn locales(study: &Study) -> Outcome {
    let locales = ["C", "POSIX", "de_DE.UTF-8", "tr_TR.UTF-8", "C.UTF-8", "nonsense", "", "\u{fffd}"];
    for locale in locales {
        let attempt = Attempt::new(study);
        let mut command = curvelax(attempt.home.path(), &attempt.run());
        let ended = Running::start(command.env("LC_ALL", locale).env("LANG", locale).env("LANGUAGE", locale)).end();
        assert_eq!((ended.code, &*ended.said), (Some(0), ""), "{locale:?}");
        attempt.must_be_the_reference(&[locale.into()]);
    }
    Found::new(locales.len(), "0 differing bytes")
}

/// A file system without locks, however it reports that; an error of another kind is an error.
pub fn no_locks(study: &Study) -> Outcome {
    let start = |attempt: &Attempt, error: &str| {
        let inject = format!("inject=flock:error={error}");
        let starter = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", "trace=flock", "-e", &inject];
        if attempt.has_state() { attempt.resume_through(&starter).end() } else { attempt.start_through(&starter).end() }
    };
    for error in ["ENOLCK", "EOPNOTSUPP"] {
        for attempt in [Attempt::new(study), Attempt::interrupted(study)] {
            let ended = start(&attempt, error);
            assert_eq!((ended.code, &*ended.said), (Some(0), ""), "{error}");
            attempt.must_be_the_reference(&[error.into()]);
        }
    }
    let ended = start(&Attempt::new(study), "EIO");
    assert!(ended.code == Some(2) && ended.errors().len() == 1, "{ended:?}");
    Found::new(5, "0 differing bytes")
}

/// Starts a program at a time that follows, the same moment in all time zones.
const FAKETIME: [&str; 3] = ["env", "TZ=UTC", "faketime"];

/// Whether `faketime` is installed, and changes the clock of a program.
pub fn has_faketime() -> bool {
    let mut command = Command::new(FAKETIME[0]);
    let output = command.args(&FAKETIME[1..]).args(["1999-12-31 23:59:59", "date", "+%Y"]).output();
    output.is_ok_and(|output| output.stdout == b"1999\n")
}

/// Clocks of other centuries, and one that goes back between a run and its continuation.
pub fn wrong_clocks(study: &Study) -> Outcome {
    let clocks = ["1970-01-01 00:00:00", "1999-12-31 23:59:59", "2038-01-19 03:14:07", "2106-02-07 06:28:15"];
    for clock in clocks {
        let starter = [&FAKETIME[..], &[clock]].concat();
        let attempt = Attempt::new(study);
        let ended = attempt.start_through(&starter).end();
        assert_eq!((ended.code, &*ended.said), (Some(0), ""), "{clock}");
        attempt.must_be_the_reference(&[clock.into()]);
        // Begun today.
        let attempt = Attempt::interrupted(study);
        let ended = attempt.resume_through(&starter).end();
        assert_eq!((ended.code, &*ended.said), (Some(0), ""), "{clock}");
        attempt.must_be_the_reference(&[clock.into()]);
        let mut json = String::new();
        fs::File::open(attempt.out().join("run.json")).unwrap().read_to_string(&mut json).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert!(json["wall_seconds"].as_f64().is_some_and(|wall| (0.0..1e4).contains(&wall)), "{clock}: {json}");
    }
    Found::new(2 * clocks.len(), "0 differing bytes")
}
