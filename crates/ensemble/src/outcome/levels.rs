//! Levels: members computed once more at other resolutions and with more exact steps, from which the error of their
//! relaxation times follows.
//!
//! The members of a level are those of a cell, with the same random numbers; they run before the cell does. With
//! `--refine` all members run at the [first three](RefinementLevel::FIRST), those whose times do not converge there
//! also at finer ones, and each gets its [limit](curvelax_statistics::Limit). Of outlines, [variations](Variation) run
//! at the finest level of each, too, which tell what rounding and points do to its time. Otherwise a few of them run at
//! the first three, the pilot, and tell the error of a typical member.

use crate::{
    Outcome, Spec, Status, Variation,
    request::spec::{BackendChoice, FinalTime, Order, Pace, Precision, SolverChoice, Store},
    request::validate::tightest_adaptive,
};
use curvelax_base::error::Result;
use curvelax_flow::solver::Solver;
use curvelax_statistics::FINER_STEPS;

/// Members of a cell in the pilot, and the share of a small cell that is.
const PILOT: u64 = 16;
const PILOT_SHARE: u64 = 16;
/// Nodes above which a single member takes so long that there is a pilot only if it is asked for, by `--refine`.
const MAX_PILOT_POINTS: usize = 10_000;
/// Most nodes of a level finer than the member itself.
const MAX_POINTS: usize = 1600;
/// How much later a level ends, and the latest time at all.
const LONGER: f64 = 2.0;
const LATEST: f64 = 1e300;
/// Tolerance of the steps of a level beside fixed ones.
const EXACT: f64 = 1e-4;

/// A resolution at which members run besides their own, by its step from 1: step l of n nodes has n·2^((l - 3)/2).
/// Variations of outlines run at the same ones, after them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RefinementLevel {
    variation: Option<Variation>,
    step: u32,
}

/// Numbers of the levels of one variation, and of the members as they are.
const NUMBERS: u64 = 100;

impl RefinementLevel {
    /// Half the nodes.
    pub const HALF: RefinementLevel = RefinementLevel::plain(1);
    /// As many nodes.
    pub const FULL: RefinementLevel = RefinementLevel::plain(3);
    /// Those at which all members run that run at any, in this order.
    pub const FIRST: [RefinementLevel; 3] = [RefinementLevel::HALF, RefinementLevel::plain(2), RefinementLevel::FULL];
    /// No members have so few nodes that they have more levels.
    pub const MOST: u64 = 24;

    const fn plain(step: u32) -> RefinementLevel {
        RefinementLevel { step, variation: None }
    }

    /// The same nodes on a variation of the outline.
    pub fn varied(self, variation: Variation) -> RefinementLevel {
        RefinementLevel { variation: Some(variation), ..self }
    }

    /// The variation of the outline, if it is one.
    pub fn variation(self) -> Option<Variation> {
        self.variation
    }

    /// The levels of members with `n` nodes that are finer than these, in the order in which they run.
    pub fn finer(n: usize) -> impl Iterator<Item = RefinementLevel> {
        let all = (RefinementLevel::FULL.step + 1..=RefinementLevel::MOST as u32).map(RefinementLevel::plain);
        all.take_while(move |level| level.points(n) <= MAX_POINTS)
    }

    /// The level with this number, if there is one.
    pub fn of_number(number: u64) -> Option<RefinementLevel> {
        let variation = match number / NUMBERS {
            0 => None,
            above => Some(*Variation::ALL.get(usize::try_from(above).ok()? - 1)?),
        };
        let step = number % NUMBERS;
        (1..=RefinementLevel::MOST).contains(&step).then_some(RefinementLevel { step: step as u32, variation })
    }

    /// Its number in `levels.csv`, from 1.
    pub fn number(self) -> u64 {
        let place = |variation: Variation| Variation::ALL.into_iter().take_while(|other| *other != variation).count();
        let before = self.variation.map_or(0, |variation| place(variation) as u64 + 1);
        before * NUMBERS + u64::from(self.step)
    }

    /// The level below it, if there is one.
    pub fn coarser(self) -> Option<RefinementLevel> {
        (self.step > 1).then(|| RefinementLevel { step: self.step - 1, ..self })
    }

    /// Whether it has more nodes than the members.
    pub fn is_finer(self) -> bool {
        self.step > RefinementLevel::FULL.step
    }

    /// Whether only those members run there that need it.
    pub fn is_selective(self) -> bool {
        self.is_finer() || self.variation.is_some()
    }

    /// Nodes, where a member has `n`.
    pub fn points(self, n: usize) -> usize {
        if self.step == RefinementLevel::HALF.step {
            return n / 2;
        }
        let halves = f64::from(self.step) - f64::from(RefinementLevel::FULL.step);
        (n as f64 * (0.5 * halves).exp2()).round() as usize
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
            stop_when_relaxed: Some(!of.keeps_both() && (of.event.is_empty() || of.stops_when_relaxed())),
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
            (spec.tolerance, spec.sor, spec.max_sweeps) = (None, None, Spec::default().max_sweeps);
        }
        spec.validate_alone()
    }
}

/// Tolerance of the steps at all levels of a cell of `spec`.
pub(super) fn tolerance(spec: &Spec) -> f64 {
    match spec.pace() {
        Pace::Adaptive(tolerance) => {
            (tolerance / FINER_STEPS).max(tightest_adaptive(spec.precision.unwrap_or(Precision::F64)))
        }
        Pace::Fixed(_) => EXACT,
    }
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
    /// The numbers in which it was computed.
    pub precision: Precision,
    /// How it ended.
    pub status: Status,
    /// Its relaxation time.
    pub t_relax: Option<f64>,
    /// When it vanished.
    pub t_vanish: Option<f64>,
    /// Steps of the paper's scheme that were computed.
    pub solves: u64,
    /// Largest angle by which the tangent of the initial curve turns at a node, in radians.
    pub turn: f64,
    /// Length of the initial curve.
    pub length_start: f64,
    /// Excess of the initial curve.
    pub excess_start: f64,
    /// Energy of the initial curve.
    pub energy_start: f64,
    /// Energy of the final curve.
    pub energy_end: f64,
    /// The times of its events, in the order of the spec: the rows of `event_levels.csv`.
    pub events: Vec<Option<f64>>,
}

impl LevelRow {
    /// The row of a member that ended at `level` in `cell`, computed in such numbers.
    pub fn new(level: RefinementLevel, cell: &Spec, precision: Precision, ended: &Outcome) -> LevelRow {
        LevelRow {
            member: ended.member,
            level: level.number(),
            cell: ended.cell,
            points: cell.points as u64,
            adaptive: cell.adaptive,
            precision,
            status: ended.status,
            t_relax: ended.t_relax,
            t_vanish: ended.t_vanish,
            solves: ended.solves,
            turn: ended.turn,
            length_start: ended.start.length,
            excess_start: ended.start.excess,
            energy_start: ended.start.energy,
            energy_end: ended.end.energy,
            events: ended.events.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_grow_by_the_root_of_two_up_to_1600_nodes() {
        let points = |n: usize| -> Vec<usize> {
            let all = RefinementLevel::FIRST.into_iter().chain(RefinementLevel::finer(n));
            all.map(|level| level.points(n)).collect()
        };
        assert_eq!(points(100), [50, 71, 100, 141, 200, 283, 400, 566, 800, 1131, 1600]);
        assert_eq!(points(101).last(), Some(&1143));
        assert_eq!((points(1600), points(5001)), (vec![800, 1131, 1600], vec![2500, 3536, 5001]));
        // Half an odd number is rounded down, as it was when there were three levels.
        for n in 6..20_000 {
            let [half, between, full] = RefinementLevel::FIRST.map(|level| level.points(n));
            assert_eq!([half, between, full], [n / 2, (n as f64 / std::f64::consts::SQRT_2).round() as usize, n]);
        }
        assert!(points(6).len() < RefinementLevel::MOST as usize);
    }

    #[test]
    fn every_level_has_a_number_of_its_own() {
        let mut numbers = Vec::new();
        for number in 0..1000 {
            let Some(level) = RefinementLevel::of_number(number) else { continue };
            assert_eq!(level.number(), number);
            numbers.push(number);
        }
        let runs: Vec<u64> = [1..25, 101..125, 201..225].into_iter().flatten().collect();
        assert_eq!(numbers, runs);
        let varied = RefinementLevel::FULL.varied(Variation::TwiceTheRadius);
        assert_eq!((varied.number(), varied.points(100), varied.is_finer()), (203, 100, false));
        assert!(varied.is_selective() && !RefinementLevel::FULL.is_selective());
    }
}
