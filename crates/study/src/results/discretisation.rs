//! The error that n and the steps leave in the relaxation times of a cell, and what the times tend to.

use curvelax_base::error::Result;
use curvelax_statistics::{Bootstrap, Description, HALF_INTERVAL, Interval, KaplanMeier, Limit, Mean, Sample};

/// What the levels tell of the relaxation times of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscretisationError {
    /// Members that it is known of: all, or the pilot.
    pub members: usize,
    /// Mean relative error of their times, with its sign: negative if they are too early.
    pub mean: f64,
    /// Half-width of its 95 % interval for a member of the cell.
    pub error: f64,
    /// Members whose times do not yet converge in n.
    pub not_asymptotic: usize,
}

impl DiscretisationError {
    /// Summarises members that ran at the levels; none if there are none.
    pub fn of(judged: &[Limit]) -> Result<Option<DiscretisationError>> {
        let relative = Description::new(judged.iter().map(|limit| limit.relative))?;
        let bars = Description::new(judged.iter().map(Limit::relative_error))?;
        let sampling = HALF_INTERVAL * relative.standard_error().unwrap_or(0.0);
        // The few that do not converge yet are counted, and not typical.
        Ok(relative.mean().zip(bars.median()).map(|(mean, bar)| DiscretisationError {
            members: judged.len(),
            mean,
            error: sampling + bar,
            not_asymptotic: judged.iter().filter(|limit| !limit.asymptotic).count(),
        }))
    }

    /// Whether most of its members converge in n, so that the mean means something.
    pub fn converges(&self) -> bool {
        2 * self.not_asymptotic <= self.members
    }
}

/// The limits of the relaxation times of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct CellLimits {
    /// Members that have one.
    pub known: usize,
    /// Their mean, as that of the times.
    pub mean: Option<Mean>,
    /// Their median.
    pub median: Option<f64>,
    /// Its 95 % interval, for sampling and discretisation together.
    pub interval: Option<(f64, f64)>,
    /// Median of the half-widths of the members' own intervals.
    pub error: Option<f64>,
}

impl CellLimits {
    /// Summarises the limits; none if no member has one.
    ///
    /// `copies` says that all members are one curve.
    pub fn of(sample: &Sample, judged: &[Limit], bootstrap: &Bootstrap, copies: bool) -> Result<Option<CellLimits>> {
        if sample.events() == 0 {
            return Ok(None);
        }
        let survival = KaplanMeier::new(sample);
        let error = Description::new(judged.iter().map(|limit| limit.error))?.median();
        // Errors of discretisation have one sign for all members: they do not average out.
        let wider = |Interval { lower, upper, .. }| Some(((lower? - error?).max(0.0), upper? + error?));
        // Copies of one curve have an interval, too: that of their own error.
        let alone = || if copies && sample.len() == 1 { sample.last() } else { None };
        let alone = || alone().zip(error).map(|(t, error)| ((t - error).max(0.0), t + error));
        Ok(Some(CellLimits {
            known: sample.events(),
            mean: survival.mean(),
            median: survival.median(),
            interval: bootstrap.median(sample).and_then(wider).or_else(alone),
            error,
        }))
    }

    /// Half-width of the interval of the median, relative to it.
    pub fn uncertainty(&self) -> Option<f64> {
        let (median, (lower, upper)) = (self.median?, self.interval?);
        Some((upper - median).max(median - lower) / median)
    }
}
