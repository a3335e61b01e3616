//! The checkpoint in a folder, the one before it, and the outlines that belong to both.

use std::{
    fs,
    io::{self, Write},
    path::Path,
};

use super::OutputFolder;
use crate::{
    disk::{create, remove, sync_folder},
    names::{OUTLINES, STATE, STATE_OLD, STATE_PART},
};
use curvelax_base::error::Result;

impl OutputFolder {
    /// Saves a checkpoint; the last one becomes the previous one.
    pub fn keep_state(&self, bytes: &[u8]) -> Result<()> {
        self.check_claim()?;
        let [state, old, part] = [STATE, STATE_OLD, STATE_PART].map(|name| self.place(name));
        let renamed = write(part.at(), bytes).and_then(|()| {
            if state.at().exists() {
                fs::rename(state.at(), old.at())?;
            }
            fs::rename(part.at(), state.at())
        });
        renamed.map_err(|e| {
            let _ = remove(part.at());
            state.io("cannot write")(e)
        })?;
        sync_folder(&self.place)
    }

    /// Saves the outlines of the run, before its first checkpoint.
    pub fn keep_outlines(&self, bytes: &[u8]) -> Result<()> {
        self.check_claim()?;
        let outlines = self.place(OUTLINES);
        write(outlines.at(), bytes).map_err(outlines.io("cannot write"))
    }

    /// Removes a damaged last checkpoint, lest it become the previous one.
    pub fn forget_last_state(&self) -> Result<()> {
        self.remove_own(STATE)
    }

    /// Removes the checkpoints, the older one first: alone it would resume with files that already have their final
    /// names. The outlines are needed until there is none.
    pub fn forget_states(&self) -> Result<()> {
        [STATE_PART, STATE_OLD, STATE, OUTLINES].into_iter().try_for_each(|name| self.remove_own(name))
    }
}

/// Writes a file anew, and returns once it is on disk.
fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::folder::tests::names;

    fn state_of(folder: &OutputFolder) -> Vec<String> {
        let text = |name| fs::read_to_string(folder.path().join(name)).ok();
        [STATE, STATE_OLD].into_iter().filter_map(text).collect()
    }

    #[test]
    fn two_states_are_kept_and_forgotten_together() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        for (bytes, kept) in [("1", &["1"][..]), ("2", &["2", "1"]), ("3", &["3", "2"])] {
            folder.keep_state(bytes.as_bytes()).unwrap();
            assert_eq!(state_of(&folder), kept);
        }
        // The last one is damaged: the previous one stays until a new one is complete.
        folder.forget_last_state().unwrap();
        folder.keep_state(b"4").unwrap();
        assert_eq!(state_of(&folder), ["4", "2"]);
        let error = OutputFolder::open(home.path(), false).unwrap_err().to_string();
        assert!(
            error.contains("a run was begun here and has not finished; if it is not running, curvelax resume ")
                && error.contains("--force"),
            "{error}"
        );
        folder.keep_outlines(b"outlines").unwrap();
        folder.forget_states().unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [""; 0]);
        let error = OutputFolder::open_again(home.path()).unwrap_err().to_string();
        assert!(error.contains("no run was started here"), "{error}");
        assert_eq!(names(home.path()), [""; 0], "it is left as it was");
    }
}
