//! Predicts the cost of a run without making it: memory, disk space, dispatches, steps and time.
//!
//! Work cannot be predicted from a spec: the steps and sweeps of a member depend on its curve. Pilots therefore
//! run a few members, spread evenly over all cells, on the back end of the run and through the same loop, as far as a
//! fixed amount of work goes: some two seconds of it on two cores. Sizes follow from what they find and from the spec;
//! no clock has a part in them.

mod finer;
mod pilot;
mod size;

use std::time::{Duration, Instant};

use serde::Serialize;

use curvelax_backend::DeviceKind;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{LevelTimes, Spec, Study, study::Stage};
use curvelax_files::zarr;
use curvelax_study::placement::{ChosenBackend, OpeningWatch, Platform};
use finer::{FinerPilot, LevelGrowth};
pub use pilot::Pilot;
use pilot::{CohortSample, CohortWork, Limits, points, sample};
use size::Residents;

/// Work of the pilots of all cohorts, in updates of nodes: for each thread of the CPU, and on a GPU, which may be one
/// in software.
const WORK_PER_THREAD: f64 = 1.5e8;
const WORK_ON_GPU: f64 = 2e9;
const WORK_IN_SOFTWARE: f64 = 2e7;
/// The work of the pilots of the levels, relative to that.
const LEVELS: f64 = 0.25;
/// Maximum cohorts with a pilot: each gets its share of the work, and less would show nothing.
const MAX_PILOTS: usize = 20;
/// Time after which pilots are given up, so that no user waits for a step that takes minutes.
const PATIENCE: Duration = Duration::from_secs(60);

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
    /// Of the members, about how many need more nodes than they have; `None` if it is not known.
    pub finer_members: Option<u64>,
    /// Of outlines, members that may run besides on variations of their curves, each once for every variation.
    pub varied_members: u64,
    /// Most nodes that a member may have at a level.
    pub most_points: usize,
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

impl Estimate {
    /// Estimates the run of a study, each stage on its choice, that saves a checkpoint after each `interval`. An error
    /// of `stopped` ends it.
    ///
    /// # Errors
    /// Those of the run itself, and that of `stopped`.
    pub fn new(
        study: &Study,
        choices: Vec<ChosenBackend>,
        interval: Duration,
        stopped: &dyn Fn() -> Option<Error>,
    ) -> Result<Estimate> {
        let (stages, cells) = (study.stages(), study.cells());
        let members = study.member_count();
        let chunks = zarr::bytes_held(study.spec(), study.cells()[0].family.points());
        let chosen = with_pilots(study);
        let count_of = |levels: bool| chosen.iter().filter(|i| stages[**i].level.is_some() == levels).count().max(1);
        let [own_count, level_count] = [false, true].map(count_of);
        let until = Instant::now() + PATIENCE;
        let (mut opened, mut start_up, mut pilot) = (None, 0.0, Pilot::default());
        let (mut residents, mut in_pilots, mut held_rows): (Vec<Residents>, u64, bool) = (Vec::new(), 0, false);
        let (mut own, mut levels, mut finer) = (Vec::new(), Vec::new(), FinerPilot::default());
        let (finest, mut at_finest) = (finest(study), None);
        let wanted = |i: &usize| chosen.contains(i) || finest == Some(*i);
        for (i, choice) in choices.into_iter().enumerate().filter(|(i, _)| wanted(i)) {
            let stage = &stages[i];
            if stage.is_selective() {
                at_finest = Some(slots_at(&study.spec_of(stage)?, &choice)?);
                continue;
            }
            let mut cells = study.cells_of(stage, &LevelTimes::default())?.into_owned();
            let (precision, in_software) = (choice.precision, choice.is_software_gpu());
            let started = Instant::now();
            let (mut backend, platform) = choice.open_for(&cells, &OpeningWatch::default())?;
            start_up += started.elapsed().as_secs_f64();
            let work = match (platform.threads, in_software) {
                (Some(threads), _) => WORK_PER_THREAD * threads as f64,
                (None, true) => WORK_IN_SOFTWARE,
                (None, false) => WORK_ON_GPU,
            };
            let work = if stage.level.is_some() { LEVELS * work / level_count as f64 } else { work / own_count as f64 };
            let keeps_members = stage.level.is_some() && study.spec().refine;
            let CohortSample { work, pilots, rows: [each, in_pilot], reads_back } =
                sample(&mut cells, precision, backend.as_mut(), &Limits { work, keeps_members, until, stopped })?;
            let slots = backend.slots();
            let of = |members: u64, rows: f64| Residents {
                n: points(&cells),
                slots,
                count: members.min(slots as u64) as usize,
                rows,
                chunks: if stage.level.is_none() { chunks } else { 0 },
            };
            let largest = pilots.iter().map(|seen| seen.counts.members).max().unwrap_or(0);
            let in_pilot = of(largest, in_pilot);
            in_pilots = in_pilots.max(in_pilot.in_pilot(reads_back));
            // A driver and states that are read back take more than rows.
            let other = reads_back || platform.backend != DeviceKind::Cpu;
            held_rows |= in_pilot.rows() > size::MANY_ROWS && !other;
            if let Some(level) = stage.level {
                levels.push(work);
                pilots.first().into_iter().for_each(|seen| finer.add(level, &cells[0].spec, precision, seen));
                continue;
            }
            opened = Some(platform);
            residents.push(of(stage.members, each));
            pilots.iter().for_each(|seen| pilot.add(&seen.counts));
            own.push(work);
        }
        let platform = opened.ok_or_else(|| Error::Failed("a study has no cell".into()))?;
        // Stages without a pilot are assumed to be like those with one.
        let level_members = study.work() - members;
        let total = |works: &[CohortWork], of: fn(&CohortWork) -> f64| works.iter().map(of).sum::<f64>();
        let [scale, scale_levels] =
            [(members, &own), (level_members, &levels)].map(|(all, works)| match total(works, |work| work.members) {
                0.0 => 0.0,
                seen => all as f64 / seen,
            });
        let certain = stages.iter().filter(|stage| !stage.is_selective()).count();
        start_up *= certain as f64 / chosen.len() as f64;
        let share = finer.share(study).filter(|_| certain < stages.len());
        let finer_members = share.map(|[share, _]| share * members as f64);
        let varied = study.varied_members();
        let growth = LevelGrowth::of(study.spec());
        // A member of a level of which nothing is known costs what an own one does.
        let sum = |of: fn(&CohortWork) -> Option<f64>| {
            let known = |works: &[CohortWork]| works.iter().map(of).sum::<Option<f64>>();
            let all = scale * known(&own)?;
            let at_levels =
                known(&levels).map_or(all * level_members as f64 / members as f64, |work| scale_levels * work);
            let of_level = at_levels / level_members.max(1) as f64;
            let more = finer_members.map_or(0.0, |finer| growth.work(finer, of_level));
            Some(all + at_levels + more + growth.varied_work(varied, share.map_or(0.0, |[share, _]| share), of_level))
        };
        let seconds = sum(|work| work.seconds);
        // If none has ended yet, all may have one.
        let rated = if pilot.ended == 0 { 1.0 } else { pilot.rated as f64 / pilot.ended as f64 };
        let events = cells[0].spec.event.len() as u64;
        let at_levels = level_members as f64 + finer_members.unwrap_or(0.0) * finer::ROWS + varied;
        let level_rows = at_levels * (size::LEVEL_ROW + events as f64 * size::EVENT_ROW);
        let most = cells.iter().map(|cell| cell.family.points()).max().unwrap_or(0);
        // A run of unknown length may be long.
        let kept = seconds.is_none_or(|seconds| seconds > interval.as_secs_f64());
        let largest_cell = cells.iter().map(|cell| cell.spec.member_count()).max().unwrap_or(0);
        let timed = if pilot.ended == 0 { 1.0 } else { pilot.relaxed.max(pilot.rated) as f64 / pilot.ended as f64 };
        let explained = size::explaining(largest_cell, cells[0].spec.cell_features().len(), timed);
        let (most_points, slots) = (study.most_points(), residents.iter().map(|stage| stage.slots).max().unwrap_or(0));
        if let Some((n, slots)) = at_finest {
            let slots = slots.or(residents.first().map(|own| own.slots)).unwrap_or(1);
            let most = share.map_or(members as f64, |[_, most]| (most * members as f64).ceil());
            residents.push(Residents { n, slots, count: slots.min(most as usize), rows: 0.0, chunks: 0 });
        }
        let [series, nodes] = [total(&own, |work| work.series), total(&own, |work| work.nodes)];
        let steps = own.iter().map(|work| work.steps).sum::<Option<f64>>();
        let memory =
            size::memory(size::program(in_pilots, held_rows), members, rated, most, explained, &residents, kept);
        Ok(Estimate {
            members,
            cells: cells.len(),
            disk_bytes: size::disk(cells, members, rated, scale * series, scale * nodes) + level_rows as u64,
            memory_bytes: memory
                + level_members * size_of::<(u64, f64)>() as u64
                + events * (members + level_members) * size_of::<f64>() as u64,
            platform,
            slots,
            level_members,
            finer_members: finer_members.map(|finer| finer.ceil() as u64),
            varied_members: varied.ceil() as u64,
            most_points,
            steps_per_member: steps.map(|steps| steps / total(&own, |work| work.members).max(1.0)),
            dispatches: sum(|work| work.dispatches).map(|dispatches| dispatches.ceil() as u64),
            start_up_seconds: start_up,
            seconds,
            pilot,
        })
    }
}

/// The stages with a pilot: evenly spread, the last one among them, which has the study's own members, and the one with
/// the most nodes, which needs the most memory.
fn with_pilots(study: &Study) -> Vec<usize> {
    let stages = study.stages();
    let points = |stage: &Stage| points(&study.cells()[stage.range.clone()]);
    let own = (0..stages.len()).filter(|i| stages[*i].level.is_none());
    let largest = own.max_by_key(|i| points(&stages[*i]));
    // Which members run at finer levels is not known yet.
    let certain: Vec<usize> = (0..stages.len()).filter(|i| !stages[*i].is_selective()).collect();
    // Counted backwards.
    let spread = certain.iter().copied().rev().step_by(certain.len().div_ceil(MAX_PILOTS).max(1));
    let mut chosen: Vec<usize> = spread.chain(largest).collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

/// The stage of most nodes among those of which the members are not known yet.
fn finest(study: &Study) -> Option<usize> {
    let points = |i: &usize| study.spec_of(&study.stages()[*i]).map_or(0, |spec| spec.points);
    (0..study.stages().len()).filter(|i| study.stages()[*i].is_selective()).max_by_key(points)
}

/// Nodes of the members of `spec`, and how many of them are resident at once; a GPU is not opened for that.
fn slots_at(spec: &Spec, choice: &ChosenBackend) -> Result<(usize, Option<usize>)> {
    let slots = match choice.device.kind() {
        DeviceKind::Cpu => Some(choice.open(spec)?.0.slots()),
        DeviceKind::Gpu => None,
    };
    Ok((spec.points, slots))
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_ensemble::request::spec::BackendChoice;
    use curvelax_study::placement::{choose_all, settle};

    fn estimated(spec: Spec, stopped: &dyn Fn() -> Option<Error>) -> Result<Estimate> {
        let mut study = Study::new(Spec { backend: BackendChoice::Cpu, ..spec }).unwrap();
        let choices = choose_all(&study).unwrap();
        settle(&mut study, &choices);
        Estimate::new(&study, choices, Duration::MAX, stopped)
    }

    #[test]
    fn a_few_of_ten_million_members_are_run() {
        let spec = Spec { curves: 10_000_000, adaptive: Some(1e-3), stop_when_relaxed: Some(true), ..Spec::default() };
        let estimate = estimated(Spec { points: 32, ..spec }, &|| None).unwrap();
        assert_eq!((estimate.members, estimate.cells), (10_000_000, 1));
        assert!(estimate.memory_bytes > 300_000_000, "{estimate:?}");
        assert!((1000..1_000_000).contains(&estimate.pilot.members), "{estimate:?}");
        assert_eq!(estimate.pilot.ended, estimate.pilot.members);
    }

    /// In either order, the larger cell decides.
    #[test]
    fn cells_of_different_sizes_need_the_memory_of_the_largest() {
        let of = |points: &str| {
            let mut spec = Spec { curves: 2, adaptive: Some(1e-2), t_end: Some(1e-9.into()), ..Spec::default() };
            spec.sweep.set(format!("points={points}").parse().unwrap());
            let mut study = Study::new(Spec { backend: BackendChoice::Cpu, ..spec }).unwrap();
            let choices = choose_all(&study).unwrap();
            settle(&mut study, &choices);
            let chosen = with_pilots(&study);
            let residents = |i: &usize| study.cells()[study.stages()[*i].range.start].family.points();
            chosen.iter().map(residents).max().unwrap()
        };
        assert_eq!((of("64,2000"), of("2000,64")), (2000, 2000));
        let many = (0..50).map(|i| (64 + 64 * (i % 7 == 3) as u32 + i).to_string()).collect::<Vec<_>>().join(",");
        assert_eq!(of(&many), 64 + 64 + 45);
    }

    #[test]
    fn a_pilot_ends_when_it_is_asked_to() {
        let asked = || Some(Error::Interrupted("stopped by Ctrl-C".into()));
        assert_eq!(estimated(Spec::default(), &asked).unwrap_err().exit_code(), 130);
    }
}
