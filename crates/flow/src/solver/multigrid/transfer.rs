//! Transfer between a ring and the next coarser one: residuals down, corrections up. Twin of `shaders/transfer.wgsl`.

use super::levels::is_odd;
use crate::{number::Number, solver::ring::Ring};

/// Transfer between a ring and the next coarser one.
#[derive(Clone, Debug)]
pub(super) struct Transfer<N, const F: usize> {
    /// Residuals integrated over cells.
    pub(super) residual: [Ring<N>; F],
    /// Residuals of the nodes between coarse nodes j and j+1.
    between: Ring<N>,
    /// Weights of coarse nodes j-1, j, j+1 and j+2 at the node between j and j+1.
    pub(super) weights: [Ring<N>; 4],
    /// Weights for the last node of an odd ring, the second after the last coarse node.
    pub(super) odd: [N; 4],
}

impl<N: Number, const F: usize> Transfer<N, F> {
    pub(super) fn zeros(n: usize) -> Self {
        Transfer {
            residual: std::array::from_fn(|_| Ring::zeros(n)),
            between: Ring::zeros(n / 2),
            weights: std::array::from_fn(|_| Ring::zeros(n / 2)),
            odd: [N::default(); 4],
        }
    }

    /// Computes the weights for a ring with these spacings.
    #[inline(always)]
    pub(super) fn weigh(&mut self, spacing: &Ring<N>, coarse: &Ring<N>) {
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
        if is_odd(n) {
            self.odd = lagrange(spacing[n - 3] + spacing[n - 2], coarse.window(m - 1));
        }
    }

    /// Computes the residuals of the coarser ring, integrated over its cells.
    #[inline(always)]
    pub(super) fn restrict_residuals(&mut self, f: usize, coarse: &mut Ring<N>) {
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
        if is_odd(fine.len()) {
            for t in 0..4 {
                let j = (m - 2 + t) % m;
                coarse[j] += self.odd[t] * fine[2 * m];
            }
        }
        coarse.close();
    }

    /// Puts the values of `coarse` at all nodes of the finer ring into `fine`, or adds them times `added`.
    #[inline(always)]
    pub(super) fn interpolate(&self, coarse: &Ring<N>, fine: &mut Ring<N>, added: Option<N>) {
        let m = coarse.len();
        let [w0, w1, w2, w3] = &self.weights;
        for j in 0..m {
            let window = coarse.window(j);
            put(&mut fine[2 * j], window[2], added);
            put(&mut fine[2 * j + 1], blend([w0[j], w1[j], w2[j], w3[j]], window), added);
        }
        if is_odd(fine.len()) {
            put(&mut fine[2 * m], blend(self.odd, coarse.window(m - 1)), added);
        }
        fine.close();
    }
}

/// Replaces `old`, or adds `added` times `value` to it.
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

/// Weights of coarse nodes j-1 … j+2 for a point at distance `l` after node j, from the window of spacings of j.
#[inline(always)]
fn lagrange<N: Number>(l: N, [_, before, gap, after, _]: [N; 5]) -> [N; 4] {
    let r = gap - l;
    let (far_l, far_r) = (before + l, r + after);
    let (wide_l, wide_r) = (before + gap, gap + after);
    let all = wide_l + after;
    [
        -(l * r * far_r) / (before * wide_l * all),
        far_l * r * far_r / (before * gap * wide_r),
        far_l * l * far_r / (wide_l * gap * after),
        -(far_l * l * r) / (all * wide_r * after),
    ]
}
