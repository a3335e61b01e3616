//! The files that grow as members end: tables, and the store of snapshots.

use crate::{
    folder::OutputFolder,
    members::MemberTable,
    names,
    part_file::{Mark, PartFile},
    part_folder::PartFolder,
    place::Place,
    spill::Spill,
    tables::{
        EventLevelRow, EventLevelTable, EventRow, EventTable, LevelTable, RateRow, RateTable, SeriesTable,
        SnapshotTable, SummaryTable, Table,
    },
    zarr::{self, SnapshotStore},
};
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Ended, Extent, LevelRow, SeriesRow, Snapshot, Spec, request::spec::Store};

/// The growing files of a spec.
pub struct Growing {
    summary: SummaryTable,
    members: MemberTable,
    levels: LevelTable,
    rates: RateTable,
    /// Those of the members and those of the levels, with the names of the events.
    events: Option<(EventTable, EventLevelTable, Vec<String>)>,
    series: Option<SeriesTable>,
    snapshots: Option<SnapshotTable>,
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
        let spill = rows.map(|mark| Spill::resume(folder, mark)).transpose()?;
        let growing = Growing::of(spec, store, |name| {
            let mark = marks.iter().find(|mark| mark.name == name).ok_or_else(others)?;
            folder.file_again(mark)
        })?;
        Ok(Growing { spill, ..growing })
    }

    /// The tables in the files that `file` returns.
    fn of(spec: &Spec, store: Option<SnapshotStore>, file: impl Fn(&str) -> Result<PartFile>) -> Result<Growing> {
        let names = Growing::names(spec);
        let asked = |name: &str| names.contains(&name).then(|| file(name)).transpose();
        Ok(Growing {
            summary: Table::new(file(names::SUMMARY)?)?,
            members: MemberTable::new(file(names::MEMBERS)?, spec)?,
            levels: Table::new(file(names::LEVELS)?)?,
            rates: Table::new(file(names::RATES)?)?,
            events: match asked(names::EVENTS)?.zip(asked(names::EVENT_LEVELS)?) {
                Some((own, levels)) => {
                    let names = spec.event.iter().map(|event| event.name.clone()).collect();
                    Some((Table::new(own)?, Table::new(levels)?, names))
                }
                None => None,
            },
            series: asked(names::SERIES)?.map(Table::new).transpose()?,
            snapshots: asked(names::SNAPSHOTS)?.map(Table::new).transpose()?,
            store,
            spill: None,
            torn: false,
            refined: spec.refine,
        })
    }

    /// Writes the row of a member at a level.
    pub fn add_level(&mut self, row: &LevelRow) -> Result<()> {
        self.torn = true;
        if let Some((_, table, names)) = &mut self.events {
            EventLevelRow::of(row, names).try_for_each(|row| table.row(&row))?;
        }
        self.levels.row(row)?;
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
        self.summary.row(outcome)?;
        self.members.row(outcome, features)?;
        if let Some((table, _, names)) = &mut self.events {
            EventRow::of(outcome, names, self.refined).try_for_each(|row| table.row(&row))?;
        }
        RateRow::of(outcome).iter().try_for_each(|row| self.rates.row(row))?;
        self.torn = false;
        Ok(())
    }

    fn add_rows(&mut self, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<()> {
        if let Some(table) = &mut self.series {
            series.iter().try_for_each(|row| table.row(row))?;
        }
        if let Some(table) = &mut self.snapshots {
            snapshots.iter().try_for_each(|snapshot| table.snapshot(snapshot))?;
        }
        if let Some(store) = &mut self.store {
            snapshots.iter().try_for_each(|snapshot| store.snapshot(snapshot))?;
        }
        Ok(())
    }

    /// Stores rows of a member that is still running; [`Growing::add`] reads them back.
    pub fn spill(&mut self, folder: &OutputFolder, series: &[SeriesRow], snapshots: &[Snapshot]) -> Result<Extent> {
        let spill = match self.spill.take() {
            Some(spill) => spill,
            None => Spill::begin(folder)?,
        };
        self.spill.insert(spill).add(series, snapshots)
    }

    /// Where the rows of the members are for now, and those of their events.
    pub fn rows(&self) -> (&Place, Option<&Place>) {
        (self.summary.part(), self.events.as_ref().map(|(own, ..)| own.part()))
    }

    /// Where the rows of the levels are for now, and those of the events there.
    pub fn levels(&self) -> (&Place, Option<&Place>) {
        (self.levels.part(), self.events.as_ref().map(|(_, levels, _)| levels.part()))
    }

    /// Returns the extent of all files, once they are on disk.
    pub fn mark(&mut self) -> Result<(Vec<Mark>, Option<zarr::StoreMark>, Option<Mark>)> {
        if self.torn {
            return Err(Error::Failed("the rows of a member could not all be written".into()));
        }
        let mut marks = vec![self.summary.mark()?, self.members.mark()?, self.levels.mark()?, self.rates.mark()?];
        if let Some((own, levels, _)) = &mut self.events {
            marks.extend([own.mark()?, levels.mark()?]);
        }
        marks.extend(self.series.as_mut().map(SeriesTable::mark).transpose()?);
        marks.extend(self.snapshots.as_mut().map(SnapshotTable::mark).transpose()?);
        let store = self.store.as_ref().map(SnapshotStore::mark).transpose()?;
        Ok((marks, store, self.spill.as_ref().map(Spill::mark).transpose()?))
    }

    /// Sets whether to keep them if the run fails.
    pub fn keep(&mut self, keep: bool) {
        self.summary.keep(keep);
        self.members.keep(keep);
        self.levels.keep(keep);
        self.rates.keep(keep);
        if let Some((own, levels, _)) = &self.events {
            own.keep(keep);
            levels.keep(keep);
        }
        self.series.iter().for_each(|table| table.keep(keep));
        self.snapshots.iter().for_each(|table| table.keep(keep));
        self.store.iter_mut().for_each(|store| store.keep(keep));
        self.spill.iter().for_each(|spill| spill.keep(keep));
    }

    /// Completes all files on disk, ready for their final names; and returns the rows needed as long as there are
    /// checkpoints.
    pub fn ready(self) -> Result<(Vec<PartFile>, Option<PartFolder>, Option<Spill>)> {
        let Growing { summary, members, levels, rates, events, series, snapshots, store, spill, .. } = self;
        let mut files = vec![summary.ready()?, members.ready()?, levels.ready()?, rates.ready()?];
        if let Some((own, levels, _)) = events {
            files.extend([own.ready()?, levels.ready()?]);
        }
        files.extend(series.map(SeriesTable::ready).transpose()?);
        files.extend(snapshots.map(SnapshotTable::ready).transpose()?);
        Ok((files, store.map(SnapshotStore::ready).transpose()?, spill))
    }
}
