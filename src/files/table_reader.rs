//! Reads tables row by row. Nothing is trusted: anything that this program would not have written is refused, with
//! file, line and column, the expected and the actual content.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    marker::PhantomData,
    path::PathBuf,
};

use csv::{ReaderBuilder, StringRecord};

use super::{
    column::TableRow,
    fields::{Fields, number_of},
    names::REMEDY,
    place::Place,
};
use crate::{
    error::{Error, Result},
    input::{self, Lines},
};

/// A table with the columns of `R`, read row by row.
pub struct TableReader<R> {
    path: PathBuf,
    names: Vec<&'static str>,
    reader: csv::Reader<Lines<File>>,
    line: StringRecord,
    kind: PhantomData<fn() -> R>,
}

impl<R: TableRow + Default> TableReader<R> {
    /// Opens the table at `place`, and reads its header.
    ///
    /// # Errors
    /// [`Error::Request`] if it does not exist, has other columns, or is truncated.
    pub fn open(place: &Place) -> Result<TableReader<R>> {
        let path = place.shown().to_path_buf();
        let file = input::open(place.at()).and_then(|mut file| Ok((ends_with_a_line(&mut file)?, file)));
        let (whole, file) =
            file.map_err(|e| Error::Request(format!("cannot read {}: {e}; {REMEDY}", path.display())))?;
        if !whole {
            let problem = "expected an end of line, found the end of the file: it was cut off";
            return Err(Error::Request(format!("{}: {problem}; {REMEDY}", path.display())));
        }
        // Rows are checked here, where messages can say more.
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

    /// Returns the next row, and its fields for further checks.
    ///
    /// # Errors
    /// [`Error::Request`] for a field that does not fit its column.
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
        Ok(some.then(|| Fields::new(path, names, line)))
    }
}

/// Returns whether the file ends with a line break, and rewinds it.
fn ends_with_a_line(file: &mut File) -> std::io::Result<bool> {
    let mut last = [0];
    if file.metadata()?.len() > 0 {
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
        file.rewind()?;
    }
    Ok(last == *b"\n")
}
