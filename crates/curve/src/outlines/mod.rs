//! Outlines from files: tables of points, GeoJSON, WKT and NumPy arrays.
//!
//! | extension | format | outlines | in degrees |
//! |---|---|---|---|
//! | `.geojson`, `.json` | GeoJSON | every polygon of every feature | unless its `crs` or its numbers say otherwise |
//! | `.wkt` | well-known text | every polygon of every line | with `SRID=4326;` |
//! | `.npy`, `.npz` | NumPy | every array (N, 2), every item of an array (M, N, 2) | no |
//! | any other | a [table](self#tables) | between blank lines, rows of NaN, or by a column | with columns `lon` and `lat` |
//!
//! The extension says what the format is, and the content is checked. An outline in degrees is projected to kilometres
//! about its own centroid, with a warning that states the projection.
//!
//! [`read_all`] reads the outlines of a file with a label each: the name of the feature, ring or array, or else the
//! name of the file, numbered if it has several. [`Outline::read`] reads a file of one outline. If an outline is
//! refused, so is the whole file: nothing is left out silently.
//!
//! # Tables
//!
//! One point per line, in columns separated by commas, semicolons, tabs or spaces, in UTF-8. Lines that begin with `#`
//! are skipped. A first line without any number is a header; it must name the columns `x` and `y`, or `lon` and `lat`.

mod columns;
mod geojson;
mod npy;
mod piece;
mod projection;
mod table;
mod wkt;

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashMap, HashSet},
    io::{self, ErrorKind},
    path::{Path, PathBuf},
    sync::Arc,
};

use ::glob::{MatchOptions, Pattern, glob_with};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use self::piece::Piece;
use super::{
    Outline,
    outline::{CROSSES, REPEATED, Source},
};
use curvelax_base::{
    error::{Error, Result, echo_path, shortened},
    guard::guarded,
    input::{self, MAX_OUTLINE},
    text::count,
};

/// An outline with what its file says about it. A run saves it, and resumes without the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Labelled {
    /// Its name, at most about 100 characters, different from those of all others that were read with it.
    pub label: String,
    /// The properties of its feature, or the columns of its table that are constant over it, as text.
    pub properties: BTreeMap<String, String>,
    /// The file, as it was named.
    pub file: PathBuf,
    /// The outline; its digest is that of the file.
    #[serde(serialize_with = "save", deserialize_with = "restore")]
    pub outline: Arc<Outline>,
}

fn save<S: Serializer>(outline: &Arc<Outline>, to: S) -> std::result::Result<S::Ok, S::Error> {
    outline.as_ref().serialize(to)
}

fn restore<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Arc<Outline>, D::Error> {
    Outline::deserialize(from).map(Arc::new)
}

impl Labelled {
    /// The name of the property that every outline has: its file.
    pub const FILE: &str = "file";

    /// The value of the property `name`: one of its [properties](Labelled::properties), or its file.
    pub fn property(&self, name: &str) -> Option<Cow<'_, str>> {
        match self.properties.get(name) {
            Some(value) => Some(value.into()),
            None => (name == Labelled::FILE).then(|| self.file.to_string_lossy()),
        }
    }
}

/// Reads all outlines of the file at `path`, relative to the directory `base`, in their order; messages name only
/// `path`.
///
/// # Errors
/// [`Error::Request`] naming the path, the place in the file, the value and the remedy: the file cannot be read, is not
/// of its format, or has no outlines; an outline is refused, see [`Outline::read`]. If several are, the message is
/// about the first and gives their number.
pub fn read_all(base: &Path, path: &Path) -> Result<Vec<Labelled>> {
    from_bytes(path, &content(base, path)?)
}

/// Reads all outlines of several files, as [`read_all`] does. Labels are different across all of them.
///
/// # Errors
/// As [`read_all`].
pub fn read_files(base: &Path, paths: &[PathBuf]) -> Result<Vec<Labelled>> {
    let files = paths.iter().map(|path| read_all(base, path)).collect();
    let mut all: Vec<Labelled> = all_or_first(files, "file")?.into_iter().flatten().collect();
    make_unique(&mut all);
    Ok(all)
}

/// Reads all outlines from the contents of the file at `path`, whose extension is the format.
///
/// # Errors
/// As [`read_all`].
pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Vec<Labelled>> {
    let source = Source::new(path);
    let format = Format::of(source, path, bytes)?;
    let mut all = format.read(source, path, bytes)?;
    make_unique(&mut all);
    Ok(all)
}

impl Outline {
    /// Reads the outline of a file.
    ///
    /// # Errors
    /// [`Error::Request`] naming the path, the line, the value and the remedy: the file cannot be read, is empty, is
    /// not of its [format](crate::outlines), or has several outlines; an outline holds more than
    /// [`MAX_POINTS`](super::MAX_POINTS) points or fewer than three distinct ones; a line of a table is not a pair of
    /// finite numbers, or longer than 65 536 bytes; neighbouring points coincide; no net area is enclosed. An outline
    /// that crosses itself is accepted with a warning.
    pub fn read(path: &Path) -> Result<Outline> {
        let bytes = content(Path::new(""), path)?;
        let source = Source::new(path);
        only(source, Format::of(source, path, &bytes)?.read(source, path, &bytes)?)
    }

    /// Reads the outline of a table of points from its text; `path` is used in messages.
    ///
    /// # Errors
    /// As [`Outline::read`].
    pub fn from_csv(path: &Path, bytes: &[u8]) -> Result<Outline> {
        let source = Source::new(path);
        check_text(source, bytes)?;
        only(source, Format::Table.read(source, path, bytes)?)
    }
}

/// The outline of a file that has one.
fn only(source: Source, mut all: Vec<Labelled>) -> Result<Outline> {
    match (all.pop(), all.len()) {
        (Some(one), 0) => Ok(Arc::unwrap_or_clone(one.outline)),
        (_, others) => {
            let problem = format!("the file holds {} where one is expected", count(others as u64 + 1, "outline"));
            Err(source.refusal("", &problem, "save the one that is meant in a file of its own"))
        }
    }
}

fn content(base: &Path, path: &Path) -> Result<Vec<u8>> {
    let whole = base.join(path);
    input::bytes(&whole, MAX_OUTLINE).map_err(|e| unread(path, &whole, &e))
}

/// The refusal of the file at `path`, which is looked for at `whole`.
fn unread(path: &Path, whole: &Path, error: &io::Error) -> Error {
    let refusal = |problem: &str, remedy: &str| Source::new(path).refusal("", problem, remedy);
    let cannot = format!("cannot read it: {error}");
    match error.kind() {
        // A part of the path may also be a file.
        ErrorKind::NotFound | ErrorKind::NotADirectory => {
            let sought = std::path::absolute(whole).unwrap_or_else(|_| whole.to_owned());
            let remedy = format!("looked for {}: check the name and the folder", echo_path(&sought));
            refusal("there is no such file", &remedy)
        }
        ErrorKind::IsADirectory => {
            let remedy = format!("give a file in it, or all of them: 'files:{}/*.csv'", echo_path(path));
            refusal("it is a folder", &remedy)
        }
        ErrorKind::PermissionDenied => {
            refusal("there is no permission to read it", "give yourself the right, for example by chmod u+r")
        }
        ErrorKind::InvalidFilename => refusal(&cannot, "use a shorter path, for example a relative one"),
        ErrorKind::FileTooLarge => refusal(&cannot, "thin the outline out, or save fewer outlines in a file"),
        _ => refusal(&cannot, "give a table x,y, GeoJSON, WKT or NumPy arrays"),
    }
}

/// The format of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    Table,
    GeoJson,
    Wkt,
    Npy,
    Npz,
}

/// Contents that are no outlines, by their first bytes, with what to do.
const FOREIGN: [(&[u8], &str, &str); 9] = [
    (&[0, 0, 0x27, 0x0a], "a shapefile", CONVERT),
    (b"SQLite format 3\0", "a database, perhaps a GeoPackage", CONVERT),
    (b"fgb", "a FlatGeobuf", CONVERT),
    (b"PAR1", "a Parquet file", CONVERT),
    (&[0x1f, 0x8b], "compressed", "unpack it by gunzip"),
    (b"\x89PNG", "an image", TRACE),
    (&[0xff, 0xd8, 0xff], "an image", TRACE),
    (b"\x89HDF", "an HDF5 file", "save the outline as CSV, with columns x,y"),
    (b"%PDF", "a PDF", "save the outline as CSV, with columns x,y"),
];
const CONVERT: &str = "convert it: ogr2ogr -f GeoJSON outlines.geojson FILE";
/// The lines are in `docs/outlines.md`: GDAL reads no SVG.
const SAMPLE: &str = "sample its paths by Python's svgelements, with the lines under SVG in docs/outlines.md";
const TRACE: &str = "trace the outline, and save its points as CSV, with columns x,y";

/// Bytes of an XML file before its element `<svg`.
const MAX_BEFORE_SVG: usize = 4096;

impl Format {
    /// The format by the extension of `path`, if the content agrees.
    fn of(source: Source, path: &Path, bytes: &[u8]) -> Result<Format> {
        let refuse = |problem: &str, remedy: &str| Err(source.refusal("", &format!("the file is {problem}"), remedy));
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let format = match &*extension {
            "geojson" | "json" => Format::GeoJson,
            "wkt" => Format::Wkt,
            "npy" => Format::Npy,
            "npz" => Format::Npz,
            _ => Format::Table,
        };
        if let Some((_, what, remedy)) = FOREIGN.iter().find(|(start, ..)| bytes.starts_with(start)) {
            return refuse(&format!("{what}, not a table of points"), remedy);
        }
        let (is_array, is_zip) = (bytes.starts_with(npy::MAGIC), bytes.starts_with(b"PK\x03\x04"));
        match format {
            Format::Npy if !is_array => return Err(npy::not_an_array(source)),
            Format::Npy | Format::Npz => return Ok(format),
            _ if is_array => return refuse("a NumPy array", "give it the extension .npy"),
            _ if is_zip => {
                return refuse("a zip archive", "unpack it; save spreadsheets as CSV; arrays have the extension .npz");
            }
            _ => check_text(source, bytes)?,
        }
        let text = without_mark(bytes).trim_ascii_start();
        let is_wkt = ["POLYGON", "MULTIPOLYGON", "LINESTRING", "SRID="]
            .iter()
            .any(|word| text.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word.as_bytes())));
        match (format, text.first()) {
            (_, Some(b'<')) if text.windows(4).take(MAX_BEFORE_SVG).any(|tag| tag == b"<svg") => {
                refuse("an SVG drawing, not a table of points", SAMPLE)
            }
            (_, Some(b'<')) => refuse("an HTML or XML page, not a table of points", CONVERT),
            (Format::Table | Format::Wkt, Some(b'{' | b'[')) => refuse("JSON", "give it the extension .geojson"),
            (Format::Table | Format::GeoJson, _) if is_wkt => refuse("well-known text", "give it the extension .wkt"),
            (Format::GeoJson, None) => refuse("empty", "give a FeatureCollection of Polygons"),
            _ => Ok(format),
        }
    }

    /// Reads the outlines of a file of this format, with labels that may be equal.
    fn read(self, source: Source, path: &Path, bytes: &[u8]) -> Result<Vec<Labelled>> {
        let text = without_mark(bytes);
        let pieces = match self {
            Format::Table => table::pieces(source, text),
            Format::GeoJson => self::geojson::pieces(source, text),
            Format::Wkt => self::wkt::pieces(source, text),
            Format::Npy => npy::pieces(source, bytes),
            Format::Npz => npy::pieces_of_zip(source, bytes),
        }?;
        let digest = crc32c::crc32c(bytes);
        let numbered = pieces.iter().flatten().any(|piece| piece.item > 1);
        let labelled = |piece: Piece| {
            let base = match &piece.name {
                Some(name) => name.clone(),
                None if numbered => format!("{}/{}", source.stem(), piece.item),
                None => source.stem(),
            };
            let label = piece.polygon.map_or(base.clone(), |number| format!("{base}/{number}"));
            let (properties, file) = (piece.properties.clone(), path.to_owned());
            Ok(Labelled { label, properties, file, outline: Arc::new(outline(source, piece, digest)?) })
        };
        all_or_first(pieces.into_iter().map(|piece| piece.and_then(labelled)).collect(), "outline")
    }
}

/// Projects and checks an outline.
fn outline(source: Source, mut piece: Piece, digest: u32) -> Result<Outline> {
    let part = piece.ring.places.part.clone();
    let mut notes: Vec<String> = piece.notes.iter().map(|note| source.said(&part, note)).collect();
    if piece.in_degrees && !piece.ring.points.is_empty() {
        source.check_number(&piece.ring.places, piece.ring.points.len())?;
        let centre = projection::project(source, &mut piece.ring)?;
        notes.push(source.said(&part, &projection::stated(centre)));
    }
    Ok(Outline::of_ring(source, piece.ring)?.read_as(digest, notes))
}

/// All values, or the first error with the number of errors.
fn all_or_first<T>(results: Vec<Result<T>>, what: &str) -> Result<Vec<T>> {
    let (all, refused) = (results.len() as u64, results.iter().filter(|result| result.is_err()).count());
    let values: Result<Vec<T>> = results.into_iter().collect();
    match (values, all) {
        (Err(Error::Request(message)), 2..) => {
            let of = count(all, what);
            Err(Error::Request(format!(
                "{message} ({refused} of {of} {} refused)",
                if refused == 1 { "is" } else { "are" }
            )))
        }
        (values, _) => values,
    }
}

/// Refuses bytes that are no text.
fn check_text(source: Source, bytes: &[u8]) -> Result<()> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(source.refusal("", "the file is in UTF-16", "save it in UTF-8"));
    }
    let line = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
    match line.contains(&0) {
        true => Err(source.refusal("", "the file is binary, not a table of points", CONVERT)),
        false => Ok(()),
    }
}

/// Without the byte order mark of UTF-8.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes)
}

/// Numbers labels that were there before: `Cuba`, `Cuba (2)`.
fn make_unique(outlines: &mut [Labelled]) {
    let mut taken: HashSet<String> = outlines.iter().map(|one| one.label.clone()).collect();
    let mut number: HashMap<String, u64> = HashMap::new();
    for one in outlines {
        let number = number.entry(one.label.clone()).or_default();
        *number += 1;
        while *number > 1 {
            let label = format!("{} ({number})", one.label);
            if taken.insert(label.clone()) {
                one.label = label;
                break;
            }
            *number += 1;
        }
    }
}

/// Returns the paths of the files that match `pattern`, relative to the directory `base`, in the order of their names.
///
/// `*` and `?` stand for any characters but `/`, `[abc]` for one of these, `**` for directories. Names that begin with
/// a dot are matched only by a dot.
///
/// # Errors
/// [`Error::Request`] if the pattern is wrong, a directory cannot be read, or nothing matches.
pub fn glob(base: &Path, pattern: &str) -> Result<Vec<PathBuf>> {
    let shown = echo_path(Path::new(pattern));
    let refuse = |problem: &str, remedy: &str| Error::Request(format!("--shape files:{shown}: {problem}; {remedy}"));
    const REMEDY: &str = "write for example 'files:outlines/*.csv', with * ? [abc] or **";
    let base_text =
        base.to_str().ok_or_else(|| refuse("the current folder is not UTF-8", "call it by another name"))?;
    // A base with brackets is no pattern.
    let whole = Path::new(&Pattern::escape(base_text)).join(pattern);
    let whole = whole.to_str().unwrap_or(pattern);
    let options =
        MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: true };
    let wrong = |e: ::glob::PatternError| refuse(&format!("{} in the pattern", shortened(e.msg, 100)), REMEDY);
    let mut paths = Vec::new();
    // It panics at names that are not UTF-8.
    let found = guarded(|| glob_with(whole, options).map(Iterator::collect::<Vec<_>>)).map_err(|_| {
        refuse(
            "a file or folder in reach of the pattern has a name that is not UTF-8",
            "rename it, or use a narrower pattern",
        )
    })?;
    for path in found.map_err(wrong)? {
        let path = path.map_err(|e| {
            let (at, e) = (echo_path(e.path()), e.error());
            refuse(&format!("cannot read {at}: {e}"), "make it readable, or use a narrower pattern")
        })?;
        if !path.is_dir() {
            paths.push(path.strip_prefix(base).map(Path::to_path_buf).unwrap_or(path));
        }
    }
    paths.sort();
    match paths.is_empty() {
        true => {
            if base.join(pattern).is_dir() {
                return Err(refuse("it is a folder", &format!("write 'files:{}/*.csv'", shown.trim_end_matches('/'))));
            }
            let place = std::path::absolute(if base_text.is_empty() { Path::new(".") } else { base });
            let place = place.as_deref().map_or("the current folder".into(), echo_path);
            if let Some(missing) = missing_folder(base, pattern) {
                let inside = if missing.is_absolute() { String::new() } else { format!(" in {place}") };
                let problem = format!("there is no folder {}{inside}", echo_path(missing));
                return Err(refuse(&problem, "check its name, and the folder that you are in"));
            }
            Err(refuse(&format!("no file matches in {place}"), &format!("check folder and extension; {REMEDY}")))
        }
        false => Ok(paths),
    }
}

/// The first folder of `pattern` that is not there, if it is named without wildcards.
fn missing_folder<'a>(base: &Path, pattern: &'a str) -> Option<&'a Path> {
    let folders = pattern.match_indices('/').map(|(end, _)| &pattern[..end]);
    let named = folders.take_while(|folder| !folder.contains(['*', '?', '[']));
    named.map(Path::new).find(|folder| !base.join(folder).exists() && !folder.as_os_str().is_empty())
}

/// Words that pandas reads as missing values unless it is told otherwise.
const MISSING: [&str; 18] = [
    "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "1.#IND", "1.#QNAN", "<NA>", "N/A", "NA", "NULL",
    "NaN", "None", "n/a", "nan", "null",
];

/// Returns the warnings about words in the column `column` of the tables that other programs misread.
pub fn misread<'a>(column: &str, words: impl Iterator<Item = &'a str> + Clone) -> Vec<String> {
    let missing = words.clone().filter(|word| MISSING.contains(word)).collect();
    // A number is no formula.
    let formulas =
        words.filter(|word| word.starts_with(['=', '+', '-', '@']) && word.parse::<f64>().is_err()).collect();
    let warning = |such: Vec<&str>, what: &str, remedy: &str| {
        let others: HashSet<&&str> = such.iter().filter(|word| **word != such[0]).collect();
        let others = match others.len() as u64 {
            0 => String::new(),
            more => format!(" and {}", count(more, "other")),
        };
        such.first().map(|first| format!("the {column} `{first}`{others} {what}: {remedy}"))
    };
    let pandas = "would be a missing value to pandas";
    let keep = "read the tables with keep_default_na=False, na_values=[\"\"], or by the Python package";
    let sheet = "may be evaluated as a formula by a spreadsheet";
    let text = format!("import the column {column} as text, see docs/files.md");
    warning(missing, pandas, keep).into_iter().chain(warning(formulas, sheet, &text)).collect()
}

/// Returns the warnings of many outlines, each kind once, with the number of outlines that it is about.
pub fn warnings(outlines: &[Labelled]) -> Vec<String> {
    let kinds = [
        CROSSES,
        "would take too long",
        REPEATED,
        projection::PROJECTED,
        geojson::NOT_DEGREES,
        geojson::OTHER_SYSTEM,
        table::X_AND_Y,
    ];
    let all = || outlines.iter().flat_map(|one| one.outline.warnings());
    let said = |kind: &str| {
        let mut such = all().filter(|warning| warning.contains(kind));
        let first = such.next()?;
        Some(match such.count() as u64 {
            0 => first.clone(),
            more => format!("{first} (likewise {more} other outline{})", if more == 1 { "" } else { "s" }),
        })
    };
    let others = all().filter(|warning| !kinds.iter().any(|kind| warning.contains(kind))).cloned();
    kinds.iter().filter_map(|kind| said(kind)).chain(others).collect()
}

#[cfg(test)]
mod tests;
