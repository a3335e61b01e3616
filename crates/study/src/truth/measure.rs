//! Measures of a curve, from its nodes before and after a run, in f64.

use std::f64::consts::TAU;

use glam::DVec2;

use curvelax_curve::polygon;

/// A number that a run is judged by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Mean distance of the nodes from the centroid of the area.
    Radius,
    /// `ln(a(0)/a(t))` of the amplitude a of this mode.
    Decay(u32),
    /// Length.
    Length,
    /// Signed area.
    Area,
}

impl Measure {
    /// Returns the number; only the decay uses the nodes `before`.
    pub fn of(self, before: &[DVec2], after: &[DVec2]) -> f64 {
        match self {
            Measure::Radius => mean_radius(&about_centroid(after)),
            Measure::Decay(m) => (mode_amplitude(before, m) / mode_amplitude(after, m)).ln(),
            Measure::Length => polygon::length(after),
            Measure::Area => polygon::signed_area(after),
        }
    }
}

fn about_centroid(nodes: &[DVec2]) -> Vec<DVec2> {
    let centre = polygon::area_centroid(nodes);
    nodes.iter().map(|node| *node - centre).collect()
}

fn mean_radius(nodes: &[DVec2]) -> f64 {
    nodes.iter().map(|node| node.length()).sum::<f64>() / nodes.len() as f64
}

/// Returns the amplitude of mode m of the radius about the centroid as a function of the angle, a length.
///
/// By the trapezium rule on the angles of the nodes, which is exact up to rounding for modes that equally spaced nodes
/// resolve.
pub fn mode_amplitude(nodes: &[DVec2], m: u32) -> f64 {
    let nodes = about_centroid(nodes);
    let (n, mean) = (nodes.len(), mean_radius(&nodes));
    let wave = |node: DVec2| (node.length() - mean) * DVec2::from_angle(f64::from(m) * node.to_angle());
    let share = |i: usize| {
        let (here, next) = (nodes[i], nodes[(i + 1) % n]);
        here.angle_to(next) * (wave(here) + wave(next))
    };
    let sum: DVec2 = (0..n).map(share).sum();
    sum.length() / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wavy(n: usize, m: u32, amplitude: f64) -> Vec<DVec2> {
        let node = |i: usize| {
            let theta = TAU * i as f64 / n as f64;
            (2.0 + amplitude * (f64::from(m) * theta + 0.3).cos()) * DVec2::from_angle(theta) + DVec2::new(5.0, -7.0)
        };
        (0..n).map(node).collect()
    }

    #[test]
    fn a_mode_is_found_wherever_the_circle_lies_and_no_other_is() {
        for m in 2..=6 {
            let nodes = wavy(31, m, 1e-3);
            for other in 2..=6 {
                let expected = if other == m { 1e-3 } else { 0.0 };
                let found = mode_amplitude(&nodes, other);
                assert!((found - expected).abs() < 2e-9, "mode {other} of a curve of mode {m}: {found}");
            }
        }
    }

    #[test]
    fn a_decay_is_the_logarithm_of_the_ratio() {
        let decay = Measure::Decay(4).of(&wavy(40, 4, 1e-3), &wavy(40, 4, 1e-4));
        assert!((decay - 10_f64.ln()).abs() < 1e-5, "{decay}");
        assert!((Measure::Radius.of(&[], &wavy(40, 2, 0.0)) - 2.0).abs() < 1e-14);
    }
}
