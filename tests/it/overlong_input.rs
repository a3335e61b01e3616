//! Files without end, and requests for more than a memory holds: refused at once, in one line.
#![cfg(target_os = "linux")]

use std::{fs, path::Path};

use tempfile::TempDir;

use super::bad_input::curvelax;
use crate::common::command::script;

/// A program that waits this long hangs, on any machine.
const HANGS: std::time::Duration = std::time::Duration::from_secs(6 * 3600);

/// Checks that `curvelax ARGUMENTS` is refused in one line that begins with `start`, with 300 MB of memory and a minute
/// of processor time.
///
/// A program that exceeds a limit ends in another way: allocations fail, or a signal comes. One that waits for a pipe
/// would never return.
#[track_caller]
fn refused_at_once(folder: &Path, arguments: &[&str], start: &str) {
    let limits = "ulimit -v 300000 && ulimit -t 60 && exec \"$0\" \"$@\"";
    let mut command = assert_cmd::Command::from_std(script("sh", folder, limits));
    let output = command.args(arguments).timeout(HANGS).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    let shown: String = message.chars().take(300).collect();
    assert_eq!(output.status.code(), Some(2), "{arguments:?} ended with {}: {shown}", output.status);
    assert!(message.starts_with(start), "{arguments:?}: not {start:?} but {shown}");
    assert!(message.len() < 2000 && message.lines().count() == 1, "{arguments:?}: {} bytes: {shown}", message.len());
    assert!(!message.trim_end().contains(char::is_control), "{arguments:?}: {message:?}");
    assert!(output.stdout.is_empty() && !folder.join("new").exists(), "{arguments:?}");
}

/// A file of `size` zero bytes that uses no disk space.
fn endless(path: &Path, size: u64) {
    fs::File::create(path).unwrap().set_len(size).unwrap();
}

fn pipe(path: &Path) {
    assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
fn an_overlong_spec_is_refused_at_once() {
    let home = TempDir::new().unwrap();
    let in_home = |name: &str| home.path().join(name);
    endless(&in_home("huge.toml"), 3 << 30);
    pipe(&in_home("pipe"));
    fs::create_dir(in_home("folder")).unwrap();
    fs::write(in_home("over.toml"), "#".repeat((1 << 20) + 1)).unwrap();
    fs::write(in_home("latin.toml"), b"curves = 3 # \xe7").unwrap();
    let many = |count: usize, item: &str| vec![item; count].join(",");
    for (name, text) in [
        ("deep.toml", format!("omega = {}", "[".repeat(1_000_000))),
        ("dotted.toml", format!("{}a = 1", "a.".repeat(500_000))),
        (
            "nested.toml",
            format!("[sweep]\nomega = [{}]", many(9_000, &format!("{}{}", "[".repeat(50), "]".repeat(50)))),
        ),
        ("key.toml", format!("{} = 1", "a".repeat(1_000_000))),
        ("word.toml", format!("solver = '{}'", "a".repeat(1_000_000))),
        ("escape.toml", format!("shape = '{}'", "\\u001b[31m".repeat(10_000)).replace('\'', "\"")),
        (
            "times.toml",
            format!(
                "t-end = 1\nsnapshots = [{}]",
                (0..90_000).map(|i| format!("{}", i as f64 / 1e5)).collect::<Vec<_>>().join(",")
            ),
        ),
        ("flower.toml", format!("shape = 'flower:{}'", many(130_000, "3:1e-9"))),
        ("curves.toml", "curves = 18446744073709551615".into()),
        ("points.toml", "points = 1000000000000".into()),
    ] {
        fs::write(in_home(name), text).unwrap();
    }
    for (spec, start) in [
        ("huge.toml", "error: cannot read the spec huge.toml: 3 GB; at most 1 MB are read"),
        ("over.toml", "error: cannot read the spec over.toml: 1 byte too many; at most 1 MB"),
        ("pipe", "error: cannot read the spec pipe: a pipe or a device; save what it holds in a file"),
        ("/dev/zero", "error: cannot read the spec /dev/zero: a pipe or a device; "),
        ("folder", "error: cannot read the spec folder: is a directory"),
        ("latin.toml", "error: cannot read the spec latin.toml: byte 13 is not UTF-8; save it as UTF-8"),
        ("deep.toml", "error: in the spec deep.toml: TOML parse error at line 1, column 89: cannot recurse further"),
        ("dotted.toml", "error: in the spec dotted.toml: recursion limit"),
        ("nested.toml", "error: --sweep omega: [[[["),
        ("key.toml", "error: in the spec key.toml: TOML parse error at line 1, column 1: unknown key `aaa"),
        ("word.toml", "error: in the spec word.toml: TOML parse error at line 1, column 10: unknown value `aaa"),
        (
            "escape.toml",
            "error: in the spec escape.toml: TOML parse error at line 1, column 9: unknown shape `\\u{1b}[",
        ),
        ("times.toml", "error: --snapshots (90000 times): too many times; at most 10000"),
        (
            "flower.toml",
            "error: in the spec flower.toml: TOML parse error at line 1, column 9: a flower of 130000 modes",
        ),
        ("curves.toml", "error: --curves 18446744073709551615: too many members; use 1 to 1000000000"),
        ("points.toml", "error: --points 1000000000000: too many nodes; use 6 to 1000000"),
    ] {
        refused_at_once(home.path(), &["run", spec, "--out", "new/out"], start);
    }
}

#[test]
fn an_overlong_outline_is_refused_at_once() {
    let home = TempDir::new().unwrap();
    let in_home = |name: &str| home.path().join(name);
    endless(&in_home("huge.csv"), 3 << 30);
    pipe(&in_home("pipe"));
    fs::write(in_home("commas.csv"), ",".repeat(1 << 26)).unwrap();
    fs::write(in_home("latin.csv"), vec![0xff; 1 << 26]).unwrap();
    fs::write(in_home("nul.csv"), "0,0\n1,0\n1,\0\u{1b}\n").unwrap();
    fs::write(in_home("points.csv"), "0,0\n1,1\n".repeat(1 << 20)).unwrap();
    for (file, said) in [
        ("huge.csv", " cannot read it: 3 GB; at most 64 MB are read; thin the outline out"),
        ("pipe", " cannot read it: a pipe or a device; "),
        ("/dev/zero", " cannot read it: a pipe or a device; "),
        ("commas.csv", " line 1: a line of 64 MB; write a point a line, x,y, of at most 64 KB"),
        ("latin.csv", " line 1: a line of 64 MB; "),
        ("nul.csv", " line 3, column 2: `\\0\\u{1b}` is not a number; "),
        ("points.csv", " the file holds more than 1000000 points; "),
    ] {
        let shape = format!("file:{file}");
        let start = format!("error: --shape {shape}:{said}");
        refused_at_once(home.path(), &["run", "--shape", &shape, "--out", "new/out"], &start);
    }
}

#[test]
fn overlong_files_of_a_run_are_refused_at_once() {
    let home = TempDir::new().unwrap();
    let arguments = ["--curves", "2", "--t-end", "0.01", "--points", "40", "--backend", "cpu", "--quiet"];
    let run = curvelax(home.path(), &[&["run", "--out", "run"], &arguments[..]].concat());
    assert_eq!(run.status.code(), Some(0), "{}", String::from_utf8_lossy(&run.stderr));
    let files = ["run.json", "summary.csv", "members.csv", "mean_excess.csv", "plots/portraits.json"];
    let table = |row: &str| [vec![b'x'; 1 << 26], row.as_bytes().to_vec()].concat();
    for (name, bytes, said) in [
        ("run.json", [b"{\"curvelax\":[".as_slice(), &b"0,".repeat(2_000_000)].concat(), ": it ends inside"),
        ("run.json", [b"{\"a\":".as_slice(), &b"[".repeat(4_000_000)].concat(), ": it ends inside"),
        (
            "run.json",
            [b"{\"spec\":\"".as_slice(), &b"a".repeat(4_000_000), b"\"}"].concat(),
            ": not written by curvelax",
        ),
        ("summary.csv", table("\n"), ", line 1: a line of more than 65536 bytes; restore the file"),
        ("members.csv", table("\n"), ", line 1: a line of more than 65536 bytes; restore the file"),
        ("mean_excess.csv", table("\n"), ", line 1: a line of more than 65536 bytes; restore the file"),
        (
            "plots/portraits.json",
            [br#"{"members":[{"nodes":["#.as_slice(), &br#""","#.repeat(2_700_000)].concat(),
            ": it ends inside",
        ),
    ] {
        let place = home.path().join("run").join(name);
        let kept = fs::read(&place).unwrap();
        fs::write(&place, bytes).unwrap();
        refused_at_once(home.path(), &["plot", "run"], &format!("error: run/{name}{said}"));
        fs::write(&place, kept).unwrap();
    }
    for name in files {
        let place = home.path().join("run").join(name);
        let kept = fs::read(&place).unwrap();
        fs::remove_file(&place).unwrap();
        pipe(&place);
        let start = format!("error: cannot read run/{name}: a pipe or a device; ");
        refused_at_once(home.path(), &["plot", "run"], &start);
        fs::remove_file(&place).unwrap();
        if name.ends_with("json") {
            endless(&place, 3 << 30);
            let start = format!("error: cannot read run/{name}: 3 GB; at most ");
            refused_at_once(home.path(), &["plot", "run"], &start);
        }
        fs::write(&place, kept).unwrap();
    }
    let again = curvelax(home.path(), &["plot", "run", "--quiet"]);
    assert_eq!(again.status.code(), Some(0), "it was no run before: {}", String::from_utf8_lossy(&again.stderr));
}

#[test]
fn requests_for_more_than_a_memory_holds_are_refused_at_once() {
    let home = TempDir::new().unwrap();
    let list = |count: usize| (1..=count).map(|i| i.to_string()).collect::<Vec<_>>().join(",");
    let thousand = [format!("omega={}", list(1000)), format!("decay={}", list(1000)), format!("seed={}", list(1000))];
    let times = (0..10_000).map(|i| format!("{}", f64::from(i) / 1e4)).collect::<Vec<_>>().join(",");
    for (arguments, start) in [
        (
            &["--sweep", &thousand[0], "--sweep", &thousand[1], "--sweep", &thousand[2]][..],
            "error: --sweep (1000000000 cells): ",
        ),
        (
            &["--snapshots", &times, "--points", "1000000"],
            "error: --snapshots (10000 times): 10000000000 rows per member; ",
        ),
        (&["--series", "1e-9"], "error: --series 1e-9: about 2.0e9 rows per member; "),
        (&["--only", "18446744073709551615"], "error: --only 18446744073709551615: no such member among 256; "),
        (
            &["--curves", "1000000000", "--sweep", "omega=1,2"],
            "error: --curves 1000000000: 2 cells make 2000000000 members",
        ),
    ] {
        refused_at_once(home.path(), &[&["run", "--out", "new/out"], arguments].concat(), start);
    }
}
