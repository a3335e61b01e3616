//! Wrong requests: exit code 2, a message that names the key and the value, nothing on stdout, nothing written.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Output,
};

use tempfile::TempDir;

use crate::common::command::{program, script, stopped_run};

/// Runs `curvelax run ARGUMENTS --out OUT` in an empty folder with the given files, and returns its message.
///
/// Asserts everything that holds for all wrong requests.
#[track_caller]
fn refused(arguments: &[&str], files: &[(&str, &str)]) -> String {
    let home = TempDir::new().unwrap();
    for (name, text) in files {
        fs::write(home.path().join(name), text).unwrap();
    }
    let output = curvelax(home.path(), &[&["run"], arguments, &["--out", "new/out"]].concat());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "", "{arguments:?}");
    assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    assert_eq!(message.matches("error: ").count(), 1, "more than one message for {arguments:?}: {message}");
    assert!(!home.path().join("new").exists(), "{arguments:?} made a folder");
    message
}

fn curvelax(folder: &Path, arguments: &[&str]) -> Output {
    program(folder).args(arguments).output().unwrap()
}

#[track_caller]
fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
}

#[test]
fn a_wrong_number_is_named_with_its_flag() {
    for (flag, values) in [
        ("--curves", &["0", "1000000001"][..]),
        ("--points", &["0", "3", "5", "1000001"]),
        ("--tau", &["0", "-1", "-1e-3", "NaN", "-inf", "inf", "1e-300", "5"]),
        ("--t-end", &["0", "-1", "NaN", "inf", "0.0001"]),
        ("--omega", &["-1", "NaN", "inf"]),
        ("--tolerance", &["0", "-0.001", "0.5", "NaN", "inf"]),
        ("--sor", &["0", "2", "-1", "NaN"]),
        ("--max-sweeps", &["0", "100000001"]),
        ("--relax-to", &["0", "1", "-0.5", "NaN", "inf"]),
        ("--series", &["0", "-1", "NaN", "inf"]),
        ("--snapshots", &["3", "-1", "NaN", "0,inf"]),
        ("--only", &["256", "1,300"]),
        ("--threads", &["0", "2000"]),
    ] {
        for value in values {
            let message = refused(&[flag, value], &[]);
            // The wrong item of a list, and the step that does not fit a final time.
            let (flag, value) = match (flag, *value) {
                ("--t-end", "0.0001") => ("--tau", "0.001"),
                ("--tau", "-1e-3") => ("--tau", "-0.001"),
                (flag, list) => (flag, list.rsplit(',').next().unwrap()),
            };
            assert_says(&message, &[&format!("error: {flag} {value}: "), "; "]);
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
}

#[test]
fn a_value_that_cannot_be_read_is_named_with_its_flag() {
    for (flag, value, reason) in [
        ("--curves", "-1", "not a whole number"),
        ("--curves", "1.5", "not a whole number"),
        ("--points", "many", "not a whole number"),
        ("--seed", "18446744073709551616", "from 0 to 18446744073709551615"),
        ("--max-sweeps", "4294967296", "from 0 to 4294967295"),
        ("--tau", "0,001", "neither a number nor `auto`"),
        ("--tau", "--force", "neither a number nor `auto`"),
        ("--t-end", "soon", "`soon` is neither a number nor `auto`"),
        ("--t-end", "1,soon", "`soon` is neither a number nor `auto`"),
        ("--mobility", "fast", "not a number"),
        ("--units", "um", "for example `um,h`"),
        ("--omega", "", "neither a number nor `auto`"),
        ("--omega", "Auto", "neither a number nor `auto`"),
        ("--modes", "2-8", "2..=8"),
        ("--flow", "elastic", "elastic:0.5"),
        ("--flow", "wilmore", "did you mean `willmore`?"),
        ("--energy", "sin:4,0.1", "`sin:4,0.1` is not cos:M,SIZE"),
        ("--energy", "cos:4,0.07", "ill-posed"),
        ("--diffusivity", "cos:4,1", "atoms would run uphill"),
        ("--sampling", "arc", "arclength"),
        ("--solver", "gaus-seidel", "similar value exists: 'gauss-seidel'"),
        ("--order", "colored", "similar value exists: 'coloured'"),
        ("--backend", "cuda", "auto, gpu, cpu"),
        ("--precision", "f16", "f32, f64"),
        ("--event", "convex = kmin >= 0", "no observable `kmin` (did you mean `k_min`?)"),
        ("--event", "convex", "write NAME = OBSERVABLE <= LEVEL"),
        ("--event", "t_relax = excess <= 1", "choose another name"),
        ("--store", "zar", "similar value exists: 'zarr'"),
        ("--tables", "parqet", "similar value exists: 'parquet'"),
    ] {
        let message = refused(&[flag, value], &[]);
        assert_says(&message, &[&format!("invalid value '{value}' for '{flag} "), reason]);
    }
}

#[test]
fn combinations_without_sense_name_a_remedy() {
    for (arguments, parts) in [
        ("--order lexicographic --backend gpu", ["--order lexicographic: ", "use --backend cpu"]),
        ("--order lexicographic --solver direct", ["--order lexicographic: ", "leave out --order"]),
        ("--solver multigrid", ["'multigrid' for '--solver ", "use direct"]),
        ("--sweep solver=direct,multigrid", ["multigrid is gone, ", "use direct"]),
        ("--sor auto --solver direct", ["--sor auto: ", "leave out --sor"]),
        ("--adapter llvmpipe --backend cpu", ["--adapter llvmpipe: ", "leave out --adapter"]),
        (
            "--event a=length<=1 --event a=length<=2",
            ["--event a = length <= 2: another event has this name; ", "use another name"],
        ),
        ("--points 20", ["--modes 2..=8: ", "use --points 32 or more"]),
        (
            "--store zarr",
            ["--store zarr: there are no snapshots to store; ", "add --snapshots T1,T2,..., or leave out"],
        ),
        (
            "--store zarr --snapshots 0 --sweep points=40,50 --sweep decay=1,2",
            ["50 in points = 50, decay = 1; ", "use --store csv, or one number of --points"],
        ),
    ] {
        assert_says(&refused(&arguments.split(' ').collect::<Vec<_>>(), &[]), &parts);
    }
}

#[test]
fn a_wrong_sweep_names_its_key_and_cell() {
    let thousand = (0..1000).map(|i| i.to_string()).collect::<Vec<_>>().join(",");
    let many = [format!("omega={thousand}"), format!("decay={thousand}")];
    for (sweeps, parts) in [
        (&["amplitud=1"][..], ["--sweep amplitud: ", "did you mean `amplitude`?"]),
        (&["curves=1,2"], ["--sweep curves: ", "run once for each value"]),
        (&["store=csv,zarr"], ["--sweep store: ", "run once for each value"]),
        (&["tables=csv,parquet"], ["--sweep tables: ", "run once for each value"]),
        (&["amplitude="], ["--sweep amplitude: no values", "amplitude=v1,v2"]),
        (&["amplitude"], ["has no `=`", "key=v1,v2"]),
        (&["amplitude=0.1,word"], ["--sweep amplitude=word: ", "expected a number, or a distribution"]),
        (&["omega=1", "decay=1,2", "omega=2"], ["--sweep omega: given twice; ", "--sweep omega=V1,V2"]),
        (&["decay=1,2", "--decay=3"], ["--sweep decay: --decay is given, too", "leave one of them out"]),
        (&["adaptive=1e-3", "--tau=1e-3"], ["--sweep adaptive: --tau is given, too", "leave one of them out"]),
        (
            &["relax-to=0.1,0.2", "--relax-to=0.1"],
            ["--sweep relax-to: --relax-to is given, too", "leave one of them out"],
        ),
        (&["omega=1,-1", "decay=1,2"], ["--omega -1: ", "in the cell omega = -1, decay = 1"]),
        (&[&many[0], &many[1]], ["(1000000 cells): too many", "at most 10000"]),
    ] {
        let (flags, axes): (Vec<&str>, Vec<&str>) = sweeps.iter().partition(|text| text.starts_with("--"));
        let swept = axes.iter().flat_map(|sweep| ["--sweep", sweep]);
        let arguments: Vec<&str> = swept.chain(flags).collect();
        assert_says(&refused(&arguments, &[]), &parts);
    }
    let message = refused(&["spec.toml"], &[("spec.toml", "[sweep]\namplitude = 1\n")]);
    assert_says(&message, &["line 2, column 13", "expected a list in brackets, found the number 1; "]);
}

#[test]
fn a_spec_file_is_told_what_is_wanted_without_types_of_rust() {
    for (text, parts) in [
        ("curves = 'x'", &["expected a whole number from 0, found the text \"x\""][..]),
        ("curves = '8'", &["found the text \"8\"; leave the quotes out"]),
        ("curves = 1.5", &["expected a whole number from 0, found the number 1.5"]),
        ("max-sweeps = 99999999999", &["expected a whole number from 0 to 4294967295, found the number 99999999999"]),
        ("mobility = 'x'", &["expected a number, found the text \"x\""]),
        ("mobility = 99999999999999999999", &["expected a number, found the number 99999999999999999999"]),
        ("snapshots = ['a']", &["expected a number, found the text \"a\""]),
        ("tau = true", &["expected a number or \"auto\", found true"]),
        ("tau = [1]", &["expected a number or \"auto\", found a list"]),
        ("refine = 'true'", &["expected true or false, found the text \"true\"; leave the quotes out"]),
        ("modes = 3", &["expected a text in quotes, found the number 3"]),
        ("event = 'a = area <= 1'", &["expected a list in brackets, found the text", "; put it in brackets"]),
        ("order = 1", &["expected a word in quotes"]),
        ("shape = {a = 1}", &["expected a text in quotes, found a table"]),
        ("[sweep]\namplitude = [99999999999999999999999]", &["line 2", "expected a number, a text, or true or false"]),
    ] {
        let message = refused(&["spec.toml"], &[("spec.toml", text)]);
        assert_says(&message, parts);
        assert_says(&message, &["in the spec spec.toml: ", "line ", "column "]);
        for word in ["f64", "u64", "u32", "i128", "usize", "boolean", "sequence", "enum", "invalid type", "floating"] {
            assert!(!message.contains(word), "{word} in: {message}");
        }
    }
}

#[test]
fn a_file_of_outlines_that_is_not_there_is_told_with_the_path_looked_for() {
    let home = TempDir::new().unwrap();
    fs::create_dir(home.path().join("folder.csv")).unwrap();
    fs::write(home.path().join("file.csv"), "0,0\n1,0\n1,1\n").unwrap();
    let folder = home.path().canonicalize().unwrap().display().to_string();
    for (shape, parts) in [
        ("file:none.csv", &["there is no such file; looked for ", &format!("{folder}/none.csv: check the name")][..]),
        ("file:no/none.csv", &["there is no such file; looked for ", &format!("{folder}/no/none.csv: check")]),
        ("file:file.csv/none.csv", &["there is no such file; looked for "]),
        ("file:folder.csv", &["it is a folder; give a file in it, or all of them: 'files:folder.csv/*.csv'"]),
        (
            "files:no*.csv",
            &[&format!("no file matches in {folder}; check folder and extension"), "'files:outlines/*.csv'"],
        ),
        ("files:none/*.csv", &[&format!("there is no folder none in {folder}; check its name")]),
        ("files:folder.csv/", &["it is a folder; write 'files:folder.csv/*.csv'"]),
    ] {
        let output = curvelax(home.path(), &["run", "--shape", shape, "--out", "new/out"]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{shape}: {message}");
        assert_says(&message, parts);
        assert_says(&message, &[&format!("error: --shape {shape}: ")]);
        assert!(!message.contains("67108864") && !message.contains("os error"), "{message}");
        assert!(!home.path().join("new").exists());
    }
}

#[test]
fn a_wrong_cell_of_a_table_of_outlines_is_named_by_row_and_column() {
    for (table, part) in [
        (
            "x,y,label\n0,0,a\n1,0,a,b\n1,1,a\n",
            "line 3, column 4: the number of columns is 4 where the header names 3 (this one holds `b`); remove it",
        ),
        (
            "x,y,label\n0,0,a\n1,0\n1,1,a\n",
            "line 3: the number of columns is 2 where the header names 3: there is no label; complete",
        ),
        (
            "x,y\n0,0\n1e308,0\n1,1\n",
            "line 3, column 1 (x): `1e308` is too large; coordinates are numbers from -1e30 to 1e30",
        ),
        ("0,0\n1,1e400\n1,1\n", "line 2, column 2: `1e400` is too large; "),
        ("label,y,x\na,0,0\na,-inf,1\na,1,1\n", "line 3, column 2 (y): `-inf` is not finite; "),
        ("lon,lat\n0,0\nnan,0\n1,1\n", "line 3, column 1 (longitude): `nan` is not finite; "),
        ("x,y\n0,0\n,0\n1,1\n", "line 3, column 1 (x): the cell is empty; write a number, "),
        ("x;y\n0;0\n1;\n1;1\n", "line 3, column 2 (y): the cell is empty; "),
        ("x,y\n0,0\n1,abc\n1,1\n", "line 3, column 2 (y): `abc` is not a number; "),
    ] {
        let message = refused(&["--shape", "file:t.csv"], &[("t.csv", table)]);
        assert_says(&message, &[&format!("error: --shape file:t.csv: {part}")]);
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn an_overlong_value_is_echoed_by_its_beginning() {
    let long = "a".repeat(10_000);
    let of = |template: &str| template.replace("LONG", &long);
    let flags = "curves points seed shape outlines sampling amplitude modes decay perturbation design sweep flow energy diffusivity mobility form \
                 units tau adaptive t-end omega pull solver order tolerance sor max-sweeps backend precision relax-to \
                 relax-at only shard accuracy event series snapshots store tables";
    let mut all: Vec<Vec<String>> =
        flags.split_whitespace().map(|flag| vec![format!("--{flag}"), long.clone()]).collect();
    for arguments in [
        &["--shape", "file:LONG"][..],
        &["--shape", "file:LONG/LONG.csv"],
        &["--shape", "files:LONG"],
        &["--shape", "ellipse:LONG,1"],
        &["--shape", "flower:LONG"],
        &["--shape", "circle:uniform(LONG)"],
        &["--shape", "circle:uniform(LONG"],
        &["--shape", "LONG(1)"],
        &["--flow", "elastic:LONG"],
        &["--amplitude", "LONG(1..2)"],
        &["--t-end", "1,LONG"],
        &["--sweep", "LONG=1,2"],
        &["--sweep", "amplitude=0.02,LONG"],
        &["--sweep", "shape=circle:1,LONG"],
        &["--sweep", "shape=circle:1,file:LONG"],
        &["--event", "a = LONG <= 1"],
        &["--event", "a = area <= LONG"],
        &["--event", "LONG = area <= 1"],
        &["--LONG"],
        &["--LONG=1"],
        &["--refine=LONG"],
        &["--accurate=LONG"],
        &["LONG"],
        &["LONG.toml"],
        &["spec.toml", "LONG"],
        &["--shape", "file:square.csv", "--group-by", "LONG"],
    ] {
        all.push(arguments.iter().map(|argument| of(argument)).collect());
    }
    let square = ("square.csv", "0,0\n1,0\n1,1\n0,1\n");
    for arguments in &all {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let message = refused(&arguments, &[square, ("spec.toml", "")]);
        let shown: Vec<String> = arguments.iter().map(|argument| argument.chars().take(40).collect()).collect();
        assert!(message.len() < 1500, "{shown:?}: {} bytes: {}", message.len(), &message[..1500]);
    }
    for text in [
        "shape = 'LONG'",
        "shape = 'circle:LONG'",
        "flow = 'LONG'",
        "modes = 'LONG'",
        "tau = 'LONG'",
        "mobility = 'LONG'",
        "snapshots = '1,LONG'",
        "event = ['LONG']",
        "order = 'LONG'",
        "LONG = 1",
        "LONG",
        "[sweep]\nLONG = [1]",
        "[sweep]\namplitude = [1, 'LONG']",
        "[sweep]\namplitude = [['LONG']]",
    ] {
        let message = refused(&["spec.toml"], &[("spec.toml", &of(text))]);
        assert!(message.len() < 1500, "{text}: {} bytes: {}", message.len(), &message[..1500]);
    }
    let table = of("x,y,label\n0,0,LONG\n1,0,LONG\n1,1,other\n0,1,LONG\n");
    for table in [of("x,y\n0,0\n1,LONG\n"), of("LONG\n"), of("x,y\n1,2,LONG\n"), table] {
        let message = refused(&["--shape", "file:t.csv"], &[("t.csv", &table)]);
        assert!(message.len() < 1500, "{} bytes: {}", message.len(), &message[..1500]);
    }
}

#[test]
fn a_wrong_value_of_a_sweep_is_told_once() {
    let message = refused(&["--sweep", "amplitude=0.02,abc"], &[]);
    assert_says(&message, &["error: --sweep amplitude=abc: expected a number, or a distribution"]);
    assert_eq!(message.matches("abc").count(), 1, "{message}");
    // Which cell it is, is not told by the wrong value alone.
    let message = refused(&["--sweep", "amplitude=0.02,-1"], &[]);
    assert_says(&message, &["error: --amplitude -1: ", "(in the cell amplitude = -1)"]);
}

#[test]
fn an_unknown_flag_is_answered_with_the_nearest() {
    for (given, meant) in [("--tua", "--tau"), ("--curve", "--curves"), ("--relaxto", "--relax-to")] {
        assert_says(&refused(&[given, "1"], &[]), &[given, &format!("similar argument exists: '{meant}'")]);
    }
}

#[test]
fn a_wrong_spec_file_is_shown_in_its_line() {
    for (text, parts) in [
        ("curves = 8\ntua = 1\n", &["line 2, column 1", "2 | tua = 1", "^^^", "did you mean `tau`?", "`omega`"][..]),
        ("t_end = 1", &["line 1, column 1", "^^^^^", "did you mean `t-end`?"]),
        ("curves = 'many'", &["line 1, column 10", "expected a whole number from 0, found the text \"many\""]),
        ("curves = -3", &["line 1, column 10", "found the number -3"]),
        ("amplitude = '0.1'", &["line 1, column 13", "expected a number, or a distribution"]),
        ("solver = 'gaus-seidel'", &["unknown value `gaus-seidel`", "did you mean `gauss-seidel`?"]),
        ("flow = 'wilmore'", &["line 1, column 8", "did you mean `willmore`?"]),
        ("no-redistribution = 1", &["line 1, column 21", "expected true or false, found the number 1"]),
        ("snapshots = 'a,b'", &["line 1, column 13", "`a` in `a,b`"]),
        ("only = [1, -2]", &["line 1, column 12", "found the number -2"]),
        ("tau = 1\ntau = 2", &["line 2", "duplicate key"]),
        ("tau = ", &["line 1"]),
        ("[sweeps]", &["unknown key `sweeps`", "did you mean `sweep`?"]),
    ] {
        let message = refused(&["spec.toml"], &[("spec.toml", text)]);
        assert_says(&message, &["in the spec spec.toml: TOML parse error"]);
        assert_says(&message, parts);
    }
}

#[test]
fn toml_numbers_meet_the_same_checks_as_flags() {
    for (text, start) in [
        ("tau = nan", "error: --tau NaN: "),
        ("tau = -inf", "error: --tau -inf: "),
        ("t-end = inf", "error: --t-end inf: "),
        ("points = 5", "error: --points 5: "),
        ("snapshots = [0, 2.5]", "error: --snapshots 2.5: "),
        ("only = []", "error: --only []: "),
    ] {
        assert_says(&refused(&["spec.toml"], &[("spec.toml", text)]), &[start]);
    }
}

#[test]
fn a_spec_file_that_cannot_be_read_is_named() {
    assert_says(
        &refused(&["absent.toml"], &[]),
        &["cannot read the spec absent.toml: it does not exist; check its name"],
    );
    assert_says(&refused(&["."], &[]), &["cannot read the spec .: "]);
}

/// A program that waits this long hangs, on any machine.
#[cfg(target_os = "linux")]
const HANGS: std::time::Duration = std::time::Duration::from_secs(6 * 3600);

/// Checks that `curvelax ARGUMENTS` is refused in one line that begins with `start`, with 300 MB of memory and a minute
/// of processor time.
///
/// A program that exceeds a limit ends in another way: allocations fail, or a signal comes. One that waits for a pipe
/// would wait for ever.
#[cfg(target_os = "linux")]
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
#[cfg(target_os = "linux")]
fn endless(path: &Path, size: u64) {
    fs::File::create(path).unwrap().set_len(size).unwrap();
}

#[cfg(target_os = "linux")]
fn pipe(path: &Path) {
    assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
#[cfg(target_os = "linux")]
fn a_spec_without_end_is_refused_at_once() {
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
#[cfg(target_os = "linux")]
fn an_outline_without_end_is_refused_at_once() {
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
#[cfg(target_os = "linux")]
fn files_of_a_run_without_end_are_refused_at_once() {
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
#[cfg(target_os = "linux")]
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

#[test]
fn a_flag_mends_the_file() {
    let home = TempDir::new().unwrap();
    fs::write(home.path().join("spec.toml"), "tau = -1\nomega = 1.5").unwrap();
    let output = curvelax(home.path(), &["run", "spec.toml", "--tau", "0.5", "--print-spec"]);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_says(&printed, &["\ntau = 0.5\n", "\nomega = 1.5\n"]);

    fs::write(home.path().join("again.toml"), &printed).unwrap();
    let again = curvelax(home.path(), &["run", "again.toml", "--print-spec"]);
    assert_eq!(String::from_utf8(again.stdout).unwrap(), printed);
}

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
#[test]
fn a_wrong_shape_is_refused_by_name() {
    let files = [
        ("empty.csv", ""),
        ("two.csv", "0,0\n1,0\n"),
        ("text.csv", "x,y\n0,0\none,0\n1,1\n0,1\n"),
        ("nan.csv", "0,0\n1,NaN\n1,1\n0,1\n"),
        ("inf.csv", "0,0\n1,inf\n1,1\n0,1\n"),
        ("ragged.csv", "0,0\n1\n1,1\n0,1\n"),
        ("same.csv", "2,2\n2,2\n2,2\n2,2\n"),
        ("twice.csv", "0,0\n1,0\n1,0\n1,1\n0,1\n"),
        ("line.csv", "0,0\n1,1\n2,2\n3,3\n"),
        ("no-area.csv", "0,0\n1,1\n1,0\n0,1\n"),
        ("several.csv", "0,0\n1,0\n1,1\n\n0,0\n1,0\n0,0\n"),
        ("holed.wkt", "POLYGON ((0 0, 9 0, 9 9, 0 0), (4 1, 5 1, 5 2, 4 1))\n"),
        ("thousands.csv", "1,234;5,678\n2,234;5,678\n2,234;6,678\n"),
        ("three.csv", "0,0,0\n1,0,0\n1,1,0\n"),
    ];
    for (name, _) in files.into_iter().chain([("absent.csv", "")]) {
        let shape = format!("file:{name}");
        assert_says(&refused(&["--shape", &shape, "--sampling", "points"], &files), &[name]);
    }
    for (flag, value) in [
        ("--shape", "elipse:2,1"),
        ("--shape", "ellipse:0,1"),
        ("--shape", "ellipse:-2,1"),
        ("--shape", "ellipse:nan,1"),
        ("--shape", "ellipse:2"),
        ("--shape", "circle:0"),
        ("--shape", "circle:inf"),
        ("--shape", "astroid:1"),
        ("--shape", "lemniscate"),
        ("--shape", "lemniscate:-1"),
        ("--shape", "file:"),
        ("--sampling", "points"),
        ("--amplitude", "-1"),
        ("--amplitude", "NaN"),
        ("--modes", "8..=2"),
        ("--modes", "0..=2"),
        ("--decay", "NaN"),
    ] {
        assert_says(&refused(&[flag, value], &[]), &[flag, value]);
    }
    assert_says(&refused(&["--shape", "elipse:2,1"], &[]), &["did you mean `ellipse`?"]);
}

/// No machine has an adapter of this name.
#[test]
fn an_adapter_that_is_not_there_is_refused_by_name() {
    let message = refused(&["--backend", "gpu", "--adapter", "abacus"], &[]);
    assert_says(&message, &["--adapter abacus", "curvelax adapters"]);
}

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
