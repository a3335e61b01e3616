//! What a page says first: title, what was run, and the numbers to read first.

use super::{DIGITS, FinishedRun, MAX_NAME};
use crate::report::{
    page::{Headline, PageHead},
    words::{describe, member_name, member_time, time_unit},
};
use curvelax_base::{
    error::shortened,
    text::{count, p_value, significant},
};
use curvelax_draw::medium::Medium;
use curvelax_ensemble::{Outcome, Spec, request::sweep::SweepAxis};
use curvelax_statistics::{Interval, PairedDifferences};
use curvelax_study::results::{
    cells::{CellStatistics, EnsembleStatistics},
    comparison::{CellComparison, CellDifference},
    discretisation::DiscretisationError,
    scaling::Scaling,
};

/// Maximum characters of names in a title.
const MAX_TITLE: usize = 90;

impl FinishedRun<'_> {
    /// What the page says first.
    pub fn head(&self) -> PageHead {
        let smoothing = self.tally.supplement.mollified.smoothing().map_or(String::new(), |text| format!("; {text}"));
        PageHead {
            title: self.title(),
            what: format!(
                "{}, {}{smoothing}. {}",
                count(self.tally.members(), "member"),
                self.what(),
                self.about_times()
            ),
            statuses: self.tally.counts().map(|(status, count)| (status.name(), count)).collect(),
            relaxed_before: self.tally.relaxed_before_vanishing(),
            headline: self.headline(),
        }
    }

    /// What times are, and their unit.
    fn about_times(&self) -> String {
        let unit = match (&self.spec().units, self.spec().mobility) {
            (Some(units), _) => format!("in {}", units.shown().time),
            (None, Some(_)) => "in the unit of time of B".into(),
            (None, None) => "in length⁴, in the unit of length of the coordinates".into(),
        };
        let relaxed = match self.spec().has_vesicles() {
            true => {
                " A vesicle is relaxed once |E - E_end| of its bending energy stays below relax-to times its maximum."
            }
            false => "",
        };
        match self.statistics.of_limits {
            true => format!(
                "t_limit is the limit of t_relax for many nodes and short steps{}; t_relax itself is the time at n = {}. \
                 Times are {unit}.{relaxed}",
                if self.spec().drive.is_some() { ", t_vanish_limit that of t_vanish" } else { "" },
                self.spec().points
            ),
            false => format!("Times are {unit}.{relaxed}"),
        }
    }

    /// What ran, for the window and the heading: shape, flow and the swept keys.
    fn title(&self) -> String {
        let Spec { shape, flow, sweep, .. } = self.spec();
        let shape = match () {
            () if self.spec().names_members() && self.spec().outlines.is_some() => self.outline_names(),
            () if sweep.has("shape") => "curves".into(),
            () => shortened(&shape.to_string(), MAX_NAME),
        };
        let flow = if sweep.has("flow") { String::new() } else { format!(" under {flow}") };
        let keys = self.keys();
        let keys = if keys.is_empty() { keys } else { format!(", by {}", listed(&keys)) };
        let Spec { conserve, drive, .. } = self.spec();
        let kept = conserve.filter(|_| !sweep.has("conserve")).map(|what| format!("{what} kept"));
        let drive = drive.as_ref().filter(|_| !sweep.has("drive")).map(|drive| format!("drive {drive}"));
        let acting: String = kept.into_iter().chain(drive).map(|what| format!(", {what}")).collect();
        format!("{shape}{flow}{acting}{keys}")
    }

    /// The labels of the outlines, as many as a title takes.
    fn outline_names(&self) -> String {
        let mut labels: Vec<&str> = self.tally.named.iter().map(|member| &member.label[..]).collect();
        labels.dedup();
        let cell = self.spec().members_per_cell() as usize;
        labels.truncate(cell.max(1));
        let fits =
            |count: &usize| labels[..*count].iter().map(|label| label.chars().count() + 2).sum::<usize>() <= MAX_TITLE;
        match (1..=labels.len()).rfind(fits) {
            Some(all) if all == labels.len() => labels.join(", "),
            Some(some) => format!("{} and {} more", labels[..some].join(", "), labels.len() - some),
            None => count(labels.len() as u64, "outline"),
        }
    }

    fn what(&self) -> String {
        let swept = self.spec().sweep.axes().iter().map(SweepAxis::title);
        [describe(self.spec())].into_iter().chain(swept).collect::<Vec<_>>().join("; ")
    }

    /// What ran and something else below the title of a chart; a page says the first itself.
    pub(super) fn note(&self, medium: Medium, rest: &str) -> String {
        let what = if medium == Medium::Page { String::new() } else { self.what() };
        [&what, rest].into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join("; ")
    }

    /// The error of discretisation of the times in a picture.
    pub(super) fn error(&self) -> String {
        // Limits are free of it.
        if self.statistics.of_limits {
            return String::new();
        }
        let errors = self.statistics.cells.iter().filter_map(|cell| cell.relaxing.discretisation.as_ref());
        let percent: Vec<f64> = errors.filter(|error| error.converges()).map(|error| 100.0 * error.mean).collect();
        let [low, high] = [f64::min, f64::max].map(|of| percent.iter().copied().reduce(of).unwrap_or_default());
        let [low, high] = [low, high].map(|value| significant(value, 2));
        let range = match percent[..] {
            [] => return String::new(),
            [_] => low,
            _ if low == high => low,
            _ => format!("{low} to {high}"),
        };
        format!("discretisation error about {range} %")
    }

    fn headline(&self) -> Vec<Headline> {
        let EnsembleStatistics { cells, comparison, scaling, .. } = self.statistics;
        let mut headline = Vec::new();
        if self.spec().names_members() {
            return self.tally.named.iter().map(|member| self.of_member(member)).collect();
        }
        match &cells[..] {
            [cell] => headline.extend(self.of_cell(cell)),
            _ => {
                let of_limits = self.statistics.of_limits;
                let medians = cells.iter().filter_map(|cell| cell.judged_median(of_limits));
                let medians: Vec<f64> = medians.map(|(median, _)| median).collect();
                let range = [f64::min, f64::max].map(|of| medians.iter().copied().reduce(of));
                let shown = match range {
                    [Some(low), Some(high)] => {
                        format!("{} to {}{}", significant(low, 3), significant(high, 3), time_unit(self.spec()))
                    }
                    _ => "not reached".into(),
                };
                let note = match (medians.len(), cells.len()) {
                    (known, all) if known < all => format!("over {known} of {all} cells; the others have no median"),
                    (_, all) => format!("over {all} cells"),
                };
                headline.push(Headline::new(format!("median {}", self.statistics.time()), shown, note));
                headline.extend(scaling.as_ref().and_then(power));
                headline.extend(compared(comparison));
            }
        }
        let finer = self.tally.nodes.counted();
        headline.extend(finer.map(|(value, note)| Headline::new("with more nodes", value, note)));
        headline
    }

    /// A member that is known by name.
    fn of_member(&self, member: &Outcome) -> Headline {
        let value = format!("{}{}", member_time(self.tally, member), time_unit(self.spec()));
        let time = if member.t_limit.is_some() { "t_limit" } else { "t_relax" };
        let data = member.t_data_error.map(|error| format!("t_data_error {}", significant(error, 2)));
        let note = [member.status.name().into()].into_iter().chain(data).collect::<Vec<_>>().join(", ");
        Headline::new(member_name(self.spec(), member), format!("{time} = {value}").replace("= >", ">"), note)
    }

    /// The only cell.
    fn of_cell(&self, cell: &CellStatistics) -> Vec<Headline> {
        let (time, times, unit) = (self.statistics.time(), self.statistics.times(cell), time_unit(self.spec()));
        let shown =
            |value: Option<f64>| value.map_or("not reached".into(), |t| format!("{}{unit}", significant(t, DIGITS)));
        let tile = |label: &str, value: Option<f64>, note: String| Headline::new(label, shown(value), note);
        let told = |interval: Interval| interval.in_short(|end| significant(end, DIGITS)) + &unit;
        let vanished = Some(&cell.vanishing).filter(|of| of.stopped == 0 && of.times.sample.events() > 0);
        let vanished = vanished
            .map(|of| (if of.limits.is_some() { "median t_vanish_limit" } else { "median t_vanish" }, of.judged()))
            .map(|(name, of)| tile(name, of.median(), of.interval().map_or(String::new(), told)));
        if times.sample.events() == 0 {
            return [Headline::new(time, "not reached", "by any member")].into_iter().chain(vanished).collect();
        }
        let error = times.mean.and_then(|mean| mean.standard_error);
        let note = match times.mean.and_then(|mean| mean.restricted_to) {
            Some(_) if cell.relaxing.limits.is_some() => {
                "a lower bound: some members had not relaxed at the end, or have no limit".into()
            }
            Some(_) => "a lower bound: some members had not relaxed at the end".into(),
            None => error.map_or(String::new(), |error| format!("standard error {}", significant(error, 2))),
        };
        let mut headline = vec![
            tile(&format!("median {time}"), times.median(), times.interval().map_or(String::new(), told)),
            tile(&format!("mean {time}"), times.mean.map(|mean| mean.value), note),
        ];
        if let [Some(low), .., Some(high)] = times.quantiles {
            let value = format!("{} to {}{unit}", significant(low, 3), significant(high, 3));
            headline.push(Headline::new("nine in ten", value, format!("{time}, 5 to 95 %")));
        }
        headline.extend(if self.statistics.of_limits { self.behind(cell) } else { discretisation(cell) });
        headline.extend(vanished);
        headline
    }

    /// What stands behind the limits of a cell.
    fn behind(&self, cell: &CellStatistics) -> Vec<Headline> {
        let (unit, open) =
            (time_unit(self.spec()), cell.relaxing.discretisation.as_ref().map_or(0, |error| error.not_asymptotic));
        let bound = match open {
            0 => "half-width of the 95 % interval of each t_limit".into(),
            _ => format!("a cautious bound for {}", count(open as u64, "member")),
        };
        let shown = |value: f64, digits: usize| format!("{}{unit}", significant(value, digits));
        let error = cell.relaxing.limits.as_ref().and_then(|limits| limits.error);
        let error = error.map(|error| Headline::new("median t_error", shown(error, 2), bound));
        let nodes = format!("at n = {}", self.spec().points);
        let raw = cell
            .relaxing
            .times
            .median()
            .map(|median| Headline::new("raw median t_relax", shown(median, DIGITS), nodes));
        error.into_iter().chain(raw).collect()
    }
}

/// Keys as a sentence has them.
fn listed(keys: &str) -> String {
    keys.rsplit_once(", ").map_or(keys.into(), |(first, last)| format!("{first} and {last}"))
}

/// The error of discretisation of times without limits.
fn discretisation(cell: &CellStatistics) -> Vec<Headline> {
    let Some(discretisation) = &cell.relaxing.discretisation else { return Vec::new() };
    let DiscretisationError { members, mean, error, .. } = discretisation;
    let [mean, error] = [mean, error].map(|value| significant(100.0 * value, 2));
    let known = count(*members as u64, "member");
    let (value, note) = match discretisation.converges() {
        true => (format!("{mean} %"), format!("± {error} % of t_relax, estimated from {known}")),
        false => ("unknown".into(), format!("the order of convergence is not steady yet for most of {known}")),
    };
    vec![Headline::new("discretisation error", value, note)]
}

/// The power law of the medians, in the headline.
fn power(of: &Scaling) -> Option<Headline> {
    let law = of.law?;
    let error = law.exponent_error.map(|e| format!("standard error {}", significant(e, 2)));
    let fit = law.goodness.map(|goodness| match of.is_rejected() {
        true => format!("but χ² rejects a power law, {}", p_value(goodness.p_value)),
        false => format!("χ² allows it, {}", p_value(goodness.p_value)),
    });
    let note = error.into_iter().chain(fit).collect::<Vec<_>>().join("; ");
    Some(Headline::new(format!("power of {}", of.scale), significant(law.exponent, 3), note))
}

/// Whether the cells differ, in the headline.
fn compared(comparison: &CellComparison) -> Option<Headline> {
    let of = |value: String, note: String| Some(Headline::new("one distribution?", value, note));
    match comparison {
        CellComparison::Single => None,
        CellComparison::LogRank(test) => of(p_value(test.p_value), "log-rank test over all cells".into()),
        CellComparison::Paired(cells) => of(differing(cells), "signed ranks of each cell against the first".into()),
        CellComparison::Refused(why) => of("not tested".into(), why.clone()),
    }
}

/// How many cells differ from the first with a probability of 5 % that any of them does by chance (Bonferroni).
fn differing(cells: &[CellDifference]) -> String {
    let most = 0.05 / cells.len() as f64;
    let differ = cells.iter().filter(|cell| cell.found.test.is_some_and(|test| test.p_value < most)).count();
    match cells {
        [CellDifference { found: PairedDifferences { test: Some(test), .. }, .. }] => p_value(test.p_value),
        [_] => "not tested".into(),
        _ => format!("{differ} of {} differ", cells.len()),
    }
}
