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

use glam::DVec2;

use super::{
    axis::Axis,
    chart::{MARGIN, Panel},
    medium::Medium,
    svg::Svg,
    trace,
};

/// The unit of all times.
const TIME: &str = "length⁴";
/// With more curves than this, bands would hide each other.
const MAX_BANDS: usize = 4;

/// The lower and upper bounds of a curve at each of its times.
pub type Band = (Vec<f64>, Vec<f64>);

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

/// The panel of a picture that has only one, `height` high below `top`, with `room` for a colour bar at its right.
fn only_panel<'a>(svg: &Svg, [x, y]: [&'a Axis; 2], top: f64, height: f64, room: f64) -> Panel<'a> {
    let left = Panel::left(y, height);
    let size = DVec2::new(svg.width() - left - MARGIN - room, height);
    Panel { heading: "", corner: DVec2::new(left, top + 8.0), size, x, y, labels_x: true }
}

/// Panels of equal width side by side, in as many rows as they need.
struct PanelGrid {
    columns: usize,
    /// Width of a panel with its labels.
    width: f64,
    /// Height of a row.
    row: f64,
    gap: f64,
}

impl PanelGrid {
    /// Rows `row` high, with `gap` between panels and `room` for a colour bar at the right.
    fn new(medium: Medium, row: f64, gap: f64, room: f64) -> PanelGrid {
        let columns = medium.columns();
        let width = match columns {
            1 => medium.width() - MARGIN - room,
            _ => 0.5 * (medium.width() - MARGIN - gap - room),
        };
        PanelGrid { columns, width, row, gap }
    }

    /// Height of all rows of so many panels.
    fn height(&self, panels: usize) -> f64 {
        panels.div_ceil(self.columns) as f64 * self.row
    }

    /// Where the panel `i` begins, from where the first does.
    fn corner(&self, i: usize) -> DVec2 {
        let [column, row] = [i % self.columns, i / self.columns].map(|place| place as f64);
        DVec2::new(column * (self.width + self.gap), row * self.row)
    }
}

#[doc(hidden)]
pub mod samples;
#[cfg(test)]
mod tests;
