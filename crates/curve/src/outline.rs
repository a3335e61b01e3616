//! An outline: a closed counter-clockwise polygon, or an error that says why points are none.
//!
//! The last point may repeat the first; other neighbours must differ. Points that are not neighbours may coincide, with
//! the warning of a crossing, and so may an edge that returns along another (a spike without width). Either orientation
//! is accepted; a clockwise outline is reversed about its first point, which stays first.
//!
//! [`outlines`](super::outlines) reads them from files.

use std::path::Path;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::{Undecided, crossing_within, polygon};
use curvelax_base::{
    error::{Error, Result, echo_path, shortened},
    text::count,
};

/// Maximum number of points of an outline, and of nodes of a curve.
pub const MAX_POINTS: usize = 1_000_000;

/// Minimum extent, so that inverse fourth powers of lengths stay finite.
const MIN_EXTENT: f64 = 1e-30;

/// Maximum coordinate, so that fourth powers of lengths, in which times are measured, stay finite.
const MAX_COORDINATE: f64 = 1e30;

/// Distance, relative to the outline's extent, at which neighbours are one point. Coordinates are rounded at
/// 1e-16; an edge much shorter than this has no direction left.
const COINCIDENT: f64 = 1e-12;

/// Pairs of boxes compared before the search for a crossing gives up: about a second. A coast of a million points takes
/// about 1e7.
const MAX_COMPARISONS: u64 = 50_000_000;

/// Fewest points of an outline whose half says something about it.
const MIN_HALVED: usize = 12;

/// A closed counter-clockwise polygon.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outline {
    vertices: Vec<DVec2>,
    simple: bool,
    warnings: Vec<String>,
    digest: u32,
}

impl Outline {
    /// Creates the outline through a list of points, in either orientation, with or without the first one again at the
    /// end.
    ///
    /// ```
    /// use curvelax_curve::Outline;
    /// use glam::DVec2;
    ///
    /// let triangle = Outline::from_points(&[DVec2::ZERO, DVec2::X, DVec2::Y])?;
    /// assert_eq!(triangle.vertices().len(), 3);
    /// assert!(Outline::from_points(&[DVec2::ZERO, DVec2::X]).is_err());
    /// # Ok::<(), curvelax_base::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Outline::read`], as if each point were a line of a file `(points)`.
    pub fn from_points(points: &[DVec2]) -> Result<Outline> {
        Outline::of_ring(Source::new(Path::new("(points)")), RingPoints::new(points.to_vec(), Places::lines()))
    }

    /// Checks the points of a ring; the places name them in messages.
    ///
    /// # Errors
    /// As [`Outline::read`], for everything but the text.
    pub(super) fn of_ring(source: Source, mut ring: RingPoints) -> Result<Outline> {
        let repeated = source.make_distinct(&mut ring)?;
        let RingPoints { mut points, places, .. } = ring;
        let (area, length) = (polygon::signed_area(&points), polygon::length(&points));
        if area.abs() <= polygon::NO_AREA * length * length {
            let problem = format!("the outline encloses no net area ({area:e} at a length of {length:e})");
            return Err(source.refusal(&places.part, &problem, "give a closed curve with an inside"));
        }
        let not_simple = match crossing_within(&points, MAX_COMPARISONS) {
            Ok(found) => found.map(|pair| crossing_warning(pair, &places, points.len())),
            Err(Undecided) => Some(
                "whether the outline crosses itself would take too long to find out; if it does, its area and \
                 relaxation are those of an immersed curve"
                    .into(),
            ),
        };
        if area < 0.0 {
            polygon::turn_round(&mut points);
        }
        let warnings = not_simple.iter().chain(&repeated).map(|said| source.said(&places.part, said)).collect();
        Ok(Outline { vertices: points, simple: not_simple.is_none(), warnings, digest: 0 })
    }

    /// Returns whether its vertices, as they were saved, can be those of an outline.
    pub fn is_possible(&self) -> bool {
        (3..=MAX_POINTS).contains(&self.vertices.len()) && self.vertices.iter().all(|point| point.is_finite())
    }

    /// The same outline, read from a file whose bytes have the CRC-32C `digest`, with more to say about it.
    pub(super) fn read_as(mut self, digest: u32, notes: impl IntoIterator<Item = String>) -> Outline {
        self.warnings.extend(notes);
        Outline { digest, ..self }
    }

    /// Returns whether the polygon neither crosses nor touches itself; false also if this is undecided.
    pub fn is_simple(&self) -> bool {
        self.simple
    }

    /// Returns the vertices, without a repeated closing point.
    pub fn vertices(&self) -> &[DVec2] {
        &self.vertices
    }

    /// Returns the CRC-32C of the file it was read from, all of its bytes; 0 if there was none.
    pub fn digest(&self) -> u32 {
        self.digest
    }

    /// Returns what the user should know about the outline, one sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the outline through every second point, from the first; `None` if there are too few for that, or if they
    /// do not enclose an area in the same sense.
    pub fn halved(&self) -> Option<Outline> {
        let points: Vec<DVec2> = self.vertices.iter().step_by(2).copied().collect();
        let (area, length) = (polygon::signed_area(&points), polygon::length(&points));
        let distinct = polygon::edges(&points).all(|edge| edge != DVec2::ZERO);
        if self.vertices.len() < MIN_HALVED || !distinct || area <= polygon::NO_AREA * length * length {
            return None;
        }
        let simple = self.simple && crossing_within(&points, MAX_COMPARISONS).is_ok_and(|found| found.is_none());
        Some(Outline { vertices: points, simple, warnings: Vec::new(), digest: 0 })
    }
}

/// The points of one ring as written, and how messages name them.
pub(super) struct RingPoints {
    pub(super) points: Vec<DVec2>,
    pub(super) places: Places,
    /// Whether a point may repeat the one before, as the standards of GeoJSON and WKT allow; it is then dropped.
    pub(super) may_repeat: bool,
}

impl RingPoints {
    pub(super) fn new(points: Vec<DVec2>, places: Places) -> RingPoints {
        RingPoints { points, places, may_repeat: false }
    }

    /// Keeps the points whose index fulfils `kept`.
    pub(super) fn retain(&mut self, kept: impl Fn(usize) -> bool) {
        let indices = (0..self.points.len()).filter(|i| kept(*i));
        let (points, numbers) = indices.map(|i| (self.points[i], self.places.number(i))).unzip();
        (self.points, self.places.numbers) = (points, numbers);
    }
}

/// The places of points in a file: `line 3`, or ``feature 2 (`Cuba`), point 5``.
pub(super) struct Places {
    /// The part of the file that is the outline; empty if the whole file is.
    pub(super) part: String,
    /// The name of one place.
    pub(super) unit: &'static str,
    /// The number of each; 1, 2, 3, ... if there are none.
    pub(super) numbers: Vec<usize>,
}

impl Places {
    pub(super) fn lines() -> Places {
        Places { part: String::new(), unit: "line", numbers: Vec::new() }
    }

    pub(super) fn points(part: String) -> Places {
        Places { part, unit: "point", numbers: Vec::new() }
    }

    fn number(&self, i: usize) -> usize {
        self.numbers.get(i).copied().unwrap_or(i + 1)
    }

    /// The place of the point at index `i`.
    pub(super) fn at(&self, i: usize) -> String {
        within(&self.part, &format!("{} {}", self.unit, self.number(i)))
    }

    fn holder(&self) -> &'static str {
        if self.part.is_empty() { "the file" } else { "it" }
    }
}

/// A place in a part of a file, which may be all of it.
pub(super) fn within(part: &str, place: &str) -> String {
    if part.is_empty() { place.to_owned() } else { format!("{part}, {place}") }
}

/// The file of an outline, for messages.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    path: &'a Path,
}

impl<'a> Source<'a> {
    pub(super) fn new(path: &'a Path) -> Source<'a> {
        Source { path }
    }

    /// Its name without directories and extension.
    pub(super) fn stem(&self) -> String {
        let stem = self.path.file_stem().unwrap_or(self.path.as_os_str());
        shortened(&stem.to_string_lossy(), MAX_LABEL)
    }

    /// What is to be said of a place in the file; of the file itself if the place is empty.
    pub(super) fn said(&self, place: &str, what: &str) -> String {
        let separator = if place.is_empty() { "" } else { ": " };
        format!("{}: {place}{separator}{what}", echo_path(self.path))
    }

    pub(super) fn refusal(&self, place: &str, problem: &str, remedy: &str) -> Error {
        Error::Request(format!("--shape file:{}; {remedy}", self.said(place, problem)))
    }

    /// Refuses more than [`MAX_POINTS`] points.
    pub(super) fn check_number(&self, places: &Places, number: usize) -> Result<()> {
        if number <= MAX_POINTS {
            return Ok(());
        }
        let remedy = format!("at most {MAX_POINTS} points: thin the outline out");
        let problem = format!("{} holds more than {MAX_POINTS} points", places.holder());
        Err(self.refusal(&places.part, &problem, &remedy))
    }

    /// Refuses a coordinate whose fourth power is not finite; `shown` is how it is written.
    pub(super) fn check_coordinate(&self, place: impl Fn() -> String, value: f64, shown: &str) -> Result<()> {
        if value.abs() <= MAX_COORDINATE {
            return Ok(());
        }
        // 1e400 is read as infinity.
        let is_number = value.is_finite() || shown.contains(|c: char| c.is_ascii_digit());
        let problem = if is_number { "is too large" } else { "is not finite" };
        let remedy = format!("coordinates are numbers from -{MAX_COORDINATE:e} to {MAX_COORDINATE:e}");
        Err(self.refusal(&place(), &format!("`{shown}` {problem}"), &remedy))
    }

    /// Drops a closing point that repeats the first, and refuses every other coincidence, unless the format allows it:
    /// then it is dropped, and the answer says so.
    fn make_distinct(&self, ring: &mut RingPoints) -> Result<Option<String>> {
        let RingPoints { points, places, may_repeat } = ring;
        self.check_number(places, points.len())?;
        for (i, point) in points.iter().enumerate() {
            for value in [point.x, point.y] {
                self.check_coordinate(|| places.at(i), value, &format!("{value:?}"))?;
            }
        }
        let [Some(&first), Some(&last)] = [points.first(), points.last()] else {
            let problem = format!("{} holds no points", places.holder());
            return Err(self.refusal(&places.part, &problem, "give at least three, x,y a line"));
        };
        let (low, high) = points.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)));
        let extent = (high - low).max_element();
        if extent > 0.0 && extent < MIN_EXTENT {
            let problem = format!("the outline extends over no more than {extent:e}");
            let remedy =
                format!("give its points in a smaller unit of length, so that it extends over {MIN_EXTENT:e} or more");
            return Err(self.refusal(&places.part, &problem, &remedy));
        }
        let coincide = |a: DVec2, b: DVec2| a.distance(b) <= COINCIDENT * low.distance(high);
        if points.len() > 1 && coincide(first, last) {
            points.pop();
            places.numbers.pop();
        }
        let second = points.iter().find(|p| **p != first).copied().unwrap_or(first);
        if points.iter().all(|p| *p == first || *p == second) {
            let number = if second == first { 1 } else { 2 };
            let problem = format!("{} holds {}", places.holder(), count(number, "distinct point"));
            return Err(self.refusal(&places.part, &problem, "a closed curve takes at least three"));
        }
        let repeats = |i: usize, points: &[DVec2]| coincide(points[i], points[(i + points.len() - 1) % points.len()]);
        let n = points.len();
        match (1..=n).map(|i| i % n).find(|i| repeats(*i, points)) {
            None => Ok(None),
            Some(_) if *may_repeat => {
                let all = points.clone();
                ring.retain(|i| !repeats(i, &all));
                let dropped = count((n - ring.points.len()) as u64, "point");
                Ok(Some(format!("{dropped} {REPEATED}")))
            }
            Some(i) => {
                let before = places.number((i + n - 1) % n);
                let (DVec2 { x, y }, unit) = (points[i], places.unit);
                let problem = format!("the point ({x}, {y}) is that of {unit} {before} again");
                Err(self.refusal(&places.at(i), &problem, &format!("remove one of the two {unit}s")))
            }
        }
    }
}

fn crossing_warning((i, j): (usize, usize), places: &Places, n: usize) -> String {
    let from_to = |edge: usize| format!("{} to {}", places.number(edge), places.number((edge + 1) % n));
    format!(
        "{CROSSES} (the edges from {unit} {} and from {unit} {}); \
         its area and relaxation are those of an immersed curve",
        from_to(i),
        from_to(j),
        unit = places.unit
    )
}

/// Maximum characters of a label: longer ones are cut.
pub(super) const MAX_LABEL: usize = 100;

pub(super) const CROSSES: &str = "the outline crosses or touches itself";
pub(super) const REPEATED: &str = "dropped that repeated the one before";

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "0,0\n1,0\n1,1\n0,1\n";

    fn outline(text: &str) -> Result<Outline> {
        Outline::from_csv(Path::new("shape.csv"), text.as_bytes())
    }

    fn vertices(text: &str) -> Vec<(f64, f64)> {
        outline(text).unwrap().vertices().iter().map(|p| (p.x, p.y)).collect()
    }

    fn assert_refused(text: &str, parts: &[&str]) {
        let error = outline(text).expect_err(text);
        assert_eq!(error.exit_code(), 2);
        let message = error.to_string();
        assert!(message.starts_with("--shape file:shape.csv:") && message.contains("; "), "{message}");
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in: {message}");
        }
    }

    #[test]
    fn an_outline_so_small_that_its_times_are_no_numbers_is_refused() {
        let rhombus = |size: f64| format!("{size:e},0\n0,{0:e}\n-{size:e},0\n0,-{0:e}\n", 0.5 * size);
        for size in [1e-31, 1e-160, 1e-170, 1e-300] {
            let problem = format!("extends over no more than {:e}; give its points in a smaller unit", 2.0 * size);
            assert_refused(&rhombus(size), &[&problem]);
        }
        for size in [1e-30, 1.0, 1e30] {
            outline(&rhombus(size)).unwrap();
        }
    }

    #[test]
    fn a_repeated_closing_point_is_dropped() {
        assert_eq!(vertices(&format!("{SQUARE}0,0\n")).len(), 4);
    }

    #[test]
    fn a_clockwise_outline_is_turned_round_and_keeps_its_first_point() {
        assert_eq!(vertices("0,0\n0,1\n1,1\n1,0\n"), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
    }

    #[test]
    fn an_outline_that_touches_itself_or_has_a_spike_without_width_is_accepted_with_a_warning() {
        for text in [
            "0,0\n2,0\n2,2\n1,0\n0,2\n",
            "0,0\n2,-1\n2,1\n0,0\n-2,1\n-2,-1\n",
            "0,0\n1,0\n3,0\n1,0\n0,1\n",
            "0,0\n1,0\n1,1\n0.5,1\n0.5,3\n0.5,1\n0,1\n",
        ] {
            let touching = outline(text).unwrap();
            assert!(touching.warnings()[0].contains("crosses or touches itself"), "{text}");
            assert!(!touching.is_simple() && outline(SQUARE).unwrap().is_simple());
        }
    }

    #[test]
    fn needles_side_by_side_that_no_search_can_tell_apart_are_accepted_with_a_warning() {
        let aslant = DVec2::from_angle(0.7);
        let needles = (0..100_000).map(|i| DVec2::new(f64::from(i) * 1e-5, f64::from(i % 2)));
        let bar = [DVec2::new(2.0, -0.5), DVec2::new(0.0, -0.5)];
        let points = needles.chain(bar).map(|p| p.rotate(aslant));
        let text: String = points.map(|p| format!("{},{}\n", p.x, p.y)).collect();
        let comb = outline(&text).unwrap();
        assert!(comb.warnings()[0].contains("would take too long") && !comb.is_simple());
    }

    #[test]
    fn too_few_points_are_refused_with_their_number() {
        assert_refused("", &["no points"]);
        assert_refused("x,y\n", &["no points"]);
        assert_refused("1,1\n", &["1 distinct point;"]);
        assert_refused("1,1\n1,1\n1,1\n", &["1 distinct point;"]);
        assert_refused("0,0\n1,1\n0,0\n1,1\n", &["2 distinct points"]);
    }

    #[test]
    fn a_list_of_points_is_a_file_of_them() {
        let points = [DVec2::ZERO, DVec2::new(1.0 / 3.0, 0.0), DVec2::new(0.1, 1e-7), DVec2::ZERO];
        assert_eq!(Outline::from_points(&points).unwrap().vertices(), &points[..3]);
        let message = Outline::from_points(&[DVec2::ZERO, DVec2::new(1.0, f64::NAN)]).unwrap_err().to_string();
        assert!(message.contains("(points): line 2: `NaN` is not finite"), "{message}");
    }

    #[test]
    fn coincident_neighbours_are_refused_with_both_lines() {
        assert_refused("0,0\n1,0\n\n1,0\n0,1\n", &["line 4:", "line 2", "(1, 0)"]);
        assert_refused("0,0\n1,0\n1,1e-14\n0,1\n", &["line 3:", "line 2"]);
        assert_refused("0,0\n1,0\n0,1\n0,0\n0,0\n", &["line 1:", "line 4"]);
    }

    #[test]
    fn an_outline_without_area_is_refused() {
        assert_refused("0,0\n1,1\n2,2\n", &["no net area"]);
        assert_refused("0,0\n1,1\n1,0\n0,1\n", &["no net area"]);
    }

    #[test]
    fn a_crossing_outline_is_accepted_with_a_warning_that_names_the_lines() {
        let crossed = outline("x,y\n0,0\n3,3\n3,0\n0,1\n").unwrap();
        assert!(crossed.warnings()[0].contains("from line 2 to 3 and from line 4 to 5"), "{:?}", crossed.warnings());
        assert!(outline(SQUARE).unwrap().warnings().is_empty());
    }

    #[test]
    fn a_million_points_are_read_and_one_more_is_refused() {
        let point = |j: usize| DVec2::from_angle(j as f64 * std::f64::consts::TAU / 1e6);
        let mut text: String = (0..MAX_POINTS).map(|j| format!("{},{}\n", point(j).x, point(j).y)).collect();
        assert_eq!(outline(&text).unwrap().vertices().len(), MAX_POINTS);
        text.push_str("0,0\n");
        assert_refused(&text, &["more than 1000000 points", "at most 1000000"]);
    }

    #[test]
    fn half_of_an_outline_has_every_second_point() {
        let ring = |n: i32| -> String {
            let angle = |i: i32| std::f64::consts::TAU * f64::from(i) / f64::from(n);
            (0..n).map(|i| format!("{:?},{:?}\n", angle(i).cos(), angle(i).sin())).collect()
        };
        for (n, half) in [(12, 6), (13, 7), (100, 50)] {
            let (whole, halved) = (outline(&ring(n)).unwrap(), outline(&ring(n)).unwrap().halved().unwrap());
            assert_eq!(halved.vertices().len(), half);
            assert!(halved.vertices().iter().zip(whole.vertices().iter().step_by(2)).all(|(a, b)| a == b));
            assert!(halved.is_simple());
        }
        assert!(outline(&ring(11)).unwrap().halved().is_none());
        // Every second point of a comb is on its back.
        let comb: String = (0..10).map(|i| format!("{i},{}\n", if i % 2 == 1 { 1 } else { 0 })).collect();
        assert!(outline(&format!("{comb}9,-1e-13\n4,-1\n")).unwrap().halved().is_none());
    }
}
