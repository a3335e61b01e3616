//! Relaxation times against a swept key: their median and spread, with a power law through them.

use glam::DVec2;

use super::{TIME, named_rows, only_panel, some};
use crate::{
    axis::{Axis, Scale, range},
    chart::{
        ChartText, Colours, Entry, EstimatedNumber, FOOT, Heading, LegendMark, Panel, draw_marker, triangle_right,
        triangle_up,
    },
    medium::Medium,
    svg::{Svg, coordinate},
    trace,
    width::{SIZE, shortened},
};
use curvelax_base::{interval::Interval, text::significant};

const HEIGHT: f64 = 300.0;
/// Height of a named setting with one series, and the height each further series adds.
const ROW: f64 = 26.0;
const FURTHER: f64 = 12.0;
/// More named settings than this are not drawn.
const MAX_ROWS: usize = 40;
/// Maximum pixels for the name of a setting.
const MAX_NAME: f64 = 200.0;
/// Maximum pixels between the series at one setting of a numeric key, and from the first to the last of them.
const ASIDE: f64 = 5.0;
const SPREAD: f64 = 24.0;

/// t_relax against a swept key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dependence<'a> {
    /// What is said of it, with the other keys, which distinguish the series.
    pub text: ChartText,
    /// The key.
    pub key: &'a str,
    /// One series, or one per setting of the other keys.
    pub series: Vec<Series>,
}

/// t_relax at all settings of the key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// The settings; those of a numeric key ascend.
    pub levels: Vec<DependencePoint>,
    /// The law fitted to them.
    pub fit: Option<PowerLawLine>,
}

/// t_relax at one setting of the key.
#[derive(Clone, Debug, PartialEq)]
pub struct DependencePoint {
    /// The setting.
    pub at: Setting,
    /// The median with its interval, in length⁴; none if too few members relaxed.
    pub median: Option<EstimatedNumber>,
    /// The 25 and 75 % quantiles, in length⁴; the upper one is none if too few members relaxed.
    pub quartiles: (Option<f64>, Option<f64>),
}

/// A setting of a key.
#[derive(Clone, Debug, PartialEq)]
pub enum Setting {
    /// Of a numeric key.
    Number(f64),
    /// Of a named key. If one is named, all are shown by name.
    Name(String),
}

/// t_relax = factor·keyᵖ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLawLine {
    /// p.
    pub exponent: EstimatedNumber,
    /// t_relax for a key of 1, in length⁴.
    pub factor: f64,
    /// Whether the medians are too far from any power law.
    pub rejected: bool,
}

impl DependencePoint {
    /// The interval of its median.
    fn interval(&self) -> Option<Interval> {
        self.median.and_then(|median| median.interval)
    }

    /// All its times that can be drawn.
    fn times(&self) -> impl Iterator<Item = f64> {
        let (value, interval) = self.median.map_or((None, None), |median| (Some(median.value), median.interval));
        let bounds = interval.map_or([None; 2], |interval| [interval.lower, interval.upper]);
        let all = [value, self.quartiles.0, self.quartiles.1].into_iter().chain(bounds);
        all.flatten().filter(|t| Scale::Linear.holds(*t))
    }

    fn number(&self) -> Option<f64> {
        match self.at {
            Setting::Number(value) => Some(value).filter(|value| Scale::Linear.holds(*value)),
            Setting::Name(_) => None,
        }
    }

    fn name(&self) -> String {
        match &self.at {
            Setting::Number(value) if Scale::Linear.holds(*value) => significant(*value, 3),
            Setting::Number(_) => "unknown".into(),
            Setting::Name(name) => name.clone(),
        }
    }

    /// Draws the point with its times at the positions that `place` returns, and the marker of this rank.
    fn draw(&self, svg: &mut Svg, time: &Axis, rank: usize, place: &dyn Fn(f64) -> DVec2) {
        let inside = |t: f64| t.clamp(time.range().0, time.range().1);
        let holds = |t: &f64| time.scale().holds(*t);
        let line = |low: f64, high: f64| {
            let [a, b] = [low, high].map(|t| place(inside(t)));
            trace::path(&[a, b])
        };
        let (low, high) = (self.quartiles.0.filter(holds), self.quartiles.1.filter(holds));
        if let Some(low) = low {
            // Open to the end of the axis if the upper quartile was not reached.
            svg.path("thin", &line(low, high.unwrap_or(time.range().1)));
        }
        // Open to the ends of the axis.
        let (start, end) = time.range();
        let ends = self.interval().map(|of| (of.lower.unwrap_or(start), of.upper.unwrap_or(end)));
        if let Some((low, high)) = ends.filter(|(low, high)| holds(low) && holds(high)) {
            svg.path("thick", &line(low, high));
        }
        if let Some(median) = self.median.map(|median| median.value).filter(holds) {
            draw_marker(svg, rank, place(inside(median)));
        }
    }
}

impl Series {
    /// The smallest and the largest of its settings to which a power law applies.
    fn span(&self) -> Option<(f64, f64)> {
        let positive = self.levels.iter().filter_map(DependencePoint::number).filter(|x| Scale::Log.holds(*x));
        range(positive).filter(|(low, high)| low < high)
    }

    /// Its law, if it has one that can be drawn.
    fn law(&self) -> Option<PowerLawLine> {
        let known = |fit: &PowerLawLine| Scale::Log.holds(fit.factor) && Scale::Linear.holds(fit.exponent.value);
        self.fit.filter(known).filter(|_| self.span().is_some())
    }

    /// Path data of the line of its law.
    fn line(&self, panel: &Panel) -> String {
        let (Some(PowerLawLine { exponent, factor, .. }), Some((low, high))) = (self.law(), self.span()) else {
            return String::new();
        };
        let at = |share: f64| low * (high / low).powf(share);
        let straight = panel.x.scale() == Scale::Log && panel.y.scale() == Scale::Log;
        let pieces = if straight { 1 } else { 100 };
        let settings = (0..=pieces).map(|i| at(f64::from(i) / f64::from(pieces)));
        panel.clipped(&panel.points(settings.map(|x| (x, factor * x.powf(exponent.value)))))
    }
}

impl Dependence<'_> {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let colours = Colours::of(self.series.len(), &self.text.key);
        let mut heading = self.text.heading([colours.sentence(self.series.len()), self.missing()]);
        if !self.levels().any(|level| level.times().next().is_some()) {
            let reason = match self.levels().count() {
                0 => "There are no cells to compare.",
                1 => "Too few members of the only cell relaxed for a median.",
                _ => "In no cell did enough members relax for a median.",
            };
            heading.sentences.pop();
            return heading.nothing(medium, reason);
        }
        heading.legend = self.legend(&colours);
        match self.named() {
            true => self.draw_named(medium, &colours, heading),
            false => self.draw_numeric(medium, &colours, &heading),
        }
    }

    fn levels(&self) -> impl Iterator<Item = &DependencePoint> {
        self.series.iter().flat_map(|series| &series.levels)
    }

    fn named(&self) -> bool {
        self.levels().any(|level| matches!(level.at, Setting::Name(_)))
    }

    /// A sentence about cells without a median.
    fn missing(&self) -> String {
        let missing = self.levels().filter(|level| level.median.is_none()).count();
        some(missing, "cell", "without a median: fewer than half of the members relaxed.")
    }

    /// The scale of an axis of these values: logarithmic if there is a power law, where all values allow it.
    fn scale(&self, values: &[f64]) -> Scale {
        let fitted = self.series.iter().any(|series| series.law().is_some());
        let scale = if fitted { Scale::Log } else { Scale::of(values.iter().copied()) };
        if values.iter().all(|v| scale.holds(*v)) { scale } else { Scale::Linear }
    }

    fn time_axis(&self) -> Axis {
        let times: Vec<f64> = self.levels().flat_map(DependencePoint::times).collect();
        let axis = Axis::over(&self.text.quantity, TIME, self.scale(&times), times.iter().copied());
        match range(times) {
            Some((low, high)) if low >= 0.0 && low < 0.5 * high => axis.with_zero(),
            _ => axis,
        }
    }

    fn draw_numeric(&self, medium: Medium, colours: &Colours, heading: &Heading) -> String {
        let settings: Vec<f64> = self.levels().filter_map(DependencePoint::number).collect();
        let across = Axis::over(self.key, "", self.scale(&settings), settings);
        let time = self.time_axis();
        only_panel(heading, medium, colours, [&across, &time], HEIGHT, |svg, panel| {
            panel.draw_frame(svg);
            colours.each(svg, |svg, rank, i| {
                let others = colours.shown.len() as f64 - 1.0;
                let aside = match colours.bar {
                    Some(_) => 0.0,
                    None => (SPREAD / others.max(1.0)).min(ASIDE) * (rank as f64 - 0.5 * others),
                };
                svg.path("dashed", &self.series[i].line(panel));
                for level in &self.series[i].levels {
                    let Some(x) = level.number() else { continue };
                    let x = (panel.across(x) + aside).clamp(panel.corner.x, panel.end().x);
                    level.draw(svg, &time, colours.rank(rank), &|t| DVec2::new(x, panel.height(t)));
                    if level.median.is_none() {
                        svg.path("solid", &triangle_up(DVec2::new(x, panel.corner.y + 8.0)));
                    }
                }
            });
        })
    }

    /// Draws named settings one below the other, with time across, so that names are not rotated.
    fn draw_named(&self, medium: Medium, colours: &Colours, mut heading: Heading) -> String {
        let mut names: Vec<String> = Vec::new();
        for level in self.levels() {
            let name = level.name();
            if !names.contains(&name) {
                names.push(name);
            }
        }
        if names.len() > MAX_ROWS {
            heading.sentences.push(format!("The first {MAX_ROWS} of {} settings are drawn.", names.len()));
            names.truncate(MAX_ROWS);
        }
        let row = ROW + FURTHER * (colours.shown.len().min(crate::style::SERIES) as f64 - 1.0).max(0.0);
        let height = row * names.len() as f64;
        let (mut svg, top) = heading.begin(medium, 28.0 + height + FOOT);

        let (time, most) = (self.time_axis(), medium.name(MAX_NAME));
        let shown: Vec<String> = names.iter().map(|name| shortened(name, SIZE, most)).collect();
        let key = shortened(self.key, SIZE, most);
        let rows = Axis::new("", "", Scale::Linear, (0.0, names.len() as f64));
        let (extent, room) = ((top + 28.0, height), colours.room(height));
        let panel = named_rows(&mut svg, [&time, &rows], (&shown, &key), extent, room);
        let left = panel.corner.x;
        svg.text("note end", DVec2::new(left - 8.0, panel.corner.y - 9.0), &key);
        let middle = |i: usize| panel.corner.y + (i as f64 + 0.5) * row;
        for (i, name) in shown.iter().enumerate() {
            svg.text("y tick end", DVec2::new(left - 8.0, middle(i) + 4.0), name);
        }
        let lines: String = (1..names.len())
            .map(|i| {
                format!("M{} {}h{}", coordinate(left), coordinate(middle(i) - 0.5 * row), coordinate(panel.size.x))
            })
            .collect();
        svg.path("grid", &lines);
        colours.each(&mut svg, |svg, rank, i| {
            let apart = (row - 14.0) / colours.shown.len() as f64;
            let aside = apart * (rank as f64 - 0.5 * (colours.shown.len() as f64 - 1.0));
            for level in &self.series[i].levels {
                let Some(at) = names.iter().position(|name| *name == level.name()) else { continue };
                let y = middle(at) + aside;
                level.draw(svg, &time, colours.rank(rank), &|t| DVec2::new(panel.across(t), y));
                if level.median.is_none() {
                    svg.path("solid", &triangle_right(DVec2::new(panel.end().x - 8.0, y)));
                }
            }
        });
        panel.draw_frame(&mut svg);
        colours.draw_bar(&mut svg, &panel);
        svg.finish()
    }

    fn legend(&self, colours: &Colours) -> Vec<Entry> {
        let several = self.series.len() > 1;
        let neutral = if several { "faint" } else { "s0" };
        let distinct = colours.shown.iter().filter(|_| several && colours.bar.is_none());
        let label = |i: usize| match (self.series[i].law(), &self.text.key.labels[i]) {
            (Some(fit), label) => format!("{label}: p = {}", fit.exponent.shown()),
            (None, label) => label.clone(),
        };
        let series = distinct.map(|(i, class)| Entry::new(class, LegendMark::Marker(*i), &label(*i)));
        let any = |has: &dyn Fn(&DependencePoint) -> bool, mark: LegendMark, label: &str| {
            self.levels().any(has).then(|| Entry::new(neutral, mark, label))
        };
        let median = any(&|level| level.median.is_some() && !several, LegendMark::Marker(0), "median");
        let has_range = |level: &DependencePoint| level.interval().is_some_and(|interval| interval.range_of.is_some());
        let interval_of_medians = match self.levels().any(has_range) {
            true => "interval of the median: 95 %, or the range of fewer than 6",
            false => "95 % interval of the median",
        };
        let interval = any(&|level| level.interval().is_some(), LegendMark::Thick, interval_of_medians);
        let quartiles = any(&|level| level.quartiles.0.is_some(), LegendMark::Thin, "25 to 75 % of the members");
        let pointer = if self.named() { LegendMark::Right } else { LegendMark::Up };
        let beyond = any(&|level| level.median.is_none(), pointer, "median not reached");
        let fit = self.series.iter().find_map(Series::law).map(|fit| {
            let exponent = if several { String::new() } else { format!(", p = {}", fit.exponent.shown()) };
            let verdict = if fit.rejected { "; χ² rejects a power law" } else { "" };
            let law = format!("fit: {} ∝ {}ᵖ{exponent}{verdict}", self.text.quantity, self.key);
            Entry::new(neutral, LegendMark::Dashed, &law)
        });
        series.chain(median).chain(interval).chain(quartiles).chain(beyond).chain(fit).collect()
    }
}
