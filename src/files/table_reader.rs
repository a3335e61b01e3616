//! Tables read back, row by row. Nothing is taken on trust: whatever this program would not have written is refused, with
//! file, line and column, what was expected there and what was found.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    marker::PhantomData,
    path::{Path, PathBuf},
    str::FromStr,
};

use csv::{ReaderBuilder, StringRecord};

use super::{column::Record, names::REMEDY, place::Place};
use crate::{
    ensemble::Status,
    error::{Error, Result, shortened},
    input::{self, Lines},
};

/// Characters of foreign text in a message.
const SHOWN: usize = 200;

/// A table with the columns of `R`, read row by row.
pub struct TableReader<R> {
    path: PathBuf,
    names: Vec<&'static str>,
    reader: csv::Reader<Lines<File>>,
    line: StringRecord,
    kind: PhantomData<fn() -> R>,
}

impl<R: Record + Default> TableReader<R> {
    /// Opens the table at `place`, and reads its header.
    ///
    /// # Errors
    /// [`Error::Request`] where there is none, or one with other columns, or one that is cut off.
    pub fn open(place: &Place) -> Result<TableReader<R>> {
        let path = place.shown().to_path_buf();
        let file = input::open(place.at()).and_then(|mut file| Ok((ends_with_a_line(&mut file)?, file)));
        let (whole, file) =
            file.map_err(|e| Error::Request(format!("cannot read {}: {e}; {REMEDY}", path.display())))?;
        if !whole {
            let problem = "expected an end of line, found the end of the file: it was cut off";
            return Err(Error::Request(format!("{}: {problem}; {REMEDY}", path.display())));
        }
        // Rows are checked here, where more can be said about them.
        let reader =
            ReaderBuilder::new().has_headers(false).flexible(true).quoting(false).from_reader(Lines::new(file));
        let names = R::COLUMNS.iter().map(|column| column.name).collect();
        let mut table = TableReader { path, names, reader, line: StringRecord::new(), kind: PhantomData };
        if let Some(mut fields) = table.fields()? {
            for column in R::COLUMNS {
                if fields.word() != column.name {
                    return Err(fields.unexpected(&format!("the heading `{}`", column.name)));
                }
            }
        }
        Ok(table)
    }

    /// The next row, and its fields for what else may be wrong with them.
    ///
    /// # Errors
    /// [`Error::Request`] for a field that holds something else than its column.
    pub fn read(&mut self) -> Result<Option<(R, Fields<'_>)>> {
        let Some(mut fields) = self.fields()? else { return Ok(None) };
        let mut record = R::default();
        for column in R::COLUMNS {
            (column.read)(&mut record, &mut fields)?;
        }
        Ok(Some((record, fields)))
    }

    /// The fields of the next line, as many as there are columns.
    fn fields(&mut self) -> Result<Option<Fields<'_>>> {
        let TableReader { path, names, reader, line, .. } = self;
        let some =
            reader.read_record(line).map_err(|e| Error::Request(format!("{}: {e}; {REMEDY}", path.display())))?;
        let (expected, found) = (names.len(), line.len());
        if some && found != expected {
            let problem = format!("line {}: expected {expected} fields, found {found}", number_of(line));
            return Err(Error::Request(format!("{}, {problem}; {REMEDY}", path.display())));
        }
        Ok(some.then_some(Fields { path, names, line, taken: 0 }))
    }
}

/// The fields of a line, taken from left to right.
pub struct Fields<'a> {
    path: &'a Path,
    names: &'a [&'static str],
    line: &'a StringRecord,
    taken: usize,
}

impl Fields<'_> {
    /// The next one.
    pub fn word(&mut self) -> &str {
        self.taken += 1;
        &self.line[self.taken - 1]
    }

    /// A whole number.
    pub fn whole<T: FromStr>(&mut self) -> Result<T> {
        let value = self.word().parse();
        value.map_err(|_| self.unexpected("a whole number"))
    }

    /// The name of a status.
    pub fn status(&mut self) -> Result<Status> {
        let word = self.word();
        let status = Status::ALL.into_iter().find(|status| status.name() == word);
        status.ok_or_else(|| self.unexpected(&Status::ALL.map(Status::name).join(", ")))
    }

    /// A float; none if it is unknown.
    pub fn number(&mut self) -> Result<Option<f64>> {
        match self.word() {
            "" => Ok(None),
            word => match word.parse().ok().filter(|value: &f64| value.is_finite()) {
                None => Err(self.unexpected("a number or nothing")),
                known => Ok(known),
            },
        }
    }

    /// A float; not a number if it is unknown.
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

    /// That the field taken last is not what was expected.
    pub fn unexpected(&self, expected: &str) -> Error {
        self.refused(self.taken - 1, expected)
    }

    /// That the field of the column `name` is not what was expected.
    pub fn unexpected_in(&self, name: &str, expected: &str) -> Error {
        self.refused(self.names.iter().position(|own| *own == name).unwrap_or(0), expected)
    }

    fn refused(&self, field: usize, expected: &str) -> Error {
        Error::Request(format!(
            "{}, line {}, column {}: expected {expected}, found `{}`; {REMEDY}",
            self.path.display(),
            number_of(self.line),
            self.names[field],
            shortened(&self.line[field], SHOWN)
        ))
    }
}

fn number_of(line: &StringRecord) -> u64 {
    line.position().map_or(0, csv::Position::line)
}

/// Whether the file is complete as far as its last byte tells; it is then read from its start.
fn ends_with_a_line(file: &mut File) -> std::io::Result<bool> {
    let mut last = [0];
    if file.metadata()?.len() > 0 {
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
        file.rewind()?;
    }
    Ok(last == *b"\n")
}
