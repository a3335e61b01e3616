//! Comparison of everything that one step computes, stage by stage.

use super::{
    device::to_their_goals,
    row::ConformanceRow,
    scales::Scales,
    setup::{MAX_SWEEPS, blocks, method, traced_workspace},
};
use crate::conformance::{
    bounds::STAGES,
    cases::{Driven, MEMBERS, members},
};
use curvelax_backend::gpu::{Variant, shader::TRACE_FIELDS};
use curvelax_base::error::Result;
use curvelax_flow::scheme::evolve::Evolves;
use curvelax_flow::{
    scheme::{Increments, Workspace, run::Run, step::Steps},
    solver::{Ring, Solver},
};
use curvelax_gpu as gpu;

/// Compares everything that one step of members driven so computes, stage by stage. Those on the GPU are changed by
/// `tamper`; if that does anything, the comparison must fail.
pub fn stages<T: Evolves>(
    driven: Driven,
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    tamper: impl FnOnce(&mut [Run<f64>]),
) -> Result<Vec<ConformanceRow>> {
    let mut launches = members(n, MEMBERS, 1)?;
    driven.change(&mut launches);
    let mut kernel = gpu::Kernel::<T>::new(
        adapter,
        blocks(n)?,
        MEMBERS,
        MAX_SWEEPS,
        Variant { traced: true, ..driven.variant(adapter.capacity().variant(blocks(n)?, solver)) },
    )?;
    kernel.poison_trace()?;
    let mut tampered = launches.clone();
    tamper(&mut tampered);
    to_their_goals(&mut kernel, &(0..MEMBERS).collect::<Vec<_>>(), &tampered)?;
    let trace = kernel.trace()?;
    let mut rows: Vec<ConformanceRow> =
        STAGES.iter().map(|bound| ConformanceRow::begin::<T>(bound, solver, n, 1)).collect();
    for (member, launch) in launches.iter().enumerate() {
        let mut run: Run<T> = launch.convert();
        let mut work = traced_workspace(n)?;
        let Run { state, parameters, .. } = &mut run;
        Steps::step(&state.curve, &mut state.increments, parameters, &method(solver), &mut work);
        let twin = traced(&work, &run.state.increments);
        let scales = Scales::of(launch)?;
        for (field, (row, bound)) in rows.iter_mut().zip(&STAGES).enumerate() {
            let at = (member * TRACE_FIELDS + field) * n;
            let scale = scales.get(bound.scale);
            let limit = bound.factor(adapter.is_hardware()) * T::EPSILON * scale;
            row.add(member, scale, limit, &trace[at..at + n], &twin[field]);
        }
    }
    Ok(rows)
}

/// The twin's side of the trace, in the order of [`STAGES`].
fn traced<T: Evolves>(work: &Workspace<T>, increments: &Increments<T>) -> Vec<Vec<f64>> {
    let wide = |values: &[T]| values.iter().map(|v| v.to_f64()).collect::<Vec<f64>>();
    let ring = |ring: &Ring<T>| wide(ring.nodes());
    let rows = |rows: &[curvelax_flow::solver::Row<T>]| {
        let column =
            |entry: fn(&curvelax_flow::solver::Row<T>) -> T| rows.iter().map(|row| entry(row).to_f64()).collect();
        [column(|row| row.a), column(|row| row.b), column(|row| row.d), column(|row| row.e), column(|row| row.weight)]
    };
    let mut fields = vec![wide(&work.motion.beta), ring(&work.motion.alpha), ring(&work.new.r)];
    fields.extend(rows(&work.curvature.system.rows));
    fields.extend([wide(&work.curvature.system.rhs[0]), ring(&increments.k)]);
    fields.extend(rows(&work.position.system.rows));
    fields.extend([
        wide(&work.position.system.rhs[0]),
        wide(&work.position.system.rhs[1]),
        ring(&increments.x),
        ring(&increments.y),
        ring(&work.new.k),
    ]);
    fields
}
