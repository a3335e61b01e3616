//! The vector code in f32, compiled here and nowhere else.

use curvelax_flow::solver::{Blocks, Solver};
use curvelax_vectors::{Vectors, Workers};

/// Creates workers of `threads` threads for rings cut by `blocks`; none if the processor lacks the vectors.
pub fn workers(vectors: Vectors, solver: Solver, blocks: Blocks, threads: usize) -> Option<Box<dyn Workers<f32>>> {
    curvelax_vectors::workers(vectors, solver, blocks, threads)
}
