//! Wrong requests: exit code 2, a message that names the key and the value, nothing on stdout, nothing written.

use std::{fs, path::Path, process::Output};

use tempfile::TempDir;

use crate::common::command::program;

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

pub fn curvelax(folder: &Path, arguments: &[&str]) -> Output {
    program(folder).args(arguments).output().unwrap()
}

#[track_caller]
pub fn assert_says(message: &str, parts: &[&str]) {
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
        ("--energy", "sin:4,0.1", "`sin:4,0.1` is not 1, cos:M,SIZE"),
        ("--energy", "cos:4,0.07", "ill-posed"),
        ("--diffusivity", "cos:4,1", "atoms would run uphill"),
        ("--conserve", "energy", "area, length, or area,length"),
        ("--conserve-at", "wide", "not a number"),
        ("--reduced-area", "low", "not a number"),
        ("--drive", "up", "`up` is not a finite number"),
        ("--drive", "1,2", "drive takes one force, or feedback:C,A0"),
        ("--drive", "feedback:1,-2", "feedback to an area of -2, which must be above 0"),
        ("--sampling", "arc", "arclength"),
        ("--solver", "gaus-seidel", "similar value exists: 'gauss-seidel'"),
        ("--order", "colored", "similar value exists: 'coloured'"),
        ("--backend", "cuda", "auto, gpu, cpu"),
        ("--precision", "f16", "f32, f64"),
        ("--event", "convex = kmin >= 0", "no observable `kmin` (did you mean `k_min`?)"),
        ("--event", "convex", "write NAME = OBSERVABLE <= THRESHOLD"),
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
fn an_error_in_a_spec_file_names_no_types_of_rust() {
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
fn a_missing_file_of_outlines_is_named_with_its_full_path() {
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
    let flags = "curves points seed shape outlines sampling amplitude modes decay perturbation design sweep flow energy diffusivity drive conserve conserve-at reduced-area mobility form \
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
fn a_wrong_value_of_a_sweep_is_reported_once() {
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
        ("curves = 8\ntua = 1\n", &["line 2, column 1", "2 | tua = 1", "^^^", "did you mean `tau`?"][..]),
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
