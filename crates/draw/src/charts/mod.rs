//! The charts of studies and of measurements, each from plain numbers to the text of an SVG file.
//!
//! Equal data give equal bytes. Values that are not finite are omitted, and counted if they stand for members. If there
//! is nothing to draw, the picture says why. A picture stays below about 100 kB for any number of members: members are
//! counted in bins, and lines are thinned to visible detail.

pub mod bins;
pub mod decay;
pub mod dependence;
pub mod distribution;
pub mod members;
pub mod mesh;
pub mod rates;
pub mod relaxation;
pub mod scatter;
pub mod survival;
pub mod work;

pub use bins::CellValues;
pub use decay::{Decay, DecayCurve, DecayLaw, Theory};
pub use dependence::{Dependence, DependencePoint, PowerLawLine, Series, Setting};
pub use distribution::{CellQuantiles, TimeDistribution};
pub use members::{MemberDot, MemberTimes};
pub use mesh::MeshQuality;
pub use rates::FittedRates;
pub use relaxation::RelaxationTimes;
pub use scatter::{Scatter, ScatterPanel, ScatterPoint};
pub use survival::{Survival, SurvivalCurve};
pub use work::{WorkCurve, WorkDiagram, WorkPanels};

pub use super::chart::{CellKey, ChartText, Crossed, EstimatedNumber};

use curvelax_base::text::count;
use glam::DVec2;

use super::{
    axis::Axis,
    chart::{Colours, FOOT, HEADING, Heading, MARGIN, Panel},
    medium::Medium,
    svg::Svg,
    trace,
    width::{SIZE, shortened, width},
};

/// The unit of all times.
const TIME: &str = "length⁴";
/// With more curves than this, bands would hide each other.
const MAX_BANDS: usize = 4;
/// Height of the panels of a [`PanelGrid`], and pixels between them.
const GRID_HEIGHT: f64 = 200.0;
const GRID_GAP: f64 = 14.0;

/// The lower and upper bounds of a curve at each of its times.
pub type Band = (Vec<f64>, Vec<f64>);

/// `3 members REST`; nothing of none.
fn some(number: usize, one: &str, rest: &str) -> String {
    if number == 0 { String::new() } else { format!("{} {rest}", count(number as u64, one)) }
}

/// Whether the bands of curves are drawn, of which each may have one.
fn shows_bands<'a>(bands: impl ExactSizeIterator<Item = &'a Option<Band>>) -> bool {
    bands.len() <= MAX_BANDS && bands.into_iter().any(Option::is_some)
}

/// Draws the band of a curve, if it is shown, from the line of each of its bounds.
fn draw_band(svg: &mut Svg, band: Option<&Band>, line: impl Fn(&[f64]) -> Vec<DVec2>) {
    if let Some((low, high)) = band {
        svg.path("band", &trace::band(&line(high), &line(low)));
    }
}

/// A chart of one panel, `height` high, in which `layers` draws all but the axes.
fn only_panel(
    heading: &Heading,
    medium: Medium,
    colours: &Colours,
    axes: [&Axis; 2],
    height: f64,
    layers: impl FnOnce(&mut Svg, &Panel),
) -> String {
    let (mut svg, top) = heading.begin(medium, 8.0 + height + FOOT);
    let left = Panel::left(axes[1], height);
    let size = DVec2::new(svg.width() - left - MARGIN - colours.room(height), height);
    let panel = Panel::new(DVec2::new(left, top + 8.0), size, axes);
    panel.draw_axes(&mut svg);
    layers(&mut svg, &panel);
    colours.draw_bar(&mut svg, &panel);
    svg.finish()
}

/// A panel, `height` high below `top`, of rows that have `names` at its left under `key`, with `room` at its right. Its
/// horizontal axis is drawn.
fn named_rows<'a>(
    svg: &mut Svg,
    axes: [&'a Axis; 2],
    (names, key): (&[String], &str),
    (top, height): (f64, f64),
    room: f64,
) -> Panel<'a> {
    let left = MARGIN + 8.0 + names.iter().map(|name| width(name, SIZE)).fold(width(key, SIZE), f64::max);
    let size = DVec2::new(svg.width() - left - MARGIN - room, height);
    let panel = Panel::new(DVec2::new(left, top), size, axes);
    panel.draw_x(svg);
    panel
}

/// Panels of equal size side by side, in as many rows as they need.
struct PanelGrid {
    columns: usize,
    /// Width of a panel with its labels.
    width: f64,
}

impl PanelGrid {
    /// Panels with `room` for a colour bar at the right.
    fn new(medium: Medium, room: f64) -> PanelGrid {
        let columns = medium.columns();
        let width = match columns {
            1 => medium.width() - MARGIN - room,
            _ => 0.5 * (medium.width() - MARGIN - GRID_GAP - room),
        };
        PanelGrid { columns, width }
    }

    /// Height of all rows of so many panels.
    fn height(&self, panels: usize) -> f64 {
        panels.div_ceil(self.columns) as f64 * (HEADING + GRID_HEIGHT + FOOT)
    }

    /// Where the panel `i` and its labels begin, if the first row begins at `top`.
    fn corner(&self, i: usize, top: f64) -> DVec2 {
        let column = (i % self.columns) as f64;
        DVec2::new(column * (self.width + GRID_GAP), top + HEADING + self.height(i / self.columns * self.columns))
    }

    /// The panel `i`, with `left` pixels for its labels, if the first row begins at `top`.
    fn panel<'a>(&self, i: usize, top: f64, left: f64, heading: &str, axes: [&'a Axis; 2]) -> Panel<'a> {
        let size = DVec2::new(self.width - left, GRID_HEIGHT);
        let corner = self.corner(i, top) + DVec2::new(left, 0.0);
        Panel { heading: shortened(heading, SIZE, size.x), ..Panel::new(corner, size, axes) }
    }
}

#[cfg(test)]
mod tests;
