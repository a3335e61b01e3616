//! The checkpoint from which `resume` continues: the file `.curvelax.state` and its predecessor `.curvelax.state.old`.
//!
//! Each is an [envelope](super::envelope) around [`CheckpointHead`] and [`RunProgress`]. It holds the lengths and
//! checksums of the tables, not the tables: a resumed run cuts off rows written later.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::LazyLock,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use serde::{Deserialize, Serialize};

use super::{
    envelope::{Fault, bytes, opened, sealed_body},
    fingerprint::fingerprint,
};
use crate::{
    folder::OutputFolder,
    names::{self, STATE, STATE_OLD},
    part_file::Mark,
    portraits::{self, Film},
    spill::SpilledRows,
    zarr,
};
use curvelax_base::error::{Error, Result};
use curvelax_curve::outlines;
use curvelax_ensemble::{Ended, Outlines, Paused, RunProgress, Study};
use curvelax_study::{placement::Platform, results::tally::TallySupplement};

/// The content of the file.
type Body = (CheckpointHead, u64, BTreeMap<u64, Ended>, BTreeMap<u64, Paused>);

/// The fingerprint of the layout of all data that `resume` reads.
pub static LAYOUT: LazyLock<u32> = LazyLock::new(fingerprint::<(Body, SpilledRows)>);

/// Facts that do not change during a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// The resolved spec, in TOML.
    pub spec: String,
    /// Where it is computed.
    pub platform: Platform,
    /// Where it was computed before, one sentence each.
    pub moves: Vec<String>,
    /// The folder to which paths in the spec are relative; empty if it has none.
    pub base: String,
    /// The outlines in the spec, with the CRC-32C of each file.
    pub outlines: Vec<(PathBuf, u32)>,
    /// When the run began, since 1970.
    pub started: Duration,
}

/// The part of a checkpoint that is not about members in progress.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckpointHead {
    /// The origin of the run.
    pub origin: Origin,
    /// Wall time of the run so far.
    pub wall: Duration,
    /// Which of the [stages](curvelax_ensemble::Study::stages) is in progress; ranks refer to it.
    pub stage: u64,
    /// Tables, with their extent at this checkpoint.
    pub tables: Vec<Mark>,
    /// The arrays of snapshots.
    pub store: Option<zarr::StoreMark>,
    /// Rows of members that are still running, if these were too many for memory.
    pub rows: Option<Mark>,
    /// Data on the members that ended that are not in their rows.
    pub supplement: TallySupplement,
    /// The first members.
    pub films: Vec<Film>,
}

/// A checkpoint that was read back and is valid.
pub struct Saved {
    /// Progress of the run.
    pub head: CheckpointHead,
    /// Progress of its members.
    pub progress: RunProgress,
    /// Why it is not the last checkpoint, if so.
    pub note: Option<String>,
}

impl Origin {
    /// The origin of a run of `study` that begins now.
    ///
    /// # Errors
    /// [`Error::Request`] for outlines in a current folder without a name.
    pub fn new(study: &Study, platform: Platform) -> Result<Origin> {
        let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let outlines: Vec<(PathBuf, u32)> = files(study.outlines()).into_iter().collect();
        let base = if outlines.is_empty() { String::new() } else { here()? };
        Ok(Origin { spec: study.spec().to_toml()?, platform, moves: Vec::new(), base, outlines, started })
    }

    /// Checks that the outlines of `study`, as read, are those of the beginning.
    ///
    /// # Errors
    /// [`Error::Request`] naming the first that differs.
    pub fn check_outlines(&self, study: &Study) -> Result<()> {
        self.differs(study.outlines()).map_or(Ok(()), |path| Err(self.changed(path)))
    }

    /// The first file of the beginning that is not among these, as it was.
    pub fn differs(&self, outlines: &Outlines) -> Option<&Path> {
        let read = files(outlines);
        self.outlines.iter().find(|(path, crc)| read.get(path) != Some(crc)).map(|(path, _)| path.as_path())
    }

    /// The error that outlines have changed, or else `error`.
    pub fn explain(&self, error: Error) -> Error {
        let read = |path| outlines::read_all(Path::new(&self.base), path).ok();
        let digest = |path| read(path).and_then(|all| all.first().map(|one| one.outline.digest()));
        let changed = self.outlines.iter().find(|(path, crc)| digest(path) != Some(*crc));
        changed.map_or(error, |(path, _)| self.changed(path))
    }

    fn changed(&self, path: &Path) -> Error {
        Error::Request(format!(
            "the outline {} has changed or disappeared since the run began: restore it; where the run's \
             folder still has the file .curvelax.outlines, curvelax resume continues with what was read then",
            Path::new(&self.base).join(path).display()
        ))
    }
}

/// The files of outlines, with the CRC-32C of each as read.
fn files(outlines: &Outlines) -> BTreeMap<PathBuf, u32> {
    outlines.all().map(|one| (one.file.clone(), one.outline.digest())).collect()
}

/// The path of the current folder.
fn here() -> Result<String> {
    let refuse = |what: String| Error::Request(format!("the current folder, where the outline is named from, {what}"));
    let here = std::env::current_dir().map_err(|e| refuse(format!("cannot be found ({e})")))?;
    let name = here.to_str().map(String::from);
    name.ok_or_else(|| refuse(format!("has a name that is not UTF-8: {}; use another one", here.display())))
}

/// The bytes of a checkpoint; `resident` is used instead of that in `progress`.
pub fn to_bytes(head: &CheckpointHead, progress: &RunProgress, resident: &BTreeMap<u64, Paused>) -> Result<Vec<u8>> {
    let body = (head, progress.next, &progress.early, resident);
    sealed_body(*LAYOUT, STATE, &body)
}

/// Reads a checkpoint from bytes.
///
/// # Errors
/// Those of [`opened`].
pub fn from_bytes(bytes: &[u8]) -> Result<(CheckpointHead, RunProgress), Fault> {
    let (head, next, early, resident): Body = opened(*LAYOUT, bytes)?;
    Ok((head, RunProgress { next, early, resident: Some(resident) }))
}

/// Reads the checkpoint at `path`.
pub fn read(path: &Path) -> Result<(CheckpointHead, RunProgress), Fault> {
    from_bytes(&bytes(path)?)
}

/// Members in progress by the last checkpoint in `folder` that have not ended in `progress`. If the current ones are
/// lost, these resume from there.
pub fn in_progress(folder: &OutputFolder, stage: u64, progress: &RunProgress) -> BTreeMap<u64, Paused> {
    let read = |name| read(folder.place(name).at());
    match read(STATE).or_else(|_| read(STATE_OLD)) {
        Ok((head, RunProgress { resident: Some(mut resident), .. })) if head.stage == stage => {
            resident.retain(|rank, _| *rank >= progress.next && !progress.early.contains_key(rank));
            resident
        }
        _ => BTreeMap::new(),
    }
}

/// Returns the last checkpoint in the folder of an interrupted run that is valid and matches its tables; none if
/// nothing is left to do.
///
/// # Errors
/// [`Error::Request`] if there is no run, or none that can be resumed, with the reason.
pub fn find(folder: &OutputFolder) -> Result<Option<Saved>> {
    let path = folder.path();
    let refuse = |problem: String| Err(Error::Request(format!("{}: {problem}", path.display())));
    let mut faults = Vec::new();
    for name in [STATE, STATE_OLD] {
        match folder.place(name).at().try_exists() {
            Ok(true) => {}
            Ok(false) => continue,
            Err(e) => return refuse(format!("cannot find {name} in it ({e})")),
        }
        let found = read(folder.place(name).at()).and_then(|(head, progress)| {
            let tables = head.tables.iter().chain(&head.rows).try_for_each(|mark| folder.check(mark));
            let store = head.store.as_ref().map_or(Ok(()), |mark| folder.check_store(mark));
            let films = portraits::check(&head.films);
            tables.and(store).and(films).map_err(Fault::Damaged).map(|()| (head, progress))
        });
        match found {
            Ok((head, progress)) => {
                let note = faults.pop().map(|fault| format!("{fault}; continuing from the checkpoint before it"));
                return Ok(Some(Saved { head, progress, note }));
            }
            Err(Fault::Foreign(what)) => {
                return refuse(format!("{name}: {what}; resume with the version that started it, or start over"));
            }
            Err(Fault::Damaged(what)) => faults.push(format!("{name}: {what}")),
        }
    }
    match faults.is_empty() {
        // Nothing is left to do for a complete run.
        true if path.join(names::RUN).is_file() => crate::reader::provenance(path).map(|_| None),
        true => refuse("no interrupted run: it had not started; curvelax run with --force starts it".into()),
        false => refuse(format!(
            "no checkpoint to continue from: {}; start over with curvelax run and --force",
            faults.join(", ")
        )),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::state::{envelope::sealed, fingerprint::layout};
    use curvelax_ensemble::{Extent, Features, Mollified, Rows, SeriesRow, Snapshot, Status};
    use curvelax_flow::scheme::member::{Counters, Report};
    use curvelax_study::samples::{outcome, platform};

    fn paused(at: f64) -> Paused {
        Paused {
            until: 2.0 * at,
            energies: vec![[0.0, at]],
            counters: Counters { steps: 7, ..Counters::default() },
            report: Report::default(),
            state: vec![at, f64::NAN, -0.0],
            sweeps: [1, u64::MAX],
            served: 1,
            rows: Rows {
                spilled: vec![Extent { at: 1 << 40, length: 9, crc: 3 }],
                series: vec![SeriesRow { member: 1, t: 0.5, at: Default::default() }],
                snapshots: Vec::new(),
            },
            frames: vec![(0.25, vec![glam::DVec2::new(1.0, 2.0)])],
            crossed: Some(0.1),
            events: vec![Some(0.05), None],
            look_at: 0.2,
        }
    }

    fn state() -> (CheckpointHead, RunProgress) {
        let origin = Origin {
            spec: "curves = 3\n".into(),
            platform: platform(),
            moves: vec!["from there".into()],
            base: "/somewhere".into(),
            outlines: vec![("island.csv".into(), 7)],
            started: Duration::from_secs(1_800_000_000),
        };
        let head = CheckpointHead {
            origin,
            wall: Duration::from_millis(1500),
            stage: 0,
            tables: vec![Mark { name: "summary.csv".into(), length: 300, crc: 5 }],
            store: None,
            rows: Some(Mark { name: "curvelax.rows".into(), length: 1 << 41, crc: 6 }),
            supplement: TallySupplement::default(),
            films: Vec::new(),
        };
        let early = Ended {
            outcome: outcome(2, Status::Relaxed, Some(0.5)),
            features: Features(vec![0.5, f64::MAX]),
            excess: vec![0.5],
            rows: Rows {
                snapshots: vec![Snapshot { member: 2, t: 0.0, x: vec![1.0], y: vec![2.0], k: vec![3.0], r: vec![4.0] }],
                ..Rows::default()
            },
            portrait: None,
            mollified: Mollified::default(),
            unresolved: true,
        };
        let resident = Some(BTreeMap::from([(1, paused(1.5)), (3, paused(2.5))]));
        (head, RunProgress { next: 1, early: BTreeMap::from([(2, early)]), resident })
    }

    fn bytes() -> Vec<u8> {
        let (head, progress) = state();
        to_bytes(&head, &progress, progress.resident.as_ref().unwrap()).unwrap()
    }

    #[test]
    fn a_state_reads_back_to_the_last_bit() {
        let (head, progress) = from_bytes(&bytes()).unwrap();
        assert_eq!(head, state().0);
        assert_eq!((progress.next, &progress.early), (1, &state().1.early));
        let resident = progress.resident.unwrap();
        assert_eq!(resident.keys().collect::<Vec<_>>(), [&1, &3]);
        let bits = |state: &[f64]| state.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&resident[&3].state), bits(&paused(2.5).state));
        assert_eq!(Paused { state: Vec::new(), ..resident[&1].clone() }, Paused { state: Vec::new(), ..paused(1.5) });
    }

    #[test]
    fn every_bit_and_every_length_counts() {
        let whole = bytes();
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(matches!(from_bytes(&flipped), Err(Fault::Damaged(_))), "bit {bit}");
        }
        for length in 0..whole.len() {
            assert!(matches!(from_bytes(&whole[..length]), Err(Fault::Damaged(_))), "{length} bytes");
        }
        assert!(matches!(from_bytes(&[&whole[..], &[0]].concat()), Err(Fault::Damaged(_))));
    }

    #[test]
    fn the_layout_has_every_type_that_is_written() {
        let layout = layout::<(Body, SpilledRows)>().unwrap();
        let named: BTreeSet<&str> = layout.split(' ').filter(|word| word.starts_with(char::is_uppercase)).collect();
        let expected = [
            ["CheckpointHead", "Origin", "Platform", "DeviceKind", "Precision", "Duration", "Mark", "Film"],
            ["TallySupplement", "MollifiedMembers", "Moments", "ExactSum", "Ended", "Outcome", "Status", "Observables"],
            ["Rows", "Extent", "SeriesRow", "Snapshot", "Portrait", "Mollified", "DVec2", "Paused"],
            ["Counters", "Report", "Observed", "Progress", "Decay", "StoreMark", "ArrayMark", "Features"],
            ["Spread", "Treated", "", "", "", "", "", ""],
        ];
        let expected: BTreeSet<&str> = expected.into_iter().flatten().filter(|name| !name.is_empty()).collect();
        assert_eq!(named, expected);
        for part in [
            "spec: string",
            "state: list f64",
            "events: list option f64",
            "outlines: list ( string u32",
            "low: u128",
            "excess_at: ( f64 f64",
        ] {
            assert!(layout.contains(part), "{part}: {layout}");
        }
    }

    #[test]
    fn a_state_of_a_build_with_other_types_is_refused_with_the_remedy() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let (head, progress) = state();
        let body = (&head, progress.next, &progress.early, progress.resident.as_ref().unwrap());
        folder.keep_state(&sealed_body(*LAYOUT ^ 1, STATE, &body).unwrap()).unwrap();
        let Err(error) = find(&folder) else { panic!("it is read") };
        let (path, own, other) = (home.path().display(), *LAYOUT, *LAYOUT ^ 1);
        let expected = format!(
            "{path}: .curvelax.state: another build of curvelax {} wrote it: its layout is {other:08x}, and that of this \
             build is {own:08x}; resume with the version that started it, or start over",
            curvelax_base::VERSION
        );
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn the_seeds_of_the_fuzzer_are_states_of_this_version() {
        let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/checkpoint");
        let mut members = 0;
        for seed in std::fs::read_dir(&seeds).unwrap() {
            let body = std::fs::read(seed.unwrap().path()).unwrap();
            let write = |bytes: Vec<u8>| Ok::<_, ()>([&bytes[..], body.strip_prefix(b"s").unwrap()].concat());
            let (_, progress) = from_bytes(&sealed(*LAYOUT, write).unwrap()).unwrap();
            members += progress.resident.unwrap().len();
        }
        assert!(members >= 3, "{members}");
    }

    #[test]
    fn members_that_ended_since_are_no_longer_in_progress() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        folder.keep_state(&bytes()).unwrap();
        let ranks = |stage: u64, progress: &RunProgress| -> Vec<u64> {
            in_progress(&folder, stage, progress).into_keys().collect()
        };
        let none = RunProgress::default();
        assert_eq!(ranks(0, &none), [1, 3]);
        assert_eq!(ranks(0, &RunProgress { next: 2, ..none.clone() }), [3]);
        assert_eq!(
            ranks(0, &RunProgress { early: BTreeMap::from([(3, state().1.early[&2].clone())]), ..none.clone() }),
            [1]
        );
        assert_eq!(ranks(1, &none), [0; 0], "of another stage");
    }
}
