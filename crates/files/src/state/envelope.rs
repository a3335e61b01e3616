//! The envelope of files that only this program reads: checkpoints, and the data that a merge needs from a shard.
//!
//! A file is 16 bytes of magic, the version of the format (4), the length of the rest without the checksum (8), the
//! [fingerprint](super::fingerprint) of the body's layout (4), the version of the program and the body, as written by
//! postcard, and the CRC-32C of all of it (4). Integers are little-endian.

use std::{
    fs::File,
    io::{self, Read, Seek},
    path::Path,
};

use serde::{Deserialize, Serialize};

use crate::disk;
use curvelax_base::{error::Error, input, text};

const MAGIC: [u8; 16] = *b"curvelax state\r\n";
/// Version of the format: of the envelope, and of numbers whose order no layout shows.
const VERSION: u32 = 4;
/// Bytes before the counted part, and after it.
const BEFORE: usize = MAGIC.len() + 4 + 8;
const AFTER: usize = 4;

const WRONG_CHECKSUM: &str = "its checksum is wrong";

/// Why bytes are not a valid file.
#[derive(Debug, PartialEq, Eq)]
pub enum Fault {
    /// They are not a file of this program, or one of another version: do not try others.
    Foreign(String),
    /// They were changed or truncated.
    Damaged(String),
}

/// The file called `name` of this version of the program with this body, whose layout has this fingerprint.
///
/// # Errors
/// [`Error::Failed`] for a body that cannot be written.
pub fn sealed_body(layout: u32, name: &str, body: &impl Serialize) -> Result<Vec<u8>, Error> {
    let body = (curvelax_base::VERSION, body);
    let sealed = postcard::experimental::serialized_size(&body).and_then(|size| {
        sealed(layout, |mut bytes| {
            // A checkpoint may be large: reserve exactly as much as it needs.
            bytes.reserve_exact(size + AFTER);
            postcard::to_extend(&body, bytes)
        })
    });
    sealed.map_err(|e| Error::Failed(format!("cannot write {name}: {e}")))
}

/// A file with the body that `write` appends to its beginning.
pub fn sealed<E>(layout: u32, write: impl FnOnce(Vec<u8>) -> Result<Vec<u8>, E>) -> Result<Vec<u8>, E> {
    let mut before = MAGIC.to_vec();
    before.extend(VERSION.to_le_bytes());
    before.extend([0; 8]);
    before.extend(layout.to_le_bytes());
    let mut bytes = write(before)?;
    let length = (bytes.len() - BEFORE) as u64;
    bytes[BEFORE - 8..BEFORE].copy_from_slice(&length.to_le_bytes());
    let crc = crc32c::crc32c(&bytes);
    bytes.extend(crc.to_le_bytes());
    Ok(bytes)
}

/// The body of a [sealed](sealed_body) file.
///
/// # Errors
/// A [`Fault`] unless the bytes are complete and written by this version of the program, with types of the same layout.
pub fn opened<'a, T: Deserialize<'a>>(layout: u32, bytes: &'a [u8]) -> Result<T, Fault> {
    let damaged = |what: &str| Err(Fault::Damaged(what.into()));
    let unreadable = |e: postcard::Error| Fault::Damaged(format!("it cannot be read ({e})"));
    let mut rest = bytes;
    let (Some(magic), Some(version), Some(length)) =
        (take::<16>(&mut rest), take::<4>(&mut rest), take::<8>(&mut rest))
    else {
        return damaged(&format!("it has {} bytes, fewer than any checkpoint", bytes.len()));
    };
    let (version, length) = (u32::from_le_bytes(version), u64::from_le_bytes(length));
    let whole = length.checked_add((BEFORE + AFTER) as u64);
    if whole != Some(bytes.len() as u64) {
        return damaged(&format!("it was cut off or changed: its header promises {length} bytes of content"));
    }
    let (all, crc) = bytes.split_at(bytes.len() - AFTER);
    if crc32c::crc32c(all).to_le_bytes() != *crc {
        return damaged(WRONG_CHECKSUM);
    }
    // It is intact, so any difference is intended.
    if magic != MAGIC {
        return Err(Fault::Foreign("it is not a checkpoint of curvelax".into()));
    }
    if version != VERSION {
        let message = format!("its format is {version}, and that of this version is {VERSION}");
        return Err(Fault::Foreign(message));
    }
    rest = &rest[..rest.len() - AFTER];
    let Some(written) = take::<4>(&mut rest) else { return damaged("it has no layout") };
    let (own, written) = (curvelax_base::VERSION, u32::from_le_bytes(written));
    let (program, body) = postcard::take_from_bytes::<&str>(rest).map_err(unreadable)?;
    if program != own {
        return Err(Fault::Foreign(format!("it is of curvelax {program}, and this is {own}, whose digits may differ")));
    }
    if written != layout {
        return Err(Fault::Foreign(format!(
            "another build of curvelax {own} wrote it: its layout is {written:08x}, and that of this build is {layout:08x}"
        )));
    }
    match postcard::take_from_bytes(body).map_err(unreadable)? {
        (body, []) => Ok(body),
        _ => damaged("there is more in it than a checkpoint"),
    }
}

/// The length of the body, as given in the bytes before it.
fn stated_length(before: &[u8]) -> Option<u64> {
    before.get(BEFORE - 8..BEFORE)?.try_into().ok().map(u64::from_le_bytes)
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*first)
}

/// The bytes of the file at `path`, or only the first if it is not sealed.
pub fn bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    let bytes = input::open(path).and_then(|mut file| {
        let length = file.metadata()?.len();
        let mut bytes = Vec::new();
        // A foreign file is not read to its end if the length does not match.
        (&file).take(BEFORE as u64).read_to_end(&mut bytes)?;
        let stated = stated_length(&bytes).and_then(|length| length.checked_add((BEFORE + AFTER) as u64));
        if stated == Some(length) {
            // Nor into memory, if the checksum is wrong.
            check_whole(&mut file, length)?;
            file.rewind()?;
            bytes.clear();
            file.take(length).read_to_end(&mut bytes)?;
        }
        Ok(bytes)
    });
    bytes.map_err(|e| Fault::Damaged(e.to_string()))
}

/// Checks piece by piece that the last of the `length` bytes are the checksum of those before them.
fn check_whole(file: &mut File, length: u64) -> io::Result<()> {
    if length > input::MAX_STATE {
        let (size, most) = (text::bytes(length), text::bytes(input::MAX_STATE));
        return Err(io::Error::other(format!("it has {size}; at most {most} are read")));
    }
    file.rewind()?;
    let (_, crc) = disk::checksum(&mut (&*file).take(length - AFTER as u64), 0)?;
    let mut last = [0; AFTER];
    file.read_exact(&mut last)?;
    if crc.to_le_bytes() == last { Ok(()) } else { Err(io::Error::other(WRONG_CHECKSUM)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYOUT: u32 = 0x1234_5678;

    fn sample() -> Vec<u8> {
        sealed_body(LAYOUT, "sample", &(7_u64, "text")).unwrap()
    }

    fn read(bytes: &[u8]) -> Result<(u64, &str), Fault> {
        opened(LAYOUT, bytes)
    }

    /// Corrects the length and checksum in `bytes`.
    fn sealed_again(mut bytes: Vec<u8>) -> Vec<u8> {
        bytes.truncate(bytes.len() - AFTER);
        let length = (bytes.len() - BEFORE) as u64;
        bytes[BEFORE - 8..BEFORE].copy_from_slice(&length.to_le_bytes());
        bytes.extend(crc32c::crc32c(&bytes).to_le_bytes());
        bytes
    }

    #[test]
    fn what_another_program_wrote_is_distinguished_from_damage() {
        assert_eq!(read(&sample()), Ok((7, "text")));
        let with = |at: usize, byte: u8| {
            let mut bytes = sample();
            bytes[at] = byte;
            read(&sealed_again(bytes)).unwrap_err()
        };
        assert_eq!(with(0, b'C'), Fault::Foreign("it is not a checkpoint of curvelax".into()));
        let older = Fault::Foreign("its format is 2, and that of this version is 4".into());
        assert_eq!(with(MAGIC.len(), 2), older);
        let Fault::Foreign(message) = with(BEFORE + 5, b'9') else { panic!("another version of the program") };
        assert!(message.starts_with("it is of curvelax 9."), "{message}");
        // Intact, but not a checkpoint.
        let cut = |length: usize| read(&sealed_again(sample()[..length].to_vec())).unwrap_err();
        let mut longer = sample();
        longer.push(0);
        assert_eq!(read(&sealed_again(longer)), Err(Fault::Damaged("there is more in it than a checkpoint".into())));
        assert!(matches!(cut(sample().len() - 2), Fault::Damaged(what) if what.starts_with("it cannot be read")));
        assert_eq!(cut(BEFORE + AFTER), Fault::Damaged("it has no layout".into()));
    }

    #[test]
    fn a_build_with_other_types_is_another_program() {
        let error = opened::<(u64, String)>(LAYOUT + 1, &sample()).unwrap_err();
        let own = curvelax_base::VERSION;
        let message = format!(
            "another build of curvelax {own} wrote it: its layout is 12345678, and that of this build is 12345679"
        );
        assert_eq!(error, Fault::Foreign(message));
    }
}
