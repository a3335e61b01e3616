//! Histograms: bins with round bounds, and the panel that shows them.

use glam::DVec2;

use crate::draw::{
    axis::{Axis, Scale, tick_step},
    chart::Panel,
    svg::{Svg, coordinate},
};

/// Minimum and maximum number of bins wanted; rounding changes the number by up to a half.
const FEWEST: f64 = 12.0;
const MOST: f64 = 60.0;
/// Widths are rounded to the next round number above this fraction of the width wanted, so about as often up as down.
const ROUNDING: f64 = 0.64;
/// Values whose range, relative to their size, is smaller go into one bin.
const EQUAL: f64 = 1e-6;
/// Minimum height of a bin in pixels, so that a single member among a million shows.
const LEAST: f64 = 1.5;

/// Numbers of members between bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Bins {
    /// Ascending bounds, one more than there are bins.
    pub bounds: Vec<f64>,
    /// Members in each bin.
    pub counts: Vec<u64>,
}

impl Bins {
    /// Bins for ascending values that [can be shown](Scale::holds) on the scale; at least one value.
    ///
    /// Their width follows Freedman and Diaconis, 2·IQR/∛n, rounded to 1, 2 or 5 times a power of ten.
    pub fn of(sorted: &[f64], scale: Scale) -> Bins {
        let level = |place: usize| scale.level(sorted[place]);
        let [low, high] = [level(0), level(sorted.len() - 1)];
        let range = high - low;
        let equal = range <= EQUAL * if scale == Scale::Log { 1.0 } else { low.abs().max(high.abs()) };
        if equal {
            let around = |share: f64| match scale {
                Scale::Log => scale.value(low + share),
                Scale::Linear if low == 0.0 => share,
                Scale::Linear => low + low.abs() * share,
            };
            return Bins { bounds: vec![around(-0.01), around(0.01)], counts: vec![sorted.len() as u64] };
        }
        let quantile = |share: f64| level((share * (sorted.len() - 1) as f64).round() as usize);
        let advised = 2.0 * (quantile(0.75) - quantile(0.25)) / (sorted.len() as f64).cbrt();
        let count = (range / advised).clamp(FEWEST, MOST);
        let width = tick_step(ROUNDING * range / count);
        let first = (low / width).floor();
        let bins = ((high / width).ceil() - first).max(1.0) as usize;
        let mut counts = vec![0; bins];
        for value in sorted {
            counts[((scale.level(*value) / width - first) as usize).min(bins - 1)] += 1;
        }
        let bounds = (0..=bins).map(|i| scale.value((first + i as f64) * width)).collect();
        Bins { bounds, counts }
    }

    /// The largest count.
    pub fn most(&self) -> u64 {
        self.counts.iter().copied().max().unwrap_or(0)
    }

    /// An axis for all bins, including 0 if they come near it.
    pub fn axis(&self, name: &str, unit: &str, scale: Scale) -> Axis {
        if let [low, high] = self.bounds[..] {
            // A bar in the middle, not a wall.
            let [low, high] = [low, high].map(|bound| scale.level(bound));
            let ends = [low - 8.0 * (high - low), high + 8.0 * (high - low)].map(|level| scale.value(level));
            return Axis::over(name, unit, scale, ends);
        }
        let axis = Axis::over(name, unit, scale, self.bounds.iter().copied());
        let (low, high) = axis.range();
        if self.bounds[0] >= 0.0 && low < 0.3 * high { axis.with_zero() } else { axis }
    }

    /// Draws the bars.
    pub fn draw(&self, svg: &mut Svg, panel: &Panel) {
        let base = panel.end().y;
        let mut data = String::new();
        for (pair, count) in self.bounds.windows(2).zip(&self.counts).filter(|(_, count)| **count > 0) {
            let top = panel.height(*count as f64).min(base - LEAST);
            let (left, right) = (panel.across(pair[0]), panel.across(pair[1]));
            // A gap between bars, unless they are thin.
            let gap = if right - left > 4.0 { 0.5 } else { 0.0 };
            let [left, right, top, base] = [left + gap, right - gap, top, base].map(coordinate);
            data += &format!("M{left} {base}V{top}H{right}V{base}Z");
        }
        svg.open("s0");
        svg.path("bars", &data);
        svg.close();
    }
}

/// Draws a dashed line up the whole panel.
pub fn guide(svg: &mut Svg, panel: &Panel, x: f64) {
    let at = coordinate(panel.across(x));
    svg.path("dashed", &format!("M{at} {}V{}", coordinate(panel.end().y), coordinate(panel.corner.y)));
}

/// Draws the interval from `low` to `high` over the height of the panel, as far as it is inside.
pub fn interval(svg: &mut Svg, panel: &Panel, (low, high): (f64, f64)) {
    let [left, right] = [low, high].map(|x| panel.across(x).clamp(panel.corner.x, panel.end().x));
    if left < right {
        let corner = DVec2::new(left, panel.corner.y);
        svg.rectangle("band", corner, DVec2::new(right - left, panel.size.y), 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_one_bin() {
        for (values, scale) in [
            (vec![1.0], Scale::Linear),
            (vec![0.0; 5], Scale::Linear),
            (vec![3.0, 3.0 + 1e-12], Scale::Log),
            ((0..1000).map(|i| (i as f64).powi(2)).collect(), Scale::Linear),
            ((0..1000).map(|i| 1e-8 * 1.03_f64.powi(i)).collect(), Scale::Log),
            (vec![-3.0, -1.0, 0.0, 0.2, 1e9], Scale::Linear),
        ] {
            let bins = Bins::of(&values, scale);
            for (pair, count) in bins.bounds.windows(2).zip(&bins.counts) {
                // A value on a bound may be on either side of it, by rounding.
                let within = |room: f64| {
                    let room = room * (pair[1] - pair[0]);
                    values.iter().filter(|v| (pair[0] - room..=pair[1] + room).contains(v)).count() as u64
                };
                assert!((within(-1e-9)..=within(1e-9)).contains(count), "{pair:?} {count}");
            }
            assert_eq!(bins.counts.iter().sum::<u64>(), values.len() as u64);
            assert_eq!(bins.bounds.len(), bins.counts.len() + 1);
            assert!(bins.counts.len() <= 96 && bins.bounds.is_sorted(), "{bins:?}");
            let (low, high) = (bins.bounds[0], bins.bounds[bins.counts.len()]);
            assert!(values.iter().all(|v| (low..=high).contains(v)), "{bins:?}");
        }
    }

    #[test]
    fn bounds_are_round() {
        let values: Vec<f64> = (0..100).map(|i| 0.315 + 0.001 * i as f64).collect();
        assert_eq!(Bins::of(&values, Scale::Linear).bounds[..2], [0.31, 0.32]);
    }
}
