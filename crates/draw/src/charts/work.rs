//! What an error costs: one row of panels for each solver, error against solves and against time.

use glam::DVec2;

use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Entry, FOOT, HEADING, LegendMark, MARGIN, Panel, draw_marker},
    medium::Medium,
    trace,
};

const HEIGHT: f64 = 200.0;
const GAP: f64 = 24.0;

/// Errors and costs of several methods.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorkDiagram<'a> {
    /// What is said of it.
    pub text: ChartText,
    /// Names of the costs, one for each column of panels, with their units.
    pub costs: [(&'a str, &'a str); 2],
    /// The rows of panels.
    pub rows: Vec<WorkPanels>,
}

/// The panels of one solver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorkPanels {
    /// What all its methods share.
    pub label: String,
    /// The methods; those of the same rank have the same colour in all rows.
    pub curves: Vec<WorkCurve>,
}

/// A method at several resolutions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorkCurve {
    /// Its entry in the legend.
    pub label: String,
    /// Error, and both costs; points that cannot be drawn on logarithmic axes are left out.
    pub points: Vec<(f64, [f64; 2])>,
}

impl WorkDiagram<'_> {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let WorkDiagram { text, costs, rows } = self;
        let pairs = |curve: &WorkCurve, column: usize| -> Vec<(f64, f64)> {
            curve.points.iter().map(|(error, costs)| (costs[column], *error)).collect()
        };
        let all = |column: usize| {
            let pairs = rows.iter().flat_map(|row| &row.curves).flat_map(move |curve| pairs(curve, column));
            pairs.filter(|(cost, error)| Scale::Log.holds(*cost) && Scale::Log.holds(*error))
        };
        let mut heading = text.heading([]);
        if all(0).next().is_none() {
            return heading.nothing(medium, "No run gave an error.");
        }
        let entry = |(rank, curve): (usize, &WorkCurve)| {
            Entry::new(&format!("s{rank}"), LegendMark::Marker(rank), &curve.label)
        };
        let longest = rows.iter().max_by_key(|row| row.curves.len());
        heading.legend = longest.into_iter().flat_map(|row| row.curves.iter().enumerate().map(entry)).collect();
        let row_height = HEADING + HEIGHT + FOOT;
        let (mut svg, top) = heading.begin(medium, rows.len() as f64 * row_height);
        let errors = Axis::over("error of t_relax", "", Scale::Log, all(0).map(|(_, error)| error));
        let across = [0, 1].map(|column| {
            let (name, unit) = costs[column];
            Axis::over(name, unit, Scale::Log, all(column).map(|(cost, _)| cost))
        });
        let left = Panel::left(&errors, HEIGHT);
        let size = DVec2::new(0.5 * (svg.width() - left - MARGIN - GAP), HEIGHT);
        for (i, row) in rows.iter().enumerate() {
            for (column, x) in across.iter().enumerate() {
                let corner = DVec2::new(left + column as f64 * (size.x + GAP), top + HEADING + i as f64 * row_height);
                let panel = Panel { heading: row.label.clone(), ..Panel::new(corner, size, [x, &errors]) };
                panel.draw_x(&mut svg);
                if column == 0 {
                    panel.draw_y(&mut svg);
                }
                panel.draw_frame(&mut svg);
                for (rank, curve) in row.curves.iter().enumerate() {
                    let places = panel.points(pairs(curve, column));
                    svg.group(&format!("s{rank}"), |svg| {
                        svg.path("thin", &trace::path(&places));
                        places.iter().for_each(|at| draw_marker(svg, rank, *at));
                    });
                }
            }
        }
        svg.finish()
    }
}
