//! Where sweeps start: increments predicted from those of the last two solves. Twin of `shaders/start.wgsl`.
//!
//! An increment over a time τ that ends at t is τ·v(t), and v is smooth. Two increments therefore predict the next one
//! to second order, which saves most of the sweeps needed with the last one alone. The first part of a row of an
//! adaptive step has no increment before it: it starts from the derivatives at the end of the step before.

use super::{Curve, Increments, State};
use crate::{number::Number, solver::Ring};

/// After a step of the paper: extrapolates its increments to the next one of the same length, and remembers them in
/// `earlier`.
#[inline(always)]
pub fn after_step<N: Number>(increments: &mut Increments<N>, earlier: &mut Increments<N>) {
    let Increments { k, x, y } = earlier;
    for (own, earlier) in [(&mut increments.k, k), (&mut increments.x, x), (&mut increments.y, y)] {
        for i in 0..own.len() {
            let last = own[i];
            own[i] = N::of(2.0) * last - earlier[i];
            earlier[i] = last;
        }
        own.close();
        earlier.close();
    }
}

/// Puts the start of the first part of a row: `ratio` times as long as the step that left the slope and the bend.
#[inline(always)]
pub fn begin_row<N: Number>(state: &mut State<N>, ratio: N) {
    let State { increments, earlier, slope, bend, .. } = state;
    let square = ratio * ratio;
    let put = |increment: &mut Ring<N>, earlier: &mut Ring<N>, slope: &Ring<N>, bend: &Ring<N>| {
        for i in 0..slope.len() {
            earlier[i] = ratio * slope[i];
            increment[i] = earlier[i] + square * bend[i];
        }
        increment.close();
        earlier.close();
    };
    let [Curve { x, y, k, .. }, Curve { x: bx, y: by, k: bk, .. }] = [slope, bend];
    put(&mut increments.k, &mut earlier.k, k, bk);
    put(&mut increments.x, &mut earlier.x, x, bx);
    put(&mut increments.y, &mut earlier.y, y, by);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `[increments, earlier]` of one node after a step of the paper.
    fn next([last, before]: [f64; 2]) -> [f64; 2] {
        let filled = |value: f64| {
            let mut all = Increments::zeros(6);
            for ring in [&mut all.k, &mut all.x, &mut all.y] {
                (0..6).for_each(|i| ring[i] = value);
            }
            all
        };
        let (mut increments, mut earlier) = (filled(last), filled(before));
        after_step(&mut increments, &mut earlier);
        [increments.y[3], earlier.x[2]]
    }

    #[test]
    fn starts_are_exact_where_the_velocity_is_a_straight_line() {
        let v = |t: f64| 0.7 - 1.3 * t;
        let (t, h) = (0.4, 0.25);
        let [start, last] = next([h * v(t), h * v(t - h)]);
        assert!((start - h * v(t + h)).abs() < 1e-15 && last == h * v(t));

        // A step of length 0.2 ended at t; a part of length h follows.
        let (step, mut state) = (0.2, State::<f64>::zeros(6));
        for i in 0..6 {
            (state.slope.y[i], state.bend.y[i]) = (step * v(t), step * step * -1.3);
        }
        begin_row(&mut state, h / step);
        assert!((state.increments.y[2] - h * v(t + h)).abs() < 1e-15);
        let [second, _] = next([state.increments.y[2], state.earlier.y[2]]);
        assert!((second - h * v(t + 2.0 * h)).abs() < 1e-15);
        assert_eq!(state.increments.x[2], 0.0);
    }
}
