//! Levels: members computed once more at coarser resolutions and with more exact steps, from which the error of their
//! relaxation times follows.
//!
//! The members of a level are those of a cell, with the same random numbers; they run before the cell does. With
//! `--refine` all members run at all levels, and each gets its [limit](curvelax_statistics::Limit). Otherwise a few of
//! them do, the pilot, and tell the error of a typical member.

use serde::{Deserialize, Serialize};

use crate::{
    Outcome, Spec, Status,
    request::spec::{BackendChoice, DEFAULT_RELAX_TO, FinalTime, Order, Pace, Precision, SolverChoice, Sor, Store},
    request::validate::tightest_adaptive,
};
use curvelax_base::error::Result;
use curvelax_flow::solver::Solver;
use curvelax_statistics::{Limit, Times};

/// Members of a cell in the pilot, and the share of a small cell that is.
const PILOT: u64 = 16;
const PILOT_SHARE: u64 = 16;
/// Nodes above which a single member takes so long that there is a pilot only if it is asked for, by `--refine`.
const MAX_PILOT_POINTS: usize = 10_000;
/// How much more exact the steps of a level are.
const FINER: f64 = 10.0;
/// How much later a level ends, and the latest time at all.
const LONGER: f64 = 2.0;
const LATEST: f64 = 1e300;
/// Tolerance of the steps of a level beside fixed ones.
const EXACT: f64 = 1e-4;
/// Bound on [`depth`]: no excess is resolved further below the default threshold.
const MOST_DEPTH: f64 = 1e3;

/// A resolution at which members run besides their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum RefinementLevel {
    /// Half the nodes.
    Half,
    /// Nodes between half and all, n/√2.
    Between,
    /// As many nodes.
    Full,
}

impl RefinementLevel {
    /// All levels, in the order in which they run.
    pub const ALL: [RefinementLevel; 3] = [RefinementLevel::Half, RefinementLevel::Between, RefinementLevel::Full];

    /// Its number in `levels.csv`, from 1.
    pub fn number(self) -> u64 {
        self as u64 + 1
    }

    /// Nodes, where a member has `n`.
    pub fn points(self, n: usize) -> usize {
        match self {
            RefinementLevel::Half => n / 2,
            RefinementLevel::Between => (n as f64 / std::f64::consts::SQRT_2).round() as usize,
            RefinementLevel::Full => n,
        }
    }

    /// The spec of the cell at this level: the same members, or those of the pilot, to their relaxation.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if members of so few nodes cannot run.
    pub fn spec(self, of: &Spec) -> Result<Spec> {
        let mut spec = Spec {
            points: self.points(of.points),
            adaptive: Some(tolerance(of)),
            tau: None,
            // A member that relaxes just in time needs longer where nodes are few.
            t_end: Some(FinalTime::At((LONGER * of.final_time()).min(LATEST))),
            // What may happen after it is also judged.
            stop_when_relaxed: Some(of.event.is_empty() || of.stops_when_relaxed()),
            series: None,
            snapshots: Vec::new(),
            store: Store::Csv,
            refine: false,
            accuracy: None,
            ..of.clone()
        };
        if !of.refine {
            // A few members do not fill a GPU, and f32 has errors of its own.
            spec.only = Some(of.first_members(pilot(of)));
            (spec.backend, spec.adapter, spec.precision) = (BackendChoice::Cpu, None, Some(Precision::F64));
        }
        if let Pace::Fixed(_) = of.pace() {
            // ω as it is: it has a part in the error of n.
            spec.omega = Some(of.omega());
            (spec.solver, spec.order) = (SolverChoice::Only(Solver::Direct), Order::Coloured);
            (spec.tolerance, spec.sor, spec.max_sweeps) = (None, Sor::Factor(1.0), Spec::default().max_sweeps);
        }
        let Spec { only, shard, .. } = spec.clone();
        let spec = Spec { only: None, shard: None, ..spec }.validate()?;
        Ok(Spec { only, shard, ..spec })
    }
}

/// Tolerance of the steps at all levels of a cell of `spec`.
fn tolerance(spec: &Spec) -> f64 {
    match spec.pace() {
        Pace::Adaptive(tolerance) => (tolerance / FINER).max(tightest_adaptive(Precision::F64)),
        Pace::Fixed(_) => EXACT,
    }
}

/// How much larger the error of a time is than with the default threshold: steps follow the amplitude of the shape, the
/// root of the excess, to a tolerance relative to the mean of that and of the curvature. Adaptive steps show it by
/// themselves, when their tolerance changes.
fn depth(spec: &Spec, excess: f64) -> f64 {
    let share = spec.threshold(excess) / excess;
    (DEFAULT_RELAX_TO / share).sqrt().sqrt().clamp(1.0, MOST_DEPTH)
}

/// Members of the pilot of a cell.
fn pilot(spec: &Spec) -> u64 {
    let all = spec.only.as_ref().map_or(spec.members_per_cell(), |only| only.len() as u64);
    if spec.points > MAX_PILOT_POINTS { 0 } else { all.div_ceil(PILOT_SHARE).min(PILOT) }
}

/// A row of `levels.csv`: a member at a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelRow {
    /// Index of the member.
    pub member: u64,
    /// Number of the level.
    pub level: u64,
    /// Index of the cell.
    pub cell: u64,
    /// Nodes.
    pub points: u64,
    /// Tolerance of adaptive steps.
    pub adaptive: Option<f64>,
    /// How it ended.
    pub status: Status,
    /// Its relaxation time.
    pub t_relax: Option<f64>,
    /// Steps of the paper's scheme that were computed.
    pub solves: u64,
    /// The times of its events, in the order of the spec: the rows of `event_levels.csv`.
    pub events: Vec<Option<f64>>,
}

impl LevelRow {
    /// The row of a member that ended at `level` in `cell`.
    pub fn new(level: RefinementLevel, cell: &Spec, ended: &Outcome) -> LevelRow {
        let Outcome { member, cell: index, status, t_relax, solves, .. } = *ended;
        let events = ended.events.clone();
        let (points, adaptive) = (cell.points as u64, cell.adaptive);
        LevelRow { member, level: level.number(), cell: index, points, adaptive, status, t_relax, solves, events }
    }
}

/// The relaxation times of members at all levels.
#[derive(Clone, Debug, Default)]
pub struct LevelTimes {
    /// By level: members, ascending, each with its time, NaN if it has none.
    times: [Vec<(u64, f64)>; RefinementLevel::ALL.len()],
    /// By level: those of all events of one member after those of another, NaN likewise.
    events: [Vec<f64>; RefinementLevel::ALL.len()],
}

impl LevelTimes {
    /// Adds a row; members of a level ascend.
    ///
    /// # Errors
    /// A message if there is no such level, or the member does not follow the one before.
    pub fn add(&mut self, row: &LevelRow) -> Result<(), String> {
        let own = row.level.checked_sub(1).and_then(|rank| self.times.get_mut(rank as usize));
        let own = own.ok_or_else(|| format!("a level from 1 to {}", RefinementLevel::ALL.len()))?;
        if let Some((last, _)) = own.last().filter(|(last, _)| *last >= row.member) {
            return Err(format!("a member after {last}: members of a level ascend, each once"));
        }
        own.push((row.member, row.t_relax.unwrap_or(f64::NAN)));
        self.events[row.level as usize - 1].extend(row.events.iter().map(|t| t.unwrap_or(f64::NAN)));
        Ok(())
    }

    /// Number of rows.
    pub fn rows(&self) -> u64 {
        self.times.iter().map(|times| times.len() as u64).sum()
    }

    /// Whether `member` ran at them.
    pub fn has(&self, member: u64) -> bool {
        self.place(RefinementLevel::Full, member).is_some()
    }

    fn place(&self, level: RefinementLevel, member: u64) -> Option<usize> {
        self.times[level as usize].binary_search_by_key(&member, |(member, _)| *member).ok()
    }

    fn time(&self, level: RefinementLevel, member: u64) -> Option<f64> {
        Some(self.times[level as usize][self.place(level, member)?].1).filter(|t| t.is_finite())
    }

    /// The time of the event at `place` among `count` of a member.
    fn event_time(&self, level: RefinementLevel, member: u64, [place, count]: [usize; 2]) -> Option<f64> {
        let at = self.place(level, member)? * count + place;
        self.events[level as usize].get(at).copied().filter(|t| t.is_finite())
    }

    /// Completes the row of a member of a cell of `spec` that ran at its own resolution: the errors of its times, if it
    /// ran at the levels, and with `--refine` the limit of its relaxation time.
    pub fn judge(&self, spec: &Spec, outcome: &mut Outcome) {
        let (member, excess) = (outcome.member, outcome.start.excess);
        let points = RefinementLevel::ALL.map(|level| level.points(spec.points));
        let is_adaptive = matches!(spec.pace(), Pace::Adaptive(_));
        let limit = |own: Option<f64>, at: &dyn Fn(RefinementLevel) -> Option<f64>| {
            let own = own?;
            let levels = [at(RefinementLevel::Half)?, at(RefinementLevel::Between)?, at(RefinementLevel::Full)?];
            // What holds at the start has no time to judge.
            let has_times = own > 0.0 && levels.iter().all(|t| *t > 0.0);
            let tolerance = || tolerance(spec) * if is_adaptive { 1.0 } else { depth(spec, excess) };
            has_times.then(|| Limit::of(&Times { own, levels, points, tolerance: tolerance(), is_adaptive }))
        };
        let count = outcome.events.len();
        let of_event =
            |(place, own): (usize, &Option<f64>)| limit(*own, &|level| self.event_time(level, member, [place, count]));
        outcome.judged_events = outcome.events.iter().enumerate().map(of_event).collect();
        let Some(limit) = limit(outcome.t_relax, &|level| self.time(level, member)) else { return };
        outcome.judged = Some(limit);
        if spec.refine {
            let Limit { t, error, order, .. } = limit;
            (outcome.t_limit, outcome.t_error, outcome.order) = (Some(t), Some(error), order);
        }
    }
}
