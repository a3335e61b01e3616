//! The distance of a curve from equilibrium, its excess: the quotient of length, or surface energy, and area above that
//! of the polygon at rest. Twin of `shaders/excess.wgsl`.
//!
//! Both are near 1, and their difference is as small as the curve is near rest. In f32 a curve is therefore compared
//! node by node, with a [`Regular`] polygon, or if it is a crystal's edge by edge, with one [at rest](AT_REST).

use glam::DVec2;

use super::{Curve, Parameters, forces, law::Kind, state::edge};
use crate::{
    flow::QUOTIENT,
    forcing::KEPT_LENGTH,
    number::{Mask, Number},
    solver::{self, Blocks, Ring},
};

/// Terms of the series of a root of unity after the first, enough for f32.
pub const ROOT_TERMS: u32 = 5;

/// The place of what f32 compares the edges of a crystal with: the energy of an edge of the Wulff shape of the area at
/// the start, twice its share of that area, and by how much their quotient exceeds the least one, as a share of it.
///
/// The sums are then of differences, which rounding harms less than the energy and the area themselves.
pub const AT_REST: usize = KEPT_LENGTH + 1;

/// Whether the excess of a curve under this law, and its derivatives, are computed by the [`Regular`] polygon next to
/// it: no differences of numbers near 1, whose rounding would be more than they are.
pub fn is_by_polygon<N: Number>(kind: Kind) -> bool {
    N::IS_SHORT && !kind.is_crystal()
}

/// By how much `Σ γ |e_i|` of a crystal exceeds that [at rest](AT_REST).
#[inline(always)]
pub(super) fn dearer<N: Number>(curve: &Curve<N>, p: &Parameters<N>, kind: Kind, blocks: Blocks) -> N {
    if !kind.is_crystal() {
        return N::of(0.0);
    }
    let law = p.law(kind);
    let mut sum = solver::Sums::new(blocks);
    for i in 0..curve.len() {
        let edge = edge(curve.nodes(), i);
        let [gamma, ..] = law.tension(forces::tangent_of(edge));
        sum.add(i, [gamma * edge[2] - p.law[AT_REST]]);
    }
    let [dearer] = sum.totals();
    dearer
}

/// Coordinates of the nodes i-1 and i: both x, then both y.
#[inline(always)]
pub(super) fn corner<N: Number>([x, y]: [&Ring<N>; 2], i: usize) -> [N; 4] {
    let ([_, xm, x, ..], [_, ym, y, ..]) = (x.window(i), y.window(i));
    [xm, x, ym, y].map(N::coordinate)
}

/// `x_{i-1} × x_i`.
#[inline(always)]
pub fn cross<N: Number>(nodes: [&Ring<N>; 2], i: usize) -> N {
    let [xm, x, ym, y] = corner(nodes, i);
    if N::IS_SHORT {
        let [[_, ex, ..], [_, ey, ..]] = nodes.map(|ring| ring.rises_of_places(i));
        return xm * ey - ex * ym;
    }
    xm * y - x * ym
}

/// `E²/(4|W||A|)`, with the length as E for γ = 1: least at equilibrium.
#[inline(always)]
pub(super) fn quotient<N: Number>(tension: N, area: N, p: &Parameters<N>) -> N {
    tension * tension / (p.law[QUOTIENT] * area.abs())
}

/// The regular polygon next to a curve in f32, with which it is compared node by node: the length and the area of a
/// curve that is nearly a circle say nothing of its excess once they are rounded.
///
/// Its nodes are `c + G ωⁱ`, with ω = exp(2πi/n), the mean c of the nodes and `G = Σ x_j ω^{-j}/n`. So what is of first
/// order in the differences from it cancels, in length and in area: with its unit tangents T, edges E and the
/// differences `d_i = x_i - c - G ωⁱ` the length exceeds its own by `Σ |e_i| - T_i·e_i`, the area by `½ Σ d_{i-1} ×
/// d_i`, whatever the curve. Both are of second order, and rounding is a share of them.
#[derive(Clone, Copy, Debug)]
pub struct Regular<N> {
    nodes: N,
    /// c.
    centre: [N; 2],
    /// G.
    radius: [N; 2],
    /// The factor of ωⁱ in `T_i`.
    tangent: [N; 2],
    /// |E|; 0 in f64.
    edge: N,
    /// Area; of a crystal that [at rest](AT_REST).
    area: N,
}

impl<N: Number> Regular<N> {
    /// The polygon next to `curve`.
    #[inline(always)]
    pub(super) fn near(curve: &Curve<N>, p: &Parameters<N>, kind: Kind, blocks: Blocks) -> Regular<N> {
        let (n, zero) = (curve.len(), N::of(0.0));
        let nodes = N::of(n as f64);
        if !N::IS_SHORT {
            let none = [zero; 2];
            return Regular { nodes, centre: none, radius: none, tangent: none, edge: zero, area: zero };
        }
        let mut sums = solver::Sums::new(blocks);
        for i in 0..n {
            let ([x, y], [c, s]) = ([curve.x[i], curve.y[i]].map(N::coordinate), root(i, n));
            sums.add(i, [x, y, x * c + y * s, y * c - x * s]);
        }
        let [x, y, re, im] = sums.totals().map(|sum| sum / nodes);
        let [cosine, sine] = half_angle(n).map(N::of);
        let size = (re * re + im * im).sqrt();
        let none = size.le(zero);
        let inverse = N::select(none, zero, size.recip());
        let [tx, ty] = [N::select(none, N::of(1.0), re * inverse), im * inverse];
        Regular {
            nodes,
            centre: [x, y],
            radius: [re, im],
            tangent: [tx * sine - ty * cosine, tx * cosine + ty * sine],
            edge: (sine + sine) * size,
            area: nodes
                * if kind.is_crystal() { N::of(0.5) * p.law[AT_REST + 1] } else { (sine * cosine) * (size * size) },
        }
    }

    /// [`changes`] of the curve in units of a length that grows as the polygon would, relative to which it neither
    /// grows nor shrinks: what is of first order cancels here, too, and the quotient has no unit.
    #[inline(always)]
    pub(super) fn changes(&self, curve: &Curve<N>, slope: &Curve<N>, bend: &Curve<N>, blocks: Blocks) -> [N; 4] {
        let n = curve.len();
        let mut sums = solver::Sums::new(blocks);
        for i in 0..n {
            let [px, py] = turned(self.radius, root(i, n));
            sums.add(i, [slope.x[i] * px + slope.y[i] * py, bend.x[i] * px + bend.y[i] * py]);
        }
        let [re, im] = self.radius;
        let growth = sums.totals().map(|sum| sum / (self.nodes * (re * re + im * im)));
        let mut sums = solver::Sums::new(blocks);
        for i in 0..n {
            let ([_, ex, ..], [_, ey, ..]) = (curve.x.rises_of_places(i), curve.y.rises_of_places(i));
            let [fx, fy] = [relative(ex, slope.x.rises(i)[1], growth), relative(ey, slope.y.rises(i)[1], growth)];
            let gx = relative_bend(ex, fx, bend.x.rises(i)[1], growth);
            let gy = relative_bend(ey, fy, bend.y.rises(i)[1], growth);
            let (x, y) = (N::coordinate(curve.x[i]) - self.centre[0], N::coordinate(curve.y[i]) - self.centre[1]);
            let [ux, uy] = [relative(x, slope.x[i], growth), relative(y, slope.y[i], growth)];
            let [sx, sy] = [relative_bend(x, ux, bend.x[i], growth), relative_bend(y, uy, bend.y[i], growth)];
            let root = root(i, n);
            let ([tx, ty], [px, py]) = (turned(self.tangent, root), turned(self.radius, root));
            let inverse = (ex * ex + ey * ey).sqrt().recip();
            // The unit vector along the edge, and by how much it differs from T.
            let (nx, ny) = (ex * inverse, ey * inverse);
            let ([cx, cy], [dx, dy]) = ([nx - tx, ny - ty], [x - px, y - py]);
            let (wx, wy) = (ex - self.edge * tx, ey - self.edge * ty);
            let across = nx * fy - ny * fx;
            let stretch = cx * fx + cy * fy;
            let bent = across * across * inverse + (cx * gx + cy * gy);
            let area = (dx * fy - dy * fx) + (ux * wy - uy * wx);
            let area_bend = (dx * gy - dy * gx) + (sx * wy - sy * wx) + N::of(2.0) * (ux * fy - uy * fx);
            sums.add(i, [stretch, bent, area, area_bend]);
        }
        sums.totals()
    }

    /// By how much the length of edge i exceeds its own part along T, and `d_{i-1} × d_i`, of a crystal by how much
    /// `(x_i - c) × e_i` exceeds that at rest; in f64 the length of the edge and `x_{i-1} × x_i`.
    #[inline(always)]
    pub(super) fn exceeded(&self, curve: &Curve<N>, i: usize, p: &Parameters<N>, kind: Kind) -> [N; 2] {
        let [ex, ey, e] = edge(curve.nodes(), i);
        if !N::IS_SHORT {
            return [e, cross(curve.nodes(), i)];
        }
        let root = root(i, curve.len());
        let [tx, ty] = turned(self.tangent, root);
        let (along, across) = (tx * ex + ty * ey, tx * ey - ty * ex);
        let longer = N::select(along.le(N::of(0.0)), e - along, across * across / (e + along));
        let x = N::coordinate(curve.x[i]) - self.centre[0];
        let y = N::coordinate(curve.y[i]) - self.centre[1];
        if kind.is_crystal() {
            return [longer, (x * ey - y * ex) - p.law[AT_REST + 1]];
        }
        let [px, py] = turned(self.radius, root);
        let (dx, dy) = (x - px, y - py);
        [longer, dx * (ey - self.edge * ty) - dy * (ex - self.edge * tx)]
    }

    /// Length and area, by the sums of that.
    #[inline(always)]
    pub(super) fn sizes(&self, [longer, more]: [N; 2]) -> [N; 2] {
        [self.nodes * self.edge + longer, self.area + N::of(0.5) * more]
    }

    /// `Σ γ |e_i|`, for γ = 1 the length.
    #[inline(always)]
    pub(super) fn tension(&self, length: N, dearer: N, p: &Parameters<N>, kind: Kind) -> N {
        if kind.is_crystal() { self.nodes * p.law[AT_REST] + dearer } else { length }
    }

    /// The distance from equilibrium: the quotient minus that of the polygon at equilibrium.
    #[inline(always)]
    pub(super) fn excess(
        &self,
        [longer, more, dearer]: [N; 3],
        [tension, area]: [N; 2],
        p: &Parameters<N>,
        kind: Kind,
    ) -> N {
        let plain = quotient(tension, area, p) - p.polygon_ratio;
        if !N::IS_SHORT {
            return plain;
        }
        if kind.is_crystal() {
            let energy_at_rest = self.nodes * p.law[AT_REST];
            let known = area.le(N::of(0.0)).or(energy_at_rest.le(N::of(0.0))).not();
            let energy = dearer / energy_at_rest;
            let wider = N::of(0.5) * more / self.area;
            let over = (p.law[AT_REST + 2] + energy * (N::of(2.0) + energy)) - wider;
            return N::select(known, p.polygon_ratio * over / (N::of(1.0) + wider), plain);
        }
        let (own, unit) = (self.nodes * self.edge, p.law[QUOTIENT]);
        let over = longer * (own + own + longer) - p.polygon_ratio * unit * (N::of(0.5) * more);
        // Of a curve that runs clockwise the area counts by its size.
        N::select(area.le(N::of(0.0)), plain, over / (unit * area))
    }
}

impl Parameters<f64> {
    /// Sets what f32 compares a member that starts at `nodes` with: the mean length of its edges, and what a crystal's
    /// are [at rest](AT_REST).
    pub fn compare_with(&mut self, nodes: &[DVec2]) {
        let (n, edges) = (nodes.len() as f64, nodes.iter().zip(nodes.iter().cycle().skip(1)));
        let short = |number: f64| f64::from(number as f32);
        self.r_offset = short(edges.clone().map(|(from, to)| from.distance(*to)).sum::<f64>() / n);
        if !self.kind_of_law().is_crystal() {
            return;
        }
        let area = 0.5 * edges.map(|(from, to)| from.perp_dot(*to)).sum::<f64>().abs();
        let energy = (self.polygon_ratio * self.law[QUOTIENT] * area).sqrt();
        let [energy, area] = [short(energy / n), short(2.0 * area / n)];
        let quotient = quotient(n * energy, 0.5 * n * area, self);
        [self.law[AT_REST], self.law[AT_REST + 1]] = [energy, area];
        self.law[AT_REST + 2] = quotient / self.polygon_ratio - 1.0;
    }
}

/// The first derivative of a place or an edge in units of a length that grows at these two derivatives.
#[inline(always)]
fn relative<N: Number>(at: N, slope: N, [growth, _]: [N; 2]) -> N {
    slope - growth * at
}

/// The second, by the first.
#[inline(always)]
fn relative_bend<N: Number>(at: N, slope: N, bend: N, [growth, growth_bend]: [N; 2]) -> N {
    bend - growth_bend * at - N::of(2.0) * growth * slope
}

/// The cosine and the sine of π/n.
pub fn half_angle(n: usize) -> [f64; 2] {
    let angle = std::f64::consts::PI / n as f64;
    [angle.cos(), angle.sin()]
}

/// `z w` of complex numbers.
#[inline(always)]
fn turned<N: Number>([x, y]: [N; 2], [c, s]: [N; 2]) -> [N; 2] {
    [x * c - y * s, x * s + y * c]
}

/// ωⁱ, an n-th root of unity, for 0 ≤ i < n: by the nearest quarter of a turn, which is at most π/4 away.
#[inline(always)]
fn root<N: Number>(i: usize, n: usize) -> [N; 2] {
    let quarter = (8 * i + n) / (2 * n);
    let past = (4 * i) as f64 - (quarter * n) as f64;
    let angle = std::f64::consts::FRAC_PI_2 / n as f64 * past;
    let square = angle * angle;
    let (mut sine, mut cosine) = (1.0, 1.0);
    for factor in (1..=ROOT_TERMS).rev().map(|term| f64::from(2 * term)) {
        sine = 1.0 - square / (factor * (factor + 1.0)) * sine;
        cosine = 1.0 - square / (factor * (factor - 1.0)) * cosine;
    }
    let sine = angle * sine;
    let at = match quarter % 4 {
        0 => [cosine, sine],
        1 => [-sine, cosine],
        2 => [-cosine, -sine],
        _ => [sine, -cosine],
    };
    at.map(N::of)
}
