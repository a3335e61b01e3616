//! The distribution of relaxation times: a histogram, and below it the fraction that has relaxed.

use std::iter;

use glam::DVec2;

use super::{
    TIME,
    bins::{Bins, guide, interval},
};
use crate::{
    draw::{
        axis::{Axis, Scale},
        chart::{Entry, EstimatedNumber, FOOT, Heading, LegendMark, MARGIN, Panel, WIDTH, nothing},
        trace,
    },
    text::{count, grouped},
};

const HISTOGRAM: f64 = 190.0;
const SHARE: f64 = 130.0;
const GAP: f64 = 16.0;

/// Relaxation times of the members of one cell, or of all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RelaxationTimes<'a> {
    /// First line.
    pub title: &'a str,
    /// A sentence below it, or nothing.
    pub note: &'a str,
    /// t_relax of the members that relaxed, in length⁴, in any order.
    pub times: Vec<f64>,
    /// The members without t_relax, counted by their status.
    pub others: &'a [(&'a str, u64)],
    /// The median over all members, including censored ones as such, in length⁴.
    pub median: Option<EstimatedNumber>,
}

impl RelaxationTimes<'_> {
    /// The text of an SVG file.
    pub fn draw(self) -> String {
        let RelaxationTimes { title, note, times: mut sorted, others, median } = self;
        let members = sorted.len() as u64 + others.iter().map(|(_, count)| count).sum::<u64>();
        sorted.retain(|t| Scale::Linear.holds(*t));
        sorted.sort_unstable_by(f64::total_cmp);
        let sentences = vec![counts(sorted.len() as u64, members, others), note.into()];
        if sorted.is_empty() {
            return nothing(title, sentences, "No member relaxed, so there are no relaxation times to count.");
        }
        let median = median.filter(|median| Scale::Linear.holds(median.value));
        let legend = median.iter().map(|median| Entry::new("ink", LegendMark::Dashed, &label(median))).collect();
        let heading = Heading { title, sentences, legend };
        let (mut svg, top) = heading.begin(HISTOGRAM + GAP + SHARE + FOOT + 8.0);

        let scale = Scale::of(sorted.iter().copied());
        let bins = Bins::of(&sorted, scale);
        let across = bins.axis("t_relax", TIME, scale);
        let counted = Axis::counts("members", bins.most());
        let share = Axis::new("share relaxed", "", Scale::Linear, (0.0, 1.05));
        let left = Panel::left(&counted, HISTOGRAM).max(Panel::left(&share, SHARE));
        let width = WIDTH - MARGIN - left;
        let above = Panel {
            heading: "",
            corner: DVec2::new(left, top + 8.0),
            size: DVec2::new(width, HISTOGRAM),
            x: &across,
            y: &counted,
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
        svg.path("series", &trace::path(&steps(&sorted, members, &below)));
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
}

/// The fraction of all members that has relaxed, against time: it ends below 1 if some never did.
fn steps(sorted: &[f64], members: u64, panel: &Panel) -> Vec<DVec2> {
    let share = |count: usize| count as f64 / members as f64;
    let places = sorted.iter().enumerate().map(|(i, t)| panel.place(*t, share(i + 1)));
    let start = DVec2::new(panel.corner.x, panel.end().y);
    let end = DVec2::new(panel.end().x, panel.place(0.0, share(sorted.len())).y);
    trace::steps(iter::once(start).chain(places).chain([end]), trace::tolerance(1, SHARE))
}

fn counts(relaxed: u64, members: u64, others: &[(&str, u64)]) -> String {
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
    format!("{} of {} relaxed; {others} no t_relax{named}.", grouped(relaxed), count(members, "member"))
}

fn label(median: &EstimatedNumber) -> String {
    let interval = if median.interval.is_some() { ", shaded: its 95 % interval" } else { "" };
    format!("median {}{interval}", median.shown())
}
