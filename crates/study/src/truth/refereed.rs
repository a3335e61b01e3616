//! Relaxation times of the members of a study beside those of the [`Referee`].

use super::{Referee, Truth};
use crate::relax;
use curvelax_base::{
    error::{Error, Result},
    text::significant,
    threads,
};
use curvelax_ensemble::{Cell, Ended, Outcome, Spec, Study};

/// Nodes of the rows that show the order of the scheme, and the tolerance of their steps.
const NODES: [usize; 3] = [50, 100, 200];
const TOLERANCE: f64 = 1e-5;
/// Members that are refereed side by side.
const BATCH: usize = 64;

/// A relaxation time of a member, and that of the referee.
#[derive(Clone, Debug)]
pub struct RefereeRow {
    /// Index of the member.
    pub member: u64,
    /// Which time it is, as its column in `summary.csv`: `t_relax` at a number of nodes, or `t_limit`.
    pub time: &'static str,
    /// Nodes; those of the finest level for a limit.
    pub points: usize,
    /// The time; unknown if the member did not relax.
    pub t: Option<f64>,
    /// Half-width of the 95 % interval of a limit.
    pub t_error: Option<f64>,
    /// Order of the error in 1/n: against the row before, or as the limit observed it.
    pub order: Option<f64>,
    /// The relaxation time by the referee, or why it has none.
    pub truth: std::result::Result<Truth, String>,
}

impl RefereeRow {
    /// Relative error of the time.
    pub fn error(&self) -> Option<f64> {
        Some(self.t? / self.truth.as_ref().ok()?.t - 1.0)
    }

    /// Error of the time in units of its own half-width.
    pub fn bars(&self) -> Option<f64> {
        Some((self.t? - self.truth.as_ref().ok()?.t) / self.t_error?)
    }
}

/// The relaxation of member `index` of `cell` by the referee, in the user's units: the limit n → ∞ of its t_relax.
///
/// ```
/// use curvelax_ensemble::{Spec, Study};
/// use curvelax_study::truth::relaxation_truth;
///
/// let study = Study::new(Spec { amplitude: 0.0.into(), curves: 1, ..Spec::default() })?;
/// assert!((relaxation_truth(&study.cells()[0], 0)?.t - 0.80698218686).abs() < 1e-9);
/// # Ok::<(), curvelax_base::Error>(())
/// ```
///
/// # Errors
/// Those of [`Referee::new`] and [`Referee::time_of_excess`]; outlines, curves that are relaxed at the start, a driving
/// force and constraints are refused.
pub fn relaxation_truth(cell: &Cell, index: u64) -> Result<Truth> {
    let Cell { spec, family, .. } = cell;
    if family.outline(index).is_some() {
        let problem = "the referee solves for curves that have a formula, and an outline is given by points";
        return Err(Error::value("shape", &spec.shape, problem, "use an ellipse or a flower"));
    }
    if let Some(drive) = &spec.drive {
        let problem = "the referee solves for flows without a driving force";
        return Err(Error::value("drive", drive, problem, "leave it out"));
    }
    if let Some(conserved) = spec.conserve {
        let problem = "the referee solves for flows that keep nothing";
        return Err(Error::value("conserve", conserved, problem, "leave it out"));
    }
    let (point, own) = family.curve(index)?;
    let referee = Referee::new(point, &own.unwrap_or_else(|| spec.typical().flow.into_owned()))?;
    let excess = referee.excess();
    let threshold = spec.threshold(excess);
    if excess <= threshold {
        let [excess, threshold] = [excess, threshold].map(|value| significant(value, 3));
        return Err(Error::Request(format!(
            "the curve is relaxed at its start, where its excess is {excess} and the threshold {threshold}; use a smaller \
             --relax-to or --relax-at"
        )));
    }
    let truth = referee.time_of_excess(threshold)?;
    Ok(Truth { t: truth.t / spec.mobility(), ..truth })
}

/// The times of the first member of a spec, without a sweep, at rising numbers of nodes, and its limit; steps and
/// levels of the spec are replaced.
///
/// # Errors
/// Those of [`relaxation_truth`], before anything runs, and of the back end.
pub fn one_curve(spec: &Spec) -> Result<Vec<RefereeRow>> {
    let own = Spec { only: Some(vec![0]), ..spec.clone() };
    let at = |points: usize| Spec { points, adaptive: Some(TOLERANCE), tau: None, refine: false, ..own.clone() };
    let truth = relaxation_truth(&Study::new(own.clone())?.cells()[0], 0)?;
    let mut rows: Vec<RefereeRow> = Vec::new();
    for points in NODES {
        for outcome in outcomes(&Study::new(at(points))?)? {
            let t = outcome.t_relax;
            let mut row = RefereeRow { time: "t_relax", t, t_error: None, ..limit(&outcome, points, Ok(truth)) };
            row.order = rows.last().and_then(|coarse| order(coarse, &row));
            rows.push(row);
        }
    }
    let study = Study::new(Spec { refine: true, ..own })?;
    rows.extend(outcomes(&study)?.iter().map(|outcome| limit(outcome, study.points(), Ok(truth))));
    Ok(rows)
}

/// How the members of a study end.
fn outcomes(study: &Study) -> Result<Vec<Outcome>> {
    let mut ended: Vec<Ended> = Vec::new();
    relax(study, &mut ended)?;
    Ok(ended.into_iter().map(|ended| ended.outcome).collect())
}

fn limit(outcome: &Outcome, points: usize, truth: std::result::Result<Truth, String>) -> RefereeRow {
    let Outcome { member, t_limit: t, t_error, order, .. } = *outcome;
    RefereeRow { member, time: "t_limit", points, t, t_error, order, truth }
}

/// The order at which the error falls between two rows; none where it changes its sign.
fn order(coarse: &RefereeRow, fine: &RefereeRow) -> Option<f64> {
    let ratio = coarse.error()? / fine.error()?;
    let refined = fine.points as f64 / coarse.points as f64;
    (ratio > 0.0 && ratio.is_finite()).then(|| ratio.ln() / refined.ln())
}

/// Limits of all members of a spec, without a sweep; `tell` receives them in batches.
///
/// # Errors
/// Those of [`Study::new`], of the back end, and of `tell`.
pub fn limits(spec: &Spec, mut tell: impl FnMut(&[RefereeRow]) -> Result<()>) -> Result<()> {
    let all: Vec<u64> = spec.members().collect();
    for some in all.chunks(BATCH) {
        let study = Study::new(Spec { refine: true, only: Some(some.to_vec()), ..spec.clone() })?;
        let truth = |i: u32| relaxation_truth(&study.cells()[0], some[i as usize]).map_err(|error| error.to_string());
        let (outcomes, truths) = (outcomes(&study)?, threads::map(some.len() as u32, truth));
        let rows = outcomes.iter().zip(truths).map(|(outcome, truth)| limit(outcome, study.points(), truth));
        tell(&rows.collect::<Vec<_>>())?;
    }
    Ok(())
}
