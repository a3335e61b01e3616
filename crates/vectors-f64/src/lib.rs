//! The vector code in f64, compiled here and nowhere else.

use curvelax_flow::solver::{Blocks, Solver};
use curvelax_vectors::{Vectors, Workers};

/// Creates workers of `threads` threads for rings cut by `blocks`; none if the processor lacks the vectors.
pub fn workers(vectors: Vectors, solver: Solver, blocks: Blocks, threads: usize) -> Option<Box<dyn Workers<f64>>> {
    curvelax_vectors::workers(vectors, solver, blocks, threads)
}
