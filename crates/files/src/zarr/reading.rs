//! The members of a complete store, read back for `merge`.

use std::path::{Path, PathBuf};

use super::{
    array::{Array, ArrayMark},
    chunks::{CHUNK_BYTES, key},
    layout::{arrays, times},
    mark::StoreMark,
};
use curvelax_base::{
    error::{Error, Result},
    input,
};
use curvelax_ensemble::Spec;

/// The members of a complete store, one after another. Each chunk is opened when needed, so any number of stores can be
/// read side by side.
pub struct StoredMembers {
    /// In the order of the growing arrays.
    pub(super) arrays: Vec<Elements>,
}

/// The elements of an array in order.
pub(super) struct Elements {
    /// The array as it grew; its mark has the chunk being read.
    array: Array,
    path: PathBuf,
    /// CRC-32C of all chunks.
    crc: u32,
    /// Bytes per member.
    pub(super) size: usize,
    /// Bytes of the chunk already read.
    taken: usize,
}

impl StoredMembers {
    /// Opens the store at `path`, of the members of `spec`, of `points` nodes each.
    ///
    /// # Errors
    /// [`Error::Request`] if `mark` is not that of such a store.
    pub fn open(path: &Path, spec: &Spec, points: usize, mark: &StoreMark) -> Result<StoredMembers> {
        let own = arrays(spec, points, &times(spec), CHUNK_BYTES).growing;
        let fits = |(array, mark): (&Array, &ArrayMark)| {
            (array.name, &array.mark.grid) == (mark.name.as_str(), &mark.grid)
                && mark.written == mark.grid.iter().product::<u64>()
        };
        if own.len() != mark.arrays.len() || !own.iter().zip(&mark.arrays).all(fits) {
            return Err(Error::Request(format!("{}: it has not the arrays of its spec", path.display())));
        }
        let members = spec.member_count().max(1);
        let elements = |(array, mark): (Array, &ArrayMark)| Elements {
            size: (array.bytes / members) as usize,
            path: path.join(array.name),
            crc: mark.crc,
            taken: 0,
            array,
        };
        Ok(StoredMembers { arrays: own.into_iter().zip(&mark.arrays).map(elements).collect() })
    }

    /// Checks that the data read are those that were written.
    ///
    /// # Errors
    /// [`Error::Request`] naming the array that differs.
    pub fn check(&self) -> Result<()> {
        match self.arrays.iter().find(|own| own.array.mark.crc != own.crc) {
            None => Ok(()),
            Some(own) => Err(own.changed("their checksum differs")),
        }
    }
}

impl Elements {
    fn changed(&self, what: &str) -> Error {
        Error::Request(format!(
            "{}: {what}: the chunks are not those that the shard wrote; copy them again, or run the shard again",
            self.path.display()
        ))
    }

    /// Returns the next elements, in at most `most` bytes.
    pub(super) fn next(&mut self, most: usize) -> Result<&[u8]> {
        if self.taken == self.array.mark.chunk.len() {
            self.read()?;
        }
        let (first, chunk) = (self.taken, &self.array.mark.chunk);
        self.taken = chunk.len().min(first + most);
        Ok(&chunk[first..self.taken])
    }

    /// Reads the next chunk, and removes the part beyond the array.
    fn read(&mut self) -> Result<()> {
        let (chunk_bytes, ArrayMark { grid, written, .. }) = (self.array.chunk_bytes, &self.array.mark);
        let path = self.path.join(key(*written, grid));
        let chunk = input::bytes(&path, chunk_bytes as u64);
        let mut chunk = chunk.map_err(|e| Error::Request(format!("cannot read {}: {e}", path.display())))?;
        if chunk.len() != chunk_bytes {
            return Err(self.changed(&format!("chunk {written} has {} bytes of {chunk_bytes}", chunk.len())));
        }
        let mark = &mut self.array.mark;
        mark.crc = crc32c::crc32c_append(mark.crc, &chunk);
        chunk.truncate(usize::try_from(mark.run_left).unwrap_or(usize::MAX));
        let left = mark.run_left - chunk.len() as u64;
        mark.run_left = if left == 0 { self.array.run_bytes } else { left };
        (mark.chunk, self.taken) = (chunk, 0);
        mark.written += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{
        OutputFolder, names,
        zarr::{
            SnapshotStore,
            tests::{add, members, read, spec},
        },
    };

    #[test]
    fn a_store_is_copied_member_by_member_and_a_changed_chunk_is_found() {
        let (home, spec) =
            (tempfile::tempdir().unwrap(), Spec { t_end: Some(2.0.into()), ..spec(7, &[0.0, 1.0, 2.0]) });
        let (from, to) = (home.path().join("from"), home.path().join("to"));
        let open = |path: &Path| {
            let out = OutputFolder::open(path, false).unwrap();
            let store = SnapshotStore::begin(out.store(names::STORE).unwrap(), &spec, 5).unwrap();
            (out, store)
        };
        let publish = |out: OutputFolder, store: SnapshotStore| {
            let run = out.write(names::RUN, "{}").unwrap();
            out.publish(Vec::new(), Some(store.ready().unwrap()), run).unwrap();
        };
        let (out, mut store) = open(&from);
        members().iter().for_each(|(status, snapshots)| add(&mut store, *status, snapshots));
        let mark = store.mark().unwrap();
        publish(out, store);

        let path = from.join(names::STORE);
        let copy = |to: &Path| {
            let (out, mut store) = open(to);
            let mut stored = StoredMembers::open(&path, &spec, 5, &mark).unwrap();
            (0..7).for_each(|_| store.copy(&mut stored).unwrap());
            publish(out, store);
            stored.check()
        };
        copy(&to).unwrap();
        for array in ["x", "y", "k", "r", "status"] {
            assert_eq!(read(&to.join(names::STORE), array), read(&path, array), "{array}");
        }
        let chunk = path.join("k/c.0.0.0");
        let mut bytes = fs::read(&chunk).unwrap();
        bytes[0] ^= 1;
        fs::write(&chunk, bytes).unwrap();
        let error = copy(&home.path().join("again")).unwrap_err().to_string();
        assert!(error.contains("/k: their checksum differs"), "{error}");
    }
}
