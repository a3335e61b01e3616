//! `curvelax check`: does the GPU compute what the CPU computes, on this machine?

use serde::Serialize;

use super::{flags, note, print, print_json};
use crate::{
    backend::gpu::{Gpu, kernel::Budget},
    conformance::{ConformanceRow, Driven, compare::MEMBERS, events, runs, stages},
    error::{Error, Result},
    placement::no_adapter,
    report::progress::Progress,
    solver::Solver,
};
use curvelax_flow::scheme::evolve::Evolves;

const EXAMPLES: &str = "\
Examples:
  curvelax check
  curvelax check --adapter llvmpipe --json > check.json

An error is the largest difference between GPU and CPU over all members and nodes. A bound is a small multiple of the rounding
error of the quantity's natural scale. The exit code is 1 if an error exceeds its bound. Most of the time is spent compiling
kernels, unless the driver has them in its cache: minutes the first time, seconds afterwards.";

/// Numbers of nodes to compare: odd, a power of two, the default, a prime.
const SIZES: [usize; 4] = [7, 64, 100, 101];
/// Number of nodes for events.
const EVENTS_SIZE: usize = 64;
/// Steps after which whole runs are compared.
const STEPS: [u32; 2] = [1, 100];
/// The work of a kernel per dispatch.
const BUDGET: Budget = Budget { steps: 16, sweeps: u32::MAX };

/// A comparison with a separate kernel: its name, and the rows for a solver and a number of nodes.
type Compared = (&'static str, fn(&Gpu, Solver, usize) -> Result<Vec<ConformanceRow>>);

/// Comparisons for every number of nodes, and for one.
const SIZED: usize = 3;
const ONCE: usize = 2;
/// Kernels that are compiled and compared for each adapter and precision.
const KERNELS: usize = Solver::ALL.len() * (SIZES.len() * SIZED + ONCE);

/// The stages of a step, for solvers after the first without those before a solve; and whole runs.
fn sized<T: Evolves>() -> [Compared; SIZED] {
    [
        ("stages of a step", |gpu, solver, n| {
            let mut rows = stages::<T>(Driven::Paper, gpu, solver, n, |_| ())?;
            rows.retain(|row| solver == Solver::ALL[0] || row.quantity.starts_with('δ'));
            Ok(rows)
        }),
        ("fixed steps", |gpu, solver, n| {
            let mut rows = Vec::new();
            for steps in STEPS {
                rows.extend(runs::<T>(Driven::Paper, gpu, solver, n, Some(steps), BUDGET, |_| ())?);
            }
            Ok(rows)
        }),
        ("adaptive steps", |gpu, solver, n| runs::<T>(Driven::Paper, gpu, solver, n, None, BUDGET, |_| ())),
    ]
}

fn once<T: Evolves>() -> [Compared; ONCE] {
    [
        ("events", |gpu, solver, n| Ok(vec![events::<T>(gpu, solver, n, false, BUDGET, |_| ())?])),
        ("events, adaptive steps", |gpu, solver, n| Ok(vec![events::<T>(gpu, solver, n, true, BUDGET, |_| ())?])),
    ]
}

/// Compare the GPU with the CPU on this machine's adapters, as a table; exit code 1 on failure.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct CheckArgs {
    /// Adapter to check: part of its name, or its number in `curvelax adapters` [default: all]
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Print no notes on stderr
    #[arg(long)]
    quiet: bool,
    /// Print the rows as JSON instead of the table
    #[arg(long, help_heading = flags::OUTPUT)]
    json: bool,
}

/// All rows of an adapter.
#[derive(Serialize)]
struct Comparison {
    adapter: String,
    driver: String,
    members: usize,
    rows: Vec<Verdict>,
}

/// A row, and whether it passed.
#[derive(Serialize)]
struct Verdict {
    #[serde(flatten)]
    row: ConformanceRow,
    passes: bool,
}

/// The output for programs.
#[derive(Serialize)]
struct Checks {
    curvelax: &'static str,
    failed: usize,
    adapters: Vec<Comparison>,
}

/// Runs the comparisons and prints their table.
pub fn check(args: CheckArgs) -> Result<()> {
    let found = Gpu::list();
    let names: Vec<String> = found.iter().map(|gpu| gpu.name().to_string()).collect();
    let (chosen, _) = Gpu::select(found, args.adapter.as_deref());
    if chosen.is_empty() {
        return Err(match args.adapter {
            Some(name) => no_adapter(Some(&name), &names),
            None => Error::Failed("no GPU adapter to check; `--backend cpu` needs none".into()),
        });
    }
    let (mut failed, mut adapters) = (0, Vec::new());
    for gpu in &chosen {
        if !args.quiet {
            note(&format!("comparing {} with the CPU", gpu.name()));
        }
        let rows = compare(gpu, Progress::new(args.quiet))?;
        failed += rows.iter().filter(|row| !row.passes()).count();
        match args.json {
            false => print(&table(gpu, &rows))?,
            true => adapters.push(Comparison {
                adapter: gpu.name().into(),
                driver: gpu.driver(),
                members: MEMBERS,
                rows: rows.into_iter().map(|row| Verdict { passes: row.passes(), row }).collect(),
            }),
        }
    }
    if args.json {
        print_json(&Checks { curvelax: curvelax_base::VERSION, failed, adapters })?;
    }
    match failed {
        0 => Ok(()),
        _ => Err(Error::Failed(format!("{failed} quantities differ by more than their bound; use --backend cpu"))),
    }
}

/// All rows of an adapter.
fn compare(gpu: &Gpu, mut progress: Progress) -> Result<Vec<ConformanceRow>> {
    let total = if gpu.has_f64() { 2 * KERNELS } else { KERNELS };
    let mut done = 0;
    let mut tell = |precision: &str, solver: Solver, n: usize, kind: &str| {
        progress.step(done, total, &format!("{precision}, {}, n = {n}, {kind}", solver.name()));
        done += 1;
    };
    let mut rows = compare_in::<f32>(gpu, &mut tell)?;
    if gpu.has_f64() {
        rows.extend(compare_in::<f64>(gpu, &mut tell)?);
    }
    progress.finish();
    Ok(rows)
}

/// The worst row of every quantity over all sizes. Every kernel is announced before it is compiled.
fn compare_in<T: Evolves>(gpu: &Gpu, tell: &mut impl FnMut(&str, Solver, usize, &str)) -> Result<Vec<ConformanceRow>> {
    let mut all = Vec::new();
    for solver in Solver::ALL {
        let mut worst: Vec<ConformanceRow> = Vec::new();
        for n in SIZES {
            let mut rows = Vec::new();
            for (kind, compared) in sized::<T>() {
                tell(T::NAME, solver, n, kind);
                rows.extend(compared(gpu, solver, n)?);
            }
            match worst.is_empty() {
                true => worst = rows,
                false => worst.iter_mut().zip(rows).for_each(|(worst, row)| {
                    if row.share() > worst.share() || row.error.is_nan() {
                        *worst = row;
                    }
                }),
            }
        }
        all.extend(worst);
        for (kind, compared) in once::<T>() {
            tell(T::NAME, solver, EVENTS_SIZE, kind);
            all.extend(compared(gpu, solver, EVENTS_SIZE)?);
        }
    }
    Ok(all)
}

fn table(gpu: &Gpu, rows: &[ConformanceRow]) -> String {
    let sizes = SIZES.map(|n| n.to_string()).join(", ");
    let mut text = format!(
        "{} ({}): {MEMBERS} members, n = {sizes}\n\n{:<5}{:<13}{:>5}  {:<24}{:>10}{:>13}{:>10}  {:<8}at\n",
        gpu.name(),
        gpu.driver(),
        "",
        "solver",
        "steps",
        "quantity",
        "scale",
        "worst error",
        "bound",
        "verdict",
    );
    for row in rows {
        let ConformanceRow { quantity, solver, precision, n, steps, adaptive, scale, error, bound, at: (member, node) } =
            row;
        let steps = format!("{}{steps}", if *adaptive { "~" } else { "" });
        let solver = solver.name();
        let verdict = if row.passes() { "ok" } else { "FAILED" };
        let place = if *error == 0.0 { "bit for bit".into() } else { format!("n {n}, member {member}, node {node}") };
        text += &format!(
            "{precision:<5}{solver:<13}{steps:>5}  {quantity:<24}{scale:>10.2e}{error:>13.2e}{bound:>10.2e}  {verdict:<8}{place}\n"
        );
    }
    text + "~ adaptive steps\n"
}
