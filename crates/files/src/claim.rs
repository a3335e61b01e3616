//! A folder into which one command at a time writes.
//!
//! Two locks ensure this. The lock on the folder itself cannot be removed or replaced while it is held. The lock on the
//! file `.curvelax.lock` is for file systems that lock files only; there the file must not be replaced. Both end with
//! their process.

use std::{
    fs::{File, TryLockError},
    io,
    path::Path,
    sync::Arc,
};

use super::{
    disk::remove,
    place::{Place, lies_at},
};
use curvelax_base::{
    error::{Error, Result},
    input,
};

/// Locked while a run writes. Only the lock counts, which ends with its process, not the file.
pub const LOCK: &str = ".curvelax.lock";

/// A folder that this process holds; released when dropped.
#[derive(Debug)]
pub struct Claim {
    /// Where it was found, and the folder that was opened there.
    place: Place,
    /// That folder; nothing if the system opens no folders.
    folder: Option<Arc<File>>,
    /// Whether the folder itself is locked.
    whole: bool,
    lock: File,
}

impl Claim {
    /// Claims the folder at `path`; none if another process holds it.
    pub fn take(path: &Path) -> io::Result<Option<Claim>> {
        loop {
            let folder = if cfg!(unix) { Some(Arc::new(File::open(path)?)) } else { None };
            let whole = match folder.as_ref().map(|folder| folder.try_lock()) {
                Some(Err(TryLockError::WouldBlock)) => return Ok(None),
                Some(Ok(())) => true,
                Some(Err(TryLockError::Error(_))) | None => false,
            };
            let place = Place::opened(path, folder.as_ref());
            let lock = lock(&place).map_err(|e| io::Error::new(e.kind(), format!("{LOCK}: {e}")))?;
            let Some(lock) = lock else { return Ok(None) };
            let claim = Claim { place, folder, whole, lock };
            // The previous holder may have removed the folder or the file after they were opened here.
            if claim.is_there()? && claim.has_its_file()? {
                return Ok(Some(claim));
            }
        }
    }

    /// The folder.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// Uses the absolute path from now on.
    pub fn make_absolute(&mut self) -> Result<()> {
        let path = std::path::absolute(self.place.shown()).map_err(self.place.io("cannot find"))?;
        self.place = Place::opened(&path, self.folder.as_ref());
        Ok(())
    }

    /// Checks that the folder is still held, and still where it was found.
    ///
    /// # Errors
    /// [`Error::Lost`] if it is not.
    pub fn check(&self) -> Result<()> {
        let path = self.place.shown().display();
        let held = || if self.whole { Ok(true) } else { self.has_its_file() };
        match self.is_there().and_then(|there| Ok((there, held()?))) {
            Err(e) => Err(self.place.io("cannot find")(e)),
            Ok((true, true)) => Ok(()),
            Ok((false, _)) => Err(Error::Lost(format!(
                "{path}: the folder was moved, removed or replaced during the run, and what is there now was not \
                 touched; the checkpoint went with the old one, where curvelax resume continues"
            ))),
            Ok((true, false)) => Err(Error::Lost(format!(
                "{path}: its lock {LOCK} was removed or replaced during the run, so another run may be writing \
                 there; curvelax resume continues from the last checkpoint"
            ))),
        }
    }

    /// Whether the folder that is held is the one at its path.
    pub fn is_there(&self) -> io::Result<bool> {
        self.folder.as_ref().map_or(Ok(true), |folder| lies_at(folder, self.place.shown()))
    }

    fn has_its_file(&self) -> io::Result<bool> {
        lies_at(&self.lock, self.place.join(LOCK).at())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Removed while locked: after unlocking it could already be another run's.
        if self.has_its_file().unwrap_or(false) {
            let _ = remove(self.place.join(LOCK).at());
        }
        // Closing would not do: a program that this process is starting has copies of both until it runs.
        for held in self.folder.as_deref().into_iter().chain([&self.lock]) {
            let _ = held.unlock();
        }
    }
}

/// Locks the file in `folder`, creating it if needed; none if another process holds it.
fn lock(folder: &Place) -> io::Result<Option<File>> {
    let path = folder.join(LOCK);
    if path.at().is_symlink() {
        remove(path.at())?;
    }
    let file = input::open_as(path.at(), File::options().write(true).create(true).truncate(false))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(e)) if !has_no_locks(&e) => Err(e),
        _ => Ok(Some(file)),
    }
}

/// Whether another process holds the folder at `path` or is writing there.
pub fn is_held(path: &Path) -> bool {
    let locked =
        |file: io::Result<File>| file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)));
    locked(input::open(&path.join(LOCK))) || (cfg!(unix) && locked(File::open(path)))
}

/// Whether the file system reports that it has no locks, which does not prevent a run: NFS without its lock daemon
/// calls that `ENOLCK`.
fn has_no_locks(error: &io::Error) -> bool {
    const ENOLCK: i32 = if cfg!(target_os = "linux") { 37 } else { 77 };
    error.kind() == io::ErrorKind::Unsupported || (cfg!(unix) && error.raw_os_error() == Some(ENOLCK))
}

#[cfg(all(test, unix))]
mod tests;
