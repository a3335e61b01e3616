//! Driving forces, and the area and length that are kept. Twin of `shaders/forcing.wgsl`.
//!
//! A force F along the inward normal acts through the normal velocity β and on the nodes; it is no part of φ, as F/k would
//! be singular where the curve is straight. What is kept adds λk + p to β, with the multipliers that keep it where the scheme's own lengths and curvatures are
//! exact: for both
//!
//! ```text
//! ( Σrk²  Σrk ) (λ)     ( Σ r k β )
//! ( Σrk   Σr  ) (p)  = -( Σ r β   )
//! ```
//!
//! λ joins c₁ of `b(k)`. The rest, of second order in the step and in the spacing, is corrected in the new polygon: its
//! nodes move along the gradients of its own area and length until both are what they should be.

use super::{
    Curve, Parameters,
    law::Kind,
    state::{Motion, edge},
};
use crate::{
    forcing::{DRIVE, FEEDBACK, FEEDBACK_AREA, KEPT_AREA, KEPT_LENGTH},
    number::{Number, place},
    solver::{Blocks, Ring, Sums},
};

/// Rounds of a correction. Each divides what is left by a thousand or more: the first takes an error of the step, the
/// last one that of rounding.
const ROUNDS: usize = 4;

/// What is kept, as a number of the law has it.
const AREA: u8 = 1;
const LENGTH: u8 = 2;

impl Kind {
    /// Whether anything acts beside the flow.
    #[inline(always)]
    pub fn is_forced(&self) -> bool {
        self.driven || self.conserved != 0
    }
}

/// Adds F + λk + p to the law, to `b(k)` and to β of `motion`, for an old curve of this length; returns `Σ r k β`.
#[inline(always)]
pub fn act<N: Number>(
    old: &Curve<N>,
    p: &Parameters<N>,
    kind: Kind,
    length: N,
    blocks: Blocks,
    motion: &mut Motion<N>,
) -> N {
    let mut sums = Sums::new(blocks);
    for i in 0..old.len() {
        let (r, k) = (old.r[i], old.k[i]);
        sums.add(i, [r * k, r * k * k, r * motion.beta[i], motion.rkb[i]]);
    }
    let [turn, bent, moved, turned] = sums.totals();
    let drive = p.law[DRIVE] + p.law[FEEDBACK] * (area(old, blocks) - p.law[FEEDBACK_AREA]);
    let (moved, turned) = (moved + drive * length, turned + drive * turn);
    let [pressure, tension] = balanced(kind.conserved, [length, turn, bent], [-moved, -turned]);
    let force = drive + pressure;
    motion.law.force = force;
    motion.law.tighten(tension);
    for i in 0..old.len() {
        let k = old.k[i];
        let beta = motion.beta[i] + (force + tension * k);
        motion.beta[i] = beta;
        motion.rkb[i] = old.r[i] * k * beta;
        motion.b[i] += tension * k;
    }
    motion.b.close();
    turned + (pressure * turn + tension * bent)
}

/// Moves the nodes of a new curve along the gradients of its area and its length to those that are kept. `gradients` is
/// room for them, x and y of each.
#[inline(always)]
pub fn correct<N: Number>(
    new: &mut Curve<N>,
    p: &Parameters<N>,
    kind: Kind,
    blocks: Blocks,
    gradients: &mut [Ring<N>; 4],
) {
    if kind.conserved == 0 {
        return;
    }
    let half = N::of(0.5);
    let mut squares = Sums::new(blocks);
    for i in 0..new.len() {
        let ([_, ex, fx, _], [_, ey, fy, _]) = (new.x.rises_of_places(i), new.y.rises_of_places(i));
        let (e, f) = ((ex * ex + ey * ey).sqrt().recip(), (fx * fx + fy * fy).sqrt().recip());
        let [ax, ay] = [half * (ey + fy), -(half * (ex + fx))];
        let [lx, ly] = [ex * e - fx * f, ey * e - fy * f];
        for (ring, value) in gradients.iter_mut().zip([ax, ay, lx, ly]) {
            ring[i] = value;
        }
        squares.add(i, [ax * ax + ay * ay, ax * lx + ay * ly, lx * lx + ly * ly]);
    }
    let squares = squares.totals();
    for _ in 0..ROUNDS {
        let [area, length] = sizes(new, blocks);
        let [along_area, along_length] =
            balanced(kind.conserved, squares, [p.law[KEPT_AREA] - area, p.law[KEPT_LENGTH] - length]);
        for i in 0..new.len() {
            let [ax, ay, lx, ly] = [&gradients[0], &gradients[1], &gradients[2], &gradients[3]].map(|ring| ring[i]);
            new.x[i] = place::moved(new.x[i], along_area * ax + along_length * lx);
            new.y[i] = place::moved(new.y[i], along_area * ay + along_length * ly);
        }
        new.x.close();
        new.y.close();
    }
}

/// Solves `(aa ab; ab bb) (u; v) = (s; t)` for what is kept, the area and the length: the other unknown is 0.
///
/// On a circle both equations are one, and the length gives way: where `aa bb - ab²` is below a share √ε of `aa bb`, v falls
/// off with it.
#[inline(always)]
fn balanced<N: Number>(conserved: u8, [aa, ab, bb]: [N; 3], [s, t]: [N; 2]) -> [N; 2] {
    let zero = N::of(0.0);
    match conserved {
        0 => [zero, zero],
        AREA => [s / aa, zero],
        LENGTH => [zero, t / bb],
        _ => {
            let share = ab / aa;
            let own = bb - share * ab;
            let least = N::of(N::EPSILON.sqrt()) * bb;
            let v = (t - share * s) * own / (own * own + least * least);
            [(s - ab * v) / aa, v]
        }
    }
}

/// The area of a polygon.
#[inline(always)]
fn area<N: Number>(curve: &Curve<N>, blocks: Blocks) -> N {
    let [area, _] = sizes(curve, blocks);
    area
}

/// Its area and its length.
#[inline(always)]
fn sizes<N: Number>(curve: &Curve<N>, blocks: Blocks) -> [N; 2] {
    let mut sums = Sums::new(blocks);
    for i in 0..curve.len() {
        sums.add(i, [super::observe::cross(curve, i), edge(curve, i)[2]]);
    }
    let [twice, length] = sums.totals();
    [N::of(0.5) * twice, length]
}
