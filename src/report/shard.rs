//! `shard.state`: what a [merge](super::merge) has to know of a shard beside its tables.
//!
//! It is sealed as a [state](super::checkpoint) is, and has the length and the checksum of every table of the shard, so that
//! one that was copied by half is known.

use std::{
    io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{
    checkpoint::{self, Fault, Head},
    growing::Growing,
};
use crate::files::{
    claim,
    names::{RUN, SHARD, STATE, STATE_OLD},
};
use crate::{
    ensemble::{Shard, Spec},
    error::{Error, Result, one_line, shortened},
};

/// Characters of a fault in a message.
const SHOWN: usize = 200;

/// What is in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// As in the last state of the run: all members have ended.
    pub head: Head,
    /// Nodes of a member, where all have the same.
    pub points: usize,
    /// What the user was told beside what follows from the results, a sentence each.
    pub warnings: Vec<String>,
}

/// A shard that is done.
pub struct Part {
    /// Its folder.
    pub path: PathBuf,
    /// Which one it is.
    pub shard: Shard,
    /// Its resolved spec.
    pub spec: Spec,
    /// The rest.
    pub record: Record,
}

/// What the folder of a shard has.
pub enum Found {
    /// All of it.
    Done(Box<Part>),
    /// Not all, and why.
    Unfinished {
        /// The folder.
        path: PathBuf,
        /// The spec, if it tells one.
        spec: Option<Box<Spec>>,
        /// What there is instead, and what to do.
        why: String,
    },
}

/// The bytes of the file.
pub fn to_bytes(head: &Head, points: usize, warnings: &[String]) -> Result<Vec<u8>> {
    checkpoint::sealed_body(&(head, points, warnings)).map_err(|e| Error::Failed(format!("cannot write {SHARD}: {e}")))
}

/// Reads it back.
///
/// # Errors
/// A [`Fault`] for anything but all the bytes that this version of the program wrote.
pub fn from_bytes(bytes: &[u8]) -> Result<Record, Fault> {
    let record: Record = checkpoint::body(checkpoint::opened(bytes)?)?;
    match record.head.films.iter().find_map(|film| Some((film.member, film.fault()?))) {
        Some((member, fault)) => Err(Fault::Damaged(format!("the portrait of member {member} has not {fault}"))),
        None => Ok(record),
    }
}

/// Looks at the folder of a shard, and changes nothing there.
///
/// # Errors
/// [`Error::Request`] where it is the folder of something else, or has what no shard of this program wrote.
pub fn look(path: &Path) -> Result<Found> {
    let refuse = |problem: String| Err(Error::Request(format!("{}: {problem}", path.display())));
    let unfinished = |spec: Option<Spec>, why: String| {
        Ok(Found::Unfinished { path: path.to_path_buf(), spec: spec.map(Box::new), why })
    };
    let there = |name: &str| {
        let found = path.join(name).try_exists();
        found.map_err(|e| Error::Request(format!("{}: cannot find {name} in it ({e})", path.display())))
    };
    match path.metadata() {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return unfinished(None, "no such folder".into()),
        Err(e) => return refuse(format!("cannot be found ({e})")),
        Ok(of) if !of.is_dir() => return refuse("no folder; name that of a shard".into()),
        Ok(_) => {}
    }
    let states = [STATE, STATE_OLD].map(|name| checkpoint::read(&path.join(name)).ok());
    let spec = || states.iter().flatten().next().and_then(|(head, _)| Spec::from_toml(&head.origin.spec).ok());
    if claim::is_held(path) {
        return unfinished(spec(), "a run is writing here".into());
    }
    if there(STATE)? || there(STATE_OLD)? {
        let resume = format!("interrupted; curvelax resume {} goes on with it", path.display());
        return unfinished(spec(), resume);
    }
    if !there(SHARD)? {
        return match there(RUN)? {
            true => refuse(format!("the run there is no shard: it has no {SHARD}")),
            false => unfinished(None, "no shard was finished here".into()),
        };
    }
    let faulty = |name: &str, fault: &str| {
        format!("{}: {fault}; copy the shard again, or run it again", path.join(name).display())
    };
    let read = checkpoint::bytes(&path.join(SHARD)).and_then(|bytes| from_bytes(&bytes));
    let record = read.map_err(|fault| {
        let (Fault::Foreign(what) | Fault::Damaged(what)) = fault;
        Error::Request(faulty(SHARD, &what))
    })?;
    let spec = Spec::from_toml(&record.head.origin.spec).map_err(|e| e.to_string());
    let spec = spec.and_then(|spec| spec.validate().map_err(|e| e.to_string()));
    let fault = |e: String| faulty(SHARD, &format!("its spec: {}", shortened(&one_line(&e), SHOWN)));
    let spec = spec.map_err(|e| Error::Request(fault(e)))?;
    let Some(shard) = spec.shard else {
        return Err(Error::Request(faulty(SHARD, "its spec is not of a shard")));
    };
    if !record.head.tables.iter().map(|mark| mark.name.as_str()).eq(Growing::names(&spec)) {
        return Err(Error::Request(faulty(SHARD, "it tells of other files than its spec asks for")));
    }
    for mark in &record.head.tables {
        let length = path.join(&mark.name).metadata().map(|of| of.len());
        let fault = match length {
            Ok(length) if length == mark.length => continue,
            Ok(length) => format!("{length} bytes, and the shard wrote {}", mark.length),
            Err(e) => format!("cannot be found ({e})"),
        };
        return Err(Error::Request(faulty(&mark.name, &fault)));
    }
    Ok(Found::Done(Box::new(Part { path: path.to_path_buf(), shard, spec, record })))
}
