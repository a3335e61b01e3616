//! The output folder. A file grows as `.NAME.part` and gets its final name only when it is complete and on disk.

mod checkpoints;
mod leftovers;
mod publish;
mod resumed;
#[cfg(test)]
pub(super) mod tests;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::{
    claim::Claim,
    disk::{create, parent, sync_names},
    names::{PLOTS, PROBE, own, part},
    owner::{Existing, Owner},
    place::Place,
};
use curvelax_base::error::{Error, Result};

/// The longest path of the system.
const MAX_PATH: usize = if cfg!(target_os = "linux") { 4096 } else { 1024 };
/// Bytes of the longest name in a folder: a chunk of a store, for more members than any run has.
const MAX_NAME: usize = 96;

/// A folder into which only this run may write.
///
/// It is accessed through its open handle: a folder that is moved away takes its files with it, and its replacement is
/// not touched.
///
/// If it is empty when dropped, the folders created for this run are removed again.
#[derive(Debug)]
pub struct OutputFolder {
    /// The folders created for this run, outermost first.
    made: Vec<PathBuf>,
    new_plots: bool,
    /// None until it is held.
    claim: Option<Claim>,
    /// Where it was found, and where names in it are looked up.
    place: Place,
    /// The files that may be written.
    names: Vec<String>,
}

impl OutputFolder {
    /// Opens the folder of a run, as [`OutputFolder::open_for`].
    pub fn open(path: &Path, existing: impl Into<Existing>) -> Result<OutputFolder> {
        OutputFolder::open_for(path, existing, Owner::Run, own())
    }

    /// Checks that [`OutputFolder::open`] may succeed, and touches nothing.
    ///
    /// # Errors
    /// Those of [`OutputFolder::open`] that can be told from outside.
    pub fn check_place(path: &Path, existing: impl Into<Existing>) -> Result<()> {
        check_place(path, existing.into(), Owner::Run, &own())
    }

    /// Creates the folder and its parents, for `owner` to write the files `names` into. An existing folder is refused
    /// unless `existing` allows it. A folder that another command wrote, that cannot be written, or in which another
    /// run is writing is refused too.
    pub fn open_for(
        path: &Path,
        existing: impl Into<Existing>,
        owner: Owner,
        names: Vec<String>,
    ) -> Result<OutputFolder> {
        let refuse = |e: io::Error| {
            Error::Request(format!("--out {}: cannot be written ({e}); use one that can be written", path.display()))
        };
        let existing = existing.into();
        // Before its lock is touched.
        check_place(path, existing, owner, &names)?;
        let mut folder = OutputFolder::of(path, names);
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            folder.make_all(parent).map_err(refuse)?;
        }
        match fs::create_dir(path) {
            Ok(()) => folder.made.push(path.to_path_buf()),
            Err(_) if path.is_dir() => {}
            Err(e) => return Err(refuse(e)),
        }
        if !folder.claim().map_err(refuse)? {
            return Err(Error::value("out", path.display(), "a run is writing here", "use another folder"));
        }
        // Another run may have started and ended in between.
        owner.check(folder.place.at(), path)?;
        existing.check(owner, folder.place.at(), path, &folder.names)?;
        folder.check_names()?;
        folder.probe().map_err(refuse)?;
        // Leftovers of an interrupted run; its lock is gone, so it is no longer writing.
        if owner == Owner::Run {
            folder.forget_states()?;
        }
        folder.remove_parts(&[]).map_err(refuse)?;
        folder.made.iter().try_for_each(|made| sync_names(parent(made))).map_err(refuse)?;
        Ok(folder)
    }

    /// Like `fs::create_dir_all`, but records what was created.
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

    fn of(path: &Path, names: Vec<String>) -> OutputFolder {
        OutputFolder { made: Vec::new(), new_plots: false, claim: None, place: Place::named(path), names }
    }

    /// Claims the folder; returns whether this run holds it.
    fn claim(&mut self) -> io::Result<bool> {
        self.claim = Claim::take(self.path())?;
        if let Some(claim) = &self.claim {
            self.place = claim.place().clone();
        }
        Ok(self.claim.is_some())
    }

    /// Uses the absolute path from now on: outlines of a run are named relative to the directory in which it began,
    /// which may be a different one.
    pub fn make_absolute(&mut self) -> Result<()> {
        if let Some(claim) = &mut self.claim {
            claim.make_absolute()?;
            self.place = claim.place().clone();
        }
        Ok(())
    }

    /// Checks that this run still holds the folder, and that it is still where it was found.
    ///
    /// # Errors
    /// [`Error::Lost`] if it is not.
    pub fn check_claim(&self) -> Result<()> {
        self.claim.as_ref().map_or(Ok(()), Claim::check)
    }

    /// Replaces `error` by its cause if the folder was taken away.
    pub fn explain(&self, error: Error) -> Error {
        match self.check_claim() {
            Err(lost @ Error::Lost(_)) => lost,
            _ => error,
        }
    }

    /// Checks that files can be created here.
    fn probe(&self) -> io::Result<()> {
        let plots = self.place.join(PLOTS);
        let folders = [Some(&self.place), plots.at().is_dir().then_some(&plots)];
        folders.into_iter().flatten().map(|folder| folder.join(PROBE)).try_for_each(|probe| {
            create(probe.at())?;
            fs::remove_file(probe.at())
        })
    }

    /// Where it was found.
    pub fn path(&self) -> &Path {
        self.place.shown()
    }

    /// The place `name` in it.
    pub fn place(&self, name: &str) -> Place {
        self.place.join(name)
    }

    /// The place of `name` in it while it grows, under its temporary name.
    pub fn part(&self, name: &str) -> Place {
        self.place.join(part(Path::new(name)))
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // Removing a folder fails, as it should, if it is not empty.
        if self.new_plots {
            let _ = fs::remove_dir(self.place(PLOTS).at());
        }
        // Another folder may be in its place.
        let stays = self.claim.as_ref().is_none_or(|claim| claim.is_there().unwrap_or(false));
        self.claim = None;
        // A folder that stays keeps its parents, including those that only its name goes through (`new/../out`).
        if stays {
            let _ = self.made.iter().rev().try_for_each(fs::remove_dir);
        }
    }
}

/// Checks that a folder may be made or used at `path`.
fn check_place(path: &Path, existing: Existing, owner: Owner, names: &[String]) -> Result<()> {
    check_length(path)?;
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    if let Some(parent) = parent.filter(|parent| parent.exists() && !parent.is_dir()) {
        let problem = format!("{} is not a folder", parent.display());
        return Err(Error::value("out", path.display(), &problem, "name a place inside a folder"));
    }
    match path.is_dir() {
        true => {
            owner.check(path, path)?;
            existing.check(owner, path, path, names)
        }
        false if path.exists() => {
            Err(Error::value("out", path.display(), "exists but is not a folder", "name another"))
        }
        false => Ok(()),
    }
}

/// Refuses a path too long for some of the files.
fn check_length(path: &Path) -> Result<()> {
    let (length, most) = (path.as_os_str().len(), MAX_PATH - MAX_NAME);
    match length > most {
        true => Err(Error::Request(format!(
            "--out: the path has {length} bytes; with file names it exceeds the system's {MAX_PATH}; use a path of \
             {most} bytes or fewer, for example a relative one"
        ))),
        false => Ok(()),
    }
}
