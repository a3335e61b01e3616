//! `curvelax resume` as a user meets it: what it resumes, what it refuses, and where it continues.

use std::{
    fs,
    path::Path,
    process::{Output, Stdio},
};

use tempfile::TempDir;

use crate::common::command::{command, curvelax, script, signalled_when, stopped_after, stopped_run, stopped_when};

/// A billion steps, about an hour: it is stopped.
const LONG: &str = "--curves 3 --points 34 --tau 1e-9 --t-end 1 --solver direct --series 0.1";

#[track_caller]
fn said(output: &Output, code: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    said
}

fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
    let mut all: Vec<_> = entries.map(|path| (path.display().to_string(), fs::read(path).unwrap())).collect();
    all.sort();
    all
}

/// Checks that `resume ARGUMENTS` is refused with these words, and leaves the folder unchanged.
#[track_caller]
fn refused(home: &Path, run: &str, arguments: &str, words: &[&str]) {
    let before = contents(&home.join(run));
    let message = said(&curvelax(home, &format!("resume {run} {arguments}")), 2);
    let line = message.lines().last().unwrap_or_default();
    assert!(line.starts_with("error: ") && words.iter().all(|word| line.contains(word)), "{message}");
    assert!(contents(&home.join(run)) == before, "{words:?}");
}

#[test]
fn what_is_no_interrupted_run_is_refused_or_left_alone() {
    let home = TempDir::new().unwrap();
    refused_place(home.path(), "nowhere", "no such folder");
    fs::create_dir(home.path().join("empty")).unwrap();
    refused(home.path(), "empty", "", &["empty: no run was started here", "--force"]);
    let small = "run --backend cpu --curves 2 --points 34 --t-end 0.01 --out done --quiet";
    said(&curvelax(home.path(), small), 0);
    let before = contents(&home.path().join("done"));
    // --force would refuse its tables.
    fs::create_dir(home.path().join("tables")).unwrap();
    fs::write(home.path().join("tables/summary.csv"), "a\n").unwrap();
    refused(
        home.path(),
        "tables",
        "",
        &["tables: no run was started here; start one with curvelax run in another folder"],
    );
    let message = said(&curvelax(home.path(), "resume done"), 0);
    assert_eq!(message, "note: the run in done is finished: nothing is left to do\n");
    assert!(contents(&home.path().join("done")) == before);
}

#[track_caller]
fn refused_place(home: &Path, run: &str, words: &str) {
    let message = said(&curvelax(home, &format!("resume {run}")), 2);
    assert!(message.starts_with(&format!("error: {run}: {words}")), "{message}");
    assert!(!home.join(run).exists());
}

#[test]
fn a_run_resumes_from_what_it_read_of_its_outline_wherever_that_is() {
    let home = TempDir::new().unwrap();
    let (begun, elsewhere) = (home.path().join("begun"), home.path().join("elsewhere"));
    [&begun, &elsewhere].into_iter().for_each(|folder| fs::create_dir(folder).unwrap());
    let square = "x,y\n0,0\n1,0\n1,1\n0,1\n";
    fs::write(begun.join("square.csv"), square).unwrap();
    // A different outline of this name is where it is resumed.
    fs::write(elsewhere.join("square.csv"), "x,y\n0,0\n2,0\n0,1\n").unwrap();
    let run = format!("run --backend cpu --shape file:square.csv {LONG}");
    stopped_run(&begun, &run, "out");
    let resumed = |run: &str| {
        let message = said(&stopped_after(&elsewhere, &format!("resume {run}"), "resuming: "), 75);
        assert!(message.contains("resuming: 0 of 3 members") && !message.contains("warning"), "{message}");
    };
    fs::write(begun.join("square.csv"), square.replace("1,1", "1,1.5")).unwrap();
    resumed("../begun/out");
    fs::remove_file(begun.join("square.csv")).unwrap();
    resumed("../begun/out");
    fs::rename(&begun, home.path().join("moved")).unwrap();
    resumed("../moved/out");
}

#[test]
fn a_damaged_copy_of_the_outlines_is_replaced_by_their_files() {
    let home = TempDir::new().unwrap();
    let square = "x,y\n0,0\n1,0\n1,1\n0,1\n";
    fs::write(home.path().join("square.csv"), square).unwrap();
    stopped_run(home.path(), &format!("run --backend cpu --shape file:square.csv {LONG}"), "out");
    let copy = home.path().join("out/.curvelax.outlines");
    let mut bytes = fs::read(&copy).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&copy, bytes).unwrap();
    let message = said(&stopped_after(home.path(), "resume out", "resuming: "), 75);
    let warning =
        "warning: out: .curvelax.outlines: its checksum is wrong; the outlines are read from their files again";
    assert!(message.contains(warning), "{message}");
    fs::write(home.path().join("square.csv"), square.replace("1,1", "1,1.5")).unwrap();
    refused(home.path(), "out", "", &["square.csv has changed or disappeared since the run began"]);
    fs::remove_file(&copy).unwrap();
    refused(home.path(), "out", "", &["square.csv has changed or disappeared since the run began"]);
}

#[test]
fn run_resume_compares_the_outline_and_the_back_end_that_it_is_asked_for() {
    let home = TempDir::new().unwrap();
    let [a, b] = ["a", "b"].map(|name| home.path().join(name));
    [&a, &b].into_iter().for_each(|folder| fs::create_dir(folder).unwrap());
    let square = "x,y\n0,0\n1,0\n1,1\n0,1\n";
    fs::write(a.join("square.csv"), square).unwrap();
    fs::write(b.join("square.csv"), square.replace("1,1", "1,1.5")).unwrap();
    let study = format!("run --shape file:square.csv {LONG} --resume");
    let line = |folder: &str, more: &str| format!("{study} --out {folder}out {more}");
    stopped_run(&a, &format!("{study} --backend cpu"), "out");
    let message = said(&curvelax(&b, &line("../a/", "--backend cpu")), 2);
    assert!(message.contains("square.csv has changed or disappeared since the run began"), "{message}");
    // The same outline is resumed from elsewhere.
    fs::write(b.join("square.csv"), square).unwrap();
    said(&stopped_after(&b, &line("../a/", "--backend cpu"), "resuming: "), 75);
    said(&stopped_after(&a, &line("", ""), "resuming: "), 75);
    // Whether or not there is a GPU.
    let message = said(&curvelax(&a, &line("", "--backend gpu")), 2);
    let told = ["the run in out is on the cpu; leave out --backend", "no GPU adapter"];
    assert!(told.iter().any(|told| message.contains(told)), "{message}");
}

#[test]
fn a_finished_run_answers_again_with_its_results_and_its_failures() {
    let home = TempDir::new().unwrap();
    let line = "run --backend cpu --curves 4 --points 60 --tau 0.02 --t-end 1 --shape astroid --out bad";
    let first = curvelax(home.path(), &format!("{line} --strict --json"));
    said(&first, 3);
    let json = |output: &Output| serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap();
    for again in ["resume bad --strict --json", &format!("{line} --resume --strict --json")] {
        let output = curvelax(home.path(), again);
        assert!(said(&output, 3).contains("--strict: 4 of 4 members ended neither relaxed nor unfinished"), "{again}");
        assert_eq!(json(&output), json(&first), "{again}");
    }
    let output = curvelax(home.path(), "resume bad --json");
    assert!(said(&output, 3).contains("error: every member failed (4 "));
    assert_eq!(json(&output), json(&first));
    assert_eq!(curvelax(home.path(), "resume bad").stdout, b"");
}

#[test]
fn members_that_end_as_they_are_made_are_kept_too() {
    let home = TempDir::new().unwrap();
    let round = "run --backend cpu --shape circle:1 --amplitude 0 --stop-when-relaxed --curves 300000000 --out out";
    let table = home.path().join("out/.summary.csv.part");
    let has_rows = || fs::read_to_string(&table).is_ok_and(|text| text.lines().count() > 1);
    let mut message = said(&stopped_when(home.path(), round, has_rows), 75);
    let again = || {
        let mut resume = command(home.path(), "resume out");
        said(&signalled_when(&mut resume, "TERM", |said| said.contains("resuming: ") && has_rows()), 75)
    };
    // A machine that is very busy ends it before its state is saved.
    while message.contains(" at once; ") {
        message = again();
    }
    message = again();
    assert!(message.contains("resuming: ") && !message.contains("resuming: 0 of"), "{message}");
}

#[cfg(unix)]
mod unix {
    use std::{
        ffi::OsStr,
        os::unix::{ffi::OsStrExt, fs::symlink},
        process::Command,
        thread,
        time::Duration,
    };

    use super::*;
    use crate::common::command::{handling, signal};

    /// A run that is resumed to its end.
    const SHORT: &str = "--curves 3 --points 34 --tau 2.5e-6 --t-end 1 --solver direct --series 0.1";

    /// Leaves in `home` a run that was stopped in progress.
    fn stopped(home: &Path) {
        stopped_run(home, &format!("run --backend cpu {SHORT}"), "out");
    }

    /// The message of a run with a checkpoint in `out` that received these signals, one after another.
    #[track_caller]
    fn stopped_by(mut command: Command, out: &Path, signals: &[&str]) -> String {
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let state = out.join(".curvelax.state");
        while !state.exists() && child.try_wait().unwrap().is_none() {
            thread::sleep(Duration::from_millis(1));
        }
        signals.iter().for_each(|name| signal(&mut child, name));
        said(&child.wait_with_output().unwrap(), 75)
    }

    #[test]
    fn a_run_continues_on_its_back_end_unless_another_is_requested() {
        let home = TempDir::new().unwrap();
        stopped(home.path());
        // As if it had begun on another machine: the platform is in the checkpoint, which has a checksum.
        let state = home.path().join("out/.curvelax.state");
        let (mut head, progress) = curvelax::files::state::checkpoint::from_bytes(&fs::read(&state).unwrap()).unwrap();
        head.origin.platform.driver = Some("another".into());
        let resident = progress.resident.clone().unwrap();
        fs::write(&state, curvelax::files::state::checkpoint::to_bytes(&head, &progress, &resident).unwrap()).unwrap();
        let words = ["the run began on cpu another", "continue on cpu", "add --backend cpu"];
        refused(home.path(), "out", "", &words);
        let message = said(&curvelax(home.path(), "resume out --backend cpu"), 0);
        assert!(message.contains("resuming: ") && message.contains(" of 3 members"), "{message}");
        let run = fs::read_to_string(home.path().join("out/run.json")).unwrap();
        assert!(run.contains("\"the run began on cpu another and continued on cpu\""), "{run}");
        assert!(!home.path().join("out/.curvelax.state").exists());
    }

    #[test]
    fn a_project_that_was_moved_resumes_to_the_same_bytes() {
        let home = TempDir::new().unwrap();
        let (before, after, whole) = (home.path().join("a"), home.path().join("b"), home.path().join("whole"));
        let project = |folder: &Path| {
            fs::create_dir(folder).unwrap();
            fs::write(folder.join("one.csv"), "x,y\n0,0\n1,0\n1,1\n0,1\n").unwrap();
            fs::write(folder.join("two.csv"), "x,y,kind\n0,0,b\n3,0,b\n0,1,b\n").unwrap();
        };
        project(&before);
        let short = SHORT.replace("--curves 3", "--group-by file");
        let run = format!("run --backend cpu --shape files:*.csv {short}");
        stopped_run(&before, &run, "out");
        let out = before.join("out");
        assert!(out.join(".curvelax.outlines").exists());
        fs::rename(&before, &after).unwrap();
        // Neither found nor needed.
        fs::rename(after.join("two.csv"), after.join("three.csv")).unwrap();
        let message = said(&curvelax(home.path(), "resume b/out"), 0);
        assert!(message.contains("resuming: ") && message.contains("of 2 members"), "{message}");
        project(&whole);
        said(&curvelax(&whole, &format!("{run} --out out")), 0);
        let tables = |project: &Path| -> Vec<(String, Vec<u8>)> {
            let named = |(path, bytes): (String, Vec<u8>)| (path.rsplit('/').next().unwrap().to_string(), bytes);
            let all = contents(&project.join("out")).into_iter().map(named);
            all.filter(|(name, _)| !["run.json", "report.html"].contains(&name.as_str())).collect()
        };
        let names = |all: &[(String, Vec<u8>)]| all.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        let (moved, straight) = (tables(&after), tables(&whole));
        assert_eq!(names(&moved), names(&straight), "no copy of the outlines is left");
        moved.iter().zip(&straight).for_each(|(a, b)| assert!(a == b, "{} differs", a.0));
    }

    #[test]
    fn json_and_strict_are_those_of_a_run() {
        let home = TempDir::new().unwrap();
        stopped(home.path());
        let output = curvelax(home.path(), "resume out --json --quiet");
        assert_eq!(said(&output, 0), "");
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(json["members"], 3, "{json}");
    }

    #[test]
    fn what_is_ignored_from_outside_stays_ignored() {
        let home = TempDir::new().unwrap();
        let ignoring = format!("trap '' HUP; exec \"$0\" run --backend cpu {LONG} --out out");
        let ignoring = script("sh", home.path(), &ignoring);
        let message = stopped_by(ignoring, &home.path().join("out"), &["HUP", "TERM"]);
        assert!(message.contains("stopped by SIGTERM"), "{message}");
        // If these tests run under nohup, it would be ignored here too.
        let Some(mut handled) = handling(home.path(), "HUP") else { return };
        handled.args(format!("run --backend cpu {LONG} --out handled").split_whitespace());
        let message = stopped_by(handled, &home.path().join("handled"), &["HUP"]);
        assert!(message.contains("stopped by SIGHUP"), "{message}");
    }

    #[test]
    fn a_link_in_the_place_of_a_table_is_not_followed() {
        let home = TempDir::new().unwrap();
        stopped_run(home.path(), &format!("run --backend cpu {LONG}"), "out");
        let (part, mine) = (home.path().join("out/.summary.csv.part"), home.path().join("mine"));
        let table = fs::read(&part).unwrap();
        fs::write(&mine, [&table[..], b"and mine"].concat()).unwrap();
        fs::remove_file(&part).unwrap();
        symlink(&mine, &part).unwrap();
        refused(home.path(), "out", "", &[".summary.csv.part is a link, which no run writes"]);
        assert!(fs::read(&mine).unwrap().ends_with(b"and mine"));
    }

    #[test]
    fn a_folder_of_any_name_will_do() {
        let home = TempDir::new().unwrap();
        let odd = home.path().join(OsStr::from_bytes(b"caf\xe9"));
        if let Err(error) = fs::create_dir(&odd) {
            eprintln!("this file system has no such names ({error}): nothing is tested");
            return;
        }
        stopped_run(&odd, &format!("run --backend cpu {LONG}"), "out");
        said(&stopped_after(&odd, "resume out", "resuming: "), 75);
        fs::write(odd.join("square.csv"), "x,y\n0,0\n1,0\n1,1\n0,1\n").unwrap();
        let message = said(&curvelax(&odd, "run --backend cpu --shape file:square.csv --curves 1 --out named"), 2);
        assert!(message.contains("has a name that is not UTF-8"), "{message}");
        assert!(!odd.join("named").exists());
    }
}

/// A user copies the line that a message proposes.
#[test]
#[cfg(unix)]
fn proposed_commands_are_those_of_any_folder_in_a_shell() {
    let home = TempDir::new().unwrap();
    let out = "-it's $HOME\n`x`";
    let given = format!("--out={out}");
    let state = home.path().join(out).join(".curvelax.state");
    let mut run = command(home.path(), &format!("run --backend cpu {LONG} --quiet"));
    run.arg(&given);
    let proposed = |message: &str| {
        let (_, rest) = message.split_once("curvelax resume ").unwrap_or_else(|| panic!("{message}"));
        rest.split_once(" continues").unwrap_or_else(|| panic!("{message}")).0.to_string()
    };
    let stopped = said(&signalled_when(&mut run, "TERM", |_| state.exists()), 75);
    assert_eq!(stopped.lines().count(), 1, "{stopped}");
    let word = proposed(&stopped);
    let exists = said(&run.stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap(), 2);
    let mut plot = command(home.path(), "plot");
    let unfinished = said(&plot.arg(format!("./{out}")).output().unwrap(), 2);
    assert_eq!([proposed(&exists), proposed(&unfinished)], [word.as_str(), &word]);
    let mut line = script("bash", home.path(), &format!("exec \"$0\" resume {word}"));
    let resumed = signalled_when(&mut line, "TERM", |said| said.contains("resuming: "));
    assert!(said(&resumed, 75).contains("resuming: "), "{word}");
}

#[test]
fn a_resumed_run_says_why_it_is_on_its_back_end_as_the_run_did() {
    let home = TempDir::new().unwrap();
    let device = |said: &str| said.lines().find(|line| line.starts_with("back end: ")).map(str::to_owned).unwrap();
    for (flags, asked) in [("", false), ("--backend cpu", true)] {
        let first = device(&said(&stopped_run(home.path(), &format!("run {LONG} {flags}"), "out"), 75));
        let mut again = command(home.path(), "resume out");
        let again = device(&said(&signalled_when(&mut again, "TERM", |said| said.contains("back end: ")), 75));
        assert_eq!(first.contains("asked for"), asked, "{first}");
        assert_eq!(first, again);
        fs::remove_dir_all(home.path().join("out")).unwrap();
    }
}
