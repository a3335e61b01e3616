//! Kernels with other forces: the geometric form, crystals, driving forces and what is kept.

use curvelax::{
    backend::gpu::{Gpu, Kernel, Variant, kernel::Budget},
    conformance::{
        ConformanceRow, Driven, adaptive_members,
        compare::{MAX_SWEEPS, MEMBERS, on_gpu},
        runs, self_test, stages,
    },
    ensemble::request::spec::Precision,
    flow::{DIFFUSIVITY_WAVES, ENERGY_WAVES},
    forcing::{CONSERVED, DRIVE, FEEDBACK, FEEDBACK_AREA, KEPT_AREA, KEPT_LENGTH},
    scheme::{evolve::Evolves, run::Run, step::Method},
    solver::{Blocks, Solver},
};

use super::{Outcome, check, dispatches_of, same};

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

/// Stage by stage and after fixed and adaptive steps, by the same bounds; the kernel is another one than that of
/// `other`. In f32 only after few adaptive steps: x counts in their errors, which are then next to rounding, and of
/// forty steps one side makes another number.
fn driven_agree<T: Evolves>([as_driven, other]: [Driven; 2], gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    check(&stages::<T>(as_driven, gpu, solver, n, |_| ())?)?;
    let many = (T::PRECISION == Precision::F64).then_some(None);
    for steps in [Some(1), Some(100)].into_iter().chain(many) {
        check(&runs::<T>(as_driven, gpu, solver, n, steps, dispatches_of(7), |_| ())?)?;
    }
    let (blocks, method) = (Blocks::new(n).ok_or("n")?, Method::coloured(solver, MAX_SWEEPS));
    for adaptive in [false, true] {
        let variant = as_driven.variant(Variant { adaptive, ..gpu.capacity().variant(blocks, solver) });
        let mut kernel = Kernel::<T>::new(gpu, blocks, MEMBERS, MAX_SWEEPS, variant)?;
        let mut test =
            |driven| self_test::<T>(&mut kernel, gpu.name(), gpu.is_hardware(), &method, n, adaptive, driven);
        test(as_driven)?;
        if test(other).is_ok() {
            return Err(format!("the kernel for {as_driven:?} passes for {other:?}").into());
        }
    }
    Ok(())
}

pub(super) fn crystals_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    driven_agree::<T>([Driven::Crystals, Driven::Geometric], gpu, solver, n)
}

pub(super) fn forced_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    driven_agree::<T>([Driven::Forced, Driven::Paper], gpu, solver, n)
}

pub(super) fn forced_crystals_agree<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    driven_agree::<T>([Driven::ForcedCrystals, Driven::Paper], gpu, solver, n)
}

/// Where a dispatch ends or pauses changes no bit of members of which something is kept.
pub(super) fn forced_bits<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    let mut launches = adaptive_members(n, MEMBERS, 2, 1e-3, T::PRECISION)?;
    Driven::Forced.change(&mut launches);
    let at_once = on_gpu::<T>(gpu, solver, n, &launches, dispatches_of(1000))?;
    for budget in [dispatches_of(1), Budget { steps: 1000, sweeps: 24 }] {
        let in_parts = on_gpu::<T>(gpu, solver, n, &launches, budget)?;
        for (j, (part, whole)) in in_parts.iter().zip(&at_once).enumerate() {
            if whole.counters.steps < 2 || whole.counters.status != 0 {
                return Err(format!("member {j}: {:?}", whole.counters).into());
            }
            same(part, whole, &format!("member {j} with {budget:?}"))?;
        }
    }
    Ok(())
}

/// Each number of a force and of what is kept is in the comparison: with another one on the GPU, it fails.
pub(super) fn another_force_fails<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    type Change = fn(&mut Run<f64>);
    let changes: [(&str, Change); 6] = [
        ("force", |run| run.parameters.law[DRIVE] *= 1.1),
        ("gain", |run| run.parameters.law[FEEDBACK] *= 1.1),
        ("area of feedback", |run| run.parameters.law[FEEDBACK_AREA] *= 1.1),
        ("area kept", |run| run.parameters.law[KEPT_AREA] *= 1.001),
        ("length kept", |run| run.parameters.law[KEPT_LENGTH] *= 1.001),
        ("set of what is kept", |run| run.parameters.law[CONSERVED] = 3.0 - run.parameters.law[CONSERVED]),
    ];
    for (what, change) in changes {
        let change_all = |runs: &mut [Run<f64>]| runs.iter_mut().for_each(change);
        match runs::<T>(Driven::Forced, gpu, solver, n, Some(1), dispatches_of(7), change_all) {
            Ok(rows) if rows.iter().all(ConformanceRow::passes) => {
                return Err(format!("another {what} was not noticed").into());
            }
            _ => {}
        }
    }
    Ok(())
}

/// The factors of the waves of γ and of M are in the comparison: with those of one a thousandth larger on the GPU, or
/// four where bounds are four times as large, it fails.
pub(super) fn another_crystal_fails<T: Evolves>(gpu: &Gpu, solver: Solver, n: usize) -> Outcome {
    type Change = fn(&mut Run<f64>);
    let changes: [Change; 2] = match gpu.is_hardware() {
        false => [
            |run| run.parameters.law[ENERGY_WAVES + 1] *= 1.001,
            |run| run.parameters.law[DIFFUSIVITY_WAVES + 2] *= 1.001,
        ],
        true => [
            |run| run.parameters.law[ENERGY_WAVES + 1] *= 1.004,
            |run| run.parameters.law[DIFFUSIVITY_WAVES + 2] *= 1.004,
        ],
    };
    for (what, change) in ["energy", "mobility"].into_iter().zip(changes) {
        let change_all = |runs: &mut [Run<f64>]| runs.iter_mut().for_each(change);
        match runs::<T>(Driven::Crystals, gpu, solver, n, Some(1), dispatches_of(7), change_all) {
            Ok(rows) if rows.iter().all(ConformanceRow::passes) => {
                return Err(format!("another {what} was not noticed").into());
            }
            _ => {}
        }
    }
    Ok(())
}
