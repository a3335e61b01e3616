//! Mesh quality of the members: how unequal the spacing of nodes is at the end, and how far lengths have drifted.

use super::{
    GRID_HEIGHT, PanelGrid,
    bins::{Bins, guide},
    some,
};
use crate::{
    axis::{Axis, Scale},
    chart::{ChartText, Entry, LegendMark, MARGIN, Panel},
    empty::say,
    medium::Medium,
    svg::Svg,
};
use curvelax_base::text::significant;

/// Mesh quality of the members at their end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshQuality<'a> {
    /// What is said of it.
    pub text: ChartText,
    /// Longest over shortest edge, one number per member: a picture shows less than seven digits.
    pub mesh_ratio: &'a [f32],
    /// max |r_i − |e_i||/|e_i|, one number per member.
    pub metric_drift: &'a [f32],
    /// Metric drift above which results are distrusted, and the number of members above it.
    pub distrusted: (f64, usize),
}

/// The values of one panel.
struct MeshMeasure {
    name: &'static str,
    scale: Scale,
    /// Bins, if there are any values.
    bins: Option<Bins>,
    heading: String,
    /// Number of values that the axis cannot show.
    zeros: usize,
    unknown: usize,
}

impl MeshMeasure {
    fn new(name: &'static str, values: &[f32]) -> MeshMeasure {
        let known = || values.iter().map(|value| f64::from(*value)).filter(|value| Scale::Linear.holds(*value));
        // A drift of 0 should not crowd all others at the left.
        let positive = || known().filter(|value| *value > 0.0);
        let scale = if known().any(|value| value < 0.0) { Scale::Linear } else { Scale::of(positive()) };
        let mut sorted: Vec<f64> = known().filter(|value| scale.holds(*value)).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let known = known().count();
        MeshMeasure {
            name,
            scale,
            bins: (!sorted.is_empty()).then(|| Bins::of(&sorted, scale)),
            heading: middle_and_most(&sorted),
            zeros: known - sorted.len(),
            unknown: values.len() - known,
        }
    }

    fn sentence(&self) -> String {
        let zeros = some(self.zeros, "member", &format!("with {} 0 left out.", self.name));
        let unknown = some(self.unknown, "member", &format!("without {}.", self.name));
        [zeros, unknown].join(" ").trim().into()
    }

    /// Draws the panel `i`.
    fn draw(&self, svg: &mut Svg, places: &PanelGrid, (i, top): (usize, f64), bound: Option<f64>) {
        let Some(bins) = &self.bins else {
            let nothing = Axis::counts("", 0);
            let Panel { corner, size, .. } = places.panel(i, top, MARGIN, "", [&nothing; 2]);
            return say(svg, corner, size, &format!("No member has a {}.", self.name));
        };
        let (across, members) = (bins.axis(self.name, "", self.scale), Axis::counts("members", bins.most()));
        let panel = places.panel(i, top, Panel::left(&members, GRID_HEIGHT), &self.heading, [&across, &members]);
        panel.draw_axes(svg);
        bins.draw(svg, &panel);
        if let Some(bound) = bound.filter(|bound| across.holds(*bound)) {
            svg.group("ink", |svg| guide(svg, &panel, bound));
        }
        panel.draw_frame(svg);
    }
}

fn middle_and_most(sorted: &[f64]) -> String {
    let Some(last) = sorted.len().checked_sub(1) else { return String::new() };
    // Four digits of a ratio near 1; two of a drift, whose zeros or power of ten take room.
    let shown = |value: f64| significant(value, if value.abs() < 0.1 { 2 } else { 4 });
    let [middle, most] = [last / 2, last].map(|i| shown(sorted[i]));
    format!("median {middle}, max {most}")
}

impl MeshQuality<'_> {
    /// The text of an SVG file.
    pub fn draw(&self, medium: Medium) -> String {
        let ratio = MeshMeasure::new("mesh_ratio", self.mesh_ratio);
        let drift = MeshMeasure::new("metric_drift", self.metric_drift);
        let (bound, above) = self.distrusted;
        let shown = significant(bound, 1);
        let verdict = some(above, "member", &format!("with metric_drift above {shown}."));
        let mut heading = self.text.heading([verdict, ratio.sentence(), drift.sentence()]);
        if above > 0 {
            let label = format!("metric_drift {shown}, above which results are distrusted");
            heading.legend.push(Entry::new("ink", LegendMark::Dashed, &label));
        }
        let places = PanelGrid::new(medium, 0.0);
        let (mut svg, top) = heading.begin(medium, places.height(2));
        ratio.draw(&mut svg, &places, (0, top), None);
        drift.draw(&mut svg, &places, (1, top), Some(bound));
        svg.finish()
    }
}
