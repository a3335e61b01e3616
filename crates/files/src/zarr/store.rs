//! `snapshots.zarr` while it grows.

use serde_json::{Map, Value, json};

use super::{
    array::Array,
    chunks::CHUNK_BYTES,
    layout::{Arrays, FIELDS, arrays, nearest, of_group, times},
    mark::StoreMark,
    reading::StoredMembers,
};
use crate::part_folder::PartFolder;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Snapshot, Spec, Status};
use curvelax_study::results::provenance::json as json_text;

/// `snapshots.zarr` while it grows.
pub struct SnapshotStore {
    folder: PartFolder,
    times: Vec<f64>,
    points: usize,
    /// The fields, and the status of the members.
    growing: Vec<Array>,
    /// Times of the next member that are written.
    filled: usize,
}

impl SnapshotStore {
    /// Makes the arrays for the members of `spec`, of `points` nodes each, and writes all data known in advance.
    pub fn begin(folder: PartFolder, spec: &Spec, points: usize) -> Result<SnapshotStore> {
        SnapshotStore::of_chunks(folder, spec, points, times(spec), CHUNK_BYTES)
    }

    pub(super) fn of_chunks(
        mut folder: PartFolder,
        spec: &Spec,
        points: usize,
        times: Vec<f64>,
        bytes: usize,
    ) -> Result<SnapshotStore> {
        let Arrays { known, growing } = arrays(spec, points, &times, bytes);
        let all = growing.iter().chain(&known);
        let consolidated: Map<String, Value> = all.clone().map(|a| (a.name.into(), a.metadata.clone())).collect();
        let group = json!({
            "zarr_format": 3,
            "node_type": "group",
            "attributes": of_group(spec)?,
            "consolidated_metadata": { "kind": "inline", "must_understand": false, "metadata": consolidated },
        });
        folder.write("zarr.json", &pretty(&group)?)?;
        for array in all {
            folder.make(array.name)?;
            folder.write(&format!("{}/zarr.json", array.name), &pretty(&array.metadata)?)?;
        }
        let [mut member, mut time, mut node, mut cell] = known;
        for index in spec.members() {
            member.push(&folder, &(index as i64).to_le_bytes())?;
            cell.push(&folder, &((index / spec.members_per_cell()) as i64).to_le_bytes())?;
        }
        times.iter().try_for_each(|t| time.push(&folder, &t.to_le_bytes()))?;
        (1..=points as i64).try_for_each(|i| node.push(&folder, &i.to_le_bytes()))?;
        Ok(SnapshotStore { folder, times, points, growing, filled: 0 })
    }

    /// Adds a snapshot of the next member; they come in time order.
    pub fn snapshot(&mut self, snapshot: &Snapshot) -> Result<()> {
        let place = nearest(&self.times, snapshot.t);
        // Of two times equal up to rounding, the first is used.
        if place < self.filled {
            return Ok(());
        }
        self.skip_to(place)?;
        let Snapshot { x, y, k, r, .. } = snapshot;
        for (array, values) in self.growing.iter_mut().zip([x, y, k, r]) {
            // NaN for unknown, as empty fields in tables.
            let known = |value: f64| if value.is_finite() { value } else { f64::NAN };
            let value = |i: usize| values.get(i).map_or(f64::NAN, |value| known(*value));
            let bytes: Vec<u8> = (0..self.points).map(value).flat_map(f64::to_le_bytes).collect();
            array.push(&self.folder, &bytes)?;
        }
        self.filled += 1;
        Ok(())
    }

    /// Completes the next member, after all its snapshots.
    pub fn member(&mut self, status: Status) -> Result<()> {
        self.skip_to(self.times.len())?;
        self.filled = 0;
        self.growing[FIELDS.len()].push(&self.folder, &[status as u8])
    }

    /// Leaves the times before the one at `place` unknown.
    fn skip_to(&mut self, place: usize) -> Result<()> {
        if self.filled < place {
            let unknown: Vec<u8> = f64::NAN.to_le_bytes().repeat(self.points);
            for array in self.growing.iter_mut().take(FIELDS.len()) {
                (self.filled..place).try_for_each(|_| array.push(&self.folder, &unknown))?;
            }
            self.filled = place;
        }
        Ok(())
    }

    /// Adds the next member of another store unchanged.
    pub fn copy(&mut self, from: &mut StoredMembers) -> Result<()> {
        for (array, from) in self.growing.iter_mut().zip(&mut from.arrays) {
            let mut left = from.size;
            while left > 0 {
                let part = from.next(left)?;
                array.push(&self.folder, part)?;
                left -= part.len();
            }
        }
        Ok(())
    }

    /// Returns its extent, once it is on disk.
    pub fn mark(&self) -> Result<StoreMark> {
        self.folder.sync()?;
        Ok(StoreMark { arrays: self.growing.iter().map(|array| array.mark.clone()).collect() })
    }

    /// Sets whether to keep it if the run fails.
    pub fn keep(&mut self, keep: bool) {
        self.folder.keep(keep);
    }

    /// Continues a [checked](StoreMark::check) store; whatever was written after `mark` is removed.
    ///
    /// # Errors
    /// [`Error::Request`] if the mark is of the arrays of another spec.
    pub fn resume(folder: PartFolder, spec: &Spec, points: usize, mark: &StoreMark) -> Result<SnapshotStore> {
        mark.cut_off(folder.part())?;
        SnapshotStore::begin(folder, spec, points)?.from(mark)
    }

    fn from(mut self, mark: &StoreMark) -> Result<SnapshotStore> {
        let mut fits = true;
        for (array, mark) in self.growing.iter_mut().zip(&mark.arrays) {
            fits &= array.resume_from(mark);
        }
        match fits {
            true => Ok(self),
            false => Err(Error::Request(format!(
                "the arrays in {} are not those of the spec in the state",
                self.folder.target().display()
            ))),
        }
    }

    /// Completes the store on disk, ready for its final name.
    pub fn ready(self) -> Result<PartFolder> {
        self.folder.sync()?;
        Ok(self.folder)
    }
}

fn pretty(metadata: &Value) -> Result<Vec<u8>> {
    json_text(metadata, "zarr.json").map(String::into_bytes)
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;
    use crate::{
        OutputFolder, names,
        place::Place,
        zarr::tests::{add, members, spec},
    };

    /// All files of a store with their bytes.
    fn contents(store: &Path) -> Vec<(String, Vec<u8>)> {
        let arrays = fs::read_dir(store).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir());
        let files = arrays.flat_map(|array| fs::read_dir(array).unwrap().map(|entry| entry.unwrap().path()));
        let name = |path: &Path| path.strip_prefix(store).unwrap().display().to_string();
        let mut all: Vec<_> = files.map(|path| (name(&path), fs::read(path).unwrap())).collect();
        all.sort();
        all
    }

    #[test]
    fn a_store_continues_from_every_member_to_the_same_bytes() {
        let (spec, members) = (spec(7, &[0.0, 1.0, 2.0]), members());
        let begin =
            |folder: PartFolder| SnapshotStore::of_chunks(folder, &spec, 5, spec.snapshots.clone(), 360).unwrap();
        let add = |store: &mut SnapshotStore, of: &[(Status, Vec<Snapshot>)]| {
            of.iter().for_each(|(status, snapshots)| add(store, *status, snapshots));
        };
        let home = tempfile::tempdir().unwrap();
        let out = OutputFolder::open(home.path(), true).unwrap();
        let mut straight = begin(out.store(names::STORE).unwrap());
        add(&mut straight, &members);
        let whole = contents(straight.folder.part().at());
        assert!(whole.len() > 9);
        drop(straight);
        for kept in 0..=members.len() {
            let mut first = begin(out.store(names::STORE).unwrap());
            add(&mut first, &members[..kept]);
            let mark = first.mark().unwrap();
            // Not in the checkpoint, so to be removed.
            add(&mut first, &members[kept..(kept + 3).min(members.len())]);
            let part = first.folder.part().clone();
            first.keep(true);
            drop(first);
            out.check_store(&mark).unwrap();
            mark.cut_off(&part).unwrap();
            let mut second = begin(PartFolder::again(part.clone(), Place::named(&home.path().join(names::STORE))))
                .from(&mark)
                .unwrap();
            add(&mut second, &members[kept..]);
            assert!(contents(part.at()) == whole, "from {kept} members");
            second.keep(false);
        }
    }
}
