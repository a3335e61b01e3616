//! Shards and their merge, as a user meets them: exactly the files of one run, and what is refused.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    path::Path,
    process::Output,
};

use curvelax::{
    backend::gpu::Gpu,
    files::state::{envelope, shard},
};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::command::{command, curvelax, script, stopped_after, stopped_run};

/// Cells of unequal cost, all files, members that end in several ways.
const STUDY: &str = "--backend cpu --curves 22 --points 34 --sweep shape=ellipse:2,1;lemniscate:1;circle:1 --adaptive=1e-3 \
                     --stop-when-relaxed --t-end 0.4 --series 0.05 --snapshots 0,0.1,0.4 --event slow=excess<=0.5*start \
                     --event never=length<=0.1";
/// A quick study with 12 members.
const SMALL: &str = "--backend cpu --curves 12 --points 34 --tau 1e-3 --t-end 0.01 --solver direct";

/// Its message on stderr, if it ended with this code.
#[track_caller]
fn said(output: &Output, code: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    said
}

#[track_caller]
fn done(home: &Path, arguments: &str) {
    said(&curvelax(home, &format!("{arguments} --quiet")), 0);
}

/// All files below a folder, by name.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name().into_string().unwrap())).unwrap();
        match path.is_dir() {
            true => all.extend(content(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes))),
            false => drop(all.insert(name, fs::read(&path).unwrap())),
        }
    }
    all
}

/// `run.json` without what may differ: when it ran, how long it took, and the number of threads.
fn lasting(run: &[u8]) -> Value {
    let mut run: Value = serde_json::from_slice(run).unwrap();
    for key in ["started", "wall_seconds"] {
        run.as_object_mut().unwrap().remove(key).unwrap();
    }
    for part in ["spec", "platform"] {
        run[part].as_object_mut().unwrap().remove("threads");
    }
    run
}

/// The names of the files in which two runs differ.
fn differences(one: &Path, other: &Path) -> Vec<String> {
    let [mut one, mut other] = [one, other].map(content);
    let [own, others] = [&mut one, &mut other].map(|run| lasting(&run.remove("run.json").unwrap()));
    let names = one.keys().chain(other.keys().filter(|name| !one.contains_key(*name)));
    let mut differing: Vec<String> = names.filter(|name| one.get(*name) != other.get(*name)).cloned().collect();
    differing.extend((own != others).then(|| "run.json".to_string()));
    differing
}

/// Runs `study` in `count` shards and merges them to `out`.
fn sharded(home: &Path, study: &str, count: u64, out: &str) {
    for index in 0..count {
        // With other numbers of threads, members run in other batches.
        let threads = 1 + index % 3;
        done(home, &format!("run {study} --shard {index}/{count} --threads {threads} --out {out}-{count}/{index}"));
    }
    let shards: Vec<String> = (0..count).rev().map(|index| format!("{out}-{count}/{index}")).collect();
    done(home, &format!("merge {} --out {out}", shards.join(" ")));
}

#[test]
fn cells_with_common_random_numbers_are_paired_alike_in_one_run_in_shards_and_when_drawn_again() {
    let home = TempDir::new().unwrap();
    let study = "--backend cpu --curves 23 --points 34 --sweep adaptive=3e-2,1e-4 --common-random-numbers --t-end 0.88 \
                 --precision f64";
    let one = curvelax(home.path(), &format!("run {study} --out one --json"));
    let document: Value = serde_json::from_slice(&one.stdout).unwrap();
    assert_eq!(said(&one, 0).matches("warning").count(), 0);
    let paired = &document["paired"][0];
    assert_eq!((document["log_rank"].clone(), paired["cell"].as_u64()), (Value::Null, Some(1)));
    // The coarser tolerance errs to one side, and some members have not relaxed.
    let left_out: u64 =
        ["later", "earlier", "unknown"].iter().map(|kind| paired["left_out"][kind].as_u64().unwrap()).sum();
    assert_eq!(paired["pairs"].as_u64().unwrap() + left_out, 23, "{paired}");
    assert!(left_out > 0 && paired["p"].as_f64().unwrap() < 1e-3, "{paired}");
    assert!(paired["p"].as_f64().unwrap() > 0.0, "{paired}");
    for count in [2, 5] {
        let out = format!("merged-{count}");
        sharded(home.path(), study, count, &out);
        assert_eq!(differences(&home.path().join("one"), &home.path().join(&out)), [""; 0], "{count} shards");
    }
    let page = fs::read(home.path().join("one/report.html")).unwrap();
    assert!(String::from_utf8_lossy(&page).contains("t_relax minus that of the same member of cell 0"));
    done(home.path(), "plot one --out again");
    assert!(fs::read(home.path().join("again/report.html")).unwrap() == page, "redrawn pairs differ");
}

#[test]
fn merged_shards_are_the_files_of_one_run() {
    let home = TempDir::new().unwrap();
    for (store, tables) in [("csv", "parquet"), ("zarr", "csv")] {
        // A store needs one number of nodes, and has chunks of many members.
        let study = format!("{STUDY} --store {store} --tables {tables}");
        done(home.path(), &format!("run {study} --out {store}"));
        let one = home.path().join(store);
        for count in [1, 3, 8, 64] {
            let out = format!("{store}-merged-{count}");
            sharded(home.path(), &study, count, &out);
            assert_eq!(differences(&one, &home.path().join(&out)), [""; 0], "{count} shards, {store}");
        }
        // A different byte in any file is detected, and a number in run.json too.
        let merged = home.path().join(format!("{store}-merged-3"));
        for name in content(&merged).keys() {
            let path = merged.join(name);
            let text = fs::read(&path).unwrap();
            let mut changed = text.clone();
            match name.as_str() {
                "run.json" => {
                    changed = String::from_utf8(text.clone()).unwrap().replace("\"seed\": 1", "\"seed\": 2").into()
                }
                _ => changed[text.len() / 2] ^= 1,
            }
            fs::write(&path, &changed).unwrap();
            assert_eq!(differences(&one, &merged), std::slice::from_ref(name));
            fs::write(&path, text).unwrap();
        }
    }
}

#[test]
fn more_shards_than_files_may_be_open_are_joined() {
    let home = TempDir::new().unwrap();
    let study =
        "--backend cpu --curves 80 --points 34 --tau 1e-3 --t-end 0.001 --solver direct --snapshots 0 --store zarr";
    done(home.path(), &format!("run {study} --out one"));
    sharded(home.path(), study, 80, "all");
    fs::remove_dir_all(home.path().join("all")).unwrap();
    let merge = "ulimit -n 40; exec \"$0\" merge all-80/* --out all --quiet";
    let output = script("bash", home.path(), merge).output().unwrap();
    assert_eq!(said(&output, 0), "");
    assert_eq!(differences(&home.path().join("one"), &home.path().join("all")), [""; 0]);
}

#[test]
fn merged_shards_of_a_gpu_are_the_files_of_one_run() {
    if Gpu::list().is_empty() {
        assert!(std::env::var("ALLOW_NO_GPU").is_ok(), "no GPU; ALLOW_NO_GPU=1 leaves this out");
        return;
    }
    let home = TempDir::new().unwrap();
    // By number, which distinguishes adapters of the same name.
    let study = "--backend gpu --adapter 0 --precision f32 --curves 10 --points 34 --adaptive=1e-2 --stop-when-relaxed --series 0.1";
    done(home.path(), &format!("run {study} --out one"));
    sharded(home.path(), study, 3, "merged");
    assert_eq!(differences(&home.path().join("one"), &home.path().join("merged")), [""; 0]);
    // The CPU computes different digits in this precision.
    let other = study.replace("gpu --adapter 0", "cpu");
    done(home.path(), &format!("run {other} --shard 1/3 --out other"));
    let words = ["not of one study", "one was computed on cpu and the other on gpu"];
    refused(home.path(), "merge merged-3/0 other merged-3/2 --out no", &words);
}

#[test]
fn some_members_are_sharded_by_their_numbers() {
    let home = TempDir::new().unwrap();
    let study = format!("{SMALL} --only 1,3,4,10");
    done(home.path(), &format!("run {study} --out one"));
    for index in [0, 1, 3] {
        done(
            home.path(),
            &format!("run {study} --shard {index}/4 --out s/{index}").replace("0/4", "2/4").replace("s/0", "s/2"),
        );
    }
    refused(
        home.path(),
        &format!("run {SMALL} --shard 0/5 --only 1,3 --out no"),
        &["--shard 0/5: none of the 2 members to run belongs to it", "use fewer shards, or leave this one out"],
    );
    // 0/4 has member 4, and 2/4 has 10.
    refused(
        home.path(),
        "merge s/1 s/2 s/3 --out no",
        &["3 of 4 shards are done", "shard 0 of 4: not among the folders"],
    );
    done(home.path(), &format!("run {study} --shard 0/4 --out s/0"));
    done(home.path(), "merge s/0 s/1 s/2 s/3 --out merged");
    assert_eq!(differences(&home.path().join("one"), &home.path().join("merged")), [""; 0]);
}

/// Checks that a command ends with 2 and these words in its last line, and creates no folder `no`.
#[track_caller]
fn refused(home: &Path, arguments: &str, words: &[&str]) {
    let message = said(&curvelax(home, arguments), 2);
    let line = message.lines().last().unwrap_or_default();
    assert!(words.iter().all(|word| line.contains(word)), "{arguments}: {message}");
    assert!(!home.join("no").exists(), "{arguments}: something was written");
}

/// A lock as a run holds it. It ends with `unlock` at once. A file that is only dropped may live on for a moment in a
/// child that another test is starting.
fn locked(path: &Path) -> File {
    let lock = File::create(path).unwrap();
    lock.lock().unwrap();
    lock
}

/// The three shards of [`SMALL`] in `s/0`, `s/1`, `s/2`.
fn three() -> TempDir {
    let home = TempDir::new().unwrap();
    (0..3).for_each(|index| done(home.path(), &format!("run {SMALL} --shard {index}/3 --out s/{index}")));
    home
}

const MERGE: &str = "merge s/0 s/1 s/2 --out no";

#[test]
fn what_are_not_the_shards_of_one_study_is_refused_by_name() {
    let home = three();
    let path = home.path();
    let before = content(&path.join("s"));
    done(path, &format!("run {SMALL} --out whole"));
    done(path, &format!("run {SMALL} --seed 2 --shard 1/3 --out seed"));
    done(path, &format!("run {SMALL} --shard 1/4 --out quarter"));
    done(path, &format!("run {SMALL} --precision f32 --shard 1/3 --out f32"));
    fs::create_dir(path.join("empty")).unwrap();
    for (arguments, words) in [
        ("s/0 s/2", &["2 of 3 shards are done", "shard 1 of 3: not among the folders", "--missing"][..]),
        ("s/1", &["1 of 3 shards are done", "shards 0,2 of 3: not among the folders"]),
        ("s/0 s/1 s/2 s/1", &["s/1: shard 1/3 is duplicated in s/1; give one of them"]),
        ("s/0 s/2 seed", &["seed is of another study than s/0: seed is 2, and 1 there"]),
        ("s/0 s/2 quarter", &["quarter is of another study than s/0: it says shard 1/4, but 0/3 is there"]),
        ("s/0 s/2 f32", &["f32 is of another study than s/0: precision is \"f32\", and \"f64\" there"]),
        ("s/0 s/1 s/2 whole", &["whole: the run there is not a shard: it has no shard.state"]),
        ("s/0 s/1 nowhere", &["nowhere: no such folder", "shard 2 of 3"]),
        ("s/0 s/1 empty", &["empty: no shard was finished here"]),
        (
            "empty nowhere",
            &["no folder says which study it is a shard of: empty: no shard was", "nowhere: no such folder"],
        ),
        ("s/0 s/1 s/2/summary.csv", &["s/2/summary.csv: not a folder; give that of a shard"]),
    ] {
        refused(path, &format!("merge {arguments} --out no"), words);
    }
    for out in ["s/1", "s/1/deeper", "s/../s/1/plots/x"] {
        refused(path, &format!("merge s/0 s/1 s/2 --force --out {out}"), &["--out", "it is inside the shard s/1"]);
    }
    refused(path, "merge s/0 s/1 s/2 --out whole", &["--out whole: already exists"]);
    assert!(content(&path.join("s")) == before);
    done(path, MERGE);
    assert_eq!(differences(&path.join("whole"), &path.join("no")), [""; 0]);
}

#[test]
fn shards_that_are_not_what_they_were_are_refused_by_name() {
    let home = three();
    let path = home.path();
    let copies = |name: &str| fs::read(path.join(name)).unwrap();
    let spoil = |name: &str, bytes: &[u8], words: &[&str]| {
        let whole = copies(name);
        fs::write(path.join(name), bytes).unwrap();
        refused(path, MERGE, &[&[name][..], words].concat());
        fs::write(path.join(name), whole).unwrap();
    };
    let summary = copies("s/1/summary.csv");
    let mut other = summary.clone();
    other[summary.len() - 2] ^= 1;
    spoil("s/1/summary.csv", &summary[..summary.len() - 9], &["bytes, and the shard wrote", "copy the shard again"]);
    spoil("s/1/summary.csv", &other, &["its checksum differs", "copy it again"]);
    let text = String::from_utf8(summary.clone()).unwrap();
    let (member, cut) = (text.replacen("\n4,", "\n5,", 1), text.replace('\n', "x"));
    spoil("s/1/summary.csv", member.as_bytes(), &["a row that is of no member of shard 1/3"]);
    spoil("s/1/summary.csv", cut.as_bytes(), &["its last line is cut off"]);
    spoil("s/1/summary.csv", text.replacen("member", "mumber", 1).as_bytes(), &["its columns differ"]);
    let state = copies("s/2/shard.state");
    spoil("s/2/shard.state", &state[..state.len() / 2], &["it was cut off or changed"]);
    let mut bit = state.clone();
    bit[state.len() / 2] ^= 4;
    spoil("s/2/shard.state", &bit, &["its checksum is wrong"]);
    fs::rename(path.join("s/1/rates.csv"), path.join("rates")).unwrap();
    refused(path, MERGE, &["s/1/rates.csv: cannot be found"]);
    fs::rename(path.join("rates"), path.join("s/1/rates.csv")).unwrap();

    // Files that a merge makes anew, of another shard.
    for name in ["run.json", "plots/portraits.json"] {
        spoil(&format!("s/1/{name}"), &copies(&format!("s/2/{name}")), &["; copy the shard again, or run it again"]);
    }
    let run = String::from_utf8(copies("s/1/run.json")).unwrap();
    let began = &run[run.find("\"started\"").unwrap()..][..33];
    let later = run.replacen(began, "\"started\": \"1999-01-01T00:00:00Z\"", 1);
    spoil(
        "s/1/run.json",
        later.as_bytes(),
        &["of another run: begun at 1999-01-01T00:00:00Z, and that of shard.state"],
    );

    // Intact, but of another program, or from elsewhere.
    let record = shard::from_bytes(&state).unwrap();
    let older = envelope::sealed(*shard::LAYOUT, |bytes| postcard::to_extend(&("0.0.1", &record), bytes)).unwrap();
    spoil("s/2/shard.state", &older, &["it is of curvelax 0.0.1, and this is"]);
    let own = (env!("CARGO_PKG_VERSION"), &record);
    let built = envelope::sealed(*shard::LAYOUT ^ 1, |bytes| postcard::to_extend(&own, bytes)).unwrap();
    let layout = format!("and that of this build is {:08x}; copy the shard again, or run it again", *shard::LAYOUT);
    spoil("s/2/shard.state", &built, &["shard.state: another build of curvelax", &layout]);
    let mut elsewhere = record.clone();
    elsewhere.head.origin.platform.driver = Some("another".into());
    let elsewhere = shard::to_bytes(&elsewhere.head, elsewhere.points, &elsewhere.warnings).unwrap();
    fs::write(path.join("s/2/shard.state"), elsewhere).unwrap();
    refused(path, MERGE, &["s/2 and s/0 are not of one study: one was computed on cpu another and the other on cpu"]);
    fs::write(path.join("s/2/shard.state"), state).unwrap();

    // One that is running, and one that was interrupted.
    let lock = locked(&path.join("s/0/.curvelax.lock"));
    refused(path, MERGE, &["2 of 3 shards are done", "s/0: a run is writing here"]);
    lock.unlock().unwrap();
    fs::remove_file(path.join("s/0/.curvelax.lock")).unwrap();
    let long = SMALL.replace("1e-3", "1e-9").replace("0.01", "1");
    stopped_run(path, &format!("run {long} --shard 2/3"), "long");
    refused(path, "merge long --out no", &["shard 2/3: long: interrupted; curvelax resume long continues it"]);
    done(path, MERGE);
}

#[test]
fn what_is_missing_is_printed_with_the_line_that_submits_it() {
    let home = TempDir::new().unwrap();
    for index in [0, 2, 3, 9] {
        done(home.path(), &format!("run {SMALL} --shard {index}/12 --out s/{index}"));
    }
    let long = SMALL.replace("1e-3", "1e-9");
    stopped_run(home.path(), &format!("run {long} --shard 5/12"), "s/5");
    let printed = |arguments: &str| {
        let output = curvelax(home.path(), arguments);
        assert_eq!(said(&output, 0), "");
        String::from_utf8(output.stdout).unwrap()
    };
    let (five, all) = ("s/5", "s/0 s/2 s/3 s/9");
    let submit = "sbatch --array=1,4-8,10-11 --export=ALL,CURVELAX_SHARDS=12";
    let folders = "shards 1,4-8,10-11 of 12: not among the folders";
    assert_eq!(printed(&format!("merge --missing {all}")), format!("{folders}\n{submit} array.sh\n"));
    assert_eq!(printed(&format!("merge --missing --script job {all}")), format!("{folders}\n{submit} job\n"));
    assert_eq!(printed(&format!("merge --missing --script $job {all}")), format!("{folders}\n{submit} '$job'\n"));
    // An interrupted shard says which one it is.
    let words = "s/5 is of another study than s/0: tau is 0.000000001, and 0.001 there";
    refused(home.path(), &format!("merge --missing {all} {five}"), &[words]);
    let lines = printed(&format!("merge --missing {five}"));
    assert!(lines.starts_with("shard 5/12: s/5: interrupted; curvelax resume s/5 continues it\n"), "{lines}");
    for index in [1, 4, 5, 6, 7, 8, 10, 11] {
        done(home.path(), &format!("run {SMALL} --shard {index}/12 --out t/{index}"));
    }
    assert_eq!(
        printed(&format!("merge --missing {all} t/1 t/4 t/5 t/6 t/7 t/8 t/10 t/11")),
        "all 12 shards are present\n"
    );
}

#[cfg(unix)]
#[test]
fn missing_shards_among_a_billion_are_listed_as_ranges() {
    let home = TempDir::new().unwrap();
    let huge = "run --backend cpu --points 34 --tau 1e-3 --t-end 0.002 --curves 1000000000";
    let only = "--only 0,7,8,400000005,999999999";
    for (out, more) in [("all", ""), ("few", only)] {
        // Of a shard with one member.
        done(home.path(), &format!("{huge} {more} --shard 7/1000000000 --out {out}/7"));
    }
    let missing = |folder: &str| {
        // Listing each shard by number would take 8 GB.
        let line = "ulimit -v 1000000; exec \"$0\" merge --missing \"$1\"";
        let output = script("sh", home.path(), line).arg(folder).output().unwrap();
        assert_eq!(said(&output, 0), "");
        String::from_utf8(output.stdout).unwrap()
    };
    for (folder, ranges) in [("all/7", "0-6,8-999999999"), ("few/7", "0,8,400000005,999999999")] {
        let told = format!("shards {ranges} of 1000000000: not among the folders");
        let submit = format!("sbatch --array={ranges} --export=ALL,CURVELAX_SHARDS=1000000000 array.sh");
        assert_eq!(missing(folder), format!("{told}\n{submit}\n"));
    }
}

#[test]
fn a_task_of_a_job_array_knows_its_shard() {
    let home = TempDir::new().unwrap();
    let run = |variables: &[(&str, &str)]| {
        let mut job = command(home.path(), &format!("run {SMALL} --shard slurm --print-spec"));
        let output = job.envs(variables.iter().copied()).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(text).unwrap())
    };
    let array = |id, count, first, last| {
        let names = ["SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_MAX"];
        names.into_iter().zip([id, count, first, last]).collect::<Vec<_>>()
    };
    let (code, text) = run(&array("3", "8", "0", "7"));
    assert!(code == Some(0) && text.contains("shard = \"3/8\""), "{text}");
    // Some of them again.
    let (code, text) = run(&[&array("5", "2", "3", "5")[..], &[("CURVELAX_SHARDS", "8")]].concat());
    assert!(code == Some(0) && text.contains("shard = \"5/8\""), "{text}");
    for (variables, told) in [
        (array("5", "2", "3", "5"), "the array has 2 tasks from 3 to 5, and shards count from 0 to N - 1"),
        (array("8", "8", "1", "8"), "use --array=0-7, or export CURVELAX_SHARDS=N"),
        (Vec::new(), "no SLURM_ARRAY_TASK_ID: this is not a task of a Slurm job array"),
        (vec![("SLURM_ARRAY_TASK_ID", "8"), ("CURVELAX_SHARDS", "8")], "use I from 0 to 7"),
        (vec![("SLURM_ARRAY_TASK_ID", "8"), ("CURVELAX_SHARDS", "many")], "CURVELAX_SHARDS=many is not a whole number"),
    ] {
        let (code, text) = run(&variables);
        assert!(code == Some(2) && text.contains(told), "{text}");
    }
    for (shard, told) in [("3/3", "use I from 0 to 2"), ("0/0", "N from 1"), ("-1/3", "write I/N"), ("1", "write I/N")]
    {
        refused(home.path(), &format!("run {SMALL} --out no --shard {shard}"), &[]);
        let message = said(&curvelax(home.path(), &format!("run {SMALL} --out no --shard {shard}")), 2);
        assert!(message.contains(told), "{message}");
    }
    fs::write(home.path().join("spec.toml"), "shard = '4/4'\n").unwrap();
    let message = said(&curvelax(home.path(), "run spec.toml --out no"), 2);
    assert!(message.contains("use I from 0 to 3") && message.contains("shard = '4/4'"), "{message}");
}

#[test]
fn one_line_begins_a_run_continues_it_and_leaves_it() {
    let home = TempDir::new().unwrap();
    // A billion steps: it is never over.
    let long = SMALL.replace("1e-3", "1e-9").replace("0.01", "1");
    let line = format!("run {long} --only 1,3 --resume --out out");
    stopped_run(home.path(), &format!("run {long} --only 1,3 --resume"), "out");
    // An orphan of this job is still running.
    let lock = locked(&home.path().join("out/.curvelax.lock"));
    refused(home.path(), &line, &["out: a run is writing here"]);
    lock.unlock().unwrap();
    refused(
        home.path(),
        &format!("{line} --seed 2"),
        &["--resume: the run in out has another spec: seed is 1 there and 2 here"],
    );
    let message = said(&stopped_after(home.path(), &line, "resuming: "), 75);
    assert!(message.contains("resuming: 0 of 2 members finished"), "{message}");
    let short = format!("run {SMALL} --resume --out short");
    // A folder in which nothing was begun is not in the way.
    fs::create_dir(home.path().join("short")).unwrap();
    said(&curvelax(home.path(), &short), 0);
    let before = content(&home.path().join("short"));
    let message = said(&curvelax(home.path(), &short), 0);
    assert!(message.ends_with("note: the run in short is finished: nothing is left to do\n"), "{message}");
    refused(home.path(), &short.replace("1e-3", "2e-3"), &["tau is 0.001 there and 0.002 here"]);
    assert!(content(&home.path().join("short")) == before);
}
