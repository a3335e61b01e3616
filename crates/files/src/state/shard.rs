//! `shard.state`: the data that a merge needs from a shard besides its tables.
//!
//! It is [sealed](super::envelope) like a checkpoint, and has the length and the checksum of every table of the shard,
//! so that an incomplete copy is detected.

use std::{
    io,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use serde::{Deserialize, Serialize};

use super::{
    checkpoint::{self, CheckpointHead},
    envelope::{self, Fault, opened, sealed_body},
    fingerprint::fingerprint,
};
use crate::{
    claim,
    growing::Growing,
    names::{PORTRAITS, RUN, SHARD, SHOWN, STATE, STATE_OLD},
    part_file::Mark,
    portraits, reader,
};
use curvelax_base::{
    error::{Error, Result, one_line, shortened},
    text::quoted,
};
use curvelax_ensemble::{Shard, Spec};
use curvelax_study::results::provenance::rfc3339;

/// Keys that a resumed run may change.
const MOVED_KEYS: [&str; 3] = ["threads", "backend", "adapter"];

/// The fingerprint of the layout of the file's content.
pub static LAYOUT: LazyLock<u32> = LazyLock::new(fingerprint::<Record>);

/// The content of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// As in the last checkpoint of the run: all members have ended.
    pub head: CheckpointHead,
    /// Nodes per member, if all have the same number.
    pub points: usize,
    /// Warnings that do not follow from the results, one sentence each.
    pub warnings: Vec<String>,
}

/// A complete shard.
pub struct FinishedShard {
    /// Its folder.
    pub path: PathBuf,
    /// Which shard it is.
    pub shard: Shard,
    /// Its resolved spec.
    pub spec: Spec,
    /// The rest.
    pub record: Record,
}

/// The content of the folder of a shard.
pub enum Found {
    /// Everything.
    Done(Box<FinishedShard>),
    /// Not everything, and why.
    Unfinished {
        /// The folder.
        path: PathBuf,
        /// The spec, if it is known.
        spec: Option<Box<Spec>>,
        /// What there is instead, and the remedy.
        why: String,
    },
}

/// The bytes of the file.
pub fn to_bytes(head: &CheckpointHead, points: usize, warnings: &[String]) -> Result<Vec<u8>> {
    sealed_body(*LAYOUT, SHARD, &(head, points, warnings))
}

/// Reads the file from bytes.
///
/// # Errors
/// A [`Fault`] unless the bytes are complete and written by this version of the program.
pub fn from_bytes(bytes: &[u8]) -> Result<Record, Fault> {
    let record: Record = opened(*LAYOUT, bytes)?;
    portraits::check(&record.head.films).map_err(Fault::Damaged)?;
    Ok(record)
}

/// Examines the folder of a shard without changing it.
///
/// # Errors
/// [`Error::Request`] if it is not the folder of a shard, or has something that no shard of this program wrote.
pub fn look(path: &Path) -> Result<Found> {
    let unfinished = |spec: Option<Spec>, why: String| {
        Ok(Found::Unfinished { path: path.to_path_buf(), spec: spec.map(Box::new), why })
    };
    match path.metadata() {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return unfinished(None, "no such folder".into()),
        Err(e) => return Err(refused(path, &format!("cannot be found ({e})"))),
        Ok(of) if !of.is_dir() => return Err(refused(path, "not a folder; give that of a shard")),
        Ok(_) => {}
    }
    // Read first: a run that ends meanwhile removes its checkpoints.
    let states = [STATE, STATE_OLD].map(|name| checkpoint::read(&path.join(name)).ok());
    if let Some(why) = unfinished_run(path)? {
        let head = states.iter().flatten().next().map(|(head, _)| head);
        return unfinished(head.and_then(|head| Spec::from_toml(&head.origin.spec).ok()), why);
    }
    if there(path, SHARD)? {
        return Ok(Found::Done(Box::new(part(path)?)));
    }
    match there(path, RUN)? {
        true => Err(refused(path, &format!("the run there is not a shard: it has no {SHARD}"))),
        false => unfinished(None, "no shard was finished here".into()),
    }
}

/// Why the run at `path` is incomplete, if there is one.
fn unfinished_run(path: &Path) -> Result<Option<String>> {
    if claim::is_held(path) {
        return Ok(Some("a run is writing here".into()));
    }
    let interrupted = there(path, STATE)? || there(path, STATE_OLD)?;
    Ok(interrupted.then(|| format!("interrupted; curvelax resume {} continues it", quoted(path))))
}

/// The complete shard at `path`; its tables have their recorded lengths.
fn part(path: &Path) -> Result<FinishedShard> {
    let faulty = |fault: &str| faulty(path, SHARD, fault);
    let read = envelope::bytes(&path.join(SHARD)).and_then(|bytes| from_bytes(&bytes));
    let record = read.map_err(|(Fault::Foreign(what) | Fault::Damaged(what))| faulty(&what))?;
    let spec = Spec::from_toml(&record.head.origin.spec).and_then(|spec| spec.validate().map_err(|e| e.to_string()));
    let spec = spec.map_err(|e| faulty(&format!("its spec: {}", shortened(&one_line(&e), SHOWN))))?;
    let Some(shard) = spec.shard else {
        return Err(faulty("its spec is not of a shard"));
    };
    if !record.head.tables.iter().map(|mark| mark.name.as_str()).eq(Growing::names(&spec)) {
        return Err(faulty("it lists other files than its spec asks for"));
    }
    record.head.tables.iter().try_for_each(|mark| check_length(path, mark))?;
    check_beside(path, &spec, &record.head)?;
    Ok(FinishedShard { path: path.to_path_buf(), shard, spec, record })
}

/// Checks that the files which a merge makes anew are those of the shard of `spec`, as far as they are there: their
/// folder may be a mixture.
fn check_beside(path: &Path, spec: &Spec, CheckpointHead { origin, films, .. }: &CheckpointHead) -> Result<()> {
    if there(path, RUN)? {
        let own = reader::provenance(path)?;
        if let Some((key, here, there)) = own.spec.difference(spec, &MOVED_KEYS) {
            return Err(faulty(path, RUN, &format!("of another run: {key} is {here}, and {there} in {SHARD}")));
        }
        let started = rfc3339(origin.started);
        if own.started != started {
            let fault = format!("of another run: begun at {}, and that of {SHARD} at {started}", own.started);
            return Err(faulty(path, RUN, &fault));
        }
    }
    if there(path, PORTRAITS)? && portraits::read(&path.join(PORTRAITS))? != *films {
        return Err(faulty(path, PORTRAITS, &format!("other portraits than those in {SHARD}")));
    }
    Ok(())
}

/// Checks that the table in the folder at `path` has the length that the shard wrote.
fn check_length(path: &Path, mark: &Mark) -> Result<()> {
    let fault = match path.join(&mark.name).metadata().map(|of| of.len()) {
        Ok(length) if length == mark.length => return Ok(()),
        Ok(length) => format!("{length} bytes, and the shard wrote {}", mark.length),
        Err(e) => format!("cannot be found ({e})"),
    };
    Err(faulty(path, &mark.name, &fault))
}

fn there(path: &Path, name: &str) -> Result<bool> {
    let found = path.join(name).try_exists();
    found.map_err(|e| refused(path, &format!("cannot find {name} in it ({e})")))
}

fn refused(path: &Path, problem: &str) -> Error {
    Error::Request(format!("{}: {problem}", path.display()))
}

fn faulty(path: &Path, name: &str, fault: &str) -> Error {
    Error::Request(format!("{}: {fault}; copy the shard again, or run it again", path.join(name).display()))
}
