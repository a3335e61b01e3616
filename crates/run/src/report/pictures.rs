//! What people look at: the charts of a run and its page, made from its statistics.

use std::cmp::Reverse;

use super::{
    gallery,
    overview::{describe, place},
    page::{Headline, MAX_MEMBERS, MovingMember, Page, PageFigure, PageTable, spread},
};
use curvelax_base::{
    error::{Result, shortened},
    random::normal_quantile,
    text::{count, p_value, significant},
};
use curvelax_draw::{
    charts::{
        CellQuantiles, CellValues, Decay, DecayCurve, DecayLaw, Dependence, DependencePoint, EstimatedNumber,
        FittedRates, MeshQuality, PowerLawLine, RelaxationTimes, Scatter, ScatterPanel, ScatterPoint, Series, Setting,
        Survival, SurvivalCurve, Theory, TimeDistribution,
    },
    style::SERIES,
};
use curvelax_ensemble::{Event, Spec, Status, outcome::linear_rate, request::sweep::SweepAxis};
use curvelax_files::{names, portraits::Film};
use curvelax_flow::flow::Flow;
use curvelax_statistics::{HALF_INTERVAL, Interval, KaplanMeier, Sample};
use curvelax_study::results::{
    cells::{CellStatistics, EnsembleStatistics, EventStatistics, GroupStatistics},
    comparison::{CellComparison, CellDifference},
    discretisation::DiscretisationError,
    explained::{Explained, ExplainedRow, FeaturedMember, LEAST_MEMBERS, MOST_CENSORED, TIMES, TOGETHER},
    provenance::Provenance,
    scaling::Scaling,
    tally::{CellTally, DISTRUSTED_DRIFT, MeanExcess, Tally},
    times::{QUANTILES, TimeStatistics},
};

/// Maximum number of groups in a table of the page.
const MAX_GROUPS: usize = 40;
/// Curves that can be told apart by colour and dashes.
const DISTINCT: usize = SERIES;
/// Conditions of events in a note.
const MAX_CONDITIONS: usize = 8;
/// Maximum quantiles of a cell that are drawn against those of a law.
const MOST_QUANTILES: usize = 99;
/// Maximum characters of the name of a member.
const MAX_NAME: usize = 60;
/// Digits of a number for reading.
const DIGITS: usize = 4;
/// Features of a time that the page lists.
const LISTED: usize = 6;

/// A finished run.
pub struct FinishedRun<'a> {
    /// The spec, with the place and time of the run.
    pub provenance: &'a Provenance,
    /// The results, except those moved to the statistics.
    pub tally: &'a Tally,
    /// Statistics of times and rates.
    pub statistics: &'a EnsembleStatistics,
    /// The mean excess in time.
    pub excess: &'a [MeanExcess],
    /// What explains the times.
    pub explained: &'a Explained,
    /// The first members.
    pub films: &'a [Film],
}

/// What a page says first: the fields of [`Page`] of the same names.
pub struct PageHead {
    /// Heading.
    pub title: String,
    /// What was run.
    pub what: String,
    /// Members by status.
    pub statuses: Vec<(&'static str, u64)>,
    /// The numbers to read first.
    pub headline: Vec<Headline>,
}

/// A picture, and its place in the folder of the run.
pub struct Chart {
    /// The file.
    pub name: &'static str,
    /// The picture, with its text.
    pub figure: PageFigure,
}

impl FinishedRun<'_> {
    /// The files that are drawn: name and text.
    pub fn pictures(&self) -> Result<Vec<(&'static str, String)>> {
        let charts = self.charts()?;
        let gallery = (!self.films.is_empty()).then(|| gallery::draw(self.films));
        let page = self.page(&charts, gallery.as_deref())?;
        let charts = charts.into_iter().map(|chart| (chart.name, chart.figure.svg));
        let gallery = gallery.map(|svg| (names::CURVES, svg));
        let all = charts.chain(gallery).chain([(names::REPORT, page)]);
        let named = |(name, text): (&'static str, String)| match &self.spec().units {
            Some(units) => (name, units.name(&text)),
            None => (name, text),
        };
        Ok(all.map(named).collect())
    }

    fn spec(&self) -> &Spec {
        &self.provenance.spec
    }

    /// The charts of this run, in reading order.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if the values of a cell do not fit the spec.
    pub fn charts(&self) -> Result<Vec<Chart>> {
        let mut charts = vec![self.relaxation(), self.distribution(), self.survival()];
        charts.extend(self.groups());
        charts.extend(self.events());
        charts.extend(self.excess()?);
        charts.push(self.rates());
        charts.extend(self.dependence());
        charts.push(self.features());
        charts.push(self.mesh());
        Ok(charts)
    }

    fn relaxation(&self) -> Chart {
        let cells = &self.statistics.cells;
        let numbers = self.numbers();
        let times = cells.iter().enumerate().map(|(rank, cell)| CellValues {
            label: self.label(cell.cell),
            value: numbers.as_ref().map(|numbers| numbers[rank]),
            numbers: happened(&cell.times.sample, true).collect(),
            members: cell.times.sample.len() as u64,
        });
        let others = Status::ALL.iter().enumerate().map(|(rank, status)| {
            let without = self.tally.cells.iter().map(|cell| cell.others[rank]).sum();
            (status.name(), without)
        });
        let others: Vec<(&str, u64)> = others.filter(|(_, without)| *without > 0).collect();
        let median = if let [cell] = &cells[..] { median(cell) } else { None };
        let title = "Relaxation times";
        let (note, key, cells) = (&self.what_and_error(), &self.colour_key(), times.collect());
        let svg = RelaxationTimes { title, note, key, cells, others: &others, median }.draw();
        let caption = "How many members relaxed when, and which share of all had relaxed by then, cell by cell.";
        chart(names::RELAXATION, title, caption, svg)
    }

    /// The times of each cell as a box, and their quantiles against those of two laws.
    fn distribution(&self) -> Chart {
        let numbers = self.numbers();
        let cells = self.statistics.cells.iter().enumerate().map(|(rank, cell)| {
            let survival = KaplanMeier::new(&cell.times.sample);
            let known = cell.times.sample.len().min(MOST_QUANTILES);
            let shares = || (0..known).map(|i| (i as f64 + 0.5) / known as f64);
            let quantiles = survival.quantiles(shares());
            CellQuantiles {
                label: self.label(cell.cell),
                value: numbers.as_ref().map(|numbers| numbers[rank]),
                places: cell.times.quantiles,
                quantiles: shares().map(normal_quantile).zip(quantiles).collect(),
            }
        });
        let title = "Distribution of the relaxation times";
        let (note, key, cells) = (&self.what_and_error(), &self.colour_key(), cells.collect());
        let svg = TimeDistribution { title, note, quantity: "t_relax", key, cells }.draw();
        let caption = "Above: the median, the middle half and the middle nine tenths of the members. Below: quantiles \
                       against those of a normal and a lognormal law.";
        chart(names::DISTRIBUTION, title, caption, svg)
    }

    fn survival(&self) -> Chart {
        let numbers = self.numbers();
        let curves = self.statistics.cells.iter().enumerate().map(|(rank, cell)| {
            let value = numbers.as_ref().map(|numbers| numbers[rank]);
            survival_curve(self.label(cell.cell), value, &cell.times.sample)
        });
        let (title, key) = ("Members not yet relaxed", self.colour_key());
        let survival = Survival {
            title,
            note: &self.what_and_error(),
            key: &key,
            curves: curves.collect(),
            ..Survival::default()
        };
        chart(names::SURVIVAL, title, SURVIVAL_CAPTION, survival.draw())
    }

    /// The members not yet relaxed, by group of their outlines.
    fn groups(&self) -> Option<Chart> {
        let (key, all) = (self.spec().group_by.as_deref()?, &self.statistics.groups);
        let mut groups: Vec<&GroupStatistics> = all.iter().collect();
        if groups.len() > DISTINCT {
            let median = |of: &GroupStatistics| of.times.median().unwrap_or(f64::INFINITY);
            groups.sort_by(|one, other| median(one).total_cmp(&median(other)));
            groups = spread(groups.len(), DISTINCT).map(|i| groups[i]).collect();
        }
        let curve = |GroupStatistics { group, times }: &GroupStatistics| {
            survival_curve(self.label_in(group, times.cell), None, &times.times.sample)
        };
        let curves: Vec<SurvivalCurve> = groups.iter().map(|group| curve(group)).collect();
        let title = format!("Members not yet relaxed, by {key}");
        let some = match curves.len() < all.len() {
            true => format!("; {} of {} groups, spread over the order of their medians", curves.len(), all.len()),
            false => String::new(),
        };
        let note = &format!("{}{some}", self.what_and_error());
        let svg = (!curves.is_empty())
            .then(|| Survival { title: &title, note, key, curves, ..Survival::default() }.draw())?;
        Some(chart(names::GROUP_SURVIVAL, &title, SURVIVAL_CAPTION, svg))
    }

    /// The name of a group or an event of a cell in a legend.
    fn label_in(&self, name: &str, cell: u64) -> String {
        if self.spec().sweep.is_empty() { name.into() } else { format!("{name}, {}", self.label(cell)) }
    }

    /// A survival curve for each event of each cell, if there are events.
    fn events(&self) -> Option<Chart> {
        let spec = self.spec();
        let curves = self.statistics.cells.iter().flat_map(|cell| {
            let events = spec.event.iter().zip(&cell.events).filter(|(_, of)| of.stopped == 0);
            events.map(|(event, of)| survival_curve(self.label_in(&event.name, cell.cell), None, &of.times.sample))
        });
        let mut curves: Vec<SurvivalCurve> = curves.collect();
        let all = curves.len();
        curves.truncate(DISTINCT);
        let some = if all > DISTINCT { format!("; the first {DISTINCT} of {all} curves") } else { String::new() };
        let shown = spec.event.iter().take(MAX_CONDITIONS).map(Event::to_string);
        let mut conditions = shown.collect::<Vec<_>>().join("; ");
        if spec.event.len() > MAX_CONDITIONS {
            conditions += &format!("; {} more", spec.event.len() - MAX_CONDITIONS);
        }
        let (title, note) = ("Events", format!("{conditions}; {}{some}", self.what()));
        let (share, none) = ("share without the event", "There are no members, so there are no events.");
        let survival = Survival { title, note: &note, key: "event", share, none, curves, time: None };
        let caption = "Share of the members in which an event has not happened yet: Kaplan-Meier estimate with Greenwood's \
                       95 % band; a stroke marks a member that ended before.";
        (!spec.event.is_empty()).then(|| chart(names::EVENT_SURVIVAL, title, caption, survival.draw()))
    }

    /// The mean excess, for as long as all members of a cell are running.
    fn excess(&self) -> Result<Option<Chart>> {
        let numbers = self.numbers();
        let curve = |(rank, cell): (usize, &CellTally)| {
            let all: u64 = cell.counts.iter().sum();
            // Rows are sorted by cell.
            let first = self.excess.partition_point(|row| row.cell < rank as u64);
            let rows = self.excess[first..].iter().take_while(|row| row.cell == rank as u64 && row.members == all);
            let rows = rows.map_while(|row| Some((row.t, row.mean?, [row.q05?, row.q95?])));
            let rows: Vec<(f64, f64, [f64; 2])> = rows.collect();
            let bound = |i: usize| rows.iter().map(|(.., bounds)| bounds[i]).collect();
            DecayCurve {
                label: self.label(rank as u64),
                value: numbers.as_ref().map(|numbers| numbers[rank]),
                t: rows.iter().map(|(t, ..)| *t).collect(),
                mean: rows.iter().map(|(_, mean, _)| *mean).collect(),
                band: Some((bound(0), bound(1))),
            }
        };
        let curves: Vec<DecayCurve> = self.tally.cells.iter().enumerate().map(curve).collect();
        if curves.iter().all(|curve| curve.t.len() < 2) {
            return Ok(None);
        }
        // One theoretical line helps, many do not.
        let theory = match (&self.tally.cells[..], &curves[..]) {
            ([cell], [curve]) => law(&self.spec().of_cell(0)?, cell, curve),
            _ => None,
        };
        let theory = theory.into_iter().collect();
        let (title, key) = ("Mean excess", self.colour_key());
        let note = format!("{}; over all members, as long as all of them run", self.what());
        let band = "5 to 95 % of the members";
        let svg = Decay { title, note: &note, band, key: &key, curves, theory, time: None }.draw();
        let excess = self.spec().flow.typical().equilibrium().excess_in_words();
        let caption = format!("How the excess, {excess}, falls, and the slope that linear theory gives.");
        Ok(Some(chart(names::EXCESS, title, &caption, svg)))
    }

    fn rates(&self) -> Chart {
        let EnsembleStatistics { cells, relative, .. } = self.statistics;
        let numbers = self.numbers();
        let rates = cells.iter().enumerate().map(|(rank, cell)| CellValues {
            label: self.label(cell.cell),
            value: numbers.as_ref().map(|numbers| numbers[rank]),
            numbers: cell.rates.drawn.sorted().into(),
            members: cell.members(),
        });
        let rates: Vec<CellValues> = rates.collect();
        let title = "Rates of decay";
        let without = self.tally.members() - rates.iter().map(|cell| cell.numbers.len() as u64).sum::<u64>();
        let (relative, unit) = (*relative, "length⁻⁴");
        let (note, key, cells) = (&self.what(), &self.colour_key(), rates);
        let svg = FittedRates { title, note, key, cells, relative, unit, without }.draw();
        let caption = "Slope of the line through ln excess, while that falls from a tenth to a thousandth of its start, over the \
                       rate that linear theory gives the slowest mode.";
        chart(names::RATE, title, caption, svg)
    }

    /// t_relax against the key that changes fastest, with a series for each combination of the others.
    fn dependence(&self) -> Option<Chart> {
        let (axis, others) = self.spec().sweep.axes().split_last()?;
        let numbers = axis.numbers();
        let EnsembleStatistics { cells, of_limits, .. } = self.statistics;
        let of_cell = |cell: &CellStatistics| {
            cell.judged_median(*of_limits).map(|(value, interval)| EstimatedNumber { value, interval })
        };
        let series = cells.chunks(axis.values.len().max(1)).map(|cells| {
            let values = &cells[0].values[..others.len()];
            let named = others.iter().zip(values).map(|(other, value)| format!("{} = {value}", other.key));
            let level = |(rank, cell): (usize, &CellStatistics)| DependencePoint {
                at: match &numbers {
                    Some(numbers) => Setting::Number(numbers[rank]),
                    None => Setting::Name(cell.values[others.len()].clone()),
                },
                median: of_cell(cell),
                quartiles: quartiles(cell),
            };
            let mut levels: Vec<DependencePoint> = cells.iter().enumerate().map(level).collect();
            if numbers.is_some() {
                let place = |level: &DependencePoint| if let Setting::Number(x) = level.at { x } else { 0.0 };
                levels.sort_by(|a, b| place(a).total_cmp(&place(b)));
            }
            let scaling = self.statistics.scaling.as_ref();
            let fit = scaling.and_then(|scaling| Some((scaling, scaling.law?))).map(|(scaling, law)| {
                let around = |error: f64| {
                    Interval::between(law.exponent - HALF_INTERVAL * error, law.exponent + HALF_INTERVAL * error)
                };
                let exponent = EstimatedNumber { value: law.exponent, interval: law.exponent_error.map(around) };
                PowerLawLine { exponent, factor: law.factor, rejected: scaling.is_rejected() }
            });
            let label = named.collect::<Vec<_>>().join(", ");
            let value = if let [other] = others { value_of(other, values) } else { None };
            Series { label, value, levels, fit }
        });
        let title = format!("Relaxation time against {}", axis.key);
        let other_key = others.iter().map(|other| other.key.as_str()).collect::<Vec<_>>().join(", ");
        let left_out = self.statistics.scaling.as_ref().map(Scaling::told).filter(|told| !told.is_empty());
        let left_out = left_out.map_or(String::new(), |told| format!(". Not in the fit: {told}"));
        let (note, series) = (format!("{}{left_out}", self.what_and_error()), series.collect());
        let (key, across, time) = (&axis.key[..], None, None);
        let quantity = self.statistics.time();
        let svg = Dependence { title: &title, note: &note, quantity, key, other_key: &other_key, series, across, time };
        let svg = svg.draw();
        let caption = "Median with its interval (thick), which covers 95 % or is the range of fewer than 6 members, and the middle half of the members (thin).";
        Some(chart(names::DEPENDENCE, &title, caption, svg))
    }

    /// t_relax against the features that explain it best.
    fn features(&self) -> Chart {
        let Explained { rows, features, pictured, drawn } = self.explained;
        let numbers = self.numbers();
        let cells = self.statistics.cells.iter().enumerate();
        let cells = cells.map(|(rank, cell)| (self.label(cell.cell), numbers.as_ref().map(|numbers| numbers[rank])));
        let panel = |i: &usize| {
            let known = drawn.iter().filter(|member| member.numbers[*i].is_finite());
            let point = |member: &FeaturedMember| ScatterPoint {
                cell: member.cell as usize,
                member: member.member,
                x: member.numbers[*i],
                t: member.times[0].unwrap_or(member.t_end),
                happened: member.times[0].is_some(),
            };
            let heading = explains(rows.iter().filter(|row| row.time == TIMES[0] && row.feature == features[*i]));
            ScatterPanel { feature: features[*i].clone(), heading, points: known.map(point).collect() }
        };
        let title = "What explains the relaxation time";
        let members = self.tally.members();
        let some = match drawn.len() as u64 {
            drawn if drawn < members => format!("{drawn} of {members} members are drawn, spread over all."),
            _ => String::new(),
        };
        let reason = match rows.is_empty() {
            true => "The members of a cell do not differ in any feature.".into(),
            false => format!("Nothing is said about a time {}.", claims()),
        };
        let is_told = |row: &&ExplainedRow| row.time == TIMES[0] && row.feature == TOGETHER;
        let told: Vec<bool> = rows.iter().filter(is_told).map(|row| row.r2.is_some()).collect();
        let silent = match told.iter().filter(|told| !**told).count() {
            0 => String::new(),
            silent => format!("{silent} of {} cells have no R²: too few members relaxed.", told.len()),
        };
        let (notes, panels) = (vec![self.what(), some, silent], pictured.iter().map(panel).collect());
        let (key, cells, reason) = (&self.colour_key(), cells.collect(), &*reason);
        let svg = Scatter { title, notes, quantity: TIMES[0], key, cells, panels, reason }.draw();
        let caption = "The features of members.csv whose straight line explains most of t_relax.";
        chart(names::FEATURES, title, caption, svg)
    }

    fn mesh(&self) -> Chart {
        let title = "Mesh quality at the end";
        let quality = MeshQuality {
            title,
            note: &self.what(),
            mesh_ratio: &self.tally.mesh_ratios,
            metric_drift: &self.tally.metric_drifts,
            distrusted: Some((DISTRUSTED_DRIFT, self.tally.distrusted())),
        };
        let caption = "Longest over shortest edge, and how far the scheme's lengths have left the polygon's.";
        chart(names::MESH, title, caption, quality.draw())
    }

    /// What the page says first.
    pub fn head(&self) -> PageHead {
        let corners = self.tally.mollified.told().map_or(String::new(), |told| format!(" Corners were {told}."));
        PageHead {
            title: self.title(),
            what: format!("{}, {}.{corners}", count(self.tally.members(), "member"), self.what()),
            statuses: self.tally.counts().map(|(status, count)| (status.name(), count)).collect(),
            headline: self.headline(),
        }
    }

    /// The text of `report.html`; `gallery` is the picture of the first members.
    fn page(&self, charts: &[Chart], gallery: Option<&str>) -> Result<String> {
        // Equal results give equal bytes, on any number of threads.
        let spec = Spec { threads: None, ..self.spec().clone() }.to_toml()?;
        let first = gallery.map(|svg| {
            let title = "The first members before, on their way and after";
            let caption = "Grey: the start. Light: on the way. Colour: the last state, by status.";
            chart(names::CURVES, title, caption, svg.into()).figure
        });
        let PageHead { title, what, statuses, headline } = self.head();
        let page = Page {
            title: &title,
            what: &what,
            statuses,
            headline,
            warnings: &self.provenance.warnings,
            members: self.trajectories(),
            plots: charts.iter().map(|chart| chart.figure.clone()).chain(first).collect(),
            tables: [self.table()]
                .into_iter()
                .chain(self.group_table())
                .chain(self.event_table())
                .chain(self.pairs())
                .chain(self.explanation())
                .collect(),
            spec: &spec,
            provenance: self.provenance(),
        };
        Ok(page.html())
    }

    /// The members to watch: the first ones, or some of all cells.
    fn trajectories(&self) -> Vec<MovingMember> {
        let sweep = &self.spec().sweep;
        let trajectory = |film: &Film| {
            let at = film.t_relax.map_or(String::new(), |t| format!(" at t = {}", significant(t, 3)));
            let cell = match sweep.is_empty() {
                true => String::new(),
                false => format!(" ({})", sweep.name(film.member / self.spec().members_per_cell())),
            };
            let label = format!("{}{cell}: {}{at}", film.name(MAX_NAME), film.status.name());
            MovingMember { label, status: film.status.name(), times: film.times.clone(), nodes: film.frames() }
        };
        let shown = if sweep.is_empty() { self.films.len() } else { MAX_MEMBERS };
        spread(self.films.len(), shown).map(|i| trajectory(&self.films[i])).collect()
    }

    /// What ran, for the window and the heading: shape, flow and the swept keys.
    fn title(&self) -> String {
        let Spec { shape, flow, sweep, .. } = self.spec();
        let shape = if sweep.has("shape") { "curves".into() } else { shortened(&shape.to_string(), MAX_NAME) };
        let flow = if sweep.has("flow") { String::new() } else { format!(" under {flow}") };
        let keys = if sweep.is_empty() { String::new() } else { format!(", by {}", self.keys()) };
        format!("{shape}{flow}{keys}")
    }

    fn what(&self) -> String {
        let swept = self.spec().sweep.axes().iter().map(SweepAxis::title);
        [describe(self.spec())].into_iter().chain(swept).collect::<Vec<_>>().join("; ")
    }

    /// The same, with the error of discretisation of the times in the picture.
    fn what_and_error(&self) -> String {
        let errors = self.statistics.cells.iter().filter_map(|cell| cell.discretisation.as_ref());
        let percent: Vec<f64> = errors.filter(|error| error.converges()).map(|error| 100.0 * error.mean).collect();
        let [low, high] = [f64::min, f64::max].map(|of| percent.iter().copied().reduce(of).unwrap_or_default());
        let [low, high] = [low, high].map(|value| significant(value, 2));
        let range = match percent[..] {
            [] => return self.what(),
            [_] => low,
            _ if low == high => low,
            _ => format!("{low} to {high}"),
        };
        format!("{}; discretisation about {range} %", self.what())
    }

    /// The swept key with numeric values that colours show if there are many cells: the one with most values. Cells
    /// that differ in other keys share a colour.
    fn colour_axis(&self) -> Option<(usize, &SweepAxis)> {
        let axes = self.spec().sweep.axes().iter().enumerate();
        axes.filter(|(_, axis)| axis.numbers().is_some()).max_by_key(|(i, axis)| (axis.values.len(), Reverse(*i)))
    }

    /// Its name.
    fn colour_key(&self) -> String {
        self.colour_axis().map_or(self.keys(), |(_, axis)| axis.key.clone())
    }

    /// Its values, cell by cell.
    fn numbers(&self) -> Option<Vec<f64>> {
        let (place, _) = self.colour_axis()?;
        let cells = self.statistics.cells.iter();
        cells.map(|cell| cell.values.get(place)?.parse().ok()).collect()
    }

    /// The name of a cell in a legend.
    fn label(&self, cell: u64) -> String {
        if self.spec().sweep.is_empty() { "all members".into() } else { self.spec().sweep.name(cell) }
    }

    fn keys(&self) -> String {
        self.spec().sweep.axes().iter().map(|axis| axis.key.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn headline(&self) -> Vec<Headline> {
        let EnsembleStatistics { cells, comparison, scaling, .. } = self.statistics;
        let mut headline = Vec::new();
        let mut add = |label: &str, value: Option<f64>, note: String| {
            let value = value.map_or("not reached".into(), |value| significant(value, DIGITS));
            headline.push(Headline { label: label.into(), value, note });
        };
        match &cells[..] {
            [cell] => {
                let told = |interval: Option<Interval>| {
                    interval.map_or(String::new(), |of| of.told_shortly(|end| significant(end, DIGITS)))
                };
                add("median t_relax", cell.median(), told(cell.interval()));
                let mean = cell.times.mean;
                let error = mean.and_then(|mean| mean.standard_error);
                let note = match mean.and_then(|mean| mean.restricted_to) {
                    Some(_) => "a lower bound: some members had not relaxed at the end".into(),
                    None => error.map_or(String::new(), |error| format!("standard error {}", significant(error, 2))),
                };
                add("mean t_relax", mean.map(|mean| mean.value), note);
                if let Some(limits) = &cell.limits {
                    add("median t_limit", limits.median, told(limits.interval));
                }
                if let Some(discretisation) = &cell.discretisation {
                    let DiscretisationError { members, mean, error, .. } = discretisation;
                    let [mean, error] = [mean, error].map(|value| significant(100.0 * value, 2));
                    let known = count(*members as u64, "member");
                    let (value, note) = match discretisation.converges() {
                        true => (format!("{mean} %"), format!("of t_relax, ± {error} %, by {known}")),
                        false => ("not known".into(), format!("most times of {known} do not converge yet in n")),
                    };
                    headline.push(Headline { label: "discretisation".into(), value, note });
                }
                if let [Some(low), .., Some(high)] = cell.times.quantiles {
                    let range = format!("{} to {}", significant(low, 3), significant(high, 3));
                    headline.push(Headline { label: "nine in ten".into(), value: range, note: "5 to 95 %".into() });
                }
            }
            _ => {
                let of_limits = self.statistics.of_limits;
                let medians = cells.iter().filter_map(|cell| cell.judged_median(of_limits));
                let medians: Vec<f64> = medians.map(|(median, _)| median).collect();
                let range = [f64::min, f64::max].map(|of| medians.iter().copied().reduce(of));
                let shown = match range {
                    [Some(low), Some(high)] => format!("{} to {}", significant(low, 3), significant(high, 3)),
                    _ => "not reached".into(),
                };
                let note = format!("over {} cells", cells.len());
                headline.push(Headline { label: format!("median {}", self.statistics.time()), value: shown, note });
                headline.extend(scaling.as_ref().and_then(power));
                headline.extend(compared(comparison));
            }
        }
        let finer = self.tally.nodes.counted();
        headline.extend(finer.map(|(value, note)| Headline { label: "with more nodes".into(), value, note }));
        headline
    }

    fn table(&self) -> PageTable {
        let keys = self.spec().sweep.axes().iter().map(|axis| axis.key.clone());
        let rows = self.statistics.cells.iter().map(|cell| (&cell.values[..], cell));
        let caption = "Members by status, statistics of t_relax (Kaplan-Meier), and rates of decay";
        table(caption, keys, rows, names::ENSEMBLE)
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
                Some(format!("log-rank test that all groups have one distribution: {}", p_value(test.p_value)))
            }
            None => comparison.refusal().map(|why| format!("not compared: {why}")),
        });
        let tests: String = tests.map(|test| format!("; {test}")).collect();
        Some(table(&format!("By {key}{shown}{tests}"), [key].into_iter(), rows, names::GROUPS))
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
        let header = header.into_iter().chain(QUANTILES.map(|(_, name, _)| name)).chain(["discretisation %"]);
        let shown = |value: Option<f64>| value.map_or(String::new(), |value| significant(value, DIGITS));
        let row = |cell: u64, event: &Event, of: &EventStatistics| {
            let TimeStatistics { sample, mean, quantiles, .. } = &of.times;
            let least = if mean.is_some_and(|mean| mean.restricted_to.is_some()) { "≥ " } else { "" };
            let moments = [
                mean.map_or(String::new(), |mean| format!("{least}{}", significant(mean.value, DIGITS))),
                mean.and_then(|mean| mean.standard_error).map_or(String::new(), |error| significant(error, 2)),
            ];
            let counts = [sample.events(), sample.censored()].map(|count| count.to_string());
            let percent = of.discretisation.as_ref().map(|error| 100.0 * error.mean);
            let start = [cell.to_string(), event.name.clone(), event.condition.to_string()].into_iter().chain(counts);
            start.chain(moments).chain(quantiles.map(shown)).chain([shown(percent)]).collect()
        };
        let cells = self.statistics.cells.iter();
        let rows = cells
            .flat_map(|cell| spec.event.iter().zip(&cell.events).map(move |(event, of)| row(cell.cell, event, of)));
        (!spec.event.is_empty()).then(|| PageTable {
            caption: "Events: members in which they were seen, and the statistics of their times (Kaplan-Meier)".into(),
            header: header.map(String::from).collect(),
            rows: rows.collect(),
            source: names::EVENT_STATISTICS.into(),
        })
    }

    /// The differences from the first cell, if cells share their random numbers.
    fn pairs(&self) -> Option<PageTable> {
        let cells = self.statistics.comparison.paired_cells()?;
        let shown = |value: Option<f64>| value.map_or(String::new(), |value| significant(value, DIGITS));
        let row = |of: &CellDifference| {
            let [low, high] = of.interval.map_or([None, None], |(low, high)| [Some(low), Some(high)]);
            let name = self.spec().sweep.name(of.cell);
            let p = of.test.map_or(String::new(), |test| p_value(test.p_value));
            let counts = [of.pairs, of.equal].map(|count| count.to_string());
            let left_out = [of.left_out.later, of.left_out.earlier, of.left_out.unknown].map(|count| count.to_string());
            let start = [of.cell.to_string(), name].into_iter().chain(counts);
            start.chain([of.median, low, high].map(shown)).chain([p]).chain(left_out).collect()
        };
        let header = ["cell", "values", "pairs", "equal", "median", "95 % from", "to", "signed ranks"];
        let left_out = ["left out: later", "earlier", "unknown"];
        Some(PageTable {
            caption: "t_relax less that of the same member of cell 0: pairs that both relaxed (Wilcoxon's signed-rank \
                      test), and pairs left out because a member did not"
                .into(),
            header: header.into_iter().chain(left_out).map(String::from).collect(),
            rows: cells.iter().map(row).collect(),
            source: String::new(),
        })
    }

    /// The best features of each time, cell by cell, and the regression on some.
    fn explanation(&self) -> Option<PageTable> {
        let rows = &self.explained.rows;
        let shown = |value: Option<f64>| value.map_or(String::new(), |value| significant(value, 3));
        let row = |of: &ExplainedRow| {
            let feature = match (&*of.feature, of.chosen) {
                (TOGETHER, Some(chosen)) => format!("{chosen} together"),
                (feature, _) => feature.into(),
            };
            let counts = [of.members, of.censored].map(|count| count.to_string());
            let chosen = of.chosen.filter(|_| of.feature != TOGETHER).map_or(String::new(), |place| place.to_string());
            let start = [of.cell.to_string(), of.time.clone(), feature].into_iter().chain(counts);
            start.chain([shown(of.spearman), shown(of.r2), chosen]).collect()
        };
        // The rows of a cell and a time are sorted, with the regression at the end.
        let groups = rows.chunk_by(|a, b| (a.cell, &a.time) == (b.cell, &b.time));
        let best = groups.flat_map(|group| {
            let (regression, features) = group.split_last().into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
            let shown = |(place, row): &(usize, &ExplainedRow)| *place < LISTED || row.chosen.is_some();
            let features = features.into_iter().flat_map(move |rows| rows.iter().enumerate().filter(shown));
            features.map(|(_, row)| row).chain(regression)
        });
        let header = ["cell", "time", "feature", "members", "censored", "Spearman", "R²", "chosen"];
        (!rows.is_empty()).then(|| PageTable {
            caption: format!(
                "What explains the times: the {LISTED} best features of each alone (R² of a straight line), and a \
                 linear regression on the chosen ones (R² cross-validated), over the members that reached the time; nothing \
                 {}{}",
                claims(),
                self.left_out()
            ),
            header: header.map(String::from).into(),
            rows: best.map(row).collect(),
            source: names::EXPLAINED.into(),
        })
    }

    fn provenance(&self) -> Vec<(String, String)> {
        let Tally { steps, solves, sweeps_k, sweeps_x, .. } = self.tally;
        let steps = if solves == steps { format!("{steps} steps") } else { format!("{steps} steps, {solves} solves") };
        let work = match sweeps_k + sweeps_x {
            0 => steps,
            _ => format!("{steps}, {sweeps_k} sweeps for k and {sweeps_x} for x, y"),
        };
        [
            ("curvelax", self.provenance.curvelax.clone()),
            // No clock times, and nothing else that does not affect digits.
            ("ran on", place(&self.provenance.platform)),
            ("driver", self.provenance.platform.driver.clone().unwrap_or_default()),
            ("work", work),
            ("seed", self.spec().seed.to_string()),
        ]
        .into_iter()
        .filter(|(_, value)| !value.is_empty())
        .map(|(name, value)| (name.to_string(), value))
        .collect()
    }
}

const SURVIVAL_CAPTION: &str =
    "Kaplan-Meier estimate with Greenwood's 95 % band; a stroke marks a member that ended before it relaxed.";

/// The statistics of cells or groups as a table of the page, each row after the values of `keys`.
fn table<'a>(
    caption: &str,
    keys: impl Iterator<Item = String>,
    rows: impl Iterator<Item = (&'a [String], &'a CellStatistics)>,
    source: &str,
) -> PageTable {
    let statuses = Status::ALL.iter().map(|status| status.name().to_string());
    let numbers = ["mean", "standard error"].into_iter().chain(QUANTILES.map(|(_, name, _)| name));
    let numbers = numbers.chain(["median rate", "over theory", "discretisation %", "median t_limit", "t_error"]);
    let header = ["cell".to_string()].into_iter().chain(keys).chain(statuses).chain(numbers.map(String::from));
    let row = |(values, cell): (&[String], &CellStatistics)| {
        let shown = |value: Option<f64>| value.map_or(String::new(), |value| significant(value, DIGITS));
        let mean = cell.times.mean;
        let least = if mean.is_some_and(|mean| mean.restricted_to.is_some()) { "≥ " } else { "" };
        let moments = [
            mean.map_or(String::new(), |mean| format!("{least}{}", significant(mean.value, DIGITS))),
            mean.and_then(|mean| mean.standard_error).map_or(String::new(), |error| significant(error, 2)),
        ];
        let quantiles = cell.times.quantiles.map(shown);
        let counts = cell.counts.iter().map(u64::to_string);
        let start = [cell.cell.to_string()].into_iter().chain(values.iter().cloned());
        let rates = ["median", "ratio"].map(|name| shown(cell.rates.numbers.get(name)));
        let known = cell.discretisation.as_ref().filter(|error| error.converges());
        let percent = known.map(|error| 100.0 * error.mean);
        let limits = cell.limits.as_ref();
        let limits = [limits.and_then(|limits| limits.median), limits.and_then(|limits| limits.error)];
        let errors =
            [percent, limits[0], limits[1]].map(|value| value.map_or(String::new(), |v| significant(v, DIGITS)));
        start.chain(counts).chain(moments).chain(quantiles).chain(rates).chain(errors).collect()
    };
    PageTable {
        caption: caption.into(),
        header: header.collect(),
        rows: rows.map(row).collect(),
        source: source.into(),
    }
}

fn chart(name: &'static str, title: &str, caption: &str, svg: String) -> Chart {
    Chart { name, figure: PageFigure { title: title.into(), caption: caption.into(), svg } }
}

/// When nothing is said about a time.
fn claims() -> String {
    let percent = 100.0 * MOST_CENSORED;
    format!("if fewer than {LEAST_MEMBERS} members reached it, or more than {percent} % did not")
}

/// How much a feature explains, in one cell or in several.
fn explains<'a>(rows: impl Iterator<Item = &'a ExplainedRow>) -> String {
    let (r2, rho): (Vec<f64>, Vec<f64>) = rows.filter_map(|row| row.r2.zip(row.spearman)).unzip();
    let shown = |values: &[f64]| {
        let [low, high] = [f64::min, f64::max].map(|of| values.iter().copied().reduce(of).unwrap_or_default());
        let [low, high] = [low, high].map(|value| significant(value, 3));
        if low == high { low } else { format!("{low} to {high}") }
    };
    format!("R² {}, Spearman {}", shown(&r2), shown(&rho))
}

/// Times at which an event happened in members, or at which they ended without it.
fn happened(sample: &Sample, happened: bool) -> impl Iterator<Item = f64> + '_ {
    sample.observations().filter(move |seen| seen.happened == happened).map(|seen| seen.time)
}

/// The survival curve of some times, with its band.
fn survival_curve(label: String, value: Option<f64>, sample: &Sample) -> SurvivalCurve {
    let mut curve = SurvivalCurve { label, value, ..SurvivalCurve::default() };
    for step in KaplanMeier::new(sample).steps() {
        curve.add_step(step.time, step.survival, step.band());
    }
    happened(sample, false).for_each(|t| curve.add_censored(t));
    curve
}

/// The law by which, in linear theory, the excess of a curve of the members' mean area decreases, through the point
/// where the mean has fallen to a tenth. There is none where each member has a shape or a flow of its own.
fn law(spec: &Spec, cell: &CellTally, curve: &DecayCurve) -> Option<Theory> {
    if spec.shape.is_drawn() || spec.flow.is_drawn() {
        return None;
    }
    let values = spec.typical();
    let members: u64 = cell.counts.iter().sum();
    let area = cell.area / members as f64;
    let first = curve.mean.first()?;
    let tenth = curve.mean.iter().position(|mean| *mean <= 0.1 * first)?;
    let (t, mean) = (curve.t[tenth], curve.mean[tenth]);
    let rate = spec.rate_in_theory(&values, area).or_else(|| linear_rate::rate_at(spec, &values, area, t))?;
    // 24 instead of 24.0.
    let brief = |rate: f64| match rate.round() {
        whole if (rate - whole).abs() < 1e-6 * rate && rate < 1e4 => format!("{whole}"),
        _ => significant(rate, 3),
    };
    Some(match (spec.growth(&values.flow, area), &*values.flow) {
        (Some(time), _) => Theory {
            label: format!("(1 + 2t/R⁴)^−{}", brief(rate)),
            law: DecayLaw::Algebraic { start: mean * (1.0 + t / time).powf(rate), time, power: rate },
        },
        (None, flow) => {
            let fourth_power = (area / std::f64::consts::PI).powi(2);
            let label = match flow {
                Flow::SurfaceDiffusion => format!("exp(−{} t/R⁴)", brief(rate * fourth_power)),
                // The radius still changes, and the rate with it.
                _ => format!("exp(−{} t), for the radius at t = {}", brief(rate), significant(t, 2)),
            };
            Theory { label, law: DecayLaw::Exponential { start: mean * (rate * t).exp(), rate } }
        }
    })
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
    Some(Headline { label: format!("power of {}", of.scale), value: significant(law.exponent, 3), note })
}

/// Whether the cells differ, in the headline.
fn compared(comparison: &CellComparison) -> Option<Headline> {
    let of = |value: String, note: String| Some(Headline { label: "one distribution?".into(), value, note });
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
    let differ = cells.iter().filter(|cell| cell.test.is_some_and(|test| test.p_value < most)).count();
    match cells {
        [CellDifference { test: Some(test), .. }] => p_value(test.p_value),
        [_] => "not tested".into(),
        _ => format!("{differ} of {} differ", cells.len()),
    }
}

fn median(cell: &CellStatistics) -> Option<EstimatedNumber> {
    cell.median().map(|value| EstimatedNumber { value, interval: cell.interval() })
}

fn quartiles(cell: &CellStatistics) -> (Option<f64>, Option<f64>) {
    let [_, lower, _, upper, _] = cell.times.quantiles;
    (lower, upper)
}

/// The value among `values` of a key with numeric values.
fn value_of(axis: &SweepAxis, values: &[String]) -> Option<f64> {
    axis.numbers().and_then(|_| values.first()?.parse().ok())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::DVec2;

    use super::*;
    use curvelax_draw::svg::dots;
    use curvelax_ensemble::{Outcome, schedule::grid};
    use curvelax_files::samples::film;
    use curvelax_study::{
        results::tally::Tally,
        samples::{outcome, platform},
    };

    /// Names and texts of the pictures of a run of `spec` with this `tally`.
    fn pictures(spec: &Spec, mut tally: Tally, films: &[Film]) -> Vec<(&'static str, String)> {
        let provenance = &Provenance::new(spec, &platform(), &tally, &[], Duration::ZERO, Duration::from_secs(1));
        let statistics = &EnsembleStatistics::new(spec, &mut tally).unwrap();
        let excess = &tally.mean_excess(spec).unwrap();
        let explained = &Explained::default();
        FinishedRun { provenance, tally: &tally, statistics, excess, explained, films }.pictures().unwrap()
    }

    /// 10⁵ members, all different, a third of them censored at various times.
    fn many(cells: u64) -> Tally {
        let mut tally = Tally::default();
        for member in 0..100_000_u64 {
            let share = member as f64 / 1e5;
            let t = 0.3 + share.powi(3) + 0.1 * (share * 1e4).sin();
            let relaxed = member % 3 > 0;
            let status = if relaxed { Status::Relaxed } else { Status::Singular };
            let mut outcome =
                Outcome { cell: member % cells, t_end: t, ..outcome(member, status, relaxed.then_some(t)) };
            (outcome.rate, outcome.rate_theory) = (Some(20.0 + t), Some(24.0));
            (outcome.end.mesh_ratio, outcome.end.metric_drift) = (1.0 + share, 1e-3 + share * share);
            outcome.start.area = 1.0;
            tally.add(&outcome).unwrap();
            let excess = grid(1.0).map(|at| (-24.0 * t * at).exp()).collect::<Vec<_>>();
            tally.add_excess(outcome.cell, &excess);
        }
        tally
    }

    #[test]
    fn pictures_of_1e5_members_are_small() {
        let films: Vec<Film> = (0..12).map(|member| film(member, 100, Status::Relaxed, Some(0.4))).collect();
        let marks: Vec<DVec2> = (0..100_000).map(|i| DVec2::new(0.006 * f64::from(i), 1.0)).collect();
        for cells in [1, 8, 500] {
            let mut spec = Spec { curves: 100_000 / cells, ..Spec::default() };
            if cells > 1 {
                let values = (1..=cells).map(|value| value.to_string()).collect::<Vec<_>>().join(",");
                spec.sweep.set(format!("omega={values}").parse().unwrap());
            }
            let drawn = pictures(&spec, many(cells), &films);
            for (name, text) in &drawn {
                let most = if *name == names::REPORT { 800_000 } else { 120_000 };
                assert!(text.len() < most, "{name} of {cells} cells: {} bytes", text.len());
            }
            assert!(drawn.len() >= 5);
        }
        assert!(dots(&marks).len() > 800_000, "marks one by one would be seen");
    }

    /// Words that are not numbers where numbers should be.
    fn none_of(text: &str) -> Vec<&str> {
        let words = text.split(|c: char| !c.is_alphanumeric());
        // Letters of a path may come before it.
        let is_none = |word: &&str| word.contains("NaN") || ["inf", "Infinity"].contains(word);
        words.filter(is_none).collect()
    }

    #[test]
    fn few_members_and_none_are_drawn_without_a_number_that_is_none() {
        let none = Tally::default();
        let of = |members: &[Outcome]| {
            let mut tally = Tally::default();
            members.iter().for_each(|member| tally.add(member).unwrap());
            tally
        };
        let relaxed = outcome(0, Status::Relaxed, Some(0.0));
        let censored = Outcome { t_end: 0.0, ..outcome(1, Status::Singular, None) };
        let mut unknown = outcome(2, Status::Nonfinite, None);
        (unknown.end.mesh_ratio, unknown.end.metric_drift, unknown.start.area) = (f64::INFINITY, f64::NAN, f64::NAN);
        for (tally, sentence) in [
            (none, "There are no members."),
            (of(std::slice::from_ref(&relaxed)), "Nothing: every member relaxed"),
            (of(std::slice::from_ref(&censored)), "<strong>0</strong> of 1 member relaxed"),
            (of(&vec![censored.clone(); 9]), "No member relaxed, so there are no relaxation times"),
            (of(&[relaxed, censored, unknown]), "<strong>1</strong> of 3 members relaxed"),
        ] {
            for sweep in ["", "omega=1,2", "shape=circle:1;astroid"] {
                let mut spec = Spec::default();
                if !sweep.is_empty() {
                    spec.sweep.set(sweep.parse().unwrap());
                }
                for (name, text) in pictures(&spec, tally.clone(), &[]) {
                    let bad = none_of(&text);
                    assert!(bad.is_empty(), "{name}: {bad:?}");
                    assert!(name != names::REPORT || text.contains(sentence), "no {sentence:?}");
                }
            }
        }
        assert_eq!(none_of("d=\"MNaN 3\" inf -inf;information NaN"), ["MNaN", "inf", "inf", "NaN"]);
    }
}
