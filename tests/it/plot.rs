//! Pictures drawn again from the files of a run.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    path::{Path, PathBuf},
    process::Output,
};

use tempfile::TempDir;

use crate::common::{
    command::curvelax,
    program::{Done, run},
};

/// A run with everything that `plot` reads: two cells, a series, and members that stay unfinished.
const RUN: &str = "--curves 3 --points 32 --adaptive=1e-3 --t-end 0.4 --series 0.1 --sweep omega=1,2 --event convex=k_min>=0 \
                   --event half=excess<=0.5*start";

#[track_caller]
fn plot(home: &Path, arguments: &str) -> Output {
    curvelax(home, &format!("plot {arguments}"))
}

/// Every file below `folder` with its bytes.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let below = |path: PathBuf| match path.is_dir() {
        true => files(&path),
        false => [(path.clone(), fs::read(&path).unwrap())].into(),
    };
    entries.flat_map(below).collect()
}

fn is_picture(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "svg" || extension == "html")
}

/// Names below `folder` and bytes of the pictures there.
fn pictures(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let all = files(folder).into_iter().filter(|(path, _)| is_picture(path));
    all.map(|(path, bytes)| (path.strip_prefix(folder).unwrap().into(), bytes)).collect()
}

#[test]
fn pictures_come_back_byte_for_byte() {
    for (arguments, count) in [
        ("--curves 7 --points 40 --adaptive=1e-3 --t-end 1", 9),
        ("--curves 1 --points 32 --t-end 0.01", 4),
        ("--curves 2 --points 32 --t-end 0.01", 9),
        (RUN, 11),
        ("--curves 5 --points 32 --tau 1e-3 --t-end 0.3 --series 0.013", 9),
        ("--curves 9 --points 32 --adaptive=1e-3 --t-end 0.3 --series 0.1 --only 2,5,7 --snapshots 0,0.1", 9),
        (
            "--curves 4 --points 32 --adaptive --t-end 0.3 --sweep amplitude=0.01,0.2,0.3 --sweep seed=1,2 --only 2,9",
            10,
        ),
        // Members that cross themselves and members that end badly.
        ("--curves 6 --points 64 --shape lemniscate:1 --sampling parameter --adaptive=1e-3 --t-end 0.1", 9),
        ("--curves 6 --points 32 --tau 0.05 --amplitude 0.4 --t-end 0.5 --solver direct", 8),
        ("--curves 3 --points 700 --adaptive=1e-2 --t-end 0.05 --shape nonconvex", 9),
    ] {
        let done = run(arguments);
        let drawn = pictures(&done.path());
        assert_eq!(drawn.len(), count, "{arguments}: {:?}", drawn.keys());
        for path in drawn.keys() {
            fs::write(done.path().join(path), "old").unwrap();
        }
        let kept = files(&done.path());
        let output = plot(done.home.path(), "out");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && message.is_empty(), "{arguments}: {message}");
        for (path, bytes) in pictures(&done.path()) {
            assert!(drawn[&path] == bytes, "{arguments}: {}", path.display());
        }
        let now = files(&done.path());
        assert_eq!(now.len(), kept.len(), "{arguments}");
        assert!(now.iter().all(|(path, bytes)| is_picture(path) || kept[path] == *bytes), "{arguments}");
    }
}

#[test]
fn runs_with_bad_members_are_among_those_that_were_drawn_again() {
    let statuses = |arguments| run(arguments).text("run.json");
    let crossed = run("--curves 6 --points 64 --shape lemniscate:1 --sampling parameter --adaptive=1e-3 --t-end 0.1");
    assert!(crossed.summary().iter().any(|row| !row["self_crossing"].is_empty()));
    let bad = statuses("--curves 6 --points 32 --tau 0.05 --amplitude 0.4 --t-end 0.5 --solver direct");
    assert!(bad.contains(" failed (see") || bad.contains("metric drift"), "{bad}");
}

#[test]
fn the_picture_in_the_readme_is_that_of_its_run() {
    let kept = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/images/ellipses.svg")).unwrap();
    let drawn = run("--curves 12").text("plots/curves.svg");
    assert!(drawn == kept, "docs/images/ellipses.svg is old: copy plots/curves.svg of curvelax run --curves 12");
    assert!(drawn != run("--curves 12 --seed 2").text("plots/curves.svg"));
}

#[test]
fn pictures_can_be_drawn_elsewhere() {
    let done = run(RUN);
    let before = files(&done.path());
    let output = plot(done.home.path(), "out --out new/place");
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.starts_with("results    new/place: plots/relaxation.svg"), "{table}");
    assert_eq!(pictures(&done.home.path().join("new/place")), pictures(&done.path()));
    assert_eq!(files(&done.path()), before);
    assert_eq!(files(&done.home.path().join("new")).len(), pictures(&done.path()).len());
    let again = plot(done.home.path(), "out --out new/place");
    assert_eq!(again.status.code(), Some(2), "it exists");
    assert!(plot(done.home.path(), "out --out new/place --force --quiet").stdout.is_empty());
}

#[test]
fn pictures_follow_the_tables() {
    let done = run(RUN);
    let before = pictures(&done.path());
    let path = done.path().join("summary.csv");
    let mut rows: Vec<Vec<String>> =
        done.text("summary.csv").lines().map(|row| row.split(',').map(String::from).collect()).collect();
    let drift = rows[0].iter().position(|name| name == "metric_drift").unwrap();
    rows[1][drift] = "0.2".into();
    fs::write(path, rows.iter().map(|row| row.join(",") + "\n").collect::<String>()).unwrap();
    assert!(plot(done.home.path(), "out").status.success());
    let mesh = Path::new("plots/mesh.svg");
    assert!(before[mesh] != pictures(&done.path())[mesh]);
}

/// Checks that a run changed by `spoil` is refused with the words `said`, and nothing is written.
#[track_caller]
fn refused(done: &Done, spoil: impl FnOnce(&Path), said: &str) {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    fs::create_dir_all(out.join("plots")).unwrap();
    for (path, bytes) in files(&done.path()) {
        fs::write(out.join(path.strip_prefix(done.path()).unwrap()), bytes).unwrap();
    }
    assert!(plot(home.path(), "out").status.success(), "it was no run before");
    spoil(&out);
    let before = files(home.path());
    for arguments in ["out", "out --out new/elsewhere"] {
        let output = plot(home.path(), arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}: {message}");
        assert!(message.starts_with("error: ") && message.contains(said), "{said}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(
            output.stdout.is_empty() && files(home.path()) == before && !home.path().join("new").exists(),
            "{said}"
        );
    }
}

/// Replaces a field of a table; row and column are counted from 0, the header being row 0.
fn field(path: &Path, row: usize, column: usize, value: &str) {
    let text = fs::read_to_string(path).unwrap();
    let mut rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    rows[row][column] = value;
    fs::write(path, rows.iter().map(|row| row.join(",") + "\n").collect::<String>()).unwrap();
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from} is not in {}", path.display());
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

fn shortened(path: &Path, by: usize) {
    let bytes = fs::read(path).unwrap();
    fs::write(path, &bytes[..bytes.len() - by]).unwrap();
}

#[test]
fn events_that_are_not_those_of_the_run_are_refused_with_their_place() {
    let done = run(RUN);
    let events = |out: &Path| out.join("events.csv");
    let last = done.text("events.csv").lines().last().unwrap().len() + 1;
    let missing = "out/events.csv: expected the events of member 5, found the end of the file";
    refused(&done, |out| shortened(&events(out), last), missing);
    refused(&done, |out| fs::remove_file(events(out)).unwrap(), "cannot read out/events.csv: ");
    for (column, value, expected) in [
        (0, "1", "column member: expected member 0, as the other table has it, found `1`"),
        (2, "concave", "column event: expected convex, found `concave`"),
        (
            3,
            "0.41",
            "column t: expected a time up to the end of the member, or that end if censored is 1, found `0.41`",
        ),
    ] {
        refused(&done, |out| field(&events(out), 1, column, value), &format!("out/events.csv, line 2, {expected}"));
    }
    let more = |out: &Path| {
        let text = fs::read_to_string(events(out)).unwrap();
        fs::write(events(out), text + "6,1,convex,0.1,0,,\n").unwrap();
    };
    refused(&done, more, "out/events.csv, line 14, column member: expected the end of the file, found `6`");
    // Where the other table lacks a row, it is that one that is named.
    let without = |out: &Path, name: &str, row: usize| {
        let text = fs::read_to_string(out.join(name)).unwrap();
        let kept = text.lines().enumerate().filter(|(line, _)| *line != row);
        fs::write(out.join(name), kept.map(|(_, row)| format!("{row}\n")).collect::<String>()).unwrap();
    };
    let lacking =
        "out/summary.csv: expected another row of member 2, which out/events.csv has, found member 3; restore";
    refused(&done, |out| without(out, "summary.csv", 3), lacking);
    let done = run(&format!("{} --refine", RUN.replace("--points 32", "--points 64")));
    let rows = done.text("levels.csv").lines().count();
    for (row, found) in [(2, "member "), (rows - 1, "the end of the file; restore")] {
        let member = done.text("levels.csv").lines().nth(row).unwrap().split(',').next().unwrap().to_string();
        let lacking = format!(
            "out/levels.csv: expected another row of member {member}, which out/event_levels.csv has, found {found}"
        );
        refused(&done, |out| without(out, "levels.csv", row), &lacking);
    }
}

#[test]
fn a_summary_that_is_not_whole_is_refused_with_its_place() {
    let done = run(RUN);
    let summary = |out: &Path| out.join("summary.csv");
    let last = done.text("summary.csv").lines().last().unwrap().len() + 1;
    let rest = "restore the file, or run again";
    refused(
        &done,
        |out| shortened(&summary(out), 30),
        "out/summary.csv, line 7: expected an end of line, found the end",
    );
    refused(&done, |out| shortened(&summary(out), 1), "it was cut off");
    refused(&done, |out| shortened(&summary(out), last), "out/summary.csv: expected 6 rows by run.json, found 5");
    refused(&done, |out| fs::write(summary(out), "").unwrap(), "it was cut off");
    let other = |column: &str, value: &str| {
        let mut rows: Vec<Vec<String>> =
            done.text("summary.csv").lines().map(|row| row.split(',').map(String::from).collect()).collect();
        let at = rows[0].iter().position(|name| name == column).unwrap();
        rows[3][at] = value.into();
        rows.iter().map(|row| row.join(",") + "\n").collect::<String>()
    };
    let late = "out/summary.csv, line 4, column t_relax: expected a time up to 0.4, the end of the run, found `7.5`";
    refused(&done, |out| fs::write(summary(out), other("t_relax", "7.5")).unwrap(), late);
    let bytes = [other("status", "@").replace('@', "rel\u{fffd}").as_bytes(), b""].concat();
    let broken: Vec<u8> = bytes.iter().copied().filter(|byte| *byte != 0xbf).collect();
    refused(&done, |out| fs::write(summary(out), broken).unwrap(), "out/summary.csv, line 4: not UTF-8: save it as");
    refused(&done, |out| fs::remove_file(summary(out)).unwrap(), "cannot read out/summary.csv: ");
    refused(
        &done,
        |out| replace(&summary(out), "member,cell,status", "member,cell,state"),
        "out/summary.csv, line 1, column status: expected the heading `status`, found `state`",
    );
    refused(&done, |out| replace(&summary(out), ",self_crossing", ""), "line 1: expected 39 fields, found 38");
    refused(&done, |out| replace(&summary(out), "\n2,0,", "\n2,0,0,"), "line 4: expected 39 fields, found 40");
    refused(
        &done,
        |out| field(&summary(out), 3, 13, "long"),
        "out/summary.csv, line 4, column length_end: expected a number or nothing, found `long`",
    );
    for number in ["NaN", "inf", "-inf", "1e999", "0x1", " 1"] {
        refused(
            &done,
            |out| field(&summary(out), 2, 8, number),
            "line 3, column t_relax: expected a number or nothing",
        );
    }
    refused(&done, |out| field(&summary(out), 2, 9, "-1"), "column t_half: expected a time or nothing, found `-1`");
    refused(&done, |out| field(&summary(out), 2, 3, ""), "column t_end: expected a time, found ``");
    refused(&done, |out| field(&summary(out), 2, 4, "1.5"), "column steps: expected a whole number, found `1.5`");
    refused(&done, |out| field(&summary(out), 2, 2, "Relaxed"), "expected relaxed, unfinished, singular");
    refused(&done, |out| field(&summary(out), 2, 0, "0"), "expected a member after 0: members ascend, each once");
    refused(
        &done,
        |out| field(&summary(out), 6, 0, "6"),
        "line 7, column member: expected a member below 6, found `6`",
    );
    refused(&done, |out| field(&summary(out), 6, 1, "9"), "column cell: expected 1, the cell of member 5, found `9`");
    refused(&done, |out| field(&summary(out), 1, 4, "1"), "steps by run.json");
    refused(&done, |out| field(&summary(out), 1, 2, "stalled"), "members by run.json");
    refused(&done, |out| fs::write(summary(out), [0xff, b'\n']).unwrap(), rest);
}

#[test]
fn areas_and_rates_at_the_ends_of_the_floats_are_drawn() {
    let done = run("--curves 3 --points 32 --adaptive=1e-3 --t-end 2");
    let (area_start, rate) = (14, 10);
    assert!(done.summary().iter().all(|row| !row["rate"].is_empty()));
    for (column, value) in [(area_start, "1e-320"), (area_start, "1e308"), (rate, "-1.7e308"), (area_start, "0.0")] {
        field(&done.path().join("summary.csv"), 2, column, value);
        let output = plot(done.home.path(), "out --quiet");
        assert_eq!(output.status.code(), Some(0), "{value}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn a_mean_excess_that_is_not_that_of_the_run_is_refused() {
    let done = run(RUN);
    let table = |out: &Path| out.join("mean_excess.csv");
    let last = done.text("mean_excess.csv").lines().last().unwrap().len() + 1;
    refused(&done, |out| shortened(&table(out), last), "out/mean_excess.csv: expected 66 rows by run.json, found 65");
    refused(&done, |out| shortened(&table(out), 5), "out/mean_excess.csv, line 67: expected an end of line");
    refused(&done, |out| field(&table(out), 7, 3, "x"), "out/mean_excess.csv, line 8, column mean: expected a number");
    refused(&done, |out| field(&table(out), 7, 1, "0"), "column t: expected a time after ");
    refused(&done, |out| fs::remove_file(table(out)).unwrap(), "cannot read out/mean_excess.csv: ");
}

#[test]
fn features_that_are_not_those_of_the_run_are_refused() {
    let done = run(RUN);
    let table = |out: &Path| out.join("members.csv");
    let last = done.text("members.csv").lines().last().unwrap().len() + 1;
    refused(&done, |out| shortened(&table(out), last), "out/members.csv: expected a row of member 5, found the end");
    refused(&done, |out| shortened(&table(out), 5), "out/members.csv, line 7: expected an end of line");
    refused(&done, |out| field(&table(out), 3, 3, "x"), "out/members.csv, line 4, column cos_2: expected a number");
    refused(&done, |out| field(&table(out), 3, 0, "3"), "column member: expected 2, as in summary.csv, found `3`");
    refused(&done, |out| field(&table(out), 3, 1, "1"), "column cell: expected 0, as in summary.csv, found `1`");
    refused(
        &done,
        |out| field(&table(out), 0, 3, "cos_3"),
        "column cos_2: expected the heading `cos_2`, found `cos_3`",
    );
    refused(&done, |out| fs::remove_file(table(out)).unwrap(), "cannot read out/members.csv: ");
}

#[test]
fn what_is_no_finished_run_of_this_program_is_refused() {
    let done = run(RUN);
    let json = |out: &Path| out.join("run.json");
    refused(&done, |out| fs::remove_dir_all(out).unwrap(), "out: no such folder; give that of a run");
    refused(&done, |out| fs::remove_file(json(out)).unwrap(), "out: no run there; give its folder (no run.json)");
    let unfinished = |out: &Path| {
        fs::remove_file(json(out)).unwrap();
        fs::rename(out.join("summary.csv"), out.join(".summary.csv.part")).unwrap();
    };
    refused(&done, unfinished, "out: the run there has not finished; curvelax resume out continues it");
    // The same folder while a run writes there.
    let in_use = TempDir::new().unwrap();
    fs::create_dir(in_use.path().join("out")).unwrap();
    fs::write(in_use.path().join("out/.summary.csv.part"), "").unwrap();
    let lock = File::create(in_use.path().join("out/.curvelax.lock")).unwrap();
    lock.try_lock().unwrap();
    let said = curvelax(in_use.path(), "plot out");
    let text = String::from_utf8_lossy(&said.stderr);
    let expected = "error: out: a run in progress is writing here; wait until it has ended (no run.json)\n";
    assert_eq!((said.status.code(), &*text), (Some(2), expected));
    refused(
        &done,
        |out| fs::write(json(out), "{\"name\": \"other\"}").unwrap(),
        "out/run.json: not written by curvelax",
    );
    refused(&done, |out| fs::write(json(out), "[]").unwrap(), "out/run.json: not written by curvelax");
    refused(&done, |out| fs::write(json(out), "curvelax").unwrap(), "out/run.json: expected a value at line 1");
    refused(
        &done,
        |out| replace(&json(out), "\"format\": 1", "\"format\": 2"),
        "out/run.json: expected format 1 at most, found 2",
    );
    refused(
        &done,
        |out| replace(&json(out), "  \"format\": 1,\n", ""),
        "a whole number from 1 under `format`, found none",
    );
    refused(
        &done,
        |out| replace(&json(out), "\"format\": 1", "\"format\": \"x\""),
        "a whole number from 1 under `format`, found \"x\"",
    );
    refused(&done, |out| replace(&json(out), "\"points\": 32", "\"points\": 1"), "out/run.json, spec: --points 1: ");
    refused(
        &done,
        |out| replace(&json(out), "\"points\": 32", "\"points\": \"n\""),
        "expected a whole number from 0, found the text \"n\" at line ",
    );
    refused(&done, |out| shortened(&json(out), 40), "out/run.json: it ends inside");
    let portraits = |out: &Path| out.join("plots/portraits.json");
    refused(&done, |out| shortened(&portraits(out), 40), "out/plots/portraits.json: it ends inside");
    refused(&done, |out| replace(&portraits(out), "\"nodes\":[\"", "\"nodes\":[\"!"), "portraits.json, member 0: ");
}

#[test]
fn a_run_without_portraits_is_drawn_without_them() {
    let done = run(RUN);
    fs::remove_file(done.path().join("plots/portraits.json")).unwrap();
    let output = plot(done.home.path(), "out --out new");
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.starts_with("note: no plots/portraits.json in out"), "{message}");
    assert_eq!(pictures(&done.home.path().join("new")).len(), pictures(&done.path()).len() - 1);
}
