//! The distribution of relaxation times: a histogram, and below it the fraction that has relaxed.

use std::iter;

use glam::DVec2;

use super::{
    TIME,
    bins::{Bins, CellValues, guide, interval},
};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Colours, Entry, EstimatedNumber, FOOT, LegendMark, MARGIN, Panel},
    medium::Medium,
    trace,
};
use curvelax_base::{
    interval::Interval,
    text::{count, grouped},
};

const HISTOGRAM: f64 = 190.0;
const SHARE: f64 = 130.0;
const GAP: f64 = 16.0;

/// Relaxation times of the members of each cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RelaxationTimes<'a> {
    /// What is said of it.
    pub text: ChartText,
    /// The times of the members that relaxed, in length⁴, cell by cell.
    pub cells: Vec<CellValues>,
    /// The members without t_relax, counted by their status.
    pub others: &'a [(&'a str, u64)],
    /// The median of a single cell, including censored ones as such, in length⁴.
    pub median: Option<EstimatedNumber>,
}

impl RelaxationTimes<'_> {
    /// The text of an SVG file.
    pub fn draw(self, medium: Medium) -> String {
        let RelaxationTimes { text, mut cells, others, median } = self;
        let members = cells.iter().map(|cell| cell.members).sum();
        CellValues::sort(&mut cells);
        let relaxed = cells.iter().map(|cell| cell.numbers.len() as u64).sum();
        let colours = Colours::of(cells.len(), &text.key);
        let mut heading = text.heading([colours.sentence(cells.len())]);
        heading.sentences.insert(0, counts(&text.quantity, relaxed, members, others));
        if relaxed == 0 {
            return heading.nothing(medium, "No member relaxed, so there are no relaxation times to count.");
        }
        let median = median.filter(|median| Scale::Linear.holds(median.value));
        let named = colours.legend().into_iter().filter(|_| cells.len() > 1);
        let middle = median.iter().map(|median| Entry::new("ink", LegendMark::Dashed, &label(median)));
        heading.legend = named.chain(middle).collect();
        let (mut svg, top) = heading.begin(medium, HISTOGRAM + GAP + SHARE + FOOT + 8.0);

        let scale = CellValues::scale(&cells);
        let bins = Bins::shared(&cells, scale);
        let across = bins[0].axis(&text.quantity, TIME, scale);
        let counted = Axis::counts("members", bins.iter().map(Bins::most).max().unwrap_or(0));
        let share = Axis::new("share relaxed", "", Scale::Linear, (0.0, 1.05));
        let left = Panel::left(&counted, HISTOGRAM).max(Panel::left(&share, SHARE));
        let width = svg.width() - MARGIN - left - colours.room(HISTOGRAM);
        let (corner, size) = (DVec2::new(left, top + 8.0), DVec2::new(width, HISTOGRAM));
        let above = Panel { labels_x: false, ..Panel::new(corner, size, [&across, &counted]) };
        let corner = DVec2::new(left, above.end().y + GAP);
        let below = Panel::new(corner, DVec2::new(width, SHARE), [&across, &share]);
        [&above, &below].into_iter().for_each(|panel| panel.draw_axes(&mut svg));
        // Behind the bars, whose heights it would hide.
        let shaded = median.and_then(|median| median.interval);
        for panel in [&above, &below] {
            let Some(Interval { lower, upper, .. }) = shaded else { continue };
            let (start, end) = panel.x.range();
            svg.group("ink", |svg| interval(svg, panel, (lower.unwrap_or(start), upper.unwrap_or(end))));
        }
        Bins::draw_all(&bins, &colours, &mut svg, &above);
        let least = trace::tolerance(if cells.len() > 1 { 2 * colours.shown.len() } else { 1 }, SHARE);
        colours.each(&mut svg, |svg, _, i| svg.path("series", &trace::path(&steps(&cells[i], &below, least))));
        colours.draw_bar(&mut svg, &above);
        if let Some(median) = median {
            let held = [&above, &below].into_iter().filter(|panel| panel.x.holds(median.value));
            svg.group("ink", |svg| held.for_each(|panel| guide(svg, panel, median.value)));
        }
        [above, below].into_iter().for_each(|panel| panel.draw_frame(&mut svg));
        svg.finish()
    }
}

/// The fraction of all members that has relaxed, against time: it ends below 1 if some never did.
fn steps(cell: &CellValues, panel: &Panel, least: f64) -> Vec<DVec2> {
    let sorted = &cell.numbers;
    let share = |count: usize| count as f64 / cell.members.max(1) as f64;
    let places = sorted.iter().enumerate().map(|(i, t)| panel.place(*t, share(i + 1)));
    let start = DVec2::new(panel.corner.x, panel.end().y);
    let end = DVec2::new(panel.end().x, panel.place(0.0, share(sorted.len())).y);
    trace::steps(iter::once(start).chain(places).chain([end]), least)
}

fn counts(quantity: &str, relaxed: u64, members: u64, others: &[(&str, u64)]) -> String {
    let rest = members - relaxed;
    if rest == 0 {
        return match relaxed {
            0 => "There are no members.".into(),
            1 => "The only member relaxed.".into(),
            _ => format!("All {} relaxed.", count(relaxed, "member")),
        };
    }
    let named = others.iter().filter(|(_, count)| *count > 0);
    let named: Vec<String> = named.map(|(status, count)| format!("{} {status}", grouped(*count))).collect();
    let named = if named.is_empty() { String::new() } else { format!(" ({})", named.join(", ")) };
    let others = if rest == 1 { "one has".into() } else { format!("{} have", grouped(rest)) };
    format!("{} of {} relaxed; {others} no {quantity}{named}.", grouped(relaxed), count(members, "member"))
}

fn label(median: &EstimatedNumber) -> String {
    let interval = if median.interval.is_some() { ", shaded" } else { "" };
    format!("median {}{interval}", median.shown())
}
