//! The law of a member: `b(k)`, and `φ(k) = k² - b(k)/k` of the position equation. Twin of the beginning of
//! `shaders/forces.wgsl`.
//!
//! Only [`forces`](super::forces) and the position equation ask for its values.

use super::Parameters;
use crate::{
    flow::MAX_DEGREE,
    number::{Number, Real},
};

/// Properties of a law that decide which instructions are run: members side by side have them in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Kind {
    /// Degree of `b(k)`.
    pub degree: usize,
}

impl<T: Real> Parameters<T> {
    /// Returns the kind of the law, on which the [branches](super::Branches) of a member depend.
    pub fn kind_of_law(&self) -> Kind {
        let zero = T::of(0.0);
        Kind { degree: self.law[..MAX_DEGREE].iter().rposition(|c| *c != zero).map_or(0, |j| j + 1) }
    }
}

impl<N: Number> Parameters<N> {
    /// Returns the law, which is of this kind.
    #[inline(always)]
    pub fn law(&self, kind: Kind) -> Law<N> {
        let mut coefficients = [N::of(0.0); MAX_DEGREE];
        coefficients.copy_from_slice(&self.law[..MAX_DEGREE]);
        Law { coefficients, kind }
    }
}

/// `b(k) = c₁k + c₂k² + …`, up to its degree.
#[derive(Clone, Copy, Debug, Default)]
pub struct Law<N> {
    coefficients: [N; MAX_DEGREE],
    kind: Kind,
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
        for c in self.coefficients[..self.kind.degree].iter().rev() {
            sum = sum * k + *c;
        }
        sum
    }
}
