//! What people look at: the charts of a run and its page, from its statistics.

use std::time::{Duration, SystemTime};

use glam::DVec2;

use super::{
    charts::{
        Decay, DecayCurve, Dependence, Estimate, FittedRates, Law, Level, MeshQuality, PowerLaw, RelaxationTimes,
        Series, Setting, Survival, SurvivalCurve, Theory,
    },
    ensemble::{CellStatistics, EnsembleStatistics, QUANTILES},
    folder,
    overview::{describe, machine},
    page::{Figure, Headline, Page, Table, Trajectory},
    progress::duration,
    provenance::rfc3339,
    tally::{CellTally, DISTRUSTED_DRIFT, Tally},
    text::{count, significant},
};
use crate::{
    backend::Platform,
    ensemble::{Outcome, Spec, Status},
    error::Result,
    flow::Flow,
    schedule::grid,
};

/// Half the width of a 95 % band in standard errors.
const BAND: f64 = 1.96;
/// Digits of a number that is to be read.
const DIGITS: usize = 4;

/// A finished run.
pub struct Study<'a> {
    /// What was asked for.
    pub spec: &'a Spec,
    /// Where it was computed.
    pub platform: &'a Platform,
    /// What came out.
    pub tally: &'a Tally,
    /// Statistics of the relaxation times.
    pub statistics: &'a EnsembleStatistics,
    /// What the user should know, a sentence each.
    pub warnings: &'a [String],
    /// When it began.
    pub started: SystemTime,
    /// How long it took.
    pub wall: Duration,
}

/// A picture with its place in the folder of the run.
pub struct Chart {
    /// The file.
    pub name: &'static str,
    /// The picture, with its words.
    pub figure: Figure,
}

/// A member on its way, for the page.
pub fn trajectory(outcome: &Outcome, before: &[DVec2], frames: Vec<(f64, Vec<DVec2>)>, after: &[DVec2]) -> Trajectory {
    let frames = frames.into_iter().filter(|(t, _)| *t > 0.0 && *t < outcome.t_end);
    let start = (0.0, before.to_vec());
    let (times, nodes) = [start].into_iter().chain(frames).chain([(outcome.t_end, after.to_vec())]).unzip();
    let at = outcome.t_relax.map_or(String::new(), |t| format!(" at t = {}", significant(t, 3)));
    Trajectory { label: format!("member {}: {}{at}", outcome.member, outcome.status.name()), times, nodes }
}

impl Study<'_> {
    /// The charts that this run has, in the order in which they are read.
    ///
    /// # Errors
    /// [`Error::Request`](crate::Error::Request) where a cell's values do not fit the spec.
    pub fn charts(&self) -> Result<Vec<Chart>> {
        let mut charts = vec![self.relaxation(), self.survival()];
        charts.extend(self.excess()?);
        charts.push(self.rates());
        charts.extend(self.dependence());
        charts.push(self.mesh());
        Ok(charts)
    }

    fn relaxation(&self) -> Chart {
        let cells = &self.statistics.cells;
        let times: Vec<f64> = cells.iter().flat_map(|cell| happened(cell, true)).collect();
        let others = Status::ALL.iter().enumerate().map(|(rank, status)| {
            let without = self.tally.cells.iter().map(|cell| cell.others[rank]).sum();
            (status.name(), without)
        });
        let others: Vec<(&str, u64)> = others.filter(|(_, without)| *without > 0).collect();
        let median = if let [cell] = &cells[..] { median(cell) } else { None };
        let title = "Relaxation times";
        let svg = RelaxationTimes { title, note: &self.what(), times: &times, others: &others, median }.draw();
        let caption = "How many members relaxed when, and which share of all had relaxed by then.";
        chart(folder::RELAXATION, title, caption, svg)
    }

    fn survival(&self) -> Chart {
        let cells = &self.statistics.cells;
        let numbers = self.numbers();
        let curves = cells.iter().enumerate().map(|(rank, cell)| {
            let steps = cell.survival.steps();
            let bound = |sign: f64| {
                let of_step =
                    |s: &crate::statistics::Step| (s.survival + sign * BAND * s.variance.sqrt()).clamp(0.0, 1.0);
                steps.iter().map(of_step).collect()
            };
            SurvivalCurve {
                label: self.label(cell.cell),
                value: numbers.as_ref().map(|numbers| numbers[rank]),
                t: steps.iter().map(|step| step.time).collect(),
                survival: steps.iter().map(|step| step.survival).collect(),
                band: Some((bound(-1.0), bound(1.0))),
                censored: happened(cell, false).collect(),
            }
        });
        let (title, key) = ("Members not yet relaxed", self.keys());
        let survival = Survival { title, note: &self.what(), key: &key, curves: curves.collect(), time: None };
        let caption =
            "Kaplan-Meier estimate with Greenwood's 95 % band; a stroke marks a member that ended before it relaxed.";
        chart(folder::SURVIVAL, title, caption, survival.draw())
    }

    /// The mean excess as long as all members of a cell run.
    fn excess(&self) -> Result<Option<Chart>> {
        let numbers = self.numbers();
        let mut curves = Vec::new();
        let mut theory = Vec::new();
        for (rank, cell) in self.tally.cells.iter().enumerate() {
            let spec = self.spec.sweep.apply(self.spec, rank as u64)?;
            let all: u64 = cell.counts.iter().sum();
            let rows = grid(spec.t_end).zip(&cell.excess).take_while(|(_, moments)| moments.count() == all);
            let rows: Vec<(f64, f64, f64)> =
                rows.map_while(|(t, m)| Some((t, m.mean()?, m.deviation().unwrap_or(0.0)))).collect();
            let bound = |sign: f64| rows.iter().map(|(_, mean, deviation)| mean + sign * deviation).collect();
            let curve = DecayCurve {
                label: self.label(rank as u64),
                value: numbers.as_ref().map(|numbers| numbers[rank]),
                t: rows.iter().map(|(t, ..)| *t).collect(),
                mean: rows.iter().map(|(_, mean, _)| *mean).collect(),
                band: Some((bound(-1.0), bound(1.0))),
            };
            theory.extend(law(&spec, cell, &curve));
            curves.push(curve);
        }
        if curves.iter().all(|curve| curve.t.len() < 2) {
            return Ok(None);
        }
        // One line of theory is a help, many are not.
        let theory = if let [_] = &curves[..] { theory } else { Vec::new() };
        let (title, key) = ("Mean excess", self.keys());
        let note = format!("{}; over all members, as long as all of them run", self.what());
        let band = "one standard deviation of the members";
        let svg = Decay { title, note: &note, band, key: &key, curves, theory, time: None }.draw();
        let caption =
            "How the excess, L²/(4πA) above that of a regular polygon, falls, and the slope that linear theory gives.";
        Ok(Some(chart(folder::EXCESS, title, caption, svg)))
    }

    fn rates(&self) -> Chart {
        let rates = || self.tally.cells.iter().flat_map(|cell| &cell.rates);
        let relative = rates().all(|(_, theory)| theory.is_some());
        let shown =
            |(rate, theory): &(f64, Option<f64>)| theory.filter(|_| relative).map_or(*rate, |theory| rate / theory);
        let shown: Vec<f64> = rates().map(shown).collect();
        let title = "Rates of decay";
        let without = self.tally.members() - shown.len() as u64;
        let unit = "length⁻⁴";
        let svg = FittedRates { title, note: &self.what(), rates: &shown, relative, unit, without }.draw();
        let caption = "Slope of the line through ln excess, while that falls from a tenth to a thousandth of its start, over the \
                       rate that linear theory gives the slowest mode.";
        chart(folder::RATE, title, caption, svg)
    }

    /// t_relax against the key that changes fastest, a series for each combination of the others.
    fn dependence(&self) -> Option<Chart> {
        let (axis, others) = self.spec.sweep.axes().split_last()?;
        let numbers = axis.numbers();
        let cells = &self.statistics.cells;
        let series = cells.chunks(axis.values.len().max(1)).map(|cells| {
            let values = &cells[0].values[..others.len()];
            let named = others.iter().zip(values).map(|(other, value)| format!("{} = {value}", other.key));
            let level = |(rank, cell): (usize, &CellStatistics)| Level {
                at: match &numbers {
                    Some(numbers) => Setting::Number(numbers[rank]),
                    None => Setting::Name(cell.values[others.len()].clone()),
                },
                median: median(cell),
                quartiles: (cell.survival.quantile(0.25), cell.survival.quantile(0.75)),
            };
            let mut levels: Vec<Level> = cells.iter().enumerate().map(level).collect();
            if numbers.is_some() {
                let place = |level: &Level| if let Setting::Number(x) = level.at { x } else { 0.0 };
                levels.sort_by(|a, b| place(a).total_cmp(&place(b)));
            }
            let fit = self.statistics.power_law.as_ref().filter(|_| others.is_empty()).map(|law| {
                let around = |error: f64| (law.exponent - BAND * error, law.exponent + BAND * error);
                let exponent = Estimate { value: law.exponent, interval: law.exponent_error.map(around) };
                PowerLaw { exponent, factor: law.factor }
            });
            let label = named.collect::<Vec<_>>().join(", ");
            let value = if let [other] = others { value_of(other, values) } else { None };
            Series { label, value, levels, fit }
        });
        let title = format!("Relaxation time against {}", axis.key);
        let other_key = others.iter().map(|other| other.key.as_str()).collect::<Vec<_>>().join(", ");
        let (note, series) = (self.what(), series.collect());
        let (key, across, time) = (&axis.key[..], None, None);
        let svg = Dependence { title: &title, note: &note, key, other_key: &other_key, series, across, time }.draw();
        let caption = "Median with its 95 % bootstrap interval (thick) and the middle half of the members (thin).";
        Some(chart(folder::DEPENDENCE, &title, caption, svg))
    }

    fn mesh(&self) -> Chart {
        let mesh = || self.tally.cells.iter().flat_map(|cell| cell.mesh.iter());
        let mesh_ratio: Vec<f64> = mesh().map(|[ratio, _]| *ratio).collect();
        let metric_drift: Vec<f64> = mesh().map(|[_, drift]| *drift).collect();
        let title = "Mesh quality at the end";
        let quality = MeshQuality {
            title,
            note: &self.what(),
            mesh_ratio: &mesh_ratio,
            metric_drift: &metric_drift,
            distrusted: Some(DISTRUSTED_DRIFT),
        };
        let caption = "Longest over shortest edge, and how far the scheme's lengths have left the polygon's.";
        chart(folder::MESH, title, caption, quality.draw())
    }

    /// The text of `report.html`; `gallery` is the picture of the first members.
    pub fn page(&self, charts: &[Chart], gallery: Option<&str>, members: &[Trajectory]) -> Result<String> {
        let spec = self.spec.to_toml()?;
        let first = gallery.map(|svg| {
            let title = "The first members before and after";
            chart(folder::CURVES, title, "Grey: the start. Colour: the last state, by status.", svg.into()).figure
        });
        let page = Page {
            title: "curvelax run",
            what: &format!("{}, {}.", count(self.tally.members(), "member"), self.what()),
            statuses: self.tally.counts().map(|(status, count)| (status.name(), count)).collect(),
            headline: self.headline(),
            warnings: self.warnings,
            members: members.to_vec(),
            plots: charts.iter().map(|chart| chart.figure.clone()).chain(first).collect(),
            tables: vec![self.table()],
            spec: &spec,
            provenance: self.provenance(),
        };
        Ok(page.html())
    }

    fn what(&self) -> String {
        let swept = self.spec.sweep.axes().iter().map(|axis| format!("{} = {}", axis.key, axis.labels().join(", ")));
        [describe(self.spec)].into_iter().chain(swept).collect::<Vec<_>>().join("; ")
    }

    /// The values of the only swept key, cell by cell, if they are numbers.
    fn numbers(&self) -> Option<Vec<f64>> {
        if let [axis] = self.spec.sweep.axes() { axis.numbers() } else { None }
    }

    /// What a cell is called in a legend.
    fn label(&self, cell: u64) -> String {
        if self.spec.sweep.is_empty() { "all members".into() } else { self.spec.sweep.name(cell) }
    }

    fn keys(&self) -> String {
        self.spec.sweep.axes().iter().map(|axis| axis.key.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn headline(&self) -> Vec<Headline> {
        let EnsembleStatistics { cells, log_rank, power_law } = self.statistics;
        let mut headline = Vec::new();
        let mut add = |label: &str, value: Option<f64>, note: String| {
            let value = value.map_or("not reached".into(), |value| significant(value, DIGITS));
            headline.push(Headline { label: label.into(), value, note });
        };
        match &cells[..] {
            [cell] => {
                let bounds =
                    |(low, high)| format!("95 %: {} to {}", significant(low, DIGITS), significant(high, DIGITS));
                add("median t_relax", cell.survival.median(), cell.bounds().map_or(String::new(), bounds));
                let mean = cell.mean;
                let error = mean.and_then(|mean| mean.standard_error);
                let note = match mean.and_then(|mean| mean.restricted_to) {
                    Some(_) => "a lower bound: some members had not relaxed at the end".into(),
                    None => error.map_or(String::new(), |error| format!("standard error {}", significant(error, 2))),
                };
                add("mean t_relax", mean.map(|mean| mean.value), note);
                let quartiles = [0.05, 0.95].map(|share| cell.survival.quantile(share));
                if let [Some(low), Some(high)] = quartiles {
                    let range = format!("{} to {}", significant(low, 3), significant(high, 3));
                    headline.push(Headline { label: "nine in ten".into(), value: range, note: "5 to 95 %".into() });
                }
            }
            _ => {
                let medians: Vec<f64> = cells.iter().filter_map(|cell| cell.survival.median()).collect();
                let range = [f64::min, f64::max].map(|of| medians.iter().copied().reduce(of));
                let shown = match range {
                    [Some(low), Some(high)] => format!("{} to {}", significant(low, 3), significant(high, 3)),
                    _ => "not reached".into(),
                };
                let note = format!("over {} cells", cells.len());
                headline.push(Headline { label: "median t_relax".into(), value: shown, note });
                if let Some(law) = power_law {
                    let error =
                        law.exponent_error.map_or(String::new(), |e| format!("standard error {}", significant(e, 2)));
                    let label = format!("power of {}", self.keys());
                    headline.push(Headline { label, value: significant(law.exponent, 3), note: error });
                }
                if let Some(test) = log_rank {
                    let label = "one distribution?".to_string();
                    let value = format!("p = {}", significant(test.p_value, 2));
                    headline.push(Headline { label, value, note: "log-rank test over all cells".into() });
                }
            }
        }
        headline
    }

    fn table(&self) -> Table {
        let keys = self.spec.sweep.axes().iter().map(|axis| axis.key.clone());
        let statuses = Status::ALL.iter().map(|status| status.name().to_string());
        let numbers = ["mean", "standard error"].into_iter().chain(QUANTILES.map(|(_, name)| name));
        let header = ["cell".to_string()].into_iter().chain(keys).chain(statuses).chain(numbers.map(String::from));
        let row = |cell: &CellStatistics| {
            let shown = |value: Option<f64>| value.map_or(String::new(), |value| significant(value, DIGITS));
            let mean = cell.mean;
            let least = if mean.is_some_and(|mean| mean.restricted_to.is_some()) { "≥ " } else { "" };
            let moments = [
                mean.map_or(String::new(), |mean| format!("{least}{}", significant(mean.value, DIGITS))),
                mean.and_then(|mean| mean.standard_error).map_or(String::new(), |error| significant(error, 2)),
            ];
            let quantiles = QUANTILES.map(|(share, _)| shown(cell.survival.quantile(share)));
            let counts = cell.counts.iter().map(u64::to_string);
            let start = [cell.cell.to_string()].into_iter().chain(cell.values.iter().cloned());
            start.chain(counts).chain(moments).chain(quantiles).collect()
        };
        Table {
            caption: "Members by status, and statistics of t_relax (Kaplan-Meier)".into(),
            header: header.collect(),
            rows: self.statistics.cells.iter().map(row).collect(),
            source: folder::ENSEMBLE.into(),
        }
    }

    fn provenance(&self) -> Vec<(String, String)> {
        let Tally { steps, sweeps_k, sweeps_x, .. } = self.tally;
        let work = match sweeps_k + sweeps_x {
            0 => format!("{steps} steps"),
            _ => format!("{steps} steps, {sweeps_k} sweeps for k and {sweeps_x} for x, y"),
        };
        [
            ("curvelax", env!("CARGO_PKG_VERSION").to_string()),
            ("started", rfc3339(self.started)),
            ("wall time", duration(self.wall.as_secs_f64())),
            ("ran on", machine(self.platform)),
            ("driver", self.platform.driver.clone().unwrap_or_default()),
            ("work", work),
            ("seed", self.spec.seed.to_string()),
        ]
        .into_iter()
        .filter(|(_, value)| !value.is_empty())
        .map(|(name, value)| (name.to_string(), value))
        .collect()
    }
}

fn chart(name: &'static str, title: &str, caption: &str, svg: String) -> Chart {
    Chart { name, figure: Figure { title: title.into(), caption: caption.into(), svg } }
}

/// Times of the members of a cell that relaxed, or of those that ended before.
fn happened(cell: &CellStatistics, happened: bool) -> impl Iterator<Item = f64> + '_ {
    cell.sample.observations().iter().filter(move |seen| seen.happened == happened).map(|seen| seen.time)
}

/// What linear theory says of the excess of a curve of the members' mean area, through the mean where it has fallen to a
/// tenth.
fn law(spec: &Spec, cell: &CellTally, curve: &DecayCurve) -> Option<Theory> {
    let members: u64 = cell.counts.iter().sum();
    let area = cell.area / members as f64;
    let rate = spec.rate_in_theory(area)?;
    let first = curve.mean.first()?;
    let tenth = curve.mean.iter().position(|mean| *mean <= 0.1 * first)?;
    let (t, mean) = (curve.t[tenth], curve.mean[tenth]);
    Some(match (spec.flow.growth(area), &spec.flow) {
        (Some(time), _) => Theory {
            label: format!("(1 + 2t/R⁴)^−{}", significant(rate, 3)),
            law: Law::Algebraic { start: mean * (1.0 + t / time).powf(rate), time, power: rate },
        },
        (None, flow) => {
            let fourth_power = (area / std::f64::consts::PI).powi(2);
            let label = match flow {
                Flow::SurfaceDiffusion => format!("exp(−{} t/R⁴)", significant(rate * fourth_power, 3)),
                _ => format!("exp(−{} t)", significant(rate, 3)),
            };
            Theory { label, law: Law::Exponential { start: mean * (rate * t).exp(), rate } }
        }
    })
}

fn median(cell: &CellStatistics) -> Option<Estimate> {
    cell.survival.median().map(|value| Estimate { value, interval: cell.bounds() })
}

/// The number among `values` of a key whose values are numbers.
fn value_of(axis: &crate::ensemble::sweep::Axis, values: &[String]) -> Option<f64> {
    axis.numbers().and_then(|_| values.first()?.parse().ok())
}
