//! `curvelax bench`: curve-steps per second of each back end, solver, precision and number of nodes.

use std::{collections::HashSet, time::Duration};

use serde::Serialize;

use super::{check_range, flags, note, parsers, print, print_json};
use crate::{
    backend::{DeviceKind, gpu::Gpu},
    bench::{self, Bench, BenchSample},
    ensemble::{
        Spec,
        request::spec::{Precision, Solver},
    },
    error::{Error, Result},
    placement::no_adapter,
};

const EXAMPLES: &str = "\
Examples:
  curvelax bench
  curvelax bench --backend cpu --solver direct --points 100,200,400
  curvelax bench --adapter llvmpipe --precision f32 --json > bench.json

A curve-step is one step of the paper's scheme for one curve. Members of the default ensemble (perturbed 2:1 ellipses, surface
diffusion, tau = 0.001) are advanced as in a run. The cases alternate, so that other load on the machine affects all of
them. Start-up is the time to open the back end and make the first step, in which kernels are compiled. The rates exclude
it and a warm-up. The default takes less than a minute.";

/// Members at once on hardware: enough to fill it.
const CURVES: u64 = 8192;
/// Members at once elsewhere: the CPU back end has fewer slots, and a software GPU as few cores.
const CURVES_IN_SOFTWARE: u64 = 32;
const MAX_SECONDS: f64 = 3600.0;
const MAX_REPEATS: usize = 1000;

/// Measure curve-steps per second on this machine, as a table.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct BenchArgs {
    /// Nodes per member, n; several values are measured in turn [default: 100]
    #[arg(long, value_name = "N1,N2,...", value_delimiter = ',', value_parser = parsers::whole::<usize>, allow_hyphen_values = true)]
    points: Vec<usize>,
    /// Members resident at once, limited by the slots of the back end [default: 8192 on hardware GPUs, 32 on software
    /// ones, all slots of the CPU]
    #[arg(long, value_name = "COUNT", value_parser = parsers::whole::<u64>, allow_hyphen_values = true)]
    curves: Option<u64>,
    /// Measuring time per case, in seconds [default: 2]
    #[arg(long, value_name = "SECONDS", value_parser = parsers::real, allow_hyphen_values = true)]
    seconds: Option<f64>,
    /// Windows into which this time is divided; the table shows their median, minimum and maximum [default: 5]
    #[arg(long, value_name = "COUNT", value_parser = parsers::whole::<usize>, allow_hyphen_values = true)]
    repeats: Option<usize>,
    /// Solvers of the pentadiagonal systems [default: all; direct with --adaptive]
    #[arg(long, value_name = "SOLVER,...", value_delimiter = ',', value_parser = parsers::name::<Solver>(&Solver::NAMES, &[crate::solver::MULTIGRID]), help_heading = flags::METHOD)]
    solver: Vec<Solver>,
    /// Adapt the steps to this local error; without TOL it is 0.001 [default: fixed steps]
    #[arg(
        long, value_name = "TOL", value_parser = parsers::real, allow_negative_numbers = true, num_args = 0..=1,
        default_missing_value = "0.001", help_heading = flags::METHOD
    )]
    adaptive: Option<f64>,
    /// Back ends [default: the CPU and every GPU adapter, software ones included]
    #[arg(long, value_name = "WHERE,...", value_delimiter = ',', value_parser = parsers::name::<DeviceKind>(&DeviceKind::NAMES, &[]), help_heading = flags::MACHINE)]
    backend: Vec<DeviceKind>,
    /// GPU adapters to measure: part of the name, or the number in `curvelax adapters`. The CPU is then measured only
    /// with --backend [default: all]
    #[arg(long, value_name = "NAME", help_heading = flags::MACHINE)]
    adapter: Option<String>,
    /// Number types [default: f64,f32]
    #[arg(long, value_name = "TYPE,...", value_delimiter = ',', value_parser = parsers::word::<Precision>(), help_heading = flags::MACHINE)]
    precision: Vec<Precision>,
    /// Threads of the CPU back end [default: all cores]
    #[arg(long, value_name = "COUNT", value_parser = parsers::whole::<usize>, allow_hyphen_values = true, help_heading = flags::MACHINE)]
    threads: Option<usize>,
    /// Print the rows as JSON, with every window, instead of the table
    #[arg(long, help_heading = flags::OUTPUT)]
    json: bool,
    /// Print no notes on stderr
    #[arg(long, help_heading = flags::OUTPUT)]
    quiet: bool,
}

/// A line of the table. Unknown values are none: a failed case has a reason instead of numbers.
#[derive(Serialize)]
struct BenchRow {
    backend: DeviceKind,
    adapter: Option<String>,
    driver: Option<String>,
    device_type: Option<String>,
    threads: Option<usize>,
    solver: Solver,
    precision: Precision,
    points: usize,
    adaptive: Option<f64>,
    curves: Option<usize>,
    start_up_seconds: Option<f64>,
    curve_steps: u64,
    sweeps_per_step: Option<f64>,
    steps_per_second: Option<StepRates>,
    nanoseconds_per_node: Option<f64>,
    failed: Option<String>,
}

/// Rates over the windows, in order.
#[derive(Serialize)]
struct StepRates {
    median: f64,
    min: f64,
    max: f64,
    windows: Vec<f64>,
}

/// All rows, with their common settings.
#[derive(Serialize)]
struct Benches<'a> {
    curvelax: &'static str,
    seconds: f64,
    repeats: usize,
    rows: &'a [BenchRow],
}

/// Runs the measurements and prints their table.
pub fn bench(args: BenchArgs) -> Result<()> {
    let (seconds, repeats) = (args.seconds.unwrap_or(2.0), args.repeats.unwrap_or(5));
    if !(seconds > 0.0 && seconds <= MAX_SECONDS) {
        return Err(Error::value("seconds", seconds, "out of range", &format!("use up to {MAX_SECONDS}")));
    }
    check_range("repeats", repeats, [1, MAX_REPEATS], "")?;
    let window = Duration::from_secs_f64(seconds / repeats as f64);
    let mut cases = cases(&args)?.into_iter().map(Case::new).collect::<Vec<_>>();
    for case in &mut cases {
        if !args.quiet {
            note(&format!("starting {}", case.name()));
        }
        case.bench = Bench::open(&case.spec, window);
    }
    if cases.iter().all(|case| case.bench.is_err())
        && let Some(Err(error)) = cases.pop().map(|case| case.bench)
    {
        return Err(error);
    }
    for repeat in 1..=repeats {
        if !args.quiet {
            note(&format!("measuring, {repeat} of {repeats}"));
        }
        cases.iter_mut().for_each(|case| case.measure(window));
    }
    let rows: Vec<BenchRow> = cases.iter().map(Case::row).collect();
    if args.json {
        let benches = Benches { curvelax: curvelax_base::VERSION, seconds, repeats, rows: &rows };
        print_json(&benches)?;
    } else {
        print(&table(&rows))?;
    }
    match rows.iter().all(|row| row.failed.is_some()) {
        false => Ok(()),
        true => Err(Error::Failed("nothing was measured: every case failed".into())),
    }
}

/// Where each case runs, and its spec, checked: a wrong key ends the command before anything starts.
fn cases(args: &BenchArgs) -> Result<Vec<(DeviceKind, Spec)>> {
    fn or<T: Copy>(given: &[T], all: &[T]) -> Vec<T> {
        if given.is_empty() { all.to_vec() } else { given.to_vec() }
    }
    let base = Spec { adaptive: args.adaptive, threads: args.threads, ..Spec::default() };
    // Fast ones first; with growing steps, without sweeps, which get more numerous.
    let suits = |solver: &Solver| args.adaptive.is_none() || !solver.sweeps();
    let solvers = or(&args.solver, &Solver::ALL.into_iter().rev().filter(suits).collect::<Vec<_>>());
    let mut cases = Vec::new();
    for (backend, place) in places(args, &base)? {
        for points in or(&args.points, &[base.points]) {
            for &solver in &solvers {
                for precision in or(&args.precision, &[Precision::F64, Precision::F32]) {
                    let spec = Spec { solver: solver.into(), precision: Some(precision), ..place.clone() };
                    cases.push((backend, bench::spec(points, spec)?));
                }
            }
        }
    }
    Ok(cases)
}

/// The requested back ends, each with what `base` is there: the adapter, and how many members. An adapter listed by
/// several interfaces is measured once, through the first.
fn places(args: &BenchArgs, base: &Spec) -> Result<Vec<(DeviceKind, Spec)>> {
    let place = |backend: DeviceKind, adapter: Option<String>, enough: u64| {
        let curves = args.curves.unwrap_or(enough);
        (backend, Spec { backend: backend.into(), adapter, curves, ..base.clone() })
    };
    let asked = |backend| args.backend.contains(&backend);
    let mut places = Vec::new();
    if asked(DeviceKind::Cpu) || (args.backend.is_empty() && args.adapter.is_none()) {
        places.push(place(DeviceKind::Cpu, None, CURVES));
    }
    if !args.backend.is_empty() && !asked(DeviceKind::Gpu) {
        return match &args.adapter {
            Some(name) => Err(Error::value("adapter", name, "the CPU has no adapters", "leave out --adapter")),
            None => Ok(places),
        };
    }
    let found = Gpu::list();
    let names: Vec<String> = found.iter().map(|gpu| gpu.name().to_string()).collect();
    let mut seen = HashSet::new();
    let (chosen, by_number) = Gpu::select(found, args.adapter.as_deref());
    for gpu in &chosen {
        if seen.insert(gpu.name()) {
            let enough = if gpu.is_hardware() { CURVES } else { CURVES_IN_SOFTWARE };
            // If two adapters share a name, the name would mean the first.
            let adapter = args.adapter.clone().filter(|_| by_number).or_else(|| Some(gpu.name().to_string()));
            places.push(place(DeviceKind::Gpu, adapter, enough));
        }
    }
    if seen.is_empty() && (args.adapter.is_some() || asked(DeviceKind::Gpu)) {
        return Err(no_adapter(args.adapter.as_deref(), &names));
    }
    Ok(places)
}

/// A case being measured.
struct Case {
    backend: DeviceKind,
    spec: Spec,
    bench: Result<Bench>,
    samples: Vec<BenchSample>,
}

impl Case {
    fn new((backend, spec): (DeviceKind, Spec)) -> Case {
        Case { backend, spec, bench: Err(Error::Failed("not started".into())), samples: Vec::new() }
    }

    /// Measures a window; a failed case stays failed.
    fn measure(&mut self, window: Duration) {
        if let Ok(bench) = &mut self.bench {
            match bench.sample(window) {
                Ok(sample) => self.samples.push(sample),
                Err(error) => self.bench = Err(error),
            }
        }
    }

    fn name(&self) -> String {
        let Spec { adapter, points, .. } = &self.spec;
        let place = adapter.clone().unwrap_or_else(|| self.backend.to_string());
        let (solver, precision) = (self.spec.solver().name(), self.precision().name());
        format!("{place}, {solver}, {precision}, n = {points}")
    }

    fn precision(&self) -> Precision {
        self.spec.precision.unwrap_or(Precision::F64)
    }

    fn row(&self) -> BenchRow {
        let bench = self.bench.as_ref().ok();
        let platform = bench.map(|bench| &bench.platform);
        let steps: u64 = self.samples.iter().map(|sample| sample.steps).sum();
        let sweeps: u64 = self.samples.iter().map(|sample| sample.sweeps).sum();
        let rates: Vec<f64> =
            self.samples.iter().map(|sample| sample.steps as f64 / sample.elapsed.as_secs_f64()).collect();
        let failed = match &self.bench {
            Err(error) => Some(error.to_string()),
            Ok(_) if steps == 0 => Some("no step was finished in this time; use more --seconds".into()),
            Ok(_) => None,
        };
        let rates = StepRates::of(rates).filter(|_| failed.is_none());
        BenchRow {
            backend: self.backend,
            adapter: self.spec.adapter.clone(),
            driver: platform.and_then(|platform| platform.driver.clone()),
            device_type: platform.and_then(|platform| platform.device_type.clone()),
            threads: platform.and_then(|platform| platform.threads),
            solver: self.spec.solver(),
            precision: self.precision(),
            points: self.spec.points,
            adaptive: self.spec.adaptive,
            curves: bench.map(Bench::curves),
            start_up_seconds: bench.map(|bench| bench.start_up.as_secs_f64()),
            curve_steps: steps,
            sweeps_per_step: (failed.is_none() && sweeps > 0).then(|| sweeps as f64 / steps as f64),
            nanoseconds_per_node: rates.as_ref().map(|rates| 1e9 / (rates.median * self.spec.points as f64)),
            steps_per_second: rates,
            failed,
        }
    }
}

impl StepRates {
    fn of(windows: Vec<f64>) -> Option<StepRates> {
        let mut sorted = windows.clone();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let median = 0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2]);
        Some(StepRates { median, min, max, windows })
    }
}

/// An aligned table; a failed case has its reason instead of numbers.
fn table(rows: &[BenchRow]) -> String {
    let place = |row: &BenchRow| match (&row.adapter, row.threads) {
        (Some(adapter), _) => adapter.clone(),
        (None, Some(1)) => "cpu, 1 thread".into(),
        (None, Some(threads)) => format!("cpu, {threads} threads"),
        (None, None) => "cpu".into(),
    };
    let width = rows.iter().map(|row| place(row).len()).max().unwrap_or(0).max("back end".len());
    let mut text = format!(
        "{:<width$}  {:<13}{:<5}{:>6}{:>8}{:>17}{:>22}{:>14}{:>13}{:>11}\n",
        "back end",
        "solver",
        "type",
        "n",
        "curves",
        "curve-steps/s",
        "min..max",
        "ns/step/node",
        "sweeps/step",
        "start-up"
    );
    for row in rows {
        let (solver, precision, n) = (row.solver.name(), row.precision.name(), row.points);
        text += &format!("{:<width$}  {solver:<13}{precision:<5}{n:>6}", place(row));
        text += &match (&row.failed, &row.steps_per_second) {
            (None, Some(StepRates { median, min, max, .. })) => {
                let curves = row.curves.map_or(String::new(), |curves| curves.to_string());
                let spread = format!("{min:.2e}..{max:.2e}");
                let node = row.nanoseconds_per_node.map_or(String::new(), |ns| format!("{ns:.2}"));
                let sweeps = row.sweeps_per_step.map_or("-".into(), |sweeps| format!("{sweeps:.0}"));
                let start_up = row.start_up_seconds.map_or(String::new(), |s| format!("{s:.3} s"));
                format!("{curves:>8}{median:>17.3e}{spread:>22}{node:>14}{sweeps:>13}{start_up:>11}\n")
            }
            (reason, _) => format!("  failed: {}\n", reason.as_deref().unwrap_or("nothing was measured")),
        };
    }
    text
}
