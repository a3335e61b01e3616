//! The forces on a curve: the normal velocity `β = -∂²_s k + b(k)`, the force of the polygon, and the density of the
//! energy. Twin of `shaders/forces.wgsl`.
//!
//! Of a crystal, `β = -∂_s(M ∂_s w)` with w = g k and g = γ + γ″. g and M go by the directions of the old polygon, on
//! its segments and between them at its nodes.
//!
//! Nothing else reads the law of a member: another law is a change here, in [`law`](super::law) and in
//! [`Flow`](crate::flow::Flow).

use super::{
    Curve, Parameters,
    law::Kind,
    state::{Motion, edge, vertex_turn},
};
use crate::{flow::LENGTH_PENALTY, number::Number};

/// Fills the law and `b(k)` of `motion` from the curve, whose reciprocal lengths are there.
#[inline(always)]
pub fn fill<N: Number>(old: &Curve<N>, p: &Parameters<N>, kind: Kind, motion: &mut Motion<N>) {
    let law = p.law(kind);
    motion.law = law;
    if kind.is_crystal() {
        return fill_directions(old, motion);
    }
    for i in 0..old.len() {
        motion.b[i] = law.b(old.k[i]);
    }
    motion.b.close();
}

/// The unit tangent of an edge.
#[inline(always)]
pub fn tangent_of<N: Number>([x, y, length]: [N; 3]) -> [N; 2] {
    let inverse = length.recip();
    [x * inverse, y * inverse]
}

/// Fills what a crystal is on the segments and at the nodes, with the lengths of the edges, by which their directions
/// are known.
#[inline(always)]
fn fill_directions<N: Number>(old: &Curve<N>, motion: &mut Motion<N>) {
    let (n, one, law) = (old.len(), N::of(1.0), motion.law);
    let first = edge(old.nodes(), 0);
    let at_first = law.directed(tangent_of(first));
    let (mut length, mut here) = (first[2], at_first);
    for i in 0..n {
        // The edge after the last node is the first one.
        let (mut after, mut next) = (first[2], at_first);
        if i + 1 < n {
            let ([.., x, _], [.., y, _]) = (old.x.rises_of_places(i), old.y.rises_of_places(i));
            after = (x * x + y * y).sqrt();
            next = law.directed(tangent_of([x, y, after]));
        }
        let stiffness = one + here.stiffness;
        motion.edge[i] = length;
        motion.stiffness[i] = stiffness;
        motion.weighted[i] = stiffness * old.k[i];
        let [stiffness_there, mobile_there] = law.between(&here, &next);
        motion.stiffness_there[i] = stiffness_there;
        if law.kind.is_diffusive() {
            motion.mobile[i] = one + here.diffusivity;
            motion.mobile_there[i] = mobile_there;
        }
        (length, here) = (after, next);
    }
    motion.edge.close();
    motion.stiffness.close();
    motion.weighted.close();
    motion.stiffness_there.close();
    if law.kind.is_diffusive() {
        motion.mobile.close();
        motion.mobile_there.close();
    }
}

/// `β_i` of the curve whose reciprocal lengths and `b(k)` are in `motion`, with the [rises](crate::solver::Ring::rises)
/// of its curvature.
#[inline(always)]
pub fn velocity<N: Number>(motion: &Motion<N>, [_, rise, next, _]: [N; 4], i: usize) -> N {
    if motion.law.kind.is_crystal() {
        let ([_, before, here, _, _], [_, rise, next, _]) = (conductance(motion, i), motion.weighted.rises(i));
        return (rise * before - next * here) * motion.ir[i];
    }
    let [_, iqm, iq, _, _] = motion.iq.window(i);
    motion.b[i] - (next * iq - rise * iqm) * motion.ir[i]
}

/// `M/q` at the nodes `i-2 … i+2` of a crystal.
#[inline(always)]
pub fn conductance<N: Number>(motion: &Motion<N>, i: usize) -> [N; 5] {
    let mut all = motion.iq.window(i);
    if motion.law.kind.is_diffusive() {
        let mobile = motion.mobile_there.window(i);
        for j in 0..5 {
            all[j] = mobile[j] * all[j];
        }
    }
    all
}

/// Fills the lengths of the polygon's edges and its own curvature at the nodes, `2 sin(θ/2)` of the angle θ there over
/// half the length of both edges: in the geometric form, what forces the curve. Of a crystal, g times that curvature.
#[inline(always)]
pub fn measure<N: Number>(old: &Curve<N>, motion: &mut Motion<N>) {
    let crystal = motion.law.kind.is_crystal();
    if !crystal {
        for i in 0..old.len() {
            motion.edge[i] = edge(old.nodes(), i)[2];
        }
        motion.edge.close();
    }
    for i in 0..old.len() {
        let ([_, ex, fx, _], [_, ey, fy, _]) = (old.x.rises_of_places(i), old.y.rises_of_places(i));
        let [_, _, e, f, _] = motion.edge.window(i);
        let bent = bent([ex, ey, e], [fx, fy, f]);
        motion.bent[i] = if crystal { (motion.stiffness_there[i] * bent).rounded() } else { bent };
    }
    motion.bent.close();
}

/// The curvature at the node between two edges `[x, y, length]`.
#[inline(always)]
fn bent<N: Number>(before: [N; 3], after: [N; 3]) -> N {
    (vertex_turn(before, after) / (N::of(0.5) * (before[2] + after[2]))).rounded()
}

/// `q (βN + αT)` at node i of the polygon that was measured: the second difference of its own curvature and `b` along
/// the inward normal to the chord between its neighbours, and α along the chord.
#[inline(always)]
pub fn of_polygon<N: Number>(old: &Curve<N>, motion: &Motion<N>, i: usize) -> [N; 2] {
    let ([_, ex, fx, _], [_, ey, fy, _]) = (old.x.rises_of_places(i), old.y.rises_of_places(i));
    let [_, _, e, f, _] = motion.edge.window(i);
    let [_, rise, next, _] = motion.bent.rises(i);
    let half = N::of(0.5);
    let along = [ex + fx, ey + fy];
    let kind = motion.law.kind;
    let inward = if kind.is_diffusive() {
        let [_, _, mobile, mobile_after, _] = motion.mobile.window(i);
        (mobile * (rise / e)).rounded() - (mobile_after * (next / f)).rounded()
    } else if kind.is_crystal() {
        (rise / e).rounded() - (next / f).rounded()
    } else {
        half * (e + f) * motion.law.b(motion.bent[i]) - ((next / f).rounded() - (rise / e).rounded())
    };
    let across = inward / (along[0] * along[0] + along[1] * along[1]).sqrt();
    let sliding = half * motion.alpha[i];
    [sliding * along[0] - across * along[1], sliding * along[1] + across * along[0]]
}

impl<N: Number> Parameters<N> {
    /// λ of the energy.
    #[inline(always)]
    pub fn length_penalty(&self) -> N {
        self.law[LENGTH_PENALTY]
    }

    /// The energy of the polygon at the node between two edges, with `½ 2sin(θ/2) 2tan(θ/2)` over the length there.
    ///
    /// In shapes at rest it is the curve's within a third of the error that `Σ ½k² r` has.
    #[inline(always)]
    pub fn energy_at_vertex(&self, before: [N; 3], after: [N; 3]) -> N {
        let (half, one) = (N::of(0.5), N::of(1.0));
        let turned = vertex_turn(before, after);
        let square = turned * turned;
        let length = half * (before[2] + after[2]);
        let bending = half * square / ((one - N::of(0.25) * square).sqrt() * length);
        bending + self.length_penalty() * length
    }

    /// `½k² + λ`, the energy of a unit of length.
    #[inline(always)]
    pub fn energy_density(&self, k: N) -> N {
        N::of(0.5) * (k * k) + self.length_penalty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        flow::Flow,
        scheme::{
            State, Workspace,
            step::{Method, Steps},
        },
        solver::{Blocks, Solver},
    };
    use glam::DVec2;
    use std::f64::consts::TAU;

    fn wavy(n: usize, amplitude: f64) -> Vec<DVec2> {
        let node = |i: usize| {
            let at = TAU * i as f64 / n as f64;
            DVec2::from_angle(at) * (1.0 + amplitude * (2.0 * at).cos())
        };
        (1..=n).map(node).collect()
    }

    /// The polygon after so many fixed steps in the geometric form, with the lengths on the way.
    fn stepped(nodes: &[DVec2], flow: &Flow, tau: f64, steps: usize) -> (State<f64>, Vec<f64>) {
        let p = Parameters { geometric: 1.0, ..Parameters::of_flow(flow, tau) };
        let mut state = State::from_nodes(nodes);
        let mut work = Workspace::new(Blocks::new(nodes.len()).unwrap());
        let mut lengths = Vec::new();
        for _ in 0..steps {
            let State { curve, increments, .. } = &mut state;
            Steps::step(curve, increments, &p, &Method::coloured(Solver::Direct, 1), &mut work);
            std::mem::swap(curve, &mut work.new);
            lengths.push((0..nodes.len()).map(|i| edge(curve.nodes(), i)[2]).sum());
        }
        (state, lengths)
    }

    #[test]
    fn a_regular_polygon_rests_in_the_geometric_form() {
        for n in [6, 35, 100] {
            let start = wavy(n, 0.0);
            let (state, _) = stepped(&start, &Flow::SurfaceDiffusion, 1e-2, 20);
            let moved = state.curve.positions().zip(&start).map(|(now, then)| now.distance(*then)).fold(0.0, f64::max);
            assert!(moved < 1e-10, "{n}: {moved:e}");
        }
    }

    #[test]
    fn the_length_falls_in_every_step_of_the_geometric_form() {
        let (_, lengths) = stepped(&wavy(60, 0.2), &Flow::SurfaceDiffusion, 1e-3, 100);
        assert!(lengths.windows(2).all(|pair| pair[1] < pair[0]), "{lengths:?}");
    }

    #[test]
    fn a_mode_decays_at_its_rate_with_order_two_in_the_geometric_form() {
        let error = |n: usize| {
            let (amplitude, tau, steps) = (1e-4, 1e-5, 1000);
            let (state, _) = stepped(&wavy(n, amplitude), &Flow::SurfaceDiffusion, tau, steps);
            let sum: f64 = (1..=n)
                .zip(state.curve.positions())
                .map(|(i, node)| node.length() * (2.0 * TAU * i as f64 / n as f64).cos())
                .sum();
            let rate = (amplitude / (2.0 * sum / n as f64)).ln() / (tau * steps as f64);
            rate / 12.0 - 1.0
        };
        let order = (error(20) / error(40)).log2();
        assert!((1.8..2.2).contains(&order), "{order}: {:e} {:e}", error(20), error(40));
    }
}
