//! Tables of points: one point per line, in columns.
//!
//! The separator is the first of comma, semicolon, tab and spaces under which the first line is a header that names the
//! coordinates, or consists of numbers. Decimal commas are read where commas do not separate. Blank lines at the edges
//! and lines that begin with `#` are skipped. A header names the columns `x` and `y`, or `lon` and `lat` (degrees);
//! other columns are properties of the outline if they are constant over it.
//!
//! A table of several outlines separates them by blank lines, by rows of NaN, by lines that begin with `>`, or by a
//! column called ring, id, part or label. Its rings are never joined.

use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
    ops::Range,
};

use glam::DVec2;

use super::{
    columns::{Columns, Separator, Written, is_missing, is_ring_column},
    piece::{Piece, Properties, label, property},
};
use crate::{
    MAX_POINTS,
    outline::{Places, RingPoints, Source},
};
use curvelax_base::{
    error::{Error, Result, shortened},
    input::MAX_LINE,
    text::{self, count},
};

/// Maximum characters of foreign text in a message.
const SHOWN: usize = 40;

/// What a table with coordinates of both kinds is told.
pub(super) const X_AND_Y: &str = "the columns x and y are the coordinates, not those of longitude and latitude";

/// What a table that is not UTF-8 is told.
const LATIN: &str = "the file is not UTF-8 and was read as Latin-1";

/// What ends an outline before a point.
#[derive(Clone, Copy, PartialEq)]
enum Break {
    Blank,
    Missing,
}

/// The points of a file with their line numbers.
#[derive(Default)]
struct PointTable {
    points: Vec<DVec2>,
    lines: Vec<usize>,
    /// Values of the further columns at each point, as indices into `words`.
    others: Vec<Vec<u32>>,
    words: Vec<String>,
    /// Before the point of an index.
    breaks: Vec<(usize, Break)>,
    /// The first number that may have a comma between thousands.
    thousands: Option<(usize, String)>,
    has_decimal_commas: bool,
    has_decimal_points: bool,
    is_latin: bool,
}

/// Reads the outlines of a table.
pub(super) fn pieces(source: Source, bytes: &[u8]) -> Result<Vec<Result<Piece>>> {
    let mut reader = Reader { source, table: PointTable::default(), known: HashMap::new() };
    let columns = reader.read(bytes)?;
    let table = reader.table;
    table.check_commas(source)?;
    let columns = columns.unwrap_or(Columns::unnamed(Separator::Comma));
    let ring_columns = table.ring_columns(&columns);
    let starts = table.starts(source, &ring_columns)?;
    let ends = starts.iter().skip(1).copied().chain([table.points.len()]);
    let spans: Vec<_> = starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect();
    let several = spans.len() > 1;
    let piece = |(index, span): (usize, Range<usize>)| {
        let mut properties = Properties::new();
        for ((name, _), values) in columns.others.iter().zip(&table.others) {
            let values = &values[span.clone()];
            if let Some(first) = values.first().filter(|first| values.iter().all(|value| value == *first)) {
                properties.insert(name.clone(), property(&table.words[*first as usize]));
            }
        }
        let names = ring_columns.iter().filter_map(|column| properties.get(&columns.others[*column].0));
        let names: Vec<&str> = names.map(String::as_str).filter(|name| !name.is_empty()).collect();
        let name = label(&names.join("/"));
        let part = match &name {
            _ if !several => String::new(),
            Some(name) => format!("outline {} (`{}`)", index + 1, shortened(name, SHOWN)),
            None => format!("outline {}", index + 1),
        };
        let places = Places { part, unit: "line", numbers: table.lines[span.clone()].to_vec() };
        let ring = RingPoints::new(table.points[span].to_vec(), places);
        let notes = [(columns.has_both, X_AND_Y), (table.is_latin && index == 0, LATIN)];
        let notes = notes.into_iter().filter_map(|(applies, note)| applies.then_some(note)).collect();
        Ok(Piece { name, properties, in_degrees: columns.in_degrees, notes, ..Piece::new(index + 1, ring) })
    };
    Ok(spans.into_iter().enumerate().map(piece).collect())
}

impl PointTable {
    /// Refuses commas that may stand between thousands.
    fn check_commas(&self, source: Source) -> Result<()> {
        match &self.thousands {
            Some((line, shown)) if !self.has_decimal_commas || self.has_decimal_points => {
                let problem = format!("the comma of `{shown}` may be a decimal comma or one between thousands");
                Err(source.refusal(&place(*line), &problem, "write decimal points, and nothing between thousands"))
            }
            _ => Ok(()),
        }
    }

    /// The columns that name the ring of a point. A column that numbers the points, of the file or of each of its
    /// rings, is none of them.
    fn ring_columns(&self, columns: &Columns) -> Vec<usize> {
        let names_rings = |i: &usize| is_ring_column(&columns.others[*i].0) && !self.numbers_points(&self.others[*i]);
        (0..columns.others.len()).filter(names_rings).collect()
    }

    /// Whether values, as indices into `words`, are all different, or numbers that rise over three points at least
    /// before they begin again.
    fn numbers_points(&self, values: &[u32]) -> bool {
        // Where rings are named, this ends it at once.
        if values.len() < 2 || values.windows(2).any(|pair| pair[0] == pair[1]) {
            return false;
        }
        if values.iter().collect::<HashSet<_>>().len() == values.len() {
            return true;
        }
        let numbers: Option<Vec<f64>> = values.iter().map(|value| self.words[*value as usize].parse().ok()).collect();
        numbers.is_some_and(|numbers| numbers.chunk_by(|one, next| one < next).all(|run| run.len() >= 3))
    }

    /// The indices at which outlines begin.
    fn starts(&self, source: Source, ring_columns: &[usize]) -> Result<Vec<usize>> {
        let n = self.points.len();
        if n == 0 {
            return Ok(vec![0]);
        }
        let keys: Vec<&[u32]> = ring_columns.iter().map(|i| &self.others[*i][..]).collect();
        let new_key = |i: &usize| keys.iter().any(|key| key[*i] != key[*i - 1]);
        let inside = |kind: Break| self.breaks.iter().filter(move |(at, one)| *one == kind && (1..n).contains(at));
        let mut starts: Vec<usize> = inside(Break::Missing).map(|(at, _)| *at).chain((1..n).filter(new_key)).collect();
        if keys.is_empty() {
            let mut with_blanks: Vec<usize> =
                inside(Break::Blank).map(|(at, _)| *at).chain(starts.iter().copied()).collect();
            with_blanks.push(0);
            with_blanks.sort_unstable();
            with_blanks.dedup();
            let size = |i: usize| with_blanks.get(i + 1).unwrap_or(&n) - with_blanks[i];
            // Blocks of one or two points are no rings.
            match (0..with_blanks.len()).find(|i| size(*i) < 3) {
                None => starts = with_blanks,
                Some(_) if (0..with_blanks.len()).all(|i| size(i) < 3) => {}
                Some(_) if inside(Break::Blank).next().is_none() => {}
                Some(short) => {
                    let points = count(size(short) as u64, "point");
                    let problem = format!("blank lines separate outlines, and the one that begins here has {points}");
                    let remedy = "remove the blank lines inside an outline, or complete it";
                    return Err(source.refusal(&place(self.lines[with_blanks[short]]), &problem, remedy));
                }
            }
        }
        starts.push(0);
        starts.sort_unstable();
        starts.dedup();
        let mut seen = HashSet::new();
        for start in starts.iter().filter(|_| !keys.is_empty()) {
            let key: Vec<u32> = keys.iter().map(|key| key[*start]).collect();
            // Two rings of one name may follow each other, separated by a row of NaN.
            let continues = *start > 0 && !new_key(start);
            if !seen.insert(key) && !continues {
                let shown: Vec<&str> = keys.iter().map(|key| &*self.words[key[*start] as usize]).collect();
                let problem = format!("the outline `{}` appears again", shortened(&shown.join("/"), SHOWN));
                let remedy = "write the points of an outline one after the other";
                return Err(source.refusal(&place(self.lines[*start]), &problem, remedy));
            }
        }
        Ok(starts)
    }
}

fn place(line: usize) -> String {
    format!("line {line}")
}

/// The reader of lines.
struct Reader<'a> {
    source: Source<'a>,
    table: PointTable,
    /// The places of the words of the table.
    known: HashMap<String, u32>,
}

impl Reader<'_> {
    /// Parses the lines into points; returns the columns, if there is a line.
    fn read(&mut self, bytes: &[u8]) -> Result<Option<Columns>> {
        let mut columns: Option<Columns> = None;
        for (line, content) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
            if content.len() > MAX_LINE {
                let most = text::bytes(MAX_LINE as u64);
                let size = text::bytes(content.len() as u64);
                let size = if size == most { format!("more than {most}") } else { size };
                let remedy = format!("write a point a line, x,y, of at most {most}");
                let problem = format!("a line of {size}");
                return Err(self.source.refusal(&place(line), &problem, &remedy));
            }
            let content = match str::from_utf8(content) {
                Ok(content) => Cow::Borrowed(content),
                Err(_) => {
                    self.table.is_latin = true;
                    Cow::Owned(content.iter().copied().map(char::from).collect())
                }
            };
            // A tab at the beginning follows an empty column.
            let content = content.trim_matches([' ', '\r']);
            if content.trim_start().starts_with('#') {
                continue;
            }
            if content.trim().is_empty() || content.starts_with('>') {
                let kind = if content.starts_with('>') { Break::Missing } else { Break::Blank };
                self.table.breaks.push((self.table.points.len(), kind));
                continue;
            }
            if columns.is_none() {
                let opening = self.opening(line, content)?;
                let is_header = opening.has_header;
                self.table.others = vec![Vec::new(); opening.others.len()];
                columns = Some(opening);
                if is_header {
                    continue;
                }
            }
            let Some(columns) = &columns else { continue };
            self.row(line, content, columns)?;
        }
        Ok(columns)
    }

    /// Adds the point of a line.
    fn row(&mut self, line: usize, content: &str, columns: &Columns) -> Result<()> {
        let fields = columns.separator.split(content);
        let (Some(x), Some(y), false) = (fields.get(columns.x), fields.get(columns.y), fields.len() > columns.count)
        else {
            return Err(self.wrong_count(line, content, fields.len(), columns));
        };
        let table = &mut self.table;
        if is_missing(x) && is_missing(y) {
            table.breaks.push((table.points.len(), Break::Missing));
            return Ok(());
        }
        let since = table.breaks.last().map_or(0, |(at, _)| *at);
        if columns.others.is_empty() && table.points.len() - since == MAX_POINTS {
            self.source.check_number(&Places::lines(), MAX_POINTS + 1)?;
        }
        let point =
            DVec2::new(self.coordinate(line, x, columns, columns.x)?, self.coordinate(line, y, columns, columns.y)?);
        // Other columns may be left out at the end of a row, as spreadsheets do. A ring without a name would be
        // another.
        let is_ring = |(name, at): &&(String, usize)| *at >= fields.len() && is_ring_column(name);
        if let Some((name, _)) = columns.others.iter().find(is_ring) {
            let (found, all) = (fields.len(), columns.count);
            let problem = format!("the number of columns is {found} where the header names {all}: there is no {name}");
            return Err(self.source.refusal(&place(line), &problem, "complete the row"));
        }
        let table = &mut self.table;
        table.points.push(point);
        table.lines.push(line);
        for ((_, column), values) in columns.others.iter().zip(&mut table.others) {
            let word = fields.get(*column).copied().unwrap_or_default().replace("\"\"", "\"");
            let index = self.known.get(&word).copied().unwrap_or_else(|| {
                let index = table.words.len() as u32;
                table.words.push(word.clone());
                self.known.insert(word, index);
                index
            });
            values.push(index);
        }
        Ok(())
    }

    /// The columns of the first line: those that it names, or two if it is a point.
    fn opening(&self, line: usize, content: &str) -> Result<Columns> {
        for separator in Separator::ALL {
            let fields = separator.split(content);
            if let Some(columns) = Columns::named(separator, &fields) {
                return Ok(columns);
            }
            if fields.len() > 1 && fields.iter().all(|field| !Written::of(field, separator).is_word()) {
                return Ok(Columns::unnamed(separator));
            }
        }
        let guess = Separator::ALL.into_iter().find(|separator| content.contains(separator.character()));
        let separator = guess.unwrap_or(Separator::Comma);
        let fields = separator.split(content);
        if fields.iter().any(|field| !Written::of(field, separator).is_word()) {
            return Ok(Columns::unnamed(separator));
        }
        let problem = format!("`{}` names no columns x and y", shortened(&fields.join(","), SHOWN));
        let remedy = "begin with the header x,y or lon,lat, or with a point such as 1.0,0.5";
        Err(self.source.refusal(&place(line), &problem, remedy))
    }

    fn wrong_count(&self, line: usize, content: &str, found: usize, columns: &Columns) -> Error {
        let own = columns.separator;
        let other =
            Separator::ALL.into_iter().find(|other| *other != own && other.split(content).len() == columns.count);
        if let Some(other) = other.filter(|_| found < columns.count) {
            let (shown, found) = (shortened(content, SHOWN), other.name());
            let problem = format!("the columns of `{shown}` are separated by {found}");
            let remedy = format!("separate them by {}, as in the first line", own.name());
            return self.source.refusal(&place(line), &problem, &remedy);
        }
        let expected = match columns.has_header {
            true => format!("the header names {}", columns.count),
            false => "x,y is expected".into(),
        };
        // The first one that nothing was said of.
        let excess = own.split(content).get(columns.count).map(|field| shortened(field, SHOWN));
        let place = match &excess {
            Some(_) => format!("line {line}, column {}", columns.count + 1),
            None => place(line),
        };
        let holds = match &excess {
            Some(field) if !field.is_empty() => format!(" (this one holds `{field}`)"),
            _ => String::new(),
        };
        let problem = format!("the number of columns is {found} where {expected}{holds}");
        let remedy = match own {
            _ if excess.is_some() && columns.has_header => "remove it, or name it in the header",
            Separator::Comma if found == 4 => {
                "name further columns in a header; where commas are decimal, separate by semicolons: 1,5;2,5"
            }
            _ => "separate by commas, and name further columns in a header",
        };
        self.source.refusal(&place, &problem, remedy)
    }

    /// The number in the column at the index `at`.
    fn coordinate(&mut self, line: usize, field: &str, columns: &Columns, at: usize) -> Result<f64> {
        let table = &mut self.table;
        let cell = || {
            let name = match (columns.has_header, at == columns.x, columns.in_degrees) {
                (false, ..) => "",
                (true, true, false) => " (x)",
                (true, false, false) => " (y)",
                (true, true, true) => " (longitude)",
                (true, false, true) => " (latitude)",
            };
            format!("line {line}, column {}{name}", at + 1)
        };
        let value = match Written::of(field, columns.separator) {
            Written::Number(value) => {
                table.has_decimal_points |= field.contains('.');
                value
            }
            Written::Comma(value) => {
                table.has_decimal_commas = true;
                value
            }
            Written::Thousands(value) => {
                table.thousands.get_or_insert_with(|| (line, shortened(field, SHOWN)));
                value
            }
            Written::Word if field.is_empty() => {
                let remedy = "write a number, or leave out both coordinates where another outline begins";
                return Err(self.source.refusal(&cell(), "the cell is empty", remedy));
            }
            Written::Word => {
                let problem = format!("`{}` is not a number", shortened(field, SHOWN));
                return Err(self.source.refusal(&cell(), &problem, "write x,y such as 1.0,0.5"));
            }
        };
        self.source.check_coordinate(cell, value, &shortened(field, SHOWN))?;
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Outline;

    const SQUARE: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];

    fn outline(text: &str) -> Result<Outline> {
        Outline::from_csv(Path::new("shape.csv"), text.as_bytes())
    }

    fn vertices(text: &str) -> Vec<(f64, f64)> {
        let outline = outline(text).unwrap_or_else(|e| panic!("{text:?}: {e}"));
        outline.vertices().iter().map(|p| (p.x, p.y)).collect()
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

    /// The labels of a table's outlines, with their numbers of vertices.
    fn rings(text: &str) -> Vec<(String, usize)> {
        let all = super::super::from_bytes(Path::new("isles.csv"), text.as_bytes());
        let all = all.unwrap_or_else(|e| panic!("{text:?}: {e}"));
        all.into_iter().map(|one| (one.label, one.outline.vertices().len())).collect()
    }

    fn labelled(all: &[(&str, usize)]) -> Vec<(String, usize)> {
        all.iter().map(|(label, n)| ((*label).to_owned(), *n)).collect()
    }

    #[test]
    fn points_are_read_in_order_with_headers_comments_and_other_columns_set_aside() {
        assert_eq!(vertices("0,0\n1,0\n1,1\n0,1\n"), SQUARE);
        assert_eq!(vertices("x,y\n# a square\n\n0,0\r\n1, 0\n 1 ,1\n0,1"), SQUARE);
        assert_eq!(vertices("\u{feff}\"name\",\"Y\",\"X\"\n\"a,b\",0,0\n,0,1\nc,1,1\nd,1,0\n"), SQUARE);
    }

    #[test]
    fn a_line_that_is_no_pair_of_finite_numbers_is_refused_with_its_number_and_value() {
        assert_refused("0,0\n# c\n1,zero\n1,1\n", &["line 3, column 2:", "`zero` is not a number"]);
        assert_refused("0,0\n1,nan\n1,1\n", &["line 2, column 2:", "`nan` is not finite"]);
        assert_refused("inf,0\n1,0\n1,1\n", &["line 1, column 1:", "`inf` is not finite"]);
        assert_refused("0,0\n1e31,0\n1,1\n", &["line 2, column 1:", "`1e31` is too large"]);
        assert_refused("0,0\n1\n1,1\n", &["line 2:", "columns is 1 "]);
        assert_refused(
            "0,0,7\n1,0,7\n1,1,7\n",
            &["line 1, column 3:", "columns is 3 ", "(this one holds `7`)", "header"],
        );
        assert_refused("x,y\n0,0\n1\n", &["line 3:", "columns is 1 "]);
        assert_refused(
            "x,y\n0,0\n1,0,9\n1,1\n",
            &["line 3, column 3: ", "columns is 3 where the header names 2 (this one holds `9`); remove it"],
        );
        assert_refused("u,v\n0,0\n1,0\n1,1\n", &["line 1:", "`u,v` names no columns x and y"]);
        assert_refused("lon,y\n0,0\n1,0\n1,1\n", &["line 1:", "`lon,y` names no columns x and y; begin with"]);
        assert_refused("x,y\nx,y\n0,0\n", &["line 2, column 1 (x):", "`x` is not a number"]);
    }

    #[test]
    fn every_separator_is_found_with_and_without_a_header() {
        for text in [
            "0;0\n1;0\n1;1\n0;1\n",
            "X;Y\r\n0;0\r\n1;0\r\n1;1\r\n0;1\r\n",
            "0\t0\n1\t0\n1\t1\n0\t1",
            "\tx\ty\n0\t0\t0\n1\t1\t0\n2\t1\t1\n3\t0\t1\n",
            "0 0\n1 0\n1 1\n0 1\n",
            "  x    y\n  0    0\n  1    0\n  1    1\n  0    1\n",
            "\"y\" \"x\"\n0 0\n0 1\n1 1\n1 0\n",
            "0.0e0, 0\n1, 0\n1, 1\n0, 1\n",
            "0 ,0\n1 ,0\n1 ,1\n0 ,1\n",
            "\"a;b\";\"x\";\"y\"\n\"p;q\";0;0\n;1;0\n;1;1\n;0;1\n",
        ] {
            assert_eq!(vertices(text), SQUARE, "{text:?}");
        }
        assert_refused(
            "0,0\n1,0\n1 1\n",
            &["line 3: the columns of `1 1` are separated by spaces; separate them by commas"],
        );
        assert_refused("x;y\n0;0\n1\t0\n", &["line 3:", r"`1\t0` are separated by tabs; separate them by semicolons"]);
        assert_refused("0, 0, 0\n1, 0, 0\n", &["columns is 3"]);
    }

    #[test]
    fn a_decimal_comma_is_read_where_commas_do_not_separate() {
        let triangle = [(0.0, -0.5), (1.5, 0.25), (0.0, 1.0)];
        for text in ["0;-0,5\n1,5;0,25\n0;1\n", "0\t-0,5\n1,5\t0,25\n0\t1,0\n", "x y\n0,0 -0,5\n1,5 2,5e-1\n0 1\n"] {
            assert_eq!(vertices(text), triangle, "{text:?}");
        }
        assert_refused(
            "1,5,2,5\n1,5,3,5\n2,5,3,5\n",
            &["line 1, column 3:", "columns is 4 ", "separate by semicolons: 1,5;2,5"],
        );
        // Three digits after every comma: 1.234 or 1234.
        let threes = "0;0\n1,234;0\n1,234;5,678\n";
        assert_refused(
            threes,
            &["line 2: the comma of `1,234` may be a decimal comma or one between thousands; write"],
        );
        assert_eq!(vertices("0;0\n1,234;0\n1,234;0,5\n")[1], (1.234, 0.0));
        assert_refused("0;0.5\n1,234;0\n1,234;1,5\n", &["line 2: the comma of `1,234`"]);
        assert_refused("0;0\n1,234,567;0\n1;1\n", &["line 2, column 1: `1,234,567` is not a number"]);
        assert_refused("0;0\n1,234.5;0\n1;1\n", &["line 2, column 1: `1,234.5` is not a number"]);
        assert_refused("x;y\n0;0\n1,;0\n1;1\n", &["line 3, column 1 (x): `1,` is not a number"]);
    }

    #[test]
    fn rings_are_separated_by_blank_lines_or_rows_of_nan_or_segment_headers_and_never_joined() {
        let expected = labelled(&[("isles/1", 3), ("isles/2", 4)]);
        let square = "5,5\n6,5\n6,6\n5,6\n";
        for separator in [
            "\n",
            "\n\n\n",
            "nan,nan\n",
            "NaN,NaN\nNA,NA\n",
            ",\n",
            "\nNaN,NaN\n",
            "> segment 2\n",
            " \r\n",
            "\n# more\n",
        ] {
            for head in ["", "x,y\n", "# a file\n\n"] {
                let text = format!("{head}0,0\n1,0\n0,1\n0,0\n{separator}{square}");
                assert_eq!(rings(&text), expected, "{text:?}");
                assert_eq!(rings(&format!("{text}{separator}")), expected, "{text:?}");
                assert_refused(&text, &["the file holds 2 outlines where one is expected; save the one that is meant"]);
            }
        }
        // A row that is only half missing separates nothing.
        assert_refused("0,0\n1,0\n,1\n0,1\n", &["line 3, column 1: the cell is empty; write a number"]);
    }

    #[test]
    fn blank_lines_are_skipped_where_they_separate_no_outlines() {
        assert_eq!(vertices("0,0\n\n1,0\n\n1,1\n\n0,1\n"), SQUARE);
        assert_eq!(vertices("0,0\n1,0\n\n1,1\n0,1\n"), SQUARE);
        assert_eq!(vertices("\n\n0,0\n1,0\n1,1\n0,1\n\n\n"), SQUARE);
        let problem = "line 6: blank lines separate outlines, and the one that begins here has 2 points; remove";
        assert_refused("0,0\n2,0\n2,2\n1,3\n\n0,2\n0,1\n", &[problem]);
    }

    #[test]
    fn a_column_of_rings_names_them_and_constant_columns_are_their_properties() {
        let text = "Ring,x,kind,y,z\nA,0,atoll,0,1\nA,1,atoll,0,2\nA,0,atoll,1,3\n\nB,0,,0,5\nB,2,,0,5\nB,0,,2,5\n";
        let all = super::super::from_bytes(Path::new("isles.csv"), text.as_bytes()).unwrap();
        let labels: Vec<_> = all.iter().map(|one| &*one.label).collect();
        assert_eq!(labels, ["A", "B"]);
        let property = |i: usize, name: &str| all[i].properties.get(name).map(String::as_str);
        assert_eq!([property(0, "kind"), property(0, "z"), property(0, "Ring")], [Some("atoll"), None, Some("A")]);
        assert_eq!([property(1, "kind"), property(1, "z")], [Some(""), Some("5")]);
        // Two columns together; a column that numbers the points names nothing.
        let both = "id\tpart\tx\ty\n7\t1\t0\t0\n7\t1\t1\t0\n7\t1\t0\t1\n7\t2\t0\t0\n7\t2\t1\t0\n7\t2\t0\t1\n";
        assert_eq!(rings(both), labelled(&[("7/1", 3), ("7/2", 3)]));
        assert_eq!(rings("id,x,y\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n"), labelled(&[("isles", 4)]));
        assert_refused("ring,x,y\n", &["the file holds no points"]);
        let again = "ring,x,y\nA,0,0\nA,1,0\nB,0,0\nB,1,0\nB,0,1\nA,0,1\n";
        assert_refused(again, &["line 7: the outline `A` appears again; write the points"]);
        let short = "ring,x,y\nA,0,0\nA,1,0\nA,1,1\nB,0,0\nB,1,0\n";
        assert_refused(short, &["outline 2 (`B`): it holds 2 distinct points", "(1 of 2 outlines is refused)"]);
    }

    #[test]
    fn columns_of_longitude_and_latitude_are_projected_to_kilometres() {
        for header in ["lon,lat", "Longitude,LATITUDE", "\"long\",\"lat\"", "lng,lat"] {
            let square = outline(&format!("{header}\n10,0\n10.01,0\n10.01,0.01\n10,0.01\n")).unwrap();
            let side = 6371.0072 * 0.01_f64.to_radians();
            let length = square.vertices()[0].distance(square.vertices()[1]);
            assert!((length / side - 1.0).abs() < 1e-6, "{length} {side}");
            let stated = "shape.csv: lon,lat projected to kilometres by Lambert's azimuthal equal-area projection about \
                          (10.005, 0.005)";
            assert_eq!(square.warnings(), [stated]);
            assert!(square.is_simple());
        }
        let both = "x,y,lon,lat\n0,0,9,9\n1,0,9,9\n1,1,9,9\n0,1,9,9\n";
        assert_eq!(vertices(both), SQUARE);
        assert_eq!(outline(both).unwrap().warnings(), [format!("shape.csv: {X_AND_Y}")]);
        assert_refused("lat,lon\n100,0\n0,1\n1,1\n", &["line 2: (0.0, 100.0) is not a longitude and a latitude"]);
    }

    #[test]
    fn an_overlong_line_is_refused_before_it_is_split_into_columns() {
        let long = |columns: usize| format!("x,y{}\n0,0\n1,0\n1,1\n", ",".repeat(columns));
        assert_eq!(vertices(&long(MAX_LINE - 3)).len(), 3);
        assert_refused(&long(MAX_LINE - 2), &["line 1: a line of more than 64 KB; ", "x,y, of at most 64 KB"]);
        assert_refused(&format!("0,0\n{}", " ".repeat(1 << 20)), &["line 2: a line of 1 MB"]);
    }

    #[test]
    fn other_columns_may_be_in_any_encoding() {
        let latin = b"x,y,name\n0,0,Cura\xe7ao\n1,0,\n1,1,\xff\n";
        assert_eq!(Outline::from_csv(Path::new("shape.csv"), latin).unwrap().vertices().len(), 3);
    }
}
