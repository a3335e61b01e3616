//! The program on adapters that open but fail: they compute wrongly, compile without end, are lost or hang, or hold
//! little.
//!
//! Each is a real Vulkan driver, lavapipe or SwiftShader, behind `driver.c`, which passes all calls on but does
//! one thing badly and calls itself hardware. The program is the one that users get: `--backend auto` must end on the
//! CPU with one note, and `--backend gpu` with one error.
//!
//! Nothing depends on the speed of the machine. A driver is given up after the seconds that a test says, which are few
//! only where it must be given up; and if a working one is given up on a slow machine, the test has more patience.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    sync::{Arc, Mutex, PoisonError},
};

use crate::{
    common::{command, program::Row},
    may_lack_gpu,
};
use libtest_mimic::{Failed, Trial};
use tempfile::TempDir;

type Outcome = Result<(), Failed>;

/// Half of the members end early. The others are observed 50 times, and have at least as many dispatches.
const RUN: &str = "run --sweep t-end=0.1,1 --curves 12 --solver direct --tau 0.01 --series 0.02 --out out";

/// A submission after the self-test, which has about ten, and after the early members, but before the end.
const MIDWAY: &str = "40";

/// An addition that the members of the self-test need.
const ADDITION: &str = "40";

/// A driver behind the hostile one.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Driver {
    Lavapipe,
    SwiftShader,
}

impl Driver {
    /// Where its description may be, as in `tests/run`: folders, and the beginning of its name.
    fn places(self) -> (&'static [&'static str], &'static str) {
        match self {
            Driver::Lavapipe => {
                (&["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"], "lvp_icd")
            }
            Driver::SwiftShader => {
                (&["/usr/lib/chromium", "/usr/lib/chromium-browser", "/opt/google/chrome"], "vk_swiftshader_icd")
            }
        }
    }

    /// Its library.
    fn library(self) -> Option<PathBuf> {
        let (folders, begin) = self.places();
        let files = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
        // Some systems have those of other processors, too, with these in their names.
        let rank = |name: &str| {
            let rest = name.strip_prefix(begin)?.strip_suffix(".json")?;
            [format!(".{}", std::env::consts::ARCH), String::new()].iter().position(|own| own == rest)
        };
        let found = files.filter_map(|file| Some((rank(&file.file_name().to_string_lossy())?, file.path())));
        let (_, description) = found.min()?;
        let text: serde_json::Value = serde_json::from_str(&fs::read_to_string(&description).ok()?).ok()?;
        let library = text["ICD"]["library_path"].as_str()?;
        // A name without a folder is left to the linker.
        let folder = if library.contains('/') { description.parent()? } else { Path::new("") };
        Some(folder.join(library))
    }

    /// Bound on relative differences between this driver and the CPU in its precision.
    fn bound(self) -> f64 {
        match self {
            Driver::Lavapipe => 1e-9,
            Driver::SwiftShader => 1e-3,
        }
    }
}

/// The tests; without lavapipe they fail, unless that is allowed.
pub fn trials() -> Vec<Trial> {
    let allowed = may_lack_gpu();
    let compiles = Path::new("/usr/include/vulkan/vulkan.h").exists()
        && Command::new("cc").arg("--version").stdout(Stdio::null()).status().is_ok_and(|status| status.success());
    let mut trials = Vec::new();
    let used = Arc::new(Used);
    for driver in [Driver::Lavapipe, Driver::SwiftShader] {
        let found = driver.library().is_some();
        let mut add = |name: &str, case: fn(Driver) -> Outcome| {
            let used = Arc::clone(&used);
            let trial = Trial::test(format!("{driver:?}: {name}"), move || {
                let _used = used;
                case(driver)
            });
            // Without lavapipe, these fail unless that is allowed.
            let left_out = !compiles || (!found && (allowed || driver == Driver::SwiftShader));
            trials.push(trial.with_ignored_flag(left_out));
        };
        if driver == Driver::Lavapipe {
            add("a kernel that compiles without end is abandoned for the CPU", compiles_without_end);
            add("a dispatch that hangs midway is abandoned for the CPU", hangs_midway);
        }
        add("without a fault the run is on the GPU and conforms", no_fault);
        add("what fails before the run leaves it to the CPU, bit for bit, or is an error", fails_before);
        add("an adapter with little memory or few threads runs what it holds", limits);
        add("a small binding leaves room for fewer members at once", small_binding);
        add("a device that is lost midway loses no member that ended", lost_midway);
    }
    eprintln!(
        "ignored tests lack a driver or a C compiler (Debian: mesa-vulkan-drivers, chromium, gcc, libvulkan-dev)"
    );
    trials
}

fn require(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise().into()) }
}

/// The folder with the hostile driver, compiled, and its description; while any of the tests may need it.
static COMPILED: Mutex<Option<TempDir>> = Mutex::new(None);

/// Removes the folder when the last of the tests is over.
struct Used;

impl Drop for Used {
    fn drop(&mut self) {
        COMPILED.lock().unwrap_or_else(PoisonError::into_inner).take();
    }
}

fn compiled() -> PathBuf {
    let mut folder = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    folder.get_or_insert_with(compile).path().to_owned()
}

fn compile() -> TempDir {
    // Nothing in a temporary folder of the system may be executable; here it is.
    let folder = TempDir::new_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let library = folder.path().join("libhostile.so");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cases/driver.c");
    let mut command = Command::new("cc");
    command.args(["-Wall", "-Wextra", "-O1", "-shared", "-fPIC", "-o"]).arg(&library).arg(source);
    assert!(command.arg("-ldl").status().unwrap().success());
    let icd = serde_json::json!({ "library_path": library, "api_version": "1.1.0" });
    let text = serde_json::json!({ "file_format_version": "1.0.0", "ICD": icd });
    fs::write(folder.path().join("hostile.json"), text.to_string()).unwrap();
    folder
}

/// What a command did in its folder.
struct Ran {
    home: TempDir,
    output: Output,
}

/// Seconds that no driver takes, on any machine.
const PATIENT: u32 = 1_000_000;

/// A command line in `home` on an adapter with a fault.
fn faulty(home: &Path, driver: Driver, fault: &str, patience: u32, arguments: &str) -> Command {
    let mut command = command::command(home, arguments);
    let icd = compiled().join("hostile.json");
    // The last one says that there may be hardware without a device node. The loader obeys the others.
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_ADD_DRIVER_FILES"] {
        command.env(variable, &icd);
    }
    command
        .env("HOSTILE_DRIVER", driver.library().expect("no lavapipe; set ALLOW_NO_GPU=1"))
        .env("HOSTILE_FAULT", fault)
        .env("CURVELAX_GPU_PATIENCE", patience.to_string());
    command
}

fn run_in(home: TempDir, driver: Driver, fault: &str, arguments: &str) -> Ran {
    let output = faulty(home.path(), driver, fault, PATIENT, arguments).output().unwrap();
    Ran { home, output }
}

fn run(driver: Driver, fault: &str, arguments: &str) -> Ran {
    run_with(driver, fault, PATIENT, arguments)
}

fn run_with(driver: Driver, fault: &str, patience: u32, arguments: &str) -> Ran {
    let home = TempDir::new().unwrap();
    let output = faulty(home.path(), driver, fault, patience, &whole(arguments)).output().unwrap();
    Ran { home, output }
}

/// A command line that begins a run.
fn whole(arguments: &str) -> String {
    let points = if arguments.contains("--points") { "" } else { "--points 32" };
    format!("{RUN} {points} {arguments}")
}

impl Ran {
    fn said(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// Checks the exit code.
    fn ended(self, code: i32) -> Result<Ran, Failed> {
        match self.output.status.code() == Some(code) {
            true => Ok(self),
            false => Err(format!("{}: {}", self.output.status, self.said()).into()),
        }
    }

    /// Checks that exactly one line of stderr, apart from progress, begins with `begin`, and that it has all `parts`.
    fn told(&self, begin: &str, parts: &[&str]) -> Outcome {
        let said = self.said();
        let lines: Vec<&str> = said.lines().filter(|line| line.starts_with(begin)).collect();
        let whole = lines.len() == 1 && parts.iter().all(|part| lines[0].contains(part));
        require(whole, || format!("{begin:?} with {parts:?} is not one line of:\n{said}"))
    }

    /// The tables by name; none if nothing was written.
    fn tables(&self) -> BTreeMap<String, String> {
        let files = fs::read_dir(self.home.path().join("out")).into_iter().flatten().flatten().map(|file| file.path());
        let tables = files.filter(|path| path.extension().is_some_and(|ending| ending == "csv"));
        tables.map(|path| (path.display().to_string(), fs::read_to_string(&path).unwrap())).map(name).collect()
    }

    fn summary(&self) -> Vec<Row> {
        let text = &self.tables()["summary.csv"];
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        reader.deserialize().map(|row| row.unwrap()).collect()
    }

    fn record(&self) -> String {
        fs::read_to_string(self.home.path().join("out/run.json")).unwrap()
    }
}

/// The last part of a path.
fn name((path, text): (String, String)) -> (String, String) {
    (path.rsplit('/').next().unwrap_or_default().to_string(), text)
}

/// The same run on the CPU, which no fault concerns, in the precision of the driver or that of the CPU.
fn on_cpu(driver: Driver, precision: &str) -> Result<Ran, Failed> {
    run(driver, "nothing", &format!("--backend cpu {precision}")).ended(0)
}

/// The precision of the driver.
fn own_precision(driver: Driver) -> &'static str {
    match driver {
        Driver::Lavapipe => "--precision f64",
        Driver::SwiftShader => "--precision f32",
    }
}

/// Columns that are compared as numbers.
const COLUMNS: [&str; 5] = ["t_end", "length_end", "area_end", "energy_end", "t_half"];

/// The largest relative difference of the members of two runs.
fn difference(a: &[Row], b: &[Row]) -> Result<f64, Failed> {
    require(a.len() == 24 && b.len() == 24, || format!("{} and {} members", a.len(), b.len()))?;
    let mut most = 0.0_f64;
    for (a, b) in a.iter().zip(b) {
        require(a["status"] == b["status"], || format!("{a:?} and {b:?}"))?;
        for column in COLUMNS.into_iter().filter(|column| !a[*column].is_empty()) {
            let [a, b]: [f64; 2] = [a[column].parse()?, b[column].parse()?];
            most = most.max((a - b).abs() / a.abs());
        }
    }
    Ok(most)
}

fn no_fault(driver: Driver) -> Outcome {
    let gpu = run(driver, "nothing", "").ended(0)?;
    gpu.told("back end: GPU Hostile (Vulkan)", &["hardware GPU Hostile"])?;
    require(!gpu.said().contains("on the CPU"), || gpu.said())?;
    require(gpu.record().contains("\"adapter\": \"Hostile\""), || gpu.record())?;
    let cpu = on_cpu(driver, own_precision(driver))?;
    let apart = difference(&gpu.summary(), &cpu.summary())?;
    println!("{driver:?}: {apart:.1e}");
    require(apart <= driver.bound() && gpu.tables() != cpu.tables(), || format!("{apart:.1e} apart"))?;
    // The negative control: other members.
    let other = run(driver, "nothing", "--seed 2").ended(0)?;
    let apart = difference(&gpu.summary(), &other.summary())?;
    require(apart > driver.bound(), || format!("other members are {apart:.1e} apart"))
}

fn fails_before(driver: Driver) -> Outcome {
    let cpu = on_cpu(driver, "")?.tables();
    let faults = [
        ("closed", "cannot be opened"),
        (&format!("wrong {ADDITION}"), "computes wrongly: "),
        ("idle", "a dispatch did nothing for the member in slot 0"),
        ("lost 0", "the device was lost"),
        ("binding 100", "no room for 1 member of 32 points"),
    ];
    for (fault, what) in faults {
        let auto = run(driver, fault, "--backend auto").ended(0)?;
        auto.told("note: on the CPU", &["instead: the GPU failed: ", "Hostile", what, "--backend cpu"])?;
        require(auto.record().contains(what), || auto.record())?;
        require(auto.tables() == cpu, || format!("{fault}: the tables are not those of the CPU"))?;
        let gpu = run(driver, fault, "--backend gpu").ended(1)?;
        gpu.told("error: ", &["Hostile", what, "--backend cpu"])?;
        require(!gpu.home.path().join("out").exists(), || format!("{fault}: something was written"))?;
    }
    Ok(())
}

fn limits(driver: Driver) -> Outcome {
    let cpu = on_cpu(driver, "")?.tables();
    for (fault, needs) in [("memory 500", "bytes of workgroup memory"), ("threads 4", "threads a workgroup")] {
        let auto = run(driver, fault, "--backend auto").ended(0)?;
        auto.told("back end: CPU, f64", &["GPU Hostile cannot do it: --points 32: a member needs ", needs])?;
        require(auto.tables() == cpu, || format!("{fault}: the tables are not those of the CPU"))?;
        let gpu = run(driver, fault, "--backend gpu").ended(2)?;
        gpu.told("error: --points 32: ", &[needs, "--backend cpu"])?;
        require(!gpu.home.path().join("out").exists(), || format!("{fault}: something was written"))?;
        require(!gpu.said().contains("use 0"), || gpu.said())?;
    }
    // The largest number of points that is offered is one that runs.
    let refused = run(driver, "memory 4000", "--backend gpu --points 319").ended(2)?.said();
    let words = refused.split_once("; use ").and_then(|(_, rest)| rest.split_once(" or fewer"));
    let (most, _) = words.ok_or_else(|| refused.clone())?;
    require((33..319).contains(&most.parse::<i32>()?), || refused.clone())?;
    run(driver, "memory 4000", &format!("--backend gpu --points {most}")).ended(0).map(drop)
}

fn small_binding(driver: Driver) -> Outcome {
    // Room for fewer than the 24 members.
    let small = run(driver, "binding 20000", "").ended(0)?;
    small.told("back end: GPU Hostile", &[])?;
    let large = run(driver, "nothing", "").ended(0)?;
    require(small.tables() == large.tables(), || "the tables differ".into())
}

/// Checks a run on the CPU that began on the GPU: members that ended there stay as they were.
fn continued(driver: Driver, ran: &Ran) -> Outcome {
    let (gpu, cpu) = (run(driver, "nothing", "").ended(0)?, on_cpu(driver, own_precision(driver))?);
    let rows = [ran, &gpu, &cpu].map(Ran::summary);
    let early = |rows: &[Row]| rows.iter().filter(|row| row["cell"] == "0").cloned().collect::<Vec<_>>();
    require(early(&rows[0]) == early(&rows[1]), || "the members that had ended differ".into())?;
    require(rows[0] != rows[1] && rows[0] != rows[2], || "the run was on one device".into())?;
    let apart = difference(&rows[0], &rows[2])?;
    println!("{driver:?}: {apart:.1e}");
    require(apart <= driver.bound(), || format!("{apart:.1e} apart"))?;
    let moved = ["the run began on gpu Hostile", "and continued on cpu"];
    require(moved.iter().all(|part| ran.record().contains(part)), || ran.record())
}

fn lost_midway(driver: Driver) -> Outcome {
    let fault = format!("lost {MIDWAY}");
    let auto = run(driver, &fault, "--backend auto").ended(0)?;
    auto.told(
        "note: on the CPU",
        &["from here on: the GPU failed: GPU Hostile: the device was lost", "--backend cpu"],
    )?;
    auto.told("resuming: 12 of 24 members", &[])?;
    auto.told("warning: the run began on gpu Hostile", &["and continued on cpu"])?;
    auto.told("back end: CPU", &["(the GPU failed)"])?;
    require(auto.record().contains("the GPU failed: GPU Hostile: the device was lost"), || auto.record())?;
    continued(driver, &auto)?;
    let gpu = run(driver, &fault, "--backend gpu").ended(1)?;
    gpu.told("error: GPU Hostile: the device was lost", &["--backend cpu"])?;
    gpu.told("note: the run was saved: curvelax resume out continues it", &["--backend cpu"])?;
    continued(driver, &run_in(gpu.home, driver, "nothing", "resume out --backend cpu").ended(0)?)
}

fn compiles_without_end(driver: Driver) -> Outcome {
    // After 5 s it is told that the kernel is still being compiled.
    let auto = run_with(driver, "compiles", 6, "--backend auto").ended(0)?;
    auto.told("note: GPU Hostile is still compiling the kernel", &["after 6 s the CPU is used instead"])?;
    let why = ["GPU Hostile: the kernel is not compiled after 6 s", "--backend gpu waits"];
    auto.told("note: on the CPU instead: the GPU failed: ", &why)?;
    require(auto.tables() == on_cpu(driver, "")?.tables(), || "the tables are not those of the CPU".into())?;
    // A request for this GPU waits, and can be stopped.
    let note = "note: GPU Hostile is still compiling the kernel";
    let home = TempDir::new()?;
    let mut command = faulty(home.path(), driver, "compiles", 6, &whole("--backend gpu"));
    let output = command::signalled_when(&mut command, "TERM", |said| said.contains(note));
    let gpu = Ran { home, output }.ended(75)?;
    gpu.told(note, &[])?;
    require(!gpu.said().contains("after 6 s"), || gpu.said())
}

/// The driver writes this on stderr when it first hangs.
const HANGS: &str = "hostile: hangs";

fn hangs_midway(driver: Driver) -> Outcome {
    // The driver keeps the kernel, which it need not compile again.
    run(driver, "nothing", "").ended(0)?;
    let mut patience = 2;
    // A driver that works may be slower than that on a busy machine.
    let auto = loop {
        let auto = run_with(driver, &format!("hangs {MIDWAY}"), patience, "--backend auto").ended(0)?;
        if auto.said().contains(HANGS) {
            break auto;
        }
        require(patience < PATIENT, || format!("nothing hangs: {}", auto.said()))?;
        patience *= 2;
    };
    let what = "a dispatch did not end in ";
    auto.told("note: on the CPU", &["from here on: the GPU failed: GPU Hostile: ", what])?;
    let said = auto.said();
    let (_, rest) = said.split_once(what).ok_or("no time")?;
    let (waited, _) = rest.split_once(" s").ok_or("no seconds")?;
    require(waited.parse::<f64>()? >= f64::from(patience), || format!("{waited} s with a patience of {patience} s"))?;
    continued(driver, &auto)
}
