//! The kernels as other compilers read them. A test without its compiler is reported as ignored.
//!
//! - Tint, in Chromium, is the second implementation of WGSL: it also proves that barriers are in uniform control flow,
//!   which naga does not. It reads every kernel, and builds pipelines of some for SwiftShader, Chromium's software GPU,
//!   whose compiler takes seconds for each.
//! - spirv-val judges what naga makes of them for Vulkan.
//! - ACO, AMD's compiler in Mesa, says whether their values fit into registers.

#[allow(dead_code)] // its main function
#[path = "../../examples/kernels.rs"]
mod kernels;

use std::{
    collections::BTreeMap,
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    sync::mpsc::channel,
    thread,
    time::Duration,
};

use crate::{browser::in_browser, common::browser::headless, everything};
use curvelax::{
    backend::gpu::{Variant, shader},
    solver::{Blocks, Solver},
};
use libtest_mimic::Trial;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use serde::{Deserialize, Serialize};

/// No page needs this long on any machine; one that does hangs.
const HANGS: Duration = Duration::from_secs(6 * 3600);

/// Reads every kernel, builds those of which it is asked, and says on the console what becomes of each. Whatever ends
/// the script early is said, too.
const PAGE: &str = r#"<!doctype html><meta charset="utf-8"><script>
const say = (name, error) => console.log("VERDICT " + JSON.stringify({ name, error }));
onerror = (message) => say("page", message);
onunhandledrejection = ({ reason }) => say("page", String(reason));
</script><script type="module">
const kernels = KERNELS;
try {
  const adapter = await navigator.gpu.requestAdapter();
  const requiredFeatures = adapter.features.has("subgroups") ? ["subgroups"] : [];
  const device = await adapter.requestDevice({ requiredFeatures });
  device.lost.then(({ message }) => say("page", "the device was lost: " + message));
  for (const { name, code, constants, build } of kernels) {
    device.pushErrorScope("validation");
    const module = device.createShaderModule({ code });
    const compute = { module, entryPoint: "evolve", constants };
    let error = null;
    if (build) {
      await device.createComputePipelineAsync({ layout: "auto", compute }).catch((e) => { error = e.message; });
    }
    const refused = await device.popErrorScope();
    say(name, refused ? refused.message : error);
  }
} catch (e) { say("page", String(e)); }
say("end", null);
</script>"#;

#[derive(Serialize)]
struct Kernel {
    name: String,
    code: String,
    constants: BTreeMap<&'static str, f64>,
    /// Whether its pipeline is built, too.
    build: bool,
}

impl Kernel {
    fn new(variant: Variant, n: usize) -> Kernel {
        let blocks = Blocks::new(n).unwrap();
        // naga 30 has subgroups without this line, and refuses it.
        let enable = if variant.subgroup { "enable subgroups;\n" } else { "" };
        Kernel {
            name: format!("{variant:?}, n = {n}"),
            code: format!("{enable}{}", shader::source::<f32>(variant)),
            constants: shader::constants(shader::sizes(blocks, 32, variant.for_one_size)).into_iter().collect(),
            // What may be wrong in the constants, and in the size of the workgroup, is the same in all of a solver.
            build: everything() || variant == Variant { subgroup: variant.subgroup, ..Variant::of(variant.solver) },
        }
    }

    /// The kernel with one part of its text replaced.
    fn with(self, from: &str, to: &str) -> Kernel {
        assert_eq!(self.code.matches(from).count(), 1, "{from}");
        Kernel { code: self.code.replace(from, to), ..self }
    }
}

#[derive(Deserialize)]
struct Verdict {
    name: String,
    error: Option<String>,
}

/// The tests, of which those are ignored whose compiler is missing.
pub fn trials() -> Vec<Trial> {
    let of = |name: &str, needed: bool, test: fn()| {
        let trial = Trial::test(name, move || {
            test();
            Ok(())
        });
        trial.with_ignored_flag(!needed)
    };
    eprintln!(
        "ignored tests lack their compiler (Debian: chromium, spirv-tools, mesa-vulkan-drivers, libvulkan-dev, gcc)"
    );
    vec![
        in_browser("tint_accepts_every_kernel_in_f32", every_kernel_is_accepted),
        in_browser("tint_refuses_a_barrier_under_a_private_condition", a_private_condition_is_refused),
        of("spirv_val_accepts_every_kernel", answers("spirv-val", "--version"), spirv_is_valid),
        of("aco_spills_nothing_but_in_crystals_in_f64", has_aco(), nothing_is_spilled),
    ]
}

/// Whether a program can be started.
fn answers(program: &str, argument: &str) -> bool {
    Command::new(program).arg(argument).stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
}

/// Whether RADV, a C compiler and Vulkan's headers are there.
fn has_aco() -> bool {
    let folder = Path::new("/usr/share/vulkan/icd.d");
    let has_driver = fs::read_dir(folder).is_ok_and(|mut files| {
        files.any(|file| file.is_ok_and(|file| file.file_name().to_string_lossy().starts_with("radeon_icd")))
    });
    has_driver && Path::new("/usr/include/vulkan/vulkan.h").exists() && answers("cc", "--version")
}

/// Whether spirv-val finds a file valid.
fn is_valid_spirv(path: &Path) -> bool {
    let judged = Command::new("spirv-val").args(["--target-env", "vulkan1.1"]).arg(path).output().unwrap();
    judged.status.success()
}

fn spirv_is_valid() {
    let folder = tempfile::tempdir().unwrap();
    let mut judged = 0;
    for n in [6, 100, 257] {
        kernels::write_all(n, folder.path()).unwrap();
    }
    for file in fs::read_dir(folder.path()).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "spv") {
            assert!(is_valid_spirv(&path), "{}", path.display());
            judged += 1;
        }
    }
    println!("{judged} kernels are valid");
    // Two solvers, two forms, crystals, and forces with and without them, fixed and adaptive, two precisions; sweeps
    // also within a subgroup, but for 257 nodes.
    assert_eq!(judged, 3 * (20 + 20) + 2 * 20);
    // Negative control: half of the code. Another word in its middle may be as valid.
    let path = folder.path().join("direct-f32-n100.spv");
    let mut bytes = fs::read(&path).unwrap();
    bytes.truncate(bytes.len() / 8 * 4);
    fs::write(&path, bytes).unwrap();
    assert!(!is_valid_spirv(&path));
}

/// The kernels in `folder` with the number of registers that ACO spills, by `benches/compilers/run`.
fn spilled(folder: &Path) -> BTreeMap<String, u32> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/compilers/run");
    let output = Command::new(script).arg("aco").env("KERNELS", folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = String::from_utf8(output.stdout).unwrap();
    let rows = table.lines().map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
    rows.filter_map(|row| Some((row.get(1)?.to_string(), row.get(3)?.parse().ok()?))).collect()
}

fn nothing_is_spilled() {
    let folder = tempfile::tempdir().unwrap();
    kernels::write_all(100, folder.path()).unwrap();
    if !everything() {
        // Its compiler takes seconds for each, and adaptive steps in f32 need more registers than fixed ones.
        for file in fs::read_dir(folder.path()).unwrap() {
            let path = file.unwrap().path();
            let name = path.display().to_string();
            if !(name.contains("-adaptive") && name.contains("-f32-")) {
                fs::remove_file(path).unwrap();
            }
        }
    }
    fs::write(folder.path().join("control.spv"), kernel_of(300)).unwrap();
    let mut spilled = spilled(folder.path());
    // Negative control: more values than there are registers.
    assert!(spilled.remove("control").is_some_and(|spilled| spilled > 0));
    // Mesa 22.3 fails on some in f64.
    let judged = spilled.keys().filter(|name| name.contains("-f32-")).count();
    assert_eq!(judged, if everything() { 30 } else { 15 }, "{spilled:?}");
    // In adaptive steps of crystals in f64, and in all steps of driven ones, more values are needed at once than there
    // are registers.
    let allowed = |name: &str| match name {
        "direct-adaptive-crystal-f64-n100" => 12,
        "gauss-seidel-adaptive-crystal-f64-n100" => 22,
        "direct-adaptive-crystal-forced-f64-n100" => 24,
        "gauss-seidel-adaptive-crystal-forced-f64-n100" => 32,
        "gauss-seidel-crystal-forced-f64-n100" => 10,
        _ => 0,
    };
    assert!(spilled.iter().all(|(name, spilled)| *spilled <= allowed(name)), "{spilled:?}");
}

/// A kernel in SPIR-V that holds `values` numbers at once.
fn kernel_of(values: usize) -> Vec<u8> {
    let load = |i: usize| format!("let v{i} = all_states[{}u + lane];", 64 * i);
    let store = |i: usize| format!("all_states[{}u ^ lane] = v{};", 64 * i + 1, values - 1 - i);
    let all = |line: &dyn Fn(usize) -> String| (0..values).map(line).collect::<String>();
    let source = format!(
        "@group(0) @binding(4) var<storage, read_write> all_states: array<f32>;
        @compute @workgroup_size(32) fn evolve(@builtin(local_invocation_index) lane: u32) {{
            {} storageBarrier(); {}
        }}",
        all(&load),
        all(&store)
    );
    let module = naga::front::wgsl::parse_str(&source).unwrap();
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).unwrap();
    let words = naga::back::spv::write_vec(&module, &info, &kernels::as_wgpu_asks(), None).unwrap();
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// A browser, which would otherwise stay open.
struct Open(Child);

impl Drop for Open {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What Tint and the device say of each kernel: nothing, or the error.
fn verdicts(browser: &Path, kernels: &[Kernel]) -> Vec<Option<String>> {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("kernels.html");
    fs::write(&page, PAGE.replace("KERNELS", &serde_json::to_string(kernels).unwrap().replace("</", "<\\/"))).unwrap();
    let (mut command, _profile) = headless(browser);
    command.args(["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan"]);
    command.arg(format!("file://{}", page.display())).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let said = BufReader::new(child.stderr.take().unwrap());
    let _open = Open(child);
    // The browser says nothing, and does not end, if its page hangs.
    let (send, lines) = channel();
    thread::spawn(move || said.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
    let mut found = Vec::new();
    // A line of the console: [...:CONSOLE:12] "VERDICT {...}", source: file:///... (12)
    while let Ok(line) = lines.recv_timeout(HANGS) {
        let Some(said) = line.split("\"VERDICT ").nth(1).and_then(|rest| rest.rsplit_once("\", source: ")) else {
            continue;
        };
        let Verdict { name, error } = serde_json::from_str(said.0).unwrap();
        if name == "end" {
            assert_eq!(found.len(), kernels.len(), "the page ended early");
            return found;
        }
        assert_eq!(Some(&name), kernels.get(found.len()).map(|kernel| &kernel.name), "{error:?}");
        found.push(error);
    }
    panic!("the page did not get to its end, after {} of {} kernels", found.len(), kernels.len());
}

fn every_kernel_is_accepted(browser: &Path) {
    // Of one size, with blocks of three and of four: others differ in constants alone.
    let mut kernels: Vec<Kernel> = Variant::all().into_iter().map(|variant| Kernel::new(variant, 30)).collect();
    // Those for many sizes, of which software GPUs have all: where a size comes from is one text.
    kernels.extend(Solver::ALL.map(|solver| {
        let every_branch =
            Variant { adaptive: true, geometric: true, crystal: true, forced: true, ..Variant::of(solver) };
        Kernel::new(Variant { for_one_size: false, ..every_branch }, 30)
    }));
    let verdicts = verdicts(browser, &kernels);
    let refused = kernels.iter().zip(verdicts).filter_map(|(kernel, error)| Some((&kernel.name, error?)));
    assert_eq!(refused.collect::<Vec<_>>(), []);
    println!("{} kernels are accepted", kernels.len());
}

/// The negative control: what is the same in every thread, but not seen to be.
fn a_private_condition_is_refused(browser: &Path) {
    let kernel = || Kernel::new(Variant::of(Solver::Direct), 100);
    let kernels = [
        kernel().with("= all_parameters[all_due[index]].redistribution", "= all_parameters[member].redistribution"),
        kernel().with("while (next.found & IS_DUE) != 0u &&", "while tau > 0.0 &&"),
        kernel().with("fn take_member(index: u32) {", "fn take_member(index: u32) { nonsense();"),
    ];
    let verdicts = verdicts(browser, &kernels);
    for (verdict, words) in verdicts.iter().zip(["uniform control flow", "uniform control flow", "nonsense"]) {
        assert!(verdict.as_ref().is_some_and(|error| error.contains(words)), "{verdicts:?}");
    }
}
