//! A periodic pentadiagonal system with `F` right-hand sides: one equation per node, and the rows used by sweeps.

use super::ring::Ring;
use crate::number::Number;

/// Equation i: `a·u_{i-2} + b·u_{i-1} + c·u_i + d·u_{i+1} + e·u_{i+2} = rhs`, for each right-hand side.
#[derive(Clone, Copy, Debug)]
pub struct Equation<N, const F: usize> {
    /// Coefficient of `u_{i-2}`.
    pub a: N,
    /// Coefficient of `u_{i-1}`.
    pub b: N,
    /// Diagonal entry.
    pub c: N,
    /// Coefficient of `u_{i+1}`.
    pub d: N,
    /// Coefficient of `u_{i+2}`.
    pub e: N,
    /// Right-hand sides.
    pub rhs: [N; F],
    /// τ/q, with `q` the length that appears in the diagonal entry as `q/τ`.
    pub time_over_length: N,
}

/// A source of the equations of a system. A trait, not a closure, so that its methods are compiled into the calling
/// vector code.
pub trait Equations<N, const F: usize> {
    /// Returns equation `i`.
    fn equation(&self, i: usize) -> Equation<N, F>;

    /// Returns row `i` times an unknown, by differences of differences: nothing is lost where it is smooth.
    fn applied(&self, i: usize, unknown: &Ring<N>) -> N;
}

/// Row i: an equation divided by its diagonal entry, `a·u_{i-2} + b·u_{i-1} + u_i + d·u_{i+1} + e·u_{i+2} = rhs`.
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
    /// Factor from the residual of this row to a bound on the error in slow modes: `(τ/q)·c`.
    pub weight: N,
}

impl<N: Number, const F: usize> Equation<N, F> {
    /// Returns the row and the right-hand sides, divided by the diagonal entry.
    #[inline(always)]
    fn normalise(self) -> (Row<N>, [N; F]) {
        let Equation { a, b, c, d, e, mut rhs, time_over_length } = self;
        let inverse = c.recip();
        let weight = time_over_length * c;
        let row = Row { a: a * inverse, b: b * inverse, d: d * inverse, e: e * inverse, weight };
        // A loop, not a closure, which would not be compiled into the vector code.
        for f in 0..F {
            rhs[f] = rhs[f] * inverse;
        }
        (row, rhs)
    }
}

impl<N: Number> Row<N> {
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
    /// Creates a system of `n` rows, to be filled.
    pub fn zeros(n: usize) -> Self {
        System { rows: vec![Row::default(); n], rhs: std::array::from_fn(|_| vec![N::default(); n]) }
    }

    /// Fills it with `equations`, divided by their diagonal entries.
    #[inline(always)]
    pub fn assemble(&mut self, equations: &impl Equations<N, F>) {
        for i in 0..self.rows.len() {
            let (row, rhs) = equations.equation(i).normalise();
            self.rows[i] = row;
            for f in 0..F {
                self.rhs[f][i] = rhs[f];
            }
        }
    }

    /// Returns the residual of row `i` for right-hand side `f`.
    #[inline(always)]
    pub fn residual(&self, f: usize, i: usize, u: &Ring<N>) -> N {
        self.rows[i].residual(self.rhs[f][i], u.window(i))
    }
}

/// The equations as stored, with a diagonal entry of 1.
impl<N: Number, const F: usize> Equations<N, F> for System<N, F> {
    #[inline(always)]
    fn equation(&self, i: usize) -> Equation<N, F> {
        let Row { a, b, d, e, weight } = self.rows[i];
        let rhs = std::array::from_fn(|f| self.rhs[f][i]);
        Equation { a, b, c: N::of(1.0), d, e, rhs, time_over_length: weight }
    }

    #[inline(always)]
    fn applied(&self, i: usize, unknown: &Ring<N>) -> N {
        -self.rows[i].residual(N::of(0.0), unknown.window(i))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// `(1 + stiffness·(1 + variation)·D⁴) u = rhs`, unsymmetric, diagonally far from dominant.
    struct Stiff(f64);

    impl Equations<f64, 2> for Stiff {
        fn equation(&self, i: usize) -> Equation<f64, 2> {
            let s = self.0 * (1.0 + 0.3 * (1.7 * i as f64).sin());
            let skew = 0.1 * (0.9 * i as f64).cos();
            let rhs = [(0.3 * i as f64).sin(), (1.1 * i as f64 + 0.5).cos()];
            let (b, d) = (-4.0 * s + skew, -4.0 * s - skew);
            Equation { a: s, b, c: 1.0 + 6.0 * s, d, e: s, rhs, time_over_length: 1.0 }
        }

        fn applied(&self, i: usize, unknown: &Ring<f64>) -> f64 {
            let Equation { a, b, c, d, e, .. } = self.equation(i);
            let [mm, m, u, p, pp] = unknown.window(i);
            a * mm + b * m + c * u + d * p + e * pp
        }
    }

    pub(crate) fn test_system(n: usize, stiffness: f64) -> System<f64, 2> {
        let mut system = System::zeros(n);
        system.assemble(&Stiff(stiffness));
        system
    }
}
