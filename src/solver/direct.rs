//! Direct solution of a periodic pentadiagonal system: the independent check of the sweeps, and `--solver direct`.
//!
//! *Theory.* The last two unknowns `s` border a plain pentadiagonal system `P z + U s = f` of n-2 rows. One
//! elimination without pivoting solves for `f` and the two columns of `U` together; the last two rows then give
//! a 2×2 system for `s`. The systems of the scheme are perturbations of `1 + (positive) D⁴`, for which
//! elimination without pivoting is stable. O(n), no branch on the values.

use super::{ring::Ring, system::System};
use crate::number::{BIG, Number};

/// A row of the triangular factor: `z_i + d·z_{i+1} + e·z_{i+2} = g`, `g` for the right-hand sides and the two
/// border columns.
#[derive(Clone, Copy)]
struct Eliminated<N, const F: usize> {
    d: N,
    e: N,
    g: [N; F],
    border: [N; 2],
}

/// Writes the solution of `system` (n ≥ 6 rows) to `unknown`, one ring per right-hand side; says whether it is finite.
pub fn solve<N: Number, const F: usize>(system: &System<N, F>, unknown: [&mut Ring<N>; F]) -> N::Mask {
    let core = system.rows.len() - 2;
    let upper = eliminate(system, core);
    let solved = substitute_back(&upper);
    let last = border_unknowns(system, &solved);
    let mut largest = N::of(0.0);
    for (f, u) in unknown.into_iter().enumerate() {
        for (i, row) in solved.iter().enumerate() {
            u[i] = row.g[f] - row.border[0] * last[f][0] - row.border[1] * last[f][1];
        }
        u[core] = last[f][0];
        u[core + 1] = last[f][1];
        u.close();
        for i in 0..u.len() {
            largest = largest.max(u[i].bounded_abs());
        }
    }
    largest.le(N::of(BIG))
}

/// The border column entries of core row `i`: what multiplies the last two unknowns.
#[inline(always)]
fn border<N: Number, const F: usize>(system: &System<N, F>, i: usize, core: usize) -> [N; 2] {
    let row = &system.rows[i];
    let zero = N::of(0.0);
    let mut columns = [zero, zero];
    match i {
        0 => columns = [row.a, row.b],
        1 => columns = [zero, row.a],
        _ => {}
    }
    if i + 2 == core {
        columns[0] += row.e;
    } else if i + 1 == core {
        columns[0] += row.d;
        columns[1] += row.e;
    }
    columns
}

fn eliminate<N: Number, const F: usize>(system: &System<N, F>, core: usize) -> Vec<Eliminated<N, F>> {
    let zero = N::of(0.0);
    let none = Eliminated { d: zero, e: zero, g: [zero; F], border: [zero; 2] };
    let mut upper: Vec<Eliminated<N, F>> = Vec::with_capacity(core);
    let (mut above2, mut above1) = (none, none);
    for i in 0..core {
        let row = &system.rows[i];
        let a = if i >= 2 { row.a } else { zero };
        let b = if i >= 1 { row.b } else { zero };
        let d = if i + 1 < core { row.d } else { zero };
        let e = if i + 2 < core { row.e } else { zero };
        let columns = border(system, i, core);
        // Row i minus a times the row two above leaves b' on z_{i-1}; minus b' times the row above leaves the pivot.
        let b = b - a * above2.d;
        let pivot = (N::of(1.0) - a * above2.e - b * above1.d).recip();
        let reduce = |own: N, two_above: N, one_above: N| (own - a * two_above - b * one_above) * pivot;
        let eliminated = Eliminated {
            d: (d - b * above1.e) * pivot,
            e: e * pivot,
            g: std::array::from_fn(|f| reduce(system.rhs[f][i], above2.g[f], above1.g[f])),
            border: std::array::from_fn(|c| reduce(columns[c], above2.border[c], above1.border[c])),
        };
        upper.push(eliminated);
        (above2, above1) = (above1, eliminated);
    }
    upper
}

fn substitute_back<N: Number, const F: usize>(upper: &[Eliminated<N, F>]) -> Vec<Eliminated<N, F>> {
    let mut solved = upper.to_vec();
    let core = upper.len();
    for i in (0..core - 1).rev() {
        let below1 = solved[i + 1];
        let below2 = solved[(i + 2).min(core - 1)];
        let row = &mut solved[i];
        // In the last but one row e is zero, so the repeated row below does not matter.
        for f in 0..F {
            row.g[f] = row.g[f] - row.d * below1.g[f] - row.e * below2.g[f];
        }
        for c in 0..2 {
            row.border[c] = row.border[c] - row.d * below1.border[c] - row.e * below2.border[c];
        }
    }
    solved
}

/// The last two unknowns for each right-hand side, from the last two rows with `z = g - border·s` put in.
fn border_unknowns<N: Number, const F: usize>(system: &System<N, F>, solved: &[Eliminated<N, F>]) -> [[N; 2]; F] {
    let core = solved.len();
    let (p, q) = (&system.rows[core], &system.rows[core + 1]);
    let (first, second) = (&solved[0], &solved[1]);
    let (before2, before1) = (&solved[core - 2], &solved[core - 1]);
    let coupling_p = |c: usize| p.a * before2.border[c] + p.b * before1.border[c] + p.e * first.border[c];
    let coupling_q = |c: usize| q.a * before1.border[c] + q.d * first.border[c] + q.e * second.border[c];
    let one = N::of(1.0);
    let [m00, m01] = [one - coupling_p(0), p.d - coupling_p(1)];
    let [m10, m11] = [q.b - coupling_q(0), one - coupling_q(1)];
    let inverse = (m00 * m11 - m01 * m10).recip();
    std::array::from_fn(|f| {
        let rp = system.rhs[f][core] - p.a * before2.g[f] - p.b * before1.g[f] - p.e * first.g[f];
        let rq = system.rhs[f][core + 1] - q.a * before1.g[f] - q.d * first.g[f] - q.e * second.g[f];
        [(rp * m11 - rq * m01) * inverse, (rq * m00 - rp * m10) * inverse]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::system::tests::test_system;

    #[test]
    fn the_residual_of_the_direct_solution_is_rounding_error() {
        for n in [6, 7, 8, 9, 50, 101] {
            for stiffness in [0.1, 10.0, 1000.0] {
                let system = test_system(n, stiffness);
                let mut u = [Ring::zeros(n), Ring::zeros(n)];
                let [x, y] = &mut u;
                assert!(solve(&system, [x, y]));
                for f in 0..2 {
                    let size = u[f].nodes().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                    let worst = (0..n).map(|i| system.residual(f, i, &u[f]).abs()).fold(0.0, f64::max);
                    assert!(worst <= 40.0 * f64::EPSILON * size, "n = {n}, stiffness {stiffness}: {worst:e}");
                }
            }
        }
    }
}
