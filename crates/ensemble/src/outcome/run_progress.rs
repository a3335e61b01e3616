//! The progress of a run between two dispatches: all that is needed to resume it exactly.

use std::collections::BTreeMap;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{Ended, Rows};
use curvelax_flow::scheme::member::{Counters, Report};

/// The members of a run by rank, from 0: the order in which they are handed to the sink.
///
/// Members of rank below `next` have been handed over. A member listed nowhere is at its start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunProgress {
    /// The first member that has not been handed to the sink.
    pub next: u64,
    /// Members that ended before one of lower rank.
    pub early: BTreeMap<u64, Ended>,
    /// Members in progress; `None` if they cannot be read back, so that those saved last remain valid.
    pub resident: Option<BTreeMap<u64, Paused>>,
}

/// A member in progress, as it was between two dispatches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paused {
    /// Its counters in the back end.
    pub counters: Counters,
    /// Its report there.
    pub report: Report<f64>,
    /// All fields of its [`State`](curvelax_flow::scheme::State) there, one after another: for each node
    /// [`STATE_FIELDS`](curvelax_flow::scheme::state::STATE_FIELDS) numbers.
    pub state: Vec<f64>,
    /// Sweeps so far, on curvature and on position systems.
    pub sweeps: [u64; 2],
    /// How many of its output times it has reached.
    pub served: u64,
    /// Its rows so far.
    pub rows: Rows,
    /// Its portrait so far, with times.
    pub frames: Vec<(f64, Vec<DVec2>)>,
    /// When it was first found to cross itself.
    pub crossed: Option<f64>,
    /// The times of its events so far, in the order of the spec.
    pub events: Vec<Option<f64>>,
    /// Travel at which it is next checked for crossings.
    pub look_at: f64,
    /// Time at which steps end because a driven member might vanish in them.
    pub until: f64,
    /// Times and energies so far, if these decide on its relaxation.
    pub energies: Vec<[f64; 2]>,
}
