//! The output folder. A file grows as `.NAME.part` and takes its final name only when it is complete and on disk.

use std::{
    cell::Cell,
    fs::{self, File, TryLockError},
    io::{self, Write},
    path::{Path, PathBuf},
};

use super::part_folder::PartFolder;
use crate::error::{Error, Result};

/// One row a member.
pub const SUMMARY: &str = "summary.csv";
/// Rates of decay, one row a member that has one.
pub const RATES: &str = "rates.csv";
/// Mean excess in time, by cell.
pub const MEAN_EXCESS: &str = "mean_excess.csv";
/// Observables over time.
pub const SERIES: &str = "series.csv";
/// Nodes at given times.
pub const SNAPSHOTS: &str = "snapshots.csv";
/// The same as arrays: a folder.
pub const STORE: &str = "snapshots.zarr";
/// Errors and orders against exact solutions.
pub const CONVERGENCE: &str = "convergence.csv";
/// Statistics by cell.
pub const ENSEMBLE: &str = "ensemble.csv";
/// How the run was made.
pub const RUN: &str = "run.json";
/// The first members before, on their way and after.
pub const CURVES: &str = "plots/curves.svg";
/// The nodes of the same members, from which pictures are drawn.
pub const PORTRAITS: &str = "plots/portraits.json";
/// Distribution of the relaxation times.
pub const RELAXATION: &str = "plots/relaxation.svg";
/// Fitted rates of decay.
pub const RATE: &str = "plots/rate.svg";
/// Kaplan-Meier curves.
pub const SURVIVAL: &str = "plots/survival.svg";
/// Mean excess in time.
pub const EXCESS: &str = "plots/excess.svg";
/// Relaxation times against a swept key.
pub const DEPENDENCE: &str = "plots/dependence.svg";
/// Spacing of nodes and metric drift.
pub const MESH: &str = "plots/mesh.svg";
/// Everything at a glance.
pub const REPORT: &str = "report.html";

/// All that a command may write, the file that vouches for the others first.
const OWN: [&str; 18] = [
    RUN,
    SUMMARY,
    ENSEMBLE,
    MEAN_EXCESS,
    RATES,
    SERIES,
    SNAPSHOTS,
    STORE,
    PORTRAITS,
    CURVES,
    RELAXATION,
    RATE,
    SURVIVAL,
    EXCESS,
    DEPENDENCE,
    MESH,
    REPORT,
    CONVERGENCE,
];

/// The files that are drawn from the others.
pub const PICTURES: [&str; 8] = [REPORT, RELAXATION, SURVIVAL, EXCESS, RATE, DEPENDENCE, MESH, CURVES];

/// The folder of the plots.
const PLOTS: &str = "plots";

/// Locked while a run writes; what counts is the lock, which ends with its process, and not the file.
const LOCK: &str = ".curvelax.lock";

/// A folder that this run, and no other at the same time, may write into.
///
/// Dropped while empty, the folders that were made for this run are removed again.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// The folders that were made for this run, outermost first.
    made: Vec<PathBuf>,
    new_plots: bool,
    lock: Option<File>,
    /// The files that may be written.
    names: Vec<String>,
}

impl OutputFolder {
    /// The folder of a run, as [`OutputFolder::open_for`] makes it.
    pub fn open(path: &Path, force: bool) -> Result<OutputFolder> {
        OutputFolder::open_for(path, force, OWN.map(String::from).into())
    }

    /// Makes the folder and its parents, to write the files `names` into. One that exists is refused unless `force`
    /// allows to replace in it the files of an earlier run; so is a place that cannot be written, or where another run
    /// is writing.
    pub fn open_for(path: &Path, force: bool, names: Vec<String>) -> Result<OutputFolder> {
        let refuse = |e: io::Error| {
            Error::Request(format!("--out {}: cannot be written ({e}); name a folder that can", path.display()))
        };
        let mut folder =
            OutputFolder { path: path.to_path_buf(), made: Vec::new(), new_plots: false, lock: None, names };
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
            Err(_) if !force => {
                let allowed = "name a new folder, or add --force to replace the files of an earlier run";
                return Err(Error::value("out", path.display(), "already exists", allowed));
            }
            Err(_) => {}
        }
        folder.lock = lock(&path.join(LOCK)).map_err(refuse)?;
        if folder.lock.is_none() {
            return Err(Error::value("out", path.display(), "a run is writing here", "name another folder"));
        }
        folder.check_names()?;
        let probe = path.join(".curvelax.part");
        create(&probe).and_then(|_| fs::remove_file(&probe)).map_err(refuse)?;
        // What an interrupted run left; its lock is gone, so it is no longer writing.
        folder.names.iter().try_for_each(|name| remove_any(&folder.part(name))).map_err(refuse)?;
        Ok(folder)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Begins the file `name` (with `/` between a subfolder and the file).
    pub fn file(&self, name: &str) -> Result<PartFile> {
        let (target, part) = (self.path.join(name), self.part(name));
        let parent = target.parent().unwrap_or(&self.path);
        fs::create_dir_all(parent).map_err(Error::io("cannot make the folder", parent))?;
        let file = create(&part).map_err(Error::io("cannot write", &part))?;
        Ok(PartFile { file, part, target, keep: Cell::new(false), broken: false, finished: false })
    }

    /// Begins the folder `name`, which must be that of a store.
    pub fn store(&self, name: &str) -> Result<PartFolder> {
        PartFolder::begin(self.part(name), self.path.join(name))
    }

    /// Writes the whole file `name`, ready for [`OutputFolder::publish`].
    pub fn write(&self, name: &str, text: &str) -> Result<PartFile> {
        let mut file = self.file(name)?;
        file.write_all(text.as_bytes()).map_err(Error::io("cannot write", &file.target))?;
        file.sync()?;
        Ok(file)
    }

    /// Gives what is complete its final name, `run` last, and removes what an earlier run wrote and this one did not.
    ///
    /// All of them are on disk by now, so that little is left that can fail. The earlier `run.json` goes first: no
    /// moment has one that vouches for the files of two runs.
    pub fn publish(&self, files: Vec<PartFile>, store: Option<PartFolder>, run: PartFile) -> Result<()> {
        let targets = files.iter().map(PartFile::target).chain(store.iter().map(PartFolder::target));
        let written: Vec<PathBuf> = targets.map(Path::to_path_buf).collect();
        self.remove_own(RUN)?;
        files.into_iter().try_for_each(PartFile::finish)?;
        store.map_or(Ok(()), PartFolder::finish)?;
        OWN.iter()
            .filter(|name| !written.contains(&self.path.join(name)))
            .try_for_each(|name| self.remove_own(name))?;
        run.finish()
    }

    /// Gives complete files their final names, and touches no others.
    pub fn publish_all(&self, files: Vec<PartFile>) -> Result<()> {
        files.into_iter().try_for_each(PartFile::finish)
    }

    fn remove_own(&self, name: &str) -> Result<()> {
        let path = self.path.join(name);
        remove_any(&path).map_err(Error::io("cannot remove", &path))
    }

    /// The temporary name of `name`.
    fn part(&self, name: &str) -> PathBuf {
        let target = self.path.join(name);
        let file_name = target.file_name().unwrap_or_default().to_string_lossy();
        target.with_file_name(format!(".{file_name}.part"))
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
        let in_the_way = |path: &Path, what: &str| {
            let problem = format!("{} is {what}", path.display());
            Err(Error::value("out", self.path.display(), &problem, "move it away, or name another folder"))
        };
        let plots = self.path.join(PLOTS);
        let needed = self.names.iter().any(|name| Path::new(name).starts_with(PLOTS));
        let new_plots = needed && plots.symlink_metadata().is_err();
        if needed && !new_plots && !plots.is_dir() {
            return in_the_way(&plots, "no folder");
        }
        for name in &self.names {
            for path in [self.path.join(name), self.part(name)] {
                match (is_store(&path), path.is_dir()) {
                    (false, true) => return in_the_way(&path, "a folder"),
                    (true, false) if path.symlink_metadata().is_ok() => return in_the_way(&path, "no folder"),
                    // All in it would be removed.
                    (true, true) if !is_own_store(&path) => {
                        return in_the_way(&path, "not the folder of an earlier run");
                    }
                    _ => {}
                }
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
            let _ = fs::remove_dir(self.path.join(PLOTS));
        }
        // Still locked: unlocked first, it could be another run's by the time it is removed.
        if self.lock.is_some() {
            let _ = fs::remove_file(self.path.join(LOCK));
        }
        // A folder that stays keeps those above it, also those that only its name goes through (`new/../out`).
        let _ = self.made.iter().rev().try_for_each(fs::remove_dir);
    }
}

/// A file that is not complete yet; dropped so, it is removed unless [told](PartFile::keep) otherwise.
#[derive(Debug)]
pub struct PartFile {
    file: File,
    part: PathBuf,
    target: PathBuf,
    keep: Cell<bool>,
    broken: bool,
    finished: bool,
}

impl PartFile {
    /// What was written so far is worth keeping even if the run fails.
    pub fn keep(&self) {
        self.keep.set(true);
    }

    /// Its temporary name.
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Its final name.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Returns once its content is on disk.
    pub fn sync(&self) -> Result<()> {
        self.file.sync_all().map_err(Error::io("cannot write", &self.target))
    }

    /// Gives the file its final name; its content should be on disk.
    fn finish(mut self) -> Result<()> {
        fs::rename(&self.part, &self.target).map_err(Error::io("cannot write", &self.target))?;
        self.finished = true;
        sync_parent(&self.target)
    }
}

impl Write for PartFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // A writer with a buffer tries again when dropped, and would repeat what had got through.
        if self.broken {
            return Err(io::Error::other("an earlier write failed"));
        }
        let written = self.file.write(bytes);
        self.broken = written.as_ref().is_err_and(|e| e.kind() != io::ErrorKind::Interrupted);
        written
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        let nothing = || self.file.metadata().is_ok_and(|file| file.len() == 0);
        if !self.finished && (!self.keep.get() || nothing()) {
            let _ = fs::remove_file(&self.part);
        }
    }
}

/// Makes the file anew: what lies there is removed and not written into, as it may be a link to elsewhere.
fn create(path: &Path) -> io::Result<File> {
    remove(path)?;
    File::create_new(path)
}

/// Whether a folder, and not a file, has this name.
fn is_store(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().trim_end_matches(".part").ends_with(STORE))
}

/// Whether a run may have left the folder of a store.
fn is_own_store(path: &Path) -> bool {
    let empty = || fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none());
    !path.is_symlink() && (path.join("zarr.json").is_file() || empty())
}

/// Removes a file, or the folder of a store; either may be absent.
fn remove_any(path: &Path) -> io::Result<()> {
    match is_store(path) {
        true => remove_folder(path),
        false => remove(path),
    }
}

/// Removes a folder and what is in it; it may be absent.
pub(super) fn remove_folder(path: &Path) -> io::Result<()> {
    match fs::remove_dir_all(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// Removes a file, which may be absent.
fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        // Below a folder that is absent, too.
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// Locks the file at `path`, made if need be; none if another holds it.
fn lock(path: &Path) -> io::Result<Option<File>> {
    loop {
        if path.is_symlink() {
            remove(path)?;
        }
        let file = File::options().write(true).create(true).truncate(false).open(path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Ok(None),
            // A file system without locks is no reason not to run.
            Err(TryLockError::Error(e)) if e.kind() != io::ErrorKind::Unsupported => return Err(e),
            // The run before may have removed the file after it was opened here: a lock that nobody else sees.
            _ if !lies_at(&file, path) => {}
            _ => return Ok(Some(file)),
        }
    }
}

#[cfg(unix)]
fn lies_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |of: &fs::Metadata| (of.dev(), of.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(a), Ok(b)) if id(&a) == id(&b))
}

/// Elsewhere a file has no number to ask for in safe and stable Rust; a file at its place has to do.
#[cfg(not(unix))]
fn lies_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Makes a rename durable.
pub(super) fn sync_parent(path: &Path) -> Result<()> {
    path.parent().map_or(Ok(()), sync_folder)
}

/// Makes the names of what is in a folder durable; only Unix lets a folder be synced.
pub(super) fn sync_folder(path: &Path) -> Result<()> {
    match cfg!(unix) {
        true => File::open(path).and_then(|folder| folder.sync_all()).map_err(Error::io("cannot write to", path)),
        false => Ok(()),
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
        for name in [RUN, "plots", ".summary.csv.part", ".a.svg.part", "b.svg"] {
            fs::write(home.path().join(name), "old").unwrap();
        }
        let folder = OutputFolder::open_for(home.path(), true, vec!["a.svg".into()]).unwrap();
        let file = folder.write("a.svg", "new").unwrap();
        folder.publish_all(vec![file]).unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [".summary.csv.part", "a.svg", "b.svg", "plots", RUN]);
        fs::create_dir(home.path().join("c.svg")).unwrap();
        let error = OutputFolder::open_for(home.path(), true, vec!["c.svg".into()]).unwrap_err();
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

    #[test]
    fn nothing_is_written_after_a_failed_write() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let mut file = folder.file(SUMMARY).unwrap();
        let good = std::mem::replace(&mut file.file, File::open(&file.part).unwrap());
        file.write_all(b"to a file that can only be read").unwrap_err();
        file.file = good;
        file.write_all(b"again").unwrap_err();
        file.keep();
        drop(file);
        assert_eq!(names(home.path()), [LOCK], "an empty file is not worth keeping");
    }

    #[test]
    fn a_failed_run_leaves_only_what_is_worth_keeping() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("out");
        let folder = OutputFolder::open(&path, false).unwrap();
        let (useless, mut useful) = (folder.file(SERIES).unwrap(), folder.file(SUMMARY).unwrap());
        useful.write_all(b"row").unwrap();
        useful.keep();
        drop((useless, useful, folder));
        assert_eq!(names(&path), [".summary.csv.part"]);

        let folder = OutputFolder::open(&home.path().join("empty"), false).unwrap();
        drop((folder.file(CURVES).unwrap(), folder));
        assert_eq!(names(home.path()), ["out"]);
    }
}
