//! The law `b(k)` and `φ(k) = k² - b(k)/k`. Twin of `shaders/flow.wgsl`.

use super::{Branches, Parameters};
use crate::{flow::MAX_DEGREE, number::Number};

impl<N: Number> Parameters<N> {
    /// Returns the law, with the degree given by `branches`.
    #[inline(always)]
    pub fn law(&self, branches: Branches) -> Law<N> {
        Law { coefficients: self.coefficients(), degree: branches.degree }
    }
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
