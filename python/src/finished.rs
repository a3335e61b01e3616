//! What the program knows of a finished run, for frames and pictures.

use std::path::PathBuf;

use curvelax::{
    Error, Result,
    files::{columns::columns, names, reader::Finished, zarr},
    paper::{PaperFormat, PaperWidth, Printer, USUAL_DPI, missing_letters},
    report::pictures,
    results::EnsembleStatistics,
    statistics::{Observation, Sample, Step},
};
use numpy::PyArray1;
use pyo3::{
    prelude::*,
    types::{PyBytes, PyDict},
};

use crate::{raise, unforked};

/// A survival curve: the times at which it falls after time 0, the members at risk before, the share without the event
/// after, and its 95 % band; and the largest time up to which it is known.
type Curve<'py> = ([Bound<'py, PyArray1<f64>>; 5], Option<f64>);

/// The survival curve of some times.
fn curve<'py>(py: Python<'py>, sample: &Sample) -> Curve<'py> {
    let array = |start: f64, of: &dyn Fn(Step) -> f64| {
        PyArray1::from_iter(py, [start].into_iter().chain(sample.steps().map(of)))
    };
    let numbers = [
        array(0.0, &|step| step.time),
        array(sample.len() as f64, &|step| step.at_risk as f64),
        array(1.0, &|step| step.survival),
        array(1.0, &|step| step.band().0),
        array(1.0, &|step| step.band().1),
    ];
    (numbers, sample.last())
}

/// A finished run as read from its folder.
#[pyclass(frozen)]
pub struct FinishedRun {
    run: Finished,
    statistics: EnsembleStatistics,
}

impl FinishedRun {
    fn pictures(&self) -> pictures::FinishedRun<'_> {
        let Finished { provenance, tally, excess, explained, films } = &self.run;
        pictures::FinishedRun { provenance, tally, statistics: &self.statistics, excess, explained, films }
    }

    fn print(&self, name: &str, extension: &str, width: &str, dpi: Option<i64>) -> Result<(Vec<u8>, Option<String>)> {
        let format = match (extension.to_lowercase().as_str(), dpi) {
            (".png", dpi) => PaperFormat::png(dpi.unwrap_or(USUAL_DPI))?,
            (".pdf", None) => PaperFormat::Pdf,
            (".pdf", Some(dpi)) => return Err(Error::value("dpi", dpi, "a .pdf has no dots", "leave it out")),
            (other, _) => {
                let problem = format!("{other:?} is no extension of a picture for papers; use .png or .pdf");
                return Err(Error::Request(problem));
            }
        };
        let width: PaperWidth = width.parse()?;
        let place = format!("{}/{name}.svg", names::PLOTS);
        let all = self.pictures().on_paper(width.pixels())?;
        let Some(picture) = all.into_iter().find(|picture| picture.name == place) else {
            return Err(Error::Request(format!("{place}: the run has no picture of this name, or its files are gone")));
        };
        let print = Printer::default().read(&picture.title, &picture.svg, width)?;
        Ok((print.file(format)?, missing_letters(&print.missing())))
    }
}

#[pymethods]
impl FinishedRun {
    /// Reads the run in `folder`.
    #[new]
    fn new(py: Python<'_>, folder: PathBuf) -> PyResult<FinishedRun> {
        unforked(py)?;
        let read = py.detach(|| {
            let mut run = Finished::read(&folder)?;
            let statistics = EnsembleStatistics::new(&run.provenance.spec, &mut run.tally)?;
            Ok(FinishedRun { run, statistics })
        });
        read.map_err(|error| raise(py, error, None))
    }

    /// The columns of each table that a run may have: heading, what its fields hold, and what they mean.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for name in names::TABLES.into_iter().filter(|name| *name != names::STORE) {
            let own = columns(name, &self.run.provenance.spec, &self.statistics).map_err(|e| raise(py, e, None))?;
            let own: Vec<(String, String, String)> =
                own.into_iter().map(|[name, holds, text]| (name, holds, text)).collect();
            all.set_item(name, own)?;
        }
        Ok(all)
    }

    /// The times of which there are statistics: the one that is shown comes first, events last.
    fn time_names(&self) -> Vec<String> {
        let shown = self.statistics.time();
        let others = ["t_relax", "t_half"].into_iter().filter(|name| *name != shown);
        let events = self.run.provenance.spec.event.iter().map(|event| event.name.clone());
        [shown].into_iter().chain(others).map(String::from).chain(events).collect()
    }

    /// Whether the members of a cell are vesicles.
    fn has_vesicles(&self, cell: u64) -> bool {
        self.run.provenance.spec.has_vesicles_in(cell)
    }

    /// The survival curve of each cell for t_limit, t_relax or an event, which is in the limit if it has one.
    ///
    /// # Errors
    /// `RequestError` for an event before which members were stopped.
    fn survival<'py>(&self, py: Python<'py>, time: &str) -> PyResult<Vec<(u64, Curve<'py>)>> {
        let cells = &self.statistics.cells;
        let event = self.run.provenance.spec.event.iter().position(|event| event.name == time);
        let stopped: u64 = event.map_or(0, |event| cells.iter().map(|cell| cell.events[event].stopped).sum());
        if stopped > 0 {
            let problem = format!(
                "time {time:?}: {stopped} members stopped when they relaxed, before this event, so it has no statistics; \
                 run with stop_when_relaxed=False and a number as t_end"
            );
            return Err(raise(py, curvelax::Error::Request(problem), None));
        }
        let curves = cells.iter().map(|cell| {
            let sample = match event {
                Some(event) => &cell.events[event].judged().sample,
                None => &cell.judged(time == "t_limit").sample,
            };
            (cell.cell, curve(py, sample))
        });
        Ok(curves.collect())
    }

    /// The survival curve of `times`, of which only some `happened`; the others are censored.
    ///
    /// # Errors
    /// `RunError` for a time that is negative or not finite.
    #[staticmethod]
    fn survival_of(py: Python<'_>, times: Vec<f64>, happened: Vec<bool>) -> PyResult<Curve<'_>> {
        let seen = times.into_iter().zip(happened).map(|(time, happened)| Observation { time, happened });
        let sample = Sample::new(seen).map_err(|error| raise(py, error, None))?;
        Ok(curve(py, &sample))
    }

    /// The unit of times, if it has a name.
    fn time_unit(&self) -> Option<String> {
        self.run.provenance.spec.units.as_ref().map(|units| units.shown().time)
    }

    /// The times of its snapshots.
    fn times(&self) -> Vec<f64> {
        zarr::times(&self.run.provenance.spec)
    }

    /// The attributes of the arrays of its snapshots, as JSON: by name, and under an empty name those of all together.
    fn attributes(&self, py: Python<'_>) -> PyResult<Vec<(&'static str, String)>> {
        let all = zarr::attributes(&self.run.provenance.spec, 1).map_err(|error| raise(py, error, None))?;
        Ok(all.into_iter().map(|(name, json)| (name, json.to_string())).collect())
    }

    /// The picture `name` as the file for a paper, with the extension `.png` or `.pdf`, and what is said of letters
    /// that it lacks.
    ///
    /// # Errors
    /// `RequestError` for another extension, width or density, and for a picture that the run has not.
    fn on_paper<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        extension: &str,
        width: &str,
        dpi: Option<i64>,
    ) -> PyResult<(Bound<'py, PyBytes>, Option<String>)> {
        let (bytes, note) = py.detach(|| self.print(name, extension, width, dpi)).map_err(|e| raise(py, e, None))?;
        Ok((PyBytes::new(py, &bytes), note))
    }

    /// What the report says first: its title, what was run, members by status, and headline numbers.
    #[expect(clippy::type_complexity, reason = "a tuple in Python")]
    fn head(&self) -> (String, String, Vec<(&'static str, u64)>, Vec<(String, String, String)>) {
        let head = self.pictures().head();
        let headline = head.headline.into_iter().map(|own| (own.label, own.value, own.note)).collect();
        (head.title, head.what, head.statuses, headline)
    }
}
