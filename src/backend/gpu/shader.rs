//! The kernel's source: a fixed list of WGSL files behind one line that chooses the number.

use crate::{number::Real, solver::Blocks};

/// A part of the source: its file name in `shaders/` and its text.
pub type Part = (&'static str, &'static str);

macro_rules! parts {
    ($($file:literal),+ $(,)?) => {
        [$(($file, include_str!(concat!("../../../shaders/", $file)))),+]
    };
}

/// The files of the kernel, in the order of the step.
pub const PARTS: [Part; 12] = parts![
    "number.wgsl",
    "ring.wgsl",
    "member.wgsl",
    "flow.wgsl",
    "redistribution.wgsl",
    "system.wgsl",
    "curvature.wgsl",
    "position.wgsl",
    "gauss_seidel.wgsl",
    "observe.wgsl",
    "step.wgsl",
    "evolve.wgsl",
];
const TRACE_OFF: [Part; 1] = parts!["trace_off.wgsl"];
const TRACE_ON: [Part; 1] = parts!["trace_on.wgsl"];

/// The whole source in precision `T`; `traced` keeps what every stage computes.
pub fn source<T: Real>(traced: bool) -> String {
    let mut text = format!("alias real = {}; const EPSILON = {:e};\n", T::NAME, T::EPSILON);
    for (_, part) in PARTS.iter().chain(if traced { &TRACE_ON } else { &TRACE_OFF }) {
        text.push_str(part);
        text.push('\n');
    }
    text
}

/// File and line, within `shaders/`, of a line (from 1) of [`source`].
pub fn locate(line: usize, traced: bool) -> Option<(&'static str, usize)> {
    let mut before = 1;
    for (file, part) in PARTS.iter().chain(if traced { &TRACE_ON } else { &TRACE_OFF }) {
        let lines = part.lines().count() + 1;
        if line > before && line <= before + lines {
            return Some((file, line - before));
        }
        before += lines;
    }
    None
}

/// Threads of a workgroup: one a block, filled up to whole subgroups of `subgroup` threads.
pub fn threads(blocks: Blocks, subgroup: u32) -> usize {
    blocks.count().next_multiple_of(subgroup as usize)
}

/// The `override` constants that size the kernel.
pub fn constants(blocks: Blocks, subgroup: u32) -> [(&'static str, f64); 4] {
    [
        ("NODES", blocks.n as f64),
        ("FOURS", blocks.fours as f64),
        ("BLOCKS", blocks.count() as f64),
        ("THREADS", threads(blocks, subgroup) as f64),
    ]
}

/// Bytes of workgroup memory that the kernel takes: two rings, a row of four per block, one decision.
///
/// Drivers do not reject a kernel that asks for too much, so this is compared with the limit beforehand.
pub fn workgroup_bytes<T: Real>(blocks: Blocks) -> usize {
    let number = size_of::<T>();
    2 * blocks.n * number + 4 * blocks.count() * number + 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_source_is_found_in_its_file() {
        for traced in [false, true] {
            let text = source::<f64>(traced);
            for (number, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.is_empty()) {
                let (file, at) = locate(number + 1, traced).unwrap();
                let (_, part) = PARTS.iter().chain(&TRACE_ON).chain(&TRACE_OFF).find(|part| part.0 == file).unwrap();
                assert_eq!(part.lines().nth(at - 1), Some(line), "{file}:{at}");
            }
        }
        assert_eq!(locate(1, false), None);
    }
}
