//! Longitude and latitude to the plane: Lambert's azimuthal equal-area projection about the outline's own centroid.
//!
//! Latitudes on the WGS 84 ellipsoid become authalic ones φ first, by series in its eccentricity: those on the sphere
//! of the same area, R = 6371.0072 km, between which all areas agree. With the centre (λ₀, φ₀)
//!
//! ```text
//! x = R k cos φ sin Δλ                      Δλ = λ - λ₀
//! y = R k (sin Δφ + 2 sin φ₀ cos φ sin²(Δλ/2))   Δφ = φ - φ₀
//! k = 1/√(1 - h)                             h = sin²(Δφ/2) + cos φ cos φ₀ sin²(Δλ/2)
//! ```
//!
//! from Snyder, *Map Projections – A Working Manual*, USGS Professional Paper 1395 (1987), chapters 3 and 24.
//! Its cosines of small angles are replaced by sines of half angles here, so that an islet keeps its digits.
//!
//! Areas are those on the ellipsoid. Lengths are off by 0.2 % at most near the centre, and by a factor of 1 ± c²/8 at
//! the distance c (radians) from it, which is 0.1 % at 570 km. An edge becomes a straight line between its projected
//! ends.
//!
//! Sines have the period of the longitude, so an outline across the antimeridian needs no special case.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::{
    outline::{RingPoints, Source},
    polygon,
};
use curvelax_base::{error::Result, text::number};

/// Radius, in kilometres, of the sphere with the area of the WGS 84 ellipsoid.
pub(super) const RADIUS: f64 = 6371.0072;

/// Maximum sin²(c/2) of the distance c from the centre: 120°, where shapes are already unrecognisable.
const MAX_HAVERSINE: f64 = 0.75;

/// Decimals of degrees to which the centre is rounded, so that the statement in the output is exact: 0.1 m.
const CENTRE_DECIMALS: f64 = 1e6;

/// What is said of a projected outline, before the centre.
pub(super) const PROJECTED: &str = "lon,lat projected to kilometres by Lambert's azimuthal equal-area projection about";

/// Square of the eccentricity of the WGS 84 ellipsoid, and its powers.
const E2: f64 = 0.006_694_379_990_141_317;
const E4: f64 = E2 * E2;
const E6: f64 = E4 * E2;

/// The sum of `terms[m]` sin 2(m+1)φ.
fn sines(angle: f64, terms: [f64; 3]) -> f64 {
    (1..).zip(terms).map(|(m, term)| term * (2.0 * f64::from(m) * angle).sin()).sum()
}

/// A place with the authalic latitude of its latitude on the ellipsoid, in degrees, to 10⁻⁸.
fn authalic(place: DVec2) -> DVec2 {
    let terms = [
        -(E2 / 3.0 + 31.0 / 180.0 * E4 + 59.0 / 560.0 * E6),
        17.0 / 360.0 * E4 + 61.0 / 1260.0 * E6,
        -383.0 / 45_360.0 * E6,
    ];
    place + DVec2::new(0.0, sines(place.y.to_radians(), terms).to_degrees())
}

/// The inverse of [`authalic`].
fn geodetic(place: DVec2) -> DVec2 {
    let terms = [
        E2 / 3.0 + 31.0 / 180.0 * E4 + 517.0 / 5040.0 * E6,
        23.0 / 360.0 * E4 + 251.0 / 3780.0 * E6,
        761.0 / 45_360.0 * E6,
    ];
    place + DVec2::new(0.0, sines(place.y.to_radians(), terms).to_degrees())
}

/// A projection with its centre (λ₀, φ₀) in degrees, φ₀ authalic.
#[derive(Clone, Copy)]
struct Lambert {
    centre: DVec2,
}

impl Lambert {
    /// The place of (λ, φ) in the plane; `None` if it is more than 120° away from the centre.
    fn forward(self, place: DVec2) -> Option<DVec2> {
        let DVec2 { x: difference, y: ascent } = (place - self.centre).map(f64::to_radians);
        let (sin0, cos0) = self.centre.y.to_radians().sin_cos();
        let cos = place.y.to_radians().cos();
        let half = (0.5 * difference).sin().powi(2);
        let haversine = (0.5 * ascent).sin().powi(2) + cos * cos0 * half;
        let scale = RADIUS / (1.0 - haversine).sqrt();
        let plane = DVec2::new(cos * difference.sin(), ascent.sin() + 2.0 * sin0 * cos * half);
        (haversine <= MAX_HAVERSINE).then(|| scale * plane)
    }

    /// The (λ, φ) of a place in the plane.
    fn inverse(self, plane: DVec2) -> DVec2 {
        let DVec2 { x, y } = plane / RADIUS;
        let distance = x.hypot(y);
        if distance == 0.0 {
            return self.centre;
        }
        let (sin, cos) = (2.0 * (0.5 * distance).min(1.0).asin()).sin_cos();
        let (sin0, cos0) = self.centre.y.to_radians().sin_cos();
        let latitude = (cos * sin0 + y * sin * cos0 / distance).clamp(-1.0, 1.0).asin();
        let difference = (x * sin).atan2(distance * cos0 * cos - y * sin0 * sin);
        DVec2::new(self.centre.x + difference.to_degrees(), latitude.to_degrees())
    }
}

/// Projects a ring in degrees to kilometres, and returns the centre, its centroid, in degrees.
///
/// # Errors
/// [`curvelax_base::error::Error::Request`] for a point that is no longitude and latitude, and for an outline that goes
/// round the Earth.
pub(super) fn project(source: Source, ring: &mut RingPoints) -> Result<DVec2> {
    for (i, DVec2 { x, y }) in ring.points.iter().enumerate() {
        if !((-180.0..=360.0).contains(x) && (-90.0..=90.0).contains(y)) {
            let problem = format!("({x:?}, {y:?}) is not a longitude and a latitude in degrees");
            let remedy = "longitudes are -180 to 360 and latitudes -90 to 90; plane coordinates are x,y of a table or of \
                          WKT without an SRID";
            return Err(source.refusal(&ring.places.at(i), &problem, remedy));
        }
    }
    close_over_poles(ring);
    let places: Vec<DVec2> = ring.points.iter().copied().map(authalic).collect();
    let too_wide = || {
        let problem = "the outline reaches over more than 120 degrees from its centroid";
        source.refusal(&ring.places.part, problem, "cut it into parts, or project it to a plane yourself")
    };
    let about = |centre: DVec2| -> Option<Vec<DVec2>> {
        places.iter().map(|place| Lambert { centre }.forward(*place)).collect()
    };
    let preliminary = mean_direction(&places).ok_or_else(too_wide)?;
    let plane = about(preliminary).ok_or_else(too_wide)?;
    let centroid = geodetic(Lambert { centre: preliminary }.inverse(polygon::area_centroid(&plane)));
    let centre = DVec2::new((centroid.x + 180.0).rem_euclid(360.0) - 180.0, centroid.y);
    let centre = (centre * CENTRE_DECIMALS).round() / CENTRE_DECIMALS;
    ring.points = about(authalic(centre)).ok_or_else(too_wide)?;
    Ok(centre)
}

/// `(lon, lat)` of a centre.
pub(super) fn stated(centre: DVec2) -> String {
    format!("{PROJECTED} ({}, {})", number(centre.x), number(centre.y))
}

/// The direction, in degrees, of the mean of the points on the unit sphere; `None` if they lie all around.
fn mean_direction(places: &[DVec2]) -> Option<DVec2> {
    let direction = |place: &DVec2| {
        let ((sin, cos), (sin_latitude, cos_latitude)) =
            (place.x.to_radians().sin_cos(), place.y.to_radians().sin_cos());
        DVec3::new(cos_latitude * cos, cos_latitude * sin, sin_latitude)
    };
    let mean = places.iter().map(direction).sum::<DVec3>() / places.len().max(1) as f64;
    let level = mean.x.hypot(mean.y);
    let degrees = DVec2::new(mean.y.atan2(mean.x), mean.z.atan2(level)) * (180.0 / PI);
    (mean.length() > 1e-6 || places.is_empty()).then_some(degrees)
}

/// Removes the cut along a meridian that opens an outline round a pole in longitude and latitude: (180, -84), (180,
/// -90), (-180, -90), (-180, -84). On the sphere its two sides are one, and the pole is inside.
fn close_over_poles(ring: &mut RingPoints) {
    let points = &ring.points;
    let same = |a: DVec2, b: DVec2| a.y == b.y && ((a.x - b.x) % 360.0 == 0.0 || a.y.abs() == 90.0);
    let mut kept = vec![true; points.len()];
    let mut i = 1;
    while i < points.len() {
        let after = (i..points.len()).find(|j| !same(points[*j], points[i])).unwrap_or(points.len());
        if points[i].y.abs() == 90.0 {
            let cut = after < points.len() && same(points[i - 1], points[after]);
            let last = if cut { after + 1 } else { after };
            kept[if cut { i } else { i + 1 }..last].fill(false);
        }
        i = after.max(i + 1);
    }
    if kept.contains(&false) {
        ring.retain(|i| kept[i]);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::{prelude::*, test_runner::RngSeed};

    use super::*;
    use crate::outline::Places;

    fn projected(places: &[(f64, f64)]) -> Result<(DVec2, Vec<DVec2>)> {
        let points = places.iter().map(|place| DVec2::from(*place)).collect();
        let mut ring = RingPoints::new(points, Places::points(String::new()));
        project(Source::new(Path::new("map")), &mut ring).map(|centre| (centre, ring.points))
    }

    /// The area of a triangle of great circles on the sphere, by van Oosterom and Strackee (1983).
    fn triangle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
        // a·(b × c) of near directions, without cancellation.
        let volume = a.dot((b - a).cross(c - a));
        2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a)) * RADIUS * RADIUS
    }

    fn direction(place: DVec2) -> DVec3 {
        let (longitude, latitude) = (place.x.to_radians(), place.y.to_radians());
        DVec3::new(latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin())
    }

    /// The same cases in every run, or others with `CURVELAX_TESTS=all`; the seed that is printed is then that of
    /// `Fixed`.
    fn seed() -> RngSeed {
        let seed = match std::env::var("CURVELAX_TESTS") {
            Ok(tests) if tests == "all" => std::time::UNIX_EPOCH.elapsed().map_or(1, |time| time.as_nanos() as u64),
            _ => 1,
        };
        eprintln!("random cases of seed {seed}");
        RngSeed::Fixed(seed)
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            failure_persistence: None,
            rng_seed: seed(),
            ..ProptestConfig::default()
        })]
        #[test]
        fn areas_are_those_on_the_authalic_sphere(
            (longitude, latitude) in (-180.0..180.0, -85.0..85.0),
            radii in prop::collection::vec(0.3..1.0, 3..20),
        ) {
            // Edges are great circles on one side and straight lines on the other: the outline is small.
            let stretch = f64::to_radians(latitude).cos();
            let corner = |(i, r): (usize, &f64)| {
                let away = 0.02 * r * DVec2::from_angle(i as f64 * 2.0 * PI / radii.len() as f64);
                let east: f64 = longitude + away.x / stretch + 540.0;
                (east.rem_euclid(360.0) - 180.0, latitude + away.y)
            };
            let places: Vec<_> = radii.iter().enumerate().map(corner).collect();
            let corners: Vec<DVec3> = places.iter().map(|place| direction(authalic(DVec2::from(*place)))).collect();
            let exact: f64 = corners.windows(2).map(|pair| triangle(corners[0], pair[0], pair[1])).sum();
            let area = polygon::signed_area(&projected(&places).unwrap().1);
            prop_assert!((area / exact - 1.0).abs() < 1e-6, "{area} {exact}");
        }

        #[test]
        fn the_inverse_leads_back(
            centre in (-180.0..180.0, -90.0..90.0),
            place in (-180.0..180.0, -89.9..89.9),
        ) {
            let map = Lambert { centre: DVec2::from(centre) };
            if let Some(plane) = map.forward(DVec2::from(place)) {
                let back = direction(map.inverse(plane)).distance(direction(DVec2::from(place)));
                prop_assert!(back < 1e-9, "{back}");
            }
        }
    }

    #[test]
    fn the_projection_is_that_of_the_manual() {
        let equatorial = Lambert { centre: DVec2::ZERO };
        let pole = equatorial.forward(DVec2::new(0.0, 90.0)).unwrap() / RADIUS;
        assert!(pole.distance(DVec2::new(0.0, 2_f64.sqrt())) < 1e-15, "{pole}");
        // The formula as the manual writes it.
        let (latitude, longitude) = (40_f64.to_radians(), 60_f64.to_radians());
        let k = (2.0 / (1.0 + latitude.cos() * longitude.cos())).sqrt();
        let exact = k * DVec2::new(latitude.cos() * longitude.sin(), latitude.sin());
        let found = equatorial.forward(DVec2::new(60.0, 40.0)).unwrap() / RADIUS;
        assert!(found.distance(exact) < 1e-15, "{found} {exact}");
    }

    #[test]
    fn an_outline_across_the_antimeridian_is_that_of_its_shifted_copy() {
        // Vanua Levu and Taveuni, roughly; the same places are written in three ways.
        let here = [(178.5, -16.9), (179.9, -17.0), (-179.9, -16.2), (179.5, -16.1)];
        let shifted = here.map(|(longitude, latitude)| (f64::rem_euclid(longitude, 360.0), latitude));
        let elsewhere = here.map(|(longitude, latitude)| (f64::rem_euclid(longitude, 360.0) - 170.0, latitude));
        let ((centre, points), (_, same), (away, moved)) =
            (projected(&here).unwrap(), projected(&shifted).unwrap(), projected(&elsewhere).unwrap());
        assert!(centre.x > 178.0 && centre.x < 180.0 && (centre.x - 170.0 - away.x).abs() < 1e-5, "{centre} {away}");
        for i in 0..4 {
            assert!(points[i].distance(same[i]) < 1e-9 && points[i].distance(moved[i]) < 1e-3);
        }
        let (low, high) = polygon::bounds(points).unwrap();
        assert!((high - low).max_element() < 200.0, "{}", high - low);
    }

    #[test]
    fn a_place_that_is_not_on_earth_is_refused_with_its_number() {
        for (place, shown) in [((0.0, 90.5), "(0.0, 90.5)"), ((361.0, 0.0), "(361.0, 0.0)"), ((f64::NAN, 0.0), "(NaN")]
        {
            let error = projected(&[(0.0, 0.0), place, (1.0, 1.0)]).unwrap_err().to_string();
            assert!(error.contains("point 2: ") && error.contains(shown), "{error}");
        }
        let error = projected(&[(-180.0, -80.0), (0.0, -80.0), (180.0, 80.0), (0.0, 80.0)]).unwrap_err().to_string();
        assert!(error.contains("more than 120 degrees"), "{error}");
    }

    #[test]
    fn a_continent_round_the_pole_is_closed_over_it() {
        let coast: Vec<_> = (0..=36).map(|i| (-180.0 + 10.0 * f64::from(i), -70.0)).collect();
        let cut = [&coast[..], &[(180.0, -90.0), (-180.0, -90.0), (-180.0, -70.0)]].concat();
        let (centre, points) = projected(&cut).unwrap();
        assert!(points.len() == 37 && centre.y < -89.9, "{} {centre}", points.len());
        // 2πR²(1 - sin φ), less what chords cut off.
        let latitude = authalic(DVec2::new(0.0, 70.0)).y;
        let cap = 2.0 * PI * RADIUS * RADIUS * (1.0 - latitude.to_radians().sin());
        let area = polygon::signed_area(&points).abs();
        assert!((area / cap - 1.0).abs() < 0.01, "{area} {cap}");
    }

    /// The area between two meridians, a degree apart, and two latitudes on the ellipsoid, by its closed formula.
    fn zone(low: f64, high: f64) -> f64 {
        let e = E2.sqrt();
        let q = |latitude: f64| {
            let s = latitude.to_radians().sin();
            (1.0 - E2) * (s / (1.0 - E2 * s * s) + (e * s).atanh() / e)
        };
        0.5 * 6378.137_f64.powi(2) * 1_f64.to_radians() * (q(high) - q(low))
    }

    #[test]
    fn areas_are_those_on_the_ellipsoid() {
        for low in [-90.0, -60.0, 0.0, 45.0, 60.0, 89.0] {
            // Parallels are no great circles, so the sides are cut finely.
            let side = |from: (f64, f64), to: (f64, f64)| {
                (0..1000).map(move |i| {
                    let share = f64::from(i) / 1000.0;
                    (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1))
                })
            };
            let high = (low + 1.0_f64).min(89.99);
            let low = low.max(-89.99);
            let corners = [(10.0, low), (11.0, low), (11.0, high), (10.0, high), (10.0, low)];
            let places: Vec<_> = corners.windows(2).flat_map(|pair| side(pair[0], pair[1])).collect();
            let area = polygon::signed_area(&projected(&places).unwrap().1);
            assert!((area / zone(low, high) - 1.0).abs() < 1e-6, "{low}: {area} {}", zone(low, high));
        }
        // The sphere is off by half a per cent there.
        assert!((zone(60.0, 61.0) - 6123.14).abs() < 0.01, "{}", zone(60.0, 61.0));
    }

    #[test]
    fn an_authalic_latitude_leads_back() {
        for latitude in -90..=90 {
            let place = DVec2::new(0.0, f64::from(latitude));
            assert!((geodetic(authalic(place)) - place).length() < 2e-8, "{latitude}");
        }
    }

    #[test]
    fn an_islet_of_a_metre_keeps_its_shape() {
        let side = 1e-5;
        let (_, points) =
            projected(&[(10.0, 60.0), (10.0 + side, 60.0), (10.0 + side, 60.0 + side), (10.0, 60.0 + side)]).unwrap();
        let [east, north] = [points[1] - points[0], points[2] - points[1]].map(DVec2::length);
        // The radii of curvature of the meridian and of the prime vertical at 60 degrees.
        let degree = 6378.137 * side.to_radians() / (1.0 - 0.75 * E2).sqrt();
        let meridian = degree * (1.0 - E2) / (1.0 - 0.75 * E2);
        assert!((north / meridian - 1.0).abs() < 2e-3 && (east / (0.5 * degree) - 1.0).abs() < 2e-3, "{east} {north}");
        assert!((north * east / (0.5 * degree * meridian) - 1.0).abs() < 1e-6, "{east} {north}");
    }
}
