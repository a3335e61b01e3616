//! The end of a run: statistics, pictures and provenance, and all files under their final names.

use std::time::Duration;

use super::{document::Document, overview::Overview, pictures::FinishedRun};
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Spec, request::spec::Tables};
use curvelax_files::{
    columns::columns,
    folder::OutputFolder,
    names, parquet,
    part_file::PartFile,
    part_folder::PartFolder,
    portraits::{self, Film},
    reader,
    tables::Table,
};
use curvelax_study::{
    placement::Platform,
    results::{
        RunVerdict,
        cells::{EnsembleStatistics, to_csv},
        provenance::{Provenance, json},
        tally::Tally,
    },
};

/// Output on stdout for a completed run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResultFormat {
    /// A table and some lines for people.
    Overview,
    /// One document for programs.
    Json,
}

/// Names in the overview of the pictures and of the tables as Parquet.
const PLOTS: &str = "plots/*.svg";
const PARQUET: &str = "*.parquet";

/// A run whose members have all ended.
pub struct Complete<'a> {
    /// The resolved spec.
    pub spec: &'a Spec,
    /// Where it was computed.
    pub platform: &'a Platform,
    /// The results.
    pub tally: Tally,
    /// The first members.
    pub films: &'a [Film],
    /// Warnings given to the user, one sentence each.
    pub warnings: &'a [String],
    /// When it began, since 1970.
    pub started: Duration,
    /// How long it took.
    pub wall: Duration,
}

/// The names of a run's files as the overview lists them, of those that `is_there`.
pub fn listed(is_there: impl Fn(&str) -> bool) -> Vec<&'static str> {
    let tables = names::TABLES.into_iter().filter(|name| is_there(name));
    let shard = Some(names::SHARD).filter(|name| is_there(name));
    let parquet = names::parquet().any(|name| is_there(&name)).then_some(PARQUET);
    tables.chain(parquet).chain([names::REPORT, PLOTS, names::RUN]).chain(shard).collect()
}

impl Complete<'_> {
    /// Gives all files their final names, once all are on disk, and returns the text for stdout and the verdict.
    /// `files` and `store` hold the results of the members; `shard` is [what a merge needs besides
    /// them](curvelax_files::state::shard).
    ///
    /// # Errors
    /// If only the pictures cannot be written, the tables are published all the same, and the error says so.
    pub fn publish(
        self,
        folder: &OutputFolder,
        mut files: Vec<PartFile>,
        store: Option<PartFolder>,
        shard: Option<&[u8]>,
        form: ResultFormat,
    ) -> Result<(String, RunVerdict)> {
        let Complete { spec, platform, mut tally, films, warnings, started, wall } = self;
        let statistics = &EnsembleStatistics::new(spec, &mut tally)?;
        let tally = &tally;
        // Rows come first: they are saved even if the disk fills up.
        files.push(folder.write(names::ENSEMBLE, to_csv(names::ENSEMBLE, statistics.rows(spec))?)?);
        if !statistics.groups.is_empty() {
            files.push(folder.write(names::GROUPS, to_csv(names::GROUPS, statistics.group_rows())?)?);
        }
        if !spec.event.is_empty() {
            let events = to_csv(names::EVENT_STATISTICS, statistics.event_rows(spec))?;
            files.push(folder.write(names::EVENT_STATISTICS, events)?);
        }
        let excess = &tally.mean_excess(spec)?;
        files.push(Table::of(folder.file(names::MEAN_EXCESS)?, excess)?);
        let explained = &reader::explained(&|name| folder.part(name), spec, statistics.of_limits)?;
        files.push(Table::of(folder.file(names::EXPLAINED)?, &explained.rows)?);
        if spec.tables == Tables::Parquet {
            for name in names::TABLES {
                let file = files.iter().find(|file| file.name() == name);
                if let Some((file, own)) = file.zip(names::as_parquet(name)) {
                    let columns = &columns(name, spec, statistics)?;
                    files.push(parquet::write(file.part(), columns, spec, folder.file(&own)?)?);
                }
            }
        }
        if let Some(shard) = shard {
            files.push(folder.write(names::SHARD, shard)?);
        }
        let mut written: Vec<String> = files.iter().map(|file| file.name().to_string()).collect();
        written.extend(store.iter().map(|_| names::STORE.to_string()));
        let names = listed(|name| written.iter().any(|own| own == name));
        let provenance = &Provenance::new(spec, platform, tally, warnings, started, wall);
        let run = folder.write(names::RUN, provenance.to_json()?)?;
        let study = FinishedRun { provenance, tally, statistics, excess, explained, films };
        let mut drawn = Vec::new();
        let done = (|| {
            drawn.push(folder.write(names::PORTRAITS, portraits::to_json(films)?)?);
            for (name, text) in study.pictures()? {
                drawn.push(folder.write(name, text)?);
            }
            Ok(())
        })();
        if done.is_err() {
            // Everything except the data from which pictures are drawn.
            drawn.truncate(1);
        }
        folder.publish(files.into_iter().chain(drawn).collect(), store, run)?;
        done.map_err(|error: Error| {
            let folder = folder.path().display();
            Error::Failed(format!("{error}; the tables in {folder} are complete, some pictures are missing"))
        })?;
        let (folder, files) = (folder.path(), &names[..]);
        let text = match form {
            ResultFormat::Overview => Overview { spec, platform, tally, statistics, wall, folder, files }.to_string(),
            ResultFormat::Json => json(&Document::new(provenance, statistics, folder, files), "JSON")?,
        };
        Ok((text, RunVerdict::new(provenance, Some(statistics))))
    }
}
