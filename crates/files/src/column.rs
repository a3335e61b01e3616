//! Columns of the tables: a name, the type of the fields, how they are written and read, and what they mean, in one
//! line.

use serde::Serialize;

use super::fields::Fields;
use curvelax_base::error::Result;
use curvelax_ensemble::Status;
use curvelax_flow::{number::Precision, solver::Solver};
use curvelax_study::truth::Varied;

/// A row of a table, as the program holds it.
pub trait TableRow: Sized + 'static {
    /// The table, by its name in the folder of results.
    const TABLE: &'static str;
    /// Its columns, from left to right.
    const COLUMNS: &'static [Column<Self>];
}

/// A column of the table whose rows are `R`.
pub struct Column<R> {
    /// The heading.
    pub name: &'static str,
    /// Type of the fields, as in the documents.
    pub holds: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// The field of a record.
    pub write: fn(&R) -> Field<'_>,
    /// Reads the next field of a row into a record.
    pub read: fn(&mut R, &mut Fields<'_>) -> Result<()>,
}

/// The content of a field.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Field<'a> {
    /// An integer ≥ 0.
    Whole(u64),
    /// An integer of either sign.
    Signed(i64),
    /// A float that reads back to the same bits, or nothing.
    Float(Option<f64>),
    /// A word.
    Word(&'a str),
}

/// The columns of a [`TableRow`] of a table, one per line: `heading: kind = path of the field, "meaning";`. The kinds
/// are the modules below.
macro_rules! columns {
    ($record:ty, $table:path: $($name:ident: $kind:ident = $($field:ident).+, $meaning:literal;)+) => {
        impl $crate::column::TableRow for $record {
            const TABLE: &'static str = $table;
            const COLUMNS: &'static [$crate::column::Column<Self>] = &[$(
                $crate::column::Column {
                    name: stringify!($name),
                    holds: $crate::column::$kind::HOLDS,
                    meaning: $meaning,
                    write: |record| $crate::column::$kind::write(&record.$($field).+),
                    read: |record, fields| {
                        record.$($field).+ = $crate::column::$kind::read(fields)?;
                        Ok(())
                    },
                },
            )+];
        }
    };
}

pub(super) use columns;

/// A [`TableRow`] that has nothing but its columns, one per line: `heading: kind, "meaning";`.
macro_rules! row {
    ($(#[$doc:meta])* $record:ident, $table:path: $($name:ident: $kind:ident, $meaning:literal;)+) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $record {
            $(#[doc = $meaning] pub $name: $crate::column::$kind::Value,)+
        }

        $crate::column::columns! { $record, $table: $($name: $kind = $name, $meaning;)+ }
    };
}

pub(super) use row;

/// The value, if it is known.
pub(super) fn known(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Kinds of columns: the type of a field, and how a value is written and read.
macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident of $value:ty, $holds:literal: |$v:ident| $write:expr, |$fields:ident| $read:expr;)+) => {$(
        $(#[$doc])*
        pub(super) mod $kind {
            use super::*;

            pub type Value = $value;
            pub const HOLDS: &str = $holds;

            // One signature for all kinds.
            #[allow(clippy::ptr_arg)]
            pub fn write($v: &Value) -> Field<'_> {
                $write
            }

            pub fn read($fields: &mut Fields<'_>) -> Result<Value> {
                $read
            }
        }
    )+};
}

kinds! {
    /// A count or an index.
    whole of u64, "integer": |v| Field::Whole(*v), |fields| fields.whole();
    /// A number of nodes.
    nodes of usize, "integer": |v| Field::Whole(*v as u64), |fields| fields.whole();
    /// A small count.
    small of u32, "integer": |v| Field::Whole(u64::from(*v)), |fields| fields.whole();
    /// An integer of either sign.
    signed of i32, "integer": |v| Field::Signed(i64::from(*v)), |fields| fields.whole();
    /// How a member ended.
    status of Status, "word": |v| Field::Word(v.name()), |fields| fields.one_of(Status::ALL, Status::name);
    /// The numbers in which a member was computed.
    precision of Precision, "word": |v| Field::Word(v.name()),
        |fields| fields.one_of([Precision::F32, Precision::F64], Precision::name);
    /// What a study refines.
    varied of Varied, "word": |v| Field::Word(v.name()), |fields| fields.one_of(Varied::ALL, Varied::name);
    /// A solver of the systems.
    solver of Solver, "word": |v| Field::Word(v.name()), |fields| fields.one_of(Solver::ALL, Solver::name);
    /// A count or an index, or none.
    rank of Option<u64>, "integer": |v| v.map_or(Field::Float(None), Field::Whole), |fields| fields.whole_or_none();
    /// Any word.
    word of String, "word": |v| Field::Word(v), |fields| Ok(fields.word().to_owned());
    /// A float; one that is not finite is unknown.
    number of f64, "float": |v| Field::Float(known(*v)), |fields| fields.known();
    /// A float, or none.
    optional of Option<f64>, "float": |v| Field::Float(v.and_then(known)), |fields| fields.number();
    /// A time, always known.
    time of f64, "float": |v| Field::Float(known(*v)), |fields| fields.time();
    /// A time, or none.
    event of Option<f64>, "float": |v| Field::Float(v.and_then(known)), |fields| fields.event();
}
