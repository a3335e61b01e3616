//! How fast the excess of the members decreases: their fitted rates, relative to linear theory if it predicts any.

use super::{
    bins::{Bins, guide},
    only_panel,
};
use crate::{
    draw::{
        axis::{Axis, Scale},
        chart::{Entry, FOOT, Heading, LegendMark, nothing},
    },
    text::{count, significant},
};

const HEIGHT: f64 = 200.0;

/// Fitted rates of the members.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FittedRates<'a> {
    /// First line.
    pub title: &'a str,
    /// A sentence below it, or nothing.
    pub note: &'a str,
    /// Rates relative to theory; or rates in `unit`, if there is no theory.
    pub rates: Vec<f64>,
    /// Whether they are relative to theory.
    pub relative: bool,
    /// Unit of rates that are not relative.
    pub unit: &'a str,
    /// Members without a rate.
    pub without: u64,
}

impl FittedRates<'_> {
    /// The text of an SVG file.
    pub fn draw(self) -> String {
        let FittedRates { title, note, rates: mut sorted, relative, unit, without } = self;
        sorted.retain(|rate| Scale::Linear.holds(*rate));
        sorted.sort_unstable_by(f64::total_cmp);
        let without = match without {
            0 => String::new(),
            without => format!("{} without a rate: fewer than 8 points in the window.", count(without, "member")),
        };
        if sorted.is_empty() {
            let sentences = vec![note.into(), without];
            return nothing(title, sentences, "No member was followed closely enough for a rate to be fitted.");
        }
        let median = format!("Median {}.", significant(sorted[sorted.len() / 2], 4));
        let scale = if sorted[0] > 0.0 { Scale::of(sorted.iter().copied()) } else { Scale::Linear };
        let bins = Bins::of(&sorted, scale);
        let (name, unit) = if relative { ("rate / theory", "") } else { ("rate", unit) };
        let (across, members) = (bins.axis(name, unit, scale), Axis::counts("members", bins.most()));
        let shown = relative && across.holds(1.0);
        let legend =
            if shown { vec![Entry::new("ink", LegendMark::Dashed, "as linear theory has it")] } else { Vec::new() };
        let sentences = vec![note.into(), median, without];
        let (mut svg, top) = Heading { title, sentences, legend }.begin(HEIGHT + FOOT + 8.0);
        let panel = only_panel([&across, &members], top, HEIGHT, 0.0);
        panel.draw_x(&mut svg);
        panel.draw_y(&mut svg);
        bins.draw(&mut svg, &panel);
        if shown {
            svg.open("ink");
            guide(&mut svg, &panel, 1.0);
            svg.close();
        }
        panel.draw_frame(&mut svg);
        svg.finish()
    }
}
