//! A full disk, and files that may not grow.

use std::{
    path::Path,
    process::{Command, Stdio},
};

use crate::{
    Found, Outcome,
    calls::must_be_a_decent_end,
    command::script,
    program::Running,
    study::{Attempt, Study},
};

/// A small disk in memory; unmounted when dropped.
pub struct Disk<'a> {
    at: &'a Path,
}

impl<'a> Disk<'a> {
    /// Needs root, and a container that allows mounting.
    pub fn mount(at: &'a Path, options: &str) -> Option<Disk<'a>> {
        mount(&["-t", "tmpfs", "-o", options, "tmpfs", at.to_str()?]).then_some(Disk { at })
    }

    pub fn remount(&self, options: &str) -> bool {
        mount(&["-o", &format!("remount,{options}"), self.at.to_str().unwrap()])
    }
}

impl Drop for Disk<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.at).stderr(Stdio::null()).status();
    }
}

fn mount(arguments: &[&str]) -> bool {
    Command::new("mount").args(arguments).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

pub fn can_mount() -> bool {
    let home = tempfile::TempDir::new().unwrap();
    Disk::mount(home.path(), "size=64k").is_some()
}

/// Disks from far too small to almost large enough.
pub fn small_disks(study: &Study, sizes: &[usize]) -> Outcome {
    let mut failed = 0;
    for kib in sizes {
        let attempt = Attempt::new(study);
        let disk = Disk::mount(attempt.home.path(), &format!("size={kib}k")).ok_or("cannot mount")?;
        let ended = attempt.start().end();
        let code = must_be_a_decent_end(&ended, &format!("a disk of {kib} KiB: {ended:?}"));
        failed += usize::from(code != 0);
        let still = attempt.resume().end();
        must_be_a_decent_end(&still, &format!("resumed on a disk of {kib} KiB: {still:?}"));
        assert!(disk.remount("size=64m"));
        attempt.must_end_well(still);
    }
    assert!(failed > sizes.len() / 2, "{failed} of {} were too small", sizes.len());
    Found::new(sizes.len(), format!("0 differing bytes; {failed} too small"))
}

/// Files limited to a number of blocks, with the signal of the limit ignored or not.
pub fn limited_files(study: &Study, limits: &[usize]) -> Outcome {
    let mut failed = 0;
    for blocks in limits {
        for trap in ["trap '' XFSZ; ", ""] {
            let attempt = Attempt::new(study);
            let limited = format!("{trap}ulimit -f {blocks}; exec \"$0\" {}", attempt.run());
            let ended = Running::start(&mut script("sh", attempt.home.path(), &limited)).end();
            match trap.is_empty() {
                true => assert!(matches!((ended.code, ended.signal), (Some(0..=2), _) | (_, Some(25))), "{ended:?}"),
                false => drop(must_be_a_decent_end(&ended, &format!("at most {blocks} blocks: {ended:?}"))),
            }
            failed += usize::from(ended.code != Some(0));
            attempt.must_end_well(ended);
        }
    }
    assert!(failed > limits.len(), "{failed}");
    Found::new(2 * limits.len(), format!("0 differing bytes; {failed} hit the limit"))
}
