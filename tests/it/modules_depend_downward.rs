//! Modules depend downward only: Cargo keeps the order of the crates, this test that of the modules inside. No folder
//! or file uses one above it in [`LAYERS`], and no files form a circle of uses. Tests inside the files may use
//! anything. Type names are unique across the crates.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

use syn::{
    Attribute, Item, ItemMod, ItemUse, UseTree,
    visit::{self, Visit},
};

/// Crates and modules; each may use only those above it. A name stands for what has no longer one; `program` for `src`.
const LAYERS: [&str; 50] = [
    "shaders",
    "base/error",
    "base/guard",
    "base/threads",
    "base/text",
    "base/input",
    "base/gamma",
    "base/random",
    "base",
    "flow/number",
    "flow/crystal",
    "flow/equilibrium",
    "flow/flow",
    "flow/forcing",
    "flow/solver",
    "flow/scheme",
    "flow",
    "vectors",
    "vectors-f32",
    "vectors-f64",
    "backend",
    "gpu",
    "curve",
    "statistics",
    "ensemble/request",
    "ensemble/theory",
    "ensemble/member",
    "ensemble/outcome",
    "ensemble/study",
    "ensemble/schedule",
    "ensemble/trajectory",
    "ensemble/simulate",
    "ensemble",
    "study/conformance",
    "study/placement",
    "study/relax",
    "study/truth",
    "study/results",
    "study/samples",
    "study/accuracy",
    "study",
    "files",
    "draw",
    "paper",
    "run/report",
    "run/session",
    "run/estimate",
    "run/figures",
    "run",
    "program",
];

type Module = Vec<String>;

/// Paths that a file names outside its tests, from the root of the crate; re-exports separately, by the name that they
/// get.
#[derive(Default)]
struct Names {
    module: Module,
    used: Vec<Module>,
    exported: BTreeMap<String, Module>,
}

fn is_of_tests(attributes: &[Attribute]) -> bool {
    let words = |a: &Attribute| match &a.meta {
        syn::Meta::List(list) if list.path.is_ident("cfg") => list.tokens.to_string(),
        _ => String::new(),
    };
    attributes.iter().any(|a| words(a).split(|c: char| !c.is_alphanumeric()).any(|word| word == "test"))
}

impl Names {
    /// The path from the root of the crate; none for a path into another crate, unless it is that of a sibling module
    /// of this file's.
    fn absolute(&self, path: &[String]) -> Option<Module> {
        let mut base = self.module.clone();
        match path.first()?.as_str() {
            "crate" => Some([&base[..1], &path[1..]].concat()),
            other if other.starts_with("curvelax_") => {
                Some([&[other["curvelax_".len()..].to_owned()], &path[1..]].concat())
            }
            "self" => Some([&base[..], &path[1..]].concat()),
            "super" => {
                let up = path.iter().take_while(|part| *part == "super").count();
                base.truncate(base.len().saturating_sub(up));
                Some([&base[..], &path[up..]].concat())
            }
            _ => Some([&base[..], path].concat()),
        }
    }

    fn tree(&mut self, tree: &UseTree, before: &[String], public: bool) {
        let mut path = before.to_vec();
        let (name, last) = match tree {
            UseTree::Path(part) => {
                path.push(part.ident.to_string());
                return self.tree(&part.tree, &path, public);
            }
            UseTree::Group(group) => return group.items.iter().for_each(|item| self.tree(item, &path, public)),
            UseTree::Name(name) => (name.ident.to_string(), Some(name.ident.to_string())),
            UseTree::Rename(new) => (new.rename.to_string(), Some(new.ident.to_string())),
            UseTree::Glob(_) => (String::new(), None),
        };
        path.extend(last.filter(|last| last != "self"));
        let Some(path) = self.absolute(&path) else { return };
        match public {
            true => drop(self.exported.insert(name, path)),
            false => self.used.push(path),
        }
    }
}

impl<'a> Visit<'a> for Names {
    fn visit_item(&mut self, item: &'a Item) {
        let attributes = match item {
            Item::Mod(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            Item::Fn(item) => &item.attrs,
            Item::Impl(item) => &item.attrs,
            _ => return visit::visit_item(self, item),
        };
        if !is_of_tests(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'a ItemMod) {
        self.module.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'a ItemUse) {
        self.tree(&item.tree, &[], !matches!(item.vis, syn::Visibility::Inherited));
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        let parts: Vec<String> = path.segments.iter().map(|part| part.ident.to_string()).collect();
        let is_ours = ["crate", "super", "self"].contains(&parts[0].as_str()) || parts[0].starts_with("curvelax_");
        if parts.len() > 1 && is_ours {
            self.used.extend(self.absolute(&parts));
        }
        visit::visit_path(self, path);
    }
}

/// All files by their crates and modules.
fn sources() -> BTreeMap<Module, String> {
    fn walk(folder: &Path, module: &Module, all: &mut BTreeMap<Module, String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
            let child = [&module[..], std::slice::from_ref(&stem)].concat();
            if path.is_dir() {
                walk(&path, &child, all);
            } else if path.extension().is_some_and(|extension| extension == "rs") && stem != "main" {
                let module = if ["mod", "lib"].contains(&stem.as_str()) { module.clone() } else { child };
                all.insert(module, fs::read_to_string(&path).unwrap());
            }
        }
    }
    let mut all = BTreeMap::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    walk(&root.join("src"), &vec!["program".to_owned()], &mut all);
    for entry in fs::read_dir(root.join("crates")).unwrap() {
        let path = entry.unwrap().path();
        walk(&path.join("src"), &vec![path.file_name().unwrap().to_string_lossy().into_owned()], &mut all);
    }
    all.insert(vec!["shaders".to_owned()], fs::read_to_string(root.join("shaders/lib.rs")).unwrap());
    // Files that are modules of tests only.
    let of_tests = |module: &Module| module.iter().any(|part| part == "tests");
    all.retain(|module, _| !of_tests(module));
    all
}

/// Which file uses which others, with re-exports resolved.
fn arrows(sources: &BTreeMap<Module, String>) -> BTreeMap<Module, BTreeSet<Module>> {
    let names: BTreeMap<&Module, Names> = sources
        .iter()
        .map(|(module, text)| {
            let mut names = Names { module: module.clone(), ..Names::default() };
            names.visit_file(&syn::parse_file(text).unwrap());
            (module, names)
        })
        .collect();
    let leads_to = |path: &Module| {
        let mut path = path.clone();
        // Chains of re-exports are short.
        for _ in 0..8 {
            let known = (1..=path.len()).rev().find(|length| sources.contains_key(&path[..*length]))?;
            let module = path[..known].to_vec();
            let exported = path.get(known).and_then(|name| names[&module].exported.get(name));
            match exported {
                Some(other) if sources.contains_key(&other[..1]) => path = [&other[..], &path[known + 1..]].concat(),
                _ => return Some(module),
            }
        }
        None
    };
    let uses = |(module, names): (&&Module, &Names)| {
        let others = names.used.iter().filter_map(leads_to).filter(|other| other != *module).collect();
        ((*module).clone(), others)
    };
    names.iter().map(uses).collect()
}

/// Violations of the rule, one per line.
fn faults(sources: &BTreeMap<Module, String>) -> Vec<String> {
    let arrows = arrows(sources);
    let layer = |module: &Module| {
        let name = |length: usize| module[..length].join("/");
        (1..=module.len()).rev().find_map(|length| LAYERS.iter().position(|layer| *layer == name(length)))
    };
    let mut faults = Vec::new();
    for (from, others) in &arrows {
        let shown = from.join("/");
        let Some(own) = layer(from) else {
            faults.push(format!("{shown} is in no layer"));
            continue;
        };
        let upward = others.iter().filter(|to| layer(to).is_none_or(|other| other > own));
        faults.extend(upward.map(|to| format!("{shown} uses {}, which is above it", to.join("/"))));
    }
    // Files that use none of the rest are removed; the remainder is in a circle or above one.
    let mut rest = arrows;
    loop {
        let done: Vec<Module> = rest
            .iter()
            .filter(|(_, others)| !others.iter().any(|to| rest.contains_key(to)))
            .map(|(m, _)| m.clone())
            .collect();
        if done.is_empty() {
            break;
        }
        done.iter().for_each(|module| drop(rest.remove(module)));
    }
    loop {
        let used: BTreeSet<Module> = rest.values().flatten().cloned().collect();
        let above: Vec<Module> = rest.keys().filter(|module| !used.contains(*module)).cloned().collect();
        if above.is_empty() {
            break;
        }
        above.iter().for_each(|module| drop(rest.remove(module)));
    }
    if !rest.is_empty() {
        let names: Vec<String> = rest.keys().map(|module| module.join("/")).collect();
        faults.push(format!("in a circle: {}", names.join(", ")));
    }
    faults
}

#[test]
fn no_file_uses_one_above_it_and_none_are_in_a_circle() {
    let sources = sources();
    assert!(sources.len() > 100, "{} files", sources.len());
    let used: usize = arrows(&sources).values().map(BTreeSet::len).sum();
    assert!(used > 400, "{used} arrows: the test has lost its eyes");
    assert_eq!(faults(&sources), [""; 0]);
}

#[test]
fn arrows_upward_and_circles_are_found() {
    let with = |changes: &[(&str, &str)]| {
        let mut sources = sources();
        for (path, line) in changes {
            let module: Module = path.split('/').map(str::to_owned).collect();
            sources.get_mut(&module).unwrap_or_else(|| panic!("no {path}")).push_str(line);
        }
        faults(&sources)
    };
    let up = ["statistics/fit uses ensemble/request/key, which is above it"];
    assert_eq!(with(&[("statistics/fit", "use curvelax_ensemble::Spec;")]), up);
    assert_eq!(with(&[("statistics/fit", "fn f() -> Option<curvelax_ensemble::Spec> { None }")]), up);
    assert_eq!(with(&[("statistics/fit", "#[cfg(test)] mod more { use curvelax_ensemble::Spec; }")]), [""; 0]);
    // Within a crate, where Cargo does not see it.
    let up = ["flow/number uses flow/solver/ring, which is above it"];
    assert_eq!(with(&[("flow/number", "fn f() -> crate::solver::ring::Blocks {}")])[..1], up);
    let circle = with(&[("statistics/sum", "use super::fit::Line;"), ("statistics/fit", "use super::sum::sum;")]);
    assert!(circle.len() == 1 && circle[0].contains("statistics/fit, statistics/sum"), "{circle:?}");
    // Through a re-export, and to the folder that holds the file.
    let circle = with(&[("statistics/sum", "use super::Line;"), ("statistics/fit", "use super::sum::sum;")]);
    assert!(circle.len() == 1 && circle[0].contains("statistics/fit, statistics/sum"), "{circle:?}");
    let circle = with(&[("run/report/complete", "use super::RunReport;")]);
    assert!(circle.len() == 1 && circle[0].contains("run/report, run/report/complete"), "{circle:?}");
}

/// The types that a file defines outside its tests and its functions.
#[derive(Default)]
struct Types(BTreeSet<String>);

impl<'a> Visit<'a> for Types {
    fn visit_item(&mut self, item: &'a Item) {
        let (name, attributes) = match item {
            Item::Struct(item) => (&item.ident, &item.attrs),
            Item::Enum(item) => (&item.ident, &item.attrs),
            Item::Union(item) => (&item.ident, &item.attrs),
            Item::Trait(item) => (&item.ident, &item.attrs),
            Item::Type(item) => (&item.ident, &item.attrs),
            Item::Mod(item) if !is_of_tests(&item.attrs) => return visit::visit_item_mod(self, item),
            _ => return,
        };
        if !is_of_tests(attributes) {
            self.0.insert(name.to_string());
        }
    }
}

/// Type names defined in several files, with these files; one file may define a type once per operating system.
fn shared_names(sources: &BTreeMap<Module, String>) -> Vec<String> {
    let mut files: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (module, text) in sources {
        let mut types = Types::default();
        types.visit_file(&syn::parse_file(text).unwrap());
        types.0.into_iter().for_each(|name| files.entry(name).or_default().push(module.join("/")));
    }
    assert!(files.len() > 200, "{} types: the test has lost its eyes", files.len());
    let shared = files.into_iter().filter(|(_, files)| files.len() > 1);
    shared.map(|(name, files)| format!("{name}: {}", files.join(", "))).collect()
}

#[test]
fn type_names_are_unique() {
    assert_eq!(shared_names(&sources()), [""; 0]);
}

#[test]
fn a_type_name_that_is_used_twice_is_found() {
    let with = |line: &str| {
        let mut sources = sources();
        sources.get_mut(&vec!["base".to_owned(), "error".to_owned()]).unwrap().push_str(line);
        shared_names(&sources)
    };
    let shared = ["Outline: base/error, curve/outline"];
    assert_eq!(with("struct Outline;"), shared);
    assert_eq!(with("mod inner { pub enum Outline {} }"), shared);
    assert_eq!(with("type Outline<T> = Option<T>;"), shared);
    assert_eq!(with("#[cfg(test)] mod more { struct Outline; }"), [""; 0]);
    assert_eq!(with("fn f() { struct Outline; }"), [""; 0]);
}
