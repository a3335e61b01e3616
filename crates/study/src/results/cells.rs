//! `ensemble.csv`: the statistics of relaxation times and decay rates, one row per cell.
//!
//! A member whose time is unknown is censored where it ended: at the final time if it is unfinished, or at its last
//! good state if it ended badly; a vesicle, of which that says nothing, at 0. The row counts these members.

use std::mem;

use super::{
    comparison::CellComparison,
    discretisation::{CellLimits, DiscretisationError},
    scaling::{CellMedian, Scaling},
    tally::{CellTally, EventTally, Rate, Tally},
    times::{Numbers, QUANTILES, Statistic, TimeStatistics, covered, ends, intervals, moments, of_mean, places},
};
use csv::WriterBuilder;
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{Spec, Status};
use curvelax_statistics::{Description, Interval, Sample, interval};
use serde::Serialize;

/// Relaxation times of one cell.
pub struct CellStatistics {
    /// Index of the cell.
    pub cell: u64,
    /// Its swept values, in the order of the keys.
    pub values: Vec<String>,
    /// Members, by status.
    pub counts: [u64; Status::ALL.len()],
    /// When members relaxed.
    pub relaxing: EventStatistics,
    /// Decay rates.
    pub rates: Rates,
    /// The events of the spec, in their order.
    pub events: Vec<EventStatistics>,
    /// When members vanished, if they are driven.
    pub vanishing: EventStatistics,
}

/// A kind of time in one cell: that of relaxation, of an event, or of vanishing.
pub struct EventStatistics {
    /// Its times.
    pub times: TimeStatistics,
    /// Their error of discretisation, if it is known of some members.
    pub discretisation: Option<DiscretisationError>,
    /// Their limits, if members have them and none was stopped before the event.
    pub limits: Option<CellLimits>,
    /// Members that were stopped when they relaxed, before the event. If there are any, censoring depends on how slow a
    /// member is, and nothing is estimated.
    pub stopped: u64,
}

/// Fitted decay rates of the members of one cell that have one: complete data.
pub struct Rates {
    /// The numbers for the table.
    pub numbers: Numbers,
    /// Data for the chart: the rates, or their ratios to theory.
    pub drawn: Description,
}

impl Rates {
    /// Summarises `rates`; the chart shows their ratios to theory if they are `relative`.
    fn new(rates: &[Rate], relative: bool) -> Result<Rates> {
        let theory = Description::new(rates.iter().filter_map(Rate::theory))?.median();
        let fitted = Description::new(rates.iter().map(|rate| rate.fitted))?;
        let moments = moments("mean", [fitted.mean(), fitted.standard_deviation(), fitted.standard_error()]);
        let quantiles = QUANTILES.map(|(share, ..)| fitted.quantile(share));
        let of_quantiles = QUANTILES.map(|(share, ..)| interval::of_values(&fitted, share));
        let (intervals, [_, _, of_median, ..]) = (intervals(&of_quantiles), of_quantiles);
        let places = places(quantiles, of_median);
        let (known, mut named) = (fitted.count(), moments.into_iter().chain(places).collect::<Vec<_>>());
        // Each is as large as all times of the cell: one at a time.
        let kept = (!relative).then_some(fitted);
        let ratio = Description::new(rates.iter().filter_map(Rate::ratio))?;
        named.push(Statistic::new("theory", theory, "median of the rates of linear theory"));
        named.push(Statistic::new("ratio", ratio.median(), "median of rate over linear theory"));
        Ok(Rates { numbers: Numbers { known, named, intervals }, drawn: kept.unwrap_or(ratio) })
    }
}

/// A field of a row of statistics, with what its column says.
pub struct StatisticsField {
    /// The heading.
    pub name: String,
    /// What a field holds.
    pub holds: &'static str,
    /// What it means.
    pub meaning: String,
    value: FieldValue,
}

/// What is written to a field.
#[derive(Serialize)]
#[serde(untagged)]
enum FieldValue {
    Word(String),
    Count(u64),
    Number(Option<f64>),
}

/// Relaxation times of the outlines of one group in a cell.
pub struct GroupStatistics {
    /// The value of the property.
    pub group: String,
    /// Their times.
    pub times: CellStatistics,
}

/// Relaxation times of all cells, and how they compare.
pub struct EnsembleStatistics {
    /// Each cell.
    pub cells: Vec<CellStatistics>,
    /// How the cells compare.
    pub comparison: CellComparison,
    /// Each group of outlines, cell by cell, if they are grouped.
    pub groups: Vec<GroupStatistics>,
    /// How the groups of each cell compare.
    pub group_comparisons: Vec<CellComparison>,
    /// The medians as a power of the swept value, if a single scale is swept.
    pub scaling: Option<Scaling>,
    /// Times are shown and compared in the limit: members have limits in each cell in which any relaxed.
    pub of_limits: bool,
    /// The uncertainty is that of each member, if they are outlines, and else that of the median.
    pub of_each: bool,
    /// Rates are drawn relative to theory, if all members with a rate have a theoretical one.
    pub relative: bool,
}

impl EnsembleStatistics {
    /// The relative uncertainty of the limits in the cell where it is largest; infinite if one has none.
    pub fn uncertainty(&self) -> f64 {
        let cells = self.cells.iter().map(|cell| cell.uncertainty(self.of_each));
        cells.map(|reached| reached.map_or(f64::INFINITY, |(all, _)| all)).fold(0.0, f64::max)
    }
}

impl CellStatistics {
    /// Moves times and rates out of `tally`.
    fn new(spec: &Spec, cell: u64, tally: &mut CellTally, relative: bool) -> Result<CellStatistics> {
        let (values, counts) = (spec.sweep.labels(cell), tally.counts);
        let copies = !spec.has_different_members() && !spec.sweep.has("amplitude");
        let relaxing = EventStatistics::new(mem::take(&mut tally.relaxing), copies)?;
        let rates = Rates::new(&mem::take(&mut tally.rates), relative)?;
        let mut of_events = mem::take(&mut tally.events).into_iter();
        let events = spec.event.iter().map(|_| EventStatistics::new(of_events.next().unwrap_or_default(), copies));
        let events = events.collect::<Result<_>>()?;
        let vanishing = EventStatistics::new(mem::take(&mut tally.vanishing), copies)?;
        Ok(CellStatistics { cell, values, counts, relaxing, rates, events, vanishing })
    }

    /// Number of members that ended.
    pub fn members(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Number of members that relaxed before they vanished.
    pub fn relaxed_before_vanishing(&self) -> u64 {
        let relaxed = (self.relaxing.times.sample.events() as u64).saturating_sub(self.counts[0]);
        relaxed.min(self.vanishing.times.sample.events() as u64)
    }

    /// The numbers on the times at which members vanished, for the table.
    pub fn vanished(&self) -> Numbers {
        of_median(self.vanishing.times.numbers())
    }

    /// The numbers on the limits of these times, for the table.
    pub fn vanished_limit(&self) -> Numbers {
        of_median(self.vanishing.limit())
    }

    /// The row of a table, with `keys` after the index of the cell.
    fn row(&self, keys: impl Iterator<Item = StatisticsField>) -> Vec<StatisticsField> {
        let quantities = [
            ("t_relax", self.relaxing.times.numbers()),
            ("rate", self.rates.numbers.clone()),
            ("discretisation", self.relaxing.errors()),
            ("t_limit", self.relaxing.limit()),
        ];
        let vanishing = [("t_vanish", self.vanished()), ("t_vanish_limit", self.vanished_limit())];
        let mut row = vec![count("cell", self.cell, "index of the cell, from 0")];
        row.extend(keys);
        row.push(count("members", self.members(), "members that ended"));
        let statuses = Status::ALL.map(Status::name).into_iter().zip(self.counts);
        row.extend(statuses.map(|(name, members)| count(name, members, format!("members that ended {name}"))));
        let with_known = |(quantity, numbers): &(&str, Numbers)| {
            let meaning = match *quantity {
                "discretisation" => "members on which the discretisation error was estimated".into(),
                _ => format!("members with a {quantity}"),
            };
            let known = count(format!("{quantity}_known"), numbers.known as u64, meaning);
            [known].into_iter().chain(floats(quantity, &numbers.named)).collect::<Vec<_>>()
        };
        row.extend(quantities.iter().flat_map(with_known));
        row.extend(quantities.iter().flat_map(|(quantity, numbers)| floats(quantity, &numbers.intervals)));
        row.extend(vanishing.iter().flat_map(with_known));
        row
    }

    /// The times that are shown: the limits, if they are asked for.
    pub fn judged(&self, of_limits: bool) -> &TimeStatistics {
        if of_limits { self.relaxing.judged() } else { &self.relaxing.times }
    }

    /// The median with its interval, that of the limits if they are asked for.
    pub fn judged_median(&self, of_limits: bool) -> Option<(f64, Option<Interval>)> {
        let times = self.judged(of_limits);
        times.median().map(|median| (median, times.interval()))
    }

    /// Whether all its members relaxed at one time, as copies of one curve do.
    pub fn has_copies(&self) -> bool {
        let mut seen = self.relaxing.times.sample.observations();
        seen.next().is_some_and(|first| first.happened && seen.all(|other| other == first))
    }

    /// The relative uncertainty of its limits: of each, or else of their median, with the part that is no sampling.
    pub fn uncertainty(&self, of_each: bool) -> Option<(f64, f64)> {
        let limits = self.relaxing.limits.as_ref()?;
        if of_each { limits.widest.map(|widest| (widest, widest)) } else { limits.uncertainty() }
    }
}

impl EventStatistics {
    /// The statistics of a kind of time; `copies` says that all members are one curve.
    fn new(of: EventTally, copies: bool) -> Result<EventStatistics> {
        let EventTally { times, limits, judged, stopped, .. } = of;
        let discretisation = DiscretisationError::of(&judged)?;
        let (times, limits) = match stopped {
            0 => (TimeStatistics::new(times), CellLimits::of(&limits, &judged, copies)?),
            _ => (TimeStatistics::unknown(times), None),
        };
        Ok(EventStatistics { times, discretisation, limits, stopped })
    }

    /// The numbers on its error of discretisation, for the table.
    pub fn errors(&self) -> Numbers {
        let number = |number: fn(&DiscretisationError) -> f64| self.discretisation.as_ref().map(number);
        let mean = "mean relative error of the times by n and the steps, negative if they are too early";
        let named = vec![
            Statistic::new("mean", number(|of| of.mean), mean),
            Statistic::new("error", number(|of| of.error), "half-width of its 95 % interval"),
        ];
        let known = self.discretisation.as_ref().map_or(0, |of| of.members);
        Numbers { known, named, intervals: Vec::new() }
    }

    /// The numbers on its limits, for the table.
    pub fn limit(&self) -> Numbers {
        let times = self.limits.as_ref().map(|limits| &limits.times);
        let error = self.limits.as_ref().and_then(|limits| limits.error);
        let interval = times.and_then(TimeStatistics::interval);
        let of = "median, for sampling and discretisation together (with fewer than 6 members, of their range)";
        let mut named: Vec<Statistic> = of_mean(times.and_then(|times| times.mean)).into();
        named.push(Statistic::new("median", times.and_then(TimeStatistics::median), "median"));
        named.extend(ends("median", [of; 2].map(String::from), interval));
        named.push(Statistic::new("error", error, "median of t_error"));
        Numbers { known: times.map_or(0, |times| times.sample.events()), named, intervals: vec![covered(interval)] }
    }

    /// The times that are shown: the limits, if there are any.
    pub fn judged(&self) -> &TimeStatistics {
        self.limits.as_ref().map_or(&self.times, |limits| &limits.times)
    }
}

impl EnsembleStatistics {
    /// Computes the statistics of a run of `spec`. Times and rates are moved out of `tally`, which keeps the counts.
    ///
    /// Those of 10⁷ members are 240 MB, so they are sorted in place.
    pub fn new(spec: &Spec, tally: &mut Tally) -> Result<EnsembleStatistics> {
        let relative = tally.cells.iter().flat_map(|cell| &cell.rates).all(|rate| rate.theory().is_some());
        let of_limits = tally.has_limits();
        // Sorting takes the times out of the order of the members.
        let same_outlines = spec.outlines.is_some() && !spec.sweep.has("shape");
        let paired = match () {
            () if spec.has_copies_of_outlines() => Some(CellComparison::of_copies(spec.sweep.cells())),
            () if spec.common_random_numbers || same_outlines => Some(CellComparison::paired(spec, tally, of_limits)?),
            () => None,
        };
        let mut none = CellTally::default();
        let cells = (0..spec.sweep.cells())
            .map(|cell| {
                let of_cell = tally.cells.get_mut(cell as usize).unwrap_or(&mut none);
                CellStatistics::new(spec, cell, of_cell, relative)
            })
            .collect::<Result<Vec<_>>>()?;
        let samples: Vec<&Sample> = cells.iter().map(|cell| &cell.judged(of_limits).sample).collect();
        let comparison = match paired {
            Some(paired) => paired,
            None => CellComparison::independent(spec, &samples)?,
        };
        let medians = cells.iter().map(|cell| {
            let (value, interval) = cell.judged_median(of_limits).unzip();
            CellMedian { cell: cell.cell, value, interval: interval.flatten(), has_copies: cell.has_copies() }
        });
        let scaling = Scaling::of(&spec.sweep, &medians.collect::<Vec<_>>());
        let groups = mem::take(&mut tally.groups).into_iter().map(|((cell, group), mut of_group)| {
            let times = CellStatistics::new(spec, cell, &mut of_group, relative)?;
            Ok(GroupStatistics { group, times })
        });
        let mut groups: Vec<GroupStatistics> = groups.collect::<Result<_>>()?;
        // Numbers ascend as numbers.
        if let Some(numbers) = groups.iter().map(|of| of.group.parse::<f64>().ok()).collect::<Option<Vec<_>>>() {
            let mut order: Vec<_> = numbers.into_iter().zip(groups).collect();
            order.sort_by(|(a, one), (b, other)| one.times.cell.cmp(&other.times.cell).then(a.total_cmp(b)));
            groups = order.into_iter().map(|(_, of)| of).collect();
        }
        let group_comparisons = groups.chunk_by(|one, other| one.times.cell == other.times.cell).map(|of_cell| {
            let samples: Vec<&Sample> = of_cell.iter().map(|group| &group.times.judged(of_limits).sample).collect();
            match spec.has_copies_of_outlines() {
                true => CellComparison::of_copies(samples.len() as u64),
                false => {
                    CellComparison::of_groups(&samples, &of_cell.iter().map(|group| &*group.group).collect::<Vec<_>>())
                }
            }
        });
        let group_comparisons = group_comparisons.collect();
        let of_each = spec.outlines.is_some();
        Ok(EnsembleStatistics { cells, comparison, groups, group_comparisons, scaling, relative, of_limits, of_each })
    }

    /// The times of a cell or a group that are shown.
    pub fn times<'a>(&self, of: &'a CellStatistics) -> &'a TimeStatistics {
        of.judged(self.of_limits)
    }

    /// The time that is shown and compared.
    pub fn time(&self) -> &'static str {
        if self.of_limits { "t_limit" } else { "t_relax" }
    }

    /// The rows of `ensemble.csv`.
    pub fn rows(&self, spec: &Spec) -> impl Iterator<Item = Vec<StatisticsField>> {
        self.cells.iter().map(|cell| {
            let keys = spec.sweep.axes().iter().map(|axis| &axis.key).zip(&cell.values);
            cell.row(keys.map(|(key, value)| word(key, "swept value", value, format!("--{key} of the cell"))))
        })
    }

    /// The rows of `groups.csv`, if outlines are grouped.
    pub fn group_rows(&self) -> impl Iterator<Item = Vec<StatisticsField>> {
        let key = |group| word("group", "word", group, "value of the property `--group-by`");
        self.groups.iter().map(move |of| of.times.row([key(&of.group)].into_iter()))
    }

    /// The rows of `event_statistics.csv`: the events of each cell, in the order of the spec.
    pub fn event_rows<'a>(&'a self, spec: &'a Spec) -> impl Iterator<Item = Vec<StatisticsField>> {
        let of_cell = |cell: &'a CellStatistics| spec.event.iter().zip(&cell.events).map(move |of| (cell.cell, of));
        self.cells.iter().flat_map(of_cell).map(|(cell, (event, of))| {
            let (times, errors, limits) = (of.times.numbers(), of.errors(), of.limit());
            let mut row = vec![
                count("cell", cell, "index of the cell, from 0"),
                word("event", "word", &event.name, "name of the event"),
                count("members", of.times.sample.len() as u64, "members that ended"),
                count("known", times.known as u64, "members of which the event was seen"),
            ];
            row.extend(floats("", &times.named));
            row.push(count("discretisation_known", errors.known as u64, "members of which that is known"));
            row.extend(floats("discretisation", &errors.named).chain(floats("", &times.intervals)));
            let meaning = "members of which the limit of the time is known, with `--refine`";
            row.push(count("t_limit_known", limits.known as u64, meaning));
            row.extend(floats("t_limit", &limits.named).chain(floats("t_limit", &limits.intervals)));
            row
        })
    }
}

/// The numbers of which the names say that they are on the median, and its error, of times at which members vanished.
fn of_median(Numbers { known, mut named, .. }: Numbers) -> Numbers {
    named.retain(|of| of.name.starts_with("median") || of.name == "error");
    named.iter_mut().filter(|of| of.name == "error").for_each(|of| of.meaning = "median of t_vanish_error".into());
    Numbers { known, named, intervals: Vec::new() }
}

fn word(name: impl Into<String>, holds: &'static str, value: &str, meaning: impl Into<String>) -> StatisticsField {
    let (name, meaning) = (name.into(), meaning.into());
    StatisticsField { name, holds, meaning, value: FieldValue::Word(value.into()) }
}

fn count(name: impl Into<String>, value: u64, meaning: impl Into<String>) -> StatisticsField {
    let (name, meaning) = (name.into(), meaning.into());
    StatisticsField { name, holds: "integer", meaning, value: FieldValue::Count(value) }
}

/// The fields of some numbers on a quantity, which has no name where it is the only one.
fn floats(quantity: &str, of: &[Statistic]) -> impl Iterator<Item = StatisticsField> {
    let [joint, colon] = if quantity.is_empty() { [""; 2] } else { ["_", ": "] };
    of.iter().map(move |Statistic { name, value, meaning }| StatisticsField {
        name: format!("{quantity}{joint}{name}"),
        holds: "float",
        meaning: format!("{quantity}{colon}{meaning}"),
        value: FieldValue::Number(*value),
    })
}

/// The text of a table of these rows, of which there is one at least; `name` is used in the error message.
pub fn to_csv(name: &str, rows: impl Iterator<Item = Vec<StatisticsField>>) -> Result<String> {
    let failed = |e: &dyn std::fmt::Display| Error::Failed(format!("cannot write {name}: {e}"));
    let mut writer = WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    let mut rows = rows.peekable();
    let names: Vec<&str> = rows.peek().into_iter().flatten().map(|field| &*field.name).collect();
    writer.write_record(names).map_err(|e| failed(&e))?;
    for row in rows {
        let values: Vec<FieldValue> = row.into_iter().map(|field| field.value).collect();
        writer.serialize(values).map_err(|e| failed(&e))?;
    }
    let bytes = writer.into_inner().map_err(|e| failed(&e))?;
    String::from_utf8(bytes).map_err(|e| failed(&e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::outcome;

    fn statistics(sweep: &str, members: &[(u64, Option<f64>)]) -> (Spec, EnsembleStatistics) {
        let mut spec = Spec { curves: 2, ..Spec::default() };
        if !sweep.is_empty() {
            spec.sweep.set(sweep.parse().unwrap());
        }
        let mut tally = Tally::default();
        for (cell, t_relax) in members {
            let status = if t_relax.is_some() { Status::Relaxed } else { Status::Unfinished };
            tally.add(&curvelax_ensemble::Outcome { cell: *cell, ..outcome(0, status, *t_relax) }).unwrap();
        }
        let statistics = EnsembleStatistics::new(&spec, &mut tally).unwrap();
        (spec, statistics)
    }

    #[test]
    fn a_table_looks_like_this() {
        let members = [(0, Some(0.5)), (0, Some(1.5)), (1, Some(1.0)), (1, None)];
        let (spec, statistics) = statistics("shape=ellipse:2,1;circle:1", &members);
        let text = to_csv("ensemble.csv", statistics.rows(&spec)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "cell,shape,members,relaxed,unfinished,singular,nonfinite,stalled,vanished,t_relax_known,t_relax_mean,t_relax_sd,\
             t_relax_se,t_relax_restricted_to,t_relax_q05,t_relax_q25,t_relax_median,t_relax_q75,t_relax_q95,\
             t_relax_median_low,t_relax_median_high,rate_known,rate_mean,rate_sd,rate_se,rate_q05,rate_q25,\
             rate_median,rate_q75,rate_q95,rate_median_low,rate_median_high,rate_theory,rate_ratio,discretisation_known,\
             discretisation_mean,discretisation_error,t_limit_known,t_limit_mean,t_limit_sd,t_limit_se,t_limit_median,\
             t_limit_median_low,t_limit_median_high,t_limit_error,t_relax_median_coverage,t_relax_q05_low,\
             t_relax_q05_high,t_relax_q25_low,t_relax_q25_high,t_relax_q75_low,t_relax_q75_high,t_relax_q95_low,\
             t_relax_q95_high,rate_median_coverage,rate_q05_low,rate_q05_high,rate_q25_low,rate_q25_high,rate_q75_low,\
             rate_q75_high,rate_q95_low,rate_q95_high,t_limit_median_coverage,\
             t_vanish_known,t_vanish_median,t_vanish_median_low,t_vanish_median_high,t_vanish_limit_known,\
             t_vanish_limit_median,t_vanish_limit_median_low,t_vanish_limit_median_high,t_vanish_limit_error"
        );
        assert!(lines[1].starts_with("0,\"ellipse:2,1\",2,2,0,0,0,0,0,2,1.0,0.7071"), "{}", lines[1]);
        assert!(lines[2].starts_with("1,circle:1,2,1,1,0,0,0,0,1,1.5,0.5,"), "{}", lines[2]);
        assert!(lines[2].contains(",2.0,1.0,1.0,1.0,,,"), "the mean is restricted, the tail unknown: {}", lines[2]);
        assert!(statistics.comparison.refusal().is_some(), "{:?}", statistics.comparison);
        assert_eq!(statistics.scaling, None);
    }

    #[test]
    fn cells_without_times_have_empty_fields_and_no_nan() {
        let (spec, statistics) = statistics("omega=1,2,3", &[(0, None), (0, None), (2, Some(0.0))]);
        let text = to_csv("ensemble.csv", statistics.rows(&spec)).unwrap();
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        let (lines, gap): (Vec<&str>, _) = (text.lines().skip(1).collect(), ",".repeat(12));
        // Of both it is known that they relax later than 2: so does the median with 75 %, the 95 % quantile with 99.75
        // %.
        let later = format!(
            "{}2.0,,0{gap},0,,,0{}0.75{}2.0{}0,,,,0,,,,",
            ",".repeat(10),
            ",".repeat(8),
            ",".repeat(7),
            ",".repeat(12)
        );
        assert_eq!(lines[0], format!("0,1,2,0,2,0,0,0,0,0{later}"));
        assert_eq!(lines[1], format!("1,2,0,0,0,0,0,0,0,0{gap}0{gap},0,,,0{}0,,,,0,,,,", ",".repeat(27)));
        assert!(lines[2].starts_with("2,3,1,1,0,0,0,0,0,1,0.0,,,,0.0,"), "{}", lines[2]);
    }
}
