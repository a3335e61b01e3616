//! Statistics of relaxation times, some of them unobserved: pure functions from numbers to numbers.
//!
//! # Theory
//!
//! A member that has not relaxed at the end of its run still carries information: its time is *larger* than the run was
//! long. Such a time is right-censored. Leaving it out, or replacing it by the end of the run, biases every mean and
//! quantile downwards. The product-limit estimate of E. L. Kaplan and P. Meier (*J. Am. Stat. Assoc.* 53, 1958, 457)
//! uses this information,
//!
//! ```text
//! S(t) = Π_{t_i ≤ t} (1 - d_i/n_i),    var S(t) ≈ S(t)² Σ_{t_i ≤ t} d_i/(n_i (n_i - d_i))
//! ```
//!
//! with d_i events at the time t_i among the n_i members still at risk, and M. Greenwood's variance (1926). Quantiles
//! are read off S, and the median is the middle of the times at which S is ½; the mean is the area under it, and if S
//! does not come down to 0, only the area up to the largest time: a lower bound. The log-rank test (N. Mantel, *Cancer
//! Chemother. Rep.* 50, 1966, 163) compares the events of each group with those expected if all groups had one S. The
//! intervals of quantiles are those of the sign test, and of the beta product where members are censored: they cover at
//! least 95 % for any distribution, or say what they cover. [`PairedDifferences`] of two groups whose members share
//! their random numbers are tested by F. Wilcoxon's signed ranks.
//!
//! All of this requires that censoring says nothing about the hidden time. This holds for the end of the run, but not
//! for a member that became singular; the caller must decide, and report, how to treat such members.
//!
//! # Practice
//!
//! A [`Sample`] is checked and sorted once; its survival, [`interval`] and [`log_rank`] follow and cannot fail. A
//! [`Description`] is for complete data, [`Line`] and [`PowerLaw`] for one quantity against another. Unknown values are
//! `None`, never NaN and never infinite. Times may be in any one unit; means, deviations and quantiles have the same
//! unit, variances of S have none.

//!
//! # Example
//!
//! ```
//! use curvelax_statistics::{Observation, Sample, interval};
//!
//! let relaxed = [0.8, 0.5, 1.1, 0.9].map(|t| Observation::new(Some(t), 2.0));
//! let unfinished = Observation::new(None, 2.0);
//! let sample = Sample::new(relaxed.into_iter().chain([unfinished]))?;
//! assert_eq!((sample.median(), sample.quantile(0.95)), (Some(0.9), None));
//! assert_eq!(sample.mean().unwrap().restricted_to, Some(2.0));
//! let interval = interval::of_sample(&sample, 0.5).unwrap();
//! assert_eq!((interval.lower, interval.upper), (Some(0.5), None));
//! # Ok::<(), curvelax_base::Error>(())
//! ```

mod describe;
mod exact;
mod explain;
mod fit;
pub mod interval;
mod limit;
mod log_rank;
mod paired;
mod sample;
mod special;
mod spread;
mod sum;
mod survival;

pub use curvelax_base::interval::Interval;
pub use describe::Description;
pub use exact::{ExactSum, Moments};
pub use explain::{FOLDS, Regression, correlation, spearman};
pub use fit::{GoodnessOfFit, Line, PowerLaw};
pub use limit::{FINER_STEPS, Limit, SHARE_OF_STEPS, Terms, TimeOf, Times};
pub use log_rank::{GroupEvents, LogRank, log_rank};
pub use paired::{PairedDifferences, SignedRank};
pub use sample::{Observation, Observations, Sample};
pub use spread::Spread;
pub use survival::{Mean, Step};

/// Standard errors in half a 95 % interval of a normal estimate.
pub const HALF_INTERVAL: f64 = 1.96;

/// The value if it is finite.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
