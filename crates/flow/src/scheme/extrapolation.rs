//! The adaptive step: rows of ever more of the paper's steps, extrapolated to order J. Twin of
//! `shaders/extrapolation.wgsl`.
//!
//! Row j is the result of [`divisions`] n_j steps of the paper of length h/n_j, its parts. The scheme is of first
//! order, and its error has an expansion in powers of the length of the parts, so the Aitken–Neville combination of the
//! first J rows is of order J (E. Hairer and G. Wanner, *Solving Ordinary Differential Equations II*, section IV.9),
//! with the weights `w_j = Π_{i≠j} n_j/(n_j - n_i)`. The rows from 2 to J give order J-1, and the difference between
//! the two measures the error. All of x, y, k and r are combined, each by itself.
//!
//! Backward differences at the ends of the rows are combined in the same way: the first and second derivatives at the
//! end of the step, from which [`dense`](super::dense) takes what lies inside steps (E. Hairer and A. Ostermann, *Dense
//! output for extrapolation methods*, 1990).
//!
//! Everything is accumulated as parts are made, as a change from the curve at the start, in what the state holds of the
//! step before: nobody needs that any more.

use super::{
    Branches, Curve, Parameters, State,
    run::Run,
    state::{self, CURVE_FIELDS, GAP_FIELDS, Gaps, change_from, is_of_places},
};
use crate::{
    number::{BIG, Number, Real, place::STEP},
    solver::{Blocks, Ring},
};

/// Lowest order of a step.
pub const LEAST_ORDER: u32 = 2;
/// Highest order of a step.
pub const MOST_ORDER: u32 = 6;

/// Weight of an error of the nodes over one of the curvature, both relative. A mode m of the curve has m²-1 times as
/// much of it in the curvature.
pub const NODE_WEIGHT: f64 = 20.0;

/// Rounding of a step in short numbers, in units of ε: each part adds that of k, r and the nodes, and the weights of
/// the rows multiply it. No tolerance is below it: crystals and vesicles at rest, which err by nothing else, would
/// creep.
pub const NOISE: f64 = 50.0;
/// The same for errors of the curvature that say nothing, whatever the tolerance.
pub const NOISE_OF_SCALE: f64 = 20.0;
/// The same of the curvature of a polygon, towards which a curve may be pulled, in units of `(n/L)²`.
pub const NOISE_OF_POLYGON: f64 = 0.3 * STEP as f64;

/// The last parts of a row, which go into the combinations.
pub const SHARED_PARTS: u32 = 3;

/// Returns the parts of `row`: 1, 2, 3, 4, 5, 6, and in short numbers 1, 2, 3, 5, 8, 12. The farther apart they are,
/// the smaller the weights of the rows, which multiply the rounding of the parts.
pub fn divisions<T: Real>(row: u32) -> u32 {
    divided(row, T::IS_SHORT)
}

fn divided(row: u32, short: bool) -> u32 {
    let beyond = if short { row.saturating_sub(3) } else { 0 };
    row + beyond * (beyond + 1) / 2
}

/// Returns the steps of the paper that a step of order `order` makes.
pub fn parts<T: Real>(order: u32) -> u32 {
    (1..=order).map(divisions::<T>).sum()
}

/// The weight of `row` in the combination of the rows from `first` to `order`, which have `divisions` parts.
fn weight<T: Real>(row: u32, first: u32, order: u32, divisions: impl Fn(u32) -> u32) -> T {
    let of = |row| T::of(f64::from(divisions(row)));
    let own = of(row);
    let mut weight = T::of(if first <= row && row <= order { 1.0 } else { 0.0 });
    for other in first..=order {
        if other != row {
            weight = weight * (own / (own - of(other)));
        }
    }
    weight
}

/// How much larger the rounding of a step of order `order` is than that of one of the paper's: each part adds its own,
/// and the weights of the rows multiply them.
pub fn roundings<T: Real>(order: u32) -> f64 {
    let of_row = |row| f64::from(divisions::<T>(row)) * weight::<f64>(row, 1, order, divisions::<T>).powi(2);
    (1..=order).map(of_row).sum::<f64>().sqrt()
}

/// How much of the change up to the end of a part goes into each combination.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shares<N> {
    /// Into the curve at the end of the step.
    value: N,
    /// Into its derivative, times the length of the step.
    slope: N,
    /// Into its second derivative, times the square of that.
    bend: N,
    /// Into the error of order J-1.
    gap: N,
    /// Into the error of order J-2.
    lower_gap: N,
}

impl<T: Real> Shares<T> {
    /// The shares of a part of `row`, `left` parts before its end, in a step of order `order` whose rows have
    /// `divisions` parts.
    fn of(row: u32, left: u32, order: u32, divisions: impl Fn(u32) -> u32) -> Shares<T> {
        let own = T::of(f64::from(divisions(row)));
        let zero = T::of(0.0);
        let weight = |first, order| weight::<T>(row, first, order, &divisions);
        let (whole, upper) = (weight(1, order), weight(LEAST_ORDER, order));
        let square = own * own * upper;
        match left {
            0 => {
                let lower =
                    if order > LEAST_ORDER { weight(1, order - 1) - weight(LEAST_ORDER, order - 1) } else { zero };
                Shares { value: whole, slope: own * whole, bend: square, gap: whole - upper, lower_gap: lower }
            }
            1 => Shares { slope: -(own * whole), bend: -(square + square), ..Shares::default() },
            2 => Shares { bend: square, ..Shares::default() },
            _ => Shares::default(),
        }
    }
}

impl<N: Number> Shares<N> {
    /// Sets one lane.
    #[inline(always)]
    pub fn set_lane(&mut self, lane: usize, of: Shares<N::Real>) {
        self.value.set_lane(lane, of.value);
        self.slope.set_lane(lane, of.slope);
        self.bend.set_lane(lane, of.bend);
        self.gap.set_lane(lane, of.gap);
        self.lower_gap.set_lane(lane, of.lower_gap);
    }
}

/// The shares of all parts in steps of all orders.
pub struct AllShares<T>(Vec<Shares<T>>);

impl<T: Real> AllShares<T> {
    /// Computes them.
    pub fn computed() -> AllShares<T> {
        let rows = (0..=MOST_ORDER).flat_map(|order| (0..=MOST_ORDER).map(move |row| (order, row)));
        let parts = rows.flat_map(|(order, row)| (0..SHARED_PARTS).map(move |left| (order, row, left)));
        AllShares(parts.map(|(order, row, left)| Shares::of(row, left, order, divisions::<T>)).collect())
    }

    /// Returns those of a part in every lane, by its order.
    #[inline(always)]
    pub fn in_lanes<N: Number<Real = T>>(&self, runs: &[&mut Run<T>], row: u32, left: u32) -> Shares<N> {
        let mut shares = Shares::default();
        for (lane, run) in runs.iter().enumerate() {
            let at = ((run.counters.order * (MOST_ORDER + 1)) + row) * SHARED_PARTS + left;
            shares.set_lane(lane, self.0[at as usize]);
        }
        shares
    }
}

/// Prepares the combinations of an attempt: nothing has changed yet.
#[inline(always)]
pub fn begin_attempt<N: Number>(state: &mut State<N>, branches: Branches) {
    let State { before, slope_before, bend_before, gaps, .. } = state;
    let curves = [before, slope_before, bend_before].into_iter().flat_map(Curve::fields_mut);
    for field in curves.chain(gaps.fields_mut().into_iter().take(gap_fields(branches))) {
        for i in 0..field.len() {
            field[i] = N::of(0.0);
        }
    }
}

/// The errors that matter: those of x and y only if the polygon leads.
fn gap_fields(branches: Branches) -> usize {
    if branches.geometric { GAP_FIELDS } else { CURVE_FIELDS }
}

/// Adds the curve `new` at the end of a part, `left` parts before the end of its row, in the lanes of `busy`.
#[inline(always)]
pub fn add_part<N: Number>(
    state: &mut State<N>,
    new: &Curve<N>,
    left: u32,
    shares: &Shares<N>,
    busy: N::Mask,
    branches: Branches,
) {
    let State { curve, before, slope_before, bend_before, gaps, .. } = state;
    let changes = new.fields().into_iter().zip(curve.fields());
    let sums = before.fields_mut().into_iter().zip(slope_before.fields_mut()).zip(bend_before.fields_mut());
    let errors = gaps.own.fields_mut().into_iter().zip(gaps.lower.fields_mut());
    let all = changes.zip(sums).zip(errors).enumerate();
    for (field, (((new, old), ((value, slope), bend)), (gap, lower_gap))) in all {
        let counts_as_error = left == 0 && (branches.geometric || !is_of_places(field));
        for i in 0..new.len() {
            let change = N::select(busy, change_from(field, old[i], new[i]), N::of(0.0));
            bend[i] += shares.bend * change;
            if left < 2 {
                slope[i] += shares.slope * change;
            }
            if left == 0 {
                value[i] += shares.value * change;
            }
            if counts_as_error {
                gap[i] += shares.gap * change;
                lower_gap[i] += shares.lower_gap * change;
            }
        }
    }
}

/// Puts the curve at the end of the step into `new`.
#[inline(always)]
pub fn finish_attempt<N: Number>(state: &mut State<N>, new: &mut Curve<N>) {
    let State { curve, before, slope_before, bend_before, .. } = state;
    let changes = before.fields().into_iter().zip(curve.fields());
    for (field, (new, (change, old))) in new.fields_mut().into_iter().zip(changes).enumerate() {
        state::advance(field, old, change, new);
    }
    slope_before.close();
    bend_before.close();
}

/// Returns the tolerance of a step whose solves are refined, or the rounding of its parts if that is larger.
#[inline(always)]
pub fn tolerance<N: Number>(p: &Parameters<N>) -> N {
    p.adaptive.max(N::of(NOISE * N::EPSILON))
}

/// The errors of order J-1 and J-2, in k and in ln r, of the step that ends in `new`.
///
/// The error in k is relative to the largest |k|. While the shape is followed, i.e. until the excess is negligible, it
/// is relative to the geometric mean of the largest |k| and the spread of k: a curve close to a circle must not lose
/// its modes in a tolerance measured by the circle.
///
/// In the geometric form the error of the nodes counts, too: relative to the radius and in the same proportion. In
/// short numbers that of a block of nodes is their mean: modes that vary within it show in the curvature, and the
/// rounding of places, which NODE_WEIGHT multiplies, differs from node to node.
#[inline(always)]
pub fn errors_of_attempt<N: Number>(
    gaps: &Gaps<N>,
    new: &Curve<N>,
    length: N,
    followed: N::Mask,
    p: &Parameters<N>,
    branches: Branches,
    blocks: Blocks,
) -> [N; 2] {
    let low = N::of(-2.0 * BIG);
    let (mut gap_k, mut gap_r, mut lower_k, mut lower_r) = (N::of(0.0), N::of(0.0), N::of(0.0), N::of(0.0));
    let (mut k_max, mut minus_k_min) = (low, low);
    for i in 0..new.len() {
        let ir = p.length_of(new.r[i]).recip();
        gap_k = gap_k.max(gaps.own.k[i].bounded_abs());
        gap_r = gap_r.max((gaps.own.r[i] * ir).bounded_abs());
        lower_k = lower_k.max(gaps.lower.k[i].bounded_abs());
        lower_r = lower_r.max((gaps.lower.r[i] * ir).bounded_abs());
        k_max = k_max.max(new.k[i]);
        minus_k_min = minus_k_min.max(-new.k[i]);
    }
    let size = k_max.max(minus_k_min);
    let spread = (k_max + minus_k_min).min(size);
    let mut scale = N::select(followed, (size * spread).sqrt(), size);
    if N::IS_SHORT {
        // Errors below the rounding of k and of the nodes, which does not know how round the curve is, say nothing.
        let mut noise = size * N::of(NOISE_OF_SCALE * N::EPSILON);
        if branches.pulled {
            let edge = length / N::of(new.len() as f64);
            noise += N::of(NOISE_OF_POLYGON) / (edge * edge);
        }
        scale = scale.max(noise / tolerance(p));
    }
    let errors = [(gap_k / scale).bounded_abs().max(gap_r), (lower_k / scale).bounded_abs().max(lower_r)];
    if !branches.geometric {
        return errors;
    }
    let unit = length * (scale / size) * N::of(0.5 / std::f64::consts::PI / NODE_WEIGHT);
    let largest = |of: [&Ring<N>; 2]| {
        let mut largest = N::of(0.0);
        for (first, count) in blocks.iter() {
            let mut sums = [N::of(0.0); 2];
            for i in first..first + count {
                if N::IS_SHORT {
                    sums[0] += of[0][i];
                    sums[1] += of[1][i];
                } else {
                    largest = largest.max(of[0][i].bounded_abs().max(of[1][i].bounded_abs()));
                }
            }
            let [x, y] = sums.map(|sum| (sum / N::of(count as f64)).bounded_abs());
            largest = largest.max(x.max(y));
        }
        (largest / unit).bounded_abs()
    };
    [errors[0].max(largest(gaps.own.nodes())), errors[1].max(largest(gaps.lower.nodes()))]
}

#[cfg(test)]
mod tests {
    use super::{super::forcing::DAMPING, *};

    /// The orders of steps in long and in short numbers.
    fn all_orders() -> impl Iterator<Item = (u32, bool)> {
        (LEAST_ORDER..=MOST_ORDER).flat_map(|order| [(order, false), (order, true)])
    }

    /// The end, the derivative and the second derivative of a step of length h for y' = -y², y(0) = 1, by the explicit
    /// Euler method, and the two errors.
    fn step(h: f64, order: u32, short: bool) -> [f64; 5] {
        let mut all = [1.0, 0.0, 0.0, 0.0, 0.0];
        for row in 1..=order {
            let mut y = 1.0;
            let parts = divided(row, short);
            for part in 1..=parts {
                y -= h / f64::from(parts) * y * y;
                let shares = Shares::<f64>::of(row, parts - part, order, |row| divided(row, short));
                let [value, slope, bend, gap, lower] =
                    [shares.value, shares.slope, shares.bend, shares.gap, shares.lower_gap];
                for (sum, share) in all.iter_mut().zip([value, slope, bend, gap, lower]) {
                    *sum += share * (y - 1.0);
                }
            }
        }
        all
    }

    #[test]
    fn combinations_have_their_orders() {
        for (order, short) in all_orders() {
            let errors = [0.04, 0.02].map(|h: f64| {
                let [value, slope, bend, gap, lower] = step(h, order, short);
                let y = 1.0 / (1.0 + h);
                [value - y, slope + h * y * y, bend - 2.0 * h * h * y * y * y, gap, lower]
            });
            let observed = |of: usize| (errors[0][of] / errors[1][of]).abs().log2();
            let expected = f64::from(order) + 1.0;
            for (of, order) in [expected, expected, expected, expected - 1.0, expected - 2.0].into_iter().enumerate() {
                // Order J-2 of the lowest step does not exist.
                if expected > 3.0 || of < 4 {
                    assert!((observed(of) - order).abs() < 0.35, "{expected}: {of}: {} of {order}", observed(of));
                }
            }
        }
    }

    /// The largest factor by which a step of this order multiplies a mode of a driven circle.
    fn most_amplified(order: u32, short: bool, damping: f64) -> f64 {
        let mut most = 0.0_f64;
        for (mode, tenths) in (2..40).flat_map(|mode| (-50..80).map(move |tenths| (mode, tenths))) {
            let (m, h) = (f64::from(mode), 10f64.powf(f64::from(tenths) / 10.0));
            let own = |tau: f64, k: f64| 1.0 / (1.0 + tau * (k.powi(4) + damping * k * k));
            let part = |tau: f64| 1.0 - 0.5 * m * m * (m * m - 1.0) * tau * (own(tau, m + 1.0) + own(tau, m - 1.0));
            let row = |j: u32| {
                let parts = divided(j, short);
                weight::<f64>(j, 1, order, |row| divided(row, short)) * part(h / f64::from(parts)).powi(parts as i32)
            };
            most = most.max((1..=order).map(row).sum::<f64>().abs());
        }
        most
    }

    #[test]
    fn no_mode_of_a_driven_circle_grows_in_a_step_of_any_length_and_order() {
        for (order, short) in all_orders() {
            let too_little = if short { 1.0 } else { 3.0 };
            let [own, less] = [DAMPING, too_little].map(|damping| most_amplified(order, short, damping));
            assert!(own <= 1.0 && less > 1.1, "order {order}, short {short}: {own} {less}");
        }
    }

    #[test]
    fn weights_add_up_to_one() {
        for (order, short) in all_orders() {
            let sum = |first: u32| {
                (1..=order).map(|row| weight::<f64>(row, first, order, |row| divided(row, short))).sum::<f64>()
            };
            assert!((sum(1) - 1.0).abs() < 1e-13 && (sum(2) - 1.0).abs() < 1e-13, "{order} {short}");
        }
        assert_eq!([1, 2].map(|row| weight::<f64>(row, 1, 2, divisions::<f64>)), [-1.0, 2.0], "step doubling");
    }

    #[test]
    fn rounding_grows_less_with_the_order_in_short_numbers() {
        assert_eq!([4, 5, 6].map(parts::<f64>), [10, 15, 21]);
        assert_eq!([4, 5, 6].map(parts::<f32>), [11, 19, 31]);
        assert_eq!([4, 5, 6].map(|order| roundings::<f64>(order).round()), [32.0, 109.0, 375.0]);
        assert_eq!([4, 5, 6].map(|order| roundings::<f32>(order).round()), [17.0, 28.0, 50.0]);
    }
}
