//! The loop: fill slots with members, advance them, collect what they report, refill.
//!
//! Nothing here depends on where the members are advanced or on how many are resident: a member's steps are its
//! own, its output times are reached by pausing it there, and rows leave in member order.

use std::{collections::BTreeMap, ops::Range, time::Duration};

use crate::{
    backend::Backend,
    ensemble::{Cell, Ended, Sink, spec::Precision},
    error::Result,
    schedule::{Output, grid, outputs},
    scheme::decay,
    trajectory::Trajectory,
};

/// A member is admitted when at most this many times the slots are waiting for the first one that has not ended.
const MEMBERS_AHEAD: usize = 8;

/// Where a dispatch takes longer, the sink is told in between, and may stop the run.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Runs the members of `cells`, which keep [company](crate::ensemble::study::companies), on `backend`, and hands each to
/// `sink` in member order.
///
/// The first members come with their nodes before, on their way and after, `portraits` of them over all cells.
pub fn simulate(
    cells: &[Cell],
    precision: Precision,
    backend: &mut dyn Backend,
    portraits: usize,
    sink: &mut dyn Sink,
) -> Result<()> {
    let outputs = |framed: bool| -> Vec<_> {
        let of_cell = |Cell { spec, .. }: &Cell| {
            // The pictures show the start and the end anyway.
            let inside = if framed { 1..decay::PARTS } else { 0..0 };
            let frames: Vec<f64> =
                grid(spec.t_end).enumerate().filter(|(part, _)| inside.contains(part)).map(|(_, t)| t).collect();
            outputs(spec.t_end, spec.series, &spec.snapshots, &frames)
        };
        cells.iter().map(of_cell).collect()
    };
    let (outputs, framed) = (outputs(false), outputs(true));
    let members = cells.iter().enumerate().flat_map(|(cell, own)| own.members().enumerate().map(move |m| (cell, m)));
    let mut waiting = members.enumerate().peekable();
    // Members that end early wait for those before them: this bounds how many.
    let ahead = MEMBERS_AHEAD * backend.slots();
    let mut pool = Pool {
        cells,
        precision,
        outputs: [&outputs, &framed],
        resident: (0..backend.slots()).map(|_| None).collect(),
        portraits,
    };
    let total = cells.iter().map(|cell| cell.spec.member_count()).sum();
    let mut queue = Queue { total, ended: 0, next: 0, early: BTreeMap::new() };
    // Where there are two batches, one of them is on its way while the other one is looked after.
    let size = backend.slots() / backend.batches();
    for batch in (0..backend.batches()).cycle() {
        let slots = batch * size..(batch + 1) * size;
        if pool.resident[slots.clone()].iter().any(Option::is_some) {
            while !backend.is_back(batch, LONGEST_WAIT) {
                queue.tell(&pool, sink)?;
            }
            backend.finish(batch)?;
            for (rank, ended) in pool.collect(backend, slots.clone())? {
                queue.leave(rank, ended, sink)?;
            }
        }
        for slot in slots.clone() {
            while pool.resident[slot].is_none() {
                let Some((rank, who)) = waiting.next_if(|(rank, _)| *rank < queue.next + ahead) else { break };
                if let Some(ended) = pool.admit(backend, slot, rank, who)? {
                    queue.leave(rank, ended, sink)?;
                }
            }
        }
        if pool.resident[slots].iter().any(Option::is_some) {
            backend.start(batch)?;
        }
        queue.tell(&pool, sink)?;
        if pool.resident.iter().all(Option::is_none) {
            break;
        }
    }
    Ok(())
}

/// The resident members of a run.
struct Pool<'a> {
    cells: &'a [Cell],
    precision: Precision,
    /// Of each cell: for members without a portrait, and for those with one.
    outputs: [&'a [Vec<Output>]; 2],
    resident: Vec<Option<(usize, Trajectory<'a>)>>,
    portraits: usize,
}

impl Pool<'_> {
    /// Puts a member, the `rank`-th of this run and the `place`-th of a cell, into a free slot; or ends it where there is
    /// nothing to do.
    fn admit(
        &mut self,
        backend: &mut dyn Backend,
        slot: usize,
        rank: usize,
        (cell, (place, index)): (usize, (usize, u64)),
    ) -> Result<Option<Ended>> {
        let own = &self.cells[cell];
        let each = (self.portraits / self.cells.len().max(1)).max(1);
        let portrait = cell < self.portraits && place < each;
        let outputs = &self.outputs[usize::from(portrait)][cell];
        let mut trajectory = Trajectory::new(own.member(index)?, &own.spec, self.precision, outputs);
        trajectory.keep_portrait(portrait);
        if trajectory.is_over() {
            return Ok(Some(trajectory.end(None)));
        }
        backend.load(slot, &trajectory.launch())?;
        self.resident[slot] = Some((rank, trajectory));
        Ok(None)
    }

    /// Looks at the members in `slots`: serves their output times, and aims them further or ends them, which are returned.
    fn collect(&mut self, backend: &mut dyn Backend, slots: Range<usize>) -> Result<Vec<(usize, Ended)>> {
        let mut wanted = Vec::new();
        for slot in slots.clone() {
            let Some((_, trajectory)) = &mut self.resident[slot] else { continue };
            trajectory.observe(backend.counters(slot), &backend.report(slot));
            if trajectory.wants_state() || (trajectory.is_over() && trajectory.keeps_portrait()) {
                wanted.push(slot);
            }
        }
        // One transfer for all.
        let mut states = wanted.iter().copied().zip(backend.states(&wanted)?).collect::<BTreeMap<_, _>>();
        let mut over = Vec::new();
        for slot in slots {
            let Some((_, trajectory)) = &mut self.resident[slot] else { continue };
            let state = states.remove(&slot);
            trajectory.serve(state.as_ref());
            if !trajectory.is_over() {
                if let Some((goal, parameters)) = trajectory.next_aim() {
                    backend.aim(slot, goal, &parameters);
                }
                continue;
            }
            backend.clear(slot);
            over.extend(self.resident[slot].take().map(|(rank, trajectory)| (rank, trajectory.end(state.as_ref()))));
        }
        Ok(over)
    }

    /// Work done on the resident members, in members.
    fn share(&self) -> f64 {
        self.resident.iter().flatten().map(|(_, trajectory)| trajectory.share()).sum()
    }
}

/// Members that have ended, kept until those before them have.
struct Queue {
    total: u64,
    ended: u64,
    next: usize,
    early: BTreeMap<usize, Ended>,
}

impl Queue {
    /// Tells how far the run is, and hears whether it is to go on.
    fn tell(&self, pool: &Pool, sink: &mut dyn Sink) -> Result<()> {
        let work = self.ended as f64 + pool.share();
        sink.progress(self.ended, self.total, work / self.total as f64)
    }

    fn leave(&mut self, rank: usize, ended: Ended, sink: &mut dyn Sink) -> Result<()> {
        self.ended += 1;
        self.early.insert(rank, ended);
        while let Some(ended) = self.early.remove(&self.next) {
            sink.member(&ended)?;
            self.next += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        ensemble::{Spec, study},
        error::Error,
        scheme::{
            Parameters, State,
            evolve::Run,
            parameters::{Counters, Report},
        },
    };

    /// Takes members and never brings them back.
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

    /// Stops a run when it has been told of it so often.
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
        let spec = Spec { curves: 3, ..Spec::default() }.validate().unwrap();
        let cells = study::cells(&spec).unwrap();
        for patience in [1, 2, 7] {
            let mut sink = Patience(patience);
            let stopped = simulate(&cells, Precision::F64, &mut Never, 0, &mut sink).unwrap_err();
            assert_eq!((stopped.exit_code(), sink.0), (75, 0), "{stopped}");
        }
    }
}
