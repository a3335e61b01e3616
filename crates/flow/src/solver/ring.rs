//! The ring of nodes: ghosts for the periodic neighbours, and blocks that give every node its colour.
//!
//! *Theory.* A row of bandwidth 2 couples a node to its four nearest neighbours, so nodes updated at the same
//! time must be at least three apart. Cut the ring into blocks of three or four consecutive nodes and colour a
//! node by its place in its block: any two nodes of one colour are then at least three apart, also across block
//! borders. Every n ≥ 6 is 4a + 3b with b ≤ 3; n = 5 is not.
//!
//! *Practice.* Only [`Blocks`] knows the cut; the kernel gives each thread one block (`shaders/ring.wgsl`). Both sum
//! block by block, in the same order.
//!
//! The scheme sees positions and curvatures by their differences only, and forms them only here.

use std::ops::{Index, IndexMut, Range};

use crate::number::Number;

/// The largest block, and so the number of colours.
pub const COLOURS: usize = 4;
/// The smallest ring that can be cut into blocks.
pub const MIN_POINTS: usize = 6;

/// The cut of a ring of `n` ≥ [`MIN_POINTS`] nodes: first blocks of four, then up to three blocks of three.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blocks {
    /// Nodes.
    pub n: usize,
    /// Blocks of four nodes, which come first.
    pub fours: usize,
    /// Blocks of three nodes.
    pub threes: usize,
}

impl Blocks {
    /// Cuts a ring of `n` nodes; returns `None` if it is too small.
    pub fn new(n: usize) -> Option<Blocks> {
        let threes = (4 - n % 4) % 4;
        (n >= MIN_POINTS).then(|| Blocks { n, fours: (n - 3 * threes) / 4, threes })
    }

    /// Returns the number of blocks, which is the number of threads of the kernel.
    pub fn count(self) -> usize {
        self.fours + self.threes
    }

    /// Iterates over the first node and the number of nodes of each block.
    #[inline(always)]
    pub fn iter(self) -> impl Iterator<Item = (usize, usize)> {
        let after_fours = 4 * self.fours;
        let fours = (0..self.fours).map(|block| (4 * block, 4));
        fours.chain((0..self.threes).map(move |block| (after_fours + 3 * block, 3)))
    }

    /// Returns the nodes of `colour` (0…3), in the order of the blocks: every fourth of one range, every third of
    /// another.
    #[inline(always)]
    pub fn of_colour(self, colour: usize) -> [(Range<usize>, usize); 2] {
        let after_fours = 4 * self.fours;
        let threes = if colour < 3 { after_fours + colour..self.n } else { 0..0 };
        [(colour..after_fours, 4), (threes, 3)]
    }
}

/// `M` sums over a ring, node after node, within blocks first.
pub struct Sums<N, const M: usize> {
    totals: [N; M],
    parts: [N; M],
    fours: usize,
    /// Where the current block ends.
    end: usize,
}

impl<N: Number, const M: usize> Sums<N, M> {
    /// Starts empty sums over a ring cut by `blocks`.
    #[inline(always)]
    pub fn new(blocks: Blocks) -> Self {
        let zero = [N::of(0.0); M];
        Sums { totals: zero, parts: zero, fours: 4 * blocks.fours, end: if blocks.fours > 0 { 4 } else { 3 } }
    }

    /// Adds the terms of node `i`, which follows the last one.
    #[inline(always)]
    pub fn add(&mut self, i: usize, terms: [N; M]) {
        for m in 0..M {
            self.parts[m] += terms[m];
        }
        if i + 1 == self.end {
            for m in 0..M {
                self.totals[m] += self.parts[m];
                self.parts[m] = N::of(0.0);
            }
            self.end += if self.end < self.fours { 4 } else { 3 };
        }
    }

    /// Returns the sums up to the last node added: of whole blocks, and of the nodes after them.
    #[inline(always)]
    pub fn so_far(&self) -> [N; M] {
        let mut sums = self.totals;
        for m in 0..M {
            sums[m] += self.parts[m];
        }
        sums
    }

    /// Returns the sums after the last node.
    #[inline(always)]
    pub fn totals(self) -> [N; M] {
        self.totals
    }
}

/// A field on the nodes of a ring, with two ghosts at either end for the periodic neighbours.
#[derive(Clone, Debug, PartialEq)]
pub struct Ring<N> {
    padded: Vec<N>,
}

const GHOSTS: usize = 2;

impl<N: Number> Ring<N> {
    /// Creates a field of zeros on `n` nodes.
    pub fn zeros(n: usize) -> Ring<N> {
        Ring { padded: vec![N::default(); n + 2 * GHOSTS] }
    }

    /// Creates a field from its `n` values.
    pub fn from_nodes(values: impl IntoIterator<Item = N>) -> Ring<N> {
        let mut padded = vec![N::default(); GHOSTS];
        padded.extend(values);
        padded.extend([N::default(); GHOSTS]);
        let mut ring = Ring { padded };
        ring.close();
        ring
    }

    /// Returns the number of nodes.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.padded.len() - 2 * GHOSTS
    }

    /// Returns whether it has no nodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies the end nodes to the ghosts; call after writing.
    #[inline(always)]
    pub fn close(&mut self) {
        close(&mut self.padded);
    }

    /// Returns the values with two ghosts at either end: node i at i + 2.
    #[inline(always)]
    pub(super) fn padded_mut(&mut self) -> &mut [N] {
        &mut self.padded
    }

    /// Returns the values at `i-2, i-1, i, i+1, i+2`, periodic.
    #[inline(always)]
    pub fn window(&self, i: usize) -> [N; 5] {
        let w = &self.padded[i..i + 5];
        [w[0], w[1], w[2], w[3], w[4]]
    }

    /// Returns how much the values at `i-1, i, i+1, i+2` exceed those of the nodes before them.
    #[inline(always)]
    pub fn rises(&self, i: usize) -> [N; 4] {
        let [mm, m, x, p, pp] = self.window(i);
        [m - mm, x - m, p - x, pp - p]
    }

    /// Returns how far it is to the places `i-1, i, i+1, i+2` from those before them.
    #[inline(always)]
    pub fn rises_of_places(&self, i: usize) -> [N; 4] {
        let [mm, m, x, p, pp] = self.window(i);
        [N::apart(mm, m), N::apart(m, x), N::apart(x, p), N::apart(p, pp)]
    }

    /// Returns by how much the square of the value at i+1 exceeds the one at i.
    #[inline(always)]
    pub fn rise_of_square(&self, i: usize) -> N {
        let [_, _, x, p, _] = self.window(i);
        p * p - x * x
    }

    /// Returns the nodes without ghosts.
    pub fn nodes(&self) -> &[N] {
        &self.padded[GHOSTS..GHOSTS + self.len()]
    }
}

impl<N: Number> Index<usize> for Ring<N> {
    type Output = N;
    #[inline(always)]
    fn index(&self, i: usize) -> &N {
        &self.padded[i + GHOSTS]
    }
}

impl<N: Number> IndexMut<usize> for Ring<N> {
    #[inline(always)]
    fn index_mut(&mut self, i: usize) -> &mut N {
        &mut self.padded[i + GHOSTS]
    }
}

/// Copies the end nodes to the ghosts.
#[inline(always)]
pub(super) fn close<N: Number>(padded: &mut [N]) {
    let n = padded.len() - 2 * GHOSTS;
    padded[0] = padded[n];
    padded[1] = padded[n + 1];
    padded[n + 2] = padded[2];
    padded[n + 3] = padded[3];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_of_one_colour_are_at_least_three_apart_for_every_n() {
        for n in MIN_POINTS..200 {
            let blocks = Blocks::new(n).unwrap();
            let mut colours = vec![usize::MAX; n];
            for colour in 0..COLOURS {
                for i in blocks.of_colour(colour).into_iter().flat_map(|(range, stride)| range.step_by(stride)) {
                    assert_eq!(colours[i], usize::MAX, "n = {n}: node {i} has two colours");
                    colours[i] = colour;
                }
            }
            for i in 0..n {
                assert!(colours[i] < COLOURS, "n = {n}: node {i} has no colour");
                for apart in 1..=2 {
                    assert_ne!(colours[i], colours[(i + apart) % n], "n = {n}: nodes {i} and {}", i + apart);
                }
            }
        }
        assert_eq!(Blocks::new(5), None);
    }

    #[test]
    fn blocks_cover_the_ring_in_order() {
        for n in MIN_POINTS..100 {
            let blocks = Blocks::new(n).unwrap();
            let mut next = 0;
            for (start, length) in blocks.iter() {
                assert_eq!(start, next);
                next = start + length;
            }
            assert_eq!(next, n);
            assert_eq!(blocks.iter().count(), blocks.count());
            let mut sums = Sums::new(blocks);
            (0..n).for_each(|i| sums.add(i, [i as f64]));
            assert_eq!(sums.totals(), [(n * (n - 1) / 2) as f64]);
        }
    }

    #[test]
    fn a_window_wraps_round_the_ring() {
        let ring = Ring::from_nodes((0..7).map(f64::from));
        assert_eq!(ring.window(0), [5.0, 6.0, 0.0, 1.0, 2.0]);
        assert_eq!(ring.window(6), [4.0, 5.0, 6.0, 0.0, 1.0]);
        assert_eq!(ring.rises(6), [1.0, 1.0, -6.0, 1.0]);
        assert_eq!([ring.rise_of_square(2), ring.rise_of_square(6)], [5.0, -36.0]);
    }
}
