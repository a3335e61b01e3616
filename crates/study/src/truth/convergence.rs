//! A problem at one resolution, and at several: error and order.

use super::{
    Problem,
    problems::{Beside, Resolution},
};
use crate::placement;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{
    Cell, Ended, Family, Outcome, Spec, Status,
    request::spec::{Precision, Solver},
    simulate::simulate,
};

/// The solution of a problem.
#[derive(Clone, Debug)]
pub struct Solved {
    /// Measured value relative to the exact one; unknown if the run did not reach its final time.
    pub ratio: Option<f64>,
    /// The member's row of a summary.
    pub outcome: Outcome,
    /// Precision of the run.
    pub precision: Precision,
}

impl Solved {
    /// Returns the relative error against the exact solution: measured/exact - 1.
    pub fn error(&self) -> Option<f64> {
        self.ratio.map(|ratio| ratio - 1.0)
    }
}

impl Problem {
    /// Returns `method` with the problem's own keys: what to ask `curvelax run` for, if the curve had a name.
    pub fn spec(&self, method: &Spec, at: Resolution) -> Spec {
        let energy = if let Beside::Energy(energy) = self.beside { Some(energy.into()) } else { None };
        let drive = if let Beside::Drive(drive) = self.beside { Some(drive.into()) } else { None };
        let conserve = if let Beside::Conserved(conserved) = self.beside { Some(conserved) } else { None };
        Spec {
            curves: 1,
            points: at.n,
            sampling: self.curve.sampling(),
            amplitude: 0.0.into(),
            flow: self.flow.clone().into(),
            tau: at.tau.map(Into::into),
            adaptive: at.tolerance,
            t_end: Some(self.t_end.into()),
            energy,
            drive,
            conserve,
            ..method.clone()
        }
    }

    /// Solves the problem by the back end, precision and solver of `method`.
    ///
    /// # Errors
    /// [`Error::Request`] if `method` is not available at this resolution, [`Error::Device`] if the GPU fails. A run
    /// that ends early is not an error but has no ratio.
    pub fn solve(&self, method: &Spec, at: Resolution) -> Result<Solved> {
        let spec = self.spec(method, at).validate()?;
        let choice = placement::choose(&spec)?;
        let precision = choice.precision;
        let family = Family::of(&spec, self.curve.resolve(precision))?;
        let (mut backend, _) = choice.open(&spec)?;
        let mut ended: Vec<Ended> = Vec::new();
        simulate(&[Cell::only(spec, family)], precision, backend.as_mut(), 1, &mut ended)?;
        let Some(Ended { outcome, portrait: Some(nodes), .. }) = ended.pop() else {
            return Err(Error::Failed(format!("{}: the run left no nodes", self.name)));
        };
        let arrived = matches!(outcome.status, Status::Relaxed | Status::Unfinished);
        let ratio = arrived.then(|| self.measure.of(&nodes.before, &nodes.after) / self.exact);
        Ok(Solved { ratio, outcome, precision })
    }
}

/// The quantity that a study refines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Varied {
    /// n, with τ in proportion to h²: the scheme is of order 2.
    Nodes,
    /// τ at a fixed n: order 1.
    Step,
    /// The tolerance of adaptive steps at a fixed n: order 1, whatever the order of the steps.
    Tolerance,
}

impl Varied {
    /// All of them.
    pub const ALL: [Varied; 3] = [Varied::Nodes, Varied::Step, Varied::Tolerance];

    /// Returns the name used in the table.
    pub fn name(self) -> &'static str {
        match self {
            Varied::Nodes => "n",
            Varied::Step => "tau",
            Varied::Tolerance => "tolerance",
        }
    }

    /// The refined quantity; it falls from row to row.
    fn fineness(self, at: Resolution) -> f64 {
        match self {
            Varied::Nodes => 1.0 / at.n as f64,
            Varied::Step => at.tau.unwrap_or(f64::NAN),
            Varied::Tolerance => at.tolerance.unwrap_or(f64::NAN),
        }
    }
}

/// A series of resolutions, the coarsest first, each refined by the same factor.
#[derive(Clone, Debug)]
pub struct ConvergenceStudy {
    /// The refined quantity.
    pub varied: Varied,
    /// The resolutions.
    pub at: Vec<Resolution>,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub struct ConvergenceRow {
    /// Name of the problem.
    pub problem: String,
    /// The refined quantity.
    pub varied: Varied,
    /// The resolution.
    pub at: Resolution,
    /// How the run ended.
    pub status: Status,
    /// Relative error, measured/exact - 1; unknown if the run ended early.
    pub error: Option<f64>,
    /// Observed order.
    pub order: Option<f64>,
}

/// Returns the studies of `problem` by `solver`.
pub fn studies(problem: &Problem, solver: Solver) -> Vec<ConvergenceStudy> {
    let nodes: &[u32] = if solver.sweeps() { &SWEPT_NODES } else { &NODES };
    let by_nodes = |&n: &u32| problem.in_steps(n as usize, n * n / 25);
    vec![
        ConvergenceStudy { varied: Varied::Nodes, at: nodes.iter().map(by_nodes).collect() },
        ConvergenceStudy {
            varied: Varied::Tolerance,
            at: TOLERANCES.map(|own| Resolution { n: FIXED_NODES, tau: None, tolerance: Some(own) }).into(),
        },
        ConvergenceStudy { varied: Varied::Step, at: STEPS.map(|steps| problem.in_steps(FIXED_NODES, steps)).into() },
    ]
}

/// n of a study in n, with n²/25 steps.
const NODES: [u32; 3] = [50, 100, 200];
/// The same for sweeps, whose number grows like n⁴·τ.
const SWEPT_NODES: [u32; 3] = [25, 50, 100];
/// n of the other studies.
const FIXED_NODES: usize = 100;
/// Steps of a study in τ.
const STEPS: [u32; 4] = [50, 100, 200, 400];

/// Tolerances of a study in adaptive steps.
const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

/// Change of the relative error, in ε, below which there is only rounding and no visible order.
const ROUNDING: f64 = 1e3;

impl ConvergenceStudy {
    /// Solves `problem` at each resolution.
    ///
    /// # Errors
    /// Those of [`Problem::solve`].
    pub fn rows(&self, problem: &Problem, method: &Spec) -> Result<Vec<ConvergenceRow>> {
        let mut errors = Vec::new();
        let mut rows = Vec::new();
        for &at in &self.at {
            let solved = problem.solve(method, at)?;
            errors.push(solved.error());
            rows.push(ConvergenceRow {
                problem: problem.name.clone(),
                varied: self.varied,
                at,
                status: solved.outcome.status,
                error: solved.error(),
                order: self.order(&errors, ROUNDING * solved.precision.epsilon()),
            });
        }
        Ok(rows)
    }

    /// The order at the last of `errors`.
    ///
    /// In n it is that of two errors. At a fixed n, all errors share the error of the spacing, but the differences of
    /// three errors do not: their ratio gives the order of the rest.
    fn order(&self, errors: &[Option<f64>], rounding: f64) -> Option<f64> {
        let last = errors.len() - 1;
        let refined = self.varied.fineness(self.at[last.checked_sub(1)?]) / self.varied.fineness(self.at[last]);
        let (coarse, fine) = match (self.varied, errors) {
            (Varied::Nodes, [.., Some(a), Some(b)]) => (*a, *b),
            (Varied::Step | Varied::Tolerance, [.., Some(a), Some(b), Some(c)]) => (a - b, b - c),
            _ => return None,
        };
        (coarse.abs().min(fine.abs()) > rounding).then(|| (coarse / fine).abs().ln() / refined.ln())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(varied: Varied) -> ConvergenceStudy {
        let at = [10, 20, 40].map(|n| Resolution { n, tau: Some(1.0 / n as f64), tolerance: None });
        ConvergenceStudy { varied, at: at.into() }
    }

    #[test]
    fn the_order_is_that_of_the_part_that_is_refined() {
        let errors = |error: fn(f64) -> f64| [10.0, 20.0, 40.0].map(|n| Some(error(1.0 / n)));
        let order = |varied, errors: &[Option<f64>]| study(varied).order(errors, 1e-12);
        let near = |found: Option<f64>, order: f64| (found.unwrap() - order).abs() < 1e-9;
        assert!(near(order(Varied::Nodes, &errors(|h| -3.0 * h * h)), 2.0));
        assert!(near(order(Varied::Step, &errors(|tau| 0.7 - 2.0 * tau)), 1.0));
        assert_eq!(order(Varied::Nodes, &[Some(1.0)]), None);
        assert_eq!(order(Varied::Step, &errors(|_| 0.1)), None, "an error that stays has no order");
        assert_eq!(order(Varied::Nodes, &[None, Some(1.0), None]), None);
    }
}
