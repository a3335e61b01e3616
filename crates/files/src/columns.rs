//! The columns of the tables of a run, for documents and for programs that read them.

use crate::{
    TableRow, names,
    tables::{EventLevelRow, EventRow, NodeRow, RateRow},
};
use curvelax_base::error::Result;
use curvelax_ensemble::{Feature, LevelRow, Outcome, SeriesRow, Spec};
use curvelax_study::results::{
    cells::{EnsembleStatistics, StatisticsField},
    explained::ExplainedRow,
    tally::MeanExcess,
};

/// Heading of a column, what its fields hold, and what they mean.
pub type ColumnText = [String; 3];

/// The first columns of `members.csv`, with their meanings.
const OF_MEMBERS: [(&str, &str, &str); 3] = [
    ("member", "integer", "index of the member, from 0"),
    ("cell", "integer", "index of its cell, from 0"),
    ("label", "word", "name of its outline; empty if it has none"),
];

/// The columns of the table `name` of a run of `spec` with these statistics; none if it is no such table.
///
/// # Errors
/// Those of the spec, whose cells have features of their own.
pub fn columns(name: &str, spec: &Spec, statistics: &EnsembleStatistics) -> Result<Vec<ColumnText>> {
    let of_row = |row: Option<Vec<StatisticsField>>| {
        row.into_iter().flatten().map(|field| [field.name, field.holds.to_owned(), field.meaning]).collect()
    };
    Ok(match name {
        names::ENSEMBLE => of_row(statistics.rows(spec).next()),
        names::GROUPS => of_row(statistics.group_rows().next()),
        names::EVENT_STATISTICS => of_row(statistics.event_rows(spec).next()),
        names::EXPLAINED => of::<ExplainedRow>(),
        names::MEAN_EXCESS => of::<MeanExcess>(),
        _ => of_growing(name, spec)?,
    })
}

/// The columns of a table that grows as members end, likewise.
pub(super) fn of_growing(name: &str, spec: &Spec) -> Result<Vec<ColumnText>> {
    Ok(match name {
        names::SUMMARY => of::<Outcome>(),
        names::MEMBERS => {
            let indices = OF_MEMBERS.map(|(name, holds, meaning)| [name, holds, meaning].map(str::to_owned));
            let of_feature = |Feature { name, meaning, is_flag }: Feature| {
                [name, if is_flag { "integer" } else { "float" }.to_owned(), meaning]
            };
            indices.into_iter().chain(spec.all_features()?.into_iter().map(of_feature)).collect()
        }
        names::EVENTS => of::<EventRow>(),
        names::RATES => of::<RateRow>(),
        names::LEVELS => of::<LevelRow>(),
        names::EVENT_LEVELS => of::<EventLevelRow>(),
        names::SERIES => of::<SeriesRow>(),
        names::SNAPSHOTS => of::<NodeRow>(),
        _ => Vec::new(),
    })
}

fn of<R: TableRow>() -> Vec<ColumnText> {
    R::COLUMNS.iter().map(|column| [column.name, column.holds, column.meaning].map(str::to_owned)).collect()
}
