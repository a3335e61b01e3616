//! Running totals over members, for the overview and `run.json`; the members themselves are not stored.

mod warnings;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    remedies::Remedies,
    treatment::{FinerMembers, MollifiedMembers},
};
use curvelax_base::error::Result;
use curvelax_ensemble::{
    LevelTimes, Mollified, Outcome, Spec, Status,
    request::{MAX_NAMED, sweep::Sweep},
    schedule::grid,
};
use curvelax_statistics::{Limit, Observation, Observations, Spread};

/// Counts and sums over the members that ended.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// By cell.
    pub cells: Vec<CellTally>,
    /// By cell and group, if outlines are grouped.
    pub groups: BTreeMap<(u64, String), CellTally>,
    /// Total steps of all members.
    pub steps: u64,
    /// Total steps of the paper's scheme that were computed, also in refused adaptive steps.
    pub solves: u64,
    /// Total sweeps on curvature systems.
    pub sweeps_k: u64,
    /// Total sweeps on position systems.
    pub sweeps_x: u64,
    /// Names of the events of the spec.
    pub events: Vec<String>,
    /// For each of them, the members in which it holds from the start.
    pub at_start: Vec<u64>,
    /// How members are counted.
    counted: Counted,
    /// By cell: whether its members are vesicles; empty if none are.
    vesicles: Vec<bool>,
    /// What helps those that failed.
    remedies: Remedies,
    /// What distinguishes the cells.
    sweep: Sweep,
    /// Rows of the levels.
    pub levels: u64,
    /// Of the members with limits, those whose times needed more nodes than they have.
    pub nodes: FinerMembers,
    /// What is in no row of the summary.
    pub supplement: TallySupplement,
    /// Members of outlines whose points leave more than [`OPEN_BY_POINTS`] of the limit open, and the largest share.
    coarse: (u64, f64),
    /// Whether corners are those of outlines.
    has_outlines: bool,
    /// Longest over shortest edge of each member at its end, for a picture.
    pub mesh_ratios: Vec<f32>,
    /// Metric drift of each member at its end, for a picture.
    pub metric_drifts: Vec<f32>,
    /// The first members of each cell, ascending; of their events those that have a limit are at it.
    pub named: Vec<Outcome>,
}

/// Members that are known by name over all cells; of each cell they are as many as may be shown one by one.
const MAX_KNOWN: usize = 2000;

/// The time of a member that is shown: the limit, if there is one, with its error.
pub fn shown_time(of: &Outcome) -> Option<(f64, Option<f64>)> {
    of.t_limit.map(|t| (t, of.t_error)).or(of.t_relax.map(|t| (t, None)))
}

/// Decay rate of a member.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// As fitted, in length⁻⁴.
    pub fitted: f64,
    /// NaN if theory predicts none.
    theory: f64,
}

impl Rate {
    /// The prediction of linear theory, if there is one.
    pub fn theory(&self) -> Option<f64> {
        Some(self.theory).filter(|theory| theory.is_finite())
    }

    /// Ratio to theory, if it is a number: areas at the ends of the range of floats, which a table may contain, have
    /// none.
    pub fn ratio(&self) -> Option<f64> {
        self.theory().map(|theory| self.fitted / theory).filter(|ratio| ratio.is_finite())
    }
}

/// Totals over the members of one cell.
#[derive(Clone, Debug, Default)]
pub struct CellTally {
    /// Members, by status in the order of [`Status::ALL`].
    pub counts: [u64; Status::ALL.len()],
    /// Times at which members relaxed, or up to which they had not: 0 for a vesicle that is not at rest at its end, of
    /// which nothing is known.
    pub relaxing: EventTally,
    /// Such vesicles.
    moving: u64,
    /// Members that have not relaxed, by status.
    pub others: [u64; Status::ALL.len()],
    /// Simple curves whose final time came before they relaxed.
    late: u64,
    /// Sum of the initial areas.
    pub area: f64,
    /// Rates of the members that have one.
    pub rates: Vec<Rate>,
    /// By event, in the order of the spec.
    pub events: Vec<EventTally>,
    /// Times at which members vanished, of driven ones.
    pub vanishing: EventTally,
}

/// Totals over the members of one cell, for one kind of time: that of relaxation, of an event, or of vanishing.
#[derive(Clone, Debug, Default)]
pub struct EventTally {
    /// Times at which it happened, or up to which it had not.
    pub times: Observations,
    /// Their limits, of the members that have one; censored like the times for the others.
    pub limits: Observations,
    /// What the levels tell of these times, for the members that ran at them.
    pub judged: Vec<Limit>,
    /// Members that were stopped when they relaxed, before the event.
    pub stopped: u64,
    /// Members in which it happened.
    reached: u64,
    /// Those of them that have no limit of the time, although one was asked for.
    without_limit: u64,
}

/// What decides on how members are counted.
#[derive(Clone, Copy, Debug, Default)]
struct Counted {
    /// Whether members are to have limits.
    refined: bool,
    /// Whether members end when they are relaxed.
    stops: bool,
    /// Whether a driving force may make members vanish.
    driven: bool,
    /// Whether these members keep area and length.
    vesicles: bool,
}

impl CellTally {
    fn add(&mut self, outcome: &Outcome, counted: Counted) -> Result<()> {
        let Counted { refined, stops, driven, vesicles } = counted;
        let CellTally { counts, others, late, area, rates, events, vanishing, .. } = self;
        let Outcome { t_end, t_relax, t_vanish, status, .. } = *outcome;
        let (later_than, stopped) = (if vesicles { 0.0 } else { t_end }, stops && status == Status::Relaxed);
        self.relaxing.add(t_relax, later_than, outcome.judged, refined)?;
        self.moving += u64::from(vesicles && status == Status::Unfinished);
        events.resize_with(outcome.events.len().max(events.len()), EventTally::default);
        for (i, (own, t)) in events.iter_mut().zip(&outcome.events).enumerate() {
            own.add(*t, t_end, outcome.limit_of_event(i), refined)?;
            own.stopped += u64::from(stopped && t.is_none());
        }
        if driven {
            vanishing.add(t_vanish, t_end, outcome.judged_vanishing, refined)?;
            vanishing.stopped += u64::from(stopped);
        }
        *late += u64::from(status == Status::Unfinished && outcome.end.turning.abs() == 1);
        *area += outcome.start.area.abs();
        rates.extend(outcome.rate.map(|fitted| Rate { fitted, theory: outcome.rate_theory.unwrap_or(f64::NAN) }));
        for (counts, counted) in [(counts, true), (others, t_relax.is_none())] {
            for (count, own) in counts.iter_mut().zip(Status::ALL) {
                *count += u64::from(counted && own == status);
            }
        }
        Ok(())
    }
}

impl EventTally {
    /// Adds the time of a member, or the one up to which it is not known, with what the levels tell of it.
    fn add(&mut self, t: Option<f64>, later_than: f64, judged: Option<Limit>, refined: bool) -> Result<()> {
        self.times.push(Observation::new(t, later_than))?;
        if refined {
            // One without a limit that was reached is known to take about that long: the slow ones must not drop out.
            let censored = if judged.is_some() { later_than } else { t.unwrap_or(later_than) };
            self.limits.push(Observation::new(judged.map(|limit| limit.t), censored))?;
            self.without_limit += u64::from(t.is_some() && judged.is_none());
        }
        self.judged.extend(judged);
        self.reached += u64::from(t.is_some());
        Ok(())
    }
}

/// The rank of relaxed members in [`Status::ALL`].
const RELAXED: usize = 0;

/// The part of a [`Tally`] that cannot be recomputed from `summary.csv`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TallySupplement {
    /// Members whose corners were rounded off before the run.
    pub mollified: MollifiedMembers,
    /// Number of members that ended with a metric drift above [`DISTRUSTED_DRIFT`], and the largest drift.
    drifted: (u64, f64),
    /// Members whose relaxation time is unknown because their threshold is below the rounding of the precision.
    pub below_rounding: u64,
    /// By cell: the excess at the times of [`grid`], over the members that reached them.
    pub excess: Vec<Vec<Spread>>,
}

impl TallySupplement {
    /// Adds the data of other members.
    pub fn merge(&mut self, other: &TallySupplement) {
        let TallySupplement { mollified, drifted, below_rounding, excess } = other;
        self.mollified.merge(mollified);
        self.drifted = (self.drifted.0.saturating_add(drifted.0), self.drifted.1.max(drifted.1));
        self.below_rounding = self.below_rounding.saturating_add(*below_rounding);
        self.excess.resize_with(self.excess.len().max(excess.len()), Vec::new);
        for (own, other) in self.excess.iter_mut().zip(excess) {
            own.resize_with(own.len().max(other.len()), Spread::default);
            own.iter_mut().zip(other).for_each(|(own, other)| own.merge(other));
        }
    }
}

/// A row of `mean_excess.csv`: the excess of the members of a cell that reached a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeanExcess {
    /// Index of the cell.
    pub cell: u64,
    /// The time.
    pub t: f64,
    /// Number of members that reached it.
    pub members: u64,
    /// Their mean excess.
    pub mean: Option<f64>,
    /// Its standard deviation.
    pub sd: Option<f64>,
    /// Its 5 % quantile, to 1 %, as the next ones.
    pub q05: Option<f64>,
    /// Its median.
    pub median: Option<f64>,
    /// Its 95 % quantile.
    pub q95: Option<f64>,
}

impl MeanExcess {
    fn new(cell: u64, t: f64, of: &Spread) -> MeanExcess {
        let (moments, [q05, median, q95]) = (of.moments(), [0.05, 0.5, 0.95].map(|share| of.quantile(share)));
        let (members, mean, sd) = (moments.count(), moments.mean(), moments.deviation());
        MeanExcess { cell, t, members, mean, sd, q05, median, q95 }
    }
}

/// Metric drift above which the scheme's lengths are too far from the polygon's for times to mean much.
pub const DISTRUSTED_DRIFT: f64 = 0.1;

/// Share of a limit that moves with half the points of an outline, above which these are too few.
const OPEN_BY_POINTS: f64 = 0.01;

impl Tally {
    /// That of a run of `spec` before its members, after these times at its levels.
    pub fn of(spec: &Spec, levels: &LevelTimes) -> Tally {
        let events: Vec<String> = spec.event.iter().map(|event| event.name.clone()).collect();
        let at_start = vec![0; events.len()];
        let sweep = spec.sweep.clone();
        let vesicles = (0..sweep.cells()).take_while(|_| spec.keeps_both()).map(|cell| spec.has_vesicles_in(cell));
        Tally {
            has_outlines: spec.rounding.is_some() || sweep.has("rounding"),
            counted: Counted {
                refined: spec.refine,
                stops: spec.stops_when_relaxed(),
                driven: spec.drive.is_some() || sweep.has("drive"),
                vesicles: false,
            },
            vesicles: vesicles.collect(),
            remedies: Remedies::of(spec),
            sweep,
            levels: levels.rows(),
            events,
            at_start,
            ..Tally::default()
        }
    }

    /// Whether the members of a cell keep area and length.
    fn is_vesicle(&self, cell: u64) -> bool {
        self.vesicles.get(cell as usize).copied().unwrap_or_default()
    }

    /// Adds a member.
    ///
    /// # Errors
    /// For an invalid time.
    pub fn add(&mut self, outcome: &Outcome) -> Result<()> {
        let cell = outcome.cell as usize;
        let counted = Counted { vesicles: self.is_vesicle(outcome.cell), ..self.counted };
        if self.cells.len() <= cell {
            self.cells.resize_with(cell + 1, CellTally::default);
        }
        if self.named.len() < MAX_KNOWN && self.cells[cell].counts.iter().sum::<u64>() < MAX_NAMED {
            let limit = |i: usize| outcome.limit_of_event(i).filter(|_| counted.refined);
            let event = |(i, t): (usize, &Option<f64>)| limit(i).map(|limit| limit.t).or(*t);
            let events = outcome.events.iter().enumerate().map(event).collect();
            self.named.push(Outcome { events, ..outcome.clone() });
        }
        self.cells[cell].add(outcome, counted)?;
        if !outcome.group.is_empty() {
            self.groups.entry((outcome.cell, outcome.group.clone())).or_default().add(outcome, counted)?;
        }
        if counted.refined {
            self.nodes.add(outcome);
        }
        self.at_start.iter_mut().zip(&outcome.events).for_each(|(count, t)| *count += u64::from(*t == Some(0.0)));
        self.mesh_ratios.push(outcome.end.mesh_ratio as f32);
        self.metric_drifts.push(outcome.end.metric_drift as f32);
        if let Some(share) = outcome.t_data_error.zip(outcome.t_limit).map(|(moved, t)| moved / t) {
            self.coarse = (self.coarse.0 + u64::from(share > OPEN_BY_POINTS), self.coarse.1.max(share));
        }
        let drift = outcome.end.metric_drift;
        let TallySupplement { drifted: (drifted, worst), .. } = &mut self.supplement;
        *drifted += u64::from(drift > DISTRUSTED_DRIFT);
        *worst = worst.max(drift);
        // A table read from disk may contain anything.
        self.steps = self.steps.saturating_add(outcome.steps);
        self.solves = self.solves.saturating_add(outcome.solves);
        self.sweeps_k = self.sweeps_k.saturating_add(outcome.sweeps_k);
        self.sweeps_x = self.sweeps_x.saturating_add(outcome.sweeps_x);
        Ok(())
    }

    /// Whether members have limits, in each cell in which any relaxed.
    pub fn has_limits(&self) -> bool {
        let any = |of: &Observations| of.iter().any(|seen| seen.happened);
        let mut cells = self.cells.iter().map(|cell| &cell.relaxing);
        cells.clone().any(|of| any(&of.limits)) && cells.all(|of| any(&of.limits) || !any(&of.times))
    }

    /// The time of `member`, if it is known by name.
    pub fn named(&self, member: u64) -> Option<&Outcome> {
        self.named.binary_search_by_key(&member, |own| own.member).ok().map(|at| &self.named[at])
    }

    /// When a member ended, if it is known not to have relaxed by then.
    pub fn later_than(&self, of: &Outcome) -> Option<f64> {
        Some(of.t_end).filter(|_| !self.is_vesicle(of.cell) && of.t_relax.is_none())
    }

    /// Number of members that ended with a metric drift above [`DISTRUSTED_DRIFT`].
    pub fn distrusted(&self) -> u64 {
        self.supplement.drifted.0
    }

    /// Adds the excess of a member of `cell`, at the times of [`grid`] that it reached.
    pub fn add_excess(&mut self, cell: u64, excess: &[f64]) {
        let (cell, all) = (cell as usize, &mut self.supplement.excess);
        all.resize_with(all.len().max(cell + 1), Vec::new);
        let own = &mut all[cell];
        own.resize_with(own.len().max(excess.len()), Spread::default);
        own.iter_mut().zip(excess).for_each(|(spread, excess)| spread.add(*excess));
    }

    /// Adds data that are not in a row of the summary.
    pub fn add_supplement(&mut self, mollified: &Mollified, unresolved: bool) {
        self.supplement.mollified.add(mollified);
        self.supplement.below_rounding += u64::from(unresolved);
    }

    /// Returns the rows of `mean_excess.csv`.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if the values of a cell do not fit `spec`.
    pub fn mean_excess(&self, spec: &Spec) -> Result<Vec<MeanExcess>> {
        let mut rows = Vec::new();
        for (cell, excess) in (0..).zip(&self.supplement.excess) {
            let t_end = spec.of_cell(cell)?.final_time();
            let row = |(t, of): (f64, &Spread)| MeanExcess::new(cell, t, of);
            rows.extend(grid(t_end).zip(excess).map(row));
        }
        Ok(rows)
    }

    /// Number of members that relaxed before they vanished.
    pub fn relaxed_before_vanishing(&self) -> u64 {
        let vanished = Status::ALL.iter().position(|status| *status == Status::Vanished);
        let relaxed = |cell: &CellTally| vanished.map_or(0, |rank| cell.counts[rank] - cell.others[rank]);
        self.cells.iter().map(relaxed).sum()
    }

    /// Number of members that ended neither relaxed nor unfinished.
    pub fn failed(&self) -> u64 {
        self.counts().filter(|(status, _)| status.is_failure()).map(|(_, count)| count).sum()
    }

    /// Number of members that ended.
    pub fn members(&self) -> u64 {
        self.counts().map(|(_, count)| count).sum()
    }

    /// Each status with its number of members, in the order of [`Status::ALL`].
    pub fn counts(&self) -> impl Iterator<Item = (Status, u64)> {
        let of = |rank: usize| self.cells.iter().map(|cell| cell.counts[rank]).sum();
        Status::ALL.into_iter().enumerate().map(move |(rank, status)| (status, of(rank)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::outcome;

    fn tally(times: &[f64], censored: u64) -> Tally {
        let mut tally = Tally::default();
        times.iter().for_each(|t| tally.add(&outcome(0, Status::Relaxed, Some(*t))).unwrap());
        (0..censored).for_each(|_| tally.add(&outcome(0, Status::Unfinished, None)).unwrap());
        tally
    }

    #[test]
    fn totals_count_every_member_once() {
        let tally = tally(&[1.0, 2.0], 3);
        assert_eq!((tally.members(), tally.steps, tally.sweeps_k, tally.sweeps_x), (5, 50, 100, 25));
        let counts: Vec<u64> = tally.counts().map(|(_, count)| count).collect();
        assert_eq!(counts, [2, 3, 0, 0, 0, 0]);
    }

    #[test]
    fn only_members_that_sweep_are_advised_to_solve_directly() {
        let advice = |status, sweeps_k, sweeps_x| {
            let mut tally = Tally::default();
            tally.add(&Outcome { sweeps_k, sweeps_x, ..outcome(0, status, None) }).unwrap();
            tally.warnings().concat().contains("--solver direct")
        };
        assert!(advice(Status::Stalled, 20, 0));
        assert!(!advice(Status::Stalled, 0, 0) && !advice(Status::Singular, 20, 0));
    }

    #[test]
    fn outlines_that_the_nodes_do_not_resolve_are_warned_of() {
        let mut tally = tally(&[1.0, 2.0, 3.0, 4.0], 0);
        let well = Mollified { rounds: 7, area_change: -0.05, ..Mollified::default() };
        assert_eq!(tally.supplement.mollified.smoothing(), None);
        tally.add_supplement(&well, false);
        assert_eq!((tally.warnings(), tally.supplement.mollified.members), (vec![], 1));
        let words = "corners of 1 member were rounded further, until its n nodes resolved them: the area changed by at most 5.0 % \
                     and was restored";
        assert_eq!(tally.supplement.mollified.smoothing().as_deref(), Some(words));
        tally.add_supplement(&Mollified { crossed: true, sharp: true, ..well }, false);
        tally.add_supplement(&Mollified { area_change: -0.2, ..well }, false);
        assert!(tally.supplement.mollified.smoothing().is_some_and(|told| told.ends_with("by at most 20 %")));
        let MollifiedMembers { unresolved, crossed, sharp, distorted, .. } = tally.supplement.mollified;
        assert_eq!((unresolved, crossed, sharp, distorted), (2, 1, 1, 1));
        let warnings = tally.warnings();
        assert!(warnings[0].starts_with("2 of 4 members started from an outline with parts thinner"), "{warnings:?}");
        let parts =
            "1 with crossings that the outline has not, 1 with a turn left above 1.5 rad, 1 with an area changed";
        assert!(warnings[0].contains(parts) && warnings[0].contains("more than 10 %; use more --points"));
        tally.supplement.mollified.crossed = 0;
        assert!(!tally.warnings()[0].contains("crossings"));
    }

    #[test]
    fn cells_in_which_no_member_relaxed_are_named_with_the_remedy() {
        let late = |cell: u64| {
            let mut late = outcome(cell, Status::Unfinished, None);
            (late.cell, late.end.turning) = (cell, -1);
            late
        };
        let mut alone = Tally::default();
        alone.add(&late(0)).unwrap();
        let remedy = "use a longer --t-end or --t-end auto, or a larger --relax-to or --relax-at";
        assert_eq!(alone.warnings(), [format!("no member relaxed before its final time; {remedy}")]);
        alone.supplement.below_rounding = 1;
        assert!(matches!(&alone.warnings()[..], [hidden] if hidden.contains("rounding hides the threshold")));
        alone.supplement.below_rounding = 0;
        alone.add(&outcome(1, Status::Relaxed, Some(0.5))).unwrap();
        assert_eq!(alone.warnings(), [""; 0]);

        let spec = Spec::from_toml("[sweep]\namplitude = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08]").unwrap();
        let mut study = Tally::of(&Spec { stop_when_relaxed: Some(true), ..spec }, &LevelTimes::default());
        study.add(&outcome(0, Status::Relaxed, Some(0.5))).unwrap();
        (1..8).for_each(|cell| study.add(&late(cell)).unwrap());
        let cells = "amplitude = 0.02; amplitude = 0.03; amplitude = 0.04; amplitude = 0.05; amplitude = 0.06; 2 more";
        let remedy = "use a longer --t-end, or a larger --relax-to or --relax-at";
        assert_eq!(
            study.warnings(),
            [format!("no member relaxed before its final time in 7 of 8 cells ({cells}); {remedy}")]
        );
        // A figure of eight does not relax, however long it is given.
        let mut eight = late(0);
        eight.end.turning = 0;
        let mut immersed = Tally::default();
        immersed.add(&eight).unwrap();
        assert_eq!(immersed.warnings(), [""; 0]);
    }

    #[test]
    fn bad_ends_and_drift_are_warned_of_and_nothing_else_is() {
        let mut tally = Tally::default();
        tally.add(&outcome(0, Status::Relaxed, Some(0.5))).unwrap();
        tally.add(&outcome(1, Status::Unfinished, None)).unwrap();
        assert_eq!(tally.warnings(), [""; 0]);
        tally.add(&outcome(2, Status::Stalled, None)).unwrap();
        let mut drifted = outcome(3, Status::Relaxed, Some(0.5));
        drifted.end.metric_drift = 0.25;
        tally.add(&drifted).unwrap();
        let warnings = tally.warnings();
        assert!(warnings[0].starts_with("1 of 4 members failed"), "{warnings:?}");
        assert!(
            warnings[1].contains("1 of 4 members ended with a metric drift above 0.1 (worst 0.25)"),
            "{warnings:?}"
        );
        assert_eq!(warnings.len(), 2);
    }
}
