//! Measures how fast a back end advances curves, in curve-steps per second.
//!
//! A curve-step is one step of the paper's scheme for one curve; an attempt of an adaptive step makes several. A
//! [`Bench`] fills the slots of a back end with members of the default family and advances them through the same calls
//! as a run: `load`, `aim`, `advance`, and a look at the counters. Other work of a run (making members, checking for
//! crossings, outputs) is left out. All numbers count steps made, not steps requested.

use std::time::{Duration, Instant};

use curvelax_base::threads::HostThreads;

use crate::{
    backend::Backend,
    curve::Modes,
    ensemble::{Family, Spec, Status},
    error::{Error, Result},
    number::BIG,
    placement::{self, Platform},
    schedule::Outputs,
    scheme::{
        member::{Counters, Report},
        run::Run,
    },
    simulate::states_at_once,
    trajectory::Trajectory,
};

/// Number of different members; further slots repeat them, so that filling a large device costs little.
const MEMBERS: usize = 256;
/// Minimum advances in a window, if the back end leaves the choice: a window that ends late says little.
const ADVANCES_PER_WINDOW: u32 = 4;
/// Minimum nodes of a perturbed ellipse: a mode needs four.
const FEWEST_POINTS: usize = 8;

/// Returns the spec of a case: the default ensemble with `points` nodes and only the modes that these resolve.
///
/// # Errors
/// [`Error::Request`] if a key is out of range.
pub fn spec(points: usize, spec: Spec) -> Result<Spec> {
    if points < FEWEST_POINTS {
        let problem = "too few nodes for a perturbed ellipse";
        return Err(Error::value("points", points, problem, &format!("use {FEWEST_POINTS} or more")));
    }
    let modes = Modes { low: 2, high: spec.modes.high.min((points / 4) as u32) };
    Spec { points, modes, ..spec }.validate()
}

/// A running back end with full slots.
pub struct Bench {
    backend: Box<dyn Backend>,
    /// Where it runs.
    pub platform: Platform,
    members: Vec<Run<f64>>,
    threads: HostThreads,
    /// Curve-steps of each slot since its member was loaded.
    made: Vec<u64>,
    /// Steps from one aim to the next; [`u32::MAX`] if the back end pauses earlier by itself.
    stride: u32,
    /// Time from opening to the end of the first step, including the compilation of kernels.
    pub start_up: Duration,
}

/// The work done in a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct BenchSample {
    /// Time taken.
    pub elapsed: Duration,
    /// Curve-steps.
    pub steps: u64,
    /// Sweeps on curvature and position systems.
    pub sweeps: u64,
    /// Some member stopped before its goal.
    paused: bool,
}

impl Bench {
    /// Opens the back end that `spec` asks for, fills it with up to `spec.curves` members, and warms it up for a
    /// `window`.
    ///
    /// # Errors
    /// [`Error::Request`] if the back end does not support the spec, [`Error::Device`] if it fails, [`Error::Failed`]
    /// if a member does.
    pub fn open(spec: &Spec, window: Duration) -> Result<Bench> {
        let choice = placement::choose(spec)?;
        let precision = choice.precision;
        let family = Family::new(spec)?;
        let count = usize::try_from(spec.curves).unwrap_or(usize::MAX);
        let member = |index: usize| {
            let mut run = Trajectory::new(family.member(index as u64)?, spec, precision, &Outputs::default()).launch();
            // Nothing checks for crossings here, so members need not wait for that.
            run.parameters.look_at = BIG;
            Ok(run)
        };
        let members = (0..count.min(MEMBERS)).map(member).collect::<Result<Vec<_>>>()?;
        let started = Instant::now();
        let (backend, platform) = choice.open(spec)?;
        let made = vec![0; count.min(backend.slots())];
        let threads = HostThreads::new(spec.threads.unwrap_or(0));
        let mut bench = Bench { backend, platform, members, threads, made, stride: 1, start_up: Duration::ZERO };
        bench.load((0..bench.made.len()).collect())?;
        bench.advance()?;
        bench.start_up = started.elapsed();
        bench.find_stride(window)?;
        bench.sample(window)?;
        Ok(bench)
    }

    /// Number of members running side by side.
    pub fn curves(&self) -> usize {
        self.made.len()
    }

    /// Advances for at least `window`.
    ///
    /// # Errors
    /// Those of [`Bench::open`].
    pub fn sample(&mut self, window: Duration) -> Result<BenchSample> {
        let mut total = BenchSample::default();
        while total.elapsed < window {
            let BenchSample { elapsed, steps, sweeps, .. } = self.advance()?;
            total.elapsed += elapsed;
            total.steps += steps;
            total.sweeps += sweeps;
        }
        Ok(total)
    }

    /// Doubles the stride until an advance uses its share of a window, or the back end pauses earlier.
    fn find_stride(&mut self, window: Duration) -> Result<()> {
        while self.stride < u32::MAX {
            let BenchSample { elapsed, paused, .. } = self.advance()?;
            if elapsed > window / ADVANCES_PER_WINDOW {
                break;
            }
            self.stride = if paused { u32::MAX } else { self.stride.saturating_mul(2) };
        }
        Ok(())
    }

    /// Advances all members once, and aims or replaces those that reached their goal.
    fn advance(&mut self) -> Result<BenchSample> {
        let started = Instant::now();
        self.backend.advance()?;
        let (mut sample, mut over) = (BenchSample::default(), Vec::new());
        for slot in 0..self.curves() {
            let (run, counters) = (&self.members[slot % self.members.len()], self.backend.counters(slot));
            let made = made(run, &counters);
            sample.steps += made - self.made[slot];
            sample.sweeps += u64::from(counters.sweeps_k) + u64::from(counters.sweeps_x);
            self.made[slot] = made;
            if let Some(status) = Status::ALL.into_iter().find(|status| *status as u32 == counters.status) {
                let (member, steps) = (slot % self.members.len(), counters.steps);
                let what = format!("member {member} ended {} after {steps} steps; use other --points", status.name());
                return Err(Error::Failed(what));
            }
            if counters.steps < counters.goal {
                sample.paused = true;
            } else if is_at_end(run, &counters, &self.backend.report(slot)) {
                over.push(slot);
            } else {
                let goal = counters.steps.saturating_add(self.stride).min(run.counters.goal);
                self.backend.aim(slot, goal, &run.parameters);
            }
        }
        self.load(over)?;
        sample.elapsed = started.elapsed();
        Ok(sample)
    }

    /// Loads new members into these slots, some at a time.
    fn load(&mut self, slots: Vec<usize>) -> Result<()> {
        for part in slots.chunks(states_at_once(self.members[0].state.curve.len())) {
            let of_slot = |slot: usize| {
                let mut run = self.members[slot % self.members.len()].clone();
                run.counters.goal = run.counters.goal.min(self.stride);
                self.made[slot] = 0;
                (slot, run)
            };
            let runs = part.iter().copied().map(of_slot).collect();
            self.backend.load_all(runs, &self.threads)?;
        }
        Ok(())
    }
}

/// Curve-steps since the start.
fn made(run: &Run<f64>, counters: &Counters) -> u64 {
    u64::from(if run.parameters.adaptive > 0.0 { counters.solves } else { counters.steps })
}

fn is_at_end(run: &Run<f64>, counters: &Counters, report: &Report<f64>) -> bool {
    let (p, progress) = (&run.parameters, &report.progress);
    match p.adaptive > 0.0 {
        true => (progress.time_high, progress.time_low) == (p.end_high, p.end_low),
        false => counters.steps >= run.counters.goal,
    }
}

#[cfg(test)]
mod tests {
    use std::{cell::Cell, rc::Rc};

    use super::*;
    use crate::{
        backend::DeviceKind,
        number::Precision,
        scheme::{Parameters, State},
    };

    /// Makes at most five steps per call, with 9 sweeps each, and counts steps and loads.
    struct Fives {
        counters: [Counters; 2],
        steps: Rc<Cell<u64>>,
        loads: Rc<Cell<u32>>,
    }

    impl Backend for Fives {
        fn slots(&self) -> usize {
            2
        }
        fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
            self.counters[slot] = run.counters;
            self.loads.set(self.loads.get() + 1);
            Ok(())
        }
        fn aim(&mut self, slot: usize, goal: u32, _: &Parameters<f64>) {
            self.counters[slot].goal = goal;
        }
        fn clear(&mut self, _: usize) {}
        fn batches(&self) -> usize {
            1
        }
        fn start(&mut self, _: usize) -> Result<()> {
            Ok(())
        }
        fn finish(&mut self, _: usize) -> Result<()> {
            for counters in &mut self.counters {
                let steps = (counters.goal - counters.steps).min(5);
                counters.steps += steps;
                (counters.sweeps_k, counters.sweeps_x) = (4 * steps, 5 * steps);
                self.steps.set(self.steps.get() + u64::from(steps));
            }
            Ok(())
        }
        fn counters(&self, slot: usize) -> Counters {
            self.counters[slot]
        }
        fn report(&self, _: usize) -> Report<f64> {
            Report::default()
        }
        fn state(&mut self, _: usize) -> Result<State<f64>> {
            unreachable!("a measurement reads no states")
        }
    }

    /// A bench over [`Fives`] whose members end after 12 steps, with its counters of steps and loads.
    fn fives(stride: u32) -> (Bench, Rc<Cell<u64>>, Rc<Cell<u32>>) {
        let spec = spec(32, Spec { t_end: Some(0.012.into()), curves: 2, ..Spec::default() }).unwrap();
        let member = Family::new(&spec).unwrap().member(0).unwrap();
        let run = Trajectory::new(member, &spec, Precision::F64, &Outputs::default()).launch();
        let (steps, loads) = (Rc::default(), Rc::default());
        let backend = Fives { counters: [Counters::default(); 2], steps: Rc::clone(&steps), loads: Rc::clone(&loads) };
        let platform = Platform {
            backend: DeviceKind::Cpu,
            adapter: None,
            driver: None,
            device_type: None,
            precision: Precision::F64,
            reason: "a test".into(),
            threads: None,
        };
        let (members, start_up) = (vec![run], Duration::ZERO);
        let (backend, threads, made) = (Box::new(backend), HostThreads::new(1), vec![0; 2]);
        let mut bench = Bench { backend, platform, members, threads, made, stride, start_up };
        bench.load(vec![0, 1]).unwrap();
        (bench, steps, loads)
    }

    #[test]
    fn what_is_counted_is_what_was_made_also_over_the_ends_of_members() {
        for stride in [1, 3, 4, u32::MAX] {
            let (mut bench, steps, loads) = fives(stride);
            let mut total = BenchSample::default();
            for _ in 0..100 {
                let sample = bench.advance().unwrap();
                total.steps += sample.steps;
                total.sweeps += sample.sweeps;
                assert_eq!(sample.paused, stride == u32::MAX && sample.steps == 10, "{sample:?}");
            }
            assert_eq!((total.steps, total.sweeps), (steps.get(), 9 * steps.get()), "stride {stride}");
            assert_eq!(u64::from(loads.get()), 2 + steps.get() / 12, "stride {stride}");
            assert!(loads.get() > 10);
        }
    }

    #[test]
    fn an_adaptive_step_counts_as_the_solves_that_it_made() {
        let mut run = fives(1).0.members[0].clone();
        let counters = Counters { steps: 2, rejected: 1, solves: 45, ..Counters::default() };
        assert_eq!(made(&run, &counters), 2);
        run.parameters.adaptive = 1e-3;
        assert_eq!(made(&run, &counters), 45);
    }

    #[test]
    fn a_back_end_that_pauses_by_itself_is_left_to_its_own_pace() {
        let (mut bench, steps, _) = fives(1);
        bench.find_stride(Duration::from_secs(1000)).unwrap();
        assert_eq!(bench.stride, u32::MAX);
        assert!(steps.get() <= 50, "it was asked for more and more over {} steps", steps.get());
    }

    #[test]
    fn a_member_that_fails_ends_the_measurement_by_name() {
        let (mut bench, ..) = fives(1);
        let mut run = bench.members[0].clone();
        run.counters.status = Status::Singular as u32;
        bench.backend.load(1, &run).unwrap();
        let message = bench.advance().unwrap_err().to_string();
        assert!(message.starts_with("member 0 ended singular after 5 steps"), "{message}");
    }
}
