//! What is released: names of archives, versions and addresses agree, the paper has the form that JOSS asks for, and
//! the site has every page.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use toml::Table;

const WORKFLOW: &str = ".github/workflows/release.yml";

/// Files that name the address of the repository or the version.
const WITH_ADDRESS: [&str; 10] = [
    "Cargo.toml",
    "python/README.md",
    "CITATION.cff",
    "CODE_OF_CONDUCT.md",
    "SECURITY.md",
    "CONTRIBUTING.md",
    "Containerfile",
    "book.toml",
    ".github/ISSUE_TEMPLATE/config.yml",
    "README.md",
];

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// The package of the program, with what it shares with the other crates.
fn package() -> Table {
    let manifest: Table = read("Cargo.toml").parse().unwrap();
    let mut package = manifest["package"].as_table().unwrap().clone();
    let shared = manifest["workspace"]["package"].as_table().unwrap().clone();
    package.extend(shared);
    package
}

fn field<'a>(table: &'a Table, key: &str) -> &'a str {
    table[key].as_str().unwrap_or_else(|| panic!("{key}"))
}

/// The value after `key` in a line of a text.
fn after<'a>(text: &'a str, key: &str) -> &'a str {
    let line = text.lines().find_map(|line| line.trim_start().strip_prefix(key)).unwrap_or_else(|| panic!("{key}"));
    line.trim().trim_matches('"')
}

/// The targets of the matrix of the workflow.
fn targets(workflow: &str) -> BTreeSet<&str> {
    let lines = workflow.lines().filter_map(|line| line.trim_start().strip_prefix("- { target: "));
    lines.filter_map(|line| line.split([',', ' ']).next()).collect()
}

/// The name that the script gives to the archive of a target.
fn packed(script: &str, target: &str, version: &str) -> String {
    let name = after(script, "name=").replace("$version", version).replace("$target", target);
    let windows = target.contains("-windows-");
    let suffix = script
        .lines()
        .filter_map(|line| line.trim_start().strip_prefix("archive=$PWD/target/archives/$name"))
        .find(|suffix| suffix.ends_with("zip") == windows)
        .expect("the suffix of the archive");
    name + suffix
}

#[test]
fn binstall_finds_every_archive_of_the_workflow() {
    let (package, workflow, script) = (package(), read(WORKFLOW), read(".github/pack"));
    let (version, repository) = (field(&package, "version"), field(&package, "repository"));
    let binstall = package["metadata"]["binstall"].as_table().unwrap();
    let overrides = binstall["overrides"].as_table().unwrap();
    let targets = targets(&workflow);
    assert!(targets.len() >= 7, "{targets:?}");
    for target in &targets {
        let own = overrides.get(*target).and_then(|own| own.as_table()).unwrap_or(binstall);
        let pairs =
            [("{ repo }", repository), ("{ name }", "curvelax"), ("{ version }", version), ("{ target }", target)];
        let url = pairs.iter().fold(field(own, "pkg-url").to_owned(), |url, (key, value)| url.replace(key, value));
        let expected = format!("{repository}/releases/download/v{version}/{}", packed(&script, target, version));
        assert_eq!(url, expected);
        assert_eq!(field(own, "pkg-fmt"), if url.ends_with(".zip") { "zip" } else { "tgz" });
    }
    assert!(overrides.keys().all(|target| targets.contains(target.as_str())), "an override without an archive");
    assert_eq!(field(binstall, "bin-dir"), "{ name }-{ version }-{ target }/{ bin }{ binary-ext }");
}

#[test]
fn versions_and_addresses_agree() {
    let package = package();
    let (version, repository) = (field(&package, "version"), field(&package, "repository"));
    assert_eq!(after(&read("CITATION.cff"), "version:"), version);
    assert_eq!(after(&read("Containerfile"), "ARG VERSION="), version);
    assert_eq!(after(&read("python/Cargo.toml"), "version ="), version);
    let changelog = read("CHANGELOG.md");
    let newest = after(&changelog, "## ");
    assert!(newest.starts_with(version), "CHANGELOG.md begins with {newest}");
    let mut named = 0;
    for file in WITH_ADDRESS {
        for rest in read(file).split("https://github.com/").skip(1) {
            let address: String =
                rest.chars().take_while(|c| c.is_alphanumeric() || matches!(c, '/' | '-' | '_')).collect();
            let address: Vec<&str> = address.split('/').take(2).collect();
            assert_eq!(format!("https://github.com/{}", address.join("/")), repository, "{file}");
            named += 1;
        }
    }
    assert!(named >= 8, "{named} addresses");
    let least = field(&package, "rust-version");
    for file in ["README.md", "CONTRIBUTING.md"] {
        assert!(read(file).contains(&format!("[Rust](https://rustup.rs) {least} or later")), "{file}: Rust {least}");
    }
}

/// The keys of citations, `@Key`, outside the front matter.
fn cited(paper: &str) -> BTreeSet<String> {
    let key = |rest: &str| rest.chars().take_while(char::is_ascii_alphanumeric).collect();
    paper.split('@').skip(1).map(key).collect()
}

/// The keys of entries.
fn entries(bibliography: &str) -> BTreeSet<String> {
    let keys = bibliography.lines().filter_map(|line| line.strip_prefix('@')?.split_once('{'));
    keys.map(|(_, key)| key.trim_end_matches(',').to_owned()).collect()
}

/// What a paper lacks of the form that JOSS asks for.
fn lacks(paper: &str, bibliography: &str) -> Vec<String> {
    let mut lacks = Vec::new();
    let (matter, body) = paper.strip_prefix("---\n").and_then(|rest| rest.split_once("\n---\n")).unwrap_or_default();
    for key in ["title:", "tags:", "authors:", "affiliations:", "date:", "bibliography:"] {
        if !matter.lines().any(|line| line.starts_with(key)) {
            lacks.push(format!("{key} in the front matter"));
        }
    }
    for heading in [
        "# Summary",
        "# Statement of need",
        "# State of the field",
        "# Software design",
        "# Research impact statement",
        "# AI usage disclosure",
        "# References",
    ] {
        if !body.lines().any(|line| line == heading) {
            lacks.push(format!("heading {heading}"));
        }
    }
    let words = body.split_whitespace().count();
    if !(750..=1750).contains(&words) {
        lacks.push(format!("750 to 1750 words: it has {words}"));
    }
    let (cited, entries) = (cited(body), entries(bibliography));
    lacks.extend(cited.difference(&entries).map(|key| format!("entry of {key}")));
    lacks.extend(entries.difference(&cited).map(|key| format!("citation of {key}")));
    lacks
}

#[test]
fn the_paper_has_the_form_that_joss_asks_for() {
    let (paper, bibliography) = (read("paper/paper.md"), read("paper/paper.bib"));
    assert_eq!(lacks(&paper, &bibliography), Vec::<String>::new());
    assert!(entries(&bibliography).len() >= 5);
    // What is missing is found.
    let shorter = paper.replace("# State of the field", "# State").replace("[@Mullins1957]", "[@Nobody2000]");
    let found = lacks(&shorter, &bibliography);
    assert_eq!(found, ["heading # State of the field", "entry of Nobody2000", "citation of Mullins1957"]);
}

#[test]
fn the_site_has_every_page() {
    let summary = read("docs/SUMMARY.md");
    let links = summary.split("](").skip(1).filter_map(|rest| Some(PathBuf::from(rest.split_once(')')?.0)));
    let links: BTreeSet<PathBuf> = links.collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let pages_in = |within: &str| {
        let names = fs::read_dir(folder.join(within)).unwrap().map(|entry| entry.unwrap().file_name());
        let pages = names.map(|name| Path::new(within).join(name));
        pages.filter(|page| page.extension().is_some_and(|extension| extension == "md")).collect::<Vec<_>>()
    };
    let pages = [pages_in(""), pages_in("internals")].concat();
    assert!(pages.len() >= 20, "{pages:?}");
    for page in pages.iter().filter(|page| page.as_path() != Path::new("SUMMARY.md")) {
        assert!(links.contains(page), "docs/SUMMARY.md does not name {}", page.display());
    }
    for page in ["../README.md", "../examples/README.md", "../CONTRIBUTING.md"] {
        assert!(links.contains(Path::new(page)), "docs/SUMMARY.md does not name {page}");
    }
}
