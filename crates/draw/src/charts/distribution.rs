//! How times are distributed: a box for each cell, and its quantiles against those of two laws.
//!
//! The boxes are quantiles by Kaplan and Meier, as far as these are known: none is drawn beyond the last time that
//! members are known to have reached. The pointer on a box shows its numbers.

use glam::DVec2;

use super::TIME;
use crate::{
    axis::{Axis, Scale},
    chart::{Colours, Entry, FOOT, HEADING, Heading, LegendMark, MARGIN, Panel, WIDTH, nothing},
    svg::{Svg, coordinate, dots},
    width::{SIZE, shortened, width},
};
use curvelax_base::text::significant;

/// Height of a row of the boxes, of a box in it, and of a panel of quantiles.
const ROW: f64 = 20.0;
const BOX: f64 = 11.0;
const HEIGHT: f64 = 200.0;
const GAP: f64 = 14.0;
/// Maximum width of the name of a cell.
const NAME: f64 = 150.0;
/// Between the quartiles of the normal law.
const NORMAL_QUARTILES: f64 = 1.348_979_500_392_163_6;

/// Times by cell, and how they are distributed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeDistribution<'a> {
    /// First line.
    pub title: &'a str,
    /// A sentence below it.
    pub note: &'a str,
    /// The time.
    pub quantity: &'a str,
    /// Name of the quantity that distinguishes the cells.
    pub key: &'a str,
    /// The cells.
    pub cells: Vec<CellQuantiles>,
}

/// The times of one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellQuantiles {
    /// Its name.
    pub label: String,
    /// The value of a numeric key, for the colours.
    pub value: Option<f64>,
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

    /// The box in a row at the height `y`.
    fn draw(&self, svg: &mut Svg, panel: &Panel, y: f64) {
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
        svg.open("thin");
        svg.hinted_path(&lines, &format!("{}: 5, 25, 50, 75, 95 %: {}", self.label, shown.join(", ")));
        svg.close();
        if let Some(median) = known(2) {
            svg.path("cross", &format!("M{} {top}V{bottom}", coordinate(median)));
        }
    }
}

impl TimeDistribution<'_> {
    /// The text of an SVG file.
    pub fn draw(&self) -> String {
        let TimeDistribution { title, note, quantity, key, cells } = self;
        let values: Vec<Option<f64>> = cells.iter().map(|cell| cell.value).collect();
        let colours = Colours::of(&values, key);
        let sentences = vec![(*note).into(), colours.sentence(cells.len())];
        let times = || cells.iter().flat_map(|cell| cell.places.iter().flatten().copied());
        if times().next().is_none() {
            return nothing(title, sentences, "Too few members relaxed for a quantile.");
        }
        let rows = colours.shown.len();
        let boxes = ROW * rows as f64 + 8.0;
        let heading = Heading { title, sentences, legend: self.legend() };
        let (mut svg, top) = heading.begin(8.0 + boxes + FOOT + HEADING + HEIGHT + FOOT);

        let names = colours.shown.iter().map(|(i, _)| shortened(&cells[*i].label, SIZE, NAME));
        let names: Vec<String> = if rows > 1 { names.collect() } else { vec![String::new(); rows] };
        let left = MARGIN + 8.0 + names.iter().map(|name| width(name, SIZE)).fold(0.0, f64::max);
        let scale = Scale::of(times());
        let across = Axis::over(quantity, TIME, scale, times());
        let nothing = Axis::new("", "", Scale::Linear, (0.0, 1.0));
        let (corner, size) = (DVec2::new(left, top + 8.0), DVec2::new(WIDTH - left - MARGIN, boxes));
        let panel = Panel { heading: "", corner, size, x: &across, y: &nothing, labels_x: true };
        panel.draw_x(&mut svg);
        for (row, (name, (cell, class))) in names.iter().zip(&colours.shown).enumerate() {
            let y = corner.y + 4.0 + ROW * (row as f64 + 0.5);
            svg.text_unless_empty("y tick end", DVec2::new(left - 6.0, y + 4.0), name);
            svg.open(class);
            cells[*cell].draw(&mut svg, &panel, y);
            svg.close();
        }
        panel.draw_frame(&mut svg);

        let below = corner.y + boxes + FOOT + HEADING;
        let of: [fn(f64) -> f64; 2] = [|t| t, f64::ln];
        let all = of.map(|of| cells.iter().map(|cell| cell.standardised(of)).collect::<Vec<_>>());
        let points = || all.iter().flatten().flatten();
        let normal = Axis::over("standard normal quantile", "", Scale::Linear, points().map(|(z, _)| *z));
        let axis = |of: &Vec<Vec<(f64, f64)>>| {
            Axis::over("standardised quantile", "", Scale::Linear, of.iter().flatten().map(|(_, y)| *y))
        };
        let own = [axis(&all[0]), axis(&all[1])];
        let left = own.iter().map(|axis| Panel::left(axis, HEIGHT)).fold(0.0, f64::max);
        let side = 0.5 * (WIDTH - MARGIN - GAP);
        for (i, ((law, all), own)) in ["normal", "lognormal"].iter().zip(&all).zip(&own).enumerate() {
            let corner = DVec2::new(left + i as f64 * (side + GAP), below);
            let heading = format!("against a {law} law");
            let size = DVec2::new(side - left, HEIGHT);
            let panel = Panel { heading: &heading, corner, size, x: &normal, y: own, labels_x: true };
            if all.iter().all(Vec::is_empty) {
                panel.say(&mut svg, "The quartiles are not known, or equal.");
                continue;
            }
            panel.draw_x(&mut svg);
            panel.draw_y(&mut svg);
            self.diagonal(&mut svg, &panel);
            for (cell, class) in &colours.shown {
                let places: Vec<DVec2> = all[*cell].iter().map(|(z, y)| panel.place(*z, *y)).collect();
                svg.open(class);
                svg.path("points", &dots(&places));
                svg.close();
            }
            panel.draw_frame(&mut svg);
        }
        svg.finish()
    }

    /// The line on which quantiles of the law lie.
    fn diagonal(&self, svg: &mut Svg, panel: &Panel) {
        let ((x0, x1), (y0, y1)) = (panel.x.range(), panel.y.range());
        let (low, high) = (x0.max(y0), x1.min(y1));
        let [start, end] = [low, high].map(|v| panel.place(v, v));
        let [sx, sy, ex, ey] = [start.x, start.y, end.x, end.y].map(coordinate);
        svg.open("faint");
        svg.path("dashed", &format!("M{sx} {sy}L{ex} {ey}"));
        svg.close();
    }

    fn legend(&self) -> Vec<Entry> {
        let text = "where the quantiles of the law are, through the quartiles";
        vec![Entry::new("faint", LegendMark::Dashed, text)]
    }
}
