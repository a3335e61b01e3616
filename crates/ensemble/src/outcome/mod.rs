//! The result of a member: its status, its times, and its observables at the start and the end.

mod features;
mod level_times;
pub mod levels;
pub mod linear_rate;
pub mod progress;
mod sink;
mod wulff;

use glam::DVec2;
use serde::{Deserialize, Serialize};

pub use curvelax_flow::scheme::Status;
use curvelax_flow::scheme::member::Observed;
use curvelax_statistics::Limit;
pub use features::{Feature, Features};
pub use level_times::LevelTimes;
pub use levels::{LevelRow, RefinementLevel};
pub use progress::{Ended, Extent, Paused, Rows, RunProgress};
pub use sink::{Sink, SinkRequest};
pub use wulff::{wulff_distance, wulff_outline};

/// Scalar observables of one curve at one time (f64 whatever the precision of the run).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Observables {
    /// Length `L` of the polygon `x`.
    pub length: f64,
    /// Signed area `A` of the polygon `x`, positive counter-clockwise.
    pub area: f64,
    /// Distance from [equilibrium](curvelax_flow::equilibrium): `L²/(4πA) - (n/π)·tan(π/n)`, 0 on a regular polygon.
    pub excess: f64,
    /// `∮(½k² + λ) ds` from the scheme's `k` and `r`; λ = 0 unless the flow is elastic.
    pub energy: f64,
    /// Smallest curvature.
    pub k_min: f64,
    /// Largest curvature.
    pub k_max: f64,
    /// Longest over shortest edge of the polygon.
    pub mesh_ratio: f64,
    /// `max |r_i - |e_i|| / |e_i|`: how far the scheme's lengths have drifted from the polygon's.
    pub metric_drift: f64,
    /// Turning number of the polygon.
    pub turning: i32,
}

impl Observables {
    /// Converts what the scheme observed in lengths of `unit` to the user's unit.
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    /// Slope of a line fitted to -ln excess against time, in 1/time; for Willmore flow against `ln(1 + 2t/R₀⁴)`.
    pub rate: Option<f64>,
    /// What linear theory predicts for `rate`, if it does.
    pub rate_theory: Option<f64>,
    /// Fraction of the variance of ln excess explained by the line.
    pub rate_r2: Option<f64>,
    /// Observables of the initial curve, computed in f64 from the sampled nodes.
    pub start: Observables,
    /// Largest angle by which the tangent of the initial curve turns at a node, in radians.
    pub turn: f64,
    /// Observables of the last accepted state.
    pub end: Observables,
    /// Time at which the polygon was first found to cross itself.
    pub self_crossing: Option<f64>,
    /// Steps of the paper's scheme that were computed, also in refused adaptive steps.
    pub solves: u64,
    /// Relaxation time in the limit of many nodes and short steps, with `--refine`.
    pub t_limit: Option<f64>,
    /// Half-width of its 95 % interval.
    pub t_error: Option<f64>,
    /// Observed order of the relaxation time in 1/n.
    pub order: Option<f64>,
    /// Name of its outline; empty if it has none.
    pub label: String,
    /// Group of its outline; empty without `--group-by`.
    pub group: String,
    /// Nodes of the finest level that `t_limit` rests on; without a limit its own.
    pub points: u64,
    /// By how much its time moves with half the points of its outline, with `--refine`.
    pub t_data_error: Option<f64>,
    /// Of a crystal, the distance of the last polygon from the Wulff shape of its area, as a length.
    pub wulff_distance: Option<f64>,
    /// When it shrank to a point, driven by a force.
    pub t_vanish: Option<f64>,
    /// That in the limit of many nodes and short steps, with `--refine`.
    pub t_vanish_limit: Option<f64>,
    /// Half-width of its 95 % interval.
    pub t_vanish_error: Option<f64>,
    /// 4πA/L² of the last polygon, if area or length are kept.
    pub reduced_area: Option<f64>,
    /// First times of the [events](crate::Event) of the spec, in their order.
    pub events: Vec<Option<f64>>,
    /// What the [levels](crate::LevelTimes) tell of the relaxation time, if the member ran at them.
    #[serde(skip)]
    pub judged: Option<Limit>,
    /// The same of the time at which it vanished.
    #[serde(skip)]
    pub judged_vanishing: Option<Limit>,
    /// The same of the times of the events, in their order.
    #[serde(skip)]
    pub judged_events: Vec<Option<Limit>>,
    /// Whether its limit rests on more nodes than its own.
    #[serde(skip)]
    pub is_finer: bool,
}

impl Outcome {
    /// The limit of the time of the event at `place` of the spec, if the member ran at the levels.
    pub fn limit_of_event(&self, place: usize) -> Option<Limit> {
        self.judged_events.get(place).copied().flatten()
    }
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
    /// At times during its run: every m-th node, m = [`Portrait::stride`].
    pub frames: Vec<(f64, Vec<DVec2>)>,
    /// At the last accepted state.
    pub after: Vec<DVec2>,
}

impl Portrait {
    /// Maximum nodes of a curve in a picture: more would not show.
    pub const MAX_NODES: usize = 600;

    /// The m for which every m-th of `n` nodes is drawn.
    pub fn stride(n: usize) -> usize {
        n.div_ceil(Self::MAX_NODES).max(1)
    }
}
