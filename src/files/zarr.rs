//! `snapshots.zarr`: the snapshots as arrays x, y, k, r of member × time × node, in Zarr's format 3.
//!
//! An array is a folder with a `zarr.json` and raw little-endian chunks `c.I.J.K`, which are written as soon as the
//! members that fill them have ended: what is in memory does not grow with the ensemble. A snapshot that a member did not
//! live to see is NaN. Equal runs give equal bytes.
//!
//! The format: <https://zarr-specs.readthedocs.io/en/latest/v3/core/>. Metadata is consolidated as zarr-python does it,
//! and dimension names, units and flags are those that xarray and the CF conventions know.

use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{disk::checksum, part_folder::PartFolder, place::Place};
use crate::results::provenance::json as json_text;
use crate::{
    ensemble::{Snapshot, Spec, Status},
    error::{Error, Result},
    input,
    schedule::Outputs,
};

/// About so many bytes make a chunk: few files for many members, and little to read for one.
const CHUNK_BYTES: usize = 4 << 20;

/// The array of how members ended.
const STATUS: &str = "status";

/// The arrays of nodes, with units and what they are.
const FIELDS: [(&str, &str, &str); 4] = [
    ("x", "length", "x coordinate of the node"),
    ("y", "length", "y coordinate of the node"),
    ("k", "1/length", "signed curvature of the segment that ends at the node"),
    ("r", "length", "length of the segment that ends at the node, as the scheme evolves it"),
];

/// A growing store as far as a state vouches for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Its arrays that grow.
    arrays: Vec<ArrayMark>,
}

/// The same of an array.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct ArrayMark {
    name: String,
    /// Chunks in each dimension.
    grid: Vec<u64>,
    /// Chunks that are written, and the CRC-32C of all of them.
    written: u64,
    crc: u32,
    /// The chunk that is being filled.
    chunk: Vec<u8>,
    run_left: u64,
}

/// `snapshots.zarr` while it grows.
pub struct SnapshotStore {
    folder: PartFolder,
    times: Vec<f64>,
    points: usize,
    fields: Vec<Array>,
    status: Array,
    /// Times of the next member that are written.
    filled: usize,
}

/// An array that is written from its first element to its last.
struct Array {
    name: &'static str,
    metadata: Value,
    /// Chunks in each dimension.
    grid: Vec<u64>,
    chunk_bytes: usize,
    /// What stands for an element that was not written.
    fill: Vec<u8>,
    /// The chunk that is being filled, and the number of those before it.
    chunk: Vec<u8>,
    written: u64,
    /// CRC-32C of those.
    crc: u32,
    /// Bytes of all elements.
    bytes: u64,
    /// Bytes between two elements that begin a chunk whatever is in the one before, and how many of them are to come.
    run_bytes: u64,
    run_left: u64,
}

/// Type of an element.
#[derive(Clone, Copy)]
enum Kind {
    Float64,
    Int64,
    Int8,
}

impl SnapshotStore {
    /// Makes the arrays for the members of `spec`, of `points` nodes each, and writes all that is known of them
    /// beforehand.
    pub fn begin(folder: PartFolder, spec: &Spec, points: usize) -> Result<SnapshotStore> {
        SnapshotStore::of_chunks(folder, spec, points, times(spec), CHUNK_BYTES)
    }

    fn of_chunks(
        mut folder: PartFolder,
        spec: &Spec,
        points: usize,
        times: Vec<f64>,
        bytes: usize,
    ) -> Result<SnapshotStore> {
        let Arrays { mut member, mut time, mut node, mut cell, fields, status } = arrays(spec, points, &times, bytes);
        let all = fields.iter().chain([&member, &time, &node, &cell, &status]);
        let consolidated: Map<String, Value> = all.clone().map(|a| (a.name.into(), a.metadata.clone())).collect();
        let group = json!({
            "zarr_format": 3,
            "node_type": "group",
            "attributes": {
                "title": "nodes of relaxing plane curves",
                "curvelax": env!("CARGO_PKG_VERSION"),
                // Where it ran and on how many threads makes no difference to the numbers.
                "spec": Spec { threads: None, ..spec.clone() }.to_toml()?,
            },
            "consolidated_metadata": { "kind": "inline", "must_understand": false, "metadata": consolidated },
        });
        folder.write("zarr.json", &pretty(&group)?)?;
        for array in all {
            folder.make(array.name)?;
            folder.write(&format!("{}/zarr.json", array.name), &pretty(&array.metadata)?)?;
        }
        for index in spec.members() {
            member.push(&folder, &(index as i64).to_le_bytes())?;
            cell.push(&folder, &((index / spec.curves) as i64).to_le_bytes())?;
        }
        times.iter().try_for_each(|t| time.push(&folder, &t.to_le_bytes()))?;
        (1..=points as i64).try_for_each(|i| node.push(&folder, &i.to_le_bytes()))?;
        Ok(SnapshotStore { folder, times, points, fields: fields.into(), status, filled: 0 })
    }

    /// Adds a snapshot of the next member; they come in time order.
    pub fn snapshot(&mut self, snapshot: &Snapshot) -> Result<()> {
        let place = nearest(&self.times, snapshot.t);
        // Two times that are one but for rounding: the first of them stands.
        if place < self.filled {
            return Ok(());
        }
        self.skip_to(place)?;
        let Snapshot { x, y, k, r, .. } = snapshot;
        for (array, values) in self.fields.iter_mut().zip([x, y, k, r]) {
            // Unknown is NaN, as it is empty in tables.
            let known = |value: f64| if value.is_finite() { value } else { f64::NAN };
            let value = |i: usize| values.get(i).map_or(f64::NAN, |value| known(*value));
            let bytes: Vec<u8> = (0..self.points).map(value).flat_map(f64::to_le_bytes).collect();
            array.push(&self.folder, &bytes)?;
        }
        self.filled += 1;
        Ok(())
    }

    /// Completes the next member, all of whose snapshots were added.
    pub fn member(&mut self, status: Status) -> Result<()> {
        self.skip_to(self.times.len())?;
        self.filled = 0;
        self.status.push(&self.folder, &[status as u8])
    }

    /// Leaves the times up to the one at `place` unknown.
    fn skip_to(&mut self, place: usize) -> Result<()> {
        if self.filled < place {
            let unknown: Vec<u8> = Kind::Float64.fill().repeat(self.points);
            for array in &mut self.fields {
                (self.filled..place).try_for_each(|_| array.push(&self.folder, &unknown))?;
            }
            self.filled = place;
        }
        Ok(())
    }

    /// Adds the next member of another store, as it is there.
    pub fn copy(&mut self, from: &mut StoredMembers) -> Result<()> {
        for (array, from) in self.fields.iter_mut().chain([&mut self.status]).zip(&mut from.arrays) {
            let mut left = from.size;
            while left > 0 {
                let part = from.next(left)?;
                array.push(&self.folder, part)?;
                left -= part.len();
            }
        }
        Ok(())
    }

    /// How far it has grown, once that is on disk.
    pub fn mark(&self) -> Result<Mark> {
        self.folder.sync()?;
        Ok(Mark { arrays: self.fields.iter().chain([&self.status]).map(Array::mark).collect() })
    }

    /// Whether what is written is worth keeping if the run fails.
    pub fn keep(&mut self, keep: bool) {
        self.folder.keep(keep);
    }

    /// Goes on with one that [was checked](Mark::check); what was written after `mark` is removed.
    ///
    /// # Errors
    /// [`Error::Request`] where the mark is of the arrays of another spec.
    pub fn resume(folder: PartFolder, spec: &Spec, points: usize, mark: &Mark) -> Result<SnapshotStore> {
        mark.cut_off(folder.part())?;
        SnapshotStore::begin(folder, spec, points)?.from(mark)
    }

    fn from(mut self, mark: &Mark) -> Result<SnapshotStore> {
        let mut fits = true;
        for (array, mark) in self.fields.iter_mut().chain([&mut self.status]).zip(&mark.arrays) {
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

    /// The whole store, on disk and ready for its final name.
    pub fn ready(self) -> Result<PartFolder> {
        self.folder.sync()?;
        Ok(self.folder)
    }
}

/// The members of a store that is complete, one after another. A chunk is opened when it is needed: any number of stores
/// can be read side by side.
pub struct StoredMembers {
    /// In the order of those that grow.
    arrays: Vec<Elements>,
}

/// The elements of an array in their order.
struct Elements {
    /// As it was when it grew; its `chunk` is the one that is being read.
    array: Array,
    path: PathBuf,
    /// CRC-32C of all chunks.
    crc: u32,
    /// Bytes of a member.
    size: usize,
    /// Bytes of the chunk that were taken.
    taken: usize,
}

impl StoredMembers {
    /// Opens the store at `path`, of the members of `spec`, of `points` nodes each.
    ///
    /// # Errors
    /// [`Error::Request`] where `mark` is not that of such a store.
    pub fn open(path: &Path, spec: &Spec, points: usize, mark: &Mark) -> Result<StoredMembers> {
        let arrays = arrays(spec, points, &times(spec), CHUNK_BYTES);
        let Arrays { fields, status, .. } = arrays;
        let own: Vec<Array> = fields.into_iter().chain([status]).collect();
        let fits = |(array, mark): (&Array, &ArrayMark)| {
            (array.name, &array.grid) == (mark.name.as_str(), &mark.grid)
                && mark.written == array.grid.iter().product::<u64>()
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

    /// That what was read is what was written.
    ///
    /// # Errors
    /// [`Error::Request`] naming the array that is not.
    pub fn check(&self) -> Result<()> {
        match self.arrays.iter().find(|own| own.array.crc != own.crc) {
            None => Ok(()),
            Some(own) => Err(own.changed("their checksum is another one")),
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

    /// The next ones, `most` bytes or fewer.
    fn next(&mut self, most: usize) -> Result<&[u8]> {
        if self.taken == self.array.chunk.len() {
            self.read()?;
        }
        let first = self.taken;
        self.taken = self.array.chunk.len().min(first + most);
        Ok(&self.array.chunk[first..self.taken])
    }

    /// Reads the next chunk, and leaves of it what is in the array.
    fn read(&mut self) -> Result<()> {
        let Array { chunk_bytes, grid, written, run_left, run_bytes, .. } = &self.array;
        let path = self.path.join(key(*written, grid));
        let chunk = input::bytes(&path, *chunk_bytes as u64);
        let mut chunk = chunk.map_err(|e| Error::Request(format!("cannot read {}: {e}", path.display())))?;
        if chunk.len() != *chunk_bytes {
            return Err(self.changed(&format!("chunk {written} has {} bytes of {chunk_bytes}", chunk.len())));
        }
        let crc = crc32c::crc32c_append(self.array.crc, &chunk);
        chunk.truncate(usize::try_from(*run_left).unwrap_or(usize::MAX));
        let left = run_left - chunk.len() as u64;
        (self.array.run_left, self.array.crc) = (if left == 0 { *run_bytes } else { left }, crc);
        (self.array.chunk, self.taken) = (chunk, 0);
        self.array.written += 1;
        Ok(())
    }
}

impl Array {
    /// With extents by name of the dimension, chunks of at most `bytes`, and these attributes.
    fn new(name: &'static str, kind: Kind, dimensions: &[(&str, u64)], attributes: Value, bytes: usize) -> Array {
        let size = kind.fill().len();
        let shape: Vec<u64> = dimensions.iter().map(|(_, extent)| *extent).collect();
        let names: Vec<&str> = dimensions.iter().map(|(name, _)| *name).collect();
        let chunk = chunk_shape(&shape, (bytes / size) as u64);
        let grid: Vec<u64> = shape.iter().zip(&chunk).map(|(extent, chunk)| extent.div_ceil(*chunk)).collect();
        // Before the last dimension that is cut chunks have one element, after it they have all.
        let cut = grid.iter().rposition(|chunks| *chunks > 1).unwrap_or(0);
        let run_bytes = shape[cut..].iter().product::<u64>() * size as u64;
        Array {
            name,
            metadata: json!({
                "zarr_format": 3,
                "node_type": "array",
                "shape": shape,
                "data_type": kind.name(),
                "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
                // Files beside each other, instead of a folder for each index.
                "chunk_key_encoding": { "name": "default", "configuration": { "separator": "." } },
                "fill_value": kind.fill_value(),
                "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
                "attributes": attributes,
                "dimension_names": names,
            }),
            grid,
            chunk_bytes: chunk.iter().product::<u64>() as usize * size,
            bytes: shape.iter().product::<u64>() * size as u64,
            fill: kind.fill(),
            chunk: Vec::new(),
            written: 0,
            crc: 0,
            run_bytes,
            run_left: run_bytes,
        }
    }

    /// Adds elements, and writes the chunks that they complete.
    fn push(&mut self, folder: &PartFolder, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let room = (self.chunk_bytes - self.chunk.len()).min(self.run_left as usize);
            let (now, later) = bytes.split_at(room.min(bytes.len()));
            self.chunk.extend_from_slice(now);
            self.run_left -= now.len() as u64;
            if self.run_left == 0 || self.chunk.len() == self.chunk_bytes {
                self.write(folder)?;
            }
            bytes = later;
        }
        Ok(())
    }

    /// Writes the chunk, which has its full length even where it reaches beyond the array.
    fn write(&mut self, folder: &PartFolder) -> Result<()> {
        let missing = self.chunk_bytes - self.chunk.len();
        self.chunk.extend(self.fill.iter().cycle().take(missing));
        folder.write(&format!("{}/{}", self.name, key(self.written, &self.grid)), &self.chunk)?;
        self.crc = crc32c::crc32c_append(self.crc, &self.chunk);
        self.chunk.clear();
        self.written += 1;
        if self.run_left == 0 {
            self.run_left = self.run_bytes;
        }
        Ok(())
    }

    fn mark(&self) -> ArrayMark {
        ArrayMark {
            name: self.name.into(),
            grid: self.grid.clone(),
            written: self.written,
            crc: self.crc,
            chunk: self.chunk.clone(),
            run_left: self.run_left,
        }
    }

    /// Goes on as marked, if the mark is of this array.
    fn resume_from(&mut self, mark: &ArrayMark) -> bool {
        let ArrayMark { name, grid, written, crc, chunk, run_left } = mark;
        let fits = chunk.len() < self.chunk_bytes && *written <= grid.iter().product();
        let fits = fits && name == self.name && *grid == self.grid && *run_left <= self.run_bytes;
        (self.written, self.crc, self.run_left) = (*written, *crc, *run_left);
        self.chunk.clone_from(chunk);
        fits
    }
}

/// All of a store.
struct Arrays {
    member: Array,
    time: Array,
    node: Array,
    cell: Array,
    fields: [Array; FIELDS.len()],
    status: Array,
}

/// Those of the members of `spec`, with chunks of at most `bytes`.
fn arrays(spec: &Spec, points: usize, times: &[f64], bytes: usize) -> Arrays {
    let members = ("member", spec.member_count());
    let (instants, nodes) = (("time", times.len() as u64), ("node", points as u64));
    let vector = |name, kind, along, attributes| Array::new(name, kind, &[along], attributes, bytes);
    let of_member = |name: &str| json!({ "long_name": name });
    let flags = json!({
        "long_name": "how the member ended",
        "flag_values": Status::ALL.map(|status| status as u32),
        "flag_meanings": Status::ALL.map(Status::name).join(" "),
    });
    let time = json!({ "long_name": "time", "units": "length^4" });
    Arrays {
        member: vector("member", Kind::Int64, members, of_member("index of the member")),
        time: vector("time", Kind::Float64, instants, time),
        node: vector("node", Kind::Int64, nodes, json!({ "long_name": "number of the node along the curve" })),
        cell: vector("cell", Kind::Int64, members, of_member("index of the cell of the sweep")),
        fields: FIELDS.map(|(name, units, what)| {
            let attributes = json!({ "long_name": what, "units": units, "coordinates": "cell status" });
            Array::new(name, Kind::Float64, &[members, instants, nodes], attributes, bytes)
        }),
        status: vector(STATUS, Kind::Int8, members, flags),
    }
}

/// The times of the snapshots. Times that agree with the final one to rounding are that one, as in `snapshots.csv`.
fn times(spec: &Spec) -> Vec<f64> {
    Outputs::new(spec.t_end, None, &spec.snapshots, &[]).from(0).map(|output| output.t).collect()
}

/// The name of a chunk: `c`, and its place in the grid.
fn key(number: u64, grid: &[u64]) -> String {
    let mut rest = number;
    let mut key = String::new();
    for chunks in grid.iter().rev() {
        key = format!(".{}{key}", rest % chunks);
        rest /= chunks;
    }
    format!("c{key}")
}

impl Mark {
    /// That the chunks in `store` are those it vouches for; else what is wrong.
    pub fn check(&self, store: &Place) -> std::result::Result<(), String> {
        let own = || FIELDS.iter().map(|(name, ..)| *name).chain([STATUS]);
        if !self.arrays.iter().map(|mark| mark.name.as_str()).eq(own()) {
            return Err(format!("it tells of other arrays than {}", own().collect::<Vec<_>>().join(", ")));
        }
        self.arrays.iter().try_for_each(|mark| mark.check(&store.join(&mark.name)))
    }

    /// Removes the chunks that were written later.
    fn cut_off(&self, store: &Place) -> Result<()> {
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
            return Err(format!("it tells of {path} with {written} of {grid:?} chunks"));
        }
        if array.at().is_symlink() {
            return Err(format!("{path} is a link, which no run writes"));
        }
        let mut found = 0;
        for number in 0..*written {
            let chunk = array.join(key(number, grid));
            // Each chunk goes on where the one before it ended. None is longer.
            let sum = input::open(chunk.at()).and_then(|file| checksum(&mut file.take(CHUNK_BYTES as u64 + 1), found));
            found = sum.map_err(|e| format!("cannot read {} ({e})", chunk.shown().display()))?.1;
        }
        match found == *crc {
            true => Ok(()),
            false => Err(format!("the chunks in {path} are not those that it tells of")),
        }
    }
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Kind::Float64 => "float64",
            Kind::Int64 => "int64",
            Kind::Int8 => "int8",
        }
    }

    fn fill_value(self) -> Value {
        match self {
            Kind::Float64 => "NaN".into(),
            Kind::Int64 | Kind::Int8 => 0.into(),
        }
    }

    /// The bytes of the fill value.
    fn fill(self) -> Vec<u8> {
        match self {
            Kind::Float64 => f64::NAN.to_le_bytes().into(),
            Kind::Int64 => 0_i64.to_le_bytes().into(),
            Kind::Int8 => vec![0],
        }
    }
}

/// Extents of chunks of at most `room` elements: whole dimensions from the last on, then equal parts of one, then single
/// elements.
fn chunk_shape(shape: &[u64], mut room: u64) -> Vec<u64> {
    let mut chunk: Vec<u64> = shape
        .iter()
        .rev()
        .map(|extent| {
            let parts = extent.div_ceil(room.max(1));
            let part = extent.div_ceil(parts);
            // What is cut takes more than half of the room, and leaves 1 for the dimensions before it.
            room /= part;
            part
        })
        .collect();
    chunk.reverse();
    chunk
}

/// The index of the time nearest to `t`, which is among them but for rounding where final times differ from cell to cell.
fn nearest(times: &[f64], t: f64) -> usize {
    let after = times.partition_point(|own| *own < t).min(times.len() - 1);
    if after > 0 && t - times[after - 1] < times[after] - t { after - 1 } else { after }
}

fn pretty(metadata: &Value) -> Result<Vec<u8>> {
    json_text(metadata, "zarr.json").map(String::into_bytes)
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;
    use crate::{
        backend::{Backend, cpu::CpuBackend},
        ensemble::{
            Cell, Ended, Family, Sink,
            spec::{Precision, Store},
        },
        files::{OutputFolder, names, tables::SnapshotTable},
        scheme::step::Method,
        simulate::simulate,
        solver::{Blocks, Order, Solver},
    };

    /// An array as it was read, in C order.
    #[derive(Clone, Debug, PartialEq)]
    struct Read {
        shape: Vec<usize>,
        chunk: Vec<usize>,
        elements: Vec<[u8; 8]>,
    }

    impl Read {
        fn floats(&self) -> Vec<u64> {
            self.elements.iter().map(|bytes| f64::from_le_bytes(*bytes).to_bits()).collect()
        }

        fn whole(&self) -> Vec<i64> {
            self.elements.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect()
        }
    }

    /// Reads an array by its metadata alone, element by element; bytes of short elements come first.
    fn read(store: &Path, name: &str) -> Read {
        let text = fs::read_to_string(store.join(name).join("zarr.json")).unwrap();
        let metadata: Value = serde_json::from_str(&text).unwrap();
        let extents = |list: &Value| -> Vec<usize> {
            list.as_array().unwrap().iter().map(|extent| extent.as_u64().unwrap() as usize).collect()
        };
        let shape = extents(&metadata["shape"]);
        let chunk = extents(&metadata["chunk_grid"]["configuration"]["chunk_shape"]);
        let size = if metadata["data_type"] == "int8" { 1 } else { 8 };
        let element = |mut number: usize| {
            let (mut key, mut offset, mut stride) = (String::new(), 0, size);
            for (extent, chunk) in shape.iter().zip(&chunk).rev() {
                let i = number % extent;
                number /= extent;
                key = format!(".{}{key}", i / chunk);
                offset += i % chunk * stride;
                stride *= chunk;
            }
            let bytes = fs::read(store.join(name).join(format!("c{key}"))).unwrap();
            assert_eq!(bytes.len(), stride, "{name}/c{key} is no whole chunk");
            let mut element = [0; 8];
            element[..size].copy_from_slice(&bytes[offset..offset + size]);
            element
        };
        let elements = (0..shape.iter().product()).map(element).collect();
        Read { shape, chunk, elements }
    }

    /// Adds a member.
    fn add(store: &mut SnapshotStore, status: Status, snapshots: &[Snapshot]) {
        snapshots.iter().for_each(|snapshot| store.snapshot(snapshot).unwrap());
        store.member(status).unwrap();
    }

    /// The store that members leave in chunks of at most `bytes`.
    fn stored(home: &Path, spec: &Spec, members: &[(Status, Vec<Snapshot>)], bytes: usize) -> std::path::PathBuf {
        let out = OutputFolder::open(home, true).unwrap();
        let points = members.iter().flat_map(|(_, snapshots)| snapshots).map(|s| s.x.len()).max().unwrap();
        let folder = out.store(names::STORE).unwrap();
        let mut store = SnapshotStore::of_chunks(folder, spec, points, spec.snapshots.clone(), bytes).unwrap();
        members.iter().for_each(|(status, snapshots)| add(&mut store, *status, snapshots));
        let run = out.write(names::RUN, "{}").unwrap();
        out.publish(Vec::new(), Some(store.ready().unwrap()), run).unwrap();
        home.join(names::STORE)
    }

    fn spec(curves: u64, snapshots: &[f64]) -> Spec {
        Spec { curves, snapshots: snapshots.into(), store: Store::Zarr, ..Spec::default() }
    }

    /// Seven members with five nodes that all differ, of which the fourth ends before the last of three times.
    fn members() -> Vec<(Status, Vec<Snapshot>)> {
        let node = |member: u64, t: f64, field: f64| -> Vec<f64> {
            (1..=5).map(|i| 1000.0 * field + 100.0 * member as f64 + 10.0 * t + f64::from(i)).collect()
        };
        let snapshot = |member: u64, t: f64| {
            let [x, y, k, r] = [1.0, 2.0, 3.0, 4.0].map(|field| node(member, t, field));
            Snapshot { member, t, x, y, k, r }
        };
        let member = |member| match member {
            3 => (Status::Stalled, vec![snapshot(3, 0.0), snapshot(3, 1.0)]),
            _ => (Status::Relaxed, [0.0, 1.0, 2.0].map(|t| snapshot(member, t)).into()),
        };
        (0..7).map(member).collect()
    }

    fn expected(members: &[(Status, Vec<Snapshot>)], of: fn(&Snapshot) -> &Vec<f64>) -> Vec<u64> {
        let mut all = Vec::new();
        for (_, snapshots) in members {
            for t in [0.0, 1.0, 2.0] {
                match snapshots.iter().find(|snapshot| snapshot.t == t) {
                    Some(snapshot) => all.extend(of(snapshot).iter().map(|value| value.to_bits())),
                    None => all.extend([f64::NAN.to_bits(); 5]),
                }
            }
        }
        all
    }

    #[test]
    fn every_element_is_where_the_metadata_say_however_the_arrays_are_cut() {
        let (spec, members) = (spec(7, &[0.0, 1.0, 2.0]), members());
        for (bytes, chunk) in [
            (1 << 20, [7, 3, 5]),
            (360, [3, 3, 5]), // three members in a chunk, one in the last
            (120, [1, 3, 5]),
            (80, [1, 2, 5]), // times are cut
            (24, [1, 1, 3]), // nodes are
            (8, [1, 1, 1]),
        ] {
            let home = tempfile::tempdir().unwrap();
            let store = stored(home.path(), &spec, &members, bytes);
            let x = read(&store, "x");
            assert_eq!((&x.shape[..], &x.chunk[..]), (&[7, 3, 5][..], &chunk[..]));
            assert_eq!(x.floats(), expected(&members, |snapshot| &snapshot.x), "chunks of {bytes} bytes");
            assert_eq!(read(&store, "y").floats(), expected(&members, |snapshot| &snapshot.y));
            assert_eq!(read(&store, "k").floats(), expected(&members, |snapshot| &snapshot.k));
            assert_eq!(read(&store, "r").floats(), expected(&members, |snapshot| &snapshot.r));
            assert_eq!(read(&store, "member").whole(), [0, 1, 2, 3, 4, 5, 6]);
            assert_eq!(read(&store, "node").whole(), [1, 2, 3, 4, 5]);
            assert_eq!(read(&store, "time").floats(), [0.0, 1.0, 2.0].map(f64::to_bits));
            let codes = read(&store, "status").elements.iter().map(|element| element[0]).collect::<Vec<_>>();
            assert_eq!(codes, [1, 1, 1, 5, 1, 1, 1]);
            let chunks = fs::read_dir(store.join("x")).unwrap().count() - 1;
            assert_eq!(chunks, 7_usize.div_ceil(chunk[0]) * 3_usize.div_ceil(chunk[1]) * 5_usize.div_ceil(chunk[2]));

            // Members in another order are seen, and so is a chunk with another one's bytes.
            let mut other = members.clone();
            other.swap(1, 2);
            assert_ne!(x.floats(), expected(&other, |snapshot| &snapshot.x));
            if chunk[0] == 3 {
                fs::copy(store.join("x/c.1.0.0"), store.join("x/c.0.0.0")).unwrap();
                assert_ne!(read(&store, "x").floats(), x.floats());
            }
        }
    }

    #[test]
    fn unknown_is_nan_and_padding_is_never_in_the_array() {
        let home = tempfile::tempdir().unwrap();
        let (spec, mut members) = (spec(7, &[0.0, 1.0, 2.0]), members());
        members[6].1[2].k[4] = f64::INFINITY;
        let store = stored(home.path(), &spec, &members, 360);
        let unknown = |name| -> Vec<usize> {
            let elements = read(&store, name).floats();
            (0..elements.len()).filter(|i| elements[*i] == f64::NAN.to_bits()).collect()
        };
        let lost: Vec<usize> = (3 * 15 + 10..3 * 15 + 15).collect();
        assert_eq!(unknown("x"), lost);
        assert_eq!(unknown("k"), [lost, vec![6 * 15 + 14]].concat());
        let last = fs::read(store.join("x/c.2.0.0")).unwrap();
        assert!(last.chunks(8).skip(15).all(|element| element == f64::NAN.to_le_bytes()));
    }

    /// Keeps all that the members leave.
    #[derive(Default)]
    struct Recorder(Vec<Ended>);

    impl Sink for Recorder {
        fn member(&mut self, ended: &Ended) -> Result<()> {
            self.0.push(ended.clone());
            Ok(())
        }
        fn progress(&mut self, _done: u64, _total: u64, _share: f64) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_run_leaves_the_same_bits_as_in_its_table() {
        let spec = Spec {
            points: 33,
            t_end: 0.3,
            relax_to: Some(0.2),
            stop_when_relaxed: true,
            only: Some(vec![1, 2, 5, 7, 8]),
            solver: Solver::Direct.into(),
            ..spec(11, &[0.0, 0.0123, 0.1, 0.3])
        };
        let spec = spec.validate().unwrap();
        let family = Family::new(&spec).unwrap();
        let direct = Method { solver: Solver::Direct, order: Order::Coloured, max_sweeps: 1 };
        let mut backend = CpuBackend::<f64>::new(Blocks::new(33).unwrap(), direct, 1).unwrap();
        let mut recorder = Recorder::default();
        let backend: &mut dyn Backend = &mut backend;
        simulate(&[Cell::only(spec.clone(), family)], Precision::F64, backend, 0, &mut recorder).unwrap();
        let members: Vec<_> =
            recorder.0.into_iter().map(|ended| (ended.outcome.status, ended.rows.snapshots)).collect();

        let home = tempfile::tempdir().unwrap();
        let store = stored(home.path(), &spec, &members, 2 * 4 * 33 * 8);
        let [member, node] = ["member", "node"].map(|name| read(&store, name).whole());
        assert_eq!(member, [1, 2, 5, 7, 8]);
        let time: Vec<f64> = read(&store, "time").floats().into_iter().map(f64::from_bits).collect();
        let fields = ["x", "y", "k", "r"].map(|name| read(&store, name));
        assert_eq!(fields[0].chunk, [2, 4, 33]);
        let mut rows = Vec::new();
        for number in 0..fields[0].elements.len() {
            let values = fields.each_ref().map(|field| f64::from_le_bytes(field.elements[number]));
            if !values[0].is_nan() {
                let (member, t, i) = (member[number / 132], time[number / 33 % 4], node[number % 33]);
                let [x, y, k, r] = values;
                rows.push(format!("{member},{t:?},{i},{x:?},{y:?},{k:?},{r:?}"));
            }
        }

        let out = OutputFolder::open(home.path(), true).unwrap();
        let mut table = SnapshotTable::new(out.file("snapshots.csv").unwrap()).unwrap();
        members.iter().flat_map(|(_, snapshots)| snapshots).for_each(|own| table.snapshot(own).unwrap());
        let text = fs::read_to_string(table.ready().unwrap().part().at()).unwrap();
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert!(rows.len() < 5 * 4 * 33 && rows.len() > 2 * 4 * 33, "{} rows: some, not all, end early", rows.len());
        assert_eq!(rows, lines);
    }

    #[test]
    fn the_metadata_hold_the_spec_and_repeat_that_of_each_array() {
        let home = tempfile::tempdir().unwrap();
        let spec = Spec { threads: Some(3), ..spec(7, &[0.0, 1.0, 2.0]) };
        let store = stored(home.path(), &spec, &members(), 1 << 20);
        let json = |name: &str| -> Value {
            serde_json::from_str(&fs::read_to_string(store.join(name).join("zarr.json")).unwrap()).unwrap()
        };
        let group = json("");
        let text = group["attributes"]["spec"].as_str().unwrap();
        assert_eq!(Spec::from_toml(text).unwrap(), Spec { threads: None, ..spec });
        assert_eq!(group["attributes"]["curvelax"], env!("CARGO_PKG_VERSION"));
        let all = group["consolidated_metadata"]["metadata"].as_object().unwrap();
        assert_eq!(all.len(), 9);
        all.iter().for_each(|(name, metadata)| assert_eq!(json(name), *metadata, "{name}"));
        assert_eq!(json("k")["attributes"]["units"], "1/length");
        assert_eq!(json("time")["attributes"]["units"], "length^4");
        let meanings = json("status")["attributes"]["flag_meanings"].as_str().unwrap().to_string();
        let words: Vec<&str> = meanings.split(' ').collect();
        let codes = json("status")["attributes"]["flag_values"].clone();
        for (i, status) in Status::ALL.into_iter().enumerate() {
            assert_eq!((words[i], &codes[i]), (status.name(), &json!(status as u32)));
        }
    }

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
    fn a_store_goes_on_from_every_member_to_the_same_bytes() {
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
            // Not in the state, so to be removed.
            add(&mut first, &members[kept..(kept + 3).min(members.len())]);
            let part = first.folder.part().clone();
            first.keep(true);
            drop(first);
            out.check_store(&mark).unwrap();
            if kept > 2 {
                let chunk = part.join("x/c.0.0.0").at().to_path_buf();
                let bytes = fs::read(&chunk).unwrap();
                fs::write(&chunk, [&[bytes[0] ^ 1], &bytes[1..]].concat()).unwrap();
                assert!(out.check_store(&mark).unwrap_err().contains("/x are not those that it tells of"));
                fs::remove_file(&chunk).unwrap();
                assert!(out.check_store(&mark).unwrap_err().contains("cannot read "));
                fs::write(&chunk, bytes).unwrap();
            }
            mark.cut_off(&part).unwrap();
            let mut second = begin(PartFolder::again(part.clone(), Place::named(&home.path().join(names::STORE))))
                .from(&mark)
                .unwrap();
            add(&mut second, &members[kept..]);
            assert!(contents(part.at()) == whole, "from {kept} members");
            second.keep(false);
        }
        let other =
            Mark { arrays: vec![ArrayMark { written: 1000, ..begin(out.store(names::STORE).unwrap()).status.mark() }] };
        assert!(out.check_store(&other).unwrap_err().contains("other arrays than x, y, k, r, status"));
    }

    #[test]
    fn chunks_are_full_and_of_equal_size() {
        for (shape, room, chunk) in [
            (&[1_000_000, 1, 100][..], 524_288, &[5236, 1, 100][..]),
            (&[256, 11, 100], 524_288, &[256, 11, 100]),
            (&[10, 10_000, 100], 524_288, &[1, 5000, 100]),
            (&[3, 2, 1_000_000], 524_288, &[1, 1, 500_000]),
            (&[600_000], 524_288, &[300_000]),
            (&[1], 524_288, &[1]),
        ] {
            assert_eq!(chunk_shape(shape, room), chunk, "{shape:?}");
        }
    }

    #[test]
    fn a_time_that_rounding_moved_finds_its_place() {
        let times = [0.0, 0.5, 1.0];
        for (t, place) in [(0.0, 0), (0.5, 1), (0.5 + 1e-12, 1), (0.5 - 1e-12, 1), (1.0, 2), (1.0 + 1e-12, 2)] {
            assert_eq!(nearest(&times, t), place, "{t}");
        }
    }
}
