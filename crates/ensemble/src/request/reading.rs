//! The spec as TOML: reading, writing, and messages about what is wrong in a file.

use std::{io::ErrorKind, path::Path};

use serde::{Deserialize, de::IgnoredAny};

use super::key::{OmittedKeys, Spec};
use curvelax_base::{
    error::{Error, Result, did_you_mean, echo_path, plainly, shortened},
    input,
};

impl Spec {
    /// Reads a spec file; absent keys have their defaults.
    ///
    /// The result is not yet [validated](Spec::validate): flags may still replace wrong values.
    pub fn read(path: &Path) -> Result<Spec> {
        let text = input::text(path, input::MAX_SPEC).map_err(|e| {
            let problem = match e.kind() {
                ErrorKind::NotFound => "it does not exist; check its name and the folder".into(),
                _ => e.to_string(),
            };
            Error::Request(format!("cannot read the spec {}: {problem}", echo_path(path)))
        })?;
        Spec::from_toml(&text).map_err(|message| Error::Request(format!("in the spec {}: {message}", echo_path(path))))
    }

    /// Parses the text of a spec file; absent keys have their defaults.
    ///
    /// ```
    /// use curvelax_ensemble::Spec;
    /// use curvelax_flow::flow::Flow;
    ///
    /// let spec = Spec::from_toml("flow = 'willmore'\ncurves = 8").unwrap();
    /// assert_eq!((spec.flow, spec.curves, spec.points), (Flow::Willmore.into(), 8, 100));
    /// assert!(Spec::from_toml("curvs = 8").unwrap_err().contains("did you mean `curves`?"));
    /// ```
    ///
    /// # Errors
    /// The message has toml's line and caret, and suggests the nearest valid spelling.
    pub fn from_toml(text: &str) -> Result<Spec, String> {
        // First, so that a large spec is in memory once. What is wrong is said below.
        let given = toml::from_str::<Given>(text).ok();
        let omitted = given.map_or(OmittedKeys::default(), |given| OmittedKeys {
            curves: given.curves.is_none(),
            amplitude: given.amplitude.is_none(),
        });
        let spec: Spec = toml::from_str(text).map_err(|e| format!("{}{}", in_words(&e), suggestion(e.message())))?;
        Ok(Spec { omitted, ..spec })
    }

    /// Returns the spec as TOML that [`Spec::from_toml`] reads back to the same spec.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::Failed(format!("cannot write the spec as TOML: {e}")))
    }
}

/// The same keys in a spec file.
#[derive(Deserialize)]
struct Given {
    curves: Option<IgnoredAny>,
    amplitude: Option<IgnoredAny>,
}

/// Lines longer than this are not shown with a caret.
const MAX_LINE: usize = 300;
/// Maximum characters of a message.
const MAX_SHOWN: usize = 1000;

/// What is wrong, with the line and a caret; for an overlong line, only where.
fn in_words(error: &toml::de::Error) -> String {
    let whole = error.to_string();
    let (whole, message) = (whole.trim_end(), error.message().trim_end());
    // The list of all keys is longer than what is wrong.
    let problem = match message.split_once(", expected one of ") {
        Some((problem, _)) if message.starts_with("unknown field") => problem,
        _ => message,
    };
    let problem = shortened(&plainly(problem), MAX_SHOWN);
    match whole.strip_suffix(message) {
        Some(shown) if shown.lines().all(|line| line.len() <= MAX_LINE) => format!("{shown}{problem}"),
        _ => format!("{}: {problem}", shortened(whole.lines().next().unwrap_or_default(), MAX_LINE)),
    }
}

/// Suggests the nearest of the names that serde lists after "unknown field `x`, expected one of `a`, `b`".
fn suggestion(message: &str) -> String {
    let mut names = quoted(message);
    match names.next() {
        Some("accurate") if message.starts_with("unknown field") => {
            "; --accurate is a flag: `curvelax run --accurate --print-spec` prints the keys that it stands for".into()
        }
        Some(word) if message.starts_with("unknown field") => match did_you_mean(word, names) {
            none if none.is_empty() => "; `curvelax run --print-spec` prints all keys".into(),
            near => near,
        },
        Some(word) if message.starts_with("unknown ") => did_you_mean(word, names),
        _ => String::new(),
    }
}

/// The parts of `text` between backticks.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_an_array_or_the_text_of_the_flag() {
        for text in ["snapshots = [0, 0.5]", "snapshots = '0,0.5'", "snapshots = '0, 0.5'"] {
            assert_eq!(Spec::from_toml(text).unwrap().snapshots, [0.0, 0.5], "{text}");
        }
        assert_eq!(Spec::from_toml("only = [3, 1]").unwrap().only, Some(vec![3, 1]));
        for text in ["snapshots = 1", "snapshots = '0,,1'", "snapshots = ['a']", "only = [1.5]", "only = [-1]"] {
            assert!(Spec::from_toml(text).is_err(), "{text}");
        }
    }

    #[test]
    fn the_error_for_an_overlong_line_has_its_place_only() {
        let long = "x".repeat(100_000);
        for (text, start) in [
            (format!("\nshape = '{long}'"), "TOML parse error at line 2, column 9: unknown shape `xxx"),
            (format!("{long} = 1"), "TOML parse error at line 1, column 1: unknown key `xxx"),
            (format!("a = {}", "[".repeat(100_000)), "TOML parse error at line 1, column 85: cannot recurse further"),
        ] {
            let message = Spec::from_toml(&text).unwrap_err();
            assert!(message.starts_with(start) && message.len() < 1200 && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn a_wrong_key_or_word_is_shown_in_its_line_with_the_nearest_spelling() {
        let message = Spec::from_toml("curves = 3\nomga = 1\n").unwrap_err();
        for part in ["line 2, column 1", "2 | omga = 1", "^^^^", "unknown key `omga`", "did you mean `omega`?"] {
            assert!(message.contains(part), "no {part:?} in: {message}");
        }
        assert!(!message.contains("`curves`"), "all keys are listed: {message}");
        for (text, remedy) in
            [("qqq = 1", "--print-spec` prints all keys"), ("accurate = true", "the keys that it stands")]
        {
            let message = Spec::from_toml(text).unwrap_err();
            assert!(message.contains(remedy) && !message.contains("did you mean"), "{message}");
        }
        let message = Spec::from_toml("order = 'colored'").unwrap_err();
        assert!(message.contains("unknown value `colored`"), "{message}");
        assert!(message.contains("did you mean `coloured`?"), "{message}");
    }
}
