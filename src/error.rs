//! Errors: what, where, the numbers and the remedy, each with its exit code.

use std::path::{Path, PathBuf};

/// Everything that can end a command early.
///
/// The message is one line (a TOML error keeps its caret lines); `main` prints it after `error: `.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The request is wrong; nothing was started or written. Exit code 2.
    #[error("{0}")]
    Request(String),
    /// A file or folder could not be read or written. Exit code 1.
    #[error("{action} {}: {source}", path.display())]
    Io {
        /// The action attempted, for example `cannot write`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The device or its driver failed during a run. Exit code 1.
    #[error("{0}")]
    Device(String),
    /// A comparison or run ended badly, as reported in its table. Exit code 1.
    #[error("{0}")]
    Failed(String),
    /// The folder was removed or replaced while the command was writing there. Exit code 1.
    #[error("{0}")]
    Lost(String),
    /// The run is complete and its files are written, but they do not hold what was asked for. Exit code 3.
    #[error("{0}")]
    Strict(String),
    /// The run was stopped early, as requested. Exit code 75.
    #[error("{0}")]
    Stopped(String),
    /// The run was stopped early by Ctrl-C. Exit code 130.
    #[error("{0}")]
    Interrupted(String),
}

/// Result with the crate's [`Error`] by default.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// A wrong value of a key: `--KEY VALUE: PROBLEM; ALLOWED`.
    pub fn value(key: &str, value: impl std::fmt::Display, problem: &str, allowed: &str) -> Self {
        Error::Request(format!("--{key} {value}: {problem}; {allowed}"))
    }

    /// Wraps an I/O error, adding the action and the path.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
        let path = path.to_path_buf();
        move |source| Error::Io { action, path, source }
    }

    /// The exit code of the process.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Request(_) => 2,
            Error::Io { .. } | Error::Device(_) | Error::Failed(_) | Error::Lost(_) => 1,
            Error::Strict(_) => 3,
            Error::Stopped(_) => 75,
            Error::Interrupted(_) => 130,
        }
    }
}

/// Longer than any plausible word.
const MAX_WORD: usize = 64;

/// The candidate nearest to `word`, if it is near enough.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // The cost is the product of the lengths.
    if word.len() > MAX_WORD {
        return None;
    }
    candidates
        .into_iter()
        .map(|candidate| (likeness(word, candidate), candidate))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

/// The similarity of two words, 1 if they are equal. One slip, including two swapped letters, is near even in a word as
/// short as `tau`, where the Jaro-Winkler similarity is almost 0.
fn likeness(a: &str, b: &str) -> f64 {
    let one_slip = a.len().min(b.len()) >= 3 && strsim::osa_distance(a, b) == 1;
    strsim::jaro_winkler(a, b).max(if one_slip { 0.9 } else { 0.0 })
}

/// `" (did you mean `X`?)"` for the nearest candidate, or nothing.
pub fn did_you_mean<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    nearest(word, candidates).map_or(String::new(), |near| format!(" (did you mean `{near}`?)"))
}

/// Shortens `text` to about `most` characters and an ellipsis, and escapes its control characters.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    let (mut shown, mut length) = (String::new(), 0);
    for c in text.chars() {
        if length >= most {
            return shown + "...";
        }
        let before = shown.len();
        match c.is_control() {
            true => shown.extend(c.escape_debug()),
            false => shown.push(c),
        }
        length += if c.is_control() { shown.len() - before } else { 1 };
    }
    shown
}

/// Escapes control characters in `text` other than line breaks: it may quote a file, and a terminal would obey them.
pub(crate) fn without_controls(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\t' => shown.push(c),
            c if c.is_control() => shown.extend(c.escape_debug()),
            c => shown.push(c),
        }
    }
    shown
}

/// Joins a message of several lines, such as a tree of causes or a text with a caret under it, into one line.
pub(crate) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_spelling_is_found_if_there_is_one() {
        let keys = ["tau", "t-end", "seed", "sor", "max-sweeps"];
        for (word, meant) in [("tua", "tau"), ("t_end", "t-end"), ("sed", "seed"), ("max-sweep", "max-sweeps")] {
            assert_eq!(nearest(word, keys), Some(meant), "{word}");
        }
        for word in ["", "x", "colour"] {
            assert_eq!(nearest(word, keys), None, "{word}");
        }
    }
    #[test]
    fn no_likeness_is_sought_for_a_word_without_end() {
        // A search would take hours.
        let endless = "tau".repeat(10_000_000);
        assert_eq!(nearest(&endless, [format!("x{endless}").as_str()]), None);
        assert_eq!(nearest(&format!("{}s", "x".repeat(63)), ["x".repeat(63).as_str()]), Some("x".repeat(63).as_str()));
    }

    #[test]
    fn what_a_terminal_would_obey_is_shown_instead() {
        assert_eq!(without_controls("a\u{1b}[31m\n\tb\r\0ü"), "a\\u{1b}[31m\n\tb\\r\\0ü");
        assert_eq!(shortened("a\u{1b}bcd", 8), "a\\u{1b}b...");
        assert_eq!(shortened("\"a\"", 3), "\"a\"");
        assert_eq!(shortened("abc", 3), "abc");
    }
}
