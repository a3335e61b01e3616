//! Axes: from values to positions, and ticks whose labels are round and do not touch.

use super::width::{SIZE, width};
use curvelax_base::{drawable::is_drawable, text::power_of_ten};

/// Free space beyond the values, as a share of their range.
const PADDING: f64 = 0.04;
/// Values are treated as equal if their range, relative to their size, is smaller: their labels would be equal.
const EQUAL: f64 = 1e-6;
/// Ratio of the largest to the smallest of positive values above which a linear axis would hide most of them.
const WIDE: f64 = 30.0;
/// Pixels between labels side by side, and between labels one above the other.
const BETWEEN: f64 = 16.0;
const LINE: f64 = 34.0;
/// Minimum pixels of a decade divided by smaller ticks, and between ticks.
const DIVIDED: f64 = 30.0;
const MIN_TICK: f64 = 4.0;

/// How values are mapped to an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal distances are equal differences.
    Linear,
    /// Equal distances are equal ratios; only positive values can be shown.
    Log,
}

impl Scale {
    /// Logarithmic if all values are positive and the largest is more than 30 times the smallest.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Scale {
        match range(values.into_iter().filter(|value| Scale::Linear.holds(*value))) {
            Some((low, high)) if Scale::Log.holds(low) && high > WIDE * low => Scale::Log,
            _ => Scale::Linear,
        }
    }

    /// Whether `value` can be shown on such an axis.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Scale::Linear => is_drawable(value),
            Scale::Log => value > 0.0 && is_drawable(value),
        }
    }

    /// The quantity that is proportional to distance.
    pub fn level(self, value: f64) -> f64 {
        match self {
            Scale::Linear => value,
            Scale::Log => value.log10(),
        }
    }

    /// The value at a [level](Scale::level).
    pub fn value(self, level: f64) -> f64 {
        match self {
            Scale::Linear => level,
            Scale::Log => 10_f64.powf(level),
        }
    }
}

/// The smallest and largest value; none if there are no values.
pub fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((value.min(low), value.max(high))),
    })
}

/// An axis with its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    name: String,
    unit: String,
    scale: Scale,
    low: f64,
    high: f64,
    /// Whether only whole numbers are labelled.
    whole: bool,
}

/// The marks on an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisTicks {
    /// Ascending values and their labels.
    pub labelled: Vec<(f64, String)>,
    /// Values between them.
    pub minor: Vec<f64>,
    /// Power of ten by which labels are multiplied.
    power: i32,
}

impl Axis {
    /// An axis from `low` to `high`, which differ and [can be shown](Scale::holds). An empty `unit` means none.
    pub fn new(name: &str, unit: &str, scale: Scale, (low, high): (f64, f64)) -> Axis {
        debug_assert!(low.is_finite() && high.is_finite() && low < high, "{low} {high}");
        Axis { name: name.into(), unit: unit.into(), scale, low, high, whole: false }
    }

    /// An axis for counts from 0 to a little more than `most`.
    pub fn counts(name: &str, most: u64) -> Axis {
        Axis { whole: true, ..Axis::new(name, "", Scale::Linear, (0.0, 1.06 * most.max(1) as f64)) }
    }

    /// The smallest axis, with padding, for those of `values` that [can be shown](Scale::holds).
    pub fn over(name: &str, unit: &str, scale: Scale, values: impl IntoIterator<Item = f64>) -> Axis {
        let values = values.into_iter().filter(|value| scale.holds(*value));
        let (low, high) = range(values.map(|value| scale.level(value))).unwrap_or((0.0, 1.0));
        let (range, size) = (high - low, low.abs().max(high.abs()));
        let equal = match scale {
            Scale::Linear => range <= EQUAL * size,
            Scale::Log => range <= EQUAL,
        };
        let room = match scale {
            _ if !equal => PADDING * range,
            Scale::Linear if size > 0.0 => 0.1 * size,
            Scale::Linear => 1.0,
            Scale::Log => 0.2,
        };
        Axis::new(name, unit, scale, (scale.value(low - room), scale.value(high + room)))
    }

    /// The same axis from 0, if it is linear and only its padding is below 0.
    pub fn with_zero(self) -> Axis {
        let positive = self.low > -2.0 * PADDING * (self.high - self.low);
        if self.scale == Scale::Linear && positive { Axis { low: 0.0, ..self } } else { self }
    }

    /// The scale.
    pub fn scale(&self) -> Scale {
        self.scale
    }

    /// The smallest and the largest value.
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Whether `value` is between the ends.
    pub fn holds(&self, value: f64) -> bool {
        self.scale.holds(value) && (self.low..=self.high).contains(&value)
    }

    /// The position from 0 at the low end to 1 at the high end.
    pub fn share(&self, value: f64) -> f64 {
        let [low, high, at] = [self.low, self.high, value].map(|value| self.scale.level(value));
        (at - low) / (high - low)
    }

    /// Name and unit, with the power of ten of the labels.
    pub fn title(&self, ticks: &AxisTicks) -> String {
        let power = if ticks.power == 0 { String::new() } else { power_of_ten(ticks.power) };
        match format!("{power} {}", self.unit).trim() {
            "" => self.name.clone(),
            unit => format!("{} ({unit})", self.name),
        }
    }

    /// Ticks of a horizontal axis of `length` pixels.
    pub fn ticks_across(&self, length: f64) -> AxisTicks {
        self.ticks(length, &|label| width(label, SIZE) + BETWEEN)
    }

    /// Ticks of a vertical axis of `length` pixels.
    pub fn ticks_upwards(&self, length: f64) -> AxisTicks {
        self.ticks(length, &|_| LINE)
    }

    /// The densest ticks whose labels, of the pixels that `extent` returns, do not touch.
    fn ticks(&self, length: f64, extent: &dyn Fn(&str) -> f64) -> AxisTicks {
        let fits = |ticks: &AxisTicks| {
            ticks.labelled.windows(2).all(|pair| {
                let [a, b] = [&pair[0], &pair[1]];
                (self.share(b.0) - self.share(a.0)) * length >= 0.5 * (extent(&a.1) + extent(&b.1))
            })
        };
        let log = self.log_candidates(length).into_iter().find(|ticks| ticks.labelled.len() > 1 && fits(ticks));
        log.unwrap_or_else(|| {
            let first = tick_step((self.high - self.low) * LINE / length).max(if self.whole { 1.0 } else { 0.0 });
            let steps = std::iter::successors(Some(first), |step| Some(tick_step(1.01 * step))).take(12);
            // A step larger than the range gives at most one label.
            let fitting = steps.map(|step| self.linear(step)).find(fits);
            fitting.unwrap_or_else(|| self.linear(tick_step(self.high - self.low)))
        })
    }

    /// The multiples of `step`, a power of ten times 1, 2 or 5.
    fn linear(&self, step: f64) -> AxisTicks {
        let power = self.power();
        let labelled = multiples(step / ten_to(power), self.low / ten_to(power), self.high / ten_to(power));
        AxisTicks {
            labelled: labelled.map(|(label, value)| (value * ten_to(power), label)).collect(),
            minor: vec![],
            power,
        }
    }

    /// Candidates from dense to sparse; none on a linear axis.
    fn log_candidates(&self, length: f64) -> Vec<AxisTicks> {
        if self.scale == Scale::Linear {
            return Vec::new();
        }
        let decades = self.high.log10() - self.low.log10();
        let [first, last] = [self.low.log10().floor() as i32, self.high.log10().ceil() as i32];
        let digits = |digits: &[u8], stride: usize| -> Vec<(u8, i32)> {
            let powers = (first..=last).filter(|power| power.rem_euclid(stride as i32) == 0);
            let all = powers.flat_map(|power| digits.iter().map(move |digit| (*digit, power)));
            all.filter(|(digit, power)| self.holds(f64::from(*digit) * ten_to(*power))).collect()
        };
        let minor = match length / decades {
            decade if decade >= DIVIDED => digits(&[1, 2, 3, 4, 5, 6, 7, 8, 9], 1),
            decade if decade >= MIN_TICK => digits(&[1], 1),
            _ => Vec::new(),
        };
        let minor: Vec<f64> = minor.iter().map(|(digit, power)| f64::from(*digit) * ten_to(*power)).collect();
        // Either all labels are powers of ten, or all are multiplied by one.
        let plain =
            (-3.0..=4.0).contains(&self.low.log10().ceil()) && (-3.0..=4.0).contains(&self.high.log10().floor());
        let powers = !plain && decades > 3.0;
        let power = if plain || powers { 0 } else { self.power() };
        let label = |(digit, at): (u8, i32)| {
            let decimals = (power - at).max(0) as usize;
            let value = f64::from(digit) * ten_to(at);
            let label = if powers { power_of_ten(at) } else { format!("{:.decimals$}", value / ten_to(power)) };
            (value, label)
        };
        let candidate = |values: Vec<(u8, i32)>| {
            let labelled = values.into_iter().map(label).collect();
            AxisTicks { labelled, minor: minor.clone(), power }
        };
        let short = !powers && decades <= 2.5;
        let dense = [&[1, 2, 3, 5][..], &[1, 2, 5]].into_iter().filter(|_| short).map(|list| digits(list, 1));
        let sparse = [1, 2, 3, 5, 10, 20, 50].map(|stride| digits(&[1], stride));
        dense.chain(sparse).map(candidate).collect()
    }

    /// The power of ten of the labels: 0 if plain labels are short.
    fn power(&self) -> i32 {
        let size = self.low.abs().max(self.high.abs()).log10().floor() as i32;
        if (-3..5).contains(&size) { 0 } else { size.div_euclid(3) * 3 }
    }
}

/// Labels and values of the multiples of `step`, a power of ten times 1, 2 or 5, from `low` to `high`.
pub fn multiples(step: f64, low: f64, high: f64) -> impl Iterator<Item = (String, f64)> {
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let [first, last] = [(low / step).ceil(), (high / step).floor()].map(|bound| bound as i64);
    (first..=last).map(move |j| {
        let value = j as f64 * step;
        (format!("{value:.digits$}").replace('-', "\u{2212}"), value)
    })
}

/// The smallest of 1, 2 and 5 times a power of ten that is at least `least`.
pub fn tick_step(least: f64) -> f64 {
    let power = 10_f64.powi(least.log10().floor() as i32);
    [1.0, 2.0, 5.0].map(|digit| digit * power).into_iter().find(|step| *step >= least).unwrap_or(10.0 * power)
}

fn ten_to(power: i32) -> f64 {
    10_f64.powi(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_not_too_close() {
        for (least, step) in [(0.11, 0.2), (0.2, 0.2), (0.3, 0.5), (0.6, 1.0), (3.0, 5.0), (7e-4, 1e-3)] {
            assert!((tick_step(least) / step - 1.0_f64).abs() < 1e-12, "{least}");
        }
    }

    /// `title: label label …`
    fn shown(scale: Scale, low: f64, high: f64, length: f64) -> String {
        let axis = Axis::new("t", "length⁴", scale, (low, high));
        let ticks = axis.ticks_across(length);
        let labels: Vec<&str> = ticks.labelled.iter().map(|(_, label)| label.as_str()).collect();
        format!("{}: {}", axis.title(&ticks), labels.join(" "))
    }

    #[test]
    fn labels_are_as_people_write_them() {
        for (axis, expected) in [
            (shown(Scale::Linear, 0.0, 2.0, 300.0), "t (length⁴): 0.0 0.5 1.0 1.5 2.0"),
            (
                shown(Scale::Linear, -1.1e-6, 2e-6, 300.0),
                "t (10⁻⁶ length⁴): \u{2212}1.0 \u{2212}0.5 0.0 0.5 1.0 1.5 2.0",
            ),
            (shown(Scale::Linear, 0.0, 3e5, 200.0), "t (10³ length⁴): 0 100 200 300"),
            (shown(Scale::Log, 0.008, 12.0, 300.0), "t (length⁴): 0.01 0.1 1 10"),
            (shown(Scale::Log, 0.8, 12.0, 300.0), "t (length⁴): 1 2 3 5 10"),
            (shown(Scale::Log, 1e-9, 1.0, 300.0), "t (length⁴): 10⁻⁸ 10⁻⁶ 10⁻⁴ 10⁻² 10⁰"),
            (shown(Scale::Log, 1e-9, 1.0, 150.0), "t (length⁴): 10⁻⁹ 10⁻⁶ 10⁻³ 10⁰"),
            (shown(Scale::Log, 3e-7, 4e-6, 300.0), "t (10⁻⁶ length⁴): 0.3 0.5 1 2 3"),
            (shown(Scale::Log, 1.01, 1.3, 200.0), "t (length⁴): 1.1 1.2 1.3"),
        ] {
            assert_eq!(axis, expected);
        }
    }

    #[test]
    fn every_axis_has_ticks_inside_it_whatever_its_values() {
        let values = [0.0, 1.0, -1.0, 1e-99, -3e99, 1.0 + 1e-9, 1e-12, 1e12, 0.3, 7.0, f64::NAN, f64::INFINITY, 1e300];
        for scale in [Scale::Linear, Scale::Log] {
            for pair in values.iter().flat_map(|a| values.iter().map(move |b| [*a, *b])) {
                let axis = Axis::over("", "", scale, pair);
                for ticks in [axis.ticks_across(240.0), axis.ticks_upwards(120.0)] {
                    assert!((1..50).contains(&ticks.labelled.len()), "{pair:?} {axis:?} {ticks:?}");
                    let inside = |value: &f64| (-1e-9..=1.0 + 1e-9).contains(&axis.share(*value));
                    let all = ticks.labelled.iter().map(|(value, _)| value).chain(&ticks.minor);
                    assert!(all.into_iter().all(inside), "{pair:?} {axis:?} {ticks:?}");
                    assert!(ticks.labelled.iter().all(|(_, label)| label.len() < 12), "{pair:?} {ticks:?}");
                }
            }
        }
    }

    #[test]
    fn a_wide_range_of_positive_values_is_logarithmic() {
        assert_eq!(Scale::of([1.0, 29.0]), Scale::Linear);
        assert_eq!(Scale::of([1.0, f64::NAN, 31.0]), Scale::Log);
        assert_eq!(Scale::of([-1.0, 31.0]), Scale::Linear);
        assert_eq!(Scale::of([]), Scale::Linear);
    }
}
