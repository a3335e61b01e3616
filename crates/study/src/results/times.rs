//! The statistics of one kind of time, over the members of a cell: moments and quantiles by Kaplan and Meier.

use serde::{Serialize, Serializer, ser::SerializeMap};

use curvelax_statistics::{Interval, KaplanMeier, Mean, Observations, Sample, interval};

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
    pub name: &'static str,
    /// The number, if known.
    pub value: Option<f64>,
    /// What it means.
    pub meaning: &'static str,
}

impl TimeStatistics {
    /// Computes the statistics of some times.
    pub fn new(times: Observations) -> TimeStatistics {
        TimeStatistics::of(Sample::from(times))
    }

    /// Computes the statistics of sorted times.
    pub fn of(sample: Sample) -> TimeStatistics {
        let survival = KaplanMeier::new(&sample);
        // The usual median, also of an even number.
        let quantile = |share| if share == 0.5 { survival.median() } else { survival.quantile(share) };
        let (mean, quantiles) = (survival.mean(), QUANTILES.map(|(share, ..)| quantile(share)));
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
        let of = |number: fn(Mean) -> Option<f64>| self.mean.and_then(number);
        let (mean, sd) = (of(|mean| Some(mean.value)), of(|mean| mean.standard_deviation));
        let (se, restricted_to) = (of(|mean| mean.standard_error), of(|mean| mean.restricted_to));
        let restricted = "where the longest times are censored, the mean is restricted to times up to this one, and is a lower bound";
        let moments = [
            Statistic { name: "mean", value: mean, meaning: "mean, by Kaplan–Meier" },
            Statistic { name: "sd", value: sd, meaning: "standard deviation" },
            Statistic { name: "se", value: se, meaning: "standard error of the mean" },
            Statistic { name: "restricted_to", value: restricted_to, meaning: restricted },
        ];
        let named = moments.into_iter().chain(places(self.quantiles, self.interval())).collect();
        Numbers { known: self.sample.events(), named, intervals: intervals(&self.intervals) }
    }

    /// The share of the members that have not had the event.
    pub fn survival(&self) -> KaplanMeier<'_> {
        KaplanMeier::new(&self.sample)
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

/// Quantiles, and the interval of the median.
pub(super) fn places(
    quantiles: [Option<f64>; QUANTILES.len()],
    interval: Option<Interval>,
) -> impl Iterator<Item = Statistic> {
    let [value, upper] = ends(interval);
    let low =
        "lower end of the 95 % interval of the median (with fewer than 6 members, the minimum); empty if there is none";
    let high =
        "upper end of the 95 % interval of the median (with fewer than 6 members, the maximum); empty if there is none";
    let ends = [
        Statistic { name: "median_low", value, meaning: low },
        Statistic { name: "median_high", value: upper, meaning: high },
    ];
    let quantiles = QUANTILES.into_iter().zip(quantiles);
    quantiles.map(|((_, name, meaning), value)| Statistic { name, value, meaning }).chain(ends)
}

/// Names and meanings of the ends of the intervals of the [quantiles](QUANTILES) but the median.
const ENDS: [[(&str, &str); 2]; QUANTILES.len()] = [
    [
        ("q05_low", "lower end of the 95 % interval of the 5 % quantile; empty if there is none"),
        ("q05_high", "upper end of the 95 % interval of the 5 % quantile; empty if there is none"),
    ],
    [
        ("q25_low", "lower end of the 95 % interval of the 25 % quantile; empty if there is none"),
        ("q25_high", "upper end of the 95 % interval of the 25 % quantile; empty if there is none"),
    ],
    [("", ""); 2],
    [
        ("q75_low", "lower end of the 95 % interval of the 75 % quantile; empty if there is none"),
        ("q75_high", "upper end of the 95 % interval of the 75 % quantile; empty if there is none"),
    ],
    [
        ("q95_low", "lower end of the 95 % interval of the 95 % quantile; empty if there is none"),
        ("q95_high", "upper end of the 95 % interval of the 95 % quantile; empty if there is none"),
    ],
];

/// What the interval of the median covers, and the intervals of the other quantiles, as far as they cover 95 %.
pub(super) fn intervals(of: &[Option<Interval>; QUANTILES.len()]) -> Vec<Statistic> {
    let [_, _, median, ..] = of;
    let named = ENDS.iter().zip(of).filter(|(names, _)| !names[0].0.is_empty()).flat_map(|(names, interval)| {
        let values = ends(interval.filter(|interval| interval.range_of.is_none()));
        names.iter().zip(values).map(|((name, meaning), value)| Statistic { name, value, meaning })
    });
    [covered(*median)].into_iter().chain(named).collect()
}

/// What the interval of the median covers.
pub(super) fn covered(median: Option<Interval>) -> Statistic {
    let meaning = "probability that the median is between median_low and median_high, a lower bound";
    Statistic { name: "median_coverage", value: median.map(|interval| interval.coverage), meaning }
}

fn ends(of: Option<Interval>) -> [Option<f64>; 2] {
    of.map_or([None, None], |interval| [interval.lower, interval.upper])
}
