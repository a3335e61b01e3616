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

/// Maximum characters of a word in a message. Longer ones are shortened, unless they are paths: commands in messages are
/// there to be copied.
const MAX_READABLE: usize = 200;
/// Characters that are left of a longer one.
const SHORT_WORD: usize = 60;

/// Shortens the words of `text` that are too long to read: it may quote a value of any length.
pub(crate) fn with_short_words(text: &str) -> String {
    let shorten = |word: &str| match word.len() > MAX_READABLE && !word.contains(['/', '\\']) {
        true => {
            let end: String = word.chars().rev().take_while(|c| !c.is_alphanumeric()).collect();
            let end: String = end.chars().rev().collect();
            format!("{} ({} characters){end}", shortened(word, SHORT_WORD), word.chars().count())
        }
        false => word.to_owned(),
    };
    text.split_inclusive(char::is_whitespace)
        .map(|part| {
            let word = part.trim_end_matches(char::is_whitespace);
            shorten(word) + &part[word.len()..]
        })
        .collect()
}

/// Says in the words of users what serde says in those of Rust: "invalid type: string "x", expected f64" becomes "the text
/// "x" where a number is expected". A message may go on with its place, " at line 3 column 5".
pub(crate) fn in_plain_words(message: &str) -> String {
    let keys = [
        ("unknown field `", "unknown key `"),
        ("unknown variant `", "unknown value `"),
        ("missing field `", "missing key `"),
    ];
    if let Some((rust, plain)) = keys.into_iter().find(|(rust, _)| message.starts_with(rust)) {
        return message.replacen(rust, plain, 1);
    }
    let kinds = ["invalid type: ", "invalid value: "];
    let parts = kinds.into_iter().find_map(|kind| message.strip_prefix(kind)?.rsplit_once(", expected "));
    let Some((found, rest)) = parts else { return message.to_owned() };
    let (wanted, place) = rest.find(" at line ").map_or((rest, ""), |at| rest.split_at(at));
    let number = |kind: &str| found.strip_prefix(kind).map(|text| text.split('`').nth(1).unwrap_or(text).to_owned());
    let found = match found {
        "sequence" => "a list".into(),
        "map" => "a table".into(),
        "null" | "unit value" | "Option value" => "nothing".into(),
        _ => ["integer ", "floating point ", "boolean "]
            .into_iter()
            .find_map(number)
            .unwrap_or_else(|| found.replacen("string ", "the text ", 1)),
    };
    let wanted = match wanted {
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number from 0",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a string" => "text in quotes",
        "a sequence" => "a list in brackets",
        "a map" => "a table",
        wanted if wanted.starts_with("struct ") => "a table",
        wanted if wanted.starts_with("tuple ") => "a list in brackets",
        wanted => wanted,
    };
    format!("{found} where {wanted} is expected{place}")
}

/// Joins a message of several lines, such as a tree of causes or a text with a caret under it, into one line.
pub(crate) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_are_shortened_and_paths_are_not() {
        let long = "z".repeat(10_000);
        let shown = with_short_words(&format!("error: --tau '{long}': no number;\n  a\t{long}"));
        let word = "z".repeat(59);
        let expected =
            format!("error: --tau '{word}... (10003 characters)': no number;\n  a\t{word}z... (10000 characters)");
        assert_eq!(shown, expected);
        let path = format!("curvelax resume /{long}/{long}  continues it\n");
        assert_eq!(with_short_words(&path), path);
        assert_eq!(with_short_words(""), "");
    }

    #[test]
    fn types_are_called_by_the_names_that_users_have_for_them() {
        for (rust, plain) in [
            ("invalid type: string \"x\", expected f64", "the text \"x\" where a number is expected"),
            ("invalid value: integer `-5`, expected u64", "-5 where a whole number from 0 is expected"),
            ("invalid type: integer `99` as i128, expected usize", "99 where a whole number from 0 is expected"),
            ("invalid type: floating point `1.5`, expected u32", "1.5 where a whole number from 0 is expected"),
            ("invalid type: sequence, expected a boolean", "a list where true or false is expected"),
            ("invalid type: map, expected a number or \"auto\"", "a table where a number or \"auto\" is expected"),
            (
                "invalid type: string \", expected u8\", expected a sequence at line 3 column 5",
                "the text \", expected u8\" where a list in brackets is expected at line 3 column 5",
            ),
            ("unknown field `a`, expected one of `b`, `c`", "unknown key `a`, expected one of `b`, `c`"),
            ("unknown variant `a`, expected `b`", "unknown value `a`, expected `b`"),
            ("missing field `a` at line 1 column 2", "missing key `a` at line 1 column 2"),
            ("duplicate key", "duplicate key"),
        ] {
            assert_eq!(in_plain_words(rust), plain);
        }
    }

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
