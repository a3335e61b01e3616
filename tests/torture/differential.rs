//! Random studies: every cell equals a run of it alone, bit for bit, and threads, shards, the order of a merge, stops
//! and kills change no byte.
//!
//! The swept keys are dealt from a shuffled pack of all keys that can be swept, two per study, so that few studies
//! cover every key. If its values are not compatible, the program refuses a study, and it is drawn again.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    fs,
    path::Path,
    time::{Duration, Instant},
};

use tempfile::TempDir;

use crate::{
    Found, Outcome,
    folder::{Content, content, differences},
    program::{Ended, Running, curvelax},
    random::Random,
};

/// Every key that can be swept, with values for it. Values that contain commas are why `;` separates them.
const KEYS: [(&str, &[&str]); 24] = [
    ("points", &["13", "16", "24", "37"]),
    ("seed", &["1", "2", "77"]),
    (
        "shape",
        &["ellipse:2,1", "circle:1", "circle:0.5", "nonconvex", "lemniscate:1", "flower:3:0.3", "file:outline.csv"],
    ),
    ("sampling", &["arclength", "parameter"]),
    ("amplitude", &["0", "0.01", "0.05", "0.2"]),
    ("modes", &["2..=2", "2..=3", "3..=3"]),
    ("decay", &["0", "1", "2.5"]),
    ("flow", &["surface-diffusion", "willmore", "elastic:0.5", "poly:0,-0.3", "poly:0.1,0,-0.5,0.01"]),
    ("energy", &["cos:3,0.03", "cos:2,0.1,20"]),
    ("diffusivity", &["cos:2,0.3"]),
    ("drive", &["0.3", "-0.1", "feedback:0.5,4"]),
    ("tau", &["1e-3", "5e-4", "2e-4"]),
    ("adaptive", &["1e-1", "3e-2", "1e-2"]),
    ("t-end", &["0.2", "0.5", "0.81"]),
    ("omega", &["0", "1", "5"]),
    ("no-redistribution", &["true", "false"]),
    ("pull", &["0", "auto", "3"]),
    ("form", &["paper", "geometric", "auto"]),
    ("solver", &["gauss-seidel", "direct"]),
    ("order", &["coloured", "lexicographic"]),
    ("tolerance", &["1e-3", "1e-5"]),
    ("sor", &["1", "auto", "1.2"]),
    ("relax-to", &["0.01", "0.5"]),
    ("relax-at", &["0.01", "0.1"]),
];
/// Keys that exclude each other.
const INSTEAD: [[&str; 2]; 2] = [["tau", "adaptive"], ["relax-to", "relax-at"]];
/// Keys for sweeps of the solver, which a direct solver refuses.
const OF_SWEEPS: [&str; 3] = ["order", "tolerance", "sor"];
/// Keys that make a crystal.
const CRYSTAL: [&str; 2] = ["energy", "diffusivity"];
/// Tables with a row per member or cell.
const TABLES: [&str; 9] = [
    "summary.csv",
    "members.csv",
    "levels.csv",
    "series.csv",
    "snapshots.csv",
    "ensemble.csv",
    "explained.csv",
    "rates.csv",
    "mean_excess.csv",
];
/// Draws of a study with incompatible values.
const TRIES: usize = 20;
/// An ellipse with a dent, as a file.
const OUTLINE: [(f64, f64); 8] =
    [(2.0, 0.0), (1.4, 0.7), (0.0, 0.6), (-1.4, 0.7), (-2.0, 0.0), (-1.4, -0.7), (0.0, -1.0), (1.4, -0.7)];

type Settings = BTreeMap<&'static str, String>;

/// A random study.
struct Drawn {
    /// Values of keys for all cells.
    base: Settings,
    /// The swept keys with their values.
    axes: [(&'static str, Vec<&'static str>); 2],
    /// Flags that do not affect a member's trajectory.
    rest: String,
    members: usize,
    common: bool,
}

impl Drawn {
    fn new(random: &mut Random, keys: [&'static str; 2], backend: &str) -> Drawn {
        let on_the_gpu = backend == "gpu";
        let axes = keys.map(|key| {
            let mut values = values(key).to_vec();
            while values.len() > 3 {
                values.remove(random.below(values.len()));
            }
            (key, values)
        });
        let mut base = Settings::new();
        let fixed =
            [("t-end", "0.4"), ("modes", "2..=3"), ("points", if on_the_gpu { "16" } else { "23" }), ("tau", "1e-3")];
        base.extend(fixed.map(|(key, value)| (key, value.to_string())));
        // Kinds of steps and numbers of nodes are entirely different paths through the program; other keys keep their
        // values half the time. On a GPU every number of nodes requires compiling a kernel.
        for (key, values) in KEYS {
            let stays = OF_SWEEPS.contains(&key)
                || (on_the_gpu && ["points", "solver", "energy", "diffusivity", "drive"].contains(&key));
            if !stays && random.below(2) == 0 {
                set(&mut base, key, values[random.below(values.len())]);
            }
        }
        if keys.iter().any(|key| OF_SWEEPS.contains(key)) {
            set(&mut base, "solver", "gauss-seidel");
        }
        // Crystals have one flow, one form and no limits.
        let plain = ["flow", "form"].into_iter().any(|key| keys.contains(&key));
        let crystal = keys.iter().any(|key| CRYSTAL.contains(key)) || CRYSTAL.iter().any(|key| base.contains_key(key));
        match crystal {
            true if plain => CRYSTAL.iter().for_each(|key| drop(base.remove(key))),
            true => ["flow", "form"].into_iter().for_each(|key| drop(base.remove(key))),
            false => {}
        }
        // With a strong pull and no redistribution, so few nodes fall into disorder: the member stalls after thousands
        // of steps, and with sweeps it needs minutes.
        let swept = |key: &str| keys.contains(&key);
        let has = |base: &Settings, key: &str, value: &str| base.get(key).is_some_and(|own| own == value);
        if (swept("pull") || has(&base, "pull", "auto"))
            && (swept("no-redistribution") || has(&base, "no-redistribution", "true"))
        {
            match (swept("pull"), swept("no-redistribution")) {
                (false, _) => set(&mut base, "pull", "3"),
                (true, false) => set(&mut base, "no-redistribution", "false"),
                (true, true) => set(&mut base, "solver", "direct"),
            }
        }
        let mut rest = format!("--backend {backend}");
        let mut sometimes = |words: &str, of: usize| {
            if random.below(of) == 0 {
                rest.push_str(words);
            }
        };
        sometimes(" --precision f32", 2);
        sometimes(" --stop-when-relaxed", 2);
        sometimes(" --series 0.061", 2);
        sometimes(" --snapshots 0,0.02,0.15", 2);
        sometimes(" --store zarr", 4);
        sometimes(" --tables parquet", 4);
        sometimes(" --max-sweeps 40", 6);
        if !crystal || plain {
            sometimes(" --refine", 6);
        }
        let common = random.below(3) == 0;
        if common {
            rest.push_str(" --common-random-numbers");
        }
        Drawn { base, axes, rest, members: 1 + random.below(6), common }
    }

    fn cells(&self) -> usize {
        self.axes.iter().map(|(_, values)| values.len()).product()
    }

    /// The whole study.
    fn study(&self) -> String {
        let axis = |(key, values): &(&str, Vec<&str>)| format!("--sweep {key}={};", values.join(";"));
        let axes: Vec<String> = self.axes.iter().map(axis).collect();
        // A key is swept or given.
        let mut base = self.base.clone();
        base.retain(|key, _| self.axes.iter().all(|(swept, _)| swept != key));
        format!("run {} {} {} --curves {}", flags(&base), axes.join(" "), self.rest, self.members)
    }

    /// The run of cell `cell` alone, and the index that its first member has there.
    fn alone(&self, cell: usize) -> (String, usize) {
        let [(outer, outer_values), (inner, inner_values)] = &self.axes;
        let mut own = self.base.clone();
        set(&mut own, outer, outer_values[cell / inner_values.len()]);
        set(&mut own, inner, inner_values[cell % inner_values.len()]);
        let (first, end) = (cell * self.members, (cell + 1) * self.members);
        let which = match self.common {
            // Its members are drawn from the numbers of the first cell.
            true => format!("--curves {}", self.members),
            false => {
                format!("--curves {end} --only {}", (first..end).map(|m| m.to_string()).collect::<Vec<_>>().join(","))
            }
        };
        let rest = self.rest.replace(" --common-random-numbers", "");
        (format!("run {} {rest} {which}", flags(&own)), if self.common { 0 } else { first })
    }
}

fn values(key: &str) -> &'static [&'static str] {
    KEYS.iter().find(|(name, _)| *name == key).unwrap().1
}

/// Sets a key, replacing one that it excludes.
fn set(settings: &mut Settings, key: &'static str, value: &str) {
    for [one, other] in INSTEAD {
        if key == one || key == other {
            settings.remove(one);
            settings.remove(other);
        }
    }
    settings.insert(key, value.to_string());
}

fn flags(settings: &Settings) -> String {
    let flag = |(key, value): (&&str, &String)| match (*key, &**value) {
        ("no-redistribution", "true") => "--no-redistribution".to_string(),
        ("no-redistribution", _) => String::new(),
        ("adaptive", value) => format!("--adaptive={value}"),
        (key, value) => format!("--{key} {value}"),
    };
    settings.iter().map(flag).collect::<Vec<_>>().join(" ")
}

/// Whether a command did all of its work: also if every member failed, which the law and the steps may bring about.
fn is_done(ended: &Ended) -> bool {
    ended.code == Some(0) || (ended.code == Some(3) && ended.said.contains("every member failed"))
}

/// A study in a separate folder, in which all experiments with it run.
struct Trial {
    home: TempDir,
    drawn: Drawn,
    /// All commands so far, so that a failure can be repeated.
    story: Vec<String>,
}

impl Trial {
    fn new(drawn: Drawn) -> Trial {
        let home = TempDir::new().unwrap();
        let nodes = OUTLINE.iter().map(|(x, y)| format!("{x},{y}\n")).collect::<String>();
        fs::write(home.path().join("outline.csv"), format!("x,y\n{nodes}")).unwrap();
        Trial { home, drawn, story: Vec::new() }
    }

    fn start(&mut self, arguments: &str) -> Running {
        self.story.push(arguments.to_string());
        Running::start(&mut curvelax(self.home.path(), &format!("{arguments} --quiet")))
    }

    #[track_caller]
    fn done(&mut self, arguments: &str) {
        let ended = self.start(arguments).end();
        assert!(is_done(&ended), "{ended:?}: {:#?}", self.story);
    }

    fn content(&self, folder: &str) -> Content {
        content(&self.home.path().join(folder))
    }

    /// The folder must hold the files of the study. `run.json` has the number of threads, so it is compared only if
    /// that is the `same`.
    #[track_caller]
    fn must_be_the_study(&self, expected: &Content, folder: &str, same: bool) {
        let [mut expected, mut found] = [expected.clone(), self.content(folder)];
        if !same {
            expected.remove("run.json");
            found.remove("run.json");
        }
        let differences = differences(&expected, &found);
        assert!(differences.is_empty(), "{folder}: {differences:#?} after {:#?}", self.story);
    }

    /// Whether the values are compatible; if not, nothing was written.
    fn is_accepted(&mut self) -> bool {
        let ended = self.start(&format!("{} --out study", self.drawn.study())).end();
        let refused = ended.code == Some(2) && !self.home.path().join("study").exists();
        assert!(refused || is_done(&ended), "{ended:?}: {:#?}", self.story);
        !refused
    }

    /// Every cell against a run of it alone; returns the number of rows compared.
    #[track_caller]
    fn cells(&mut self) -> usize {
        let mut compared = 0;
        for cell in 0..self.drawn.cells() {
            let (alone, first) = self.drawn.alone(cell);
            let folder = format!("cell-{cell}");
            self.done(&format!("{alone} --out {folder}"));
            for table in TABLES {
                let path = |folder: &str| self.home.path().join(folder).join(table);
                let study = self.rows(&path("study"), cell, cell * self.drawn.members);
                let own = self.rows(&path(&folder), 0, first);
                assert!(
                    study == own,
                    "{table}, cell {cell}: {study:#?} in the study, {own:#?} alone: {:#?}",
                    self.story
                );
                compared += own.len();
            }
        }
        compared
    }

    /// The rows of a cell whose first member is `first`, with members counted from there, and without the columns that
    /// identify the cell; none if there is no such table.
    fn rows(&self, path: &Path, cell: usize, first: usize) -> Vec<Vec<String>> {
        let Ok(mut table) = csv::Reader::from_path(path) else { return Vec::new() };
        let header = table.headers().unwrap().clone();
        let number = |record: &csv::StringRecord, column: &str| -> Option<usize> {
            header.iter().position(|name| name == column).map(|i| record[i].parse().unwrap())
        };
        let row = |record: csv::StringRecord| {
            let member = number(&record, "member");
            let of_cell = match (number(&record, "cell"), member) {
                (Some(own), _) => own == cell,
                (None, member) => member.is_some_and(|m| (first..first + self.drawn.members).contains(&m)),
            };
            let is_value =
                |name: &str| !["member", "cell"].contains(&name) && self.drawn.axes.iter().all(|(key, _)| *key != name);
            // A cell has no values in columns that only others have.
            let values = header.iter().zip(&record).filter(|(name, value)| is_value(name) && !value.is_empty());
            let place = member.map(|member| format!("member {}", member.wrapping_sub(first)));
            of_cell.then(|| place.into_iter().chain(values.map(|(name, v)| format!("{name} {v}"))).collect())
        };
        table.records().filter_map(|record| row(record.unwrap())).collect()
    }

    /// The study in shards, with different numbers of threads, merged in two orders.
    #[track_caller]
    fn shards(&mut self, expected: &Content, random: &mut Random) {
        let members = self.drawn.cells() * self.drawn.members;
        let count = (2 + random.below(3)).min(members);
        let mut shards = Vec::new();
        for index in 0..count {
            let threads = 1 + random.below(3);
            let study = self.drawn.study();
            self.done(&format!("{study} --shard {index}/{count} --threads {threads} --out shard-{index}"));
            shards.push(format!("shard-{index}"));
        }
        for order in ["forth", "back"] {
            let merged = format!("merged-{order}");
            self.done(&format!("merge {} --out {merged}", shards.join(" ")));
            self.must_be_the_study(expected, &merged, false);
            shards.reverse();
        }
    }

    /// The study stopped and killed, and resumed until it ends.
    #[track_caller]
    fn interruptions(&mut self, expected: &Content, took: Duration, random: &mut Random) -> usize {
        let study = self.drawn.study();
        let mut running = self.start(&format!("{study} --out stopped"));
        let mut interruptions = 0;
        for _ in 0..4 {
            // Members run only for a part of the time, from the moment when their table exists.
            let (table, moment) =
                (self.home.path().join("stopped/.summary.csv.part"), took.mul_f64(0.5 * random.real()));
            running.wait_until(|running| table.exists() && running.age() >= moment);
            // A stop leaves a checkpoint of that moment, a kill the last one.
            let ended = match random.below(3) {
                0 => running.kill(),
                _ => {
                    running.signal("TERM");
                    running.end()
                }
            };
            if is_done(&ended) {
                self.must_be_the_study(expected, "stopped", true);
                return interruptions;
            }
            interruptions += usize::from(!ended.had_not_begun());
            running = self.resume(&study, &ended);
        }
        let mut ended = running.end();
        while !is_done(&ended) {
            assert!(ended.had_not_begun(), "{ended:?}: {:#?}", self.story);
            ended = self.resume(&study, &ended).end();
        }
        self.must_be_the_study(expected, "stopped", true);
        interruptions
    }

    fn resume(&mut self, study: &str, last: &Ended) -> Running {
        let begun = self.home.path().join("stopped").exists() && !last.had_not_begun();
        self.start(&if begun { "resume stopped".into() } else { format!("{study} --out stopped --force") })
    }
}

/// Runs studies on a back end until `wanted` of them were compared.
pub fn studies(backend: &'static str, wanted: usize, seed: u64) -> Outcome {
    let mut random = Random::new(seed ^ u64::from(backend == "gpu") << 40);
    let mut pack = VecDeque::new();
    // If there is room for all keys, none is left out.
    let mut missing: BTreeSet<&str> = keys(backend).into_iter().collect();
    missing.retain(|_| 2 * wanted >= KEYS.len());
    let (mut studies, mut refused, mut cells, mut rows, mut interruptions) = (0, 0, 0, 0, 0);
    while studies < wanted || !missing.is_empty() {
        if pack.len() < 2 {
            pack.extend(shuffled(&mut random, keys(backend)));
        }
        let keys = [pack.pop_front().unwrap(), pack.pop_front().unwrap()];
        if keys[0] == keys[1] {
            pack.push_back(keys[0]);
            continue;
        }
        // Until the program accepts it; some pairs are never compatible.
        for _ in 0..TRIES {
            let mut trial = Trial::new(Drawn::new(&mut random, keys, backend));
            let since = Instant::now();
            if !trial.is_accepted() {
                refused += 1;
                continue;
            }
            let took = since.elapsed();
            let expected = trial.content("study");
            rows += trial.cells();
            let study = trial.drawn.study();
            trial.done(&format!("{study} --threads {} --out threads", 1 + random.below(5)));
            trial.must_be_the_study(&expected, "threads", false);
            trial.shards(&expected, &mut random);
            interruptions += trial.interruptions(&expected, took, &mut random);
            cells += trial.drawn.cells();
            studies += 1;
            missing.retain(|key| !keys.contains(key));
            break;
        }
    }
    assert!(rows > studies, "nothing was compared");
    let found = format!(
        "0 differing bytes: {cells} cells, {rows} rows of tables, {interruptions} interruptions; {refused} refused"
    );
    Found::new(studies, found)
}

/// Keys that a study can sweep on this back end.
fn keys(backend: &str) -> Vec<&'static str> {
    let of_the_cpu = |key: &str| key == "order" || CRYSTAL.contains(&key);
    KEYS.iter().map(|(key, _)| *key).filter(|key| backend == "cpu" || !of_the_cpu(key)).collect()
}

fn shuffled(random: &mut Random, mut keys: Vec<&'static str>) -> Vec<&'static str> {
    for last in (1..keys.len()).rev() {
        keys.swap(last, random.below(last + 1));
    }
    keys
}
