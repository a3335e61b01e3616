//! Sums and maxima of a curve, which determine its report, status and events. Twin of
//! `shaders/observe.wgsl`.
//!
//! Length, area and turning number are those of the polygon x; the energy uses the scheme's k and r. Of a crystal,
//! energy and excess are those of the polygon, by the directions of its edges.

use super::{
    Curve, Parameters,
    dense::LOOKS,
    excess::{Regular, corner, dearer, is_by_polygon, quotient},
    law::{Kind, Law},
    member::Observed,
    pull,
    state::edge,
};
use crate::{
    number::{BIG, Mask, Number, Real},
    solver::{self, Blocks},
};

/// `|k|·r` at which a curve counts as unresolved: its tangent turns by 2 rad from segment to segment.
pub const MAX_TURN: f64 = 2.0;
/// Ratio of the shortest edge to the mean below which an edge counts as vanished.
pub const MIN_EDGE: f64 = 1e-5;
/// Metric drift above which the scheme's lengths say nothing about the polygon: if steps are far too large, k and r
/// lose x, and the polygon shrinks to a point that would look round.
pub const MAX_DRIFT: f64 = 1.0;
/// Gap between k and the polygon's turn, in rad, above which no member counts as relaxed: the curvature, which moves
/// the member, is not that of the polygon, which looks round.
pub const MAX_GAP: f64 = 0.5;
/// Excess at the end of an adaptive step, as a multiple of a threshold, above which nobody looks for a dip below the
/// threshold inside the step.
pub const NEAR: f64 = 4.0;

/// The sums, the first four in the order of the kernel's `vec4`.
#[derive(Clone, Copy, Debug)]
pub struct CurveSums<N> {
    /// `Σ |e_i|`.
    pub length: N,
    /// `½ Σ x_{i-1} × x_i`.
    pub area: N,
    /// `Σ (½k_i² + λ) r_i`; of a crystal `Σ γ |e_i|`, in the same unit; where the area or the length is kept, that of
    /// the polygon.
    pub energy: N,
    /// Windings of the edge vector round the origin.
    pub turning: N,
    /// `Σ γ |e_i|`, the length for γ = 1.
    pub tension: N,
    /// Distance from equilibrium.
    pub excess: N,
}

/// What every step is judged by: the decisive part of the sums and maxima, without a division.
#[derive(Clone, Copy, Debug)]
pub struct Glance<N> {
    /// `Σ |e_i|`.
    pub length: N,
    /// `Σ γ |e_i|`, the length for γ = 1.
    pub tension: N,
    /// `½ Σ x_{i-1} × x_i`.
    pub area: N,
    /// Distance from equilibrium.
    pub excess: N,
    /// Windings of the edge vector round the origin.
    pub turning: N,
    /// `max |k_i| r_i`; a value that is not finite shows as more than [`BIG`].
    pub turn: N,
    /// `max (|r_i - |e_i|| - MAX_DRIFT·|e_i|)`, positive where the metric drift is above [`MAX_DRIFT`].
    pub slack: N,
    /// Minus the shortest edge.
    pub minus_shortest: N,
    /// Minus the smallest curvature.
    pub minus_k_min: N,
    /// Largest displacement of a node from the old curve.
    pub farthest: N,
    /// The regular polygon next to the curve.
    pub regular: Regular<N>,
}

/// Examines the curve that a step made from `old`.
#[inline(always)]
pub fn glance<N: Number>(old: &Curve<N>, new: &Curve<N>, p: &Parameters<N>, kind: Kind, blocks: Blocks) -> Glance<N> {
    let low = N::of(-2.0 * BIG);
    let (mut turn, mut slack, mut minus_shortest, mut minus_k_min, mut farthest) = (low, low, low, low, N::of(0.0));
    let mut sums = solver::Sums::new(blocks);
    let regular = Regular::near(new, p, kind, blocks);
    for i in 0..new.len() {
        let (k, r, e) = (new.k[i], p.length_of(new.r[i]), edge(new.nodes(), i)[2]);
        turn = turn.max((k * r).bounded_abs());
        slack = slack.max((r - e).bounded_abs() - N::of(MAX_DRIFT) * e);
        minus_shortest = minus_shortest.max(-e.bounded_abs());
        minus_k_min = minus_k_min.max(-k);
        let (dx, dy) = (N::apart(old.x[i], new.x[i]), N::apart(old.y[i], new.y[i]));
        farthest = farthest.max((dx * dx + dy * dy).bounded_abs());
        let [longer, more] = regular.exceeded(new, i, p, kind);
        sums.add(i, [longer, more, winding(new, i)]);
    }
    let [longer, more, turning] = sums.totals();
    let [length, area] = regular.sizes([longer, more]);
    let dearer = dearer(new, p, kind, blocks);
    let tension = regular.tension(length, dearer, p, kind);
    let excess = regular.excess([longer, more, dearer], [tension, area], p, kind);
    let farthest = farthest.sqrt();
    Glance { length, tension, area, excess, turning, turn, slack, minus_shortest, minus_k_min, farthest, regular }
}

impl<N: Number> Glance<N> {
    /// Returns whether the sums and the curvature are finite.
    #[inline(always)]
    pub fn is_finite(&self) -> N::Mask {
        let big = N::of(BIG);
        self.length.le(big).and(self.area.abs().le(big)).and(self.turn.le(big))
    }

    /// Returns whether the curve has become singular: it is unresolved, an edge has vanished, its lengths mean nothing,
    /// it has shrunk, or its turning number is no longer `turning`.
    #[inline(always)]
    pub fn is_singular(&self, turning: N, p: &Parameters<N>, n: usize) -> N::Mask {
        let mean_edge = self.length / N::of(n as f64);
        let resolved = self.turn.le(N::of(MAX_TURN));
        let apart = (N::of(MIN_EDGE) * mean_edge).le(-self.minus_shortest);
        let measured = self.slack.le(N::of(0.0));
        let extended = p.least_length.le(self.length);
        let winds = self.turning.le(turning).and(turning.le(self.turning));
        resolved.and(apart).and(measured).and(extended).and(winds).not()
    }
}

/// Computes the sums over the ring.
#[inline(always)]
pub fn sums<N: Number>(curve: &Curve<N>, p: &Parameters<N>, kind: Kind, blocks: Blocks) -> CurveSums<N> {
    let mut sums = solver::Sums::new(blocks);
    let regular = Regular::near(curve, p, kind, blocks);
    for i in 0..curve.len() {
        let k = curve.k[i];
        let energy = match kind.conserved {
            0 => p.energy_density(k) * p.length_of(curve.r[i]),
            _ => p.energy_at_vertex(edge(curve.nodes(), i), edge(curve.nodes(), (i + 1) % curve.len())),
        };
        let [longer, more] = regular.exceeded(curve, i, p, kind);
        sums.add(i, [longer, more, energy, winding(curve, i)]);
    }
    let [longer, more, energy, turning] = sums.totals();
    let [length, area] = regular.sizes([longer, more]);
    let dearer = dearer(curve, p, kind, blocks);
    let tension = regular.tension(length, dearer, p, kind);
    let energy = if kind.is_crystal() { p.law(kind).unit * tension } else { energy };
    let excess = regular.excess([longer, more, dearer], [tension, area], p, kind);
    CurveSums { length, area, energy, turning, tension, excess }
}

/// The first and the second derivative of ln excess along a step, by those of the nodes of the curve at its end.
///
/// With length L, area A and Q = L²/(4π|A|), (ln Q)' is 2L'/L - A'/A. Of a crystal, `γ|e|` stands for the length of an
/// edge.
#[inline(always)]
pub fn decline<N: Number>(
    curve: &Curve<N>,
    slope: &Curve<N>,
    bend: &Curve<N>,
    seen: &Glance<N>,
    p: &Parameters<N>,
    kind: Kind,
    blocks: Blocks,
) -> [N; 2] {
    let [stretch, bent, area_slope, area_bend] = if is_by_polygon::<N>(kind) {
        seen.regular.changes(curve, slope, bend, blocks)
    } else {
        changes(curve, slope, bend, &p.law(kind), blocks)
    };
    let (two, half) = (N::of(2.0), N::of(0.5));
    let (growth, widening) = (stretch / seen.tension, half * area_slope / seen.area);
    let slope = two * growth - widening;
    let bend = two * (bent / seen.tension - growth * growth) - (half * area_bend / seen.area - widening * widening);
    let over = quotient(seen.tension, seen.area, p) / seen.excess;
    let first = over * slope;
    [first, over * (bend + slope * slope) - first * first]
}

/// L', L'', 2A' and 2A''.
#[inline(always)]
fn changes<N: Number>(curve: &Curve<N>, slope: &Curve<N>, bend: &Curve<N>, law: &Law<N>, blocks: Blocks) -> [N; 4] {
    let mut sums = solver::Sums::new(blocks);
    for i in 0..curve.len() {
        let [xm, x, ym, y] = corner(curve.nodes(), i);
        let ([_, um, u, ..], [_, vm, v, ..]) = (slope.x.window(i), slope.y.window(i));
        let ([_, sm, s, ..], [_, tm, t, ..]) = (bend.x.window(i), bend.y.window(i));
        let ([_, ex, ..], [_, ey, ..]) = (curve.x.rises_of_places(i), curve.y.rises_of_places(i));
        let ([_, fx, ..], [_, fy, ..]) = (slope.x.rises(i), slope.y.rises(i));
        let ([_, gx, ..], [_, gy, ..]) = (bend.x.rises(i), bend.y.rises(i));
        let inverse = (ex * ex + ey * ey).sqrt().recip();
        let (stretch, bent) = if law.kind.is_crystal() {
            let [tx, ty] = [ex * inverse, ey * inverse];
            let [gamma, turned, stiffness] = law.tension([tx, ty]);
            let across = tx * fy - ty * fx;
            let stretch = gamma * (tx * fx + ty * fy) + turned * across;
            let pulled = gamma * (tx * gx + ty * gy) + turned * (tx * gy - ty * gx);
            (stretch, stiffness * (across * across) * inverse + pulled)
        } else {
            let stretch = (ex * fx + ey * fy) * inverse;
            (stretch, (fx * fx + fy * fy + (ex * gx + ey * gy) - stretch * stretch) * inverse)
        };
        let area = (um * y - u * ym) + (xm * v - x * vm);
        let area_bend = (sm * y - s * ym) + (xm * t - x * tm) + N::of(2.0) * (um * v - u * vm);
        sums.add(i, [stretch, bent, area, area_bend]);
    }
    sums.totals()
}

/// The largest difference between the angle by which the curvature turns the tangent over a segment, from middle to
/// middle of its neighbours, and the angle by which the polygon turns there.
#[inline(always)]
pub fn gap<N: Number>(curve: &Curve<N>) -> N {
    let mut gap = N::of(0.0);
    for i in 0..curve.len() {
        let [angle, span] = pull::turn(curve, i);
        gap = gap.max((curve.k[i] * span - angle).bounded_abs());
    }
    gap
}

/// +1 (-1) if the edge vector turns from `e_i` to `e_{i+1}` across the positive x axis, the short way round.
#[inline(always)]
fn winding<N: Number>(curve: &Curve<N>, i: usize) -> N {
    let ([_, ex, fx, _], [_, ey, fy, _]) = (curve.x.rises_of_places(i), curve.y.rises_of_places(i));
    let (zero, one) = (N::of(0.0), N::of(1.0));
    let side = ex * fy - fx * ey;
    // +1 upwards across the axis, which counts with the origin on the left; -1 downwards, with it on the right.
    let across = N::select(fy.le(zero), zero, one) - N::select(ey.le(zero), zero, one);
    N::select((across * side).le(zero), zero, across)
}

/// Observes a curve.
#[inline(never)]
pub fn observe<T: Real>(curve: &Curve<T>, p: &Parameters<T>, blocks: Blocks) -> Observed<T> {
    observed(&sums(curve, p, p.kind_of_law(), blocks), curve, p)
}

/// The observables of a curve with these sums. A value that is not finite shows as more than [`BIG`].
#[inline(always)]
pub fn observed<N: Number>(sums: &CurveSums<N>, curve: &Curve<N>, p: &Parameters<N>) -> Observed<N> {
    let low = N::of(-2.0 * BIG);
    let (mut drift, mut longest, mut minus_shortest, mut k_max, mut minus_k_min) = (low, low, low, low, low);
    for i in 0..curve.x.len() {
        let (k, r, e) = (curve.k[i], p.length_of(curve.r[i]), edge(curve.nodes(), i)[2]);
        drift = drift.max(((r - e) / e).bounded_abs());
        longest = longest.max(e.bounded_abs());
        minus_shortest = minus_shortest.max(-e.bounded_abs());
        k_max = k_max.max(k);
        minus_k_min = minus_k_min.max(-k);
    }
    Observed {
        length: sums.length,
        area: sums.area,
        excess: sums.excess,
        energy: sums.energy,
        k_min: -minus_k_min,
        k_max,
        mesh_ratio: longest / -minus_shortest,
        metric_drift: drift,
    }
}

/// Whether an observable has reached a level at which the member pauses.
#[inline(always)]
pub fn reaches_level<N: Number>(at: &Observed<N>, p: &Parameters<N>) -> N::Mask {
    let fell = at.length.le(p.low.length).or(at.area.le(p.low.area)).or(at.excess.le(p.low.excess));
    let fell = fell.or(at.energy.le(p.low.energy)).or(at.k_min.le(p.low.k_min)).or(at.k_max.le(p.low.k_max));
    let fell = fell.or(at.mesh_ratio.le(p.low.mesh_ratio)).or(at.metric_drift.le(p.low.metric_drift));
    let rose = p.high.length.le(at.length).or(p.high.area.le(at.area)).or(p.high.excess.le(at.excess));
    let rose = rose.or(p.high.energy.le(at.energy)).or(p.high.k_min.le(at.k_min)).or(p.high.k_max.le(at.k_max));
    fell.or(rose).or(p.high.mesh_ratio.le(at.mesh_ratio)).or(p.high.metric_drift.le(at.metric_drift))
}

/// Whether a value above `level` at both ends of a step may have reached it inside, by the values at the start, at the
/// two [`LOOKS`] and at the end: if it is there at a look, or if the lines through the first two and through the last
/// two values meet at or below it. A value that turns once does not fall below those lines.
#[inline(always)]
pub fn falls_inside<N: Number>([start, early, late, end]: [N; 4], level: N) -> N::Mask {
    let (zero, between) = (N::of(0.0), N::of((LOOKS[1] - LOOKS[0]) / LOOKS[0]));
    let (fall, rise) = (start - early, end - late);
    let (early, late) = (early - level, late - level);
    let there = early.le(zero).or(late.le(zero));
    let turns = fall.le(zero).or(rise.le(zero)).not();
    there.or(turns.and((early * rise + late * fall).le(between * (fall * rise))))
}

/// Whether an observable may have reached a level inside a step and left it again, by the observables at the start, at
/// the two [`LOOKS`] and at the end. Where the host looks closely, it may turn out that none has.
#[inline(always)]
pub fn passes_level<N: Number>(at: &[Observed<N>; 4], p: &Parameters<N>) -> N::Mask {
    let passes = |of: fn(&Observed<N>) -> N| {
        let values = at.each_ref().map(of);
        falls_inside(values, of(&p.low)).or(falls_inside(values.map(|value| -value), -of(&p.high)))
    };
    let length = passes(|at| at.length);
    let area = passes(|at| at.area);
    let excess = passes(|at| at.excess);
    let energy = passes(|at| at.energy);
    let k_min = passes(|at| at.k_min);
    let k_max = passes(|at| at.k_max);
    let mesh_ratio = passes(|at| at.mesh_ratio);
    let metric_drift = passes(|at| at.metric_drift);
    length.or(area).or(excess).or(energy).or(k_min).or(k_max).or(mesh_ratio).or(metric_drift)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The observables at both ends of a step and at the looks, all of which are `value`.
    fn seen(value: impl Fn(f64) -> f64) -> [Observed<f64>; 4] {
        let all = |at: f64| Observed::from_numbers(&[value(at); Observed::<f64>::FIELDS.len()]);
        [0.0, LOOKS[0], LOOKS[1], 1.0].map(all)
    }

    #[test]
    fn a_level_that_a_value_reaches_inside_a_step_and_leaves_again_is_not_passed_over() {
        let fields = Observed::<f64>::FIELDS.len();
        for field in 0..fields {
            let passes = |value: &dyn Fn(f64) -> f64, level: f64| {
                let (mut p, mut low, mut high) = (Parameters::default(), vec![-BIG; fields], vec![BIG; fields]);
                if level < 1.0 {
                    low[field] = level
                } else {
                    high[field] = level
                }
                (p.low, p.high) = (Observed::from_numbers(&low), Observed::from_numbers(&high));
                passes_level(&seen(value), &p)
            };
            for turn in [0.07, 0.2, 0.5, 0.9] {
                // An exponential that falls and one that rises: they meet in a place where the sum is 0.9 or 1.1.
                let sum = |x: f64| (-9.0 * x).exp() + (9.0 * (x - 2.0 * turn)).exp() - 2.0 * (-9.0 * turn).exp();
                let (dip, bump) = (|x: f64| 0.9 + sum(x), |x: f64| 1.1 - sum(x));
                assert!(passes(&dip, 0.901) && passes(&bump, 1.099), "{field} {turn}");
                // A level in the other direction.
                assert!(!passes(&|x| dip(x) - 1.0, 1.0 + dip(0.0) + dip(1.0)), "{field} {turn}");
            }
            let (falls, bends) = (|x: f64| 2.0 - x, |x: f64| 1.5 + 0.01 * (x - 0.5).powi(2));
            assert!(!passes(&falls, 0.5) && !passes(&bends, 0.5), "{field}");
        }
    }
}
