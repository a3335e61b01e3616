//! Periodic pentadiagonal systems on a ring of nodes: rows, Gauss–Seidel sweeps, and a direct solve.
//!
//! A solver is a type that implements [`Solves`]. The rest of the program knows only its [`Facts`].

pub mod direct;
pub mod gauss_seidel;
pub mod refinement;
pub mod ring;
pub mod sweeps;
pub mod system;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

pub use ring::{Blocks, Ring, Sums};
pub use sweeps::Order;
pub use system::{Equation, Equations, Row, System};

use crate::number::Number;
use sweeps::{Control, Swept};

/// The solver of the periodic pentadiagonal systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Solver {
    /// Gauss–Seidel sweeps, the paper's.
    GaussSeidel,
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
            $crate::solver::Solver::Direct => {
                type $S = $crate::solver::Elimination;
                $body
            }
        }
    };
}

pub use by_solver;

/// The name of a solver that there was.
pub const MULTIGRID: &str = "multigrid";

impl Solver {
    /// All solvers.
    pub const ALL: [Solver; 2] = [Solver::GaussSeidel, Solver::Direct];

    /// Their names, in the same order.
    pub const NAMES: [&str; Solver::ALL.len()] = [Solver::ALL[0].name(), Solver::ALL[1].name()];

    /// Returns what the rest of the program knows about it.
    pub const fn facts(self) -> &'static Facts {
        by_solver!(self, S => &<S as Solves>::FACTS)
    }

    /// Returns the name used in flags and files.
    pub const fn name(self) -> &'static str {
        self.facts().name
    }

    /// Returns the solver called `name`.
    ///
    /// # Errors
    ///
    /// Names `known` if there is none.
    pub fn named<E: de::Error>(name: &str, known: &'static [&'static str]) -> Result<Solver, E> {
        match Solver::ALL.into_iter().find(|solver| solver.name() == name) {
            Some(solver) => Ok(solver),
            None if name == MULTIGRID => Err(E::custom(
                "multigrid is gone, since the direct solver was 2.5 to 5 times as fast wherever both were measured; use \
                 direct",
            )),
            None => Err(E::unknown_variant(name, known)),
        }
    }

    /// Returns whether it sweeps until a tolerance is met.
    pub const fn sweeps(self) -> bool {
        self.facts().sweeps
    }
}

impl Serialize for Solver {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Solver {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Solver::named(&String::deserialize(deserializer)?, &Solver::NAMES)
    }
}

/// A solver as a type.
pub trait Solves: 'static {
    /// What the rest of the program knows about it.
    const FACTS: Facts;

    /// Solves `system` for `unknown`, one ring per right-hand side, in the lanes that are `live`; sweeps start from the
    /// values of `unknown`. Other lanes cost no sweeps and mean nothing afterwards.
    fn solve<N: Number, const F: usize>(
        system: &impl Equations<N, F>,
        unknown: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        blocks: Blocks,
        control: &Control<N>,
        live: N::Mask,
    ) -> Swept<N>;

    /// Makes one round of a [refinement](refinement::solve), in short numbers: solves for what `unknown` lacks; values
    /// of `lacks` do not matter. Earlier rounds have made `made` sweeps. Converged are the lanes that may continue.
    #[expect(clippy::too_many_arguments)]
    fn round<N: Number, const F: usize>(
        system: &impl Equations<N, F>,
        unknown: [&Ring<N>; F],
        lacks: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        blocks: Blocks,
        control: &Control<N>,
        made: N,
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
    /// Keys of the spec that have no meaning for it.
    pub refuses: &'static [&'static str],
    /// Why they have none.
    pub refuses_because: &'static str,
    /// Numbers per node of its [`Memory`], both systems of a step together.
    pub numbers_per_node: usize,
    /// How many more it stores in short numbers, whose solutions are refined.
    pub numbers_to_refine: usize,
    /// Whether a member that is one subgroup of the kernel may exchange by shuffles.
    pub shuffles: bool,
    /// Rows of four numbers per block in the kernel's workgroup memory, where threads exchange by barriers.
    pub rows_per_block: usize,
}

/// The memory of solvers: each allocates what it needs, and leaves the rest empty.
#[derive(Clone, Debug)]
pub struct Memory<N, const F: usize> {
    /// The rows used by sweeps.
    pub system: System<N, F>,
    /// Triangular factor.
    pub factor: direct::Factor<N, F>,
}

impl<N: Number, const F: usize> Memory<N, F> {
    /// Allocates what any solver needs for systems of `n` equations.
    pub fn any(n: usize) -> Self {
        Self::with([n; 2])
    }

    /// Allocates what the solver `S` needs for them.
    pub fn of_solver<S: Solves>(n: usize) -> Self {
        Self::with(if S::FACTS.sweeps { [n, 0] } else { [0, n] })
    }

    fn with([system, factor]: [usize; 2]) -> Self {
        Memory { system: System::zeros(system), factor: direct::Factor::new(factor) }
    }
}

/// [`Solver::GaussSeidel`] as a type.
pub struct Sweeps;

impl Solves for Sweeps {
    const FACTS: Facts = Facts {
        name: "gauss-seidel",
        title: "Gauss-Seidel sweeps",
        sweeps: true,
        refuses: &[],
        refuses_because: "",
        numbers_per_node: 13,
        numbers_to_refine: 0,
        shuffles: true,
        rows_per_block: 3,
    };

    #[inline(always)]
    fn solve<N: Number, const F: usize>(
        system: &impl Equations<N, F>,
        unknown: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        blocks: Blocks,
        control: &Control<N>,
        live: N::Mask,
    ) -> Swept<N> {
        memory.system.assemble(system);
        gauss_seidel::solve(&memory.system, unknown, blocks, control, live)
    }

    #[inline(always)]
    fn round<N: Number, const F: usize>(
        system: &impl Equations<N, F>,
        unknown: [&Ring<N>; F],
        lacks: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        blocks: Blocks,
        control: &Control<N>,
        made: N,
        live: N::Mask,
    ) -> Swept<N> {
        memory.system.assemble(&refinement::Remaining { of: system, unknown });
        gauss_seidel::sweep_round(&memory.system, lacks, blocks, control, made, live)
    }
}

/// [`Solver::Direct`] as a type.
pub struct Elimination;

impl Solves for Elimination {
    const FACTS: Facts = Facts {
        name: "direct",
        title: "direct solver",
        sweeps: false,
        refuses: &["order", "tolerance", "sor", "max-sweeps"],
        refuses_because: "the direct solver makes no sweeps",
        numbers_per_node: 11,
        numbers_to_refine: 9,
        shuffles: false,
        rows_per_block: 6,
    };

    #[inline(always)]
    fn solve<N: Number, const F: usize>(
        system: &impl Equations<N, F>,
        unknown: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        _: Blocks,
        _: &Control<N>,
        _: N::Mask,
    ) -> Swept<N> {
        Swept::without_sweeps(direct::solve(system, unknown, &mut memory.factor))
    }

    #[inline(always)]
    fn round<N: Number, const F: usize>(
        system: &impl Equations<N, F>,
        unknown: [&Ring<N>; F],
        lacks: [&mut Ring<N>; F],
        memory: &mut Memory<N, F>,
        _: Blocks,
        _: &Control<N>,
        _: N,
        _: N::Mask,
    ) -> Swept<N> {
        Swept::without_sweeps(direct::refine(system, unknown, lacks, &mut memory.factor))
    }
}
