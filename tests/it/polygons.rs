//! Random simple polygons: the guarantees of the generator, and their treatment as outlines.

use crate::common::polygons::{self, CORNERS, Family};
use curvelax::{
    curve::{Interpolation, Shape, crossing, polygon},
    ensemble::{Family as Ensemble, Member, Mollified, Spec, member::mollifier::MAX_VERTEX_TURN},
};
use glam::DVec2;

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

/// The outline as a member's nodes: equal spacing by arclength, corners rounded off.
fn nodes(outline: &[DVec2], n: usize) -> (Vec<DVec2>, Mollified) {
    let text: String = outline.iter().map(|p| format!("{},{}\n", p.x, p.y)).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("outline.csv");
    std::fs::write(&path, text).unwrap();
    let member = member(Shape::File(path), n, 0.0, 0);
    (member.nodes, member.mollified)
}

fn member(shape: Shape, points: usize, amplitude: f64, index: u64) -> Member {
    // What is rounded for the nodes alone.
    let (interpolate, rounding) = (Some(Interpolation::Polygon), Some(0.0));
    let (shape, amplitude) = (shape.into(), amplitude.into());
    Ensemble::new(&Spec { shape, interpolate, rounding, points, amplitude, ..Spec::default() })
        .unwrap()
        .member(index)
        .unwrap()
}

fn sharpest_turn(nodes: &[DVec2]) -> f64 {
    let edges: Vec<DVec2> = polygon::edges(nodes).collect();
    let after = edges.iter().cycle().skip(1);
    edges.iter().zip(after).map(|(a, b)| a.angle_to(*b).abs()).fold(0.0, f64::max)
}

/// Smallest distance, in spacings of `n` nodes, between points of the outline that are four spacings apart along it.
fn clearance(outline: &[DVec2], n: usize) -> f64 {
    const PARTS: usize = 8;
    let m = PARTS * n;
    let length = polygon::length(outline);
    let (mut points, mut left) = (Vec::new(), 0.0);
    for (p, edge) in outline.iter().zip(polygon::edges(outline)) {
        while left < edge.length() && points.len() < m {
            points.push(*p + edge * (left / edge.length()));
            left += length / m as f64;
        }
        left -= edge.length();
    }
    let apart = 4 * PARTS;
    let squared = |i: usize| {
        let others = (i + apart..m).take_while(|j| j - i <= m - apart);
        others.map(|j| points[i].distance_squared(points[j])).fold(f64::INFINITY, f64::min)
    };
    (0..m).map(squared).fold(f64::INFINITY, f64::min).sqrt() * n as f64 / length
}

#[test]
fn outlines_that_n_nodes_resolve_become_simple_polygons_and_others_are_reported() {
    for n in [64, 100, 128, 200, 256] {
        let [mut resolved, mut crossed, mut sharp, mut touched] = [0; 4];
        for j in 0..300 {
            let (family, outline) = polygons::random(j);
            let (nodes, done) = nodes(&outline, n);
            assert_eq!(done.crossed, crossing(&nodes).is_some(), "n = {n}, {family:?} {j}");
            assert_eq!(done.sharp, sharpest_turn(&nodes) > MAX_VERTEX_TURN, "n = {n}, {family:?} {j}");
            if done.rounds > 0 && !done.crossed {
                let kept = polygon::signed_area(&nodes) / polygon::signed_area(&outline).abs();
                assert!((kept - 1.0).abs() < 1e-9, "n = {n}, {family:?} {j}: {kept} of the area, {done:?}");
            }
            if clearance(&outline, n) > 1.0 {
                assert!(!done.crossed && !done.sharp, "n = {n}, {family:?} {j}: {done:?}");
                resolved += 1;
            }
            touched += usize::from(done.rounds > 0);
            crossed += usize::from(done.crossed);
            sharp += usize::from(done.sharp);
        }
        println!("n = {n}: of 300 {resolved} resolved, {touched} touched, {crossed} crossed, {sharp} sharp");
        assert!(resolved > 90 && touched > 270, "n = {n}: {resolved} {touched}, the test has lost its point");
        assert!(crossed < 10 && sharp < 60, "n = {n}: {crossed} of 300 cross, {sharp} turn sharply");
    }
}

#[test]
fn every_island_becomes_simple_nodes_without_sharp_turns() {
    for island in ["iceland", "jamaica", "madagascar", "sri-lanka"] {
        let shape: Shape = format!("file:examples/islands/{island}.csv").parse().unwrap();
        for (index, amplitude) in (0..20).map(|j| (j, if j == 0 { 0.0 } else { 0.05 })) {
            let mut areas = Vec::new();
            for n in [64, 100, 128, 200, 256] {
                let Member { nodes, mollified, .. } = member(shape.clone(), n, amplitude, index);
                assert!(sharpest_turn(&nodes) <= MAX_VERTEX_TURN, "{island} {n} {index}: {mollified:?}");
                assert_eq!(crossing(&nodes), None, "{island} {n} {index}: {mollified:?}");
                assert!(
                    !mollified.sharp && !mollified.crossed && !mollified.distorted(),
                    "{island} {n}: {mollified:?}"
                );
                areas.extend((mollified.rounds > 0).then(|| polygon::signed_area(&nodes)));
            }
            // Rounding keeps the area of the perturbed outline, which has nothing to do with the nodes.
            assert!(areas.len() > 1 && areas.iter().all(|area| (area / areas[0] - 1.0).abs() < 1e-5), "{areas:?}");
        }
    }
}
