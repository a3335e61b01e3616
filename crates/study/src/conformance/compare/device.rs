//! The results of members on a device.

use super::setup::{MAX_SWEEPS, blocks};
use curvelax_backend::{Backend, gpu::Variant};
use curvelax_base::error::Result;
use curvelax_flow::scheme::evolve::Evolves;
use curvelax_flow::{
    scheme::{
        State,
        member::{Counters, Report},
        run::Run,
    },
    solver::Solver,
};
use curvelax_gpu as gpu;
use curvelax_gpu::kernel::Budget;

/// The result of a member on the GPU.
#[derive(Clone, Debug)]
pub struct Left {
    /// Its last accepted state.
    pub state: State<f64>,
    /// Its counters; the sweeps are those of the last dispatch.
    pub counters: Counters,
    /// Its report.
    pub report: Report<f64>,
}

/// Runs `launches` to their goals on the GPU.
pub fn on_gpu<T: Evolves>(
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    launches: &[Run<f64>],
    budget: Budget,
) -> Result<Vec<Left>> {
    let adaptive = launches.iter().any(|launch| launch.parameters.adaptive > 0.0);
    let watched = launches.iter().any(|launch| launch.parameters.branches().watched);
    let geometric = launches.iter().any(|launch| launch.parameters.branches().geometric);
    let crystal = launches.iter().any(|launch| launch.parameters.branches().law.is_crystal());
    let forced = launches.iter().any(|launch| launch.parameters.branches().law.is_forced());
    let variant =
        Variant { adaptive, watched, geometric, crystal, forced, ..adapter.capacity().variant(blocks(n)?, solver) };
    on_gpu_by::<T>(adapter, variant, n, launches, budget)
}

/// Like [`on_gpu`], with a given kernel.
pub fn on_gpu_by<T: Evolves>(
    adapter: &gpu::Gpu,
    variant: Variant,
    n: usize,
    launches: &[Run<f64>],
    budget: Budget,
) -> Result<Vec<Left>> {
    let kernel = gpu::Kernel::<T>::new(adapter, blocks(n)?, launches.len(), MAX_SWEEPS, variant)?;
    let slots: Vec<usize> = (0..launches.len()).collect();
    to_their_goals(&mut kernel.with_budget(budget), &slots, launches)
}

/// Runs `launches` to their goals in these slots of a back end, where they stay.
pub(in crate::conformance) fn to_their_goals(
    backend: &mut dyn Backend,
    slots: &[usize],
    launches: &[Run<f64>],
) -> Result<Vec<Left>> {
    for (slot, launch) in slots.iter().zip(launches) {
        backend.load(*slot, launch)?;
    }
    while slots.iter().any(|slot| backend.counters(*slot).is_running()) {
        backend.advance()?;
    }
    let left = |slot: &usize| {
        Ok(Left { state: backend.state(*slot)?, counters: backend.counters(*slot), report: backend.report(*slot) })
    };
    slots.iter().map(left).collect()
}
