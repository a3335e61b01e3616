//! Asked to stop: by a signal at a random time, by two of them, by the clock.

use std::{
    thread::sleep,
    time::{Duration, Instant},
};

use crate::{
    Found, Outcome,
    program::{Running, curvelax},
    random::Random,
    study::{Attempt, Study},
};

/// A run that was asked to stop has stopped after so long.
pub const SOON: Duration = Duration::from_secs(5);

/// So long a program may take until it listens to signals.
const WAKES: Duration = Duration::from_millis(300);

/// Stops runs of `studies` at random times by the signals in turn; each is then resumed to its end.
pub fn stop_at_random_times(studies: &[&Study], signals: &[(&str, i32, i32)], cases: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let mut longest = Duration::ZERO;
    let (mut stopped, mut rank) = (0, 0);
    while stopped < cases {
        let study = studies[rank % studies.len()];
        let (name, number, code) = signals[rank % signals.len()];
        rank += 1;
        let attempt = Attempt::on_a_fast_disk(study);
        let mut running = attempt.start();
        // Twice in a row: the second one stops a resumed run.
        for _ in 0..2 {
            let time = study.reference().took.mul_f64(0.8 * random.real());
            running.wait_until(|running| running.age() >= time);
            let (asked, age) = (Instant::now(), running.age());
            running.signal(name);
            let ended = running.end();
            longest = longest.max(asked.elapsed());
            let told = format!("{name} after {time:?} (seed {seed}): {ended:?}");
            match (ended.code, ended.signal) {
                (Some(found), _) if found == code => {
                    assert!(attempt.has_state(), "{told}");
                    stopped += 1;
                }
                // It came before the program listened, or when all was done.
                (None, Some(found)) if found == number => assert!(!attempt.has_state() || age < WAKES, "{told}"),
                (Some(0), _) => {}
                _ => return Err(told.into()),
            }
            running = attempt.go_on(&ended);
        }
        let last = running.end();
        assert!(last.code == Some(0) || last.had_not_begun(), "{last:?}");
        attempt.must_end_well(last);
    }
    assert!(longest < SOON, "{longest:?} to stop");
    Found::new(stopped, format!("0 differing bytes; longest {:.2} s", longest.as_secs_f64()))
}

/// Between one Ctrl-C and the next of somebody in a hurry.
const PRESSED_AGAIN: Duration = Duration::from_millis(100);

/// A second Ctrl-C does not wait for anything.
pub fn stop_twice(study: &Study, cases: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let mut longest = Duration::ZERO;
    for _ in 0..cases {
        let attempt = Attempt::on_a_fast_disk(study);
        let mut running = attempt.start();
        let time = study.reference().took.mul_f64(0.7 * random.real());
        running.wait_until(|running| running.age() >= time && attempt.has_state());
        running.signal("INT");
        sleep(Duration::from_millis(3).mul_f64(random.real()));
        let asked = Instant::now();
        // Two that come before the first is looked at are one: who is not heard presses again.
        while !running.is_over() && asked.elapsed() < SOON {
            running.signal("INT");
            sleep(PRESSED_AGAIN);
        }
        let ended = running.end();
        longest = longest.max(asked.elapsed());
        assert!(matches!((ended.code, ended.signal), (Some(130 | 0), _) | (_, Some(2))), "{ended:?}");
        attempt.must_end_well(ended);
    }
    assert!(longest < SOON / 5, "{longest:?} to stop at once");
    Found::new(cases, format!("0 differing bytes; longest {:.2} s", longest.as_secs_f64()))
}

/// A run that may only take a second at a time.
pub fn a_second_at_a_time(studies: &[&Study]) -> Outcome {
    let mut stops = 0;
    for study in studies {
        let attempt = Attempt::on_a_fast_disk(study);
        let second = |arguments: &str| {
            let arguments = format!("{arguments} --max-time 1s");
            Running::start(&mut curvelax(attempt.home.path(), &arguments)).end()
        };
        let mut ended = second(&attempt.run());
        while ended.code == Some(75) {
            assert!(attempt.has_state(), "{ended:?}");
            stops += 1;
            assert!(stops < 100, "{}: does not get on", study.name);
            ended = second("resume out --quiet");
        }
        assert_eq!(ended.code, Some(0), "{ended:?}");
        attempt.must_be_the_reference(&[format!("{ended:?}")]);
    }
    assert!(stops > 0, "no run was as long as a second");
    Found::new(stops, "0 differing bytes")
}
