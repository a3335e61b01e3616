//! A periodic pentadiagonal system with `F` right-hand sides, every row divided by its diagonal entry.

use super::ring::Ring;
use crate::number::Number;

/// Row i: `a·u_{i-2} + b·u_{i-1} + u_i + d·u_{i+1} + e·u_{i+2} = rhs`, the diagonal entry being 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row<N> {
    /// Coefficient of `u_{i-2}`.
    pub a: N,
    /// Coefficient of `u_{i-1}`.
    pub b: N,
    /// Coefficient of `u_{i+1}`.
    pub d: N,
    /// Coefficient of `u_{i+2}`.
    pub e: N,
    /// Factor from the residual of this row to a bound of the error in slow modes: `(τ/q)·c`, with `c` the
    /// diagonal entry before the division and `q` the length that stands in `q/τ`.
    pub weight: N,
}

impl<N: Number> Row<N> {
    /// Divides a row by its diagonal entry `c`; `time_over_length` is τ/q. Returns the row and 1/c.
    #[inline(always)]
    pub fn normalised(a: N, b: N, c: N, d: N, e: N, time_over_length: N) -> (Row<N>, N) {
        let inverse = c.recip();
        let row = Row { a: a * inverse, b: b * inverse, d: d * inverse, e: e * inverse, weight: time_over_length * c };
        (row, inverse)
    }

    /// `rhs - (row · u)` at the centre of a window of `u`.
    #[inline(always)]
    pub fn residual(&self, rhs: N, [m2, m1, u, p1, p2]: [N; 5]) -> N {
        rhs - self.a * m2 - self.b * m1 - self.d * p1 - self.e * p2 - u
    }
}

/// One matrix, `F` right-hand sides (1 for the curvature, 2 for the positions).
#[derive(Clone, Debug)]
pub struct System<N, const F: usize> {
    /// The rows.
    pub rows: Vec<Row<N>>,
    /// The right-hand sides, divided by the diagonal like the rows.
    pub rhs: [Vec<N>; F],
}

impl<N: Number, const F: usize> System<N, F> {
    /// A system of `n` rows, to be filled.
    pub fn zeros(n: usize) -> Self {
        System { rows: vec![Row::default(); n], rhs: std::array::from_fn(|_| vec![N::default(); n]) }
    }

    /// Residual of row `i` for right-hand side `f`.
    #[inline(always)]
    pub fn residual(&self, f: usize, i: usize, u: &Ring<N>) -> N {
        self.rows[i].residual(self.rhs[f][i], u.window(i))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// `(1 + stiffness·(1 + variation)·D⁴) u = rhs`, unsymmetric, diagonally far from dominant.
    pub(crate) fn test_system(n: usize, stiffness: f64) -> System<f64, 2> {
        let mut system = System::zeros(n);
        for i in 0..n {
            let s = stiffness * (1.0 + 0.3 * (1.7 * i as f64).sin());
            let skew = 0.1 * (0.9 * i as f64).cos();
            let (row, inverse) = Row::normalised(s, -4.0 * s + skew, 1.0 + 6.0 * s, -4.0 * s - skew, s, 1.0);
            system.rows[i] = row;
            system.rhs[0][i] = (0.3 * i as f64).sin() * inverse;
            system.rhs[1][i] = (1.1 * i as f64 + 0.5).cos() * inverse;
        }
        system
    }
}
