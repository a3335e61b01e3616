//! Merges shards into the files that one run of all members would have written.
//!
//! Rows are copied unchanged, in the order of the members, with only one block of each shard in memory. Data that are
//! not in the rows are added up exactly. Statistics and pictures are then those of any [`Complete`] run.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, BinaryHeap},
    io::{self, BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write},
    ops::RangeInclusive,
    path::{Display, Path, PathBuf},
    time::Duration,
};

use super::{ResultFormat, complete::Complete};
use curvelax_base::{
    error::{Error, Result, without_controls},
    input::{self, MAX_LINE},
    text::listed,
};
use curvelax_ensemble::{Shard, Spec};
use curvelax_files::{
    folder::OutputFolder,
    growing::Growing,
    names,
    part_file::{Mark, PartFile},
    part_folder::PartFolder,
    portraits::Film,
    reader,
    state::shard::{FinishedShard, Found},
    zarr::{SnapshotStore, StoredMembers},
};
use curvelax_study::results::{RunVerdict, tally::TallySupplement};

/// Bytes read at once, from all shards together and at least from one.
const BLOCKS: usize = 64 << 20;
const MIN_BLOCK: usize = MAX_LINE;
const MAX_BLOCK: usize = 1 << 20;

/// Maximum number of shards listed in a message.
const NAMED: usize = 8;

/// Keys that may differ between shards: where and how it was computed, which the platform records, and which shard it
/// is.
const OWN_KEYS: [&str; 4] = ["shard", "threads", "backend", "adapter"];

/// Shards of one study.
pub struct Shards {
    /// Those that are complete, by number.
    parts: BTreeMap<u64, FinishedShard>,
    /// Information on the others.
    unfinished: Vec<(Option<u64>, PathBuf, String)>,
    /// The spec of the whole study.
    spec: Spec,
    /// N, the number of shards of the study; those without members do not count.
    pub count: u64,
}

impl Shards {
    /// Sorts the shards that were found.
    ///
    /// # Errors
    /// [`Error::Request`] if two shards are not of the same study, or one is there twice.
    pub fn new(found: Vec<Found>) -> Result<Shards> {
        let of = |found: &Found| match found {
            Found::Done(part) => Some((part.path.clone(), part.spec.clone())),
            Found::Unfinished { path, spec, .. } => Some((path.clone(), *spec.clone()?)),
        };
        let Some((first, own)) = found.iter().find_map(of) else {
            let unfinished = |found: &Found| match found {
                Found::Done(part) => part.path.display().to_string(),
                Found::Unfinished { path, why, .. } => format!("{}: {why}", path.display()),
            };
            let folders: Vec<String> = found.iter().map(unfinished).collect();
            let message = format!("no folder says which study it is a shard of: {}", listed(&folders, NAMED, "; "));
            return Err(Error::Request(message));
        };
        let Some(shard) = own.shard else {
            return Err(Error::Request(format!("{}: the run there is not a shard", first.display())));
        };
        let mut shards = Shards {
            parts: BTreeMap::new(),
            unfinished: Vec::new(),
            spec: Spec { shard: None, ..own.clone() },
            count: shard.count(),
        };
        for one in found {
            let index = of(&one).map(|(path, spec)| same_study((&path, &spec), (&first, &own))).transpose()?;
            match one {
                Found::Done(part) => {
                    let (path, shard) = (part.path.clone(), part.shard);
                    if let Some(other) = shards.parts.insert(shard.index(), *part) {
                        let (one, other) = (path.display(), other.path.display());
                        let message = format!("{one}: shard {shard} is duplicated in {other}; give one of them");
                        return Err(Error::Request(message));
                    }
                }
                Found::Unfinished { path, why, .. } => shards.unfinished.push((index, path, why)),
            }
        }
        shards.check_places()?;
        Ok(shards)
    }

    /// Digits agree only if shards were computed in the same way.
    fn check_places(&self) -> Result<()> {
        let mut parts = self.parts.values();
        let Some(first) = parts.next() else { return Ok(()) };
        for part in parts {
            let [one, own] = [part, first].map(|part| &part.record.head.origin);
            let differs = |what: String| {
                let (one, own) = (part.path.display(), first.path.display());
                Err(Error::Request(format!("{one} and {own} are not of one study: {what}; run one of them again")))
            };
            if !one.platform.computes_like(&own.platform) {
                let [one, own] = [one, own].map(|origin| without_controls(&origin.platform.name()));
                return differs(format!("one was computed on {one} and the other on {own}, where digits differ"));
            }
            let sums = |of: &[(PathBuf, u32)]| of.iter().map(|(_, crc)| *crc).collect::<BTreeSet<_>>();
            if sums(&one.outlines) != sums(&own.outlines) {
                return differs("their outlines differ".into());
            }
            if part.record.points != first.record.points {
                return differs(format!("members have {} and {} nodes", part.record.points, first.record.points));
            }
        }
        Ok(())
    }

    /// The shards that are not complete, as ranges of their numbers: at most one more than there are folders, however
    /// many shards the study has.
    pub fn missing(&self) -> Vec<RangeInclusive<u64>> {
        self.all_but(self.parts.keys().copied())
    }

    /// The shards with members, except `others`, which ascend.
    fn all_but(&self, others: impl Iterator<Item = u64>) -> Vec<RangeInclusive<u64>> {
        match &self.spec.only {
            Some(only) => {
                let own: BTreeSet<u64> = only.iter().map(|member| member % self.count).collect();
                let own: Vec<u64> = own.difference(&others.collect()).copied().collect();
                own.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..=run[run.len() - 1]).collect()
            }
            None => {
                let end = self.count.min(self.spec.all_members());
                let mut next = 0;
                let mut gaps = Vec::new();
                for taken in others.take_while(|index| *index < end).chain([end]) {
                    if next < taken {
                        gaps.push(next..=taken - 1);
                    }
                    next = taken + 1;
                }
                gaps
            }
        }
    }

    /// A line for each incomplete shard, with its number and what there is instead; a single line for all those of
    /// which nothing is known.
    pub fn in_words(&self) -> Vec<String> {
        let line = |(index, path, why): &(Option<u64>, PathBuf, String)| match index {
            Some(index) if self.parts.contains_key(index) => None,
            Some(index) => Some(format!("shard {index}/{}: {}: {why}", self.count, path.display())),
            None => Some(format!("{}: {why}", path.display())),
        };
        let mut lines: Vec<String> = self.unfinished.iter().filter_map(line).collect();
        let begun = self.unfinished.iter().filter_map(|(index, ..)| *index);
        let known: BTreeSet<u64> = begun.chain(self.parts.keys().copied()).collect();
        let nowhere = self.all_but(known.into_iter());
        if !nowhere.is_empty() {
            let shards = if total(&nowhere) == 1 { "shard" } else { "shards" };
            lines.push(format!("{shards} {} of {}: not among the folders", listed_ranges(&nowhere), self.count));
        }
        lines
    }

    /// Merges them in `folder`, and returns the text for stdout and the verdict.
    ///
    /// # Errors
    /// [`Error::Request`] if a shard is missing or has changed since it was completed; `folder` is then left empty.
    pub fn merge(self, folder: &OutputFolder, form: ResultFormat) -> Result<(String, RunVerdict)> {
        self.check_complete()?;
        let Shards { parts, spec, .. } = self;
        let spec = &spec;
        let parts: Vec<FinishedShard> = parts.into_values().collect();
        let mut files = Vec::new();
        for name in Growing::names(spec) {
            files.push(join(&parts, name, folder)?);
        }
        let store = match Growing::has_store(spec) {
            true => Some(join_stores(&parts, spec, folder)?),
            false => None,
        };
        let (mut supplement, mut films, mut warnings) =
            (TallySupplement::default(), Vec::<Film>::new(), Vec::<String>::new());
        for FinishedShard { record, .. } in &parts {
            supplement.merge(&record.head.supplement);
            films.extend(record.head.films.iter().cloned());
            warnings.extend(record.warnings.iter().cloned());
        }
        films.sort_by_key(|film| film.member);
        let mut seen = BTreeSet::new();
        warnings.retain(|warning| seen.insert(warning.clone()));
        let place = |name: &str| folder.part(name);
        let levels = reader::levels(&place, spec)?;
        let tally = reader::rows(&place, spec, &levels, supplement)?;
        if tally.members() != spec.member_count() {
            let (found, all) = (tally.members(), spec.member_count());
            return Err(Error::Request(format!("the shards have {found} members, and their spec has {all}")));
        }
        warnings.extend(tally.warnings());
        let heads = || parts.iter().map(|part| &part.record.head);
        let complete = Complete {
            spec,
            platform: &parts[0].record.head.origin.platform,
            tally,
            films: &films,
            warnings: &warnings,
            started: heads().map(|head| head.origin.started).min().unwrap_or_default(),
            wall: heads().fold(Duration::ZERO, |all, head| all.saturating_add(head.wall)),
        };
        complete.publish(folder, files, store, None, form)
    }

    /// # Errors
    /// [`Error::Request`] naming the missing shards.
    pub fn check_complete(&self) -> Result<()> {
        let missing = self.missing();
        if missing.is_empty() {
            return Ok(());
        }
        let there = self.parts.len();
        Err(Error::Request(format!(
            "{there} of {} shards are done; {}; `curvelax merge --missing` prints the command that submits them",
            there as u64 + total(&missing),
            listed(&self.in_words(), NAMED, "; ")
        )))
    }
}

/// The number of the shard in `one`, if it is of the same study as `own`.
fn same_study(one: (&PathBuf, &Spec), own: (&PathBuf, &Spec)) -> Result<u64> {
    let refuse = |what: String| {
        let (one, own) = (one.0.display(), own.0.display());
        Err(Error::Request(format!("{one} is of another study than {own}: {what}")))
    };
    let (one, own) = (one.1, own.1);
    if let Some((key, here, there)) = one.difference(own, &OWN_KEYS) {
        return refuse(format!("{key} is {here}, and {there} there"));
    }
    match (one.shard, own.shard) {
        (Some(shard), Some(own)) if shard.count() == own.count() => Ok(shard.index()),
        (Some(shard), Some(own)) => refuse(format!("it says shard {shard}, but {own} is there")),
        _ => refuse("it is not a shard".into()),
    }
}

/// Ascending ranges in Slurm's notation: `0,3,5-9`.
pub fn listed_ranges(ranges: &[RangeInclusive<u64>]) -> String {
    let text = |range: &RangeInclusive<u64>| match (range.start(), range.end()) {
        (first, last) if first == last => first.to_string(),
        (first, last) => format!("{first}-{last}"),
    };
    ranges.iter().map(text).collect::<Vec<_>>().join(",")
}

/// How many numbers are in them.
fn total(ranges: &[RangeInclusive<u64>]) -> u64 {
    ranges.iter().map(|range| range.end() - range.start() + 1).sum()
}

/// The first bytes of a file, which is reopened for every block, so that any number of shards can be merged.
struct Reopened {
    path: PathBuf,
    /// Bytes to read.
    length: u64,
    /// Bytes read, and their CRC-32C.
    read: u64,
    crc: u32,
}

impl Read for Reopened {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut file = input::open(&self.path)?;
        file.seek(SeekFrom::Start(self.read))?;
        let count = file.take(self.length - self.read).read(buffer)?;
        self.read += count as u64;
        self.crc = crc32c::crc32c_append(self.crc, &buffer[..count]);
        Ok(count)
    }
}

/// The rows of a table of one shard.
struct ShardRows {
    shard: Shard,
    mark: Mark,
    file: BufReader<Reopened>,
    /// The next one.
    line: Vec<u8>,
}

impl ShardRows {
    fn new(part: &FinishedShard, name: &str, block: usize) -> Result<ShardRows> {
        let path = part.path.join(name);
        let mark = part.record.head.tables.iter().find(|mark| mark.name == name).cloned();
        let missing = || Error::Request(format!("{}: the shard does not list it", path.display()));
        let mark = mark.ok_or_else(missing)?;
        let file = BufReader::with_capacity(block, Reopened { path, length: mark.length, read: 0, crc: 0 });
        Ok(ShardRows { shard: part.shard, mark, file, line: Vec::new() })
    }

    fn path(&self) -> Display<'_> {
        self.file.get_ref().path.display()
    }

    fn changed(&self, what: &str) -> Error {
        Error::Request(format!(
            "{}: {what}: it is not the file that the shard wrote; copy it again, or run the shard again",
            self.path()
        ))
    }

    /// Goes to the next line; none at the end of the file, when its checksum has been verified.
    fn next(&mut self) -> Result<Option<&[u8]>> {
        self.line.clear();
        let read = self.file.by_ref().take(MAX_LINE as u64 + 1).read_until(b'\n', &mut self.line);
        read.map_err(|e| Error::Request(format!("cannot read {}: {e}", self.path())))?;
        let Reopened { length, read, crc, .. } = *self.file.get_ref();
        match () {
            _ if self.line.ends_with(b"\n") => Ok(Some(&self.line)),
            _ if self.line.len() > MAX_LINE => Err(self.changed(&format!("a line of more than {MAX_LINE} bytes"))),
            _ if read < length => Err(self.changed(&format!("it ends after {read} bytes"))),
            _ if !self.line.is_empty() => Err(self.changed("its last line is cut off")),
            _ if crc != self.mark.crc => Err(self.changed("its checksum differs")),
            _ => Ok(None),
        }
    }

    /// What the next line is sorted by: its member, after the level in a table that has levels.
    fn key(&mut self) -> Result<Option<(u64, u64)>> {
        let (shard, has_levels) = (self.shard, [names::LEVELS, names::EVENT_LEVELS].contains(&&*self.mark.name));
        let key = match self.next()? {
            None => return Ok(None),
            Some(line) => {
                let mut fields = line.split(|byte| *byte == b',');
                let mut number = || std::str::from_utf8(fields.next()?).ok()?.parse::<u64>().ok();
                let member = number();
                let level = if has_levels { number() } else { Some(0) };
                level.zip(member)
            }
        };
        match key.filter(|(_, member)| shard.has(*member)) {
            Some(key) => Ok(Some(key)),
            None => Err(self.changed(&format!("a row that is of no member of shard {shard}"))),
        }
    }
}

/// Merges the table `name` of all parts, in the order of the members.
fn join(parts: &[FinishedShard], name: &str, folder: &OutputFolder) -> Result<PartFile> {
    let file = folder.file(name)?;
    let target = file.target().to_path_buf();
    let mut out = BufWriter::with_capacity(MAX_BLOCK, file);
    join_rows(parts, name, &mut out, &target)?;
    let file = out.into_inner().map_err(|e| Error::io("cannot write", &target)(e.into_error()))?;
    file.sync()?;
    Ok(file)
}

/// Writes the table `name` of all parts, in the order of the members, to `out`, which messages call `target`.
///
/// # Errors
/// [`Error::Request`] naming a file that differs from what its shard wrote.
pub fn join_rows(parts: &[FinishedShard], name: &str, out: &mut impl Write, target: &Path) -> Result<()> {
    let cannot = |e| Error::io("cannot write", target)(e);
    let block = (BLOCKS / parts.len().max(1)).clamp(MIN_BLOCK, MAX_BLOCK);
    let mut all = parts.iter().map(|part| ShardRows::new(part, name, block)).collect::<Result<Vec<_>>>()?;
    let mut header: Option<Vec<u8>> = None;
    for rows in &mut all {
        let own = rows.next()?.map(<[u8]>::to_vec);
        match (&header, own) {
            (None, Some(own)) => {
                out.write_all(&own).map_err(cannot)?;
                header = Some(own);
            }
            (Some(header), Some(own)) if *header == own => {}
            _ => return Err(rows.changed("its columns differ")),
        }
    }
    let mut next = BinaryHeap::new();
    for (i, rows) in all.iter_mut().enumerate() {
        next.extend(rows.key()?.map(|key| Reverse((key, i))));
    }
    while let Some(Reverse((key, i))) = next.pop() {
        let rows = &mut all[i];
        out.write_all(&rows.line).map_err(cannot)?;
        match rows.key()? {
            Some(after) if after < key => {
                return Err(rows.changed(&format!("member {} after {}", after.1, key.1)));
            }
            after => next.extend(after.map(|after| Reverse((after, i)))),
        }
    }
    Ok(())
}

/// Merges the arrays of all parts, in the order of the members.
fn join_stores(parts: &[FinishedShard], spec: &Spec, folder: &OutputFolder) -> Result<PartFolder> {
    let points = parts[0].record.points;
    let mut stored = BTreeMap::new();
    for part in parts {
        let path = part.path.join(names::STORE);
        let missing = || Error::Request(format!("{}: the shard does not list it", path.display()));
        let mark = part.record.head.store.as_ref().ok_or_else(missing)?;
        stored.insert(part.shard.index(), StoredMembers::open(&path, &part.spec, points, mark)?);
    }
    let count = parts[0].shard.count();
    let mut store = SnapshotStore::begin(folder.store(names::STORE)?, spec, points)?;
    for member in spec.members() {
        let missing = || Error::Request(format!("no shard has member {member}"));
        store.copy(stored.get_mut(&(member % count)).ok_or_else(missing)?)?;
    }
    stored.values().try_for_each(StoredMembers::check)?;
    store.ready()
}
