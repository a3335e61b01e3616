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
    gauss_seidel::{Control, Swept, Target, coloured_sweep},
    ring::{Blocks, MIN_POINTS, Ring},
    system::{Equations, Row, System},
};
use crate::number::{BIG, Mask, Number};

/// The equations of a discretised `ρu + ∂⁴u + p ∂²u + w ∂u`, which can be discretised anew on coarser rings.
pub trait Discretisation<N: Number, const F: usize>: Equations<N, F> {
    /// Writes ρ, p, w and the mesh into the finest level.
    fn discretised(&self, levels: &mut Levels<N, F>);
}

/// Levels in the kernel at most.
pub const KERNEL_LEVELS: usize = 8;

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

    #[inline(always)]
    fn len(&self) -> usize {
        self.spacing.len()
    }

    /// Periodic values at the ends; call after filling.
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
        if n % 2 == 1 {
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
    #[inline(always)]
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
    #[inline(always)]
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
                level.transfer.interpolate(&coarser.unknown[f], &mut level.unknown[f], None);
            }
            let blocks = Blocks::new(level.terms.len()).expect("a ring that can be swept");
            let (one, all) = (N::of(1.0), N::Mask::all_of(true));
            for _ in 0..COARSE_SWEEPS {
                coloured_sweep(&level.system, &mut level.unknown.each_mut(), blocks, one, all);
            }
            coarser = level;
        }
        let share = N::select(active, N::of(1.0), N::of(0.0));
        for (f, u) in unknown.iter_mut().enumerate() {
            transfer.interpolate(&coarser.unknown[f], u, Some(share));
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

    #[inline(always)]
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

/// The coefficient `p` of ∂² for a level with cells of this length.
///
/// A circle may be moved about, since ∂⁴ and p∂² cancel where p is the square of a wave number. On a few nodes their
/// differences do not: that of p∂² is the larger one, and a coarse system with a long step would be singular.
#[inline(always)]
fn balanced<N: Number>(p: N, cell: N) -> N {
    p / (N::of(1.0) + N::of(BALANCE) * (p.max(N::of(0.0)) * (cell * cell)))
}

/// By how much p is damped on coarse levels: with 1/12 the two terms of a circle cancel to order 4, with 1/9 nothing
/// negative is left of a circle on 3 nodes or more.
pub const BALANCE: f64 = 1.0 / 9.0;

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
    let inverse = c.recip();
    (Row { a: a * inverse, b: b * inverse, d: d * inverse, e: e * inverse, weight: N::of(0.0) }, inverse)
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

    #[inline(always)]
    fn is_odd(&self) -> bool {
        self.residual[0].len() % 2 == 1
    }

    /// The weights for a ring with these spacings.
    #[inline(always)]
    fn weigh(&mut self, spacing: &Ring<N>, coarse: &Ring<N>) {
        let (n, m) = (spacing.len(), coarse.len());
        for j in 0..m {
            let weights = lagrange(spacing[2 * j], coarse.window(j));
            for t in 0..4 {
                self.weights[t][j] = weights[t];
            }
        }
        for ring in &mut self.weights {
            ring.close();
        }
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
                coarse[j] += self.odd[t] * fine[2 * m];
            }
        }
        coarse.close();
    }

    /// Puts the values of `coarse` at all nodes of the finer ring into `fine`, or adds this many times as much.
    #[inline(always)]
    fn interpolate(&self, coarse: &Ring<N>, fine: &mut Ring<N>, added: Option<N>) {
        let m = coarse.len();
        let [w0, w1, w2, w3] = &self.weights;
        for j in 0..m {
            let window = coarse.window(j);
            put(&mut fine[2 * j], window[2], added);
            put(&mut fine[2 * j + 1], blend([w0[j], w1[j], w2[j], w3[j]], window), added);
        }
        if self.is_odd() {
            put(&mut fine[2 * m], blend(self.odd, coarse.window(m - 1)), added);
        }
        fine.close();
    }
}

/// Replaces `old`, or adds this many times `value` to it.
#[inline(always)]
fn put<N: Number>(old: &mut N, value: N, added: Option<N>) {
    *old = match added {
        None => value,
        Some(times) => *old + times * value,
    };
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
#[inline(always)]
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

/// Sweeps `unknown` inside V-cycles until its residual is small, in the lanes that are `live`. Lanes that are done stay as
/// they are.
#[inline(always)]
pub fn solve<N: Number, const F: usize>(
    system: &System<N, F>,
    mut unknown: [&mut Ring<N>; F],
    blocks: Blocks,
    control: &Control<N>,
    live: N::Mask,
    levels: &mut Levels<N, F>,
) -> Swept<N> {
    let target = Target::of(system, control);
    let mut swept = Swept { sweeps: N::of(0.0), converged: N::Mask::all_of(false), finite: target.finite };
    levels.build();
    let mut done = 0;
    loop {
        let norms = levels.residual(system, &unknown);
        swept.converged = target.is_met(norms);
        let active = live.and(target.finite).and(norms[0].le(N::of(BIG))).and(swept.converged.not());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::{Order, direct};

    /// Sizes of every remainder by 8, primes, powers of two, and the smallest ones.
    const SIZES: [usize; 21] =
        [6, 7, 8, 9, 10, 11, 12, 13, 23, 96, 99, 100, 101, 102, 103, 104, 127, 128, 255, 256, 512];
    /// Longest τ; a circle of this size relaxes in 1/12.
    const LONGEST: f64 = 1.0;
    /// τ/h⁴, where τ is not longer than that.
    const STIFFNESSES: [f64; 6] = [0.06, 6.0, 60.0, 600.0, 6e4, 6e6];

    /// A mesh: how far its spacings jump from node to node, and the ratio between its widest and its narrowest part.
    #[derive(Clone, Copy, Debug)]
    struct Mesh {
        jitter: f64,
        ratio: f64,
    }

    const MESHES: [Mesh; 3] =
        [Mesh { jitter: 0.0, ratio: 1.0 }, Mesh { jitter: 0.3, ratio: 1.0 }, Mesh { jitter: 0.05, ratio: 10.0 }];

    /// `u/τ + ∂⁴u + p ∂²u + w ∂u` on a ring of length 2π, with p and w like those of a curve near the unit circle.
    fn problem(n: usize, stiffness: f64, mesh: Mesh) -> (System<f64, 2>, Levels<f64, 2>) {
        let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
        let noise = |i: usize| (12.9898 * i as f64 + 0.3).sin() * 43758.5453 % 1.0;
        let spacing =
            |i: usize| (0.5 * mesh.ratio.ln() * (2.0 * angle(i)).sin()).exp() * (1.0 + mesh.jitter * noise(i));
        let unit = std::f64::consts::TAU / (0..n).map(spacing).sum::<f64>();
        let tau = (stiffness * (std::f64::consts::TAU / n as f64).powi(4)).min(LONGEST);
        let mut levels = Levels::new(n);
        levels.rate = 1.0 / tau;
        let terms = &mut levels.terms;
        (0..n).for_each(|i| terms.spacing[i] = unit * spacing(i));
        terms.spacing.close();
        for i in 0..n {
            terms.cell[i] = 0.5 * (terms.spacing.window(i)[1] + terms.spacing[i]);
            terms.mass[i] = 1.0 / tau;
            terms.second[i] = 0.8 + 0.1 * (3.0 * angle(i)).cos();
            terms.first[i] = 0.3 * (2.0 * angle(i) + 1.0).sin();
        }
        terms.close();
        let reciprocal = |ring: &Ring<f64>| Ring::from_nodes(ring.nodes().iter().map(|v| 1.0 / v));
        let (id, iv) = (reciprocal(&terms.spacing), reciprocal(&terms.cell));
        let mut system = System::zeros(n);
        for i in 0..n {
            let mass = terms.cell[i] * terms.mass[i];
            let (row, inverse) = row(id.window(i), iv.window(i), [mass, terms.second[i], terms.first[i]]);
            system.rows[i] = Row { weight: tau * iv[i] / inverse, ..row };
            system.rhs[0][i] =
                mass * inverse * ((2.0 * angle(i)).sin() + 0.3 * (5.0 * angle(i)).cos() + 0.1 * noise(i));
            system.rhs[1][i] = mass * inverse * (angle(i).cos() + 0.1 * noise(i + n));
        }
        (system, levels)
    }

    fn control(tolerance: f64, max_sweeps: u32) -> Control<f64> {
        Control { tolerance, negligible: 0.0, sor: 1.0, max_sweeps, order: Order::Coloured }
    }

    /// The solution after a solve from zero, and what the solve did.
    fn solved(
        system: &System<f64, 2>,
        levels: &mut Levels<f64, 2>,
        control: Control<f64>,
    ) -> ([Ring<f64>; 2], Swept<f64>) {
        let n = system.rows.len();
        let mut unknown = [Ring::zeros(n), Ring::zeros(n)];
        let swept = solve(system, unknown.each_mut(), Blocks::new(n).unwrap(), &control, true, levels);
        (unknown, swept)
    }

    /// Largest error against the direct solution, as a share of that.
    fn error(system: &System<f64, 2>, unknown: &[Ring<f64>; 2]) -> f64 {
        let n = system.rows.len();
        let mut exact = [Ring::zeros(n), Ring::zeros(n)];
        direct::solve(system, exact.each_mut(), &mut direct::Factor::new(n));
        let largest = |value: &dyn Fn(usize, usize) -> f64| {
            (0..2).flat_map(|f| (0..n).map(move |i| (f, i))).map(|(f, i)| value(f, i).abs()).fold(0.0, f64::max)
        };
        largest(&|f, i| unknown[f][i] - exact[f][i]) / largest(&|f, i| exact[f][i])
    }

    #[test]
    fn a_cycle_halves_the_error_for_every_n_stiffness_and_mesh() {
        for mesh in MESHES {
            for stiffness in STIFFNESSES {
                let (mut worst, mut at) = (0.0_f64, 0);
                for n in SIZES {
                    let (system, mut levels) = problem(n, stiffness, mesh);
                    let mut after = |cycles| {
                        let (unknown, _) = solved(&system, &mut levels, control(1e-300, cycles * SWEEPS_PER_CYCLE));
                        error(&system, &unknown)
                    };
                    // Below this the errors are rounding.
                    let (early, late) = (after(2), after(8).max(1e-13 * stiffness.max(1.0)));
                    let factor = (late / early).powf(1.0 / 6.0);
                    if early > 1e-9 && factor > worst {
                        (worst, at) = (factor, n);
                    }
                }
                println!(
                    "jitter {}, ratio {}, τ/h⁴ = {stiffness:.0e}: {worst:.2} at n = {at}",
                    mesh.jitter, mesh.ratio
                );
                assert!(worst < 0.5, "{mesh:?}, τ/h⁴ = {stiffness}: {worst} at n = {at}");
            }
        }
    }

    #[test]
    fn cycles_reach_the_direct_solution_for_every_n() {
        for n in (6..70).chain(SIZES) {
            for stiffness in [0.06, 60.0, 6e4] {
                let (system, mut levels) = problem(n, stiffness, MESHES[1]);
                let (unknown, swept) = solved(&system, &mut levels, control(1e-9, 1000));
                assert!(swept.converged && swept.sweeps <= 70.0, "n = {n}, τ/h⁴ = {stiffness}: {swept:?}");
                let error = error(&system, &unknown);
                assert!(error < 1e-8, "n = {n}, τ/h⁴ = {stiffness}: {error:e}");
            }
        }
    }

    #[test]
    fn interpolation_is_exact_for_cubics_on_any_mesh() {
        for n in [23, 24] {
            let (_, mut levels) = problem(n, 1.0, MESHES[2]);
            levels.build();
            let spacing = levels.terms.spacing.nodes();
            let place = |i: usize| spacing[..i].iter().sum::<f64>();
            let cubic = |i: usize| ((place(i) - 2.0) * (place(i) - 4.0) + 0.5) * place(i);
            let coarse = Ring::from_nodes((0..n / 2).map(|j| cubic(2 * j)));
            // Not across the ends, where the cubic jumps.
            let mut fine = Ring::zeros(n);
            levels.transfer.interpolate(&coarse, &mut fine, None);
            for (i, value) in fine.nodes().iter().enumerate() {
                let seam = i < 3 || i + 5 > n;
                assert!(seam || (value - cubic(i)).abs() < 1e-12, "n = {n}, node {i}: {value} for {}", cubic(i));
            }
            let sums = (0..n / 2).map(|j| levels.transfer.weights.iter().map(|w| w[j]).sum::<f64>());
            let odd: f64 = if n % 2 == 1 { levels.transfer.odd.iter().sum() } else { 1.0 };
            assert!(sums.chain([odd]).all(|sum| (sum - 1.0).abs() < 1e-12), "n = {n}");
        }
    }

    #[test]
    fn the_cap_and_what_is_not_finite_are_reported() {
        let (mut system, mut levels) = problem(64, 600.0, MESHES[0]);
        let (_, swept) = solved(&system, &mut levels, control(1e-12, 3));
        assert!(!swept.converged && swept.finite && swept.sweeps == 3.0, "{swept:?}");
        system.rhs[1][17] = f64::NAN;
        let (unknown, swept) = solved(&system, &mut levels, control(1e-12, 100));
        assert!(!swept.converged && !swept.finite && swept.sweeps == 0.0, "{swept:?}");
        assert_eq!(unknown[0], Ring::zeros(64));
    }

    #[test]
    fn the_inverse_of_the_coarsest_matrix_is_its_inverse() {
        for n in [12, 14, 16, 18, 20, 22] {
            let (_, mut levels) = problem(n, 60.0, MESHES[1]);
            levels.build();
            let coarsest = levels.coarse.last().unwrap();
            let m = coarsest.share.len();
            assert!((3..=COARSEST).contains(&m));
            for column in 0..m {
                let unknown = Ring::from_nodes((0..m).map(|j| levels.inverse[m * j + column]));
                for j in 0..m {
                    let unit = f64::from(u8::from(j == column));
                    let residual = coarsest.system.rows[j].residual(unit, unknown.window(j));
                    assert!(residual.abs() < 1e-12, "n = {n}: {residual:e}");
                }
            }
        }
    }
}
