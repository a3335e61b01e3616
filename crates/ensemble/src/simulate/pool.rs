//! The slots of a back end: what is done with the members in them between two dispatches.

use std::{collections::BTreeMap, ops::Range, time::Instant};

use super::{
    queue::{MAX_WAIT, Queue},
    roster::{Admitted, Aim, Entering, Resident, Roster, Served},
};
use crate::{Paused, Rows, Sink};
use curvelax_backend::Backend;
use curvelax_base::error::Result;
use curvelax_flow::scheme::state::STATE_FIELDS;

/// Maximum states read back at once for a checkpoint, and their maximum bytes.
const READ_BACK: usize = 512;
const BYTES_READ_BACK: usize = 64 << 20;

/// Bytes of rows in memory above which all are passed to the sink; also the maximum of one member.
pub const MAX_HELD: usize = 32 << 20;
const MAX_OF_ONE: usize = 8 << 20;

/// Returns how many states of `n` nodes may be read back at once.
pub fn states_at_once(n: usize) -> usize {
    (BYTES_READ_BACK / (STATE_FIELDS * size_of::<f64>() * n)).max(1)
}

/// The resident members of a run.
pub(super) struct Pool<'a> {
    pub roster: &'a Roster<'a>,
    pub resident: Vec<Option<Box<Resident<'a>>>>,
    /// Members that continue from a checkpoint, by rank.
    pub paused: BTreeMap<u64, Paused>,
    /// Bound on the bytes of rows in memory, including members that ended early.
    pub held: usize,
}

impl<'a> Pool<'a> {
    /// Puts members into free slots, each with its rank in this run; returns the slots of those that end at once,
    /// because there is nothing to do.
    pub fn admit(
        &mut self,
        backend: &mut dyn Backend,
        mut entering: Vec<(usize, Entering)>,
        queue: &mut Queue,
        sink: &mut dyn Sink,
    ) -> Result<Vec<usize>> {
        let roster = self.roster;
        // Of few members, each frees the memory in which the next is made.
        let at_once = if roster.threads.share(entering.len()) { entering.len() } else { 1 };
        let mut over = Vec::new();
        while !entering.is_empty() {
            let with_paused = |(slot, (rank, who))| (slot, rank, who, self.paused.remove(&rank));
            let part = entering.drain(..at_once).map(with_paused).collect();
            let admitted = roster.threads.map(part, |(slot, rank, who, paused)| {
                let begun = paused.is_none().then(Instant::now);
                (slot, rank, begun, roster.admit(who, paused))
            });
            let (mut runs, mut failed) = (Vec::new(), Ok(()));
            for (slot, rank, begun, admitted) in admitted {
                match admitted {
                    Ok(Admitted::Over(ended)) => {
                        over.push(slot);
                        queue.leave(rank, *ended, sink)?;
                    }
                    Ok(Admitted::Runs(own)) => {
                        let (mut trajectory, run) = *own;
                        self.held += trajectory.rows().bytes();
                        self.resident[slot] = Some(Box::new(Resident { rank, trajectory, begun }));
                        runs.push((slot, run));
                    }
                    Err(error) => {
                        failed = Err(error);
                        break;
                    }
                }
            }
            let loaded = backend.load_all(runs, &roster.threads);
            failed.and(loaded)?;
        }
        Ok(over)
    }

    /// Nodes of a member.
    pub fn points(&self) -> usize {
        self.roster.cells.first().map_or(1, |cell| cell.family.points())
    }

    /// The slots with members.
    pub fn occupied(&self) -> Vec<usize> {
        (0..self.resident.len()).filter(|slot| self.resident[*slot].is_some()).collect()
    }

    /// The slots of members that began in the first half of the time from `then` to `now` or earlier. To begin the
    /// others again costs less than to save their states.
    pub fn old(&self, then: Instant, now: Instant) -> Vec<usize> {
        let most = (now - then) / 2;
        let is_old = |own: &Resident| own.begun.is_none_or(|begun| now - begun > most);
        (0..self.resident.len()).filter(|slot| self.resident[*slot].as_deref().is_some_and(is_old)).collect()
    }

    /// The unfinished members in `slots`, and those that wait to be continued; no batch may be on the way if there are
    /// any slots.
    pub fn pause(&self, backend: &mut dyn Backend, slots: &[usize]) -> Result<BTreeMap<u64, Paused>> {
        let mut all = self.paused.clone();
        for part in slots.chunks(states_at_once(self.points()).min(READ_BACK)) {
            for (slot, state) in part.iter().zip(backend.states(part)?) {
                let Some(own) = &self.resident[*slot] else { continue };
                all.insert(own.rank, own.trajectory.pause(backend.counters(*slot), backend.report(*slot), &state));
            }
        }
        Ok(all)
    }

    /// Processes the members in `slots`: serves their output times, and sets their next goals or lets them leave.
    pub fn collect(
        &mut self,
        backend: &mut dyn Backend,
        slots: Range<usize>,
        queue: &mut Queue,
        sink: &mut dyn Sink,
    ) -> Result<()> {
        let roster = self.roster;
        let occupied: Vec<usize> = slots.filter(|slot| self.resident[*slot].is_some()).collect();
        for slots in occupied.chunks(states_at_once(self.points())) {
            let mut wanted = Vec::new();
            for slot in slots.iter().copied() {
                let Some(own) = &mut self.resident[slot] else { continue };
                let trajectory = &mut own.trajectory;
                trajectory.observe(backend.counters(slot), &backend.report(slot));
                if trajectory.wants_state() || (trajectory.is_over() && trajectory.needs_last_state()) {
                    wanted.push(slot);
                }
            }
            // One transfer for all.
            let mut states = wanted.iter().copied().zip(backend.states(&wanted)?).collect::<BTreeMap<_, _>>();
            let take = |slot: &usize| Some((*slot, self.resident[*slot].take()?, states.remove(slot)));
            let taken: Vec<_> = slots.iter().filter_map(take).collect();
            // Rows may take twice the memory that they fill. One after another, members free theirs for the next.
            let room = if roster.threads.share(taken.len()) { MAX_HELD.saturating_sub(self.held) / 2 } else { 0 };
            let each = room / taken.len().max(1);
            let served = roster.threads.map(taken, |(slot, mut own, state)| {
                let before = own.trajectory.rows().bytes();
                let all = own.trajectory.serve(state.as_ref(), before + each);
                let more = own.trajectory.rows().bytes().saturating_sub(before);
                (slot, if all { Ok(roster.proceed(own, state.as_ref())) } else { Err((own, state)) }, more)
            });
            let (mut over, mut full) = (Vec::new(), Vec::new());
            for (slot, served, more) in served {
                self.held += more;
                match served {
                    Ok(Served::Runs(own, aim)) => self.keep(backend, slot, own, aim),
                    Ok(Served::Over(rank, ended)) => over.push((slot, rank, ended)),
                    // Its rows fill the memory that it has before all output times are served.
                    Err((own, state)) => {
                        self.resident[slot] = Some(own);
                        full.push((slot, state));
                    }
                }
            }
            let mut left = over.len();
            for (slot, rank, ended) in over {
                backend.clear(slot);
                queue.leave(rank, *ended, sink)?;
                left -= 1;
                self.bound(queue, left, sink)?;
            }
            for (slot, state) in full {
                let Some(mut own) = self.resident[slot].take() else { continue };
                let (before, mut most) = (own.trajectory.rows().bytes(), MAX_OF_ONE);
                // One step may pass more output times than memory has room for.
                while !own.trajectory.serve(state.as_ref(), most) {
                    most = if own.trajectory.rows().spill(sink)? { MAX_OF_ONE } else { usize::MAX };
                }
                self.held += own.trajectory.rows().bytes().saturating_sub(before);
                match roster.proceed(own, state.as_ref()) {
                    Served::Runs(own, aim) => self.keep(backend, slot, own, aim),
                    Served::Over(rank, ended) => {
                        backend.clear(slot);
                        queue.leave(rank, *ended, sink)?;
                    }
                }
                self.bound(queue, 0, sink)?;
            }
        }
        Ok(())
    }

    /// Bounds the rows in memory, and the time until the sink is notified, since many rows take long to write; `left`
    /// members that have ended are not in the queue yet.
    fn bound(&mut self, queue: &mut Queue, left: usize, sink: &mut dyn Sink) -> Result<()> {
        if self.held > MAX_HELD {
            self.relieve(queue, MAX_HELD / 4 * 3, sink)?;
        }
        if queue.told.elapsed() >= MAX_WAIT {
            queue.tell(self.share() + left as f64, sink)?;
        }
        Ok(())
    }

    /// Lets a member continue in its slot.
    fn keep(&mut self, backend: &mut dyn Backend, slot: usize, own: Box<Resident<'a>>, aim: Option<Box<Aim>>) {
        self.resident[slot] = Some(own);
        if let Some(aim) = aim {
            let (goal, parameters) = *aim;
            backend.aim(slot, goal, &parameters);
        }
    }

    /// Passes all rows in memory to the sink if they exceed `most` bytes.
    pub fn relieve(&mut self, queue: &mut Queue, most: usize, sink: &mut dyn Sink) -> Result<()> {
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
    pub fn share(&self) -> f64 {
        self.resident.iter().flatten().map(|own| own.trajectory.share()).sum()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{Spec, Study, request::spec::Precision};

    #[test]
    fn members_that_began_a_short_while_ago_are_left_out_of_a_checkpoint() {
        let study = Study::new(Spec { curves: 3, ..Spec::default() }).unwrap();
        let roster = Roster::new(study.cells(), Precision::F64, 0);
        let second = Duration::from_secs(1);
        let now = Instant::now() + 10 * second;
        let then = now - 8 * second;
        let resident = |begun| Some(Box::new(Resident { rank: 0, trajectory: roster.create((0, 0)).unwrap(), begun }));
        let pool = |begun: &[Option<Instant>]| Pool {
            roster: &roster,
            resident: begun.iter().map(|begun| resident(*begun)).chain([None]).collect(),
            paused: BTreeMap::new(),
            held: 0,
        };
        let [late, early] = [now - 3 * second, now - 5 * second].map(Some);
        let old = |begun: &[Option<Instant>]| pool(begun).old(then, now);
        assert!(old(&[]).is_empty());
        // Some work of a member that continues is older than it looks.
        assert_eq!(old(&[late, early, late, None]), [1, 3]);
        assert_eq!(pool(&[late, early]).occupied(), [0, 1]);
    }
}
