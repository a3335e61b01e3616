//! Members side by side: to one scale if they can be seen at it. The gallery, the page and movies have this layout.

use glam::DVec2;

use curvelax_draw::svg::{Svg, coordinate};

/// Sizes that differ by more than this factor are drawn each to its own scale.
const MIXED: f64 = 6.0;

/// What is said where each member has its own scale.
pub(super) const OWN_SCALES: &str = "each to its own scale";

/// The layout common to the panels of some members.
pub(super) struct PanelLayout {
    /// The extent that fills a panel; if there is none, each member fills its own.
    pub common: Option<f64>,
    /// Size of a panel.
    pub frame: DVec2,
    /// Free space inside a panel.
    padding: f64,
}

impl PanelLayout {
    /// Fits members, each inside its lower left and upper right corner, into panels `side` wide that are no higher than
    /// the tallest member needs, and at least `least`.
    pub fn new(bounds: &[(DVec2, DVec2)], side: f64, padding: f64, least: f64) -> PanelLayout {
        let extents = bounds.iter().map(|(low, high)| *high - *low);
        let largest = extents.clone().map(DVec2::max_element).fold(0.0, f64::max);
        let positive = extents.clone().map(DVec2::max_element).filter(|extent| *extent > 0.0);
        let common = (largest <= MIXED * positive.fold(largest, f64::min)).then_some(largest);
        let layout = PanelLayout { common, frame: DVec2::splat(side), padding };
        let heights = extents.map(|extent| extent.y * layout.scale(extent.max_element()));
        let height = (heights.fold(0.0, f64::max) + 2.0 * padding).clamp(least.min(side), side);
        PanelLayout { frame: DVec2::new(side, height), ..layout }
    }

    /// Pixels per unit of length, for a member of this extent.
    pub fn scale(&self, own: f64) -> f64 {
        let extent = self.common.unwrap_or(own);
        if extent > 0.0 && extent.is_finite() { (self.frame.x - 2.0 * self.padding) / extent } else { 1.0 }
    }

    /// Where a point of a member inside these bounds lies, in the panel with its upper left corner at `corner`.
    pub fn place(&self, (low, high): (DVec2, DVec2), corner: DVec2) -> impl Fn(DVec2) -> DVec2 + use<> {
        let (scale, middle) = (self.scale((high - low).max_element()), corner + 0.5 * self.frame);
        // y grows downwards in a picture.
        move |p| middle + (p - 0.5 * (low + high)) * DVec2::new(scale, -scale)
    }
}

/// Draws the bar of the scale between its ends, with what is written next to it.
pub(super) fn draw_bar(svg: &mut Svg, [left, right]: [DVec2; 2], text: &str) {
    let [x, end, y, top, bottom] = [left.x, right.x, left.y, left.y - 4.0, left.y + 4.0].map(coordinate);
    svg.path("scale", &format!("M{x} {top}V{bottom}M{x} {y}H{end}M{end} {top}V{bottom}"));
    svg.text("note", right + DVec2::new(8.0, 4.0), text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_of_very_different_sizes_have_their_own_scales() {
        let common = |extents: &[f64]| {
            let bounds: Vec<_> = extents.iter().map(|extent| (DVec2::ONE, DVec2::ONE + DVec2::X * *extent)).collect();
            PanelLayout::new(&bounds, 100.0, 10.0, 50.0).common
        };
        assert_eq!(common(&[1.0, 6.0, 2.0]), Some(6.0));
        assert_eq!(common(&[1.0, 6.25, 2.0]), None);
        assert_eq!(common(&[0.0, 2.0]), Some(2.0));
        assert_eq!(common(&[]), Some(0.0));
    }
}
