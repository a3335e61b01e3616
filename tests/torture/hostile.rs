//! Other things in the place of a run's files: pipes, devices, folders, links, and huge files.

use std::{
    ffi::OsStr,
    fs::{self, File},
    os::unix::{ffi::OsStrExt, fs::symlink},
    path::Path,
    process::Command,
};

use tempfile::TempDir;

use crate::{
    Found, Outcome,
    folder::{content, copy},
    program::{Running, curvelax, through},
    study::{Attempt, Study},
};

/// Address space that is enough for the small runs of these tests, but not for reading a whole huge file. Threads need
/// some of it, too, so that there must not be as many as cores.
const LITTLE: [&str; 3] =
    ["sh", "-c", "export RAYON_NUM_THREADS=1 MALLOC_ARENA_MAX=1; ulimit -v 1000000; exec \"$0\" \"$@\""];

/// Replacements of a file.
const THINGS: [&str; 5] = ["a pipe", "a device", "a folder", "2 GiB", "nothing to be opened"];

fn put(thing: &str, path: &Path) {
    // The huge file begins like the original; the header of a checkpoint gets the matching length.
    let old = fs::read(path).unwrap_or_default();
    let _ = fs::remove_file(path);
    match thing {
        "a pipe" => assert!(Command::new("mkfifo").arg(path).status().unwrap().success()),
        "a device" => symlink("/dev/zero", path).unwrap(),
        "a folder" => fs::create_dir(path).unwrap(),
        "2 GiB" => {
            let size: u64 = 2 << 30;
            let mut old = old;
            if old.starts_with(b"curvelax state") {
                old[20..28].copy_from_slice(&(size - 32).to_le_bytes());
            }
            fs::write(path, old).unwrap();
            File::options().write(true).open(path).unwrap().set_len(size).unwrap();
        }
        _ => symlink("nowhere", path).unwrap(),
    }
}

/// Each of [`THINGS`] in the place of every file that is read again: the reader reports it at once, with little memory,
/// or does without the file; the replacement stays unchanged.
pub fn in_the_place_of_files(csv: &Study, zarr: &Study) -> Outcome {
    let home = TempDir::new().unwrap();
    let go = |arguments: &str| Running::start(&mut through(home.path(), &LITTLE, arguments)).end();
    for (arguments, out) in [(csv.arguments, "done"), (&*format!("{} --shard 0/1", zarr.arguments), "shard")] {
        let ended = go(&format!("run {arguments} --quiet --out {out}"));
        assert_eq!(ended.code, Some(0), "{ended:?}");
    }
    copy(&Attempt::interrupted(csv).out(), &home.path().join("csv"));
    copy(&Attempt::interrupted(zarr).out(), &home.path().join("zarr"));
    fs::write(home.path().join("spec.toml"), "curves = 2\n").unwrap();
    fs::write(home.path().join("q.csv"), "0,0\n3,0\n3,2\n0,2\n").unwrap();
    let (resume, store) = ("resume place --quiet", ".snapshots.zarr.part");
    let (states, marks) =
        (["csv", "zarr"], [".curvelax.lock", ".curvelax.state", ".curvelax.state.old", ".summary.csv.part"]);
    let mut cases: Vec<(&str, String, &str)> = Vec::new();
    for state in states {
        cases.extend(marks.map(|mark| (state, mark.to_string(), resume)));
    }
    cases.extend(["zarr.json", "x/zarr.json", "member/c.0"].map(|name| ("zarr", format!("{store}/{name}"), resume)));
    for name in ["run.json", "summary.csv", "members.csv", "mean_excess.csv", "plots/portraits.json"] {
        cases.push(("done", name.into(), "plot place --quiet"));
    }
    for name in [
        "shard.state",
        "summary.csv",
        "members.csv",
        "rates.csv",
        "snapshots.zarr/x/c.0.0.0",
        "snapshots.zarr/status/c.0",
    ] {
        cases.push(("shard", name.into(), "merge place --quiet --out merged"));
    }
    cases.push(("done", "run.json".into(), "resume place --quiet"));
    let (mut count, mut done) = (0, 0);
    for (from, name, command) in &cases {
        for thing in THINGS {
            let place = home.path().join("place");
            copy(&home.path().join(from), &place);
            put(thing, &place.join(name));
            let ended = go(command);
            let told = format!("{thing} for {name} of {from}: {ended:?}");
            match ended.code {
                Some(0) => done += 1,
                code => assert!(code == Some(2) && ended.errors().len() == 1, "{told}"),
            }
            fs::remove_dir_all(&place).unwrap();
            let _ = fs::remove_dir_all(home.path().join("merged"));
            count += 1;
        }
    }
    for (name, command) in [("spec.toml", "run spec.toml"), ("q.csv", "run --shape file:q.csv")] {
        for thing in THINGS {
            put(thing, &home.path().join(name));
            let ended = go(&format!("{command} --backend cpu --quiet --out no"));
            assert!(ended.code == Some(2) && ended.said.contains(name), "{thing} for {name}: {ended:?}");
            let path = home.path().join(name);
            let _ = fs::remove_file(&path).or_else(|_| fs::remove_dir(&path));
            count += 1;
        }
    }
    Found::new(count, format!("{done} done without it, {} refused in 1 GB", count - done))
}

/// Folders where a run needs others, leftovers of a kill in a store, and names that are not text.
pub fn in_the_way(csv: &Study, zarr: &Study) -> Outcome {
    let mut cases = 0;
    let middle = Attempt::interrupted(csv);
    // The file of an unused lock may be removed.
    let _ = fs::remove_file(middle.out().join(".curvelax.lock"));
    for name in [".curvelax.state", ".curvelax.state.old", ".curvelax.state.part", ".curvelax.part"] {
        let attempt = middle.fork();
        let path = attempt.out().join(name);
        let _ = fs::remove_file(&path);
        fs::create_dir(&path).unwrap();
        let before = content(&attempt.out());
        let ended = attempt.resume().end();
        assert!(ended.code == Some(2) && ended.errors().len() == 1 && ended.said.contains(name), "{name}: {ended:?}");
        assert!(content(&attempt.out()) == before, "{name}");
        cases += 1;
    }
    let attempt = middle.fork();
    let elsewhere = attempt.home.path().join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    let _ = fs::remove_dir(attempt.out().join("plots"));
    symlink(&elsewhere, attempt.out().join("plots")).unwrap();
    let ended = attempt.resume().end();
    assert!(ended.code == Some(2) && ended.said.contains("plots is a link"), "{ended:?}");
    assert_eq!(fs::read_dir(&elsewhere).unwrap().count(), 0);
    cases += 1;

    let attempt = Attempt::interrupted(zarr);
    for left in ["zarr.part", "x/zarr.part", "x/c.0.0.part", "status/c.part"] {
        attempt.write(&format!(".snapshots.zarr.part/{left}"), b"half");
    }
    let ended = attempt.resume().end();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    attempt.must_be_the_reference(&[format!("{ended:?}")]);
    cases += 1;

    let home = TempDir::new().unwrap();
    for json in [true, false] {
        let mut command = curvelax(home.path(), "run");
        command.args(csv.arguments.split_whitespace()).arg("--quiet").arg("--out").arg(OsStr::from_bytes(b"\xff"));
        let ended = Running::start(command.args(json.then_some("--json"))).end();
        assert_eq!(ended.code, Some(if json { 2 } else { 0 }), "{ended:?}");
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), usize::from(!json));
        cases += 1;
    }
    Found::new(cases, "refused by name, or done with nothing left over")
}
