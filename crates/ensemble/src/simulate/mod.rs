//! The main loop: fill slots with members, advance them, collect their reports, refill.
//!
//! Nothing here depends on where the members are advanced or on how many are resident: a member's steps are its
//! own, it is paused at its output times, and rows are written in member order. A run may therefore be interrupted
//! between any two dispatches: the [`RunProgress`] then has all that [`resume`] needs to end it as it would have ended.

mod pool;
mod queue;
mod roster;

use std::{
    collections::{BTreeSet, VecDeque},
    iter::Peekable,
    time::Instant,
};

use crate::{Cell, Ended, RunProgress, Sink, SinkRequest, request::spec::Precision, trajectory::Trajectory};
use curvelax_backend::Backend;
use curvelax_base::error::{Error, Result};
use pool::Pool;
pub use pool::{MAX_HELD, states_at_once};
use queue::{MAX_WAIT, Queue};
use roster::Entering;
pub use roster::Roster;

/// Members that may wait for the first unfinished one, in multiples of the slots; beyond, no member is admitted.
const MEMBERS_AHEAD: usize = 8;

/// Maximum members that are created at once, and roughly that end at their creation between two calls of the sink.
const MAX_AT_ONCE: usize = 1000;

/// Bytes of rows above which all are passed to the sink before a checkpoint, to keep it small.
const MAX_KEPT: usize = 4 << 20;

/// Runs the members of `cells`, which form a [cohort](crate::study::Cohort), on `backend`, and passes each
/// to `sink` in member order.
///
/// The first members come with their nodes before, during and after the run, `portraits` of them over all cells.
pub fn simulate(
    cells: &[Cell],
    precision: Precision,
    backend: &mut dyn Backend,
    portraits: usize,
    sink: &mut dyn Sink,
) -> Result<()> {
    resume(cells, precision, backend, portraits, RunProgress::default(), sink)
}

/// Like [`simulate`], continuing from the progress of an earlier run of the same cells.
///
/// # Errors
/// Those of the back end and the sink, and [`Error::Request`] if members in `progress` are not those of `cells`.
pub fn resume(
    cells: &[Cell],
    precision: Precision,
    backend: &mut dyn Backend,
    portraits: usize,
    progress: RunProgress,
    sink: &mut dyn Sink,
) -> Result<()> {
    let roster = Roster::new(cells, precision, portraits);
    let mut simulation = Simulation::new(&roster, backend.slots(), backend.batches(), progress)?;
    let done = loop {
        match simulation.turn(backend, sink) {
            Ok(true) => {}
            Ok(false) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    let queue = &mut simulation.queue;
    if done.is_err() && !queue.kept {
        // Save the members that have ended; `done` already has the reason why the run ends.
        let _ = queue.checkpoint(None, sink);
    }
    done
}

/// Members that wait: their ranks, cells and indices.
type Waiting<'a> = Peekable<Box<dyn Iterator<Item = Entering> + 'a>>;

/// A run in turns, for a caller who has other things to do between them, such as a page in a browser; [`simulate`]
/// takes one after another.
pub struct Simulation<'a> {
    pool: Pool<'a>,
    queue: Queue,
    waiting: Waiting<'a>,
    /// Members that end early wait for those before them; this bounds how many.
    ahead: u64,
    /// The batch of the next turn, and those that are being advanced.
    batch: usize,
    on_the_way: Vec<bool>,
    /// Whether all rows in memory have been checked, since a checkpoint may hold as many as a run.
    is_relieved: bool,
    told: bool,
}

impl<'a> Simulation<'a> {
    /// Begins a run on a back end of so many slots in so many batches, or continues one.
    ///
    /// # Errors
    /// [`Error::Request`] if members in `progress` are not those of the roster.
    pub fn new(roster: &'a Roster<'a>, slots: usize, batches: usize, progress: RunProgress) -> Result<Simulation<'a>> {
        let cells = roster.cells;
        let RunProgress { next, early, resident } = progress;
        let pool = Pool {
            roster,
            resident: (0..slots).map(|_| None).collect(),
            paused: resident.unwrap_or_default(),
            held: 0,
        };
        let total = cells.iter().map(|cell| cell.spec.member_count()).sum();
        let [first, last] = [cells.first(), cells.last()].map(|cell| cell.map_or(0, |cell| cell.index));
        let is_own = |(rank, ended): (&u64, &Ended)| {
            (next..total).contains(rank) && (first..=last).contains(&ended.outcome.cell)
        };
        if next > total || !early.iter().all(is_own) {
            return Err(Error::Request(format!(
                "the checkpoint has members that are not among the {total} of the spec"
            )));
        }
        let ended: BTreeSet<u64> = early.keys().copied().collect();
        let members = cells.iter().enumerate().flat_map(|(cell, own)| own.members().map(move |member| (cell, member)));
        let left = (0..).zip(members).skip(next as usize).filter(move |(rank, _)| !ended.contains(rank));
        let waiting: Box<dyn Iterator<Item = _>> = Box::new(left);
        Ok(Simulation {
            pool,
            queue: Queue {
                total,
                ended: next + early.len() as u64,
                next,
                early,
                saved: Instant::now(),
                kept: false,
                told: Instant::now(),
            },
            waiting: waiting.peekable(),
            ahead: (MEMBERS_AHEAD * slots) as u64,
            batch: 0,
            on_the_way: vec![false; batches],
            is_relieved: false,
            told: false,
        })
    }

    /// Handles a batch, if it is back, and starts it again. Returns whether the run continues.
    ///
    /// # Errors
    /// Those of the back end and the sink, which end the run.
    pub fn turn(&mut self, backend: &mut dyn Backend, sink: &mut dyn Sink) -> Result<bool> {
        let Simulation { pool, queue, waiting, ahead, batch, on_the_way, is_relieved, told } = self;
        if !std::mem::replace(is_relieved, true) {
            pool.relieve(queue, MAX_HELD, sink)?;
        }
        // With two batches, one is being advanced while the other is handled.
        let size = backend.slots() / backend.batches();
        let slots = *batch * size..(*batch + 1) * size;
        if on_the_way[*batch] {
            if !backend.is_back(*batch, MAX_WAIT) {
                queue.tell(pool.share(), sink)?;
                *told = *told || queue.checkpoint_before_the_stop(sink)?;
                return Ok(true);
            }
            backend.finish(*batch)?;
            on_the_way[*batch] = false;
            pool.collect(backend, slots.clone(), queue, sink)?;
        }
        // The sink must be asked even if members end at once.
        let (mut over, most) = (0, MAX_AT_ONCE.min(states_at_once(pool.points())));
        let mut free: VecDeque<usize> = slots.clone().filter(|slot| pool.resident[*slot].is_none()).collect();
        while over < MAX_AT_ONCE {
            let next = |slot| Some((slot, waiting.next_if(|(rank, _)| *rank < queue.next + *ahead)?));
            let entering: Vec<_> = free.iter().copied().take(most).map_while(next).collect();
            if entering.is_empty() {
                break;
            }
            free.drain(..entering.len());
            let ended = pool.admit(backend, entering, queue, sink)?;
            over += ended.len();
            free.extend(ended);
        }
        queue.tell(pool.share(), sink)?;
        if pool.resident.iter().all(Option::is_none) && waiting.peek().is_none() {
            return Ok(false);
        }
        let request = sink.next_request();
        let continues = matches!(request, SinkRequest::Continue);
        let saved = match request {
            SinkRequest::Continue => Vec::new(),
            SinkRequest::Checkpoint => pool.old(queue.saved, Instant::now()),
            SinkRequest::Stop(_) => pool.occupied(),
        };
        // To save members in progress, all batches must be back.
        if !continues && (saved.is_empty() || !on_the_way.contains(&true)) {
            pool.relieve(queue, MAX_KEPT, sink)?;
            queue.checkpoint(Some(pool.pause(backend, &saved)?), sink)?;
            if let SinkRequest::Stop(error) = request {
                return Err(error);
            }
        } else if !continues {
            *told = *told || queue.checkpoint_before_the_stop(sink)?;
            *batch = (*batch + 1) % on_the_way.len();
            return Ok(true);
        }
        if pool.resident[slots].iter().any(Option::is_some) {
            backend.start(*batch)?;
            (on_the_way[*batch], queue.kept) = (true, false);
        }
        *batch = (*batch + 1) % on_the_way.len();
        Ok(true)
    }

    /// The members that are being advanced, each with its slot.
    pub fn resident(&self) -> impl Iterator<Item = (usize, &Trajectory<'a>)> {
        let resident = self.pool.resident.iter().enumerate();
        resident.filter_map(|(slot, own)| own.as_ref().map(|own| (slot, &own.trajectory)))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{Spec, Study};
    use curvelax_flow::scheme::{
        Parameters, State,
        member::{Counters, Report},
        run::Run,
    };

    /// A back end that accepts members and never returns them.
    struct Never;

    impl Backend for Never {
        fn slots(&self) -> usize {
            2
        }
        fn load(&mut self, _: usize, _: &Run<f64>) -> Result<()> {
            Ok(())
        }
        fn aim(&mut self, _: usize, _: u32, _: &Parameters<f64>) {}
        fn clear(&mut self, _: usize) {}
        fn batches(&self) -> usize {
            1
        }
        fn start(&mut self, _: usize) -> Result<()> {
            Ok(())
        }
        fn is_back(&mut self, _: usize, _: Duration) -> bool {
            false
        }
        fn finish(&mut self, _: usize) -> Result<()> {
            unreachable!("it is not back")
        }
        fn counters(&self, _: usize) -> Counters {
            unreachable!("it is not back")
        }
        fn report(&self, _: usize) -> Report<f64> {
            unreachable!("it is not back")
        }
        fn state(&mut self, _: usize) -> Result<State<f64>> {
            unreachable!("it is not back")
        }
    }

    /// Stops a run after this many notifications.
    struct Patience(u32);

    impl Sink for Patience {
        fn member(&mut self, _: &Ended) -> Result<()> {
            unreachable!("no member ends")
        }
        fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
            assert_eq!((done, total, share), (0, 3, 0.0));
            self.0 -= 1;
            if self.0 == 0 { Err(Error::Stopped("no patience".into())) } else { Ok(()) }
        }
    }

    #[test]
    fn a_sink_stops_a_run_between_dispatches_and_during_one() {
        let study = Study::new(Spec { curves: 3, ..Spec::default() }).unwrap();
        let cells = study.cells();
        for patience in [1, 2, 7] {
            let mut sink = Patience(patience);
            let stopped = simulate(cells, Precision::F64, &mut Never, 0, &mut sink).unwrap_err();
            assert_eq!((stopped.exit_code(), sink.0), (75, 0), "{stopped}");
        }
    }
}
