//! The kernel's source: a fixed list of WGSL files behind one line that chooses the number and the kind of steps.

use crate::{
    number::Real,
    solver::{Blocks, Solver, multigrid::coarse_nodes},
};

/// A part of the source: its file name in `shaders/` and its text.
pub type Part = (&'static str, &'static str);

macro_rules! parts {
    ($($file:literal),+ $(,)?) => {
        [$(($file, include_str!(concat!("../../../shaders/", $file)))),+]
    };
}

/// Fields that a traced kernel keeps per member; `conformance::bounds::STAGES` names them in their order.
pub const TRACE_FIELDS: usize = 20;

/// What a kernel is made for, besides its number and sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Solver of the pentadiagonal systems.
    pub solver: Solver,
    /// Makes adaptive steps. A constant, since a kernel with both kinds of steps takes compilers twice as long.
    pub adaptive: bool,
    /// Keeps what every stage of a step computes.
    pub traced: bool,
    /// A workgroup is one subgroup, whose threads exchange by shuffles instead of barriers.
    pub subgroup: bool,
}

impl Variant {
    /// All that are used; adaptive steps are made of traced ones.
    pub const ALL: [Variant; 12] = [
        Variant::of(Solver::GaussSeidel),
        Variant { traced: true, ..Variant::of(Solver::GaussSeidel) },
        Variant { adaptive: true, ..Variant::of(Solver::GaussSeidel) },
        Variant { subgroup: true, ..Variant::of(Solver::GaussSeidel) },
        Variant { subgroup: true, traced: true, ..Variant::of(Solver::GaussSeidel) },
        Variant { subgroup: true, adaptive: true, ..Variant::of(Solver::GaussSeidel) },
        Variant::of(Solver::Multigrid),
        Variant { traced: true, ..Variant::of(Solver::Multigrid) },
        Variant { adaptive: true, ..Variant::of(Solver::Multigrid) },
        Variant::of(Solver::Direct),
        Variant { traced: true, ..Variant::of(Solver::Direct) },
        Variant { adaptive: true, ..Variant::of(Solver::Direct) },
    ];

    /// The kernel of fixed steps.
    pub const fn of(solver: Solver) -> Variant {
        Variant { solver, adaptive: false, traced: false, subgroup: false }
    }

    /// The files of the kernel, in the order of the step.
    pub fn parts(self) -> impl Iterator<Item = Part> {
        let solver: &[Part] = match self.solver {
            Solver::GaussSeidel => &GAUSS_SEIDEL,
            Solver::Multigrid => &MULTIGRID,
            Solver::Direct => &DIRECT,
        };
        let trace = if self.traced { TRACE_ON } else { TRACE_OFF };
        let exchange = if self.subgroup { EXCHANGE_SUBGROUP } else { EXCHANGE };
        COMMON.into_iter().chain(exchange).chain(solver.iter().copied()).chain(trace)
    }
}

const COMMON: [Part; 16] = parts![
    "number.wgsl",
    "ring.wgsl",
    "member.wgsl",
    "flow.wgsl",
    "redistribution.wgsl",
    "system.wgsl",
    "curvature.wgsl",
    "position.wgsl",
    "pull.wgsl",
    "observe.wgsl",
    "step.wgsl",
    "pace.wgsl",
    "start.wgsl",
    "extrapolation.wgsl",
    "decay.wgsl",
    "evolve.wgsl",
];
const EXCHANGE: [Part; 1] = parts!["exchange.wgsl"];
const EXCHANGE_SUBGROUP: [Part; 1] = parts!["exchange_subgroup.wgsl"];
const GAUSS_SEIDEL: [Part; 2] = parts!["sweeps.wgsl", "gauss_seidel.wgsl"];
const MULTIGRID: [Part; 3] = parts!["sweeps.wgsl", "coarse.wgsl", "multigrid.wgsl"];
const DIRECT: [Part; 1] = parts!["direct.wgsl"];
const TRACE_OFF: [Part; 1] = parts!["trace_off.wgsl"];
const TRACE_ON: [Part; 1] = parts!["trace_on.wgsl"];

/// The whole source in precision `T`.
pub fn source<T: Real>(variant: Variant) -> String {
    let Variant { solver, adaptive, .. } = variant;
    let (number, epsilon, sweeps) = (T::NAME, T::EPSILON, solver.sweeps());
    let mut text = format!(
        "alias real = {number}; const EPSILON = {epsilon:e}; const ADAPTIVE = {adaptive}; const SWEEPS = {sweeps};\n"
    );
    for (_, part) in variant.parts() {
        text.push_str(part);
        text.push('\n');
    }
    text
}

/// File and line, within `shaders/`, of a line (from 1) of [`source`].
pub fn locate(line: usize, variant: Variant) -> Option<(&'static str, usize)> {
    let mut before = 1;
    for (file, part) in variant.parts() {
        let lines = part.lines().count() + 1;
        if line > before && line <= before + lines {
            return Some((file, line - before));
        }
        before += lines;
    }
    None
}

/// Levels of multigrid at most, in the kernel.
pub const LEVELS: usize = 8;

/// Threads of a workgroup: one a block, filled up to whole subgroups of `subgroup` threads; the kernel that is one
/// subgroup wants the smallest subgroup there is.
pub fn threads(blocks: Blocks, subgroup: u32) -> usize {
    blocks.count().next_multiple_of(subgroup as usize)
}

/// The `override` constants that size the kernel.
pub fn constants(blocks: Blocks, subgroup: u32) -> [(&'static str, f64); 5] {
    [
        ("NODES", blocks.n as f64),
        ("FOURS", blocks.fours as f64),
        ("BLOCKS", blocks.count() as f64),
        ("THREADS", threads(blocks, subgroup) as f64),
        ("COARSE", coarse_nodes(blocks.n) as f64),
    ]
}

/// Bytes of workgroup memory that the kernel takes: rows of four numbers a block, and one decision; for multigrid 13 numbers
/// a coarse node and a row a level besides.
///
/// Drivers do not reject a kernel that asks for too much, so this is compared with the limit beforehand.
pub fn workgroup_bytes<T: Real>(blocks: Blocks, variant: Variant) -> usize {
    let rows = match variant {
        Variant { subgroup: true, .. } => 1,
        Variant { solver: Solver::GaussSeidel | Solver::Multigrid, .. } => 3,
        Variant { solver: Solver::Direct, .. } => 6,
    };
    let coarse = if variant.solver == Solver::Multigrid { 13 * coarse_nodes(blocks.n) + 4 * LEVELS } else { 0 };
    (4 * rows * blocks.count() + coarse) * size_of::<T>() + 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_source_is_found_in_its_file() {
        for variant in Variant::ALL {
            let text = source::<f64>(variant);
            for (number, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.is_empty()) {
                let (file, at) = locate(number + 1, variant).unwrap();
                let (_, part) = variant.parts().find(|part| part.0 == file).unwrap();
                assert_eq!(part.lines().nth(at - 1), Some(line), "{file}:{at}");
            }
        }
        assert_eq!(locate(1, Variant::ALL[0]), None);
    }
}
