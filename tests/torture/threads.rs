//! A system that starts no more threads: commands that need them say so, and signals are still received.
//!
//! `strace` makes the calls fail with which the main thread starts others, because a limit of the user does not bind
//! root.

use std::{thread::sleep, time::Duration};

use crate::{
    Found, Outcome,
    folder::copy,
    program::{Ended, Running, curvelax, is_there, through},
    study::{Attempt, Study},
    surroundings::Unprivileged,
};

/// Starts `arguments` where the main thread can start only `room` threads.
fn start(attempt: &Attempt, room: usize, arguments: &str) -> Running {
    let inject = format!("inject=clone,clone3:error=EAGAIN:when={}+", room + 1);
    let starter = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", "trace=clone,clone3", "-e", &inject];
    // The threads of a software GPU, which has as many as cores if nothing is said.
    Running::start(through(attempt.home.path(), &starter, arguments).env("LP_NUM_THREADS", "2"))
}

/// A command with less and less room.
struct Case {
    name: &'static str,
    arguments: String,
    /// Minimum number of threads for its work.
    least: usize,
    /// Its starting point.
    prepare: fn(&'static Study) -> Attempt<'static>,
    /// Whether it must leave the files of the study.
    writes: bool,
}

/// Every command with room for no thread, for one, and so on until it succeeds.
pub fn few(study: &'static Study) -> Outcome {
    const BENCH: &str =
        "bench --backend cpu --threads 1 --points 34 --solver direct --precision f64 --seconds 0.1 --quiet";
    let run = Attempt::new(study).run();
    // Two for signals and the clock, and one that computes.
    let list = [
        Case { name: "run", arguments: run, least: 3, prepare: Attempt::new, writes: true },
        Case {
            name: "resume",
            arguments: "resume out --quiet".into(),
            least: 3,
            prepare: Attempt::interrupted,
            writes: true,
        },
        Case {
            name: "merge",
            arguments: "merge 0 1 --quiet --out out".into(),
            least: 0,
            prepare: shards,
            writes: true,
        },
        Case { name: "plot", arguments: "plot out --quiet".into(), least: 0, prepare: finished, writes: true },
        Case {
            name: "animate",
            arguments: "animate out --out movie.gif --quiet".into(),
            least: 0,
            prepare: finished,
            writes: true,
        },
        Case { name: "bench", arguments: BENCH.into(), least: 1, prepare: Attempt::new, writes: false },
    ];
    let mut cases = 0;
    for Case { name, arguments, least, prepare, writes } in list {
        for room in 0..=least {
            let attempt = prepare(study);
            let ended = start(&attempt, room, &arguments).end();
            let told = format!("{name} with room for {room} threads: {ended:?}");
            cases += 1;
            if room == least {
                assert_eq!((ended.code, &*ended.said), (Some(0), ""), "{told}");
            } else {
                must_be_named(&ended, "ulimit -u", &told);
            }
            if writes && room == least {
                attempt.must_be_the_reference(&[told]);
            } else if writes && name == "run" {
                assert!(!attempt.out().exists(), "{told}");
            }
        }
    }
    Found::new(cases, "refused by name, 0 panics, 0 differing bytes")
}

/// A finished run.
fn finished(study: &'static Study) -> Attempt<'static> {
    let attempt = Attempt::new(study);
    let ended = attempt.start().end();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    attempt
}

/// Two shards, to be merged.
fn shards(study: &'static Study) -> Attempt<'static> {
    let attempt = Attempt::new(study);
    for shard in ["0", "1"] {
        let arguments = format!("run {} --quiet --shard {shard}/2 --out {shard}", study.arguments);
        let ended = Running::start(&mut curvelax(attempt.home.path(), &arguments)).end();
        assert_eq!(ended.code, Some(0), "{ended:?}");
    }
    attempt
}

/// Threads of the program itself that a run on a GPU needs: the last one waits for the driver's compiler.
const OWN: usize = 3;

/// A software GPU starts threads itself, some of which it can do without.
pub fn few_on_the_gpu(study: &'static Study, most: usize) -> Outcome {
    let mut refused = 0;
    for room in 0..=most {
        let attempt = Attempt::new(study);
        let ended = start(&attempt, room, &attempt.run()).end();
        let told = format!("room for {room} threads: {ended:?}");
        if ended.code == Some(0) {
            attempt.must_be_the_reference(&[told]);
        } else {
            must_be_named(&ended, if room < OWN { "ulimit -u" } else { "--backend cpu" }, &told);
            refused += 1;
        }
    }
    assert!(refused > 1, "{refused} refused");
    Found::new(most + 1, format!("{refused} refused by name, 0 panics, 0 differing bytes"))
}

/// One error with `remedy`, and nothing else: all commands are quiet.
#[track_caller]
fn must_be_named(ended: &Ended, remedy: &str, told: &str) {
    assert!(ended.code == Some(1) && ended.said.lines().all(|line| line.starts_with("error: ")), "{told}");
    assert!(ended.errors().len() == 1 && ended.errors()[0].contains(remedy), "{told}");
}

/// Runs that have all threads they need, but can start no more when they are to stop. `strace` counts the calls of
/// every thread separately, so the user's limit is lowered instead, as soon as the run has begun.
pub fn none_left_for_signals(study: &'static Study, stops: &[(&str, i32, i32)]) -> Outcome {
    let signals = stops.iter().map(|(name, number, code)| (Some((*name, *number)), *code));
    for (signal, code) in signals.chain([(None, 75)]) {
        // A run may end before it can be stopped, if the tests get less processor time than it does. The clock gives it
        // more and more time to begin.
        let stopped = (0..20).any(|tries| {
            let stop = signal.map_or(Stop::MaxTime(1 << (tries / 2)), |(name, number)| Stop::Signal(name, number));
            stopped_without_threads(study, stop, code)
        });
        assert!(stopped, "{signal:?}: every run was done before it could be stopped");
    }
    Found::new(stops.len() + 1, "stopped, 0 differing bytes")
}

/// What stops a run: a signal, or the end of its seconds.
#[derive(Clone, Copy, Debug)]
enum Stop<'a> {
    Signal(&'a str, i32),
    MaxTime(u64),
}

/// Whether the run was still there to be stopped, and had begun; if so, it ends with `code`. A signal that was ignored
/// from outside, as under `nohup`, stops nothing.
fn stopped_without_threads(study: &'static Study, stop: Stop, code: i32) -> bool {
    let unprivileged = Unprivileged::new();
    let more = match stop {
        Stop::Signal(..) => String::new(),
        Stop::MaxTime(seconds) => format!("--max-time {seconds}s"),
    };
    let arguments = format!("run {} --quiet --checkpoint-every 1s {more} --out out", study.arguments);
    let mut running = unprivileged.start("022", &arguments);
    let out = unprivileged.home.path().join("out");
    let mut ignored = false;
    let is_caught = running.wait_until(|_| out.join(".curvelax.state").exists());
    if is_caught {
        running.signal("STOP");
        let id = running.id().to_string();
        let lowered = unprivileged.command(&["prlimit", "--pid", &id, "--nproc=1:1"]).status().unwrap();
        assert!(lowered.success() || running.is_over(), "{stop:?}");
        match stop {
            Stop::Signal(name, number) => {
                ignored = !running.handles(number);
                running.signal(name);
            }
            // Its time passes, however fast it is.
            Stop::MaxTime(seconds) => sleep(Duration::from_secs(seconds)),
        }
        running.signal("CONT");
    }
    let ended = running.end();
    let attempt = Attempt::new(study);
    if !is_caught && ended.code != Some(0) {
        assert!(matches!(stop, Stop::MaxTime(_)) && ended.code == Some(code), "{stop:?}: {ended:?}");
        return false;
    }
    copy(&out, &attempt.out());
    if ended.code == Some(0) {
        attempt.must_be_the_reference(&[format!("{stop:?}: {ended:?}")]);
        return ignored;
    }
    assert_eq!(ended.code, Some(code), "{stop:?}: {ended:?}");
    attempt.must_end_well(ended);
    true
}

pub fn can_limit() -> bool {
    is_there("prlimit")
}
