//! The fields of a line of a table: taken from left to right, checked, refused by line and column.

use std::{path::Path, str::FromStr};

use csv::StringRecord;

use super::names::{SHOWN, spoilt};
use curvelax_base::error::{Error, Result, shortened};

/// The fields of a line, read from left to right.
pub struct Fields<'a> {
    path: &'a Path,
    names: &'a [String],
    line: &'a StringRecord,
    taken: usize,
}

impl<'a> Fields<'a> {
    /// The fields of `line` in the file at `path`, under these headings.
    pub(super) fn new(path: &'a Path, names: &'a [String], line: &'a StringRecord) -> Fields<'a> {
        Fields { path, names, line, taken: 0 }
    }
}

impl Fields<'_> {
    /// The next field, as a word.
    pub fn word(&mut self) -> &str {
        self.taken += 1;
        &self.line[self.taken - 1]
    }

    /// A whole number.
    pub fn whole<T: FromStr>(&mut self) -> Result<T> {
        let value = self.word().parse();
        value.map_err(|_| self.unexpected("a whole number"))
    }

    /// A whole number; none if unknown.
    pub fn whole_or_none<T: FromStr>(&mut self) -> Result<Option<T>> {
        self.or_none("a whole number", |word| word.parse().ok())
    }

    /// `true` or `false`; none if unknown.
    pub fn truth_or_none(&mut self) -> Result<Option<bool>> {
        self.or_none("true, false", |word| word.parse().ok())
    }

    /// One of these values, by its name.
    pub fn one_of<T: Copy, const N: usize>(&mut self, all: [T; N], name: impl Fn(T) -> &'static str) -> Result<T> {
        let word = self.word();
        let value = all.into_iter().find(|value| name(*value) == word);
        value.ok_or_else(|| self.unexpected(&all.map(name).join(", ")))
    }

    /// A float; none if unknown.
    pub fn number(&mut self) -> Result<Option<f64>> {
        self.or_none("a number", |word| word.parse().ok().filter(|value: &f64| value.is_finite()))
    }

    /// A value that `parse` makes of a word; none if unknown.
    fn or_none<T>(&mut self, expected: &str, parse: impl Fn(&str) -> Option<T>) -> Result<Option<T>> {
        match self.word() {
            "" => Ok(None),
            word => match parse(word) {
                None => Err(self.unexpected(&format!("{expected} or nothing"))),
                known => Ok(known),
            },
        }
    }

    /// A float; NaN if unknown.
    pub fn known(&mut self) -> Result<f64> {
        Ok(self.number()?.unwrap_or(f64::NAN))
    }

    /// A time that may be unknown.
    pub fn event(&mut self) -> Result<Option<f64>> {
        match self.number()? {
            Some(t) if t < 0.0 => Err(self.unexpected("a time or nothing")),
            t => Ok(t),
        }
    }

    /// A time.
    pub fn time(&mut self) -> Result<f64> {
        self.event()?.ok_or_else(|| self.unexpected("a time"))
    }

    /// The error that the last field read is not what was expected.
    pub fn unexpected(&self, expected: &str) -> Error {
        self.refused(self.taken - 1, expected)
    }

    /// The error that the field of the column `name` is not what was expected.
    pub fn unexpected_in(&self, name: &str, expected: &str) -> Error {
        self.refused(self.names.iter().position(|own| own == name).unwrap_or(0), expected)
    }

    fn refused(&self, field: usize, expected: &str) -> Error {
        let (line, column, found) = (number_of(self.line), &self.names[field], shortened(&self.line[field], SHOWN));
        spoilt(self.path, &format!("line {line}, column {column}"), &format!("expected {expected}, found `{found}`"))
    }
}

/// The number of a line in its file.
pub(super) fn number_of(line: &StringRecord) -> u64 {
    line.position().map_or(0, csv::Position::line)
}
