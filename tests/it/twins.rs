//! Every function of the shaders has a twin in Rust, or a reason for having none: the tables of `shaders/README.md`
//! against the code.

use std::{collections::BTreeMap, fs, path::Path};

use syn::{
    Attribute, ImplItemFn, Item, ItemFn, ItemImpl, TraitItemFn, Type,
    visit::{self, Visit},
};

/// The files under comparison: text by path in the repository.
#[derive(Clone)]
struct Sources(BTreeMap<String, String>);

impl Sources {
    fn read() -> Sources {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut sources = BTreeMap::new();
        let mut add = |path: &str| {
            fs::read_to_string(root.join(path)).ok().and_then(|text| sources.insert(path.to_owned(), text))
        };
        add(README);
        for entry in fs::read_dir(root.join("shaders")).unwrap() {
            add(&format!("shaders/{}", entry.unwrap().file_name().to_string_lossy()));
        }
        for row in rows(&fs::read_to_string(root.join(README)).unwrap(), TWINS) {
            names(&row[2]).iter().for_each(|twin| drop(add(twin)));
        }
        Sources(sources)
    }

    /// File names of the shaders.
    fn shaders(&self) -> impl Iterator<Item = &str> {
        self.0.keys().filter_map(|path| path.strip_prefix("shaders/").filter(|file| file.ends_with(".wgsl")))
    }

    fn with(mut self, path: &str, change: impl Fn(&str) -> String) -> Sources {
        let text = self.0.get_mut(path).unwrap_or_else(|| panic!("no {path}"));
        let changed = change(text);
        assert_ne!(*text, changed, "{path}");
        *text = changed;
        self
    }
}

const README: &str = "shaders/README.md";
/// First lines of the two tables.
const TWINS: &str = "| file | holds | twin |";
const EXCEPTIONS: &str = "| functions | why |";

/// The cells of a table, row by row.
fn rows(text: &str, head: &str) -> Vec<Vec<String>> {
    let lines = text.lines().skip_while(|line| *line != head).skip(2).take_while(|line| line.starts_with('|'));
    let cells = |line: &str| line.trim_matches('|').split('|').map(str::to_owned).collect();
    lines.map(cells).collect()
}

/// The words between backticks.
fn names(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// The functions of a shader in their order.
fn shader_functions(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.strip_prefix("fn ")?.split('(').next()).collect()
}

/// The functions of a Rust file in order, each by its name alone and qualified by its type.
fn rust_functions(text: &str) -> Vec<[String; 2]> {
    #[derive(Default)]
    struct Functions {
        of: String,
        found: Vec<[String; 2]>,
    }
    impl Functions {
        fn add(&mut self, name: &syn::Ident) {
            self.found.push([name.to_string(), format!("{}_{name}", self.of)]);
        }
    }
    fn is_of_tests(attributes: &[Attribute]) -> bool {
        attributes.iter().any(|a| a.path().is_ident("cfg"))
    }
    impl<'a> Visit<'a> for Functions {
        fn visit_item(&mut self, item: &'a Item) {
            match item {
                Item::Mod(item) if is_of_tests(&item.attrs) => {}
                _ => visit::visit_item(self, item),
            }
        }
        fn visit_item_impl(&mut self, item: &'a ItemImpl) {
            if let Type::Path(path) = &*item.self_ty {
                self.of = path.path.segments.last().unwrap().ident.to_string().to_lowercase();
            }
            visit::visit_item_impl(self, item);
            self.of.clear();
        }
        fn visit_item_fn(&mut self, item: &'a ItemFn) {
            self.add(&item.sig.ident);
        }
        fn visit_impl_item_fn(&mut self, item: &'a ImplItemFn) {
            self.add(&item.sig.ident);
        }
        fn visit_trait_item_fn(&mut self, item: &'a TraitItemFn) {
            self.add(&item.sig.ident);
        }
    }
    let mut functions = Functions::default();
    functions.visit_file(&syn::parse_file(text).unwrap());
    functions.found
}

/// The faults, one per line, and the number of twins.
fn compare(sources: &Sources) -> (Vec<String>, usize) {
    let readme = &sources.0[README];
    let (twins, exceptions) = (rows(readme, TWINS), rows(readme, EXCEPTIONS));
    let mut faults = Vec::new();

    let listed: Vec<&str> = twins.iter().flat_map(|row| names(&row[0])).collect();
    for file in sources.shaders() {
        if listed.iter().filter(|other| **other == file).count() != 1 {
            faults.push(format!("{file} is not in the table once"));
        }
    }
    let paths = listed.iter().map(|file| format!("shaders/{file}"));
    let paths = paths.chain(twins.iter().flat_map(|row| names(&row[2])).map(str::to_owned));
    faults.extend(paths.filter(|path| !sources.0.contains_key(path)).map(|path| format!("there is no {path}")));

    let mut alone = Vec::new();
    let mut pairs = 0;
    for row in &twins {
        let rust: Vec<[String; 2]> = names(&row[2])
            .iter()
            .filter_map(|path| sources.0.get(*path))
            .flat_map(|text| rust_functions(text))
            .collect();
        for file in names(&row[0]) {
            let Some(text) = sources.0.get(&format!("shaders/{file}")) else { continue };
            let mut after = 0;
            for function in shader_functions(text) {
                let is_twin = |names: &[String; 2]| names.iter().any(|name| name == function);
                if let Some(at) = rust[after..].iter().position(is_twin) {
                    after += at + 1;
                    pairs += 1;
                } else if rust.iter().any(is_twin) {
                    faults.push(format!("{file}: the twin of {function} is in another place"));
                } else {
                    alone.push((file, function));
                }
            }
        }
    }

    let excepted: Vec<&str> = exceptions.iter().flat_map(|row| names(&row[0])).collect();
    for (file, function) in &alone {
        if !excepted.contains(function) {
            faults.push(format!("{file}: {function} has no twin"));
        }
    }
    for (place, name) in excepted.iter().enumerate() {
        if excepted[..place].contains(name) || !alone.iter().any(|(_, function)| function == name) {
            faults.push(format!("the exception of {name} is unnecessary"));
        }
    }
    faults.extend(exceptions.iter().filter(|row| row[1].trim().is_empty()).map(|row| format!("{}: no reason", row[0])));
    (faults, pairs)
}

#[test]
fn every_function_of_a_shader_has_a_twin_or_a_reason_why_not() {
    let (faults, pairs) = compare(&Sources::read());
    assert_eq!(faults, [""; 0]);
    println!("{pairs} twins");
    assert!(pairs > 60, "{pairs} twins: the test has lost its eyes");
}

#[test]
fn missing_twins_and_unnecessary_exceptions_are_found() {
    let faults = |path: &str, change: &dyn Fn(&str) -> String| compare(&Sources::read().with(path, change)).0;
    let appended = |path: &str, text: &str| faults(path, &|old| format!("{old}{text}"));
    let exception = |name: &str| {
        let row = format!("{EXCEPTIONS}\n|---|---|\n");
        faults(README, &|old| old.replace(&row, &format!("{row}| `{name}` | A reason. |\n")))
    };
    assert_eq!(appended("shaders/pace.wgsl", "fn hurry() {}\n"), ["pace.wgsl: hurry has no twin"]);
    assert_eq!(
        faults("crates/flow/src/scheme/pace.rs", &|old| old.replace("fn growth", "fn stretch")),
        ["pace.wgsl: growth has no twin"]
    );
    assert_eq!(exception("growth"), ["the exception of growth is unnecessary"]);
    assert_eq!(exception("hurry"), ["the exception of hurry is unnecessary"]);
    assert_eq!(exception("trace"), ["the exception of trace is unnecessary"], "it is there twice");
    // A file is no exception: what it excepted would not be looked at when a twin comes or goes.
    assert_eq!(exception("ring.wgsl"), ["the exception of ring.wgsl is unnecessary"]);
    assert_eq!(appended("shaders/ring.wgsl", "fn minus3() {}\n"), ["ring.wgsl: minus3 has no twin"]);
    assert_eq!(
        faults("shaders/pull.wgsl", &|old| old.replace("fn turn", "fn twist").replace("fn pull", "fn turn")),
        ["pull.wgsl: twist has no twin"]
    );
    assert_eq!(
        appended("shaders/pace.wgsl", "fn stride() {}\n"),
        ["pace.wgsl: the twin of stride is in another place"]
    );
    assert_eq!(
        faults(README, &|old| old.replace("`crates/flow/src/scheme/pace.rs`", "`src/scheme/space.rs`"))[0],
        "there is no src/scheme/space.rs"
    );
    let unlisted = faults(README, &|old| old.replace("| `pace.wgsl` |", "| |"));
    assert_eq!(unlisted, ["pace.wgsl is not in the table once"]);
    // Tests and other files provide no twins.
    let hidden = "#[cfg(test)]\nmod more { fn next_length() {} }\n";
    assert_eq!(
        faults("crates/flow/src/scheme/pace.rs", &|old| old.replace("fn growth", "fn stretch") + hidden),
        ["pace.wgsl: growth has no twin"]
    );
}

/// The lines of a shader that compute with indices of nodes or blocks: by a remainder, which wraps them round the ring,
/// or from how the ring is cut.
fn index_arithmetic(text: &str) -> Vec<&str> {
    let computes = |line: &str| {
        let code = line.split("//").next().unwrap_or("");
        let counts = ["block_count", "four_count", "node_count() /", "node_count() >>", "node_count() -"];
        // The constants themselves are 0 where a kernel serves many sizes.
        ["%", "BLOCKS", "FOURS", "NODES"].iter().chain(&counts).any(|sign| code.contains(sign))
    };
    text.lines().filter(|line| computes(line)).collect()
}

/// The lines of a shader that form differences of a field between nodes. A product of two fields is no difference.
fn differences(text: &str) -> Vec<&str> {
    const PLACES: [&str; 5] = ["minus2", "minus1", "here", "plus1", "plus2"];
    let forms = |line: &str| {
        let code = line.split("//").next().unwrap_or("");
        code.match_indices(" - ").any(|(at, sign)| {
            let (left, right) = (&code[..at], &code[at + sign.len()..]);
            let start = left.rfind('(').map_or("", |open| &left[..open]);
            let is_place = PLACES.iter().any(|place| start.ends_with(place) && left.ends_with(')'));
            let factor = PLACES.iter().any(|place| start.ends_with(&format!("* {place}")));
            let call = PLACES.iter().find_map(|place| right.strip_prefix(place)?.strip_prefix('('));
            let multiplied = call.and_then(|rest| rest.split_once(')')).is_some_and(|(_, rest)| rest.starts_with(" *"));
            is_place && !factor && call.is_some() && !multiplied
        })
    };
    text.lines().filter(|line| forms(line)).collect()
}

#[test]
fn differences_of_neighbours_are_formed_in_one_file() {
    let sources = Sources::read();
    for file in sources.shaders().filter(|file| *file != "ring.wgsl") {
        assert_eq!(differences(&sources.0[&format!("shaders/{file}")]), [""; 0], "{file}");
    }
    // Negative controls.
    assert!(!differences(&sources.0["shaders/ring.wgsl"]).is_empty());
    assert_eq!(differences("let dx = here(wx) - minus1(wx);").len(), 1);
    assert_eq!(differences("let cross = minus1(wx) * here(wy) - here(wx) * minus1(wy);"), [""; 0]);
}

#[test]
fn indices_are_computed_in_one_file() {
    let sources = Sources::read();
    for file in sources.shaders().filter(|file| *file != "ring.wgsl") {
        assert_eq!(index_arithmetic(&sources.0[&format!("shaders/{file}")]), [""; 0], "{file}");
    }
    // Negative controls.
    assert!(index_arithmetic(&sources.0["shaders/ring.wgsl"]).len() > 10);
    assert_eq!(index_arithmetic("let next = (i + 1u) % count;").len(), 1);
}
