//! Every format, and what is refused of each.

mod arrays;

use std::{fs, io::Write};

use glam::DVec2;
use npyz::WriterBuilder;
use serde_json::{Value, json};

use super::*;
use crate::polygon;

fn read(file: &str, bytes: impl AsRef<[u8]>) -> Vec<Labelled> {
    from_bytes(Path::new(file), bytes.as_ref()).unwrap_or_else(|e| panic!("{e}"))
}

fn labels(all: &[Labelled]) -> Vec<&str> {
    all.iter().map(|one| &*one.label).collect()
}

fn vertices(one: &Labelled) -> Vec<(f64, f64)> {
    one.outline.vertices().iter().map(|p| (p.x, p.y)).collect()
}

/// The message of a refusal, which no terminal would obey.
fn refusal(file: &str, bytes: impl AsRef<[u8]>) -> String {
    let error = from_bytes(Path::new(file), bytes.as_ref()).expect_err(file);
    let message = error.to_string();
    let start = format!("--shape file:{file}: ");
    assert!(error.exit_code() == 2 && message.starts_with(&start) && message.contains("; "), "{message}");
    assert!(!message.contains(char::is_control) && message.len() < 600, "{message:?}");
    message
}

#[track_caller]
fn assert_refused(file: &str, bytes: impl AsRef<[u8]>, parts: &[&str]) {
    let message = refusal(file, bytes);
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

fn polygon_of(points: &[(f64, f64)]) -> Value {
    let ring: Vec<[f64; 2]> = points.iter().chain(&points[..1]).map(|(x, y)| [*x, *y]).collect();
    json!({"type": "Polygon", "coordinates": [ring]})
}

fn feature(geometry: &Value, properties: &Value) -> Value {
    json!({"type": "Feature", "geometry": geometry, "properties": properties})
}

fn collection(features: &[Value]) -> String {
    json!({"type": "FeatureCollection", "features": features}).to_string()
}

/// The text of features in the plane.
fn plane(features: &[Value]) -> String {
    json!({"type": "FeatureCollection", "crs": null, "features": features}).to_string()
}

fn npy<T: npyz::AutoSerialize + Copy>(shape: &[u64], order: npyz::Order, values: &[T]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype().shape(shape).order(order).writer(&mut bytes);
    let mut writer = options.begin_nd().unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
    bytes
}

fn npz(arrays: &[(&str, Vec<u8>)], method: zip::CompressionMethod) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        writer.start_file(format!("{name}.npy"), options).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

const ISLE: [(f64, f64); 5] = [(0.0, 0.0), (4.0, 0.1), (3.0, 2.0 / 3.0), (1.5, 3.25), (-0.5, 1e-3)];

#[test]
fn an_outline_is_the_same_in_every_format() {
    let table = |separator: &str| -> String { ISLE.iter().map(|(x, y)| format!("{x}{separator}{y}\n")).collect() };
    let text = ISLE.iter().chain(&ISLE[..1]).map(|(x, y)| format!("{x} {y}")).collect::<Vec<_>>().join(", ");
    let flat: Vec<f64> = ISLE.iter().flat_map(|(x, y)| [*x, *y]).collect();
    let columns: Vec<f64> = ISLE.iter().map(|p| p.0).chain(ISLE.iter().map(|p| p.1)).collect();
    let array = npy(&[5, 2], npyz::Order::C, &flat);
    let files: Vec<(&str, Vec<u8>)> = vec![
        ("isle.csv", table(",").into()),
        ("isle.txt", table(" ").into()),
        ("isle.tsv", table("\t").into()),
        ("isle.csv", table(";").replace('.', ",").into()),
        ("isle.csv", format!("\u{feff}\"X\";\"Y\"\r\n{}", table(";").replace('\n', "\r\n")).into()),
        ("isle.geojson", plane(&[feature(&polygon_of(&ISLE), &Value::Null)]).into()),
        (
            "isle.JSON",
            format!("\u{feff}{}", json!({"type": "Feature", "crs": null, "geometry": polygon_of(&ISLE)})).into(),
        ),
        ("isle.wkt", format!("POLYGON (({text}))").into()),
        (
            "isle.wkt",
            format!("\r\n# one\r\nSRID=25832; linestring z({})\r\n", text.replace(", ", " 7, ") + " 7").into(),
        ),
        ("isle.wkt", format!("MULTIPOLYGON((({text})))\n").into()),
        ("isle.npy", array.clone()),
        ("isle.npy", npy(&[5, 2], npyz::Order::Fortran, &columns)),
        ("isle.npy", npy(&[1, 5, 2], npyz::Order::C, &flat)),
        ("ring.npz", npz(&[("isle", array.clone())], zip::CompressionMethod::Stored)),
        ("ring.npz", npz(&[("isle", array)], zip::CompressionMethod::Deflated)),
    ];
    for (file, bytes) in files {
        let all = read(file, &bytes);
        assert_eq!((labels(&all), vertices(&all[0])), (vec!["isle"], ISLE.to_vec()), "{file}");
        assert_eq!(all[0].outline.digest(), crc32c::crc32c(&bytes));
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join(file), &bytes).unwrap();
        assert_eq!(Outline::read(&home.path().join(file)).unwrap().vertices().len(), 5);
    }
}

#[test]
fn every_feature_is_an_outline_with_its_label_and_properties() {
    let triangle = |x: f64| vec![(x, 0.0), (x + 1.0, 0.0), (x, 1.0)];
    let shape = |x: f64| polygon_of(&triangle(x));
    let mut with_id = feature(&shape(1.0), &json!({"name": "ignored"}));
    with_id["id"] = json!(17);
    let multi = json!({"type": "MultiPolygon", "coordinates": [shape(4.0)["coordinates"], shape(6.0)["coordinates"]]});
    let text = plane(&[
        with_id,
        feature(&shape(2.0), &json!({"NAME": "Cuba", "area": 1.5, "wet": true, "none": null, "list": [1]})),
        feature(&shape(3.0), &json!({"name": " Cuba\u{1b}[31m", "kind": "x\ny"})),
        feature(&multi, &json!({"label": "Twins"})),
        feature(&shape(5.0), &Value::Null),
        feature(&shape(7.0), &json!({"name": "Cuba"})),
        json!({"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0], [0, 1], [0, 0]]}}),
    ]);
    let all = read("seas.geojson", text);
    let expected = ["17", "Cuba", "Cuba\\u{1b}[31m", "Twins/1", "Twins/2", "seas/5", "Cuba (2)", "seas/7"];
    assert_eq!(labels(&all), expected);
    let properties: Vec<_> = all[1].properties.iter().map(|(name, value)| format!("{name}={value}")).collect();
    assert_eq!(properties, ["NAME=Cuba", "area=1.5", "list=[1]", "wet=true"]);
    assert_eq!(all[2].properties["kind"], "x\\ny");
    assert_eq!(all[4].outline.vertices()[0], DVec2::new(6.0, 0.0));
    assert!(
        all.iter().all(|one| one.outline.digest() == all[0].outline.digest() && one.file == Path::new("seas.geojson"))
    );
}

#[test]
fn coordinates_of_geojson_are_degrees_unless_the_file_says_or_shows_otherwise() {
    let far = [(500.0, 0.0), (501.0, 0.0), (500.0, 1.0)];
    let near = [(50.0, 0.0), (51.0, 0.0), (50.0, 1.0)];
    let [far, near] = [far, near].map(|points| feature(&polygon_of(&points), &Value::Null));
    let said = |text: &str| {
        let all = read("map.geojson", text);
        (all[0].outline.warnings()[0].clone(), polygon::signed_area(all[0].outline.vertices()))
    };
    let (warning, area) = said(&collection(std::slice::from_ref(&near)));
    assert!(warning.starts_with("map.geojson: feature 1: lon,lat projected to kilometres"), "{warning}");
    // Half of 111.320 km by 110.574 km, a degree of the equator and of the meridian there; a sphere has 6182 km².
    assert!((area / 6154.5 - 1.0).abs() < 1e-3, "{area}");
    // One place that is not on Earth shows that the file is a plane.
    let (warning, area) = said(&collection(&[near.clone(), far.clone()]));
    assert!(
        warning.contains("are not degrees; the file is taken as coordinates of the plane") && area == 0.5,
        "{warning}"
    );
    let with_crs = |crs: Value, feature: &Value| {
        json!({"type": "FeatureCollection", "crs": crs, "features": [feature]}).to_string()
    };
    let named = |name: &str| json!({"type": "name", "properties": {"name": name}});
    for name in ["urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326", "urn:ogc:def:crs:EPSG::4258"] {
        let (warning, area) = said(&with_crs(named(name), &near));
        assert!(warning.contains("projected") && area > 1.0, "{name}");
        assert_refused(
            "map.geojson",
            with_crs(named(name), &far),
            &["feature 1, point 1: (500.0, 0.0) is not a longitude"],
        );
    }
    for crs in [named("urn:ogc:def:crs:EPSG::25832"), named("EPSG:14326")] {
        let (warning, area) = said(&with_crs(crs, &near));
        assert!(warning.contains("by its `crs` the file has coordinates of the plane") && area == 0.5, "{warning}");
    }
    let all = read("map.geojson", with_crs(Value::Null, &near));
    assert!(all[0].outline.warnings().is_empty(), "{:?}", all[0].outline.warnings());
    assert_eq!(polygon::signed_area(all[0].outline.vertices()), 0.5);
}

#[test]
fn an_outline_across_the_antimeridian_is_one_piece() {
    let fiji = [(179.9, -17.0), (-179.9, -17.0), (-179.9, -16.8), (179.9, -16.8)];
    let all = read("fiji.geojson", collection(&[feature(&polygon_of(&fiji), &json!({"name": "Fiji"}))]));
    let (low, high) = polygon::bounds(all[0].outline.vertices().iter().copied()).unwrap();
    assert!((high - low).max_element() < 25.0, "{}", high - low);
    assert!(all[0].outline.warnings()[0].contains("180, -16.9"), "{:?}", all[0].outline.warnings());
}

#[test]
fn a_bad_feature_is_refused_by_its_number_and_label_and_the_others_are_counted() {
    let good = polygon_of(&ISLE);
    let [outer, inner] =
        [good["coordinates"][0].clone(), polygon_of(&[(1.0, 0.2), (1.1, 0.2), (1.0, 0.3)])["coordinates"][0].clone()];
    let holed = json!({"type": "Polygon", "coordinates": [outer, inner]});
    let with =
        |bad: &Value| collection(&[feature(&good, &Value::Null), feature(bad, &json!({"name": "Vatican\u{7}"}))]);
    let part = "feature 2 (`Vatican\\u{7}`)";
    for (geometry, problem) in [
        (&holed, " has a hole; fill it in, or export its outer ring alone (1 of 2 outlines is refused)"),
        (&json!({"type": "MultiPolygon", "coordinates": [[outer], [outer, inner, inner]]}), " has 2 holes; "),
        (&json!({"type": "MultiPolygon", "coordinates": []}), " is empty; "),
        (&json!({"type": "Polygon", "coordinates": []}), " is empty; "),
        (&json!({"type": "Polygon", "coordinates": [[]]}), " is empty; "),
        (
            &json!({"type": "Polygon", "coordinates": [[[0], [1, 0], [0, 1]]]}),
            " has a position of fewer than two numbers; ",
        ),
        (&Value::Null, " has no geometry; "),
        (&json!({"type": "Point", "coordinates": [1, 2]}), " is a Point; give each outline as a Polygon"),
        (&json!({"type": "GeometryCollection", "geometries": []}), " is a GeometryCollection; "),
        (&json!({"type": "LineString", "coordinates": [[0, 0], [1, 0], [0, 1]]}), " is an open line; close it"),
        (&json!({"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [0, 0]]]}), ": it holds 2 distinct points; "),
        (
            &json!({"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [2, 0], [0, 0]]]}),
            ": the outline encloses no net area",
        ),
    ] {
        let message = refusal("all.geojson", with(geometry));
        assert!(message.contains(&format!("{part}{problem}")) && message.contains("1 of 2 outlines"), "{message}");
    }
    for geometry in [
        json!({"type": "Polygon", "coordinates": [[[0, 0], [1, "x\u{1b}"], [0, 1]]]}),
        json!({"type": "Polygon", "coordinates": [[[0, null], [1, 0], [0, 1]]]}),
        json!({"type": "Polygon", "coordinates": [0, 1]}),
        json!({"type": "Polygon"}),
        json!({"type": "Octagon", "coordinates": []}),
        json!("round"),
    ] {
        assert_refused(
            "all.geojson",
            with(&geometry),
            &["feature 2", "; correct it as RFC 7946 says, or remove it (1 of 2"],
        );
    }
    let all_bad = collection(&vec![feature(&holed, &Value::Null); 7]);
    assert_refused("all.geojson", all_bad, &["feature 1 has a hole", "(7 of 7 outlines are refused)"]);
    // A file of one geometry has no feature 1.
    assert_refused("one.json", holed.to_string(), &["one.json: the outline has a hole; "]);
    assert_refused("one.json", feature(&holed, &Value::Null).to_string(), &["one.json: the outline has a hole; "]);
}

#[test]
fn points_that_repeat_the_one_before_are_dropped_where_the_standard_allows_them() {
    let doubled: Vec<_> = ISLE.iter().flat_map(|p| [*p, *p]).collect();
    let text = doubled.iter().map(|(x, y)| format!("{x} {y}")).collect::<Vec<_>>().join(",");
    for (file, text) in [
        ("isle.json", plane(&[feature(&polygon_of(&doubled), &Value::Null)])),
        ("isle.wkt", format!("POLYGON(({text}))")),
    ] {
        let all = read(file, text);
        assert_eq!(vertices(&all[0]), ISLE);
        let warned = &all[0].outline.warnings()[0];
        assert!(
            warned.contains("5 points dropped that repeated the one before") && all[0].outline.is_simple(),
            "{warned}"
        );
    }
    let table: String = doubled.iter().map(|(x, y)| format!("{x},{y}\n")).collect();
    assert_refused("isle.csv", table, &["line 2: the point (0, 0) is that of line 1 again"]);
}

#[test]
fn what_is_not_geojson_is_refused() {
    assert_refused("a.geojson", "", &["the file is empty"]);
    assert_refused("a.geojson", " \n", &["the file is empty"]);
    assert_refused("a.geojson", "{\"type\": \"FeatureCollection\", \"features\": [", &["not JSON: it ends inside"]);
    assert_refused(
        "a.geojson",
        "{\"type\":\"Feature\"}\n{\"type\":\"Feature\"}",
        &["not JSON: trailing characters", "a feature a line"],
    );
    assert_refused("a.geojson", "x,y\n0,0\n", &["not JSON: expected a value at line 1 column 1"]);
    assert_refused("a.geojson", "{}", &["no member `type`"]);
    assert_refused("a.geojson", collection(&[]), &["the FeatureCollection is empty"]);
    assert_refused("a.geojson", "{\"type\": \"FeatureCollection\"}", &["has no `features`"]);
    assert_refused("a.geojson", "{\"type\": \"Topology\"}", &["it is TopoJSON; convert it"]);
    assert_refused("a.geojson", "{\"type\": \"Feature\", \"geometry\": 7}", &["no valid feature: "]);
    assert_refused("a.geojson", b"{\"type\": \"\xff\"}", &["byte 10 is not UTF-8"]);
    let huge = "{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1e400,0],[0,1]]]}";
    assert_refused("a.geojson", huge, &["number out of range"]);
    let large = "{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1e39,0],[0,1]]]}";
    assert_refused("a.geojson", large, &["point 2: `1e39` is too large"]);
    assert_refused("a.geojson", "[".repeat(100_000), &["not JSON: "]);
    let nested = format!("{{\"type\":\"Polygon\",\"coordinates\":{}", "[".repeat(100_000));
    assert_refused("a.geojson", nested, &["not JSON: "]);
    let closed = format!("{{\"type\":\"Polygon\",\"coordinates\":{}1{}}}", "[".repeat(1000), "]".repeat(1000));
    assert_refused("a.geojson", closed, &["no valid feature: lists or tables nested too deeply"]);
}

#[test]
fn every_line_of_well_known_text_is_read() {
    let text = "POLYGON ((0 0, 1 0, 0 1, 0 0))\n\n# two\nMULTIPOLYGON (((0 0, 2 0, 0 2)), ((5 5, 6 5, 5 6)))\n\
                SRID=4326;POLYGON((10 0, 10.01 0, 10 0.01, 10 0))\nPOLYGON ZM((0 0 1 2, 1 0 1 2, 0 1 1 2))\n";
    let all = read("all.wkt", text);
    assert_eq!(labels(&all), ["all/1", "all/2/1", "all/2/2", "all/3", "all/4"]);
    let warned: Vec<_> = all.iter().map(|one| one.outline.warnings().len()).collect();
    assert_eq!(warned, [0, 0, 0, 1, 0]);
    assert!(all[3].outline.warnings()[0].starts_with("all.wkt: line 5: lon,lat projected"));
    let crossed = read("all.wkt", "POLYGON((0 0, 2 2, 2 0, 0 1))");
    assert!(crossed[0].outline.warnings()[0].starts_with("all.wkt: line 1: the outline crosses"));
    for (line, problem) in [
        ("POLYGON ((0 0, 1 0, 0 1, 0 0)", "lacks a closing bracket"),
        ("POLYGON ((0 0, 1 0, 0 1, 0 0)))", "continues after its last bracket"),
        ("POLYGON ((0 0 0 0 0, 1 0, 0 1, 0 0))", "has a point of 5 numbers"),
        ("POLYGON )(0 0, 1 0, 0 1)", "has a closing bracket too many"),
        ("POLYGON ((0 0, 1 0, 0 1)) POLYGON", "continues after its last bracket"),
        ("POLYGON ((0 0, 1 0, 0 1))(0 0)", "continues after its last bracket"),
        ("POLYGON (0 0, 1 0, 0 1)", "is not well-known text"),
        ("POLYGON ((0 0, 1, 0 1))", "has a point of 1 number;"),
        ("POLYGON ((0 0, 1 x, 0 1, 0 0))", "has `x` where a number is expected;"),
        ("POLYGON ((0 0, 1 NaN, 0 1))", "is not well-known text"),
        ("POLYGON ((0,0 1,5 0,1))", "has a point of 1 number;"),
        ("POLYGON", "is not well-known text"),
        ("POLYGON EMPTY", "is empty"),
        ("MULTIPOLYGON EMPTY", "is empty"),
        ("POLYGON ((0 0, 9 0, 0 9), (1 1, 2 1, 1 2))", "has a hole; fill it in"),
        ("POINT (1 2)", "is no POLYGON, MULTIPOLYGON or closed LINESTRING"),
        ("GEOMETRYCOLLECTION (POLYGON ((0 0, 1 0, 0 1)))", "is no POLYGON"),
        ("LINESTRING (0 0, 1 0, 0 1)", "is an open line"),
        ("POLYGON ((0 0, 1e999 0, 0 1))", "point 2: `inf` is not finite"),
        ("POLYGON ((0 0, 1e31 0, 0 1))", "point 2: `1e31` is too large"),
        ("\u{1b}[31m", "`\\u{1b}[31m` is no POLYGON"),
    ] {
        assert_refused("all.wkt", format!("POLYGON ((0 0, 1 0, 0 1))\n{line}\n"), &["line 2", problem, "(1 of 2"]);
    }
    assert_refused("all.wkt", "# nothing\n", &["the file holds no geometry"]);
    let deep = format!("POLYGON {}", "(".repeat(1_000_000));
    assert_refused("all.wkt", deep, &["lacks a closing bracket"]);
    let deep = format!("POLYGON {}{}", "(".repeat(1_000_000), ")".repeat(1_000_000));
    assert_refused("all.wkt", deep, &["is not well-known text"]);
}

#[test]
fn a_file_that_is_not_what_its_extension_says_is_refused_with_the_way_out() {
    let good = npy(&[1, 2], npyz::Order::C, &[0.0, 0.0]);
    for (file, bytes, said) in [
        ("a.csv", &good[..], "the file is a NumPy array; give it the extension .npy"),
        ("a.csv", b"PK\x03\x04abc", "the file is a zip archive; unpack it; save spreadsheets as CSV"),
        ("a.xlsx", b"PK\x03\x04abc", "the file is a zip archive; unpack it; save spreadsheets as CSV"),
        ("a.shp", b"\0\0\x27\x0a\0\0", "a shapefile, not a table of points; convert it: ogr2ogr -f GeoJSON"),
        ("a.gpkg", b"SQLite format 3\0", "perhaps a GeoPackage, not a table of points; convert it: ogr2ogr"),
        ("a.csv.gz", b"\x1f\x8b\x08", "compressed, not a table of points; unpack it"),
        ("a.csv", b"\x89PNG\r\n\x1a\n\0", "an image, not a table of points; trace the outline"),
        ("a.csv", b"\0\x01\x02\x03\x1b[31m", "the file is binary, not a table of points"),
        ("a.wkt", b"\x01\0\0", "the file is binary"),
        ("a.csv", b" <!DOCTYPE html><html>", "an HTML or XML page, not a table of points"),
        ("a.geojson", b"<?xml version='1.0'?>", "an HTML or XML page"),
        ("a.svg", b"<?xml version='1.0'?>\n<svg width='9'>", "an SVG drawing, not a table of points; sample its paths"),
        ("a.csv", b"{\"type\": \"Feature\"}", "the file is JSON; give it the extension .geojson"),
        ("a.csv", b"\xef\xbb\xbfPolygon ((0 0, 1 0, 0 1))", "the file is well-known text; give it the extension .wkt"),
        ("a.json", b"POLYGON ((0 0, 1 0, 0 1))", "give it the extension .wkt"),
        ("a.csv", b"\xff\xfe0\0,\0", "the file is in UTF-16; save it in UTF-8"),
        ("a.geojson", b"\xfe\xff\0{", "the file is in UTF-16; save it in UTF-8"),
        ("a.csv", b"", "the file holds no points"),
        ("a.csv", b"\x1b[31m\x07", "`\\u{1b}[31m\\u{7}` names no columns x and y"),
        ("a.csv", b"\xf0\x9f\x92\xff,\xfe", "names no columns x and y"),
    ] {
        assert_refused(file, bytes, &[said]);
    }
}

#[test]
fn the_lines_for_svg_are_in_the_document_that_the_message_names() {
    let text = include_str!("../../../../docs/outlines.md");
    let (_, lines) = text.split_once("## SVG\n").expect("a section SVG");
    let lines = lines.split("\n## ").next().unwrap();
    assert!(
        SAMPLE.contains("docs/outlines.md") && SAMPLE.contains("svgelements") && lines.contains("import svgelements")
    );
}

#[test]
fn words_that_other_programs_misread_have_a_warning_with_the_remedy() {
    for word in MISSING {
        let warnings = misread("label", ["a", word].into_iter());
        assert!(
            warnings[0].starts_with(&format!("the label `{word}` would be a missing value to pandas")),
            "{warnings:?}"
        );
        assert!(warnings[0].contains("keep_default_na=False, na_values=[\"\"]"), "{warnings:?}");
    }
    let warnings = misread("group", ["=1+1", "+a", "-5", "+1e3", "=1+1", "@b", "a=b"].into_iter());
    let expected = "the group `=1+1` and 2 others may be evaluated as a formula by a spreadsheet: import the column group as \
                    text, see docs/files.md";
    assert_eq!(warnings, [expected]);
    assert!(misread("label", ["Namibia", "na", "", "-5"].into_iter()).is_empty());
}

#[test]
fn an_outline_is_read_below_a_directory_and_named_without_it() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("eight.csv"), "0,0\n2,2\n2,0\n0,1\n").unwrap();
    let all = read_all(home.path(), Path::new("eight.csv")).unwrap();
    let outline = &all[0].outline;
    assert!(outline.warnings()[0].starts_with("eight.csv: the outline crosses"), "{:?}", outline.warnings());
    let error = read_all(home.path(), Path::new("none.csv")).unwrap_err().to_string();
    assert!(error.starts_with("--shape file:none.csv: there is no such file; "), "{error}");
    let denied = super::unread(Path::new("a.csv"), Path::new("/a.csv"), &std::io::ErrorKind::PermissionDenied.into());
    assert!(denied.to_string().starts_with("--shape file:a.csv: there is no permission to read it; "), "{denied}");
    // An absolute path ignores the base directory.
    assert!(read_all(Path::new("/none"), &home.path().join("eight.csv")).is_ok());
}

#[test]
fn a_missing_file_and_a_folder_are_wrong_requests() {
    for path in ["no/such/file.csv", "src"] {
        let error = Outline::read(Path::new(path)).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains(path), "{error}");
    }
}

#[test]
fn labels_are_different_also_if_a_name_looks_numbered() {
    let labelled = |label: &str| {
        let outline = Outline::from_points(&[DVec2::ZERO, DVec2::X, DVec2::Y]).unwrap();
        Labelled { label: label.into(), properties: BTreeMap::new(), file: PathBuf::new(), outline: outline.into() }
    };
    let mut all = ["a", "a (2)", "a", "b", "a", "a (2)"].map(labelled);
    make_unique(&mut all);
    assert_eq!(labels(&all), ["a", "a (2)", "a (3)", "b", "a (4)", "a (2) (2)"]);
}

#[test]
fn a_pattern_gives_the_files_that_match_in_the_order_of_their_names() {
    let home = tempfile::tempdir().unwrap();
    // A directory with the characters of a pattern.
    let base = home.path().join("a[1]*");
    fs::create_dir_all(base.join("deep/er")).unwrap();
    fs::create_dir(base.join("folder.csv")).unwrap();
    for name in ["b.csv", "a.csv", ".hidden.csv", "a.txt", "deep/c.csv", "deep/er/d.csv"] {
        fs::write(base.join(name), "0,0\n1,0\n0,1\n").unwrap();
    }
    let found = |pattern: &str| {
        let paths = glob(&base, pattern).unwrap();
        paths.iter().map(|path| path.to_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(found("*.csv"), ["a.csv", "b.csv"]);
    assert_eq!(found("**/*.csv"), ["a.csv", "b.csv", "deep/c.csv", "deep/er/d.csv"]);
    assert_eq!(found("[b-z].csv"), ["b.csv"]);
    assert_eq!(found("./a.*"), ["a.csv", "a.txt"]);
    let absolute = Pattern::escape(base.to_str().unwrap()) + "/?.txt";
    assert_eq!(glob(Path::new(""), &absolute).unwrap(), [base.join("a.txt")]);
    assert_eq!(
        glob(Path::new(""), "../../examples/islands/i*.csv").unwrap(),
        [Path::new("../../examples/islands/iceland.csv")]
    );
    let refusal = |base: &Path, pattern: &str| {
        let error = glob(base, pattern).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    };
    let message = refusal(&base, "*.geojson");
    assert!(
        message.starts_with("--shape files:*.geojson: no file matches in ")
            && message.contains("a[1]*; check folder and extension; write")
    );
    let current = std::env::current_dir().unwrap();
    assert!(refusal(Path::new(""), "none*").contains(&format!("no file matches in {}; ", current.display())));
    assert!(refusal(&base, "folder*").contains("no file matches"));
    let message = refusal(&base, "deep/none/*.csv");
    assert!(
        message.contains(": there is no folder deep/none in ") && message.contains("; check its name"),
        "{message}"
    );
    assert!(refusal(&base, "deep/*/none/*.csv").contains(": no file matches in "));
    let absolute = format!("{}/none/*.csv", Pattern::escape(base.to_str().unwrap()));
    assert!(refusal(&base, &absolute).contains(": no file matches in "), "brackets are wildcards");
    #[cfg(unix)]
    assert!(refusal(&base, "/no-such-folder/*.csv").contains(": there is no folder /no-such-folder; check its name"));
    assert!(refusal(&base, "a***b").contains("in the pattern; write for example"), "{}", refusal(&base, "a***b"));
    let all = read_files(&base, &glob(&base, "**/*.csv").unwrap()).unwrap();
    assert_eq!(labels(&all), ["a", "b", "c", "d"]);
    fs::write(base.join("deep/b.csv"), "0,0\n").unwrap();
    let error = read_files(&base, &glob(&base, "**/*.csv").unwrap()).unwrap_err().to_string();
    assert!(error.starts_with("--shape file:deep/b.csv: ") && error.ends_with("(1 of 5 files is refused)"), "{error}");
}

#[test]
fn warnings_of_many_outlines_are_said_once() {
    let triangle = |x: f64| feature(&polygon_of(&[(x, 0.0), (x + 1.0, 0.0), (x, 1.0)]), &Value::Null);
    let all = read("map.geojson", collection(&[triangle(1.0), triangle(2.0), triangle(3.0)]));
    let said = warnings(&all);
    assert_eq!(said.len(), 1);
    assert!(
        said[0].starts_with("map.geojson: feature 1: lon,lat projected")
            && said[0].ends_with("(likewise 2 other outlines)")
    );
    assert_eq!(warnings(&all[..1]), all[0].outline.warnings());
    assert!(warnings(&read("a.csv", "0,0\n1,0\n0,1\n")).is_empty());
}

#[test]
fn reading_many_features_takes_a_time_that_grows_with_their_number() {
    let ring = |center: DVec2| -> Vec<(f64, f64)> {
        let corner = |i: u32| center + DVec2::from_angle(f64::from(i) * 0.0314159) * (0.1 + 0.01 * f64::from(i % 3));
        (0..200).map(|i| corner(i).into()).collect()
    };
    let text = |count: u32| {
        let features = (0..count).map(|i| {
            feature(
                &polygon_of(&ring(DVec2::new(f64::from(i % 100), f64::from(i / 100)))),
                &json!({"name": i, "class": i % 7}),
            )
        });
        collection(&features.collect::<Vec<_>>())
    };
    // Time without a processor does not count, and the fastest of three times is the least disturbed.
    let seconds = |text: &str| {
        let times = (0..3).map(|_| {
            let begun = thread_time();
            read("map.geojson", text);
            (thread_time() - begun).as_secs_f64()
        });
        times.fold(f64::INFINITY, f64::min)
    };
    let (few, many) = (text(625), text(5000));
    let all = read("map.geojson", &many);
    assert_eq!((all.len(), all[4999].label.as_str(), &*all[4999].properties["class"]), (5000, "4999", "1"));
    // Eight times as many; anything quadratic would take 64 times as long.
    let ratio = seconds(&many) / seconds(&few);
    assert!(ratio < 24.0, "{ratio}");
}

/// Processor time of this thread, where the system reports it.
fn thread_time() -> std::time::Duration {
    #[cfg(unix)]
    {
        use rustix::time::{ClockId, clock_gettime};
        clock_gettime(ClockId::ThreadCPUTime).try_into().unwrap()
    }
    #[cfg(not(unix))]
    {
        static BEGUN: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
        BEGUN.elapsed()
    }
}

#[test]
fn labels_that_change_at_every_point_are_refused_and_numbers_of_points_are_not_labels() {
    let table = |labels: &[&str]| {
        let rows = labels.iter().enumerate().map(|(i, label)| {
            let angle = i as f64;
            format!("{},{},{label}\n", angle.cos(), angle.sin())
        });
        format!("x,y,label\n{}", rows.collect::<String>())
    };
    assert_refused("t.csv", table(&["A", "B", "A", "B", "A", "B"]), &["the outline `A` appears again"]);
    assert_refused("t.csv", table(&["1", "2", "1", "2", "1", "2"]), &["the outline `1` appears again"]);
    for numbers in [["0", "1", "2", "3", "4", "5"], ["1", "2", "3", "1", "2", "3"], ["a", "b", "c", "d", "e", "f"]] {
        assert_eq!(read("t.csv", table(&numbers)).len(), 1, "{numbers:?}");
    }
}

#[test]
fn labels_in_latin_1_and_with_quotes_are_read_as_they_are_meant() {
    let ring = |label: &[u8], at: u8| {
        let rows =
            [(0, 0), (1, 0), (0, 1)].map(|(x, y)| [format!("{},{y},", x + at).as_bytes(), label, b"\n"].concat());
        rows.concat()
    };
    let latin = read("t.csv", [&b"x,y,label\n"[..], &ring(b"\xe9", 0), &ring(b"\xe8", 9)].concat());
    assert_eq!(labels(&latin), ["é", "è"]);
    assert!(latin[0].outline.warnings()[0].contains("the file is not UTF-8 and was read as Latin-1"));
    assert_eq!(latin[1].outline.warnings(), [""; 0]);
    let quoted = read("t.csv", [&b"x,y,label\n"[..], &ring(b"\"5\"\" sieve\"", 0), &ring(b"\"a,b\"", 9)].concat());
    assert_eq!(labels(&quoted), ["5\" sieve", "a,b"]);
}

#[test]
#[cfg(target_os = "linux")]
fn a_name_that_is_not_utf_8_is_no_panic() {
    use std::{ffi::OsStr, os::unix::ffi::OsStrExt};
    let home = tempfile::tempdir().unwrap();
    for name in [&b"a.csv"[..], b"b\xe9.csv"] {
        fs::write(home.path().join(OsStr::from_bytes(name)), "0,0\n1,0\n0,1\n").unwrap();
    }
    let message = glob(home.path(), "*.csv").unwrap_err().to_string();
    assert!(message.contains("has a name that is not UTF-8; rename it"), "{message}");
}
