//! GeoJSON (RFC 7946): a FeatureCollection, a Feature or a geometry.
//!
//! Every Polygon is an outline, every polygon of a MultiPolygon is one of its own, and so is a closed LineString. Holes
//! are refused. Coordinates are longitude and latitude in degrees, as the RFC says, except in two cases: the member
//! `crs` of the older GeoJSON 2008 is null or names another reference system, or coordinates of the file are no
//! degrees. They are then taken as coordinates of the plane, and a note says so, except of null.

use std::borrow::Cow;

use geojson::{Feature, GeometryValue, Position, feature::Id};
use glam::DVec2;
use serde::{Deserialize, Deserializer};
use serde_json::{Value, value::RawValue};

use super::piece::{NoOutline, Piece, Properties, closed, each, label, of_polygons, outer_ring, outer_rings, property};
use crate::outline::Source;
use curvelax_base::error::{Error, Result, one_line, plainly, shortened};

/// Maximum characters of foreign text in a message.
const SHOWN: usize = 40;
const MAX_PROBLEM: usize = 160;

/// Reference systems in degrees, by the ends of their names: WGS 84, ETRS89, NAD83 and NAD27.
const DEGREES: [&str; 5] = ["CRS84", "4326", "4258", "4269", "4267"];

/// Properties that name a feature, in this order, after its `id`.
const NAMES: [&str; 6] = ["name", "NAME", "Name", "label", "LABEL", "Label"];

/// What is said of coordinates that are not degrees.
pub(super) const NOT_DEGREES: &str =
    "coordinates outside -180 to 180 and -90 to 90 are not degrees; the file is taken as coordinates of the plane";
/// What is said of another reference system.
pub(super) const OTHER_SYSTEM: &str = "by its `crs` the file has coordinates of the plane, which are used as they are";

/// The members of a file that matter; features stay text until their turn.
#[derive(Deserialize)]
struct GeoFile<'a> {
    #[serde(borrow, rename = "type")]
    kind: Option<Cow<'a, str>>,
    #[serde(default, deserialize_with = "present")]
    crs: Option<Value>,
    #[serde(borrow)]
    features: Option<Vec<&'a RawValue>>,
}

/// A member that is there, also if it is null.
fn present<'de, D: Deserializer<'de>>(member: D) -> std::result::Result<Option<Value>, D::Error> {
    Value::deserialize(member).map(Some)
}

/// Reads the outlines of a file.
pub(super) fn pieces(source: Source, bytes: &[u8]) -> Result<Vec<Result<Piece>>> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        source.refusal("", &format!("byte {} is not UTF-8", e.valid_up_to()), "GeoJSON is in UTF-8: save it so")
    })?;
    let file: GeoFile = serde_json::from_str(text).map_err(|e| {
        let problem = format!("not JSON: {}", shortened(&plainly(&one_line(&e.to_string())), MAX_PROBLEM));
        source.refusal("", &problem, "give one FeatureCollection; a file with a feature a line needs one around them")
    })?;
    let features = match (file.kind.as_deref(), &file.features) {
        (Some("FeatureCollection"), Some(features)) => features.iter().map(|feature| feature.get()).collect(),
        (Some("FeatureCollection"), None) => {
            return Err(no_features(source, "the FeatureCollection has no `features`"));
        }
        (Some("Feature"), _) => vec![text],
        (Some("Topology"), _) => {
            let remedy = "convert it, for example by ogr2ogr -f GeoJSON outlines.geojson FILE";
            return Err(source.refusal("", "it is TopoJSON", remedy));
        }
        (Some(_), _) => vec![text],
        (None, _) => return Err(no_features(source, "the JSON has no member `type`")),
    };
    if features.is_empty() {
        return Err(no_features(source, "the FeatureCollection is empty"));
    }
    let bare = !matches!(file.kind.as_deref(), Some("FeatureCollection" | "Feature"));
    let numbered = file.features.is_some();
    let read = |(item, text)| read(source, item, text, bare, numbered);
    let mut pieces = each((1..).zip(features).map(read));
    let (in_degrees, note) = match &file.crs {
        // Whoever writes null says that there is no system.
        Some(Value::Null) => (false, None),
        Some(crs) if !names_degrees(crs) => (false, Some(OTHER_SYSTEM)),
        Some(_) => (true, None),
        None => {
            let all = pieces.iter().flatten().flat_map(|piece| &piece.ring.points);
            let are_degrees = |p: &DVec2| p.x.abs() <= 180.0 && p.y.abs() <= 90.0;
            if { all }.all(are_degrees) { (true, None) } else { (false, Some(NOT_DEGREES)) }
        }
    };
    for piece in pieces.iter_mut().flatten() {
        piece.in_degrees = in_degrees;
        piece.notes.extend(note);
    }
    Ok(pieces)
}

fn no_features(source: Source, problem: &str) -> Error {
    source.refusal("", problem, "give a FeatureCollection of Polygons, as RFC 7946 describes it")
}

/// Whether a `crs` names a system in degrees.
fn names_degrees(crs: &Value) -> bool {
    let name = crs.pointer("/properties/name").and_then(Value::as_str).unwrap_or_default();
    DEGREES
        .iter()
        .any(|known| name.strip_suffix(known).is_some_and(|rest| !rest.ends_with(|c: char| c.is_ascii_digit())))
}

/// Reads the outlines of a feature, or of a bare geometry.
fn read(source: Source, item: usize, text: &str, bare: bool, numbered: bool) -> Result<Vec<Piece>> {
    let unnamed = if numbered { format!("feature {item}") } else { String::new() };
    let wrong = |e: serde_json::Error| {
        let said = one_line(&e.to_string());
        // Its line and column are counted in the feature.
        let said = said.rsplit_once(" at line ").map_or(&*said, |(said, _)| said);
        let problem = format!("no valid feature: {}", shortened(&plainly(said), MAX_PROBLEM));
        source.refusal(&unnamed, &problem, "correct it as RFC 7946 says, or remove it")
    };
    let feature: Feature = match bare {
        true => {
            let geometry = Some(serde_json::from_str(text).map_err(wrong)?);
            Feature { geometry, ..Feature::default() }
        }
        false => serde_json::from_str(text).map_err(wrong)?,
    };
    let name = name(&feature);
    let part = match &name {
        Some(name) if numbered => format!("{unnamed} (`{}`)", shortened(name, SHOWN)),
        _ => unnamed,
    };
    let rings = match feature.geometry {
        None => Err(NoOutline::new("has no geometry", "give it a Polygon, or remove it")),
        Some(geometry) => rings(geometry.value),
    };
    let rings = rings.map_err(|NoOutline { problem, remedy }| {
        let holder = if part.is_empty() { "the outline" } else { &*part };
        source.refusal("", &format!("{holder} {problem}"), remedy)
    })?;
    let properties: Properties = feature.properties.iter().flatten().filter_map(written).collect();
    let named = |piece| Piece { name: name.clone(), properties: properties.clone(), ..piece };
    Ok(of_polygons(item, &part, rings).map(named).collect())
}

/// The name of a feature: its `id`, or a property that is usually one.
fn name(feature: &Feature) -> Option<String> {
    let id = feature.id.as_ref().map(|id| match id {
        Id::String(text) => text.clone(),
        Id::Number(number) => number.to_string(),
    });
    let property = |name: &&str| match feature.property(name)? {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    };
    id.or_else(|| NAMES.iter().find_map(property)).and_then(|text| label(&text))
}

/// A property as text; none if it is null.
fn written((name, value): (&String, &Value)) -> Option<(String, String)> {
    let text = match value {
        Value::Null => return None,
        Value::String(text) => property(text),
        other => property(&other.to_string()),
    };
    Some((property(name), text))
}

fn rings(geometry: GeometryValue) -> Result<Vec<Vec<DVec2>>, NoOutline> {
    match geometry {
        GeometryValue::Polygon { coordinates } => Ok(vec![outer_ring(lines(&coordinates)?)?]),
        GeometryValue::MultiPolygon { coordinates } => {
            let polygons: Result<Vec<_>, _> = coordinates.iter().map(|polygon| lines(polygon)).collect();
            outer_rings(polygons?)
        }
        GeometryValue::LineString { coordinates } => Ok(vec![closed(line(&coordinates)?)?]),
        other => Err(NoOutline::of_type(other.type_name())),
    }
}

fn lines(lines: &[Vec<Position>]) -> Result<Vec<Vec<DVec2>>, NoOutline> {
    lines.iter().map(|positions| line(positions)).collect()
}

/// The points of positions, without heights.
fn line(positions: &[Position]) -> Result<Vec<DVec2>, NoOutline> {
    let point = |position: &Position| match position.as_slice() {
        [x, y, ..] => Ok(DVec2::new(*x, *y)),
        _ => Err(NoOutline::new("has a position of fewer than two numbers", "give every position as [x, y]")),
    };
    positions.iter().map(point).collect()
}
