//! Well-known text: one POLYGON, MULTIPOLYGON or closed LINESTRING a line, as spatial databases write it.
//!
//! Coordinates are those of the plane. `SRID=4326;` before a geometry, as PostGIS writes it, says that they are
//! degrees; any other SRID is of the plane. Blank lines and lines that begin with `#` are skipped; heights are ignored.

use glam::DVec2;
use wkt::{
    Wkt,
    types::{Coord, LineString, Polygon},
};

use super::piece::{NoOutline, Piece, closed, each, of_polygons, outer_ring, outer_rings};
use crate::outline::Source;
use curvelax_base::{
    error::{Result, shortened},
    text,
};

/// Maximum characters of foreign text in a message.
const SHOWN: usize = 40;

/// The SRIDs of systems in degrees.
const DEGREES: [&str; 4] = ["4326", "4258", "4269", "4267"];

/// What is read; nothing else is given to the parser, which recurses into collections.
const TYPES: [&str; 4] = ["POLYGON", "MULTIPOLYGON", "LINESTRING", "LINEARRING"];

/// Reads the outlines of a file.
pub(super) fn pieces(source: Source, bytes: &[u8]) -> Result<Vec<Result<Piece>>> {
    let text = String::from_utf8_lossy(bytes);
    let lines = (1..).zip(text.split('\n').map(str::trim));
    let lines = lines.filter(|(_, content)| !content.is_empty() && !content.starts_with('#'));
    let pieces = each((1..).zip(lines).map(|(item, (line, content))| read(source, item, line, content)));
    match pieces.is_empty() {
        true => Err(source.refusal(
            "",
            "the file holds no geometry",
            "give one a line, such as POLYGON ((0 0, 1 0, 1 1, 0 0))",
        )),
        false => Ok(pieces),
    }
}

/// Reads the outlines of a line.
fn read(source: Source, item: usize, line: usize, content: &str) -> Result<Vec<Piece>> {
    let place = format!("line {line}");
    let (in_degrees, geometry) = without_srid(content);
    let rings = rings(geometry).map_err(|NoOutline { problem, remedy }| {
        source.refusal(&place, &format!("`{}` {problem}", shortened(content, SHOWN)), remedy)
    })?;
    Ok(of_polygons(item, &place, rings).map(|piece| Piece { in_degrees, ..piece }).collect())
}

/// Whether the geometry is in degrees, and its text without the prefix that says so.
fn without_srid(content: &str) -> (bool, &str) {
    let prefixed = content.split_once(';').and_then(|(srid, rest)| Some((srid.split_once('=')?, rest)));
    match prefixed {
        Some(((key, srid), rest)) if key.trim().eq_ignore_ascii_case("SRID") => {
            (DEGREES.contains(&srid.trim()), rest.trim())
        }
        _ => (false, content),
    }
}

fn rings(content: &str) -> Result<Vec<Vec<DVec2>>, NoOutline> {
    let letters = content.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(content.len());
    let word = content[..letters].to_ascii_uppercase();
    let known = word.trim_end_matches(['Z', 'M']);
    if !TYPES.contains(&known) {
        return Err(NoOutline::new(
            "is no POLYGON, MULTIPOLYGON or closed LINESTRING",
            "write a geometry a line, such as POLYGON ((0 0, 1 0, 1 1, 0 0))",
        ));
    }
    check_brackets(content)?;
    check_points(content)?;
    let geometry: Wkt<f64> = content.parse().map_err(|e: &str| {
        NoOutline::new(format!("is not well-known text: {e}"), "write it as POLYGON ((0 0, 1 0, 1 1, 0 0))")
    })?;
    match geometry {
        Wkt::Polygon(polygon) => Ok(vec![outer_ring(lines(&polygon))?]),
        Wkt::MultiPolygon(all) => outer_rings(all.polygons().iter().map(lines).collect()),
        Wkt::LineString(one) => Ok(vec![closed(line(&one))?]),
        _ => Err(NoOutline::of_type(known)),
    }
}

/// Refuses brackets that do not match, and text after the last one, which the parser would ignore.
fn check_brackets(text: &str) -> Result<(), NoOutline> {
    let wrong = |problem: &str| NoOutline::new(problem, "write one geometry a line, all of it on this line");
    let mut depth = 0_usize;
    for (i, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.checked_sub(1).ok_or_else(|| wrong("has a closing bracket too many"))?,
            _ => {}
        }
        if c == ')' && depth == 0 && !text[i + 1..].trim().is_empty() {
            return Err(wrong("continues after its last bracket"));
        }
    }
    match depth {
        0 => Ok(()),
        _ => Err(wrong("lacks a closing bracket")),
    }
}

/// Refuses points with fewer numbers than x and y or more than x, y, z and m, and words that are no numbers, for which
/// the parser misses a bracket.
fn check_points(content: &str) -> Result<(), NoOutline> {
    let rings = content.split_once('(').map_or("", |(_, rings)| rings);
    let points = rings.split(['(', ')', ',']).filter(|point| !point.trim().eq_ignore_ascii_case("EMPTY"));
    let wrong =
        |problem: String| Err(NoOutline::new(problem, "give each point x and y, and separate points by commas"));
    for point in points {
        let length = point.split_whitespace().count();
        if !matches!(length, 0 | 2..=4) {
            return wrong(format!("has a point of {}", text::count(length as u64, "number")));
        }
        if let Some(word) = point.split_whitespace().find(|word| word.parse::<f64>().is_err()) {
            return wrong(format!("has `{}` where a number is expected", shortened(word, SHOWN)));
        }
    }
    Ok(())
}

fn lines(polygon: &Polygon<f64>) -> Vec<Vec<DVec2>> {
    polygon.rings().iter().map(line).collect()
}

fn line(line: &LineString<f64>) -> Vec<DVec2> {
    line.coords().iter().map(|Coord { x, y, .. }| DVec2::new(*x, *y)).collect()
}
