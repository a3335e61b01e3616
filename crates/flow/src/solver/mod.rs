//! Periodic pentadiagonal systems on a ring of nodes: rows, Gauss–Seidel sweeps, alone or in V-cycles, and a direct
//! solve.
//!
//! A solver is a type that implements [`Solves`]. The rest of the program knows only its [`Facts`].

pub mod direct;
pub mod gauss_seidel;
pub mod multigrid;
pub mod ring;
pub mod sweeps;
pub mod system;

use serde::{Deserialize, Serialize};

pub use ring::{Blocks, Ring, Sums};
pub use sweeps::Order;
pub use system::{Equation, Equations, Row, System};

use crate::number::Number;
use gauss_seidel::SWEEPS_PER_CHECK;
use multigrid::{COARSEST, Discretisation, Levels, SWEEPS_PER_CYCLE};
use sweeps::{Control, Swept};

/// The solver of the periodic pentadiagonal systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Gauss–Seidel sweeps, the paper's.
    GaussSeidel,
    /// The same sweeps inside V-cycles.
    Multigrid,
    /// Periodic pentadiagonal elimination.
    Direct,
}

/// Evaluates `$body` with `$S` as the type of a [`Solver`], for code that is compiled for one solver at a time.
#[macro_export]
macro_rules! by_solver {
    ($solver:expr, $S:ident => $body:expr) => {
        match $solver {
            $crate::solver::Solver::GaussSeidel => {
                type $S = $crate::solver::Sweeps;
                $body
            }
            $crate::solver::Solver::Multigrid => {
                type $S = $crate::solver::Cycles;
                $body
            }
            $crate::solver::Solver::Direct => {
                type $S = $crate::solver::Elimination;
                $body
            }
        }
    };
}

pub use by_solver;

impl Solver {
    /// All solvers.
    pub const ALL: [Solver; 3] = [Solver::GaussSeidel, Solver::Multigrid, Solver::Direct];

    /// Their names, in the same order.
    pub const NAMES: [&str; Solver::ALL.len()] = {
        let mut names = [""; Solver::ALL.len()];
        let mut i = 0;
        while i < names.len() {
            names[i] = Solver::ALL[i].name();
            i += 1;
        }
        names
    };

    /// Returns what the rest of the program knows about it.
    pub const fn facts(self) -> &'static Facts {
        by_solver!(self, S => &<S as Solves>::FACTS)
    }

    /// Returns the name used in flags and files.
    pub const fn name(self) -> &'static str {
        self.facts().name
    }

    /// Returns whether it sweeps until a tolerance is met.
    pub const fn sweeps(self) -> bool {
        self.facts().sweeps
    }
}

/// A solver as a type.
pub trait Solves: 'static {
    /// What the rest of the program knows about it.
    const FACTS: Facts;

    /// Allocates its memory, apart from the unknowns, for systems of `n` equations.
    fn memory<N: Number, const F: usize>(n: usize) -> Memory<N, F>;

    /// Solves `system` for `unknown`, one ring per right-hand side, in the lanes that are `live`; sweeps start from the
    /// values of `unknown`. Other lanes cost no sweeps and mean nothing afterwards.
    fn solve<N: Number, const F: usize>(
        system: &impl Discretisation<N, F>,
        unknown: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        blocks: Blocks,
        control: &Control<N>,
        live: N::Mask,
    ) -> Swept<N>;
}

/// The name, needs and properties of a solver.
#[derive(Debug)]
pub struct Facts {
    /// Name used in flags and files.
    pub name: &'static str,
    /// Name used in messages.
    pub title: &'static str,
    /// Whether it sweeps until a tolerance is met.
    pub sweeps: bool,
    /// Whether it needs more sweeps for longer steps.
    pub slows_with_step: bool,
    /// Maximum number of sweeps per solve, whatever is requested.
    pub max_sweeps: u32,
    /// Keys of the spec that have no meaning for it.
    pub refuses: &'static [&'static str],
    /// Why they have none.
    pub refuses_because: &'static str,
    /// Numbers per node of its [`Memory`], both systems of a step together.
    pub numbers_per_node: usize,
    /// What the kernel needs to know about it.
    pub kernel: KernelFacts,
}

/// What the kernel needs to know about a solver.
#[derive(Debug)]
pub struct KernelFacts {
    /// Whether a member that is one subgroup may exchange by shuffles.
    pub shuffles: bool,
    /// Rows of four numbers per block in workgroup memory, where threads exchange by barriers.
    pub rows_per_block: usize,
    /// Further numbers there for a ring of n nodes.
    pub numbers: fn(usize) -> usize,
    /// Sweeps between two checks of the residual.
    pub sweeps_per_look: u32,
    /// Loop iterations between two checks.
    pub iterations_per_look: u32,
    /// Loop iterations before the first check.
    pub iterations_per_solve: u32,
}

/// The memory of solvers: each allocates what it needs, and leaves the rest empty.
#[derive(Clone, Debug)]
pub struct Memory<N, const F: usize> {
    /// The rows used by sweeps.
    pub system: System<N, F>,
    /// Triangular factor.
    pub factor: direct::Factor<N, F>,
    /// Coarser levels.
    pub levels: Levels<N, F>,
}

impl<N: Number, const F: usize> Memory<N, F> {
    /// Allocates nothing.
    pub fn none() -> Self {
        Self::with([0; 3])
    }

    /// Allocates what any solver needs for systems of `n` equations.
    pub fn any(n: usize) -> Self {
        Self::with([n; 3])
    }

    fn with([system, factor, levels]: [usize; 3]) -> Self {
        Memory { system: System::zeros(system), factor: direct::Factor::new(factor), levels: Levels::new(levels) }
    }
}

/// [`Solver::GaussSeidel`] as a type.
pub struct Sweeps;

impl Solves for Sweeps {
    const FACTS: Facts = Facts {
        name: "gauss-seidel",
        title: "Gauss-Seidel sweeps",
        sweeps: true,
        slows_with_step: true,
        max_sweeps: u32::MAX,
        refuses: &[],
        refuses_because: "",
        numbers_per_node: 13,
        kernel: KernelFacts {
            shuffles: true,
            rows_per_block: 3,
            numbers: |_| 0,
            sweeps_per_look: SWEEPS_PER_CHECK,
            iterations_per_look: SWEEPS_PER_CHECK,
            iterations_per_solve: 0,
        },
    };

    fn memory<N: Number, const F: usize>(n: usize) -> Memory<N, F> {
        Memory { system: System::zeros(n), ..Memory::none() }
    }

    #[inline(always)]
    fn solve<N: Number, const F: usize>(
        system: &impl Discretisation<N, F>,
        unknown: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        blocks: Blocks,
        control: &Control<N>,
        live: N::Mask,
    ) -> Swept<N> {
        memory.system.assemble(system);
        gauss_seidel::solve(&memory.system, unknown, blocks, control, live)
    }
}

/// [`Solver::Multigrid`] as a type.
pub struct Cycles;

impl Solves for Cycles {
    const FACTS: Facts = Facts {
        name: "multigrid",
        title: "sweeps inside multigrid",
        sweeps: true,
        slows_with_step: false,
        // A V-cycle of two sweeps at least halves the error, so a solve takes some 50 cycles; one of 500 would never
        // end.
        max_sweeps: 1000,
        refuses: &["order", "sor"],
        refuses_because: "multigrid sweeps by colours and without over-relaxation",
        numbers_per_node: 13 + 65,
        kernel: KernelFacts {
            shuffles: false,
            rows_per_block: 3,
            numbers: |n| 13 * multigrid::coarse_nodes(n) + 4 * multigrid::odd_rings(n).max(1) + COARSEST * COARSEST,
            sweeps_per_look: SWEEPS_PER_CYCLE,
            // At most 11 levels of 4 colours.
            iterations_per_look: 300,
            // Includes the inversion of the matrix of the coarsest level.
            iterations_per_solve: 300,
        },
    };

    fn memory<N: Number, const F: usize>(n: usize) -> Memory<N, F> {
        Memory { system: System::zeros(n), levels: Levels::new(n), ..Memory::none() }
    }

    #[inline(always)]
    fn solve<N: Number, const F: usize>(
        system: &impl Discretisation<N, F>,
        unknown: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        blocks: Blocks,
        control: &Control<N>,
        live: N::Mask,
    ) -> Swept<N> {
        memory.system.assemble(system);
        system.discretised(&mut memory.levels);
        multigrid::solve(&memory.system, unknown, blocks, control, live, &mut memory.levels)
    }
}

/// [`Solver::Direct`] as a type.
pub struct Elimination;

impl Solves for Elimination {
    const FACTS: Facts = Facts {
        name: "direct",
        title: "direct solver",
        sweeps: false,
        slows_with_step: false,
        max_sweeps: u32::MAX,
        refuses: &["order", "tolerance", "sor", "max-sweeps"],
        refuses_because: "the direct solver makes no sweeps",
        numbers_per_node: 11,
        kernel: KernelFacts {
            shuffles: false,
            rows_per_block: 6,
            numbers: |_| 0,
            sweeps_per_look: SWEEPS_PER_CHECK,
            iterations_per_look: SWEEPS_PER_CHECK,
            iterations_per_solve: 0,
        },
    };

    fn memory<N: Number, const F: usize>(n: usize) -> Memory<N, F> {
        Memory { factor: direct::Factor::new(n), ..Memory::none() }
    }

    #[inline(always)]
    fn solve<N: Number, const F: usize>(
        system: &impl Discretisation<N, F>,
        unknown: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        _: Blocks,
        _: &Control<N>,
        _: N::Mask,
    ) -> Swept<N> {
        let finite = direct::solve(system, unknown, &mut memory.factor);
        Swept { sweeps: N::of(0.0), converged: finite, finite }
    }
}
