//! How fast the excess of the members decreases: their fitted rates, relative to linear theory if it predicts any.

use super::{
    bins::{Bins, CellValues, guide},
    only_panel, some,
};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Colours, Entry, LegendMark},
    medium::Medium,
};
use curvelax_base::text::significant;

const HEIGHT: f64 = 200.0;

/// Fitted rates of the members.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FittedRates<'a> {
    /// What is said of it.
    pub text: ChartText,
    /// Rates relative to theory; or rates in `unit`, if there is no theory; cell by cell.
    pub cells: Vec<CellValues>,
    /// Whether they are relative to theory.
    pub relative: bool,
    /// Unit of rates that are not relative.
    pub unit: &'a str,
    /// Members without a rate.
    pub without: u64,
}

impl FittedRates<'_> {
    /// The text of an SVG file.
    pub fn draw(self, medium: Medium) -> String {
        let FittedRates { text, mut cells, relative, unit, without } = self;
        CellValues::sort(&mut cells);
        let without = some(without as usize, "member", "without a rate: fewer than 8 points in the window.");
        if cells.iter().all(|cell| cell.numbers.is_empty()) {
            let reason = "No member was followed closely enough for a rate to be fitted.";
            return text.heading([without]).nothing(medium, reason);
        }
        let middle = match &cells[..] {
            [CellValues { numbers, .. }] => {
                let middle = 0.5 * numbers[(numbers.len() - 1) / 2] + 0.5 * numbers[numbers.len() / 2];
                format!("Median {}.", significant(middle, 4))
            }
            _ => String::new(),
        };
        let colours = Colours::of(cells.len(), &text.key);
        let positive = cells.iter().filter_map(|cell| cell.numbers.first()).all(|rate| *rate > 0.0);
        let scale = if positive { CellValues::scale(&cells) } else { Scale::Linear };
        let bins = Bins::shared(&cells, scale);
        let (name, unit) = if relative { ("rate / theory", "") } else { ("rate", unit) };
        let (across, members) =
            (bins[0].axis(name, unit, scale), Axis::counts("members", bins.iter().map(Bins::most).max().unwrap_or(0)));
        let shown = relative && across.holds(1.0);
        let named = colours.legend().into_iter().filter(|_| cells.len() > 1);
        let theory = shown.then(|| Entry::new("ink", LegendMark::Dashed, "linear theory"));
        let mut heading = text.heading([middle, without, colours.sentence(cells.len())]);
        heading.legend = named.chain(theory).collect();
        only_panel(&heading, medium, &colours, [&across, &members], HEIGHT, |svg, panel| {
            Bins::draw_all(&bins, &colours, svg, panel);
            if shown {
                svg.group("ink", |svg| guide(svg, panel, 1.0));
            }
            panel.draw_frame(svg);
        })
    }
}
