//! Kills without warning, at random times, repeatedly, also while resuming.

use std::{thread::sleep, time::Duration};

use crate::{
    Found, Outcome,
    program::Running,
    random::Random,
    study::{Attempt, Study},
};

/// When a run is killed.
#[derive(Clone, Copy, Debug)]
enum Moment {
    /// This long after its start.
    After(Duration),
    /// This long after the first file of the last stage appears.
    Publishing(Duration),
}

/// Files that appear when all members have ended: tables over all of them, and final names.
const LAST_STAGE: [&str; 4] = [".ensemble.csv.part", "ensemble.csv", "summary.csv", ".run.json.part"];

/// A moment for a run that needs `whole`: its first milliseconds, its end, and anything between.
fn moment(random: &mut Random, whole: Duration) -> Moment {
    let between = |random: &mut Random, most: Duration| most.mul_f64(random.real());
    match random.below(5) {
        0 => Moment::After(between(random, Duration::from_millis(40)).mul_f64(random.real())),
        1 => Moment::Publishing(between(random, Duration::from_millis(25))),
        _ => Moment::After(between(random, whole.min(Duration::from_millis(2200)))),
    }
}

impl Moment {
    fn wait(self, running: &mut Running, attempt: &Attempt) {
        running.wait_until(|running| match self {
            Moment::After(time) => running.age() >= time,
            Moment::Publishing(_) => LAST_STAGE.iter().any(|name| attempt.out().join(name).exists()),
        });
        if let Moment::Publishing(time) = self {
            sleep(time);
        }
    }
}

/// Kills `study` at least `kills` times: every run of it one to six times before it may finish. Over the files of an
/// `earlier` run, either those or the new ones must be complete.
pub fn at_random_times(study: &Study, earlier: Option<&Study>, kills: usize, seed: u64) -> Outcome {
    let whole = study.reference().took;
    let mut random = Random::new(seed);
    let (mut killed, mut early, mut resuming, mut runs) = (0, 0, 0, 0);
    while killed < kills {
        let attempt = earlier.map_or_else(|| Attempt::new(study), |earlier| Attempt::over(study, earlier));
        let mut running = attempt.start();
        let mut begun = false;
        let mut story = Vec::new();
        for _ in 0..=random.below(6) {
            let moment = moment(&mut random, whole);
            moment.wait(&mut running, &attempt);
            let ended = running.kill();
            story.push(format!("{moment:?} (seed {seed}) {ended:?}"));
            if ended.signal == Some(9) {
                killed += 1;
                resuming += usize::from(begun);
                begun |= attempt.has_state();
                early += usize::from(!begun);
            }
            running = attempt.resume_after(&ended);
        }
        let ended = running.end();
        story.push(format!("{ended:?}"));
        match ended.code {
            Some(0) => attempt.must_be_whole(begun, &story),
            _ if ended.had_not_begun() => attempt.must_end_well(ended),
            _ => return Err(format!("{}: {story:#?}", study.name).into()),
        }
        runs += 1;
    }
    let result = format!("0 differing bytes in {runs} runs; {resuming} kills while resuming, {early} before any state");
    Found::new(killed, result)
}
