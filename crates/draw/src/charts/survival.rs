//! Survival curves: the fraction of members that has not relaxed yet, cell by cell (Kaplan and Meier).

use std::iter;

use glam::DVec2;

use super::{Band, TIME, draw_band, only_panel, shows_bands};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Colours, Entry, LegendMark, Panel, stroke},
    medium::Medium,
    trace,
};

const HEIGHT: f64 = 300.0;
/// Fraction of the members, and of a time, that is less than a tenth of a pixel.
const FINEST: f64 = 1.0 / 4096.0;
/// Maximum censoring strokes, over all curves.
const MAX_STROKES: f64 = 1200.0;
/// Minimum pixels between two of them on a curve.
const STROKE_GAP: f64 = 3.0;

/// Survival curves of the cells of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Survival<'a> {
    /// What is said of it.
    pub text: ChartText,
    /// What the height of a curve is.
    pub share: &'a str,
    /// The sentence in the place of the curves if there are none.
    pub none: &'a str,
    /// The curves, in the order of the legend.
    pub curves: Vec<SurvivalCurve>,
}

/// Curves of relaxation times.
impl Default for Survival<'_> {
    fn default() -> Self {
        let (share, none) = ("share not relaxed", "There are no members, so there is nothing to survive.");
        Survival { text: ChartText::default(), share, none, curves: Vec::new() }
    }
}

/// The survival curve of one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurvivalCurve {
    /// Times at which members relaxed, ascending, in length⁴.
    pub t: Vec<f64>,
    /// Fraction that has not relaxed after each of those times, in [0, 1].
    pub survival: Vec<f64>,
    /// Lower and upper bounds of the fractions, or nothing.
    pub band: Option<Band>,
    /// Times at which members were censored, ascending, in length⁴.
    pub censored: Vec<f64>,
}

impl SurvivalCurve {
    /// Adds a step at a time after all others, to the fraction `survival`, within `bounds`. Steps before the curve has
    /// fallen visibly are merged into one, at the last of them.
    pub fn add_step(&mut self, t: f64, survival: f64, bounds: (f64, f64)) {
        let (low, high) = self.band.get_or_insert_default();
        // The fraction before the last step.
        let before = match self.survival[..] {
            [.., before, _] => before,
            [_] => 1.0,
            [] => f64::INFINITY,
        };
        let is_one_with_the_last = before - survival < FINEST;
        for (all, next) in [(&mut self.t, t), (&mut self.survival, survival), (low, bounds.0), (high, bounds.1)] {
            if is_one_with_the_last {
                all.pop();
            }
            all.push(next);
        }
    }

    /// Adds a member censored at a time not before any other, unless its stroke would cover the last one.
    pub fn add_censored(&mut self, t: f64) {
        if self.censored.last().is_none_or(|last| t - last > FINEST * t) {
            self.censored.push(t);
        }
    }

    /// All times, ascending within each kind.
    fn times(&self) -> impl Iterator<Item = f64> + '_ {
        self.t.iter().chain(&self.censored).copied()
    }

    /// Times by which a quarter, half and three quarters of the members have relaxed, if they have.
    fn quartiles(&self) -> impl Iterator<Item = f64> + '_ {
        let by = |share: f64| self.survival.partition_point(|survival| *survival > share);
        [0.75, 0.5, 0.25].map(by).into_iter().filter_map(|at| self.t.get(at).copied())
    }

    /// Time at which the last member relaxed or was censored.
    fn end(&self, scale: Scale) -> Option<f64> {
        self.times().filter(|t| scale.holds(*t)).reduce(f64::max)
    }

    /// Corners of the steps of one of its lines, from the start to the end.
    fn line(&self, shares: &[f64], panel: &Panel, least: f64) -> Vec<DVec2> {
        let (time, share) = (panel.x.scale(), Scale::Linear);
        let Some(end) = self.end(time) else { return Vec::new() };
        let pairs = self.t.iter().zip(shares).filter(|(t, s)| time.holds(**t) && share.holds(**s));
        let start = DVec2::new(panel.corner.x, panel.height(1.0));
        let last = pairs.clone().next_back().map_or(start.y, |(_, s)| panel.height(*s));
        let places = pairs.map(|(t, s)| DVec2::new(panel.across(*t), panel.height(*s)));
        let end = DVec2::new(panel.across(end), last);
        trace::steps(iter::once(start).chain(places).chain([end]), least)
    }

    /// Path data of the strokes where members were censored.
    fn strokes(&self, panel: &Panel, least: f64) -> String {
        let mut data = String::new();
        let mut before = f64::NEG_INFINITY;
        for t in self.censored.iter().filter(|t| panel.x.scale().holds(**t)) {
            let x = panel.across(*t);
            if x - before >= least {
                // The fraction after the last relaxation up to then.
                let relaxed = self.t.partition_point(|time| time <= t).min(self.survival.len());
                let share = self.survival[..relaxed].last().copied().filter(|share| Scale::Linear.holds(*share));
                data += &stroke(DVec2::new(x, panel.height(share.unwrap_or(1.0))));
                before = x;
            }
        }
        data
    }
}

impl Survival<'_> {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let Survival { text, curves, .. } = self;
        let colours = Colours::of(curves.len(), &text.key);
        let mut heading = text.heading([colours.sentence(curves.len())]);
        if curves.iter().all(|curve| curve.end(Scale::Linear).is_none()) {
            return heading.nothing(medium, self.none);
        }
        let (bands, censored) = (self.has_bands(), self.has_strokes());
        heading.legend = self.legend(&colours, bands, censored);
        let times = || curves.iter().flat_map(SurvivalCurve::times);
        let scale = Scale::of(curves.iter().flat_map(SurvivalCurve::quartiles));
        let scale = if times().any(|t| scale.holds(t)) { scale } else { Scale::Linear };
        let across = Axis::over(&text.quantity, TIME, scale, times()).with_zero();
        let upwards = Axis::new(self.share, "", Scale::Linear, (0.0, 1.02));
        only_panel(&heading, medium, &colours, [&across, &upwards], HEIGHT, |svg, panel| {
            panel.draw_frame(svg);
            let least = trace::tolerance(colours.shown.len() * if bands { 3 } else { 1 }, HEIGHT);
            let stroke_gap = (colours.shown.len() as f64 * panel.size.x / MAX_STROKES).max(STROKE_GAP);
            colours.each(svg, |svg, _, i| {
                let curve = &curves[i];
                draw_band(svg, curve.band.as_ref().filter(|_| bands), |shares| curve.line(shares, panel, least));
                svg.path("series", &trace::path(&curve.line(&curve.survival, panel, least)));
                svg.path("thin", &curve.strokes(panel, stroke_gap));
            });
        })
    }

    /// Whether bands are drawn.
    pub fn has_bands(&self) -> bool {
        shows_bands(self.curves.iter().map(|curve| &curve.band))
    }

    /// Whether strokes mark censored members.
    pub fn has_strokes(&self) -> bool {
        self.curves.iter().any(|curve| !curve.censored.is_empty())
    }

    fn legend(&self, colours: &Colours, bands: bool, censored: bool) -> Vec<Entry> {
        let band = bands.then(|| Entry::new("faint", LegendMark::Band, "95 % band"));
        let stroke = censored.then(|| Entry::new("faint", LegendMark::Stroke, "censored"));
        colours.legend().into_iter().chain(band).chain(stroke).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_of_many_steps_keeps_those_that_show() {
        for members in [1, 7, 4000, 100_000] {
            let mut curve = SurvivalCurve::default();
            let share = |i: usize| 1.0 - (i + 1) as f64 / members as f64;
            let all: Vec<(f64, f64)> = (0..members).map(|i| ((i as f64).sqrt(), share(i))).collect();
            all.iter().for_each(|(t, s)| curve.add_step(*t, *s, (s - 0.01, s + 0.01)));
            assert_eq!(curve.t.len(), curve.survival.len());
            assert!(if members <= 4000 { curve.t.len() == members } else { curve.t.len() <= 4200 }, "{members}");
            assert_eq!((curve.t.last(), curve.survival.last()), (all.last().map(|l| &l.0), Some(&0.0)));
            for (t, share) in &all {
                let passed = curve.t.partition_point(|kept| kept <= t);
                let shown = passed.checked_sub(1).map_or(1.0, |last| curve.survival[last]);
                assert!((0.0..=FINEST).contains(&(shown - share)), "{members}: {t}: {shown} {share}");
            }
            let (low, high) = curve.band.unwrap();
            assert!(low.iter().zip(&curve.survival).all(|(low, s)| *low == s - 0.01) && high.len() == low.len());
        }
        let mut curve = SurvivalCurve::default();
        (0..100_000).for_each(|i| curve.add_censored(1.0 + 1e-5 * f64::from(i)));
        assert!((2000..4000).contains(&curve.censored.len()), "{}", curve.censored.len());
    }
}
