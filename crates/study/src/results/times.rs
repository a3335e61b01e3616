//! The statistics of one kind of time, over the members of a cell: moments and quantiles by Kaplan and Meier.

use serde::{Serialize, Serializer, ser::SerializeMap};

use curvelax_statistics::{Bootstrap, Interval, KaplanMeier, Mean, Observations, Sample};

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
    /// 95 % interval of the median.
    pub interval: Option<Interval>,
}

/// The numbers in `ensemble.csv` on one quantity of a cell, in the order and with the names of its columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// Members with a known quantity.
    pub known: usize,
    /// All other numbers.
    pub named: Vec<Statistic>,
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
    pub fn new(times: Observations, bootstrap: &Bootstrap) -> TimeStatistics {
        let sample = Sample::from(times);
        let survival = KaplanMeier::new(&sample);
        // The usual median, also of an even number.
        let quantile = |share| if share == 0.5 { survival.median() } else { survival.quantile(share) };
        let (mean, quantiles) = (survival.mean(), QUANTILES.map(|(share, ..)| quantile(share)));
        let interval = bootstrap.median(&sample);
        TimeStatistics { sample, mean, quantiles, interval }
    }

    /// Those of times from which nothing can be estimated.
    pub fn unknown(times: Observations) -> TimeStatistics {
        TimeStatistics { sample: Sample::from(times), mean: None, quantiles: [None; QUANTILES.len()], interval: None }
    }

    /// The numbers for the table.
    pub fn numbers(&self) -> Numbers {
        let of = |number: fn(Mean) -> Option<f64>| self.mean.and_then(number);
        let (mean, sd) = (of(|mean| Some(mean.value)), of(|mean| mean.standard_deviation));
        let (se, restricted_to) = (of(|mean| mean.standard_error), of(|mean| mean.restricted_to));
        let restricted =
            "time to which the mean is restricted, a lower bound then, since the last members are censored";
        let moments = [
            Statistic { name: "mean", value: mean, meaning: "mean, by Kaplan–Meier" },
            Statistic { name: "sd", value: sd, meaning: "standard deviation" },
            Statistic { name: "se", value: se, meaning: "standard error of the mean" },
            Statistic { name: "restricted_to", value: restricted_to, meaning: restricted },
        ];
        let places = places(self.quantiles, self.interval);
        Numbers { known: self.sample.events(), named: moments.into_iter().chain(places).collect() }
    }

    /// Time by which half of the members have had the event.
    pub fn median(&self) -> Option<f64> {
        let [_, _, median, ..] = self.quantiles;
        median
    }

    /// The interval of the median, if both its ends are known.
    pub fn bounds(&self) -> Option<(f64, f64)> {
        self.interval.and_then(|Interval { lower, upper, .. }| Some((lower?, upper?)))
    }
}

impl Numbers {
    /// Returns the number called `name`, if known.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.named.iter().find(|statistic| statistic.name == name).and_then(|statistic| statistic.value)
    }
}

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(1 + self.named.len()))?;
        map.serialize_entry("known", &self.known)?;
        self.named.iter().try_for_each(|Statistic { name, value, .. }| map.serialize_entry(name, value))?;
        map.end()
    }
}

/// Quantiles, and the interval of the median.
pub(super) fn places(
    quantiles: [Option<f64>; QUANTILES.len()],
    interval: Option<Interval>,
) -> impl Iterator<Item = Statistic> {
    let [lower, upper] = interval.map_or([None, None], |interval| [interval.lower, interval.upper]);
    let ends = [
        Statistic { name: "median_low", value: lower, meaning: "lower end of the 95 % interval of the median" },
        Statistic { name: "median_high", value: upper, meaning: "upper end of the 95 % interval of the median" },
    ];
    let quantiles = QUANTILES.into_iter().zip(quantiles);
    quantiles.map(|((_, name, meaning), value)| Statistic { name, value, meaning }).chain(ends)
}
