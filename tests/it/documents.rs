//! The documents: flags and columns as in the program, a README of at most a thousand words that shows what the program
//! prints, and links that work.

use std::{
    collections::{BTreeMap, BTreeSet},
    env, fs,
    path::{Path, PathBuf},
};

use curvelax::{
    backend::gpu::shader::{Variant, workgroup_bytes},
    ensemble::{Spec, request::event::MAX_EVENTS},
    files::{TableRow, columns, names, truth_tables::TruthRow},
    results::{cells::EnsembleStatistics, tally::Tally},
    solver::{Blocks, Solver},
    truth::{ConvergenceRow, WorkRow},
};

use crate::common::command::program;

/// The pages with a generated part, and the marks around it.
const FLAGS: &str = "docs/flags.md";
const FILES: &str = "docs/files.md";
const BEGIN: &str = "<!-- Generated from the program: UPDATE_DOCS=1 cargo test --test it documents -->\n";
const END: &str = "<!-- The end of what is generated. -->\n";
const REMEDY: &str = "UPDATE_DOCS=1 cargo test --test it documents rewrites it";

/// The keys of a spec as the types of keywords.
const KEYS: &str = "python/curvelax/_keys.py";

const MAX_WORDS: usize = 1000;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The help of a command, or of the program.
fn help(command: Option<&str>) -> String {
    let output = program(root()).args(command).arg("--help").output().unwrap();
    assert!(output.status.success(), "{command:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// An entry of a help text: a flag, an argument or a command, with its description.
#[derive(Debug, PartialEq)]
struct Entry<'a> {
    heading: &'a str,
    name: &'a str,
    text: &'a str,
}

/// The entries of a help text up to its examples.
fn entries(help: &str) -> Vec<Entry<'_>> {
    let (mut heading, mut all) = ("", Vec::new());
    for line in help.lines().take_while(|line| *line != "Examples:") {
        match line.strip_suffix(':') {
            Some(title) if !line.starts_with(' ') => heading = title,
            _ => {
                if let Some((name, text)) = line.trim_start().split_once("  ").filter(|_| line.starts_with("  ")) {
                    all.push(Entry { heading, name, text: text.trim_start() });
                }
            }
        }
    }
    all
}

/// `text` without `[label: …]` at its end, and the content of that.
fn noted<'a>(text: &'a str, label: &str) -> (&'a str, Option<&'a str>) {
    let note = text.rsplit_once(&format!(" [{label}: ")).and_then(|(text, note)| Some((text, note.strip_suffix(']')?)));
    note.map_or((text, None), |(text, note)| (text, Some(note)))
}

/// Formats text as a cell of a table.
fn cell(text: &str) -> String {
    ["\\", "|", "<", "*", "["].iter().fold(text.to_owned(), |text, c| text.replace(c, &format!("\\{c}")))
}

/// A row of the table: the flag, its meaning with its possible values, its default.
fn row(entry: &Entry) -> String {
    let (text, values) = noted(entry.text, "possible values");
    let (text, default) = noted(text, "default");
    let how_many = if entry.name.contains(",...") { "Any" } else { "One" };
    let values = values.map_or(String::new(), |values| format!(". {how_many} of `{}`", values.replace(", ", "`, `")));
    format!("| `{}` | {}{values} | {} |\n", entry.name, cell(text), cell(default.unwrap_or_default()))
}

/// The tables of all commands.
fn flags() -> String {
    let program = help(None);
    let mut page = String::new();
    for command in entries(&program).iter().filter(|entry| entry.heading == "Commands" && entry.name != "help") {
        let help = help(Some(command.name));
        let usage = help.lines().find_map(|line| line.strip_prefix("Usage: ")).expect("usage");
        page += &format!("\n## curvelax {}\n\n{}.\n\n    {usage}\n", command.name, cell(command.text));
        let entries = entries(&help);
        let told: Vec<&Entry> = entries.iter().filter(|entry| entry.name != "-h, --help").collect();
        let mut heading = None;
        for entry in told {
            if heading != Some(entry.heading) {
                let title = if command.name == "run" { format!("\n### {}\n", entry.heading) } else { String::new() };
                // One table for a command with few flags.
                if command.name == "run" || heading.is_none() {
                    page += &format!("{title}\n| | | default |\n|---|---|---|\n");
                }
                heading = Some(entry.heading);
            }
            page += &row(entry);
        }
    }
    page
}

/// A table with a name, and the heading, type and meaning of each column.
fn table(name: &str, rows: &str, columns: impl Iterator<Item = [String; 3]>) -> String {
    let (mut columns, mut lines) = (columns.peekable(), String::new());
    while let Some([heading, holds, meaning]) = columns.next() {
        // Both ends of an interval share a line, if their meanings differ in this word only.
        let upper = meaning.replacen("lower end", "upper end", 1);
        let (headings, meaning) = match columns.next_if(|[_, _, next]| *next == upper && upper != meaning) {
            Some([end, ..]) => (format!("{heading}` `{end}"), meaning.replacen("lower end", "lower and upper end", 1)),
            None => (heading, meaning),
        };
        lines += &format!("| `{headings}` | {holds} | {} |\n", cell(&meaning));
    }
    format!("\n### {name}\n\nOne row per {rows}.\n\n| column | holds | meaning |\n|---|---|---|\n{lines}")
}

fn table_of<R: TableRow>(name: &str, rows: &str) -> String {
    let columns = R::COLUMNS.iter().map(|column| [column.name, column.holds, column.meaning].map(str::to_owned));
    table(name, rows, columns)
}

/// The columns of all tables.
fn columns() -> String {
    let mut spec = Spec::default();
    spec.sweep.set("amplitude=0.05,0.1".parse().unwrap());
    spec.event.push("convex = k_min >= 0".parse().unwrap());
    let cells = EnsembleStatistics::new(&spec, &mut Tally::default()).unwrap();
    let drawn = Spec::from_toml("shape = 'ellipse:uniform(1.5..2.5),1'\nmodes = '2..=3'").unwrap();
    let of_run = |name: &str, rows: &str| {
        let spec = if name == names::MEMBERS { &drawn } else { &spec };
        table(name, rows, columns::columns(name, spec, &cells).unwrap().into_iter())
    };
    [
        of_run(names::SUMMARY, "member"),
        of_run(names::MEMBERS, "member; here with `--shape 'ellipse:uniform(1.5..2.5),1' --modes 2..=3`"),
        of_run(names::ENSEMBLE, "cell; here with `--sweep amplitude=0.05,0.1`"),
        of_run(names::EVENTS, "member and event, with `--event`"),
        of_run(names::EVENT_STATISTICS, "cell and event, with `--event`"),
        of_run(names::EXPLAINED, "cell, time and feature"),
        of_run(names::RATES, "member with a rate"),
        of_run(names::LEVELS, "member and level ([limit](method.md#limit))"),
        of_run(names::EVENT_LEVELS, "member, level and event, with `--event`"),
        of_run(names::MEAN_EXCESS, "cell and time"),
        of_run(names::SERIES, "member and time, with `--series`"),
        of_run(names::SNAPSHOTS, "member, time and node, with `--snapshots`"),
        table_of::<ConvergenceRow>(names::CONVERGENCE, "run of a problem, from `curvelax convergence --out`"),
        table_of::<TruthRow>(names::REFEREE, "time of a member, from `curvelax convergence --referee --out`"),
        table_of::<WorkRow>(names::WORK, "method, from `curvelax convergence --work-precision --out`"),
    ]
    .concat()
}

#[test]
fn the_page_of_files_has_the_columns_of_the_program() {
    let columns = columns();
    let ends = "| `t_relax_q05_low` `t_relax_q05_high` | float | t_relax: lower and upper end";
    let others = ["| `t_relax` | float | first time", "| `t_relax_median_low` | float |", "| `i` | integer |"];
    for line in others.into_iter().chain([ends]) {
        assert!(columns.contains(line), "{line} is not in the page: {columns}");
    }
    generated(FILES, &columns);
}

/// The type of a key in Python, by the name of its value in the help text.
fn python_type(value: &str, words: Option<&str>) -> String {
    if let Some(words) = words {
        return format!("Literal[\"{}\"]", words.replace(", ", "\", \""));
    }
    let own = match value {
        "COUNT" | "N" | "SEED" => "int",
        "" | "BOOL" => "bool",
        "B" | "FRACTION" | "EXCESS" | "SHARE" | "DT" | "X" => "float",
        "TAU" | "OMEGA" | "KAPPA" | "FACTOR" => "float | Literal[\"auto\"]",
        "TOL" => "float | bool",
        "T" => "float | Literal[\"auto\"] | Sequence[float]",
        "SIGMA" | "P" | "F" | "V" => "float | str | Any",
        "T1,T2,..." | "A,L" => "Sequence[float]",
        "J1,J2,..." => "Sequence[int]",
        "SHAPE" => "Any",
        "KEY=V1,V2,..." => "Mapping[str, Sequence[Any]]",
        "NAME=CONDITION" => "str | Sequence[str]",
        "FLOW" | "GAMMA" | "D" | "WHAT" | "LO..=HI" | "PROPERTY" | "NAME" | "LENGTH,TIME" | "I/N" => "str",
        other => panic!("a key has a value {other}, of which the type in Python is not known: name it here"),
    };
    own.to_owned()
}

/// The keys of a spec for editors and type checkers: one keyword for each flag of `run` up to `--out`.
fn python_keys() -> String {
    let help = help(Some("run"));
    let all = entries(&help);
    let keys = all.iter().take_while(|entry| !entry.name.starts_with("--out ")).filter(|e| e.name.starts_with("--"));
    let mut file = format!(
        "\"\"\"The keys of a spec as keywords of :func:`curvelax.run`, for editors and type checkers.\"\"\"\n\n\
         # {}\n\nfrom __future__ import annotations\n\nfrom collections.abc import Mapping, Sequence\n\
         from typing import Any, Literal, TypedDict\n\n\nclass Keys(TypedDict, total=False):\n    \
         \"\"\"What ``curvelax.run`` takes; flags of ``curvelax run`` with ``_`` for ``-``.\"\"\"\n",
        BEGIN.trim_start_matches("<!-- ").trim_end_matches(" -->\n")
    );
    for entry in keys {
        let (text, words) = noted(entry.text, "possible values");
        let (text, default) = noted(text, "default");
        let (name, value) = entry.name.split_once([' ', '[']).unwrap_or((entry.name, ""));
        let value = value.trim_matches(['[', ']', '=']).trim_start_matches('<').trim_end_matches('>');
        let kind = python_type(value, words);
        // The flag is given once for each event, the keyword has all of them.
        let names = if name == "--event" {
            vec!["event".to_owned(), "events".into()]
        } else {
            vec![name[2..].replace('-', "_")]
        };
        for name in names {
            let kind = if name == "events" { "Mapping[str, str]" } else { &kind };
            let default = default.map_or(String::new(), |default| format!(" By default {default}."));
            let text = format!("{text}.{default}").replace("--", "").replace('\\', "\\\\");
            file += &format!("\n    {name}: {kind}\n    {}\n", wrapped(&format!("\"\"\"{text}\"\"\""), "    "));
        }
    }
    file
}

/// `text` in lines of at most 118 columns, of which all but the first begin with `indent`.
fn wrapped(text: &str, indent: &str) -> String {
    let (mut lines, mut line) = (Vec::new(), String::new());
    for word in text.split(' ') {
        if !line.is_empty() && line.chars().count() + word.chars().count() + 1 + indent.len() > 118 {
            lines.push(std::mem::take(&mut line));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    lines.push(line);
    lines.join(&format!("\n{indent}"))
}

#[test]
fn the_keys_of_python_are_those_of_the_program() {
    let path = root().join(KEYS);
    let keys = python_keys();
    if env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&path, &keys).unwrap();
    }
    assert!(fs::read_to_string(&path).unwrap_or_default() == keys, "{KEYS} is not that of the program: {REMEDY}");
}

#[test]
fn the_page_of_flags_is_that_of_the_program() {
    let flags = flags();
    for flag in ["`--shape <SHAPE>`", "`--checkpoint-every <DURATION>`", "| `--missing` |", "## curvelax man\n"] {
        assert!(flags.contains(flag), "{flag} is not in the page: {flags}");
    }
    generated(FLAGS, &flags);
}

/// Checks that the generated part of a page is `text`, or rewrites it on request.
fn generated(page: &str, text: &str) {
    let path = root().join(page);
    let old = read(&path);
    let (head, rest) = old.split_once(BEGIN).expect("the beginning of the generated part");
    let (_, tail) = rest.split_once(END).expect("the end of the generated part");
    let new = format!("{head}{BEGIN}{text}\n{END}{tail}");
    if env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&path, new).unwrap();
    } else {
        assert!(old == new, "{page} differs from the program: {REMEDY}");
    }
}

/// Sentences of the pages with numbers that the program has as constants.
fn facts() -> Vec<(&'static str, String)> {
    let blocks = Blocks::new(100).unwrap();
    let bytes =
        [workgroup_bytes::<f32>, workgroup_bytes::<f64>].map(|of| of(blocks.count(), Variant::of(Solver::GaussSeidel)));
    vec![
        (FLAGS, format!("A spec has at most {MAX_EVENTS} events.")),
        ("shaders/README.md", format!("{} bytes in f32 and {} in f64 at n = 100", bytes[0], bytes[1])),
    ]
}

#[test]
fn numbers_in_the_pages_are_those_of_the_program() {
    for (page, fact) in facts() {
        let text = read(&root().join(page));
        assert!(text.split_whitespace().collect::<Vec<_>>().join(" ").contains(&fact), "{page} does not say: {fact}");
    }
}

#[test]
fn a_help_text_is_taken_apart() {
    let help = "Does it\n\nUsage: x [OPTIONS]\n\nMethod:\n      --a <B>  Text: a|b [default: 1] [possible values: c, d]\n  -h, \
                --help   Print help\n\nExamples:\n  x --a c  d\n";
    let found = entries(help);
    assert_eq!(found.len(), 2);
    assert_eq!(
        found[0],
        Entry { heading: "Method", name: "--a <B>", text: "Text: a|b [default: 1] [possible values: c, d]" }
    );
    assert_eq!(row(&found[0]), "| `--a <B>` | Text: a\\|b. One of `c`, `d` | 1 |\n");
}

#[test]
fn the_readme_has_at_most_a_thousand_words() {
    let words = read(&root().join("README.md")).split_whitespace().count();
    assert!(
        words <= MAX_WORDS,
        "README.md has {words} words, and may have {MAX_WORDS}: move what is too much to docs/"
    );
}

/// The commands of a page that run something, each with what it is said to print, but for what differs between
/// machines.
fn printed(page: &str) -> Vec<(&str, Vec<&str>)> {
    let mut runs: Vec<(&str, Vec<&str>)> = Vec::new();
    for line in page.lines().filter_map(|line| line.strip_prefix("    ")) {
        match line.strip_prefix("cargo run --release -- run ") {
            Some(arguments) => runs.push((arguments, Vec::new())),
            None if ["…", "ran on", "wall time", "results"].iter().any(|start| line.starts_with(start)) => {}
            None => runs.last_mut().into_iter().for_each(|(_, lines)| lines.push(line)),
        }
    }
    runs
}

#[test]
fn the_readme_shows_what_the_program_prints() {
    let page = read(&root().join("README.md"));
    let (begin, end) = (page.find("## Install").unwrap(), page.find("To study a parameter").unwrap());
    // What follows the command of the tests is not printed by a run.
    let page = page[begin..end].replace("\n    tests/run\n", "");
    let runs = printed(&page);
    assert_eq!(runs.iter().map(|(_, lines)| lines.len()).collect::<Vec<_>>(), [5, 1]);
    let folder = tempfile::tempdir().unwrap();
    for (arguments, lines) in runs {
        let output =
            program(folder.path()).arg("run").args(arguments.split(' ')).args(["--backend", "cpu"]).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        for line in lines {
            assert!(text.lines().any(|printed| printed == line), "{arguments} does not print\n{line}\nbut\n{text}");
        }
    }
}

/// The Markdown files that users read.
fn documents() -> BTreeSet<PathBuf> {
    let top = ["README.md", "CHANGELOG.md", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md", "SECURITY.md"];
    let mut all: BTreeSet<PathBuf> = top.map(PathBuf::from).into();
    let mut folders: Vec<PathBuf> =
        ["docs", "examples", "shaders", "benches", "tests", "web"].map(PathBuf::from).into();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root().join(&folder)).unwrap() {
            let entry = entry.unwrap();
            let path = folder.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                all.insert(path);
            }
        }
    }
    all
}

/// The text without code blocks and spans, in which brackets mean something else.
fn prose(text: &str) -> String {
    let (mut prose, mut fenced, mut blank) = (String::new(), false, true);
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !(fenced || blank && line.starts_with("    ")) {
            prose += line;
            prose.push('\n');
        }
        // Indented code begins after an empty line and continues while lines are indented.
        blank = line.is_empty() || blank && line.starts_with("    ");
    }
    prose.split('`').step_by(2).collect::<Vec<_>>().join("`")
}

/// Targets of the links and pictures in `prose`.
fn links(prose: &str) -> Vec<&str> {
    prose.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target).collect()
}

/// Targets after a `#`: headings as GitHub names them, and `<a id=…>`.
fn anchors(text: &str) -> BTreeSet<String> {
    let (mut all, mut seen) = (BTreeSet::new(), BTreeMap::<String, u32>::new());
    let mut fenced = false;
    for line in text.lines() {
        fenced ^= line.starts_with("```");
        let title = line.trim_start_matches('#');
        if !fenced && title.len() < line.len() && title.starts_with(' ') {
            let kept = title.trim().to_lowercase().replace(' ', "-");
            let kept: String = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_')).collect();
            let times = seen.entry(kept.clone()).or_default();
            all.insert(if *times == 0 { kept } else { format!("{kept}-{times}") });
            *times += 1;
        }
    }
    all.extend(text.split("<a id=\"").skip(1).filter_map(|rest| Some(rest.split_once('"')?.0.to_owned())));
    all
}

/// Broken links of `text`; `at` finds a file by its path relative to that of the text.
fn broken(text: &str, at: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let outside = |target: &str| ["https://", "http://", "mailto:"].iter().any(|scheme| target.starts_with(scheme));
    let leads = |target: &str| {
        let (file, anchor) = target.split_once('#').map_or((target, None), |(file, anchor)| (file, Some(anchor)));
        let there = if file.is_empty() { Some(text.to_owned()) } else { at(file) };
        there.is_some_and(|there| anchor.is_none_or(|anchor| anchors(&there).contains(anchor)))
    };
    let prose = prose(text);
    links(&prose).into_iter().filter(|target| !outside(target) && !leads(target)).map(str::to_owned).collect()
}

#[test]
fn every_link_leads_somewhere() {
    let (mut count, mut wrong) = (0, Vec::new());
    for document in documents() {
        let path = root().join(&document);
        let text = read(&path);
        let folder = path.parent().unwrap();
        let at = |file: &str| match folder.join(file) {
            found if found.is_file() => Some(fs::read_to_string(found).unwrap_or_default()),
            found => found.is_dir().then(String::new),
        };
        count += links(&prose(&text)).len();
        wrong.extend(broken(&text, at).iter().map(|link| format!("{}: {link}", document.display())));
    }
    assert!(count >= 80, "{count} links");
    assert!(wrong.is_empty(), "links that lead nowhere:\n{}", wrong.join("\n"));
}

/// The paths between backticks, without those with a name to fill in.
fn paths(text: &str) -> BTreeSet<&str> {
    let is_path = |word: &&str| {
        let mut characters = word.chars();
        word.contains('/') && characters.all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c))
    };
    let to_fill_in = |word: &&str| word.contains("NAME") || word.contains("MODULE");
    let built = |word: &&str| word.starts_with("target/");
    text.split('`').skip(1).step_by(2).filter(is_path).filter(|word| !to_fill_in(word) && !built(word)).collect()
}

#[test]
fn the_recipes_name_files_that_exist_and_every_crate() {
    let text = read(&root().join("CONTRIBUTING.md"));
    // The recipe of a solver names the lists in tests by their last folders.
    let missing = |path: &&str| !root().join(path).exists() && !root().join("tests").join(path).exists();
    let paths = paths(&text);
    assert_eq!(paths.iter().copied().filter(|path| missing(path)).collect::<Vec<_>>(), [""; 0]);
    assert!(missing(&"crates/flow/src/none.rs") && paths.len() > 50, "{paths:?}");
    for entry in fs::read_dir(root().join("crates")).unwrap() {
        let path = format!("crates/{}", entry.unwrap().file_name().to_string_lossy());
        assert!(paths.contains(&*path), "CONTRIBUTING.md does not say what {path} is");
    }
}

/// The decisions without an anchor, and those that the index at the top does not name.
fn unlisted(text: &str) -> Vec<&str> {
    let (index, decisions) = text.split_once("\n## Numerics\n").expect("the first section of decisions");
    let (decisions, _) = decisions.split_once("\n## Dependencies\n").expect("the last section");
    let listed = |line: &str| {
        let anchor = line.strip_prefix("<a id=\"").and_then(|rest| rest.strip_suffix("\"></a>"));
        anchor.is_some_and(|anchor| index.contains(&format!("](#{anchor})")))
    };
    let paragraphs = decisions.split("\n\n").map(|paragraph| paragraph.trim_start().lines().next().unwrap_or_default());
    paragraphs.filter(|line| !line.is_empty() && !line.starts_with("## ") && !listed(line)).collect()
}

#[test]
fn the_index_of_decisions_names_all_of_them() {
    let text = read(&root().join("docs/internals/decisions.md"));
    assert_eq!(unlisted(&text), [""; 0]);
    assert!(text.matches("<a id=\"").count() > 100);
    // A decision that is not listed is found, and one without an anchor.
    let other = "[1](#one)\n\n## Numerics\n\n<a id=\"one\"></a>\n**1.** a\n\n<a id=\"two\"></a>\n**2.** b\n\n**3.** c\n\n## Dependencies\n";
    assert_eq!(unlisted(other), ["<a id=\"two\"></a>", "**3.** c"]);
}

#[test]
fn a_link_that_leads_nowhere_is_found() {
    let text = "# A title, `b`\n<a id=\"c\"></a>\n[1](#a-title-b) [2](#c) [3](there.md#d) [4](#e) `[5](#f)` [6](gone.md)\n\n    \
                [7](#g)\n\n```\n[8](#h)\n```\n[9](there.md#i) ![10](there.md) [11](https://x.y#z)\n# A title, b\n[12](#a-title-b-1)";
    let at = |file: &str| (file == "there.md").then(|| "## D".to_owned());
    assert_eq!(broken(text, at), ["#e", "gone.md", "there.md#i"]);
}
