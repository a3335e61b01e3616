//! What multigrid needs from the two systems to discretise them on coarser rings. Twin of `shaders/terms.wgsl`.
//!
//! Both are `ρu + ∂⁴u + p ∂²u + w ∂u`: that of k lives on segments, q apart and r long, with ρ = 1/τ - kβ, p = 0 and
//! w = -α; that of x on nodes, r apart and q long, with ρ = 1/τ, p = φ and w = -α + ³⁄₂ ∂_s k². Coarse systems only
//! provide corrections, so α is taken as the mean over the cell.

use super::{curvature::Curvature, position::Position};
use crate::{
    number::Number,
    solver::multigrid::{Discretisation, Levels},
};

impl<N: Number> Discretisation<N, 1> for Curvature<'_, N> {
    #[inline(always)]
    fn discretised(&self, levels: &mut Levels<N, 1>) {
        curvature_terms(self, levels);
    }
}

impl<N: Number> Discretisation<N, 2> for Position<'_, N> {
    #[inline(always)]
    fn discretised(&self, levels: &mut Levels<N, 2>) {
        position_terms(self, levels);
    }
}

/// The terms of the curvature system.
#[inline(always)]
fn curvature_terms<N: Number>(&Curvature { new, motion, rate, .. }: &Curvature<'_, N>, levels: &mut Levels<N, 1>) {
    levels.rate = rate;
    for i in 0..new.r.len() {
        let [_, _, own, next, _] = new.r.window(i);
        let [_, alpha_m, alpha, _, _] = motion.alpha.window(i);
        levels.terms.spacing[i] = (own + next) * N::of(0.5);
        levels.terms.cell[i] = own;
        levels.terms.mass[i] = rate - motion.rkb[i] * motion.ir[i];
        levels.terms.second[i] = N::of(0.0);
        levels.terms.first[i] = -(N::of(0.5) * (alpha_m + alpha));
    }
    levels.terms.close();
}

/// The terms of the position system.
#[inline(always)]
fn position_terms<N: Number>(equations: &Position<'_, N>, levels: &mut Levels<N, 2>) {
    let Position { new, motion, rate, ref law, .. } = *equations;
    levels.rate = rate;
    for i in 0..new.r.len() {
        let [_, _, own, next, _] = new.r.window(i);
        let [_, _, here, after, _] = new.k.window(i);
        levels.terms.spacing[i] = next;
        levels.terms.cell[i] = (own + next) * N::of(0.5);
        levels.terms.mass[i] = rate;
        levels.terms.second[i] = N::of(0.5) * (law.phi(here) + law.phi(after));
        levels.terms.first[i] = N::of(1.5) * ((after * after - here * here) * motion.iq[i]) - motion.alpha[i];
    }
    levels.terms.close();
}
