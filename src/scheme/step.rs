//! One step of the paper's scheme, from an old curve to the new one in the workspace. Twin of `shaders/step.wgsl`.

use super::{Curve, Increments, Parameters, Workspace, coarse, curvature, position, pull, redistribution};
use crate::{
    number::{Mask, Number},
    solver::{Order, Ring, Solver, System, direct, gauss_seidel, multigrid},
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

/// Computes the curve a time `p.tau` after `old` into `work.new`; `increments` is where the solves start, and the result.
pub fn step<N: Number>(
    old: &Curve<N>,
    increments: &mut Increments<N>,
    p: &Parameters<N>,
    method: &Method,
    work: &mut Workspace<N>,
) -> Stepped<N> {
    let length = redistribution::redistribute(old, p, work);
    // Curvature and position are rounded relative to the radius of the circle of this length.
    let radius = length * N::of(0.5 / std::f64::consts::PI);
    let rounding = N::of(NEGLIGIBLE * N::EPSILON);
    let blocks = work.blocks;

    curvature::assemble(old, p, work);
    if method.solver == Solver::Multigrid {
        coarse::curvature(old, p, work);
    }
    let Workspace { curvature, curvature_levels, .. } = work;
    let for_k = solve(curvature, [&mut increments.k], blocks, p, method, rounding / radius, curvature_levels);
    add(&old.k, &increments.k, &mut work.new.k);

    position::assemble(old, p, work);
    if method.solver == Solver::Multigrid {
        coarse::position(p, work);
    }
    let unknowns = [&mut increments.x, &mut increments.y];
    let Workspace { position, position_levels, .. } = work;
    let for_x = solve(position, unknowns, blocks, p, method, rounding * radius, position_levels);
    add(&old.x, &increments.x, &mut work.new.x);
    add(&old.y, &increments.y, &mut work.new.y);
    pull::pull(&mut work.new, p);

    // What the second solve did counts only where the first one succeeded.
    Stepped {
        sweeps_k: for_k.sweeps,
        sweeps_x: N::select(for_k.converged, for_x.sweeps, N::of(0.0)),
        solved: for_k.converged.and(for_x.converged),
        finite: for_k.finite.and(for_x.finite.or(for_k.converged.not())),
    }
}

/// Solves for the increments, sweeps starting from where they are.
fn solve<N: Number, const F: usize>(
    system: &System<N, F>,
    unknowns: [&mut Ring<N>; F],
    blocks: crate::solver::Blocks,
    p: &Parameters<N>,
    method: &Method,
    negligible: N,
    levels: &mut multigrid::Levels<N, F>,
) -> gauss_seidel::Swept<N> {
    let control = gauss_seidel::Control {
        tolerance: p.tolerance,
        negligible,
        sor: p.sor,
        max_sweeps: method.max_sweeps,
        order: method.order,
    };
    match method.solver {
        Solver::GaussSeidel => gauss_seidel::solve(system, unknowns, blocks, &control),
        Solver::Multigrid => multigrid::solve(system, unknowns, blocks, &control, levels),
        Solver::Direct => {
            let finite = direct::solve(system, unknowns);
            gauss_seidel::Swept { sweeps: N::of(0.0), converged: finite, finite }
        }
    }
}

fn add<N: Number>(old: &Ring<N>, increment: &Ring<N>, new: &mut Ring<N>) {
    for i in 0..old.len() {
        new[i] = old[i] + increment[i];
    }
    new.close();
}
