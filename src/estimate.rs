//! Predicts the cost of a run without making it: memory, disk space, dispatches, steps and time.
//!
//! Work cannot be predicted from a spec: the steps and sweeps of a member depend on its curve. A pilot therefore runs a
//! few members, spread evenly over all cells, on the back end of the run and through the same loop, for at most about
//! two seconds. The first pilot has as many members as run side by side. If these end early, a second has as many more
//! as there is time for. The difference between the two gives the time per additional member, free of fixed costs.

use std::time::{Duration, Instant};

use serde::Serialize;

use crate::{
    backend::Backend,
    ensemble::{
        Cell, Ended, Extent, Portrait, SeriesRow, Sink, Snapshot, Study, rows,
        spec::{Pace, Precision, Store, Tau},
    },
    error::{Error, Result},
    placement::{Choice, Platform},
    report::gallery::MAX_PANELS,
    results::{
        explained::{DRAWN, LEAST_MEMBERS, PICTURED, TIMES},
        tally::Rate,
    },
    schedule::Clock,
    scheme::{member, state::STATE_FIELDS},
    simulate::{MAX_HELD, simulate, states_at_once},
};

/// Time for the pilots of all cohorts.
const PILOT: Duration = Duration::from_secs(2);
/// The same for the levels.
const LEVEL_PILOT: Duration = Duration::from_millis(500);
/// Maximum cohorts with a pilot: each gets its share of the time, and less would show nothing.
const MAX_PILOTS: usize = 20;
/// Fraction of the remaining time that a larger pilot may use; it may run longer than predicted.
const FILLED: f64 = 0.6;

/// Memory of the idle program, in bytes.
const PROGRAM_BYTES: u64 = 10_000_000;
/// Numbers per node of a resident member: its state on the back end, and its initial nodes on the host.
const POOL_NUMBERS: usize = STATE_FIELDS + 4;
/// The same while a checkpoint is saved: the paused member, and its bytes.
const KEPT_NUMBERS: usize = 2 * STATE_FIELDS;
/// Bytes per node of the page and its pictures, up to the maximum number of nodes drawn.
const PAGE_BYTES: usize = 25_000;
/// Copies of the nodes of the members drawn.
const PORTRAIT_COPIES: usize = 3;
/// Additional bytes if rows go to disk before their members end: rows are written and read again. Measured.
const SPILL_BYTES: u64 = 6_000_000;

/// Bytes of a row of a table, measured: floats have 17 digits. A row of the snapshots is a node.
const SUMMARY_ROW: f64 = 337.0;
const RATES_ROW: f64 = 80.0;
const EVENT_ROW: f64 = 38.0;
const LEVEL_ROW: f64 = 55.0;
const SERIES_ROW: f64 = 166.0;
const NODE_ROW: f64 = 88.0;
/// Bytes of the tables of a cell: its statistics and its mean excess.
const CELL_BYTES: f64 = 2500.0;
/// Bytes of a number in the table of features, and of a row on what explains the times.
const FEATURE_BYTES: f64 = 20.3;
const EXPLAINED_ROW: f64 = 68.0;
/// Bytes of a member's dot against one feature, in the plot and in the page.
const DOT_BYTES: f64 = 160.0;
/// Bytes of plots and page, measured: without the members that are drawn, and for each of their nodes.
const PLOTS_BYTES: f64 = 100_000.0;
const DRAWN_NODE_BYTES: f64 = 355.0;
/// Bytes of the files that describe a store and of its last, partly filled chunks.
const STORE_BYTES: f64 = 50_000.0;

/// The predicted cost of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    /// Members of the run.
    pub members: u64,
    /// Its cells.
    pub cells: usize,
    /// Where it would run.
    pub platform: Platform,
    /// Maximum members resident at once, over all cohorts.
    pub slots: usize,
    /// Members that run at other resolutions besides, for the error of discretisation.
    pub level_members: u64,
    /// Peak resident size of the process.
    pub memory_bytes: u64,
    /// Size of the output folder at the end.
    pub disk_bytes: u64,
    /// Mean over the members; `None` if no member of the pilot has ended and there is no other clue.
    pub steps_per_member: Option<f64>,
    /// Dispatches; `None` if the pilot was over before any work was done.
    pub dispatches: Option<u64>,
    /// Time to open back ends and compile kernels.
    pub start_up_seconds: f64,
    /// Time of the rest of the run; `None` as for the dispatches.
    pub seconds: Option<f64>,
    /// The basis of the estimate.
    pub pilot: Pilot,
}

/// The pilots of all cohorts together.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Pilot {
    /// Members started.
    pub members: u64,
    /// Members that ended.
    pub ended: u64,
    /// Members that relaxed.
    pub relaxed: u64,
    /// Members that have a rate.
    pub rated: u64,
    /// Time used.
    pub seconds: f64,
}

/// The cost of some cohorts, and for how many members a pilot stands.
#[derive(Default)]
struct CohortWork {
    members: f64,
    seconds: Option<f64>,
    dispatches: Option<f64>,
    steps: Option<f64>,
    /// Rows of the series and snapshots.
    series: f64,
    snapshots: f64,
}

impl Estimate {
    /// Estimates the run of a study, each stage on its choice, that saves a checkpoint after each `interval`.
    ///
    /// # Errors
    /// Those of the run itself.
    pub fn new(study: &Study, choices: Vec<Choice>, interval: Duration) -> Result<Estimate> {
        let (stages, cells) = (study.stages(), study.cells());
        let members = study.member_count();
        let (mut opened, mut start_up, mut pilot) = (None, 0.0, Pilot::default());
        let (mut slots, mut resident) = (0, 0);
        let mut rows = [0.0_f64; 2];
        let (every, count) = (stages.len().div_ceil(MAX_PILOTS), stages.len());
        let of_levels = stages.iter().rev().step_by(every).filter(|stage| stage.level.is_some()).count();
        let of_members = count.div_ceil(every) - of_levels;
        let shares = [(PILOT, of_members), (LEVEL_PILOT, of_levels)].map(|(time, stages)| time / stages.max(1) as u32);
        let (mut own, mut levels) = (CohortWork::none(), CohortWork::none());
        // Counted backwards, so that the last stage, which has the study's own members, always has a pilot.
        let mut sampled: Vec<_> = stages.iter().zip(choices).rev().step_by(every).collect();
        sampled.reverse();
        for (stage, choice) in sampled {
            let mut cells = study.cells_of(stage)?.into_owned();
            let precision = choice.precision();
            let started = Instant::now();
            let (mut backend, platform) = choice.open_for(&cells)?;
            start_up += started.elapsed().as_secs_f64();
            let mut seen = Pilot::default();
            let budget = shares[usize::from(stage.level.is_some())];
            let (work, most, of_member) = sample(&mut cells, precision, backend.as_mut(), budget, &mut seen)?;
            if stage.level.is_some() {
                levels.add(&work);
                continue;
            }
            opened = Some(platform);
            slots = slots.max(backend.slots());
            pilot.add(&seen);
            rows = [0, 1].map(|i| rows[i].max(of_member[i]));
            resident = resident.max(most.min(backend.slots() as u64) as usize);
            own.add(&work);
        }
        let platform = opened.ok_or_else(|| Error::Failed("a study has no cell".into()))?;
        // Stages without a pilot are assumed to be like those with one.
        let level_members = study.work() - members;
        let [scale, scale_levels] = [(members, &own), (level_members, &levels)].map(|(all, work)| match work.members {
            0.0 => 0.0,
            seen => all as f64 / seen,
        });
        start_up *= every as f64;
        // A member of a level of which nothing is known costs what an own one does.
        let sum = |of: fn(&CohortWork) -> Option<f64>| {
            let all = scale * of(&own)?;
            Some(all + of(&levels).map_or(all * level_members as f64 / members as f64, |work| scale_levels * work))
        };
        let seconds = sum(|work| work.seconds);
        // If none has ended yet, all may have one.
        let rated = if pilot.ended == 0 { 1.0 } else { pilot.rated as f64 / pilot.ended as f64 };
        let events = cells[0].spec.event.len() as u64;
        let level_rows = level_members as f64 * (LEVEL_ROW + events as f64 * EVENT_ROW);
        Ok(Estimate {
            members,
            cells: cells.len(),
            disk_bytes: disk(cells, members, rated, scale * own.series, scale * own.snapshots) + level_rows as u64,
            memory_bytes: memory(
                members,
                rated,
                [slots, resident],
                rows,
                cells[0].spec.points,
                seconds.is_none_or(|seconds| seconds > interval.as_secs_f64()),
            ) + level_members * size_of::<(u64, f64)>() as u64
                + events * (members + level_members) * size_of::<f64>() as u64,
            platform,
            slots,
            level_members,
            steps_per_member: own.steps.map(|steps| steps / own.members.max(1.0)),
            dispatches: sum(|work| work.dispatches).map(|dispatches| dispatches.ceil() as u64),
            start_up_seconds: start_up,
            seconds,
            pilot,
        })
    }
}

impl Pilot {
    fn add(&mut self, other: &Pilot) {
        let Pilot { members, ended, relaxed, rated, seconds } = other;
        self.members += members;
        self.ended += ended;
        self.relaxed += relaxed;
        self.rated += rated;
        self.seconds += seconds;
    }
}

impl CohortWork {
    fn none() -> CohortWork {
        CohortWork { seconds: Some(0.0), dispatches: Some(0.0), steps: Some(0.0), ..CohortWork::default() }
    }

    fn add(&mut self, other: &CohortWork) {
        let add = |sum: Option<f64>, part: Option<f64>| Some(sum? + part?);
        self.members += other.members;
        self.series += other.series;
        self.snapshots += other.snapshots;
        self.seconds = add(self.seconds, other.seconds);
        self.dispatches = add(self.dispatches, other.dispatches);
        self.steps = add(self.steps, other.steps);
    }
}

/// The result of one pilot.
struct Seen {
    members: u64,
    /// Members that have ended, and the steps that they made.
    left: u64,
    relaxed: u64,
    rated: u64,
    steps: u64,
    /// Bytes of their rows.
    rows: f64,
    /// Rows of their series, and snapshots.
    series: usize,
    snapshots: usize,
    /// Fraction of the work that was done.
    share: f64,
    dispatches: u64,
    seconds: f64,
    until: Instant,
}

impl Seen {
    fn new(members: u64, until: Instant) -> Seen {
        Seen {
            members,
            left: 0,
            relaxed: 0,
            rated: 0,
            steps: 0,
            rows: 0.0,
            series: 0,
            snapshots: 0,
            share: 0.0,
            dispatches: 0,
            seconds: 0.0,
            until,
        }
    }
}

impl Sink for Seen {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.left += 1;
        self.relaxed += u64::from(ended.outcome.t_relax.is_some());
        self.rated += u64::from(ended.outcome.rate.is_some());
        self.steps += ended.outcome.steps;
        self.series += ended.rows.series.len();
        self.snapshots += ended.rows.snapshots.len();
        let spilled: u64 = ended.rows.spilled.iter().map(|extent| extent.length).sum();
        self.rows += ended.rows.bytes() as f64 + spilled as f64;
        Ok(())
    }

    /// Only the size of the rows is needed.
    fn spill(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        self.series += series.len();
        self.snapshots += snapshots.len();
        let length = rows::bytes_of(series.len(), snapshots.len(), snapshots.first().map_or(0, |first| first.x.len()));
        Ok(Some(Extent { length: length as u64, ..Extent::default() }))
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        self.share = share;
        self.dispatches += 1;
        match done < total && Instant::now() >= self.until {
            true => Err(Error::Stopped("the pilot is over".into())),
            false => Ok(()),
        }
    }
}

/// Runs pilots of a cohort. Returns the cost of all of it, the members of the largest pilot, and bytes of the rows of a
/// member at its end and in that pilot.
fn sample(
    cohort: &mut [Cell],
    precision: Precision,
    backend: &mut dyn Backend,
    budget: Duration,
    pilot: &mut Pilot,
) -> Result<(CohortWork, u64, [f64; 2])> {
    let until = Instant::now() + budget;
    let own: Vec<Option<Vec<u64>>> = cohort.iter().map(|cell| cell.spec.only.clone()).collect();
    let all: u64 = cohort.iter().map(|cell| cell.spec.member_count()).sum();
    let mut pilots: Vec<Seen> = Vec::new();
    let mut count = (backend.abreast() as u64).min(all);
    loop {
        choose(cohort, &own, all, count);
        let mut seen = Seen::new(count, until);
        let started = Instant::now();
        let stopped = match simulate(cohort, precision, backend, 0, &mut seen) {
            Err(Error::Stopped(_)) => true,
            done => done.map(|()| false)?,
        };
        seen.seconds = started.elapsed().as_secs_f64();
        let left = until.saturating_duration_since(Instant::now()).as_secs_f64();
        let more = (count as f64 * FILLED * left / seen.seconds.max(1e-6)) as u64;
        pilots.push(seen);
        // A pilot less than twice as large would show nothing new.
        if stopped || count == all || more < 2 * count {
            break;
        }
        count = more.min(all);
    }
    cohort.iter_mut().zip(own).for_each(|(cell, only)| cell.spec.only = only);
    for seen in &pilots {
        pilot.members += seen.members;
        pilot.ended += seen.left;
        pilot.relaxed += seen.relaxed;
        pilot.rated += seen.rated;
        pilot.seconds += seen.seconds;
    }
    let steps = pilots.iter().rfind(|seen| seen.left > 0).map(|seen| seen.steps as f64 / seen.left as f64);
    let ended = pilots.iter().rfind(|seen| seen.left > 0);
    let each = |count: fn(&Seen) -> usize| ended.map(|seen| count(seen) as f64 / seen.left as f64);
    let [most_series, most_snapshots] = most_rows(cohort);
    let work = CohortWork {
        members: all as f64,
        seconds: extrapolated(&pilots, all, |seen| seen.seconds),
        dispatches: extrapolated(&pilots, all, |seen| seen.dispatches as f64),
        steps: steps.or_else(|| certain_steps(cohort)).map(|each| each * all as f64),
        series: each(|seen| seen.series).unwrap_or(most_series) * all as f64,
        snapshots: each(|seen| seen.snapshots).unwrap_or(most_snapshots) * all as f64,
    };
    let rows = pilots.iter().rfind(|seen| seen.left > 0).map(|seen| seen.rows / seen.left as f64);
    let rows = rows.unwrap_or_else(|| all_rows(cohort));
    let share = pilots.last().map_or(1.0, |seen| seen.share.clamp(0.0, 1.0));
    Ok((work, count, [rows, share * rows]))
}

/// Bytes of the rows of a member that reaches the final time, the maximum over all cells.
fn all_rows(cohort: &[Cell]) -> f64 {
    let of_cell = |Cell { spec, family, .. }: &Cell| {
        let series = spec.series.map_or(0.0, |every| spec.final_time() / every + 1.0);
        rows::bytes_of(series as usize, spec.snapshots.len(), family.points()) as f64
    };
    cohort.iter().map(of_cell).fold(0.0, f64::max)
}

/// Rows of the series and snapshots of a member that reaches the final time, the maximum over all cells.
fn most_rows(cohort: &[Cell]) -> [f64; 2] {
    let series =
        cohort.iter().map(|Cell { spec, .. }| spec.series.map_or(0.0, |every| spec.final_time() / every + 1.0));
    let snapshots = cohort.iter().map(|Cell { spec, .. }| spec.snapshots.len() as f64);
    [series.fold(0.0, f64::max), snapshots.fold(0.0, f64::max)]
}

/// Bytes of the output folder at the end, with so many rows of the series and snapshots in all.
fn disk(cells: &[Cell], members: u64, rated: f64, series: f64, snapshots: f64) -> u64 {
    let Some(Cell { spec, family, .. }) = cells.first() else { return 0 };
    let nodes = snapshots * family.points() as f64;
    let nodes = match spec.store {
        Store::Zarr if nodes == 0.0 => 0.0,
        Store::Csv => nodes * NODE_ROW,
        // x, y, k and r.
        Store::Zarr => STORE_BYTES + nodes * 4.0 * size_of::<f64>() as f64,
    };
    let drawn = members.min(MAX_PANELS as u64) as f64 * family.points().min(Portrait::MAX_NODES) as f64;
    let events = spec.event.len() as f64 * EVENT_ROW;
    let tables = members as f64 * (SUMMARY_ROW + rated * RATES_ROW + events) + series * SERIES_ROW + nodes;
    let features = spec.cell_features().len() as f64;
    let explained = members as f64 * features * FEATURE_BYTES + explained(features, cells.len() as f64, members as f64);
    (tables + explained + cells.len() as f64 * CELL_BYTES + PLOTS_BYTES + drawn * DRAWN_NODE_BYTES) as u64
}

/// Bytes of what explains the times: tables and dots, if cells have enough members.
fn explained(features: f64, cells: f64, members: f64) -> f64 {
    let rows = TIMES.len() as f64 * cells;
    match members < LEAST_MEMBERS as f64 * cells {
        true => rows * EXPLAINED_ROW,
        false => rows * features * EXPLAINED_ROW + members.min(DRAWN as f64) * PICTURED as f64 * DOT_BYTES,
    }
}

/// The cost of `all` members from that of the pilots, each scaled to its end.
fn extrapolated(pilots: &[Seen], all: u64, cost: impl Fn(&Seen) -> f64) -> Option<f64> {
    let whole = |seen: &Seen| (seen.share > 0.0).then(|| cost(seen) / seen.share.min(1.0));
    let known: Vec<(f64, f64)> = pilots.iter().filter_map(|seen| Some((seen.members as f64, whole(seen)?))).collect();
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
        Pace::Fixed(Tau::Step(tau)) if !spec.stops_when_relaxed() => {
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

/// Peak resident size in bytes of a run of `members` of `n` nodes, from that of this process, which had `resident` of
/// up to `slots` members in its pool. `rows` are the bytes of rows of a member at its end, and in this process: above
/// [`MAX_HELD`] for the whole pool they go to disk. Checkpoints may be saved during the run (`kept`).
///
/// The peak is at the end of the run, with a full pool and the tally, or after it, with the statistics and the charts
/// but no pool. For each member the tally has its time and two numbers of half size about its mesh; for a fraction
/// `rated` also its rate and that of theory. Times are sorted in place, and rates one number at a time; the number that
/// is drawn replaces them. A chart sorts the numbers that it shows.
fn memory(members: u64, rated: f64, [slots, resident]: [usize; 2], rows: [f64; 2], n: usize, kept: bool) -> u64 {
    let numbers = |count: usize| (count * size_of::<f64>()) as u64;
    let pool = |slots: usize| numbers(POOL_NUMBERS * n * slots);
    let drawn = usize::try_from(members).unwrap_or(usize::MAX).min(MAX_PANELS);
    let shown = n.min(Portrait::MAX_NODES);
    let portraits = numbers(2 * shown * (member::PARTS + 1) * drawn);
    let page = (PAGE_BYTES * shown * drawn / MAX_PANELS) as u64;
    let rated = (rated * members as f64) as u64;
    let tally = members * (size_of::<f64>() + 2 * size_of::<f32>()) as u64 + rated * size_of::<Rate>() as u64;
    let [fitted, charted] = [rated, members.saturating_sub(rated)].map(|count| count * size_of::<f64>() as u64);
    let statistics = fitted.max(charted);
    let held = |each: f64, members: usize| (each * members as f64).min(MAX_HELD as f64) as u64;
    let in_pilot = pool(resident) + held(rows[1], resident);
    let program = peak_resident().map_or(PROGRAM_BYTES, |peak| peak.saturating_sub(in_pilot));
    let full = usize::try_from(members).unwrap_or(usize::MAX).min(slots);
    let all_held = held(rows[0], full);
    let spilling = if all_held < MAX_HELD as u64 { 0 } else { SPILL_BYTES };
    let read_back = |members: usize| numbers(STATE_FIELDS * n * members.min(states_at_once(n)));
    // Members that are drawn are read back for each of their pictures.
    let passing = if kept { numbers(KEPT_NUMBERS * n * full) + read_back(full) } else { read_back(drawn.min(full)) };
    let running = pool(full) + passing + portraits + all_held + spilling;
    let reporting = PORTRAIT_COPIES as u64 * portraits + page + statistics;
    program + tally + running.max(reporting)
}

/// Maximum resident size of this process so far, in bytes, if the system reports it.
pub fn peak_resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes << 10)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        ensemble::{Spec, spec::BackendChoice},
        placement::{choose_all, settle},
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

    fn seen(members: u64, share: f64, seconds: f64) -> Seen {
        Seen { share, seconds, ..Seen::new(members, Instant::now()) }
    }

    #[test]
    fn costs_are_extrapolated_from_the_two_largest_pilots() {
        let of = |pilots: &[Seen], all| extrapolated(pilots, all, |seen| seen.seconds);
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

    #[test]
    fn ten_million_members_are_estimated_without_room_for_them() {
        let before = peak_resident();
        let spec = Spec { curves: 10_000_000, adaptive: Some(1e-3), stop_when_relaxed: Some(true), ..Spec::default() };
        let mut study = study(Spec { backend: BackendChoice::Cpu, points: 32, ..spec });
        let choices = choose_all(&study).unwrap();
        settle(&mut study, &choices);
        let estimate = Estimate::new(&study, choices, Duration::MAX).unwrap();
        assert_eq!((estimate.members, estimate.cells), (10_000_000, 1));
        assert!(estimate.memory_bytes > 300_000_000, "{estimate:?}");
        assert!(estimate.pilot.members < 5_000_000 && estimate.pilot.seconds < 60.0, "{estimate:?}");
        // Memory predicted is not memory used; other tests run at the same time.
        if let (Some(before), Some(after)) = (before, peak_resident()) {
            assert!(after - before < estimate.memory_bytes / 4, "{before} to {after}");
        }
    }
}
