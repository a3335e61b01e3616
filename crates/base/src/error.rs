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
        let value = shortened(&value.to_string(), MAX_VALUE);
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
pub fn shortened(text: &str, most: usize) -> String {
    let (mut shown, mut length) = (String::new(), 0);
    for c in text.chars() {
        if length >= most {
            return shown + "...";
        }
        let one = escaped(c);
        length += one.chars().count();
        shown += &one;
    }
    shown
}

/// A character as it is shown: control characters are escaped.
fn escaped(c: char) -> String {
    if c.is_control() { c.escape_debug().to_string() } else { c.into() }
}

/// Escapes control characters in `text` other than line breaks: it may quote a file, and a terminal would obey them.
pub fn without_controls(text: &str) -> String {
    text.chars().map(|c| if matches!(c, '\n' | '\t') { c.into() } else { escaped(c) }).collect()
}

/// Maximum characters of a value that is all of a flag; it may be a path.
pub const MAX_VALUE: usize = 200;
/// Maximum characters of a value that a message echoes.
const ECHOED: usize = 60;

/// A value as a message echoes it: of a long one the beginning, without what a terminal would obey.
pub fn echo(value: impl std::fmt::Display) -> String {
    shortened(&value.to_string(), ECHOED)
}

/// Characters of a path that a message echoes at its beginning and at its end.
const ECHOED_ENDS: (usize, usize) = (60, 140);

/// A path as a message echoes it: of a long one the beginning and the end, which has the name of the file.
pub fn echo_path(path: &Path) -> String {
    ends(&path.display().to_string())
}

/// The beginning and the end of a long text.
fn ends(text: &str) -> String {
    let (start, end) = ECHOED_ENDS;
    match text.char_indices().nth_back(end - 1) {
        Some((at, _)) if text.chars().count() > start + end => {
            format!("{}{}", shortened(text, start), shortened(&text[at..], 2 * end))
        }
        // Escaped, each character may be several.
        _ => shortened(text, 2 * (start + end)),
    }
}

/// A message without words of endless length, such as the path of a folder from a wrong variable of a shell.
pub fn with_short_words(message: &str) -> String {
    let most = 2 * (ECHOED_ENDS.0 + ECHOED_ENDS.1);
    if message.len() <= most {
        return message.to_owned();
    }
    let words = message.split_inclusive(char::is_whitespace);
    words.map(|word| if word.len() > most { ends(word) } else { word.to_owned() }).collect()
}

/// What a reader of TOML or JSON says is wrong, in words that do not take Rust, its values shortened. The names of
/// types are those of serde: `invalid type: string "x", expected f64` becomes `expected a number, found the text "x"`.
pub fn plainly(message: &str) -> String {
    // JSON ends with the place, which TOML puts before.
    let (what, place) = match message.rfind(" at line ") {
        Some(at) => message.split_at(at),
        None => (message, ""),
    };
    let invalid = ["invalid type: ", "invalid value: ", "invalid length "].iter().find_map(|start| {
        // What is found may hold the same words, what is expected does not.
        what.strip_prefix(start)?.rsplit_once(", expected ")
    });
    let plain = match (invalid, what) {
        (Some((found, wanted)), _) => {
            let remedy = wanted_otherwise(found, wanted).map_or(String::new(), |remedy| format!("; {remedy}"));
            format!("expected {}, found {}{remedy}", in_words(wanted), found_in_words(found))
        }
        (None, "wanted string or table") => "expected a word in quotes".into(),
        (None, what) if what.starts_with("data did not match any variant") => {
            "expected a number, a text, or true or false".into()
        }
        (None, what) => with_short_quotes(&without_types(what)),
    };
    plain + place
}

/// What was expected according to [`plainly`], without what was found.
pub fn expected_of(message: &str) -> String {
    let plain = plainly(message);
    match plain.split_once(", found ") {
        Some((expected, _)) if plain.starts_with("expected ") => expected.to_owned(),
        _ => plain,
    }
}

/// What serde expects, in words.
fn in_words(wanted: &str) -> String {
    let words = match wanted {
        "f64" | "f32" => "a number",
        "u64" | "usize" => "a whole number from 0",
        "u32" => "a whole number from 0 to 4294967295",
        "u16" => "a whole number from 0 to 65535",
        "u8" => "a whole number from 0 to 255",
        "i64" | "i32" | "i16" | "i8" | "isize" => "a whole number",
        "a boolean" => "true or false",
        "a string" | "a borrowed string" | "str" | "string" => "a text in quotes",
        "a character" => "one letter in quotes",
        "a sequence" => "a list in brackets",
        "any value" | "any valid TOML value" | "any valid JSON value" => "a number, a text, or true or false",
        "unit" | "null" => "nothing",
        "a map" | "map" => "a table of keys and values",
        own if own.starts_with("struct ") => "a table of keys and values",
        own => {
            let sized = ["a tuple of size ", "an array of length "].iter().find_map(|start| own.strip_prefix(start));
            return sized.map_or(own.to_owned(), |size| format!("a list of {size}"));
        }
    };
    words.to_owned()
}

/// What serde found, in words.
fn found_in_words(found: &str) -> String {
    let inside = |start: &str| found.strip_prefix(start).and_then(|rest| rest.split('`').next()).map(echo);
    match found {
        "map" => return "a table".into(),
        "sequence" => return "a list".into(),
        "null" | "unit value" | "Option value" => return "nothing".into(),
        _ => {}
    }
    if let Some(text) = found.strip_prefix("string ") {
        let text = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text);
        return format!("the text \"{}\"", echo(text));
    }
    let number = inside("integer `").or_else(|| inside("floating point `"));
    number.map(|number| format!("the number {number}")).or_else(|| inside("boolean `")).unwrap_or_else(|| echo(found))
}

/// How to write what was found so that it is as wanted, if this is only a matter of quotes or brackets.
fn wanted_otherwise(found: &str, wanted: &str) -> Option<String> {
    let text = found.strip_prefix("string \"").and_then(|text| text.strip_suffix('"'));
    match (wanted, text) {
        ("a sequence", _) if !["map", "null", "unit value"].contains(&found) => {
            Some("put it in brackets: [...]".into())
        }
        ("a boolean", Some("true" | "false")) => Some("leave the quotes out".into()),
        ("f64" | "f32" | "u64" | "usize" | "u32", Some(text)) if text.trim().parse::<f64>().is_ok() => {
            Some("leave the quotes out".into())
        }
        _ => None,
    }
}

/// What serde and the readers of JSON call fields, variants and the like, in words.
fn without_types(what: &str) -> String {
    const WORDS: [(&str, &str); 7] = [
        ("unknown variant ", "unknown value "),
        ("unknown field ", "unknown key "),
        ("duplicate field ", "the key is there twice: "),
        ("EOF while parsing", "it ends inside"),
        ("recursion limit exceeded", "lists or tables nested too deeply"),
        ("expected value", "expected a value"),
        ("invalid number", "not a number"),
    ];
    if let Some(key) = what.strip_prefix("missing field ") {
        return format!("the key {key} is missing");
    }
    let known = WORDS.iter().find_map(|(start, plain)| Some(format!("{plain}{}", what.strip_prefix(start)?)));
    known.unwrap_or_else(|| what.to_owned())
}

/// Shortens what stands between backticks.
fn with_short_quotes(text: &str) -> String {
    let parts = text.split('`').enumerate();
    let parts = parts.map(|(i, part)| if i % 2 == 1 { echo(part) } else { part.to_owned() });
    parts.collect::<Vec<_>>().join("`")
}

/// Joins a message of several lines, such as a tree of causes or a text with a caret under it, into one line.
pub fn one_line(text: &str) -> String {
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
    fn no_similar_name_is_suggested_for_an_overlong_word() {
        // A search would take hours.
        let endless = "tau".repeat(10_000_000);
        assert_eq!(nearest(&endless, [format!("x{endless}").as_str()]), None);
        assert_eq!(nearest(&format!("{}s", "x".repeat(63)), ["x".repeat(63).as_str()]), Some("x".repeat(63).as_str()));
    }

    #[test]
    fn a_long_path_is_echoed_by_its_ends() {
        let short = "folder/".repeat(20) + "file.csv";
        assert_eq!(echo_path(Path::new(&short)), short);
        let long = echo_path(Path::new(&("folder/".repeat(2000) + "file.csv")));
        assert!(long.starts_with("folder/folder/") && long.contains("...") && long.ends_with("/file.csv"), "{long}");
        assert_eq!(long.chars().count(), 203);
    }

    #[test]
    fn errors_of_serde_are_shown_without_types_of_rust() {
        for (said, told) in [
            ("invalid type: string \"x\", expected f64", "expected a number, found the text \"x\""),
            (
                "invalid type: string \"1.5\", expected f64",
                "expected a number, found the text \"1.5\"; leave the quotes out",
            ),
            ("invalid value: integer `-1`, expected u64", "expected a whole number from 0, found the number -1"),
            (
                "invalid type: floating point `1.5`, expected u64",
                "expected a whole number from 0, found the number 1.5",
            ),
            (
                "invalid type: integer `99999999999999999999` as i128, expected usize",
                "expected a whole number from 0, found the number 99999999999999999999",
            ),
            ("invalid type: integer `1`, expected a boolean", "expected true or false, found the number 1"),
            ("invalid type: boolean `true`, expected a string", "expected a text in quotes, found true"),
            (
                "invalid type: string \"x\", expected a sequence",
                "expected a list in brackets, found the text \"x\"; put it in brackets: [...]",
            ),
            (
                "invalid type: null, expected struct Provenance at line 1 column 4",
                "expected a table of keys and values, found nothing at line 1 column 4",
            ),
            ("invalid type: map, expected a number or \"auto\"", "expected a number or \"auto\", found a table"),
            ("wanted string or table", "expected a word in quotes"),
            ("data did not match any variant of untagged enum Read", "expected a number, a text, or true or false"),
            ("missing field `points` at line 3 column 1", "the key `points` is missing at line 3 column 1"),
            ("unknown variant `x`, expected `a` or `b`", "unknown value `x`, expected `a` or `b`"),
            ("unknown field `x`, expected `a` or `b`", "unknown key `x`, expected `a` or `b`"),
            ("EOF while parsing an object at line 1 column 9", "it ends inside an object at line 1 column 9"),
        ] {
            assert_eq!(plainly(said), told);
        }
        let long = "x".repeat(10_000);
        for said in [
            format!("invalid type: string \"{long}\", expected f64"),
            format!("unknown field `{long}`, expected `tau`"),
            format!("invalid type: integer `{}`, expected f64", "9".repeat(10_000)),
        ] {
            assert!(plainly(&said).len() < 200, "{}", plainly(&said));
        }
        let said = "invalid type: string \"abc\", expected f64";
        assert_eq!(expected_of(said), "expected a number");
        assert_eq!(expected_of("unknown shape `abc`"), "unknown shape `abc`");
    }

    #[test]
    fn what_a_terminal_would_obey_is_shown_instead() {
        assert_eq!(without_controls("a\u{1b}[31m\n\tb\r\0ü"), "a\\u{1b}[31m\n\tb\\r\\0ü");
        assert_eq!(shortened("a\u{1b}bcd", 8), "a\\u{1b}b...");
        assert_eq!(shortened("\"a\"", 3), "\"a\"");
        assert_eq!(shortened("abc", 3), "abc");
    }
}
