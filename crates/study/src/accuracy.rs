//! `--accuracy`: the number of nodes, the tolerance and the number of members that reach a given uncertainty, found in
//! rounds.
//!
//! A round runs the whole study, without its shards, in memory and on the CPU, so that the choice is the same on every
//! machine. Its uncertainty has two parts: sampling falls like 1/√members, discretisation with n. The last choice is
//! extrapolated from a round of at least an eighth as many members.

use std::fmt;

use crate::{
    relax::relax,
    results::{EnsembleStatistics, cells::CellStatistics, tally::Tally},
};
use curvelax_base::{
    error::{Error, Result},
    text::{number, plural, rounded},
};
use curvelax_ensemble::{Ended, LevelTimes, Sink, Spec, Study, request::spec::BackendChoice};

/// Share of the goal for discretisation, and that for sampling which is aimed at: the rest is for what a round of fewer
/// members does not know.
const DISCRETISATION: f64 = 0.2;
const SAMPLING: f64 = 0.7;
/// Members above which a goal is refused, and nodes.
const MAX_MEMBERS: f64 = 1e6;
const MAX_NODES: usize = 1600;
/// Largest ratio of members to those of the round that they are extrapolated from, and of rounds to each other.
const FARTHEST: f64 = 8.0;
/// Largest share of members that may not converge yet.
const UNRULY: f64 = 0.05;
/// The error of a limit goes with this power of n.
const ORDER: f64 = 4.0;
/// Largest growth of n between rounds.
const MAX_FINER: f64 = 2.0;
/// Fewest members of a round, unless all are the same.
const MIN_MEMBERS: u64 = 16;
/// Uncertainties below this are rounding.
const ROUNDING: f64 = 1e-12;
/// More rounds mean that the uncertainty does not fall.
const MAX_ROUNDS: usize = 12;

/// A round: what was run, and the cell that is farthest from the goal.
pub struct Round {
    /// Its number, from 1.
    number: usize,
    /// Members of each cell.
    members: u64,
    /// Nodes.
    points: usize,
    /// Tolerance of the steps.
    tolerance: Option<f64>,
    /// Median limit.
    median: f64,
    /// Half-width of its 95 % interval relative to it, from sampling alone.
    sampling: f64,
    /// Half-width for discretisation.
    discretisation: f64,
    /// Share of the members whose times do not yet converge.
    unruly: f64,
}

impl Round {
    /// Members for which sampling has its share of the goal.
    fn needed(&self, goal: f64) -> f64 {
        (self.members as f64 * (self.sampling / (SAMPLING * goal)).powi(2)).ceil()
    }

    /// Whether its median is that of the same members with fewer nodes, as far as their errors allow.
    fn agrees_with(&self, coarse: &Round, goal: f64) -> bool {
        let apart = (self.median / coarse.median - 1.0).abs();
        apart <= (self.discretisation + coarse.discretisation).max(0.5 * DISCRETISATION * goal)
    }
}

impl fmt::Display for Round {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Round { number, members, points, tolerance, median, sampling, discretisation, .. } = self;
        let [median, sampling, discretisation] = [*median, *sampling, *discretisation].map(|value| rounded(value, 3));
        let tolerance = tolerance.map_or(String::new(), |tolerance| format!(", tolerance {}", rounded(tolerance, 2)));
        write!(
            f,
            "round {number}: {members} {} of n = {points}{tolerance}: median {median}, relative \
             uncertainty {sampling} by sampling and {discretisation} by discretisation",
            plural(*members, "member")
        )
    }
}

/// Collects the statistics of a round, unless it is asked to stop.
struct RoundSums<'a> {
    tally: Tally,
    stopped: &'a dyn Fn() -> Option<Error>,
}

impl Sink for RoundSums<'_> {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.tally.add(&ended.outcome)
    }

    fn progress(&mut self, _: u64, _: u64, _: f64) -> Result<()> {
        (self.stopped)().map_or(Ok(()), Err)
    }
}

/// Returns `spec` with the nodes, tolerance and members that reach its goal, if it has one; `tell` hears of every round,
/// and an error of `stopped` ends them. The numbers of `spec` are those of the first round, and the least that are
/// chosen.
///
/// # Errors
/// [`Error::Request`] for a goal that needs more members or nodes than this program would run, or that cannot be judged,
/// with what was reached; and that of `stopped`.
pub fn plan(spec: Spec, mut tell: impl FnMut(&Round), stopped: impl Fn() -> Option<Error>) -> Result<Spec> {
    let Some(goal) = spec.accuracy else { return Ok(spec) };
    let mut spec = spec.validate()?;
    if spec.has_different_members() {
        spec.curves = spec.curves.max(MIN_MEMBERS);
    }
    let refuse = |problem: &str, remedy: &str| Err(Error::value("accuracy", number(goal), problem, remedy));
    // The round with fewer nodes, whose error is to be confirmed by one with more.
    let mut before: Option<(Spec, Round)> = None;
    for count in 1..=MAX_ROUNDS {
        let round = Round { number: count, ..round(&spec, &stopped)? };
        tell(&round);
        let reached = rounded(round.discretisation, 2);
        if round.discretisation > DISCRETISATION * goal || round.unruly > UNRULY {
            if spec.points >= MAX_NODES {
                if round.unruly > UNRULY {
                    let percent = rounded(100.0 * round.unruly, 2);
                    let problem =
                        format!("at n = {}, the times of {percent} % of the members do not converge", spec.points);
                    return refuse(&problem, "begin with fewer --points, or use a smoother curve");
                }
                let problem = format!("at n = {} the uncertainty of discretisation is still {reached}", spec.points);
                return refuse(&problem, "use a larger number");
            }
            (spec, before) = (finer(spec, &round, goal)?, None);
            continue;
        }
        let confirmed = before.take().filter(|(_, coarse)| round.agrees_with(coarse, goal));
        let Some((chosen, coarse)) = confirmed else {
            let points = (spec.points as f64 * std::f64::consts::SQRT_2).round() as usize;
            let next = Spec { points, ..spec.clone() }.validate()?;
            before = Some((std::mem::replace(&mut spec, next), round));
            continue;
        };
        return members(chosen, coarse, goal, |number, spec| {
            let round = Round { number: count + number, ..self::round(spec, &stopped)? };
            tell(&round);
            Ok(round)
        });
    }
    refuse(&format!("not reached in {MAX_ROUNDS} rounds"), "use a larger number, or more --points")
}

/// The spec with as many members as `goal` needs, where `judged` says how far its first ones reach. The need is estimated,
/// so it is not believed far beyond the members that are judged: `judge` judges more of the same.
fn members(
    mut spec: Spec,
    mut judged: Round,
    goal: f64,
    mut judge: impl FnMut(usize, &Spec) -> Result<Round>,
) -> Result<Spec> {
    for further in 1.. {
        let (needed, farthest) = (judged.needed(goal), FARTHEST * judged.members as f64);
        if needed > MAX_MEMBERS {
            let problem = format!(
                "it needs about {needed:.1e} members in each cell, and more than {MAX_MEMBERS:.0e} is too many"
            );
            let reached = rounded(judged.sampling + judged.discretisation, 2);
            let remedy = format!("{reached} was reached with {}; use a larger number", judged.members);
            return Err(Error::value("accuracy", number(goal), &problem, &remedy));
        }
        spec.curves = spec.curves.max(needed.min(farthest) as u64);
        if needed <= farthest {
            break;
        }
        judged = judge(further, &spec)?;
    }
    Ok(spec)
}

/// The spec with more nodes and shorter steps, so that discretisation comes down to its share of the goal.
fn finer(spec: Spec, round: &Round, goal: f64) -> Result<Spec> {
    let wanted = round.discretisation / (0.5 * DISCRETISATION * goal);
    let factor = wanted.powf(1.0 / ORDER).clamp(std::f64::consts::SQRT_2, MAX_FINER);
    let points = ((spec.points as f64 * factor).ceil() as usize).min(MAX_NODES);
    let adaptive = spec.adaptive.map(|tolerance| (0.1 * tolerance).max(1e-6).min(tolerance));
    Spec { points, adaptive, ..spec }.validate()
}

/// Runs the study, and returns the cell that is farthest from its limit.
fn round(spec: &Spec, stopped: &dyn Fn() -> Option<Error>) -> Result<Round> {
    let here = Spec { backend: BackendChoice::Cpu, adapter: None, shard: None, accuracy: None, ..spec.clone() };
    let here = Spec { series: None, snapshots: Vec::new(), store: Spec::default().store, ..here };
    let study = Study::new(here)?;
    if study.spec().outlines.is_some() {
        let goal = number(spec.accuracy.unwrap_or_default());
        let problem = "it chooses the number of members, and outlines are as many as they are";
        return Err(Error::value("accuracy", goal, problem, "use --accurate alone"));
    }
    let mut sums = RoundSums { tally: Tally::of(study.spec(), &LevelTimes::default()), stopped };
    relax(&study, &mut sums)?;
    let statistics = EnsembleStatistics::new(study.spec(), &mut sums.tally)?;
    let rounds = statistics.cells.iter().map(|cell| of_cell(spec, cell)).collect::<Result<Vec<_>>>()?;
    let width = |round: &Round| round.sampling + round.discretisation;
    let worst = rounds.into_iter().max_by(|one, other| width(one).total_cmp(&width(other)));
    worst.ok_or_else(|| Error::Failed("a study has no cell".into()))
}

fn of_cell(spec: &Spec, cell: &CellStatistics) -> Result<Round> {
    let limits = cell.limits.as_ref();
    let found = limits.and_then(|of| Some((of.median?, of.uncertainty()?, of.error?)));
    let refuse = |problem: &str, remedy: &str| {
        Err(Error::value("accuracy", number(spec.accuracy.unwrap_or_default()), problem, remedy))
    };
    if cell.median() == Some(0.0) {
        return refuse(
            "at least half of the members are relaxed at the start",
            "use a larger --amplitude, or another --shape",
        );
    }
    let Some((median, total, error)) = found else {
        let problem = format!(
            "{} of {} members relaxed, too few for a median with an interval",
            cell.times.sample.events(),
            spec.curves
        );
        return refuse(&problem, "use more --curves or a longer --t-end, or a curve that relaxes");
    };
    let discretisation = error / median;
    let unruly = cell.discretisation.as_ref().map_or(0.0, |of| of.not_asymptotic as f64 / of.members.max(1) as f64);
    Ok(Round {
        number: 0,
        members: spec.curves,
        points: spec.points,
        tolerance: spec.adaptive,
        median,
        sampling: Some(total - discretisation).filter(|sampling| *sampling > ROUNDING).unwrap_or(0.0),
        discretisation,
        unruly,
    })
}
