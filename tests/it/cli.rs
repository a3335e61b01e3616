//! The program's conventions: JSON, --quiet, exit codes, `--max-time`, the dry run, completions, the man page.

use std::{
    env, fs,
    path::Path,
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};

use crate::common::{
    command::{command, curvelax, handling, program, signal, signalled_when, stopped_when},
    program::{number, run},
};
use curvelax::backend::gpu::Gpu;
use serde_json::Value;
use tempfile::TempDir;

/// The output of the program, which must succeed with nothing on stderr.
#[track_caller]
fn printed(folder: &Path, arguments: &str) -> String {
    let output = curvelax(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.is_empty(), "{arguments}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

#[track_caller]
fn json(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&printed(folder, arguments)).expect("one JSON document")
}

/// Names of the entries of a folder.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

const SMALL: &str = "run --backend cpu --points 34 --adaptive=1e-3 --t-end 1 --curves 11 --quiet";

#[test]
fn json_of_a_run_is_run_json_with_the_statistics_of_ensemble_csv() {
    let home = TempDir::new().unwrap();
    let said = json(home.path(), &format!("{SMALL} --sweep amplitude=0.03,0.1 --json --out out"));
    let file: Value = serde_json::from_str(&fs::read_to_string(home.path().join("out/run.json")).unwrap()).unwrap();
    for (key, value) in file.as_object().unwrap() {
        assert_eq!(said[key], *value, "{key}");
    }
    let done =
        run(&format!("{} --sweep amplitude=0.03,0.1", SMALL.replace("run --backend cpu", "").replace("--quiet", "")));
    let rows = done.rows("ensemble.csv");
    let cells = said["cells"].as_array().unwrap();
    assert_eq!((cells.len(), rows.len()), (2, 2));
    for (cell, row) in cells.iter().zip(&rows) {
        for name in ["known", "mean", "sd", "se", "q05", "median", "q95", "median_low", "median_high"] {
            // Unknown values are empty there and null here.
            assert_eq!(cell["t_relax"][name].as_f64(), row[&format!("t_relax_{name}")].parse().ok(), "{name}");
        }
        assert_eq!(cell["members_by_status"]["relaxed"].as_f64(), Some(number(row, "relaxed")));
        assert_eq!(cell["values"]["amplitude"].as_f64(), Some(number(row, "amplitude")));
    }
    assert_ne!(cells[0]["t_relax"]["mean"], cells[1]["t_relax"]["mean"]);
}

#[test]
fn json_of_adapters_says_what_the_table_says() {
    let home = TempDir::new().unwrap();
    let (said, table) = (json(home.path(), "adapters --json"), printed(home.path(), "adapters"));
    assert!(table.ends_with(&format!(": {}\n", said["auto"]["sentence"].as_str().unwrap())), "{table}");
    for adapter in said["adapters"].as_array().unwrap() {
        assert!(table.contains(&format!("{}\n", adapter["name"].as_str().unwrap())), "{table}");
        assert!(table.contains(&format!("at most {} in f32", adapter["max_points_f32"])), "{table}");
    }
}

#[test]
fn strict_fails_where_members_end_badly_and_only_there() {
    let home = TempDir::new().unwrap();
    // Steps so long that they merge nodes, and members that have not relaxed.
    let bad = "run --backend cpu --points 34 --curves 3 --shape nonconvex --sweep tau=0.05,1e-3 --t-end 0.1 --quiet";
    let output = curvelax(home.path(), &format!("{bad} --strict --out strict"));
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(
        message.starts_with("error: --strict: ") && message.contains("see `status` in strict/summary.csv"),
        "{message}"
    );
    assert_eq!(curvelax(home.path(), &format!("{bad} --out mild")).status.code(), Some(0));
    assert_eq!(names(&home.path().join("strict")), names(&home.path().join("mild")));
    let good = curvelax(home.path(), &format!("{SMALL} --strict --out good"));
    assert_eq!(good.status.code(), Some(0), "{}", String::from_utf8_lossy(&good.stderr));
}

#[test]
fn a_run_in_which_every_member_failed_says_so_however_it_ends() {
    let home = TempDir::new().unwrap();
    let refused = |arguments: &str, all: &str| {
        let output = curvelax(home.path(), arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{arguments}: {message}");
        assert!(message.contains(&format!("error: every member failed ({all}); see `status` in ")), "{message}");
    };
    // One sweep solves nothing.
    let bad = "run --backend cpu --points 34 --curves 4 --tau 0.05 --t-end 0.1 --max-sweeps 1 --quiet";
    let all = "4 stalled of 4 members";
    refused(&format!("{bad} --out whole"), all);
    refused(&format!("{bad} --out whole --resume"), all);
    refused("resume whole --quiet", all);
    // Members are judged together: by the merge.
    for index in 0..2 {
        let output = curvelax(home.path(), &format!("{bad} --shard {index}/2 --out shard-{index}"));
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    }
    refused("merge shard-0 shard-1 --quiet --out merged", all);
    assert_eq!(names(&home.path().join("whole")), names(&home.path().join("merged")));
}

#[test]
fn a_run_that_missed_its_accuracy_says_so_also_when_it_is_found_finished() {
    let home = TempDir::new().unwrap();
    printed(home.path(), "run --backend cpu --accurate --points 64 --curves 16 --quiet --out out");
    let file = home.path().join("out/run.json");
    let mut run: Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    for (goal, code) in [(0.5, 0), (1e-3, 3)] {
        run["spec"]["accuracy"] = goal.into();
        fs::write(&file, run.to_string()).unwrap();
        let output = curvelax(home.path(), "resume out --quiet");
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{message}");
        let missed =
            message.starts_with("error: --accuracy 0.001: 0.") && message.contains("was reached; sampling alone needs");
        assert_eq!(missed, code == 3, "{message}");
    }
}

#[test]
fn cells_in_which_no_member_relaxed_are_named() {
    let home = TempDir::new().unwrap();
    let short = "run --backend cpu --points 34 --curves 4 --adaptive=1e-3 --t-end 0.1";
    let output = curvelax(home.path(), &format!("{short} --sweep relax-to=0.9,0.02,0.01 --out cells"));
    let message = String::from_utf8(output.stderr).unwrap();
    let cells = "in 2 of 3 cells (relax-to = 0.02; relax-to = 0.01)";
    let remedy = "use a longer --t-end or --t-end auto, or a larger --relax-to or --relax-at";
    let warning = format!("warning: no member relaxed before its final time {cells}; {remedy}\n");
    assert!(output.status.success() && message.contains(&warning), "{message}");
    let output = curvelax(home.path(), &format!("{short} --out one"));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains(&format!("warning: no member relaxed before its final time; {remedy}\n")), "{message}");
}

#[test]
fn a_run_out_of_time_keeps_its_state() {
    let home = TempDir::new().unwrap();
    // Months of work.
    let long = "run --backend cpu --points 34 --adaptive=1e-3 --curves 100000000 --stop-when-relaxed";
    let started = Instant::now();
    let timed = curvelax(home.path(), &format!("{long} --max-time 2s --out timed"));
    let message = String::from_utf8(timed.stderr).unwrap();
    assert_eq!(timed.status.code(), Some(75), "{message}");
    assert!(started.elapsed().as_secs() >= 2, "{message}");
    // A machine that is very busy ends it before it has.
    assert!(["after ", "at once"].iter().any(|way| message.contains(&format!("error: stopped by --max-time {way}"))));
    // However slow it is.
    let table = home.path().join("out/.summary.csv.part");
    let rows = || fs::read_to_string(&table).map_or(0, |text| text.lines().count().saturating_sub(1));
    let output = stopped_when(home.path(), &format!("{long} --out out"), || rows() > 0);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(75), "{message}");
    // Then the state may be older than the table.
    let at_once = |message: &str| message.contains("error: stopped by SIGTERM at once");
    let kept = rows();
    let told = format!("; {kept} of 100000000 members finished; curvelax resume out continues\n");
    let mut is_exact = !at_once(&message);
    let says_so = message.contains("error: stopped by SIGTERM after ") && message.contains(&told);
    assert!(says_so || !is_exact, "{message}");
    assert_eq!(
        names(&home.path().join("out")),
        [
            ".curvelax.state",
            ".curvelax.state.old",
            ".levels.csv.part",
            ".members.csv.part",
            ".rates.csv.part",
            ".summary.csv.part"
        ]
    );
    assert_eq!(output.stdout, b"");
    // Finished work is not repeated.
    for _ in 0..3 {
        let before = rows();
        let output = stopped_when(home.path(), "resume out", || rows() > before);
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(rows() > before, "{message}");
        assert_eq!(output.status.code(), Some(75), "{message}");
        let resuming = format!("resuming: {before} of 100000000 members finished\n");
        assert!(message.contains(&resuming) || !is_exact, "{message}");
        is_exact = !at_once(&message);
    }
}

#[test]
fn a_time_that_cannot_be_read_is_refused() {
    let home = TempDir::new().unwrap();
    for time in ["1d", "0", "-5", "1.5h", "soon"] {
        let output = curvelax(home.path(), &format!("run --max-time {time} --out new"));
        assert_eq!(output.status.code(), Some(2), "{time}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("write 90, 90s, 5m or 1h30m"), "{time}");
    }
    assert_eq!(names(home.path()), [""; 0]);
}

#[test]
fn a_dry_run_writes_nothing_and_its_table_says_what_its_json_says() {
    let home = TempDir::new().unwrap();
    let study = "run --backend cpu --points 34 --tau 0.01 --curves 23 --sweep amplitude=0.03,0.1 --dry-run";
    let said = json(home.path(), &format!("{study} --json"));
    assert_eq!(
        (&said["members"], &said["cells"], &said["platform"]["backend"]),
        (&46.into(), &2.into(), &"cpu".into())
    );
    assert_eq!(said["steps_per_member"], 200.0);
    for key in ["dispatches", "seconds", "memory_bytes", "disk_bytes", "slots"] {
        assert!(said[key].as_f64().is_some_and(|value| value > 0.0), "{key}: {said}");
    }
    let table = printed(home.path(), &format!("{study} --out out"));
    for line in [
        "the run has 46 members in 2 cells\n",
        "takes about 200 on average\n",
        "its files take about ",
        "the run takes about ",
    ] {
        assert!(table.contains(line), "{table}");
    }
    assert_eq!(names(home.path()), [""; 0]);
}

/// Bytes of all files below a folder.
fn bytes(folder: &Path) -> f64 {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { bytes(&path) } else { fs::metadata(&path).unwrap().len() as f64 }).sum()
}

#[test]
fn the_disk_space_of_a_run_is_estimated_within_a_quarter() {
    let home = TempDir::new().unwrap();
    let mut foretold = Vec::new();
    for (i, flags) in [
        "--curves 700 --points 34",
        "--curves 60 --points 100 --series 0.01",
        "--curves 60 --points 101 --snapshots 0,0.1,0.2,0.3,0.4,0.5",
        "--curves 120 --points 100 --snapshots 0,0.1,0.2,0.3,0.4,0.5 --store zarr",
        "--curves 3 --points 64 --sweep amplitude=0.01,0.02,0.03,0.04,0.05",
        "--curves 400 --points 34 --stop-when-relaxed --series 0.02 --precision f32",
        "--curves 300 --points 34 --series 0.02 --tables parquet",
    ]
    .into_iter()
    .enumerate()
    {
        let study = format!("run --backend cpu --adaptive=1e-3 {flags}");
        let said = json(home.path(), &format!("{study} --dry-run --json"))["disk_bytes"].as_f64().unwrap();
        let out = format!("out-{i}");
        printed(home.path(), &format!("{study} --quiet --out {out}"));
        let measured = bytes(&home.path().join(&out));
        eprintln!("{flags}: {said}, measured {measured}");
        assert!((0.8..=1.25).contains(&(said / measured)), "{flags}: {said}, measured {measured}");
        foretold.push(said / measured);
        foretold.push(said);
    }
    // The sizes differ by more than the bound, so that one number for all would not do.
    let sizes = || foretold.chunks(2).map(|pair| pair[1]);
    assert!(sizes().fold(0.0, f64::max) > 4.0 * sizes().fold(f64::INFINITY, f64::min));
}

/// The peak resident size of `curvelax ARGUMENTS --out OUT`. Its stdout is a socket that is full: once its files are
/// complete, it waits there until the size has been read.
#[cfg(target_os = "linux")]
fn peak(folder: &Path, arguments: &str, out: &str) -> f64 {
    use std::{
        io::{ErrorKind, Write},
        os::{fd::OwnedFd, unix::net::UnixStream},
    };

    let (mut reader, mut writer) = UnixStream::pair().unwrap();
    writer.set_nonblocking(true).unwrap();
    for spaces in [&[b' '; 4096][..], b" "] {
        let full = std::iter::repeat_with(|| writer.write(spaces)).find_map(Result::err).unwrap();
        assert_eq!(full.kind(), ErrorKind::WouldBlock);
    }
    writer.set_nonblocking(false).unwrap();
    let mut child =
        command(folder, &format!("{arguments} --json --out {out}")).stdout(OwnedFd::from(writer)).spawn().unwrap();
    let out = folder.join(out);
    while !out.join("run.json").exists() || out.join(".curvelax.lock").exists() {
        assert!(child.try_wait().unwrap().is_none(), "{arguments}");
        std::thread::sleep(Duration::from_millis(1));
    }
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    std::io::copy(&mut reader, &mut std::io::sink()).unwrap();
    assert!(child.wait().unwrap().success(), "{arguments}");
    fs::remove_dir_all(out).unwrap();
    1024.0 * line.trim().trim_end_matches(" kB").parse::<f64>().unwrap()
}

/// A run on any machine is over before. One that takes longer saves checkpoints, which need memory.
#[cfg(target_os = "linux")]
const NEVER: &str = "100000h";

#[cfg(target_os = "linux")]
#[test]
fn the_memory_of_a_run_is_estimated_within_a_fifth() {
    let home = TempDir::new().unwrap();
    let mut foretold = Vec::new();
    // Few members, and so many small ones that the data stored for each dominate; members with a rate need more.
    let many = "--shape circle:1 --sampling parameter --points 8 --modes 2..=2 --solver direct --stop-when-relaxed \
                --tau 0.02";
    let mut runs = vec![
        "--curves 300 --adaptive=1e-3 --stop-when-relaxed".to_string(),
        format!("--curves 150000 --t-end 0.02 {many}"),
        format!("--curves 210000 --t-end 0.9 --relax-to 1e-3 {many}"),
        // More rows than may be in memory, and members of very many nodes.
        "--curves 12 --points 32 --adaptive=0.1 --t-end 1 --series 1e-5".to_string(),
        "--curves 12 --points 1000 --adaptive=0.1 --t-end 0.01 --snapshots SNAPSHOTS --store zarr".to_string(),
        // Pictures of members of so many nodes that not all of them are drawn.
        "--curves 12 --points 1000 --adaptive=0.1 --t-end 0.01".to_string(),
        "--curves 1 --points 100000 --adaptive --t-end 1e-15".to_string(),
    ];
    if env::var("CURVELAX_TESTS").is_ok_and(|tests| tests == "all") {
        runs.extend([
            "--curves 12 --points 500 --adaptive=0.1 --t-end 0.01 --snapshots SNAPSHOTS --store zarr".to_string(),
            "--curves 12 --points 500 --adaptive=0.1 --t-end 0.01".to_string(),
            "--curves 7 --points 50000 --adaptive --t-end 1e-15".to_string(),
        ]);
    }
    let snapshots = (0..400).map(|i| (f64::from(i) * 2.5e-5).to_string()).collect::<Vec<_>>().join(",");
    let runs: Vec<String> = runs.iter().map(|spec| spec.replace("SNAPSHOTS", &snapshots)).collect();
    for (rank, spec) in runs.iter().enumerate() {
        // Whether a run saves a checkpoint, which takes memory, must not depend on how fast it is, and its pool not on
        // the number of cores.
        let base = format!("run --backend cpu --threads 1 {spec} --checkpoint-every {NEVER} --quiet");
        let said = json(home.path(), &format!("{base} --dry-run --json"))["memory_bytes"].as_f64().unwrap();
        let taken = peak(home.path(), &base, &rank.to_string());
        assert!((said / taken - 1.0).abs() < 0.2, "{spec}: {said} foretold, {taken} taken");
        foretold.push(said);
    }
    // One estimate would not do for the other.
    assert!(foretold[2] > 1.25 * foretold[1], "{foretold:?}");
}

/// An estimate as the program makes it while it is held for 2.5 s after each of `holds`.
#[cfg(target_os = "linux")]
fn held_estimate(home: &Path, arguments: &str, holds: &[u64]) -> Value {
    let mut dry_run = command(home, &format!("run --dry-run --json --quiet --checkpoint-every {NEVER} {arguments}"));
    let mut child = dry_run.stdout(Stdio::piped()).spawn().unwrap();
    for milliseconds in holds {
        std::thread::sleep(Duration::from_millis(*milliseconds));
        signal(&mut child, "STOP");
        std::thread::sleep(Duration::from_millis(2500));
        signal(&mut child, "CONT");
    }
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{arguments}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn an_estimate_does_not_depend_on_how_fast_its_pilot_is() {
    let home = TempDir::new().unwrap();
    for arguments in [
        "--backend cpu --threads 2 --curves 7 --points 50000 --adaptive --t-end 1e-15",
        "--backend cpu --threads 2 --curves 100000 --adaptive=1e-6 --series 0.01",
    ] {
        let [free, held] = [&[][..], &[300, 300]].map(|holds| held_estimate(home.path(), arguments, holds));
        for key in ["steps_per_member", "disk_bytes", "members", "slots"] {
            assert!(free[key] == held[key] && !free[key].is_null(), "{arguments}, {key}: {free}, {held}");
        }
        for key in ["members", "ended", "relaxed"] {
            assert_eq!(free["pilot"][key], held["pilot"][key], "{arguments}, {key}");
        }
        let [free, held] = [&free, &held].map(|estimate| estimate["memory_bytes"].as_f64().unwrap());
        assert!((free / held - 1.0).abs() < 0.05, "{arguments}: {free}, {held}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn the_memory_of_a_sweep_is_that_of_its_largest_cell_in_any_order() {
    let home = TempDir::new().unwrap();
    let study = "run --backend cpu --threads 1 --curves 2 --adaptive --t-end 1e-13 --quiet";
    let study = format!("{study} --checkpoint-every {NEVER}");
    let foretold = |points: &str| {
        let dry_run = format!("{study} --sweep points={points} --dry-run --json");
        json(home.path(), &dry_run)["memory_bytes"].as_f64().unwrap()
    };
    let [rising, falling, small] = ["64,20000", "20000,64", "64,65"].map(foretold);
    assert!((rising / falling - 1.0).abs() < 0.05, "{rising} and {falling}");
    let taken = peak(home.path(), &format!("{study} --sweep points=20000,64"), "out");
    for said in [rising, falling] {
        assert!((said / taken - 1.0).abs() < 0.2, "{said} foretold, {taken} taken");
    }
    assert!(small < 0.5 * taken, "{small} foretold for small members, {taken} taken by large ones");
}

#[cfg(unix)]
#[test]
fn the_pilot_of_a_dry_run_can_be_stopped() {
    let home = TempDir::new().unwrap();
    // Each step needs more sweeps than any machine makes in hours. A warning comes when signals are received.
    let long = "run --dry-run --backend cpu --threads 1 --curves 64 --points 3000 --tau 0.1 --t-end 2 --max-sweeps 100000000 \
                --solver gauss-seidel";
    let stopped = |output: &Output, cause: &str, code: i32| {
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert_eq!(said.matches("error: ").count(), 1, "{said}");
        // A machine that is very busy ends it before it answers.
        let expected =
            ["in the pilot", "at once"].map(|when| format!("error: stopped by {cause} {when}: nothing is saved"));
        assert!(expected.iter().any(|line| said.lines().last() == Some(line)), "{said}");
        assert!(output.stdout.is_empty());
    };
    stopped(&curvelax(home.path(), &format!("{long} --max-time 1s")), "--max-time", 75);
    for (signal, cause, code) in [("TERM", "SIGTERM", 75), ("INT", "Ctrl-C", 130)] {
        let Some(mut command) = handling(home.path(), signal) else { continue };
        command.args(long.split_whitespace());
        stopped(&signalled_when(&mut command, signal, |said| said.contains("warning: ")), cause, code);
    }
    assert_eq!(names(home.path()), [""; 0]);
}

/// Vulkan's loader lists what it loads; without `XDG_RUNTIME_DIR` a layer of Mesa prints a message, too.
#[cfg(target_os = "linux")]
#[test]
fn a_first_run_loads_no_driver_where_no_gpu_can_be() {
    let home = TempDir::new().unwrap();
    let mut first = program(home.path());
    first.env_remove("XDG_RUNTIME_DIR").env("VK_LOADER_DEBUG", "all").env_remove("VK_ADD_DRIVER_FILES");
    first.args(["run", "--curves", "3", "--t-end", "0.01", "--relax-to", "0.99", "--out", "out"]);
    let said = String::from_utf8(first.output().unwrap().stderr).unwrap();
    let kinds = ["dri", "nvidia", "nvhost", "nvgpu", "kfd", "dxg", "mali", "kgsl", "pvr", "galcore"];
    let devices = fs::read_dir("/dev").into_iter().flatten().map(|entry| entry.unwrap().file_name());
    let has_nodes = devices.into_iter().any(|name| kinds.iter().any(|kind| name.to_string_lossy().starts_with(kind)));
    // A slow run prints how far it is.
    let lines: Vec<&str> = said.lines().filter(|line| !line.contains(" of 3 runs, ")).collect();
    assert!(has_nodes || lines == ["back end: CPU, f64 (no hardware GPU found); Gauss-Seidel sweeps"], "{said}");
}

#[test]
fn completions_are_scripts_and_know_the_commands_and_flags() {
    let home = TempDir::new().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = printed(home.path(), &format!("completions {shell}"));
        for word in ["convergence", "stop-when-relaxed", "max-time"] {
            assert!(script.contains(word), "no {word} for {shell}");
        }
    }
    let parses = |script: &str| {
        fs::write(home.path().join("script"), script).unwrap();
        Command::new("bash").arg("-n").arg(home.path().join("script")).stderr(Stdio::null()).status().unwrap().success()
    };
    let script = printed(home.path(), "completions bash");
    assert!(parses(&script));
    assert!(!parses(&script.replacen("esac", "", 1)), "bash takes anything");
    assert_eq!(curvelax(home.path(), "completions tcsh").status.code(), Some(2));
}

/// The commands that have a separate section in a man page.
fn sections(page: &str) -> Vec<&str> {
    page.lines().filter_map(|line| line.strip_prefix(".SH \"curvelax ")?.strip_suffix('"')).collect()
}

#[test]
fn the_man_page_has_every_command_with_its_flags() {
    let home = TempDir::new().unwrap();
    let page = printed(home.path(), "man");
    let help = printed(home.path(), "--help");
    let (_, listed) = help.split_once("Commands:\n").unwrap();
    let listed = listed.lines().take_while(|line| line.starts_with("  "));
    let commands: Vec<&str> =
        listed.filter_map(|line| line.split_whitespace().next()).filter(|c| *c != "help").collect();
    assert!(commands.len() >= 8 && commands.contains(&"run"), "{commands:?}");
    assert_eq!(sections(&page), commands);
    assert!(page.contains(".TH curvelax 1") && page.contains("max\\-time"), "{page}");
    let without = page.replace(".SH \"curvelax bench\"", ".PP");
    assert_ne!(sections(&without), commands, "a command that is missing is not missed");
}

/// Of each command that has the flag, except `check`, which takes minutes.
#[test]
fn quiet_says_nothing_but_errors() {
    let home = TempDir::new().unwrap();
    // With a warning: sweeps slow down with adaptive steps.
    let warned = "--curves 2 --points 34 --adaptive=1e-2 --solver gauss-seidel --t-end 0.01";
    let loud = curvelax(home.path(), &format!("run {warned} --backend auto --out loud"));
    let said = String::from_utf8(loud.stderr).unwrap();
    assert!(
        said.contains("back end: ") && said.contains("\nwarning: Gauss-Seidel ") && !loud.stdout.is_empty(),
        "{said}"
    );
    fs::remove_file(home.path().join("loud/plots/portraits.json")).unwrap();
    for arguments in [
        format!("run {warned} --backend auto --out run"),
        format!("run {warned} --dry-run"),
        format!("run {warned} --shard 0/1 --out shard"),
        "merge shard --out merged".into(),
        "resume run".into(),
        "plot loud".into(),
        "animate run --out movie.svg".into(),
        "figure fig1a --out figure".into(),
        "convergence --problem willmore-circle --backend cpu".into(),
    ] {
        assert_eq!(printed(home.path(), &format!("{arguments} --quiet")), "", "{arguments}");
    }
    // The rates are its result, and in no file.
    let bench = "bench --backend cpu --solver direct --precision f64 --points 34 --seconds 0.01 --repeats 1 --quiet";
    assert!(printed(home.path(), bench).contains("direct"));
    let stopped = curvelax(home.path(), "run --curves 100000000 --backend cpu --max-time 1s --out long --quiet");
    let said = String::from_utf8(stopped.stderr).unwrap();
    assert!(said.starts_with("error: stopped by --max-time ") && said.lines().count() == 1, "{said}");
    assert_eq!(printed(home.path(), "resume run --quiet"), "");
}

#[test]
fn a_software_gpu_that_was_asked_for_is_warned_about_once() {
    let Some((number, gpu)) = Gpu::list().into_iter().enumerate().find(|(_, gpu)| !gpu.is_hardware()) else {
        assert!(std::env::var("ALLOW_NO_GPU").is_ok(), "no software GPU; ALLOW_NO_GPU=1 leaves this out");
        return;
    };
    let home = TempDir::new().unwrap();
    let run = "run --curves 2 --points 34 --t-end 0.01 --relax-to 0.99 --precision f32 --solver direct";
    let warning = format!("{} is a software GPU, and the CPU back end is faster: use --backend cpu", gpu.name());
    let warnings = |out: &str| -> Vec<String> {
        let text = fs::read_to_string(home.path().join(out).join("run.json")).unwrap();
        serde_json::from_value(serde_json::from_str::<Value>(&text).unwrap()["warnings"].take()).unwrap()
    };
    let loud = curvelax(home.path(), &format!("{run} --backend gpu --adapter {number} --out loud"));
    let said = String::from_utf8(loud.stderr).unwrap();
    assert_eq!(said.matches(&format!("warning: {warning}\n")).count(), 1, "{said}");
    printed(home.path(), &format!("{run} --backend gpu --adapter {number} --out quiet --quiet"));
    assert_eq!([warnings("loud"), warnings("quiet")], [[warning.clone()], [warning]]);
    let cpu = curvelax(home.path(), &format!("{run} --backend cpu --out cpu"));
    assert!(cpu.status.success() && !String::from_utf8_lossy(&cpu.stderr).contains("software GPU"));
    assert_eq!(warnings("cpu"), [""; 0]);
}
