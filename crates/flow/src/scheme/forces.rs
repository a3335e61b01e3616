//! The forces on a curve: the normal velocity `β = -∂²_s k + b(k)`, `φ(k) = k² - b(k)/k` of the position equation, and the
//! density of the energy. Twin of `shaders/forces.wgsl`.
//!
//! Nothing else reads the law of a member: a law of another kind is a change here and in [`Flow`](crate::flow::Flow).

use super::{Curve, Parameters, state::Motion};
use crate::{
    flow::{LENGTH_PENALTY, MAX_DEGREE},
    number::{Number, Real},
};

impl<N: Number> Parameters<N> {
    /// Returns the law, whose `b(k)` has this degree.
    #[inline(always)]
    pub fn law(&self, degree: usize) -> Law<N> {
        let mut coefficients = [N::of(0.0); MAX_DEGREE];
        coefficients.copy_from_slice(&self.law[..MAX_DEGREE]);
        Law { coefficients, degree }
    }
}

/// Returns the degree of `b(k)`, on which the [branches](super::Branches) of a member depend.
pub fn degree<T: Real>(p: &Parameters<T>) -> usize {
    let zero = T::of(0.0);
    p.law[..MAX_DEGREE].iter().rposition(|c| *c != zero).map_or(0, |j| j + 1)
}

/// `b(k) = c₁k + c₂k² + …`, up to its degree.
#[derive(Clone, Copy, Debug)]
pub struct Law<N> {
    coefficients: [N; MAX_DEGREE],
    degree: usize,
}

impl<N: Number> Law<N> {
    /// `b(k)` by Horner's rule.
    #[inline(always)]
    pub fn b(&self, k: N) -> N {
        self.b_over_k(k) * k
    }

    /// `φ(k) = k² - b(k)/k`, without division.
    #[inline(always)]
    pub fn phi(&self, k: N) -> N {
        k * k - self.b_over_k(k)
    }

    #[inline(always)]
    fn b_over_k(&self, k: N) -> N {
        let mut sum = N::of(0.0);
        for c in self.coefficients[..self.degree].iter().rev() {
            sum = sum * k + *c;
        }
        sum
    }
}

/// Fills `b(k)` of `motion` from the curve.
#[inline(always)]
pub fn fill<N: Number>(old: &Curve<N>, p: &Parameters<N>, degree: usize, motion: &mut Motion<N>) {
    let law = p.law(degree);
    for i in 0..old.len() {
        motion.b[i] = law.b(old.k[i]);
    }
    motion.b.close();
}

/// `β_i` of the curve whose reciprocal lengths and `b(k)` are in `motion`, with the [rises](crate::solver::Ring::rises)
/// of its curvature.
#[inline(always)]
pub fn velocity<N: Number>(motion: &Motion<N>, [_, rise, next, _]: [N; 4], i: usize) -> N {
    let [_, iqm, iq, _, _] = motion.iq.window(i);
    motion.b[i] - (next * iq - rise * iqm) * motion.ir[i]
}

impl<N: Number> Parameters<N> {
    /// λ of the energy.
    #[inline(always)]
    pub fn length_penalty(&self) -> N {
        self.law[LENGTH_PENALTY]
    }

    /// `½k² + λ`, the energy of a unit of length.
    #[inline(always)]
    pub fn energy_density(&self, k: N) -> N {
        N::of(0.5) * (k * k) + self.length_penalty()
    }
}
