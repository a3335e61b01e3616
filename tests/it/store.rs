//! `snapshots.zarr` from outside: the files in the folder, their bytes, and the effects of a failed run.

use std::{collections::BTreeMap, fs, path::Path};

use crate::common::{
    command::{curvelax, script},
    program::{Done, number, run},
};
use curvelax::ensemble::Spec;
use serde_json::Value;

const FLAGS: &str = "--curves 13 --points 41 --t-end 0.05 --relax-to 0.8 --stop-when-relaxed --snapshots 0,0.0123,0.05";

/// The files below `folder` and their bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_string();
        match path.is_dir() {
            true => {
                files.extend(self::files(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)))
            }
            false => drop(files.insert(name, fs::read(&path).unwrap())),
        }
    }
    files
}

fn floats(store: &BTreeMap<String, Vec<u8>>, name: &str) -> Vec<f64> {
    store[name].chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect()
}

fn store(done: &Done) -> BTreeMap<String, Vec<u8>> {
    files(&done.path().join("snapshots.zarr"))
}

#[test]
fn the_store_holds_the_numbers_of_the_table_and_stands_instead_of_it() {
    let (table, arrays) = (run(FLAGS), run(&format!("{FLAGS} --store zarr")));
    assert!(!table.path().join("snapshots.zarr").exists() && !arrays.path().join("snapshots.csv").exists());
    let store = store(&arrays);
    let times = floats(&store, "time/c.0");
    assert_eq!(times, [0.0, 0.0123, 0.05]);
    for name in ["x", "y", "k", "r"] {
        let mut expected = vec![f64::NAN; 13 * 3 * 41];
        for row in table.rows("snapshots.csv") {
            let time = times.iter().position(|t| *t == number(&row, "t")).unwrap();
            let at = |column: &str| number(&row, column) as usize;
            expected[(at("member") * 3 + time) * 41 + at("i") - 1] = number(&row, name);
        }
        let bits = |values: &[f64]| -> Vec<u64> { values.iter().map(|value| value.to_bits()).collect() };
        let found = floats(&store, &format!("{name}/c.0.0.0"));
        assert_eq!(bits(&found), bits(&expected), "{name}");
        let lost = expected.iter().filter(|value| value.is_nan()).count();
        assert!(lost > 0 && lost < expected.len() / 2, "{lost} of {} are missing", expected.len());
        // Two exchanged nodes are detected.
        expected.swap(0, 1);
        assert_ne!(bits(&found), bits(&expected), "{name}");
    }
    // Both summaries agree, and the statuses in the store match them.
    assert_eq!(table.text("summary.csv"), arrays.text("summary.csv"));
    let group: Value = serde_json::from_slice(&store["zarr.json"]).unwrap();
    let flags = &group["consolidated_metadata"]["metadata"]["status"]["attributes"];
    let words: Vec<&str> = flags["flag_meanings"].as_str().unwrap().split(' ').collect();
    let codes = flags["flag_values"].as_array().unwrap();
    for (row, code) in arrays.summary().iter().zip(&store["status/c.0"]) {
        let word = codes.iter().position(|own| own == u64::from(*code)).map(|place| words[place]);
        assert_eq!(word, Some(&*row["status"]));
    }
}

#[test]
fn equal_runs_give_equal_bytes_and_the_spec_in_the_store_repeats_them() {
    let first = run(&format!("{FLAGS} --store zarr --threads 1"));
    let bytes = store(&first);
    assert!(store(&run(&format!("{FLAGS} --store zarr --threads 2"))) == bytes);
    let other = store(&run(&format!("{FLAGS} --store zarr --seed 2")));
    assert!(other["x/c.0.0.0"] != bytes["x/c.0.0.0"]);

    let group: Value = serde_json::from_slice(&bytes["zarr.json"]).unwrap();
    let text = group["attributes"]["spec"].as_str().unwrap();
    Spec::from_toml(text).unwrap();
    assert!(store(&crate::common::program::run_with(&[("spec.toml", text)], "spec.toml")) == bytes);
}

#[test]
fn members_of_a_sweep_and_members_alone_keep_their_index() {
    let sweep = "--store zarr --sweep amplitude=0.01,0.1";
    let (whole, only) = (run(&format!("{FLAGS} {sweep}")), run(&format!("{FLAGS} {sweep} --only 3,14,25")));
    let (whole, only) = (store(&whole), store(&only));
    let whole_numbers = |store: &BTreeMap<String, Vec<u8>>, name: &str| -> Vec<i64> {
        store[name].chunks_exact(8).map(|bytes| i64::from_le_bytes(bytes.try_into().unwrap())).collect()
    };
    assert_eq!(whole_numbers(&whole, "cell/c.0"), [[0; 13], [1; 13]].concat());
    assert_eq!(whole_numbers(&only, "member/c.0"), [3, 14, 25]);
    assert_eq!(whole_numbers(&only, "cell/c.0"), [0, 1, 1]);
    let member = |store: &BTreeMap<String, Vec<u8>>, place: usize| -> Vec<u8> {
        store["k/c.0.0.0"].chunks_exact(3 * 41 * 8).nth(place).unwrap().to_vec()
    };
    for (place, index) in [3, 14, 25].into_iter().enumerate() {
        assert!(member(&only, place) == member(&whole, index), "member {index}");
    }
    assert!(member(&only, 0) != member(&whole, 4));
}

/// Runs curvelax where no file can grow beyond `limit` blocks of 512 or 1024 bytes, as on a full disk.
#[cfg(unix)]
fn limited(home: &Path, limit: &str, arguments: &str) -> std::process::Output {
    // A limit that is lower already cannot be raised.
    if limit == "unlimited" {
        return curvelax(home, arguments);
    }
    script("sh", home, &format!("ulimit -f {limit} && exec \"$0\" {arguments}")).output().unwrap()
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_store_of_the_earlier_run_and_no_half_of_another() {
    let home = tempfile::tempdir().unwrap();
    let small =
        "run --backend cpu --curves 100 --points 32 --tau 1e-4 --t-end 2e-4 --snapshots 0,2e-4 --store zarr --out out";
    let first = limited(home.path(), "unlimited", small);
    assert_eq!(first.status.code(), Some(0), "{}", String::from_utf8_lossy(&first.stderr));
    let out = home.path().join("out");
    let before = files(&out);
    // 100 members of two times and 32 nodes are 51 kB, the metadata 9 kB.
    let second = limited(home.path(), "40", &format!("{small} --force --seed 2"));
    let message = String::from_utf8(second.stderr).unwrap();
    assert_eq!(second.status.code(), Some(1), "{message}");
    assert!(message.contains("error: cannot write out/snapshots.zarr/x/c.0.0.0: "), "{message}");
    let after = files(&out);
    assert!(before.iter().all(|(name, bytes)| after.get(name) == Some(bytes)), "{:?}", after.keys());
    let more: Vec<&String> = after.keys().filter(|name| !before.contains_key(*name)).collect();
    let tables = [".summary.csv.part", ".members.csv.part", ".levels.csv.part", ".rates.csv.part"];
    let state = [&tables[..], &[".curvelax.", ".snapshots.zarr.part/"]].concat();
    assert!(more.iter().all(|name| state.iter().any(|part| name.starts_with(part))), "{more:?}");
    assert!(message.contains("note: the run was saved: curvelax resume out continues it\n"), "{message}");

    // With room it resumes, to exactly the right end.
    let resumed = limited(home.path(), "unlimited", "resume out");
    assert_eq!(resumed.status.code(), Some(0), "{}", String::from_utf8_lossy(&resumed.stderr));
    let straight = format!("{} --seed 2", small.replace("--out out", "--out straight"));
    assert_eq!(limited(home.path(), "unlimited", &straight).status.code(), Some(0));
    let (mut ours, mut theirs) = (files(&out), files(&home.path().join("straight")));
    assert!(ours.remove("run.json").is_some() && theirs.remove("run.json").is_some());
    assert!(ours == theirs, "{:?}", ours.keys());

    // A later run of another kind removes all of it.
    let third = limited(home.path(), "unlimited", &format!("{} --force", small.replace("zarr", "csv")));
    assert_eq!(third.status.code(), Some(0), "{}", String::from_utf8_lossy(&third.stderr));
    let left: Vec<String> = files(&out).into_keys().collect();
    assert!(left.iter().any(|name| name == "snapshots.csv"), "{left:?}");
    assert!(!left.iter().any(|name| name.contains("zarr") || name.ends_with(".part")), "{left:?}");
}
