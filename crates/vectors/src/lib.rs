//! Vector instructions, chosen at run time: the same source, compiled once for each set.
//!
//! Nothing is compiled here. `curvelax-vectors-f32` and `curvelax-vectors-f64` do that for a precision each, at the
//! same time, since it takes minutes.

// Where there are no vectors, nothing fills lanes.
#![cfg_attr(not(any(target_arch = "x86_64", target_arch = "aarch64")), allow(dead_code, unused_imports))]

use std::{marker::PhantomData, sync::Mutex};

use pulp::{NullaryFnOnce, Simd};

use curvelax_flow::{
    number::{Element, Instructions, Number, Real, WithLanes, with_lanes},
    scheme::{
        evolve::{Team, evolve_abreast},
        run::Group,
        step::Method,
    },
    solver::{Blocks, Solver, Solves, by_solver},
};

/// Fuzzing (`fuzz/run`) advances no member, and would take minutes to count the branches of the vector code.
const WITHOUT_VECTORS: bool = cfg!(fuzzing);

/// Vector instructions for members side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vectors {
    /// One member at a time: the reference.
    None,
    /// 128 bits: NEON on aarch64. Those of x86-64 are left out: processors with no wider ones are rare, and the code
    /// takes minutes to compile.
    Bits128,
    /// 256 bits: AVX2.
    Bits256,
    /// 512 bits: AVX-512.
    Bits512,
}

impl Vectors {
    /// All variants, the widest last.
    pub const ALL: [Vectors; 4] = [Vectors::None, Vectors::Bits128, Vectors::Bits256, Vectors::Bits512];

    /// Returns whether this processor has them, and this program the code for them.
    pub fn are_available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        match self {
            Vectors::None => true,
            _ if WITHOUT_VECTORS => false,
            Vectors::Bits128 => false,
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

    /// Returns the widest vectors of this processor.
    pub fn widest() -> Vectors {
        Self::ALL.into_iter().rfind(|vectors| vectors.are_available()).unwrap_or(Vectors::None)
    }
}

/// Creates workers of `threads` threads for rings cut by `blocks`; none if the processor lacks the vectors.
#[inline(always)]
pub fn workers<T: Lane>(
    vectors: Vectors,
    solver: Solver,
    blocks: Blocks,
    threads: usize,
) -> Option<Box<dyn Workers<T>>> {
    by_solver!(solver, S => workers_by::<S, T>(vectors, blocks, threads))
}

/// Creates workers for the solver `M` if the processor has the vectors.
///
/// An elimination is a chain of dependent results, so two of the smaller registers are interleaved. Sweeps have no such
/// chain, and visit their rows so often that these must stay in the nearest cache, so fewer members run side by side.
fn workers_by<M: Solves, T: Lane>(vectors: Vectors, blocks: Blocks, threads: usize) -> Option<Box<dyn Workers<T>>> {
    match vectors {
        Vectors::None => Some(VectorWorkers::<_, M, T>::workers(pulp::Scalar::new(), blocks, threads)),
        _ if WITHOUT_VECTORS => None,
        #[cfg(target_arch = "aarch64")]
        Vectors::Bits128 => abreast::<_, M, T, 2>(pulp::aarch64::Neon::try_new(), blocks, threads),
        #[cfg(target_arch = "x86_64")]
        Vectors::Bits256 if M::FACTS.sweeps => abreast::<_, M, T, 1>(pulp::x86::V3::try_new(), blocks, threads),
        #[cfg(target_arch = "x86_64")]
        Vectors::Bits256 => abreast::<_, M, T, 2>(pulp::x86::V3::try_new(), blocks, threads),
        #[cfg(target_arch = "x86_64")]
        Vectors::Bits512 => abreast::<_, M, T, 1>(pulp::x86::V4::try_new(), blocks, threads),
        #[allow(unreachable_patterns)]
        _ => None,
    }
}

/// Creates workers whose members fill `R` registers of the instructions, if the processor has them.
fn abreast<S: Instructions, M: Solves, T: Element<S>, const R: usize>(
    simd: Option<S>,
    blocks: Blocks,
    threads: usize,
) -> Option<Box<dyn Workers<T>>> {
    let solver = PhantomData::<fn() -> M>;
    simd.map(|simd| with_lanes::<S, T, R, _>(simd, Abreast { simd, solver, blocks, threads }))
}

/// Everything that defines workers, except their lanes.
struct Abreast<S, M> {
    simd: S,
    solver: PhantomData<fn() -> M>,
    blocks: Blocks,
    threads: usize,
}

impl<S: Simd, M: Solves, T: Real> WithLanes<T> for Abreast<S, M> {
    type Output = Box<dyn Workers<T>>;

    fn call<N: Number<Real = T>>(self) -> Box<dyn Workers<T>> {
        VectorWorkers::<S, M, N>::workers(self.simd, self.blocks, self.threads)
    }
}

/// A number that fits all vectors of this processor architecture.
#[cfg(target_arch = "x86_64")]
pub trait Lane: Element<pulp::x86::V3> + Element<pulp::x86::V4> {}
#[cfg(target_arch = "x86_64")]
impl<T: Element<pulp::x86::V3> + Element<pulp::x86::V4>> Lane for T {}
/// A number that fits all vectors of this processor architecture.
#[cfg(target_arch = "aarch64")]
pub trait Lane: Element<pulp::aarch64::Neon> {}
#[cfg(target_arch = "aarch64")]
impl<T: Element<pulp::aarch64::Neon>> Lane for T {}
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub use curvelax_flow::number::Real as Lane;

/// Threads that advance groups of members.
pub trait Workers<T>: Send + Sync {
    /// Returns the number of members side by side in a group.
    fn lanes(&self) -> usize;

    /// Advances a group of at most `lanes` members by some steps, in a thread of the pool.
    fn advance(&self, group: Group<T>, method: &Method, attempts: u32);

    /// Returns the bytes that a thread needs to advance a group.
    fn bytes_of_team(&self) -> usize;
}

/// Lanes of `N` in the instructions `S`, whose presence the token proves, for the solver `M`; one team per thread.
struct VectorWorkers<S, M, N: Number> {
    simd: S,
    solver: PhantomData<fn() -> M>,
    blocks: Blocks,
    /// Created when a thread has a group to advance; never more than groups being advanced.
    teams: Vec<Mutex<Option<Team<N>>>>,
}

impl<S: Simd, M: Solves, T: Real, N: Number<Real = T>> VectorWorkers<S, M, N> {
    fn workers(simd: S, blocks: Blocks, threads: usize) -> Box<dyn Workers<T>> {
        let teams = (0..threads).map(|_| Mutex::new(None::<Team<N>>)).collect();
        Box::new(VectorWorkers { simd, solver: PhantomData::<fn() -> M>, blocks, teams })
    }

    /// Returns the team of a thread, which is still in its cache, or else an unused one.
    fn take_team(&self, thread: usize) -> Option<Team<N>> {
        let (others, own) = self.teams.split_at(thread);
        own.iter().chain(others).find_map(|team| unlocked(team).take())
    }
}

impl<S: Simd, M: Solves, T: Real, N: Number<Real = T>> Workers<T> for VectorWorkers<S, M, N> {
    fn lanes(&self) -> usize {
        N::LANES
    }

    fn bytes_of_team(&self) -> usize {
        Team::<N>::bytes::<M>(self.blocks.n)
    }

    fn advance(&self, group: Group<T>, method: &Method, attempts: u32) {
        let thread = rayon::current_thread_index().unwrap_or(0);
        let mut team = self.take_team(thread).unwrap_or_else(|| Team::for_solver::<M>(self.blocks));
        self.simd.vectorize(Advance { group, solver: self.solver, method, team: &mut team, attempts });
        *unlocked(&self.teams[thread]) = Some(team);
    }
}

/// Locks the mutex; nothing can panic while it is held.
fn unlocked<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// The call that is compiled for the instructions.
struct Advance<'a, 'b, M, N: Number> {
    group: Group<'a, 'b, N::Real>,
    solver: PhantomData<fn() -> M>,
    method: &'a Method,
    team: &'a mut Team<N>,
    attempts: u32,
}

impl<M: Solves, N: Number> NullaryFnOnce for Advance<'_, '_, M, N> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Advance { group, solver: PhantomData, method, team, attempts } = self;
        evolve_abreast::<N, M>(group, method, team, attempts);
    }
}
