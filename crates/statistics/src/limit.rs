//! The limit of a time as the resolution grows without bound, and its error.
//!
//! Where n is large enough, t(n) = t + c n⁻² + d n⁻⁴ + …, and three resolutions give t. How far that is from what the two
//! finest give with c alone bounds its error, and the steps in time leave a part that goes with their tolerance. The
//! constants below were fitted to ensembles of curves and flows at n = 64 to 200 with limits known from n = 300 to 600
//! (`docs/method.md#limit`).

use serde::{Deserialize, Serialize};

/// Share of the difference of the two extrapolations in the error.
const OF_SPACE: f64 = 0.5;
/// Share of what ten times more exact steps change, and the least error of steps in units of their tolerance, relative to
/// the time: the change may be small by chance.
const OF_STEPS: f64 = 0.5;
const OF_TOLERANCE: f64 = 0.3;
/// Observed orders between which differences fall as they should.
const ORDERS: std::ops::RangeInclusive<f64> = 1.97..=2.2;
/// Relative differences between the coarsest and the finest resolution: below the first they are as small as the errors
/// of the steps, and have no order; above the second, three terms are too few.
const SMALL: f64 = 5e-5;
const LARGE: f64 = 0.05;
/// The error where differences do not fall as they should, in multiples of the largest of them.
const NOT_ASYMPTOTIC: f64 = 4.0;
/// Orders that are looked for.
const ALL_ORDERS: std::ops::Range<f64> = 0.05..8.0;
/// Halvings of that range: to the last bit.
const HALVINGS: usize = 60;

/// One time, computed at several resolutions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    /// As it is to be judged.
    pub own: f64,
    /// With more exact steps, at growing numbers of nodes; the last are those of `own`.
    pub levels: [f64; 3],
    /// These numbers.
    pub points: [usize; 3],
    /// Tolerance of these steps.
    pub tolerance: f64,
    /// Whether the steps of `own` are adaptive, with a tolerance ten times as large.
    pub is_adaptive: bool,
}

/// What the time tends to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// The limit, in the unit of the times.
    pub t: f64,
    /// Half-width of its 95 % interval.
    pub error: f64,
    /// Observed order in 1/n, if the differences have one.
    pub order: Option<f64>,
    /// Whether the differences fall as they should; if not, `t` is the time at the finest resolution, and the error is
    /// larger than they are.
    pub asymptotic: bool,
    /// Relative error of the time that is judged, with its sign.
    pub relative: f64,
}

impl Limit {
    /// Estimates the limit.
    ///
    /// ```
    /// use curvelax_statistics::{Limit, Times};
    ///
    /// let points = [50, 71, 100];
    /// let levels = points.map(|n| 0.8 + 40.0 / f64::from(n).powi(2));
    /// let points = points.map(|n| n as usize);
    /// let limit = Limit::of(&Times { own: 0.805, levels, points, tolerance: 1e-4, is_adaptive: true });
    /// assert!((limit.t - 0.8).abs() < 1e-12 && limit.error < 1e-3 && limit.asymptotic);
    /// assert!((limit.order.unwrap() - 2.0).abs() < 1e-9 && (limit.relative - 0.00625).abs() < 1e-12);
    /// ```
    pub fn of(times: &Times) -> Limit {
        let Times { own, levels: [half, between, full], points, tolerance, is_adaptive } = *times;
        // (n/n')²: how much larger the leading error is.
        let [p, q] = [points[0], points[1]].map(|n| (points[2] as f64 / n as f64).powi(2));
        let two = full - (between - full) / (q - 1.0);
        // Lagrange's weights at 0 for the abscissas p, q and 1.
        let three = half * q / ((p - q) * (p - 1.0)) - between * p / ((p - q) * (q - 1.0))
            + full * p * q / ((p - 1.0) * (q - 1.0));
        let order = order([half, between, full], points);
        let farthest = [half - between, between - full, half - full].map(f64::abs).into_iter().fold(0.0, f64::max);
        let is_ordered = order.is_some_and(|order| ORDERS.contains(&order)) || farthest < SMALL * full;
        let asymptotic = is_ordered && (half - full).abs() <= LARGE * full;
        let steps = if is_adaptive { (own - full).abs() } else { 0.0 };
        let (t, error) = match asymptotic {
            true => {
                let of_steps = (OF_STEPS * steps).max(OF_TOLERANCE * tolerance * full);
                (three, OF_SPACE * (three - two).abs() + of_steps)
            }
            false => (full, NOT_ASYMPTOTIC * farthest + steps.max(tolerance * full)),
        };
        Limit { t, error, order, asymptotic, relative: own / t - 1.0 }
    }

    /// Its half-width relative to the limit.
    pub fn relative_error(&self) -> f64 {
        self.error / self.t
    }
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
        let levels = POINTS.map(|n| at(1.0 / n as f64));
        Limit::of(&Times { own: levels[2], levels, points: POINTS, tolerance: 1e-4, is_adaptive: true })
    }

    #[test]
    fn two_terms_are_removed_and_the_third_is_within_the_error() {
        let exact = limit(|h| 2.0 + 50.0 * h.powi(2) + 1e4 * h.powi(4));
        assert!((exact.t - 2.0).abs() < 1e-12 && exact.asymptotic, "{exact:?}");
        let sixth = limit(|h| 2.0 + 50.0 * h.powi(2) + 1e4 * h.powi(4) + 1e6 * h.powi(6));
        assert!((sixth.t - 2.0).abs() < sixth.error && (sixth.t - 2.0).abs() > 1e-6, "{sixth:?}");
    }

    #[test]
    fn where_differences_do_not_fall_the_error_is_larger_than_they_are() {
        for at in [|h: f64| 2.0 + 0.5 * h, |h: f64| 2.0 + 40.0 * (h - 0.013).abs(), |h: f64| 2.0 + 3e3 * h.powi(3)] {
            let limit = limit(at);
            assert!(!limit.asymptotic && limit.t == at(0.01), "{limit:?}");
            assert!((limit.t - 2.0).abs() < limit.error, "{limit:?}");
        }
        assert_eq!(limit(|h| 2.0 + 40.0 * (h - 0.013).abs()).order, None);
        assert!((limit(|h| 2.0 + 0.5 * h).order.unwrap() - 1.0).abs() < 1e-9);
        // Half the nodes are far off.
        assert!(!limit(|h| 2.0 + 500.0 * h.powi(2)).asymptotic);
    }

    #[test]
    fn differences_as_small_as_the_errors_of_steps_need_no_order() {
        let noise = limit(|h| if h > 0.012 { 2.0 } else { 2.00001 });
        assert!(noise.asymptotic && noise.error < 1e-4 && noise.order.is_none(), "{noise:?}");
    }

    #[test]
    fn times_in_another_unit_have_the_limit_in_that_unit() {
        let [one, other] = [1.0, 1024.0].map(|unit| limit(|h| unit * (2.0 + 50.0 * h.powi(2) + 1e4 * h.powi(4))));
        assert_eq!((1024.0 * one.t, 1024.0 * one.error, one.order), (other.t, other.error, other.order));
    }
}
