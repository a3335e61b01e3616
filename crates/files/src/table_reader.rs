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
    names::{REMEDY, spoilt},
    place::Place,
};
use curvelax_base::{
    error::{Error, Result},
    input::{self, Lines},
};

/// A table with the columns of `R`, read row by row.
pub struct TableReader<R> {
    lines: LineReader,
    kind: PhantomData<fn() -> R>,
}

impl<R: TableRow + Default> TableReader<R> {
    /// Opens the table at `place`, and reads its header.
    ///
    /// # Errors
    /// [`Error::Request`] if it does not exist, has other columns, or is truncated.
    pub fn open(place: &Place) -> Result<TableReader<R>> {
        let names = R::COLUMNS.iter().map(|column| column.name.into()).collect();
        Ok(TableReader { lines: LineReader::open(place, names)?, kind: PhantomData })
    }

    /// Returns the next row, and its fields for further checks.
    ///
    /// # Errors
    /// [`Error::Request`] for a field that does not fit its column.
    pub fn read(&mut self) -> Result<Option<(R, Fields<'_>)>> {
        let Some(mut fields) = self.lines.fields()? else { return Ok(None) };
        let mut record = R::default();
        for column in R::COLUMNS {
            (column.read)(&mut record, &mut fields)?;
        }
        Ok(Some((record, fields)))
    }
}

/// A table with given headings, read line by line.
pub(super) struct LineReader {
    path: PathBuf,
    names: Vec<String>,
    reader: csv::Reader<Lines<File>>,
    line: StringRecord,
}

impl LineReader {
    /// Opens the table at `place`, and reads its header.
    ///
    /// # Errors
    /// [`Error::Request`] if it does not exist, has other headings than `names`, or is truncated.
    pub fn open(place: &Place, names: Vec<String>) -> Result<LineReader> {
        let path = place.shown().to_path_buf();
        let file = input::open(place.at()).and_then(|mut file| Ok((line_cut_off(&mut file)?, file)));
        let (cut_off, file) =
            file.map_err(|e| Error::Request(format!("cannot read {}: {e}; {REMEDY}", path.display())))?;
        if let Some(line) = cut_off {
            let problem = "expected an end of line, found the end of the file: it was cut off";
            return Err(spoilt(&path, &format!("line {line}"), problem));
        }
        // Rows are checked here, where messages can say more.
        let reader = ReaderBuilder::new().has_headers(false).flexible(true).from_reader(Lines::new(file));
        let expected = names.clone();
        let mut table = LineReader { path, names, reader, line: StringRecord::new() };
        if let Some(mut fields) = table.fields()? {
            for name in expected {
                if fields.word() != name {
                    return Err(fields.unexpected(&format!("the heading `{name}`")));
                }
            }
        }
        Ok(table)
    }

    /// The fields of the next line, as many as there are columns.
    pub fn fields(&mut self) -> Result<Option<Fields<'_>>> {
        let LineReader { path, names, reader, line } = self;
        let some = reader.read_record(line).map_err(|e| {
            let problem = match e.kind() {
                csv::ErrorKind::Utf8 { .. } => "not UTF-8: save it as UTF-8".into(),
                _ => e.to_string(),
            };
            // The reader may fail at a line that it has not begun.
            let number = e.position().unwrap_or(reader.position()).line();
            spoilt(path, &format!("line {number}"), &problem)
        })?;
        let (expected, found) = (names.len(), line.len());
        if some && found != expected {
            let problem = format!("expected {expected} fields, found {found}");
            return Err(spoilt(path, &format!("line {}", number_of(line)), &problem));
        }
        Ok(some.then(|| Fields::new(path, names, line)))
    }
}

/// Returns the number of the last line if no line break ends it, and rewinds the file.
fn line_cut_off(file: &mut File) -> std::io::Result<Option<u64>> {
    let mut last = [0];
    if file.metadata()?.len() > 0 {
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
        file.rewind()?;
    }
    if last == *b"\n" {
        return Ok(None);
    }
    let (mut line, mut block) = (1, vec![0; 1 << 16]);
    loop {
        match file.read(&mut block)? {
            0 => break,
            count => line += block[..count].iter().filter(|byte| **byte == b'\n').count() as u64,
        }
    }
    file.rewind()?;
    Ok(Some(line))
}
