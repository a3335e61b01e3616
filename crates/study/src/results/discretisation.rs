//! The error that n and the steps leave in the relaxation times of a cell, and what the times tend to.

use super::times::{QUANTILES, TimeStatistics};
use curvelax_base::error::Result;
use curvelax_statistics::{Description, HALF_INTERVAL, Interval, Limit, Observation, Observations, Sample, interval};

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
        // What holds at the start has no error of this kind.
        let judged = || judged.iter().filter(|limit| limit.t > 0.0);
        let relative = Description::new(judged().map(|limit| limit.relative))?;
        let bars = Description::new(judged().map(Limit::relative_error))?;
        let sampling = HALF_INTERVAL * relative.standard_error().unwrap_or(0.0);
        // The few that do not converge yet are counted, and not typical.
        Ok(relative.mean().zip(bars.median()).map(|(mean, bar)| DiscretisationError {
            members: relative.count(),
            mean,
            error: sampling + bar,
            not_asymptotic: judged().filter(|limit| !limit.asymptotic).count(),
        }))
    }

    /// Whether most of its members converge in n, so that the mean means something.
    pub fn converges(&self) -> bool {
        2 * self.not_asymptotic <= self.members
    }
}

/// The limits of the times of a cell.
pub struct CellLimits {
    /// Their statistics, as those of the times; intervals are for sampling and discretisation together.
    pub times: TimeStatistics,
    /// Median of the half-widths of the members' own intervals.
    pub error: Option<f64>,
    /// What the median is if all limits are at one end of their own intervals.
    pub ends: Option<(f64, f64)>,
    /// Relative half-width of the members' own intervals that [`MOST`] of them do not exceed.
    pub widest: Option<f64>,
    /// The part of it that no nodes lessen: what rounding the corners of an outline does.
    pub fixed: Option<f64>,
}

/// Share of the members whose own intervals are as narrow as [`CellLimits::widest`].
pub const MOST: f64 = 0.95;

impl CellLimits {
    /// Summarises the limits, in the order of those that are `judged`; none if no member has one.
    ///
    /// `copies` says that all members are one curve.
    pub fn of(limits: &Observations, judged: &[Limit], copies: bool) -> Result<Option<CellLimits>> {
        let [at_low_end, sample, at_high_end] = [-1.0, 0.0, 1.0].map(|end| moved(limits, judged, end));
        let (at_low_end, sample, at_high_end) = (at_low_end?, sample?, at_high_end?);
        if sample.events() == 0 {
            return Ok(None);
        }
        let ends = at_low_end.median().zip(at_high_end.median()).filter(|_| !judged.is_empty());
        // Errors of discretisation have one sign for all members: they do not average out. So each end is that of
        // limits that are all as far on its side as they may be.
        let sampled = |share: f64| {
            let of = |sample: &Sample| interval::of_sample(sample, share);
            let [lower, upper] = [of(&at_low_end)?.lower, of(&at_high_end)?.upper];
            Some(Interval { lower, upper, ..of(&sample)? })
        };
        // Copies of one curve have the interval of their own error.
        let interval = |share: f64| match (copies, ends) {
            (_, None) => None,
            (true, Some((low, high))) => Some(Interval::between(low, high)),
            (false, Some(_)) => sampled(share),
        };
        let intervals = QUANTILES.map(|(share, ..)| interval(share));
        let mut by_error: Vec<&Limit> = judged.iter().collect();
        by_error.sort_by(|one, other| one.relative_error().total_cmp(&other.relative_error()));
        let widest = ((MOST * judged.len() as f64).ceil() as usize).checked_sub(1).map(|place| by_error[place]);
        Ok(Some(CellLimits {
            times: TimeStatistics { intervals, ..TimeStatistics::of(sample) },
            error: Description::new(judged.iter().map(|limit| limit.error))?.median(),
            ends,
            widest: widest.map(Limit::relative_error),
            fixed: widest.map(Limit::relative_fixed),
        }))
    }

    /// Half-width of the interval of the median relative to it, and the part of it that is there without sampling.
    pub fn uncertainty(&self) -> Option<(f64, f64)> {
        self.times.median().filter(|median| *median > 0.0)?;
        Some((self.times.half_width(self.times.interval()?.bounds()?)?, self.times.half_width(self.ends?)?))
    }
}

/// The limits, each moved by its error times `share`.
fn moved(limits: &Observations, judged: &[Limit], share: f64) -> Result<Sample> {
    let mut errors = judged.iter().map(|limit| limit.error);
    Sample::new(limits.iter().map(|seen| match seen.happened {
        true => Observation { time: (seen.time + share * errors.next().unwrap_or_default()).max(0.0), ..seen },
        false => seen,
    }))
}
