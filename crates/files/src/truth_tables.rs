//! The tables of `curvelax convergence`: errors against exact solutions and the referee, and what they cost.

use super::{
    column::{columns, row},
    names,
};
use curvelax_study::truth::{ConvergenceRow, RefereeRow, WorkRow};

columns! { ConvergenceRow, names::CONVERGENCE:
    problem: word = problem, "name of the problem";
    varied: varied = varied, "what is refined: n, tau or tolerance";
    n: nodes = at.n, "nodes";
    tau: optional = at.tau, "time step; empty where steps adapt";
    tolerance: optional = at.tolerance, "local error tolerance of adaptive steps";
    error: optional = error, "measured / exact - 1; empty where the run ended early";
    order: optional = order, "observed order against the row before";
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

columns! { WorkRow, names::WORK:
    solver: solver = solver, "solver of the systems";
    tau: optional = stepping.tau, "time step; empty where steps adapt";
    tolerance: optional = stepping.tolerance, "local error tolerance of adaptive steps";
    most_order: small = stepping.most_order, "highest order of the steps; 1 for fixed ones";
    error: optional = error, "median of |t_relax / reference - 1|; empty unless all members relaxed";
    solves: number = solves, "steps of the paper per member, mean";
    sweeps: number = sweeps, "sweeps per member, mean";
    seconds: number = seconds, "seconds per member with all threads at work, median of several runs";
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
            at: curvelax_study::truth::Resolution { n: 100, tau: Some(0.25), tolerance: None },
            status: Status::Unfinished,
            error,
            order,
        };
        let text = written("convergence.csv", |file| Table::of(file, &[row(Some(-0.1), Some(1.5)), row(None, None)]));
        assert_eq!(
            text,
            "problem,varied,n,tau,tolerance,error,order\nlemniscate,tau,100,0.25,,-0.1,1.5\nlemniscate,tau,100,0.25,,,\n"
        );
    }
}
