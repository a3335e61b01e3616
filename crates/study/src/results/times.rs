//! The statistics of one kind of time, over the members of a cell: moments and quantiles by Kaplan and Meier.

use serde::{Serialize, Serializer, ser::SerializeMap};

use curvelax_statistics::{Interval, Mean, Observations, Sample, interval};

/// Fractions of the members whose times are in the table, with the names and meanings of the columns.
pub const QUANTILES: [(f64, &str, &str); 5] = [
    (0.05, "q05", "5 % quantile"),
    (0.25, "q25", "25 % quantile"),
    (0.5, "median", "median"),
    (0.75, "q75", "75 % quantile"),
    (0.95, "q95", "95 % quantile"),
];

/// The times of one kind of event in one cell.
pub struct TimeStatistics {
    /// The times, sorted.
    pub sample: Sample,
    /// Mean time, restricted if the last member is censored.
    pub mean: Option<Mean>,
    /// Times by which each [fraction](QUANTILES) of the members has had the event.
    pub quantiles: [Option<f64>; QUANTILES.len()],
    /// Intervals of these.
    pub intervals: [Option<Interval>; QUANTILES.len()],
}

/// The numbers in `ensemble.csv` on one quantity of a cell, in the order and with the names of its columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// Members with a known quantity.
    pub known: usize,
    /// All other numbers.
    pub named: Vec<Statistic>,
    /// What the intervals cover, and those of other quantiles than the median: columns at the end of the table.
    pub intervals: Vec<Statistic>,
}

/// A number of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistic {
    /// Its column, without the quantity.
    pub name: String,
    /// The number, if known.
    pub value: Option<f64>,
    /// What it means.
    pub meaning: String,
}

impl Statistic {
    pub(super) fn new(name: impl Into<String>, value: Option<f64>, meaning: impl Into<String>) -> Statistic {
        Statistic { name: name.into(), value, meaning: meaning.into() }
    }
}

impl TimeStatistics {
    /// Computes the statistics of some times.
    pub fn new(times: Observations) -> TimeStatistics {
        TimeStatistics::of(Sample::from(times))
    }

    /// Computes the statistics of sorted times.
    pub fn of(sample: Sample) -> TimeStatistics {
        // The usual median, also of an even number.
        let quantile = |share| if share == 0.5 { sample.median() } else { sample.quantile(share) };
        let (mean, quantiles) = (sample.mean(), QUANTILES.map(|(share, ..)| quantile(share)));
        let intervals = QUANTILES.map(|(share, ..)| interval::of_sample(&sample, share));
        TimeStatistics { sample, mean, quantiles, intervals }
    }

    /// Those of times from which nothing can be estimated.
    pub fn unknown(times: Observations) -> TimeStatistics {
        let (quantiles, intervals) = ([None; QUANTILES.len()], [None; QUANTILES.len()]);
        TimeStatistics { sample: Sample::from(times), mean: None, quantiles, intervals }
    }

    /// The numbers for the table.
    pub fn numbers(&self) -> Numbers {
        let restricted_to = self.mean.and_then(|mean| mean.restricted_to);
        let restricted = "where the longest times are censored, the mean is restricted to times up to this one, and is a lower bound";
        let moments =
            of_mean(self.mean).into_iter().chain([Statistic::new("restricted_to", restricted_to, restricted)]);
        let named = moments.chain(places(self.quantiles, self.interval())).collect();
        Numbers { known: self.sample.events(), named, intervals: intervals(&self.intervals) }
    }

    /// Time by which half of the members have had the event.
    pub fn median(&self) -> Option<f64> {
        let [_, _, median, ..] = self.quantiles;
        median
    }

    /// The larger distance of these two times from the median, relative to it.
    pub fn half_width(&self, (low, high): (f64, f64)) -> Option<f64> {
        self.median().map(|median| (high - median).max(median - low) / median)
    }

    /// The interval of the median.
    pub fn interval(&self) -> Option<Interval> {
        let [_, _, median, ..] = self.intervals;
        median
    }
}

impl Numbers {
    /// Returns the number called `name`, if known.
    pub fn get(&self, name: &str) -> Option<f64> {
        let mut all = self.named.iter().chain(&self.intervals);
        all.find(|statistic| statistic.name == name).and_then(|statistic| statistic.value)
    }
}

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(1 + self.named.len() + self.intervals.len()))?;
        map.serialize_entry("known", &self.known)?;
        let mut all = self.named.iter().chain(&self.intervals);
        all.try_for_each(|Statistic { name, value, .. }| map.serialize_entry(name, value))?;
        map.end()
    }
}

/// A mean time, if it is known, the standard deviation and the standard error.
pub(super) fn of_mean(mean: Option<Mean>) -> [Statistic; 3] {
    let of = |number: fn(Mean) -> Option<f64>| mean.and_then(number);
    let all = [of(|mean| Some(mean.value)), of(|mean| mean.standard_deviation), of(|mean| mean.standard_error)];
    moments("mean, by Kaplan–Meier", all)
}

/// A mean, its meaning, the standard deviation and the standard error.
pub(super) fn moments(of_mean: &str, [mean, sd, se]: [Option<f64>; 3]) -> [Statistic; 3] {
    [
        Statistic::new("mean", mean, of_mean),
        Statistic::new("sd", sd, "standard deviation"),
        Statistic::new("se", se, "standard error of the mean"),
    ]
}

/// Quantiles, and the interval of the median.
pub(super) fn places(
    quantiles: [Option<f64>; QUANTILES.len()],
    interval: Option<Interval>,
) -> impl Iterator<Item = Statistic> {
    let of_median = |end| format!("median (with fewer than 6 members, the {end})");
    let ends = ends("median", ["minimum", "maximum"].map(of_median), interval);
    let quantiles = QUANTILES.into_iter().zip(quantiles);
    quantiles.map(|((_, name, meaning), value)| Statistic::new(name, value, meaning)).chain(ends)
}

/// What the interval of the median covers, and the intervals of the other quantiles, as far as they cover 95 %.
pub(super) fn intervals(of: &[Option<Interval>; QUANTILES.len()]) -> Vec<Statistic> {
    let [_, _, median, ..] = of;
    let others = QUANTILES.into_iter().zip(of).filter(|((share, ..), _)| *share != 0.5);
    let of_ends = others.flat_map(|((_, name, meaning), interval)| {
        ends(name, [meaning; 2].map(String::from), interval.filter(|interval| interval.range_of.is_none()))
    });
    [covered(*median)].into_iter().chain(of_ends).collect()
}

/// The ends of the interval of the quantile called `name`, with what the lower and the upper one is that of.
pub(super) fn ends(name: &str, of: [String; 2], interval: Option<Interval>) -> impl Iterator<Item = Statistic> {
    let values = interval.map_or([None; 2], |interval| [interval.lower, interval.upper]);
    let ends = [("low", "lower"), ("high", "upper")].into_iter().zip(of).zip(values);
    ends.map(move |(((end, side), of), value)| {
        let meaning = format!("{side} end of the 95 % interval of the {of}; empty if there is none");
        Statistic::new(format!("{name}_{end}"), value, meaning)
    })
}

/// What the interval of the median covers.
pub(super) fn covered(median: Option<Interval>) -> Statistic {
    let meaning = "probability that the median is between median_low and median_high, a lower bound";
    Statistic::new("median_coverage", median.map(|interval| interval.coverage), meaning)
}
