//! The limit of a time as the resolution grows without bound, and its error.
//!
//! With h = 1/n, t(n) = t + a h² + b h⁴ + c h⁶ + …, and three resolutions remove a and b. What is left goes with c,
//! which they do not show. Two things tell its size: the terms in h² and h⁴ at the finest resolution, and the factor ρ
//! by which terms fall. That is about the square of the angle by which the tangent turns at a node, θ: for a smooth
//! curve it goes with h, and where θ is not small, n nodes do not resolve the curve, whatever the differences of the
//! times say. A weak mode of many waves turns little and falls more slowly; its terms in h² and h⁴ show it. Early times
//! depend on the short waves that still live then: those of wave number k decay as exp(-k⁴t), so their phase turns by
//! about (L/n)/t^¼ at a node. And where the terms are not small beside the time itself, no more are those that follow.
//! ρ is therefore the largest of θ², that phase squared, the terms over the time, and a multiple of the ratio of the
//! two terms. From the term in h⁴ what is left is about `ρ·|term in h⁴|`, from that in h² it is `ρ²·|term in h²|`;
//! their sum cannot vanish by chance. A fourth resolution shows the term in h⁶ itself, by what it changes in the limit.
//!
//! The steps in time leave a part that goes with their tolerance, so a ninth of what ten times more exact steps change
//! is what these leave themselves. It is removed. What remains goes with that change, or with the tolerance over the
//! amplitude of the shape at that time, which is the root of its excess. The parts of space and of steps are
//! independent and add as squares. The constants were fitted to ensembles of curves and flows whose limits are known
//! from more nodes and steps (`docs/internals/method.md#limit`).

use serde::{Deserialize, Serialize};

/// Largest turn of the tangent at a node, in radians, at which terms are believed to fall.
pub const MAX_TURN: f64 = 0.5;
/// Orders between which differences must fall.
const ORDERS: std::ops::RangeInclusive<f64> = 1.7..=2.6;
/// Relative difference between resolutions below which they are as small as the errors of the steps, and have no order.
const SMALL: f64 = 5e-5;
/// The error of space in units of the estimate of the term in h⁶.
const OF_SPACE: f64 = 1.25;
/// The same where terms do not fall yet, with θ ≤ 1 in place of θ².
const OF_OPEN: f64 = 1.25;
/// Differences that are as small as so many errors of rounding have no order, either.
const OF_NOISE: f64 = 2.0;
/// The factor by which terms fall in units of that from the one in h² to the one in h⁴.
const OF_FALL: f64 = 1.5;
/// The same in units of (L/n)²/√t: the phase, squared, of the waves that have fallen by e⁻² at that time.
const OF_WAVES: f64 = std::f64::consts::SQRT_2;
/// How much larger it is for energy and area, on which short waves weigh more.
const OF_BENDING: f64 = 2.0;
/// Orders by which differences fall somehow where nodes are too few; and the error of what has no such order, in units
/// of the largest difference.
const LOOSE_ORDERS: std::ops::RangeInclusive<f64> = 1.0..=4.0;
const OF_DIFFERENCES: f64 = 1.5;
/// The same where the differences are of extremes over the nodes: the true extreme lies anywhere between two of these.
const OF_EXTREMES: f64 = 2.5;
/// By how much an error may fall from one level to the next, which has √2 times the nodes. Errors fall as h⁶, by 8;
/// those of levels that do not resolve the curve are bounds, and fall faster. Where terms do not fall yet, as h⁴.
const FALL: f64 = 32.0;
const OPEN_FALL: f64 = 4.0;
/// With a fourth level the limit of the three below the finest is known, too. Its error is 8 times as large, so the two
/// limits differ by 7 times the error of the finer: of their difference this is a part. The rest is a share of the
/// error by three levels, since limits may agree by chance.
const OF_CHANGE: f64 = 0.25;
const OF_THREE: f64 = 0.25;
/// How much more exact the steps of the levels are than those of the member.
pub const FINER_STEPS: f64 = 10.0;
/// The error of steps as a share of what these change, for times at which an excess is reached.
pub const SHARE_OF_STEPS: f64 = 0.15;
/// The same in units of their tolerance over the root of the excess, relative to the time, since the change may be
/// small by chance.
const OF_TOLERANCE: f64 = 0.0045;
/// Orders that are looked for.
const ALL_ORDERS: std::ops::Range<f64> = 0.05..8.0;
/// Halvings of that range: to the last bit.
const HALVINGS: usize = 60;

/// Relative error above which a time that is not asymptotic is worth more nodes.
const WIDE: f64 = 1e-3;
/// Turn of the tangent at a node above which no bound is believed, and above [`MAX_TURN`] none without an order: three
/// times may agree by chance.
const BLIND_TURN: f64 = 0.7;

/// What reaches a value at a time, which decides how the errors of that time fall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimeOf {
    /// The curve is relaxed, or vanishes.
    #[default]
    End,
    /// Length or excess, on the way.
    Shape,
    /// Energy or area, whose rates go with powers of the curvature.
    Bending,
    /// The largest or smallest of the values at the nodes. Its errors do not fall as a power of h.
    Extreme,
}

/// What disturbs the terms of a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Terms {
    /// Nothing: of these, more levels tell more.
    #[default]
    Plain,
    /// Waves of γ or M, or a length that is kept.
    Waves,
    /// A curve through points, whose third derivative jumps there: no term but the first is regular.
    Points,
}

/// One time, computed at several resolutions.
#[derive(Clone, Debug, PartialEq)]
pub struct Times {
    /// Of what.
    pub of: TimeOf,
    /// As it is to be judged.
    pub own: f64,
    /// With more exact steps, at growing numbers of nodes, at least three.
    pub levels: Vec<f64>,
    /// These numbers.
    pub points: Vec<usize>,
    /// By how much rounding moves each, relative to it; nothing in double precision.
    pub rounding: Vec<f64>,
    /// Which of them is that of `own`.
    pub own_level: usize,
    /// Tolerance of these steps.
    pub tolerance: f64,
    /// The error of the steps, as a share of by how much those of `own` change it, if these are adaptive, with a
    /// tolerance [`FINER_STEPS`] times as large.
    pub share_of_steps: Option<f64>,
    /// Largest angle by which the tangent of the initial curve turns at a node of the finest level, in radians.
    pub turn: f64,
    /// Length of the initial curve, in the unit whose fourth power is that of the times.
    pub length: f64,
    /// The excess at that time, or a smaller one.
    pub excess: f64,
    /// What disturbs its terms.
    pub terms: Terms,
}

/// What the time tends to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// The limit, in the unit of the times.
    pub t: f64,
    /// Half-width of its 95 % interval.
    pub error: f64,
    /// The part of it that no nodes or steps lessen, such as rounding.
    pub fixed: f64,
    /// Observed order in 1/n, if the differences have one.
    pub order: Option<f64>,
    /// Whether the nodes resolve the curve and the differences fall as they should; if not, the term in h² alone is
    /// removed, and the error is a bound.
    pub asymptotic: bool,
    /// Relative error of the time that is judged, with its sign.
    pub relative: f64,
}

impl Limit {
    /// Estimates the limit from the three finest levels; those below them must not have promised less.
    ///
    /// ```
    /// use curvelax_statistics::{Limit, SHARE_OF_STEPS, Terms, TimeOf, Times};
    ///
    /// let points = [50, 71, 100];
    /// let levels = points.map(|n| 0.8 + 40.0 / f64::from(n).powi(2)).to_vec();
    /// let (points, rounding) = (points.map(|n| n as usize).to_vec(), vec![0.0; 3]);
    /// let (own, own_level, tolerance, share_of_steps) = (0.804, 2, 1e-4, Some(SHARE_OF_STEPS));
    /// let (of, turn, length, excess, terms) = (TimeOf::End, 0.2, 6.3, 2e-3, Terms::Plain);
    /// let limit = Limit::of(&Times {
    ///     of, own, levels, points, rounding, own_level, tolerance, share_of_steps, turn, length, excess, terms,
    /// });
    /// assert!((limit.t - 0.8).abs() < 1e-12 && limit.error < 1e-3 && limit.asymptotic);
    /// assert!((limit.order.unwrap() - 2.0).abs() < 1e-9 && (limit.relative - 0.005).abs() < 1e-12);
    /// ```
    ///
    /// # Panics
    /// With fewer than three levels.
    pub fn of(times: &Times) -> Limit {
        let Times { levels, points, rounding, .. } = times;
        let &Times { of, own, tolerance, share_of_steps, terms, .. } = times;
        let finest = points[points.len() - 1];
        let of_three = |from: usize| {
            let at = [0, 1, 2].map(|i| from + i);
            let (points, rounding) = (at.map(|i| points[i]), at.map(|i| rounding[i] * levels[i]));
            let (turn, spacing) = (times.turn * finest as f64 / points[2] as f64, times.length / points[2] as f64);
            OfSpace::of(at.map(|i| levels[i]), points, rounding, Nodes { of, terms, turn, spacing })
        };
        let of_space: Vec<OfSpace> = (0..levels.len() - 2).rev().map(of_three).collect();
        let OfSpace { t, three, error, rounding, order, asymptotic } = of_space[0];
        let fall = if asymptotic { FALL } else { OPEN_FALL };
        // What is small at the finest levels alone may be so by chance.
        let scales = std::iter::successors(Some(1.0 / fall), |scale| Some(scale / fall));
        let promised = of_space[1..].iter().zip(scales).map(|(coarser, scale)| scale * coarser.error);
        let error = promised.fold(error, f64::max);
        let error = match of_space.get(1) {
            Some(coarser) if asymptotic && terms == Terms::Plain && of == TimeOf::End => {
                error.min(OF_CHANGE * (three - coarser.three).abs() + OF_THREE * error)
            }
            _ => error,
        };
        let full = levels[levels.len() - 1];
        let change = if share_of_steps.is_some() { own - levels[times.own_level] } else { 0.0 };
        let t = t - change / (FINER_STEPS - 1.0);
        let of_steps = share_of_steps.unwrap_or(0.0) * change;
        let error = error.hypot(of_steps).hypot(OF_TOLERANCE * tolerance * full / times.excess.sqrt()).hypot(rounding);
        Limit { t, error, fixed: rounding, order, asymptotic, relative: own / t - 1.0 }
    }

    /// The limit of what holds at the start, time 0, with any number of nodes. It is exact.
    pub const AT_START: Limit = Limit { t: 0.0, error: 0.0, fixed: 0.0, order: None, asymptotic: true, relative: 0.0 };

    /// Whether its differences do not fall as they should, and it is not known to a thousandth.
    pub fn is_open(&self) -> bool {
        !self.asymptotic && self.error - self.fixed > WIDE * self.t
    }

    /// Whether the time is worth levels of more nodes, where the tangent of the curve turns by `turn` at a node of the
    /// finest: it is [open](Limit::is_open), or its bound is not to be believed.
    pub fn needs_more(&self, turn: f64) -> bool {
        let falls = self.order.is_some_and(|order| LOOSE_ORDERS.contains(&order));
        let is_believed = turn <= MAX_TURN || turn <= BLIND_TURN && falls;
        self.is_open() || !self.asymptotic && !is_believed
    }

    /// Its half-width relative to the limit.
    pub fn relative_error(&self) -> f64 {
        self.relative_to_limit(self.error)
    }

    /// The part of it that no nodes or steps lessen.
    pub fn relative_fixed(&self) -> f64 {
        self.relative_to_limit(self.fixed)
    }

    /// Nothing is nothing beside a limit of 0, too.
    fn relative_to_limit(&self, part: f64) -> f64 {
        if part == 0.0 { 0.0 } else { part / self.t }
    }
}

/// What three levels tell of a limit.
struct OfSpace {
    t: f64,
    /// Without the terms in h² and h⁴, asymptotic or not.
    three: f64,
    error: f64,
    /// By how much rounding moves it.
    rounding: f64,
    order: Option<f64>,
    asymptotic: bool,
}

/// How well the nodes of a level resolve what a time is that of.
#[derive(Clone, Copy)]
struct Nodes {
    of: TimeOf,
    terms: Terms,
    /// By how much the tangent turns at a node.
    turn: f64,
    /// Mean distance of two.
    spacing: f64,
}

impl Nodes {
    /// The factor by which terms fall, at most 1, at the time `t` with these terms.
    fn fall(self, t: f64, terms: [f64; 2]) -> f64 {
        let waves = OF_WAVES * self.spacing.powi(2) / t.abs().sqrt();
        let fall = self.turn.powi(2).max(waves).max((terms[0] + terms[1]) / t.abs());
        if self.of == TimeOf::Bending { (OF_BENDING * fall).min(1.0) } else { fall.min(1.0) }
    }
}

impl OfSpace {
    /// Extrapolates from three levels, the finest last, which `rounding` moves, with such nodes at the finest.
    fn of([half, between, full]: [f64; 3], points: [usize; 3], rounding: [f64; 3], nodes: Nodes) -> OfSpace {
        // (n/n')²: how much larger the leading error is.
        let [p, q] = [points[0], points[1]].map(|n| (points[2] as f64 / n as f64).powi(2));
        let two = |[_, between, full]: [f64; 3]| full - (between - full) / (q - 1.0);
        // Lagrange's weights at 0 for the abscissas p, q and 1.
        let three = |[half, between, full]: [f64; 3]| {
            half * q / ((p - q) * (p - 1.0)) - between * p / ((p - q) * (q - 1.0))
                + full * p * q / ((p - 1.0) * (q - 1.0))
        };
        let alone = [0, 1, 2].map(|i| std::array::from_fn(|j| if i == j { rounding[i] } else { 0.0 }));
        let moved = |by_each: [f64; 3]| by_each.into_iter().fold(0.0, f64::hypot);
        let (moved_two, moved_three) = (moved(alone.map(two)), moved(alone.map(three)));
        let [two, three] = [two([half, between, full]), three([half, between, full])];
        let noise = rounding.into_iter().fold(0.0, f64::max);
        let order = order([half, between, full], points);
        let farthest = [half - between, between - full, half - full].map(f64::abs).into_iter().fold(0.0, f64::max);
        let terms = [(two - full).abs(), (three - two).abs()];
        let falls_by = |orders: std::ops::RangeInclusive<f64>| order.is_some_and(|order| orders.contains(&order));
        let (is_resolved, is_smooth) = (nodes.turn <= MAX_TURN, nodes.of != TimeOf::Extreme);
        let is_regular = nodes.terms != Terms::Points;
        let is_small = farthest < (SMALL * full).max(OF_NOISE * noise);
        let asymptotic = is_resolved && is_smooth && (falls_by(ORDERS) || is_small);
        let fall = nodes.fall(three, terms);
        let (t, error, rounding) = if asymptotic {
            let left = OF_SPACE * if is_regular { remainder(terms, fall) } else { after_the_first(terms, fall) };
            (three, if falls_by(ORDERS) { left } else { left.max(farthest) }, moved_three)
        } else {
            let bound = OF_OPEN * remainder(terms, fall.sqrt());
            let few_nodes_explain = !is_resolved && is_smooth && falls_by(LOOSE_ORDERS);
            let of_differences = if is_smooth { OF_DIFFERENCES } else { OF_EXTREMES };
            (two, if few_nodes_explain { bound } else { bound.max(of_differences * farthest) }, moved_two)
        };
        OfSpace { t, three, error, rounding, order, asymptotic }
    }
}

/// What follows the terms in h² and h⁴, each `fall` times the one before, or what these two show if they fall more
/// slowly.
fn remainder(terms: [f64; 2], fall: f64) -> f64 {
    shown_fall(terms, fall) * after_the_first(terms, fall)
}

/// What follows the term in h², by itself and by that in h⁴, which may be small by chance.
fn after_the_first([second, fourth]: [f64; 2], fall: f64) -> f64 {
    fourth + shown_fall([second, fourth], fall) * second
}

/// The factor by which terms fall: `fall`, or what these two show if they fall more slowly.
fn shown_fall([second, fourth]: [f64; 2], fall: f64) -> f64 {
    if OF_FALL * fourth > fall * second { (OF_FALL * fourth / second).min(1.0) } else { fall }
}

/// The p for which times at three numbers of nodes are t + c n^-p.
fn order([half, between, full]: [f64; 3], points: [usize; 3]) -> Option<f64> {
    let [first, second] = [points[0], points[1]].map(|n| (points[2] as f64 / n as f64).ln());
    // Grows with p.
    let ratio = |p: f64| ((p * first).exp() - (p * second).exp()) / ((p * second).exp() - 1.0);
    let observed = (half - between) / (between - full);
    let (mut low, mut high) = (ALL_ORDERS.start, ALL_ORDERS.end);
    if !(ratio(low) < observed && observed < ratio(high)) {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if ratio(middle) < observed { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [usize; 3] = [50, 71, 100];

    fn limit(at: impl Fn(f64) -> f64) -> Limit {
        on(&POINTS, 0.2, at)
    }

    /// With the third number of nodes as the own one, and a curve that turns by `turn` at a node there.
    fn on(points: &[usize], turn: f64, at: impl Fn(f64) -> f64) -> Limit {
        let levels: Vec<f64> = points.iter().map(|n| at(1.0 / *n as f64)).collect();
        let turn = turn * points[2] as f64 / points[points.len() - 1] as f64;
        Limit::of(&Times { points: points.to_vec(), turn, ..times(levels) })
    }

    /// Those of a plain curve, the third of which is its own, without rounding.
    fn times(levels: Vec<f64>) -> Times {
        Times {
            own: levels[2],
            points: POINTS.to_vec(),
            rounding: vec![0.0; levels.len()],
            levels,
            own_level: 2,
            tolerance: 1e-4,
            share_of_steps: Some(SHARE_OF_STEPS),
            turn: 0.2,
            length: 6.3,
            excess: 2e-3,
            terms: Terms::Plain,
            of: TimeOf::End,
        }
    }

    /// A time whose terms fall by the square of the angle at a node of `n` nodes.
    fn falling(turn: f64) -> impl Fn(f64) -> f64 {
        move |h: f64| {
            let fall = (100.0 * turn * h).powi(2);
            2.0 + 0.05 * fall * (1.0 + 0.2 * fall + 0.1 * fall.powi(2))
        }
    }

    #[test]
    fn two_terms_are_removed_and_the_third_is_within_the_error() {
        let exact = limit(|h| 2.0 + 50.0 * h.powi(2) + 1e4 * h.powi(4));
        assert!((exact.t - 2.0).abs() < 1e-12 && exact.asymptotic, "{exact:?}");
        for turn in [0.1, 0.2, 0.3, 0.4, 0.48] {
            let limit = on(&POINTS, turn, falling(turn));
            assert!(limit.asymptotic && (limit.t - 2.0).abs() < limit.error, "{turn}: {limit:?}");
        }
        // Terms that fall more slowly than the angle says show it, as far as they are seen: up to the fourth power.
        let slow = on(&POINTS, 0.2, falling(0.45));
        assert!((slow.t - 2.0).abs() < slow.error, "{slow:?}");
        // The control: a tenth of it is too little.
        assert!((slow.t - 2.0).abs() > 0.1 * slow.error, "{slow:?}");
    }

    #[test]
    fn the_error_does_not_vanish_where_the_fourth_power_does_by_chance() {
        let turn = 0.4;
        let sixth = |h: f64| 2.0 + 0.05 * (100.0 * turn * h).powi(2) + 0.005 * (100.0 * turn * h).powi(6);
        // What makes the extrapolations with two and with three levels agree.
        let limit = |fourth: f64| on(&POINTS, turn, move |h| sixth(h) + fourth * (100.0 * turn * h).powi(4));
        let gap = |fourth: f64| limit(fourth).order.unwrap() - 2.0;
        let (mut low, mut high) = (-0.02, 0.02);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if gap(middle) < 0.0 { low = middle } else { high = middle }
        }
        let chance = limit(low);
        assert!((chance.order.unwrap() - 2.0).abs() < 1e-6 && (chance.t - 2.0).abs() < chance.error, "{chance:?}");
        assert!((chance.t - 2.0).abs() > 1e-4, "{chance:?}");
    }

    #[test]
    fn nodes_that_do_not_resolve_the_curve_are_never_believed() {
        let exact = |h: f64| 2.0 + 50.0 * h.powi(2) + 1e4 * h.powi(4);
        assert!(on(&POINTS, 0.49, exact).asymptotic && !on(&POINTS, 0.51, exact).asymptotic);
        let coarse = on(&POINTS, 0.8, falling(0.8));
        assert!(coarse.needs_more(0.8) && (coarse.t - 2.0).abs() < coarse.error, "{coarse:?}");
    }

    #[test]
    fn where_differences_do_not_fall_the_error_is_larger_than_they_are() {
        for at in [|h: f64| 2.0 + 0.5 * h, |h: f64| 2.0 + 40.0 * (h - 0.013).abs(), |h: f64| 2.0 + 3e3 * h.powi(3)] {
            let limit = limit(at);
            assert!(!limit.asymptotic && (limit.t - 2.0).abs() < limit.error, "{limit:?}");
        }
        assert_eq!(limit(|h| 2.0 + 40.0 * (h - 0.013).abs()).order, None);
        assert!((limit(|h| 2.0 + 0.5 * h).order.unwrap() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_fourth_level_shortens_the_error_but_never_to_nothing() {
        let fall = |h: f64| (80.0 * h).powi(2);
        let at = |h: f64| 2.0 + 0.05 * fall(h) * (1.0 + 0.2 * fall(h) + 0.03 * fall(h).powi(2));
        let limit = |points: &[usize], terms: Terms| {
            let levels = points.iter().map(|n| at(1.0 / *n as f64)).collect();
            let of = times(levels);
            let (own, own_level) = (of.levels[0], 0);
            Limit::of(&Times { own, own_level, points: points.to_vec(), tolerance: 1e-6, turn: 0.4, terms, ..of })
        };
        let four_levels = [71, 100, 141, 200];
        let (four, three) = (limit(&four_levels, Terms::Plain), limit(&four_levels[1..], Terms::Plain));
        assert!(four.asymptotic && (four.t - three.t).abs() < 1e-12, "{four:?} {three:?}");
        assert!(four.error < 0.6 * three.error && (four.t - 2.0).abs() < four.error, "{four:?} {three:?}");
        assert!(four.error > OF_THREE * three.error, "{four:?} {three:?}");
        // Where waves disturb the terms, it does not count.
        assert_eq!(limit(&four_levels, Terms::Waves).error, three.error);
    }

    /// Of the events of docs/internals/method.md#limit-of-events: which, nodes, their times, the turn, the limit.
    #[test]
    fn limits_of_events_are_within_their_errors() {
        let within = |of: TimeOf, length: f64, (points, levels, turn, t): ([usize; 3], [f64; 3], f64, f64)| {
            let times = Times { of, points: points.to_vec(), turn, length, ..times(levels.to_vec()) };
            let limit = Limit::of(&times);
            (limit.asymptotic, (limit.t - t).abs() < limit.error)
        };
        // Length falls by 1 %: early, on short waves. The control has none.
        let early = (POINTS, [3.548561e-4, 3.32852e-4, 3.226214e-4], 0.26, 3.12173e-4);
        assert_eq!(within(TimeOf::Shape, 6.5, early), (true, true));
        assert_eq!(within(TimeOf::Shape, 0.0, early), (true, false));
        // Energy falls by a tenth, with terms as large as the time.
        let large = (POINTS, [2.966020e-2, 1.640909e-2, 9.726496e-3], 0.1424, 4.0946e-3);
        assert_eq!(within(TimeOf::Bending, 8.0, large), (true, true));
        // By a half, on waves that are shorter than those of the shape.
        let half = ([75, 106, 150], [1.351263e-2, 1.263854e-2, 1.22038e-2], 0.14, 1.17702e-2);
        assert_eq!([TimeOf::Bending, TimeOf::Shape].map(|of| within(of, 6.9, half)), [(true, true), (true, false)]);
        // The largest curvature of the nodes falls to 1.2: order 2 by chance.
        let largest = ([40, 57, 80], [5.553012e-2, 5.936192e-2, 6.115425e-2], 0.15, 6.287514e-2);
        assert_eq!(within(TimeOf::Extreme, 8.0, largest), (false, true));
        assert_eq!(within(TimeOf::Shape, 8.0, largest), (true, false));
    }

    #[test]
    fn the_limit_of_a_curve_through_points_is_known_by_its_first_term() {
        // An outline of 27 points, member 1: the term in h⁴ is small by chance.
        let levels = vec![0.135_888_47, 0.134_833_33, 0.134_321_61];
        let limit = |terms: Terms| {
            let (points, own) = (vec![48, 68, 96], 0.134_321_61);
            Limit::of(&Times { points, own, turn: 0.158, length: 7.61, terms, excess: 8.5e-3, ..times(levels.clone()) })
        };
        let off = |terms: Terms| (limit(terms).t - 0.133_802).abs() / limit(terms).error;
        assert!(off(Terms::Points) < 1.0 && off(Terms::Plain) > 5.0, "{:?}", limit(Terms::Points));
    }

    #[test]
    fn more_nodes_are_worth_it_until_differences_fall_or_are_small() {
        let three = on(&POINTS, 0.8, falling(0.8));
        assert!(three.needs_more(0.8) && !three.asymptotic, "{three:?}");
        let five = on(&[50, 71, 100, 141, 200], 0.8, falling(0.8));
        assert!(!five.needs_more(0.4) && five.asymptotic && (five.t - 2.0).abs() < five.error, "{five:?}");
        // What is judged is the time at the own nodes.
        assert!((five.relative - 0.5 * (falling(0.8)(0.01) - 2.0)).abs() < 1e-4, "{five:?}");
        // A bound that is small enough needs none, either.
        let rough = limit(|h| 2.0 + 0.02 * h);
        assert!(!rough.asymptotic && !rough.needs_more(0.2), "{rough:?}");
        assert!(limit(|h| 2.0 + 0.5 * h).needs_more(0.2));
        // Member 10 of docs/internals/method.md#limit: times that agree by chance are not enough.
        let levels = vec![31.81772, 31.82203, 31.82330];
        let times_by_chance = Times { points: vec![53, 75, 106], turn: 1.36, excess: 0.012, ..times(levels) };
        let chance = Limit::of(&times_by_chance);
        assert!(chance.relative_error() < WIDE && chance.needs_more(1.36) && !chance.needs_more(0.69), "{chance:?}");
        // A time that passes its largest value between levels has no order.
        let levels = vec![1.000672, 1.001219, 1.001099];
        let turned_times = Times { points: vec![40, 57, 80], turn: 0.65, excess: 0.012, ..times(levels) };
        let turned = Limit::of(&turned_times);
        assert!(turned.order.is_none() && turned.needs_more(0.65) && !turned.asymptotic, "{turned:?}");
    }

    #[test]
    fn differences_as_small_as_the_errors_of_steps_need_no_order() {
        let noise = limit(|h| if h > 0.012 { 2.0 } else { 2.00001 });
        assert!(noise.asymptotic && noise.error < 1e-4 && noise.order.is_none(), "{noise:?}");
    }

    #[test]
    fn the_error_of_steps_goes_with_the_amplitude_at_which_they_are_judged() {
        let at = |excess: f64, tolerance: f64| {
            Limit::of(&Times { tolerance, turn: 0.1, excess, ..times(vec![2.0; 3]) }).error
        };
        let (one, small, exact) = (at(1e-2, 1e-4), at(1e-4, 1e-4), at(1e-2, 1e-5));
        // Equal times leave the rounding of their extrapolation, some 1e-16.
        assert!((small / one - 10.0).abs() < 1e-8 && (one / exact - 10.0).abs() < 1e-8, "{one} {small} {exact}");
    }

    #[test]
    fn what_steps_leave_goes_with_their_tolerance_and_is_removed() {
        let levels = POINTS.map(|n| 2.001 + 50.0 / (n as f64).powi(2)).to_vec();
        let at = |share_of_steps: Option<f64>| {
            let own = levels[2] + 0.009;
            Limit::of(&Times { own, share_of_steps, turn: 0.1, excess: 1e-2, ..times(levels.clone()) })
        };
        let [adaptive, other] = [Some(SHARE_OF_STEPS), None].map(at);
        assert!((adaptive.t - 2.0).abs() < 1e-12 && (other.t - 2.001).abs() < 1e-12, "{adaptive:?} {other:?}");
        assert!(adaptive.error > SHARE_OF_STEPS * 0.009 && other.error < 2e-5, "{adaptive:?} {other:?}");
    }

    #[test]
    fn rounding_moves_a_limit_by_its_weights_and_no_nodes_lessen_it() {
        let exact = |n: i32| 2.0 + 40.0 / f64::from(n).powi(2);
        let at = |by: [f64; 3], rounding: f64| {
            let levels = [50, 71, 100].iter().zip(by).map(|(n, by)| exact(*n) * (1.0 + by)).collect();
            Limit::of(&Times { own: exact(100), rounding: vec![rounding; 3], share_of_steps: None, ..times(levels) })
        };
        let (moved, blind) = (at([1e-4, -1e-4, 1e-4], 1e-4), at([1e-4, -1e-4, 1e-4], 0.0));
        assert!(
            (moved.t - 2.0).abs() < 2.0 * moved.error && (moved.t - 2.0).abs() > 2.0 * blind.error,
            "{moved:?} {blind:?}"
        );
        assert!(moved.asymptotic && !moved.is_open() && moved.fixed > 3e-4 * moved.t, "{moved:?}");
        // Differences below it have no order.
        let chance = at([-4e-3, -2e-3, -6e-3], 4e-3);
        assert!(
            chance.order.is_none() && chance.asymptotic && !at([-4e-3, -2e-3, -6e-3], 0.0).asymptotic,
            "{chance:?}"
        );
    }

    #[test]
    fn times_in_another_unit_have_the_limit_in_that_unit() {
        // So early that short waves decide.
        let at = |h: f64| 2e-3 * (1.0 + 50.0 * h.powi(2) + 1e4 * h.powi(4));
        let limit = |unit: f64, length: f64| {
            let levels = POINTS.map(|n| unit * at(1.0 / n as f64)).to_vec();
            Limit::of(&Times { length, ..times(levels) })
        };
        let (one, other) = (limit(1.0, 6.3), limit(4096.0, 8.0 * 6.3));
        assert_eq!((4096.0 * one.t, 4096.0 * one.error, one.order), (other.t, other.error, other.order));
        // The control: the same length.
        assert!(limit(4096.0, 6.3).error < 0.9 * other.error);
    }
}
