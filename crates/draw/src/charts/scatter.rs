//! A time against features of the members: one panel for each feature, one dot for each member.
//!
//! The pointer on a dot shows its member and its numbers.

use super::{GRID_HEIGHT, PanelGrid, TIME, some};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Colours, Entry, LegendMark, Panel, triangle_up},
    medium::Medium,
    svg::{Svg, dots},
};
use curvelax_base::text::significant;

/// A time against features.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scatter<'a> {
    /// What is said of it.
    pub text: ChartText,
    /// Sentences below the note.
    pub notes: Vec<String>,
    /// Number of cells.
    pub cells: usize,
    /// The features, best first.
    pub panels: Vec<ScatterPanel>,
    /// Why there are none.
    pub reason: &'a str,
}

/// The time against one feature.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScatterPanel {
    /// Name of the feature.
    pub feature: String,
    /// How much it explains.
    pub heading: String,
    /// The members.
    pub points: Vec<ScatterPoint>,
}

/// A member.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScatterPoint {
    /// Its cell, as an index into those of the chart.
    pub cell: usize,
    /// Its index.
    pub member: u64,
    /// Its feature.
    pub x: f64,
    /// Its time, or when it ended without reaching it.
    pub t: f64,
    /// It reached the time.
    pub happened: bool,
}

impl ScatterPoint {
    fn is_drawable(&self) -> bool {
        Scale::Linear.holds(self.x) && Scale::Linear.holds(self.t)
    }

    /// The mark, with a text for the pointer.
    fn draw(&self, svg: &mut Svg, panel: &Panel) {
        let at = panel.place(self.x, self.t);
        let ended = if self.happened { "" } else { " ended" };
        let (x, t) = (significant(self.x, 3), significant(self.t, 4));
        let mark = if self.happened { dots(&[at]) } else { triangle_up(at) };
        svg.hinted_path(&mark, &format!("member {}: {x},{ended} {t}", self.member));
    }
}

impl Scatter<'_> {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let mut heading = self.text.heading(self.notes.iter().cloned());
        if self.panels.is_empty() {
            return heading.nothing(medium, self.reason);
        }
        let colours = Colours::of(self.cells, &self.text.key);
        heading.sentences.push(colours.sentence(self.cells));
        let hidden = self.panels.iter().flat_map(|panel| &panel.points).filter(|point| !point.is_drawable()).count();
        heading.sentences.push(some(hidden, "dot", "out of range."));
        let places = PanelGrid::new(medium, colours.room(GRID_HEIGHT));
        heading.legend = self.legend(&colours);
        let (mut svg, top) = heading.begin(medium, places.height(self.panels.len()));
        let times = self.panels.iter().flat_map(|panel| &panel.points).filter(|point| point.is_drawable());
        let scale = Scale::of(times.clone().map(|point| point.t));
        let time = Axis::over(&self.text.quantity, TIME, scale, times.map(|point| point.t));
        let left = Panel::left(&time, GRID_HEIGHT);
        for (i, of) in self.panels.iter().enumerate() {
            let known = of.points.iter().filter(|point| point.is_drawable());
            // Where times are over several magnitudes, features may be, too.
            let own = if scale == Scale::Log { Scale::of(known.clone().map(|point| point.x)) } else { Scale::Linear };
            let axis = Axis::over(&of.feature, "", own, known.map(|point| point.x));
            let panel = places.panel(i, top, left, &of.heading, [&axis, &time]);
            panel.draw_axes(&mut svg);
            colours.each(&mut svg, |svg, _, cell| {
                for (class, happened) in [("points", true), ("hollow", false)] {
                    let is_one = |point: &&ScatterPoint| point.cell == cell && point.happened == happened;
                    let mut own = of.points.iter().filter(is_one).filter(|point| point.is_drawable()).peekable();
                    if own.peek().is_some() {
                        svg.group(class, |svg| own.for_each(|point| point.draw(svg, &panel)));
                    }
                }
            });
            panel.draw_frame(&mut svg);
            if i + 1 == self.panels.len().min(places.columns) {
                colours.draw_bar(&mut svg, &panel);
            }
        }
        svg.finish()
    }

    fn legend(&self, colours: &Colours) -> Vec<Entry> {
        let (key, several) = (&self.text.key, self.cells > 1 && colours.bar.is_none());
        // Panels show what colours do not.
        let cells: Vec<Entry> = match &key.crossed {
            _ if !several || key.named_elsewhere => Vec::new(),
            Some(crossed) => {
                let entry = |(i, label): (usize, &String)| Entry::new(&format!("s{i}"), LegendMark::Points, label);
                crossed.colours.iter().enumerate().map(entry).collect()
            }
            None => colours.distinct(LegendMark::Points),
        };
        let censored = self.panels.iter().any(|panel| panel.points.iter().any(|point| !point.happened));
        let class = if several { "faint" } else { "s0" };
        let text = format!("ended without {}, at its last time", self.text.quantity);
        let censored = censored.then(|| Entry::new(class, LegendMark::HollowUp, &text));
        cells.into_iter().chain(censored).collect()
    }
}
