//! The output folder. A file grows as `.NAME.part` and takes its final name only when it is complete and on disk.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use crate::error::{Error, Result};

/// One row a member.
pub const SUMMARY: &str = "summary.csv";
/// Observables over time.
pub const SERIES: &str = "series.csv";
/// Nodes at given times.
pub const SNAPSHOTS: &str = "snapshots.csv";
/// How the run was made.
pub const RUN: &str = "run.json";
/// The first members before and after.
pub const CURVES: &str = "plots/curves.svg";

/// All files that a run may write, the one that vouches for the others first.
const OWN: [&str; 5] = [RUN, SUMMARY, SERIES, SNAPSHOTS, CURVES];

/// A folder that this run may write into.
///
/// Dropped while empty, a folder that was made for this run is removed again.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    created: bool,
}

impl OutputFolder {
    /// Makes the folder and its parents. One that exists is refused unless `force` allows to replace in it the files
    /// of an earlier run; so is a place that cannot be written.
    pub fn open(path: &Path, force: bool) -> Result<OutputFolder> {
        let refuse = |e: io::Error| {
            Error::Request(format!("--out {}: cannot be written ({e}); name a folder that can", path.display()))
        };
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            if parent.exists() && !parent.is_dir() {
                let problem = format!("{} is no folder", parent.display());
                return Err(Error::value("out", path.display(), &problem, "name a place inside a folder"));
            }
            fs::create_dir_all(parent).map_err(refuse)?;
        }
        let created = match fs::create_dir(path) {
            Ok(()) => true,
            Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(refuse(e)),
            Err(_) if !path.is_dir() => {
                return Err(Error::value("out", path.display(), "exists and is no folder", "name another"));
            }
            Err(_) if !force => {
                let allowed = "name a new folder, or add --force to replace the files of an earlier run";
                return Err(Error::value("out", path.display(), "already exists", allowed));
            }
            Err(_) => false,
        };
        let folder = OutputFolder { path: path.to_path_buf(), created };
        let probe = path.join(".curvelax.part");
        File::create(&probe).and_then(|_| fs::remove_file(&probe)).map_err(refuse)?;
        Ok(folder)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Begins the file `name` (with `/` between a subfolder and the file).
    pub fn file(&self, name: &str) -> Result<PartFile> {
        let target = self.path.join(name);
        let parent = target.parent().unwrap_or(&self.path);
        fs::create_dir_all(parent).map_err(Error::io("cannot make the folder", parent))?;
        let file_name = target.file_name().unwrap_or_default().to_string_lossy();
        let part = target.with_file_name(format!(".{file_name}.part"));
        let file = File::create(&part).map_err(Error::io("cannot write", &part))?;
        Ok(PartFile { file, part, target, keep: false, finished: false })
    }

    /// Writes the whole file `name`.
    pub fn write(&self, name: &str, text: &str) -> Result<()> {
        let mut file = self.file(name)?;
        file.write_all(text.as_bytes()).map_err(Error::io("cannot write", &file.target))?;
        file.finish()
    }

    /// Removes the files of an earlier run, so that what lies here afterwards is of one run.
    pub fn remove_earlier(&self) -> Result<()> {
        for path in OWN.map(|name| self.path.join(name)) {
            match fs::remove_file(&path) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(Error::io("cannot remove", &path)(e)),
                _ => {}
            }
        }
        Ok(())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        if self.created {
            // Fails, as it should, where there is something inside.
            let _ = fs::remove_dir(self.path.join("plots"));
            let _ = fs::remove_dir(&self.path);
        }
    }
}

/// A file that is not complete yet; dropped so, it is removed unless [told](PartFile::keep) otherwise.
#[derive(Debug)]
pub struct PartFile {
    file: File,
    part: PathBuf,
    target: PathBuf,
    keep: bool,
    finished: bool,
}

impl PartFile {
    /// What was written so far is worth keeping even if the run fails.
    pub fn keep(&mut self) {
        self.keep = true;
    }

    /// Its temporary name.
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Its final name.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Gives the file its final name, once its content is on disk.
    pub fn finish(mut self) -> Result<()> {
        self.file.sync_all().map_err(Error::io("cannot write", &self.target))?;
        fs::rename(&self.part, &self.target).map_err(Error::io("cannot write", &self.target))?;
        self.finished = true;
        sync_parent(&self.target)
    }
}

impl Write for PartFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if !self.finished && !self.keep {
            let _ = fs::remove_file(&self.part);
        }
    }
}

/// Makes a rename durable; only Unix lets a folder be synced.
fn sync_parent(path: &Path) -> Result<()> {
    match path.parent() {
        Some(parent) if cfg!(unix) => {
            File::open(parent).and_then(|folder| folder.sync_all()).map_err(Error::io("cannot write to", parent))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(names(home.path()).len(), 4, "nothing goes before the new files are ready");
        folder.remove_earlier().unwrap();
        folder.write(SUMMARY, "new").unwrap();
        drop(folder);
        assert_eq!(names(home.path()), ["notes.txt", SUMMARY]);
        assert_eq!(fs::read(home.path().join(SUMMARY)).unwrap(), b"new");
    }

    #[test]
    fn a_failed_run_leaves_only_what_is_worth_keeping() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("out");
        let folder = OutputFolder::open(&path, false).unwrap();
        let (useless, mut useful) = (folder.file(SERIES).unwrap(), folder.file(SUMMARY).unwrap());
        useful.keep();
        drop((useless, useful, folder));
        assert_eq!(names(&path), [".summary.csv.part"]);

        let folder = OutputFolder::open(&home.path().join("empty"), false).unwrap();
        drop((folder.file(CURVES).unwrap(), folder));
        assert_eq!(names(home.path()), ["out"]);
    }
}
