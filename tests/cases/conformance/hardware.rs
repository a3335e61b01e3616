//! Kernels as hardware has them, compiled for one size, on an adapter that otherwise has kernels for many.

use super::{Evolves, Outcome, adaptive_agree, everything, passed, runs_agree, stages_agree};
use curvelax::{backend::gpu::Gpu, solver::Solver};
use libtest_mimic::Trial;

/// Nodes: blocks of four and blocks of three.
const NODES: usize = 101;

type Case = fn(&Gpu, Solver, usize) -> Outcome;

/// The cases of a precision and a solver.
pub fn cases<T: Evolves>(index: usize, solver: Solver) -> Vec<Trial> {
    let mut compared: Vec<(&str, Case)> = vec![("the curve agrees after 1 and 100 steps", runs_agree::<T>)];
    if everything() {
        compared.push(("every stage of a step agrees", stages_agree::<T>));
        compared.push(("the curve agrees after adaptive steps", adaptive_agree::<T>));
    }
    let trial = |(what, case): (&str, Case)| {
        let name = format!("{} {} adapter {index}: by a kernel for one size {what}", T::NAME, solver.name());
        Trial::test(name, move || passed(case(&Gpu::list()[index].with_kernels_of_hardware(), solver, NODES)))
    };
    compared.into_iter().map(trial).collect()
}
