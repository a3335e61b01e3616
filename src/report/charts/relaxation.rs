//! How relaxation times are distributed: their histogram, and below it the share that has relaxed.

use glam::DVec2;

use super::{
    TIME,
    bins::{Bins, guide, interval},
};
use crate::report::{
    axis::{Axis, Scale},
    chart::{Entry, Estimate, FOOT, Heading, MARGIN, Mark, Panel, WIDTH, nothing},
    text::{count, grouped},
    trace,
};

const HISTOGRAM: f64 = 190.0;
const SHARE: f64 = 130.0;
const GAP: f64 = 16.0;

/// Relaxation times of the members of one cell, or of all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationTimes<'a> {
    /// First line.
    pub title: &'a str,
    /// A sentence below it, or nothing.
    pub note: &'a str,
    /// t_relax of those that relaxed, in length⁴, in any order.
    pub times: &'a [f64],
    /// The members without t_relax, counted by their status.
    pub others: &'a [(&'a str, u64)],
    /// The median over all, with censored members counted as such, in length⁴.
    pub median: Option<Estimate>,
}

impl RelaxationTimes<'_> {
    /// The text of an SVG file.
    pub fn draw(&self) -> String {
        let mut sorted: Vec<f64> = self.times.iter().copied().filter(|t| Scale::Linear.holds(*t)).collect();
        sorted.sort_by(f64::total_cmp);
        let sentences = vec![self.counts(sorted.len()), self.note.into()];
        if sorted.is_empty() {
            return nothing(self.title, sentences, "No member relaxed, so there are no relaxation times to count.");
        }
        let median = self.median.filter(|median| Scale::Linear.holds(median.value));
        let legend = median.iter().map(|median| Entry::new("ink", Mark::Dashed, &label(median))).collect();
        let heading = Heading { title: self.title, sentences, legend };
        let (mut svg, top) = heading.begin(HISTOGRAM + GAP + SHARE + FOOT + 8.0);

        let scale = Scale::of(sorted.iter().copied());
        let bins = Bins::of(&sorted, scale);
        let across = bins.axis("t_relax", TIME, scale);
        let members = Axis::counts("members", bins.most());
        let share = Axis::new("share relaxed", "", Scale::Linear, (0.0, 1.05));
        let left = Panel::left(&members, HISTOGRAM).max(Panel::left(&share, SHARE));
        let width = WIDTH - MARGIN - left;
        let above = Panel {
            heading: "",
            corner: DVec2::new(left, top + 8.0),
            size: DVec2::new(width, HISTOGRAM),
            x: &across,
            y: &members,
            labels_x: false,
        };
        let below = Panel {
            corner: DVec2::new(left, above.end().y + GAP),
            size: DVec2::new(width, SHARE),
            y: &share,
            labels_x: true,
            ..above
        };
        for panel in [&above, &below] {
            panel.draw_x(&mut svg);
            panel.draw_y(&mut svg);
        }
        bins.draw(&mut svg, &above);
        svg.open("s0");
        svg.path("series", &trace::path(&self.steps(&sorted, &below)));
        svg.close();
        if let Some(median) = median {
            svg.open("ink");
            for panel in [&above, &below].into_iter().filter(|panel| panel.x.holds(median.value)) {
                median.interval.iter().for_each(|bounds| interval(&mut svg, panel, *bounds));
                guide(&mut svg, panel, median.value);
            }
            svg.close();
        }
        above.draw_frame(&mut svg);
        below.draw_frame(&mut svg);
        svg.finish()
    }

    /// The share of all members that has relaxed, against time: it ends below 1 where some never did.
    fn steps(&self, sorted: &[f64], panel: &Panel) -> Vec<DVec2> {
        let all = sorted.len() as f64 + self.rest() as f64;
        let step = |(i, t): (usize, &f64)| panel.place(*t, (i + 1) as f64 / all);
        let start = DVec2::new(panel.corner.x, panel.end().y);
        let mut points: Vec<DVec2> = std::iter::once(start).chain(sorted.iter().enumerate().map(step)).collect();
        points.push(DVec2::new(panel.end().x, points[points.len() - 1].y));
        trace::steps(&points, trace::tolerance(1, SHARE))
    }

    fn rest(&self) -> u64 {
        let unusable = self.times.iter().filter(|t| !Scale::Linear.holds(**t)).count();
        unusable as u64 + self.others.iter().map(|(_, count)| count).sum::<u64>()
    }

    fn counts(&self, relaxed: usize) -> String {
        let (rest, all) = (self.rest(), relaxed as u64 + self.rest());
        if rest == 0 {
            return match relaxed {
                0 => "There are no members.".into(),
                1 => "The only member relaxed.".into(),
                _ => format!("All {} relaxed.", count(relaxed as u64, "member")),
            };
        }
        let named = self.others.iter().filter(|(_, count)| *count > 0);
        let named: Vec<String> = named.map(|(status, count)| format!("{} {status}", grouped(*count))).collect();
        let named = if named.is_empty() { String::new() } else { format!(" ({})", named.join(", ")) };
        let others = if rest == 1 { "one has".into() } else { format!("{} have", grouped(rest)) };
        format!("{} of {} relaxed; {others} no t_relax{named}.", grouped(relaxed as u64), count(all, "member"))
    }
}

fn label(median: &Estimate) -> String {
    let interval = if median.interval.is_some() { ", shaded: its 95 % interval" } else { "" };
    format!("median {}{interval}", median.shown())
}
