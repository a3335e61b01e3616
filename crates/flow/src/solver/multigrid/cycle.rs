//! A V-cycle: residuals down to the coarsest ring without sweeps, corrections up with sweeps on every ring. Twin of
//! `shaders/cycle.wgsl`.

use super::coarse::{Level, Levels};
use crate::{
    number::{Mask, Number},
    solver::{
        ring::{Blocks, Ring},
        sweeps::coloured_sweep,
        system::System,
    },
};

/// Sweeps of every level between the finest and the coarsest.
pub const COARSE_SWEEPS: u32 = 4;

impl<N: Number, const F: usize> Levels<N, F> {
    /// Stores the residual of the finest level; returns `[max weight·|residual|, max |u|]`.
    #[inline(always)]
    pub(super) fn residual(&mut self, system: &System<N, F>, unknown: &[&mut Ring<N>; F]) -> [N; 2] {
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
    pub(super) fn correct(&mut self, unknown: &mut [&mut Ring<N>; F], active: N::Mask) {
        let Levels { transfer, coarse, inverse, .. } = self;
        let mut finer = &mut *transfer;
        for level in coarse.iter_mut() {
            for f in 0..F {
                finer.restrict_residuals(f, &mut level.transfer.residual[f]);
                for j in 0..level.share.len() {
                    level.system.rhs[f][j] = level.transfer.residual[f][j] * level.share[j];
                }
            }
            finer = &mut level.transfer;
        }
        let (coarsest, swept) = coarse.split_last_mut().expect("a coarse level");
        coarsest.solve_coarsest(inverse);
        let mut coarser = coarsest;
        for level in swept.iter_mut().rev() {
            for f in 0..F {
                level.transfer.interpolate(&coarser.unknown[f], &mut level.unknown[f], None);
            }
            level.sweep_coarse();
            coarser = level;
        }
        let share = N::select(active, N::of(1.0), N::of(0.0));
        for (f, u) in unknown.iter_mut().enumerate() {
            transfer.interpolate(&coarser.unknown[f], u, Some(share));
        }
    }
}

impl<N: Number, const F: usize> Level<N, F> {
    /// Solves the coarsest system with the inverse of its matrix.
    #[inline(always)]
    fn solve_coarsest(&mut self, inverse: &[N]) {
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

    /// Sweeps the system of the level.
    #[inline(always)]
    fn sweep_coarse(&mut self) {
        let blocks = Blocks::new(self.share.len()).expect("a ring that can be swept");
        let (one, all) = (N::of(1.0), N::Mask::all_of(true));
        for _ in 0..COARSE_SWEEPS {
            coloured_sweep(&self.system, &mut self.unknown.each_mut(), blocks, one, all);
        }
    }
}
