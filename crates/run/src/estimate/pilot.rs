//! Pilots: a few members of a cohort, run through the loop of every run, as far as a fixed amount of work goes.
//!
//! Work is counted in updates of nodes, never in time: what a pilot finds must not depend on the speed of the machine
//! or on what else it does. So that every pilot stops at the same point, its members go to a common number of steps,
//! which doubles until the work is done ([`Rationed`]). Only the time that this takes is measured by the clock.

use std::{
    cell::Cell as Flag,
    time::{Duration, Instant},
};

use serde::Serialize;

use curvelax_backend::Backend;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{
    Cell, Ended, Extent, Outcome, SeriesRow, Sink, Snapshot,
    outcome::progress::bytes_of,
    request::spec::{OrAuto, Pace, Precision},
    schedule::Clock,
    simulate::simulate,
};
use curvelax_flow::scheme::{
    Parameters, State,
    member::{Counters, Report},
    run::Run,
};

/// Updates of a node, in sweeps, that a step of the paper costs besides its sweeps. Measured: with the direct solver, a
/// step takes as long as some ten sweeps.
const UPDATES_PER_SOLVE: f64 = 10.0;

/// Limits of all pilots of an estimate.
pub struct Limits<'a> {
    /// Work of each pilot, in updates of nodes.
    pub work: f64,
    /// Whether to keep the outcomes of the members.
    pub keeps_members: bool,
    /// When pilots are given up: a step takes too long to wait for.
    pub until: Instant,
    /// The error with which the user ends them, if so.
    pub stopped: &'a dyn Fn() -> Option<Error>,
}

/// The cost of a cohort, and for how many members its pilot stands.
#[derive(Debug)]
pub struct CohortWork {
    pub members: f64,
    pub seconds: Option<f64>,
    pub dispatches: Option<f64>,
    pub steps: Option<f64>,
    /// Rows of the series, and nodes of the snapshots.
    pub series: f64,
    pub nodes: f64,
}

/// The pilots of all cohorts together.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Pilot {
    /// Members started.
    pub members: u64,
    /// Members that ended.
    pub ended: u64,
    /// Members that ended neither relaxed nor at the end of their time.
    pub failed: u64,
    /// Members that relaxed.
    pub relaxed: u64,
    /// Members that have a rate.
    pub rated: u64,
    /// Time used.
    pub seconds: f64,
}

impl Pilot {
    /// Adds another pilot.
    pub fn add(&mut self, seen: &Pilot) {
        self.members += seen.members;
        self.ended += seen.ended;
        self.failed += seen.failed;
        self.relaxed += seen.relaxed;
        self.rated += seen.rated;
        self.seconds += seen.seconds;
    }
}

/// The result of one pilot.
#[derive(Clone, Debug, Default)]
pub struct PilotResult {
    /// What is counted of all pilots.
    pub counts: Pilot,
    /// Steps of the members that have ended.
    pub steps: u64,
    /// Bytes of their rows.
    pub rows: f64,
    /// Rows of their series, and snapshots.
    pub series: usize,
    pub snapshots: usize,
    /// Fraction of the work that was done.
    pub share: f64,
    pub dispatches: u64,
    /// Work done, in updates of nodes.
    pub work: f64,
    /// The members that ended, ascending, if they are asked for.
    pub ended: Vec<Outcome>,
}

impl PilotResult {
    pub fn new(members: u64) -> PilotResult {
        PilotResult { counts: Pilot { members, ..Pilot::default() }, ..PilotResult::default() }
    }
}

/// Why a pilot ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// All its members have ended.
    Complete,
    /// Its work was done.
    Rationed,
    /// It took too long.
    GivenUp,
}

/// Receives the members of a pilot, and ends it.
struct PilotSink<'a> {
    seen: PilotResult,
    limits: &'a Limits<'a>,
    /// Set by the back end once the work is done.
    is_done: &'a Flag<bool>,
    end: End,
}

impl Sink for PilotSink<'_> {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        let seen = &mut self.seen;
        seen.ended.extend(self.limits.keeps_members.then(|| ended.outcome.clone()));
        seen.counts.ended += 1;
        seen.counts.failed += u64::from(ended.outcome.status.is_failure());
        seen.counts.relaxed += u64::from(ended.outcome.t_relax.is_some());
        seen.counts.rated += u64::from(ended.outcome.rate.is_some());
        seen.steps += ended.outcome.steps;
        seen.series += ended.rows.series.len();
        seen.snapshots += ended.rows.snapshots.len();
        let spilled: u64 = ended.rows.spilled.iter().map(|extent| extent.length).sum();
        seen.rows += ended.rows.bytes() as f64 + spilled as f64;
        Ok(())
    }

    /// Only the size of the rows is needed.
    fn spill(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        self.seen.series += series.len();
        self.seen.snapshots += snapshots.len();
        let length = bytes_of(series.len(), snapshots.len(), snapshots.first().map_or(0, |first| first.x.len()));
        Ok(Some(Extent { length: length as u64, ..Extent::default() }))
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        self.seen.share = share;
        if let Some(error) = (self.limits.stopped)() {
            return Err(error);
        }
        self.end = match done < total {
            true if self.is_done.get() => End::Rationed,
            true if Instant::now() >= self.limits.until => End::GivenUp,
            _ => return Ok(()),
        };
        Err(Error::Stopped("the pilot is over".into()))
    }
}

/// A back end that lets every member make the same number of steps before any goes further, and counts their work.
struct Rationed<'a> {
    inner: &'a mut dyn Backend,
    /// Nodes of a member.
    nodes: usize,
    /// Work after which no member goes further.
    budget: f64,
    /// Steps that a member may make so far.
    ration: u32,
    places: Vec<Option<PilotSlot>>,
    work: f64,
    dispatches: u64,
    is_done: &'a Flag<bool>,
}

/// What is known of the member in a slot.
#[derive(Clone, Copy, Default)]
struct PilotSlot {
    solves: u32,
    /// Whether it is in the dispatch in progress.
    is_running: bool,
    /// Whether it has made its steps, or ended.
    waits: bool,
}

impl<'a> Rationed<'a> {
    fn new(inner: &'a mut dyn Backend, nodes: usize, budget: f64, is_done: &'a Flag<bool>) -> Rationed<'a> {
        let places = vec![None; inner.slots()];
        Rationed { inner, nodes, budget, ration: 1, places, work: 0.0, dispatches: 0, is_done }
    }

    fn slots_of(&self, batch: usize) -> std::ops::Range<usize> {
        let size = self.slots() / self.batches();
        batch * size..(batch + 1) * size
    }
}

impl Backend for Rationed<'_> {
    fn slots(&self) -> usize {
        self.inner.slots()
    }

    fn abreast(&self) -> usize {
        self.inner.abreast()
    }

    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        self.inner.load(slot, run)?;
        self.places[slot] = Some(PilotSlot { solves: run.counters.solves, ..PilotSlot::default() });
        self.aim(slot, run.counters.goal, &run.parameters);
        Ok(())
    }

    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        self.inner.aim(slot, goal.min(self.ration), parameters);
        if let Some(place) = &mut self.places[slot] {
            place.waits = false;
        }
    }

    fn clear(&mut self, slot: usize) {
        self.places[slot] = None;
        self.inner.clear(slot);
    }

    fn batches(&self) -> usize {
        self.inner.batches()
    }

    fn start(&mut self, batch: usize) -> Result<()> {
        let mut any = false;
        for slot in self.slots_of(batch) {
            let Some(place) = &mut self.places[slot] else { continue };
            place.is_running = self.inner.counters(slot).is_running();
            any |= place.is_running;
        }
        self.dispatches += u64::from(any);
        self.inner.start(batch)
    }

    fn is_back(&mut self, batch: usize, most: Duration) -> bool {
        self.inner.is_back(batch, most)
    }

    fn finish(&mut self, batch: usize) -> Result<()> {
        self.inner.finish(batch)?;
        for slot in self.slots_of(batch) {
            let Some(place) = &mut self.places[slot] else { continue };
            let now = self.inner.counters(slot);
            // Others keep the sweeps of an earlier dispatch.
            if place.is_running {
                let sweeps = f64::from(now.sweeps_k) + f64::from(now.sweeps_x);
                let solves = f64::from(now.solves.saturating_sub(place.solves));
                self.work += self.nodes as f64 * (sweeps + UPDATES_PER_SOLVE * solves);
            }
            *place =
                PilotSlot { solves: now.solves, is_running: false, waits: now.status != 0 || now.steps >= self.ration };
        }
        if self.places.iter().flatten().all(|place| place.waits) {
            if self.work < self.budget {
                self.ration = self.ration.saturating_mul(2);
            } else {
                self.is_done.set(true);
            }
        }
        Ok(())
    }

    fn counters(&self, slot: usize) -> Counters {
        self.inner.counters(slot)
    }

    fn report(&self, slot: usize) -> Report<f64> {
        self.inner.report(slot)
    }

    fn state(&mut self, slot: usize) -> Result<State<f64>> {
        self.inner.state(slot)
    }

    fn states(&mut self, slots: &[usize]) -> Result<Vec<State<f64>>> {
        self.inner.states(slots)
    }
}

/// What the pilots of a cohort show.
pub struct CohortSample {
    /// The cost of the whole cohort.
    pub work: CohortWork,
    /// The pilots, each larger than the one before.
    pub pilots: Vec<PilotResult>,
    /// Bytes of the rows of a member at its end, and in the largest pilot.
    pub rows: [f64; 2],
    /// Whether states were read back for rows.
    pub reads_back: bool,
}

/// Runs pilots of a cohort: first as many members as run side by side, then, if these end early, as many more as the
/// rest of the work allows. The difference between the two gives the cost of a further member, free of fixed costs.
pub fn sample(
    cohort: &mut [Cell],
    precision: Precision,
    backend: &mut dyn Backend,
    limits: &Limits<'_>,
) -> Result<CohortSample> {
    let own: Vec<Option<Vec<u64>>> = cohort.iter().map(|cell| cell.spec.only.clone()).collect();
    let all: u64 = cohort.iter().map(|cell| cell.spec.member_count()).sum();
    let mut pilots: Vec<PilotResult> = Vec::new();
    let mut count = (backend.abreast() as u64).min(all);
    // The second pilot runs to its end, so that it does not matter in which order its members are admitted.
    let mut budget = limits.work;
    loop {
        choose(cohort, &own, all, count);
        let (end, seen) = pilot(cohort, precision, backend, (count, budget), limits)?;
        let more = (count as f64 * (limits.work - seen.work) / seen.work.max(1.0)).max(0.0) as u64;
        pilots.push(seen);
        // A pilot less than twice as large would show nothing new.
        if end != End::Complete || count == all || more < 2 * count || pilots.len() > 1 {
            break;
        }
        (count, budget) = (more.min(all), f64::INFINITY);
    }
    cohort.iter_mut().zip(own).for_each(|(cell, only)| cell.spec.only = only);
    let ended = pilots.iter().rfind(|seen| seen.counts.ended > 0);
    let per_member = |of: fn(&PilotResult) -> f64| ended.map(|seen| of(seen) / seen.counts.ended as f64);
    let [most_series, most_snapshots] = most_rows(cohort);
    let work = CohortWork {
        members: all as f64,
        seconds: extrapolated(&pilots, all, |seen| seen.counts.seconds),
        dispatches: extrapolated(&pilots, all, |seen| seen.dispatches as f64),
        steps: per_member(|seen| seen.steps as f64).or_else(|| certain_steps(cohort)).map(|each| each * all as f64),
        series: per_member(|seen| seen.series as f64).unwrap_or(most_series) * all as f64,
        nodes: per_member(|seen| seen.snapshots as f64).unwrap_or(most_snapshots) * all as f64 * points(cohort) as f64,
    };
    let most = bytes_of(most_series as usize, most_snapshots as usize, points(cohort));
    let rows = per_member(|seen| seen.rows).unwrap_or(most as f64);
    let share = pilots.last().map_or(1.0, |seen| seen.share.clamp(0.0, 1.0));
    let reads_back = cohort.iter().any(|cell| !cell.spec.snapshots.is_empty()) && share > 0.0;
    Ok(CohortSample { work, pilots, rows: [rows, share * rows], reads_back })
}

/// Nodes of a member of a cohort.
pub fn points(cohort: &[Cell]) -> usize {
    cohort.first().map_or(0, |cell| cell.family.points())
}

/// Runs the chosen members of a cohort, `count` of them, until they have done the work of `budget`.
fn pilot(
    cohort: &[Cell],
    precision: Precision,
    backend: &mut dyn Backend,
    (count, budget): (u64, f64),
    limits: &Limits<'_>,
) -> Result<(End, PilotResult)> {
    let is_done = Flag::new(false);
    let mut rationed = Rationed::new(backend, points(cohort), budget, &is_done);
    if budget == f64::INFINITY {
        rationed.ration = u32::MAX;
    }
    let mut watch = PilotSink { seen: PilotResult::new(count), limits, is_done: &is_done, end: End::Complete };
    let started = Instant::now();
    let ended = simulate(cohort, precision, &mut rationed, 0, &mut watch);
    let (work, dispatches) = (rationed.work, rationed.dispatches);
    let PilotSink { mut seen, end, .. } = watch;
    if end == End::Complete {
        ended?;
    }
    // How far it came depends on the machine, so nothing of it counts.
    if end == End::GivenUp {
        seen = PilotResult::new(count);
    }
    (seen.counts.seconds, seen.work, seen.dispatches) = (started.elapsed().as_secs_f64(), work, dispatches);
    Ok((end, seen))
}

/// Rows of the series and snapshots of a member that reaches the final time, the maximum over all cells.
fn most_rows(cohort: &[Cell]) -> [f64; 2] {
    let specs = || cohort.iter().map(|cell| &cell.spec);
    let series = specs().map(|spec| spec.series.map_or(0.0, |every| spec.final_time() / every + 1.0));
    [series.fold(0.0, f64::max), specs().map(|spec| spec.snapshots.len() as f64).fold(0.0, f64::max)]
}

/// The cost of `all` members from that of the pilots, each scaled to its end.
fn extrapolated(pilots: &[PilotResult], all: u64, cost: impl Fn(&PilotResult) -> f64) -> Option<f64> {
    let whole = |seen: &PilotResult| (seen.share > 0.0).then(|| cost(seen) / seen.share.min(1.0));
    let known: Vec<(f64, f64)> =
        pilots.iter().filter_map(|seen| Some((seen.counts.members as f64, whole(seen)?))).collect();
    let (members, most) = *known.last()?;
    let each = match known[..] {
        [.., (fewer, less), _] if most > less => (most - less) / (members - fewer),
        _ => most / members,
    };
    Some(most + each * (all as f64 - members))
}

/// Steps of a member, if these do not depend on its curve.
fn certain_steps(cohort: &[Cell]) -> Option<f64> {
    let of_cell = |Cell { spec, .. }: &Cell| match spec.pace() {
        Pace::Fixed(OrAuto::Number(tau)) if !spec.stops_when_relaxed() => {
            Some(f64::from(Clock::new(tau, spec.final_time()).steps))
        }
        _ => None,
    };
    let steps = cohort.iter().map(of_cell).sum::<Option<f64>>()?;
    Some(steps / cohort.len() as f64)
}

/// Selects `count` of the `all` members of `cohort`, spread evenly; `own` are the members that its cells were to run.
fn choose(cohort: &mut [Cell], own: &[Option<Vec<u64>>], all: u64, count: u64) {
    let place = |i: u64| ((2 * u128::from(i) + 1) * u128::from(all) / (2 * u128::from(count))) as u64;
    let mut places = (0..count).map(place).peekable();
    let mut before = 0;
    for (cell, own) in cohort.iter_mut().zip(own) {
        cell.spec.only.clone_from(own);
        let members = cell.spec.member_count();
        let (mut own, mut taken, mut only) = (cell.spec.members(), 0, Vec::new());
        while let Some(place) = places.next_if(|place| *place < before + members) {
            only.extend(own.nth((place - before - taken) as usize));
            taken = place - before + 1;
        }
        drop(own);
        cell.spec.only = Some(only);
        before += members;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_backend::cpu::CpuBackend;
    use curvelax_ensemble::{Spec, Study};
    use curvelax_flow::{
        scheme::step::Method,
        solver::{Blocks, Solver},
    };

    fn study(spec: Spec) -> Study {
        Study::new(spec).unwrap()
    }

    fn chosen(cells: &[Cell]) -> Vec<u64> {
        cells.iter().flat_map(|cell| cell.members().collect::<Vec<_>>()).collect()
    }

    #[test]
    fn a_pilot_is_spread_over_all_cells() {
        let mut spec = Spec { curves: 1000, ..Spec::default() };
        spec.sweep.set("amplitude=0.01,0.02,0.05".parse().unwrap());
        let mut study = study(spec);
        let (cells, own) = (study.cells_mut(), vec![None; 3]);
        choose(cells, &own, 3000, 3);
        assert_eq!(chosen(cells), [500, 1500, 2500]);
        choose(cells, &own, 3000, 3000);
        assert_eq!(chosen(cells), (0..3000).collect::<Vec<u64>>());
        choose(cells, &own, 3000, 7);
        assert_eq!(cells.iter().map(|cell| cell.spec.member_count()).collect::<Vec<_>>(), [2, 3, 2]);
    }

    #[test]
    fn a_pilot_takes_members_that_are_to_run() {
        let only: Vec<u64> = (0..90).map(|i| 11 * i).collect();
        let mut study = study(Spec { curves: 1000, only: Some(only.clone()), ..Spec::default() });
        let own = vec![study.cells()[0].spec.only.clone()];
        choose(study.cells_mut(), &own, 90, 13);
        let chosen = chosen(study.cells());
        assert!(chosen.len() == 13 && chosen.iter().all(|member| only.contains(member)), "{chosen:?}");
        assert!(chosen[0] < 100 && chosen[12] > 880, "{chosen:?}");
    }

    fn seen(members: u64, share: f64, seconds: f64) -> PilotResult {
        PilotResult { counts: Pilot { members, seconds, ..Pilot::default() }, share, ..PilotResult::default() }
    }

    #[test]
    fn costs_are_extrapolated_from_the_two_largest_pilots() {
        let of = |pilots: &[PilotResult], all| extrapolated(pilots, all, |seen| seen.counts.seconds);
        // A fixed cost of 0.3 s, and 0.01 s per member.
        let pilots = [seen(10, 1.0, 0.4), seen(110, 1.0, 1.4)];
        assert!((of(&pilots, 1010).unwrap() - 10.4).abs() < 1e-12);
        // Half of the work was done.
        assert!((of(&[seen(10, 0.5, 1.0)], 30).unwrap() - 6.0).abs() < 1e-12);
        assert_eq!(of(&[seen(10, 1.0, 1.5)], 10), Some(1.5));
        assert_eq!(of(&[seen(10, 0.0, 2.0)], 10), None);
    }

    #[test]
    fn steps_of_fixed_length_are_certain_unless_members_stop() {
        let fixed = Spec { tau: Some(0.01.into()), t_end: Some(0.055.into()), ..Spec::default() };
        assert_eq!(certain_steps(study(fixed.clone()).cells()), Some(6.0));
        assert_eq!(certain_steps(study(Spec { stop_when_relaxed: Some(true), ..fixed }).cells()), None);
        assert_eq!(certain_steps(study(Spec { adaptive: Some(1e-3), ..Spec::default() }).cells()), None);
    }

    /// What a pilot finds that does not concern time, with dispatches of so many microseconds.
    fn found(spec: &Spec, work: f64, dispatch: u64) -> (u64, u64, u64, f64, f64) {
        let mut study = study(spec.clone());
        let cells = study.cells_mut();
        let blocks = Blocks::new(points(cells)).unwrap();
        let backend = CpuBackend::<f64>::new(blocks, Method::coloured(cells[0].spec.solver(), 1_000_000), 2).unwrap();
        let mut backend = backend.for_display(16, Duration::from_micros(dispatch));
        let limits =
            Limits { work, keeps_members: false, until: Instant::now() + Duration::from_secs(3600), stopped: &|| None };
        let sample = sample(cells, Precision::F64, &mut backend, &limits).unwrap();
        let seen = sample.pilots.last().unwrap().clone();
        (seen.counts.members, seen.counts.ended, seen.steps, seen.share, seen.work)
    }

    #[test]
    fn a_pilot_stops_at_the_same_point_however_long_dispatches_take() {
        let fixed = Spec { points: 40, tau: Some(1e-3.into()), ..Spec::default() };
        let sweeps = Spec { solver: Solver::GaussSeidel.into(), ..fixed.clone() };
        let adaptive = Spec { points: 40, adaptive: Some(1e-3), stop_when_relaxed: Some(true), ..Spec::default() };
        for (spec, work) in [(&fixed, 1e6), (&sweeps, 3e6), (&adaptive, 8e6), (&adaptive, 1e8)] {
            let expected = found(spec, work, 40_000);
            for dispatch in [1, 300] {
                assert_eq!(found(spec, work, dispatch), expected, "{spec:?}, {work}");
            }
            assert_ne!(found(spec, work / 8.0, 300), expected, "{spec:?}: the work does not matter");
        }
    }
}
