//! Two programs that start in one folder at the same time.

use std::time::Instant;

use crate::{
    Found, Outcome,
    program::{Ended, HANGS, Running, signal, through},
    study::{Attempt, Study},
};

/// Starts when it is woken, so that two programs can be started together.
const HELD: [&str; 3] = ["sh", "-c", "kill -s STOP $$; exec \"$0\" \"$@\""];

/// Open while a run is working, from its start to its end.
const TABLE: &str = ".summary.csv.part";

/// Which command starts twice.
#[derive(Clone, Copy, Debug)]
pub enum Twins {
    Runs,
    ForcedRuns,
    Resumes,
    ResumeAndForcedRun,
}

impl Twins {
    pub const ALL: [Twins; 4] = [Twins::Runs, Twins::ForcedRuns, Twins::Resumes, Twins::ResumeAndForcedRun];

    fn arguments(self, attempt: &Attempt) -> [String; 2] {
        let (run, resume) = (attempt.run(), "resume out --quiet --checkpoint-every 1s".to_string());
        let forced = format!("{run} --force");
        match self {
            Twins::Runs => [run.clone(), run],
            Twins::ForcedRuns => [forced.clone(), forced],
            Twins::Resumes => [resume.clone(), resume],
            Twins::ResumeAndForcedRun => [resume, forced],
        }
    }
}

/// `races` double starts: exactly one proceeds, and the other does not touch its files.
pub fn double_starts(study: &Study, races: usize) -> Outcome {
    let middle = Attempt::interrupted(study);
    let (mut race, mut second_won) = (0, 0);
    let since = Instant::now();
    while race < races {
        assert!(since.elapsed() < HANGS, "no run is caught at work");
        let twins = Twins::ALL[race % Twins::ALL.len()];
        let attempt = match twins {
            Twins::Runs => Attempt::new(study),
            _ => middle.fork(),
        };
        let ended = together(twins.arguments(&attempt).map(|arguments| {
            let mut command = through(attempt.home.path(), &HELD, &arguments);
            Running::start(&mut command)
        }));
        let Some(ended) = ended else { continue };
        race += 1;
        let codes = ended.each_ref().map(|ended| ended.code);
        assert!(matches!(codes, [Some(0), Some(2)] | [Some(2), Some(0)]), "{twins:?}: {ended:?}");
        let refused: &Ended = ended.iter().find(|ended| ended.code == Some(2)).unwrap();
        assert!(refused.errors().len() == 1 && refused.said.contains("out"), "{twins:?}: {refused:?}");
        second_won += usize::from(codes[1] == Some(0));
        attempt.must_be_the_reference(&[format!("{twins:?} {ended:?}")]);
    }
    Found::new(races, format!("{races} proceeded, {races} refused, 0 differing bytes; {second_won} times the second"))
}

/// Starts both at once. The one that begins to work is paused until the other one has ended: it must not finish before
/// the other one checks, however little work there is. None if it did: that was no race.
fn together(mut both: [Running; 2]) -> Option<[Ended; 2]> {
    for one in &mut both {
        one.wait_until(Running::is_held);
    }
    signal("CONT", &both.each_ref());
    let [one, other] = &mut both;
    let mut at_work = None;
    one.wait_until(|one| {
        at_work = [one, &*other].iter().position(|running| running.has_open(TABLE));
        at_work.is_some()
    });
    let [winner, loser] = match at_work? {
        0 => [one, other],
        _ => [other, one],
    };
    winner.signal("STOP");
    if !winner.wait_until(Running::is_held) || !winner.has_open(TABLE) {
        return None;
    }
    loser.wait_until(|_| false);
    winner.signal("CONT");
    Some(both.map(Running::end))
}
