//! The runs under test, and their results when nothing interferes.

use std::{
    fs,
    path::PathBuf,
    sync::OnceLock,
    time::{Duration, Instant},
};

use tempfile::TempDir;

use crate::{
    folder::{Content, content, copy, differences},
    program::{Ended, HANGS, Running, curvelax, through},
};

/// A run by its arguments.
pub struct Study {
    pub name: &'static str,
    pub arguments: &'static str,
    reference: OnceLock<Reference>,
}

/// An undisturbed run.
pub struct Reference {
    home: TempDir,
    pub files: Content,
    pub took: Duration,
}

impl Study {
    pub const fn new(name: &'static str, arguments: &'static str) -> Study {
        Study { name, arguments, reference: OnceLock::new() }
    }

    /// The result of an undisturbed run, made once.
    pub fn reference(&self) -> &Reference {
        self.reference.get_or_init(|| {
            let home = TempDir::new().unwrap();
            let since = Instant::now();
            let arguments = format!("run {} --quiet --out out", self.arguments);
            let ended = Running::start(&mut curvelax(home.path(), &arguments)).end();
            let took = since.elapsed();
            assert_eq!((ended.code, &*ended.said), (Some(0), ""), "{}", self.arguments);
            let files = content(&home.path().join("out"));
            assert!(files.contains_key("summary.csv") && files.contains_key("report.html"), "{:?}", files.keys());
            Reference { home, files, took }
        })
    }
}

/// A folder in which a study must reach its end, whatever is done to it before.
pub struct Attempt<'a> {
    pub study: &'a Study,
    /// The previous, complete contents of the folder.
    earlier: Option<&'a Study>,
    pub home: TempDir,
}

impl<'a> Attempt<'a> {
    pub fn new(study: &'a Study) -> Attempt<'a> {
        study.reference();
        Attempt { study, earlier: None, home: TempDir::new().unwrap() }
    }

    /// In memory if there is room: a shared disk may need a second for a sync, for which the program is not
    /// responsible.
    pub fn on_a_fast_disk(study: &'a Study) -> Attempt<'a> {
        let home = TempDir::new_in("/dev/shm").or_else(|_| TempDir::new());
        Attempt { home: home.unwrap(), ..Attempt::new(study) }
    }

    /// Replaces the files of an earlier run.
    pub fn over(study: &'a Study, earlier: &'a Study) -> Attempt<'a> {
        let attempt = Attempt { earlier: Some(earlier), ..Attempt::new(study) };
        copy(&earlier.reference().home.path().join("out"), &attempt.out());
        attempt
    }

    /// The same in a copy of the folder.
    pub fn fork(&self) -> Attempt<'a> {
        let other = Attempt { earlier: self.earlier, ..Attempt::new(self.study) };
        copy(&self.out(), &other.out());
        other
    }

    pub fn out(&self) -> PathBuf {
        self.home.path().join("out")
    }

    /// Whether there is a checkpoint to resume from.
    pub fn has_state(&self) -> bool {
        self.out().join(".curvelax.state").exists() || self.out().join(".curvelax.state.old").exists()
    }

    /// The arguments of a run from its beginning.
    pub fn run(&self) -> String {
        let force = if self.earlier.is_some() { " --force" } else { "" };
        format!("run {} --quiet --checkpoint-every 1s --out out{force}", self.study.arguments)
    }

    /// Starts the run.
    pub fn start(&self) -> Running {
        self.start_through(&[])
    }

    pub fn start_through(&self, starter: &[&str]) -> Running {
        Running::start(&mut through(self.home.path(), starter, &self.run()))
    }

    pub fn resume(&self) -> Running {
        self.resume_through(&[])
    }

    pub fn resume_through(&self, starter: &[&str]) -> Running {
        let resume = "resume out --quiet --checkpoint-every 1s";
        Running::start(&mut through(self.home.path(), starter, resume))
    }

    /// Continues like a user who reads the messages: resumes a run that has begun, and otherwise starts again.
    pub fn resume_after(&self, last: &Ended) -> Running {
        if last.had_not_begun() {
            assert!(!self.has_state(), "there is a state, but {last:?}");
            let anew = if self.earlier.is_some() { self.run() } else { format!("{} --force", self.run()) };
            return Running::start(&mut curvelax(self.home.path(), &anew));
        }
        match self.out().exists() {
            true => self.resume(),
            false => self.start(),
        }
    }

    /// Lets the study reach its end after `last`; then exactly its files must be there, as if nothing had happened.
    #[track_caller]
    pub fn must_end_well(&self, mut last: Ended) {
        let begun = self.has_state();
        let mut story = vec![format!("{last:?}")];
        for _ in 0..3 {
            last = self.resume_after(&last).end();
            story.push(format!("{last:?}"));
            if last.code == Some(0) {
                return self.must_be_whole(begun, &story);
            }
            assert!(last.had_not_begun(), "{}: {story:#?}, in {:?}", self.study.name, self.names());
        }
        panic!("{}: does not get on: {story:#?}", self.study.name);
    }

    #[track_caller]
    pub fn must_be_the_reference(&self, story: &[String]) {
        self.must_be_whole(true, story);
    }

    /// The files of the study; or, if it may not have `begun`, those that were there before.
    #[track_caller]
    pub fn must_be_whole(&self, begun: bool, story: &[String]) {
        let found = content(&self.out());
        let differences = differences(&self.study.reference().files, &found);
        let is_earlier = self.earlier.is_some_and(|earlier| earlier.reference().files == found);
        assert!(
            differences.is_empty() || (is_earlier && !begun),
            "{}: {differences:#?} after {story:#?}; the earlier run: {is_earlier}",
            self.study.name
        );
    }

    /// The entries of the folder.
    pub fn names(&self) -> Vec<String> {
        match self.out().exists() {
            true => content(&self.out()).into_keys().collect(),
            false => Vec::new(),
        }
    }

    /// A run that was interrupted as early as possible, with its messages.
    pub fn interrupted(study: &'a Study) -> Attempt<'a> {
        let since = Instant::now();
        // A run may end before it is checked.
        while since.elapsed() < HANGS {
            let attempt = Attempt::new(study);
            let mut running = attempt.start();
            running.wait_until(|_| attempt.out().join(".curvelax.state").exists());
            let ended = running.kill();
            if ended.signal == Some(9) && attempt.has_state() {
                return attempt;
            }
        }
        panic!("{}: cannot be interrupted", study.name);
    }

    /// Writes `text` into a file of the folder.
    pub fn write(&self, name: &str, text: &[u8]) {
        fs::write(self.out().join(name), text).unwrap();
    }
}
