//! Folders that cannot be written or hold what is not of a run, and files of a run that were damaged: exit code 2, and
//! nothing changes.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

use super::bad_input::{assert_says, curvelax};
use crate::common::command::{program, stopped_run};

#[test]
fn a_run_without_a_folder_is_refused() {
    let home = TempDir::new().unwrap();
    let output = curvelax(home.path(), &["run", "--curves", "2"]);
    assert_eq!(output.status.code(), Some(2));
    assert_says(&String::from_utf8(output.stderr).unwrap(), &["required", "--out <DIR>"]);
}

#[test]
fn a_folder_that_exists_or_cannot_be_made_is_refused() {
    let home = TempDir::new().unwrap();
    fs::write(home.path().join("file"), "mine").unwrap();
    fs::create_dir(home.path().join("old")).unwrap();
    for (out, force, reason) in [
        ("old", false, "--out old: already exists; name a new folder, or add --force"),
        ("file", false, "--out file: exists but is not a folder"),
        ("file", true, "--out file: exists but is not a folder"),
        ("file/below", false, "--out file/below: file is not a folder"),
    ] {
        let force = if force { "--force" } else { "--quiet" };
        let output = curvelax(home.path(), &["run", "--curves", "2", "--backend", "cpu", "--out", out, force]);
        assert_eq!(output.status.code(), Some(2), "{out}");
        assert_says(&String::from_utf8(output.stderr).unwrap(), &[reason]);
    }
    assert_eq!(fs::read_to_string(home.path().join("file")).unwrap(), "mine");
    assert_eq!(fs::read_dir(home.path().join("old")).unwrap().count(), 0);
}

#[test]
fn a_folder_with_something_in_the_way_is_refused_with_force() {
    let home = TempDir::new().unwrap();
    for (folder, file, reason) in [
        ("first", "plots", "--out first: first/plots is not a folder; "),
        ("second", "summary.csv/mine", "--out second: second/summary.csv is a folder; "),
    ] {
        let file = home.path().join(folder).join(file);
        let run = home.path().join(folder).join("run.json");
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        let old = "{\"curvelax\": \"0.1.0\"}";
        fs::write(&file, "mine").unwrap();
        fs::write(&run, old).unwrap();
        let output = curvelax(home.path(), &["run", "--curves", "2", "--backend", "cpu", "--out", folder, "--force"]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert_says(&message, &[reason]);
        assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
        assert_eq!(fs::read_to_string(&run).unwrap(), old);
    }
}

/// All files below `folder`, by their path there.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for path in fs::read_dir(next).unwrap().map(|entry| entry.unwrap().path()) {
            match path.is_dir() {
                true => folders.push(path),
                false => drop(all.insert(path.strip_prefix(folder).unwrap().into(), fs::read(&path).unwrap())),
            }
        }
    }
    all
}

/// A folder with a run and a shard; and the beginnings of the lines that replace a run.
fn small_runs() -> (TempDir, [String; 2]) {
    let home = TempDir::new().unwrap();
    let small = "--curves 2 --points 34 --t-end 0.01 --backend cpu --quiet";
    for arguments in [format!("run {small} --out run"), format!("run {small} --shard 0/1 --out shard")] {
        assert_eq!(told(home.path(), &arguments), (Some(0), String::new()), "{arguments}");
    }
    (home, [format!("run {small} --force --out"), "merge shard --quiet --force --out".into()])
}

/// Its exit code, and what it says on stderr.
fn told(home: &Path, arguments: &str) -> (Option<i32>, String) {
    let output = curvelax(home, &arguments.split_whitespace().collect::<Vec<_>>());
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn force_refuses_a_folder_that_holds_what_is_not_of_a_run() {
    let (home, commands) = small_runs();
    let out = home.path().join("run");
    // Next to a run: in its folder, in that of its pictures, and many. Hidden files of others are not in the way.
    for (files, named) in [
        (&["notes.txt"][..], "notes.txt"),
        (&["plots/mine.svg", "data/a.csv"], "data, plots/mine.svg"),
        (&["f", "e", "d", "c", "b", "a"], "a, b, c, d, and 2 more"),
        (&["series.csv"], "series.csv"),
        (&[".DS_Store"], ""),
    ] {
        for name in files {
            fs::create_dir_all(out.join(name).parent().unwrap()).unwrap();
            fs::write(out.join(name), "mine").unwrap();
        }
        for command in &commands {
            let before = contents(home.path());
            let (code, said) = told(home.path(), &format!("{command} run"));
            if named.is_empty() {
                assert_eq!((code, said), (Some(0), String::new()), "{command}: {files:?}");
                continue;
            }
            let expected = format!(
                "error: --out run: it holds {named}, which no run wrote; use another folder, or move away what is not of a \
                 run\n"
            );
            assert_eq!((code, said), (Some(2), expected), "{command}");
            assert!(contents(home.path()) == before, "{command}: {files:?}");
        }
        files.iter().for_each(|name| fs::remove_file(out.join(name)).unwrap());
        let _ = fs::remove_dir(out.join("data"));
    }
    // Names of a run do not make one.
    for (name, text) in [("run.json", "{\"engine\": \"another\"}"), ("summary.csv", "a,b\n1,2\n"), ("events.csv", "")] {
        fs::create_dir_all(home.path().join("mine")).unwrap();
        fs::write(home.path().join("mine").join(name), text).unwrap();
        for command in &commands {
            let (code, said) = told(home.path(), &format!("{command} mine"));
            assert!(code == Some(2) && said.contains(&format!(": it holds {name}, which no run wrote; ")), "{said}");
            assert_eq!(fs::read_to_string(home.path().join("mine").join(name)).unwrap(), text);
        }
        fs::remove_dir_all(home.path().join("mine")).unwrap();
    }
    fs::create_dir(home.path().join("empty")).unwrap();
    assert_eq!(told(home.path(), &format!("{} empty", commands[0])), (Some(0), String::new()));
}

#[test]
fn a_folder_that_cannot_be_made_leaves_no_parents() {
    let home = TempDir::new().unwrap();
    let out = format!("new/deep/{}", "x".repeat(1000));
    let output = curvelax(home.path(), &["run", "--curves", "2", "--backend", "cpu", "--out", &out]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!home.path().join("new").exists());
}

#[test]
fn a_reader_that_goes_away_ends_the_program_quietly() {
    for arguments in [&["run", "--backend", "cpu", "--print-spec"][..], &["run", "--help"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let home = TempDir::new().unwrap();
        let output = program(home.path()).args(arguments).stdout(writer).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
        assert_eq!(String::from_utf8(output.stderr).unwrap(), "", "{arguments:?}");
    }
}

/// The reader of shapes and the perturbation refuse these.
/// What commands read again, in `run`, `shard` and `half`.
const READ_AGAIN: [(&str, &str, &[&str]); 6] = [
    (
        "plot run",
        "run",
        &["run.json", "summary.csv", "members.csv", "levels.csv", "events.csv", "event_levels.csv", "mean_excess.csv"],
    ),
    ("plot run --out new/pictures", "run", &["run.json", "summary.csv", "mean_excess.csv"]),
    ("animate run", "run", &["run.json", "plots/portraits.json"]),
    ("resume run", "run", &["run.json"]),
    (
        "merge shard --out new/merged",
        "shard",
        &["shard.state", "summary.csv", "levels.csv", "snapshots.zarr/k/c.0.0.0", "snapshots.zarr/status/c.0"],
    ),
    ("resume half", "half", &[".summary.csv.part", ".members.csv.part", ".levels.csv.part", ".series.csv.part"]),
];

/// Files that were cut off, replaced by those of others, or removed: each is refused in one line, and nothing changes.
#[test]
fn damaged_files_of_a_run_are_refused_and_nothing_is_changed() {
    let home = TempDir::new().unwrap();
    let path = home.path();
    let small = "--backend cpu --curves 2 --points 68 --threads 1 --adaptive=1e-2 --solver direct --refine --t-end 0.01 \
                 --event half=excess<=0.5*start --snapshots 0,0.01 --quiet";
    let long = "--backend cpu --curves 2 --points 34 --tau 1e-9 --t-end 1 --solver direct --series 0.1 --quiet";
    for (arguments, code) in [
        (format!("run {small} --out run"), 0),
        (format!("run {small} --store zarr --shard 0/1 --out shard"), 0),
        ("plot run --quiet".into(), 0),
    ] {
        let ended = told(path, &arguments);
        assert_eq!(ended.0, Some(code), "{arguments}: {}", ended.1);
    }
    stopped_run(path, &format!("run {long}"), "half");
    let before = contents(path);
    let refused = |command: &str, what: &str| {
        let now = contents(path);
        let output = curvelax(path, &command.split_whitespace().collect::<Vec<_>>());
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{command}, {what}: {said}");
        assert!(said.starts_with("error: ") && said.lines().count() == 1, "{command}, {what}: {said}");
        assert!(output.stdout.is_empty() && contents(path) == now && !path.join("new").exists(), "{command}, {what}");
    };
    let garbage: Vec<u8> = (0..3000_u32).map(|i| (i * 167 + 91) as u8).collect();
    for (command, folder, files) in READ_AGAIN {
        for name in files {
            let place = path.join(folder).join(name);
            let whole = &before[&Path::new(folder).join(name)];
            // Without the last bracket or line break.
            let cut = &whole[..whole.len() - 2];
            for damaged in [cut, &whole[..whole.len() / 2], b"", &garbage, b"hello,world\n1,2\n"] {
                fs::write(&place, damaged).unwrap();
                refused(command, &format!("{name} of {} bytes", damaged.len()));
            }
            fs::remove_file(&place).unwrap();
            refused(command, &format!("without {name}"));
            fs::write(&place, whole).unwrap();
        }
    }
    for command in ["plot", "animate", "resume", "merge --out new/merged"] {
        refused(&format!("{command} run/summary.csv"), "a file");
    }
    for command in ["plot half", "animate half"] {
        refused(command, "unfinished");
    }
    assert!(contents(path) == before);
}
