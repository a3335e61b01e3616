//! The tables of a page.

use super::{DIGITS, FinishedRun};
use crate::report::{
    page::PageTable,
    words::{member_name, time_unit, unit_in_title},
};
use curvelax_base::text::{p_value, significant};
use curvelax_ensemble::{Event, Outcome, Status};
use curvelax_files::names;
use curvelax_statistics::PairedDifferences;
use curvelax_study::results::{
    cells::{CellStatistics, EventStatistics},
    comparison::CellDifference,
    explained::{ExplainedRow, MAX_CENSORED, MIN_MEMBERS, TOGETHER},
    times::{QUANTILES, TimeStatistics},
};

/// Maximum number of groups in a table of the page.
const MAX_GROUPS: usize = 40;
/// Features of a time that the page lists.
const LISTED: usize = 6;
/// Digits of the time of a member, whose error may be small.
const MEMBER_DIGITS: usize = 6;

impl FinishedRun<'_> {
    /// The tables of the page, in reading order.
    pub(super) fn tables(&self) -> Vec<PageTable> {
        if self.spec().names_members() {
            return [self.member_table()].into_iter().chain(self.group_table()).chain(self.pairs()).collect();
        }
        let others = [self.group_table(), self.event_table(), self.pairs(), self.explanation()];
        [self.table()].into_iter().chain(others.into_iter().flatten()).map(PageTable::without_empty_columns).collect()
    }

    /// Each member that is known by name.
    fn member_table(&self) -> PageTable {
        let (event, unit) = (&self.spec().event, unit_in_title(self.spec()));
        let times = ["t_limit", "± t_error", "t_relax", "t_vanish_limit", "± t_vanish_error", "t_vanish"];
        let header = ["member", "name", "status"].into_iter().chain(times).map(String::from);
        let events = event.iter().map(|event| event.name.clone());
        let header = header.chain(events).enumerate().map(|(i, name)| if i > 2 { name + &unit } else { name });
        let [shown, half] = [MEMBER_DIGITS, 2].map(known);
        let row = |member: &Outcome| {
            let Outcome { t_limit, t_error, t_relax, t_vanish, t_vanish_limit, t_vanish_error, events, .. } = member;
            let times = [shown(*t_limit), half(*t_error), shown(*t_relax)].into_iter();
            let gone = [shown(*t_vanish_limit), half(*t_vanish_error), shown(*t_vanish)];
            let times = times.chain(gone).chain(events.iter().copied().map(&shown));
            let start = [member.member.to_string(), member_name(self.spec(), member), member.status.name().into()];
            start.into_iter().chain(times).collect()
        };
        let of_run = format!("; t_relax is that of this run, at n = {}", self.spec().points);
        let raw = if self.statistics.of_limits { &of_run } else { "" };
        PageTable {
            caption: format!("Each member{raw}"),
            header: header.collect(),
            rows: self.tally.named.iter().map(row).collect(),
            source: names::SUMMARY.into(),
            ..PageTable::default()
        }
        .without_empty_columns()
    }

    fn table(&self) -> PageTable {
        let keys = self.spec().sweep.axes().iter().map(|axis| axis.key.clone());
        let rows = self.statistics.cells.iter().map(|cell| (&cell.values[..], cell));
        let unit = time_unit(self.spec());
        let unit = if unit.is_empty() { unit } else { format!(" in{unit}") };
        let time = self.statistics.time();
        let caption = format!("Members by status, statistics of {time}{unit} (Kaplan-Meier), and rates of decay");
        self.cell_table(&caption, keys, rows, names::ENSEMBLE)
    }

    /// The same by group of outlines.
    fn group_table(&self) -> Option<PageTable> {
        let key = self.spec().group_by.clone()?;
        let groups = &self.statistics.groups;
        let rows = groups.iter().take(MAX_GROUPS).map(|group| (std::slice::from_ref(&group.group), &group.times));
        let shown = match groups.len().saturating_sub(MAX_GROUPS) {
            0 => String::new(),
            more => format!("; {more} more groups are in {}", names::GROUPS),
        };
        let tests = self.statistics.group_comparisons.iter().filter_map(|comparison| match comparison.log_rank() {
            Some(test) => {
                Some(format!("log-rank test that all groups have the same distribution: {}", p_value(test.p_value)))
            }
            None => comparison.refusal().map(|why| format!("not compared: {why}")),
        });
        let tests: String = tests.map(|test| format!("; {test}")).collect();
        let caption = format!("By {key}: {}{shown}{tests}", self.statistics.time());
        Some(self.cell_table(&caption, [key].into_iter(), rows, names::GROUPS))
    }

    /// The modes of the perturbation that are no features, if there are any.
    fn left_out(&self) -> String {
        match self.spec().modes_without_features() {
            0 => String::new(),
            modes => format!(". The {modes} highest modes of the perturbation are not among the features"),
        }
    }

    /// The statistics of the events, if there are any.
    fn event_table(&self) -> Option<PageTable> {
        let spec = self.spec();
        let header = ["cell", "event", "condition", "seen", "censored", "mean", "standard error"];
        let header =
            header.into_iter().chain(QUANTILES.map(|(_, name, _)| name)).chain(["discretisation %", "raw median"]);
        let row = |cell: u64, event: &Event, of: &EventStatistics| {
            let sample = &of.times.sample;
            let counts = [sample.events(), sample.censored()].map(|count| count.to_string());
            let percent = of.discretisation.as_ref().filter(|_| of.limits.is_none()).map(|error| 100.0 * error.mean);
            let raw = of.limits.as_ref().and_then(|_| of.times.median());
            let start = [cell.to_string(), event.name.clone(), event.condition.to_string()].into_iter().chain(counts);
            start.chain(times(of.judged())).chain([percent, raw].map(known(DIGITS))).collect()
        };
        let cells = self.statistics.cells.iter();
        let rows = cells
            .flat_map(|cell| spec.event.iter().zip(&cell.events).map(move |(event, of)| row(cell.cell, event, of)));
        (!spec.event.is_empty()).then(|| PageTable {
            caption: format!(
                "Events: members in which they were seen, and the statistics of their times{} (Kaplan-Meier)",
                if self.statistics.of_limits { ", in the limit" } else { "" }
            ),
            header: header.map(String::from).collect(),
            rows: rows.collect(),
            source: names::EVENT_STATISTICS.into(),
            ..PageTable::default()
        })
    }

    /// The differences from the first cell, if cells share their random numbers.
    fn pairs(&self) -> Option<PageTable> {
        let cells = self.statistics.comparison.paired_cells()?;
        let row = |of: &CellDifference| {
            let PairedDifferences { pairs, equal, median, interval, test } = of.found;
            let [low, high] = interval.map_or([None, None], |(low, high)| [Some(low), Some(high)]);
            let name = self.spec().sweep.name(of.cell);
            let p = test.map_or(String::new(), |test| p_value(test.p_value));
            let counts = [pairs, equal].map(|count| count.to_string());
            let left_out = [of.left_out.later, of.left_out.earlier, of.left_out.unknown].map(|count| count.to_string());
            let start = [of.cell.to_string(), name].into_iter().chain(counts);
            start.chain([median, low, high].map(known(DIGITS))).chain([p]).chain(left_out).collect()
        };
        let header = ["cell", "values", "pairs", "equal", "median", "95 % from", "to", "signed ranks"];
        let left_out = ["left out: later", "earlier", "unknown"];
        Some(PageTable {
            caption: format!(
                "{} minus that of the same member of cell 0: pairs that both relaxed (Wilcoxon signed-rank test), and \
                 pairs left out because a member did not",
                self.statistics.time()
            ),
            header: header.into_iter().chain(left_out).map(String::from).collect(),
            rows: cells.iter().map(row).collect(),
            ..PageTable::default()
        })
    }

    /// The values of a cell in a table, or its index.
    fn cell_name(&self, cell: u64) -> String {
        let name = self.short_label(cell);
        if name.is_empty() { cell.to_string() } else { name }
    }

    /// The best features of each time, cell by cell, and the regression on some.
    fn explanation(&self) -> Option<PageTable> {
        let rows = &self.explained.rows;
        let row = |of: &ExplainedRow| {
            let feature = match (&*of.feature, of.chosen) {
                (TOGETHER, Some(chosen)) => format!("{chosen} together"),
                (feature, _) => feature.into(),
            };
            let counts = [of.members, of.censored].map(|count| count.to_string());
            let chosen = of.chosen.filter(|_| of.feature != TOGETHER).map_or(String::new(), |place| place.to_string());
            let start = [self.cell_name(of.cell), of.time.clone(), feature].into_iter().chain(counts);
            start.chain([of.spearman, of.r2].map(known(3))).chain([chosen]).collect()
        };
        // The rows of a cell and a time are sorted, with the regression at the end.
        let groups = rows.chunk_by(|a, b| (a.cell, &a.time) == (b.cell, &b.time));
        let best = groups.flat_map(|group| {
            let (regression, features) = group.split_last().into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
            let shown = |(place, row): &(usize, &ExplainedRow)| *place < LISTED || row.chosen.is_some();
            let features = features.into_iter().flat_map(move |rows| rows.iter().enumerate().filter(shown));
            features.map(|(_, row)| row).chain(regression)
        });
        let keys = self.keys();
        let first = if keys.is_empty() { "cell" } else { &keys };
        let header = [first, "time", "feature", "members", "censored", "Spearman", "R²", "chosen"];
        rows.iter().any(|row| row.r2.is_some()).then(|| PageTable {
            caption: "What explains the times".into(),
            note: format!(
                "The {LISTED} best features of each time, alone (R² of a straight line), and a linear regression on the \
                 chosen ones (R² cross-validated), over the members that reached the time. Nothing is said {}{}.",
                claims(),
                self.left_out()
            ),
            header: header.map(String::from).into(),
            rows: best.map(row).collect(),
            source: names::EXPLAINED.into(),
        })
    }

    /// The statistics of cells or groups as a table of the page, each row after the values of `keys`.
    fn cell_table<'a>(
        &self,
        caption: &str,
        keys: impl Iterator<Item = String>,
        rows: impl Iterator<Item = (&'a [String], &'a CellStatistics)>,
        source: &str,
    ) -> PageTable {
        let statuses = Status::ALL.iter().map(|status| status.name().to_string());
        let numbers = ["mean", "standard error"].into_iter().chain(QUANTILES.map(|(_, name, _)| name));
        let raw = ["median t_error", "raw median t_relax", "median t_vanish", "median t_vanish_limit"];
        let numbers = numbers.chain(["median rate", "over theory", "discretisation %"]).chain(raw);
        let header = ["cell".to_string()].into_iter().chain(keys).chain(statuses).chain(numbers.map(String::from));
        let row = |(values, cell): (&[String], &CellStatistics)| {
            let counts = cell.counts.iter().map(u64::to_string);
            let start = [cell.cell.to_string()].into_iter().chain(values.iter().cloned());
            let rates = ["median", "ratio"].map(|name| cell.rates.numbers.get(name));
            let of_limits = self.statistics.of_limits;
            let error = cell.relaxing.discretisation.as_ref().filter(|error| error.converges() && !of_limits);
            let percent = error.map(|error| 100.0 * error.mean);
            let limits = cell.relaxing.limits.as_ref().filter(|_| of_limits);
            let raw = limits.and_then(|_| cell.relaxing.times.median());
            let vanishing = &cell.vanishing;
            let gone = [vanishing.times.median(), vanishing.limits.as_ref().and_then(|of| of.times.median())];
            let errors = [percent, limits.and_then(|limits| limits.error), raw];
            let numbers = rates.into_iter().chain(errors).chain(gone).map(known(DIGITS));
            start.chain(counts).chain(times(self.statistics.times(cell))).chain(numbers).collect()
        };
        PageTable {
            caption: caption.into(),
            header: header.collect(),
            rows: rows.map(row).collect(),
            source: source.into(),
            ..PageTable::default()
        }
    }
}

/// Writes a number to so many digits, and nothing where none is known.
fn known(digits: usize) -> impl Fn(Option<f64>) -> String {
    move |value| value.map_or(String::new(), |value| significant(value, digits))
}

/// Mean, standard error and quantiles of some times; the mean is a lower bound if members had not ended.
fn times(of: &TimeStatistics) -> impl Iterator<Item = String> {
    let least = if of.mean.is_some_and(|mean| mean.restricted_to.is_some()) { "≥ " } else { "" };
    let mean = of.mean.map_or(String::new(), |mean| format!("{least}{}", significant(mean.value, DIGITS)));
    let error = known(2)(of.mean.and_then(|mean| mean.standard_error));
    [mean, error].into_iter().chain(of.quantiles.map(known(DIGITS)))
}

/// When nothing is said about a time.
pub(super) fn claims() -> String {
    let percent = 100.0 * MAX_CENSORED;
    format!("if fewer than {MIN_MEMBERS} members reached it, or more than {percent} % did not")
}
