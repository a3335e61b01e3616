//! Checks of times and steps.

use super::{MAX_STEPS, TIMES, positive, tightest_adaptive};
use crate::request::spec::{DEFAULT_ADAPTIVE, FinalTime, OrAuto, Pace, Precision, Spec, final_times};
use curvelax_base::{
    error::{Error, Result},
    text::number,
};

/// The rows of a resident member stay in memory until it ends.
const MAX_SERIES_ROWS: f64 = 1e6;
/// Above this local error a step says nothing about the curve.
const LOOSEST_ADAPTIVE: f64 = 1.0;

impl Spec {
    pub(super) fn check_times(&self) -> Result<()> {
        self.check_final_times()?;
        match self.pace() {
            Pace::Fixed(tau) => self.check_fixed(tau)?,
            Pace::Adaptive(tolerance) => self.check_adaptive(tolerance)?,
        }
        let Some(series) = self.series else { return Ok(()) };
        positive("series", series, "an interval of time", "0.01")?;
        let Some(t_end) = self.known_end() else { return Ok(()) };
        let rows = t_end / series;
        if rows > MAX_SERIES_ROWS {
            let allowed = format!("at most {MAX_SERIES_ROWS:e} rows: use a longer interval");
            return Err(Error::value("series", number(series), &format!("about {rows:.1e} rows per member"), &allowed));
        }
        Ok(())
    }

    /// The final time of the spec of a cell, if it is a number.
    pub(super) fn known_end(&self) -> Option<f64> {
        match self.t_end {
            None | Some(FinalTime::At(_)) => Some(self.final_time()),
            Some(FinalTime::Auto | FinalTime::OfCells(_)) => None,
        }
    }

    fn check_final_times(&self) -> Result<()> {
        let swept = self.sweep.axis("t-end");
        let times = match &self.t_end {
            Some(FinalTime::OfCells(times)) if times.len() as u64 != self.sweep.cells() || swept.is_some() => {
                return Err(final_times(times.len(), self.sweep.cells()));
            }
            Some(FinalTime::OfCells(times)) => times.clone(),
            _ => self.known_end().into_iter().collect(),
        };
        for t in times {
            positive("t-end", t, "a final time", "2")?;
            if !TIMES.contains(&t) {
                let allowed = format!("use a time from {:e} to {:e}", TIMES.start(), TIMES.end());
                return Err(Error::value("t-end", number(t), "parts or sums of it are not finite", &allowed));
            }
        }
        match swept.is_some_and(|axis| axis.values.iter().any(|value| value.as_str() == Some("auto"))) {
            true => {
                let message = "auto is a time for each cell already; give numbers, or --t-end auto without the sweep";
                Err(Error::Request(format!("--sweep t-end=auto: {message}")))
            }
            false => Ok(()),
        }
    }

    fn check_fixed(&self, tau: OrAuto) -> Result<()> {
        let OrAuto::Number(tau) = tau else { return Ok(()) };
        positive("tau", tau, "a time step", "0.001")?;
        let Some(end) = self.known_end() else { return Ok(()) };
        let t_end = number(end);
        if tau > end {
            let problem = format!("the step is longer than the whole run of {t_end}");
            let allowed = format!("use a step of at most {t_end} or auto, or a later --t-end");
            return Err(Error::value("tau", number(tau), &problem, &allowed));
        }
        let steps = end / tau;
        if steps > MAX_STEPS {
            let problem = format!("about {steps:.1e} steps of {} to --t-end {t_end}", number(tau));
            let allowed = format!("at most {MAX_STEPS:e} steps: use a larger --tau or an earlier --t-end");
            return Err(Error::value("tau", number(tau), &problem, &allowed));
        }
        Ok(())
    }

    fn check_adaptive(&self, tolerance: f64) -> Result<()> {
        if let Some(tau) = self.tau {
            let problem = format!("steps are either fixed or adaptive, and --adaptive {} is given", number(tolerance));
            return Err(Error::value("tau", tau, &problem, "leave out one of the two"));
        }
        if !(tolerance > 0.0 && tolerance <= LOOSEST_ADAPTIVE) {
            let allowed = format!("use a number above 0, up to {LOOSEST_ADAPTIVE}, for example {DEFAULT_ADAPTIVE}");
            return Err(Error::value("adaptive", number(tolerance), "not a local error tolerance", &allowed));
        }
        let tightest = tightest_adaptive(self.precision.unwrap_or(Precision::F64));
        if tolerance < tightest {
            let problem = "the rounding of the precision is larger";
            return Err(Error::value("adaptive", number(tolerance), problem, &format!("use {tightest:e} or more")));
        }
        Ok(())
    }
}
