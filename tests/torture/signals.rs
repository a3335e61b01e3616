//! Requests to stop: by a signal at a random time, by two of them, by the clock.

use std::{
    thread::{available_parallelism, sleep},
    time::{Duration, Instant},
};

use crate::{
    Found, Outcome,
    program::{Ended, Running, curvelax},
    random::Random,
    study::{Attempt, Study},
};

/// Maximum processor time of each thread that computes in which a run stops when asked: the program gives itself four
/// seconds, and one is for the process to end. The wall time is only printed, as the machine may be busy with other
/// work.
const SOON: Duration = Duration::from_secs(5);
/// The same for a run that is asked twice, which gives itself one second.
const AT_ONCE: Duration = Duration::from_secs(2);

/// The maximum that runs needed to stop.
struct Longest {
    waited: Duration,
    worked: Duration,
    /// Threads that compute.
    threads: u32,
}

impl Longest {
    fn of(studies: &[&Study]) -> Longest {
        let threads = if studies.iter().all(|study| study.arguments.contains("--threads 1 ")) {
            1
        } else {
            available_parallelism().map_or(1, |cores| cores.get() as u32)
        };
        Longest { waited: Duration::ZERO, worked: Duration::ZERO, threads }
    }

    /// Waits for the end of a run that was asked to stop.
    fn end(&mut self, running: Running) -> Ended {
        self.end_while(running, |_| ())
    }

    /// The same while `what` is done to it.
    fn end_while(&mut self, running: Running, what: impl FnMut(&Running)) -> Ended {
        let asked = Instant::now();
        let (ended, worked) = running.end_while(what);
        self.waited = self.waited.max(asked.elapsed());
        self.worked = self.worked.max(worked);
        ended
    }

    /// The result, if none worked for longer than `most` in each thread.
    fn within(&self, most: Duration) -> String {
        let [waited, worked] = [self.waited, self.worked].map(|time| time.as_secs_f64());
        let told = format!("longest {waited:.2} s, with {worked:.2} s of work");
        assert!(self.worked < most * self.threads, "{told}");
        told
    }
}

/// Stops runs of `studies` at random times by the signals in turn; each is then resumed to its end.
pub fn stop_at_random_times(studies: &[&Study], signals: &[(&str, i32, i32)], cases: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let mut longest = Longest::of(studies);
    let (mut stopped, mut rank) = (0, 0);
    while stopped < cases {
        let study = studies[rank % studies.len()];
        let (name, number, code) = signals[rank % signals.len()];
        rank += 1;
        let attempt = Attempt::on_a_fast_disk(study);
        let mut running = attempt.start();
        // Twice in a row: the second signal stops a resumed run.
        for _ in 0..2 {
            let time = study.reference().took.mul_f64(0.8 * random.real());
            running.wait_until(|running| running.age() >= time);
            let handles = running.handles(number);
            running.signal(name);
            let ended = longest.end(running);
            let told = format!("{name} after {time:?} (seed {seed}): {ended:?}");
            match (ended.code, ended.signal) {
                (Some(found), _) if found == code => {
                    // On a slow machine it may be ended before there is anything to save, and says so.
                    let nothing = ended.said.contains("nothing is saved");
                    assert!(attempt.has_state() || nothing, "{told}");
                    stopped += usize::from(!nothing);
                }
                _ if ended.had_not_begun() => {}
                // It came before the program received signals.
                (None, Some(found)) if found == number => assert!(!handles, "{told}"),
                (Some(0), _) => {}
                _ => return Err(told.into()),
            }
            running = attempt.resume_after(&ended);
        }
        let last = running.end();
        assert!(last.code == Some(0) || last.had_not_begun(), "{last:?}");
        attempt.must_end_well(last);
    }
    Found::new(stopped, format!("0 differing bytes; {}", longest.within(SOON)))
}

/// Time between two Ctrl-C of someone in a hurry.
const PRESSED_AGAIN: Duration = Duration::from_millis(100);

/// A second Ctrl-C does not wait for anything.
pub fn stop_twice(study: &Study, cases: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let mut longest = Longest::of(&[study]);
    for _ in 0..cases {
        let attempt = Attempt::on_a_fast_disk(study);
        let mut running = attempt.start();
        let time = study.reference().took.mul_f64(0.7 * random.real());
        running.wait_until(|running| running.age() >= time && attempt.has_state());
        running.signal("INT");
        sleep(Duration::from_millis(3).mul_f64(random.real()));
        let (first, mut pressed) = (Instant::now(), 0);
        // Two signals that come before the first is handled count as one: press again if nothing happens.
        let ended = longest.end_while(running, |running| {
            if first.elapsed() >= PRESSED_AGAIN * pressed {
                running.signal("INT");
                pressed += 1;
            }
        });
        assert!(matches!((ended.code, ended.signal), (Some(130 | 0), _) | (_, Some(2))), "{ended:?}");
        attempt.must_end_well(ended);
    }
    Found::new(cases, format!("0 differing bytes; {}", longest.within(AT_ONCE)))
}

/// How often a run is limited before it may finish.
const LIMITED: usize = 3;

/// A run limited to a second at a time, or more on a machine that needs more to begin. It is paused until its time is
/// over, wherever it is by then, so that a run that needs less is stopped, too.
pub fn a_second_at_a_time(studies: &[&Study]) -> Outcome {
    let (mut stops, mut seconds) = (0, 1);
    for study in studies {
        let wanted = stops + 1;
        while stops < wanted {
            let attempt = Attempt::on_a_fast_disk(study);
            let mut ended = limited(&attempt, &attempt.run(), seconds);
            if ended.code == Some(75) && !attempt.has_state() {
                seconds *= 2;
                continue;
            }
            for _ in 1..LIMITED {
                if ended.code == Some(75) {
                    stops += 1;
                    ended = limited(&attempt, "resume out --quiet", seconds);
                }
            }
            stops += usize::from(ended.code == Some(75));
            match ended.code {
                Some(0) => attempt.must_be_the_reference(&[format!("{ended:?}")]),
                _ => attempt.must_end_well(ended),
            }
        }
    }
    Found::new(stops, "0 differing bytes")
}

/// A run that ends when its seconds are over, or before. There is a checkpoint, unless they were over before.
fn limited(attempt: &Attempt, arguments: &str, seconds: u64) -> Ended {
    let arguments = format!("{arguments} --max-time {seconds}s");
    let mut running = Running::start(&mut curvelax(attempt.home.path(), &arguments));
    // Its clock starts when it begins to receive signals, and runs on while it is paused.
    let is_caught = running.wait_until(|running| running.handles(15) && attempt.has_state());
    if is_caught {
        running.signal("STOP");
        sleep(Duration::from_secs(seconds));
        running.signal("CONT");
    }
    let ended = running.end();
    assert!(matches!(ended.code, Some(0 | 75)), "{ended:?}");
    assert!(!is_caught || ended.code == Some(0) || attempt.has_state(), "{ended:?}");
    ended
}
