//! The parts of all charts: a heading with sentences and a legend, panels with axes, colours of curves.
//!
//! A chart is laid out from top to bottom in this order. Text widths are known only [roughly](super::width), from
//! above.

use glam::DVec2;

use super::{
    axis::{Axis, Scale, range},
    empty::{NOTHING, say},
    medium::Medium,
    style,
    svg::{Svg, coordinate, dots},
    trace,
    width::{LINE, SIZE, TITLE, distinct, shortened, width, wrapped},
};
use curvelax_base::{interval::Interval, text::significant};

/// Margin at the left and right of a chart.
pub const MARGIN: f64 = 20.0;
/// Space below a panel for tick labels and the name of the axis.
pub const FOOT: f64 = 52.0;
/// Space above a panel that has a heading.
pub const HEADING: f64 = 22.0;

const TITLE_LINE: f64 = 20.0;
/// Most pixels of a name next to a colour bar.
const MAX_NAME: f64 = 90.0;
const LEGEND_LINE: f64 = 20.0;
const SAMPLE: f64 = 26.0;
const AXIS_SIZE: f64 = 13.0;
const TICK: f64 = 5.0;
const MINOR_TICK: f64 = 3.0;
/// More curves than this are not drawn: they would hide each other.
const MAX_CURVES: usize = 24;
/// Width of the colour bar itself.
const BAR: f64 = 14.0;

/// An estimated number with its bounds, if known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EstimatedNumber {
    /// The number.
    pub value: f64,
    /// Its interval; `None` if unknown.
    pub interval: Option<Interval>,
}

impl EstimatedNumber {
    /// `0.412 (95 %: 0.401 to 0.420)`, `0.412 (range of 4, covers 87.5 %: 0.3 to 0.5)`.
    pub fn shown(&self) -> String {
        let value = significant(self.value, 3);
        match self.interval {
            Some(interval) => format!("{value} ({})", interval.in_short(|end| significant(end, 3))),
            None => value,
        }
    }
}

/// How an entry of a legend is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LegendMark {
    /// A line in the dash pattern of its class.
    Series,
    /// A dashed line.
    Dashed,
    /// A thin line.
    Thin,
    /// A thick line.
    Thick,
    /// An area.
    Band,
    /// The [marker](draw_marker) of the series of this rank.
    Marker(usize),
    /// One of many dots.
    Points,
    /// A triangle that points up.
    Up,
    /// The outline of one.
    HollowUp,
    /// A triangle that points right.
    Right,
    /// The short stroke of a censored member.
    Stroke,
    /// Nothing: its label continues the line above.
    More,
}

/// An entry of a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Class of its colour.
    pub class: String,
    /// How it is drawn.
    pub mark: LegendMark,
    /// What it stands for.
    pub label: String,
}

impl Entry {
    /// An entry in the colour of `class`.
    pub fn new(class: &str, mark: LegendMark, label: &str) -> Entry {
        Entry { class: class.into(), mark, label: label.into() }
    }

    /// Pixels of the sample before the label.
    fn sample(&self) -> f64 {
        match self.mark {
            LegendMark::Series | LegendMark::Dashed | LegendMark::Thin | LegendMark::Thick | LegendMark::Band => SAMPLE,
            LegendMark::More => 0.0,
            _ => 10.0,
        }
    }

    fn draw(&self, svg: &mut Svg, at: DVec2) {
        let [x, y] = at.to_array().map(coordinate);
        let middle = at + DVec2::new(0.5 * self.sample(), 0.0);
        let line = format!("M{x} {y}h{SAMPLE}");
        svg.group(&self.class, |svg| match self.mark {
            LegendMark::Series => svg.path("series", &line),
            LegendMark::Dashed => svg.path("dashed", &line),
            LegendMark::Thin => svg.path("thin", &line),
            LegendMark::Thick => svg.path("thick", &line),
            LegendMark::Band => svg.rectangle("band", at - DVec2::new(0.0, 5.0), DVec2::new(SAMPLE, 10.0), 0.0),
            LegendMark::Marker(rank) => draw_marker(svg, rank, middle),
            LegendMark::Points => svg.path("points", &dots(&[middle])),
            LegendMark::Up => svg.path("solid", &triangle_up(middle)),
            LegendMark::HollowUp => svg.path("hollow", &triangle_up(middle)),
            LegendMark::Right => svg.path("solid", &triangle_right(middle)),
            LegendMark::Stroke => svg.path("thin", &stroke(middle)),
            LegendMark::More => {}
        });
    }
}

/// Draws the marker of the series of this rank; each of the [series](style::SERIES) has its own shape.
pub fn draw_marker(svg: &mut Svg, rank: usize, at: DVec2) {
    let [x, y] = at.to_array().map(coordinate);
    let square = format!("M{x} {y}m-3.6 -3.6h7.2v7.2h-7.2Z");
    let diamond = format!("M{x} {y}m0 -5l5 5l-5 5l-5 -5Z");
    match rank % style::SERIES {
        0 => svg.path("dots", &dots(&[at])),
        1 => svg.path("solid", &square),
        2 => svg.path("solid", &diamond),
        3 => svg.path("hollow", &format!("M{x} {y}m-4 0a4 4 0 0 0 8 0a4 4 0 0 0 -8 0Z")),
        4 => svg.path("hollow", &square),
        5 => svg.path("hollow", &diamond),
        6 => svg.path("cross", &format!("M{x} {y}m-4 -4l8 8m0 -8l-8 8")),
        _ => svg.path("cross", &format!("M{x} {y}m-5 0h10m-5 -5v10")),
    }
}

/// Path data of a triangle about `at` that points up.
pub fn triangle_up(at: DVec2) -> String {
    let [x, y] = (at - DVec2::new(0.0, 5.0)).to_array().map(coordinate);
    format!("M{x} {y}l5 9h-10Z")
}

/// Path data of a triangle about `at` that points right.
pub fn triangle_right(at: DVec2) -> String {
    let [x, y] = (at + DVec2::new(5.0, 0.0)).to_array().map(coordinate);
    format!("M{x} {y}l-9 5v-10Z")
}

/// Path data of a short upright stroke about `at`.
pub fn stroke(at: DVec2) -> String {
    let [x, y] = (at - DVec2::new(0.0, 4.0)).to_array().map(coordinate);
    format!("M{x} {y}v8")
}

/// The text above the panels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heading<'a> {
    /// The title, also for screen readers.
    pub title: &'a str,
    /// Sentences below it, each a paragraph; empty ones are omitted.
    pub sentences: Vec<String>,
    /// The legend; entries without a label are omitted.
    pub legend: Vec<Entry>,
}

impl Heading<'_> {
    /// Begins a picture with this heading and `body` pixels below it; returns where these begin.
    pub fn begin(&self, medium: Medium, body: f64) -> (Svg, f64) {
        let (full, room) = (medium.width(), medium.width() - 2.0 * MARGIN);
        // On paper a caption has both.
        let (title, sentences) = if medium.is_screen() { (self.title, &self.sentences[..]) } else { ("", &[][..]) };
        let titles = wrapped(title, TITLE, room);
        let lines: Vec<String> = sentences.iter().flat_map(|text| wrapped(text, SIZE, room)).collect();
        let rows = self.rows(room, medium);
        let above = [(titles.len(), TITLE_LINE), (lines.len(), LINE), (rows.len(), LEGEND_LINE)];
        let top = 22.0 + above.iter().map(|(count, height)| *count as f64 * height).sum::<f64>();

        let mut svg = Svg::new(full, top + body, &style::chart(medium), self.title);
        svg.rectangle("back", DVec2::ZERO, DVec2::new(full, top + body), 0.0);
        let mut y = 6.0;
        let mut next = |height: f64| {
            y += height;
            DVec2::new(MARGIN, y)
        };
        titles.iter().for_each(|line| svg.text("head", next(TITLE_LINE), line));
        lines.iter().for_each(|line| svg.text("note", next(LINE), line));
        for row in rows {
            let left = next(LEGEND_LINE);
            for (x, entry) in row {
                let at = left + DVec2::new(x, 2.0);
                entry.draw(&mut svg, at - DVec2::new(0.0, 4.0));
                svg.text("label", at + DVec2::new(entry.sample() + 6.0, 0.0), &entry.label);
            }
        }
        (svg, top)
    }

    /// A picture with this heading that says why there is nothing to draw; [`reason`](super::empty::reason) finds it.
    pub fn nothing(&self, medium: Medium, reason: &str) -> String {
        let (mut svg, top) = self.begin(medium, 180.0);
        let size = DVec2::new(medium.width() - 2.0 * MARGIN, 180.0 - MARGIN);
        svg.group(NOTHING, |svg| say(svg, DVec2::new(MARGIN, top), size, reason));
        svg.finish()
    }

    /// The rows of the legend, each entry with its position. A label that is too long is cut on a screen, where the
    /// text of the page has the rest, and broken into lines on paper.
    fn rows(&self, room: f64, medium: Medium) -> Vec<Vec<(f64, Entry)>> {
        let most = room - SAMPLE - 6.0;
        let fitted = |entry: &Entry| -> Vec<Entry> {
            let lines = match medium {
                Medium::Screen | Medium::Page => vec![shortened(&entry.label, SIZE, most)],
                Medium::Paper(_) => wrapped(&entry.label, SIZE, most),
            };
            let mark = |i: usize| if i == 0 { entry.mark } else { LegendMark::More };
            lines.iter().enumerate().map(|(i, line)| Entry::new(&entry.class, mark(i), line)).collect()
        };
        let entries: Vec<Entry> = self.legend.iter().filter(|entry| !entry.label.is_empty()).flat_map(fitted).collect();
        let extent = |entry: &Entry| entry.sample() + 24.0 + width(&entry.label, SIZE);
        let mut rows: Vec<Vec<(f64, Entry)>> = Vec::new();
        let (mut end, mut indent) = (f64::INFINITY, 0.0);
        for entry in entries {
            if entry.mark == LegendMark::More {
                rows.push(vec![(indent, entry)]);
                end = f64::INFINITY;
                continue;
            }
            let extent = extent(&entry);
            indent = entry.sample();
            if end + extent - 18.0 > room {
                rows.push(Vec::new());
                end = 0.0;
            }
            rows.last_mut().expect("pushed above").push((end, entry));
            end += extent;
        }
        rows
    }
}

/// Axes with room for data.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// A line above it, or empty.
    pub heading: String,
    /// The upper left corner, in pixels.
    pub corner: DVec2,
    /// Width and height, in pixels.
    pub size: DVec2,
    /// Horizontal axis.
    pub x: &'a Axis,
    /// Vertical axis.
    pub y: &'a Axis,
    /// Whether the horizontal axis has labels; otherwise those of a panel below apply.
    pub labels_x: bool,
}

impl<'a> Panel<'a> {
    /// A panel without a heading, with labels on both axes.
    pub fn new(corner: DVec2, size: DVec2, [x, y]: [&'a Axis; 2]) -> Panel<'a> {
        Panel { heading: String::new(), corner, size, x, y, labels_x: true }
    }

    /// Space needed at the left of a panel of this height.
    pub fn left(y: &Axis, height: f64) -> f64 {
        let labels = y.ticks_upwards(height).labelled.into_iter().map(|(_, label)| width(&label, SIZE));
        MARGIN + AXIS_SIZE + 16.0 + labels.fold(0.0, f64::max)
    }

    /// The lower right corner.
    pub fn end(&self) -> DVec2 {
        self.corner + self.size
    }

    /// The horizontal position of a value, in pixels.
    pub fn across(&self, x: f64) -> f64 {
        self.corner.x + self.size.x * self.x.share(x)
    }

    /// The vertical position of a value, in pixels, restricted to the panel.
    pub fn height(&self, y: f64) -> f64 {
        // y grows downwards in SVG.
        self.end().y - self.size.y * self.y.share(y).clamp(0.0, 1.0)
    }

    /// The position of a point, inside the panel or not.
    pub fn place(&self, x: f64, y: f64) -> DVec2 {
        DVec2::new(self.across(x), self.end().y - self.size.y * self.y.share(y))
    }

    /// The positions of those points that can be shown on axes of these scales, inside the panel or not.
    pub fn points(&self, points: impl IntoIterator<Item = (f64, f64)>) -> Vec<DVec2> {
        let shown = points.into_iter().filter(|(x, y)| self.x.scale().holds(*x) && self.y.scale().holds(*y));
        shown.map(|(x, y)| self.place(x, y)).collect()
    }

    /// Path data of the parts of a line that are inside.
    pub fn clipped(&self, line: &[DVec2]) -> String {
        trace::clipped(line, self.corner, self.end()).iter().map(|part| trace::path(part)).collect()
    }

    /// Draws both axes.
    pub fn draw_axes(&self, svg: &mut Svg) {
        self.draw_x(svg);
        self.draw_y(svg);
    }

    /// Draws the border and the heading.
    pub fn draw_frame(&self, svg: &mut Svg) {
        svg.rectangle("frame", self.corner, self.size, 0.0);
        let middle = self.corner.x + 0.5 * self.size.x;
        svg.text_unless_empty("middle", DVec2::new(middle, self.corner.y - 8.0), &self.heading);
    }

    /// Draws grid, ticks, labels and name of the horizontal axis.
    pub fn draw_x(&self, svg: &mut Svg) {
        let [top, bottom] = [self.corner.y, self.end().y].map(coordinate);
        let ticks = self.x.ticks_across(self.size.x);
        let (mut grid, mut marks) = (String::new(), String::new());
        for value in &ticks.minor {
            marks += &format!("M{} {bottom}v-{MINOR_TICK}", coordinate(self.across(*value)));
        }
        for (value, label) in &ticks.labelled {
            let x = self.across(*value);
            grid += &format!("M{} {top}V{bottom}", coordinate(x));
            marks += &format!("M{} {bottom}v-{TICK}", coordinate(x));
            if self.labels_x {
                let inside = x.min(svg.width() - 0.5 * width(label, SIZE) - 1.0);
                svg.text("x tick middle", DVec2::new(inside, self.end().y + 16.0), label);
            }
        }
        svg.path("grid", &grid);
        svg.path("ticks", &marks);
        if self.labels_x {
            let name = shortened(&self.x.title(&ticks), AXIS_SIZE, self.size.x);
            svg.text("axis middle", DVec2::new(self.corner.x + 0.5 * self.size.x, self.end().y + 38.0), &name);
        }
    }

    /// Draws grid, ticks, labels and name of the vertical axis.
    pub fn draw_y(&self, svg: &mut Svg) {
        let [left, right] = [self.corner.x, self.end().x].map(coordinate);
        let ticks = self.y.ticks_upwards(self.size.y);
        let (mut grid, mut marks) = (String::new(), String::new());
        for value in &ticks.minor {
            marks += &format!("M{left} {}h{MINOR_TICK}", coordinate(self.height(*value)));
        }
        for (value, label) in &ticks.labelled {
            let y = self.height(*value);
            grid += &format!("M{left} {}H{right}", coordinate(y));
            marks += &format!("M{left} {}h{TICK}", coordinate(y));
            svg.text("y tick end", DVec2::new(self.corner.x - 6.0, y + 4.0), label);
        }
        svg.path("grid", &grid);
        svg.path("ticks", &marks);
        let name = shortened(&self.y.title(&ticks), AXIS_SIZE, self.size.y);
        let from_left = Panel::left(self.y, self.size.y) - MARGIN - AXIS_SIZE + 3.0;
        let at = DVec2::new(self.corner.x - from_left, self.corner.y + 0.5 * self.size.y);
        svg.text_upwards("axis middle", at, &name);
    }
}

/// The sample of an entry of a legend by itself, as the text of an SVG file.
pub fn sample(entry: &Entry) -> String {
    let (width, height) = (SAMPLE, 12.0);
    let mut svg = Svg::new(width, height, &style::chart(Medium::Screen), "");
    entry.draw(&mut svg, DVec2::new(0.0, 0.5 * height));
    svg.finish()
}

/// What is said of a chart, and what distinguishes its curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChartText {
    /// First line.
    pub title: String,
    /// A sentence below it, or nothing.
    pub note: String,
    /// The time that is drawn, `t_relax` or its limit.
    pub quantity: String,
    /// What distinguishes the curves.
    pub key: CellKey,
}

impl ChartText {
    /// The heading with the note and `more` sentences, without a legend.
    pub fn heading(&self, more: impl IntoIterator<Item = String>) -> Heading<'_> {
        let sentences = [self.note.clone()].into_iter().chain(more).collect();
        Heading { title: &self.title, sentences, legend: Vec::new() }
    }
}

/// What distinguishes the curves of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellKey {
    /// Name of the quantity, for the colour bar that replaces the legend if there are many.
    pub name: String,
    /// Two quantities, of which colours show one and dashes or panels the other.
    pub crossed: Option<Crossed>,
    /// The entry of each curve in the legend.
    pub labels: Vec<String>,
    /// Names of the curves where the quantity need not be named: next to the colour bar, if it is no number.
    pub names: Vec<String>,
    /// Its values, if it is a number: the colours are in their order.
    pub values: Option<Vec<f64>>,
    /// Another legend names the curves, as one for all charts of a page does.
    pub named_elsewhere: bool,
}

impl From<&str> for CellKey {
    fn from(name: &str) -> CellKey {
        CellKey { name: name.into(), ..CellKey::default() }
    }
}

/// Curves that two quantities distinguish.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crossed {
    /// Entries of the legend for the quantity that colours show.
    pub colours: Vec<String>,
    /// Those for the other.
    pub patterns: Vec<String>,
    /// For each curve, its place in both.
    pub places: Vec<(usize, usize)>,
}

impl Crossed {
    /// Whether each value has a colour or a pattern of its own, and all curves can be drawn.
    fn fits(&self) -> bool {
        self.colours.len() <= style::SERIES && self.has_patterns() && self.places.len() <= MAX_CURVES
    }

    fn has_patterns(&self) -> bool {
        self.patterns.len() <= style::SERIES
    }

    /// The entries of the legend.
    pub fn entries(&self) -> Vec<Entry> {
        let entry = |(class, label): (String, &String)| Entry::new(&class, LegendMark::Series, label);
        let colours = self.colours.iter().enumerate().map(|(i, label)| (format!("s{i} d0"), label));
        let patterns = self.patterns.iter().enumerate().map(|(i, label)| (format!("faint d{i}"), label));
        match self.fits() {
            true => colours.chain(patterns).map(entry).collect(),
            false => patterns.filter(|_| self.has_patterns()).map(entry).collect(),
        }
    }
}

/// Colours of curves: a few are distinct, many form an ordered scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Colours {
    key: CellKey,
    /// Which curves are drawn, and the class of each.
    pub shown: Vec<(usize, String)>,
    /// The scale of the colours, if they are ordered.
    pub bar: Option<Axis>,
}

impl Colours {
    /// Colours for `count` curves. If a value of the key is unknown, or there is none, curves are numbered from 0 and
    /// ordered by that.
    pub fn of(count: usize, cells: &CellKey) -> Colours {
        let key = cells.clone();
        // Nothing else is drawn where the curves are not those of the quantities.
        let crossed = cells.crossed.as_ref().filter(|crossed| crossed.places.len() == count);
        if let Some(crossed) = crossed.filter(|crossed| crossed.fits()) {
            let class = |(i, (colour, pattern)): (usize, &(usize, usize))| (i, format!("s{colour} d{pattern}"));
            return Colours { key, shown: crossed.places.iter().enumerate().map(class).collect(), bar: None };
        }
        if count <= style::SERIES {
            return Colours { key, shown: (0..count).map(|i| (i, format!("s{i}"))).collect(), bar: None };
        }
        let known = |value: &f64| Scale::Linear.holds(*value);
        let given = cells.values.as_ref().and_then(|values| values.get(..count));
        let given = given.filter(|values| values.iter().all(known));
        let names = if given.is_none() && key.names.len() == count { key.names } else { Vec::new() };
        let names = distinct(&names, SIZE, MAX_NAME);
        // Names that stay wide leave no room for curves.
        let fit = names.iter().all(|name| width(name, SIZE) <= MAX_NAME);
        let names = if fit { names } else { Vec::new() };
        let name = if given.is_some() || !names.is_empty() { &cells.name[..] } else { "cell" };
        let key = CellKey { names, ..key };
        let values = given.map_or_else(|| (0..count).map(|i| i as f64).collect(), <[f64]>::to_vec);
        let scale = Scale::of(values.iter().copied());
        let ends = range(values.iter().copied()).filter(|(low, high)| low < high);
        let axis = match ends {
            Some(ends) => Axis::new(name, "", scale, ends),
            None => Axis::over(name, "", scale, values.iter().copied()),
        };
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
        let most = count.min(MAX_CURVES);
        let picked = (0..most).map(|i| order[i * (count - 1) / (most - 1)]);
        let class = |i: usize| {
            let step = (axis.share(values[i]) * style::RAMP as f64) as usize;
            let pattern = crossed.filter(|crossed| crossed.has_patterns()).map(|crossed| crossed.places[i].1);
            let dashes = pattern.map_or(String::new(), |pattern| format!(" d{pattern}"));
            (i, format!("r{}{dashes}", step.min(style::RAMP - 1)))
        };
        Colours { key, shown: picked.map(class).collect(), bar: Some(axis) }
    }

    /// Legend entries of distinct curves; none where another legend has them.
    pub fn legend(&self) -> Vec<Entry> {
        match &self.key.crossed {
            _ if self.key.named_elsewhere => Vec::new(),
            Some(crossed) if crossed.places.len() >= self.shown.len() => crossed.entries(),
            _ => self.distinct(LegendMark::Series),
        }
    }

    /// Entries of the curves with a colour of their own; none where colours are ordered.
    pub fn distinct(&self, mark: LegendMark) -> Vec<Entry> {
        let label = |i: usize| self.key.labels.get(i).map_or("", String::as_str);
        let distinct = self.shown.iter().filter(|_| self.bar.is_none());
        distinct.map(|(i, class)| Entry::new(class, mark, label(*i))).collect()
    }

    /// Draws each curve that is shown, by its rank among these and its number, in a group of its colour.
    pub fn each(&self, svg: &mut Svg, mut draw: impl FnMut(&mut Svg, usize, usize)) {
        for (rank, (i, class)) in self.shown.iter().enumerate() {
            svg.group(class, |svg| draw(svg, rank, *i));
        }
    }

    /// The marker of the curve drawn at this rank: ordered colours need no shapes.
    pub fn rank(&self, rank: usize) -> usize {
        if self.bar.is_some() { 0 } else { rank }
    }

    /// A sentence if not all of `count` curves are drawn.
    pub fn sentence(&self, count: usize) -> String {
        match self.shown.len() {
            shown if shown < count => format!("{shown} of {count} cells are drawn, spread over all."),
            _ => String::new(),
        }
    }

    /// Space for the colour bar next to a panel of this height.
    pub fn room(&self, height: f64) -> f64 {
        let Some(bar) = &self.bar else { return 0.0 };
        let names = self.names(height).into_iter().map(|(_, name)| width(&name, SIZE)).reduce(f64::max);
        2.0 * BAR + names.map_or(Panel::left(bar, height) - MARGIN, |widest| widest + AXIS_SIZE + 16.0)
    }

    /// Names next to a colour bar of this height, with the numbers of their curves: as many as there is room for.
    fn names(&self, height: f64) -> Vec<(f64, String)> {
        let names = &self.key.names;
        let step = names.len().div_ceil(((height / LINE) as usize).max(1)).max(1);
        names.iter().enumerate().step_by(step).map(|(i, name)| (i as f64, name.clone())).collect()
    }

    /// Draws the colour bar at the right of a panel.
    pub fn draw_bar(&self, svg: &mut Svg, panel: &Panel) {
        let Some(bar) = &self.bar else { return };
        let corner = DVec2::new(panel.end().x + BAR, panel.corner.y);
        let step = panel.size.y / style::RAMP as f64;
        for i in 0..style::RAMP {
            let at = corner + DVec2::new(0.0, (style::RAMP - 1 - i) as f64 * step);
            // A slight overlap avoids seams.
            let size = DVec2::new(BAR, step + if i > 0 { 0.5 } else { 0.0 });
            svg.group(&format!("r{i}"), |svg| svg.rectangle("solid", at, size, 0.0));
        }
        let (ticks, names) = (bar.ticks_upwards(panel.size.y), self.names(panel.size.y));
        let labelled = if names.is_empty() { &ticks.labelled } else { &names };
        let mut right: f64 = 0.0;
        for (value, label) in labelled {
            let y = panel.end().y - panel.size.y * bar.share(*value);
            svg.path("ticks", &format!("M{} {}h3", coordinate(corner.x + BAR), coordinate(y)));
            svg.text("tick", DVec2::new(corner.x + BAR + 6.0, y + 4.0), label);
            right = right.max(width(label, SIZE));
        }
        svg.rectangle("frame", corner, DVec2::new(BAR, panel.size.y), 0.0);
        let name = shortened(&bar.title(&ticks), AXIS_SIZE, panel.size.y);
        let at = DVec2::new(corner.x + BAR + right + 12.0 + AXIS_SIZE, panel.corner.y + 0.5 * panel.size.y);
        svg.text_upwards("axis middle", at, &name);
    }
}
