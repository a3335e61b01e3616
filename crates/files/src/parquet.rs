//! The tables as Parquet, for programs that read columns and their types: made from the CSV files when they are
//! complete, so that every row has one writer.
//!
//! Integers are `INT64` and floats `DOUBLE`, both null where the CSV field is empty; words are strings, never null.
//! Equal tables give equal bytes.

use std::{io, sync::Arc};

use parquet::{
    basic::{Compression, LogicalType, Repetition, Type as Physical},
    data_type::{BoolType, ByteArrayType, DataType, DoubleType, Int64Type},
    errors::ParquetError,
    file::{
        properties::{EnabledStatistics, WriterProperties},
        writer::{SerializedColumnWriter, SerializedFileWriter},
    },
    schema::types::{Type, TypePtr},
};

use super::{columns::ColumnText, fields::Fields, part_file::PartFile, place::Place, table_reader::LineReader};
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Spec, request::sweep::SweepAxis};

type ParquetResult<T> = std::result::Result<T, ParquetError>;

/// Fields of a row group, which is in memory as a whole.
const GROUP: usize = 1 << 19;

/// Writes the complete table at `csv`, whose columns are `columns`, as Parquet into `file`, ready for its final name.
///
/// # Errors
/// If a field is not what its column holds, or the file cannot be written.
pub fn write(csv: &Place, columns: &[ColumnText], spec: &Spec, file: PartFile) -> Result<PartFile> {
    write_groups(csv, columns, spec, file, GROUP)
}

/// Does so with at most so many fields in a row group, but at least one row.
fn write_groups(csv: &Place, columns: &[ColumnText], spec: &Spec, file: PartFile, most: usize) -> Result<PartFile> {
    let target = file.target().to_path_buf();
    let failed = |e: ParquetError| Error::io("cannot write", &target)(cause(e));
    let mut lines = LineReader::open(csv, columns.iter().map(|[name, ..]| name.clone()).collect())?;
    let mut fields: Vec<_> = columns.iter().map(|[name, holds, _]| column(name, holds, spec)).collect();
    let described = columns.iter().zip(&fields).map(|([name, ..], column)| column.described(name));
    let described = described.collect::<ParquetResult<_>>().map_err(failed)?;
    let schema = Type::group_type_builder("table").with_fields(described).build().map_err(failed)?;
    let properties = WriterProperties::builder()
        .set_created_by(format!("curvelax {}", env!("CARGO_PKG_VERSION")))
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk);
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties.build())).map_err(failed)?;
    let most = (most / fields.len().max(1)).max(1);
    loop {
        let mut rows = 0;
        while rows < most
            && let Some(mut line) = lines.fields()?
        {
            fields.iter_mut().try_for_each(|column| column.read(&mut line))?;
            rows += 1;
        }
        if rows == 0 {
            break;
        }
        add_group(&mut writer, &mut fields).map_err(failed)?;
    }
    let file = writer.into_inner().map_err(failed)?;
    file.sync()?;
    Ok(file)
}

fn add_group(writer: &mut SerializedFileWriter<PartFile>, fields: &mut [Box<dyn FieldColumn>]) -> ParquetResult<()> {
    let mut group = writer.next_row_group()?;
    for column in fields {
        if let Some(mut own) = group.next_column()? {
            column.write(&mut own)?;
            own.close()?;
        }
    }
    group.close().map(drop)
}

/// The cause of a failed write, if the system said it.
fn cause(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(e) => e.downcast::<io::Error>().map_or_else(io::Error::other, |e| *e),
        other => io::Error::other(other),
    }
}

/// The fields of a column in a row group.
trait FieldColumn {
    /// Its description.
    fn described(&self, name: &str) -> ParquetResult<TypePtr>;

    /// Reads the next field of a line.
    fn read(&mut self, line: &mut Fields<'_>) -> Result<()>;

    /// Writes the fields, and is empty then.
    fn write(&mut self, column: &mut SerializedColumnWriter<'_>) -> ParquetResult<()>;
}

/// Those of one type.
struct TypedColumn<T: DataType> {
    next: fn(&mut Fields<'_>) -> Result<Option<T::T>>,
    /// Those that are known.
    values: Vec<T::T>,
    /// For each row, 1 if its field is known.
    known: Vec<i16>,
}

impl<T: DataType> TypedColumn<T> {
    fn boxed(next: fn(&mut Fields<'_>) -> Result<Option<T::T>>) -> Box<dyn FieldColumn> {
        Box::new(TypedColumn::<T> { next, values: Vec::new(), known: Vec::new() })
    }

    /// Whether it holds words, which are always known.
    fn has_words() -> bool {
        T::get_physical_type() == Physical::BYTE_ARRAY
    }
}

impl<T: DataType> FieldColumn for TypedColumn<T> {
    fn described(&self, name: &str) -> ParquetResult<TypePtr> {
        let (logical, repetition) = match Self::has_words() {
            true => (Some(LogicalType::String), Repetition::REQUIRED),
            false => (None, Repetition::OPTIONAL),
        };
        let column = Type::primitive_type_builder(name, T::get_physical_type());
        column.with_logical_type(logical).with_repetition(repetition).build().map(Arc::new)
    }

    fn read(&mut self, line: &mut Fields<'_>) -> Result<()> {
        let value = (self.next)(line)?;
        self.known.push(i16::from(value.is_some()));
        self.values.extend(value);
        Ok(())
    }

    fn write(&mut self, column: &mut SerializedColumnWriter<'_>) -> ParquetResult<()> {
        let known = Some(&self.known[..]).filter(|_| !Self::has_words());
        column.typed::<T>().write_batch(&self.values, known, None)?;
        self.values.clear();
        self.known.clear();
        Ok(())
    }
}

/// An empty column of the type that its description `holds`, or that the swept values of `name` have.
fn column(name: &str, holds: &str, spec: &Spec) -> Box<dyn FieldColumn> {
    let axis = spec.sweep.axes().iter().find(|axis| axis.key == name);
    match axis.filter(|_| holds == "swept value").map_or(holds, |axis| held_by(axis)) {
        "integer" => TypedColumn::<Int64Type>::boxed(|line| line.whole_or_none()),
        "float" => TypedColumn::<DoubleType>::boxed(|line| line.number()),
        "truth" => TypedColumn::<BoolType>::boxed(|line| line.truth_or_none()),
        _ => TypedColumn::<ByteArrayType>::boxed(|line| Ok(Some(line.word().as_bytes().to_vec().into()))),
    }
}

/// What the values of a swept key are: numbers if all of them are, and integers if all are written as such.
fn held_by(axis: &SweepAxis) -> &'static str {
    let labels = axis.labels();
    let all = |is: fn(&str) -> bool| labels.iter().all(|label| is(label));
    match axis.numbers() {
        Some(_) if all(|label| label.parse::<i64>().is_ok()) => "integer",
        Some(_) => "float",
        None if all(|label| label.parse::<bool>().is_ok()) => "truth",
        None => "word",
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use parquet::{
        file::reader::{FileReader, SerializedFileReader},
        record::Field,
    };

    use super::*;
    use crate::OutputFolder;

    const TABLE: &str = "cell,amplitude,points,mark,flow,t,label,turning\n\
                         0,0.1,40,true,willmore,0.30000000000000004,NA,-1\n\
                         1,1e-12,50,false,\"poly:1,2\",,,2\n\
                         2,2.0,60,true,Ševčovič,5e-324,\"a \"\"b\"\"\",0\n";

    fn columns() -> Vec<ColumnText> {
        let swept = ["amplitude", "points", "mark", "flow"].map(|name| (name, "swept value"));
        let own = [("t", "float"), ("label", "word"), ("turning", "integer")];
        let all = [&[("cell", "integer")][..], &swept, &own].concat();
        all.into_iter().map(|(name, holds)| [name, holds, ""].map(str::to_owned)).collect()
    }

    fn spec() -> Spec {
        let mut spec = Spec::default();
        for axis in ["amplitude=0.1,1e-12,2.0", "points=40,50,60", "mark=true,false", "flow=willmore;poly:1,2"] {
            spec.sweep.set(axis.parse().unwrap());
        }
        spec
    }

    /// The bytes of a table, with so many fields in a row group.
    fn written(text: &str, most: usize) -> Result<Vec<u8>> {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(&home.path().join("out"), true).unwrap();
        let csv = folder.write("ensemble.csv", text).unwrap();
        let file = write_groups(csv.part(), &columns(), &spec(), folder.file("ensemble.parquet").unwrap(), most)?;
        Ok(std::fs::read(file.part().at()).unwrap())
    }

    /// The rows of a table, and how many row groups it has.
    fn read(bytes: &[u8]) -> (Vec<Vec<Field>>, usize) {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("table");
        std::fs::write(&path, bytes).unwrap();
        let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
        let row = |row: ParquetResult<parquet::record::Row>| {
            row.unwrap().get_column_iter().map(|(_, field)| field.clone()).collect()
        };
        (reader.get_row_iter(None).unwrap().map(row).collect(), reader.num_row_groups())
    }

    #[test]
    fn every_field_reads_back_with_its_type_and_what_is_empty_is_null() {
        let word = |text: &str| Field::Str(text.into());
        let row = |cell, amplitude, points, mark, flow, t, label, turning| {
            let numbers = [Field::Long(cell), Field::Double(amplitude), Field::Long(points), Field::Bool(mark)];
            [&numbers[..], &[word(flow), t, word(label), Field::Long(turning)]].concat()
        };
        let expected = [
            row(0, 0.1, 40, true, "willmore", Field::Double(0.1 + 0.2), "NA", -1),
            row(1, 1e-12, 50, false, "poly:1,2", Field::Null, "", 2),
            row(2, 2.0, 60, true, "Ševčovič", Field::Double(f64::MIN_POSITIVE * f64::EPSILON), "a \"b\"", 0),
        ];
        let columns = columns().len();
        for (most, groups) in [(GROUP, 1), (2 * columns, 2), (1, 3)] {
            assert_eq!(read(&written(TABLE, most).unwrap()), (expected.to_vec(), groups), "{most}");
        }
        assert_eq!(written(TABLE, GROUP).unwrap(), written(TABLE, GROUP).unwrap(), "equal tables give equal bytes");
        // The control: one bit of one float is seen.
        let other = TABLE.replace("0.30000000000000004", "0.3");
        assert_ne!(read(&written(&other, GROUP).unwrap()).0, expected);
        let header = TABLE.lines().next().unwrap();
        assert_eq!(read(&written(&format!("{header}\n"), GROUP).unwrap()), (Vec::new(), 0));
    }

    #[test]
    fn a_field_of_another_type_is_refused_by_its_place() {
        for (from, to, place) in [
            ("0,0.1,40", "0,x,40", "line 2, column amplitude: expected a number or nothing, found `x`"),
            (",2\n", ",2.5\n", "line 3, column turning: expected a whole number or nothing, found `2.5`"),
            ("true,willmore", "yes,willmore", "line 2, column mark: expected true, false or nothing, found `yes`"),
        ] {
            let error = written(&TABLE.replacen(from, to, 1), GROUP).unwrap_err().to_string();
            assert!(error.contains(place), "{error}");
        }
    }
}
