//! The members of a run: how each is created, and what becomes of it. Nothing here depends on the others, so threads
//! share the work.

use std::time::Instant;

use crate::{
    Cell, Ended, Paused,
    outcome::linear_rate,
    request::spec::Precision,
    schedule::{Outputs, grid},
    study::cell_of,
    trajectory::{Trajectory, settling_times},
};
use curvelax_base::{error::Result, threads::HostThreads};
use curvelax_flow::scheme::{Parameters, State, member, run::Run};

/// The members of a [`Simulation`](super::Simulation), and when they leave something during it.
pub struct Roster<'a> {
    pub(super) cells: &'a [Cell],
    precision: Precision,
    /// For each cell: for members without a portrait, and for those with one.
    outputs: [Vec<Outputs>; 2],
    portraits: usize,
    pub(super) threads: HostThreads,
}

impl<'a> Roster<'a> {
    /// Lists the members of `cells` as [`simulate`](super::simulate) does.
    pub fn new(cells: &'a [Cell], precision: Precision, portraits: usize) -> Roster<'a> {
        let outputs = |framed: bool| -> Vec<_> {
            let of_cell = |Cell { spec, .. }: &Cell| {
                // The pictures show the start and the end anyway.
                let inside = if framed { member::TIMES } else { 0 };
                let frames: Vec<f64> = grid(spec.final_time()).skip(1).take(inside).collect();
                let energies = settling_times(spec);
                Outputs::new(spec.final_time(), spec.series, [&spec.snapshots, &frames, &energies])
            };
            cells.iter().map(of_cell).collect()
        };
        let threads = HostThreads::new(cells.first().and_then(|cell| cell.spec.threads).unwrap_or(0));
        Roster { cells, precision, outputs: [outputs(false), outputs(true)], portraits, threads }
    }

    /// Creates a member at its start.
    pub(super) fn create(&self, (cell, index): (usize, u64)) -> Result<Trajectory<'_>> {
        let own = &self.cells[cell];
        let each = (self.portraits / self.cells.len().max(1)).max(1);
        // The same members whatever their shard.
        let portrait = cell < self.portraits && own.place(index) < each as u64;
        let outputs = &self.outputs[usize::from(portrait)][cell];
        let mut trajectory = Trajectory::new(own.member(index)?, &own.spec, self.precision, outputs);
        trajectory.portrait = portrait;
        Ok(trajectory)
    }

    /// Prepares a member, paused or new, for a back end, or ends it if there is nothing to do.
    pub(super) fn admit(&self, who: (usize, u64), paused: Option<Paused>) -> Result<Admitted<'_>> {
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
        let cell = cell_of(self.cells, &ended.outcome);
        ended.outcome.rate_theory = cell.and_then(|cell| linear_rate::rate_of(&cell.spec, &ended.outcome));
        ended
    }

    /// Sets the next goal of a member whose output times have been served, or ends it.
    pub(super) fn proceed<'b>(&self, own: Box<Resident<'b>>, state: Option<&State<f64>>) -> Served<'b> {
        if own.trajectory.is_over() {
            return Served::Over(own.rank, Box::new(self.end(own.trajectory, state)));
        }
        let aim = own.trajectory.next_aim().map(Box::new);
        Served::Runs(own, aim)
    }
}

/// The rank of a member in its run, its cell and its index.
pub(super) type Entering = (u64, (usize, u64));

/// What has become of a member at its creation.
pub(super) enum Admitted<'a> {
    Over(Box<Ended>),
    Runs(Box<(Trajectory<'a>, Run<f64>)>),
}

/// The next goal of a member, as a number of steps, and the parameters until then.
pub(super) type Aim = (u32, Parameters<f64>);

/// What has become of a member after a dispatch.
pub(super) enum Served<'a> {
    /// With its rank.
    Over(u64, Box<Ended>),
    /// With another goal, if it has one.
    Runs(Box<Resident<'a>>, Option<Box<Aim>>),
}

/// A member in a slot.
pub(super) struct Resident<'a> {
    /// Its rank in this run.
    pub rank: u64,
    pub trajectory: Trajectory<'a>,
    /// When it began; none if it continues from a checkpoint.
    pub begun: Option<Instant>,
}
