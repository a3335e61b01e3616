//! Outlines from files: turns a table of points into a closed counter-clockwise polygon, or an error that says why not.
//!
//! The format is CSV in UTF-8: one point per line, `x,y`, with a decimal point. Blank lines and lines that begin with
//! `#` are skipped. A first line without any number is a header; it must name the columns `x` and `y`, and further
//! columns are then ignored. The last point may repeat the first; other neighbours must differ. Points that are not
//! neighbours may coincide, with the warning of a crossing, and so may an edge that returns along another (a spike
//! without width). Either orientation is accepted; a clockwise outline is reversed about its first point, which stays
//! first.

use std::path::Path;

use glam::DVec2;

use super::{Undecided, crossing_within, polygon};
use crate::{
    error::{Error, Result, shortened},
    input::{self, MAX_LINE, MAX_OUTLINE},
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

/// A closed counter-clockwise polygon, traversed by arclength.
#[derive(Clone, Debug)]
pub struct Outline {
    vertices: Vec<DVec2>,
    /// Length from vertex 0 to each vertex, and finally the total length.
    reached: Vec<f64>,
    simple: bool,
    warnings: Vec<String>,
    digest: u32,
}

impl Outline {
    /// Reads an outline from a CSV file.
    ///
    /// # Errors [`Error::Request`] naming the path, the line, the value and the remedy: the file cannot be read, is
    /// empty, or holds more than [`MAX_POINTS`] points or fewer than three distinct ones; a line is not a pair of
    /// finite numbers, or longer than 65 536 bytes; neighbouring points coincide; no net area is enclosed. An outline
    /// that crosses itself is accepted with a warning.
    pub fn read(path: &Path) -> Result<Outline> {
        Outline::read_from(Path::new(""), path)
    }

    /// Like [`Outline::read`], with `path` relative to the directory `base`; messages name only `path`.
    ///
    /// # Errors
    /// As [`Outline::read`].
    pub fn read_from(base: &Path, path: &Path) -> Result<Outline> {
        let remedy = format!("give a CSV file x,y of at most {MAX_OUTLINE} bytes");
        let bytes = input::bytes(&base.join(path), MAX_OUTLINE);
        let bytes = bytes.map_err(|e| Source { path }.refusal(None, &format!("cannot read it: {e}"), &remedy))?;
        Outline::from_csv(path, &bytes)
    }

    /// Reads an outline from the contents of the file at `path`, which is used in messages.
    ///
    /// # Errors
    /// As [`Outline::read`].
    pub fn from_csv(path: &Path, bytes: &[u8]) -> Result<Outline> {
        let source = Source { path };
        if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
            return Err(source.refusal(None, "the file is in UTF-16", "save it in UTF-8"));
        }
        Ok(Outline { digest: crc32c::crc32c(bytes), ..source.outline(bytes)? })
    }

    /// Creates the outline through a list of points, in either orientation, with or without the first one again at the
    /// end.
    ///
    /// ```
    /// use curvelax::curve::Outline;
    /// use glam::DVec2;
    ///
    /// let triangle = Outline::from_points(&[DVec2::ZERO, DVec2::X, DVec2::Y])?;
    /// assert_eq!(triangle.vertices().len(), 3);
    /// assert!(Outline::from_points(&[DVec2::ZERO, DVec2::X]).is_err());
    /// # Ok::<(), curvelax::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Outline::read`], as if each point were a line of a file `(points)`.
    pub fn from_points(points: &[DVec2]) -> Result<Outline> {
        // `{:?}` reads back exactly.
        let lines: String = points.iter().map(|point| format!("{:?},{:?}\n", point.x, point.y)).collect();
        Source { path: Path::new("(points)") }.outline(lines.as_bytes())
    }

    /// The polygon through valid points: counter-clockwise, no two neighbours equal.
    fn through(vertices: Vec<DVec2>, not_simple: Option<String>) -> Outline {
        let mut reached = vec![0.0];
        reached.extend(polygon::edges(&vertices).scan(0.0, |sum, edge| {
            *sum += edge.length();
            Some(*sum)
        }));
        Outline {
            vertices,
            reached,
            simple: not_simple.is_none(),
            warnings: not_simple.into_iter().collect(),
            digest: 0,
        }
    }

    /// Returns whether the polygon neither crosses nor touches itself; false also if this is undecided.
    pub fn is_simple(&self) -> bool {
        self.simple
    }

    /// Returns the vertices, without a repeated closing point.
    pub fn vertices(&self) -> &[DVec2] {
        &self.vertices
    }

    /// Returns the CRC-32C of the bytes it was read from; 0 if there were none.
    pub fn digest(&self) -> u32 {
        self.digest
    }

    /// Returns what the user should know about the outline, one sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn length(&self) -> f64 {
        self.reached[self.vertices.len()]
    }

    /// Returns the point at the fraction `u ∈ [0, 1]` of the length, from the first vertex.
    pub fn point(&self, u: f64) -> DVec2 {
        let target = u * self.length();
        let n = self.vertices.len();
        let edge = self.reached[1..n].partition_point(|&reached| reached <= target);
        let share = (target - self.reached[edge]) / (self.reached[edge + 1] - self.reached[edge]);
        self.vertices[edge].lerp(self.vertices[(edge + 1) % n], share)
    }

    /// Returns `(u, point)` once round: every vertex, and between vertices pieces no longer than `length / pieces`.
    pub(super) fn subdivision(&self, pieces: usize) -> impl Iterator<Item = (f64, DVec2)> {
        let (n, length) = (self.vertices.len(), self.length());
        let edge = move |i: usize| {
            let (start, end) = (self.reached[i], self.reached[i + 1]);
            let (a, b) = (self.vertices[i], self.vertices[(i + 1) % n]);
            let parts = ((end - start) / length * pieces as f64).ceil().max(1.0);
            (0..parts as usize).map(move |j| {
                let share = j as f64 / parts;
                ((start + share * (end - start)) / length, a.lerp(b, share))
            })
        };
        (0..n).flat_map(edge).chain([(1.0, self.vertices[0])])
    }
}

/// The points of a file with their line numbers.
#[derive(Default)]
struct PointTable {
    points: Vec<DVec2>,
    lines: Vec<usize>,
}

/// The columns, from 0, of the coordinates.
#[derive(Clone, Copy)]
struct Columns {
    x: usize,
    y: usize,
    /// Columns named by the header; without one there are two.
    count: usize,
    has_header: bool,
}

/// The origin of the text, for messages.
struct Source<'a> {
    path: &'a Path,
}

impl Source<'_> {
    fn refusal(&self, line: Option<usize>, problem: &str, remedy: &str) -> Error {
        let line = line.map_or(String::new(), |line| format!(" line {line}:"));
        Error::Request(format!("--shape file:{}:{line} {problem}; {remedy}", self.path.display()))
    }

    fn too_many(&self, count: &str) -> Error {
        let remedy = format!("at most {MAX_POINTS} points: thin the outline out");
        self.refusal(None, &format!("the file holds {count}"), &remedy)
    }

    fn outline(&self, bytes: &[u8]) -> Result<Outline> {
        let mut table = self.table(bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes))?;
        self.make_distinct(&mut table)?;
        let mut points = table.points;
        let (area, length) = (polygon::signed_area(&points), polygon::length(&points));
        if area.abs() <= polygon::NO_AREA * length * length {
            let problem = format!("the outline encloses no net area ({area:e} at a length of {length:e})");
            return Err(self.refusal(None, &problem, "give a closed curve with an inside"));
        }
        let not_simple = match crossing_within(&points, MAX_COMPARISONS) {
            Ok(found) => found.map(|pair| self.crossing_warning(pair, &table.lines)),
            Err(Undecided) => Some(format!(
                "{}: whether the outline crosses itself would take too long to find out; if it does, its area and \
                 relaxation are those of an immersed curve",
                self.path.display()
            )),
        };
        if area < 0.0 {
            polygon::turn_round(&mut points);
        }
        Ok(Outline::through(points, not_simple))
    }

    fn crossing_warning(&self, (i, j): (usize, usize), lines: &[usize]) -> String {
        let from_to = |edge: usize| format!("{} to {}", lines[edge], lines[(edge + 1) % lines.len()]);
        format!(
            "{}: the outline crosses or touches itself (the edges from line {} and from line {}); \
             its area and relaxation are those of an immersed curve",
            self.path.display(),
            from_to(i),
            from_to(j)
        )
    }

    /// Parses the lines into points.
    fn table(&self, bytes: &[u8]) -> Result<PointTable> {
        let mut table = PointTable::default();
        let mut columns = None;
        for (line, content) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
            if content.len() > MAX_LINE {
                let problem = format!("a line of {} bytes", content.len());
                let remedy = format!("write a point a line, x,y, of at most {MAX_LINE} bytes");
                return Err(self.refusal(Some(line), &problem, &remedy));
            }
            // Other columns may be in any encoding.
            let content = String::from_utf8_lossy(content);
            let content = content.trim();
            if content.is_empty() || content.starts_with('#') {
                continue;
            }
            if !content.contains(',') {
                self.refuse_separator(line, content, &SEPARATORS)?;
            }
            let fields: Vec<&str> = fields(content).collect();
            if columns.is_none() && fields.iter().all(|field| field.parse::<f64>().is_err()) {
                columns = Some(self.header(line, &fields)?);
                continue;
            }
            let Columns { x, y, count, has_header } =
                *columns.get_or_insert(Columns { x: 0, y: 1, count: 2, has_header: false });
            let (Some(x), Some(y), false) = (fields.get(x), fields.get(y), fields.len() > count) else {
                self.refuse_separator(line, content, &SEPARATORS[..2])?;
                let expected = if has_header { format!("the header names {count}") } else { "x,y is expected".into() };
                let problem = format!("the number of columns is {} where {expected}", fields.len());
                let remedy = "separate by commas, and name further columns in a header";
                return Err(self.refusal(Some(line), &problem, remedy));
            };
            if table.points.len() == MAX_POINTS {
                return Err(self.too_many(&format!("more than {MAX_POINTS} points")));
            }
            table.points.push(DVec2::new(self.coordinate(line, x)?, self.coordinate(line, y)?));
            table.lines.push(line);
        }
        Ok(table)
    }

    /// Refuses a line that contains one of `separators`.
    fn refuse_separator(&self, line: usize, content: &str, separators: &[(char, &str)]) -> Result<()> {
        let Some((_, name)) = separators.iter().find(|(separator, _)| content.contains(*separator)) else {
            return Ok(());
        };
        let problem = format!("the columns of `{}` are separated by {name}", shortened(content, SHOWN));
        Err(self.refusal(Some(line), &problem, "separate them by a comma and write decimal points: 1.0,0.5"))
    }

    /// Returns the columns of x and y named by a header.
    fn header(&self, line: usize, fields: &[&str]) -> Result<Columns> {
        let column = |name: &str| fields.iter().position(|field| field.eq_ignore_ascii_case(name));
        let (Some(x), Some(y)) = (column("x"), column("y")) else {
            let problem = format!("`{}` names no columns x and y", shortened(&fields.join(","), SHOWN));
            return Err(self.refusal(
                Some(line),
                &problem,
                "begin with the header x,y or with a point such as 1.0,0.5",
            ));
        };
        Ok(Columns { x, y, count: fields.len(), has_header: true })
    }

    fn coordinate(&self, line: usize, field: &str) -> Result<f64> {
        let shown = shortened(field, SHOWN);
        match field.parse::<f64>() {
            Ok(value) if value.abs() <= MAX_COORDINATE => Ok(value),
            Ok(value) => {
                let problem = if value.is_finite() { "is too large" } else { "is not finite" };
                let remedy = format!("coordinates are numbers from -{MAX_COORDINATE:e} to {MAX_COORDINATE:e}");
                Err(self.refusal(Some(line), &format!("`{shown}` {problem}"), &remedy))
            }
            Err(_) => Err(self.refusal(Some(line), &format!("`{shown}` is not a number"), "write x,y such as 1.0,0.5")),
        }
    }

    /// Drops a closing point that repeats the first, and refuses every other coincidence.
    fn make_distinct(&self, table: &mut PointTable) -> Result<()> {
        let PointTable { points, lines } = table;
        let [Some(&first), Some(&last)] = [points.first(), points.last()] else {
            return Err(self.refusal(None, "the file holds no points", "give at least three, x,y a line"));
        };
        let (low, high) = points.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)));
        let extent = (high - low).max_element();
        if extent > 0.0 && extent < MIN_EXTENT {
            let problem = format!("the outline extends over no more than {extent:e}");
            let remedy =
                format!("give its points in a smaller unit of length, so that it extends over {MIN_EXTENT:e} or more");
            return Err(self.refusal(None, &problem, &remedy));
        }
        let coincide = |a: DVec2, b: DVec2| a.distance(b) <= COINCIDENT * low.distance(high);
        if points.len() > 1 && coincide(first, last) {
            points.pop();
            lines.pop();
        }
        let second = points.iter().find(|p| **p != first).copied().unwrap_or(first);
        if points.iter().all(|p| *p == first || *p == second) {
            let count = if second == first { 1 } else { 2 };
            let problem = format!("the file holds {count} distinct point{}", if count == 1 { "" } else { "s" });
            return Err(self.refusal(None, &problem, "a closed curve takes at least three"));
        }
        for i in 0..points.len() {
            let next = (i + 1) % points.len();
            if coincide(points[i], points[next]) {
                let problem =
                    format!("the point ({}, {}) is that of line {} again", points[next].x, points[next].y, lines[i]);
                return Err(self.refusal(Some(lines[next]), &problem, "remove one of the two lines"));
            }
        }
        Ok(())
    }
}

/// Splits a line into fields at commas, trimmed, without quotes; a comma inside quotes does not separate.
fn fields(line: &str) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    let separates = move |c: char| {
        quoted ^= c == '"';
        c == ',' && !quoted
    };
    line.split(separates).map(|field| field.trim().trim_matches('"').trim())
}

/// Maximum characters of foreign text in a message.
const SHOWN: usize = 40;

/// Other separators of columns; a space may also follow a comma.
const SEPARATORS: [(char, &str); 3] = [(';', "semicolons"), ('\t', "tabs"), (' ', "spaces")];

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
    fn points_are_read_in_order_with_headers_comments_and_other_columns_set_aside() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        assert_eq!(vertices(SQUARE), square);
        assert_eq!(vertices("x,y\n# a square\n\n0,0\r\n1, 0\n 1 ,1\n0,1"), square);
        assert_eq!(vertices("\u{feff}\"name\",\"Y\",\"X\"\n\"a,b\",0,0\n,0,1\nc,1,1\nd,1,0\n"), square);
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
    fn a_line_that_is_no_pair_of_finite_numbers_is_refused_with_its_number_and_value() {
        assert_refused("0,0\n# c\n1,zero\n1,1\n", &["line 3:", "`zero` is not a number"]);
        assert_refused("0,0\n1,nan\n1,1\n", &["line 2:", "`nan` is not finite"]);
        assert_refused("inf,0\n1,0\n1,1\n", &["line 1:", "`inf` is not finite"]);
        assert_refused("0,0\n1e31,0\n1,1\n", &["line 2:", "`1e31` is too large"]);
        assert_refused("0,0\n1\n1,1\n", &["line 2:", "columns is 1 "]);
        assert_refused("0,0,7\n1,0,7\n1,1,7\n", &["line 1:", "columns is 3 ", "header"]);
        assert_refused("x,y\n0,0\n1\n", &["line 3:", "columns is 1 "]);
        assert_refused("x,y\n0,0\n1,0,9\n1,1\n", &["line 3:", "columns is 3 where the header names 2;"]);
        assert_refused("lon,lat\n0,0\n1,0\n1,1\n", &["line 1:", "`lon,lat` names no columns x and y"]);
        assert_refused("x,y\nx,y\n0,0\n", &["line 2:", "`x` is not a number"]);
    }

    #[test]
    fn other_separators_are_named() {
        for (text, parts) in [
            ("0;0\n1;0\n", ["line 1:", "columns of `0;0` are separated by semicolons; separate them by a comma"]),
            ("x;y\n0;0\n", ["line 1:", "semicolons"]),
            ("1,5;2,5\n1,5;3,5\n", ["line 1:", "semicolons"]),
            ("0\t0\n1\t0\n", ["line 1:", r"`0\t0` are separated by tabs"]),
            ("1,5\t2,5\n1,5\t3,5\n", ["line 1:", "tabs"]),
            ("x y\n0 0\n1 0\n", ["line 1:", "`x y` are separated by spaces"]),
            ("0,0\n1,0\n1 1\n", ["line 3:", "spaces"]),
        ] {
            assert_refused(text, &parts);
        }
        assert_refused("0, 0, 0\n1, 0, 0\n", &["columns is 3"]);
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
    fn a_utf_16_file_is_named_as_such() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let text: Vec<u8> = format!("\u{feff}{SQUARE}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        std::fs::write(file.path(), text).unwrap();
        let message = Outline::read(file.path()).unwrap_err().to_string();
        assert!(message.contains("in UTF-16; save it in UTF-8"), "{message}");
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
    fn an_outline_is_read_below_a_directory_and_named_without_it() {
        let home = tempfile::tempdir().unwrap();
        std::fs::write(home.path().join("eight.csv"), "0,0\n2,2\n2,0\n0,1\n").unwrap();
        let outline = Outline::read_from(home.path(), Path::new("eight.csv")).unwrap();
        assert!(outline.warnings()[0].starts_with("eight.csv: the outline crosses"), "{:?}", outline.warnings());
        let error = Outline::read_from(home.path(), Path::new("none.csv")).unwrap_err().to_string();
        assert!(error.starts_with("--shape file:none.csv: cannot read it"), "{error}");
        // An absolute path ignores the base directory.
        assert!(Outline::read_from(Path::new("/none"), &home.path().join("eight.csv")).is_ok());
    }

    #[test]
    fn a_missing_file_and_a_folder_are_wrong_requests() {
        for path in ["no/such/file.csv", "src"] {
            let error = Outline::read(Path::new(path)).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(path), "{error}");
        }
    }

    #[test]
    fn a_line_without_end_is_refused_before_it_is_cut_into_columns() {
        let long = |columns: usize| format!("x,y{}\n0,0\n1,0\n1,1\n", ",".repeat(columns));
        assert_eq!(vertices(&long(MAX_LINE - 3)).len(), 3);
        assert_refused(&long(MAX_LINE - 2), &["line 1: a line of 65537 bytes; ", "x,y, of at most 65536 bytes"]);
        assert_refused(&format!("0,0\n{}", " ".repeat(1 << 20)), &["line 2: a line of 1048576 bytes"]);
    }

    #[test]
    fn other_columns_may_be_in_any_encoding() {
        let latin = b"x,y,name\n0,0,Cura\xe7ao\n1,0,\n1,1,\xff\n";
        assert_eq!(Outline::from_csv(Path::new("shape.csv"), latin).unwrap().vertices().len(), 3);
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
    fn the_parameter_of_a_polygon_is_its_share_of_the_length() {
        let rectangle = outline("0,0\n3,0\n3,1\n0,1\n").unwrap();
        let expected = [(0.0, 0.0, 0.0), (0.25, 2.0, 0.0), (0.375, 3.0, 0.0), (0.5, 3.0, 1.0), (0.9375, 0.0, 0.5)];
        for (u, x, y) in expected {
            assert!(rectangle.point(u).distance(DVec2::new(x, y)) < 1e-15, "u = {u}");
        }
        assert_eq!(rectangle.point(1.0), rectangle.point(0.0));
    }

    #[test]
    fn a_subdivision_contains_every_vertex_and_lies_on_the_polygon() {
        let triangle = outline("0,0\n10,0\n0,0.1\n").unwrap();
        for pieces in [1, 2, 50] {
            let samples: Vec<_> = triangle.subdivision(pieces).collect();
            assert!(samples.len() > pieces);
            for vertex in triangle.vertices() {
                assert!(samples.iter().any(|(_, p)| p == vertex), "{vertex} of {pieces}");
            }
            assert!(samples.windows(2).all(|pair| pair[0].0 < pair[1].0));
            assert!(samples.iter().all(|(u, p)| triangle.point(*u).distance(*p) < 1e-14));
        }
    }
}
