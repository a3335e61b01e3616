//! The output folder. A file grows as `.NAME.part` and takes its final name only when it is complete and on disk.

use std::{
    fs::{self, File},
    io::{self, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use super::{
    claim::Claim,
    disk::{checksum, create, is_own_store, names_of, parent, remove, remove_store, sync_folder, sync_names},
    names::{OWN, PLOTS, PROBE, RUN, STATE, STATE_OLD, STATE_PART, STORE, is_store, part},
    owner::{Existing, Owner},
    part_file::{Mark, PartFile},
    part_folder::PartFolder,
    place::Place,
    zarr,
};
use crate::{
    error::{Error, Result},
    input,
};

/// The system knows no longer paths.
const MAX_PATH: usize = if cfg!(target_os = "linux") { 4096 } else { 1024 };
/// Bytes of the longest name in a folder: a chunk of a store, for more members than there are.
const MAX_NAME: usize = 96;

/// A folder that this run, and no other at the same time, may write into.
///
/// It is reached through what was opened: a folder that is moved away takes its files with it, and what comes into its place
/// is not touched.
///
/// Dropped while empty, the folders that were made for this run are removed again.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// The folders that were made for this run, outermost first.
    made: Vec<PathBuf>,
    new_plots: bool,
    /// None until it is held.
    claim: Option<Claim>,
    /// What it is in it.
    place: Place,
    /// The files that may be written.
    names: Vec<String>,
}

impl OutputFolder {
    /// The folder of a run, as [`OutputFolder::open_for`] makes it.
    pub fn open(path: &Path, existing: impl Into<Existing>) -> Result<OutputFolder> {
        OutputFolder::open_for(path, existing, Owner::Run, OWN.map(String::from).into())
    }

    /// Makes the folder and its parents, for `owner` to write the files `names` into. One that exists is refused but for
    /// what `existing` allows; so is one that another command wrote, a place that cannot be written, and one where
    /// another run is writing.
    pub fn open_for(
        path: &Path,
        existing: impl Into<Existing>,
        owner: Owner,
        names: Vec<String>,
    ) -> Result<OutputFolder> {
        let refuse = |e: io::Error| {
            Error::Request(format!("--out {}: cannot be written ({e}); name a folder that can", path.display()))
        };
        let existing = existing.into();
        check_length(path)?;
        let mut folder = OutputFolder::of(path, names);
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            if parent.exists() && !parent.is_dir() {
                let problem = format!("{} is no folder", parent.display());
                return Err(Error::value("out", path.display(), &problem, "name a place inside a folder"));
            }
            folder.make_all(parent).map_err(refuse)?;
        }
        match fs::create_dir(path) {
            Ok(()) => folder.made.push(path.to_path_buf()),
            Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(refuse(e)),
            Err(_) if !path.is_dir() => {
                return Err(Error::value("out", path.display(), "exists and is no folder", "name another"));
            }
            // Before its lock is touched.
            Err(_) => existing.check(path, path, &folder.names)?,
        }
        if !folder.claim().map_err(refuse)? {
            return Err(Error::value("out", path.display(), "a run is writing here", "name another folder"));
        }
        // Another run may have come and gone in between.
        existing.check(folder.place.at(), path, &folder.names)?;
        owner.check(folder.place.at(), path)?;
        folder.check_names()?;
        folder.probe().map_err(refuse)?;
        // What an interrupted run left; its lock is gone, so it is no longer writing.
        if owner == Owner::Run {
            folder.forget_states()?;
        }
        folder.remove_parts(&[]).map_err(refuse)?;
        folder.made.iter().try_for_each(|made| sync_names(parent(made))).map_err(refuse)?;
        Ok(folder)
    }

    /// The folder of an interrupted run, as it is.
    ///
    /// # Errors
    /// [`Error::Request`] where there is none, where it cannot be written, or where another run is writing.
    pub fn open_again(path: &Path) -> Result<OutputFolder> {
        let refuse = |problem: String| Error::Request(format!("{}: {problem}", path.display()));
        let cannot = |e: io::Error| refuse(format!("cannot be written ({e})"));
        if !path.is_dir() {
            return Err(refuse("no such folder; name that of a run".into()));
        }
        // A folder that no run has begun in is left as it is.
        let mut begun = false;
        for name in [STATE, STATE_OLD, RUN] {
            begun |= path.join(name).try_exists().map_err(|e| refuse(format!("cannot find {name} in it ({e})")))?;
        }
        if !begun {
            return Err(refuse("no run was begun here; begin it with curvelax run and --force".into()));
        }
        let mut folder = OutputFolder::of(path, OWN.map(String::from).into());
        if !folder.claim().map_err(cannot)? {
            return Err(refuse("a run is writing here; wait for its end".into()));
        }
        folder.check_names()?;
        folder.probe().map_err(cannot)?;
        Ok(folder)
    }

    fn of(path: &Path, names: Vec<String>) -> OutputFolder {
        let place = Place::named(path);
        OutputFolder { path: path.into(), made: Vec::new(), new_plots: false, claim: None, place, names }
    }

    /// Returns whether the folder is held by this run from now on.
    fn claim(&mut self) -> io::Result<bool> {
        self.claim = Claim::take(&self.path)?;
        if let Some(claim) = &self.claim {
            self.place = claim.place().clone();
        }
        Ok(self.claim.is_some())
    }

    /// Stays where it is when the current folder changes.
    pub fn make_absolute(&mut self) -> Result<()> {
        self.path = std::path::absolute(&self.path).map_err(Error::io("cannot find", &self.path))?;
        if let Some(claim) = &mut self.claim {
            claim.make_absolute()?;
            self.place = claim.place().clone();
        }
        Ok(())
    }

    /// That the folder is still held by this run, and still where it was found.
    ///
    /// # Errors
    /// [`Error::Lost`] where it is not.
    pub fn check_claim(&self) -> Result<()> {
        self.claim.as_ref().map_or(Ok(()), Claim::check)
    }

    /// Why `error` came: because the folder was taken away, if it was.
    pub fn explain(&self, error: Error) -> Error {
        match self.check_claim() {
            Err(lost @ Error::Lost(_)) => lost,
            _ => error,
        }
    }

    /// Whether files can be made here.
    fn probe(&self) -> io::Result<()> {
        let probe = self.place.join(PROBE);
        create(probe.at()).and_then(|_| fs::remove_file(probe.at()))
    }

    /// Removes what an interrupted run left, but for the files in `keep`.
    fn remove_parts(&self, keep: &[&str]) -> io::Result<()> {
        let parts = self.names.iter().filter(|name| !keep.contains(&name.as_str()));
        parts.into_iter().try_for_each(|name| remove_any(self.part(name).at()))
    }

    /// Removes what a run left beside the files of a complete one because it was killed before its first state.
    pub fn tidy(&self) -> Result<()> {
        self.forget_states()?;
        self.keep_only(&[])
    }

    /// Where it was found.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is called `name` in it.
    pub fn place(&self, name: &str) -> Place {
        self.place.join(name)
    }

    /// Begins the file `name` (with `/` between a subfolder and the file).
    pub fn file(&self, name: &str) -> Result<PartFile> {
        let (target, part) = (self.place(name), self.part(name));
        if let Some(below) = Path::new(name).parent().filter(|below| !below.as_os_str().is_empty()) {
            self.make_below(below)?;
        }
        let file = create(part.at()).map_err(part.io("cannot write"))?;
        Ok(PartFile::new(file, part, target, Mark { name: name.into(), length: 0, crc: 0 }))
    }

    /// Makes the folder `name` in it. A link to another one is none.
    fn make_below(&self, name: &Path) -> Result<()> {
        let below = self.place.join(name);
        let made = match fs::create_dir(below.at()) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && !is_real_folder(below.at()) => Err(e),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            made => made,
        };
        made.map_err(below.io("cannot make the folder"))
    }

    /// Whether the file is there, under its temporary or its final name, as far as `mark` goes; else what is wrong with it.
    pub fn check(&self, mark: &Mark) -> std::result::Result<(), String> {
        // A state that was not written by this program could name any file.
        if !self.names.contains(&mark.name) || is_store(Path::new(&mark.name)) {
            return Err(format!("it tells of {:?}, which no run writes", mark.name));
        }
        let place = self.growing(&mark.name).map_err(|e| format!("cannot find {} ({e})", mark.name))?;
        let path = place.shown().display();
        if place.at().is_symlink() {
            return Err(format!("{path} is a link, which no run writes"));
        }
        let same = input::open(place.at())
            .and_then(|file| Ok(checksum(&mut file.take(mark.length), 0)? == (mark.length, mark.crc)));
        match same {
            Ok(true) => Ok(()),
            Ok(false) => Err(format!("{path} is not the file that it tells of")),
            Err(e) => Err(format!("cannot read {path} ({e})")),
        }
    }

    /// The same for the folder of a store.
    pub fn check_store(&self, mark: &zarr::Mark) -> std::result::Result<(), String> {
        mark.check(&self.growing(STORE).map_err(|e| format!("cannot find {STORE} ({e})"))?)
    }

    /// Removes everything that an interrupted run left but for what `names` name.
    pub fn keep_only(&self, names: &[&str]) -> Result<()> {
        self.remove_parts(names).map_err(Error::io("cannot remove what a run left in", &self.path))
    }

    /// Goes on with a file of an interrupted run. What was written after `mark` is cut off.
    pub fn file_again(&self, mark: &Mark) -> Result<PartFile> {
        let part = self.back(&mark.name)?;
        let cut = |path: &Path| {
            let mut file = input::open_as(path, File::options().read(true).write(true))?;
            if names_of(&file)? > 1 {
                file = self.copy(file, path, mark.length)?;
            }
            file.set_len(mark.length)?;
            file.seek(SeekFrom::End(0))?;
            Ok(file)
        };
        let file = cut(part.at()).map_err(part.io("cannot write"))?;
        Ok(PartFile::new(file, part, self.place(&mark.name), mark.clone()))
    }

    /// Puts a copy of the first `length` bytes of `file` in its place at `path`: under its other names it stays what it is.
    fn copy(&self, file: File, path: &Path, length: u64) -> io::Result<File> {
        let spare = self.place(PROBE);
        let mut copy = create(spare.at())?;
        io::copy(&mut file.take(length), &mut copy)?;
        copy.sync_all()?;
        fs::rename(spare.at(), path)?;
        Ok(copy)
    }

    /// The same for the folder of a store.
    pub fn store_again(&self, name: &str) -> Result<PartFolder> {
        let store = PartFolder::again(self.back(name)?, self.place(name));
        store.sweep()?;
        Ok(store)
    }

    /// Where `name` lies of a run that was interrupted: if that was at its very end, under its final name.
    fn growing(&self, name: &str) -> io::Result<Place> {
        let part = self.part(name);
        match part.at().symlink_metadata() {
            Ok(_) => Ok(part),
            Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(self.place(name)),
            Err(e) => Err(e),
        }
    }

    /// Gives `name` its temporary name back, which is returned.
    fn back(&self, name: &str) -> Result<Place> {
        let part = self.part(name);
        let now = self.growing(name).map_err(part.io("cannot find"))?;
        if now.at() != part.at() {
            fs::rename(now.at(), part.at()).map_err(now.io("cannot rename"))?;
        }
        Ok(part)
    }

    /// Puts a state in the place of the last one, which is kept as the one before.
    pub fn keep_state(&self, bytes: &[u8]) -> Result<()> {
        self.check_claim()?;
        let [state, old, part] = [STATE, STATE_OLD, STATE_PART].map(|name| self.place(name));
        let written = create(part.at()).and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        });
        let renamed = written.and_then(|()| {
            if state.at().exists() {
                fs::rename(state.at(), old.at())?;
            }
            fs::rename(part.at(), state.at())
        });
        renamed.map_err(|e| {
            let _ = remove(part.at());
            state.io("cannot write")(e)
        })?;
        sync_folder(&self.place)
    }

    /// Removes a last state that is damaged, lest it become the one before.
    pub fn forget_last_state(&self) -> Result<()> {
        let state = self.place(STATE);
        remove(state.at()).map_err(state.io("cannot remove"))
    }

    /// Removes the states, the older one first: alone it would go on with files that have their final names.
    pub fn forget_states(&self) -> Result<()> {
        for name in [STATE_PART, STATE_OLD, STATE] {
            let place = self.place(name);
            remove(place.at()).map_err(place.io("cannot remove"))?;
        }
        Ok(())
    }

    /// Begins the folder `name`, which must be that of a store.
    pub fn store(&self, name: &str) -> Result<PartFolder> {
        PartFolder::begin(self.part(name), self.place(name))
    }

    /// Writes the whole file `name`, ready for [`OutputFolder::publish`].
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<PartFile> {
        let mut file = self.file(name)?;
        file.write_all(content.as_ref()).map_err(Error::io("cannot write", file.target()))?;
        file.sync()?;
        Ok(file)
    }

    /// Gives what is complete its final name, `run` last, and removes what an earlier run wrote and this one did not.
    ///
    /// All of them are on disk by now, so that little is left that can fail. The earlier `run.json` goes first: no
    /// moment has one that vouches for the files of two runs.
    pub fn publish(&self, files: Vec<PartFile>, store: Option<PartFolder>, run: PartFile) -> Result<()> {
        self.check_claim()?;
        let mut written: Vec<String> = files.iter().map(|file| file.name().to_string()).collect();
        written.extend(store.iter().map(|_| STORE.to_string()));
        self.remove_own(RUN)?;
        files.into_iter().try_for_each(PartFile::finish)?;
        store.map_or(Ok(()), PartFolder::finish)?;
        OWN.iter().filter(|name| !written.iter().any(|own| own == *name)).try_for_each(|name| self.remove_own(name))?;
        run.finish()?;
        self.check_claim()
    }

    /// Gives complete files their final names, and touches no others.
    pub fn publish_all(&self, files: Vec<PartFile>) -> Result<()> {
        self.check_claim()?;
        files.into_iter().try_for_each(PartFile::finish)?;
        self.check_claim()
    }

    fn remove_own(&self, name: &str) -> Result<()> {
        let place = self.place(name);
        remove_any(place.at()).map_err(place.io("cannot remove"))
    }

    /// The temporary name of `name`.
    fn part(&self, name: &str) -> Place {
        self.place.join(part(Path::new(name)))
    }

    /// As `fs::create_dir_all`, remembering what was made.
    fn make_all(&mut self, path: &Path) -> io::Result<()> {
        let missing: Vec<&Path> = path.ancestors().take_while(|folder| !folder.is_dir()).collect();
        for folder in missing.into_iter().rev().filter(|folder| !folder.as_os_str().is_empty()) {
            match fs::create_dir(folder) {
                Ok(()) => self.made.push(folder.to_path_buf()),
                Err(_) if folder.is_dir() => {}
                Err(e) => return Err(e),
            }
        }
        Ok(())
    }

    /// Refuses, before any work, names that this run could not give to its files at the end.
    fn check_names(&mut self) -> Result<()> {
        let in_the_way = |place: &Place, what: &str| {
            let problem = format!("{} is {what}", place.shown().display());
            Err(Error::value("out", self.path.display(), &problem, "move it away, or name another folder"))
        };
        let plots = self.place(PLOTS);
        let needed = self.names.iter().any(|name| Path::new(name).starts_with(PLOTS));
        let new_plots = needed && plots.at().symlink_metadata().is_err();
        if needed && !new_plots && !is_real_folder(plots.at()) {
            return in_the_way(&plots, if plots.at().is_symlink() { "a link, and no folder" } else { "no folder" });
        }
        let others = [STATE, STATE_OLD, STATE_PART, PROBE].map(|name| self.place(name));
        let own = self.names.iter().flat_map(|name| [self.place(name), self.part(name)]);
        for place in own.chain(others) {
            let path = place.at();
            match (is_store(path), path.is_dir()) {
                // A link to a folder is removed like one to a file.
                (false, true) if !path.is_symlink() => return in_the_way(&place, "a folder"),
                (true, false) if path.symlink_metadata().is_ok() => return in_the_way(&place, "no folder"),
                // All in it would be removed.
                (true, true) if !is_own_store(path) => {
                    return in_the_way(&place, "not the folder of an earlier run");
                }
                _ => {}
            }
        }
        self.new_plots = new_plots;
        Ok(())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // Removing a folder fails, as it should, where there is something inside.
        if self.new_plots {
            let _ = fs::remove_dir(self.place(PLOTS).at());
        }
        // Others may be where it was.
        let stays = self.claim.as_ref().is_none_or(Claim::stays);
        self.claim = None;
        // A folder that stays keeps those above it, also those that only its name goes through (`new/../out`).
        if stays {
            let _ = self.made.iter().rev().try_for_each(fs::remove_dir);
        }
    }
}

/// Refuses a path in which not every file would have one.
fn check_length(path: &Path) -> Result<()> {
    let (length, most) = (path.as_os_str().len(), MAX_PATH - MAX_NAME);
    match length > most {
        true => Err(Error::Request(format!(
            "--out: a path of {length} bytes, and with the names of files the system knows none of more than {MAX_PATH}; \
             name a folder by {most} bytes or less, for example from nearer by"
        ))),
        false => Ok(()),
    }
}

/// Whether a folder is there, and no link to one.
fn is_real_folder(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|of| of.is_dir())
}

/// Removes a file, or the folder of a store; either may be absent.
fn remove_any(path: &Path) -> io::Result<()> {
    match is_store(path) {
        true => remove_store(path),
        false => remove(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{
        claim::LOCK,
        names::{CURVES, SERIES, SUMMARY},
    };

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_has_its_name_only_when_it_is_complete() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(&home.path().join("a/b"), false).unwrap();
        let mut file = folder.file(CURVES).unwrap();
        file.write_all(b"half").unwrap();
        file.sync().unwrap();
        assert_eq!(names(&folder.path().join("plots")), [".curves.svg.part"]);
        file.finish().unwrap();
        assert_eq!(names(&folder.path().join("plots")), ["curves.svg"]);
        assert_eq!(fs::read(folder.path().join(CURVES)).unwrap(), b"half");
    }

    #[test]
    fn what_exists_is_refused_without_force() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("file");
        fs::write(&file, "mine").unwrap();
        for (path, force) in [(home.path(), false), (&file, false), (&file, true), (&file.join("below"), true)] {
            let error = OutputFolder::open(path, force).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().starts_with(&format!("--out {}: ", path.display())), "{error}");
        }
        assert_eq!(names(home.path()), ["file"]);
    }

    #[test]
    fn force_replaces_the_files_of_a_run_and_no_others() {
        let home = tempfile::tempdir().unwrap();
        for name in [SUMMARY, SERIES, RUN, "notes.txt"] {
            fs::write(home.path().join(name), "old").unwrap();
        }
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let summary = folder.write(SUMMARY, "new").unwrap();
        let run = folder.write(RUN, "new").unwrap();
        for name in [SUMMARY, SERIES, RUN] {
            assert_eq!(fs::read(home.path().join(name)).unwrap(), b"old", "{name} goes before the new files are ready");
        }
        folder.publish(vec![summary], None, run).unwrap();
        drop(folder);
        assert_eq!(names(home.path()), ["notes.txt", RUN, SUMMARY]);
        for (name, text) in [(SUMMARY, "new"), (RUN, "new"), ("notes.txt", "old")] {
            assert_eq!(fs::read_to_string(home.path().join(name)).unwrap(), text, "{name}");
        }
    }

    #[test]
    fn a_folder_of_other_files_leaves_those_of_a_run_alone() {
        let home = tempfile::tempdir().unwrap();
        for name in [SUMMARY, "plots", ".summary.csv.part", ".a.svg.part", "b.svg"] {
            fs::write(home.path().join(name), "old").unwrap();
        }
        let folder = OutputFolder::open_for(home.path(), true, Owner::Figure, vec!["a.svg".into()]).unwrap();
        let file = folder.write("a.svg", "new").unwrap();
        folder.publish_all(vec![file]).unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [".summary.csv.part", "a.svg", "b.svg", "plots", SUMMARY]);
        fs::create_dir(home.path().join("c.svg")).unwrap();
        let error = OutputFolder::open_for(home.path(), true, Owner::Figure, vec!["c.svg".into()]).unwrap_err();
        assert!(error.to_string().contains("c.svg is a folder"), "{error}");
    }

    #[test]
    fn names_that_no_file_could_take_are_refused_before_any_work() {
        for (folders, files) in [(&[SUMMARY][..], &[][..]), (&["plots", CURVES], &[]), (&[], &["plots"])] {
            let home = tempfile::tempdir().unwrap();
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

    #[cfg(unix)]
    #[test]
    fn no_link_is_followed() {
        let home = tempfile::tempdir().unwrap();
        let (out, mine) = (home.path().join("out"), home.path().join("mine"));
        fs::create_dir(&out).unwrap();
        fs::write(&mine, "mine").unwrap();
        let link = |name: &str, to: &Path| std::os::unix::fs::symlink(to, out.join(name)).unwrap();
        link(".curvelax.part", &mine);
        link(LOCK, &home.path().join("absent"));
        let folder = OutputFolder::open(&out, true).unwrap();
        link(".summary.csv.part", &mine);
        folder.write(SUMMARY, "new").unwrap().finish().unwrap();
        drop(folder);
        assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
        assert!(!out.join(SUMMARY).is_symlink());
        assert_eq!(names(home.path()), ["mine", "out"]);
    }

    #[test]
    fn parents_made_for_nothing_are_removed_and_others_are_not() {
        let home = tempfile::tempdir().unwrap();
        fs::create_dir(home.path().join("old")).unwrap();
        drop(OutputFolder::open(&home.path().join("old/new/out"), false).unwrap());
        assert_eq!(names(&home.path().join("old")), [""; 0]);
        let endless = "x".repeat(1000);
        OutputFolder::open(&home.path().join("new/deep").join(endless), false).unwrap_err();
        assert_eq!(names(home.path()), ["old"]);

        let path = home.path().join("through/../out");
        let folder = OutputFolder::open(&path, false).unwrap();
        folder.write(RUN, "new").unwrap().finish().unwrap();
        drop(folder);
        assert_eq!(names(&path), [RUN], "a folder in use keeps its name");
    }

    #[test]
    fn one_run_at_a_time_writes_into_a_folder() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let first = OutputFolder::open(&out, false).unwrap();
        let rows = first.file(SUMMARY).unwrap();
        let error = OutputFolder::open(&out, true).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("a run is writing here"), "{error}");
        assert_eq!(names(&out), [LOCK, ".summary.csv.part"], "the first run is not disturbed");
        drop((rows, first));
        assert_eq!(names(home.path()), [""; 0]);

        // As a killed run leaves it.
        fs::create_dir(&out).unwrap();
        fs::write(out.join(LOCK), "").unwrap();
        drop(OutputFolder::open(&out, true).unwrap());
        assert_eq!(names(&out), [""; 0]);
    }

    fn state_of(folder: &OutputFolder) -> Vec<String> {
        let text = |name| fs::read_to_string(folder.path().join(name)).ok();
        [STATE, STATE_OLD].into_iter().filter_map(text).collect()
    }

    #[test]
    fn two_states_are_kept_and_forgotten_together() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        for (bytes, kept) in [("1", &["1"][..]), ("2", &["2", "1"]), ("3", &["3", "2"])] {
            folder.keep_state(bytes.as_bytes()).unwrap();
            assert_eq!(state_of(&folder), kept);
        }
        // The last one is damaged: the one before stays until a new one is whole.
        folder.forget_last_state().unwrap();
        folder.keep_state(b"4").unwrap();
        assert_eq!(state_of(&folder), ["4", "2"]);
        let error = OutputFolder::open(home.path(), false).unwrap_err().to_string();
        assert!(error.contains("a run was interrupted here; curvelax resume ") && error.contains("--force"), "{error}");
        folder.forget_states().unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [""; 0]);
        let error = OutputFolder::open_again(home.path()).unwrap_err().to_string();
        assert!(error.contains("no run was begun here"), "{error}");
        assert_eq!(names(home.path()), [""; 0], "it is left as it was");
    }

    #[test]
    fn a_file_goes_on_after_its_mark_wherever_the_run_was_interrupted() {
        for published in [false, true] {
            let home = tempfile::tempdir().unwrap();
            let folder = OutputFolder::open(home.path(), true).unwrap();
            let mut file = folder.file(SUMMARY).unwrap();
            file.write_all(b"kept").unwrap();
            let mark = file.mark().unwrap();
            assert_eq!((mark.length, mark.crc), (4, crc32c::crc32c(b"kept")));
            file.write_all(b" and later").unwrap();
            file.keep(true);
            let series = folder.file(SERIES).unwrap();
            series.keep(true);
            if published {
                file.finish().unwrap()
            } else {
                drop(file)
            }
            drop(series);
            folder.check(&mark).unwrap();
            for wrong in [Mark { crc: mark.crc ^ 1, ..mark.clone() }, Mark { length: 99, ..mark.clone() }] {
                let fault = folder.check(&wrong).unwrap_err();
                assert!(fault.contains("summary.csv") && fault.contains("is not the file"), "{fault}");
            }
            let fault = folder.check(&Mark { name: "../mine".into(), ..mark.clone() }).unwrap_err();
            assert!(fault.contains("which no run writes"), "{fault}");

            folder.keep_only(&[SUMMARY]).unwrap();
            let mut file = folder.file_again(&mark).unwrap();
            assert_eq!(names(home.path()), [LOCK, ".summary.csv.part"], "what no state tells of is removed");
            file.write_all(b", then this").unwrap();
            file.finish().unwrap();
            assert_eq!(fs::read_to_string(home.path().join(SUMMARY)).unwrap(), "kept, then this");
        }
    }

    #[test]
    fn a_failed_run_leaves_only_what_is_worth_keeping() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("out");
        let folder = OutputFolder::open(&path, false).unwrap();
        let (useless, mut useful) = (folder.file(SERIES).unwrap(), folder.file(SUMMARY).unwrap());
        useful.write_all(b"row").unwrap();
        useful.keep(true);
        drop((useless, useful, folder));
        assert_eq!(names(&path), [".summary.csv.part"]);

        let folder = OutputFolder::open(&home.path().join("empty"), false).unwrap();
        drop((folder.file(CURVES).unwrap(), folder));
        assert_eq!(names(home.path()), ["out"]);
    }
}
