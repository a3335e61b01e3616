//! A self-test by known answers: before a run begins on a device, a few members make two steps there and on the CPU.
//!
//! It tests what the run will use: its kernel, its number of nodes, its slots. The bounds are those of the other
//! comparisons.

use super::{
    adaptive_members,
    cases::{Driven, LAWS, adaptive_tolerance},
    compare::{ConformanceRow, compare_ends, to_their_goals},
    members,
};
use curvelax_backend::Backend;
use curvelax_base::error::{Error, Result};
use curvelax_flow::{
    number::Precision,
    scheme::{evolve::Evolves, step::Method},
};

/// One for each law of [`members`]; with and without redistribution and pull.
const MEMBERS: usize = LAWS;
/// Fixed steps; adaptive runs cover the same time.
const STEPS: u32 = 2;
/// Length of a single one, over a fixed step.
const SHORT: f64 = 0.005;

/// Makes two steps with members of `n` nodes, or adaptive ones over the same time, in the paper's form, in the
/// geometric one or as crystals, and compares the results with those of `method` on the CPU. In f32 a crystal makes one
/// adaptive step of a given length: the errors of its nodes are next to rounding, and what follows from them is not the
/// same on both sides. The slots must be free, and are free again afterwards.
///
/// # Errors
/// [`Error::Device`] with the quantity, its error and its bound; errors of `backend`.
pub fn self_test<T: Evolves>(
    backend: &mut dyn Backend,
    device: &str,
    hardware: bool,
    method: &Method,
    n: usize,
    adaptive: bool,
    driven: Driven,
) -> Result<()> {
    let count = MEMBERS.min(backend.slots());
    let mut launches = match adaptive {
        false => members(n, count, STEPS)?,
        true => adaptive_members(n, count, STEPS, adaptive_tolerance::<T>(), T::PRECISION)?,
    };
    driven.change(&mut launches);
    if !matches!(driven, Driven::Paper | Driven::Geometric) && adaptive && T::PRECISION == Precision::F32 {
        for launch in &mut launches {
            launch.counters.goal = 1;
            launch.report.progress.next = SHORT * launch.parameters.tau;
        }
    }
    // In all batches.
    let slots: Vec<usize> = (0..count).map(|member| member * backend.slots() / count).collect();
    let left = to_their_goals(backend, &slots, &launches)?;
    slots.into_iter().for_each(|slot| backend.clear(slot));
    let wrong = |what: String| {
        let remedy = "see `curvelax check`, or use --backend cpu";
        Error::Device(format!("GPU {device} computes wrongly: {what}; {remedy}"))
    };
    let rows = compare_ends::<T>(hardware, method, n, &launches, &left).map_err(|error| wrong(error.to_string()))?;
    match rows.iter().filter(|row| !row.is_empty()).find(|row| !row.passes()) {
        None => Ok(()),
        Some(ConformanceRow { quantity, error, bound, at: (member, node), .. }) => Err(wrong(format!(
            "{quantity} of member {member}, node {node}, of {n} in {}, is off by {error:.1e}, bound {bound:.1e}",
            T::NAME
        ))),
    }
}
