//! Histograms: bins with round bounds, and the panel that shows them.

use glam::DVec2;

use crate::{
    axis::{Axis, Scale, range, tick_step},
    chart::{Colours, Panel},
    svg::{Svg, coordinate},
    trace,
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

/// A number of each member of one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellValues {
    /// The numbers of the members that have one, in any order.
    pub numbers: Vec<f64>,
    /// All members.
    pub members: u64,
}

impl CellValues {
    /// Sorts the numbers, and drops those that cannot be shown on a linear axis.
    pub fn sort(cells: &mut [CellValues]) {
        for cell in cells {
            cell.numbers.retain(|number| Scale::Linear.holds(*number));
            cell.numbers.sort_unstable_by(f64::total_cmp);
        }
    }

    /// A scale for the numbers of all cells, which are sorted: logarithmic if the middles of the cells span much.
    pub fn scale(cells: &[CellValues]) -> Scale {
        if let [cell] = cells {
            return Scale::of(cell.numbers.iter().copied());
        }
        let positive = cells.iter().filter_map(|cell| cell.numbers.first()).all(|number| Scale::Log.holds(*number));
        let middle = |cell: &CellValues| cell.numbers.get(cell.numbers.len() / 2).copied();
        if positive { Scale::of(cells.iter().filter_map(middle)) } else { Scale::Linear }
    }
}

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
        Bins::counted(sorted, scale, [low, high], advised(sorted, scale))
    }

    /// Bins with common bounds for cells of such values, some of which have any. Their width is the middle one of
    /// those that the cells would have alone.
    pub fn shared(cells: &[CellValues], scale: Scale) -> Vec<Bins> {
        if let [cell] = cells {
            return vec![Bins::of(&cell.numbers, scale)];
        }
        let filled = || cells.iter().map(|cell| &cell.numbers[..]).filter(|numbers| !numbers.is_empty());
        let levels = filled().flat_map(|numbers| [numbers[0], numbers[numbers.len() - 1]]);
        let (low, high) = range(levels).unwrap_or_default();
        let all = Bins::of(&[low, high], scale);
        if all.counts.len() == 1 {
            let count = |cell: &CellValues| cell.numbers.len() as u64;
            return cells.iter().map(|cell| Bins { counts: vec![count(cell)], ..all.clone() }).collect();
        }
        let mut widths: Vec<f64> = filled().map(|numbers| advised(numbers, scale)).collect();
        widths.sort_unstable_by(f64::total_cmp);
        let (width, ends) = (widths[widths.len() / 2], [low, high].map(|value| scale.level(value)));
        cells.iter().map(|cell| Bins::counted(&cell.numbers, scale, ends, width)).collect()
    }

    /// Counts values between the levels `low` and `high` in bins about as wide as `advised`.
    fn counted(values: &[f64], scale: Scale, [low, high]: [f64; 2], advised: f64) -> Bins {
        let range = high - low;
        let count = (range / advised).clamp(FEWEST, MOST);
        let width = tick_step(ROUNDING * range / count);
        let first = (low / width).floor();
        let bins = ((high / width).ceil() - first).max(1.0) as usize;
        let mut counts = vec![0; bins];
        for value in values {
            counts[((scale.level(*value) / width - first) as usize).min(bins - 1)] += 1;
        }
        let bounds = (0..=bins).map(|i| scale.value((first + i as f64) * width)).collect();
        Bins { bounds, counts }
    }

    /// Draws the tops of the bars as a line.
    pub fn draw_outline(&self, svg: &mut Svg, panel: &Panel) {
        let base = panel.end().y;
        let mut line = vec![DVec2::new(panel.across(self.bounds[0]), base)];
        for (pair, count) in self.bounds.windows(2).zip(&self.counts) {
            let top = if *count > 0 { panel.height(*count as f64).min(base - LEAST) } else { base };
            line.extend([pair[0], pair[1]].map(|bound| DVec2::new(panel.across(bound), top)));
        }
        line.push(DVec2::new(panel.across(self.bounds[self.bounds.len() - 1]), base));
        line.dedup();
        svg.path("series", &trace::path(&line));
    }

    /// Draws one cell as bars, or several as lines in their colours.
    pub fn draw_all(all: &[Bins], colours: &Colours, svg: &mut Svg, panel: &Panel) {
        if let [bins] = all {
            return bins.draw(svg, panel);
        }
        colours.each(svg, |svg, _, i| all[i].draw_outline(svg, panel));
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
        svg.group("s0", |svg| svg.path("bars", &data));
    }
}

/// The width of bins by Freedman and Diaconis for ascending values.
fn advised(sorted: &[f64], scale: Scale) -> f64 {
    let quantile = |share: f64| scale.level(sorted[(share * (sorted.len() - 1) as f64).round() as usize]);
    2.0 * (quantile(0.75) - quantile(0.25)) / (sorted.len() as f64).cbrt()
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
    fn cells_share_their_bounds_and_count_their_own_members() {
        let cell = |numbers: Vec<f64>| CellValues { members: numbers.len() as u64, numbers };
        for (first, other) in [
            (
                (0..500).map(|i| 1.0 + 0.001 * f64::from(i)).collect(),
                (0..90).map(|i| 3.0 + 0.01 * f64::from(i)).collect(),
            ),
            (vec![1.0; 20], vec![1.0; 7]),
            (vec![1.0; 20], vec![5.0; 7]),
            (vec![], vec![5.0, 7.0]),
        ] {
            let cells = [cell(first), cell(other), cell(vec![])];
            let shared = Bins::shared(&cells, Scale::Linear);
            assert!(shared.iter().all(|bins| bins.bounds == shared[0].bounds), "{shared:?}");
            for (bins, cell) in shared.iter().zip(&cells) {
                assert_eq!(bins.counts.iter().sum::<u64>(), cell.members);
                let above = |x: f64| cell.numbers.iter().filter(|v| **v > x).count() as u64;
                let middle = bins.counts.len() / 2;
                let room = 1e-9 * bins.bounds[middle].abs();
                let found: u64 = bins.counts[middle..].iter().sum();
                assert!((above(bins.bounds[middle] + room)..=above(bins.bounds[middle] - room)).contains(&found));
            }
        }
        let alone = cell((0..100).map(|i| f64::from(i).sqrt()).collect());
        assert_eq!(
            Bins::shared(std::slice::from_ref(&alone), Scale::Linear),
            [Bins::of(&alone.numbers, Scale::Linear)]
        );
    }

    #[test]
    fn bounds_are_round() {
        let values: Vec<f64> = (0..100).map(|i| 0.315 + 0.001 * i as f64).collect();
        assert_eq!(Bins::of(&values, Scale::Linear).bounds[..2], [0.31, 0.32]);
    }
}
