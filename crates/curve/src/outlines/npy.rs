//! Arrays saved by NumPy: `.npy`, and `.npz`, a zip of them.
//!
//! An array of shape (N, 2) is an outline of N points, and one of shape (M, N, 2) is M outlines. Rows of NaN separate
//! outlines, and fill up shorter ones. The outlines of an `.npz` have the names of its arrays.

use std::io::{Cursor, Read};

use glam::DVec2;
use npyz::{DType, NpyFile, Order, TypeChar};
use zip::ZipArchive;

use super::piece::{Piece, each, label};
use crate::outline::{Places, RingPoints, Source, within};
use curvelax_base::{
    error::{Error, Result, one_line, shortened},
    input::MAX_OUTLINE,
    text,
};

/// Maximum characters of foreign text in a message.
const SHOWN: usize = 40;
const MAX_PROBLEM: usize = 160;

const REMEDY: &str = "save it by numpy.save, as floats of the shape (points, 2) or (outlines, points, 2)";

/// The first bytes of an array.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// Reads the outlines of an `.npy` file.
pub(super) fn pieces(source: Source, bytes: &[u8]) -> Result<Vec<Result<Piece>>> {
    let mut pieces = of_array(source, "", bytes)?;
    number(&mut pieces, 0);
    Ok(each([Ok(pieces)].into_iter()))
}

/// Reads the outlines of an `.npz` file, in the order of its arrays.
pub(super) fn pieces_of_zip(source: Source, bytes: &[u8]) -> Result<Vec<Result<Piece>>> {
    let broken = |place: &str, said: String| {
        let problem = format!("no zip of arrays: {}", shortened(&one_line(&said), MAX_PROBLEM));
        source.refusal(place, &problem, "save it by numpy.savez")
    };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| broken("", e.to_string()))?;
    let (mut arrays, mut left) = (Vec::new(), MAX_OUTLINE);
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(|e| broken(&format!("array {}", index + 1), e.to_string()))?;
        let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
        let name = name.strip_suffix(".npy").unwrap_or(&name);
        let place = format!("array `{}`", shortened(name, SHOWN));
        let mut array = Vec::new();
        let read = entry.take(left + 1).read_to_end(&mut array).map_err(|e| broken(&place, e.to_string()))?;
        left = left.checked_sub(read as u64).ok_or_else(|| {
            let problem = format!("the arrays unpack to more than {}", text::bytes(MAX_OUTLINE));
            source.refusal(&place, &problem, "save fewer in one file")
        })?;
        arrays.push(of_array(source, &place, &array).map(|mut outlines| {
            outlines.iter_mut().for_each(|piece| piece.name = label(name));
            number(&mut outlines, index);
            outlines
        }));
    }
    match arrays.is_empty() {
        true => Err(source.refusal("", "the file holds no arrays", "save them by numpy.savez")),
        false => Ok(each(arrays.into_iter())),
    }
}

/// Numbers the outlines of the array at `index`: by itself if it is named, otherwise each.
fn number(pieces: &mut [Piece], index: usize) {
    let several = pieces.len() > 1;
    for (i, piece) in pieces.iter_mut().enumerate() {
        match piece.name {
            Some(_) => (piece.item, piece.polygon) = (index + 1, several.then_some(i + 1)),
            None => piece.item = i + 1,
        }
    }
}

/// The outlines of one array.
fn of_array(source: Source, place: &str, bytes: &[u8]) -> Result<Vec<Piece>> {
    let refuse = |problem: String| source.refusal(place, &problem, REMEDY);
    let coordinates = PointArray::read(bytes).map_err(refuse)?;
    let (blocks, points) = match coordinates.shape[..] {
        [points, 2] => (1, points),
        [outlines, points, 2] => (outlines, points),
        _ => return Err(refuse(format!("the array has the shape {}", shown(&coordinates.shape)))),
    };
    let mut pieces = Vec::new();
    let mut spans = Vec::new();
    for block in 0..blocks {
        let rows = (0..points).map(|row| coordinates.point(block, row));
        let mut start = None;
        for (row, point) in rows.enumerate() {
            match (point.is_nan_mask().all(), start) {
                (false, None) => start = Some(row),
                (true, Some(begin)) => {
                    spans.push((block, begin..row));
                    start = None;
                }
                _ => {}
            }
        }
        spans.extend(start.map(|begin| (block, begin..points)));
    }
    if spans.is_empty() {
        return Err(refuse("the array holds no points".into()));
    }
    let several = spans.len() > 1;
    for (index, (block, span)) in spans.into_iter().enumerate() {
        let part = if several { within(place, &format!("outline {}", index + 1)) } else { place.to_owned() };
        let numbers = span.clone().collect();
        let places = Places { part, unit: "row", numbers };
        let ring = RingPoints::new(span.map(|row| coordinates.point(block, row)).collect(), places);
        pieces.push(Piece::new(index + 1, ring));
    }
    Ok(pieces)
}

/// `(100, 3)`.
fn shown(shape: &[usize]) -> String {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    format!("({}{})", sizes.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// Numbers with their shape.
struct PointArray {
    shape: Vec<usize>,
    order: Order,
    values: Vec<f64>,
}

impl PointArray {
    /// Reads an array of integers or floats.
    ///
    /// # Errors
    /// The problem, in words.
    fn read(bytes: &[u8]) -> Result<PointArray, String> {
        let data = check_header(bytes)?;
        let invalid = |e: std::io::Error| format!("no array: {}", shortened(&one_line(&e.to_string()), MAX_PROBLEM));
        let file = NpyFile::new(bytes).map_err(invalid)?;
        let (dtype, order) = (file.dtype(), file.order());
        let DType::Plain(kind) = &dtype else {
            return Err("the array has named fields".into());
        };
        let shape: Vec<usize> = file.shape().iter().map(|size| *size as usize).collect();
        let size = kind.size_field() as usize;
        let there = bytes.len() - data;
        let expected = shape.iter().try_fold(size, |product, n| product.checked_mul(*n));
        if expected != Some(there) {
            let expected = expected.map_or("more".into(), |bytes| bytes.to_string());
            return Err(format!("the array of shape {} takes {expected} bytes and has {there}", shown(&shape)));
        }
        let wrong_type = || format!("the numbers are of the type {}", shortened(&dtype.descr(), SHOWN));
        macro_rules! numbers {
            ($type:ty) => {
                file.into_vec::<$type>().map_err(invalid)?.into_iter().map(|value| value as f64).collect()
            };
        }
        let values = match (kind.type_char(), size) {
            (TypeChar::Float, 8) => file.into_vec::<f64>().map_err(invalid)?,
            (TypeChar::Float, 4) => numbers!(f32),
            (TypeChar::Int, 8) => numbers!(i64),
            (TypeChar::Int, 4) => numbers!(i32),
            (TypeChar::Int, 2) => numbers!(i16),
            (TypeChar::Int, 1) => numbers!(i8),
            (TypeChar::Uint, 8) => numbers!(u64),
            (TypeChar::Uint, 4) => numbers!(u32),
            (TypeChar::Uint, 2) => numbers!(u16),
            (TypeChar::Uint, 1) => numbers!(u8),
            _ => return Err(wrong_type()),
        };
        Ok(PointArray { shape, order, values })
    }

    /// The point of a row of a block.
    fn point(&self, block: usize, row: usize) -> DVec2 {
        let sizes = match self.shape[..] {
            [outlines, points, _] => [outlines, points],
            _ => [1, self.shape[0]],
        };
        let at = |axis: usize| match self.order {
            Order::C => (block * sizes[1] + row) * 2 + axis,
            Order::Fortran => (axis * sizes[1] + row) * sizes[0] + block,
        };
        DVec2::new(self.values[at(0)], self.values[at(1)])
    }
}

/// Checks the header before it is parsed: its length, how deeply it nests, and that no size overflows. Returns where
/// the numbers begin.
fn check_header(bytes: &[u8]) -> Result<usize, String> {
    let damaged = || "no NumPy array: its header is damaged".to_owned();
    let version = bytes.strip_prefix(MAGIC).and_then(|rest| rest.first()).ok_or_else(damaged)?;
    let length = |bytes: Option<&[u8]>| bytes.map(|bytes| bytes.iter().rev().fold(0, |sum, b| sum << 8 | *b as usize));
    let (begin, length) = match version {
        1 => (10, length(bytes.get(8..10))),
        _ => (12, length(bytes.get(8..12))),
    };
    let end = begin + length.ok_or_else(damaged)?;
    let header = bytes.get(begin..end).ok_or_else(damaged)?;
    let number = |of: fn(&u8) -> bool| header.iter().filter(|byte| of(byte)).count();
    // Whatever the numbers are, their product has no more digits than they have: no overflow.
    let (digits, brackets) = (number(u8::is_ascii_digit), number(|byte| b"([{".contains(byte)));
    match digits <= 18 && brackets <= 16 {
        true => Ok(end),
        false => Err("the header is not that of an array of points".into()),
    }
}

/// The error of a file that is called an array and is none.
pub(super) fn not_an_array(source: Source) -> Error {
    source.refusal("", "not a NumPy array, whatever its name says", REMEDY)
}
