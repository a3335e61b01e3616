//! The times of members at their [levels](super::levels): which members need more nodes, and what all of them tell.

use super::levels::{LevelRow, RefinementLevel, tolerance};
use crate::{Outcome, Spec, Variation, request::spec::Pace, theory::vanishing::LITTLE_EXCESS};
use curvelax_base::error::Result;
use curvelax_flow::number::Precision;
use curvelax_statistics::{Limit, SHARE_OF_STEPS, Terms, TimeOf, Times};

/// Errors of a time in f32: of its steps, relative, and of the nodes over the amplitude of the shape, in units of ε.
const OF_STEPS: f64 = 5e-5;
const OF_NODES: f64 = 6.0;
/// Of the excess of a crystal, which is compared with one at rest by energy and area, in units of ε over the excess.
const OF_ENERGY: f64 = 0.1;
/// Of the energy of a vesicle, in units of ε over the share of its way at which it is relaxed.
const OF_REST: f64 = 0.5;
/// How much larger they are in the geometric form.
const OF_GEOMETRIC: f64 = 3.0;

/// The times of members at all levels.
#[derive(Clone, Debug, Default)]
pub struct LevelTimes {
    /// By level: members, ascending.
    times: Vec<Vec<AtLevel>>,
    /// By level: those of all events of one member after those of another, NaN likewise.
    events: Vec<Vec<f64>>,
}

/// What is known of a member at a level.
#[derive(Clone, Copy, Debug)]
struct AtLevel {
    member: u64,
    /// The time of each [`EndTime`], NaN if it has none.
    ends: [f64; 2],
    /// Largest turn of the tangent at a node of the initial curve.
    turn: f64,
    /// Length of the initial curve.
    length: f64,
    /// Excess of the initial curve.
    excess: f64,
    /// How far the energy of the curve went, relative to that at its end.
    way: f64,
    /// The numbers in which it was computed.
    precision: Precision,
}

/// The excess that stands for the error of steps in a time at which a member vanishes.
const OF_VANISHING: f64 = 0.01;
/// The same where a vesicle is relaxed, and the error as a share of what steps change: the energy at rest has one, too.
const OF_SETTLING: f64 = 1e-4;
const SHARE_OF_SETTLING: f64 = 0.5;

/// The times that end a member, each with a limit of its own.
#[derive(Clone, Copy)]
enum EndTime {
    Relaxation,
    Vanishing,
}

impl EndTime {
    const ALL: [EndTime; 2] = [EndTime::Relaxation, EndTime::Vanishing];

    /// The excess at which a member with the curve `at` has it, on whose root the error of steps and rounding depends.
    /// None decides when a member vanishes, or a vesicle is at rest: there it is such that bars hold
    /// (docs/internals/method.md#limit-beyond).
    fn excess(self, spec: &Spec, at: &AtLevel) -> f64 {
        match self {
            EndTime::Relaxation if spec.keeps_both() => OF_SETTLING.min(at.excess),
            EndTime::Relaxation => spec.threshold(at.excess),
            EndTime::Vanishing => OF_VANISHING,
        }
    }

    /// The error that adaptive steps leave, as a share of what they change.
    fn share_of_steps(self, spec: &Spec) -> f64 {
        match self {
            EndTime::Relaxation if spec.keeps_both() => SHARE_OF_SETTLING,
            _ => SHARE_OF_STEPS,
        }
    }
}

/// A time at consecutive levels, ascending, at each of which it is known: with the numbers in which it was computed.
#[derive(Default)]
struct Ladder(Vec<(RefinementLevel, (f64, Precision))>);

impl Ladder {
    /// The longest ladder that ends at `top`; empty if the time is not known there.
    fn up_to(top: RefinementLevel, at: impl Fn(RefinementLevel) -> Option<(f64, Precision)>) -> Ladder {
        let down = std::iter::successors(Some(top), |level| level.coarser());
        let mut known: Vec<_> = down.map_while(|level| Some((level, at(level)?))).collect();
        known.reverse();
        Ladder(known)
    }

    /// The finest level.
    fn finest(&self) -> Option<RefinementLevel> {
        self.0.last().map(|(level, _)| *level)
    }

    /// What it tells of the time `own` at the nodes of `spec`, at which a value is `reached`, judged as `of`, with the
    /// curve at its finest level. A time that is 0 at these nodes and at all finer levels has the limit 0. There is
    /// none if the ladder is too short, does not have these nodes, the time is 0 at some of its levels only, or tends
    /// below 0.
    fn limit(self, spec: &Spec, own: f64, finest: &AtLevel, of: EndTime, reached: TimeOf) -> Option<Limit> {
        let (levels, at): (Vec<_>, Vec<_>) = self.0.into_iter().unzip();
        let (times, precisions): (Vec<_>, Vec<_>) = at.into_iter().unzip();
        let own_level = levels.iter().position(|level| *level == RefinementLevel::FULL)?;
        // What holds at the start, with more nodes, too, does so with any number of them.
        if times[own_level..].iter().chain([&own]).all(|t| *t == 0.0) {
            return Some(Limit::AT_START);
        }
        if levels.len() < RefinementLevel::FIRST.len() || !(own > 0.0 && times.iter().all(|t| *t > 0.0)) {
            return None;
        }
        let points = levels.iter().map(|level| level.points(spec.points)).collect();
        let share_of_steps = matches!(spec.pace(), Pace::Adaptive(_)).then(|| of.share_of_steps(spec));
        let turn = turn(spec, finest);
        let excess = of.excess(spec, finest);
        // The error of the steps is relative to the root of the excess, and a circle has none.
        if excess <= 0.0 {
            return None;
        }
        let tolerance = tolerance(spec);
        let form = if spec.is_geometric() { OF_GEOMETRIC } else { 1.0 };
        let energy = match of {
            EndTime::Relaxation if spec.keeps_both() => OF_REST / (spec.threshold(1.0) * finest.way),
            _ if spec.has_crystals() => OF_ENERGY / excess,
            _ => 0.0,
        };
        let rounding = precisions.into_iter().map(|precision| form * rounding(precision, excess, energy)).collect();
        let terms = if spec.shape.typical().is_outline() {
            Terms::Points
        } else if spec.turns() == 1.0 && !spec.has_crystals() {
            Terms::Plain
        } else {
            Terms::Waves
        };
        let limit = Limit::of(&Times {
            of: reached,
            own,
            levels: times,
            points,
            rounding,
            own_level,
            tolerance,
            share_of_steps,
            turn,
            // That of unit mobility: times are that of the length to the fourth power.
            length: finest.length / spec.mobility().powf(0.25),
            excess,
            terms,
        });
        // What happens right after the start of a curve that its nodes do not resolve may tend below 0.
        (limit.t > 0.0 && limit.error.is_finite()).then_some(limit)
    }
}

impl LevelTimes {
    /// Adds a row; members of a level ascend.
    ///
    /// # Errors
    /// A message if there is no such level, or the member does not follow the one before.
    pub fn add(&mut self, row: &LevelRow) -> Result<(), String> {
        let none = || format!("a level from 1 to {}, or 100 or 200 more of an outline", RefinementLevel::MOST);
        let rank = RefinementLevel::of_number(row.level).map(rank).ok_or_else(none)?;
        let count = self.times.len().max(rank + 1);
        self.times.resize_with(count, Vec::new);
        self.events.resize_with(count, Vec::new);
        let own = &mut self.times[rank];
        if let Some(last) = own.last().filter(|last| last.member >= row.member) {
            return Err(format!("a member after {}: members of a level ascend, each once", last.member));
        }
        let LevelRow { member, turn, length_start: length, excess_start: excess, precision, .. } = *row;
        let way = ((row.energy_start - row.energy_end) / row.energy_end).abs();
        let ends = [row.t_relax, row.t_vanish].map(|t| t.unwrap_or(f64::NAN));
        own.push(AtLevel { member, ends, turn, length, excess, way, precision });
        self.events[rank].extend(row.events.iter().map(|t| t.unwrap_or(f64::NAN)));
        Ok(())
    }

    /// Number of rows.
    pub fn rows(&self) -> u64 {
        self.times.iter().map(|times| times.len() as u64).sum()
    }

    /// Whether `member` ran at them.
    pub fn has(&self, member: u64) -> bool {
        self.place(RefinementLevel::FULL, member).is_some()
    }

    /// Whether `member`, of a cell of `spec`, is to run at `level`, one of the finer ones, by its own times at those
    /// below: it has a time at the last of them, and no limit yet, or one that [needs more](Limit::needs_more). A time
    /// that is 0 there needs none.
    ///
    /// At the level of a variation it is to run if it has its finest time there, whose limit that will be.
    pub fn needs(&self, spec: &Spec, member: u64, level: RefinementLevel) -> bool {
        if let Some(variation) = level.variation() {
            let finest = |of| self.finest(member, of).is_some_and(|finest| finest.varied(variation) == level);
            return EndTime::ALL.into_iter().any(finest);
        }
        let Some(top) = level.coarser() else { return false };
        let Some(finest) = self.at(top, member) else { return false };
        EndTime::ALL.into_iter().any(|of| {
            let ladder = Ladder::up_to(top, |level| self.time(of, level, member));
            let is_later = ladder.0.last().is_some_and(|(_, (t, _))| *t > 0.0);
            let own = self.time(of, RefinementLevel::FULL, member).filter(|(own, _)| *own > 0.0);
            let Some((own, _)) = own.filter(|_| is_later) else { return false };
            // The member has not run itself, so the error of its steps is not known; nodes do not take it away.
            let limit = ladder.limit(spec, own, finest, of, TimeOf::End);
            limit.is_none_or(|limit| limit.needs_more(turn(spec, finest)))
        })
    }

    /// Completes the row of a member of a cell of `spec` that ran at its own resolution: the errors of its times, if it
    /// ran at the levels, and with `--refine` the limits of those at which it relaxed and vanished.
    pub fn judge(&self, spec: &Spec, outcome: &mut Outcome) {
        let (member, count) = (outcome.member, outcome.events.len());
        let of_event = |(place, own): (usize, &Option<f64>)| {
            let ladder = self.ladder(|level| self.event_time(level, member, [place, count]));
            let finest = self.at(ladder.finest()?, member)?;
            let reached = spec.event.get(place)?.condition.observable.time_of();
            ladder.limit(spec, (*own)?, finest, EndTime::Relaxation, reached)
        };
        outcome.judged_events = outcome.events.iter().enumerate().map(of_event).collect();
        // What is left of the life of one that is not round is not that of a circle.
        let vanished = outcome.t_vanish.filter(|_| outcome.end.excess <= LITTLE_EXCESS);
        let vanished = self.limit(spec, member, vanished, EndTime::Vanishing);
        let relaxed = self.limit(spec, member, outcome.t_relax, EndTime::Relaxation);
        let first = if relaxed.is_some() { EndTime::Relaxation } else { EndTime::Vanishing };
        outcome.t_data_error = self.moved_by(member, Variation::HalfThePoints, first);
        (outcome.judged, outcome.judged_vanishing) = (relaxed.map(|of| of.0), vanished.map(|of| of.0));
        if !spec.refine {
            return;
        }
        if let Some(Limit { t, error, order, .. }) = outcome.judged {
            (outcome.t_limit, outcome.t_error, outcome.order) = (Some(t), Some(error), order);
        }
        if let Some(Limit { t, error, .. }) = outcome.judged_vanishing {
            (outcome.t_vanish_limit, outcome.t_vanish_error) = (Some(t), Some(error));
        }
        if let Some((_, finest)) = relaxed.or(vanished) {
            (outcome.points, outcome.is_finer) = (finest.points(spec.points) as u64, finest.is_finer());
        }
    }

    /// The limit of the time `own` of a member, and the finest level on which it rests. Of an outline its error has by
    /// how much the time moves with corners rounded to twice the radius.
    fn limit(&self, spec: &Spec, member: u64, own: Option<f64>, of: EndTime) -> Option<(Limit, RefinementLevel)> {
        let ladder = self.ladder(|level| self.time(of, level, member));
        let level = ladder.finest()?;
        let finest = self.at(level, member)?;
        let mut limit = ladder.limit(spec, own?, finest, of, TimeOf::End)?;
        let by_radius = self.moved_by(member, Variation::TwiceTheRadius, of).unwrap_or_default();
        limit.fixed += by_radius;
        limit.error += by_radius;
        Some((limit, level))
    }

    /// The finest level at which a time of a member is known, if it is at its own nodes.
    fn finest(&self, member: u64, of: EndTime) -> Option<RefinementLevel> {
        let ladder = self.ladder(|level| self.time(of, level, member).filter(|(t, _)| *t > 0.0));
        ladder.finest().filter(|_| ladder.0.iter().any(|(level, _)| *level == RefinementLevel::FULL))
    }

    /// By how much a variation of its outline moves a time of a member, at its finest level; unknown if it did not
    /// run.
    fn moved_by(&self, member: u64, variation: Variation, of: EndTime) -> Option<f64> {
        let finest = self.finest(member, of)?;
        let [varied, own] = [finest.varied(variation), finest].map(|level| self.time(of, level, member));
        Some((varied?.0 - own?.0).abs())
    }

    /// The ladder that ends at the finest level at which a time is known.
    fn ladder(&self, at: impl Fn(RefinementLevel) -> Option<(f64, Precision)>) -> Ladder {
        let all = (1..=RefinementLevel::MOST).rev().filter_map(RefinementLevel::of_number);
        let top = all.into_iter().find(|level| at(*level).is_some());
        top.map_or_else(Ladder::default, |top| Ladder::up_to(top, at))
    }

    fn place(&self, level: RefinementLevel, member: u64) -> Option<usize> {
        self.times.get(rank(level))?.binary_search_by_key(&member, |at| at.member).ok()
    }

    fn at(&self, level: RefinementLevel, member: u64) -> Option<&AtLevel> {
        self.times.get(rank(level))?.get(self.place(level, member)?)
    }

    /// A time of a member, and the numbers in which it was computed.
    fn time(&self, of: EndTime, level: RefinementLevel, member: u64) -> Option<(f64, Precision)> {
        let at = self.at(level, member)?;
        let t = at.ends[of as usize];
        t.is_finite().then_some((t, at.precision))
    }

    /// The time of the event at `place` among `count` of a member.
    fn event_time(&self, level: RefinementLevel, member: u64, [place, count]: [usize; 2]) -> Option<(f64, Precision)> {
        let at = self.place(level, member)? * count + place;
        let t = self.events.get(rank(level))?.get(at).copied().filter(|t| t.is_finite())?;
        Some((t, self.at(level, member)?.precision))
    }
}

/// The largest turn at a node, as that of a plain curve that is resolved as well. The pilot, which only estimates, goes
/// by that of the tangent.
fn turn(spec: &Spec, at: &AtLevel) -> f64 {
    if spec.refine { spec.turns() * at.turn } else { at.turn }
}

/// By how much rounding moves a time at this excess, relative to the time (docs/internals/precision.md#limit), where an
/// energy is compared by so many ε. The root of the excess is about the amplitude.
fn rounding(precision: Precision, excess: f64, energy: f64) -> f64 {
    let epsilon = precision.epsilon();
    match precision {
        Precision::F32 => OF_STEPS.hypot(OF_NODES * epsilon / excess.sqrt()).hypot(energy * epsilon),
        Precision::F64 => 0.0,
    }
}

/// The place of a level among all.
fn rank(level: RefinementLevel) -> usize {
    level.number() as usize - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of a curve near a unit circle.
    fn row() -> LevelRow {
        LevelRow { excess_start: 0.2, length_start: 6.3, ..LevelRow::default() }
    }

    /// Whether a member that turns by `turn` at a node of 100 needs more of them, with times of order two.
    fn needs(text: &str, turn: f64) -> bool {
        let spec = Spec::from_toml(&format!("points = 100\nadaptive = 1e-3\n{text}")).unwrap();
        let mut times = LevelTimes::default();
        for level in RefinementLevel::FIRST {
            let n = level.points(100) as f64;
            let (level, turn, t_relax) = (level.number(), turn * 100.0 / n, Some(1.0 + 4.0 / (n * n)));
            times.add(&LevelRow { level, turn, t_relax, ..row() }).unwrap();
        }
        times.needs(&spec, 0, RefinementLevel::of_number(4).unwrap())
    }

    #[test]
    fn what_holds_at_the_start_has_the_limit_0() {
        let spec = Spec::from_toml("adaptive = 1e-3\nrefine = true\nevent = ['early = excess <= 1']").unwrap();
        let judged = |at_levels: [f64; 3]| {
            let mut times = LevelTimes::default();
            for (level, t) in RefinementLevel::FIRST.into_iter().zip(at_levels) {
                let (level, t_relax, events) = (level.number(), Some(t), vec![Some(t)]);
                times.add(&LevelRow { level, t_relax, events, ..row() }).unwrap();
            }
            let mut own = Outcome { t_relax: Some(0.0), events: vec![Some(0.0)], ..Outcome::default() };
            times.judge(&spec, &mut own);
            (own.t_limit.zip(own.t_error), own.limit_of_event(0).map(|limit| limit.relative_error()))
        };
        assert_eq!(judged([0.0; 3]), (Some((0.0, 0.0)), Some(0.0)));
        // Fewer nodes may not see it.
        assert_eq!(judged([0.1, 0.1, 0.0]), (Some((0.0, 0.0)), Some(0.0)));
        assert_eq!(judged([0.1, 0.0, 0.1]), (None, None));
    }

    #[test]
    fn a_time_of_0_at_the_finest_level_asks_for_no_more() {
        let spec = Spec::from_toml("adaptive = 1e-3\nrefine = true").unwrap();
        let needs = |last: f64| {
            let mut times = LevelTimes::default();
            for (level, t) in (1..).zip([0.3, 0.2, 0.1, last]) {
                times.add(&LevelRow { level, t_relax: Some(t), ..row() }).unwrap();
            }
            times.needs(&spec, 0, RefinementLevel::of_number(5).unwrap())
        };
        assert!(!needs(0.0) && needs(0.04));
    }

    #[test]
    fn times_that_tend_below_0_have_no_limit() {
        let spec = Spec::from_toml("points = 100\nadaptive = 1e-3\nrefine = true").unwrap();
        let limit = |at_infinity: f64| {
            let mut times = LevelTimes::default();
            for level in RefinementLevel::FIRST {
                let n = level.points(100) as f64;
                let (level, t_relax) = (level.number(), Some(at_infinity + 10.0 / (n * n)));
                times.add(&LevelRow { level, t_relax, ..row() }).unwrap();
            }
            let mut own = Outcome { t_relax: Some(at_infinity + 1e-3), ..Outcome::default() };
            times.judge(&spec, &mut own);
            own.t_limit
        };
        assert!(limit(1e-4).is_some_and(|t| t > 0.0));
        assert_eq!(limit(-1e-4), None);
    }

    #[test]
    fn nodes_must_resolve_the_waves_of_a_crystal_and_more_where_the_length_is_kept() {
        let crystal = "diffusivity = 'cos:4,0.5'\nenergy = 'cos:2,0.1'";
        let kept = "flow = 'willmore'\nconserve = 'length'";
        for (text, least) in [("", 0.7), (crystal, 0.175), (kept, 0.35), ("drive = -1", 0.7)] {
            let refined = format!("{text}\nrefine = true");
            assert!(!needs(&refined, 0.95 * least) && needs(&refined, 1.05 * least), "{text}");
        }
        // The pilot has no more nodes, and goes by the tangent.
        assert!(!needs(crystal, 0.3));
    }
}
