//! The files that grow as members end: tables, and the store of snapshots.

use crate::{
    column::TableRow,
    columns::of_growing,
    folder::OutputFolder,
    members::MemberFields,
    names,
    part_file::{Mark, PartFile},
    part_folder::PartFolder,
    spill::Spill,
    tables::{EventLevelRow, EventRow, NodeRow, RateRow, Table},
    zarr::{self, SnapshotStore},
};
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Ended, Extent, LevelRow, SeriesRow, Snapshot, Spec, request::spec::Store};

/// The growing files of a spec.
pub struct Growing {
    /// The tables of [`Growing::names`], in this order.
    tables: Vec<Table>,
    members: MemberFields,
    /// The names of the events.
    events: Vec<String>,
    store: Option<SnapshotStore>,
    /// Rows of members that are still running; created when the first of them arrive.
    spill: Option<Spill>,
    /// Some of them lack the last member.
    torn: bool,
    /// Whether events have limits.
    refined: bool,
}

impl Growing {
    /// Names of the files for `spec`, except the store.
    pub fn names(spec: &Spec) -> Vec<&'static str> {
        let snapshots = !spec.snapshots.is_empty() && spec.store == Store::Csv;
        let events = !spec.event.is_empty();
        let optional = [
            (names::EVENTS, events),
            (names::EVENT_LEVELS, events),
            (names::SERIES, spec.series.is_some()),
            (names::SNAPSHOTS, snapshots),
        ];
        let asked = optional.into_iter().filter(|(_, asked)| *asked).map(|(name, _)| name);
        [names::SUMMARY, names::MEMBERS, names::LEVELS, names::RATES].into_iter().chain(asked).collect()
    }

    /// Whether `spec` requires the store.
    pub fn has_store(spec: &Spec) -> bool {
        !spec.snapshots.is_empty() && spec.store == Store::Zarr
    }

    /// Begins the files; `points` is the number of nodes of a member, which matters only if all have the same.
    pub fn begin(folder: &OutputFolder, spec: &Spec, points: usize) -> Result<Growing> {
        let store = match Growing::has_store(spec) {
            true => Some(SnapshotStore::begin(folder.store(names::STORE)?, spec, points)?),
            false => None,
        };
        Growing::of(spec, store, |name| folder.file(name))
    }

    /// Continues the files of an interrupted run, up to their marks.
    ///
    /// # Errors
    /// [`Error::Request`] if the marks do not match the files of `spec`.
    pub fn resume(
        folder: &OutputFolder,
        spec: &Spec,
        points: usize,
        marks: &[Mark],
        store: Option<&zarr::StoreMark>,
        rows: Option<&Mark>,
    ) -> Result<Growing> {
        let mut names: Vec<&str> = marks.iter().map(|mark| mark.name.as_str()).collect();
        let others = || {
            let path = folder.path().display();
            Error::Request(format!("{path}: the checkpoint lists other files than its spec asks for"))
        };
        if names != Growing::names(spec) || store.is_some() != Growing::has_store(spec) {
            return Err(others());
        }
        names.extend(store.map(|_| names::STORE));
        names.extend(rows.map(|_| names::ROWS));
        folder.keep_only(&names)?;
        let store = match store {
            Some(mark) => Some(SnapshotStore::resume(folder.store_again(names::STORE)?, spec, points, mark)?),
            None => None,
        };
        let spill = rows.map(|mark| Spill::new(folder.file_again(mark)?)).transpose()?;
        let growing = Growing::of(spec, store, |name| {
            let mark = marks.iter().find(|mark| mark.name == name).ok_or_else(others)?;
            folder.file_again(mark)
        })?;
        Ok(Growing { spill, ..growing })
    }

    /// The tables in the files that `file` returns.
    fn of(spec: &Spec, store: Option<SnapshotStore>, file: impl Fn(&str) -> Result<PartFile>) -> Result<Growing> {
        let table = |name| {
            let columns = of_growing(name, spec)?;
            Table::with_header(file(name)?, columns.iter().map(|[heading, ..]| &**heading))
        };
        Ok(Growing {
            tables: Growing::names(spec).into_iter().map(table).collect::<Result<_>>()?,
            members: MemberFields::new(spec)?,
            events: spec.event.iter().map(|event| event.name.clone()).collect(),
            store,
            spill: None,
            torn: false,
            refined: spec.refine,
        })
    }

    /// Writes the row of a member at a level.
    pub fn add_level(&mut self, row: &LevelRow) -> Result<()> {
        self.torn = true;
        EventLevelRow::of(row, &self.events).try_for_each(|row| write(&mut self.tables, &row))?;
        write(&mut self.tables, row)?;
        self.torn = false;
        Ok(())
    }

    /// Writes the results of a member.
    pub fn add(&mut self, ended: &Ended) -> Result<()> {
        // Until everything is written.
        self.torn = true;
        let Ended { outcome, features, rows, .. } = ended;
        for extent in &rows.spilled {
            let none = || Error::Failed(format!("the rows of member {} are not to be found", outcome.member));
            let (series, snapshots) = self.spill.as_mut().ok_or_else(none)?.read(extent)?;
            self.add_rows(&series, &snapshots)?;
        }
        self.add_rows(&rows.series, &rows.snapshots)?;
        if let Some(store) = &mut self.store {
            store.member(outcome.status)?;
        }
        let tables = &mut self.tables;
        write(tables, outcome)?;
        let members = self.members.of(outcome, features)?;
        find(tables, names::MEMBERS).map_or(Ok(()), |table| table.write(members))?;
        EventRow::of(outcome, &self.events, self.refined).try_for_each(|row| write(tables, &row))?;
        RateRow::of(outcome).iter().try_for_each(|row| write(tables, row))?;
        self.torn = false;
        Ok(())
    }

    fn add_rows(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<()> {
        series.iter().try_for_each(|row| write(&mut self.tables, row))?;
        snapshots.iter().try_for_each(|snapshot| match &mut self.store {
            Some(store) => store.snapshot(snapshot),
            None => NodeRow::of(snapshot).try_for_each(|row| write(&mut self.tables, &row)),
        })
    }

    /// Stores rows of a member that is still running; [`Growing::add`] reads them back.
    pub fn spill(&mut self, folder: &OutputFolder, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Extent> {
        let spill = match self.spill.take() {
            Some(spill) => spill,
            None => Spill::new(folder.file(names::ROWS)?)?,
        };
        self.spill.insert(spill).add(series, snapshots)
    }

    /// Returns the extent of all files, once they are on disk.
    pub fn mark(&mut self) -> Result<(Vec<Mark>, Option<zarr::StoreMark>, Option<Mark>)> {
        if self.torn {
            return Err(Error::Failed("the rows of a member could not all be written".into()));
        }
        let marks = self.tables.iter_mut().map(Table::mark).collect::<Result<_>>()?;
        let store = self.store.as_ref().map(SnapshotStore::mark).transpose()?;
        Ok((marks, store, self.spill.as_ref().map(Spill::mark).transpose()?))
    }

    /// Sets whether to keep them if the run fails.
    pub fn keep(&mut self, keep: bool) {
        self.tables.iter().for_each(|table| table.keep(keep));
        self.store.iter_mut().for_each(|store| store.keep(keep));
        self.spill.iter().for_each(|spill| spill.keep(keep));
    }

    /// Completes all files on disk, ready for their final names; and returns the rows needed as long as there are
    /// checkpoints.
    pub fn ready(self) -> Result<(Vec<PartFile>, Option<PartFolder>, Option<Spill>)> {
        let files = self.tables.into_iter().map(Table::ready).collect::<Result<_>>()?;
        Ok((files, self.store.map(SnapshotStore::ready).transpose()?, self.spill))
    }
}

fn find<'a>(tables: &'a mut [Table], name: &str) -> Option<&'a mut Table> {
    tables.iter_mut().find(|table| table.name() == name)
}

/// Writes a row into its table, if that is asked for.
fn write<R: TableRow>(tables: &mut [Table], row: &R) -> Result<()> {
    find(tables, R::TABLE).map_or(Ok(()), |table| table.row(row))
}
