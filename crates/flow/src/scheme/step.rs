//! One step of the paper's scheme, from an old curve to the new one in the workspace. Twin of `shaders/step.wgsl`.

use super::{
    Branches, Curve, Increments, Parameters, Workspace, curvature::Curvature, extrapolation::MOST_ORDER, forces,
    forcing, position::Position, pull, redistribution, state,
};
use crate::{
    number::{Mask, Number, Real},
    solver::{Order, Solver, Solves, by_solver, refinement, sweeps::Control},
};

/// The settings that the members of a run share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// Solver of the two systems.
    pub solver: Solver,
    /// Order of a Gauss–Seidel sweep.
    pub order: Order,
    /// Maximum sweeps per system; a member that needs more is stalled.
    pub max_sweeps: u32,
    /// Highest order of an adaptive step; never above [`MOST_ORDER`].
    pub most_order: u32,
}

impl Method {
    /// The method whose sweeps visit the nodes by colours, as the kernel's do, with steps of any order.
    pub fn coloured(solver: Solver, max_sweeps: u32) -> Method {
        Method { solver, order: Order::Coloured, max_sweeps, most_order: MOST_ORDER }
    }
}

/// Result of the two solves of a step.
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

/// Fraction of the rounding error of an unknown below which an error of its increment is not worth a sweep.
pub const NEGLIGIBLE: f64 = 0.1;

/// A number for which steps are compiled, here and not again in every crate that makes steps.
pub trait Steps: Real {
    /// Computes the curve a time `p.tau` after `old` into `work.new`; the solves start at `increments`, which returns
    /// the result.
    fn step(
        old: &Curve<Self>,
        increments: &mut Increments<Self>,
        p: &Parameters<Self>,
        method: &Method,
        work: &mut Workspace<Self>,
    ) -> Stepped<Self>;
}

macro_rules! steps {
    ($($real:ident)*) => {
        $(
            impl Steps for $real {
                fn step(
                    old: &Curve<$real>,
                    increments: &mut Increments<$real>,
                    p: &Parameters<$real>,
                    method: &Method,
                    work: &mut Workspace<$real>,
                ) -> Stepped<$real> {
                    let branches = p.branches();
                    by_solver!(method.solver, S => step_by::<$real, S>(old, increments, p, branches, true, method, work))
                }
            }
        )*
    };
}

steps!(f64 f32);

/// Like [`Steps::step`], for members side by side that share `branches`, by the solver `S`. Lanes that are not `live`
/// cost no sweeps and mean nothing afterwards.
#[inline(always)]
pub fn step_by<N: Number, S: Solves>(
    old: &Curve<N>,
    increments: &mut Increments<N>,
    p: &Parameters<N>,
    branches: Branches,
    live: N::Mask,
    method: &Method,
    work: &mut Workspace<N>,
) -> Stepped<N> {
    let Workspace { blocks, motion, new, curvature, position, lacks_curvature, lacks_positions, by, gradients, .. } =
        work;
    let refined = branches.is_refined::<N>();
    // Not compiled for members side by side, which nobody traces.
    let traced = N::LANES == 1 && work.traced;
    let refinements = if refined { work.refinements } else { N::of(0.0) };
    let length = redistribution::redistribute(old, p, branches, *blocks, motion, &mut new.r);
    // Curvature and position are rounded relative to the radius of the circle of this length.
    let radius = length * N::of(0.5 / std::f64::consts::PI);
    let rounding = N::of(NEGLIGIBLE * N::EPSILON);
    let control = Control {
        tolerance: p.tolerance,
        negligible: rounding / radius,
        sor: p.sor,
        max_sweeps: method.max_sweeps,
        order: method.order,
        refined,
        refinements,
    };

    let equations = Curvature::new(old, new, motion, p);
    if traced {
        curvature.system.assemble(&equations);
    }
    let unknown = [&mut increments.k];
    let for_k = refinement::solve::<N, S, 1>(&equations, unknown, curvature, lacks_curvature, *blocks, &control, live);
    state::advance(2, &old.k, &increments.k, &mut new.k);

    if branches.geometric {
        forces::measure(old, motion);
    }
    let equations = Position::new(old, new, motion, p, branches);
    if traced {
        position.system.assemble(&equations);
    }
    let control = Control { negligible: rounding * radius, ..control };
    let unknowns = [&mut increments.x, &mut increments.y];
    let for_x = refinement::solve::<N, S, 2>(&equations, unknowns, position, lacks_positions, *blocks, &control, live);
    if branches.law.is_forced() {
        forcing::push(old, new, motion, p.tau, [&increments.x, &increments.y], by);
        forcing::correct(old.nodes(), [&by[0], &by[1]], new, p, branches.law, *blocks, gradients);
    } else {
        state::advance(0, &old.x, &increments.x, &mut new.x);
        state::advance(1, &old.y, &increments.y, &mut new.y);
    }
    pull::pull(new, p, branches);

    // The second solve counts only if the first one succeeded.
    Stepped {
        sweeps_k: for_k.sweeps,
        sweeps_x: N::select(for_k.converged, for_x.sweeps, N::of(0.0)),
        solved: for_k.converged.and(for_x.converged),
        finite: for_k.finite.and(for_x.finite.or(for_k.converged.not())),
    }
}
