//! The state of a run on disk, from which `resume` goes on: the files `.curvelax.state` and, one older,
//! `.curvelax.state.old`.
//!
//! A file is 16 bytes of magic, the version of the format (4), the length of the body (8), the body, and the CRC-32C of all
//! of it (4), integers little-endian. The body is what [`Head`] and [`Standing`] are, as postcard writes it. Tables are not
//! in it, but how long they were and their checksums: a run that goes on cuts off what came later.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read, Seek},
    path::{Path, PathBuf},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use serde::{Deserialize, Serialize};

use crate::{
    curve::{Outline, Shape},
    ensemble::{Cell, Ended, Paused, Standing, Study},
    error::{Error, Result},
    files::{
        disk,
        folder::OutputFolder,
        names::{self, STATE, STATE_OLD},
        part_file::Mark,
        portraits::Film,
        zarr,
    },
    input,
    placement::Platform,
    results::tally::Aside,
};

const MAGIC: [u8; 16] = *b"curvelax state\r\n";
/// Version of the format.
const VERSION: u32 = 2;
/// Bytes before the body, and after it.
const BEFORE: usize = MAGIC.len() + 4 + 8;
const AFTER: usize = 4;

const WRONG_CHECKSUM: &str = "its checksum is wrong";

/// What does not change while a run goes on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// The resolved spec, in TOML.
    pub spec: String,
    /// Where it is computed.
    pub platform: Platform,
    /// Where it was computed before, a sentence each.
    pub moves: Vec<String>,
    /// The folder that paths in the spec begin at; nothing where it has none.
    pub base: String,
    /// The outlines in the spec, with the CRC-32C of each file.
    pub outlines: Vec<(PathBuf, u32)>,
    /// When the run began, since 1970.
    pub started: Duration,
}

/// What a state says beside the members on their way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// How it all began.
    pub origin: Origin,
    /// Wall time of the run so far.
    pub wall: Duration,
    /// Which of the [cohorts](crate::ensemble::Study::cohorts) the ranks are of.
    pub cohort: u64,
    /// Tables, as far as they are told by this state.
    pub tables: Vec<Mark>,
    /// The arrays of snapshots.
    pub store: Option<zarr::Mark>,
    /// Rows of members that have not left yet, where they were too many for memory.
    pub rows: Option<Mark>,
    /// Of the members that ended, what their rows do not say.
    pub aside: Aside,
    /// The first members.
    pub films: Vec<Film>,
}

/// A state that was read back and found whole.
pub struct Saved {
    /// Where the run stood.
    pub head: Head,
    /// Its members.
    pub standing: Standing,
    /// Why it is not the last state, if so.
    pub note: Option<String>,
}

/// Why bytes are no state.
#[derive(Debug, PartialEq, Eq)]
pub enum Fault {
    /// They are no state of this program, or of another version of it: nothing else is to be tried.
    Foreign(String),
    /// They are one that was changed or cut off.
    Damaged(String),
}

impl Origin {
    /// That of a run of `cells` which begins now.
    ///
    /// # Errors
    /// [`Error::Request`] for outlines in a current folder without a name.
    pub fn new(study: &Study, platform: Platform) -> Result<Origin> {
        let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let outlines: Vec<(PathBuf, u32)> = outlines(study).into_iter().collect();
        let base = if outlines.is_empty() { String::new() } else { here()? };
        Ok(Origin { spec: study.spec().to_toml()?, platform, moves: Vec::new(), base, outlines, started })
    }

    /// That the outlines of `study`, as they were read, are those of the beginning.
    ///
    /// # Errors
    /// [`Error::Request`] naming the first that is not.
    pub fn check_outlines(&self, study: &Study) -> Result<()> {
        let read = outlines(study);
        match self.outlines.iter().find(|(path, crc)| read.get(path) != Some(crc)) {
            None => Ok(()),
            Some((path, _)) => Err(self.changed(path)),
        }
    }

    /// The error of outlines that are not those of the beginning, or `error` where they are.
    pub fn explain(&self, error: Error) -> Error {
        let read = |path| Outline::read_from(Path::new(&self.base), path).ok();
        let changed = self.outlines.iter().find(|(path, crc)| read(path).map(|outline| outline.digest()) != Some(*crc));
        changed.map_or(error, |(path, _)| self.changed(path))
    }

    fn changed(&self, path: &Path) -> Error {
        Error::Request(format!(
            "the outline {} has changed since the run began, or is gone: restore it, or begin anew",
            Path::new(&self.base).join(path).display()
        ))
    }
}

/// The outlines of a study with the CRC-32C of what was read of each.
fn outlines(study: &Study) -> BTreeMap<PathBuf, u32> {
    let outline = |cell: &Cell| match &cell.spec.shape {
        Shape::File(path) => Some((path.clone(), cell.family.outline()?.digest())),
        _ => None,
    };
    study.cells().iter().filter_map(outline).collect()
}

/// The current folder, by name.
fn here() -> Result<String> {
    let refuse = |what: String| Error::Request(format!("the current folder, where the outline is named from, {what}"));
    let here = std::env::current_dir().map_err(|e| refuse(format!("cannot be found ({e})")))?;
    let name = here.to_str().map(String::from);
    name.ok_or_else(|| refuse(format!("has a name that is not UTF-8: {}; go to another one", here.display())))
}

/// The bytes of a state; `resident` takes the place of that in `standing`.
pub fn to_bytes(head: &Head, standing: &Standing, resident: &BTreeMap<u64, Paused>) -> Result<Vec<u8>> {
    let body = (head, standing.next, &standing.early, resident);
    sealed_body(&body).map_err(|e| Error::Failed(format!("cannot write {STATE}: {e}")))
}

/// A file of this version of the program with this body.
pub fn sealed_body(body: &impl Serialize) -> postcard::Result<Vec<u8>> {
    let body = (env!("CARGO_PKG_VERSION"), body);
    let size = postcard::experimental::serialized_size(&body)?;
    sealed(|mut bytes| {
        // A state may be large: no more room for it than it takes.
        bytes.reserve_exact(size + AFTER);
        postcard::to_extend(&body, bytes)
    })
}

/// A file with the body that `write` appends to its beginning.
pub fn sealed<E>(write: impl FnOnce(Vec<u8>) -> Result<Vec<u8>, E>) -> Result<Vec<u8>, E> {
    let mut before = MAGIC.to_vec();
    before.extend(VERSION.to_le_bytes());
    before.extend([0; 8]);
    let mut bytes = write(before)?;
    let length = (bytes.len() - BEFORE) as u64;
    bytes[BEFORE - 8..BEFORE].copy_from_slice(&length.to_le_bytes());
    let crc = crc32c::crc32c(&bytes);
    bytes.extend(crc.to_le_bytes());
    Ok(bytes)
}

/// The body of a [sealed](sealed_body) file.
///
/// # Errors
/// A [`Fault`] for anything but all the bytes that this version of the program wrote.
pub fn opened(bytes: &[u8]) -> Result<&[u8], Fault> {
    let damaged = |what: &str| Err(Fault::Damaged(what.into()));
    let mut rest = bytes;
    let (Some(magic), Some(version), Some(length)) =
        (take::<16>(&mut rest), take::<4>(&mut rest), take::<8>(&mut rest))
    else {
        return damaged(&format!("it has {} bytes, fewer than any state", bytes.len()));
    };
    let (version, length) = (u32::from_le_bytes(version), u64::from_le_bytes(length));
    let whole = length.checked_add((BEFORE + AFTER) as u64);
    if whole != Some(bytes.len() as u64) {
        return damaged(&format!("it has {} bytes where {length} and {} are told", bytes.len(), BEFORE + AFTER));
    }
    let (all, crc) = bytes.split_at(bytes.len() - AFTER);
    if crc32c::crc32c(all).to_le_bytes() != *crc {
        return damaged(WRONG_CHECKSUM);
    }
    // Whole, so what follows is no accident.
    if magic != MAGIC {
        return Err(Fault::Foreign("it is no state of curvelax".into()));
    }
    if version != VERSION {
        let message = format!("its format is {version}, and that of this version is {VERSION}");
        return Err(Fault::Foreign(message));
    }
    let own = env!("CARGO_PKG_VERSION");
    let (program, body) = postcard::take_from_bytes::<&str>(&rest[..rest.len() - AFTER]).map_err(unreadable)?;
    if program != own {
        return Err(Fault::Foreign(format!("it is of curvelax {program}, and this is {own}, whose digits may differ")));
    }
    Ok(body)
}

/// Reads what [`opened`] gave.
pub fn body<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, Fault> {
    match postcard::take_from_bytes(bytes).map_err(unreadable)? {
        (body, []) => Ok(body),
        _ => Err(Fault::Damaged("there is more in it than a state".into())),
    }
}

fn unreadable(e: postcard::Error) -> Fault {
    Fault::Damaged(format!("it cannot be read ({e})"))
}

/// Reads a state back.
///
/// # Errors
/// As [`opened`].
pub fn from_bytes(bytes: &[u8]) -> Result<(Head, Standing), Fault> {
    type Body = (Head, u64, BTreeMap<u64, Ended>, BTreeMap<u64, Paused>);
    let (head, next, early, resident): Body = body(opened(bytes)?)?;
    Ok((head, Standing { next, early, resident: Some(resident) }))
}

/// The length of the body, as the bytes before it tell.
fn told(before: &[u8]) -> Option<u64> {
    before.get(BEFORE - 8..BEFORE)?.try_into().ok().map(u64::from_le_bytes)
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*first)
}

/// Reads the state at `path`.
pub fn read(path: &Path) -> Result<(Head, Standing), Fault> {
    from_bytes(&bytes(path)?)
}

/// The bytes of the file at `path`, or the first of them if it is not sealed.
pub fn bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    let bytes = input::open(path).and_then(|mut file| {
        let length = file.metadata()?.len();
        let mut bytes = Vec::new();
        // Whatever else it is, it is not read to its end if that is not where it says.
        (&file).take(BEFORE as u64).read_to_end(&mut bytes)?;
        let told = told(&bytes).and_then(|told| told.checked_add((BEFORE + AFTER) as u64));
        if told == Some(length) {
            // Nor into memory, if it is not what was written.
            check_whole(&mut file, length)?;
            file.rewind()?;
            bytes.clear();
            file.take(length).read_to_end(&mut bytes)?;
        }
        Ok(bytes)
    });
    bytes.map_err(|e| Fault::Damaged(e.to_string()))
}

/// That the last of the `length` bytes are the checksum of those before them, read piece by piece.
fn check_whole(file: &mut File, length: u64) -> io::Result<()> {
    if length > input::MAX_STATE {
        return Err(io::Error::other(format!("it has {length} bytes; at most {} are read", input::MAX_STATE)));
    }
    file.rewind()?;
    let (_, crc) = disk::checksum(&mut (&*file).take(length - AFTER as u64), 0)?;
    let mut last = [0; AFTER];
    file.read_exact(&mut last)?;
    if crc.to_le_bytes() == last { Ok(()) } else { Err(io::Error::other(WRONG_CHECKSUM)) }
}

/// Members on their way by the last state in `folder`, of those that have not ended in `standing`: where they are lost,
/// they go on from there.
pub fn on_their_way(folder: &OutputFolder, cohort: u64, standing: &Standing) -> BTreeMap<u64, Paused> {
    let read = |name| read(folder.place(name).at());
    match read(STATE).or_else(|_| read(STATE_OLD)) {
        Ok((head, Standing { resident: Some(mut resident), .. })) if head.cohort == cohort => {
            resident.retain(|rank, _| *rank >= standing.next && !standing.early.contains_key(rank));
            resident
        }
        _ => BTreeMap::new(),
    }
}

/// The last state in the folder of an interrupted run that is whole and has its tables; none where nothing is left to do.
///
/// # Errors
/// [`Error::Request`] where there is no run, or none that can go on, with the reason.
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
        let found = read(folder.place(name).at()).and_then(|(head, standing)| {
            let tables = head.tables.iter().chain(&head.rows).try_for_each(|mark| folder.check(mark));
            let store = head.store.as_ref().map_or(Ok(()), |mark| folder.check_store(mark));
            let film = head.films.iter().find_map(|film| Some((film.member, film.fault()?)));
            let films =
                film.map_or(Ok(()), |(member, fault)| Err(format!("the portrait of member {member} has not {fault}")));
            tables.and(store).and(films).map_err(Fault::Damaged).map(|()| (head, standing))
        });
        match found {
            Ok((head, standing)) => {
                let note = faults.pop().map(|fault| format!("{fault}; going on from the state before it"));
                return Ok(Some(Saved { head, standing, note }));
            }
            Err(Fault::Foreign(what)) => {
                return refuse(format!("{name}: {what}; resume with the program that began it, or begin anew"));
            }
            Err(Fault::Damaged(what)) => faults.push(format!("{name}: {what}")),
        }
    }
    match faults.is_empty() {
        // What is left to do of a run that is complete is nothing.
        true if path.join(names::RUN).is_file() => super::reader::provenance(path).map(|_| None),
        true => refuse("no run that was interrupted: it had not begun; curvelax run with --force begins it".into()),
        false => {
            refuse(format!("no state to go on from: {}; begin anew with curvelax run and --force", faults.join(", ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        ensemble::{Extent, Mollified, Rows, SeriesRow, Snapshot, Status},
        results::{provenance::tests::platform, tally::tests::outcome},
        scheme::member::{Counters, Report},
    };

    fn paused(at: f64) -> Paused {
        Paused {
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
            look_at: 0.2,
        }
    }

    fn state() -> (Head, Standing) {
        let origin = Origin {
            spec: "curves = 3\n".into(),
            platform: platform(),
            moves: vec!["from there".into()],
            base: "/somewhere".into(),
            outlines: vec![("island.csv".into(), 7)],
            started: Duration::from_secs(1_800_000_000),
        };
        let head = Head {
            origin,
            wall: Duration::from_millis(1500),
            cohort: 0,
            tables: vec![Mark { name: "summary.csv".into(), length: 300, crc: 5 }],
            store: None,
            rows: Some(Mark { name: "curvelax.rows".into(), length: 1 << 41, crc: 6 }),
            aside: Aside::default(),
            films: Vec::new(),
        };
        let early = Ended {
            outcome: outcome(2, Status::Relaxed, Some(0.5)),
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
        (head, Standing { next: 1, early: BTreeMap::from([(2, early)]), resident })
    }

    fn bytes() -> Vec<u8> {
        let (head, standing) = state();
        to_bytes(&head, &standing, standing.resident.as_ref().unwrap()).unwrap()
    }

    #[test]
    fn a_state_reads_back_to_the_last_bit() {
        let (head, standing) = from_bytes(&bytes()).unwrap();
        assert_eq!(head, state().0);
        assert_eq!((standing.next, &standing.early), (1, &state().1.early));
        let resident = standing.resident.unwrap();
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

    /// The bytes with a right length and checksum again.
    fn sealed_again(mut bytes: Vec<u8>) -> Vec<u8> {
        bytes.truncate(bytes.len() - AFTER);
        let length = (bytes.len() - BEFORE) as u64;
        bytes[BEFORE - 8..BEFORE].copy_from_slice(&length.to_le_bytes());
        bytes.extend(crc32c::crc32c(&bytes).to_le_bytes());
        bytes
    }

    #[test]
    fn what_another_program_wrote_is_told_from_damage() {
        let with = |at: usize, byte: u8| {
            let mut bytes = bytes();
            bytes[at] = byte;
            from_bytes(&sealed_again(bytes)).unwrap_err()
        };
        assert_eq!(with(0, b'C'), Fault::Foreign("it is no state of curvelax".into()));
        let newer = Fault::Foreign("its format is 3, and that of this version is 2".into());
        assert_eq!(with(MAGIC.len(), 3), newer);
        let Fault::Foreign(message) = with(BEFORE + 1, b'9') else { panic!("another version of the program") };
        assert!(message.starts_with("it is of curvelax 9."), "{message}");
        // Whole, but no state: written by a program with the same numbers and other types.
        let mut longer = bytes();
        longer.push(0);
        assert_eq!(from_bytes(&sealed_again(longer)), Err(Fault::Damaged("there is more in it than a state".into())));
        let mut shorter = bytes();
        shorter.truncate(shorter.len() - 9);
        assert!(
            matches!(from_bytes(&sealed_again(shorter)), Err(Fault::Damaged(what)) if what.starts_with("it cannot be read"))
        );
    }

    #[test]
    fn the_seeds_of_the_fuzzer_are_states_of_this_version() {
        let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/checkpoint");
        let mut members = 0;
        for seed in std::fs::read_dir(&seeds).unwrap() {
            let body = std::fs::read(seed.unwrap().path()).unwrap();
            let write = |bytes: Vec<u8>| Ok::<_, ()>([&bytes[..], body.strip_prefix(b"s").unwrap()].concat());
            let (_, standing) = from_bytes(&sealed(write).unwrap()).unwrap();
            members += standing.resident.unwrap().len();
        }
        assert!(members >= 3, "{members}");
    }

    #[test]
    fn members_that_ended_since_are_no_longer_on_their_way() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(home.path(), true).unwrap();
        folder.keep_state(&bytes()).unwrap();
        let ranks = |cohort: u64, standing: &Standing| -> Vec<u64> {
            on_their_way(&folder, cohort, standing).into_keys().collect()
        };
        let none = Standing::default();
        assert_eq!(ranks(0, &none), [1, 3]);
        assert_eq!(ranks(0, &Standing { next: 2, ..none.clone() }), [3]);
        assert_eq!(
            ranks(0, &Standing { early: BTreeMap::from([(3, state().1.early[&2].clone())]), ..none.clone() }),
            [1]
        );
        assert_eq!(ranks(1, &none), [0; 0], "of another cohort");
    }
}
