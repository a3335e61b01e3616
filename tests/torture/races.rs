//! Two programs that start in one folder at the same time.

use crate::{
    Found, Outcome,
    program::{Ended, Running, curvelax},
    study::{Attempt, Study},
};

/// Who starts twice.
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

/// `races` double starts: exactly one proceeds, and the other does not touch it.
pub fn double_starts(study: &Study, races: usize) -> Outcome {
    let middle = Attempt::interrupted(study);
    let mut second_won = 0;
    for race in 0..races {
        let twins = Twins::ALL[race % Twins::ALL.len()];
        let attempt = match twins {
            Twins::Runs => Attempt::new(study),
            _ => middle.fork(),
        };
        let started =
            twins.arguments(&attempt).map(|arguments| Running::start(&mut curvelax(attempt.home.path(), &arguments)));
        let ended = started.map(Running::end);
        let codes = ended.each_ref().map(|ended| ended.code);
        assert!(matches!(codes, [Some(0), Some(2)] | [Some(2), Some(0)]), "{twins:?}: {ended:?}");
        let refused: &Ended = ended.iter().find(|ended| ended.code == Some(2)).unwrap();
        assert!(refused.errors().len() == 1 && refused.said.contains("out"), "{twins:?}: {refused:?}");
        second_won += usize::from(codes[1] == Some(0));
        attempt.must_be_the_reference(&[format!("{twins:?} {ended:?}")]);
    }
    Found::new(races, format!("{races} proceeded, {races} refused, 0 differing bytes; {second_won} times the second"))
}
