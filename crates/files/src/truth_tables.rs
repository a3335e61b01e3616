//! The tables of `curvelax convergence`: errors against exact solutions and the referee, and what they cost.

use super::column::columns;
use curvelax_study::truth::{ConvergenceRow, RefereeRow, WorkRow};

/// A row of `convergence.csv`: the error of a run against an exact solution.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorRow {
    problem: String,
    varied: String,
    n: u64,
    tau: Option<f64>,
    tolerance: Option<f64>,
    error: Option<f64>,
    order: Option<f64>,
}

columns! { ErrorRow:
    problem: word = problem, "name of the problem";
    varied: word = varied, "what is refined: n, tau or tolerance";
    n: whole = n, "nodes";
    tau: optional = tau, "time step; empty where steps adapt";
    tolerance: optional = tolerance, "local error tolerance of adaptive steps";
    error: optional = error, "measured / exact - 1; empty where the run ended early";
    order: optional = order, "observed order against the row before";
}

/// A row of `referee.csv`: a relaxation time of a member, and that of an independent solver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TruthRow {
    member: u64,
    time: String,
    points: u64,
    t: Option<f64>,
    t_error: Option<f64>,
    order: Option<f64>,
    referee: Option<f64>,
    referee_error: Option<f64>,
    error: Option<f64>,
    bars: Option<f64>,
}

columns! { TruthRow:
    member: whole = member, "index of the member";
    time: word = time, "which time of `summary.csv` it is: t_relax or t_limit";
    points: whole = points, "nodes";
    t: event = t, "the time; empty if the member did not relax";
    t_error: optional = t_error, "half-width of the 95 % interval of t_limit";
    order: optional = order, "of t_relax: order of the error against the row before; of t_limit: as in `summary.csv`";
    referee: event = referee, "the time by the referee; empty if it refused the curve";
    referee_error: optional = referee_error, "its uncertainty: the difference from a solution with half the nodes and a wider tolerance";
    error: optional = error, "t / referee - 1";
    bars: optional = bars, "(t - referee) / t_error";
}

/// A row of `work_precision.csv`: the error of relaxation times by one method, and what it costs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CostRow {
    solver: String,
    tau: Option<f64>,
    tolerance: Option<f64>,
    most_order: u64,
    error: Option<f64>,
    solves: f64,
    sweeps: f64,
    seconds: f64,
}

columns! { CostRow:
    solver: word = solver, "solver of the systems";
    tau: optional = tau, "time step; empty where steps adapt";
    tolerance: optional = tolerance, "local error tolerance of adaptive steps";
    most_order: whole = most_order, "highest order of the steps; 1 for fixed ones";
    error: optional = error, "median of |t_relax / reference - 1|; empty unless all members relaxed";
    solves: number = solves, "steps of the paper per member, mean";
    sweeps: number = sweeps, "sweeps per member, mean";
    seconds: number = seconds, "seconds per member with all threads at work, median of several runs";
}

impl ErrorRow {
    /// The row of a run; either τ or the tolerance of adaptive steps is empty.
    pub fn of(run: &ConvergenceRow) -> ErrorRow {
        let ConvergenceRow { problem, varied, at, error, order, .. } = run;
        ErrorRow {
            problem: problem.clone(),
            varied: varied.name().to_string(),
            n: at.n as u64,
            tau: at.tolerance.is_none().then_some(at.tau),
            tolerance: at.tolerance,
            error: *error,
            order: *order,
        }
    }
}

impl TruthRow {
    /// The row of a comparison.
    pub fn of(row: &RefereeRow) -> TruthRow {
        let truth = row.truth.as_ref().ok();
        TruthRow {
            member: row.member,
            time: row.time.name().to_string(),
            points: row.points as u64,
            t: row.t,
            t_error: row.t_error,
            order: row.order,
            referee: truth.map(|truth| truth.t),
            referee_error: truth.map(|truth| truth.error * truth.t),
            error: row.error(),
            bars: row.bars(),
        }
    }
}

impl CostRow {
    /// The row of a method; either τ or the tolerance of adaptive steps is empty.
    pub fn of(row: &WorkRow) -> CostRow {
        let (tau, tolerance) = row.stepping.settings();
        CostRow {
            solver: row.solver.name().to_string(),
            tau,
            tolerance,
            most_order: row.stepping.order().into(),
            error: row.error,
            solves: row.solves,
            sweeps: row.sweeps,
            seconds: row.seconds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::{Table, tests::written};
    use curvelax_ensemble::Status;

    #[test]
    fn a_table_of_convergence_has_these_bytes() {
        let row = |error, order| ConvergenceRow {
            problem: "lemniscate".into(),
            varied: curvelax_study::truth::Varied::Step,
            at: curvelax_study::truth::Resolution { n: 100, tau: 0.25, tolerance: None },
            status: Status::Unfinished,
            error,
            order,
        };
        let text = written("convergence.csv", |file| {
            Table::of(file, &[row(Some(-0.1), Some(1.5)), row(None, None)].map(|row| ErrorRow::of(&row)))
        });
        assert_eq!(
            text,
            "problem,varied,n,tau,tolerance,error,order\nlemniscate,tau,100,0.25,,-0.1,1.5\nlemniscate,tau,100,0.25,,,\n"
        );
    }
}
