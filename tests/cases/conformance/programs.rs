//! The program from outside, with a GPU and with the CPU.

use std::{
    io::{BufRead, BufReader},
    process::Stdio,
};

use curvelax::{
    backend::gpu::Gpu, ensemble::request::spec::Precision, placement::MAX_POINTS_F32, scheme::evolve::Evolves,
    solver::Solver,
};
use glam::DVec2;
use libtest_mimic::Failed;

use super::Outcome;
use crate::common::command;

/// Numbers of the tables that the program writes, with the statuses first.
fn tables<T: Evolves>(
    backend: &str,
    solver: Solver,
    n: usize,
    pace: &[&str],
) -> Result<(Vec<String>, Vec<f64>), Failed> {
    let folder = tempfile::tempdir()?;
    let solver = solver.name();
    let mut command = command::program(folder.path());
    let shape = folder.path().join("dumbbell.csv");
    std::fs::write(&shape, dumbbell())?;
    // A short last step, output times inside steps, and members that stop when they are relaxed.
    if !pace.contains(&"--t-end") {
        command.args(["run", "--curves", "7", "--t-end", "0.4", "--series", "0.07", "--snapshots", "0,0.1,0.2"]);
    }
    // The length of an adaptive step has the rounding of the error estimate, and in f32 an estimate may meet its
    // tolerance on one side only. The step in which a member relaxes then ends at another time: members continue to a
    // time that is the same for all.
    let adaptive = pace.iter().any(|flag| flag.starts_with("--adaptive"));
    let rounded = T::PRECISION == Precision::F32 && adaptive;
    command.args(pace).args(["--backend", backend, "--solver", solver]);
    if !adaptive {
        command.arg("--stop-when-relaxed");
    }
    command.args(["--event", "short = length <= 0.98 * start", "--event", "bent = k_max <= 0.8 * start"]);
    let output = command.args(["--precision", T::NAME, "--points", &n.to_string(), "--out", "out"]).output()?;
    if !output.status.success() {
        return Err(String::from_utf8(output.stderr)?.into());
    }
    let (mut words, mut numbers) = (Vec::new(), Vec::new());
    for name in ["summary.csv", "series.csv", "snapshots.csv", "events.csv"] {
        let mut reader = csv::Reader::from_path(folder.path().join("out").join(name))?;
        let header = reader.headers()?.clone();
        for record in reader.records() {
            for (column, field) in header.iter().zip(record?.iter()) {
                match field.parse() {
                    // Numbers of sweeps may differ where a residual is close to its bound.
                    Ok(_) if column.starts_with("sweeps") => {}
                    // So may numbers of steps, and in f32 a rate: it is fitted down to excesses that are rounded to
                    // percents, and compared with bounds for that elsewhere.
                    Ok(_) if rounded && ["steps", "rejected", "solves", "rate", "rate_r2"].contains(&column) => {}
                    Ok(number) => numbers.push(number),
                    Err(_) => words.push(format!("{name} {column} {field}")),
                }
            }
        }
    }
    Ok((words, numbers))
}

/// The program from outside: equal statuses, and numbers within the accuracy of the solves.
pub(super) fn programs_agree<T: Evolves>(_: &Gpu, solver: Solver, n: usize) -> Outcome {
    tables_agree::<T>(solver, n, &["--tau", "0.003", "--relax-to", "0.3"]).map(drop)
}

/// Times to relax of a tiny and a huge curve, with times and rates by their size.
pub(super) fn sizes_agree<T: Evolves>(_: &Gpu, solver: Solver, n: usize) -> Outcome {
    let bound = if T::PRECISION == Precision::F32 { 2e-3 } else { 1e-6 };
    let paces = [&["--tau", "auto"][..], &["--adaptive", "--pull", "auto"]];
    // Longer steps would need too many sweeps.
    for pace in &paces[..if solver.sweeps() { 1 } else { 2 }] {
        let [gpu, cpu] = ["gpu", "cpu"].map(|backend| times_of_sizes::<T>(backend, solver, n, pace));
        for (on_gpu, on_cpu) in gpu?.into_iter().zip(cpu?) {
            let (a, b): (f64, f64) = (on_gpu.parse()?, on_cpu.parse()?);
            let gap = (a / b - 1.0).abs();
            if gap.is_nan() || gap > bound {
                return Err(format!("{pace:?}: t_relax {a:e} on the GPU, {b:e} on the CPU").into());
            }
        }
    }
    Ok(())
}

/// t_relax of ellipses of three sizes, 40 orders of magnitude apart in time.
fn times_of_sizes<T: Evolves>(backend: &str, solver: Solver, n: usize, pace: &[&str]) -> Result<Vec<String>, Failed> {
    let folder = tempfile::tempdir()?;
    let mut command = command::program(folder.path());
    command.args(["run", "--curves", "2", "--sweep", "shape=ellipse:2e-6,1e-6;ellipse:2,1;ellipse:2e4,1e4"]);
    command.args(pace).args(["--t-end", "auto", "--relax-to", "0.3", "--backend", backend, "--solver", solver.name()]);
    let output = command.args(["--precision", T::NAME, "--points", &n.to_string(), "--out", "out"]).output()?;
    if !output.status.success() {
        return Err(String::from_utf8(output.stderr)?.into());
    }
    let mut reader = csv::Reader::from_path(folder.path().join("out/summary.csv"))?;
    let column = reader.headers()?.iter().position(|name| name == "t_relax").ok_or("no t_relax")?;
    let times: Vec<String> = reader.records().map(|row| Ok(row?[column].to_owned())).collect::<Result<_, Failed>>()?;
    if times.len() == 6 { Ok(times) } else { Err(format!("{times:?}").into()) }
}

/// Two unit discs joined by a thin bar, whose long sides eventually cross.
fn dumbbell() -> String {
    let bar = 0.1_f64;
    let end = std::f64::consts::PI - bar.asin();
    let arc = |j: i32| DVec2::new(6.0, 0.0) + DVec2::from_angle(end * f64::from(j - 100) / 100.0);
    let right: Vec<DVec2> = (0..=200).map(arc).collect();
    let nodes = right.iter().copied().chain(right.iter().map(|p| -*p));
    nodes.fold("x,y\n".to_string(), |text, p| text + &format!("{},{}\n", p.x, p.y))
}

/// Adaptive steps: output times and events inside them, refused ones, members that begin to cross themselves.
pub(super) fn adaptive_programs_agree<T: Evolves>(_: &Gpu, solver: Solver, n: usize) -> Outcome {
    tables_agree::<T>(solver, n, &["--adaptive", "--pull", "auto", "--relax-at", "0.05"])?;
    // Longer ones would need too many sweeps.
    if solver.sweeps() {
        return Ok(());
    }
    // An f32 member may make one step more on one side; the numbers then differ by the error allowed per step.
    let adaptive = if T::PRECISION == Precision::F32 { "--adaptive=2e-4" } else { "--adaptive" };
    tables_agree::<T>(solver, n, &[adaptive, "--pull", "auto", "--shape", "nonconvex", "--amplitude", "0.1"])?;
    let times = ["run", "--curves", "7", "--t-end", "3", "--series", "0.3", "--snapshots", "1,2"];
    let law = ["--adaptive", "--pull", "auto", "--amplitude", "0.02", "--shape", "file:dumbbell.csv"];
    let words = tables_agree::<T>(solver, 128, &[&times[..], &law].concat())?;
    match words.iter().filter(|word| *word == "summary.csv self_crossing ").count() {
        0..4 => Ok(()),
        simple => Err(format!("{simple} of 7 members never cross themselves").into()),
    }
}

/// Compares the tables; returns the entries that are not numbers.
fn tables_agree<T: Evolves>(solver: Solver, n: usize, pace: &[&str]) -> Result<Vec<String>, Failed> {
    let (gpu, cpu) = (tables::<T>("gpu", solver, n, pace)?, tables::<T>("cpu", solver, n, pace)?);
    if gpu.0 != cpu.0 || gpu.1.len() != cpu.1.len() || gpu.1.len() < 1000 {
        return Err(format!("{:?} on the GPU, {:?} on the CPU", gpu.0, cpu.0).into());
    }
    // Where an adaptive member crosses itself is searched from where a step began.
    let adaptive = pace.iter().any(|flag| flag.starts_with("--adaptive"));
    let bound = match T::PRECISION {
        Precision::F32 => 1e-3,
        Precision::F64 if adaptive => 1e-8,
        Precision::F64 => 1e-9,
    };
    let error = gpu.1.iter().zip(&cpu.1).map(|(a, b)| (a - b).abs() / a.abs().max(1.0)).fold(0.0, f64::max);
    println!("{} numbers of the program's tables differ by at most {error:.1e}", gpu.1.len());
    if error > bound { Err(format!("the tables differ by {error:e}").into()) } else { Ok(cpu.0) }
}

/// Two columns of the members' summary of a run in this precision.
fn columns(arguments: &str, backend: &str, precision: Precision, names: [&str; 2]) -> Result<Vec<[f64; 2]>, Failed> {
    let folder = tempfile::tempdir()?;
    let mut command = command::program(folder.path());
    command.arg("run").args(arguments.split(' ')).args(["--curves", "8", "--backend", backend]);
    let output = command.args(["--precision", precision.name(), "--out", "out"]).output()?;
    if !output.status.success() {
        return Err(String::from_utf8(output.stderr)?.into());
    }
    let mut reader = csv::Reader::from_path(folder.path().join("out/summary.csv"))?;
    let header = reader.headers()?.clone();
    let place = |name: &str| header.iter().position(|other| other == name).ok_or(format!("no {name}"));
    let places = [place(names[0])?, place(names[1])?];
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let [one, other] = places.map(|at| record[at].parse());
        rows.push([one?, other?]);
    }
    Ok(rows)
}

/// Whole adaptive runs: what the GPU computes in f32 is within 5e-4 of what the CPU does in f64. Limits of an ellipse
/// and of one that is nearly a circle are within their own errors, too. The times are of curves that are nearly
/// circles and not pulled, where products that neighbours do not see alike change them by up to 1e-2, and of crystals.
pub(super) fn f32_is_that_of_the_cpu_in_f64(_: &Gpu, _: Solver, n: usize) -> Outcome {
    let limits = format!("--accurate --shape ellipse:choice(1.05,2),1 --amplitude 0.02 --modes 2..=5 --points {n}");
    let circles = "--shape circle:1 --amplitude 0.03 --decay 2 --flow willmore --adaptive=1e-4";
    let times = format!("{circles} --t-end auto --stop-when-relaxed --points {n}");
    let crystals = "--shape ellipse:1.3,1 --amplitude 0.03 --energy cos:4,0.03 --diffusivity cos:2,0.2 --adaptive=1e-4";
    let of_crystals = format!("{crystals} --t-end auto --stop-when-relaxed --points {n}");
    let names = ["t_relax", "t_end"];
    for (what, arguments, names) in
        [("limits", limits, ["t_limit", "t_error"]), ("times", times, names), ("times of crystals", of_crystals, names)]
    {
        let short = columns(&arguments, "gpu", Precision::F32, names)?;
        let long = columns(&arguments, "cpu", Precision::F64, names)?;
        let off = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).abs();
        let holds = |a: &[f64; 2], b: &[f64; 2]| off(a, b) <= a[1] && off(a, b) <= 5e-4 * b[0];
        let farthest = short.iter().zip(&long).map(|(a, b)| off(a, b) / b[0]).fold(0.0, f64::max);
        println!("{} {what} in f32 differ from those in f64 by at most {farthest:.1e}", short.len());
        let all = short.len() == 8 && long.len() == 8 && short.iter().zip(&long).all(|(a, b)| holds(a, b));
        // The control: other members.
        let others = short.iter().zip(&long[1..]).any(|(a, b)| holds(a, b));
        if !all || others {
            return Err(format!("{what}: f32 {short:?}, f64 {long:?}").into());
        }
    }
    Ok(())
}

/// `curvelax check` may need minutes, during which it shows progress. The test does not wait for its end.
pub(super) fn check_tells() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut command = command::command(folder.path(), "check");
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()?;
    // Drivers may have something to say first.
    let lines = BufReader::new(child.stderr.take().ok_or("no stderr")?).lines();
    let lines = lines.skip_while(|line| line.as_ref().is_ok_and(|line| !line.starts_with("comparing ")));
    let said: Vec<String> = lines.take(3).collect::<Result<_, _>>()?;
    child.kill()?;
    child.wait()?;
    let kernels =
        ["1 of ", ": f32, gauss-seidel, n = 7, stages of a step", "2 of ", ": f32, gauss-seidel, n = 7, fixed steps"];
    let told = said.len() == 3 && said[0].starts_with("comparing ") && said[1].starts_with(kernels[0]);
    let told =
        told && said[1].ends_with(kernels[1]) && said[2].starts_with(kernels[2]) && said[2].ends_with(kernels[3]);
    if told { Ok(()) } else { Err(format!("{said:?}").into()) }
}

/// The same from outside: exit code 2, one message with both numbers, nothing written.
pub(super) fn program_refuses<T: Evolves>(gpu: &Gpu, solver: Solver, _: usize) -> Outcome {
    let most = gpu.capacity().max_points::<T>(solver);
    let folder = tempfile::tempdir()?;
    let points = (most + 1).to_string();
    let arguments = ["run", "--backend", "gpu", "--adapter", gpu.name(), "--precision", T::NAME, "--points", &points];
    let solver = solver.name();
    let mut command = command::program(folder.path());
    let output = command.args(arguments).args(["--solver", solver, "--out", "out"]).output()?;
    // Drivers may have something to say first.
    let said = String::from_utf8(output.stderr)?;
    let message = said.find("error: ").map_or("", |begin| &said[begin..]);
    let beyond_f32 = T::NAME == "f32" && most >= MAX_POINTS_F32;
    let remedy = if beyond_f32 { "use fewer points".to_string() } else { format!("use {most} or fewer") };
    let named = message.starts_with(&format!("error: --points {points}: ")) && message.contains(&remedy);
    if output.status.code() != Some(2) || !named || message.lines().count() != 1 || folder.path().join("out").exists() {
        return Err(format!("{:?}: {message}", output.status).into());
    }
    Ok(())
}
