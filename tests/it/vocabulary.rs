//! One word for one thing: the words that the vocabulary of the decisions rules out are in no name and in no text. And
//! text that fits a screen.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Where the words are, and this file, which is about them.
const DECISIONS: &str = "docs/internals/decisions.md";
const OWN: &str = "tests/it/vocabulary.rs";
/// Folders with names and text of this project.
const FOLDERS: [&str; 10] =
    ["src", "crates", "shaders", "python", "web", "docs", "tests", "examples", "benches", "fuzz/targets"];
const EXTENSIONS: [&str; 8] = ["rs", "wgsl", "py", "pyi", "js", "css", "html", "md"];
/// Built or foreign files.
const SKIPPED: [&str; 5] = ["target", "node_modules", "data", "corpus", ".venv"];
/// Constants that still have names of their own: where the scheme and its kernel use them.
const KEPT: [&str; 3] = ["MOST_WAVES", "MOST_ORDER", "LEAST_ORDER"];
/// Where comments still have the words of the last lines of the table.
const UNREVISED: [&str; 2] = ["crates/flow/src/scheme/", "shaders/"];

const MAX_COLUMNS: usize = 120;

/// A word that is used nowhere: some words in a row, or the beginning of constants.
#[derive(Debug, PartialEq)]
enum Banned {
    Words(Vec<String>),
    Prefix(String),
}

/// The words between backticks in the last column of the table.
fn banned(page: &str) -> Vec<Banned> {
    let table = page.split("## Vocabulary").nth(1).expect("a section").split("\n## ").next().unwrap();
    let columns = table.lines().filter_map(|line| line.strip_suffix(" |")?.rsplit_once(" | "));
    let words = columns.flat_map(|(_, last)| last.split('`').skip(1).step_by(2));
    words
        .map(|word| match word.strip_suffix('…') {
            Some(prefix) => Banned::Prefix(prefix.to_owned()),
            None => Banned::Words(word.split(' ').map(str::to_owned).collect()),
        })
        .collect()
}

/// The words of a line in lower case, with those of names in snake and camel case.
fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    for token in line.split(|c: char| !c.is_alphanumeric()) {
        let (mut word, mut was_lower) = (String::new(), false);
        for c in token.chars() {
            if c.is_uppercase() && was_lower {
                words.push(std::mem::take(&mut word));
            }
            was_lower = c.is_lowercase();
            word.extend(c.to_lowercase());
        }
        if !word.is_empty() {
            words.push(word);
        }
    }
    words
}

/// Whether the line has the word.
fn has(line: &str, banned: &Banned) -> bool {
    match banned {
        Banned::Words(row) => words(line).windows(row.len()).any(|some| some == row),
        Banned::Prefix(prefix) => {
            let names = line.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            names.filter(|name| !KEPT.contains(name)).any(|name| name.starts_with(prefix))
        }
    }
}

/// What a file with this name and text has of the words, a line each.
fn faults(name: &str, text: &str, all: &[Banned]) -> Vec<String> {
    let lines = [(0, name)].into_iter().chain((1..).zip(text.lines()));
    let of_line = |(number, line): (usize, &str)| -> Vec<String> {
        let own = all.iter().filter(|banned| has(line, banned));
        own.map(|banned| format!("{name}:{number}: {banned:?}")).collect()
    };
    lines.flat_map(of_line).collect()
}

/// All files below a folder that have text of this project.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if path.is_dir() {
            if !SKIPPED.contains(&&*name) {
                files(&path, found);
            }
        } else if path.extension().is_some_and(|extension| EXTENSIONS.iter().any(|known| extension == *known)) {
            found.push(path);
        }
    }
}

/// Name and text of all files with text of this project.
fn texts() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    FOLDERS.iter().for_each(|folder| files(&root.join(folder), &mut found));
    let read = fs::read_dir(root).unwrap().flatten().map(|entry| entry.path());
    found.extend(read.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    assert!(found.len() > 300, "{}", found.len());
    found.sort();
    let name = |path: &Path| path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
    found.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

/// The numbers of the lines of prose that are too wide: comments of code, and text of documents that is no table, code
/// or heading.
fn wide(name: &str, text: &str) -> Vec<usize> {
    let mut is_code = false;
    let mut is_wide = |line: &str| {
        is_code ^= line.trim_start().starts_with("```");
        let prose = match name.rsplit_once('.').map(|(_, extension)| extension) {
            Some("md") => !is_code && !["|", "#", "    ", "<", "["].iter().any(|mark| line.starts_with(mark)),
            Some("rs" | "wgsl") => line.trim_start().strip_prefix("//").is_some_and(|text| !text.contains(" | ")),
            _ => false,
        };
        prose && line.chars().count() > MAX_COLUMNS
    };
    (1..).zip(text.lines()).filter(|(_, line)| is_wide(line)).map(|(number, _)| number).collect()
}

#[test]
fn comments_and_documents_keep_to_120_columns() {
    let of = |(name, text): (String, String)| wide(&name, &text).into_iter().map(move |line| format!("{name}:{line}"));
    let found: Vec<String> = texts().into_iter().flat_map(of).collect();
    assert_eq!(found, [""; 0]);
}

#[test]
fn a_wide_line_of_prose_is_found_and_a_wide_table_is_not() {
    let long = "word ".repeat(30);
    let rows = ["", "| ", "# ", "    "].map(|start| format!("{start}{long}"));
    assert_eq!(wide("a.md", &format!("{}\n```\n{long}\n```\n", rows.join("\n"))), [1]);
    assert_eq!(wide("a.rs", &format!("/// {long}\nlet text = \"{long}\";\n// {long}\n// | a | {long}")), [1, 3]);
    assert_eq!(wide("a.md", &"ä".repeat(120)), [0; 0], "characters, not bytes");
}

#[test]
fn no_name_and_no_text_has_a_word_that_the_vocabulary_rules_out() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(DECISIONS)).unwrap();
    let all = banned(&page);
    let mut wrong = Vec::new();
    for (name, text) in texts() {
        let text = match &*name {
            OWN => String::new(),
            // The table itself.
            DECISIONS => {
                text.lines().map(|line| if line.starts_with('|') { "" } else { line }).collect::<Vec<_>>().join("\n")
            }
            _ => text,
        };
        let is_unrevised = UNREVISED.iter().any(|folder| name.starts_with(folder));
        let later = |fault: &String| is_unrevised && (fault.contains("nobody") || fault.contains("\"ever\""));
        wrong.extend(faults(&name, &text, &all).into_iter().filter(|fault| !later(fault)));
    }
    assert_eq!(wrong, [""; 0], "{DECISIONS} has the word to use instead");
}

#[test]
fn a_word_that_is_ruled_out_is_found_in_names_and_in_text() {
    let page = "# Page\n## Vocabulary\n\n| word | meaning | not |\n|---|---|---|\n| resume | to continue | `go on`, keep |\n\
                | bound | in names | `MOST_…` |\n| request | what is wanted | `wish` |\n\n## Next\n\n| a | b | `c` |\n";
    let all = banned(page);
    let row = |words: &[&str]| Banned::Words(words.iter().map(|word| word.to_string()).collect());
    assert_eq!(all, [row(&["go", "on"]), Banned::Prefix("MOST_".into()), row(&["wish"])]);
    let found = |name: &str, text: &str| faults(name, text, &all).len();
    for (name, text) in [
        ("src/a.rs", "enum Wish {}"),
        ("src/a.rs", "fn next_wish() {}"),
        ("src/a.rs", "let wishOfSink = 1;"),
        ("src/a.rs", "// Runs go on."),
        ("src/a.rs", "fn runs_go_on() {}"),
        ("src/a.rs", "const MOST_NODES: u32 = 1;"),
        ("src/wish.rs", ""),
        ("docs/a.md", "What you wish"),
    ] {
        assert_eq!(found(name, text), 1, "{name}: {text}");
    }
    let clean = "The wishes of a goon; most nodes keep on. MOST_WAVES, AT_MOST_ONE, let along = on_go;";
    assert_eq!(found("src/keep.rs", clean), 0);
}
