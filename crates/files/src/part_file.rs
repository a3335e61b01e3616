//! A file that grows as `.NAME.part` and gets its final name only when it is complete and on disk.

use std::{
    cell::Cell,
    fs::{self, File},
    io::{self, Write},
    path::Path,
};

use serde::{Deserialize, Serialize};

use super::{disk::sync_parent, place::Place};
use curvelax_base::error::Result;

/// The message about a file that failed before.
const TORN: &str = "an earlier write failed";

/// The length and checksum of a growing file, as recorded in a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Its final name.
    pub name: String,
    /// Bytes.
    pub length: u64,
    /// Their CRC-32C.
    pub crc: u32,
}

/// An incomplete file; it is removed when dropped, unless [kept](PartFile::keep).
#[derive(Debug)]
pub struct PartFile {
    file: File,
    part: Place,
    target: Place,
    /// The part written so far.
    mark: Mark,
    keep: Cell<bool>,
    broken: bool,
    /// The data may not be on disk, whatever the system says.
    torn: Cell<bool>,
    finished: bool,
}

impl PartFile {
    /// Continues `file`, which is at `part` and matches `mark`; its final name is `target`.
    pub(super) fn new(file: File, part: Place, target: Place, mark: Mark) -> PartFile {
        let (keep, torn) = (Cell::new(mark.length > 0), Cell::new(false));
        PartFile { file, part, target, mark, keep, broken: false, torn, finished: false }
    }

    /// Whether nothing has been written yet.
    pub fn is_empty(&self) -> bool {
        self.mark.length == 0
    }

    /// Bytes written.
    pub fn length(&self) -> u64 {
        self.mark.length
    }

    /// Sets whether to keep the file if the run fails.
    pub fn keep(&self, keep: bool) {
        self.keep.set(keep);
    }

    /// Returns what has been written, once it is on disk.
    pub fn mark(&self) -> Result<Mark> {
        self.sync()?;
        Ok(self.mark.clone())
    }

    /// Its place under its temporary name.
    pub fn part(&self) -> &Place {
        &self.part
    }

    /// The path of its final name, for messages.
    pub fn target(&self) -> &Path {
        self.target.shown()
    }

    /// Its final name in its folder.
    pub fn name(&self) -> &str {
        &self.mark.name
    }

    /// Returns once its content is on disk.
    pub fn sync(&self) -> Result<()> {
        let synced = self.file.sync_all();
        // Data that failed to sync once may be lost even if a later sync succeeds.
        self.torn.set(self.torn.get() || synced.is_err());
        let whole = if self.torn.get() && synced.is_ok() { Err(io::Error::other(TORN)) } else { synced };
        whole.map_err(self.target.io("cannot write"))
    }

    /// Gives the file its final name; its content should be on disk.
    pub(super) fn finish(mut self) -> Result<()> {
        fs::rename(self.part.at(), self.target.at()).map_err(self.target.io("cannot write"))?;
        self.finished = true;
        sync_parent(&self.target)
    }
}

impl Write for PartFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // A buffered writer tries again when dropped, and would repeat data that was written.
        if self.broken {
            return Err(io::Error::other(TORN));
        }
        let written = self.file.write(bytes);
        if let Ok(count) = written {
            self.mark.length += count as u64;
            self.mark.crc = crc32c::crc32c_append(self.mark.crc, &bytes[..count]);
        }
        self.broken = written.as_ref().is_err_and(|e| e.kind() != io::ErrorKind::Interrupted);
        written
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if !self.finished && !self.keep.get() {
            let _ = fs::remove_file(self.part.at());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_written_after_a_failed_write() {
        let home = tempfile::tempdir().unwrap();
        let [part, target] = [".rows.part", "rows"].map(|name| Place::named(&home.path().join(name)));
        let mark = Mark { name: "rows".into(), length: 0, crc: 0 };
        let mut file = PartFile::new(File::create_new(part.at()).unwrap(), part, target, mark);
        let good = std::mem::replace(&mut file.file, File::open(file.part.at()).unwrap());
        file.write_all(b"to a file that can only be read").unwrap_err();
        file.file = good;
        file.write_all(b"again").unwrap_err();
        assert_eq!(file.mark().unwrap().length, 0);
        drop(file);
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
    }
}
