//! Chromium or Chrome: the program named by `CURVELAX_BROWSER`, or the first in the path that shows a page.

use std::{
    env,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::OnceLock,
};

use tempfile::TempDir;

const NAMES: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];
/// What the page of the probe says once its script has run.
const MARK: &str = "curvelax-7919";

/// The browser of this machine, or why there is none; it is tried when somebody asks for the first time.
pub fn browser() -> Result<&'static Path, &'static str> {
    static FOUND: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    FOUND.get_or_init(find).as_deref().map_err(String::as_str)
}

fn find() -> Result<PathBuf, String> {
    let there = candidates();
    if there.is_empty() {
        return Err("there is no Chromium (Debian: apt-get install chromium); CURVELAX_BROWSER names another".into());
    }
    let names: Vec<String> = there.iter().map(|path| path.display().to_string()).collect();
    // One from a snap has folders of its own in the place of /tmp.
    let shows = there.into_iter().find(|browser| shows_a_page(browser));
    shows.ok_or_else(|| format!("no page in {} is shown by {}", env::temp_dir().display(), names.join(", ")))
}

fn candidates() -> Vec<PathBuf> {
    if let Some(named) = env::var_os("CURVELAX_BROWSER") {
        return vec![named.into()];
    }
    let folders: Vec<PathBuf> = env::split_paths(&env::var_os("PATH").unwrap_or_default()).collect();
    let all = NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    all.filter(|path| path.is_file()).collect()
}

fn shows_a_page(browser: &Path) -> bool {
    let (number, home) = (MARK.split_once('-').unwrap().1, tempfile::tempdir().unwrap());
    let page = home.path().join("page.html");
    let script = format!("document.body.textContent = 'curvelax-' + ({number} + 1 - 1)");
    fs::write(&page, format!("<!doctype html><meta charset=\"utf-8\"><body><script>{script}</script>")).unwrap();
    let (mut command, _profile) = headless(browser);
    command.args(["--disable-gpu", "--dump-dom"]).arg(format!("file://{}", page.display())).stderr(Stdio::null());
    command.output().is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains(MARK))
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
    // Neither a slow software GPU nor a page that has to wait for a processor hangs.
    command.args(["--disable-gpu-watchdog", "--disable-hang-monitor"]);
    command.args(["--enable-logging=stderr", "--v=0"]);
    (command, profile)
}
