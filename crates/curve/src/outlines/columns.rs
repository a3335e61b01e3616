//! The columns of a table of points: what separates them, what is written in them, and which are the coordinates.

use super::piece::property;

/// Names of the column of a ring; they are compared without regard to case.
const RING_COLUMNS: [&str; 4] = ["ring", "id", "part", "label"];

pub(super) fn is_ring_column(name: &str) -> bool {
    RING_COLUMNS.iter().any(|ring| name.eq_ignore_ascii_case(ring))
}

/// What separates columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Separator {
    #[default]
    Comma,
    Semicolon,
    Tab,
    Spaces,
}

impl Separator {
    pub(super) const ALL: [Separator; 4] = [Separator::Comma, Separator::Semicolon, Separator::Tab, Separator::Spaces];

    pub(super) fn character(self) -> char {
        match self {
            Separator::Comma => ',',
            Separator::Semicolon => ';',
            Separator::Tab => '\t',
            Separator::Spaces => ' ',
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Separator::Comma => "commas",
            Separator::Semicolon => "semicolons",
            Separator::Tab => "tabs",
            Separator::Spaces => "spaces",
        }
    }

    /// Splits a line into fields, trimmed, without quotes; a separator inside quotes does not separate.
    pub(super) fn split(self, line: &str) -> Vec<&str> {
        let mut quoted = false;
        let separates = |c: char| {
            quoted ^= c == '"';
            c == self.character() && !quoted
        };
        let fields = line.split(separates).map(|field| without_quotes(field).trim());
        match self {
            // Columns may be aligned by several.
            Separator::Spaces => line.split_whitespace().map(without_quotes).collect(),
            _ => fields.collect(),
        }
    }
}

/// A field without the quotes around it; those inside are still doubled.
fn without_quotes(field: &str) -> &str {
    let field = field.trim();
    field.strip_prefix('"').and_then(|field| field.strip_suffix('"')).unwrap_or(field)
}

/// A number as it is written.
pub(super) enum Written {
    Number(f64),
    /// A number with a decimal comma.
    Comma(f64),
    /// A number in which a comma may also be one between thousands: `1,234`.
    Thousands(f64),
    Word,
}

impl Written {
    pub(super) fn of(field: &str, separator: Separator) -> Written {
        if let Ok(value) = field.parse() {
            return Written::Number(value);
        }
        let Some((whole, rest)) = field.split_once(',').filter(|_| separator != Separator::Comma) else {
            return Written::Word;
        };
        let digit = |c: char| c.is_ascii_digit();
        if !(whole.ends_with(digit) && rest.starts_with(digit)) || whole.contains('.') || rest.contains(['.', ',']) {
            return Written::Word;
        }
        let Ok(value) = format!("{whole}.{rest}").parse() else { return Written::Word };
        let whole = whole.trim_start_matches(['+', '-']);
        let in_threes = rest.len() == 3 && rest.chars().all(digit) && whole.len() <= 3 && !whole.starts_with('0');
        if in_threes { Written::Thousands(value) } else { Written::Comma(value) }
    }

    pub(super) fn is_word(&self) -> bool {
        matches!(self, Written::Word)
    }
}

/// Whether a field stands for a missing number.
pub(super) fn is_missing(field: &str) -> bool {
    field.is_empty() || field.eq_ignore_ascii_case("nan") || field.eq_ignore_ascii_case("na")
}

/// The columns, from 0, of the coordinates.
#[derive(Clone, Default)]
pub(super) struct Columns {
    pub(super) separator: Separator,
    pub(super) x: usize,
    pub(super) y: usize,
    /// Columns named by the header; without one there are two.
    pub(super) count: usize,
    pub(super) in_degrees: bool,
    /// There are coordinates of both kinds.
    pub(super) has_both: bool,
    /// The names and numbers of the other columns of a header.
    pub(super) others: Vec<(String, usize)>,
    pub(super) has_header: bool,
}

impl Columns {
    pub(super) fn unnamed(separator: Separator) -> Columns {
        Columns { separator, y: 1, count: 2, ..Columns::default() }
    }

    /// The columns of a header; `None` if it does not name the coordinates.
    pub(super) fn named(separator: Separator, fields: &[&str]) -> Option<Columns> {
        let column =
            |names: &[&str]| fields.iter().position(|field| names.iter().any(|n| field.eq_ignore_ascii_case(n)));
        let plane = column(&["x"]).zip(column(&["y"]));
        let degrees = column(&["lon", "long", "lng", "longitude"]).zip(column(&["lat", "latitude"]));
        let (x, y) = plane.or(degrees)?;
        let others = (0..fields.len()).filter(|i| ![x, y].contains(i)).map(|i| (property(fields[i]), i)).collect();
        let (in_degrees, has_both) = (plane.is_none(), plane.is_some() && degrees.is_some());
        Some(Columns { separator, x, y, count: fields.len(), in_degrees, has_both, others, has_header: true })
    }
}
