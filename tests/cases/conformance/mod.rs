//! The kernel against its CPU twin on every adapter of this machine: each case is a value, each comparison has a
//! negative control.
//!
//! Having no adapter is a failure, unless `ALLOW_NO_GPU=1`: then every case is reported as ignored.

mod forces;
mod hardware;
mod programs;
mod shared;

use std::{
    io::Write,
    sync::atomic::{AtomicU64, Ordering},
};

use crate::{everything, may_lack_gpu};
use curvelax::scheme::evolve::Evolves;
use curvelax::{
    backend::gpu::{Gpu, Kernel, Variant, kernel::Budget},
    conformance::{
        ConformanceRow, Driven, Tamper, adaptive_members,
        compare::{Left, events, on_gpu, on_gpu_by, runs, stages},
        members,
    },
    ensemble::{Cell, Ended, Family, Sink, Spec, Status, request::spec::Precision},
    scheme::{
        State,
        evolve::Team,
        member::{Counters, NEVER},
        run::Run,
        step::Method,
    },
    simulate::simulate,
    solver::{Blocks, Solver},
};
use forces::{
    another_crystal_fails, another_force_fails, crystals_agree, forced_agree, forced_bits, forced_crystals_agree,
    geometric_agrees,
};
use glam::DVec2;
use libtest_mimic::{Failed, Trial};
use programs::{
    adaptive_programs_agree, check_tells, f32_is_that_of_the_cpu_in_f64, program_refuses, programs_agree, sizes_agree,
};
use shared::adapter;

/// The sizes: the two smallest, a power of two, divisible by 3, by 4, a prime, every remainder modulo 4 (the number of
/// blocks of three), and one beyond 64 threads. `tests/run` has two of them, `tests/run --all` has all. The compiler
/// takes most of the time; a kernel serves all rings of as many threads.
const SIZES: [usize; 6] = [6, 7, 64, 99, 101, 257];
const FEW_SIZES: [usize; 2] = [7, 101];

/// Sizes of the adaptive comparison, whose kernels take the longest to compile. Those of other forms and forces, and of
/// events, are compared at one, with `tests/run --all` in f32 at few of them: what differs with the size is in the
/// kernels of the paper's form, too. `tests/run` has other forms and forces by [two of the four kinds](has_forms).
const ADAPTIVE_SIZES: [usize; 3] = [7, 64, 101];
const FEW_ADAPTIVE_SIZES: [usize; 2] = [7, 101];
const ONE_ADAPTIVE_SIZE: [usize; 1] = [101];

/// Sizes at which the exchange by shuffles is compared with that by barriers: every number of blocks of three, and the
/// largest ring for eight threads; of adaptive steps at few of them.
const ONE_SUBGROUP: [usize; 4] = [6, 7, 29, 32];
const FEW_ONE_SUBGROUP: [usize; 2] = [7, 32];

/// Whether other forms and forces are compared in a precision by a solver: in `tests/run`, each precision and each
/// solver once. Sweeps in f32 are the kind that differs most from the others, since they refine what they solve. A
/// second driver has all kinds at few sizes.
fn has_forms<T: Evolves>(solver: Solver) -> bool {
    let all_forms = std::env::var("CURVELAX_TESTS").is_ok_and(|value| value == "forms");
    everything() || all_forms || solver.sweeps() == (T::PRECISION == Precision::F32)
}

/// All of them, or those of a test that is to be quick.
fn sizes(all: &'static [usize], few: &'static [usize]) -> impl Iterator<Item = usize> {
    if everything() { all } else { few }.iter().copied()
}

type Outcome = Result<(), Failed>;

/// Cases that have passed.
static PASSED: AtomicU64 = AtomicU64::new(0);

/// The cases of all adapters.
pub fn trials() -> Vec<Trial> {
    let found = Gpu::list();
    let mut trials = Vec::new();
    if found.is_empty() {
        let missing = || -> Outcome {
            Err("no GPU adapter: install one (Debian: mesa-vulkan-drivers), or set ALLOW_NO_GPU=1".into())
        };
        trials.push(Trial::test("an adapter is there", missing).with_ignored_flag(may_lack_gpu()));
    }
    for (index, gpu) in found.iter().enumerate() {
        println!("adapter {index}: {} ({}, {})", gpu.name(), gpu.device_type(), gpu.driver());
        let mut kinds: Vec<Vec<Trial>> = Solver::ALL.map(|solver| cases::<f32>(index, gpu, solver)).into();
        if gpu.capacity().best_precision() == Precision::F64 {
            kinds.extend(Solver::ALL.map(|solver| cases::<f64>(index, gpu, solver)));
        }
        // One of each kind in turn, since each kind has an adapter of its own.
        let mut kinds: Vec<_> = kinds.into_iter().map(Vec::into_iter).collect();
        for _ in 0..kinds.iter().map(ExactSizeIterator::len).max().unwrap_or(0) {
            trials.extend(kinds.iter_mut().filter_map(Iterator::next));
        }
    }
    if !found.is_empty() {
        trials.push(Trial::test("the program says which kernel it compares before it compiles it", check_tells));
    }
    trials
}

/// Counts a case if it has passed.
fn passed(outcome: Outcome) -> Outcome {
    if outcome.is_ok() {
        PASSED.fetch_add(1, Ordering::Relaxed);
    }
    outcome
}

/// Appends to the file that CURVELAX_CASES names how many cases have passed, and where they ran, for scripts.
pub fn record() {
    let Some(path) = std::env::var_os("CURVELAX_CASES") else { return };
    let (cases, gpus) = (PASSED.load(Ordering::Relaxed), Gpu::list());
    let names: Vec<&str> = gpus.iter().map(Gpu::name).collect();
    let file = std::fs::OpenOptions::new().create(true).append(true).open(&path);
    let written = file.and_then(|mut file| writeln!(file, "{cases} conformance on {}", names.join(", ")));
    if let Err(error) = written {
        println!("cannot write {}: {error}", path.display());
    }
}

/// Those of a precision and a solver. Few sizes are used, so that they share kernels.
fn cases<T: Evolves>(index: usize, gpu: &Gpu, solver: Solver) -> Vec<Trial> {
    let mut trials = Vec::new();
    let others: &'static [usize] = if T::NAME == "f32" { &FEW_ADAPTIVE_SIZES } else { &ONE_ADAPTIVE_SIZE };
    let word = solver.name();
    let mut add = |name: String, case: fn(&Gpu, Solver, usize) -> Outcome, n: usize| {
        let name = format!("{} {word} adapter {index}: {name}", T::NAME);
        trials.push(Trial::test(name, move || passed(case(&adapter::<T>(index, solver), solver, n))));
    };
    for n in sizes(&SIZES, &FEW_SIZES) {
        add(format!("every stage of a step agrees, n = {n}"), stages_agree::<T>, n);
        add(format!("the curve agrees after 1 and 100 steps, n = {n}"), runs_agree::<T>, n);
    }
    for n in sizes(&ADAPTIVE_SIZES, &FEW_ADAPTIVE_SIZES) {
        add(format!("the curve agrees after adaptive steps, n = {n}"), adaptive_agree::<T>, n);
    }
    for n in sizes(others, &ONE_ADAPTIVE_SIZE).filter(|_| has_forms::<T>(solver)) {
        add(format!("the curve agrees in the geometric form, n = {n}"), geometric_agrees::<T>, n);
        add(format!("crystals agree, n = {n}"), crystals_agree::<T>, n);
        add(format!("driven and constrained curves agree, n = {n}"), forced_agree::<T>, n);
    }
    if everything() {
        add("driven crystals agree, n = 101".into(), forced_crystals_agree::<T>, 101);
    }
    if has_forms::<T>(solver) {
        add("another force or conserved quantity fails the comparison".into(), another_force_fails::<T>, 101);
        add("another energy or mobility fails the comparison".into(), another_crystal_fails::<T>, 101);
        add(
            "adaptive: where a dispatch ends changes no bit of driven and constrained curves".into(),
            forced_bits::<T>,
            31,
        );
    }
    for n in sizes(others, &ONE_ADAPTIVE_SIZE) {
        add(format!("events are at the same times, n = {n}"), events_agree::<T>, n);
    }
    add("a moved node fails the comparison after adaptive steps".into(), a_moved_node_fails_adaptive::<T>, 101);
    add("adaptive: where a dispatch ends or pauses, or a member lies, changes no bit".into(), adaptive_bits::<T>, 31);
    if everything() {
        add("adaptive: a dispatch may do as much as it is allowed to".into(), adaptive_largest::<T>, 0);
        add("the largest n that fits the adapter runs".into(), largest::<T>, 0);
    }
    if T::NAME == "f32" && !solver.sweeps() {
        add("adaptive: f32 is that of the CPU in f64".into(), f32_is_that_of_the_cpu_in_f64, 100);
    }
    add("adaptive: members that end badly leave the others untouched".into(), adaptive_bad_members::<T>, 101);
    add("adaptive: the program writes the same tables on both back ends".into(), adaptive_programs_agree::<T>, 101);
    add("a moved node fails the comparison of events".into(), a_moved_node_fails_events::<T>, 101);
    for n in [7, 101] {
        add(format!("a moved node fails both comparisons by name, n = {n}"), a_moved_node_fails::<T>, n);
    }
    add("how many slots there are, in how many batches, changes no bit".into(), slots::<T>, 7);
    add("permuted members give permuted results, bit for bit".into(), permutation::<T>, 101);
    add("where a dispatch ends or pauses changes no bit".into(), dispatches::<T>, 101);
    for n in sizes(&ONE_SUBGROUP, &FEW_ONE_SUBGROUP).filter(|_| solver.facts().shuffles) {
        add(format!("shuffles and barriers give the same bits, n = {n}"), exchanges::<T>, n);
    }
    add("members that end badly leave the others untouched".into(), bad_members::<T>, 101);
    add("relaxed members stop, at the step and in the place the CPU finds".into(), relaxation::<T>, 101);
    add("the program writes the same tables on both back ends".into(), programs_agree::<T>, 101);
    add("a curve of any size relaxes at the same time on both back ends".into(), sizes_agree::<T>, 101);
    add("the program refuses a ring that the adapter cannot hold".into(), program_refuses::<T>, 0);
    add("the paper's ellipse at t = 2 is that of the CPU in f64".into(), paper::<T>, 100);
    if !gpu.is_hardware() {
        trials.extend(hardware::cases::<T>(index, solver));
    }
    trials
}

/// At most `steps` steps in a dispatch.
fn dispatches_of(steps: u32) -> Budget {
    Budget { steps, sweeps: u32::MAX }
}

fn check(rows: &[ConformanceRow]) -> Outcome {
    for row in rows {
        println!("{}", line(row));
    }
    match rows.iter().find(|row| !row.passes()) {
        None => Ok(()),
        Some(row) => Err(line(row).into()),
    }
}

fn line(row: &ConformanceRow) -> String {
    let ConformanceRow { quantity, solver, precision, n, steps, scale, error, bound, at, .. } = row;
    let (member, node) = at;
    let share = row.share();
    format!(
        "{precision} {solver:?} n={n} steps={steps} {quantity}: error {error:.2e}, bound {bound:.2e} ({share:.3}), scale \
         {scale:.2e}, member {member}, node {node}"
    )
}

fn stages_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    check(&stages::<T>(Driven::Paper, gpu, solver, n, |_| ())?)
}

fn runs_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    check(&runs::<T>(Driven::Paper, gpu, solver, n, Some(1), dispatches_of(1), |_| ())?)?;
    check(&runs::<T>(Driven::Paper, gpu, solver, n, Some(100), dispatches_of(7), |_| ())?)
}

fn adaptive_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let rows = runs::<T>(Driven::Paper, gpu, solver, n, None, dispatches_of(7), |_| ())?;
    if rows.iter().any(|row| row.steps < 5) {
        return Err("too few steps to compare".into());
    }
    check(&rows)
}

fn events_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    for adaptive in [false, true] {
        check(&[events::<T>(gpu, solver, n, adaptive, dispatches_of(7), |_| ())?])?;
    }
    Ok(())
}

fn a_moved_node_fails_events<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    // In f32 the bound of adaptive steps is as long as a step.
    let paces = if T::PRECISION == Precision::F32 { &[false][..] } else { &[false, true] };
    for adaptive in paces {
        // This one watches its length, which moves with a node.
        let tamper = Tamper { member: 8, node: n / 2, by: 1e9 * T::EPSILON.min(1e-10) };
        let row = events::<T>(gpu, solver, n, *adaptive, dispatches_of(7), |runs| tamper.apply(runs))?;
        if row.passes() || row.at.0 != tamper.member {
            return Err(format!("a moved node was not noticed: {}", line(&row)).into());
        }
    }
    Ok(())
}

fn a_moved_node_fails_adaptive<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    // As many times more as the bounds allow.
    let by = if gpu.is_hardware() { 4.0 } else { 1.0 } * 65536.0 * T::EPSILON;
    let tamper = Tamper { member: 4, node: n / 2, by };
    // Either a row fails, or the member makes other steps.
    match runs::<T>(Driven::Paper, gpu, solver, n, None, dispatches_of(7), |runs| tamper.apply(runs)) {
        Ok(rows) if rows.iter().all(ConformanceRow::passes) => Err("a moved node was not noticed".into()),
        Ok(rows) => match rows.iter().find(|row| !row.passes() && row.at.0 != tamper.member) {
            Some(row) => Err(format!("the wrong member was named: {}", line(row)).into()),
            None => Ok(()),
        },
        Err(error) if error.to_string().contains("member 4") => Ok(()),
        Err(error) => Err(error.into()),
    }
}

fn adaptive_bits<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let mut launches = adaptive_members(n, 5, 20, 1e-3, T::PRECISION)?;
    // Two members end when they are relaxed; all relax during the run.
    for launch in &mut launches[1..3] {
        launch.counters.stop_when_relaxed = 1;
    }
    let at_once = on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(1000))?;
    let budgets = [dispatches_of(1), dispatches_of(3), Budget { steps: 1000, sweeps: 24 }];
    for budget in budgets {
        let in_parts = on_gpu::<T>(gpu, solver, n, &launches, budget)?;
        for j in 0..launches.len() {
            same(&in_parts[j], &at_once[j], &format!("member {j} with {budget:?}"))?;
        }
    }
    let reversed: Vec<Run<f64>> = launches.iter().rev().cloned().collect();
    let reversed = on_gpu::<T>(gpu, solver, n, &reversed, dispatches_of(5))?;
    for (j, left) in reversed.iter().rev().enumerate() {
        same(left, &at_once[j], &format!("member {j} in reversed order"))?;
    }
    for (j, left) in at_once.iter().enumerate() {
        let Counters { status, relax_step, .. } = left.counters;
        let expected = if (1..3).contains(&j) { Status::Relaxed as u32 } else { 0 };
        if status != expected || relax_step == NEVER || (j == 2 && left.counters.rejected == 0) {
            return Err(format!("member {j}: {:?}", left.counters).into());
        }
    }
    // The negative control: another tolerance leads to other steps.
    let other = on_gpu::<T>(gpu, solver, n, &adaptive_members(n, 5, 20, 2e-3, T::PRECISION)?, dispatches_of(1000))?;
    if same(&other[0], &at_once[0], "").is_ok() {
        return Err("another tolerance changed nothing".into());
    }
    Ok(())
}

fn adaptive_bad_members<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let good = adaptive_members(n, 5, 20, 1e-3, T::PRECISION)?;
    let alone = on_gpu::<T>(gpu, solver, n, &good, dispatches_of(5))?;
    let mut mixed = good.clone();
    replace_nodes(&mut mixed[1], |nodes| nodes[n / 3] = DVec2::new(f64::NAN, 0.0));
    mixed[3].report.progress.turning = 2.0;
    let together = on_gpu::<T>(gpu, solver, n, &mixed, dispatches_of(5))?;
    for (j, status) in [(1, Status::Nonfinite), (3, Status::Singular)] {
        let Counters { status: ended, steps, rejected, .. } = together[j].counters;
        if (ended, steps) != (status as u32, 0) || rejected == 0 {
            return Err(format!("member {j}: status {ended} after {steps} steps and {rejected} refused").into());
        }
    }
    for j in [0, 2, 4] {
        same(&together[j], &alone[j], &format!("good member {j}"))?;
    }
    Ok(())
}

/// The negative control: a displacement far below anything visible must fail, and the row must name the member.
fn a_moved_node_fails<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let tamper = Tamper { member: 4, node: n / 2, by: 4096.0 * T::EPSILON };
    let after_step = stages::<T>(Driven::Paper, gpu, solver, n, |runs| tamper.apply(runs))?;
    let after_run = runs::<T>(Driven::Paper, gpu, solver, n, Some(1), dispatches_of(1), |runs| tamper.apply(runs))?;
    for rows in [after_step, after_run] {
        let caught: Vec<&ConformanceRow> = rows.iter().filter(|row| !row.passes()).collect();
        if caught.is_empty() {
            return Err("a moved node was not noticed".into());
        }
        // In the first stages the trace is local: the row names the node too, or a neighbour.
        let local = |row: &&&ConformanceRow| ["β", "a", "𝓐"].contains(&row.quantity);
        let far = |row: &ConformanceRow| (row.at.1 + n - tamper.node + 3) % n > 6;
        if let Some(row) = caught.iter().filter(local).find(|row| far(row)) {
            return Err(format!("the wrong node was named: {}", line(row)).into());
        }
        if let Some(row) = caught.iter().find(|row| row.at.0 != tamper.member) {
            return Err(format!("the wrong member was named: {}", line(row)).into());
        }
    }
    Ok(())
}

fn permutation<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let launches = members(n, 7, 20)?;
    let order = [3, 0, 6, 2, 5, 1, 4];
    let permuted: Vec<Run<f64>> = order.iter().map(|j| launches[*j].clone()).collect();
    let plain = on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(6))?;
    let shuffled = on_gpu::<T>(gpu, solver, n, &permuted, dispatches_of(6))?;
    for (slot, j) in order.iter().enumerate() {
        same(&shuffled[slot], &plain[*j], &format!("member {j} in slot {slot}"))?;
    }
    if shuffled[0].state == plain[0].state {
        return Err("the members do not differ".into());
    }
    Ok(())
}

fn same(a: &Left, b: &Left, what: &str) -> Outcome {
    // Neither the goals, which a member sets when it pauses, nor the sweeps of the last dispatch.
    let counts = |c: Counters| (c.status, c.steps, c.rejected, c.refused, c.relax_step, c.half_step, c.phase);
    let bits = |left: &Left| {
        let numbers = [left.state.to_numbers(), left.report.to_numbers()].concat();
        numbers.into_iter().map(f64::to_bits).collect::<Vec<_>>()
    };
    if counts(a.counters) != counts(b.counters) || bits(a) != bits(b) {
        return Err(format!("{what} differs").into());
    }
    Ok(())
}

fn dispatches<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let launches = members(n, 5, 50)?;
    let at_once = on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(50))?;
    for per_dispatch in [1, 7] {
        let in_parts = on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(per_dispatch))?;
        for j in 0..launches.len() {
            same(&in_parts[j], &at_once[j], &format!("member {j} at {per_dispatch} steps per dispatch"))?;
        }
    }
    let paused = on_gpu::<T>(gpu, solver, n, &launches, Budget { steps: 50, sweeps: 24 })?;
    for j in 0..launches.len() {
        same(&paused[j], &at_once[j], &format!("member {j}, paused every 24 sweeps,"))?;
    }
    Ok(())
}

/// Outcomes of a run.
#[derive(Default)]
struct Outcomes(Vec<String>);

impl Sink for Outcomes {
    fn member(&mut self, Ended { outcome, rows, .. }: &Ended) -> curvelax::Result<()> {
        self.0.push(format!("{outcome:?} {rows:?}"));
        Ok(())
    }
}

/// Members that end at different times, observed during the run, refilled into slots of two batches.
fn slots<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let spec = Spec {
        curves: 13,
        points: n,
        t_end: Some(0.1.into()),
        tau: Some(1e-3.into()),
        relax_to: Some(0.5),
        stop_when_relaxed: Some(true),
        series: Some(0.03),
        snapshots: vec![0.0505],
        solver: solver.into(),
        precision: Some(T::PRECISION),
        ..Spec::default()
    };
    let blocks = Blocks::new(n).ok_or("n")?;
    let variant = gpu.capacity().variant(blocks, solver);
    let run = |batches: [usize; 2], spec: &Spec| -> Result<Vec<String>, Failed> {
        let mut kernel = Kernel::<T>::in_batches(gpu, blocks, batches, spec.max_sweeps, variant)?;
        let mut outcomes = Outcomes::default();
        let family = Family::new(spec)?;
        simulate(&[Cell::only(spec.clone(), family)], T::PRECISION, &mut kernel, 0, &mut outcomes)?;
        Ok(outcomes.0)
    };
    let whole = run([1, 13], &spec)?;
    for batches in [[1, 1], [1, 5], [2, 1], [2, 3], [2, 13], [3, 2]] {
        if run(batches, &spec)? != whole {
            return Err(format!("{batches:?} batches and slots give other results").into());
        }
    }
    // The negative control: a different step is detected.
    if whole.len() != 13 || run([1, 13], &Spec { tau: Some(1.1e-3.into()), ..spec.clone() })? == whole {
        return Err("another step changed nothing".into());
    }
    Ok(())
}

/// A kernel whose workgroup is one subgroup gives the same bits as one of any size, if the adapter's subgroups hold the
/// ring.
fn exchanges<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let by_shuffles = gpu.capacity().variant(Blocks::new(n).ok_or("n")?, solver);
    if by_shuffles.subgroup != (gpu.capacity().least_subgroup >= 8) {
        return Err(format!("{by_shuffles:?} on subgroups of {}", gpu.capacity().least_subgroup).into());
    }
    let launches = members(n, 5, 50)?;
    let mut paces = vec![(false, launches)];
    if FEW_ONE_SUBGROUP.contains(&n) {
        paces.push((true, adaptive_members(n, 5, 20, 1e-3, T::PRECISION)?));
    }
    for (adaptive, launches) in paces {
        let by_shuffles = Variant { adaptive, ..by_shuffles };
        let by_barriers = Variant { subgroup: false, ..by_shuffles };
        let [shuffled, waited] = [by_shuffles, by_barriers]
            .map(|variant| on_gpu_by::<T>(gpu, variant, n, &launches, Budget { steps: 50, sweeps: 1000 }));
        let (shuffled, waited) = (shuffled?, waited?);
        for j in 0..launches.len() {
            same(&shuffled[j], &waited[j], &format!("member {j}, adaptive: {adaptive},"))?;
        }
    }
    Ok(())
}

/// Starts `run` from other nodes.
fn replace_nodes(run: &mut Run<f64>, change: impl FnOnce(&mut Vec<DVec2>)) {
    let mut nodes: Vec<DVec2> = run.state.curve.positions().collect();
    change(&mut nodes);
    let counters = run.counters;
    *run = Run { counters, ..Run::new(State::with_offset(&nodes, run.parameters.r_offset), run.parameters) };
}

/// One member for each way to fail, at different places; the good ones must not be affected.
fn bad_members<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let good = members(n, 8, 20)?;
    let alone = on_gpu::<T>(gpu, solver, n, &good, dispatches_of(5))?;
    let mut mixed = good.clone();
    replace_nodes(&mut mixed[1], |nodes| nodes[n / 3] = DVec2::new(f64::NAN, 0.0));
    replace_nodes(&mut mixed[3], |nodes| nodes[5].x = 1e30);
    // Two neighbouring nodes in one place.
    replace_nodes(&mut mixed[4], |nodes| nodes[8] = nodes[7]);
    // A turning number that is not the curve's.
    mixed[6].report.progress.turning = 2.0;
    let together = on_gpu::<T>(gpu, solver, n, &mixed, dispatches_of(5))?;
    let expected = [
        (1, vec![Status::Nonfinite]),
        (3, vec![Status::Nonfinite, Status::Singular]),
        (4, vec![Status::Nonfinite, Status::Singular]),
        (6, vec![Status::Singular]),
    ];
    for (j, statuses) in expected {
        let ended = together[j].counters.status;
        if !statuses.iter().any(|status| *status as u32 == ended) {
            return Err(format!("member {j} ended with status {ended}, not one of {statuses:?}").into());
        }
    }
    for j in [0, 2, 5, 7] {
        same(&together[j], &alone[j], &format!("good member {j}"))?;
    }
    Ok(())
}

fn relaxation<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let mut launches = members(n, 5, 60)?;
    for launch in &mut launches {
        launch.counters.stop_when_relaxed = 1;
    }
    let ended = on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(7))?;
    let blocks = Blocks::new(n).ok_or("n")?;
    let method = Method::coloured(solver, 200_000);
    let mut relaxed = 0;
    for (j, launch) in launches.iter().enumerate() {
        let mut twin: Run<T> = launch.convert();
        Evolves::evolve(&mut twin, &method, &mut Team::new(blocks), 60);
        let (ours, theirs) = (ended[j].counters, twin.counters);
        let key = |c: Counters| (c.status, c.steps, c.relax_step, c.half_step);
        if key(ours) != key(theirs) {
            return Err(format!("member {j}: {:?} on the GPU, {:?} on the CPU", key(ours), key(theirs)).into());
        }
        // Position inside the step: the rounding of an excess, over its change in the step.
        let (a, b) = (ended[j].report.progress, twin.report.convert::<f64>().progress);
        for (a, b) in [(a.relax_fraction, b.relax_fraction), (a.half_fraction, b.half_fraction)] {
            let per_step = (launch.parameters.half_at - launch.parameters.relax_at) / f64::from(ours.steps);
            let bound = 64.0 * T::EPSILON / per_step;
            if !((0.0..=1.0).contains(&a) && (a - b).abs() <= bound) {
                return Err(format!("member {j}: fraction {a} on the GPU, {b} on the CPU, bound {bound:e}").into());
            }
        }
        relaxed += usize::from(ours.status == Status::Relaxed as u32 && ours.relax_step != NEVER);
    }
    if relaxed == 0 {
        return Err("no member relaxed, so nothing was compared".into());
    }
    Ok(())
}

fn largest<T: Evolves>(gpu: &Gpu, solver: Solver, _: usize) -> Outcome {
    let most = gpu.capacity().max_points::<T>(solver);
    let n = most.min(1024);
    if n < 512 {
        return Err(format!("only {n} points fit").into());
    }
    let launches = members(n, 2, 2)?;
    for (j, Left { state, counters, .. }) in
        on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(2))?.into_iter().enumerate()
    {
        if (counters.status, counters.steps) != (0, 2) || !state.curve.x.nodes().iter().all(|x| x.is_finite()) {
            return Err(format!("member {j} of {n} points: {counters:?}").into());
        }
    }
    let blocks = Blocks::new(most + 1).ok_or("n")?;
    if gpu.capacity().check_size::<T>(blocks, solver).is_ok()
        || Kernel::<T>::new(gpu, blocks, 1, 1, Variant::of(solver)).is_ok()
    {
        return Err("one point more was not refused".into());
    }
    Ok(())
}

/// A dispatch at its maximum work loses nothing: llvmpipe silently leaves all loops when they get too long.
fn adaptive_largest<T: Evolves>(gpu: &Gpu, solver: Solver, _: usize) -> Outcome {
    let n = gpu.capacity().max_points::<T>(solver).min(1024);
    let launches = adaptive_members(n, 2, 60, 1e-3, T::PRECISION)?;
    let little = on_gpu::<T>(gpu, solver, n, &launches, Budget { steps: 1, sweeps: 64 })?;
    let much = on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(u32::MAX))?;
    for j in 0..launches.len() {
        same(&much[j], &little[j], &format!("member {j} of {n} points"))?;
        if (much[j].counters.status, much[j].counters.steps < 4) != (0, false) {
            return Err(format!("member {j} of {n} points: {:?}", much[j].counters).into());
        }
    }
    Ok(())
}

/// Positions within 5·10⁻⁴ (f32) and 10⁻⁵ (f64) of the direct f64 solution on the CPU: the tolerances' errors.
fn paper<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let node = |i: usize| DVec2::from_angle(std::f64::consts::TAU * i as f64 / n as f64) * DVec2::new(2.0, 1.0);
    let mut launch = members(n, 1, 2000)?.remove(0);
    replace_nodes(&mut launch, |nodes| *nodes = (1..=n).map(node).collect());
    launch.parameters.tau = 1e-3;
    let mut exact = launch.clone();
    let method = Method::coloured(Solver::Direct, 1);
    Evolves::evolve(&mut exact, &method, &mut Team::new(Blocks::new(n).ok_or("n")?), 2000);
    let Left { state, counters, .. } = on_gpu::<T>(gpu, solver, n, &[launch], dispatches_of(50))?.remove(0);
    if (counters.steps, exact.counters.steps) != (2000, 2000) {
        return Err(format!("{counters:?} on the GPU, {:?} on the CPU", exact.counters).into());
    }
    let error =
        state.curve.positions().zip(exact.state.curve.positions()).map(|(a, b)| (a - b).length()).fold(0.0, f64::max);
    println!("{}: paper's ellipse at t = 2, positions off by {error:.2e}", T::NAME);
    let bound = if T::PRECISION == Precision::F32 { 5e-4 } else { 1e-5 };
    if error > bound { Err(format!("positions off by {error:e}").into()) } else { Ok(()) }
}
