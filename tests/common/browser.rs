//! Chromium or Chrome: the program named by `CURVELAX_BROWSER`, or the first in the path.

use std::{
    env,
    ffi::OsString,
    path::{Path, PathBuf},
    process::Command,
};

use tempfile::TempDir;

const NAMES: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];

/// The browser of this machine.
pub fn browser() -> Option<PathBuf> {
    let named = env::var_os("CURVELAX_BROWSER").map(PathBuf::from);
    let folders: Vec<PathBuf> = env::split_paths(&env::var_os("PATH").unwrap_or_default()).collect();
    named.or_else(|| {
        NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|p| p.is_file())
    })
}

/// The command that opens a page without a window and without a network, with its console on stderr; and its profile.
pub fn headless(browser: &Path) -> (Command, TempDir) {
    let profile = tempfile::tempdir().unwrap();
    let mut user_data = OsString::from("--user-data-dir=");
    user_data.push(profile.path());
    let mut command = Command::new(browser);
    command.arg(user_data).arg("--host-resolver-rules=MAP * ~NOTFOUND");
    // The sandbox needs rights that containers do not give; the page is our own.
    command.args(["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run"]);
    command.args(["--enable-logging=stderr", "--v=0"]);
    (command, profile)
}
