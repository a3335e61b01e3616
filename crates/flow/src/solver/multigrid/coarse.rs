//! The coarse systems: the equation rediscretised on every coarse ring. Twin of `shaders/coarse.wgsl`.

use super::{
    levels::{is_odd, sizes},
    transfer::Transfer,
};
use crate::{
    number::Number,
    solver::{
        ring::Ring,
        system::{Equations, Row, System},
    },
};

/// The equations of a discretised `ρu + ∂⁴u + p ∂²u + w ∂u`, which can be rediscretised on coarser rings.
pub trait Discretisation<N: Number, const F: usize>: Equations<N, F> {
    /// Writes ρ, p, w and the mesh into the finest level.
    fn discretised(&self, levels: &mut Levels<N, F>);
}

/// The terms of `ρu + ∂⁴u + p ∂²u + w ∂u` that a system discretises, and its mesh.
#[derive(Clone, Debug)]
pub struct Terms<N> {
    /// Distance from each node to the next.
    pub spacing: Ring<N>,
    /// Length of the cell of each node, over which its equation is integrated.
    pub cell: Ring<N>,
    /// ρ, in 1/time.
    pub mass: Ring<N>,
    /// p.
    pub second: Ring<N>,
    /// w.
    pub first: Ring<N>,
}

/// The rings below a ring of given size.
#[derive(Clone, Debug)]
pub struct Levels<N, const F: usize> {
    /// The finest level; must be filled before a solve.
    pub terms: Terms<N>,
    /// 1/τ; must be set before a solve.
    pub rate: N,
    pub(super) transfer: Transfer<N, F>,
    pub(super) coarse: Vec<Level<N, F>>,
    /// Inverse of the coarsest matrix, row by row.
    pub(super) inverse: Vec<N>,
}

/// A coarse level and its transfer to the next one.
#[derive(Clone, Debug)]
pub(super) struct Level<N, const F: usize> {
    pub(super) terms: Terms<N>,
    /// 1/spacing and 1/cell.
    reciprocal: [Ring<N>; 2],
    pub(super) system: System<N, F>,
    /// Factor from a residual integrated over the cell, times τ, to a right-hand side.
    pub(super) share: Vec<N>,
    pub(super) unknown: [Ring<N>; F],
    pub(super) transfer: Transfer<N, F>,
}

impl<N: Number> Terms<N> {
    fn zeros(n: usize) -> Terms<N> {
        let ring = || Ring::zeros(n);
        Terms { spacing: ring(), cell: ring(), mass: ring(), second: ring(), first: ring() }
    }

    #[inline(always)]
    fn len(&self) -> usize {
        self.spacing.len()
    }

    /// Sets the periodic values at the ends; call after filling.
    #[inline(always)]
    pub fn close(&mut self) {
        let Terms { spacing, cell, mass, second, first } = self;
        for ring in [spacing, cell, mass, second, first] {
            ring.close();
        }
    }

    /// Fills `coarse` with every second node.
    #[inline(always)]
    fn coarsen(&self, coarse: &mut Terms<N>) {
        let (n, m) = (self.len(), coarse.len());
        for j in 0..m {
            coarse.spacing[j] = self.spacing[2 * j] + self.spacing[2 * j + 1];
        }
        if is_odd(n) {
            coarse.spacing[m - 1] += self.spacing[n - 1];
        }
        coarse.spacing.close();
        for j in 0..m {
            coarse.cell[j] = N::of(0.5) * (coarse.spacing.window(j)[1] + coarse.spacing[j]);
            coarse.mass[j] = average(&self.mass, 2 * j);
            coarse.second[j] = average(&self.second, 2 * j);
            coarse.first[j] = average(&self.first, 2 * j);
        }
        coarse.close();
    }
}

#[inline(always)]
fn average<N: Number>(field: &Ring<N>, i: usize) -> N {
    let [_, before, here, after, _] = field.window(i);
    N::of(0.25) * (before + after) + N::of(0.5) * here
}

impl<N: Number, const F: usize> Levels<N, F> {
    /// Allocates the levels below a ring of `n` nodes.
    pub fn new(n: usize) -> Self {
        let coarsest = sizes(n).last().unwrap_or(0);
        Levels {
            terms: Terms::zeros(n),
            rate: N::default(),
            transfer: Transfer::zeros(n),
            coarse: sizes(n).map(Level::zeros).collect(),
            inverse: vec![N::default(); coarsest * coarsest],
        }
    }

    /// Builds all coarse systems from [`Levels::terms`].
    #[inline(always)]
    pub(super) fn build(&mut self) {
        let (mut terms, mut transfer) = (&self.terms, &mut self.transfer);
        for level in &mut self.coarse {
            terms.coarsen(&mut level.terms);
            transfer.weigh(&terms.spacing, &level.terms.spacing);
            level.discretise(self.rate);
            (terms, transfer) = (&level.terms, &mut level.transfer);
        }
        invert_matrix(&self.coarse[self.coarse.len() - 1].system.rows, &mut self.inverse);
    }
}

impl<N: Number, const F: usize> Level<N, F> {
    fn zeros(n: usize) -> Self {
        Level {
            terms: Terms::zeros(n),
            reciprocal: std::array::from_fn(|_| Ring::zeros(n)),
            system: System::zeros(n),
            share: vec![N::default(); n],
            unknown: std::array::from_fn(|_| Ring::zeros(n)),
            transfer: Transfer::zeros(n),
        }
    }

    /// Computes the rows of the level from its terms.
    #[inline(always)]
    fn discretise(&mut self, rate: N) {
        let Terms { spacing, cell, mass, second, first } = &self.terms;
        let [id, iv] = &mut self.reciprocal;
        for j in 0..spacing.len() {
            id[j] = spacing[j].recip();
            iv[j] = cell[j].recip();
        }
        id.close();
        iv.close();
        for j in 0..spacing.len() {
            let second = balanced(second[j], cell[j]);
            let (row, inverse) = row(id.window(j), iv.window(j), [cell[j] * mass[j], second, first[j]]);
            self.system.rows[j] = row;
            self.share[j] = inverse * rate;
        }
    }
}

/// The coefficient `p` of ∂² for a level with cells of this length.
///
/// A circle may be translated, since ∂⁴ and p∂² cancel where p is the square of a wave number. On a few nodes their
/// differences do not cancel: that of p∂² is larger, and a coarse system with a long step would be singular.
#[inline(always)]
fn balanced<N: Number>(p: N, cell: N) -> N {
    p / (N::of(1.0) + N::of(BALANCE) * (p.max(N::of(0.0)) * (cell * cell)))
}

/// The damping of p on coarse levels: with 1/12 the two terms of a circle cancel to order 4; with 1/9 nothing
/// negative is left of a circle on 3 nodes or more.
pub const BALANCE: f64 = 1.0 / 9.0;

/// Returns a row of a coarse level, integrated over its cell and divided by its diagonal entry, and the reciprocal of
/// the entry.
#[inline(always)]
pub(super) fn row<N: Number>(
    [idmm, idm, id, idp, _]: [N; 5],
    [_, ivm, iv, ivp, _]: [N; 5],
    [mass, second, first]: [N; 3],
) -> (Row<N>, N) {
    let a = idm * ivm * idmm;
    let e = id * ivp * idp;
    let middle = iv * id * idm;
    let low = idm * idm * (iv + ivm);
    let high = id * id * (iv + ivp);
    let drift = N::of(0.5) * first;
    let b = (second * idm - drift) - (middle + low + a);
    let d = (second * id + drift) - (middle + high + e);
    let c = mass - (a + b + d + e);
    let inverse = c.recip();
    (Row { a: a * inverse, b: b * inverse, d: d * inverse, e: e * inverse, weight: N::of(0.0) }, inverse)
}

/// Inverts the periodic pentadiagonal matrix of at most [`COARSEST`](super::COARSEST) `rows` by Gauss–Jordan
/// elimination, row by row.
#[inline(always)]
fn invert_matrix<N: Number>(rows: &[Row<N>], inverse: &mut [N]) {
    let n = rows.len();
    inverse.fill(N::of(0.0));
    for (j, row) in rows.iter().enumerate() {
        // On so few nodes, neighbours on either side may coincide.
        for (o, entry) in [row.a, row.b, N::of(1.0), row.d, row.e].into_iter().enumerate() {
            inverse[n * j + (j + n + o - 2) % n] += entry;
        }
    }
    for l in 0..n {
        let pivot = inverse[n * l + l].recip();
        inverse[n * l + l] = N::of(1.0);
        for c in 0..n {
            inverse[n * l + c] = inverse[n * l + c] * pivot;
        }
        for j in 0..n {
            if j == l {
                continue;
            }
            let factor = inverse[n * j + l];
            inverse[n * j + l] = N::of(0.0);
            for c in 0..n {
                inverse[n * j + c] = inverse[n * j + c] - factor * inverse[n * l + c];
            }
        }
    }
}
