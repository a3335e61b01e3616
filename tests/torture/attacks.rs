//! Interference with the folder of a run: it is moved away, copied with links, or belongs to someone else.

use std::{
    fs,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

use crate::{
    Found, Outcome,
    folder::{content, copy, differences},
    program::{Ended, Running, curvelax, status, through},
    random::Random,
    study::{Attempt, Study},
};

/// Calls at which a run is paused while its folder is taken away, under their names on all kinds of processors.
const RENAME: &str = "?rename,?renameat,?renameat2";
const HELD_AT: [&str; 6] = ["openat", RENAME, "?unlink,?unlinkat", "fsync", "?mkdir,?mkdirat", "write"];

/// A run that `strace` paused at the n-th use of a call.
struct Held {
    running: Running,
    program: u32,
}

impl Held {
    /// None if the run ended earlier.
    fn start(attempt: &Attempt, call: &str, n: usize) -> Option<Held> {
        let log = attempt.home.path().join("calls");
        let inject = format!("inject={call}:signal=STOP:when={n}");
        let starter = ["strace", "-f", "-qq", "-o", log.to_str()?, "-e", &format!("trace={call}"), "-e", &inject];
        let mut running = Running::start(&mut through(attempt.home.path(), &starter, &attempt.run()));
        let stopped = |_: &Running| fs::read_to_string(&log).is_ok_and(|log| log.contains("stopped by SIGSTOP"));
        if !running.wait_until(stopped) {
            return None;
        }
        Some(Held { program: traced(&log)?, running })
    }

    fn resume(self) -> Ended {
        signal(self.program, "CONT");
        self.running.end()
    }
}

/// The process whose calls are in a log of `strace`: the number of one of its threads begins every line.
fn traced(log: &Path) -> Option<u32> {
    let log = fs::read_to_string(log).ok()?;
    let mut threads = log.lines().filter_map(|line| line.split_whitespace().next()?.parse().ok());
    threads.find_map(|thread| status(thread, "Tgid:")?.parse().ok())
}

fn signal(process: u32, name: &str) {
    let kill = ["-c", "kill -s \"$0\" \"$1\"", name, &process.to_string()];
    assert!(std::process::Command::new("sh").args(kill).status().unwrap().success());
}

/// The folder of a run is moved or removed at every `stride`-th call, and another run uses its path: that run must not
/// be touched.
pub fn taken_away(study: &Study, other: &Study, stride: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let (mut cases, mut lost) = (0, 0);
    for (call, moved) in HELD_AT.into_iter().flat_map(|call| [(call, false), (call, true)]) {
        for n in (1 + random.below(stride)..).step_by(stride) {
            let attempt = Attempt::new(study);
            let Some(held) = Held::start(&attempt, call, n) else { break };
            let (out, gone) = (attempt.out(), attempt.home.path().join("gone"));
            if out.exists() {
                fs::rename(&out, &gone).unwrap();
                if !moved {
                    fs::remove_dir_all(&gone).unwrap();
                }
                let arguments = format!("run {} --quiet --out out", other.arguments);
                let second = Running::start(&mut curvelax(attempt.home.path(), &arguments)).end();
                assert_eq!(second.code, Some(0), "{call} {n}: {second:?}");
            }
            let first = held.resume();
            cases += 1;
            if !attempt.home.path().join("gone").exists() && !out.exists() {
                panic!("{call} {n}: {first:?}");
            }
            let of_other = differences(&other.reference().files, &content(&out));
            let of_own = differences(&study.reference().files, &content(&out));
            let untouched = if gone.exists() || first.code != Some(0) { of_other } else { of_own.min(of_other) };
            assert!(untouched.is_empty(), "{call} {n}: {untouched:#?}, {first:?}");
            if first.code != Some(0) {
                lost += 1;
                assert!(matches!(first.code, Some(1 | 2)) && first.errors().len() == 1, "{call} {n}: {first:?}");
                assert!(first.said.contains("out"), "{call} {n}: {first:?}");
            }
            if gone.exists() {
                must_continue(study, &attempt, &gone, &format!("{call} {n}: {first:?}"));
            }
        }
    }
    assert!(lost > 10, "{lost} of {cases}");
    Found::new(cases, format!("{lost} lost theirs and said so, 0 differing bytes in the other one"))
}

/// A folder that was moved away is resumed where it is.
fn must_continue(study: &Study, attempt: &Attempt, gone: &Path, told: &str) {
    let has = |name: &str| gone.join(name).exists();
    if has(".curvelax.state") || has(".curvelax.state.old") || has("run.json") {
        let ended = Running::start(&mut curvelax(attempt.home.path(), "resume gone --quiet")).end();
        assert_eq!(ended.code, Some(0), "{told}: {ended:?}");
        let found = differences(&study.reference().files, &content(gone));
        assert!(found.is_empty(), "{told}: {found:#?}");
    }
}

/// The lock of a run is removed after its n-th rename, and a second process tries to resume the run: that is refused,
/// and the run continues.
pub fn lock_removed(study: &Study) -> Outcome {
    let mut cases = 0;
    for n in 1.. {
        let attempt = Attempt::new(study);
        let Some(held) = Held::start(&attempt, RENAME, n) else { break };
        fs::remove_file(attempt.out().join(".curvelax.lock")).unwrap();
        let second = attempt.resume().end();
        assert!(second.code == Some(2) && second.said.contains("a run is writing here"), "{n}: {second:?}");
        let first = held.resume();
        assert_eq!(first.code, Some(0), "{n}: {first:?}");
        attempt.must_be_the_reference(&[format!("{n}: {first:?} {second:?}")]);
        cases += 1;
    }
    assert!(cases > 5, "{cases}");
    Found::new(cases, "refused, 0 differing bytes")
}

/// One of two copies that share their files is finished, and then the other: neither changes the other.
pub fn linked_copies(studies: &[&Study]) -> Outcome {
    let mut cases = 0;
    for study in studies {
        let middle = Attempt::interrupted(study);
        for original_first in [true, false] {
            let attempt = middle.fork();
            let (out, twin) = (attempt.out(), attempt.home.path().join("twin"));
            link(&out, &twin);
            let shared = fs::metadata(twin.join(".summary.csv.part")).unwrap().nlink();
            assert_eq!(shared, 2);
            let names = if original_first { ["out", "twin"] } else { ["twin", "out"] };
            for (name, other) in [(names[0], names[1]), (names[1], names[0])] {
                let other = attempt.home.path().join(other);
                let before = content(&other);
                let ended = Running::start(&mut curvelax(attempt.home.path(), &format!("resume {name} --quiet"))).end();
                assert_eq!(ended.code, Some(0), "{ended:?}");
                assert!(content(&other) == before, "{}: resuming {name} changed the other", study.name);
                let found = differences(&study.reference().files, &content(&attempt.home.path().join(name)));
                assert!(found.is_empty(), "{}: {found:#?}", study.name);
                cases += 1;
            }
        }
    }
    Found::new(cases, "0 differing bytes in both")
}

/// `cp -al`.
fn link(from: &Path, to: &Path) {
    fs::create_dir(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        match path.is_dir() {
            true => link(&path, &target),
            false => fs::hard_link(&path, &target).unwrap(),
        }
    }
}

/// Every command with `--force` on every command's folder: each accepts only its own.
pub fn foreign_folders(study: &Study) -> Outcome {
    let home = TempDir::new().unwrap();
    let go = |arguments: &str| Running::start(&mut curvelax(home.path(), arguments)).end();
    let run = format!("run {} --quiet", study.arguments);
    let convergence = "convergence --backend cpu --problem willmore-circle --quiet";
    for arguments in [
        format!("{run} --out runs"),
        format!("{run} --shard 0/1 --out shard"),
        format!("{convergence} --out convergences"),
        "figure fig1a --quiet --out figures".into(),
        "plot runs --quiet --out pictures".into(),
    ] {
        assert_eq!(go(&arguments).code, Some(0), "{arguments}");
    }
    copy(&Attempt::interrupted(study).out(), &home.path().join("interrupted"));
    // The file of an unused lock may be removed.
    let _ = fs::remove_file(home.path().join("interrupted/.curvelax.lock"));
    let folders = ["runs", "interrupted", "convergences", "figures"];
    let commands = [
        (run.clone(), &["runs", "interrupted"][..]),
        ("merge shard --quiet".into(), &["runs", "interrupted"]),
        (convergence.into(), &["convergences"]),
        ("figure fig1a --quiet".into(), &["figures"]),
        ("plot shard --quiet".into(), &[]),
    ];
    let mut cases = 0;
    for (command, own) in &commands {
        for folder in folders {
            let place = home.path().join("place");
            copy(&home.path().join(folder), &place);
            let before = content(&place);
            let ended = go(&format!("{command} --out place --force"));
            match own.contains(&folder) {
                true => assert_eq!(ended.code, Some(0), "{command}, {folder}: {ended:?}"),
                false => {
                    assert!(
                        ended.code == Some(2) && ended.said.contains("use another folder"),
                        "{command}, {folder}: {ended:?}"
                    );
                    assert!(content(&place) == before, "{command}, {folder}");
                }
            }
            fs::remove_dir_all(&place).unwrap();
            cases += 1;
        }
    }
    Found::new(cases, "one's own replaced, others refused and not touched")
}

/// A folder in which no run was begun: files of the user are not replaced, and leftovers of a killed run are not in the
/// way.
pub fn folders_without_a_run(study: &Study) -> Outcome {
    let mut cases = 0;
    for name in ["summary.csv", "report.html", "series.csv", "ensemble.csv", "plots/mesh.svg", "shard.state"] {
        let attempt = Attempt::new(study);
        let mine = attempt.out().join(name);
        fs::create_dir_all(mine.parent().unwrap()).unwrap();
        fs::write(&mine, "mine").unwrap();
        let before = content(&attempt.out());
        for flag in ["--resume", ""] {
            let ended = Running::start(&mut curvelax(attempt.home.path(), &format!("{} {flag}", attempt.run()))).end();
            assert!(ended.code == Some(2) && ended.errors().len() == 1, "{name} {flag}: {ended:?}");
            assert!(content(&attempt.out()) == before, "{name} {flag}");
            cases += 1;
        }
    }
    for left in
        [&[".curvelax.lock"][..], &[".curvelax.part"], &[".curvelax.lock", ".summary.csv.part", ".curvelax.state.part"]]
    {
        let attempt = Attempt::new(study);
        fs::create_dir(attempt.out()).unwrap();
        left.iter().for_each(|name| attempt.write(name, b""));
        let ended = attempt.start().end();
        assert_eq!(ended.code, Some(0), "{left:?}: {ended:?}");
        attempt.must_be_the_reference(&[format!("{left:?}")]);
        cases += 1;
    }
    Found::new(cases, "refused, or done where nothing was lost")
}

/// An outline is read once by a run and not again when it is resumed, whatever is swept, even if it has changed.
pub fn outlines() -> Outcome {
    let home = TempDir::new().unwrap();
    let outline = home.path().join("q.csv");
    fs::write(&outline, "0,0\n3,0\n3,2\n0,2\n").unwrap();
    let run = "run --backend cpu --threads 1 --shape file:q.csv --curves 2 --tau 1e-8 --t-end 1 --solver direct --quiet \
               --sweep points=34,52 --checkpoint-every 1s --out out";
    let resume = "resume out --quiet --checkpoint-every 1s";
    let mut cases = 0;
    for (arguments, reads) in [(run, 1), (resume, 0)] {
        assert_eq!(reads_of_outline(home.path(), arguments), reads, "{arguments}");
        cases += 1;
    }
    for text in ["0,0\n3,0\n3,1\n0,1\n", "0,0\n", ""] {
        fs::write(&outline, text).unwrap();
        assert_eq!(reads_of_outline(home.path(), resume), 0);
        cases += 1;
    }
    Found::new(cases, "read once; not read again, even where it changed")
}

/// How often a run opens its outline until it is at work and is stopped.
fn reads_of_outline(home: &Path, arguments: &str) -> usize {
    let log = home.join("calls");
    let starter = ["strace", "-f", "-qq", "-o", log.to_str().unwrap(), "-e", "trace=openat"];
    // It is at work when it has written a state of its own.
    let state = || fs::metadata(home.join("out/.curvelax.state")).map(|state| state.ino()).ok();
    let before = state();
    let mut running = Running::start(&mut through(home, &starter, arguments));
    assert!(running.wait_until(|_| state().is_some_and(|now| Some(now) != before)), "{arguments}: it has ended");
    signal(traced(&log).unwrap(), "TERM");
    let ended = running.end();
    assert_eq!(ended.code, Some(75), "{ended:?}");
    fs::read_to_string(&log).unwrap().lines().filter(|line| line.contains("q.csv")).count()
}

/// Paths near the maximum length of the system: the run succeeds, or is refused with nothing left over.
pub fn long_paths(study: &Study, lengths: &[usize]) -> Outcome {
    let (mut done, mut refused) = (0, 0);
    for length in lengths {
        let attempt = Attempt::new(study);
        let mut path = PathBuf::new();
        while path.as_os_str().len() + 101 < *length {
            path.push("d".repeat(100));
        }
        path.push("e".repeat(length - path.as_os_str().len() - 1));
        assert_eq!(path.as_os_str().len(), *length);
        let arguments = format!("run {} --quiet --out {}", study.arguments, path.display());
        let ended = Running::start(&mut curvelax(attempt.home.path(), &arguments)).end();
        match ended.code {
            Some(0) => done += 1,
            _ => {
                assert!(ended.code == Some(2) && ended.errors().len() == 1, "{length}: {ended:?}");
                assert_eq!(fs::read_dir(attempt.home.path()).unwrap().count(), 0, "{length}");
                refused += 1;
            }
        }
    }
    assert!(done > 0 && refused > 0, "{done} {refused}");
    Found::new(lengths.len(), format!("{done} done, {refused} refused with nothing left over"))
}
