//! `curvelax convergence`: the error of the scheme against exact solutions, and its order.

use std::path::PathBuf;

use super::{
    flags, note,
    paper::{PaperFlags, Prints},
    parsers, print,
    referee::{RefereeFlags, referee},
};
use crate::{
    draw::{
        charts::{ChartText, WorkCurve, WorkDiagram, WorkPanels},
        medium::Medium,
    },
    ensemble::{
        Spec, Study,
        request::spec::{BackendChoice, Precision, Solver, SolverChoice},
    },
    error::{Error, Result},
    files::{OutputFolder, Owner, names, tables::Table},
    placement,
    text::significant,
    truth::{ConvergenceRow, Problem, Stepping, WorkPrecision, WorkRow, problems, studies},
};

const EXAMPLES: &str = "\
Examples:
  curvelax convergence
  curvelax convergence --problem willmore-circle --problem lemniscate --out convergence
  curvelax convergence --backend gpu --precision f32
  curvelax convergence --work-precision --out work
  curvelax convergence --work-precision --out work --format png,pdf --width page
  curvelax convergence --referee --shape flower:3:0.2 --flow willmore
  curvelax convergence --referee --curves 100 --seed 2 --out referee

An error is measured/exact - 1. In n, with tau proportional to 1/n^2, the order should be 2. In tau, at a fixed n, it
should be 1. In the tolerance of adaptive steps it is about 1, and scatters, as steps have several orders. The last two are
orders of the differences of three errors, which cancels the error of the spacing. No order is printed where the error changes
by rounding only.

--work-precision runs members of the default ensemble with fixed steps and with adaptive steps of every order, at
several lengths and tolerances, until they are relaxed. Its error is the median of |t_relax/reference - 1|, where the
reference has the same nodes and a tolerance of 1e-8: the error of the steps alone. It takes some seconds with --solver
direct, and minutes with sweeps.

--referee solves the same flow by tangent angle and length, with Fourier coefficients and steps of order 8, twice, until
both solutions agree to 1e-6. It refuses curves with corners and curves that become singular. For one curve the table has
t_relax at n = 50, 100 and 200 (adaptive steps, 1e-5), whose error should fall at order 2, and t_limit; with --curves it has
the t_limit of every member. The error of t_limit is also given in bars, its half-width t_error.";

/// Solve problems with exact solutions; print errors and observed orders as a table.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct ConvergenceArgs {
    /// Solve only this problem; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    problem: Vec<String>,
    /// Instead, measure what an error of the relaxation time costs, in solves and in seconds
    #[arg(long, conflicts_with = "problem")]
    work_precision: bool,
    #[command(flatten)]
    referee: RefereeFlags,
    /// Solver of the pentadiagonal systems; Gauss-Seidel takes longer [default: direct; with --work-precision all]
    #[arg(long, value_name = "SOLVER", value_parser = parsers::word::<SolverChoice>(), help_heading = flags::METHOD)]
    solver: Option<SolverChoice>,
    /// Where to run; auto uses a hardware GPU if there is one, otherwise the CPU [default: auto]
    #[arg(long, value_name = "WHERE", value_parser = parsers::word::<BackendChoice>(), help_heading = flags::MACHINE)]
    backend: Option<BackendChoice>,
    /// GPU adapter to use, given by a part of its name [default: the best]
    #[arg(long, value_name = "NAME", help_heading = flags::MACHINE)]
    adapter: Option<String>,
    /// Number type [default: f64 where the device has it]
    #[arg(long, value_name = "TYPE", value_parser = parsers::word::<Precision>(), help_heading = flags::MACHINE)]
    precision: Option<Precision>,
    /// Folder for convergence.csv, work_precision.csv and .svg, or referee.csv, which must not exist yet [default: no
    /// file]
    #[arg(long, value_name = "DIR", help_heading = flags::OUTPUT)]
    out: Option<PathBuf>,
    /// Write into an existing DIR, replacing these files in it
    #[arg(long, help_heading = flags::OUTPUT)]
    force: bool,
    #[command(flatten)]
    paper: PaperFlags,
    /// Print no notes and no table: only errors
    #[arg(long, help_heading = flags::OUTPUT)]
    quiet: bool,
}

/// Runs the command.
pub fn convergence(args: ConvergenceArgs) -> Result<()> {
    let prints = args.paper.prints()?;
    if args.paper.is_given() && !(args.work_precision && args.out.is_some()) {
        let remedy = "add --work-precision --out DIR, or leave out --format, --width and --dpi";
        return Err(Error::Request(format!("only --work-precision draws a picture, into --out: {remedy}")));
    }
    let chosen = match args.problem.is_empty() {
        true => problems(),
        false => args.problem.iter().map(|name| Problem::named(name)).collect::<Result<_>>()?,
    };
    let solver = args.solver;
    let spec = Spec {
        solver: solver.unwrap_or(Solver::Direct.into()),
        backend: args.backend.unwrap_or(BackendChoice::Auto),
        adapter: args.adapter,
        precision: args.precision,
        ..Spec::default()
    };
    let (refereed, one) = (args.referee.referee, args.referee.curves.is_none());
    let spec = if refereed { args.referee.spec(spec) } else { spec };
    // The times of the referee follow its curves as they are made.
    let mut method = if refereed { Study::new(spec)?.spec().clone() } else { spec.validate()? };
    let choice = placement::choose(&method)?;
    // Chosen once: adapters are looked for only now, and all runs have the same precision.
    choice.settle_place(&mut method);
    method.solver = method.solver().into();
    let names = match (args.work_precision, refereed) {
        (true, _) => [names::WORK.into()].into_iter().chain(prints.extensions().map(work_picture)).collect(),
        (_, true) => vec![names::REFEREE.into()],
        _ => vec![names::CONVERGENCE.into()],
    };
    let folder = args.out.map(|out| OutputFolder::open_for(&out, args.force, Owner::Convergence, names)).transpose()?;
    if !args.quiet {
        note(&if args.work_precision { choice.place() } else { choice.sentence(&method) });
        choice.warning().iter().for_each(|warning| note(&format!("warning: {warning}")));
    }
    if refereed {
        return referee(&method, one, folder, args.quiet);
    }
    if args.work_precision {
        let solvers = solver.map_or(Solver::ALL.to_vec(), |_| vec![method.solver()]);
        return work_precision(&method, &solvers, folder, args.quiet, prints);
    }
    let mut rows = Vec::new();
    for problem in &chosen {
        for study in studies(problem, method.solver()) {
            rows.extend(study.rows(problem, &method)?);
        }
    }
    if let Some(folder) = folder {
        let file = Table::of(folder.file(names::CONVERGENCE)?, &rows)?;
        folder.publish_all(vec![file])?;
    }
    if !args.quiet {
        print(&table(&rows))?;
    }
    match rows.iter().filter(|row| row.error.is_none()).count() {
        0 => Ok(()),
        early => Err(Error::Failed(format!(
            "{early} of {} runs ended before their final time; use f64, or another problem",
            rows.len()
        ))),
    }
}

const WORK_TITLE: &str = "What an error of the relaxation time costs";

/// The file of the picture with this extension.
fn work_picture(extension: &str) -> String {
    names::WORK_PICTURE.replace("svg", extension)
}

/// Measures what errors cost, with all `solvers`; prints the rows as they come.
fn work_precision(
    method: &Spec,
    solvers: &[Solver],
    folder: Option<OutputFolder>,
    quiet: bool,
    mut prints: Prints,
) -> Result<()> {
    let measured = WorkPrecision::new(method)?;
    if !quiet {
        note(&measured.sentence());
        print(&work_line(["solver", "order", "tau", "tolerance", "error", "solves", "sweeps", "ms"]))?;
    }
    let mut rows = Vec::new();
    for solver in solvers {
        for way in measured.ways(*solver) {
            let of_way = measured.rows(*solver, &way)?;
            if !quiet {
                print(&format!("\n{}", of_way.iter().map(work_row).collect::<String>()))?;
            }
            rows.push(of_way);
        }
    }
    if let Some(folder) = folder {
        let table = Table::of(folder.file(names::WORK)?, &rows.concat())?;
        let draw = |medium| work_diagram(&measured, solvers, &rows, medium);
        let pictures = prints.write(&folder, work_picture, WORK_TITLE, draw)?;
        if !quiet {
            prints.note_missing();
        }
        folder.publish_all([table].into_iter().chain(pictures).collect())?;
    }
    match rows.iter().flatten().filter(|row| row.error.is_none()).count() {
        0 => Ok(()),
        early => Err(Error::Failed(format!("in {early} of {} rows not all members relaxed", rows.concat().len()))),
    }
}

fn work_line([solver, order, tau, tolerance, error, solves, sweeps, ms]: [&str; 8]) -> String {
    format!("{solver:<13}{order:>5}{tau:>10}{tolerance:>11}{error:>11}{solves:>9}{sweeps:>10}{ms:>10}\n")
}

fn work_row(row: &WorkRow) -> String {
    let short = |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{value:.1e}"));
    let Stepping { tau, tolerance, most_order } = row.stepping;
    work_line([
        row.solver.name(),
        &most_order.to_string(),
        &short(tau),
        &short(tolerance),
        &short(row.error),
        &format!("{:.0}", row.solves),
        &format!("{:.0}", row.sweeps),
        &significant(1e3 * row.seconds, 3),
    ])
}

/// Errors against solves and seconds, a row of panels for each solver.
fn work_diagram(measured: &WorkPrecision, solvers: &[Solver], rows: &[Vec<WorkRow>], medium: Medium) -> String {
    let curve = |way: &Vec<WorkRow>| WorkCurve {
        label: match way.first().map_or(1, |row| row.stepping.most_order) {
            1 => "fixed steps".into(),
            order => format!("order up to {order}"),
        },
        points: way.iter().filter_map(|row| Some((row.error?, [row.solves, 1e3 * row.seconds]))).collect(),
    };
    let panels = |solver: &Solver| WorkPanels {
        label: solver.name().into(),
        curves: rows.iter().filter(|way| way.iter().all(|row| row.solver == *solver)).map(curve).collect(),
    };
    let text = ChartText { title: WORK_TITLE.into(), note: measured.sentence(), ..ChartText::default() };
    let costs = [("solves per member", ""), ("time per member", "ms")];
    WorkDiagram { text, costs, rows: solvers.iter().map(panels).collect() }.draw(medium)
}

/// An aligned table, grouped by problem; a run that ended early has its status instead of its error.
fn table(rows: &[ConvergenceRow]) -> String {
    let width = rows.iter().map(|row| row.problem.len()).max().unwrap_or(0).max("problem".len());
    let line = |cells: [&str; 7]| {
        let [problem, varied, n, tau, tolerance, error, order] = cells;
        let line = format!("{problem:<width$}  {varied:<9}{n:>6}{tau:>11}{tolerance:>11}{error:>12}{order:>7}");
        format!("{}\n", line.trim_end())
    };
    let mut text = line(["problem", "varied", "n", "tau", "tolerance", "error", "order"]);
    let mut before = "";
    for ConvergenceRow { problem, varied, at, status, error, order } in rows {
        if problem != before {
            text += "\n";
            before = problem;
        }
        let short = |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{value:.2e}"));
        let tau = short(at.tau);
        let error = error.map_or(status.name().to_string(), |error| format!("{error:+.2e}"));
        let order = order.map_or("-".to_string(), |order| format!("{order:.2}"));
        text += &line([problem, varied.name(), &at.n.to_string(), &tau, &short(at.tolerance), &error, &order]);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        ensemble::Status,
        truth::{Resolution, Varied},
    };

    #[test]
    fn a_table_is_aligned_and_says_how_a_run_ended_that_has_no_error() {
        let row = |problem: &str, status, error| ConvergenceRow {
            problem: problem.into(),
            varied: Varied::Nodes,
            at: Resolution { n: 50, tau: Some(0.001), tolerance: None },
            status,
            error,
            order: error.map(|_| 1.998),
        };
        let rows = [row("one", Status::Unfinished, Some(-0.0123)), row("another", Status::Singular, None)];
        let expected = "\
problem  varied        n        tau  tolerance       error  order

one      n            50    1.00e-3          -    -1.23e-2   2.00

another  n            50    1.00e-3          -    singular      -
";
        assert_eq!(table(&rows), expected);
    }
}
