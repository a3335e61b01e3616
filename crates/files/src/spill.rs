//! Rows on disk of members that are still running: `.curvelax.rows.part`.
//!
//! A member may have a million rows, and writes them to the tables only after the members before it. Until then they
//! wait here, not in memory. The file only grows, so that everything that any checkpoint refers to is still there; it
//! is removed with the last checkpoint.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom, Write},
};

use super::part_file::{Mark, PartFile};
use curvelax_base::{
    error::{Error, Result},
    input,
};
use curvelax_ensemble::{Extent, SeriesRow, Snapshot};

/// Rows added together, as they are written.
pub type SpilledRows = (Vec<SeriesRow>, Vec<Snapshot>);

/// The file.
pub struct Spill {
    file: PartFile,
    reader: File,
}

impl Spill {
    /// Begins in `file`, which is called [`ROWS`](super::names::ROWS), or continues after the rows in it.
    pub fn new(file: PartFile) -> Result<Spill> {
        let reader = input::open(file.part().at()).map_err(file.part().io("cannot read"))?;
        Ok(Spill { file, reader })
    }

    /// Adds rows, and returns where they are.
    pub fn add(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Extent> {
        let bytes = postcard::to_stdvec(&(series, snapshots))
            .map_err(|e| Error::Failed(format!("cannot write {}: {e}", self.file.part().shown().display())))?;
        let extent = Extent { at: self.file.length(), length: bytes.len() as u64, crc: crc32c::crc32c(&bytes) };
        self.file.write_all(&bytes).map_err(self.file.part().io("cannot write"))?;
        Ok(extent)
    }

    /// Reads the rows at `extent`.
    ///
    /// # Errors
    /// [`Error::Failed`] if they are not the rows that were added.
    pub fn read(&mut self, extent: &Extent) -> Result<SpilledRows> {
        let place = self.file.part();
        let changed = || {
            let path = place.shown().display();
            Error::Failed(format!("{path}: it has not the rows that were written; run again with --force"))
        };
        let Extent { at, length, crc } = *extent;
        if at.checked_add(length).is_none_or(|end| end > self.file.length()) {
            return Err(changed());
        }
        let mut bytes = vec![0; usize::try_from(length).map_err(|_| changed())?];
        let read = self.reader.seek(SeekFrom::Start(at)).and_then(|_| self.reader.read_exact(&mut bytes));
        read.map_err(place.io("cannot read"))?;
        match postcard::from_bytes(&bytes) {
            Ok(rows) if crc32c::crc32c(&bytes) == crc => Ok(rows),
            _ => Err(changed()),
        }
    }

    /// Returns its length and checksum, once it is on disk.
    pub fn mark(&self) -> Result<Mark> {
        self.file.mark()
    }

    /// Sets whether to keep it if the run fails.
    pub fn keep(&self, keep: bool) {
        self.file.keep(keep);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{OutputFolder, names::ROWS};

    #[test]
    fn rows_come_back_as_they_were_also_from_where_a_run_was_interrupted() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let rows = |member: u64| {
            let series: Vec<SeriesRow> =
                (0..5).map(|i| SeriesRow { member, t: 0.1 * f64::from(i), at: Default::default() }).collect();
            let snapshot =
                Snapshot { member, t: 0.2, x: vec![1.0, -0.0], y: vec![f64::MAX; 2], k: vec![3.0; 2], r: vec![0.1; 2] };
            (series, vec![snapshot; member as usize])
        };
        let mut spill = Spill::new(folder.file(ROWS).unwrap()).unwrap();
        let add = |spill: &mut Spill, member: u64| spill.add(&rows(member).0, &rows(member).1).unwrap();
        let (one, two) = (add(&mut spill, 1), add(&mut spill, 2));
        assert_eq!((spill.read(&two).unwrap(), spill.read(&one).unwrap()), (rows(2), rows(1)));
        let mark = spill.mark().unwrap();
        let late = add(&mut spill, 3);
        assert_eq!(spill.read(&late).unwrap(), rows(3));
        spill.keep(true);
        drop(spill);

        folder.check(&mark).unwrap();
        let mut again = Spill::new(folder.file_again(&mark).unwrap()).unwrap();
        assert!(again.read(&late).is_err(), "what came after the mark is cut off");
        assert_eq!((again.read(&one).unwrap(), again.read(&two).unwrap()), (rows(1), rows(2)));
        let other = add(&mut again, 4);
        assert_eq!((other.at, again.read(&other).unwrap()), (late.at, rows(4)));
        let message = again.read(&Extent { length: other.length - 1, ..other }).unwrap_err().to_string();
        assert!(message.contains(".curvelax.rows.part: it has not the rows that were written"), "{message}");
        assert!(again.read(&Extent { length: u64::MAX, ..other }).is_err());
        again.keep(false);
        drop((again, folder));
        assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    }
}
