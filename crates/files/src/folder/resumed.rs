//! The folder of an interrupted run: files are checked against a checkpoint, truncated and continued.

use std::{
    fs::{self, File},
    io::{self, Read, Seek, SeekFrom},
    path::Path,
};

use super::OutputFolder;
use crate::{
    disk::{checksum, create, names_of},
    foreign::foreign,
    names::{PROBE, RUN, STATE, STATE_OLD, STORE, is_store, own},
    part_file::{Mark, PartFile},
    part_folder::PartFolder,
    place::Place,
    zarr,
};
use curvelax_base::{
    error::{Error, Result},
    input,
};

impl OutputFolder {
    /// Opens the folder of an interrupted run, as it is.
    ///
    /// # Errors
    /// [`Error::Request`] if there is none, if it cannot be written, or if another run is writing there.
    pub fn open_again(path: &Path) -> Result<OutputFolder> {
        let refuse = |problem: String| Error::Request(format!("{}: {problem}", path.display()));
        let cannot = |e: io::Error| refuse(format!("cannot be written ({e})"));
        if !path.is_dir() {
            return Err(refuse("no such folder; give that of a run".into()));
        }
        // A folder in which no run has begun is left as it is.
        let mut begun = false;
        for name in [STATE, STATE_OLD, RUN] {
            begun |= path.join(name).try_exists().map_err(|e| refuse(format!("cannot find {name} in it ({e})")))?;
        }
        if !begun {
            let is_free = foreign(path).is_ok_and(|found| found.is_empty());
            let remedy = match is_free {
                true => "start one with curvelax run and --force",
                false => "start one with curvelax run in another folder, or restore the run.json of the files there",
            };
            return Err(refuse(format!("no run was started here; {remedy}")));
        }
        let mut folder = OutputFolder::of(path, own());
        if !folder.claim().map_err(cannot)? {
            return Err(refuse("a run is writing here; wait until it ends".into()));
        }
        folder.check_names()?;
        folder.probe().map_err(cannot)?;
        Ok(folder)
    }

    /// Checks that the file exists, under its temporary or its final name, and matches `mark`; otherwise returns the
    /// fault.
    pub fn check(&self, mark: &Mark) -> std::result::Result<(), String> {
        // A checkpoint not written by this program could name any file.
        if !self.names.contains(&mark.name) || is_store(Path::new(&mark.name)) {
            return Err(format!("it lists {:?}, which no run writes", mark.name));
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
            Ok(false) => Err(format!("{path} is not the file that it lists")),
            Err(e) => Err(format!("cannot read {path} ({e})")),
        }
    }

    /// Checks the folder of a store in the same way.
    pub fn check_store(&self, mark: &zarr::StoreMark) -> std::result::Result<(), String> {
        mark.check(&self.growing(STORE).map_err(|e| format!("cannot find {STORE} ({e})"))?)
    }

    /// Continues a file of an interrupted run; whatever was written after `mark` is cut off.
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

    /// Replaces the file at `path` by a copy of its first `length` bytes: under other names it stays unchanged.
    fn copy(&self, file: File, path: &Path, length: u64) -> io::Result<File> {
        let spare = self.place(PROBE);
        let mut copy = create(spare.at())?;
        io::copy(&mut file.take(length), &mut copy)?;
        copy.sync_all()?;
        fs::rename(spare.at(), path)?;
        Ok(copy)
    }

    /// Continues the folder of a store in the same way.
    pub fn store_again(&self, name: &str) -> Result<PartFolder> {
        let store = PartFolder::again(self.back(name)?, self.place(name));
        store.sweep()?;
        Ok(store)
    }

    /// Where `name` of an interrupted run is: under its final name if the interruption came at the very end.
    fn growing(&self, name: &str) -> io::Result<Place> {
        let part = self.part(name);
        match part.at().symlink_metadata() {
            Ok(_) => Ok(part),
            Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(self.place(name)),
            Err(e) => Err(e),
        }
    }

    /// Gives `name` its temporary name again, and returns that.
    fn back(&self, name: &str) -> Result<Place> {
        let part = self.part(name);
        let now = self.growing(name).map_err(part.io("cannot find"))?;
        if now.at() != part.at() {
            fs::rename(now.at(), part.at()).map_err(now.io("cannot rename"))?;
        }
        Ok(part)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::{
        claim::LOCK,
        folder::tests::names,
        names::{SERIES, SUMMARY},
    };

    #[test]
    fn a_file_continues_after_its_mark_wherever_the_run_was_interrupted() {
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
}
