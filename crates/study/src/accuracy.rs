//! `--accuracy`: the number of nodes, the tolerance and the number of members that reach a given uncertainty, found in
//! rounds.
//!
//! A round runs the study, without its shards, in memory and on the CPU, so that the choice is the same on every
//! machine. The uncertainty of a median has two parts: sampling falls like 1/√members, discretisation with n. First
//! rounds find n and the tolerance, with limits of all members ([`Limit`](curvelax_statistics::Limit): its time and its
//! error). Then rounds without levels, at a fifth of the work, find the number of members: their times are spread like
//! the limits.
//!
//! The numbers of outlines are given. What is asked for is then the error of each member.
//!
//! The first round that is good enough ends the search. If none is, the best one is what the run repeats.

use std::fmt;

use crate::{
    relax::relax,
    results::{EnsembleStatistics, cells::CellStatistics, shortfall::needed, tally::Tally},
};
use curvelax_base::{
    error::{Error, Result},
    text::{count, rounded},
};
use curvelax_ensemble::{Ended, LevelTimes, Sink, Spec, Study, request::spec::BackendChoice};

/// Share of the goal for discretisation, where sampling needs the rest.
const DISCRETISATION: f64 = 0.1;
/// What sampling leaves to the difference between times and their limits, in errors of discretisation, and at most in
/// shares of the goal: in 14 ensembles of 330 to 3082 ellipses the interval of limits was wider by -0.1 to 3.4 of them.
const SPARE: [f64; 2] = [3.0, 0.1];
/// Members of a cell above which no round is run, and nodes.
const MAX_MEMBERS: f64 = 1e6;
const MAX_NODES: usize = 1600;
/// The error of a limit goes with this power of n.
const ORDER: f64 = 4.0;
/// Bounds of the growth of n between rounds, and of that of the members.
const FINER: [f64; 2] = [std::f64::consts::SQRT_2, 2.0];
const MORE: [f64; 2] = [1.05, 8.0];
/// An estimated number of members is believed if it is within the first factor of those that gave it; else this share
/// of it.
const NEAR: f64 = 1.2;
const CAUTION: f64 = 0.6;
/// The least tolerance, in shares of what discretisation may have.
const TOLERANCE: f64 = 2.0;
/// Fewest members of a round, unless all are the same or their number is given.
const MIN_MEMBERS: u64 = 16;
/// More nodes are of no use once they left more than this share of the error so many times.
const LEFT: f64 = 0.8;
const MAX_IDLE: usize = 2;
/// Rounds in which the members of a cell may grow.
const MAX_ROUNDS: usize = 24;

/// A round: what was run, and the cell that is farthest from the goal.
pub struct Round {
    /// Its number, from 1.
    number: usize,
    /// Members of all cells.
    members: u64,
    /// Nodes.
    points: usize,
    /// Tolerance of the steps.
    tolerance: Option<f64>,
    /// What is known of the farthest cell; none if a cell has no interval.
    found: Option<Uncertainty>,
}

/// Relative half-width of the interval of the times of a cell, and the part of it that is there without sampling.
#[derive(Clone, Copy)]
struct Uncertainty {
    of: Uncertain,
    all: f64,
    discretisation: f64,
}

/// What an interval is that of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Uncertain {
    /// The limit of each member, or of most.
    Each,
    /// The median of the limits.
    Median,
    /// The median of the times, by sampling alone.
    Sampled,
}

impl fmt::Display for Round {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Round { number, points, tolerance, found, .. } = self;
        let tolerance = tolerance.map_or(String::new(), |tolerance| format!(", tolerance {}", rounded(tolerance, 2)));
        write!(f, "round {number}: {} at n = {points}{tolerance}: ", count(self.members, "member"))?;
        let Some(Uncertainty { of, all, discretisation }) = *found else {
            return write!(f, "the median has no interval");
        };
        let (all, discretisation) = (rounded(all, 2), rounded(discretisation, 2));
        match of {
            Uncertain::Each => write!(f, "the relative error of each time is {all}"),
            Uncertain::Median => {
                write!(f, "the relative uncertainty of the median is {all} (that of discretisation {discretisation})")
            }
            Uncertain::Sampled => write!(f, "the relative uncertainty of the median is {all} (sampling alone)"),
        }
    }
}

/// Returns `spec` with the nodes, tolerance and members that reach its goal, if it has one, or else that come nearest
/// to it; `tell` receives every round, and an error of `stopped` ends them. The numbers of `spec` are those of the
/// first round, and the least that are chosen.
///
/// # Errors
/// Those of the study, and that of `stopped`.
pub fn plan(spec: Spec, mut tell: impl FnMut(&Round), stopped: impl Fn() -> Option<Error>) -> Result<Spec> {
    let Some(goal) = spec.accuracy else { return Ok(spec) };
    let mut spec = spec.validate()?;
    // The rounds have no goal: what it forbids is refused here.
    let of_each = Study::new(spec.clone())?.spec().outlines.is_some();
    if !of_each && spec.has_different_members() {
        spec.curves = spec.curves.max(MIN_MEMBERS);
    }
    let mut search = Search { goal, rounds: 0, tell: &mut tell, stopped: &stopped };
    let (spec, cells) = search.nodes(spec)?;
    if of_each { Ok(spec) } else { search.members(spec, &cells) }
}

/// A search for the goal.
struct Search<'a> {
    goal: f64,
    rounds: usize,
    tell: &'a mut dyn FnMut(&Round),
    stopped: &'a dyn Fn() -> Option<Error>,
}

/// Statistics of a round.
type Cells = Vec<CellStatistics>;

impl Search<'_> {
    /// The spec with as many nodes and as short steps as the goal needs, and its round; that with the smallest error if
    /// none has them.
    fn nodes(&mut self, mut spec: Spec) -> Result<(Spec, Cells)> {
        let mut best: Option<(f64, Spec, Cells)> = None;
        let mut idle = 0;
        loop {
            let (cells, found) = match self.refined(&spec) {
                Ok(round) => round,
                Err(error) => match (error, best) {
                    // The device has no room for so many nodes, or too few digits.
                    (Error::Request(_), Some((_, best, cells))) => return Ok((best, cells)),
                    (error, _) => return Err(error),
                },
            };
            // Without an interval more nodes do not help, either.
            let Some(found) = found else { return Ok(best.map_or((spec, cells), |(_, spec, cells)| (spec, cells))) };
            if found.all <= self.goal {
                return Ok((spec, cells));
            }
            let (allowed, is_beyond) = match found.of {
                Uncertain::Each => (self.goal, false),
                _ => (DISCRETISATION * self.goal, self.is_beyond(&cells)),
            };
            let (error, points) = (found.discretisation, spec.points);
            let is_enough = error <= allowed || is_beyond;
            let better = best.as_ref().is_none_or(|(best, ..)| error < *best);
            idle = if best.as_ref().is_none_or(|(best, ..)| error < LEFT * best) { 0 } else { idle + 1 };
            if better {
                best = Some((error, spec.clone(), cells));
            }
            match best {
                Some((_, best, cells)) if is_enough || idle >= MAX_IDLE || points >= MAX_NODES => {
                    return Ok((best, cells));
                }
                _ => spec = finer(spec, error / allowed, allowed)?,
            }
        }
    }

    /// Whether sampling needs more members than are run.
    fn is_beyond(&self, cells: &[CellStatistics]) -> bool {
        self.needed(cells, &vec![0.0; cells.len()]).is_some_and(|needed| needed > MAX_MEMBERS)
    }

    /// Members of a cell for which sampling is at most what the discretisation of each cell leaves of the goal.
    fn needed(&self, cells: &[CellStatistics], discretisation: &[f64]) -> Option<f64> {
        let needed = cells.iter().zip(discretisation).map(|(cell, part)| needed(cell, self.left(*part)));
        needed.collect::<Option<Vec<_>>>()?.into_iter().reduce(f64::max)
    }

    /// What is left of the goal for sampling, beside this part of discretisation.
    fn left(&self, discretisation: f64) -> f64 {
        let [errors, share] = SPARE;
        self.goal - discretisation - (errors * discretisation).min(share * self.goal)
    }

    /// The spec with as many members as the goal needs, after the round of its limits.
    fn members(&mut self, mut spec: Spec, refined: &[CellStatistics]) -> Result<Spec> {
        let parts: Option<Vec<(f64, f64)>> = refined.iter().map(|cell| cell.uncertainty(false)).collect();
        let Some(parts) = parts else { return Ok(spec) };
        let discretisation: Vec<f64> = parts.iter().map(|(_, part)| *part).collect();
        if parts.iter().all(|(all, _)| *all <= self.goal) || !spec.has_different_members() {
            return Ok(spec);
        }
        let mut needed = self.needed(refined, &discretisation);
        let mut sums = None;
        for _ in 0..MAX_ROUNDS {
            let Some(members) = needed.filter(|needed| *needed <= MAX_MEMBERS) else { break };
            let [least, most] = MORE.map(|factor| (factor * spec.curves as f64).ceil());
            let near = (NEAR * spec.curves as f64).max(CAUTION * members).ceil();
            spec.curves = members.min(near).clamp(least, most) as u64;
            let cells = self.sampled(&spec, &mut sums)?;
            let is_enough = |(cell, part): (_, &f64)| half_width(cell).is_some_and(|width| width <= self.left(*part));
            if cells.iter().zip(&discretisation).all(is_enough) {
                break;
            }
            needed = self.needed(&cells, &discretisation);
        }
        Ok(spec)
    }

    /// A round with limits: its statistics, and the farthest cell.
    fn refined(&mut self, spec: &Spec) -> Result<(Cells, Option<Uncertainty>)> {
        let study = quiet(spec, true)?;
        let statistics = self.run(&study, Tally::of(study.spec(), &LevelTimes::default()))?.0;
        let cells = statistics.cells.iter().map(|cell| cell.uncertainty(statistics.of_each));
        let farthest = |cells: Vec<(f64, f64)>| cells.into_iter().max_by(|one, other| one.0.total_cmp(&other.0));
        let of = if statistics.of_each { Uncertain::Each } else { Uncertain::Median };
        let found = cells.collect::<Option<Vec<_>>>().and_then(farthest);
        let found = found.map(|(all, discretisation)| Uncertainty { of, all, discretisation });
        self.report(spec, &study, found);
        Ok((statistics.cells, found))
    }

    /// A round of times alone. Where a member does not depend on how many there are, those of the last round are in
    /// `sums` and are not run again.
    fn sampled(&mut self, spec: &Spec, sums: &mut Option<(u64, Tally)>) -> Result<Cells> {
        let mut study = quiet(spec, false)?;
        let is_alone = study.spec().sweep.cells() == 1 && study.spec().design.is_random();
        let (from, tally) = sums.take().unwrap_or_else(|| (0, Tally::of(study.spec(), &LevelTimes::default())));
        if from > 0 {
            study = quiet(&Spec { only: Some((from..spec.curves).collect()), ..spec.clone() }, false)?;
        }
        let (statistics, tally) = self.run(&study, tally)?;
        *sums = is_alone.then_some((spec.curves, tally));
        let widths: Option<Vec<f64>> = statistics.cells.iter().map(half_width).collect();
        let widest = widths.and_then(|all| all.into_iter().reduce(f64::max));
        let found = |all| Uncertainty { of: Uncertain::Sampled, all, discretisation: 0.0 };
        self.report(spec, &study, widest.map(found));
        Ok(statistics.cells)
    }

    fn report(&mut self, spec: &Spec, study: &Study, found: Option<Uncertainty>) {
        self.rounds += 1;
        let Spec { points, adaptive: tolerance, .. } = *spec;
        let members = Spec { only: None, ..study.spec().clone() }.all_members();
        (self.tell)(&Round { number: self.rounds, members, points, tolerance, found });
    }

    /// Adds the members of a study to `tally`.
    fn run(&self, study: &Study, tally: Tally) -> Result<(EnsembleStatistics, Tally)> {
        let mut sums = RoundSums { tally, stopped: self.stopped };
        relax(study, &mut sums)?;
        let tally = sums.tally.clone();
        Ok((EnsembleStatistics::new(study.spec(), &mut sums.tally)?, tally))
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

/// The study of a round, with limits if it is to be `refined`.
fn quiet(spec: &Spec, refined: bool) -> Result<Study> {
    let here = Spec { backend: BackendChoice::Cpu, adapter: None, shard: None, accuracy: None, ..spec.clone() };
    let here = Spec { series: None, snapshots: Vec::new(), store: Spec::default().store, ..here };
    Study::new(Spec { refine: refined, ..here })
}

/// Half-width of the interval of the median time of a cell, relative to it.
fn half_width(cell: &CellStatistics) -> Option<f64> {
    let times = &cell.relaxing.times;
    times.half_width(times.interval()?.bounds()?).filter(|width| width.is_finite())
}

/// The spec with more nodes and shorter steps, so that an error that is so many times as large as `allowed` comes down
/// to it.
fn finer(spec: Spec, times: f64, allowed: f64) -> Result<Spec> {
    let [least, most] = FINER;
    let factor = (2.0 * times).powf(1.0 / ORDER).clamp(least, most);
    let points = ((spec.points as f64 * factor).ceil() as usize).min(MAX_NODES);
    let adaptive = spec.adaptive.map(|tolerance| (0.1 * tolerance).max(TOLERANCE * allowed).max(1e-6).min(tolerance));
    Spec { points, adaptive, ..spec }.validate()
}
