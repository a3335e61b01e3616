//! Random simple polygons: what the generator promises, and what becomes of them as outlines.

mod common;

use common::polygons::{self, CORNERS, Family};
use curvelax::curve::{crossing, polygon};

#[test]
fn a_thousand_random_polygons_are_simple_and_of_every_family() {
    let mut corners = Vec::new();
    for j in 0..1000 {
        let (family, outline) = polygons::random(j);
        assert_eq!((family, outline.clone()), polygons::random(j));
        assert_eq!(family, Family::ALL[j as usize % 5]);
        assert!(CORNERS.contains(&outline.len()), "{family:?} {j} has {} corners", outline.len());
        assert_eq!(crossing(&outline), None, "{family:?} {j}");
        let (area, length) = (polygon::signed_area(&outline).abs(), polygon::length(&outline));
        assert!(area > 1e-6 * length * length, "{family:?} {j} has the area {area} at a length of {length}");
        assert_eq!(polygon::turning_number(&outline).abs(), 1, "{family:?} {j}");
        corners.push(outline.len());
    }
    corners.sort_unstable();
    assert!(corners[0] == *CORNERS.start() && corners[999] > 190 && (20..60).contains(&corners[500]), "{corners:?}");
}
