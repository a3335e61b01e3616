//! Which command a folder belongs to: what a command may use, and what it must leave alone.

use std::{
    collections::BTreeSet,
    io,
    path::{Path, PathBuf},
};

use super::{
    claim::LOCK,
    disk::{entries, is_own_store},
    foreign::foreign,
    names::{
        CONVERGENCE, FIGURES, PLOTS, PROBE, REFEREE, RUN, SHARD, STATE, STATE_OLD, STATE_PART, WORK, WORK_PICTURE,
        is_store, part,
    },
};
use curvelax_base::{
    error::{Error, Result},
    text::{listed, quoted},
};

/// Maximum number of files listed in a message.
const NAMED: usize = 4;

/// Who writes into a folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// `run`, `resume` and `merge`, whose files are the same.
    Run,
    /// `convergence`.
    Convergence,
    /// `figure`.
    Figure,
    /// `plot` with a separate folder.
    Pictures,
    /// `plot` in the folder of the run that it draws.
    PicturesOfRun,
    /// `animate`: one file that the user names, which may be in any folder.
    Movie,
}

/// How an existing folder is treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Refused, unless it only has what a run killed before it began leaves.
    Refused,
    /// Accepted, unless a name in it is needed.
    Filled,
    /// Accepted; files of an earlier run of the same command are replaced. Commands that also remove such files accept
    /// no others.
    Replaced,
}

impl From<bool> for Existing {
    /// `--force`.
    fn from(force: bool) -> Existing {
        if force { Existing::Replaced } else { Existing::Refused }
    }
}

impl Owner {
    /// Files that only this command writes.
    fn marks(self) -> &'static [&'static str] {
        match self {
            Owner::Run => &[RUN, SHARD, STATE, STATE_OLD],
            Owner::Convergence => &[CONVERGENCE, REFEREE, WORK, WORK_PICTURE],
            Owner::Figure => &FIGURES,
            // They may be left over from a run whose other files are lost.
            Owner::Pictures | Owner::PicturesOfRun | Owner::Movie => &[],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Owner::Run => "run",
            Owner::Convergence => "convergence",
            Owner::Figure => "figure",
            Owner::Pictures | Owner::PicturesOfRun => "plot",
            Owner::Movie => "animate",
        }
    }

    /// Refuses the folder at `place`, called `path`, if another command has written there.
    ///
    /// # Errors
    /// [`Error::Request`] naming that command and its file.
    pub fn check(self, place: &Path, path: &Path) -> Result<()> {
        if self == Owner::Movie {
            return Ok(());
        }
        let own = if self == Owner::PicturesOfRun { Owner::Run } else { self };
        for other in [Owner::Run, Owner::Convergence, Owner::Figure].into_iter().filter(|other| *other != own) {
            if let Some(mark) = other.marks().iter().find(|mark| is_there(&place.join(mark))) {
                let problem =
                    format!("curvelax {} wrote {mark} there, and {} would mix with it", other.name(), self.name());
                return Err(Error::value("out", path.display(), &problem, "use another folder, or remove that one"));
            }
        }
        Ok(())
    }
}

impl Existing {
    /// Refuses the folder at `place`, called `path`, in which `owner` will write files `names`, if something in it
    /// would be lost.
    ///
    /// # Errors
    /// [`Error::Request`] naming what is there.
    pub fn check(self, owner: Owner, place: &Path, path: &Path, names: &[String]) -> Result<()> {
        let refuse = |problem: &str, allowed: &str| Err(Error::value("out", path.display(), problem, allowed));
        if self == Existing::Replaced {
            // Other commands replace the files that they write, and remove none.
            let found = if owner == Owner::Run { foreign(place) } else { Ok(Vec::new()) };
            let found = found.map_err(|e| Error::Request(format!("--out {}: cannot be read ({e})", path.display())))?;
            if found.is_empty() {
                return Ok(());
            }
            let names: Vec<String> = found.iter().map(|path| path.display().to_string()).collect();
            let problem = format!("it holds {}, which no run wrote", listed(&names, NAMED, ", "));
            return refuse(&problem, "use another folder, or move away what is not of a run");
        }
        if [STATE, STATE_OLD].iter().any(|state| is_there(&place.join(state))) {
            let resume =
                format!("if it is not running, curvelax resume {} continues it, --force starts over", quoted(path));
            return refuse("a run was begun here and has not finished", &resume);
        }
        match self {
            Existing::Filled => match names.iter().find(|name| is_there(&place.join(name))) {
                None => Ok(()),
                Some(name) => {
                    let own = foreign(place).is_ok_and(|found| found.is_empty());
                    let force = if own { ", or add --force instead of --resume to replace the files" } else { "" };
                    let problem = format!("{name} exists, but there is no run to resume");
                    refuse(&problem, &format!("use another folder{force}"))
                }
            },
            _ if is_only_begun(place, names).unwrap_or(false) => Ok(()),
            _ => refuse("already exists", "name a new folder, or add --force to replace the files of an earlier run"),
        }
    }
}

/// Whether `folder` holds only what a run killed before its first checkpoint leaves. An empty one may belong to
/// someone.
fn is_only_begun(folder: &Path, names: &[String]) -> io::Result<bool> {
    let parts: BTreeSet<PathBuf> = names.iter().map(|name| part(Path::new(name))).collect();
    let is_left = |path: &Path| {
        let name = path.strip_prefix(folder).unwrap_or(path);
        let own = [LOCK, PROBE, STATE_PART].iter().any(|own| name == Path::new(own)) || parts.contains(name);
        own && if is_store(path) { is_own_store(path) } else { !path.is_dir() }
    };
    let mut count = 0;
    for path in entries(folder)? {
        let is_plots = path.ends_with(PLOTS) && path.symlink_metadata()?.is_dir();
        let all = match is_plots {
            true => entries(&path)?.iter().all(|path| is_left(path)),
            false => is_left(&path),
        };
        if !all {
            return Ok(false);
        }
        count += 1;
    }
    Ok(count > 0)
}

fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}
