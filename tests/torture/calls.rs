//! Kills or errors at the n-th system call that touches a file, for every n.
//!
//! `strace` injects both. It counts the calls of each thread separately. For every call under test, a single thread of
//! the run touches files; if a call is counted in another thread, the fault comes at that thread's own count.

use std::{collections::BTreeMap, fs, ops::RangeInclusive, os::unix::process::ExitStatusExt};

use tempfile::TempDir;

use crate::{
    Found, Outcome,
    program::Ended,
    random::Random,
    study::{Attempt, Study},
};

/// Calls that change data on disk.
pub const CHANGES: [&str; 20] = [
    "openat",
    "write",
    "writev",
    "pwrite64",
    "pwritev",
    "fsync",
    "fdatasync",
    "sync_file_range",
    "ftruncate",
    "fallocate",
    "rename",
    "renameat",
    "renameat2",
    "unlink",
    "unlinkat",
    "mkdir",
    "mkdirat",
    "rmdir",
    "linkat",
    "copy_file_range",
];

/// Further calls that can fail.
pub const FAILURES: [&str; 9] =
    ["read", "pread64", "close", "flock", "fcntl", "lseek", "statx", "getdents64", "readlink"];

/// Errors of a disk that is full, broken, or full for this user.
const ERRORS: [&str; 3] = ["ENOSPC", "EIO", "EDQUOT"];

/// Whether `strace` is installed, may trace, and can tamper with calls.
pub fn can_trace() -> bool {
    let mut command = std::process::Command::new("strace");
    command.args(["-f", "-qq", "-o", "/dev/null", "-e", "trace=close", "-e", "inject=close:signal=KILL:when=1"]);
    // It ends as the shell does, which closes something.
    let ended = command.args(["sh", "-c", "exec true"]).output();
    ended.is_ok_and(|output| output.status.signal() == Some(9))
}

/// The target: a run from its beginning, a resumed one, or one over the files of an earlier run.
#[derive(Clone, Copy)]
pub enum From {
    Start,
    Middle,
    Over(&'static Study),
}

/// For each of `calls`, its first and last use by the thread that makes most of them, counted as `strace` counts.
/// Those before the run uses its folder are left out: there is nothing to lose yet, and how many there are, and what
/// for, depends on the system.
fn counts(prepared: &Prepared, calls: &[&str]) -> BTreeMap<String, RangeInclusive<usize>> {
    let list = TempDir::new().unwrap();
    let file = list.path().join("calls");
    let traced = format!("trace={}", calls.iter().map(|call| format!("?{call}")).collect::<Vec<_>>().join(","));
    let attempt = prepared.attempt();
    let starter = ["strace", "-f", "-qq", "-o", file.to_str().unwrap(), "-e", "signal=none", "-e", &traced];
    let ended = prepared.go(&attempt, &starter);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let mut by_thread = BTreeMap::<(String, String), [usize; 2]>::new();
    // Not any folder of this name: Cargo sets LD_LIBRARY_PATH, where build scripts have such folders.
    let out = attempt.out();
    let folders = ["\"out\"", "\"out/", out.to_str().unwrap()];
    let mut has_begun = false;
    for line in fs::read_to_string(&file).unwrap().lines() {
        has_begun |= folders.iter().any(|folder| line.contains(folder));
        let mut words = line.splitn(2, ' ');
        let (thread, call) = (words.next().unwrap(), words.next().unwrap_or_default().trim_start());
        if let Some((call, _)) = call.split_once('(').filter(|(call, _)| calls.contains(call)) {
            let [before, all] = by_thread.entry((call.into(), thread.into())).or_default();
            *before += usize::from(!has_begun);
            *all += 1;
        }
    }
    assert!(has_begun, "no call names the folder");
    let mut most = BTreeMap::new();
    for ((call, _), [before, all]) in by_thread.into_iter().filter(|(_, [before, all])| before < all) {
        let known = most.entry(call).or_insert(before + 1..=all);
        if all - before > known.clone().count() {
            *known = before + 1..=all;
        }
    }
    most
}

/// The starting point of an attempt.
struct Prepared<'a> {
    study: &'a Study,
    from: From,
    /// Copied for every attempt.
    middle: Option<Attempt<'a>>,
}

impl<'a> Prepared<'a> {
    fn new(study: &'a Study, from: From) -> Prepared<'a> {
        let middle = matches!(from, From::Middle).then(|| Attempt::interrupted(study));
        Prepared { study, from, middle }
    }

    fn attempt(&self) -> Attempt<'a> {
        match (self.from, &self.middle) {
            (From::Over(earlier), _) => Attempt::over(self.study, earlier),
            (_, Some(middle)) => middle.fork(),
            (_, None) => Attempt::new(self.study),
        }
    }

    fn go(&self, attempt: &Attempt, starter: &[&str]) -> Ended {
        match self.middle {
            None => attempt.start_through(starter).end(),
            Some(_) => attempt.resume_through(starter).end(),
        }
    }

    /// Continues with `fault` at the calls `when`.
    fn with_fault(&self, attempt: &Attempt, call: &str, fault: &str, when: &str) -> Ended {
        // Only traced calls can be tampered with.
        let (trace, inject) = (format!("trace={call}"), format!("inject={call}:{fault}:when={when}"));
        self.go(attempt, &["strace", "-f", "-qq", "-o", "/dev/null", "-e", &trace, "-e", &inject])
    }
}

/// Kills at every `stride`-th of the calls that change data on disk.
pub fn kill_at_every_call(study: &Study, from: From, stride: usize, seed: u64) -> Outcome {
    let prepared = Prepared::new(study, from);
    let mut random = Random::new(seed);
    let (mut points, mut told) = (0, Vec::new());
    for (call, own) in counts(&prepared, &CHANGES) {
        let mut killed = 0;
        // One more: the number may differ slightly from run to run if it depends on time.
        for n in (own.start() + random.below(stride)..=own.end() + 1).step_by(stride) {
            let attempt = prepared.attempt();
            let ended = prepared.with_fault(&attempt, &call, "signal=KILL", &n.to_string());
            if ended.code == Some(0) {
                attempt.must_be_the_reference(&[format!("{call} {n} was not reached")]);
                continue;
            }
            assert_eq!(ended.signal, Some(9), "{call} {n}: {ended:?}");
            eprintln!("{}: killed at {call} {n}", study.name);
            attempt.must_end_well(ended);
            killed += 1;
        }
        points += killed;
        told.push(format!("{call} {killed}"));
    }
    assert!(points > 10, "{told:?}");
    Found::new(points, format!("0 differing bytes ({})", told.join(", ")))
}

/// Makes every `stride`-th call fail, once or from then on, with one error after the other or, if `all`, with each.
pub fn fail_at_every_call(study: &Study, from: From, stride: usize, all: bool, seed: u64) -> Outcome {
    let prepared = Prepared::new(study, from);
    let mut random = Random::new(seed);
    let calls: Vec<&str> = CHANGES.iter().chain(&FAILURES).copied().collect();
    let mut by_code = BTreeMap::<i32, usize>::new();
    let (mut points, mut turn) = (0, 0);
    for (call, own) in counts(&prepared, &calls) {
        for n in (own.start() + random.below(stride)..=*own.end()).step_by(stride) {
            // A full disk stays full; a call that fails once is just as bad.
            let faults = ERRORS.iter().flat_map(|error| [n.to_string(), format!("{n}+")].map(|when| (error, when)));
            let taken: Vec<_> = match all {
                true => faults.collect(),
                false => faults.cycle().skip(turn).take(1).collect(),
            };
            turn += 1;
            for (error, when) in taken {
                let attempt = prepared.attempt();
                let ended = prepared.with_fault(&attempt, &call, &format!("error={error}"), &when);
                let told = format!("{error} of {call} at {when}: {ended:?}");
                eprintln!("{}: {told}", study.name);
                // Nothing can be printed if that fails, too.
                let speechless = call == "write" && ended.said.is_empty() && matches!(ended.code, Some(1 | 2));
                let code = if speechless { 1 } else { must_be_a_decent_end(&ended, &told) };
                *by_code.entry(code).or_default() += 1;
                attempt.must_end_well(ended);
                points += 1;
            }
        }
    }
    assert!(points > 10 && by_code.contains_key(&1), "{by_code:?}");
    let codes: Vec<String> = by_code.iter().map(|(code, count)| format!("exit {code} {count}")).collect();
    Found::new(points, format!("0 panics, 0 differing bytes ({})", codes.join(", ")))
}

/// The run succeeded in spite of all, or printed one line that says where it failed; returns the exit code.
#[track_caller]
pub fn must_be_a_decent_end(ended: &Ended, told: &str) -> i32 {
    let code = ended.code.unwrap_or_else(|| panic!("{told}"));
    let is_said = |line: &str| ["error: ", "note: ", "warning: "].iter().any(|begin| line.starts_with(begin));
    match code {
        0 => assert_eq!(ended.errors(), [""; 0], "{told}"),
        1 | 2 => {
            let errors = ended.errors();
            assert!(errors.len() == 1 && ended.said.lines().all(is_said), "{told}");
            // The run creates its folder in `.`.
            let is_path = ["out", "to .: "].iter().any(|path| errors[0].contains(path));
            assert!(is_path, "no path: {told}");
        }
        _ => panic!("{told}"),
    }
    code
}
