//! Coloured sweeps inside a V-cycle on the ring: their number hardly depends on τ/h⁴.
//!
//! *Theory.* Sweeps damp what oscillates from node to node and leave what is smooth, so the smooth part is solved for
//! on a ring with half the nodes, by the same means, down to a ring of at most [`COARSEST`] nodes that is solved densely.
//!
//! - **Coarse nodes** are every second one: 0, 2, 4… An odd ring has two nodes between its last coarse node and its
//!   first. A gap is then at most twice as wide as the others, however often the ring is halved.
//! - **Interpolation** is cubic through the four nearest coarse nodes, by Lagrange's formula with the true spacings, so
//!   it knows nothing of even or odd rings and holds on any mesh; with equal spacings it is (-1, 9, 9, -1)/16. Linear
//!   interpolation is not enough for an operator of fourth order. Residuals, integrated over the cells of their nodes, go
//!   down by its transpose.
//! - **Coarse systems** are the equation discretised anew: `ρu + ∂⁴u + p ∂²u + w ∂u` with the merged spacings and the
//!   averaged fields of [`Terms`]; both systems of the scheme have this form, and every level is pentadiagonal.
//! - **Cycle.** Residual of the finest level, down to the coarsest without sweeps, since a correction starts from zero
//!   and its residual is its right-hand side; then up with sweeps on every level. Shifting all sweeps behind the
//!   correction changes no factor of convergence, and saves the residuals of all but the finest level.
//!
//! *Practice.* [`Levels`] is made once for a ring and filled for every solve. When to stop is what
//! [`gauss_seidel`](super::gauss_seidel) stops at; sweeps are those of the finest level. Twin of `shaders/multigrid.wgsl`.

use super::{
    gauss_seidel::{Control, Swept, coloured_sweep, size},
    ring::{Blocks, MIN_POINTS, Ring},
    system::{Row, System},
};
use crate::number::{BIG, Mask, Number};

/// Sweeps of the finest level in a cycle.
pub const SWEEPS_PER_CYCLE: u32 = 2;
/// Sweeps of every level between the finest and the coarsest.
pub const COARSE_SWEEPS: u32 = 4;
/// Nodes of the coarsest ring at most; fewer than can be swept colour by colour.
pub const COARSEST: usize = MIN_POINTS - 1;

/// What a system discretises: `ρu + ∂⁴u + p ∂²u + w ∂u`, with the mesh on which it does.
#[derive(Clone, Debug)]
pub struct Terms<N> {
    /// Distance from each node to the next one.
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
    /// The finest level: to be filled before a solve.
    pub terms: Terms<N>,
    /// 1/τ: to be set before a solve.
    pub rate: N,
    transfer: Transfer<N, F>,
    coarse: Vec<Level<N, F>>,
    /// Inverse of the coarsest matrix, row by row.
    inverse: Vec<N>,
}

/// A coarse level and its way to the next one.
#[derive(Clone, Debug)]
struct Level<N, const F: usize> {
    terms: Terms<N>,
    /// 1/spacing and 1/cell.
    reciprocal: [Ring<N>; 2],
    system: System<N, F>,
    /// From a residual integrated over the cell, times τ, to a right-hand side.
    share: Vec<N>,
    unknown: [Ring<N>; F],
    transfer: Transfer<N, F>,
}

/// From a ring to the next coarser one and back.
#[derive(Clone, Debug)]
struct Transfer<N, const F: usize> {
    /// Residuals integrated over cells.
    residual: [Ring<N>; F],
    /// Those of the nodes between coarse nodes j and j+1.
    between: Ring<N>,
    /// Weights of coarse nodes j-1, j, j+1 and j+2 at the node between j and j+1.
    weights: [Ring<N>; 4],
    /// The same for the last node of an odd ring, which is the second one behind the last coarse node.
    odd: [N; 4],
}

impl<N: Number> Terms<N> {
    fn zeros(n: usize) -> Terms<N> {
        let ring = || Ring::zeros(n);
        Terms { spacing: ring(), cell: ring(), mass: ring(), second: ring(), first: ring() }
    }

    fn len(&self) -> usize {
        self.spacing.len()
    }

    /// Periodic values at the ends; call after filling.
    pub fn close(&mut self) {
        let Terms { spacing, cell, mass, second, first } = self;
        [spacing, cell, mass, second, first].into_iter().for_each(Ring::close);
    }

    /// Fills `coarse` with every second node.
    fn coarsen(&self, coarse: &mut Terms<N>) {
        let (n, m) = (self.len(), coarse.len());
        for j in 0..m {
            coarse.spacing[j] = self.spacing[2 * j] + self.spacing[2 * j + 1];
        }
        if n % 2 == 1 {
            coarse.spacing[m - 1] = coarse.spacing[m - 1] + self.spacing[n - 1];
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

/// Sizes of the rings below one of `n` nodes, the finest first.
fn sizes(n: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(n / 2), |m| (*m > COARSEST).then_some(m / 2))
}

/// Nodes of all rings below one of `n` nodes.
pub fn coarse_nodes(n: usize) -> usize {
    sizes(n).sum()
}

impl<N: Number, const F: usize> Levels<N, F> {
    /// Room for the levels below a ring of `n` nodes.
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
    fn build(&mut self) {
        let (mut terms, mut transfer) = (&self.terms, &mut self.transfer);
        for level in &mut self.coarse {
            terms.coarsen(&mut level.terms);
            transfer.weigh(&terms.spacing, &level.terms.spacing);
            level.discretise(self.rate);
            (terms, transfer) = (&level.terms, &mut level.transfer);
        }
        invert(&self.coarse[self.coarse.len() - 1].system.rows, &mut self.inverse);
    }

    /// Notes the residual of the finest level; returns `[max weight·|residual|, max |u|]`.
    #[inline(always)]
    fn residual(&mut self, system: &System<N, F>, unknown: &[&mut Ring<N>; F]) -> [N; 2] {
        let mut norms = [N::of(0.0); 2];
        for (f, u) in unknown.iter().enumerate() {
            for i in 0..u.len() {
                let error = system.rows[i].weight * system.residual(f, i, u);
                self.transfer.residual[f][i] = self.terms.cell[i] * error;
                norms = [norms[0].max(error.bounded_abs()), norms[1].max(u[i].bounded_abs())];
            }
        }
        norms
    }

    /// Adds the correction for the residual in `self.transfer` to `unknown` where `active`.
    fn correct(&mut self, unknown: &mut [&mut Ring<N>; F], active: N::Mask) {
        let Levels { transfer, coarse, inverse, .. } = self;
        let mut finer = &mut *transfer;
        for level in coarse.iter_mut() {
            for f in 0..F {
                finer.restrict(f, &mut level.transfer.residual[f]);
                for j in 0..level.share.len() {
                    level.system.rhs[f][j] = level.transfer.residual[f][j] * level.share[j];
                }
            }
            finer = &mut level.transfer;
        }
        let (coarsest, swept) = coarse.split_last_mut().expect("a coarse level");
        coarsest.solve_by(inverse);
        let mut coarser = coarsest;
        for level in swept.iter_mut().rev() {
            for f in 0..F {
                level.transfer.interpolate(&coarser.unknown[f], |i, value| level.unknown[f][i] = value);
                level.unknown[f].close();
            }
            let blocks = Blocks::new(level.terms.len()).expect("a ring that can be swept");
            let (one, all) = (N::of(1.0), N::Mask::all_of(true));
            for _ in 0..COARSE_SWEEPS {
                coloured_sweep(&level.system, &mut level.unknown.each_mut(), blocks, one, all);
            }
            coarser = level;
        }
        for (f, u) in unknown.iter_mut().enumerate() {
            transfer.interpolate(&coarser.unknown[f], |i, value| u[i] = N::select(active, u[i] + value, u[i]));
            u.close();
        }
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

    /// The rows of the level from its terms.
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
            let (row, inverse) = row(id.window(j), iv.window(j), [cell[j] * mass[j], second[j], first[j]]);
            self.system.rows[j] = row;
            self.share[j] = inverse * rate;
        }
    }

    fn solve_by(&mut self, inverse: &[N]) {
        let n = self.share.len();
        for (u, rhs) in self.unknown.iter_mut().zip(&self.system.rhs) {
            for j in 0..n {
                let mut sum = inverse[n * j] * rhs[0];
                for l in 1..n {
                    sum += inverse[n * j + l] * rhs[l];
                }
                u[j] = sum;
            }
            u.close();
        }
    }
}

/// A row of a coarse level, integrated over its cell and divided by its diagonal entry, and one over that entry.
#[inline(always)]
fn row<N: Number>(
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
    Row::normalised(a, b, c, d, e, N::of(0.0))
}

impl<N: Number, const F: usize> Transfer<N, F> {
    fn zeros(n: usize) -> Self {
        Transfer {
            residual: std::array::from_fn(|_| Ring::zeros(n)),
            between: Ring::zeros(n / 2),
            weights: std::array::from_fn(|_| Ring::zeros(n / 2)),
            odd: [N::default(); 4],
        }
    }

    fn is_odd(&self) -> bool {
        self.residual[0].len() % 2 == 1
    }

    /// The weights for a ring with these spacings.
    fn weigh(&mut self, spacing: &Ring<N>, coarse: &Ring<N>) {
        let (n, m) = (spacing.len(), coarse.len());
        for j in 0..m {
            let weights = lagrange(spacing[2 * j], coarse.window(j));
            (0..4).for_each(|t| self.weights[t][j] = weights[t]);
        }
        self.weights.iter_mut().for_each(Ring::close);
        if self.is_odd() {
            self.odd = lagrange(spacing[n - 3] + spacing[n - 2], coarse.window(m - 1));
        }
    }

    /// Residuals of the coarser ring, integrated over its cells.
    #[inline(always)]
    fn restrict(&mut self, f: usize, coarse: &mut Ring<N>) {
        let (fine, m) = (&self.residual[f], coarse.len());
        for j in 0..m {
            self.between[j] = fine[2 * j + 1];
        }
        self.between.close();
        let [w0, w1, w2, w3] = &self.weights;
        for j in 0..m {
            let [bmm, bm, b, bp, _] = self.between.window(j);
            let near = w2.window(j)[1] * bm + w1[j] * b;
            let far = w3.window(j)[0] * bmm + w0.window(j)[3] * bp;
            coarse[j] = fine[2 * j] + (near + far);
        }
        if self.is_odd() {
            for t in 0..4 {
                let j = (m - 2 + t) % m;
                coarse[j] = coarse[j] + self.odd[t] * fine[2 * m];
            }
        }
        coarse.close();
    }

    /// Hands the values of `coarse` at all nodes of the finer ring to `put`.
    #[inline(always)]
    fn interpolate(&self, coarse: &Ring<N>, mut put: impl FnMut(usize, N)) {
        let m = coarse.len();
        let [w0, w1, w2, w3] = &self.weights;
        for j in 0..m {
            let window = coarse.window(j);
            put(2 * j, window[2]);
            put(2 * j + 1, blend([w0[j], w1[j], w2[j], w3[j]], window));
        }
        if self.is_odd() {
            put(2 * m, blend(self.odd, coarse.window(m - 1)));
        }
    }
}

/// The cubic with weights `w` through coarse nodes j-1 … j+2, from the window of j.
#[inline(always)]
fn blend<N: Number>(w: [N; 4], [_, before, here, after, beyond]: [N; 5]) -> N {
    (w[1] * here + w[2] * after) + (w[0] * before + w[3] * beyond)
}

/// Weights of coarse nodes j-1 … j+2 for a point at the distance `l` behind node j, from the window of spacings of j.
#[inline(always)]
fn lagrange<N: Number>(l: N, [_, before, gap, behind, _]: [N; 5]) -> [N; 4] {
    let r = gap - l;
    let (far_l, far_r) = (before + l, r + behind);
    let (wide_l, wide_r) = (before + gap, gap + behind);
    let all = wide_l + behind;
    [
        -(l * r * far_r) / (before * wide_l * all),
        far_l * r * far_r / (before * gap * wide_r),
        far_l * l * far_r / (wide_l * gap * behind),
        -(far_l * l * r) / (all * wide_r * behind),
    ]
}

/// The inverse of the periodic pentadiagonal matrix of at most [`COARSEST`] `rows`, by Gauss and Jordan, row by row.
fn invert<N: Number>(rows: &[Row<N>], inverse: &mut [N]) {
    let n = rows.len();
    inverse.fill(N::of(0.0));
    for (j, row) in rows.iter().enumerate() {
        // On so few nodes neighbours on either side may be the same one.
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
        for j in (0..n).filter(|j| *j != l) {
            let factor = inverse[n * j + l];
            inverse[n * j + l] = N::of(0.0);
            for c in 0..n {
                inverse[n * j + c] = inverse[n * j + c] - factor * inverse[n * l + c];
            }
        }
    }
}

/// Sweeps `unknown` inside V-cycles until its residual is small. Lanes that are done stay as they are.
pub fn solve<N: Number, const F: usize>(
    system: &System<N, F>,
    mut unknown: [&mut Ring<N>; F],
    blocks: Blocks,
    control: &Control<N>,
    levels: &mut Levels<N, F>,
) -> Swept<N> {
    let size = size(system);
    let tolerance = control.tolerance.max(N::of(N::EPSILON) * size);
    let finite = size.le(N::of(BIG));
    let mut swept = Swept { sweeps: N::of(0.0), converged: N::Mask::all_of(false), finite };
    levels.build();
    let mut done = 0;
    loop {
        let [error, increment] = levels.residual(system, &unknown);
        let bound = (tolerance * increment).max(control.negligible);
        swept.converged = finite.and(error.le(bound));
        let active = finite.and(error.le(N::of(BIG))).and(swept.converged.not());
        if done >= control.max_sweeps || !active.any() {
            return swept;
        }
        levels.correct(&mut unknown, active);
        let sweeps = SWEEPS_PER_CYCLE.min(control.max_sweeps - done);
        for _ in 0..sweeps {
            coloured_sweep(system, &mut unknown, blocks, N::of(1.0), active);
        }
        done += sweeps;
        swept.sweeps += N::select(active, N::of(f64::from(sweeps)), N::of(0.0));
    }
}
