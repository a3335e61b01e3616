//! What an earlier run left in a folder: names in the way, and files to remove.

use std::{io, path::Path};

use super::OutputFolder;
use crate::{
    disk::{is_own_store, is_real_folder, remove_any},
    names::{OUTLINES, PLOTS, PROBE, STATE, STATE_OLD, STATE_PART, is_store},
    place::Place,
};
use curvelax_base::error::{Error, Result};

impl OutputFolder {
    /// Refuses, before any work, a folder in which this run could not give its files their final names.
    pub(super) fn check_names(&mut self) -> Result<()> {
        let in_the_way = |place: &Place, what: &str| {
            let problem = format!("{} is {what}", place.shown().display());
            Err(Error::value("out", self.path().display(), &problem, "move it away, or use another folder"))
        };
        let plots = self.place(PLOTS);
        let needed = self.names.iter().any(|name| Path::new(name).starts_with(PLOTS));
        let new_plots = needed && plots.at().symlink_metadata().is_err();
        if needed && !new_plots && !is_real_folder(plots.at()) {
            return in_the_way(&plots, if plots.at().is_symlink() { "a link, not a folder" } else { "not a folder" });
        }
        let others = [STATE, STATE_OLD, STATE_PART, OUTLINES, PROBE].map(|name| self.place(name));
        let own = self.names.iter().flat_map(|name| [self.place(name), self.part(name)]);
        for place in own.chain(others) {
            let path = place.at();
            match (is_store(path), path.is_dir()) {
                // A link to a folder is removed like one to a file.
                (false, true) if !path.is_symlink() => return in_the_way(&place, "a folder"),
                (true, false) if path.symlink_metadata().is_ok() => return in_the_way(&place, "not a folder"),
                // Everything in it would be removed.
                (true, true) if !is_own_store(path) => {
                    return in_the_way(&place, "not the folder of an earlier run");
                }
                _ => {}
            }
        }
        self.new_plots = new_plots;
        Ok(())
    }

    /// Removes what an interrupted run left, except the files in `keep`.
    pub(super) fn remove_parts(&self, keep: &[&str]) -> io::Result<()> {
        let parts = self.names.iter().filter(|name| !keep.contains(&name.as_str()));
        parts.into_iter().try_for_each(|name| remove_any(self.part(name).at()))
    }

    /// Removes what a run killed before its first checkpoint left next to the files of a complete one.
    pub fn tidy(&self) -> Result<()> {
        self.forget_states()?;
        self.keep_only(&[])
    }

    /// Removes everything that an interrupted run left, except `names`.
    pub fn keep_only(&self, names: &[&str]) -> Result<()> {
        self.remove_parts(names).map_err(self.place.io("cannot remove what a run left in"))
    }

    pub(super) fn remove_own(&self, name: &str) -> Result<()> {
        let place = self.place(name);
        remove_any(place.at()).map_err(place.io("cannot remove"))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{
        folder::tests::{OLD, names},
        names::{CURVES, RUN, SUMMARY},
    };

    #[test]
    fn names_that_no_file_could_take_are_refused_before_any_work() {
        for (folders, files) in [(&[SUMMARY][..], &[][..]), (&["plots", CURVES], &[]), (&[], &["plots"])] {
            let home = tempfile::tempdir().unwrap();
            fs::write(home.path().join(RUN), OLD).unwrap();
            folders.iter().for_each(|name| fs::create_dir(home.path().join(name)).unwrap());
            files.iter().for_each(|name| fs::write(home.path().join(name), "mine").unwrap());
            let before = names(home.path());
            let error = OutputFolder::open(home.path(), true).unwrap_err();
            let name = folders.last().or(files.last()).unwrap();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(&format!("{} is ", home.path().join(name).display())), "{error}");
            assert_eq!(names(home.path()), before);
        }
    }

    #[test]
    fn force_removes_what_an_interrupted_run_left() {
        let home = tempfile::tempdir().unwrap();
        fs::create_dir(home.path().join("plots")).unwrap();
        for name in [".summary.csv.part", ".snapshots.csv.part", "plots/.curves.svg.part", ".mine.part"] {
            fs::write(home.path().join(name), "old").unwrap();
        }
        drop(OutputFolder::open(home.path(), true).unwrap());
        assert_eq!(names(home.path()), [".mine.part", "plots"]);
        assert_eq!(names(&home.path().join("plots")), [""; 0]);
    }
}
