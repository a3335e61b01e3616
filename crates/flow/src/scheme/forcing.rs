//! Driving forces, and the area and length that are kept. Twin of `shaders/forcing.wgsl`.
//!
//! A force F along the inward normal is a part of the normal velocity β; it is no part of φ, as F/k would be singular where the
//! curve is straight. The nodes move by τF after the position equation has been solved. What is kept adds λk + p to β, with
//! multipliers by the lengths and curvatures that the scheme evolves: for both
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
pub const ROUNDS: usize = 4;

impl Kind {
    /// Whether anything acts beside the flow.
    #[inline(always)]
    pub fn is_forced(&self) -> bool {
        self.driven || self.conserved != 0
    }

    /// 1 for each of area and length that is kept, else 0.
    #[inline(always)]
    fn kept<N: Number>(&self) -> [N; 2] {
        [self.conserved & 1, self.conserved >> 1].map(|kept| N::of(f64::from(kept)))
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
    let [area, _] = sizes(old, blocks);
    let drive = p.law[DRIVE] + p.law[FEEDBACK] * (area - p.law[FEEDBACK_AREA]);
    let (moved, turned) = (moved + drive * length, turned + drive * turn);
    let [pressure, tension] = balanced(kind.kept(), [length, turn, bent], [-moved, -turned]);
    let force = drive + pressure;
    motion.force = force;
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

/// Moves the nodes of a new curve by a time τ of the force that [`act`] has found, along the inward normals of the old one.
#[inline(always)]
pub fn push<N: Number>(old: &Curve<N>, new: &mut Curve<N>, motion: &Motion<N>, tau: N) {
    let by = tau * motion.force;
    for i in 0..old.len() {
        let ([_, ex, fx, _], [_, ey, fy, _]) = (old.x.rises_of_places(i), old.y.rises_of_places(i));
        let (along_x, along_y) = (ex + fx, ey + fy);
        let across = by / (along_x * along_x + along_y * along_y).sqrt();
        new.x[i] = place::moved(new.x[i], -(across * along_y));
        new.y[i] = place::moved(new.y[i], across * along_x);
    }
    new.x.close();
    new.y.close();
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
    let (squares, kept) = (squares.totals(), kind.kept());
    for _ in 0..ROUNDS {
        let [area, length] = sizes(new, blocks);
        let [along_area, along_length] =
            balanced(kept, squares, [p.law[KEPT_AREA] - area, p.law[KEPT_LENGTH] - length]);
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
/// off with it. Without a branch, by which compilers would write every loop around it several times.
#[inline(always)]
fn balanced<N: Number>([area_kept, length_kept]: [N; 2], [aa, ab, bb]: [N; 3], [s, t]: [N; 2]) -> [N; 2] {
    let share = area_kept * (ab / aa);
    let own = bb - share * ab;
    let least = N::of(N::EPSILON.sqrt()) * bb;
    let v = length_kept * ((t - share * s) * own / (own * own + least * least));
    [area_kept * ((s - ab * v) / aa), v]
}

/// The area and the length of a polygon.
#[inline(always)]
fn sizes<N: Number>(curve: &Curve<N>, blocks: Blocks) -> [N; 2] {
    let mut sums = Sums::new(blocks);
    for i in 0..curve.len() {
        sums.add(i, [super::observe::cross(curve, i), edge(curve, i)[2]]);
    }
    let [twice, length] = sums.totals();
    [N::of(0.5) * twice, length]
}

#[cfg(test)]
mod tests {
    use glam::DVec2;
    use std::f64::consts::{PI, TAU};

    use super::*;
    use crate::{
        flow::Flow,
        forcing::{Conserved, Drive, Forcing},
        scheme::{
            evolve::{Team, evolve},
            run::Run,
            state::State,
            step::Method,
        },
        solver::Solver,
    };

    /// A member that has followed a flow with this forcing to a time, by adaptive steps.
    fn followed(nodes: &[DVec2], flow: &Flow, forcing: &Forcing, end: f64, geometric: bool, tol: f64) -> Run<f64> {
        let mut p = Parameters { geometric: f64::from(u8::from(geometric)), ..Parameters::of_flow(flow, 0.0) };
        forcing.write(&mut p.law, 1.0);
        (p.adaptive, p.omega, p.follow_to) = (tol, 4.0, 1.0);
        (p.time_unit, p.time_tick) = (1.0 / 1024.0, 2f64.powi(-40));
        (p.end_high, p.goal_high) = (end, end);
        let mut run = Run::new(State::from_nodes(nodes), p);
        run.report.progress.next = 1e-7;
        run.counters.goal = 5_000;
        let mut team = Team::new(Blocks::new(nodes.len()).unwrap());
        while run.counters.is_running() {
            evolve(&mut run, &Method::coloured(Solver::Direct, 1), &mut team, 100);
        }
        run
    }

    fn circle(n: usize) -> Vec<DVec2> {
        (1..=n).map(|i| DVec2::from_angle(TAU * i as f64 / n as f64)).collect()
    }

    #[test]
    fn xx() {
        for tol in [1e-5, 1e-6, 1e-7] {
        for geometric in [false, true] {
            for force in [1.0] {
                for end in [0.5, 0.8, 0.9, 0.95, 0.98] {
                    let forcing = Forcing { drive: Some(Drive::Constant(force)), ..Forcing::default() };
                    let run = followed(&circle(50), &Flow::SurfaceDiffusion, &forcing, end, geometric, tol);
                    let radius = run.state.curve.positions().map(|node| node.length()).sum::<f64>() / 50.0;
                    println!("{tol:e} {geometric} {force} {end}: {} {} {} {:e} {:e} {:e}", run.counters.status, run.counters.steps, run.counters.solves, radius - 1.0 + force * end, run.report.now.mesh_ratio - 1.0, run.report.now.excess);
                }
            }
        }
        }
    }
}
