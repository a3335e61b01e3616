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

/// Maximum processor time per core in which a run stops when asked. The wall time is only printed, as the machine may
/// be busy with other work.
const SOON: Duration = Duration::from_secs(5);

/// The maximum that runs needed to stop.
#[derive(Default)]
struct Longest {
    waited: Duration,
    worked: Duration,
}

impl Longest {
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

    /// The result, if none worked for longer than `most` on each core.
    fn within(&self, most: Duration) -> String {
        let [waited, worked] = [self.waited, self.worked].map(|time| time.as_secs_f64());
        let told = format!("longest {waited:.2} s, with {worked:.2} s of work");
        let cores = available_parallelism().map_or(1, |cores| cores.get() as u32);
        assert!(self.worked < most * cores, "{told}");
        told
    }
}

/// Stops runs of `studies` at random times by the signals in turn; each is then resumed to its end.
pub fn stop_at_random_times(studies: &[&Study], signals: &[(&str, i32, i32)], cases: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let mut longest = Longest::default();
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
            let hears = running.hears(number);
            running.signal(name);
            let ended = longest.end(running);
            let told = format!("{name} after {time:?} (seed {seed}): {ended:?}");
            match (ended.code, ended.signal) {
                (Some(found), _) if found == code => {
                    assert!(attempt.has_state(), "{told}");
                    stopped += 1;
                }
                // It came before the program received signals.
                (None, Some(found)) if found == number => assert!(!hears, "{told}"),
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
    let mut longest = Longest::default();
    for _ in 0..cases {
        let attempt = Attempt::on_a_fast_disk(study);
        let mut running = attempt.start();
        let time = study.reference().took.mul_f64(0.7 * random.real());
        running.wait_until(|running| running.age() >= time && attempt.has_state());
        running.signal("INT");
        sleep(Duration::from_millis(3).mul_f64(random.real()));
        let (first, mut pressed) = (Instant::now(), 0);
        // Two signals that come before the first is handled count as one: whoever is not heard presses again.
        let ended = longest.end_while(running, |running| {
            if first.elapsed() >= PRESSED_AGAIN * pressed {
                running.signal("INT");
                pressed += 1;
            }
        });
        assert!(matches!((ended.code, ended.signal), (Some(130 | 0), _) | (_, Some(2))), "{ended:?}");
        attempt.must_end_well(ended);
    }
    Found::new(cases, format!("0 differing bytes; {}", longest.within(SOON / 5)))
}

/// The shortest time limit.
const SECOND: Duration = Duration::from_secs(1);
/// How often a run is limited to a second before it may finish.
const SECONDS: usize = 3;

/// A run limited to a second at a time. It is paused until its second is over, wherever it is by then, so that a run
/// that needs less than a second is stopped, too.
pub fn a_second_at_a_time(studies: &[&Study]) -> Outcome {
    let mut stops = 0;
    for study in studies {
        let wanted = stops + 1;
        while stops < wanted {
            let attempt = Attempt::on_a_fast_disk(study);
            let mut ended = a_second(&attempt, &attempt.run());
            for _ in 1..SECONDS {
                if ended.code == Some(75) {
                    stops += 1;
                    ended = a_second(&attempt, "resume out --quiet");
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

fn a_second(attempt: &Attempt, arguments: &str) -> Ended {
    let mut running = Running::start(&mut curvelax(attempt.home.path(), &format!("{arguments} --max-time 1s")));
    // Its clock starts when it begins to receive signals, and runs on while it is paused.
    if running.wait_until(|running| running.hears(15) && attempt.has_state()) {
        running.signal("STOP");
        sleep(SECOND);
        running.signal("CONT");
    }
    let ended = running.end();
    assert!(matches!(ended.code, Some(0 | 75)) && (ended.code == Some(0) || attempt.has_state()), "{ended:?}");
    ended
}
