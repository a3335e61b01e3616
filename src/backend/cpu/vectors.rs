//! Vector instructions, chosen at run time: the same source, compiled once for each.

use std::sync::Mutex;

use pulp::{NullaryFnOnce, Scalar, Simd};

use crate::{
    error::{Error, Result},
    number::{Lanes, Number, Real},
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
    /// What every processor of the kind has: SSE2, NEON.
    Baseline,
    /// 256 bits, on x86-64.
    Avx2,
    /// 512 bits, on x86-64.
    Avx512,
}

impl Vectors {
    /// All of them, the widest last.
    pub const ALL: [Vectors; 4] = [Vectors::None, Vectors::Baseline, Vectors::Avx2, Vectors::Avx512];

    /// Whether this processor has them.
    pub fn are_available(self) -> bool {
        match self {
            Vectors::None | Vectors::Baseline => true,
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx2 => pulp::x86::V3::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx512 => pulp::x86::V4::try_new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            Vectors::Avx2 | Vectors::Avx512 => false,
        }
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

/// Members abreast: two registers of the instructions, so that one waits for the other's results as little as possible.
macro_rules! vectorised {
    ($real:ident, $baseline:literal, $avx2:literal, $avx512:literal) => {
        impl Vectorised for $real {
            fn crew(vectors: Vectors, blocks: Blocks, threads: usize) -> Result<Box<dyn Crew<$real>>> {
                let missing = || Error::Failed(format!("this processor has no {vectors:?} instructions"));
                Ok(match vectors {
                    Vectors::None => Group::<_, $real>::crew(Scalar::new(), blocks, threads),
                    Vectors::Baseline => Group::<_, Lanes<$real, $baseline>>::crew(Scalar::new(), blocks, threads),
                    #[cfg(target_arch = "x86_64")]
                    Vectors::Avx2 => {
                        let simd = pulp::x86::V3::try_new().ok_or_else(missing)?;
                        Group::<_, Lanes<$real, $avx2>>::crew(simd, blocks, threads)
                    }
                    #[cfg(target_arch = "x86_64")]
                    Vectors::Avx512 => {
                        let simd = pulp::x86::V4::try_new().ok_or_else(missing)?;
                        Group::<_, Lanes<$real, $avx512>>::crew(simd, blocks, threads)
                    }
                    #[cfg(not(target_arch = "x86_64"))]
                    Vectors::Avx2 | Vectors::Avx512 => return Err(missing()),
                })
            }
        }
    };
}

vectorised!(f64, 4, 8, 8);
vectorised!(f32, 8, 16, 16);

/// Threads that advance groups of members.
pub trait Crew<T>: Send + Sync {
    /// Members abreast in a group.
    fn lanes(&self) -> usize;

    /// Takes a group of at most that many members some steps further, in a thread of the pool.
    fn advance(&self, runs: &mut [&mut Run<T>], method: &Method, attempts: u32);
}

/// Lanes of `N` in instructions `S`; a team for each thread.
struct Group<S, N: Number> {
    simd: S,
    teams: Vec<Mutex<Team<N>>>,
}

impl<S: Simd, N: Number> Group<S, N> {
    fn crew(simd: S, blocks: Blocks, threads: usize) -> Box<dyn Crew<N::Real>> {
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
