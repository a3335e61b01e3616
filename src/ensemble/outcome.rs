//! What a member's run leaves behind: its status, its times, and its observables at the start and the end.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::{Extent, Mollified, Rows, Standing};
pub use crate::scheme::Status;
use crate::{
    error::{Error, Result},
    scheme::parameters::Observed,
};

/// Scalar observables of one curve at one time (f64 whatever the precision of the run).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Observables {
    /// Length `L` of the polygon `x`.
    pub length: f64,
    /// Signed area `A` of the polygon `x`, positive counter-clockwise.
    pub area: f64,
    /// `L²/(4πA) - (n/π)·tan(π/n)`: 0 on a regular polygon.
    pub excess: f64,
    /// `∮(½k² + λ) ds` from the scheme's `k` and `r`; λ = 0 unless the flow is elastic.
    pub energy: f64,
    /// Smallest curvature.
    pub k_min: f64,
    /// Largest curvature.
    pub k_max: f64,
    /// Longest over shortest edge of the polygon.
    pub mesh_ratio: f64,
    /// `max |r_i - |e_i|| / |e_i|`: how far the scheme's lengths have left the polygon's.
    pub metric_drift: f64,
    /// Turning number of the polygon.
    pub turning: i32,
}

impl Observables {
    /// In the user's unit, from what the scheme observed in lengths of `unit`.
    pub fn new(observed: &Observed<f64>, turning: f64, unit: f64) -> Observables {
        Observables {
            length: observed.length * unit,
            area: observed.area * unit * unit,
            excess: observed.excess,
            energy: observed.energy / unit,
            k_min: observed.k_min / unit,
            k_max: observed.k_max / unit,
            mesh_ratio: observed.mesh_ratio,
            metric_drift: observed.metric_drift,
            turning: turning as i32,
        }
    }
}

/// One row of `summary.csv`. Times are in the curve's own units (length⁴).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Index of the member, from 0.
    pub member: u64,
    /// Index of its cell, from 0.
    pub cell: u64,
    /// How it ended.
    pub status: Status,
    /// Time of its last accepted state.
    pub t_end: f64,
    /// Accepted steps.
    pub steps: u64,
    /// Refused adaptive steps.
    pub rejected: u64,
    /// Gauss–Seidel sweeps spent on curvature systems (0 with the direct solver).
    pub sweeps_k: u64,
    /// Gauss–Seidel sweeps spent on position systems.
    pub sweeps_x: u64,
    /// First time the excess was at or under the threshold.
    pub t_relax: Option<f64>,
    /// First time the excess was at or under half its start.
    pub t_half: Option<f64>,
    /// Slope of the line fitted to -ln excess against time, in 1/time; of one against `ln(1 + 2t/R₀⁴)` for Willmore flow.
    pub rate: Option<f64>,
    /// What linear theory gives for `rate`, where it does.
    pub rate_theory: Option<f64>,
    /// Share of the variance of ln excess that the line explains.
    pub rate_r2: Option<f64>,
    /// Observables of the initial curve, computed in f64 from the sampled nodes.
    pub start: Observables,
    /// Observables of the last accepted state.
    pub end: Observables,
    /// Time at which the polygon was first seen to cross itself.
    pub self_crossing: Option<f64>,
}

/// One row of `series.csv`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeriesRow {
    /// Index of the member.
    pub member: u64,
    /// Time.
    pub t: f64,
    /// Observables at `t`.
    pub at: Observables,
}

/// The nodes of one member at one time; each vector has n entries, node i = 1…n at index i-1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Index of the member.
    pub member: u64,
    /// Time.
    pub t: f64,
    /// Node coordinates, in the user's frame.
    pub x: Vec<f64>,
    /// Node coordinates, in the user's frame.
    pub y: Vec<f64>,
    /// Curvature on the segment that ends at the node.
    pub k: Vec<f64>,
    /// The scheme's length of the segment that ends at the node.
    pub r: Vec<f64>,
}

/// A member's nodes in the user's frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Portrait {
    /// At the start.
    pub before: Vec<DVec2>,
    /// At some times on its way: every m-th node, m = [`Portrait::stride`].
    pub frames: Vec<(f64, Vec<DVec2>)>,
    /// In the last accepted state.
    pub after: Vec<DVec2>,
}

impl Portrait {
    /// A picture has at most this many nodes of a curve: more do not show.
    pub const MOST_NODES: usize = 600;

    /// Of `n` nodes every so-many-th is drawn.
    pub fn stride(n: usize) -> usize {
        n.div_ceil(Self::MOST_NODES).max(1)
    }
}

/// Everything that one member left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ended {
    /// Its row of the summary.
    pub outcome: Outcome,
    /// Its excess at the times of [`grid`](crate::schedule::grid) that it reached.
    pub excess: Vec<f64>,
    /// Its rows of the series and its snapshots.
    pub rows: Rows,
    /// Its nodes at both ends, where they were asked for.
    pub portrait: Option<Portrait>,
    /// What rounding off did to its corners before the run.
    pub mollified: Mollified,
    /// Its threshold lies in the rounding of the precision, so no relaxation time can be told.
    pub unresolved: bool,
}

/// What a sink wishes of a run between two dispatches.
#[derive(Debug)]
pub enum Wish {
    /// To go on.
    GoOn,
    /// To be told where the run stands, and to go on.
    Keep,
    /// To be told where the run stands, and to end with this error.
    Stop(Error),
}

/// Receives everything that the members leave.
pub trait Sink {
    /// A member has ended; called exactly once per member, in member order.
    fn member(&mut self, ended: &Ended) -> Result<()>;
    /// Takes rows of a member that has not left, in time order, when more of them are in memory than should be. They come
    /// back with the member as what this returns, also in a run that goes on from a standing; none where it has no place.
    fn spill(&mut self, _series: &[SeriesRow], _snapshots: &[Snapshot]) -> Result<Option<Extent>> {
        Ok(None)
    }
    /// `done` of `total` members have ended; `share` ∈ [0, 1] of the work is done. Called after every dispatch, and
    /// during long ones: an error stops the run.
    fn progress(&mut self, _done: u64, _total: u64, _share: f64) -> Result<()> {
        Ok(())
    }
    /// What it wishes now; asked after every dispatch, and during long ones.
    fn wish(&mut self) -> Wish {
        Wish::GoOn
    }
    /// Where the run stands: as was wished for, or as it comes to a bad end.
    fn keep(&mut self, _standing: &Standing) -> Result<()> {
        Ok(())
    }
}
