//! The charts of a run, from its statistics.

use super::{FinishedRun, cells::CellGroup, figure, tables::claims};
use crate::report::{
    page::{PageFigure, spread},
    words::member_name,
};
use curvelax_base::{error::Result, random::normal_quantile, text::significant};
use curvelax_draw::{
    charts::{
        CellKey, CellQuantiles, CellValues, ChartText, Crossed, Decay, DecayCurve, DecayLaw, Dependence,
        DependencePoint, EstimatedNumber, FittedRates, MemberDot, MemberTimes, MeshQuality, PowerLawLine,
        RelaxationTimes, Scatter, ScatterPanel, ScatterPoint, Series, Setting, Survival, SurvivalCurve, Theory,
        TimeDistribution,
    },
    medium::Medium,
    style::SERIES,
};
use curvelax_ensemble::{Event, Outcome, Spec, Status, outcome::linear_rate, request::sweep::SweepAxis};
use curvelax_files::names;
use curvelax_flow::{crystal::Energy, equilibrium::Equilibrium, flow::Flow};
use curvelax_statistics::{HALF_INTERVAL, Interval, Sample};
use curvelax_study::results::{
    cells::{CellStatistics, EnsembleStatistics, EventStatistics, GroupStatistics},
    explained::{Explained, ExplainedRow, FeaturedMember, TOGETHER},
    scaling::Scaling,
    tally::{CellTally, DISTRUSTED_DRIFT, shown_time},
    times::TimeStatistics,
};

/// Curves that can be told apart by colour and dashes.
const DISTINCT: usize = SERIES;
/// Conditions of events in a note.
const MAX_CONDITIONS: usize = 8;
/// Maximum quantiles of a cell that are drawn against those of a distribution.
const MAX_QUANTILES: usize = 99;
/// Maximum panels of a time against features.
const MAX_PANELS: usize = 8;
/// Rank of the colour of text among those of series.
const INK: usize = 4;

impl FinishedRun<'_> {
    /// The charts of this run, in reading order. Few members that are known by name have their times, and no
    /// statistics.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if the values of a cell do not fit the spec.
    pub fn charts(&self, medium: Medium) -> Result<Vec<PageFigure>> {
        let key = &self.cell_key(medium == Medium::Page);
        if self.spec().names_members() {
            // A mean over outlines of unlike sizes would mean nothing.
            let is_single = self.spec().members_per_cell() == 1;
            let excess = if is_single && !self.is_constant() { self.excess(medium, key)? } else { None };
            return Ok([self.members(medium)].into_iter().chain(excess).chain(self.dependence(medium)).collect());
        }
        let mut charts = vec![self.relaxation(medium, key), self.distribution(medium, key), self.survival(medium, key)];
        charts.extend(self.groups(medium));
        charts.extend(self.events(medium));
        if !self.is_constant() {
            charts.extend(self.excess(medium, key)?);
            charts.push(self.rates(medium, key));
        }
        charts.extend(self.dependence(medium));
        charts.push(self.features(medium, key));
        charts.push(self.mesh(medium));
        Ok(charts)
    }

    /// Whether the excess of all members is: area and length are kept.
    fn is_constant(&self) -> bool {
        (0..self.tally.cells.len() as u64).all(|cell| self.spec().has_vesicles_in(cell))
    }

    /// What is said of a chart: what ran, and `rest`.
    fn text(&self, medium: Medium, title: &str, rest: &str, key: &CellKey) -> ChartText {
        let (note, quantity) = (self.note(medium, rest), self.statistics.time().into());
        ChartText { title: title.into(), note, quantity, key: key.clone() }
    }

    fn relaxation(&self, medium: Medium, key: &CellKey) -> PageFigure {
        let cells = &self.statistics.cells;
        let times = cells.iter().map(|cell| CellValues {
            numbers: happened(&self.statistics.times(cell).sample, true).collect(),
            members: self.statistics.times(cell).sample.len() as u64,
        });
        let others = Status::ALL.iter().enumerate().map(|(rank, status)| {
            let without = self.tally.cells.iter().map(|cell| cell.others[rank]).sum();
            (status.name(), without)
        });
        let others: Vec<(&str, u64)> = others.filter(|(_, without)| *without > 0).collect();
        let median = if let [cell] = &cells[..] { median(self.statistics.times(cell)) } else { None };
        let (title, quantity) = ("Relaxation times", self.statistics.time());
        let text = self.text(medium, title, &self.error(), key);
        let svg = RelaxationTimes { text, cells: times.collect(), others: &others, median }.draw(medium);
        let of_cells = if self.statistics.cells.len() > 1 { " of each cell" } else { "" };
        let caption = format!(
            "Above: how many members{of_cells} relaxed at which {quantity}. Below: the share of them that had relaxed by \
             then."
        );
        figure(names::RELAXATION, title, &caption, svg)
    }

    /// The times of each cell as a box, and their quantiles against those of two laws.
    fn distribution(&self, medium: Medium, key: &CellKey) -> PageFigure {
        let cells = self.statistics.cells.iter().map(|cell| {
            let sample = &self.statistics.times(cell).sample;
            let known = sample.len().min(MAX_QUANTILES);
            let shares = || (0..known).map(|i| (i as f64 + 0.5) / known as f64);
            let quantiles = sample.quantiles(shares());
            CellQuantiles {
                places: self.statistics.times(cell).quantiles,
                quantiles: shares().map(normal_quantile).zip(quantiles).collect(),
            }
        });
        let text = self.text(medium, "Distribution of the relaxation times", &self.error(), key);
        let chart_of = TimeDistribution { text, keys: &self.keys(), cells: cells.collect() };
        let caption = "Above: the median, the middle half and the middle nine tenths of the members. Below, if known: \
                       quantiles of the times against a normal distribution, left, and of their logarithms, right.";
        figure(names::DISTRIBUTION, &chart_of.text.title, caption, chart_of.draw(medium))
    }

    fn survival(&self, medium: Medium, key: &CellKey) -> PageFigure {
        let curves = self.statistics.cells.iter().map(|cell| survival_curve(&self.statistics.times(cell).sample));
        let text = self.text(medium, "Members not yet relaxed", &self.error(), key);
        let survival = Survival { text, curves: curves.collect(), ..Survival::default() };
        survival_chart(names::SURVIVAL, &survival, medium, "", "it relaxed")
    }

    /// The members not yet relaxed, by group of their outlines.
    fn groups(&self, medium: Medium) -> Option<PageFigure> {
        let (key, all) = (self.spec().group_by.as_deref()?, &self.statistics.groups);
        let mut groups: Vec<&GroupStatistics> = all.iter().collect();
        if groups.len() > DISTINCT {
            let median = |of: &GroupStatistics| self.statistics.times(&of.times).median().unwrap_or(f64::INFINITY);
            groups.sort_by(|one, other| median(one).total_cmp(&median(other)));
            groups = spread(groups.len(), DISTINCT).map(|i| groups[i]).collect();
        }
        if groups.is_empty() {
            return None;
        }
        let some = match groups.len() < all.len() {
            true => format!("{} of {} groups, spread over the order of their medians", groups.len(), all.len()),
            false => String::new(),
        };
        let curves = groups.iter().map(|group| survival_curve(&self.statistics.times(&group.times).sample)).collect();
        let labels = groups.iter().map(|of| self.label_in(&of.group, of.times.cell)).collect();
        let title = format!("Members not yet relaxed, by {key}");
        let key = CellKey { labels, ..CellKey::from(key) };
        let text = self.text(medium, &title, &joined([self.error(), some]), &key);
        let survival = Survival { text, curves, ..Survival::default() };
        Some(survival_chart(names::GROUP_SURVIVAL, &survival, medium, "", "it relaxed"))
    }

    /// The name of a group or an event of a cell in a legend.
    fn label_in(&self, name: &str, cell: u64) -> String {
        if self.keys().is_empty() { name.into() } else { format!("{name}, {}", self.label(cell)) }
    }

    /// A survival curve for each event of each cell, if there are events.
    fn events(&self, medium: Medium) -> Option<PageFigure> {
        let spec = self.spec();
        if spec.event.is_empty() {
            return None;
        }
        let events = self.statistics.cells.iter().flat_map(|cell| {
            let events = spec.event.iter().zip(&cell.events).filter(|(_, of)| of.stopped == 0);
            events.map(|(event, of)| (self.label_in(&event.name, cell.cell), of))
        });
        let all = events.clone().count();
        let curve = |(label, of): (String, &EventStatistics)| (label, survival_curve(&of.judged().sample));
        let (labels, curves) = events.take(DISTINCT).map(curve).unzip();
        let some = if all > DISTINCT { format!("the first {DISTINCT} of {all} curves") } else { String::new() };
        let shown = spec.event.iter().take(MAX_CONDITIONS).map(Event::to_string);
        let mut conditions = shown.collect::<Vec<_>>().join("; ");
        if spec.event.len() > MAX_CONDITIONS {
            conditions += &format!("; {} more", spec.event.len() - MAX_CONDITIONS);
        }
        let key = CellKey { labels, ..CellKey::from("event") };
        let quantity = if self.statistics.of_limits { "t, in the limit" } else { "t" };
        let text = self.text(medium, "Events", &joined([conditions, some]), &key);
        let text = ChartText { quantity: quantity.into(), ..text };
        let none = match self.tally.members() {
            0 => "There are no members, so there are no events.",
            _ => "No event has statistics, as members were stopped before it when they relaxed.",
        };
        let survival = Survival { text, share: "share without the event", none, curves };
        let share = "Share of the members in which an event has not happened yet. ";
        Some(survival_chart(names::EVENT_SURVIVAL, &survival, medium, share, "that"))
    }

    /// The mean excess, for as long as all members of a cell are running.
    fn excess(&self, medium: Medium, key: &CellKey) -> Result<Option<PageFigure>> {
        let curve = |(rank, cell): (usize, &CellTally)| {
            let all: u64 = cell.counts.iter().sum();
            // Rows are sorted by cell.
            let first = self.excess.partition_point(|row| row.cell < rank as u64);
            let rows = self.excess[first..].iter().take_while(|row| row.cell == rank as u64 && row.members == all);
            let rows = rows.map_while(|row| Some((row.t, row.mean?, [row.q05?, row.q95?])));
            let rows: Vec<(f64, f64, [f64; 2])> = rows.collect();
            let bound = |i: usize| rows.iter().map(|(.., bounds)| bounds[i]).collect();
            DecayCurve {
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
        let slope = if theory.is_some() { ", and the slope that linear theory gives" } else { "" };
        let theory = theory.into_iter().collect();
        let each = self.spec().members_per_cell() == 1;
        let (title, over) = match each {
            true => ("Excess", "while the member runs"),
            false => ("Mean excess", "over all members, while all of them run"),
        };
        let (text, band) = (self.text(medium, title, over, key), "5 to 95 % of the members");
        let decay = Decay { text, band, curves, theory };
        let excess = match self.spec().sweep.has("energy") {
            true => Equilibrium::Wulff(Energy::default()),
            false => self.spec().typical().flow.equilibrium(),
        };
        let excess = excess.excess_in_words();
        let of_band = if decay.has_bands() { format!(" Band: {band}.") } else { String::new() };
        let caption = format!("How the excess, {excess}, falls{slope}.{of_band}");
        Ok(Some(figure(names::EXCESS, title, &caption, decay.draw(medium))))
    }

    fn rates(&self, medium: Medium, key: &CellKey) -> PageFigure {
        let EnsembleStatistics { cells, relative, .. } = self.statistics;
        let rates =
            cells.iter().map(|cell| CellValues { numbers: cell.rates.drawn.sorted().into(), members: cell.members() });
        let cells: Vec<CellValues> = rates.collect();
        let without = self.tally.members() - cells.iter().map(|cell| cell.numbers.len() as u64).sum::<u64>();
        let (title, relative, unit) = ("Rates of decay", *relative, "length⁻⁴");
        let text = self.text(medium, title, "", key);
        let svg = FittedRates { text, cells, relative, unit, without }.draw(medium);
        let over = if relative { ", over the rate that linear theory gives the slowest mode" } else { "" };
        let caption = format!(
            "Slope of the line through ln excess, while that falls from a tenth to a thousandth of its start{over}."
        );
        figure(names::RATE, title, &caption, svg)
    }

    /// The time against one swept key, with a series for each combination of the others: against the one that colours
    /// show, or that changes fastest.
    fn dependence(&self, medium: Medium) -> Option<PageFigure> {
        let axes = self.spec().sweep.axes();
        let across = self.two_axes().map_or(axes.len().checked_sub(1)?, |[colour, _]| colour);
        let axis = &axes[across];
        let keys: Vec<(usize, &SweepAxis)> = axes.iter().enumerate().filter(|(i, _)| *i != across).collect();
        let label = |cell: &CellStatistics| {
            let distinct = keys.iter().filter(|(_, key)| key.values.len() > 1);
            distinct.map(|(i, key)| format!("{} = {}", key.key, cell.values[*i])).collect::<Vec<_>>().join(", ")
        };
        let mut groups: Vec<(String, Vec<&CellStatistics>)> = Vec::new();
        for cell in &self.statistics.cells {
            let own = label(cell);
            match groups.iter_mut().find(|(label, _)| *label == own) {
                Some((_, cells)) => cells.push(cell),
                None => groups.push((own, vec![cell])),
            }
        }
        let has_numbers = axis.numbers().is_some();
        let level = |cell: &&CellStatistics| DependencePoint {
            at: match cell.values[across].parse() {
                Ok(number) if has_numbers => Setting::Number(number),
                _ => Setting::Name(cell.values[across].clone()),
            },
            median: median(self.statistics.times(cell)),
            quartiles: quartiles(self.statistics.times(cell)),
        };
        let labels: Vec<String> = groups.iter().map(|(label, _)| label.clone()).collect();
        let values = match keys[..] {
            [(i, key)] if key.numbers().is_some() => {
                groups.iter().map(|(_, cells)| cells[0].values[i].parse().ok()).collect()
            }
            _ => None,
        };
        let series = groups.iter().map(|(_, cells)| {
            let mut levels: Vec<DependencePoint> = cells.iter().map(level).collect();
            if has_numbers {
                let place = |level: &DependencePoint| if let Setting::Number(x) = level.at { x } else { 0.0 };
                levels.sort_by(|a, b| place(a).total_cmp(&place(b)));
            }
            Series { levels, fit: self.power_law() }
        });
        let series: Vec<Series> = series.collect();
        let title = format!("Relaxation time against {}", axis.key);
        let name = keys.iter().map(|(_, key)| key.key.as_str()).collect::<Vec<_>>().join(", ");
        // Colours are those of the key across: the series have dashes and markers.
        let crossed = self.two_axes().map(|_| Crossed {
            colours: Vec::new(),
            patterns: labels.clone(),
            places: (0..series.len()).map(|i| (INK, i)).collect(),
        });
        let others = CellKey { name, crossed, labels, values, ..CellKey::default() };
        let left_out = self.statistics.scaling.as_ref().map(Scaling::in_words).filter(|told| !told.is_empty());
        let left_out = left_out.map_or(String::new(), |told| format!("not in the fit: {told}"));
        let text = self.text(medium, &title, &joined([self.error(), left_out]), &others);
        let chart_of = Dependence { text, key: &axis.key, series };
        let quantity = self.statistics.time();
        let each = self.spec().members_per_cell() == 1;
        let caption = match each {
            true => format!("{quantity} of each member."),
            false => {
                "Median with its interval (thick), which covers 95 % or is the range of fewer than 6 members, and the \
                      middle half of the members (thin)."
                    .into()
            }
        };
        Some(figure(names::DEPENDENCE, &title, &caption, chart_of.draw(medium)))
    }

    /// The line of the power law of the medians, if one was fitted.
    fn power_law(&self) -> Option<PowerLawLine> {
        let scaling = self.statistics.scaling.as_ref()?;
        let law = scaling.law?;
        let around =
            |error: f64| Interval::between(law.exponent - HALF_INTERVAL * error, law.exponent + HALF_INTERVAL * error);
        let exponent = EstimatedNumber { value: law.exponent, interval: law.exponent_error.map(around) };
        Some(PowerLawLine { exponent, factor: law.factor, rejected: scaling.is_rejected() })
    }

    /// The time against the features that explain it best. Flows and shapes have a panel each; cells that differ in a
    /// number have a colour each, and no R² over all of them.
    fn features(&self, medium: Medium, key: &CellKey) -> PageFigure {
        let Explained { rows, features, pictured, drawn, times } = self.explained;
        let quantity = times.first().map_or("t_relax", String::as_str);
        let (groups, count) = (self.panel_groups(), self.panel_groups().len());
        let panel = |i: usize, group: &CellGroup| {
            let own = |member: &&FeaturedMember| group.cells.contains(&(member.cell as usize));
            let known = drawn.iter().filter(own).filter(|member| member.numbers[i].is_finite());
            let known = known.filter(|member| first_time(member).unwrap_or(member.later_than).is_finite());
            let point = |member: &FeaturedMember| {
                let t = first_time(member);
                ScatterPoint {
                    cell: member.cell as usize,
                    member: member.member,
                    x: member.numbers[i],
                    t: t.unwrap_or(member.later_than),
                    happened: t.is_some(),
                }
            };
            let of_cell = |cell: usize| {
                rows.iter().find(|row| row.cell == cell as u64 && row.time == quantity && row.feature == features[i])
            };
            let heading = match group.cells[..] {
                [cell] if !group.name.is_empty() => {
                    let r2 = of_cell(cell).map_or(String::new(), |row| format!(", {}", r2(row)));
                    self.short_label(cell as u64) + &r2
                }
                [cell] => of_cell(cell).map_or(String::new(), explains),
                _ => group.name.clone(),
            };
            ScatterPanel { feature: features[i].clone(), heading, points: known.map(point).collect() }
        };
        let shown = (MAX_PANELS / count.max(1)).clamp(1, pictured.len().max(1));
        let pairs =
            pictured.iter().take(shown).flat_map(|i| groups.iter().take(MAX_PANELS).map(move |group| (*i, group)));
        let panels: Vec<ScatterPanel> = pairs.map(|(i, group)| panel(i, group)).collect();
        let title = "What explains the relaxation time";
        let members = self.tally.members();
        let some = match drawn.len() as u64 {
            drawn if drawn < members => format!("{drawn} of {members} members are drawn, spread over all."),
            _ => String::new(),
        };
        let left_out = match count.saturating_sub(MAX_PANELS) {
            0 => String::new(),
            _ => format!("The first {MAX_PANELS} of {count} values of {} are drawn.", self.keys()),
        };
        let reason = match rows.is_empty() {
            true => "The members of a cell do not differ in any feature.".into(),
            false => format!("Nothing is said about a time {}.", claims()),
        };
        let is_told = |row: &&ExplainedRow| row.time == quantity && row.feature == TOGETHER;
        let told: Vec<bool> = rows.iter().filter(is_told).map(|row| row.r2.is_some()).collect();
        let silent = match told.iter().filter(|told| !**told).count() {
            0 => String::new(),
            // Only panels of one cell show one.
            _ if groups.iter().all(|group| group.cells.len() > 1) => String::new(),
            silent => format!("{silent} of {} cells have no R²: too few members relaxed.", told.len()),
        };
        let text = ChartText { quantity: quantity.into(), ..self.text(medium, title, "", key) };
        let (notes, cells) = (vec![some, left_out, silent], self.statistics.cells.len());
        let svg = Scatter { text, notes, cells, panels, reason: &reason }.draw(medium);
        let caption =
            format!("{quantity} against the features in members.csv that explain most of it by a straight line.");
        figure(names::FEATURES, title, &caption, svg)
    }

    /// The times of members that are known by name.
    fn members(&self, medium: Medium) -> PageFigure {
        let dot = |member: &Outcome| {
            let time = shown_time(member);
            let (t, error) = time.or(self.tally.later_than(member).map(|t| (t, None)))?;
            let name = member_name(self.spec(), member);
            Some(MemberDot { name, t, error, happened: time.is_some() })
        };
        let members: Vec<MemberDot> = self.tally.named.iter().filter_map(dot).collect();
        let has = |of: &dyn Fn(&MemberDot) -> bool| members.iter().any(of);
        let bar =
            if has(&|member| member.error.is_some()) { " Bar: its 95 % interval, which the dot may hide." } else { "" };
        let open = if has(&|member| !member.happened) { " Hollow: the member ended before." } else { "" };
        let (title, quantity) = ("Relaxation times", self.statistics.time());
        let caption = format!("Dot: {quantity} of a member.{bar}{open}");
        let text = self.text(medium, title, "", &CellKey::default());
        let svg = MemberTimes { text, members }.draw(medium);
        figure(names::MEMBER_TIMES, title, &caption, svg)
    }

    fn mesh(&self, medium: Medium) -> PageFigure {
        let text = self.text(medium, "Mesh quality at the end", "", &CellKey::default());
        let quality = MeshQuality {
            text,
            mesh_ratio: &self.tally.mesh_ratios,
            metric_drift: &self.tally.metric_drifts,
            distrusted: (DISTRUSTED_DRIFT, self.tally.distrusted() as usize),
        };
        let caption = "Longest over shortest edge, and how far the scheme's lengths have left the polygon's.";
        figure(names::MESH, &quality.text.title, caption, quality.draw(medium))
    }
}

/// The parts that are not empty, as one sentence.
fn joined(parts: [String; 2]) -> String {
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
}

/// Survival curves. The caption says, after `share`, what a curve is, as far as it is drawn; a stroke is a member that
/// ended before `what`.
fn survival_chart(name: &'static str, drawn: &Survival, medium: Medium, share: &str, what: &str) -> PageFigure {
    let band = if drawn.has_bands() { " with Greenwood's 95 % band" } else { "" };
    let stroke = match drawn.has_strokes() {
        true => format!("; a stroke marks a member that ended before {what}"),
        false => String::new(),
    };
    let caption = format!("{share}Kaplan-Meier estimate{band}{stroke}.");
    figure(name, &drawn.text.title, &caption, drawn.draw(medium))
}

/// How much a feature explains in a cell.
fn explains(row: &ExplainedRow) -> String {
    format!("{}, Spearman {}", r2(row), row.spearman.map_or("not known".into(), |value| significant(value, 3)))
}

fn r2(row: &ExplainedRow) -> String {
    format!("R² {}", row.r2.map_or("not known".into(), |value| significant(value, 3)))
}

/// Times at which an event happened in members, or at which they ended without it.
fn happened(sample: &Sample, happened: bool) -> impl Iterator<Item = f64> + '_ {
    sample.observations().filter(move |seen| seen.happened == happened).map(|seen| seen.time)
}

/// The time of a member that is explained first, if it reached it.
fn first_time(member: &FeaturedMember) -> Option<f64> {
    member.times.first().copied().flatten()
}

/// The survival curve of some times, with its band.
fn survival_curve(sample: &Sample) -> SurvivalCurve {
    let mut curve = SurvivalCurve::default();
    for step in sample.steps() {
        curve.add_step(step.time, step.survival, step.band());
    }
    happened(sample, false).for_each(|t| curve.add_censored(t));
    curve
}

/// The law by which, in linear theory, the excess of a curve of the members' mean area decreases, through the point
/// where the mean has fallen to a tenth. There is none where each member has a shape or a flow of its own.
fn law(spec: &Spec, cell: &CellTally, curve: &DecayCurve) -> Option<Theory> {
    if spec.shape.is_drawn() || spec.has_drawn_flow() {
        return None;
    }
    let values = spec.typical();
    let members: u64 = cell.counts.iter().sum();
    let area = cell.area / members as f64;
    let first = curve.mean.first()?;
    let tenth = curve.mean.iter().position(|mean| *mean <= 0.1 * first)?;
    let (t, mean) = (curve.t[tenth], curve.mean[tenth]);
    let rate = linear_rate::rate_at(spec, area, t)?;
    // 24 instead of 24.0.
    let brief = |rate: f64| match rate.round() {
        whole if (rate - whole).abs() < 1e-6 * rate && rate < 1e4 => format!("{whole}"),
        _ => significant(rate, 3),
    };
    Some(match (spec.growth(&values.flow, &values.forcing, area), &*values.flow) {
        (Some(time), _) => Theory {
            label: format!("(1 + 2t/R⁴)^−{}", brief(rate)),
            law: DecayLaw::Algebraic { start: mean * (1.0 + t / time).powf(rate), time, power: rate },
        },
        (None, flow) => {
            let fourth_power = (area / std::f64::consts::PI).powi(2);
            let label = match flow {
                Flow::SurfaceDiffusion | Flow::Crystal(_) => format!("exp(−{} t/R⁴)", brief(rate * fourth_power)),
                // The radius still changes, and the rate with it.
                _ => format!("exp(−{} t), for the radius at t = {}", brief(rate), significant(t, 2)),
            };
            Theory { label, law: DecayLaw::Exponential { start: mean * (rate * t).exp(), rate } }
        }
    })
}

fn median(of: &TimeStatistics) -> Option<EstimatedNumber> {
    of.median().map(|value| EstimatedNumber { value, interval: of.interval() })
}

fn quartiles(of: &TimeStatistics) -> (Option<f64>, Option<f64>) {
    let [_, lower, _, upper, _] = of.quantiles;
    (lower, upper)
}
