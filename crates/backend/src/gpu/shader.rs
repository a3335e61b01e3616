//! The kernel's source: a fixed list of WGSL files after one line that chooses the number and the kind of steps.

use curvelax_flow::{
    number::Real,
    solver::{Blocks, Solver},
};
use curvelax_shaders::{self as shaders, ShaderPart};

/// Fields that a traced kernel records per member; `conformance::bounds::STAGES` names them in the same order.
pub const TRACE_FIELDS: usize = 20;

/// The variant of a kernel: everything but its number and sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Solver of the pentadiagonal systems.
    pub solver: Solver,
    /// Makes adaptive steps. A constant, since a kernel with both kinds of steps takes twice as long to compile.
    pub adaptive: bool,
    /// Members may pause where an observable reaches a level. A constant, since drivers of software GPUs execute every
    /// branch.
    pub watched: bool,
    /// Moves the nodes by the force of the polygon. A constant for the same reason.
    pub geometric: bool,
    /// Does so with an energy and a mobility that depend on the direction.
    pub crystal: bool,
    /// A force drives the curve, or its area or length are kept.
    pub forced: bool,
    /// Records what every stage of a step computes.
    pub traced: bool,
    /// A workgroup is one subgroup, whose threads exchange values by shuffles instead of barriers.
    pub subgroup: bool,
    /// Is compiled for one size, which makes it faster. Otherwise it serves all rings of as many threads: software GPUs
    /// take longer to compile a kernel than to run it.
    pub for_one_size: bool,
}

impl Variant {
    /// Returns all variants in use, without those that differ only in being watched; traces need only fixed steps,
    /// since adaptive ones are made of them.
    pub fn all() -> Vec<Variant> {
        let exchanges = |solver: Solver| [false, true].into_iter().filter(move |by| !by || solver.facts().shuffles);
        let exchanging = |solver| exchanges(solver).map(move |subgroup| Variant { subgroup, ..Variant::of(solver) });
        let made_for = |own| [own, Variant { traced: true, ..own }, Variant { adaptive: true, ..own }];
        let geometric = |own| Variant { geometric: true, ..own };
        let forms = |own| {
            let geometric = geometric(own);
            let forced = Variant { forced: true, ..geometric };
            [own, geometric, forced, Variant { crystal: true, ..geometric }, Variant { crystal: true, ..forced }]
        };
        Solver::ALL.into_iter().flat_map(exchanging).flat_map(made_for).flat_map(forms).collect()
    }

    /// Returns the variant for fixed steps.
    pub const fn of(solver: Solver) -> Variant {
        let (adaptive, watched, geometric, crystal, forced) = (false, false, false, false, false);
        let (traced, subgroup, for_one_size) = (false, false, true);
        Variant { solver, adaptive, watched, geometric, crystal, forced, traced, subgroup, for_one_size }
    }

    /// Returns the files of the kernel in precision `T`, in the order of the step.
    pub fn parts<T: Real>(self) -> impl Iterator<Item = ShaderPart> {
        let place = if T::IS_SHORT { shaders::PLACE_FIXED } else { shaders::PLACE };
        let solver = of_solver(self.solver);
        let trace = if self.traced { TRACE_ON } else { TRACE_OFF };
        let exchange = if self.subgroup { EXCHANGE_SUBGROUP } else { EXCHANGE };
        let first = [shaders::NUMBER, place];
        first.into_iter().chain(COMMON).chain(exchange).chain(solver.iter().copied()).chain(trace)
    }
}

const COMMON: [ShaderPart; 20] = [
    shaders::RING,
    shaders::SUMS,
    shaders::MEMBER,
    shaders::STATE,
    shaders::FORCES,
    shaders::FORCING,
    shaders::REDISTRIBUTION,
    shaders::SYSTEM,
    shaders::CURVATURE,
    shaders::POSITION,
    shaders::PULL,
    shaders::EXCESS,
    shaders::OBSERVE,
    shaders::STEP,
    shaders::START,
    shaders::EXTRAPOLATION,
    shaders::PACE,
    shaders::DENSE,
    shaders::DECAY,
    shaders::EVOLVE,
];
const EXCHANGE: [ShaderPart; 1] = [shaders::EXCHANGE];
const EXCHANGE_SUBGROUP: [ShaderPart; 1] = [shaders::EXCHANGE_SUBGROUP];
const TRACE_OFF: [ShaderPart; 1] = [shaders::TRACE_OFF];
const TRACE_ON: [ShaderPart; 1] = [shaders::TRACE_ON];

/// Returns the files of a solver.
fn of_solver(solver: Solver) -> &'static [ShaderPart] {
    match solver {
        Solver::GaussSeidel => &[shaders::SWEEPS, shaders::GAUSS_SEIDEL],
        Solver::Direct => &[shaders::DIRECT],
    }
}

/// Returns the whole source in precision `T`.
pub fn source<T: Real>(variant: Variant) -> String {
    let Variant { solver, adaptive, watched, geometric, crystal, forced, .. } = variant;
    let (number, epsilon, root, sweeps) = (T::NAME, T::EPSILON, T::EPSILON.sqrt(), solver.sweeps());
    let mut text = format!(
        "alias real = {number}; const EPSILON = {epsilon:e}; const ROOT_EPSILON = {root:e}; \
         const ADAPTIVE = {adaptive}; const SWEEPS = {sweeps}; const WATCHED = {watched}; \
         const GEOMETRIC = {geometric}; const CRYSTAL = {crystal}; const FORCED = {forced};\n"
    );
    for (_, part) in variant.parts::<T>() {
        text.push_str(part);
        text.push('\n');
    }
    text
}

/// Returns the file and line, within `shaders/`, of a line (from 1) of [`source`] in precision `T`.
pub fn locate<T: Real>(line: usize, variant: Variant) -> Option<(&'static str, usize)> {
    let mut before = 1;
    for (file, part) in variant.parts::<T>() {
        let lines = part.lines().count() + 1;
        if line > before && line <= before + lines {
            return Some((file, line - before));
        }
        before += lines;
    }
    None
}

/// Returns the threads of a workgroup: one per block, rounded up to whole subgroups of `subgroup` threads. The
/// one-subgroup kernel needs the smallest subgroup there is.
pub fn threads(blocks: Blocks, subgroup: u32) -> usize {
    blocks.count().next_multiple_of(subgroup as usize)
}

/// Returns the share of lanes in use, with subgroups of `subgroup` threads: the nodes over four times the threads of a
/// workgroup.
///
/// ```
/// use curvelax_backend::gpu::shader::lanes_in_use;
/// use curvelax_flow::solver::Blocks;
///
/// let lanes = |n| lanes_in_use(Blocks::new(n).unwrap(), 32);
/// // Fewer nodes than a subgroup can hold leave lanes idle.
/// assert_eq!([lanes(64), lanes(100), lanes(128), lanes(200), lanes(256)], [0.5, 0.78125, 1.0, 0.78125, 1.0]);
/// ```
pub fn lanes_in_use(blocks: Blocks, subgroup: u32) -> f64 {
    blocks.n as f64 / (4 * threads(blocks, subgroup)) as f64
}

/// The values of the `override` constants that size a kernel, [`CONSTANTS`].
pub type KernelSizes = [usize; 5];

/// The names of these constants.
pub const CONSTANTS: [&str; 5] = ["NODES", "FOURS", "BLOCKS", "ROWS", "THREADS"];

/// Returns the sizes of a kernel for rings cut by `blocks`, or for all rings of as many threads.
pub fn sizes(blocks: Blocks, subgroup: u32, for_one_size: bool) -> KernelSizes {
    let (threads, count) = (threads(blocks, subgroup), blocks.count());
    if for_one_size { [blocks.n, blocks.fours, count, count, threads] } else { [0, 0, 0, threads, threads] }
}

/// Returns the constants of a kernel of these sizes, for wgpu.
pub fn constants(sizes: KernelSizes) -> [(&'static str, f64); 5] {
    std::array::from_fn(|i| (CONSTANTS[i], sizes[i] as f64))
}

/// Numbers and integers of a `Plan` in the kernel.
const PLAN: (usize, usize) = (2, 5);

/// Returns the bytes of workgroup memory of the kernel for arrays of `rows` rows, of four numbers each, one per block:
/// those, the plan of an attempt, a decision and the member.
///
/// Drivers do not reject a kernel that asks for too much, so this is compared with the limit beforehand.
pub fn workgroup_bytes<T: Real>(rows: usize, variant: Variant) -> usize {
    let arrays = if variant.subgroup { 1 } else { variant.solver.facts().rows_per_block };
    let integers = (PLAN.1 * size_of::<u32>()).next_multiple_of(size_of::<T>());
    (4 * arrays * rows + PLAN.0) * size_of::<T>() + integers + 2 * size_of::<u32>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines_are_found_in<T: Real>() {
        for variant in Variant::all().into_iter().flat_map(|own| [own, Variant { watched: true, ..own }]) {
            let text = source::<T>(variant);
            for (number, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.is_empty()) {
                let (file, at) = locate::<T>(number + 1, variant).unwrap();
                let (_, part) = variant.parts::<T>().find(|part| part.0 == file).unwrap();
                assert_eq!(part.lines().nth(at - 1), Some(line), "{file}:{at}");
            }
        }
        assert_eq!(locate::<T>(1, Variant::of(Solver::GaussSeidel)), None);
    }

    #[test]
    fn a_line_of_the_source_is_found_in_its_file() {
        lines_are_found_in::<f32>();
        lines_are_found_in::<f64>();
    }
}
