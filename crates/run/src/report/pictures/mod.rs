//! What people look at: the charts of a run and its page, made from its statistics.

mod cells;
mod charts;
mod head;
mod tables;

use super::{
    gallery::{self, Wording},
    page::{MAX_MEMBERS, MovingMember, Page, PageFigure, spread},
    words::{RAW_CLOCK, in_the_limit, length_unit, place, time_unit},
};
use glam::DVec2;

use curvelax_base::{error::Result, text::significant};
use curvelax_draw::{medium::Medium, width::distinct};
use curvelax_ensemble::{Spec, Status, outcome::wulff_outline};
use curvelax_files::{names, portraits::Film};
use curvelax_flow::equilibrium::Equilibrium;
use curvelax_study::results::{
    cells::EnsembleStatistics,
    explained::Explained,
    provenance::Provenance,
    tally::{MeanExcess, Tally},
};

/// Maximum characters of the name of a member.
const MAX_NAME: usize = 60;
/// Digits of a number for reading.
const DIGITS: usize = 4;

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

impl FinishedRun<'_> {
    /// The pictures for white paper so many pixels wide, without what a caption says.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if the values of a cell do not fit the spec.
    pub fn on_paper(&self, width: f64) -> Result<Vec<PageFigure>> {
        let medium = Medium::Paper(width);
        let all = self.charts(medium)?.into_iter().chain(self.gallery(medium).map(first_members));
        Ok(all.map(|figure| PageFigure { svg: self.with_unit(figure.svg), ..figure }).collect())
    }

    /// The first members, if there are portraits of them.
    fn gallery(&self, medium: Medium) -> Option<String> {
        (!self.films.is_empty()).then(|| gallery::draw(medium, self.films, &self.wording(medium)))
    }

    /// The files that are drawn: name and text.
    pub fn pictures(&self) -> Result<Vec<(&'static str, String)>> {
        let page = self.page()?;
        let gallery = self.gallery(Medium::Screen);
        let charts = self.charts(Medium::Screen)?.into_iter().map(|chart| (chart.name, chart.svg));
        let gallery = gallery.map(|svg| (names::CURVES, svg));
        let all = charts.chain(gallery).chain([(names::REPORT, page)]);
        Ok(all.map(|(name, text)| (name, self.with_unit(text))).collect())
    }

    /// `text` with the unit of times that this run has.
    fn with_unit(&self, text: String) -> String {
        match (&self.spec().units, self.spec().mobility) {
            (Some(units), _) => units.name(&text),
            (None, Some(_)) => text.replace("length⁻⁴", "1/time of B").replace("length⁴", "time of B"),
            (None, None) => text,
        }
    }

    fn spec(&self) -> &Spec {
        &self.provenance.spec
    }

    /// The text of `report.html`.
    fn page(&self) -> Result<String> {
        // Equal results give equal bytes, on any number of threads.
        let spec = Spec { threads: None, ..self.spec().clone() }.to_toml()?;
        let first = self.gallery(Medium::Page).map(first_members);
        let page = Page {
            head: self.head(),
            is_list: self.spec().names_members(),
            warnings: &self.provenance.warnings,
            members: self.trajectories(),
            clock: if self.statistics.of_limits { RAW_CLOCK } else { "" },
            units: [length_unit(self.spec()), time_unit(self.spec())],
            legend: &self.legend(),
            plots: self.charts(Medium::Page)?.into_iter().chain(first).collect(),
            tables: self.tables(),
            spec: &spec,
            provenance: self.provenance(),
        };
        Ok(page.html())
    }

    /// How and when a member ended; when it relaxed is said in the limit, if that is known.
    fn end_of(&self, film: &Film) -> String {
        let (unit, member) = (time_unit(self.spec()), self.tally.named(film.member));
        let at = |t: f64| format!(" at t = {}{unit}", significant(t, 3));
        let when = match film.status {
            Status::Vanished => member.and_then(|member| member.t_vanish).map(at),
            _ => member.and_then(|member| member.t_limit).map(|t| in_the_limit(t, &unit)).or(film.t_relax.map(at)),
        };
        format!("{}{}", film.status.name(), when.unwrap_or_default())
    }

    /// What is written below the portraits.
    fn wording(&self, medium: Medium) -> Wording {
        let cell = |film: &Film| self.short_label(film.member / self.spec().members_per_cell());
        let cells: Vec<String> = self.films.iter().map(cell).collect();
        let (_, side) = gallery::columns(medium, self.films.len().min(gallery::MAX_PANELS));
        let cells = distinct(&cells, gallery::SIZE, side);
        let ends = self.films.iter().map(|film| self.end_of(film));
        let rests = self.films.iter().map(|film| self.at_rest(film).unwrap_or_default());
        Wording { unit: length_unit(self.spec()), cells, ends: ends.collect(), rests: rests.collect() }
    }

    /// The Wulff shape of the last state of a crystal.
    fn at_rest(&self, film: &Film) -> Option<Vec<DVec2>> {
        let cell = film.member / self.spec().members_per_cell();
        let spec = self.spec().of_cell(cell).ok()?;
        let values = spec.values_of(film.member, cell).ok()?;
        let Equilibrium::Wulff(energy) = values.flow.equilibrium() else { return None };
        film.frames().last().map(|nodes| wulff_outline(nodes, &energy))
    }

    /// The members to watch: the first ones, or some of all cells.
    fn trajectories(&self) -> Vec<MovingMember> {
        let sweep = &self.spec().sweep;
        let trajectory = |film: &Film| {
            let cell = self.short_label(film.member / self.spec().members_per_cell());
            let cell = if cell.is_empty() { cell } else { format!(" ({cell})") };
            let (name, status) = (film.name(MAX_NAME), film.status.name());
            let label = format!("{name}{cell}: {}", self.end_of(film));
            MovingMember { label, status, times: film.times.clone(), nodes: film.frames() }
        };
        let shown = if sweep.is_empty() { self.films.len() } else { MAX_MEMBERS };
        spread(self.films.len(), shown).map(|i| trajectory(&self.films[i])).collect()
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

/// The gallery with its words.
fn first_members(svg: String) -> PageFigure {
    let caption = "Grey: the start. Light: in between. Colour: the last state, by status.";
    figure(names::CURVES, "The first members before, during and after", caption, svg)
}

fn figure(name: &'static str, title: &str, caption: &str, svg: String) -> PageFigure {
    PageFigure { name, title: title.into(), caption: caption.into(), svg }
}

#[cfg(test)]
mod tests;
