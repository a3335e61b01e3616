//! The names of all files in a folder of results.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use curvelax_base::{
    error::{Error, Result, plainly, shortened},
    input,
};

/// One row per member.
pub const SUMMARY: &str = "summary.csv";
/// Decay rates, one row per member that has one.
pub const RATES: &str = "rates.csv";
/// Relaxation times at other resolutions, one row per member and level.
pub const LEVELS: &str = "levels.csv";
/// What was drawn for each member, and its shape at the start.
pub const MEMBERS: &str = "members.csv";
/// How much of the variance of the times each of that explains, by cell.
pub const EXPLAINED: &str = "explained.csv";
/// First times of the events of the spec, one row per member and event.
pub const EVENTS: &str = "events.csv";
/// Their statistics, one row per cell and event.
pub const EVENT_STATISTICS: &str = "event_statistics.csv";
/// Times of events at other resolutions, one row per member, level and event.
pub const EVENT_LEVELS: &str = "event_levels.csv";
/// Mean excess in time, by cell.
pub const MEAN_EXCESS: &str = "mean_excess.csv";
/// Observables over time.
pub const SERIES: &str = "series.csv";
/// Nodes at given times.
pub const SNAPSHOTS: &str = "snapshots.csv";
/// The same as arrays: a folder.
pub const STORE: &str = "snapshots.zarr";
/// Errors and orders against exact solutions.
pub const CONVERGENCE: &str = "convergence.csv";
/// Errors of relaxation times and what they cost.
pub const WORK: &str = "work_precision.csv";
/// The same as a picture.
pub const WORK_PICTURE: &str = "work_precision.svg";
/// Relaxation times beside those of an independent solver.
pub const REFEREE: &str = "referee.csv";
/// Statistics by cell.
pub const ENSEMBLE: &str = "ensemble.csv";
/// The same by group of outlines.
pub const GROUPS: &str = "groups.csv";
/// How the run was made.
pub const RUN: &str = "run.json";
/// Times of members that are known by name.
pub const MEMBER_TIMES: &str = "plots/members.svg";
/// The first members at the start, during the run and at the end.
pub const CURVES: &str = "plots/curves.svg";
/// The nodes of the same members, from which pictures are drawn.
pub const PORTRAITS: &str = "plots/portraits.json";
/// Distribution of the relaxation times.
pub const RELAXATION: &str = "plots/relaxation.svg";
/// The relaxation times of each cell as a box, and against two laws.
pub const DISTRIBUTION: &str = "plots/distribution.svg";
/// Fitted decay rates.
pub const RATE: &str = "plots/rate.svg";
/// Kaplan-Meier curves.
pub const SURVIVAL: &str = "plots/survival.svg";
/// The same by group of outlines.
pub const GROUP_SURVIVAL: &str = "plots/groups.svg";
/// Kaplan-Meier curves of the events.
pub const EVENT_SURVIVAL: &str = "plots/events.svg";
/// Mean excess in time.
pub const EXCESS: &str = "plots/excess.svg";
/// Relaxation times against a swept key.
pub const DEPENDENCE: &str = "plots/dependence.svg";
/// Relaxation times against what explains them best.
pub const FEATURES: &str = "plots/features.svg";
/// Spacing of nodes and metric drift.
pub const MESH: &str = "plots/mesh.svg";
/// Everything at a glance.
pub const REPORT: &str = "report.html";

/// The first members in motion, from `curvelax animate`.
pub const MOVIE: &str = "movie.gif";

/// What a merge needs from a shard besides its tables, see [`shard`](crate::state::shard).
pub const SHARD: &str = "shard.state";

/// The files of `curvelax figure`.
pub const FIGURES: [&str; 8] =
    ["fig1a.svg", "fig1a.csv", "fig1b.svg", "fig1b.csv", "fig1c.svg", "fig1c.csv", "fig2.svg", "fig2.csv"];

/// Rows of members that are still running, see [`spill`](super::spill): never under this name, only as
/// `.curvelax.rows.part` during a run.
pub const ROWS: &str = "curvelax.rows";

/// All files that a run may write, or that are made from one without naming a place; the one that vouches for the
/// others comes first.
pub fn own() -> Vec<String> {
    let own = [RUN, SHARD].into_iter().chain(TABLES).chain([PORTRAITS]).chain(PICTURES).chain([MOVIE, ROWS]);
    let paper = PICTURES.into_iter().flat_map(|name| PAPER_EXTENSIONS.map(|extension| on_paper(name, extension)));
    own.map(String::from).chain(parquet()).chain(paper.flatten()).collect()
}

/// The outlines that the Python package leaves with a run, and those of the earlier run until it is replaced.
pub const PYTHON_OUTLINES: [&str; 2] = ["outlines.npz", "outlines.before"];

/// The tables of a run and its store, in the order in which people see them.
pub const TABLES: [&str; 14] = [
    SUMMARY,
    MEMBERS,
    ENSEMBLE,
    GROUPS,
    EXPLAINED,
    EVENTS,
    EVENT_STATISTICS,
    RATES,
    LEVELS,
    EVENT_LEVELS,
    MEAN_EXCESS,
    SERIES,
    SNAPSHOTS,
    STORE,
];

/// The tables as Parquet, in the same order.
pub fn parquet() -> impl Iterator<Item = String> {
    TABLES.into_iter().filter_map(as_parquet)
}

/// The name of the table `name` as Parquet; none for the store.
pub fn as_parquet(name: &str) -> Option<String> {
    let stem = name.strip_suffix(".csv").filter(|_| TABLES.contains(&name))?;
    Some(format!("{stem}.parquet"))
}

/// The files that are drawn from the others.
pub const PICTURES: [&str; 13] = [
    REPORT,
    MEMBER_TIMES,
    RELAXATION,
    DISTRIBUTION,
    SURVIVAL,
    GROUP_SURVIVAL,
    EVENT_SURVIVAL,
    EXCESS,
    RATE,
    DEPENDENCE,
    FEATURES,
    MESH,
    CURVES,
];

/// The extensions of the same pictures for papers.
const PAPER_EXTENSIONS: [&str; 2] = ["png", "pdf"];

/// The name of the picture `name` for papers, with the extension `png` or `pdf`; none for the report.
pub fn on_paper(name: &str, extension: &str) -> Option<String> {
    let stem = name.strip_suffix("svg").filter(|_| PAPER_EXTENSIONS.contains(&extension))?;
    Some(format!("{stem}{extension}"))
}

/// Characters of foreign text in a message.
pub(super) const SHOWN: usize = 200;

/// The remedy for a file that was changed or truncated.
pub const REMEDY: &str = "restore the file, or run again";

/// The error that the file at `path` is not as a run wrote it, at `place` if that is not empty.
pub(super) fn spoilt(path: &Path, place: &str, problem: &str) -> Error {
    let comma = if place.is_empty() { "" } else { ", " };
    Error::Request(format!("{}{comma}{place}: {problem}; {REMEDY}", path.display()))
}

/// The text of the file at `path`, of at most `most` bytes.
pub(super) fn text_of(path: &Path, most: u64) -> Result<String> {
    input::text(path, most).map_err(|e| Error::Request(format!("cannot read {}: {e}", path.display())))
}

/// The value in `text`, which is that of the JSON file at `path`.
pub(super) fn parsed<'a, T: Deserialize<'a>>(path: &Path, text: &'a str) -> Result<T> {
    serde_json::from_str(text).map_err(|e| spoilt(path, "", &shortened(&plainly(&e.to_string()), SHOWN)))
}

/// The folder of the plots.
pub const PLOTS: &str = "plots";

/// The checkpoint, see [`checkpoint`](crate::state::checkpoint).
pub const STATE: &str = ".curvelax.state";
/// The previous checkpoint, in case the last one is damaged.
pub const STATE_OLD: &str = ".curvelax.state.old";
/// The next checkpoint, while it is being written.
pub const STATE_PART: &str = ".curvelax.state.part";

/// What was read of outlines, for as long as there is a checkpoint, see [`outlines`](crate::state::outlines).
pub const OUTLINES: &str = ".curvelax.outlines";

/// Tests whether a folder can be written, and holds the replacement of another file.
pub const PROBE: &str = ".curvelax.part";

/// The temporary name of `name`.
pub fn part(name: &Path) -> PathBuf {
    let file_name = name.file_name().unwrap_or_default().to_string_lossy();
    name.with_file_name(format!(".{file_name}.part"))
}

/// Whether a folder, and not a file, has this name.
pub fn is_store(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().trim_end_matches(".part").ends_with(STORE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_has_the_same_name_as_parquet() {
        for name in TABLES.into_iter().filter(|name| *name != STORE) {
            assert_eq!(as_parquet(name), Some(name.replace(".csv", ".parquet")));
        }
        assert_eq!([STORE, RUN].map(as_parquet), [None, None]);
    }

    #[test]
    fn every_picture_but_the_report_has_names_for_papers() {
        let pictures = || PICTURES.into_iter().filter(|name| *name != REPORT);
        for (name, extension) in pictures().flat_map(|name| ["png", "pdf"].map(|extension| (name, extension))) {
            assert_eq!(on_paper(name, extension), Some(name.replace("svg", extension)));
        }
        assert_eq!([on_paper(REPORT, "png"), on_paper(MESH, "gif")], [None, None]);
    }
}
