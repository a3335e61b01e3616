//! The product-limit estimate of Kaplan and Meier: the fraction of members without an event so far, with its
//! quantiles and its mean.

use super::{
    HALF_INTERVAL, finite,
    sample::{ProductLimit, ROUNDING, Sample, reaches},
    sum::Sum,
};

/// A time at which S falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The time.
    pub time: f64,
    /// Members at risk just before, including those censored at this very time.
    pub at_risk: usize,
    /// Events at this time, at least 1.
    pub events: usize,
    /// S from this time on.
    pub survival: f64,
    /// Greenwood's variance of S; 0 if S is 0, the limit.
    pub variance: f64,
}

impl Step {
    /// The 95 % band of S by Greenwood's variance, cut off at 0 and 1.
    pub fn band(&self) -> (f64, f64) {
        let bound = |sign: f64| (self.survival + sign * HALF_INTERVAL * self.variance.sqrt()).clamp(0.0, 1.0);
        (bound(-1.0), bound(1.0))
    }

    /// The decrease of S here, from `survival` before.
    fn fall_from(&self, survival: f64) -> f64 {
        survival * (self.events as f64 / self.at_risk as f64)
    }
}

/// The mean time, the area under S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// The mean: of t if S comes down to 0, else of min(t, `restricted_to`).
    pub value: f64,
    /// Standard deviation of a member's time, restricted likewise; without censoring that of the sample, with n - 1.
    /// `None` if S falls to 0 by a single event.
    pub standard_deviation: Option<f64>,
    /// Standard error of `value`; without censoring the standard deviation over √n. `None` likewise.
    pub standard_error: Option<f64>,
    /// The largest time, if S is not 0 there. The mean is then a lower bound of the members' mean time.
    pub restricted_to: Option<f64>,
}

/// The estimate of the survival function, a right-continuous step function from S = 1.
///
/// Nothing is stored next to the sample: each number passes through it once or twice.
impl Sample {
    /// Iterates over the steps of S, in order of time.
    pub fn steps(&self) -> impl Iterator<Item = Step> + '_ {
        let mut limit = ProductLimit::new(self.len());
        let mut left = self.len();
        self.times().filter_map(move |(time, events, censored)| {
            let at_risk = left;
            limit.events(events);
            let (survival, variance) = (limit.survival(), limit.variance());
            limit.censored(censored);
            left -= events + censored;
            (events > 0).then_some(Step { time, at_risk, events, survival, variance })
        })
    }

    /// Returns S(t), the fraction of members without an event by the time t; beyond the largest time its last value.
    pub fn survival(&self, t: f64) -> f64 {
        self.steps().take_while(|step| step.time <= t).last().map_or(1.0, |step| step.survival)
    }

    /// Returns the time by which the fraction `p` ∈ [0, 1] of the members has had the event: the first with S(t) ≤ 1 -
    /// p.
    ///
    /// If S is exactly 1 - p on an interval, this is the interval's start, as in lifelines and numpy's
    /// `inverted_cdf` (R's `survfit` uses its middle); equality means within 1e-12, so that rounding does not
    /// decide. `None` if S does not come down that far, and for any other p.
    pub fn quantile(&self, p: f64) -> Option<f64> {
        if !(0.0..=1.0).contains(&p) {
            return None;
        }
        self.steps().find(|step| reaches(step.survival, 1.0 - p)).map(|step| step.time)
    }

    /// Returns the [quantiles](Sample::quantile) of ascending fractions, in one pass, up to the first that is
    /// unknown.
    pub fn quantiles(&self, ascending: impl IntoIterator<Item = f64>) -> Vec<f64> {
        let mut steps = self.steps().peekable();
        let quantile = |p: f64| {
            while steps.next_if(|step| !reaches(step.survival, 1.0 - p)).is_some() {}
            steps.peek().map(|step| step.time)
        };
        ascending.into_iter().map_while(quantile).collect()
    }

    /// Returns the time by which half of the members have had the event.
    ///
    /// If S is exactly ½ between two events, this is the middle between them, as in R's `survfit`. Without censoring it
    /// is therefore the usual median, the mean of the two middle times of an even number. If no later event is known,
    /// it is the time of the last one.
    pub fn median(&self) -> Option<f64> {
        let mut steps = self.steps().skip_while(|step| !reaches(step.survival, 0.5));
        let first = steps.next()?;
        let is_half = first.survival >= 0.5 - ROUNDING;
        let next = steps.next().filter(|_| is_half);
        Some(next.map_or(first.time, |next| 0.5 * first.time + 0.5 * next.time))
    }

    /// Returns the mean time, restricted to the largest time if S does not come down to 0.
    ///
    /// With censoring the standard error is that of J. O. Irwin (1949), as in Kaplan and Meier and R's `survfit`:
    /// `var = Σ A_i² d_i/(n_i (n_i - d_i))`, A_i being the area under S from t_i on. `None` without an event, since
    /// all that is known then is that S was 1, or if the numbers are too large for f64.
    pub fn mean(&self) -> Option<Mean> {
        let (first, last) = (self.steps().next()?.time, self.last()?);
        // Each event contributes the fall of S, the end contributes the rest; measured from the first event, so that
        // equal times have exactly their own mean and no deviation.
        let (mut mean, mut area) = (Sum::default(), Sum::default());
        let (mut survival, mut before) = (1.0, first);
        for step in self.steps() {
            mean.add(step.fall_from(survival) * (step.time - first));
            area.add(survival * (step.time - before));
            (survival, before) = (step.survival, step.time);
        }
        mean.add(survival * (last - first));
        area.add(survival * (last - before));
        let value = first + mean.value();
        let [variance, area_variance] = self.variances(value, area);
        let n = self.len() as f64;
        let [deviation, error] = if self.has_single_event() {
            [None, None]
        } else if self.censored() > 0 {
            [variance, area_variance].map(Some)
        } else {
            [variance * (n / (n - 1.0)), variance / (n - 1.0)].map(Some)
        };
        Some(Mean {
            value: finite(value)?,
            standard_deviation: deviation.map(f64::sqrt).and_then(finite),
            standard_error: error.map(f64::sqrt).and_then(finite),
            restricted_to: (survival > 0.0).then_some(last),
        })
    }

    /// Variances of the times about their `mean`, and of the mean from the `area` under S from the first event on. The
    /// remaining area comes down to 0 without the rounding of all steps, since it is subtracted as it was added up.
    fn variances(&self, mean: f64, mut area: Sum) -> [f64; 2] {
        let (mut of_times, mut of_area) = (Sum::default(), Sum::default());
        let (mut survival, mut before) = (1.0, None);
        for step in self.steps() {
            of_times.add(step.fall_from(survival) * (step.time - mean).powi(2));
            area.add(before.map_or(0.0, |before| -survival * (step.time - before)));
            let (n, left) = (step.at_risk as f64, (step.at_risk - step.events) as f64);
            // The last event has no area behind it.
            if left > 0.0 {
                of_area.add(area.value().powi(2) * (step.events as f64 / (n * left)));
            }
            (survival, before) = (step.survival, Some(step.time));
        }
        if let Some(last) = self.last() {
            of_times.add(survival * (last - mean).powi(2));
        }
        [of_times, of_area].map(Sum::value)
    }

    /// Whether S falls by one event from 1 to 0, which says nothing about the spread of times.
    fn has_single_event(&self) -> bool {
        self.events() == 1 && self.steps().all(|step| step.survival == 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Observation;

    /// Times with `+` for censored.
    fn curve(times: &str) -> Sample {
        let seen = |word: &str| Observation {
            time: word.trim_end_matches('+').parse().unwrap(),
            happened: !word.ends_with('+'),
        };
        Sample::new(times.split_whitespace().map(seen)).unwrap()
    }

    #[test]
    fn where_the_curve_is_exactly_at_the_level_the_quantile_is_the_first_time() {
        assert_eq!(curve("1 2 3 4").quantile(0.5), Some(2.0));
        assert_eq!(curve("1 2 3 4 5").quantile(0.5), Some(3.0));
        // 1 - 0.9 is less than 1/10, 1 - 0.3 is less than 7/10, and a product with censoring is rounded.
        let ten = curve("1 2 3 4 5 6 7 8 9 10");
        assert_eq!([0.1, 0.3, 0.7, 0.9, 1.0].map(|p| ten.quantile(p)), [1.0, 3.0, 7.0, 9.0, 10.0].map(Some));
        // 4/5 · 3/4 is 3/5, then one is censored: 3/5 · 1/2 is 3/10.
        let censored = curve("1 2 2.5+ 3 4+");
        assert_eq!([0.4, 0.7, 0.70001].map(|p| censored.quantile(p)), [Some(2.0), Some(3.0), None]);
    }

    #[test]
    fn the_median_of_an_even_number_is_the_mean_of_the_two_in_the_middle() {
        let medians = ["1 2 4 8", "1 2 3 4 5", "1 5", "7", "2 2 2 9"].map(|times| curve(times).median());
        assert_eq!(medians, [3.0, 3.0, 3.0, 7.0, 2.0].map(Some));
        // S is 2/3, then two are censored: 2/3 · 3/4 is ½.
        assert_eq!(curve("1 2 3 3+ 3+ 4 5 6 7").median(), Some(4.5));
        // Nothing is known behind the second event.
        assert_eq!(["1 2 3+ 4+", "1 2+ 3+ 4+"].map(|times| curve(times).median()), [Some(2.0), None]);
    }

    #[test]
    fn quantiles_in_one_pass_are_those_one_by_one_up_to_the_first_that_is_unknown() {
        let times = (1..40_u32).map(|i| Observation { time: f64::from(i * i), happened: i % 7 > 0 && i < 35 });
        let survival = Sample::new(times).unwrap();
        let shares: Vec<f64> = (0..50).map(|i| (f64::from(i) + 0.5) / 50.0).collect();
        let one_by_one: Vec<f64> = shares.iter().map_while(|share| survival.quantile(*share)).collect();
        assert!(one_by_one.len() > 30 && one_by_one.len() < 50, "{}", one_by_one.len());
        assert_eq!(survival.quantiles(shares), one_by_one);
    }

    #[test]
    fn quantiles_outside_zero_and_one_are_none() {
        let curve = curve("1 2 3");
        assert_eq!([-0.1, 1.1, f64::NAN, f64::INFINITY].map(|p| curve.quantile(p)), [None; 4]);
        assert_eq!([0.0, 1.0].map(|p| curve.quantile(p)), [Some(1.0), Some(3.0)]);
    }

    #[test]
    fn the_survival_is_one_before_the_first_event_and_keeps_its_last_value() {
        let curve = curve("1 2 3+");
        assert_eq!([0.0, 0.999, 1.0, 2.5, 1e9].map(|t| curve.survival(t)), [1.0, 1.0, 2.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0]);
    }

    #[test]
    fn no_members_have_no_numbers() {
        let none = curve("");
        assert_eq!((none.median(), none.mean(), none.last(), none.survival(1.0)), (None, None, None, 1.0));
    }

    #[test]
    fn one_member_has_a_mean_and_nothing_about_its_spread() {
        let one = curve("0.3");
        let mean = Mean { value: 0.3, standard_deviation: None, standard_error: None, restricted_to: None };
        assert_eq!((one.median(), one.mean()), (Some(0.3), Some(mean)));
        // Nor does it if others were censored before.
        assert_eq!(curve("0.1+ 0.3").mean(), Some(mean));
    }

    #[test]
    fn censored_members_alone_have_no_mean_and_no_quantile() {
        for times in ["0.5+", "0.5+ 0.25+ 0.5+"] {
            let all = curve(times);
            assert!(all.mean().is_none() && all.median().is_none() && all.steps().next().is_none());
        }
    }

    #[test]
    fn a_complete_sample_has_fractions_of_its_members_to_the_last_bit() {
        let times: String = (0..49).map(|t| format!("{t} ")).collect();
        for (i, step) in curve(&times).steps().enumerate() {
            assert_eq!(step.survival, (48 - i) as f64 / 49.0);
        }
    }

    #[test]
    fn equal_times_have_their_own_mean_and_no_deviation() {
        for (events, censored) in (1..30).flat_map(|events| (0..30).map(move |censored| (events, censored))) {
            let mean = curve(&("0.1 ".repeat(events) + &"0.1+ ".repeat(censored))).mean().unwrap();
            let spread = (events + censored > 1).then_some(0.0);
            assert_eq!((mean.value, mean.standard_deviation, mean.standard_error), (0.1, spread, spread));
        }
        let tied = curve("0.1 0.1 0.1+");
        // The censored member was at risk at the time of the events.
        assert_eq!((tied.survival(0.1), tied.mean().unwrap().restricted_to), (1.0 / 3.0, Some(0.1)));
    }

    #[test]
    fn the_mean_is_a_lower_bound_where_the_last_member_is_censored() {
        let cut = curve("1 2+");
        let mean = cut.mean().unwrap();
        assert_eq!((mean.value, mean.standard_deviation, mean.restricted_to), (1.5, Some(0.5), Some(2.0)));
        assert_eq!(mean.standard_error, Some(0.125_f64.sqrt()));
        // The censored member counts through those that outlast it.
        let whole = curve("1+ 2 3");
        let mean = whole.mean().unwrap();
        assert_eq!((mean.value, mean.restricted_to), (2.5, None));
        assert_eq!(mean.standard_error, Some(0.125_f64.sqrt()));
    }

    #[test]
    fn numbers_too_large_are_none() {
        let large = curve("1e308 1e308 1e300+ 0");
        assert!(large.mean().is_some_and(|mean| mean.value.is_finite() && mean.standard_deviation.is_none()));
        assert!(large.mean().is_some_and(|mean| mean.standard_error.is_none()));
    }
}
