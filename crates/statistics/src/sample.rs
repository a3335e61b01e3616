//! Right-censored times, checked and sorted, and the product underlying every estimate from them.

use std::ops::Range;

use curvelax_base::error::{Error, Result};

/// One member's time, in any one unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// When the event happened, or until when it had not.
    pub time: f64,
    /// Whether the event happened; if not, the observation is censored at `time`.
    pub happened: bool,
}

impl Observation {
    /// Creates the observation of an event, if it came before the `end` of observation.
    pub fn new(event: Option<f64>, end: f64) -> Observation {
        Observation { time: event.unwrap_or(end), happened: event.is_some() }
    }
}

/// Unsorted observations, 8 bytes each.
///
/// A time that is not negative has a sign bit of 0. The other bits are shifted into its place, and the lowest bit is
/// the censoring: numbers then have the order of their times, and events come before censorings at the same time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observations {
    keys: Vec<u64>,
}

impl Observations {
    /// Adds an observation.
    ///
    /// An error names its place if its time is negative or not finite.
    pub fn push(&mut self, seen: Observation) -> Result<()> {
        let Observation { time, happened } = seen;
        if !(time.is_finite() && time >= 0.0) {
            return Err(Error::Failed(format!(
                "statistics of times: number {} (from 0) is {time}; a time is finite and not negative: leave the member \
                 out, or give it as censored at the end of its run",
                self.keys.len()
            )));
        }
        // -0 would sort after all others and not tie with 0.
        self.keys.push((time + 0.0).to_bits() << 1 | u64::from(!happened));
        Ok(())
    }

    /// Returns the number of observations.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Iterates over them in the order in which they were added.
    pub fn iter(&self) -> impl Iterator<Item = Observation> + '_ {
        self.keys.iter().map(|key| observation(*key))
    }
}

fn observation(key: u64) -> Observation {
    Observation { time: f64::from_bits(key >> 1), happened: happened(key) }
}

fn happened(key: u64) -> bool {
    key & 1 == 0
}

/// Observations in order of time; events come before censorings at the same time, which were still at risk then.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    sorted: Vec<u64>,
    events: usize,
}

impl From<Observations> for Sample {
    fn from(observations: Observations) -> Sample {
        let mut sorted = observations.keys;
        sorted.sort_unstable();
        let events = sorted.iter().filter(|key| happened(**key)).count();
        Sample { sorted, events }
    }
}

impl Sample {
    /// Sorts the observations of any number of members, in any order.
    ///
    /// An error names the first whose time is negative or not finite.
    pub fn new(observations: impl IntoIterator<Item = Observation>) -> Result<Sample> {
        let mut all = Observations::default();
        observations.into_iter().try_for_each(|seen| all.push(seen))?;
        Ok(all.into())
    }

    /// Returns all observations, in order.
    pub fn observations(&self) -> impl ExactSizeIterator<Item = Observation> + Clone + '_ {
        self.range(0..self.len())
    }

    /// Returns those at a range of places, which must exist.
    pub(super) fn range(&self, places: Range<usize>) -> impl ExactSizeIterator<Item = Observation> + Clone + '_ {
        self.sorted[places].iter().map(|key| observation(*key))
    }

    /// Returns the number of members.
    pub fn len(&self) -> usize {
        self.sorted.len()
    }

    /// Returns whether there are no members.
    pub fn is_empty(&self) -> bool {
        self.sorted.is_empty()
    }

    /// Returns the number of members with an event.
    pub fn events(&self) -> usize {
        self.events
    }

    /// Returns the number of members whose time is censored.
    pub fn censored(&self) -> usize {
        self.len() - self.events
    }

    /// Returns the largest time, censored or not.
    pub fn last(&self) -> Option<f64> {
        self.sorted.last().map(|key| observation(*key).time)
    }

    /// Iterates over the distinct times in order, each with the numbers of its events and its censorings.
    pub(super) fn times(&self) -> impl Iterator<Item = (f64, usize, usize)> + '_ {
        self.sorted.chunk_by(|a, b| a >> 1 == b >> 1).map(|tied| {
            let events = tied.partition_point(|key| happened(*key));
            (observation(tied[0]).time, events, tied.len() - events)
        })
    }
}

/// Π (1 - d/n) and Greenwood's sum, as members leave in order of time.
///
/// Between two censorings the factors telescope, (n-d₁)/n · (n-d₁-d₂)/(n-d₁) · … = left/n. Products are therefore taken
/// only at censorings, and a complete sample has S = left/n to the last bit.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProductLimit {
    at_risk: f64,
    /// S, Greenwood's sum and the members at risk after the last censoring.
    survival: f64,
    greenwood: f64,
    from: f64,
}

impl ProductLimit {
    pub(super) fn new(members: usize) -> ProductLimit {
        ProductLimit { at_risk: members as f64, survival: 1.0, greenwood: 0.0, from: members as f64 }
    }

    /// Removes `count` members with events, at most those at risk.
    pub(super) fn events(&mut self, count: usize) {
        self.at_risk -= count as f64;
    }

    /// Removes `count` censored members, at most those at risk.
    pub(super) fn censored(&mut self, count: usize) {
        if count > 0 {
            (self.survival, self.greenwood) = (self.survival(), self.greenwood());
            self.at_risk -= count as f64;
            self.from = self.at_risk;
        }
    }

    pub(super) fn survival(&self) -> f64 {
        if self.at_risk == self.from { self.survival } else { self.survival * (self.at_risk / self.from) }
    }

    /// Greenwood's variance; 0 if S is 0, the limit of S²·Σ.
    pub(super) fn variance(&self) -> f64 {
        let survival = self.survival();
        if survival == 0.0 { 0.0 } else { survival * survival * self.greenwood() }
    }

    /// Σ d/(n(n-d)), whose terms telescope too: 1/left - 1/n.
    fn greenwood(&self) -> f64 {
        let left = self.from - self.at_risk;
        if left == 0.0 { self.greenwood } else { self.greenwood + left / (self.from * self.at_risk) }
    }
}

/// Returns whether a survival has come down to a level, equality included.
///
/// Levels such as 1 - 0.9 and products of fractions carry rounding errors, so equality means within 1e-12; S takes no
/// value that close to 0, since it is at least 1/n if it is not 0.
pub(super) fn reaches(survival: f64, level: f64) -> bool {
    survival <= level + ROUNDING
}

pub(super) const ROUNDING: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(time: f64, happened: bool) -> Observation {
        Observation { time, happened }
    }

    #[test]
    fn events_come_before_censorings_of_the_same_time_and_zeros_tie() {
        let sample = Sample::new([seen(2.0, false), seen(0.0, false), seen(2.0, true), seen(-0.0, true)]).unwrap();
        assert_eq!(sample.times().collect::<Vec<_>>(), [(0.0, 1, 1), (2.0, 1, 1)]);
        assert!(sample.last().is_some() && sample.observations().all(|seen| seen.time.is_sign_positive()));
        assert_eq!((sample.len(), sample.events(), sample.censored(), sample.last()), (4, 2, 2, Some(2.0)));
    }

    #[test]
    fn a_time_that_is_none_is_refused_by_its_place() {
        for time in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e-300] {
            let message = Sample::new([seen(1.0, true), seen(time, false)]).unwrap_err().to_string();
            assert!(message.contains("number 1 (from 0)") && message.contains(&format!(" {time};")), "{message}");
        }
        assert!(Sample::new([]).unwrap().is_empty());
    }

    #[test]
    fn a_complete_sample_has_fractions_of_its_members_to_the_last_bit() {
        let mut limit = ProductLimit::new(1000);
        for left in (0..1000).rev() {
            limit.events(1);
            assert_eq!(limit.survival(), f64::from(left) / 1000.0);
        }
        assert_eq!((limit.survival(), limit.variance()), (0.0, 0.0));
    }

    #[test]
    fn when_all_have_left_by_censoring_the_product_stays() {
        let mut limit = ProductLimit::new(3);
        limit.events(1);
        let before = (limit.survival(), limit.variance());
        limit.censored(0);
        limit.censored(2);
        assert_eq!((limit.survival(), limit.variance()), before);
        assert_eq!(before.0, 2.0 / 3.0);
    }
}
