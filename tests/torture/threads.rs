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
    surroundings::AsNobody,
};

/// Starts `arguments` where the main thread can start only `room` threads.
fn start(attempt: &Attempt, room: usize, arguments: &str) -> Running {
    let inject = format!("inject=clone,clone3:error=EAGAIN:when={}+", room + 1);
    let starter = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", "trace=clone,clone3", "-e", &inject];
    Running::start(&mut through(attempt.home.path(), &starter, arguments))
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
    let max_time = [("--max-time 1s", 0, 75)];
    for (cause, number, code) in stops.iter().chain(&max_time) {
        // A run may end before it can be stopped, if the tests get less processor time than it does.
        let stopped = (0..20).any(|_| stopped_without_threads(study, cause, *number, *code));
        assert!(stopped, "{cause}: every run was done before it could be stopped");
    }
    Found::new(stops.len() + 1, "stopped, 0 differing bytes")
}

/// Whether the run was still there to be stopped; if so, it ends with `code`. A signal that was ignored from outside, as
/// under `nohup`, stops nothing.
fn stopped_without_threads(study: &'static Study, cause: &str, number: i32, code: i32) -> bool {
    let nobody = AsNobody::new();
    let more = if cause.starts_with("--") { cause } else { "" };
    let arguments = format!("run {} --quiet --checkpoint-every 1s {more} --out out", study.arguments);
    let mut running = nobody.start("022", &arguments);
    let out = nobody.home.path().join("out");
    let mut ignored = false;
    if running.wait_until(|_| out.join(".curvelax.state").exists()) {
        ignored = more.is_empty() && !running.hears(number);
        running.signal("STOP");
        let id = running.id().to_string();
        let lowered = nobody.command(&["prlimit", "--pid", &id, "--nproc=1:1"]).status().unwrap();
        assert!(lowered.success() || running.is_over(), "{cause}");
        if more.is_empty() {
            running.signal(cause);
        } else {
            // Its time passes, however fast it is.
            sleep(Duration::from_millis(1500));
        }
        running.signal("CONT");
    }
    let ended = running.end();
    let attempt = Attempt::new(study);
    copy(&out, &attempt.out());
    if ended.code == Some(0) {
        attempt.must_be_the_reference(&[format!("{cause}: {ended:?}")]);
        return ignored;
    }
    assert_eq!(ended.code, Some(code), "{cause}: {ended:?}");
    attempt.must_end_well(ended);
    true
}

pub fn can_limit() -> bool {
    is_there("prlimit") && is_there("setpriv")
}
