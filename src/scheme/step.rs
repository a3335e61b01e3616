//! One step of the paper's scheme, from an old state to the new one in the workspace. Twin of `shaders/step.wgsl`.

use super::{Parameters, State, Workspace, curvature, position, redistribution};
use crate::{
    number::{Mask, Number},
    solver::{Order, Ring, Solver, System, direct, gauss_seidel},
};

/// What the members of a run have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// Solver of the two systems.
    pub solver: Solver,
    /// Order of a Gauss–Seidel sweep.
    pub order: Order,
    /// Sweeps per system after which a member is stalled.
    pub max_sweeps: u32,
}

/// How the two solves of a step went.
#[derive(Clone, Copy, Debug)]
pub struct Stepped<N: Number> {
    /// Sweeps on the curvature system.
    pub sweeps_k: N,
    /// Sweeps on the position system.
    pub sweeps_x: N,
    /// Both systems were solved.
    pub solved: N::Mask,
    /// No residual was infinite or NaN.
    pub finite: N::Mask,
}

/// Share of the rounding error of an unknown below which an error of its increment is not worth a sweep.
pub const NEGLIGIBLE: f64 = 0.1;

/// Computes the new state into `work`; `state` stays as it is, so a step can be refused.
pub fn step<N: Number>(state: &State<N>, p: &Parameters<N>, method: &Method, work: &mut Workspace<N>) -> Stepped<N> {
    let length = redistribution::redistribute(state, p, work);
    // Curvature and position are rounded relative to the radius of the circle of this length.
    let radius = length * N::of(0.5 / std::f64::consts::PI);
    let rounding = N::of(NEGLIGIBLE * N::EPSILON);

    curvature::assemble(state, p, work);
    let blocks = work.blocks;
    let for_k = solve(&work.curvature, [(&state.dk, &mut work.dk)], blocks, p, method, rounding / radius);
    add(&state.k, &work.dk, &mut work.k);

    position::assemble(state, p, work);
    let unknowns = [(&state.dx, &mut work.dx), (&state.dy, &mut work.dy)];
    let for_x = solve(&work.position, unknowns, blocks, p, method, rounding * radius);
    add(&state.x, &work.dx, &mut work.x);
    add(&state.y, &work.dy, &mut work.y);

    // What the second solve did counts only where the first one succeeded.
    Stepped {
        sweeps_k: for_k.sweeps,
        sweeps_x: N::select(for_k.converged, for_x.sweeps, N::of(0.0)),
        solved: for_k.converged.and(for_x.converged),
        finite: for_k.finite.and(for_x.finite.or(for_k.converged.not())),
    }
}

/// Takes the state that `step` computed.
pub fn accept<N: Number>(state: &mut State<N>, work: &mut Workspace<N>) {
    std::mem::swap(&mut state.x, &mut work.x);
    std::mem::swap(&mut state.y, &mut work.y);
    std::mem::swap(&mut state.k, &mut work.k);
    std::mem::swap(&mut state.r, &mut work.r);
    std::mem::swap(&mut state.dk, &mut work.dk);
    std::mem::swap(&mut state.dx, &mut work.dx);
    std::mem::swap(&mut state.dy, &mut work.dy);
}

/// Solves for the increments, sweeps starting from the previous step's.
fn solve<N: Number, const F: usize>(
    system: &System<N, F>,
    unknowns: [(&Ring<N>, &mut Ring<N>); F],
    blocks: crate::solver::Blocks,
    p: &Parameters<N>,
    method: &Method,
    negligible: N,
) -> gauss_seidel::Swept<N> {
    let started = unknowns.map(|(previous, unknown)| {
        unknown.clone_from(previous);
        unknown
    });
    match method.solver {
        Solver::GaussSeidel => {
            let control = gauss_seidel::Control {
                tolerance: p.tolerance,
                negligible,
                sor: p.sor,
                max_sweeps: method.max_sweeps,
                order: method.order,
            };
            gauss_seidel::solve(system, started, blocks, &control)
        }
        Solver::Direct => {
            direct::solve(system, started);
            let yes = N::Mask::all_of(true);
            gauss_seidel::Swept { sweeps: N::of(0.0), converged: yes, finite: yes }
        }
    }
}

fn add<N: Number>(old: &Ring<N>, increment: &Ring<N>, new: &mut Ring<N>) {
    for i in 0..old.len() {
        new[i] = old[i] + increment[i];
    }
    new.close();
}
