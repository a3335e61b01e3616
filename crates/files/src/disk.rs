//! Operations on the file system: files that are not links, checksums, durable names.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
};

use super::{names::is_store, place::Place};
use curvelax_base::{
    error::{Error, Result},
    guard::guarded,
};

/// A file in every folder of a store.
pub const IS_STORE: &str = "zarr.json";

/// The contents of a folder, in no order. A listing panics if the system cannot close the folder; the entries read are
/// still valid.
pub fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut listing = fs::read_dir(folder)?;
    let paths = listing.by_ref().map(|entry| Ok(entry?.path())).collect();
    let _ = guarded(|| drop(listing));
    paths
}

/// Creates the file. An existing one is removed, not written into, as it may be a link to elsewhere.
pub fn create(path: &Path) -> io::Result<File> {
    remove(path)?;
    File::create_new(path)
}

/// Removes the folder of a store with its contents; it may be absent. The file that marks it as a store goes last, so
/// that the remains after a kill are still recognised.
pub fn remove_store(path: &Path) -> io::Result<()> {
    if path.is_symlink() {
        return fs::remove_file(path);
    }
    let entries = match entries(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        if entry.symlink_metadata()?.is_dir() {
            fs::remove_dir_all(entry)?;
        } else if !entry.ends_with(IS_STORE) {
            fs::remove_file(entry)?;
        }
    }
    remove(&path.join(IS_STORE))?;
    fs::remove_dir(path)
}

/// Removes a file, which may be absent.
pub fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        // Also if its folder is absent.
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// Whether a folder exists at `path` and is not a link.
pub fn is_real_folder(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|of| of.is_dir())
}

/// Removes a file, or the folder of a store; either may be absent.
pub fn remove_any(path: &Path) -> io::Result<()> {
    match is_store(path) {
        true => remove_store(path),
        false => remove(path),
    }
}

/// Reads `file` to its end; returns the number of bytes and their CRC-32C, continued from `crc`.
pub fn checksum(file: &mut impl Read, mut crc: u32) -> io::Result<(u64, u32)> {
    let mut length = 0;
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok((length, crc)),
            Ok(count) => {
                length += count as u64;
                crc = crc32c::crc32c_append(crc, &buffer[..count]);
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}

/// Number of names (hard links) of the file.
#[cfg(unix)]
pub fn names_of(file: &File) -> io::Result<u64> {
    use std::os::unix::fs::MetadataExt;
    Ok(file.metadata()?.nlink())
}

/// Not available elsewhere in safe and stable Rust; making a copy is always right.
#[cfg(not(unix))]
pub fn names_of(_: &File) -> io::Result<u64> {
    Ok(2)
}

/// Whether a run may have left the folder of a store.
pub fn is_own_store(path: &Path) -> bool {
    let empty = || entries(path).is_ok_and(|entries| entries.is_empty());
    !path.is_symlink() && (path.join(IS_STORE).is_file() || empty())
}

/// Makes a rename durable.
pub fn sync_parent(place: &Place) -> Result<()> {
    sync_names(parent(place.at())).map_err(Error::io("cannot write to", parent(place.shown())))
}

/// Makes the names of the entries of a folder durable.
pub fn sync_folder(place: &Place) -> Result<()> {
    sync_names(place.at()).map_err(place.io("cannot write to"))
}

/// Does the same for a path; only Unix can sync a folder.
pub fn sync_names(folder: &Path) -> io::Result<()> {
    match cfg!(unix) {
        true => File::open(folder).and_then(|folder| folder.sync_all()),
        false => Ok(()),
    }
}

/// The folder that contains `path`.
pub fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        Some(_) => Path::new("."),
        None => path,
    }
}
