//! The tables of `curvelax convergence`: errors against exact solutions and the referee, and what they cost.

use super::{column::row, names};
use curvelax_study::truth::{ConvergenceRow, RefereeRow, WorkRow};

row! {
    /// A row of `convergence.csv`: the error of a run against an exact solution.
    ErrorRow, names::CONVERGENCE:
    problem: word, "name of the problem";
    varied: word, "what is refined: n, tau or tolerance";
    n: whole, "nodes";
    tau: optional, "time step; empty where steps adapt";
    tolerance: optional, "local error tolerance of adaptive steps";
    error: optional, "measured / exact - 1; empty where the run ended early";
    order: optional, "observed order against the row before";
}

row! {
    /// A row of `referee.csv`: a relaxation time of a member, and that of an independent solver.
    TruthRow, names::REFEREE:
    member: whole, "index of the member";
    time: word, "which time of `summary.csv` it is: t_relax or t_limit";
    points: whole, "nodes";
    t: event, "the time; empty if the member did not relax";
    t_error: optional, "half-width of the 95 % interval of t_limit";
    order: optional, "of t_relax: order of the error against the row before; of t_limit: as in `summary.csv`";
    referee: event, "the time by the referee; empty if it refused the curve";
    referee_error: optional, "its uncertainty: the difference from a solution with half the nodes and a wider tolerance";
    error: optional, "t / referee - 1";
    bars: optional, "(t - referee) / t_error";
}

row! {
    /// A row of `work_precision.csv`: the error of relaxation times by one method, and what it costs.
    CostRow, names::WORK:
    solver: word, "solver of the systems";
    tau: optional, "time step; empty where steps adapt";
    tolerance: optional, "local error tolerance of adaptive steps";
    most_order: whole, "highest order of the steps; 1 for fixed ones";
    error: optional, "median of |t_relax / reference - 1|; empty unless all members relaxed";
    solves: number, "steps of the paper per member, mean";
    sweeps: number, "sweeps per member, mean";
    seconds: number, "seconds per member with all threads at work, median of several runs";
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
            time: row.time.to_string(),
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
