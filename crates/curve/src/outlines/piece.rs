//! One outline of a file as written, before it is projected and checked.

use std::collections::BTreeMap;

use glam::DVec2;

use crate::outline::{MAX_LABEL, Places, RingPoints, within};
use curvelax_base::error::{Result, shortened};

/// Properties of a feature, by name.
pub type Properties = BTreeMap<String, String>;

/// Maximum characters of a property's name or value: longer ones are cut.
const MAX_PROPERTY: usize = 200;

/// An outline of a file.
pub(super) struct Piece {
    /// What the file calls it; otherwise it is numbered.
    pub(super) name: Option<String>,
    /// The number of its feature, line or array in the file, from 1.
    pub(super) item: usize,
    /// Its number in a feature that has several, from 1.
    pub(super) polygon: Option<usize>,
    pub(super) properties: Properties,
    pub(super) ring: RingPoints,
    /// Whether the points are longitudes and latitudes in degrees.
    pub(super) in_degrees: bool,
    /// What the user should know about how it was read.
    pub(super) notes: Vec<&'static str>,
}

impl Piece {
    pub(super) fn new(item: usize, ring: RingPoints) -> Piece {
        let properties = Properties::new();
        Piece { name: None, item, polygon: None, properties, ring, in_degrees: false, notes: Vec::new() }
    }
}

/// The outlines of the polygons of a feature or line, which is `part` of its file: numbered if there are several.
pub(super) fn of_polygons(item: usize, part: &str, rings: Vec<Vec<DVec2>>) -> impl Iterator<Item = Piece> {
    let several = rings.len() > 1;
    (1..).zip(rings).map(move |(number, points)| {
        let part = if several { within(part, &format!("polygon {number}")) } else { part.to_owned() };
        let ring = RingPoints { may_repeat: true, ..RingPoints::new(points, Places::points(part)) };
        Piece { polygon: several.then_some(number), ..Piece::new(item, ring) }
    })
}

/// The outlines of all parts of a file, or why a part has none.
pub(super) fn each(parts: impl Iterator<Item = Result<Vec<Piece>>>) -> Vec<Result<Piece>> {
    let pieces = parts.map(|part| part.map_or_else(|e| vec![Err(e)], |pieces| pieces.into_iter().map(Ok).collect()));
    pieces.flatten().collect()
}

/// Why a geometry is no outline, and what to do.
pub(super) struct NoOutline {
    pub(super) problem: String,
    pub(super) remedy: &'static str,
}

impl NoOutline {
    pub(super) fn new(problem: impl Into<String>, remedy: &'static str) -> NoOutline {
        NoOutline { problem: problem.into(), remedy }
    }

    /// A geometry of the wrong type.
    pub(super) fn of_type(name: &str) -> NoOutline {
        let problem = format!("is a {}", shortened(name, 40));
        NoOutline::new(problem, "give each outline as a Polygon, a MultiPolygon or a closed LineString")
    }
}

/// The outer ring of a polygon given by all of its rings.
pub(super) fn outer_ring(rings: Vec<Vec<DVec2>>) -> Result<Vec<DVec2>, NoOutline> {
    let holes = rings.len().saturating_sub(1);
    match rings.into_iter().next() {
        Some(ring) if holes == 0 && !ring.is_empty() => Ok(ring),
        Some(_) if holes > 0 => {
            let problem = if holes == 1 { "has a hole".into() } else { format!("has {holes} holes") };
            Err(NoOutline::new(problem, "fill it in, or export its outer ring alone"))
        }
        _ => Err(NoOutline::new("is empty", "give it at least three points, or remove it")),
    }
}

/// The outer rings of several polygons.
pub(super) fn outer_rings(polygons: Vec<Vec<Vec<DVec2>>>) -> Result<Vec<Vec<DVec2>>, NoOutline> {
    match polygons.is_empty() {
        true => outer_ring(Vec::new()).map(|_| Vec::new()),
        false => polygons.into_iter().map(outer_ring).collect(),
    }
}

/// A line that ends where it begins, as a ring.
pub(super) fn closed(line: Vec<DVec2>) -> Result<Vec<DVec2>, NoOutline> {
    match line.first() == line.last() {
        true => outer_ring(vec![line]),
        false => Err(NoOutline::new("is an open line", "close it: its last point must repeat the first")),
    }
}

/// A label, cut to a length that fits in a table, without control characters; `None` if nothing is left.
pub(super) fn label(text: &str) -> Option<String> {
    let text = text.trim();
    (!text.is_empty()).then(|| shortened(text, MAX_LABEL))
}

/// The name or value of a property, likewise.
pub(super) fn property(text: &str) -> String {
    shortened(text.trim(), MAX_PROPERTY)
}
