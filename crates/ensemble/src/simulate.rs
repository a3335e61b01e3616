//! The main loop: fill slots with members, advance them, collect their reports, refill.
//!
//! Nothing here depends on where the members are advanced or on how many are resident: a member's steps are its
//! own, it is paused at its output times, and rows are written in member order. A run may therefore be interrupted
//! between any two dispatches: the [`RunProgress`] then has all that [`resume`] needs to end it as it would have ended.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    iter::Peekable,
    ops::Range,
    time::{Duration, Instant},
};

use crate::{
    Cell, Ended, Paused, Rows, RunProgress, Sink, SinkRequest,
    outcome::linear_rate,
    request::spec::Precision,
    schedule::{Outputs, grid},
    trajectory::{Trajectory, settling_times},
};
use curvelax_backend::Backend;
use curvelax_base::{
    error::{Error, Result},
    threads::HostThreads,
};
use curvelax_flow::scheme::{
    Parameters, member,
    run::Run,
    state::{STATE_FIELDS, State},
};

/// Members that may wait for the first unfinished one, in multiples of the slots; beyond, no member is admitted.
const MEMBERS_AHEAD: usize = 8;

/// Interval at which the sink is notified, and may stop the run, during longer dispatches.
const MAX_WAIT: Duration = Duration::from_millis(200);

/// Maximum members that are created at once, and roughly that end at their creation between two calls of the sink.
const MAX_AT_ONCE: usize = 1000;

/// Maximum states read back at once for a checkpoint, and their maximum bytes.
const READ_BACK: usize = 512;
const BYTES_READ_BACK: usize = 64 << 20;

/// Bytes of rows in memory above which all are passed to the sink; also the maximum of one member.
pub const MAX_HELD: usize = 32 << 20;
const MAX_OF_ONE: usize = 8 << 20;
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

/// The members of a [`Simulation`], and when they leave something during it.
pub struct Roster<'a> {
    cells: &'a [Cell],
    precision: Precision,
    /// For each cell: for members without a portrait, and for those with one.
    outputs: [Vec<Outputs>; 2],
    portraits: usize,
    threads: HostThreads,
}

impl<'a> Roster<'a> {
    /// Lists the members of `cells` as [`simulate`] does.
    pub fn new(cells: &'a [Cell], precision: Precision, portraits: usize) -> Roster<'a> {
        let outputs = |framed: bool| -> Vec<_> {
            let of_cell = |Cell { spec, .. }: &Cell| {
                // The pictures show the start and the end anyway.
                let inside = if framed { member::TIMES } else { 0 };
                let frames: Vec<f64> = grid(spec.final_time()).skip(1).take(inside).collect();
                let energies = settling_times(spec);
                Outputs::with_energies(spec.final_time(), spec.series, [&spec.snapshots, &frames, &energies])
            };
            cells.iter().map(of_cell).collect()
        };
        let threads = HostThreads::new(cells.first().and_then(|cell| cell.spec.threads).unwrap_or(0));
        Roster { cells, precision, outputs: [outputs(false), outputs(true)], portraits, threads }
    }

    /// Creates a member at its start.
    fn create(&self, (cell, index): (usize, u64)) -> Result<Trajectory<'_>> {
        let own = &self.cells[cell];
        let each = (self.portraits / self.cells.len().max(1)).max(1);
        // The same members whatever their shard.
        let portrait = cell < self.portraits && own.place(index) < each as u64;
        let outputs = &self.outputs[usize::from(portrait)][cell];
        let mut trajectory = Trajectory::new(own.member(index)?, &own.spec, self.precision, outputs);
        trajectory.keep_portrait(portrait);
        Ok(trajectory)
    }

    /// Prepares a member, paused or new, for a back end, or ends it if there is nothing to do.
    fn admit(&self, who: (usize, u64), paused: Option<Paused>) -> Result<Admitted<'_>> {
        let mut trajectory = self.create(who)?;
        if trajectory.is_over() {
            return Ok(Admitted::Over(Box::new(self.end(trajectory, None))));
        }
        paused.map_or(Ok(()), |paused| trajectory.resume_from(paused))?;
        let run = trajectory.launch();
        Ok(Admitted::Runs(Box::new((trajectory, run))))
    }

    /// Ends a member. What theory predicts may depend on when it relaxed.
    fn end(&self, trajectory: Trajectory, last: Option<&State<f64>>) -> Ended {
        let mut ended = trajectory.end(last);
        // Not all cells have a level.
        let at = self.cells.binary_search_by_key(&ended.outcome.cell, |cell| cell.index);
        ended.outcome.rate_theory = at.ok().and_then(|at| {
            let cell = &self.cells[at];
            let values = cell.spec.values_of(ended.outcome.member, cell.index).ok()?;
            linear_rate::rate_of(&cell.spec, &values, &ended.outcome)
        });
        ended
    }

    /// Sets the next goal of a member whose output times have been served, or ends it.
    fn proceed<'b>(&self, own: Resident<'b>, state: Option<&State<f64>>) -> Served<'b> {
        if own.trajectory.is_over() {
            return Served::Over(own.rank, Box::new(self.end(own.trajectory, state)));
        }
        let aim = own.trajectory.next_aim();
        Served::Runs(own, aim)
    }
}

/// What has become of a member at its creation.
enum Admitted<'a> {
    Over(Box<Ended>),
    Runs(Box<(Trajectory<'a>, Run<f64>)>),
}

/// The next goal of a member, as a number of steps, and the parameters until then.
type Aim = (u32, Parameters<f64>);

/// What has become of a member after a dispatch.
enum Served<'a> {
    /// With its rank.
    Over(u64, Box<Ended>),
    /// With another goal, if it has one.
    Runs(Resident<'a>, Option<Aim>),
    /// Its rows fill the memory that it has before all output times are served; with its state.
    Full(Resident<'a>, Option<State<f64>>),
}

/// Members that wait: their ranks, cells and indices.
type Waiting<'a> = Peekable<Box<dyn Iterator<Item = Entering> + 'a>>;

/// The rank of a member in its run, its cell and its index.
type Entering = (u64, (usize, u64));

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
                queue.tell(pool, sink)?;
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
        queue.tell(pool, sink)?;
        if pool.resident.iter().all(Option::is_none) && waiting.peek().is_none() {
            return Ok(false);
        }
        let request = sink.next_request();
        let continues = matches!(request, SinkRequest::Continue);
        if matches!(request, SinkRequest::Checkpoint) && pool.are_young(queue.saved, Instant::now()) {
            queue.checkpoint(None, sink)?;
        } else if !continues && !on_the_way.contains(&true) {
            // A checkpoint of members in progress needs all batches back.
            pool.relieve(queue, MAX_KEPT, sink)?;
            queue.checkpoint(Some(pool.pause(backend)?), sink)?;
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

/// Returns how many states of `n` nodes may be read back at once.
pub fn states_at_once(n: usize) -> usize {
    (BYTES_READ_BACK / (STATE_FIELDS * size_of::<f64>() * n)).max(1)
}

/// A member in a slot.
struct Resident<'a> {
    /// Its rank in this run.
    rank: u64,
    trajectory: Trajectory<'a>,
    /// When it began; none if it continues from a checkpoint.
    begun: Option<Instant>,
}

/// The resident members of a run.
struct Pool<'a> {
    roster: &'a Roster<'a>,
    resident: Vec<Option<Resident<'a>>>,
    /// Members that continue from a checkpoint, by rank.
    paused: BTreeMap<u64, Paused>,
    /// Bound on the bytes of rows in memory, including members that ended early.
    held: usize,
}

impl<'a> Pool<'a> {
    /// Puts members into free slots, each with its rank in this run; returns the slots of those that end at once,
    /// because there is nothing to do.
    fn admit(
        &mut self,
        backend: &mut dyn Backend,
        entering: Vec<(usize, Entering)>,
        queue: &mut Queue,
        sink: &mut dyn Sink,
    ) -> Result<Vec<usize>> {
        let roster = self.roster;
        let with_paused = |(slot, (rank, who))| (slot, rank, who, self.paused.remove(&rank));
        let entering = entering.into_iter().map(with_paused).collect();
        let admitted = roster.threads.map(entering, |(slot, rank, who, paused)| {
            let begun = paused.is_none().then(Instant::now);
            (slot, rank, begun, roster.admit(who, paused))
        });
        let (mut over, mut runs, mut failed) = (Vec::new(), Vec::new(), Ok(()));
        for (slot, rank, begun, admitted) in admitted {
            match admitted {
                Ok(Admitted::Over(ended)) => {
                    over.push(slot);
                    queue.leave(rank, *ended, sink)?;
                }
                Ok(Admitted::Runs(own)) => {
                    let (mut trajectory, run) = *own;
                    self.held += trajectory.rows().bytes();
                    self.resident[slot] = Some(Resident { rank, trajectory, begun });
                    runs.push((slot, run));
                }
                Err(error) => {
                    failed = Err(error);
                    break;
                }
            }
        }

        backend.load_all(runs, &roster.threads)?;
        failed.map(|()| over)
    }

    /// Nodes of a member.
    fn points(&self) -> usize {
        self.roster.cells.first().map_or(1, |cell| cell.family.points())
    }

    /// All unfinished members; none may be in a batch that is being advanced.
    fn pause(&self, backend: &mut dyn Backend) -> Result<BTreeMap<u64, Paused>> {
        let occupied = self.resident.iter().enumerate().filter_map(|(slot, own)| Some((slot, own.as_ref()?)));
        let occupied: Vec<_> = occupied.collect();
        let mut all = self.paused.clone();
        for part in occupied.chunks(states_at_once(self.points()).min(READ_BACK)) {
            let slots: Vec<usize> = part.iter().map(|(slot, _)| *slot).collect();
            for ((slot, own), state) in part.iter().zip(backend.states(&slots)?) {
                all.insert(own.rank, own.trajectory.pause(backend.counters(*slot), backend.report(*slot), &state));
            }
        }
        Ok(all)
    }

    /// Processes the members in `slots`: serves their output times, and sets their next goals or lets them leave.
    fn collect(
        &mut self,
        backend: &mut dyn Backend,
        slots: Range<usize>,
        queue: &mut Queue,
        sink: &mut dyn Sink,
    ) -> Result<()> {
        let occupied: Vec<usize> = slots.filter(|slot| self.resident[*slot].is_some()).collect();
        occupied
            .chunks(states_at_once(self.points()))
            .try_for_each(|part| self.collect_part(backend, part, queue, sink))
    }

    fn collect_part(
        &mut self,
        backend: &mut dyn Backend,
        slots: &[usize],
        queue: &mut Queue,
        sink: &mut dyn Sink,
    ) -> Result<()> {
        let mut wanted = Vec::new();
        for slot in slots.iter().copied() {
            let Some(Resident { trajectory, .. }) = &mut self.resident[slot] else { continue };
            trajectory.observe(backend.counters(slot), &backend.report(slot));
            if trajectory.wants_state() || (trajectory.is_over() && trajectory.needs_last_state()) {
                wanted.push(slot);
            }
        }
        // One transfer for all.
        let mut states = wanted.iter().copied().zip(backend.states(&wanted)?).collect::<BTreeMap<_, _>>();
        let roster = self.roster;
        let take = |slot: &usize| Some((*slot, self.resident[*slot].take()?, states.remove(slot)));
        let taken: Vec<_> = slots.iter().filter_map(take).collect();
        let share = MAX_HELD / taken.len().max(1);
        let served = roster.threads.map(taken, |(slot, mut own, state)| {
            let before = own.trajectory.rows().bytes();
            let all = own.trajectory.serve(state.as_ref(), before + share);
            let more = own.trajectory.rows().bytes().saturating_sub(before);
            (slot, if all { roster.proceed(own, state.as_ref()) } else { Served::Full(own, state) }, more)
        });
        let mut rest = Vec::new();
        for (slot, served, more) in served {
            self.held += more;
            match served {
                Served::Runs(own, aim) => self.keep(backend, slot, own, aim),
                other => rest.push((slot, other)),
            }
        }
        for (slot, mut served) in rest {
            if let Served::Full(mut own, state) = served {
                let (before, mut most) = (own.trajectory.rows().bytes(), MAX_OF_ONE);
                // One step may pass more output times than memory has room for.
                while !own.trajectory.serve(state.as_ref(), most) {
                    most = if own.trajectory.rows().spill(sink)? { MAX_OF_ONE } else { usize::MAX };
                }
                self.held += own.trajectory.rows().bytes().saturating_sub(before);
                served = roster.proceed(own, state.as_ref());
            }
            match served {
                Served::Runs(own, aim) => self.keep(backend, slot, own, aim),
                Served::Over(rank, ended) => {
                    backend.clear(slot);
                    queue.leave(rank, *ended, sink)?;
                }
                Served::Full(..) => unreachable!("all output times have been served"),
            }
            if self.held > MAX_HELD {
                self.relieve(queue, MAX_HELD / 4 * 3, sink)?;
            }
            // Many rows take long to write, so the sink is notified in between.
            if queue.told.elapsed() >= MAX_WAIT {
                queue.tell(self, sink)?;
            }
        }
        if self.held > MAX_HELD {
            self.relieve(queue, MAX_HELD / 4 * 3, sink)?;
        }
        Ok(())
    }

    /// Lets a member continue in its slot.
    fn keep(&mut self, backend: &mut dyn Backend, slot: usize, own: Resident<'a>, aim: Option<Aim>) {
        self.resident[slot] = Some(own);
        if let Some((goal, parameters)) = aim {
            backend.aim(slot, goal, &parameters);
        }
    }

    /// Passes all rows in memory to the sink if they exceed `most` bytes.
    fn relieve(&mut self, queue: &mut Queue, most: usize, sink: &mut dyn Sink) -> Result<()> {
        let own = self.resident.iter_mut().flatten().map(|own| own.trajectory.rows());
        let own = own.chain(self.paused.values_mut().map(|paused| &mut paused.rows));
        let all: Vec<&mut Rows> = own.chain(queue.early.values_mut().map(|ended| &mut ended.rows)).collect();
        self.held = all.iter().map(|rows| rows.bytes()).sum();
        if self.held <= most {
            return Ok(());
        }
        self.held = 0;
        for rows in all {
            if !rows.spill(sink)? {
                break;
            }
        }
        Ok(())
    }

    /// Work done on the resident members, in members.
    fn share(&self) -> f64 {
        self.resident.iter().flatten().map(|own| own.trajectory.share()).sum()
    }

    /// Whether all members in progress began in the second half of the time from `then` to `now`: to begin them again
    /// costs less than to save their states.
    fn are_young(&self, then: Instant, now: Instant) -> bool {
        let most = (now - then) / 2;
        let is_young = |own: &Resident| own.begun.is_some_and(|begun| now - begun <= most);
        self.paused.is_empty() && self.resident.iter().flatten().all(is_young)
    }
}

/// Members that have ended, held until those before them have.
struct Queue {
    total: u64,
    ended: u64,
    next: u64,
    early: BTreeMap<u64, Ended>,
    /// When the progress was last saved, or the run began.
    saved: Instant,
    /// Whether the sink has saved the progress of the run, to the last member.
    kept: bool,
    /// When the sink was last notified of the progress.
    told: Instant,
}

impl Queue {
    /// Reports the progress to the sink, which may end the run at once.
    fn tell(&mut self, pool: &Pool, sink: &mut dyn Sink) -> Result<()> {
        self.told = Instant::now();
        let work = self.ended as f64 + pool.share();
        sink.progress(self.ended, self.total, work / self.total as f64)
    }

    fn leave(&mut self, rank: u64, ended: Ended, sink: &mut dyn Sink) -> Result<()> {
        self.ended += 1;
        self.kept = false;
        self.early.insert(rank, ended);
        while let Some(ended) = self.early.remove(&self.next) {
            sink.member(&ended)?;
            self.next += 1;
        }
        Ok(())
    }

    /// Saves the members that have ended, and the unfinished ones if known.
    fn checkpoint(&mut self, resident: Option<BTreeMap<u64, Paused>>, sink: &mut dyn Sink) -> Result<()> {
        let progress = RunProgress { next: self.next, early: std::mem::take(&mut self.early), resident };
        let done = sink.checkpoint(&progress);
        self.kept = done.is_ok() && progress.resident.is_some();
        self.saved = Instant::now();
        self.early = progress.early;
        done
    }

    /// If the run is to stop, saves at once what is known, since members in progress may never end.
    fn checkpoint_before_the_stop(&mut self, sink: &mut dyn Sink) -> Result<bool> {
        let stops = matches!(sink.next_request(), SinkRequest::Stop(_));
        if stops {
            self.checkpoint(None, sink)?;
        }
        Ok(stops)
    }
}

#[cfg(test)]
mod tests {
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
    fn only_members_that_began_a_short_while_ago_are_left_out_of_a_checkpoint() {
        let study = Study::new(Spec { curves: 3, ..Spec::default() }).unwrap();
        let roster = Roster::new(study.cells(), Precision::F64, 0);
        let second = Duration::from_secs(1);
        let now = Instant::now() + 10 * second;
        let then = now - 8 * second;
        let resident = |begun| Some(Resident { rank: 0, trajectory: roster.create((0, 0)).unwrap(), begun });
        let pool = |begun: &[Option<Instant>]| Pool {
            roster: &roster,
            resident: begun.iter().map(|begun| resident(*begun)).chain([None]).collect(),
            paused: BTreeMap::new(),
            held: 0,
        };
        let [late, early] = [now - 3 * second, now - 5 * second].map(Some);
        let are_young = |begun: &[Option<Instant>]| pool(begun).are_young(then, now);
        assert!(are_young(&[]) && are_young(&[late]) && are_young(&[late, late]));
        // Some work of a member that continues is older than it looks.
        assert!(!are_young(&[early]) && !are_young(&[late, early]) && !are_young(&[late, None]));
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
