//! A folder of files that grows as `.NAME.part` and gets its final name only when it is complete and on disk.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::Path,
};

use super::{
    disk::{create, entries, remove_store, sync_folder, sync_parent},
    place::Place,
};
use curvelax_base::{
    error::{Error, Result},
    input,
};

/// The suffix of a file that is to replace another.
pub(super) const SUCCESSOR: &str = "part";

/// An incomplete folder; it is removed with its contents when dropped, unless [kept](PartFolder::keep).
#[derive(Debug)]
pub struct PartFolder {
    part: Place,
    target: Place,
    /// The folders in it.
    below: Vec<Place>,
    /// Whether an interrupted run began it.
    again: bool,
    keep: bool,
    finished: bool,
}

impl PartFolder {
    /// Creates it, empty, at `part`; its final name is `target`.
    pub(super) fn begin(part: Place, target: Place) -> Result<PartFolder> {
        fs::create_dir(part.at()).map_err(part.io("cannot make the folder"))?;
        Ok(PartFolder { part, target, below: Vec::new(), again: false, keep: false, finished: false })
    }

    /// Continues the folder at `part`, whose files may be written again.
    pub(super) fn again(part: Place, target: Place) -> PartFolder {
        PartFolder { part, target, below: Vec::new(), again: true, keep: true, finished: false }
    }

    /// Creates the folder `name` in it.
    pub fn make(&mut self, name: &str) -> Result<()> {
        let path = self.part.join(name);
        // A link to a folder does not count: its contents are not ours.
        if !(self.again && path.at().symlink_metadata().is_ok_and(|of| of.is_dir())) {
            fs::create_dir(path.at()).map_err(path.io("cannot make the folder"))?;
        }
        self.below.push(path);
        Ok(())
    }

    /// Writes the whole file `name` (with `/` between a folder in it and the file), and returns once it is on disk.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.part.join(name);
        let path = path.at();
        // The file that makes it a store is never absent.
        if self.again && input::bytes(path, bytes.len() as u64).is_ok_and(|old| old == bytes) {
            return Ok(());
        }
        // An existing file stays until its replacement is complete.
        let replaced = self.again && path.symlink_metadata().is_ok();
        let place = if replaced { path.with_extension(SUCCESSOR) } else { path.to_path_buf() };
        let file = if replaced { create(&place) } else { File::create_new(&place) };
        let written = file.and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()?;
            if replaced { fs::rename(&place, path) } else { Ok(()) }
        });
        written.map_err(|e| {
            // Half a file would be mistaken for a whole one.
            let _ = fs::remove_file(&place);
            self.target.join(name).io("cannot write")(e)
        })
    }

    /// Removes unfinished replacements left by a killed run.
    pub(super) fn sweep(&self) -> Result<()> {
        sweep(self.part.at(), true)
            .map_err(|e| Error::Request(format!("{}: cannot continue it ({e})", self.part.shown().display())))
    }

    /// Sets whether to keep the folder if the run fails.
    pub fn keep(&mut self, keep: bool) {
        self.keep = keep;
    }

    /// Its temporary name.
    pub(super) fn part(&self) -> &Place {
        &self.part
    }

    /// The path of its final name, for messages.
    pub fn target(&self) -> &Path {
        self.target.shown()
    }

    /// Returns once the names of all files in it are on disk; their contents already are.
    pub fn sync(&self) -> Result<()> {
        self.below.iter().chain([&self.part]).try_for_each(sync_folder)
    }

    /// Gives the folder its final name, replacing what an earlier run left there.
    pub(super) fn finish(mut self) -> Result<()> {
        remove_store(self.target.at()).map_err(self.target.io("cannot remove"))?;
        fs::rename(self.part.at(), self.target.at()).map_err(self.target.io("cannot write"))?;
        self.finished = true;
        sync_parent(&self.target)
    }
}

impl Drop for PartFolder {
    fn drop(&mut self) {
        if !self.finished && !self.keep {
            let _ = remove_store(self.part.at());
        }
    }
}

/// Removes unfinished replacements in `folder` and, if `below`, in its subfolders.
fn sweep(folder: &Path, below: bool) -> io::Result<()> {
    for path in entries(folder)? {
        if path.symlink_metadata()?.is_dir() {
            if !below {
                let name = path.file_name().unwrap_or_default();
                return Err(io::Error::other(format!("{} is a folder, which no run writes", name.display())));
            }
            sweep(&path, false)?;
        } else if path.extension().is_some_and(|end| end == SUCCESSOR) {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        OutputFolder,
        folder::tests::OLD,
        names::{RUN, STORE},
    };

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn begun(folder: &OutputFolder) -> PartFolder {
        let mut store = folder.store(STORE).unwrap();
        store.write("zarr.json", b"{}").unwrap();
        store.make("x").unwrap();
        store.write("x/c.0", b"new").unwrap();
        store
    }

    #[test]
    fn a_folder_has_its_name_only_when_it_is_complete_and_replaces_that_of_an_earlier_run() {
        let home = tempfile::tempdir().unwrap();
        let old = home.path().join(STORE);
        fs::create_dir_all(old.join("y")).unwrap();
        fs::write(home.path().join(RUN), OLD).unwrap();
        fs::write(old.join("zarr.json"), "old").unwrap();
        fs::write(old.join("y/c.0"), "old").unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let store = begun(&folder);
        assert_eq!(names(&home.path().join(".snapshots.zarr.part")), ["x", "zarr.json"]);
        assert_eq!(names(&old), ["y", "zarr.json"]);
        store.sync().unwrap();
        folder.publish(Vec::new(), Some(store), folder.write(RUN, OLD).unwrap()).unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [RUN, STORE]);
        assert_eq!(names(&old), ["x", "zarr.json"]);
        assert_eq!(fs::read(old.join("x/c.0")).unwrap(), b"new");

        // A run without a store removes it.
        let folder = OutputFolder::open(home.path(), true).unwrap();
        folder.publish(Vec::new(), None, folder.write(RUN, OLD).unwrap()).unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [RUN]);
    }

    #[test]
    fn a_folder_that_is_dropped_is_removed_unless_it_is_worth_keeping() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let folder = OutputFolder::open(&out, false).unwrap();
        drop((begun(&folder), folder));
        assert_eq!(names(home.path()), [""; 0]);

        let folder = OutputFolder::open(&out, false).unwrap();
        let mut store = begun(&folder);
        store.keep(true);
        drop((store, folder));
        assert_eq!(names(&out), [".snapshots.zarr.part"]);
        drop(OutputFolder::open(&out, true).unwrap());
        assert_eq!(names(&out), [""; 0], "the next run removes it");
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named_by_its_final_place() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let store = begun(&folder);
        let error = store.write("absent/c.0", b"new").unwrap_err().to_string();
        assert!(error.starts_with("cannot write ") && error.contains("snapshots.zarr/absent/c.0: "), "{error}");
        assert_eq!(error.matches(".part").count(), 0, "{error}");
    }

    #[test]
    fn what_no_run_has_left_is_not_removed() {
        for (file, problem) in [
            ("snapshots.zarr", "is not a folder"),
            ("snapshots.zarr/mine", "it holds snapshots.zarr/mine, which no run wrote"),
            (".snapshots.zarr.part/mine", "it holds .snapshots.zarr.part/mine, which no run wrote"),
        ] {
            let home = tempfile::tempdir().unwrap();
            fs::write(home.path().join(RUN), OLD).unwrap();
            let mine = home.path().join(file);
            fs::create_dir_all(mine.parent().unwrap()).unwrap();
            fs::write(&mine, "mine").unwrap();
            let error = OutputFolder::open(home.path(), true).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(problem), "{error}");
            assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
        }
        // An empty folder holds nothing to lose.
        let home = tempfile::tempdir().unwrap();
        fs::create_dir(home.path().join(STORE)).unwrap();
        OutputFolder::open(home.path(), true).unwrap();
    }
}
