//! What is in a folder that no run wrote there: `--force` must not lose it.

use std::{
    collections::BTreeSet,
    io,
    path::{Path, PathBuf},
};

use super::{
    claim::LOCK,
    disk::{IS_STORE, entries, is_real_folder},
    names::{
        EVENT_LEVELS, EVENT_STATISTICS, EVENTS, OUTLINES, PLOTS, PROBE, PYTHON_OUTLINES, RUN, SERIES, SNAPSHOTS, STATE,
        STATE_OLD, STATE_PART, STORE, as_parquet, is_store, own, parquet, part,
    },
    part_folder::SUCCESSOR,
};
use curvelax_base::input;

/// What is in `folder` and in its folders that is not of a run, by its path there, in order.
///
/// Names alone do not tell: `summary.csv` or `run.json` may be anybody's. A checkpoint or the `run.json` of a run
/// speaks for the files of these names, without a checkpoint only for those that the spec in it asks for; unfinished
/// ones, which are hidden, speak for themselves. Other hidden files do not count: no run touches them, and systems
/// leave some in every folder that is looked at.
pub fn foreign(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let there = |name: &&str| folder.join(name).symlink_metadata().is_ok();
    let (begun, run) = ([STATE, STATE_OLD].iter().any(there), folder.join(RUN));
    let has_run = begun || is_of_run(&run);
    let unasked = if begun { Vec::new() } else { unasked(&run) };
    let unfinished = own().into_iter().map(|name| part(Path::new(&name)));
    let finished = own().into_iter().chain(PYTHON_OUTLINES.map(String::from));
    let finished = finished.filter(|name| has_run && !unasked.contains(name)).map(PathBuf::from);
    let working = [LOCK, OUTLINES, PROBE, STATE, STATE_OLD, STATE_PART].map(PathBuf::from);
    let known: BTreeSet<PathBuf> = finished.chain(unfinished).chain(working).collect();
    let mut found = Vec::new();
    let mut look = |path: &Path| {
        let name = path.strip_prefix(folder).unwrap_or(path);
        let is_empty = || is_real_folder(path) && entries(path).is_ok_and(|entries| entries.is_empty());
        if !known.contains(name) && !is_hidden(name) && !is_empty() {
            found.push(name.to_path_buf());
        }
    };
    let mut stores = Vec::new();
    for path in entries(folder)? {
        match path.ends_with(PLOTS) {
            true if is_real_folder(&path) => entries(&path)?.iter().for_each(|path| look(path)),
            // That no folder can be made here is said of it elsewhere.
            true => {}
            false => {
                look(&path);
                stores.extend(Some(path).filter(|path| is_store(path) && is_real_folder(path)));
            }
        }
    }
    for store in stores.iter().filter(|store| known.contains(store.strip_prefix(folder).unwrap_or(store))) {
        found.extend(
            foreign_in_store(store)?.iter().map(|path| path.strip_prefix(folder).unwrap_or(path).to_path_buf()),
        );
    }
    found.sort();
    Ok(found)
}

/// Whether a run wrote the file, as far as it is whole.
fn is_of_run(path: &Path) -> bool {
    const KEY: &[u8] = b"\"curvelax\"";
    input::bytes(path, input::MAX_RUN).is_ok_and(|bytes| bytes.windows(KEY.len()).any(|part| part == KEY))
}

/// The tables that the spec in a `run.json` does not ask for; none if it cannot be read.
fn unasked(path: &Path) -> Vec<String> {
    let run = input::bytes(path, input::MAX_RUN).ok();
    let run: Option<serde_json::Value> = run.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let Some(spec) = run.as_ref().and_then(|run| run.get("spec")) else { return Vec::new() };
    let lacks = |key| spec.get(key).is_none_or(|value| value.is_null() || value.as_array().is_some_and(Vec::is_empty));
    let is_stored = spec.get("store").is_some_and(|store| store == "zarr");
    let lacks_snapshots = lacks("snapshots");
    let tables = [
        (lacks("series"), &[SERIES][..]),
        (lacks_snapshots || is_stored, &[SNAPSHOTS]),
        (lacks_snapshots || !is_stored, &[STORE]),
        (lacks("event"), &[EVENTS, EVENT_STATISTICS, EVENT_LEVELS]),
    ];
    let tables = tables.iter().filter(|(lacks, _)| *lacks).flat_map(|(_, names)| *names).copied();
    let lacks_parquet = spec.get("tables").is_none_or(|tables| tables != "parquet");
    let parquet = parquet().filter(|_| lacks_parquet);
    tables.flat_map(|name| [Some(name.to_owned()), as_parquet(name)]).flatten().chain(parquet).collect()
}

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
}

/// What is in the folder of a store, which is removed as a whole, besides arrays and their chunks.
fn foreign_in_store(store: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for path in entries(store)? {
        match is_real_folder(&path) {
            true => found.extend(entries(&path)?.into_iter().filter(|path| !is_of_store(path, true))),
            false => found.extend((!is_of_store(&path, false)).then_some(path)),
        }
    }
    Ok(found)
}

/// Whether a file is part of a store: metadata, a chunk if it is `in_array`, or the unfinished replacement of one.
fn is_of_store(path: &Path, in_array: bool) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let is_chunk = in_array && name.starts_with("c.");
    let own = path.ends_with(IS_STORE) || is_chunk || path.extension().is_some_and(|end| end == SUCCESSOR);
    (own && !path.is_dir()) || is_hidden(path)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// What is foreign where these files are.
    fn found(files: &[&str]) -> Vec<String> {
        let home = tempfile::tempdir().unwrap();
        for name in files {
            let path = home.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, if *name == RUN { "{\n  \"curvelax\": \"0.1.0\"" } else { "mine" }).unwrap();
        }
        foreign(home.path()).unwrap().iter().map(|path| path.display().to_string()).collect()
    }

    #[test]
    fn files_of_a_run_are_its_own_and_others_are_foreign() {
        let run = [
            RUN,
            "outlines.npz",
            "summary.csv",
            "plots/curves.svg",
            "snapshots.zarr/zarr.json",
            "snapshots.zarr/x/c.0.0.0",
        ];
        let left = ["snapshots.zarr/x/zarr.part", ".series.csv.part", "plots/.mesh.svg.part", LOCK, STATE_PART];
        assert_eq!(found(&[&run[..], &left].concat()), [""; 0]);
        let others =
            ["notes.txt", "plots/mine.svg", "data/a", "snapshots.zarr/notes", "snapshots.zarr/x/mine", ".hidden"];
        let expected = ["data", "notes.txt", "plots/mine.svg", "snapshots.zarr/notes", "snapshots.zarr/x/mine"];
        assert_eq!(found(&[&run[..], &others].concat()), expected);
    }

    #[test]
    fn names_of_a_run_are_its_own_only_where_one_was() {
        let names = ["ensemble.csv", "outlines.npz", "plots/mesh.svg", "snapshots.zarr/zarr.json", "summary.csv"];
        assert_eq!(found(&names), ["ensemble.csv", "outlines.npz", "plots/mesh.svg", "snapshots.zarr", "summary.csv"]);
        for own in [RUN, STATE, STATE_OLD] {
            assert_eq!(found(&[&names[..], &[own]].concat()), [""; 0], "{own}");
        }
        // Before its first checkpoint a run has unfinished files only.
        assert_eq!(found(&[".summary.csv.part", ".snapshots.zarr.part/x/zarr.json", STATE_PART]), [""; 0]);
        // What the run did not ask for is not its own, whatever its name.
        let home = tempfile::tempdir().unwrap();
        for name in [SERIES, SNAPSHOTS, EVENTS, "series.parquet", "summary.csv", "summary.parquet"] {
            fs::write(home.path().join(name), "mine").unwrap();
        }
        fs::create_dir(home.path().join(STORE)).unwrap();
        fs::write(home.path().join(STORE).join("zarr.json"), "mine").unwrap();
        let of_spec = |spec: &str| {
            fs::write(home.path().join(RUN), format!("{{\"curvelax\": \"0.1.0\", \"spec\": {{{spec}}}}}")).unwrap();
            foreign(home.path()).unwrap().iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(" ")
        };
        let tables = "events.csv series.csv series.parquet snapshots.csv snapshots.zarr";
        assert_eq!(of_spec("\"snapshots\": []"), format!("{tables} summary.parquet"));
        assert_eq!(of_spec("\"tables\": \"parquet\""), tables);
        let all = "\"tables\": \"parquet\", \"series\": 0.1, \"snapshots\": [1]";
        assert_eq!(of_spec(&format!("{all}, \"event\": [\"a = area <= 1\"]")), "snapshots.zarr");
        assert_eq!(of_spec(&format!("{all}, \"store\": \"zarr\"")), "events.csv snapshots.csv");
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join(RUN), "{\"engine\": \"another\"}").unwrap();
        assert_eq!(foreign(home.path()).unwrap(), [Path::new(RUN)]);
    }
}
