//! How far a curve is from the shape at rest of a crystal.

use std::f64::consts::TAU;

use glam::DVec2;

use curvelax_curve::polygon;
use curvelax_flow::crystal::Energy;

/// Directions in which the two are compared.
const DIRECTIONS: usize = 360;

/// The place and the scale of the Wulff shape of support function γ that has the area and the centroid of a polygon.
fn fitted(nodes: &[DVec2], energy: &Energy) -> (DVec2, f64) {
    let scale = (polygon::signed_area(nodes).abs() / energy.wulff_area()).sqrt();
    // Two waves have their centroid elsewhere.
    let own = polygon::area_centroid(&energy.wulff_nodes(DIRECTIONS));
    (polygon::area_centroid(nodes) - scale * own, scale)
}

/// The largest error of the support function of a polygon against that of the Wulff shape of its area and centroid.
pub fn wulff_distance(nodes: &[DVec2], energy: &Energy) -> f64 {
    let (origin, scale) = fitted(nodes, energy);
    let error = |i: usize| {
        let psi = TAU * i as f64 / DIRECTIONS as f64;
        let normal = DVec2::from_angle(psi);
        let support = nodes.iter().map(|node| (*node - origin).dot(normal)).fold(f64::NEG_INFINITY, f64::max);
        (support - scale * energy.waves().at(psi)[0]).abs()
    };
    (0..DIRECTIONS).map(error).fold(0.0, f64::max)
}

/// That Wulff shape, as a polygon.
pub fn wulff_outline(nodes: &[DVec2], energy: &Energy) -> Vec<DVec2> {
    let (origin, scale) = fitted(nodes, energy);
    energy.wulff_nodes(DIRECTIONS).into_iter().map(|node| origin + scale * node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wulff_shape_anywhere_is_at_no_distance_and_another_one_at_its_own() {
        let energy: Energy = "cos:4,0.03,10".parse().unwrap();
        let nodes: Vec<DVec2> =
            energy.wulff_nodes(1000).into_iter().map(|node| 2.0 * node + DVec2::new(5.0, -3.0)).collect();
        assert!(wulff_distance(&nodes, &energy) < 1e-4);
        // The waves are in opposite phase, of 0.06 at most, twice as large.
        let turned: Energy = "cos:4,0.03,55".parse().unwrap();
        assert!((wulff_distance(&nodes, &turned) - 0.12).abs() < 2e-3);
        // Of two waves, whose shape has its centroid elsewhere.
        let two: Energy = "cos:2,0.1+cos:3,0.03,20".parse().unwrap();
        let nodes: Vec<DVec2> = two.wulff_nodes(1000);
        assert!(polygon::area_centroid(&nodes).length() > 1e-3 && wulff_distance(&nodes, &two) < 1e-4);
        assert!(wulff_distance(&wulff_outline(&nodes, &two), &two) < 1e-3);
    }
}
