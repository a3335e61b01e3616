//! Kernels with other forces: the geometric form, and crystals.

use curvelax::{
    backend::gpu::{Gpu, Kernel, Variant},
    conformance::{
        ConformanceRow, Driven,
        compare::{MAX_SWEEPS, MEMBERS},
        crystals, self_test, stages_of,
    },
    ensemble::request::spec::Precision,
    flow::{DIFFUSIVITY_WAVES, ENERGY_WAVES},
    scheme::{evolve::Evolves, run::Run, step::Method},
    solver::{Blocks, Solver},
};

use super::{Outcome, check, dispatches_of};

/// After fixed and adaptive steps, by the bounds of the paper's form; which is another one.
pub(super) fn geometric_agrees<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let blocks = Blocks::new(n).ok_or("n")?;
    let method = Method::coloured(solver, MAX_SWEEPS);
    for adaptive in [false, true] {
        let variant = Driven::Geometric.variant(Variant { adaptive, ..gpu.capacity().variant(blocks, solver) });
        let mut kernel = Kernel::<T>::new(gpu, blocks, MEMBERS, MAX_SWEEPS, variant)?;
        let mut test =
            |driven| self_test::<T>(&mut kernel, gpu.name(), gpu.is_hardware(), &method, n, adaptive, driven);
        test(Driven::Geometric)?;
        if test(Driven::Paper).is_ok() {
            return Err("the geometric kernel passes for the paper's".into());
        }
    }
    Ok(())
}

/// Stage by stage and after fixed and adaptive steps, by the same bounds. In f32 only after few adaptive ones: x counts in
/// their errors, which are then next to rounding, and of forty steps one side makes another number.
pub(super) fn crystals_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    check(&stages_of::<T>(Driven::Crystals, gpu, solver, n, None)?)?;
    let many = (T::PRECISION == Precision::F64).then_some(None);
    for steps in [Some(1), Some(100)].into_iter().chain(many) {
        check(&crystals::<T>(gpu, solver, n, steps, dispatches_of(7), None)?)?;
    }
    let (blocks, method) = (Blocks::new(n).ok_or("n")?, Method::coloured(solver, MAX_SWEEPS));
    for adaptive in [false, true] {
        let variant = Driven::Crystals.variant(Variant { adaptive, ..gpu.capacity().variant(blocks, solver) });
        let mut kernel = Kernel::<T>::new(gpu, blocks, MEMBERS, MAX_SWEEPS, variant)?;
        let mut test =
            |driven| self_test::<T>(&mut kernel, gpu.name(), gpu.is_hardware(), &method, n, adaptive, driven);
        test(Driven::Crystals)?;
        if test(Driven::Geometric).is_ok() {
            return Err("the kernel of crystals passes for another one".into());
        }
    }
    Ok(())
}

/// The factors of the waves of γ and of M are in the comparison: with those of one a thousandth larger on the GPU, it fails.
pub(super) fn another_crystal_fails<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let energy: fn(&mut Run<f64>) = |run| run.parameters.law[ENERGY_WAVES + 1] *= 1.001;
    let mobility: fn(&mut Run<f64>) = |run| run.parameters.law[DIFFUSIVITY_WAVES + 2] *= 1.001;
    for (what, change) in [("energy", energy), ("mobility", mobility)] {
        match crystals::<T>(gpu, solver, n, Some(1), dispatches_of(7), Some(change)) {
            Ok(rows) if rows.iter().all(ConformanceRow::passes) => {
                return Err(format!("another {what} was not noticed").into());
            }
            _ => {}
        }
    }
    Ok(())
}
