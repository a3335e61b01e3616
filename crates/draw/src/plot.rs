//! Curves on axes of equal scale, in panels side by side that share one range and one scale.

use glam::DVec2;

use super::{
    axis::{multiples, tick_step},
    medium::Medium,
    style::sheet,
    svg::{Svg, closed_path, coordinate, dots},
};
use curvelax_base::text::number;
use curvelax_curve::polygon;

/// Maximum width of all panels together, and maximum height of one, in pixels.
const MAX_WIDTH: f64 = 600.0;
const MAX_HEIGHT: f64 = 440.0;
/// Free space round the curves, as a fraction of the larger extent.
const PADDING: f64 = 0.05;
/// Pixels between panels, and round them for labels: title and legend, tick labels, names of the axes.
const GAP: f64 = 22.0;
const HEAD: f64 = 56.0;
const LEGEND: f64 = 26.0;
const HEADING: f64 = 22.0;
const LEFT: f64 = 56.0;
const RIGHT: f64 = 20.0;
const FOOT: f64 = 48.0;
/// Minimum width for titles, in pixels.
const MIN_WIDTH: f64 = 560.0;
/// Minimum pixels between ticks.
const MIN_TICK: f64 = 45.0;
/// Length of a tick, in pixels.
const TICK: f64 = 5.0;
/// Nodes closer than this on average, in pixels, get smaller dots.
const DENSE: f64 = 6.0;
/// Width of an entry of the legend, in pixels.
const ENTRY: f64 = 104.0;

const LIGHT: &str = include_str!("style/plot.css");
const DARK: &str = include_str!("style/plot-dark.css");

/// Number of colours in the style sheet.
const COLOURS: usize = 5;

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// First line.
    pub title: String,
    /// Second line.
    pub subtitle: String,
    /// Panels from left to right. If one has several curves, a legend distinguishes them.
    pub panels: Vec<PlotPanel>,
}

/// Axes with curves in them.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotPanel {
    /// A line above the axes.
    pub heading: Option<String>,
    /// The curves, first to last.
    pub curves: Vec<PlottedCurve>,
}

/// A closed polygon, drawn as a line with a dot on each node.
#[derive(Clone, Debug, PartialEq)]
pub struct PlottedCurve {
    /// Its entry in the legend.
    pub label: String,
    /// Its nodes, all finite.
    pub nodes: Vec<DVec2>,
}

impl PlottedCurve {
    /// A curve with nodes (x, y) at the time t, which is its label.
    pub fn at(t: f64, x: &[f64], y: &[f64]) -> PlottedCurve {
        let nodes = x.iter().zip(y).map(|(x, y)| DVec2::new(*x, *y)).collect();
        PlottedCurve { label: format!("t = {}", number(t)), nodes }
    }
}

impl Plot {
    /// The text of an SVG file: equal plots give equal bytes.
    pub fn draw(&self, medium: Medium) -> String {
        let (most, least, head) = match medium {
            Medium::Screen | Medium::Page => (MAX_WIDTH, MIN_WIDTH, HEAD),
            // Title and sentence belong in the caption.
            Medium::Paper(width) => (width - LEFT - RIGHT, width, RIGHT),
        };
        let frame = Frame::new(&self.panels, most);
        let most_curves = self.panels.iter().map(|panel| panel.curves.len()).max().unwrap_or(0);
        let entries = match medium {
            Medium::Screen | Medium::Page => most_curves,
            Medium::Paper(width) => (((width - 2.0 * RIGHT) / ENTRY) as usize).max(1),
        };
        let lines = most_curves.div_ceil(entries.max(1)) as f64;
        let legend = if most_curves > 1 { LEGEND * lines } else { 0.0 };
        let heading = if self.panels.iter().any(|panel| panel.heading.is_some()) { HEADING } else { 0.0 };
        let count = self.panels.len().max(1) as f64;
        let panels_width = count * (frame.size.x + GAP) - GAP;
        let width = (LEFT + panels_width + RIGHT).max(least);
        let top = head + legend + heading;
        let left = 0.5 * (width - panels_width + LEFT - RIGHT);

        let mut svg = Svg::new(width, top + frame.size.y + FOOT, &sheet(medium, LIGHT, DARK), &self.title);
        svg.rectangle("back", DVec2::ZERO, DVec2::new(width, top + frame.size.y + FOOT), 0.0);
        if medium.is_screen() {
            svg.text("head", DVec2::new(RIGHT, 26.0), &self.title);
            svg.text("note", DVec2::new(RIGHT, 46.0), &self.subtitle);
        }
        if let Some(panel) = self.panels.iter().find(|panel| legend > 0.0 && panel.curves.len() == most_curves) {
            draw_legend(&mut svg, panel, DVec2::new(RIGHT, head + 12.0), entries);
        }
        for (i, panel) in self.panels.iter().enumerate() {
            let corner = DVec2::new(left + i as f64 * (frame.size.x + GAP), top);
            frame.draw(&mut svg, panel, corner, i == 0);
        }
        svg.finish()
    }
}

fn draw_legend(svg: &mut Svg, panel: &PlotPanel, left: DVec2, entries: usize) {
    for (i, curve) in panel.curves.iter().enumerate() {
        let at = left + DVec2::new((i % entries) as f64 * ENTRY, (i / entries) as f64 * LEGEND);
        svg.group(&colour(i), |svg| {
            svg.path("line", &format!("M{} {}h24", coordinate(at.x), coordinate(at.y)));
            svg.path("nodes", &dots(&[at + DVec2::new(4.0, 0.0), at + DVec2::new(20.0, 0.0)]));
            svg.text("label", at + DVec2::new(30.0, 4.0), &curve.label);
        });
    }
}

fn colour(i: usize) -> String {
    format!("c{}", i % COLOURS)
}

/// What all panels share: the range of x and y, the scale, the ticks.
struct Frame {
    low: DVec2,
    high: DVec2,
    /// Pixels per unit of length, along both axes.
    scale: f64,
    /// Width and height in pixels.
    size: DVec2,
    /// Distance between ticks.
    step: f64,
}

impl Frame {
    /// The smallest frame for all curves, in panels that are together at most so wide.
    fn new(panels: &[PlotPanel], width: f64) -> Frame {
        let nodes = || panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| curve.nodes.iter().copied());
        let low = nodes().reduce(DVec2::min).unwrap_or(DVec2::ZERO);
        let high = nodes().reduce(DVec2::max).unwrap_or(DVec2::ONE);
        let largest = (high - low).max_element();
        let room = DVec2::splat(if largest > 0.0 { PADDING * largest } else { 1.0 });
        let (low, high) = (low - room, high + room);
        let count = panels.len().max(1) as f64;
        let most = DVec2::new((width - (count - 1.0) * GAP) / count, MAX_HEIGHT);
        let scale = (most / (high - low)).min_element();
        Frame { low, high, scale, size: (high - low) * scale, step: tick_step(MIN_TICK / scale) }
    }

    /// Draws `panel` with the upper left corner of its axes at `corner`.
    fn draw(&self, svg: &mut Svg, panel: &PlotPanel, corner: DVec2, names_y: bool) {
        // y grows downwards in SVG.
        let place = |p: DVec2| corner + DVec2::new(p.x - self.low.x, self.high.y - p.y) * self.scale;
        let end = corner + self.size;
        let [left, right, top, bottom] = [corner.x, end.x, corner.y, end.y].map(coordinate);
        let (mut grid, mut ticks) = (String::new(), String::new());
        for (label, value) in multiples(self.step, self.low.x, self.high.x) {
            let x = place(DVec2::splat(value)).x;
            let at = coordinate(x);
            grid += &format!("M{at} {top}V{bottom}");
            ticks += &format!("M{at} {bottom}v-{TICK}");
            svg.text("x tick middle", DVec2::new(x, end.y + 16.0), &label);
        }
        for (label, value) in multiples(self.step, self.low.y, self.high.y) {
            let y = place(DVec2::splat(value)).y;
            let at = coordinate(y);
            grid += &format!("M{left} {at}H{right}");
            ticks += &format!("M{left} {at}h{TICK}");
            if names_y {
                svg.text("y tick end", DVec2::new(corner.x - 6.0, y + 4.0), &label);
            }
        }
        svg.path("grid", &grid);
        svg.path("ticks", &ticks);
        svg.rectangle("frame", corner, self.size, 0.0);
        svg.text("axis middle", DVec2::new(0.5 * (corner.x + end.x), end.y + 36.0), "x");
        if names_y {
            svg.text("axis middle", DVec2::new(corner.x - 42.0, 0.5 * (corner.y + end.y) + 4.0), "y");
        }
        if let Some(heading) = &panel.heading {
            svg.text("middle", DVec2::new(0.5 * (corner.x + end.x), corner.y - 8.0), heading);
        }
        for (i, curve) in panel.curves.iter().enumerate() {
            let nodes: Vec<DVec2> = curve.nodes.iter().map(|node| place(*node)).collect();
            let spacing = polygon::length(&nodes) / nodes.len().max(1) as f64;
            svg.group(&format!("curve {}", colour(i)), |svg| {
                svg.path("line", &closed_path(&nodes));
                svg.path(if spacing < DENSE { "nodes dense" } else { "nodes" }, &dots(&nodes));
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use super::*;

    fn rectangle(width: f64, height: f64) -> PlottedCurve {
        let corner = 0.5 * DVec2::new(width, height);
        let nodes = [DVec2::ONE, DVec2::new(-1.0, 1.0), -DVec2::ONE, DVec2::new(1.0, -1.0)].map(|p| p * corner);
        PlottedCurve { label: "t = 0".into(), nodes: nodes.into() }
    }

    fn plot(panels: &[&[PlottedCurve]]) -> Plot {
        let panel = |curves: &&[PlottedCurve]| PlotPanel { heading: None, curves: curves.to_vec() };
        Plot { title: "a".into(), subtitle: "b".into(), panels: panels.iter().map(panel).collect() }
    }

    #[test]
    fn the_frame_holds_the_largest_curve_whatever_its_size() {
        for (width, height) in [(4.0, 2.0), (1e-6, 3e-6), (1e9, 1.0), (0.0, 0.0)] {
            let plot = plot(&[&[rectangle(width, height), rectangle(0.5 * width, 0.5 * height)]]);
            let frame = Frame::new(&plot.panels, MAX_WIDTH);
            assert!(frame.size.x < MAX_WIDTH + 1e-9 && frame.size.y < MAX_HEIGHT + 1e-9);
            assert!(frame.high.x > 0.5 * width && frame.high.y > 0.5 * height);
            let text = plot.draw(Medium::Screen);
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
            assert!(text.matches("class=\"x tick").count() >= 1, "{text}");
        }
    }

    #[test]
    fn times_are_written_as_people_write_them() {
        assert_eq!([0.0, 2.0, 0.17, 5e-4, 1e-6].map(number), ["0", "2", "0.17", "0.0005", "1e-6"]);
    }

    #[test]
    fn a_legend_is_there_where_a_panel_has_several_curves() {
        let one = rectangle(1.0, 1.0);
        assert_eq!(plot(&[from_ref(&one), from_ref(&one)]).draw(Medium::Screen).matches("class=\"label\"").count(), 0);
        assert_eq!(plot(&[&[one.clone(), one]]).draw(Medium::Screen).matches("class=\"label\"").count(), 2);
    }
}
