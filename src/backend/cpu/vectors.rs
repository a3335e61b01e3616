//! Vector instructions, chosen at run time: the same source, compiled once for each.

use std::sync::Mutex;

use pulp::{NullaryFnOnce, Simd};

use crate::{
    error::{Error, Result},
    number::{Element, Instructions, Lanes, Number, Real},
    scheme::{
        evolve::{Run, Team, evolve_abreast},
        step::Method,
    },
    solver::Blocks,
};

/// Instructions for members side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vectors {
    /// One member at a time: the reference.
    None,
    /// 128 bits: SSE4.2 on x86-64, NEON on aarch64.
    Bits128,
    /// 256 bits: AVX2.
    Bits256,
    /// 512 bits: AVX-512.
    Bits512,
}

impl Vectors {
    /// All of them, the widest last.
    pub const ALL: [Vectors; 4] = [Vectors::None, Vectors::Bits128, Vectors::Bits256, Vectors::Bits512];

    /// Whether this processor has them.
    pub fn are_available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        match self {
            Vectors::None => true,
            Vectors::Bits128 => pulp::x86::V2::is_available(),
            Vectors::Bits256 => pulp::x86::V3::is_available(),
            Vectors::Bits512 => pulp::x86::V4::is_available(),
        }
        #[cfg(target_arch = "aarch64")]
        match self {
            Vectors::None => true,
            Vectors::Bits128 => pulp::aarch64::Neon::is_available(),
            Vectors::Bits256 | Vectors::Bits512 => false,
        }
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
        matches!(self, Vectors::None)
    }

    /// The widest that this processor has.
    pub fn widest() -> Vectors {
        Self::ALL.into_iter().rfind(|vectors| vectors.are_available()).unwrap_or(Vectors::None)
    }
}

/// A number with vector code. Implemented for each number by name, so that the code is compiled here, once, and not again
/// in every program that uses a back end.
pub trait Vectorised: Real {
    /// A crew of `threads` threads for rings cut by `blocks`.
    #[doc(hidden)]
    fn crew(vectors: Vectors, blocks: Blocks, threads: usize) -> Result<Box<dyn Crew<Self>>>;
}

/// How many registers a number takes, for each of the instructions.
macro_rules! vectorised {
    ($real:ident, $of128:literal, $of256:literal, $of512:literal) => {
        impl Vectorised for $real {
            fn crew(vectors: Vectors, blocks: Blocks, threads: usize) -> Result<Box<dyn Crew<$real>>> {
                let crew = match vectors {
                    Vectors::None => Some(Group::<_, $real>::crew(pulp::Scalar::new(), blocks, threads)),
                    #[cfg(target_arch = "x86_64")]
                    Vectors::Bits128 => abreast::<_, $real, $of128>(pulp::x86::V2::try_new(), blocks, threads),
                    #[cfg(target_arch = "aarch64")]
                    Vectors::Bits128 => abreast::<_, $real, $of128>(pulp::aarch64::Neon::try_new(), blocks, threads),
                    #[cfg(target_arch = "x86_64")]
                    Vectors::Bits256 => abreast::<_, $real, $of256>(pulp::x86::V3::try_new(), blocks, threads),
                    #[cfg(target_arch = "x86_64")]
                    Vectors::Bits512 => abreast::<_, $real, $of512>(pulp::x86::V4::try_new(), blocks, threads),
                    #[allow(unreachable_patterns)]
                    _ => None,
                };
                crew.ok_or_else(|| Error::Failed(format!("this processor has no vector instructions of {vectors:?}")))
            }
        }
    };
}

vectorised!(f64, 2, 2, 1);
vectorised!(f32, 2, 2, 1);

/// A crew whose members go abreast in `R` registers of the instructions, if the processor has them.
fn abreast<S: Instructions, T: Element<S>, const R: usize>(
    simd: Option<S>,
    blocks: Blocks,
    threads: usize,
) -> Option<Box<dyn Crew<T>>> {
    simd.map(|simd| Group::<S, Lanes<S, T, R>>::crew(simd, blocks, threads))
}

/// Threads that advance groups of members.
#[doc(hidden)]
pub trait Crew<T>: Send + Sync {
    /// Members abreast in a group.
    fn lanes(&self) -> usize;

    /// Takes a group of at most that many members some steps further, in a thread of the pool.
    fn advance(&self, runs: &mut [&mut Run<T>], method: &Method, attempts: u32);
}

/// Lanes of `N` in instructions `S`, which the token proves to be there; a team for each thread.
struct Group<S, N: Number> {
    simd: S,
    teams: Vec<Mutex<Team<N>>>,
}

impl<S: Simd, T: Real, N: Number<Real = T>> Group<S, N> {
    fn crew(simd: S, blocks: Blocks, threads: usize) -> Box<dyn Crew<T>> {
        Box::new(Group { simd, teams: (0..threads).map(|_| Mutex::new(Team::<N>::new(blocks))).collect() })
    }
}

impl<S: Simd, N: Number> Crew<N::Real> for Group<S, N> {
    fn lanes(&self) -> usize {
        N::LANES
    }

    fn advance(&self, runs: &mut [&mut Run<N::Real>], method: &Method, attempts: u32) {
        let thread = rayon::current_thread_index().unwrap_or(0);
        // A team that a panic left behind is taken over: members overwrite all of it.
        let mut team = self.teams[thread].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        self.simd.vectorize(Advance { runs, method, team: &mut team, attempts });
    }
}

/// The call that is compiled for the instructions.
struct Advance<'a, 'b, N: Number> {
    runs: &'a mut [&'b mut Run<N::Real>],
    method: &'a Method,
    team: &'a mut Team<N>,
    attempts: u32,
}

impl<N: Number> NullaryFnOnce for Advance<'_, '_, N> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        evolve_abreast(self.runs, self.method, self.team, self.attempts);
    }
}
