//! A completed run, read back from its folder for `plot`.
//!
//! Tables are read row by row, and each row is checked against the spec and the rows before it.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::{
    TableReader, TableRow, claim,
    members::MemberReader,
    names::{self, SHOWN, parsed, spoilt, text_of},
    place::Place,
    portraits::{self, Film},
    tables::{EventLevelRow, EventRow},
};
use curvelax_base::{
    error::{Error, Result, shortened},
    input,
    text::quoted,
};
use curvelax_ensemble::{LevelRow, LevelTimes, Outcome, Spec, outcome::linear_rate};
use curvelax_study::results::{
    explained::{Explained, Explaining, FeaturedMember, TIMES},
    provenance::{FORMAT, Provenance, by_status},
    tally::{MeanExcess, Tally, TallySupplement},
};

/// Relative distance behind the end at which a time is still rounding, in f32.
const LATE: f64 = 1e-6;

/// A run as read from its folder.
pub struct Finished {
    /// How it was made.
    pub provenance: Provenance,
    /// The results.
    pub tally: Tally,
    /// The mean excess in time.
    pub excess: Vec<MeanExcess>,
    /// What explains the times.
    pub explained: Explained,
    /// The first members; none if the run could not save them.
    pub films: Vec<Film>,
}

impl Finished {
    /// Reads the run in `folder`.
    ///
    /// # Errors
    /// [`Error::Request`] for a folder without a completed run, and for files of different runs.
    pub fn read(folder: &Path) -> Result<Finished> {
        let provenance = provenance(folder)?;
        let tally = tally(folder, &provenance)?;
        let films = films(folder)?;
        let excess = mean_excess(folder, &provenance)?;
        let explained = explained(&inside(folder), &provenance.spec, tally.has_limits())?;
        Ok(Finished { provenance, tally, excess, explained, films })
    }
}

/// The places of a finished run's files in its `folder`, by their names.
fn inside(folder: &Path) -> impl Fn(&str) -> Place {
    |name| Place::named(&folder.join(name))
}

/// Reads the portraits of the first members; none if the run could not save them.
///
/// # Errors
/// Those of [`Finished::read`].
pub fn films(folder: &Path) -> Result<Vec<Film>> {
    let path = folder.join(names::PORTRAITS);
    if path.exists() { portraits::read(&path) } else { Ok(Vec::new()) }
}

/// The keys that decide whether the rest can be understood.
#[derive(Default, Deserialize)]
#[serde(default)]
struct RunHead {
    curvelax: serde_json::Value,
    format: serde_json::Value,
}

/// Reads `run.json`.
///
/// # Errors
/// Those of [`Finished::read`].
pub fn provenance(folder: &Path) -> Result<Provenance> {
    let path = folder.join(names::RUN);
    let refuse = |path: &Path, problem: String| Err(Error::Request(format!("{}: {problem}", path.display())));
    if !folder.is_dir() {
        return refuse(folder, "no such folder; give that of a run".into());
    }
    if !path.exists() {
        let begun = folder.join(format!(".{}.part", names::SUMMARY)).exists();
        let problem = if claim::is_held(folder) {
            "a run in progress is writing here; wait until it has ended".into()
        } else if begun {
            format!("the run there has not finished; curvelax resume {} continues it", quoted(folder))
        } else {
            "no run there; give its folder".into()
        };
        return refuse(folder, format!("{problem} (no {})", names::RUN));
    }
    let text = text_of(&path, input::MAX_RUN)?;
    let RunHead { curvelax, format } = parsed(&path, &text)?;
    let Some(version) = curvelax.as_str() else {
        return refuse(&path, "not written by curvelax: expected its version under `curvelax`, found none".into());
    };
    match format.as_u64() {
        Some(1..=FORMAT) => {}
        Some(format) => {
            let (version, own) = (shortened(version, SHOWN), curvelax_base::VERSION);
            let problem = format!(
                "expected format {FORMAT} at most, found {format}, of curvelax {version}; this is {own}: use a newer one"
            );
            return refuse(&path, problem);
        }
        None => {
            let found = if format.is_null() { "none".into() } else { shortened(&format.to_string(), SHOWN) };
            return Err(spoilt(&path, "", &format!("expected a whole number from 1 under `format`, found {found}")));
        }
    }
    // From the text, not from the value, so that an error names its line.
    let provenance: Provenance = parsed(&path, &text)?;
    match provenance.spec.clone().validate() {
        Ok(_) => Ok(provenance),
        Err(e) => Err(spoilt(&path, "spec", &e.to_string())),
    }
}

/// Adds up the tables in `folder`, as the run did member by member.
///
/// # Errors
/// Those of [`Finished::read`].
pub fn tally(folder: &Path, provenance: &Provenance) -> Result<Tally> {
    let spec = &provenance.spec;
    let levels = levels(&inside(folder), spec)?;
    expected(folder, names::LEVELS, "rows", provenance.levels, levels.rows())?;
    let mut tally = Tally::of(spec, &levels);
    tally.supplement.mollified = provenance.mollified;
    tally.supplement.below_rounding = provenance.below_rounding;
    let mut rows = Summary::open(&inside(folder), spec, &levels)?;
    rows.try_for_each(|outcome| tally.add(&outcome?))?;
    let summary = |what: &str, told: u64, found: u64| expected(folder, names::SUMMARY, what, told, found);
    summary("rows", provenance.members, tally.members())?;
    for (status, count) in by_status(&tally) {
        let told = provenance.members_by_status.get(&status).copied().unwrap_or(0);
        summary(&format!("{status} members"), told, count)?;
    }
    summary("steps", provenance.steps, tally.steps)?;
    rows.end()?;
    Ok(tally)
}

/// Reads the times at the levels of a run of `spec`, whose tables have these places by their names.
///
/// # Errors
/// [`Error::Request`] for rows that are not of such a run.
pub fn levels(place: &dyn Fn(&str) -> Place, spec: &Spec) -> Result<LevelTimes> {
    let (mut table, mut levels) = (TableReader::<LevelRow>::open(&place(names::LEVELS))?, LevelTimes::default());
    let mut events = EventTimes::<EventLevelRow>::open(place, names::LEVELS, spec)?;
    while let Some((mut row, fields)) = table.read()? {
        let LevelRow { member, cell, .. } = row;
        if member >= spec.all_members() || cell != member / spec.members_per_cell() {
            let problem = format!("the cell of a member below {}", spec.all_members());
            return Err(fields.unexpected_in("cell", &problem));
        }
        row.events = events.next((member, row.level), |_| true)?.iter().map(EventTime::time).collect();
        levels.add(&row).map_err(|expected| fields.unexpected_in("level", &expected))?;
    }
    events.end()?;
    Ok(levels)
}

/// Adds up the rows of a resumed run, whose tables have these places, with those of its levels, and `supplement`.
///
/// # Errors
/// [`Error::Request`] for rows that are not of a run of `spec`.
pub fn rows(
    place: &dyn Fn(&str) -> Place,
    spec: &Spec,
    levels: &LevelTimes,
    supplement: TallySupplement,
) -> Result<Tally> {
    let mut tally = Tally::of(spec, levels);
    let mut rows = Summary::open(place, spec, levels)?;
    rows.try_for_each(|outcome| tally.add(&outcome?))?;
    rows.end()?;
    tally.supplement = supplement;
    Ok(tally)
}

/// Checks a count against `run.json`.
fn expected(folder: &Path, name: &str, what: &str, expected: u64, found: u64) -> Result<()> {
    if expected == found {
        return Ok(());
    }
    let problem = format!("expected {expected} {what} by {}, found {found}", names::RUN);
    Err(spoilt(&folder.join(name), "", &problem))
}

/// The rows of a `summary.csv`, in order of ascending members.
pub struct Summary<'a> {
    levels: &'a LevelTimes,
    table: TableReader<Outcome>,
    /// Those of their events.
    events: EventTimes<EventRow>,
    last: Option<u64>,
    spec: Spec,
    /// The last cell and its spec.
    spec_of: Option<(u64, Spec)>,
}

impl<'a> Summary<'a> {
    /// Opens the table of a run of `spec`, whose tables have these places.
    ///
    /// # Errors
    /// [`Error::Request`] if it does not exist, has other columns, or is truncated.
    pub fn open(place: &dyn Fn(&str) -> Place, spec: &Spec, levels: &'a LevelTimes) -> Result<Summary<'a>> {
        let events = EventTimes::open(place, names::SUMMARY, spec)?;
        let table = TableReader::open(&place(names::SUMMARY))?;
        Ok(Summary { levels, table, events, last: None, spec: spec.clone(), spec_of: None })
    }

    /// Checks that there are no events of further members.
    fn end(mut self) -> Result<()> {
        self.events.end()
    }

    fn read(&mut self) -> Result<Option<Outcome>> {
        let Some((mut outcome, fields)) = self.table.read()? else { return Ok(None) };
        let Outcome { member, cell, .. } = outcome;
        if let Some(last) = self.last.filter(|last| member <= *last) {
            return Err(fields.unexpected_in("member", &format!("a member after {last}: members ascend, each once")));
        }
        let all = self.spec.all_members();
        if member >= all {
            return Err(fields.unexpected_in("member", &format!("a member below {all}")));
        }
        self.last = Some(member);
        let own = member / self.spec.members_per_cell();
        if cell != own {
            return Err(fields.unexpected_in("cell", &format!("{own}, the cell of member {member}")));
        }
        let spec = match self.spec_of.take() {
            Some((of, spec)) if of == cell => spec,
            _ => self.spec.of_cell(cell)?,
        };
        let (_, spec) = self.spec_of.insert((cell, spec));
        let t_end = spec.final_time();
        if outcome.t_relax.is_some_and(|t| t > t_end * (1.0 + LATE)) {
            return Err(fields.unexpected_in("t_relax", &format!("a time up to {t_end}, the end of the run")));
        }
        let end = outcome.t_end;
        let fits = |row: &EventRow| if row.censored == 0 { row.t <= end } else { row.t == end };
        let rows = self.events.next((member, 0), fits)?;
        outcome.events = rows.iter().map(EventTime::time).collect();
        let limits = rows.iter().map(|row| row.t_limit.zip(row.t_error));
        // The theoretical rate is in no table, since it follows from the spec and the rest of the row.
        outcome.rate_theory = linear_rate::rate_of(spec, &outcome);
        let judged = |of: &Outcome| {
            [
                ("t_limit", of.t_limit),
                ("t_error", of.t_error),
                ("t_data_error", of.t_data_error),
                ("t_vanish_limit", of.t_vanish_limit),
                ("t_vanish_error", of.t_vanish_error),
            ]
        };
        let (told, points) = (judged(&outcome), outcome.points);
        self.levels.judge(spec, &mut outcome);
        if let Some((found, _)) = judged(&outcome).into_iter().zip(told).find(|(found, told)| found != told) {
            let (value, file) = (found.1.map_or("nothing".into(), |t| t.to_string()), names::LEVELS);
            return Err(fields.unexpected_in(found.0, &format!("{value}, as {file} has it")));
        }
        let refined = self.spec.refine;
        let judged = |place| outcome.limit_of_event(place).filter(|_| refined).map(|limit| (limit.t, limit.error));
        let mut pairs = limits.enumerate().map(|(place, told)| (place, told, judged(place)));
        if let Some((place, told, found)) = pairs.find(|(_, told, found)| told != found) {
            let shown =
                |limit: Option<(f64, f64)>| limit.map_or("nothing".into(), |(t, error)| format!("{t} ± {error}"));
            let (found, told) = (shown(found), shown(told));
            let (name, file) = (&self.events.names[place], names::EVENT_LEVELS);
            let what = format!("the limit {found} of the event {name} of member {member}, as {file} has it");
            return Err(spoilt(&self.events.path, "", &format!("expected {what}, found {told}")));
        }
        if outcome.points != points {
            return Err(fields.unexpected_in("points", &format!("{}, as {} has it", outcome.points, names::LEVELS)));
        }
        Ok(Some(outcome))
    }
}

/// A row of a table of events.
trait EventTime: TableRow + Default {
    /// Its member and level, 0 if it has none; its event; and when that happened.
    fn parts(&self) -> ((u64, u64), &str, Option<f64>);

    /// When its event happened.
    fn time(&self) -> Option<f64> {
        self.parts().2
    }
}

impl EventTime for EventRow {
    fn parts(&self) -> ((u64, u64), &str, Option<f64>) {
        ((self.member, 0), &self.event, (self.censored == 0).then_some(self.t))
    }
}

impl EventTime for EventLevelRow {
    fn parts(&self) -> ((u64, u64), &str, Option<f64>) {
        ((self.member, self.level), &self.event, self.t)
    }
}

/// A table of events, read along with that of the members or levels. Without events there is none, and nothing is read.
struct EventTimes<R> {
    path: PathBuf,
    /// The table of the members.
    beside: PathBuf,
    /// The last member that it had, and the level.
    last: Option<(u64, u64)>,
    /// The number of members of the study.
    members: u64,
    table: Option<TableReader<R>>,
    names: Vec<String>,
}

impl<R: EventTime> EventTimes<R> {
    fn open(place: &dyn Fn(&str) -> Place, beside: &str, spec: &Spec) -> Result<EventTimes<R>> {
        let names: Vec<String> = spec.event.iter().map(|event| event.name.clone()).collect();
        let [own, beside] = [R::TABLE, beside].map(place);
        let table = (!names.is_empty()).then(|| TableReader::open(&own)).transpose()?;
        let [path, beside] = [own, beside].map(|place| place.shown().to_path_buf());
        Ok(EventTimes { path, beside, last: None, members: spec.all_members(), table, names })
    }

    /// The error for a row of `of`, which is not due yet, if it is one that the table of the members lacks and has
    /// `found` instead.
    fn check_beside(&self, of: (u64, u64), found: &str) -> Result<()> {
        if Some(of) <= self.last || of.0 >= self.members {
            return Ok(());
        }
        let (member, own) = (of.0, self.path.display());
        let problem = format!("expected another row of member {member}, which {own} has, found {found}");
        Err(spoilt(&self.beside, "", &problem))
    }

    /// The rows of the events of the next member, which must be that of `place` and of which all must `fit`.
    fn next(&mut self, place: (u64, u64), fits: impl Fn(&R) -> bool) -> Result<Vec<R>> {
        let mut rows = Vec::with_capacity(self.names.len());
        let Some(table) = &mut self.table else { return Ok(rows) };
        for name in &self.names {
            let Some((row, fields)) = table.read()? else {
                let problem = format!("expected the events of member {}, found the end of the file", place.0);
                return Err(spoilt(&self.path, "", &problem));
            };
            let (of, event, _) = row.parts();
            if of != place {
                let wrong = fields.unexpected_in("member", &format!("member {}, as the other table has it", place.0));
                if of < place {
                    self.check_beside(of, &format!("member {}", place.0))?;
                }
                return Err(wrong);
            }
            if event != name {
                return Err(fields.unexpected_in("event", name));
            }
            if !fits(&row) {
                return Err(
                    fields.unexpected_in("t", "a time up to the end of the member, or that end if censored is 1")
                );
            }
            rows.push(row);
        }
        self.last = Some(place);
        Ok(rows)
    }

    /// Checks that there are no more rows.
    fn end(&mut self) -> Result<()> {
        match self.table.as_mut().map_or(Ok(None), TableReader::read)? {
            None => Ok(()),
            Some((row, fields)) => {
                let wrong = fields.unexpected_in("member", "the end of the file");
                self.check_beside(row.parts().0, "the end of the file")?;
                Err(wrong)
            }
        }
    }
}

impl Iterator for Summary<'_> {
    type Item = Result<Outcome>;

    fn next(&mut self) -> Option<Result<Outcome>> {
        self.read().transpose()
    }
}

/// Finds what explains the times in a `summary.csv`, and those of its events, by the features in a `members.csv`, of a
/// run of `spec` whose tables have these places; with limits first, if there are any. All are read as far as members
/// enter.
///
/// # Errors
/// [`Error::Request`] for rows that are not of the same members, each once.
pub fn explained(place: &dyn Fn(&str) -> Place, spec: &Spec, of_limits: bool) -> Result<Explained> {
    let members = place(names::MEMBERS);
    let mut outcomes = TableReader::<Outcome>::open(&place(names::SUMMARY))?;
    let (mut table, mut events) =
        (MemberReader::open(&members, spec)?, EventTimes::<EventRow>::open(place, names::SUMMARY, spec)?);
    let count = table.features().len();
    let names = spec.event.iter().map(|event| event.name.clone());
    let times = of_limits.then_some("t_limit").into_iter().chain(TIMES).map(String::from);
    let mut explaining = Explaining::new(table.features(), times.chain(names), spec.sweep.cells());
    while let Some((Outcome { member, cell, t_relax, t_half, t_limit, t_end, .. }, _)) = outcomes.read()? {
        let Some((own, of, mut fields)) = table.read()? else {
            let problem = format!("expected a row of member {member}, found the end");
            return Err(spoilt(members.shown(), "", &problem));
        };
        for (name, told, found) in [("member", member, own), ("cell", cell, of)] {
            if told != found {
                return Err(fields.unexpected_in(name, &format!("{told}, as in {}", names::SUMMARY)));
            }
        }
        let of_events = events.next((member, 0), |_| true)?;
        if explaining.wants(cell) {
            // An event has its limit where there is one, as everywhere.
            let of_events = of_events.iter().map(|row| row.t_limit.or(row.time()));
            let times = of_limits.then_some(t_limit).into_iter().chain([t_relax, t_half]).chain(of_events).collect();
            let numbers = (0..count).map(|_| fields.known()).collect::<Result<_>>()?;
            let place = member.saturating_sub(cell.saturating_mul(spec.curves));
            // Of a vesicle without a relaxation time nothing is known.
            let later_than = if spec.has_vesicles_in(cell) { t_relax.unwrap_or(f64::NAN) } else { t_end };
            explaining.add(FeaturedMember { member, cell, place, numbers, times, later_than });
        } else if explaining.is_full() {
            return Ok(explaining.finish());
        }
    }
    match table.read()? {
        Some((.., fields)) => {
            Err(fields.unexpected_in("member", &format!("no more members, as in {}", names::SUMMARY)))
        }
        None => Ok(explaining.finish()),
    }
}

/// Reads `mean_excess.csv`.
///
/// # Errors
/// Those of [`Finished::read`].
pub fn mean_excess(folder: &Path, provenance: &Provenance) -> Result<Vec<MeanExcess>> {
    let mut table = TableReader::<MeanExcess>::open(&inside(folder)(names::MEAN_EXCESS))?;
    let (mut rows, mut count, mut last): (Vec<MeanExcess>, u64, _) = (Vec::new(), 0, None);
    while let Some((row, fields)) = table.read()? {
        let at = (row.cell, row.t);
        if let Some((cell, t)) = last.filter(|last| at <= *last) {
            return Err(fields.unexpected_in("t", &format!("a time after {t} of cell {cell}")));
        }
        last = Some(at);
        count += 1;
        // Surplus rows are only counted.
        rows.extend((count <= provenance.excess_rows).then_some(row));
    }
    expected(folder, names::MEAN_EXCESS, "rows", provenance.excess_rows, count)?;
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{OutputFolder, tables::Table};
    use curvelax_ensemble::{Observables, Status};
    use curvelax_study::samples::outcome;

    #[test]
    fn the_run_that_the_fuzzer_changes_is_one_of_this_version() {
        let home = tempfile::tempdir().unwrap();
        let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/base");
        std::fs::create_dir(home.path().join("plots")).unwrap();
        let tables = [names::SUMMARY, names::MEMBERS, names::LEVELS, names::MEAN_EXCESS];
        for name in tables.into_iter().chain([names::RUN, names::PORTRAITS]) {
            let own = Path::new(name).file_name().unwrap();
            std::fs::copy(base.join(own), home.path().join(name)).unwrap();
        }
        let run = Finished::read(home.path()).unwrap();
        assert!(run.tally.members() > 0 && !run.films.is_empty());
    }

    #[test]
    fn a_row_reads_back_to_the_outcome_that_was_written() {
        let home = tempfile::tempdir().unwrap();
        let mut written = outcome(3, Status::Stalled, Some(0.1 + 0.2));
        (written.cell, written.rejected, written.self_crossing, written.t_half) = (1, 7, Some(1.0 / 3.0), Some(1e-300));
        (written.rate, written.rate_r2) = (Some(-0.5), Some(0.25));
        written.start = Observables { length: 9.1, area: -6.5, excess: 0.3, energy: 2.0, ..Observables::default() };
        written.end = Observables {
            length: 8.1,
            area: 6.1,
            excess: -0.0,
            energy: 1.0 / 7.0,
            k_min: -3.0,
            k_max: f64::MAX,
            mesh_ratio: 1.5,
            metric_drift: 0.01,
            turning: -1,
        };
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let mut table = Table::new::<Outcome>(folder.file(names::SUMMARY).unwrap()).unwrap();
        table.row(&written).unwrap();
        folder.publish_all(vec![table.ready().unwrap()]).unwrap();
        let mut spec = Spec { curves: 2, ..Spec::default() };
        spec.sweep.set("omega=1,2".parse().unwrap());
        written.rate_theory = spec.rate_in_theory(&spec.typical(), [-6.5, f64::NAN]);
        let read: Vec<Outcome> =
            Summary::open(&inside(home.path()), &spec, &LevelTimes::default()).unwrap().map(Result::unwrap).collect();
        assert_eq!(read, [written.clone()]);
        assert_eq!(read[0].end.excess.to_bits(), written.end.excess.to_bits());
    }
}
