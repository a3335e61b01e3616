//! The error of relaxation times against what it costs: fixed steps, and adaptive steps of every order.
//!
//! The curves are members of the default ensemble. What is measured is the error of the steps alone: the reference has
//! the same members and the same nodes, and so the same error of the spacing.

use std::time::Instant;

use crate::placement;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{
    Cell, Ended, Family, Outcome, Spec,
    request::spec::{BackendChoice, DEFAULT_ADAPTIVE, FinalTime, OrAuto, Precision, Solver},
    simulate::simulate,
};
use curvelax_flow::scheme::extrapolation::{LEAST_ORDER, MOST_ORDER};
use curvelax_statistics::Description;

/// How much is run.
struct Effort {
    members: u64,
    /// Runs of which the seconds are the median.
    repeats: usize,
    /// Tolerances of adaptive steps.
    tolerances: &'static [f64],
}

const FULL: Effort = Effort { members: 32, repeats: 5, tolerances: &[1e-1, 1e-2, DEFAULT_ADAPTIVE, 1e-4, 1e-5] };
/// Where longer steps take more sweeps, a member takes a good part of a second.
const SWEPT: Effort = Effort { members: 8, repeats: 3, tolerances: &[1e-2, DEFAULT_ADAPTIVE, 1e-4] };

impl Effort {
    fn of(solver: Solver) -> &'static Effort {
        if solver.sweeps() { &SWEPT } else { &FULL }
    }
}

/// Fixed steps, in length⁴.
const STEPS: [f64; 4] = [1e-2, 2.5e-3, 6.25e-4, 1.5625e-4];
/// Tolerance of the reference.
const FINEST: f64 = 1e-8;
/// How the time of a row is cut into steps: of one length, or adaptive ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepping {
    /// The length, in length⁴.
    pub tau: Option<f64>,
    /// The tolerance of adaptive steps.
    pub tolerance: Option<f64>,
    /// Their highest order, 1 for fixed ones.
    pub most_order: u32,
}

/// A row of the table: one method.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkRow {
    /// Solver of the systems.
    pub solver: Solver,
    /// The steps.
    pub stepping: Stepping,
    /// Median over the members of the relative error of t_relax; unknown unless all relaxed.
    pub error: Option<f64>,
    /// Mean number of steps of the paper per member.
    pub solves: f64,
    /// Mean number of sweeps per member.
    pub sweeps: f64,
    /// Seconds per member on the whole device, median of three runs or more.
    pub seconds: f64,
}

/// Errors and costs of relaxation times.
#[derive(Debug)]
pub struct WorkPrecision {
    method: Spec,
    precision: Precision,
    reference: Vec<Option<f64>>,
}

fn median(values: Vec<f64>) -> Result<f64> {
    Ok(Description::new(values)?.median().unwrap_or(f64::NAN))
}

impl WorkPrecision {
    /// Computes the reference for runs where `method` says, with its number of nodes.
    ///
    /// # Errors
    /// [`Error::Request`] if `method` is not available, [`Error::Failed`] if a member of the reference does not relax.
    pub fn new(method: &Spec) -> Result<WorkPrecision> {
        let precision = placement::choose(&method.clone().validate()?)?.precision;
        let exactly = Spec {
            backend: BackendChoice::Cpu,
            adapter: None,
            precision: Some(Precision::F64),
            solver: Solver::Direct.into(),
            ..method.clone()
        };
        let mut all = WorkPrecision { method: exactly, precision: Precision::F64, reference: Vec::new() };
        let finest = Stepping { tau: None, tolerance: Some(FINEST), most_order: MOST_ORDER };
        let (exact, _) = all.run(Solver::Direct, &[finest], 1)?.remove(0);
        let reference: Vec<Option<f64>> = exact.iter().map(|ended| ended.outcome.t_relax).collect();
        if reference.iter().any(Option::is_none) {
            return Err(Error::Failed("a member of the reference did not relax".into()));
        }
        (all.method, all.precision, all.reference) = (method.clone(), precision, reference);
        Ok(all)
    }

    /// What was measured, in a sentence.
    pub fn sentence(&self) -> String {
        format!(
            "{} perturbed 2:1 ellipses ({} with sweeps), n = {}, {}. Median error against the same nodes at a tolerance of \
             {FINEST:e}, median time of several runs.",
            FULL.members,
            SWEPT.members,
            self.method.points,
            self.precision.name()
        )
    }

    /// The ways of stepping, each at several resolutions, the coarsest first: steps of one length, then adaptive steps
    /// of rising order.
    pub fn ways(&self, solver: Solver) -> Vec<Vec<Stepping>> {
        let fixed = STEPS.map(|tau| Stepping { tau: Some(tau), tolerance: None, most_order: 1 }).to_vec();
        let orders = LEAST_ORDER..=MOST_ORDER;
        let step = |tolerance: &f64, most_order| Stepping { tau: None, tolerance: Some(*tolerance), most_order };
        let adaptive =
            |most_order| Effort::of(solver).tolerances.iter().map(|tolerance| step(tolerance, most_order)).collect();
        std::iter::once(fixed).chain(orders.map(adaptive)).collect()
    }

    /// Measures a way of stepping by `solver`.
    ///
    /// # Errors
    /// Those of the back end.
    pub fn rows(&self, solver: Solver, way: &[Stepping]) -> Result<Vec<WorkRow>> {
        let runs = self.run(solver, way, Effort::of(solver).repeats)?;
        let row = |(stepping, (members, seconds)): (&Stepping, (Vec<Ended>, f64))| {
            let error = |(ended, exact): (&Ended, &Option<f64>)| Some((ended.outcome.t_relax? / (*exact)? - 1.0).abs());
            let errors: Option<Vec<f64>> = members.iter().zip(&self.reference).map(error).collect();
            let count = members.len() as f64;
            let mean =
                |of: fn(&Outcome) -> u64| members.iter().map(|ended| of(&ended.outcome)).sum::<u64>() as f64 / count;
            Ok(WorkRow {
                solver,
                stepping: *stepping,
                error: errors.map(median).transpose()?,
                solves: mean(|of| of.solves),
                sweeps: mean(|of| of.sweeps_k + of.sweeps_x),
                seconds: seconds / count,
            })
        };
        way.iter().zip(runs).map(row).collect()
    }

    /// Runs all members once for each of `way`, and returns how they end with the median of the seconds of `repeats`
    /// runs. The runs take turns, so that a disturbance of the machine meets all of them.
    fn run(&self, solver: Solver, way: &[Stepping], repeats: usize) -> Result<Vec<(Vec<Ended>, f64)>> {
        let mut runs: Vec<(Vec<Ended>, Vec<f64>)> = way.iter().map(|_| Default::default()).collect();
        let specs: Vec<Spec> = way.iter().map(|stepping| self.spec(solver, *stepping)).collect();
        let Some(first) = specs.first() else { return Ok(Vec::new()) };
        let choice = placement::choose(first)?;
        let (mut backend, _) = choice.open(first)?;
        let family = Family::new(first)?;
        for _ in 0..repeats {
            for (spec, (members, seconds)) in specs.iter().zip(&mut runs) {
                members.clear();
                let cell = Cell::only(spec.clone().validate()?, family.clone());
                let started = Instant::now();
                simulate(&[cell], choice.precision, backend.as_mut(), 0, members)?;
                seconds.push(started.elapsed().as_secs_f64());
            }
        }
        runs.into_iter().map(|(members, seconds)| Ok((members, median(seconds)?))).collect()
    }

    /// The spec of a run: what `--accurate` recommends, with other steps.
    fn spec(&self, solver: Solver, stepping: Stepping) -> Spec {
        let spec = Spec {
            curves: Effort::of(solver).members,
            solver: solver.into(),
            omega: Some(OrAuto::Auto),
            pull: OrAuto::Auto,
            t_end: Some(FinalTime::Auto),
            ..self.method.clone()
        };
        let Stepping { tau, tolerance, most_order } = stepping;
        Spec {
            tau: tau.map(Into::into),
            adaptive: tolerance,
            most_order: tolerance.map_or(spec.most_order, |_| Some(most_order)),
            ..spec
        }
    }
}
