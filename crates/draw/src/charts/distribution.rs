//! How times are distributed: a box for each cell, and its quantiles against those of two distributions.
//!
//! The boxes are quantiles by Kaplan and Meier, as far as these are known: none is drawn beyond the last time that
//! members are known to have reached. The pointer on a box shows its numbers.

use glam::DVec2;

use super::{GRID_HEIGHT, PanelGrid, TIME, named_rows};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Colours, Entry, FOOT, LegendMark, Panel},
    empty::say,
    medium::Medium,
    svg::{Svg, coordinate, dots},
    width::{SIZE, distinct},
};
use curvelax_base::text::significant;

/// Height of a row of the boxes, and of a box in it.
const ROW: f64 = 20.0;
const BOX: f64 = 11.0;
/// Maximum width of the name of a cell.
const NAME: f64 = 150.0;
/// Between the quartiles of the normal law.
const NORMAL_QUARTILES: f64 = 1.348_979_500_392_163_6;

/// Times by cell, and how they are distributed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeDistribution<'a> {
    /// What is said of it; the boxes have the names of the cells.
    pub text: ChartText,
    /// What their names are, above these.
    pub keys: &'a str,
    /// The cells.
    pub cells: Vec<CellQuantiles>,
}

/// The times of one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellQuantiles {
    /// The 5, 25, 50, 75 and 95 % quantiles, as far as they are known.
    pub places: [Option<f64>; 5],
    /// Ascending quantiles: that of the standard normal law, and the time.
    pub quantiles: Vec<(f64, f64)>,
}

impl CellQuantiles {
    /// Its quantiles of `of` the time in units in which the quartiles are those of the standard normal law; none if
    /// they are not known, or equal.
    fn standardised(&self, of: fn(f64) -> f64) -> Vec<(f64, f64)> {
        let [_, low, middle, high, _] = self.places.map(|place| place.map(of));
        let (Some(low), Some(middle), Some(high)) = (low, middle, high) else { return Vec::new() };
        let unit = (high - low) / NORMAL_QUARTILES;
        let all = self.quantiles.iter().map(|(z, t)| (*z, (of(*t) - middle) / unit));
        all.filter(|(z, y)| Scale::Linear.holds(*z) && Scale::Linear.holds(*y)).collect()
    }

    /// The box of the cell of this name in a row at the height `y`.
    fn draw(&self, svg: &mut Svg, panel: &Panel, y: f64, name: &str) {
        let known = |i: usize| self.places[i].filter(|t| panel.x.holds(*t)).map(|t| panel.across(t));
        let ends: Vec<f64> = (0..self.places.len()).filter_map(known).collect();
        let (Some(first), Some(last)) = (ends.first(), ends.last()) else { return };
        let half = 0.5 * BOX;
        let [at, top, bottom] = [y, y - half, y + half].map(coordinate);
        let mut lines = format!("M{} {at}H{}", coordinate(*first), coordinate(*last));
        if let (Some(low), Some(high)) = (known(1), known(3)) {
            svg.rectangle("band", DVec2::new(low, y - half), DVec2::new(high - low, BOX), 0.0);
            let [low, high] = [low, high].map(coordinate);
            lines += &format!("M{low} {top}H{high}V{bottom}H{low}Z");
        }
        let shown = self.places.map(|place| {
            let shown = place.filter(|t| Scale::Linear.holds(*t)).map(|t| significant(t, 4));
            shown.unwrap_or("unknown".into())
        });
        let hint = format!("{name}: 5, 25, 50, 75, 95 %: {}", shown.join(", "));
        svg.group("thin", |svg| svg.hinted_path(&lines, &hint));
        if let Some(median) = known(2) {
            svg.path("cross", &format!("M{} {top}V{bottom}", coordinate(median)));
        }
    }
}

impl TimeDistribution<'_> {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let TimeDistribution { text, keys, cells } = self;
        let colours = Colours::of(cells.len(), &text.key);
        let mut heading = text.heading([colours.sentence(cells.len())]);
        let times = || cells.iter().flat_map(|cell| cell.places.iter().flatten().copied());
        if times().next().is_none() {
            return heading.nothing(medium, "Too few members relaxed for a quantile.");
        }
        let rows = colours.shown.len();
        let boxes = ROW * rows as f64 + 8.0;
        let law = "a normal or lognormal distribution with these quartiles";
        heading.legend = vec![Entry::new("faint", LegendMark::Dashed, law)];
        let of: [fn(f64) -> f64; 2] = [|t| t, f64::ln];
        let all = of.map(|of| cells.iter().map(|cell| cell.standardised(of)).collect::<Vec<_>>());
        let mut groups = self.groups(&colours);
        groups.retain(|(_, cells)| all.iter().any(|all| cells.iter().any(|(cell, _)| !all[*cell].is_empty())));
        // Where no quartiles are known, there is nothing to compare with a law.
        let compared = all.iter().any(|all| !all.iter().all(Vec::is_empty));
        let places = PanelGrid::new(medium, 0.0);
        let laws = if compared { places.height(2 * groups.len()) } else { 0.0 };
        let above = if rows > 1 { 24.0 } else { 8.0 };
        let (mut svg, top) = heading.begin(medium, above + boxes + FOOT + laws);

        let own: Vec<String> = colours.shown.iter().map(|(i, _)| text.key.names[*i].clone()).collect();
        let names = if rows > 1 { distinct(&own, SIZE, medium.name(NAME)) } else { vec![String::new(); rows] };
        let keys = if rows > 1 { *keys } else { "" };
        let scale = Scale::of(times());
        let across = Axis::over(&text.quantity, TIME, scale, times());
        let nothing = Axis::new("", "", Scale::Linear, (0.0, 1.0));
        let panel = named_rows(&mut svg, [&across, &nothing], (&names, keys), (top + above, boxes), 0.0);
        let corner = panel.corner - DVec2::new(6.0, 0.0);
        svg.text_unless_empty("note end", corner - DVec2::new(0.0, 8.0), keys);
        for (row, (name, (cell, class))) in names.iter().zip(&colours.shown).enumerate() {
            let y = corner.y + 4.0 + ROW * (row as f64 + 0.5);
            svg.text_unless_empty("y tick end", DVec2::new(corner.x, y + 4.0), name);
            svg.group(class, |svg| cells[*cell].draw(svg, &panel, y, &own[row]));
        }
        panel.draw_frame(&mut svg);

        if compared {
            let below = corner.y + boxes + FOOT;
            for (i, group) in groups.iter().enumerate() {
                self.draw_laws(medium, &mut svg, &places, (2 * i, below), group, &all);
            }
        }
        svg.finish()
    }

    /// The cells side by side in one pair of panels, with its name: those of one value of the quantity that colours do
    /// not show.
    fn groups<'a>(&'a self, colours: &'a Colours) -> Vec<(&'a str, Vec<&'a (usize, String)>)> {
        let Some(crossed) = &self.text.key.crossed else { return vec![("", colours.shown.iter().collect())] };
        let of = |pattern: usize| {
            colours.shown.iter().filter(move |(i, _)| crossed.places.get(*i).is_some_and(|place| place.1 == pattern))
        };
        let all = crossed.patterns.iter().enumerate().map(|(i, name)| (&name[..], of(i).collect::<Vec<_>>()));
        all.filter(|(_, cells)| !cells.is_empty()).collect()
    }

    /// Quantiles of some cells against those of the two laws, in two panels from `first` on.
    fn draw_laws(
        &self,
        medium: Medium,
        svg: &mut Svg,
        places: &PanelGrid,
        (first, top): (usize, f64),
        (name, cells): &(&str, Vec<&(usize, String)>),
        all: &[Vec<Vec<(f64, f64)>>; 2],
    ) {
        let own = |all: &Vec<Vec<(f64, f64)>>| -> Vec<(f64, f64)> {
            cells.iter().flat_map(|(cell, _)| all[*cell].iter().copied()).collect()
        };
        let points: Vec<(f64, f64)> = all.iter().flat_map(own).collect();
        let normal = Axis::over("standard normal quantile", "", Scale::Linear, points.iter().map(|(z, _)| *z));
        let axis = |name, all: &Vec<Vec<(f64, f64)>>| {
            Axis::over(name, "", Scale::Linear, own(all).into_iter().map(|(_, y)| y))
        };
        let upwards = [axis("standardised quantile", &all[0]), axis("standardised quantile of ln", &all[1])];
        let left = upwards.iter().map(|axis| Panel::left(axis, GRID_HEIGHT)).fold(0.0, f64::max);
        for (i, ((law, all), own_axis)) in (first..).zip(["normal", "lognormal"].iter().zip(all).zip(&upwards)) {
            let heading = match medium {
                _ if name.is_empty() => law.to_string(),
                // The axes say which side is which.
                _ if medium.is_screen() => name.to_string(),
                _ => format!("{name}, {law}"),
            };
            let panel = places.panel(i, top, left, &heading, [&normal, own_axis]);
            if own(all).is_empty() {
                say(svg, panel.corner, panel.size, "The quartiles are not known, or equal.");
                continue;
            }
            panel.draw_axes(svg);
            self.diagonal(svg, &panel);
            for (cell, class) in cells {
                let places: Vec<DVec2> = all[*cell].iter().map(|(z, y)| panel.place(*z, *y)).collect();
                svg.group(class, |svg| svg.path("points", &dots(&places)));
            }
            panel.draw_frame(svg);
        }
    }

    /// The line on which quantiles of the law lie.
    fn diagonal(&self, svg: &mut Svg, panel: &Panel) {
        let ((x0, x1), (y0, y1)) = (panel.x.range(), panel.y.range());
        let (low, high) = (x0.max(y0), x1.min(y1));
        let [start, end] = [low, high].map(|v| panel.place(v, v));
        let [sx, sy, ex, ey] = [start.x, start.y, end.x, end.y].map(coordinate);
        svg.group("faint", |svg| svg.path("dashed", &format!("M{sx} {sy}L{ex} {ey}")));
    }
}
