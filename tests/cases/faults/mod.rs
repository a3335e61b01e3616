//! Faults of devices and of members: an adapter that computes wrongly, a device that is lost, full or slow, a back end
//! that fails at any call, a member with poisoned numbers. Each ends in a specific error, or in the status of that
//! member alone.
//!
//! Without an adapter and with `ALLOW_NO_GPU=1`, cases that need one are reported as ignored.

mod failing;
mod liar;

use std::{
    process::Output,
    time::{Duration, Instant},
};

use curvelax::scheme::evolve::Evolves;
use curvelax::{
    Error,
    backend::{
        Backend, DeviceKind,
        cpu::{CpuBackend, Vectorised, Vectors},
        gpu::{Gpu, Kernel, Variant, kernel::Budget},
    },
    conformance::{Driven, adaptive_members, members, self_test},
    ensemble::{
        Cell, Ended, Family, Spec, Status,
        request::spec::{BackendChoice, Precision},
    },
    placement,
    scheme::{State, member::Counters, run::Run, step::Method},
    simulate::simulate,
    solver::{Blocks, Solver},
};
use failing::any_call_fails;
use glam::DVec2;
use liar::the_self_test_finds_a_liar;
use libtest_mimic::{Failed, Trial};

use crate::common::command;

type Outcome = Result<(), Failed>;

/// Nodes of the members, one of which is poisoned.
const POINTS: usize = 11;
/// Members of a cohort: every lane of the widest vectors is used twice, and not all vectors are full.
const COHORT: usize = 40;
/// A test that waits this long hangs.
const HANGS: Duration = Duration::from_secs(6 * 3600);
/// More advances than members of a few steps can need.
const MANY_ADVANCES: usize = 10_000;

/// The tests.
pub fn trials() -> Vec<Trial> {
    let mut trials = Vec::new();
    for solver in Solver::ALL {
        for adaptive in [false, true] {
            on_the_cpu::<f32>(solver, adaptive, &mut trials);
            on_the_cpu::<f64>(solver, adaptive, &mut trials);
        }
    }
    trials.push(Trial::test("a back end that fails at any call ends the run with its error", any_call_fails));
    #[cfg(target_os = "linux")]
    trials.push(Trial::test("without an adapter a GPU is refused by name, and auto runs on the CPU", no_adapter));
    let found = Gpu::list();
    for (index, gpu) in found.iter().enumerate() {
        for (solver, adaptive) in Solver::ALL.into_iter().flat_map(|solver| [(solver, false), (solver, true)]) {
            match gpu.capacity().best_precision() {
                Precision::F32 => on_the_gpu::<f32>(index, solver, adaptive, &mut trials),
                Precision::F64 => on_the_gpu::<f64>(index, solver, adaptive, &mut trials),
            }
        }
        let mut add = |name: &str, case: fn(&Gpu) -> Outcome| {
            trials.push(Trial::test(format!("adapter {index}: {name}"), move || case(&Gpu::list()[index])));
        };
        add("a device that is lost between dispatches is an error by name", lost_between_dispatches);
        add("a device that is lost during a dispatch is an error by name", lost_during_a_dispatch);
        add("on a lost device nothing is opened, and auto continues on the CPU", lost_before);
        add("a cap of one sweep fails members, not the self-test", a_cap_of_one_sweep);
        add("a device without room for the slots is an error with their bytes", no_room);
        add("a dispatch is given up at its limit, and waited for in slices", slow_dispatch);
    }
    trials
}

fn on_the_cpu<T: Vectorised>(solver: Solver, adaptive: bool, trials: &mut Vec<Trial>) {
    let pace = pace(adaptive);
    let mut add = |name: &str, case: fn(Solver, bool) -> Outcome| {
        let name = format!("{} {} {pace}: {name}", T::NAME, solver.name());
        trials.push(Trial::test(name, move || case(solver, adaptive)));
    };
    add("a poisoned member leaves all others untouched", poison_on_the_cpu::<T>);
    add("the self-test passes what computes rightly, and names what does not", the_self_test_finds_a_liar::<T>);
}

/// One kernel for both, since lavapipe needs a second or more to compile one.
fn on_the_gpu<T: Evolves>(index: usize, solver: Solver, adaptive: bool, trials: &mut Vec<Trial>) {
    let name = format!("{} {} {}, adapter {index}", T::NAME, solver.name(), pace(adaptive));
    let case = move || -> Outcome {
        let gpu = &Gpu::list()[index];
        let blocks = Blocks::new(POINTS).ok_or("n")?;
        let variant = Variant { adaptive, ..gpu.capacity().variant(blocks, solver) };
        let started = Instant::now();
        let mut kernel = Kernel::<T>::new(gpu, blocks, COHORT + 1, method(solver).max_sweeps, variant)?;
        the_self_test_passes(&mut kernel, gpu, solver, adaptive, started)?;
        poison_on_the_gpu(kernel, gpu, solver, adaptive)
    };
    let name = format!("{name}: the self-test passes, and a poisoned member leaves all others untouched");
    trials.push(Trial::test(name, case));
}

fn pace(adaptive: bool) -> &'static str {
    if adaptive { "adaptive" } else { "fixed" }
}

fn method(solver: Solver) -> Method {
    Method::coloured(solver, 2000)
}

fn require(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise().into()) }
}

// Poisoned members.

/// A fault of a member, and the function that causes it.
type Poison = (&'static str, fn(&mut Run<f64>));

const POISONS: [Poison; 9] = [
    ("a node is NaN", |run| renew(run, |nodes| nodes[3] = DVec2::new(f64::NAN, 0.0))),
    ("a node is infinite", |run| renew(run, |nodes| nodes[0].y = f64::NEG_INFINITY)),
    ("a node is at 1e30", |run| renew(run, |nodes| nodes[POINTS - 1].x = 1e30)),
    ("all nodes are beyond the roots of the largest number", |run| {
        renew(run, |nodes| nodes.iter_mut().for_each(|node| *node *= 1e200));
    }),
    ("two neighbours are in one place", |run| renew(run, |nodes| nodes[6] = nodes[5])),
    ("all nodes are in one place", |run| renew(run, |nodes| nodes.fill(DVec2::new(0.3, -0.2)))),
    ("a curvature is NaN", |run| {
        run.state.curve.k[4] = f64::NAN;
        run.state.curve.k.close();
    }),
    ("all lengths are 0", |run| {
        (0..POINTS).for_each(|i| run.state.curve.r[i] = -run.parameters.r_offset);
        run.state.curve.r.close();
    }),
    ("its ω is NaN", |run| run.parameters.omega = f64::NAN),
];

/// Starts `run` from other nodes.
fn renew(run: &mut Run<f64>, change: impl FnOnce(&mut [DVec2])) {
    let mut nodes: Vec<DVec2> = run.state.curve.positions().collect();
    change(&mut nodes);
    let (counters, next) = (run.counters, run.report.progress.next);
    *run = Run { counters, ..Run::new(State::with_offset(&nodes, run.parameters.r_offset), run.parameters) };
    run.report.progress.next = next;
}

/// Members that are all different; lanes require that either all or none are redistributed, and likewise pulled.
fn launches<T: Evolves>(count: usize, adaptive: bool) -> curvelax::Result<Vec<Run<f64>>> {
    let few = 13;
    let some = match adaptive {
        true => adaptive_members(POINTS, few, 40, 1e-3, T::PRECISION)?,
        false => members(POINTS, few, 4)?,
    };
    let member = |j: usize| {
        let mut run = some[j % few].clone();
        let factor = 1.0 - 0.01 * (j / few) as f64;
        run.parameters.tau *= factor;
        run.report.progress.next *= factor;
        (run.parameters.redistribution, run.parameters.pull) = (1.0, 50.0);
        run
    };
    Ok((0..count).map(member).collect())
}

/// The bits of a member's results, except the sweeps of the last dispatch.
type Bits = ([u32; 8], Vec<u64>);

/// Runs `launches` to their goals.
fn finished(backend: &mut dyn Backend, launches: &[Run<f64>]) -> Result<Vec<(Counters, Bits)>, Failed> {
    for (slot, launch) in launches.iter().enumerate() {
        backend.load(slot, launch)?;
    }
    let mut advances = 0;
    while (0..launches.len()).any(|slot| backend.counters(slot).is_running()) {
        backend.advance()?;
        advances += 1;
        require(advances < MANY_ADVANCES, || "a member hangs".into())?;
    }
    let slots: Vec<usize> = (0..launches.len()).collect();
    let states = backend.states(&slots)?;
    let left = |(slot, state): (usize, State<f64>)| {
        let c = backend.counters(slot);
        let counts = [c.status, c.steps, c.rejected, c.refused, c.relax_step, c.half_step, c.fit_points, c.noted];
        let numbers = [state.to_numbers(), backend.report(slot).to_numbers()].concat();
        (c, (counts, numbers.into_iter().map(f64::to_bits).collect()))
    };
    Ok(slots.into_iter().zip(states).map(left).collect())
}

/// Tries every poison for which `takes` holds, at every place among the others.
fn poison<T: Evolves>(
    backend: &mut dyn Backend,
    adaptive: bool,
    where_: &str,
    takes: impl Fn(usize, usize) -> bool,
) -> Outcome {
    let good = launches::<T>(COHORT, adaptive)?;
    let alone = finished(backend, &good)?;
    if let Some(j) = alone.iter().position(|(counters, _)| counters.status != 0 || counters.steps < 2) {
        return Err(format!("{where_}: good member {j}: {:?}", alone[j].0).into());
    }
    // The negative control: a member that is a few roundings off is detected.
    let mut other = good.clone();
    other[7].state.curve.k[3] *= 1.0 + 64.0 * T::EPSILON;
    other[7].state.curve.k.close();
    let differ = finished(backend, &other)?.iter().zip(&alone).map(|(a, b)| a.1 != b.1).collect::<Vec<_>>();
    require(differ.iter().filter(|differs| **differs).count() == 1 && differ[7], || format!("{where_}: {differ:?}"))?;
    let mut cases = 0;
    for place in 0..=COHORT {
        for (_, (what, poison)) in POISONS.iter().enumerate().filter(|(kind, _)| takes(place, *kind)) {
            let mut bad = good[place % COHORT].clone();
            poison(&mut bad);
            let mut mixed = good.clone();
            mixed.insert(place, bad);
            let mut together =
                finished(backend, &mixed).map_err(|e| format!("{what}: {}", e.message().unwrap_or("")))?;
            let (poisoned, _) = together.remove(place);
            let failed = [Status::Singular, Status::Nonfinite, Status::Stalled].map(|status| status as u32);
            let at = || format!("{where_}: {what}, place {place}");
            require(failed.contains(&poisoned.status), || format!("{}: it ends as {poisoned:?}", at()))?;
            if let Some(j) = (0..COHORT).find(|j| together[*j].1 != alone[*j].1) {
                return Err(format!("{}: member {j} ends as {:?} in place of {:?}", at(), together[j], alone[j]).into());
            }
            cases += 1;
        }
    }
    println!("{where_}: {cases} poisoned members");
    require(cases >= COHORT, || format!("{where_}: only {cases} cases"))
}

fn poison_on_the_cpu<T: Vectorised>(solver: Solver, adaptive: bool) -> Outcome {
    let blocks = Blocks::new(POINTS).ok_or("n")?;
    for vectors in Vectors::ALL.into_iter().filter(|vectors| vectors.are_available()) {
        let mut backend = CpuBackend::<T>::with_vectors(blocks, method(solver), 3, vectors)?;
        let where_ = format!("{} {} {} {vectors:?}", T::NAME, solver.name(), pace(adaptive));
        let widest = vectors == Vectors::widest();
        poison::<T>(&mut backend, adaptive, &where_, |place, kind| widest || place % POISONS.len() == kind)?;
    }
    Ok(())
}

fn poison_on_the_gpu<T: Evolves>(kernel: Kernel<T>, gpu: &Gpu, solver: Solver, adaptive: bool) -> Outcome {
    let mut kernel = kernel.with_budget(Budget { steps: 1 << 10, sweeps: 1 << 20 });
    let where_ = format!("{} {} {} {}", T::NAME, solver.name(), pace(adaptive), gpu.name());
    // The members of a dispatch share nothing but its end, so not every poison is tried at every place.
    poison::<T>(&mut kernel, adaptive, &where_, |place, kind| place % POISONS.len() == kind)
}

// The self-test.

fn the_self_test_passes<T: Evolves>(
    kernel: &mut Kernel<T>,
    gpu: &Gpu,
    solver: Solver,
    adaptive: bool,
    started: Instant,
) -> Outcome {
    let (hardware, method) = (gpu.is_hardware(), method(solver));
    let mut test = || self_test::<T>(kernel, gpu.name(), hardware, &method, POINTS, adaptive, Driven::Paper);
    test()?;
    let first = started.elapsed();
    test()?;
    let again = started.elapsed() - first;
    let name = solver.name();
    println!("{name} {}: opened and tested in {first:.1?}, tested again in {again:.1?}", pace(adaptive));
    require((0..kernel.slots()).all(|slot| kernel.counters(slot) == Counters::default()), || "a slot is taken".into())
}

// The device.

/// A kernel with `count` long-running members, in dispatches of `sweeps` if the adapter allows as many.
fn busy(gpu: &Gpu, count: usize, sweeps: u32) -> Result<Kernel<f32>, Failed> {
    let blocks = Blocks::new(64).ok_or("n")?;
    let variant = gpu.capacity().variant(blocks, Solver::GaussSeidel);
    let kernel = Kernel::<f32>::in_batches(gpu, blocks, [1, count], 1 << 30, variant)?;
    // Only the device decides how long a dispatch takes.
    let mut kernel = kernel.with_budget(Budget { steps: 1 << 20, sweeps }).with_limit(HANGS);
    for (slot, launch) in members(64, 3, 1 << 20)?.iter().cycle().take(kernel.slots()).enumerate() {
        kernel.load(slot, launch)?;
    }
    Ok(kernel)
}

/// The error must be about the device and name the adapter, `what` and a remedy, in one line.
fn named<R>(result: curvelax::Result<R>, gpu: &Gpu, what: &str) -> Outcome {
    let Err(error) = result else { return Err(format!("{what}: not noticed").into()) };
    let message = error.to_string();
    let parts = [&format!("GPU {}: ", gpu.name()), what, "--backend cpu"];
    let missing = parts.into_iter().find(|part| !message.contains(*part));
    let right = matches!(error, Error::Device(_)) && missing.is_none() && message.lines().count() == 1;
    require(right, || format!("{missing:?} is not in: {message} ({error:?})"))
}

fn lost_between_dispatches(gpu: &Gpu) -> Outcome {
    let mut kernel = busy(gpu, 3, 64)?;
    kernel.advance()?;
    gpu.lose();
    named(kernel.advance(), gpu, "the device was lost")?;
    // The same holds for all later requests.
    named(kernel.advance(), gpu, "the device was lost")?;
    named(kernel.load(1, &members(64, 1, 9)?[0]), gpu, "the device was lost")?;
    named(kernel.state(0), gpu, "the device was lost")?;
    named(busy(gpu, 3, 64).map_err(|e| Error::Device(e.message().unwrap_or("").into())), gpu, "the device was lost")
}

fn lost_during_a_dispatch(gpu: &Gpu) -> Outcome {
    let mut kernel = busy(gpu, 3, 1 << 14)?;
    kernel.start(0)?;
    gpu.lose();
    // Results under way may still arrive.
    let finished = kernel.finish(0);
    if finished.is_err() {
        named(finished, gpu, "the device was lost")?;
    }
    require(kernel.is_back(0, HANGS), || "a lost device is waited for".into())?;
    named(kernel.advance(), gpu, "the device was lost")
}

/// With the cap of the run, the self-test compared solves that had not converged, and rounding decided how its members
/// ended.
fn a_cap_of_one_sweep(gpu: &Gpu) -> Outcome {
    let spec = Spec {
        backend: BackendChoice::Gpu,
        adapter: Some(gpu.name().to_string()),
        curves: 3,
        points: 127,
        adaptive: Some(0.005),
        solver: Solver::GaussSeidel.into(),
        max_sweeps: 1,
        t_end: Some(1e-9.into()),
        ..Spec::default()
    };
    let spec = spec.validate()?;
    let choice = placement::choose(&spec)?;
    let (mut backend, _) = choice.open(&spec)?;
    // The run has the cap that it asked for.
    let mut all = Vec::new();
    let cell = Cell::only(spec.clone(), Family::new(&spec)?);
    simulate(&[cell], choice.precision, backend.as_mut(), 0, &mut all)?;
    require(all.len() == 3, || format!("{} members", all.len()))?;
    let sweeps = |ended: &Ended| ended.outcome.sweeps_k <= ended.outcome.solves;
    require(all.iter().all(sweeps), || format!("{:?}", all[0].outcome))
}

fn lost_before(gpu: &Gpu) -> Outcome {
    let adapter = Some(gpu.name().to_string());
    let spec = Spec { backend: BackendChoice::Gpu, adapter, curves: 3, t_end: Some(0.01.into()), ..Spec::default() }
        .validate()?;
    let choice = || -> Result<placement::ChosenBackend, Failed> {
        let choice = placement::choose(&spec)?;
        let gpu = choice.device.gpu().ok_or("no GPU")?;
        let blocks = Blocks::new(spec.points).ok_or("n")?;
        let _ = gpu.pipeline::<f64>(blocks, gpu.capacity().variant(blocks, spec.solver()))?;
        gpu.lose();
        Ok(choice)
    };
    named(choice()?.open(&spec), gpu, "the device was lost")?;
    let choice = placement::ChosenBackend { or_cpu: true, ..choice()? };
    let precision = choice.precision;
    let (mut backend, platform) = choice.open(&spec)?;
    let told = platform.reason.starts_with("the GPU failed: ") && platform.reason.contains("the device was lost");
    require(platform.backend == DeviceKind::Cpu && platform.adapter.is_none() && told, || format!("{platform:?}"))?;
    let mut settled = spec.clone();
    platform.settle_place(&mut settled);
    require((settled.backend, settled.adapter) == (BackendChoice::Cpu, None), || "the spec says another place".into())?;
    let mut all = Vec::new();
    let family = Family::new(&spec)?;
    simulate(&[Cell::only(spec.clone(), family)], precision, backend.as_mut(), 0, &mut all)?;
    require(all.len() == 3, || format!("{} members", all.len()))?;
    // A later part of the same study makes the same choice, and one of a study on a GPU stays there.
    let later = or_cpu(&spec)?.after(&platform);
    require(later.device.gpu().is_none(), || "a later part goes back to the GPU".into())?;
    let (_, there) = choice_like(&spec)?.open(&spec)?;
    require(there.backend == DeviceKind::Gpu, || format!("{there:?}"))?;
    let later = or_cpu(&spec)?.after(&there);
    let own = later.device.gpu().ok_or("no GPU")?;
    let blocks = Blocks::new(spec.points).ok_or("n")?;
    let _ = own.pipeline::<f64>(blocks, own.capacity().variant(blocks, spec.solver()))?;
    own.lose();
    named(later.open(&spec), gpu, "the device was lost")
}

fn or_cpu(spec: &Spec) -> curvelax::Result<placement::ChosenBackend> {
    Ok(placement::ChosenBackend { or_cpu: true, ..choice_like(spec)? })
}

fn choice_like(spec: &Spec) -> curvelax::Result<placement::ChosenBackend> {
    placement::choose(spec)
}

fn no_room(gpu: &Gpu) -> Outcome {
    let blocks = Blocks::new(100).ok_or("n")?;
    let variant = gpu.capacity().variant(blocks, Solver::Direct);
    let state = 18 * 100 * size_of::<f32>() as u64;
    let limits = gpu.limits();
    let slots = (limits.max_buffer_size.min(1 << 42) / state) as usize + 1;
    let opened = Kernel::<f32>::with_slots(gpu, blocks, [1, slots], 1, variant);
    named(opened.map(drop), gpu, &format!("no room for {slots} members of 100 points"))
}

/// Work of a dispatch: members, and sweeps of each if the adapter allows as many.
type Work = (usize, u32);

/// More of both; a device that does that in no time does nothing.
fn more((members, sweeps): Work) -> Result<Work, Failed> {
    require(members < 1 << 13 || sweeps < 1 << 24, || format!("a dispatch of {members} members ends at once"))?;
    Ok(((2 * members).min(1 << 13), (2 * sweeps).min(1 << 24)))
}

fn slow_dispatch(gpu: &Gpu) -> Outcome {
    let slice = Duration::from_millis(1);
    // So long that this thread observes it repeatedly, on any machine.
    let mut work = (96, 1 << 16);
    let whole = loop {
        let mut kernel = busy(gpu, work.0, work.1)?;
        kernel.start(0)?;
        let (started, mut slices) = (Instant::now(), 0);
        while !kernel.is_back(0, slice) {
            slices += 1;
        }
        let whole = started.elapsed();
        kernel.finish(0)?;
        println!("{work:?}: a dispatch of {whole:.1?}, waited for in {slices} slices of 1 ms");
        require(kernel.is_back(0, slice), || "no transfer is pending, and one is waited for".into())?;
        if slices >= 10 {
            break whole;
        }
        work = more(work)?;
    };
    // The same dispatch with less time than it needs; it may be faster this time.
    let mut limit = whole / 8;
    loop {
        let mut kernel = busy(gpu, work.0, work.1)?.with_limit(limit);
        kernel.start(0)?;
        require(kernel.is_back(0, HANGS), || "a dispatch beyond its limit is waited for".into())?;
        let spent = kernel.spent(0).ok_or("no dispatch")?;
        let finished = kernel.finish(0);
        if finished.is_err() {
            require(spent >= limit, || format!("given up after {spent:.1?} of {limit:.1?}"))?;
            return named(finished, gpu, "a dispatch did not end in ");
        }
        println!("a dispatch of {spent:.1?} is not given up with a limit of {limit:.1?}");
        limit /= 2;
        work = more(work)?;
    }
}

/// The program where the Vulkan loader finds no driver.
#[cfg(target_os = "linux")]
fn no_adapter() -> Outcome {
    let folder = tempfile::tempdir()?;
    let run = |arguments: &[&str]| -> Result<(Output, String), Failed> {
        let mut command = command::command(folder.path(), "run --curves 3 --t-end 0.01 --out out");
        for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            command.env(variable, "/nonexistent");
        }
        let output = command.env_remove("VK_ADD_DRIVER_FILES").args(arguments).output()?;
        let said = String::from_utf8(output.stderr.clone())?;
        Ok((output, said))
    };
    for arguments in [&["--backend", "gpu"][..], &["--adapter", "toaster"]] {
        let (output, said) = run(arguments)?;
        let named = said.starts_with("error: --") && said.contains("GPU driver") && said.contains("--backend cpu");
        require(output.status.code() == Some(2) && named && said.lines().count() == 1, || format!("{output:?}"))?;
        require(!folder.path().join("out").exists(), || "something was written".into())?;
    }
    let (output, said) = run(&["--backend", "auto"])?;
    require(output.status.success() && said.contains("back end: CPU, f64 (no hardware GPU found)"), || {
        format!("{output:?}")
    })?;
    let record = std::fs::read_to_string(folder.path().join("out/run.json"))?;
    require(record.contains("no hardware GPU found"), || record)
}
