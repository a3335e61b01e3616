//! The extent of a growing store, as recorded in a checkpoint.

use std::{fs, io::Read};

use serde::{Deserialize, Serialize};

use super::{
    array::ArrayMark,
    chunks::{CHUNK_BYTES, key},
    layout::{FIELDS, STATUS},
};
use crate::{disk::checksum, place::Place};
use curvelax_base::{error::Result, input};

/// The extent of a growing store, as recorded in a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoreMark {
    /// Its growing arrays.
    pub(super) arrays: Vec<ArrayMark>,
}

impl StoreMark {
    /// Checks that the chunks in `store` match; otherwise returns the fault.
    pub fn check(&self, store: &Place) -> std::result::Result<(), String> {
        let own = || FIELDS.iter().map(|(name, ..)| *name).chain([STATUS]);
        if !self.arrays.iter().map(|mark| mark.name.as_str()).eq(own()) {
            return Err(format!("it lists other arrays than {}", own().collect::<Vec<_>>().join(", ")));
        }
        self.arrays.iter().try_for_each(|mark| mark.check(&store.join(&mark.name)))
    }

    /// Removes the chunks that were written later.
    pub(super) fn cut_off(&self, store: &Place) -> Result<()> {
        for ArrayMark { name, grid, written, .. } in &self.arrays {
            let later = (*written..grid.iter().product()).map(|number| store.join(name).join(key(number, grid)));
            for chunk in later.take_while(|chunk| chunk.at().exists()) {
                fs::remove_file(chunk.at()).map_err(chunk.io("cannot remove"))?;
            }
        }
        Ok(())
    }
}

impl ArrayMark {
    fn check(&self, array: &Place) -> std::result::Result<(), String> {
        let ArrayMark { grid, written, crc, .. } = self;
        let path = array.shown().display();
        let all = grid.iter().try_fold(1_u64, |all, own| all.checked_mul(*own)).unwrap_or(0);
        if all == 0 || *written > all {
            return Err(format!("it lists {path} with {written} of {grid:?} chunks"));
        }
        if array.at().is_symlink() {
            return Err(format!("{path} is a link, which no run writes"));
        }
        let mut found = 0;
        for number in 0..*written {
            let chunk = array.join(key(number, grid));
            // The checksum continues from chunk to chunk. None is longer.
            let sum = input::open(chunk.at()).and_then(|file| checksum(&mut file.take(CHUNK_BYTES as u64 + 1), found));
            found = sum.map_err(|e| format!("cannot read {} ({e})", chunk.shown().display()))?.1;
        }
        match found == *crc {
            true => Ok(()),
            false => Err(format!("the chunks in {path} are not those that it lists")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        OutputFolder, names,
        zarr::{
            SnapshotStore,
            tests::{add, members, spec},
        },
    };

    #[test]
    fn chunks_that_were_changed_or_are_gone_are_found() {
        let (home, spec) = (tempfile::tempdir().unwrap(), spec(7, &[0.0, 1.0, 2.0]));
        let out = OutputFolder::open(home.path(), true).unwrap();
        let folder = out.store(names::STORE).unwrap();
        let chunk = folder.part().join("x/c.0.0.0").at().to_path_buf();
        let mut store = SnapshotStore::of_chunks(folder, &spec, 5, spec.snapshots.clone(), 360).unwrap();
        members()[..4].iter().for_each(|(status, snapshots)| add(&mut store, *status, snapshots));
        let mark = store.mark().unwrap();
        out.check_store(&mark).unwrap();
        let bytes = fs::read(&chunk).unwrap();
        fs::write(&chunk, [&[bytes[0] ^ 1], &bytes[1..]].concat()).unwrap();
        assert!(out.check_store(&mark).unwrap_err().contains("/x are not those that it lists"));
        fs::remove_file(&chunk).unwrap();
        assert!(out.check_store(&mark).unwrap_err().contains("cannot read "));
        fs::write(&chunk, bytes).unwrap();
        out.check_store(&mark).unwrap();
    }

    #[test]
    fn marks_of_other_arrays_and_of_more_chunks_than_there_are_are_refused() {
        let home = tempfile::tempdir().unwrap();
        let out = OutputFolder::open(home.path(), true).unwrap();
        let spec = spec(7, &[0.0, 1.0, 2.0]);
        let store = SnapshotStore::begin(out.store(names::STORE).unwrap(), &spec, 5).unwrap();
        let mut mark = store.mark().unwrap();
        out.check_store(&mark).unwrap();
        mark.arrays[4].written = 1000;
        assert!(out.check_store(&mark).unwrap_err().contains("status with 1000 of [1] chunks"));
        mark.arrays.swap(0, 4);
        assert!(out.check_store(&mark).unwrap_err().contains("other arrays than x, y, k, r, status"));
    }
}
