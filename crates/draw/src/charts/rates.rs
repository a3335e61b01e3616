//! How fast the excess of the members decreases: their fitted rates, relative to linear theory if it predicts any.

use super::{
    bins::{Bins, CellValues, guide},
    only_panel,
};
use crate::{
    axis::{Axis, Scale},
    chart::{CellKey, Colours, Entry, FOOT, Heading, LegendMark, nothing},
    medium::Medium,
};
use curvelax_base::text::{count, significant};

const HEIGHT: f64 = 200.0;

/// Fitted rates of the members.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FittedRates<'a> {
    /// First line.
    pub title: &'a str,
    /// A sentence below it, or nothing.
    pub note: &'a str,
    /// Name of the quantity that distinguishes the cells, for the colour bar that replaces the legend if there are
    /// many.
    pub key: CellKey,
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
        let FittedRates { title, note, key, mut cells, relative, unit, without } = self;
        CellValues::sort(&mut cells);
        let without = match without {
            0 => String::new(),
            without => format!("{} without a rate: fewer than 8 points in the window.", count(without, "member")),
        };
        if cells.iter().all(|cell| cell.numbers.is_empty()) {
            let sentences = vec![note.into(), without];
            return nothing(medium, title, sentences, "No member was followed closely enough for a rate to be fitted.");
        }
        let middle = match &cells[..] {
            [CellValues { numbers, .. }] => {
                let middle = 0.5 * numbers[(numbers.len() - 1) / 2] + 0.5 * numbers[numbers.len() / 2];
                format!("Median {}.", significant(middle, 4))
            }
            _ => String::new(),
        };
        let values: Vec<Option<f64>> = cells.iter().map(|cell| cell.value).collect();
        let colours = Colours::of(&values, &key);
        let positive = cells.iter().filter_map(|cell| cell.numbers.first()).all(|rate| *rate > 0.0);
        let scale = if positive { CellValues::scale(&cells) } else { Scale::Linear };
        let bins = Bins::shared(&cells, scale);
        let (name, unit) = if relative { ("rate / theory", "") } else { ("rate", unit) };
        let (across, members) =
            (bins[0].axis(name, unit, scale), Axis::counts("members", bins.iter().map(Bins::most).max().unwrap_or(0)));
        let shown = relative && across.holds(1.0);
        let named = colours.legend(|i| &cells[i].label).filter(|_| cells.len() > 1);
        let theory = shown.then(|| Entry::new("ink", LegendMark::Dashed, "linear theory"));
        let legend = named.chain(theory).collect();
        let sentences = vec![note.into(), middle, without, colours.sentence(cells.len())];
        let (mut svg, top) = Heading { title, sentences, legend }.begin(medium, HEIGHT + FOOT + 8.0);
        let panel = only_panel(&svg, [&across, &members], top, HEIGHT, colours.room(HEIGHT));
        panel.draw_x(&mut svg);
        panel.draw_y(&mut svg);
        Bins::draw_all(&bins, &colours, &mut svg, &panel);
        if shown {
            svg.open("ink");
            guide(&mut svg, &panel, 1.0);
            svg.close();
        }
        panel.draw_frame(&mut svg);
        colours.draw_bar(&mut svg, &panel);
        svg.finish()
    }
}
