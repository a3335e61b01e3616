//! A name in a folder: the path for the system, and the path for people.
//!
//! An open folder is accessed through its handle, not by its path: whatever is moved to that path meanwhile is not
//! touched. Safe Rust has no `openat`, but Linux names open folders: `/proc/self/fd/N/NAME`. Other systems use the
//! path.

use std::{
    fs::File,
    io,
    path::{Path, PathBuf},
    sync::Arc,
};

use curvelax_base::error::Error;

/// A file or folder.
#[derive(Clone, Debug)]
pub struct Place {
    at: PathBuf,
    shown: PathBuf,
    /// Open as long as a name in it is in use: the descriptor of a closed one would soon be reused.
    _folder: Option<Arc<File>>,
}

impl Place {
    /// Whatever has this path at the moment.
    pub fn named(path: &Path) -> Place {
        Place { at: path.into(), shown: path.into(), _folder: None }
    }

    /// The folder that was opened at `path`, wherever it is now; as [`Place::named`] if the system opens no folders.
    pub fn opened(path: &Path, folder: Option<&Arc<File>>) -> Place {
        match folder.and_then(|folder| Some((descriptor(folder)?, Arc::clone(folder)))) {
            Some((at, folder)) => Place { at, shown: path.into(), _folder: Some(folder) },
            None => Place::named(path),
        }
    }

    /// The place `name` in it.
    pub fn join(&self, name: impl AsRef<Path>) -> Place {
        Place { at: self.at.join(&name), shown: self.shown.join(&name), _folder: self._folder.clone() }
    }

    /// The path to use.
    pub fn at(&self) -> &Path {
        &self.at
    }

    /// The path for messages.
    pub fn shown(&self) -> &Path {
        &self.shown
    }

    /// Does the same as [`Error::io`].
    pub fn io(&self, action: &'static str) -> impl FnOnce(io::Error) -> Error + use<> {
        let path = self.shown.clone();
        move |source| Error::Io { action, path, source }
    }
}

/// The path of an open folder's handle, if the system has one.
#[cfg(target_os = "linux")]
fn descriptor(folder: &File) -> Option<PathBuf> {
    use std::os::fd::AsRawFd;
    let path = PathBuf::from(format!("/proc/self/fd/{}", folder.as_raw_fd()));
    // There is none if /proc is not mounted.
    lies_at(folder, &path).is_ok_and(|same| same).then_some(path)
}

#[cfg(not(target_os = "linux"))]
fn descriptor(_: &File) -> Option<PathBuf> {
    None
}

/// Whether `file` is the file at `path`; false if there is none.
#[cfg(unix)]
pub fn lies_at(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let id = |of: std::fs::Metadata| (of.dev(), of.ino());
    match std::fs::metadata(path) {
        Ok(there) => Ok(id(file.metadata()?) == id(there)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(e) => Err(e),
    }
}

/// Elsewhere, safe and stable Rust cannot identify a file; any file at this path must do.
#[cfg(not(unix))]
pub fn lies_at(_: &File, path: &Path) -> io::Result<bool> {
    path.try_exists()
}

#[cfg(all(test, target_os = "linux"))]
mod tests;
