//! `curvelax convergence`: the error of the scheme against exact solutions, and its order.

use std::path::{Path, PathBuf};

use super::{flags, note, print};
use crate::{
    ensemble::{
        Spec,
        spec::{BackendChoice, Precision, Solver, SolverChoice},
    },
    error::{Error, Result},
    files::{
        OutputFolder, Owner, names,
        tables::{ErrorRow, Table},
    },
    placement,
    truth::{ConvergenceRow, Problem, problems, studies},
};

const EXAMPLES: &str = "\
Examples:
  curvelax convergence
  curvelax convergence --problem willmore-circle --problem lemniscate --out convergence
  curvelax convergence --backend gpu --precision f32

An error is measured/exact - 1. In n, with tau proportional to 1/n^2, the order should be 2. In tau, at a fixed n, it
should be 1. In the length of adaptive steps, proportional to the root of their tolerance, it should be 2. The last two are
orders of the differences of three errors, which cancels the error of the spacing. No order is printed where the error changes
by rounding only.";

/// Solve problems with exact solutions; print errors and observed orders as a table.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct ConvergenceArgs {
    /// Solve only this problem; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    problem: Vec<String>,
    /// Solver of the pentadiagonal systems; sweeps take longer [default: direct]
    #[arg(long, value_name = "SOLVER", value_parser = flags::word::<SolverChoice>(&SolverChoice::NAMES), help_heading = flags::METHOD)]
    solver: Option<SolverChoice>,
    /// Where to run; auto uses a hardware GPU if there is one, otherwise the CPU [default: auto]
    #[arg(long, value_name = "WHERE", value_parser = flags::word::<BackendChoice>(flags::BACKENDS), help_heading = flags::MACHINE)]
    backend: Option<BackendChoice>,
    /// GPU adapter to use, given by a part of its name [default: the best]
    #[arg(long, value_name = "NAME", help_heading = flags::MACHINE)]
    adapter: Option<String>,
    /// Number type [default: f64 where the device has it]
    #[arg(long, value_name = "TYPE", value_parser = flags::word::<Precision>(flags::PRECISIONS), help_heading = flags::MACHINE)]
    precision: Option<Precision>,
    /// Folder for convergence.csv, which must not exist yet [default: no file]
    #[arg(long, value_name = "DIR", help_heading = flags::OUTPUT)]
    out: Option<PathBuf>,
    /// Write into an existing DIR, replacing its convergence.csv
    #[arg(long, help_heading = flags::OUTPUT)]
    force: bool,
    /// Print no notes and no table: only errors
    #[arg(long, help_heading = flags::OUTPUT)]
    quiet: bool,
}

/// Runs the command.
pub fn convergence(args: ConvergenceArgs) -> Result<()> {
    let chosen = match args.problem.is_empty() {
        true => problems(),
        false => args.problem.iter().map(|name| Problem::named(name)).collect::<Result<_>>()?,
    };
    let spec = Spec {
        solver: args.solver.unwrap_or(Solver::Direct.into()),
        backend: args.backend.unwrap_or(BackendChoice::Auto),
        adapter: args.adapter,
        precision: args.precision,
        ..Spec::default()
    };
    let mut method = spec.validate()?;
    let choice = placement::choose(&method, method.points)?;
    // Chosen once: adapters are looked for only now, and all runs have the same precision.
    choice.settle(&mut method);
    let folder = args.out.map(|out| open(&out, args.force)).transpose()?;
    if !args.quiet {
        note(&choice.sentence(&method));
    }
    let mut rows = Vec::new();
    for problem in &chosen {
        for study in studies(problem, method.solver()) {
            rows.extend(study.rows(problem, &method)?);
        }
    }
    if let Some(folder) = folder {
        let errors: Vec<ErrorRow> = rows.iter().map(ErrorRow::of).collect();
        let file = Table::of(folder.file(names::CONVERGENCE)?, &errors)?;
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

fn open(out: &Path, force: bool) -> Result<OutputFolder> {
    OutputFolder::open_for(out, force, Owner::Convergence, vec![names::CONVERGENCE.into()])
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
        let tau = short(at.tolerance.is_none().then_some(at.tau));
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
            at: Resolution { n: 50, tau: 0.001, tolerance: None },
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
