//! Direct solution of a periodic pentadiagonal system: the independent check of the sweeps, and `--solver direct`.
//!
//! *Theory.* The last two unknowns `s` border a plain pentadiagonal system `P z + U s = f` of n-2 rows. One
//! elimination without pivoting solves for `f` and the two columns of `U` together; the last two rows then give
//! a 2×2 system for `s`. The systems of the scheme are perturbations of `1 + (positive) D⁴`, for which
//! elimination without pivoting is stable. O(n), no branch on the values.
//!
//! *Practice.* Equations are requested one after another and never stored, since memory traffic limits a step. Short
//! numbers, whose solutions are refined, store what that needs of them.

use super::{
    ring::Ring,
    system::{Equation, Equations},
};
use crate::number::{BIG, Number};

/// A row of the triangular factor: `z_i + d·z_{i+1} + e·z_{i+2} = g`, `g` for the right-hand sides and the two
/// border columns.
#[derive(Clone, Copy, Debug)]
struct Eliminated<N, const F: usize> {
    d: N,
    e: N,
    g: [N; F],
    border: [N; 2],
}

impl<N: Number, const F: usize> Eliminated<N, F> {
    /// `own - d·z_{i+1} - e·z_{i+2}`, with what is below already known.
    #[inline(always)]
    fn substitute(&self, own: N, below1: N, below2: N) -> N {
        own - self.d * below1 - self.e * below2
    }
}

/// What made a row of the triangular factor: `g_i = (rhs_i - a·g_{i-2} - b·g_{i-1})·pivot`.
#[derive(Clone, Copy, Debug)]
struct PivotRow<N, const F: usize> {
    a: N,
    b: N,
    pivot: N,
    rhs: [N; F],
}

impl<N: Number, const F: usize> PivotRow<N, F> {
    #[inline(always)]
    fn eliminate(&self, rhs: N, above2: N, above1: N) -> N {
        (rhs - self.a * above2 - self.b * above1) * self.pivot
    }
}

/// Storage for the factors of an elimination.
#[derive(Clone, Debug)]
pub struct Factor<N, const F: usize> {
    /// The triangular factor: `n-2` rows.
    rows: Vec<Eliminated<N, F>>,
    /// What made them, in short numbers.
    pivot_rows: Vec<PivotRow<N, F>>,
    /// The last two equations.
    last: [Equation<N, F>; 2],
}

impl<N: Number, const F: usize> Factor<N, F> {
    /// Allocates room for systems of `n` ≥ 6 equations, or none for `n` = 0.
    pub fn new(n: usize) -> Self {
        let (zero, core) = (N::default(), n.saturating_sub(2));
        Factor {
            rows: vec![Eliminated { d: zero, e: zero, g: [zero; F], border: [zero; 2] }; core],
            pivot_rows: vec![
                PivotRow { a: zero, b: zero, pivot: zero, rhs: [zero; F] };
                if N::IS_SHORT { core } else { 0 }
            ],
            last: [Equation { a: zero, b: zero, c: zero, d: zero, e: zero, rhs: [zero; F], time_over_length: zero }; 2],
        }
    }
}

/// Writes the solution of `equations` to `unknown`, one ring of n ≥ 6 nodes per right-hand side. Returns whether it is
/// finite.
#[inline(always)]
pub fn solve<N: Number, const F: usize>(
    equations: &impl Equations<N, F>,
    unknown: [&mut Ring<N>; F],
    factor: &mut Factor<N, F>,
) -> N::Mask {
    eliminate(equations, factor);
    substitute_back(&mut factor.rows);
    finish(unknown, &factor.rows, &factor.last)
}

/// Writes to `lacks` the solution for what `unknown` leaves of the right-hand sides of `equations`, which were solved
/// last, in short numbers. Returns whether it is finite.
#[inline(always)]
pub fn refine<N: Number, const F: usize>(
    equations: &impl Equations<N, F>,
    unknown: [&Ring<N>; F],
    lacks: [&mut Ring<N>; F],
    factor: &mut Factor<N, F>,
) -> N::Mask {
    let Factor { rows, pivot_rows, last } = factor;
    let (core, mut last) = (rows.len(), *last);
    let (mut above2, mut above1) = ([N::of(0.0); F], [N::of(0.0); F]);
    for i in 0..core + 2 {
        let rhs = if i < core { pivot_rows[i].rhs } else { last[i - core].rhs };
        let mut left = rhs;
        for f in 0..F {
            left[f] = rhs[f] - equations.applied(i, unknown[f]);
        }
        if i >= core {
            last[i - core].rhs = left;
            continue;
        }
        for f in 0..F {
            left[f] = pivot_rows[i].eliminate(left[f], above2[f], above1[f]);
        }
        rows[i].g = left;
        (above2, above1) = (above1, left);
    }
    let (mut below1, mut below2) = (above1, above1);
    for row in rows[..core - 1].iter_mut().rev() {
        for f in 0..F {
            row.g[f] = row.substitute(row.g[f], below1[f], below2[f]);
        }
        (below2, below1) = (below1, row.g);
    }
    finish(lacks, rows, &last)
}

/// Writes the solution, once `rows` have been substituted back.
#[inline(always)]
fn finish<N: Number, const F: usize>(
    unknown: [&mut Ring<N>; F],
    rows: &[Eliminated<N, F>],
    [p, q]: &[Equation<N, F>; 2],
) -> N::Mask {
    let core = rows.len();
    let last = border_unknowns(p, q, rows);
    let mut largest = N::of(0.0);
    for (f, u) in unknown.into_iter().enumerate() {
        for (i, row) in rows.iter().enumerate() {
            let value = row.g[f] - row.border[0] * last[f][0] - row.border[1] * last[f][1];
            u[i] = value;
            largest = largest.max(value.bounded_abs());
        }
        for (c, value) in last[f].into_iter().enumerate() {
            u[core + c] = value;
            largest = largest.max(value.bounded_abs());
        }
        u.close();
    }
    largest.le(N::of(BIG))
}

/// Fills `factor`.
#[inline(always)]
fn eliminate<N: Number, const F: usize>(equations: &impl Equations<N, F>, factor: &mut Factor<N, F>) {
    let Factor { rows, pivot_rows, last } = factor;
    let core = rows.len();
    let zero = N::of(0.0);
    let none = Eliminated { d: zero, e: zero, g: [zero; F], border: [zero; 2] };
    let (mut above2, mut above1) = (none, none);
    // One loop for all, in which the body of an equation is compiled once.
    for i in 0..core + 2 {
        let mut own = equations.equation(i);
        if i >= core {
            last[i - core] = own;
            continue;
        }
        // Entries of a row outside the core, those of the last two unknowns, go into its border columns.
        let mut border = [zero; 2];
        if i < 2 {
            border = if i == 0 { [own.a, own.b] } else { [zero, own.a] };
            own.a = zero;
            own.b = if i == 0 { zero } else { own.b };
        }
        if i + 2 >= core {
            border =
                if i + 2 == core { [border[0] + own.e, border[1]] } else { [border[0] + own.d, border[1] + own.e] };
            own.d = if i + 1 == core { zero } else { own.d };
            own.e = zero;
        }
        // Row i minus a times the row two above leaves b' on z_{i-1}; minus b' times the row above leaves the pivot.
        let b = own.b - own.a * above2.d;
        let pivot = (own.c - own.a * above2.e - b * above1.d).recip();
        let pivot_row = PivotRow { a: own.a, b, pivot, rhs: own.rhs };
        let mut row = Eliminated { d: (own.d - b * above1.e) * pivot, e: own.e * pivot, g: own.rhs, border };
        for f in 0..F {
            row.g[f] = pivot_row.eliminate(own.rhs[f], above2.g[f], above1.g[f]);
        }
        for c in 0..2 {
            row.border[c] = pivot_row.eliminate(border[c], above2.border[c], above1.border[c]);
        }
        rows[i] = row;
        if N::IS_SHORT {
            pivot_rows[i] = pivot_row;
        }
        (above2, above1) = (above1, row);
    }
}

#[inline(always)]
fn substitute_back<N: Number, const F: usize>(rows: &mut [Eliminated<N, F>]) {
    let core = rows.len();
    // The entry e of the last row but one, and d and e of the last one, are zero.
    let (mut below1, mut below2) = (rows[core - 1], rows[core - 1]);
    for row in rows[..core - 1].iter_mut().rev() {
        for f in 0..F {
            row.g[f] = row.substitute(row.g[f], below1.g[f], below2.g[f]);
        }
        for c in 0..2 {
            row.border[c] = row.substitute(row.border[c], below1.border[c], below2.border[c]);
        }
        (below2, below1) = (below1, *row);
    }
}

/// The last two unknowns for each right-hand side, from the last two equations with `z = g - border·s` substituted.
#[inline(always)]
fn border_unknowns<N: Number, const F: usize>(
    p: &Equation<N, F>,
    q: &Equation<N, F>,
    solved: &[Eliminated<N, F>],
) -> [[N; 2]; F] {
    let core = solved.len();
    let (first, second) = (&solved[0], &solved[1]);
    let (before2, before1) = (&solved[core - 2], &solved[core - 1]);
    let (mut m, mut last) = ([[N::of(0.0); 2]; 2], [[N::of(0.0); 2]; F]);
    for c in 0..2 {
        m[0][c] = p.a * before2.border[c] + p.b * before1.border[c] + p.e * first.border[c];
        m[1][c] = q.a * before1.border[c] + q.d * first.border[c] + q.e * second.border[c];
    }
    let [m00, m01] = [p.c - m[0][0], p.d - m[0][1]];
    let [m10, m11] = [q.b - m[1][0], q.c - m[1][1]];
    let inverse = (m00 * m11 - m01 * m10).recip();
    for f in 0..F {
        let rp = p.rhs[f] - p.a * before2.g[f] - p.b * before1.g[f] - p.e * first.g[f];
        let rq = q.rhs[f] - q.a * before1.g[f] - q.d * first.g[f] - q.e * second.g[f];
        last[f] = [(rp * m11 - rq * m01) * inverse, (rq * m00 - rp * m10) * inverse];
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::{
        refinement::Remaining,
        system::{Row, System, tests::test_system},
    };

    #[test]
    fn the_residual_of_the_direct_solution_is_rounding_error() {
        for n in [6, 7, 8, 9, 50, 101] {
            for stiffness in [0.1, 10.0, 1000.0] {
                let system = test_system(n, stiffness);
                let mut u = [Ring::zeros(n), Ring::zeros(n)];
                let [x, y] = &mut u;
                assert!(solve(&system, [x, y], &mut Factor::new(n)));
                for f in 0..2 {
                    let size = u[f].nodes().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                    let worst = (0..n).map(|i| system.residual(f, i, &u[f]).abs()).fold(0.0, f64::max);
                    assert!(worst <= 40.0 * f64::EPSILON * size, "n = {n}, stiffness {stiffness}: {worst:e}");
                }
            }
        }
    }

    #[test]
    fn a_refinement_is_a_solve_for_what_is_left() {
        for n in [6, 7, 50, 101] {
            let System { rows, rhs } = test_system(n, 10.0);
            let row = |&Row { a, b, d, e, weight }: &Row<f64>| {
                let [a, b, d, e, weight] = [a, b, d, e, weight].map(|number| number as f32);
                Row { a, b, d, e, weight }
            };
            let rhs = rhs.map(|rhs| rhs.into_iter().map(|number| number as f32).collect());
            let system = System { rows: rows.iter().map(row).collect(), rhs };
            let rings = || [Ring::zeros(n), Ring::zeros(n)];
            let (mut first, mut factor) = (rings(), Factor::new(n));
            assert!(solve(&system, first.each_mut(), &mut factor));
            let (mut lacks, mut expected) = (rings(), rings());
            assert!(refine(&system, first.each_ref(), lacks.each_mut(), &mut factor));
            let remaining = Remaining { of: &system, unknown: first.each_ref() };
            assert!(solve(&remaining, expected.each_mut(), &mut Factor::new(n)));
            assert_eq!(lacks, expected, "n = {n}");
            assert!(lacks[0].nodes().iter().any(|lack| *lack != 0.0) && lacks != first);
        }
    }
}
