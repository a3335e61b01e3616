//! How an array is cut into chunks of equal size, and their names.

use serde_json::Value;

/// Approximate bytes per chunk: few files for many members, and little to read for one.
pub(super) const CHUNK_BYTES: usize = 4 << 20;

/// Type of an element.
#[derive(Clone, Copy)]
pub(super) enum DataType {
    Float64,
    Int64,
    Int8,
}

impl DataType {
    /// Its name, its fill value, and the bytes of that.
    pub(super) fn parts(self) -> (&'static str, Value, Vec<u8>) {
        match self {
            DataType::Float64 => ("float64", "NaN".into(), f64::NAN.to_le_bytes().into()),
            DataType::Int64 => ("int64", 0.into(), 0_i64.to_le_bytes().into()),
            DataType::Int8 => ("int8", 0.into(), vec![0]),
        }
    }
}

/// Extents of chunks of at most `room` elements: whole dimensions from the last one, then equal parts of one, then
/// single elements.
pub(super) fn chunk_shape(shape: &[u64], mut room: u64) -> Vec<u64> {
    let mut chunk: Vec<u64> = shape
        .iter()
        .rev()
        .map(|extent| {
            let parts = extent.div_ceil(room.max(1));
            let part = extent.div_ceil(parts);
            // Each part is more than half of the room, which leaves 1 for the dimensions before it.
            room /= part;
            part
        })
        .collect();
    chunk.reverse();
    chunk
}

/// The name of a chunk: `c` and its place in the grid.
pub(super) fn key(number: u64, grid: &[u64]) -> String {
    let mut rest = number;
    let mut key = String::new();
    for chunks in grid.iter().rev() {
        key = format!(".{}{key}", rest % chunks);
        rest /= chunks;
    }
    format!("c{key}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_called_by_their_place_in_the_grid() {
        let names: Vec<String> = (0..6).map(|number| key(number, &[2, 1, 3])).collect();
        assert_eq!(names, ["c.0.0.0", "c.0.0.1", "c.0.0.2", "c.1.0.0", "c.1.0.1", "c.1.0.2"]);
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
}
