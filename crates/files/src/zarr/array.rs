//! An array of a growing store, chunk by chunk.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::chunks::{DataType, chunk_shape, key};
use crate::part_folder::PartFolder;
use curvelax_base::error::Result;

/// An array that is written from its first element to its last.
pub(super) struct Array {
    pub(super) name: &'static str,
    pub(super) metadata: Value,
    /// Its extent so far.
    pub(super) mark: ArrayMark,
    pub(super) chunk_bytes: usize,
    /// The value of elements that were not written.
    pub(super) fill: Vec<u8>,
    /// Bytes of all elements.
    pub(super) bytes: u64,
    /// Bytes between two elements that always begin a chunk.
    pub(super) run_bytes: u64,
}

/// The extent of an array, as recorded in a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct ArrayMark {
    pub(super) name: String,
    /// Chunks in each dimension.
    pub(super) grid: Vec<u64>,
    /// Number of chunks written, and the CRC-32C of all of them.
    pub(super) written: u64,
    pub(super) crc: u32,
    /// The chunk that is being filled.
    pub(super) chunk: Vec<u8>,
    pub(super) run_left: u64,
}

impl Array {
    /// Makes an array from extents by name of the dimension, with chunks of at most `bytes`, and with attributes.
    pub(super) fn new(
        name: &'static str,
        kind: DataType,
        dimensions: &[(&str, u64)],
        attributes: Value,
        bytes: usize,
    ) -> Array {
        let (data_type, fill_value, fill) = kind.parts();
        let size = fill.len();
        let shape: Vec<u64> = dimensions.iter().map(|(_, extent)| *extent).collect();
        let names: Vec<&str> = dimensions.iter().map(|(name, _)| *name).collect();
        let chunk = chunk_shape(&shape, (bytes / size) as u64);
        let grid: Vec<u64> = shape.iter().zip(&chunk).map(|(extent, chunk)| extent.div_ceil(*chunk)).collect();
        // Dimensions before the last one that is cut have chunks of one element, those after it are whole.
        let cut = grid.iter().rposition(|chunks| *chunks > 1).unwrap_or(0);
        let run_bytes = shape[cut..].iter().product::<u64>() * size as u64;
        Array {
            name,
            metadata: json!({
                "zarr_format": 3,
                "node_type": "array",
                "shape": shape,
                "data_type": data_type,
                "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
                // Files side by side, instead of a folder per index.
                "chunk_key_encoding": { "name": "default", "configuration": { "separator": "." } },
                "fill_value": fill_value,
                "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
                "attributes": attributes,
                "dimension_names": names,
            }),
            mark: ArrayMark { name: name.into(), grid, written: 0, crc: 0, chunk: Vec::new(), run_left: run_bytes },
            chunk_bytes: chunk.iter().product::<u64>() as usize * size,
            bytes: shape.iter().product::<u64>() * size as u64,
            fill,
            run_bytes,
        }
    }

    /// Continues from the mark, if it belongs to this array.
    pub(super) fn resume_from(&mut self, mark: &ArrayMark) -> bool {
        let ArrayMark { name, grid, written, chunk, run_left, .. } = mark;
        let fits = chunk.len() < self.chunk_bytes && *written <= grid.iter().product();
        let fits = fits && name == self.name && *grid == self.mark.grid && *run_left <= self.run_bytes;
        self.mark.clone_from(mark);
        fits
    }

    /// Adds elements, and writes the chunks that they complete.
    pub(super) fn push(&mut self, folder: &PartFolder, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let ArrayMark { chunk, run_left, .. } = &mut self.mark;
            let missing = self.chunk_bytes - chunk.len();
            let (now, later) = bytes.split_at(missing.min(*run_left as usize).min(bytes.len()));
            // All at once, since a chunk that grew by doubling would hold up to twice its bytes.
            chunk.reserve_exact(missing);
            chunk.extend_from_slice(now);
            *run_left -= now.len() as u64;
            if *run_left == 0 || chunk.len() == self.chunk_bytes {
                self.write(folder)?;
            }
            bytes = later;
        }
        Ok(())
    }

    /// Writes the chunk at its full length, even if it extends beyond the array.
    fn write(&mut self, folder: &PartFolder) -> Result<()> {
        let ArrayMark { grid, written, crc, chunk, run_left, .. } = &mut self.mark;
        chunk.extend(self.fill.iter().cycle().take(self.chunk_bytes - chunk.len()));
        folder.write(&format!("{}/{}", self.name, key(*written, grid)), chunk)?;
        *crc = crc32c::crc32c_append(*crc, chunk);
        chunk.clear();
        *written += 1;
        if *run_left == 0 {
            *run_left = self.run_bytes;
        }
        Ok(())
    }
}
