//! The rings of multigrid: their number and sizes. Twin of `shaders/levels.wgsl`, where their arrays are.

use crate::solver::ring::MIN_POINTS;

/// Maximum nodes of the coarsest ring; fewer than can be swept colour by colour.
pub const COARSEST: usize = MIN_POINTS - 1;

/// Sizes of the rings below one of `n` nodes, finest first.
pub(super) fn sizes(n: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(n / 2), |m| (*m > COARSEST).then_some(m / 2))
}

/// Returns the number of nodes of all rings below one of `n` nodes.
pub fn coarse_nodes(n: usize) -> usize {
    sizes(n).sum()
}

/// Returns how many of these rings and that of `n` nodes itself are odd and have a coarser one.
pub fn odd_rings(n: usize) -> usize {
    let finer = std::iter::once(n).chain(sizes(n)).take(sizes(n).count());
    finer.filter(|m| is_odd(*m)).count()
}

/// Returns whether a ring of `n` nodes has two nodes between its last coarse node and its first one.
#[inline(always)]
pub(super) fn is_odd(n: usize) -> bool {
    n % 2 == 1
}
