//! An array of a growing store, chunk by chunk.

use serde_json::{Value, json};

use super::chunks::{DataType, chunk_shape, key};
use crate::part_folder::PartFolder;
use curvelax_base::error::Result;

/// An array that is written from its first element to its last.
pub(super) struct Array {
    pub(super) name: &'static str,
    pub(super) metadata: Value,
    /// Chunks in each dimension.
    pub(super) grid: Vec<u64>,
    pub(super) chunk_bytes: usize,
    /// The value of elements that were not written.
    pub(super) fill: Vec<u8>,
    /// The chunk that is being filled, and the number of chunks before it.
    pub(super) chunk: Vec<u8>,
    pub(super) written: u64,
    /// CRC-32C of those before it.
    pub(super) crc: u32,
    /// Bytes of all elements.
    pub(super) bytes: u64,
    /// Bytes between two elements that always begin a chunk, and how many of these bytes are still to come.
    pub(super) run_bytes: u64,
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
        let size = kind.fill().len();
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
                "data_type": kind.name(),
                "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
                // Files side by side, instead of a folder per index.
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
    pub(super) fn push(&mut self, folder: &PartFolder, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let room = (self.chunk_bytes - self.chunk.len()).min(self.run_left as usize);
            let (now, later) = bytes.split_at(room.min(bytes.len()));
            // All at once, since a chunk that grew by doubling would hold up to twice its bytes.
            self.chunk.reserve_exact(self.chunk_bytes - self.chunk.len());
            self.chunk.extend_from_slice(now);
            self.run_left -= now.len() as u64;
            if self.run_left == 0 || self.chunk.len() == self.chunk_bytes {
                self.write(folder)?;
            }
            bytes = later;
        }
        Ok(())
    }

    /// Writes the chunk at its full length, even if it extends beyond the array.
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
}
