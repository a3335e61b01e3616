//! Discrete Fourier transforms of complex numbers, for the referee.

use std::f64::consts::TAU;

use glam::DVec2;

/// The wave number of coefficient `m` of `n`.
pub(super) fn signed(m: usize, n: usize) -> f64 {
    if m <= n / 2 { m as f64 } else { m as f64 - n as f64 }
}

pub(super) fn conjugate(z: DVec2) -> DVec2 {
    DVec2::new(z.x, -z.y)
}

/// Sets coefficient `m` of a real field, where a forward transform sums the field.
pub(super) fn set_real(grid: &mut [DVec2], m: usize, c: DVec2) {
    let n = grid.len();
    (grid[n - m], grid[m]) = (c, conjugate(c));
}

/// The discrete Fourier transform of length n, a power of two, of complex numbers.
///
/// Radix 2 in place: with some hundred numbers it needs no library. The inverse is the same of the numbers in reverse.
pub(super) struct Fourier {
    /// `e^{-2πij/n}`, j = 0 … n/2 - 1.
    roots: Vec<DVec2>,
    /// Places with their bits in reverse.
    reversed: Vec<u32>,
}

impl Fourier {
    pub(super) fn new(n: usize) -> Fourier {
        let unused = u32::BITS - n.trailing_zeros();
        let reversed = (0..n as u32).map(|i| i.reverse_bits() >> unused).collect();
        let roots = (0..n / 2).map(|j| DVec2::from_angle(-TAU * j as f64 / n as f64)).collect();
        Fourier { roots, reversed }
    }

    /// Replaces `data[m]` by `Σ_j data[j] e^{-2πijm/n}`.
    pub(super) fn transform(&self, data: &mut [DVec2]) {
        for (i, &j) in self.reversed.iter().enumerate() {
            if i < j as usize {
                data.swap(i, j as usize);
            }
        }
        let n = data.len();
        let mut half = 1;
        while half < n {
            let roots = self.roots.iter().step_by(n / (2 * half));
            for block in data.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for ((a, b), root) in low.iter_mut().zip(high).zip(roots.clone()) {
                    let turned = root.rotate(*b);
                    (*a, *b) = (*a + turned, *a - turned);
                }
            }
            half *= 2;
        }
    }
}
