//! Intervals of quantiles, whatever the distribution of the times.
//!
//! # Theory
//!
//! Of n independent times the number B up to the quantile of p is binomial with n and p. The times of ranks l and u
//! thus hold it with the probability P(l ≤ B < u): the sign test (W. R. Thompson, *Ann. Math. Stat.* 7, 1936, 122). l
//! is the largest and u the smallest rank that leave at most 2.5 % on their side, so at least 95 % are covered. Where
//! no rank is that sure, the interval is open on this side. Where it would be open on both, as for the median of fewer
//! than 6 times, it is the range of all, which covers 1 - pⁿ - (1-p)ⁿ: of the median 1 - 2^(1-n).
//!
//! Where members are censored before rank u, the share S that has no event yet is bounded by the beta product (M. P.
//! Fay, E. H. Brittain and M. A. Proschan, *Biostatistics* 14, 2013, 723). At an event with Y members at risk, S falls
//! by a factor with the law Beta(Y, 1). So S is distributed as the product of these factors just after an event, and at
//! most by one more, with the members then at risk, before the next. As in their paper each product is replaced by the
//! beta law of its mean and variance. Ends are where its quantiles of 2.5 and 97.5 % come down to 1 - p. Without
//! censoring the product telescopes to the law of the sign test. The interval of R. Brookmeyer and J. Crowley
//! (*Biometrics* 38, 1982, 29) takes S as normal and covers too little for few members.

use super::{
    Description,
    sample::{Observation, Sample},
    special::beta_share,
};
use curvelax_base::interval::Interval;

/// Least probability that an interval covers, and that on each side of it.
const COVERAGE: f64 = 0.95;
const TAIL: f64 = 0.5 * (1.0 - COVERAGE);
/// Standard deviations beyond which a share of less than [`TAIL`] lies, whatever the law (Cantelli's inequality).
const FAR: f64 = 6.25;

/// Returns the interval of the quantile of `p` ∈ (0, 1) of some times; `None` below two members, for any other p, and
/// if nothing is known of either end.
pub fn of_sample(sample: &Sample, p: f64) -> Option<Interval> {
    let n = sample.len();
    let ranks = Ranks::new(n, p)?;
    let time = |place: usize| sample.range(place..place + 1).next().map(|seen| seen.time);
    let happened = |places: usize| sample.range(0..places).all(|seen| seen.happened);
    let interval = match (ranks.lower, ranks.upper) {
        (_, Some(upper)) if happened(upper) => ranks.interval(time),
        (_, None) if happened(n) => ranks.interval(time),
        // The largest time is not known.
        (None, None) => {
            let coverage = 1.0 - (1.0 - p).powi(n as i32);
            let range_of = (coverage < COVERAGE).then_some(n);
            Interval { lower: time(0), upper: None, coverage, range_of }
        }
        _ => {
            let [lower, upper] = [lower_end(sample, p), upper_end(sample, p)];
            Interval { lower, upper, coverage: COVERAGE, range_of: None }
        }
    };
    (interval.lower.is_some() || interval.upper.is_some()).then_some(interval)
}

/// Returns the interval of the quantile of `p` of complete data; `None` likewise.
pub fn of_values(values: &Description, p: f64) -> Option<Interval> {
    Some(Ranks::new(values.count(), p)?.interval(|place| values.sorted().get(place).copied()))
}

/// Ranks of the ends, from 1; `None` where no rank is sure enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ranks {
    n: usize,
    p: f64,
    pub(super) lower: Option<usize>,
    pub(super) upper: Option<usize>,
    coverage: f64,
}

impl Ranks {
    /// Those of the quantile of `p` ∈ (0, 1) among `n` values; `None` below two, and for any other p.
    pub(super) fn new(n: usize, p: f64) -> Option<Ranks> {
        if n < 2 || !(p > 0.0 && p < 1.0) {
            return None;
        }
        let [(lower, below), (from_above, above)] = [p, 1.0 - p].map(|p| sure_rank(n, p));
        let rank = |rank: usize| (rank > 0).then_some(rank);
        let upper = rank(from_above).map(|k| n + 1 - k);
        Some(Ranks { n, p, lower: rank(lower), upper, coverage: 1.0 - below - above })
    }

    /// The interval whose ends are the values at places from 0: the range if no rank is sure enough.
    fn interval(self, value: impl Fn(usize) -> Option<f64>) -> Interval {
        let Ranks { n, p, lower, upper, coverage } = self;
        if lower.is_none() && upper.is_none() {
            let coverage = 1.0 - p.powi(n as i32) - (1.0 - p).powi(n as i32);
            return Interval { lower: value(0), upper: value(n - 1), coverage, range_of: Some(n) };
        }
        let [lower, upper] = [lower, upper].map(|rank| rank.and_then(|rank| value(rank - 1)));
        Interval { lower, upper, coverage, range_of: None }
    }
}

/// The largest k with P(B < k) of at most [`TAIL`] for B binomial with n and p, and this probability.
fn sure_rank(n: usize, p: f64) -> (usize, f64) {
    // P(B ≤ j).
    let up_to = |j: usize| beta_share(1.0 - p, (n - j) as f64, (j + 1) as f64);
    let (mut low, mut high) = (0, n);
    while low < high {
        let middle = low + (high - low) / 2;
        if up_to(middle) <= TAIL { low = middle + 1 } else { high = middle }
    }
    (low, low.checked_sub(1).map_or(0.0, up_to))
}

/// The law of S as a beta law, by its first two moments.
#[derive(Clone, Copy, Debug)]
struct BetaProduct {
    mean: f64,
    square: f64,
}

impl BetaProduct {
    /// S = 1.
    const WHOLE: BetaProduct = BetaProduct { mean: 1.0, square: 1.0 };

    /// After an event among so many members at risk.
    fn after_one_of(self, at_risk: usize) -> BetaProduct {
        let at_risk = at_risk as f64;
        BetaProduct { mean: self.mean * (at_risk / (at_risk + 1.0)), square: self.square * (at_risk / (at_risk + 2.0)) }
    }

    fn variance(self) -> f64 {
        (self.square - self.mean * self.mean).max(0.0)
    }

    /// How far `level` is above the mean, if that is so far that the law does not matter.
    fn is_far_below(self, level: f64) -> Option<bool> {
        let above = level - self.mean;
        (above.abs() > FAR * self.variance().sqrt()).then_some(above > 0.0)
    }

    /// P(S ≤ `level`).
    fn share_up_to(self, level: f64) -> f64 {
        if let Some(below) = self.is_far_below(level) {
            return if below { 1.0 } else { 0.0 };
        }
        let sum = self.mean * (1.0 - self.mean) / self.variance() - 1.0;
        beta_share(level, self.mean * sum, (1.0 - self.mean) * sum)
    }
}

/// The laws of S from which the upper limits follow, just after each event.
fn after_events(sample: &Sample) -> impl Iterator<Item = (f64, BetaProduct)> + '_ {
    let n = sample.len();
    sample.observations().enumerate().filter(|(_, seen)| seen.happened).scan(BetaProduct::WHOLE, move |law, seen| {
        *law = law.after_one_of(n - seen.0);
        Some((seen.1.time, *law))
    })
}

/// The first time by which the quantile of `p` is reached with 97.5 %.
fn upper_end(sample: &Sample, p: f64) -> Option<f64> {
    first(after_events(sample), 1.0 - p, 1.0 - TAIL)
}

/// The last time before which it is not reached with 97.5 %: one at which somebody leaves.
fn lower_end(sample: &Sample, p: f64) -> Option<f64> {
    let n = sample.len();
    let leaving = sample.observations().enumerate().scan(BetaProduct::WHOLE, move |law, (place, seen)| {
        let Observation { time, happened } = seen;
        if happened {
            *law = law.after_one_of(n - place);
        }
        Some((time, law.after_one_of(n - place - 1)))
    });
    let from_start = BetaProduct::WHOLE.after_one_of(n).share_up_to(1.0 - p) <= TAIL;
    first(leaving.take_while(move |_| from_start), 1.0 - p, TAIL)
}

/// The first time at which S is at most `level` with a probability above `share`. Laws are of falling S.
fn first(laws: impl Iterator<Item = (f64, BetaProduct)>, level: f64, share: f64) -> Option<f64> {
    // Those that are near: some thousands of ten million.
    let mut near = Vec::new();
    for (time, law) in laws {
        match law.is_far_below(level) {
            Some(false) => {}
            None => near.push((time, law)),
            Some(true) => {
                near.push((time, law));
                break;
            }
        }
    }
    let at = near.partition_point(|(_, law)| law.share_up_to(level) <= share);
    near.get(at).map(|(time, _)| *time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HALF_INTERVAL;
    use curvelax_base::random::Stream;

    const SHARES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

    /// When a member is censored whose random number is this.
    type Censoring = fn(f64) -> f64;
    const NEVER: Censoring = |_| f64::INFINITY;
    const CENSORINGS: [Censoring; 5] =
        [|v| -2.0 * v.ln(), |v| -v.ln(), |v| 2.0 * v, |_| 4.0_f64.ln(), |_| (1.0_f64 / 0.6).ln()];

    /// Exponential times of mean 1.
    fn sample(members: u32, trial: u64, censoring: Censoring) -> Sample {
        let seen = |index| {
            let [u, v] = Stream::new(3, trial, members).uniforms(index);
            let (event, end) = (-u.ln(), censoring(v));
            Observation { time: event.min(end), happened: event <= end }
        };
        Sample::new((0..members).map(seen)).unwrap()
    }

    fn complete(times: &[f64]) -> Sample {
        Sample::new(times.iter().map(|time| Observation { time: *time, happened: true })).unwrap()
    }

    fn holds(interval: &Interval, t: f64) -> bool {
        interval.lower.is_none_or(|lower| lower <= t) && interval.upper.is_none_or(|upper| t <= upper)
    }

    /// Both ends one event further inside.
    fn narrower(sample: &Sample, of: &Interval) -> Interval {
        let events: Vec<f64> = sample.observations().filter(|seen| seen.happened).map(|seen| seen.time).collect();
        let lower = events.iter().copied().find(|t| *t > of.lower.unwrap_or(0.0));
        let upper = events.iter().copied().rev().find(|t| *t < of.upper.unwrap_or(f64::INFINITY));
        Interval { lower, upper, ..*of }
    }

    #[test]
    fn the_ranks_of_the_median_are_those_of_the_tables() {
        // n and k of the sign test at 95 %, as in W. J. Conover, Practical Nonparametric Statistics.
        for (n, k) in [(6, 1), (8, 1), (9, 2), (12, 3), (20, 6), (25, 8), (50, 18), (100, 40)] {
            let ranks = Ranks::new(n, 0.5).unwrap();
            assert_eq!((ranks.lower, ranks.upper), (Some(k), Some(n + 1 - k)), "{n}");
        }
        for n in [10_000_usize, 5_000_000] {
            let normal = 0.5 * n as f64 - 0.5 * 1.959964 * (n as f64).sqrt();
            assert!((Ranks::new(n, 0.5).unwrap().lower.unwrap() as f64 - normal).abs() < 2.0, "{n}");
        }
        // 71 times are not enough for a lower end of the 5 % quantile: 0.95^71 is above 2.5 %.
        assert_eq!([71, 73].map(|n| Ranks::new(n, 0.05).unwrap().lower), [None, Some(1)]);
        // By hand: 1 - 2·(1 + 8)/2^8 would be 93 %, 1 - 2/2^8 is 99.2 %.
        assert!((Ranks::new(8, 0.5).unwrap().coverage - (1.0 - 2.0 / 256.0)).abs() < 1e-14);
    }

    #[test]
    fn without_censoring_an_interval_covers_what_it_says() {
        const TRIALS: u64 = 1500;
        let (mut inside, mut all) = ([0_u64; 2], 0);
        for n in 4..=100 {
            for p in SHARES {
                let t = -(1.0 - p).ln();
                let (mut held, mut said, mut within) = (0, 1.0, 0);
                for trial in 0..TRIALS / 5 {
                    let sample = sample(n, trial, NEVER);
                    let Some(interval) = of_sample(&sample, p) else { panic!("{n} {p}") };
                    held += u64::from(holds(&interval, t));
                    within += u64::from(holds(&narrower(&sample, &interval), t));
                    said = interval.coverage;
                }
                let chance =
                    4.5 * (0.25_f64.min(said * (1.0 - said)) / (TRIALS / 5) as f64).sqrt() + 5.0 / TRIALS as f64;
                let share = held as f64 / (TRIALS / 5) as f64;
                assert!((share - said).abs() < chance, "seed 3: {n} {p}: {share}, not {said}");
                assert!(said >= COVERAGE || p == 0.5 && n < 6, "{n} {p}: {said}");
                if n >= 6 {
                    inside = [inside[0] + held, inside[1] + within];
                    all += TRIALS / 5;
                }
            }
        }
        let [held, within] = inside.map(|count| count as f64 / all as f64);
        assert!(held > 0.96 && within < 0.94, "seed 3: {held}; one rank narrower: {within}");
    }

    #[test]
    fn with_censoring_an_interval_covers_at_least_what_it_says() {
        const TRIALS: u64 = 30;
        for (design, censoring) in CENSORINGS.into_iter().enumerate() {
            let (mut all, mut missed, mut said, mut within, mut normal) = (0, [0_u64; 2], 0.0, 0_u64, 0_u64);
            for (n, p) in (4..=100).flat_map(|n| SHARES.map(|p| (n, p))) {
                let t = -(1.0 - p).ln();
                for trial in 0..TRIALS {
                    let sample = sample(n, trial, censoring);
                    let interval = of_sample(&sample, p).unwrap_or(Interval { lower: None, upper: None, ..WIDE });
                    missed[0] += u64::from(interval.lower.is_some_and(|lower| lower > t));
                    missed[1] += u64::from(interval.upper.is_some_and(|upper| upper < t));
                    within += u64::from(!holds(&narrower(&sample, &interval), t));
                    said += interval.coverage;
                    normal += u64::from(n <= 20 && p == 0.5 && !holds(&normal_interval(&sample), t));
                    all += 1;
                }
            }
            let share = |count: u64| count as f64 / all as f64;
            let [low, high] = missed.map(share);
            // A side misses 2.5 % at most, and as often as all claim in the mean.
            let allowed = 1.0 - said / all as f64;
            assert!(low < 0.025 && high < 0.025 && low + high < allowed, "seed 3: {design}: {low} {high}, {allowed}");
            assert!(low + high > 0.005, "seed 3: {design}: {low} {high} is idle");
            assert!(share(within) > 1.3 * (low + high), "seed 3: {design}: {} one event narrower", share(within));
            if design < 3 {
                // Brookmeyer and Crowley's, for the median of 4 to 20 members.
                let few = normal as f64 / (17 * TRIALS) as f64;
                assert!(few > 0.06, "seed 3: {design}: {few} by the normal law");
            }
        }
    }

    const WIDE: Interval = Interval { lower: None, upper: None, coverage: COVERAGE, range_of: None };

    /// Where S is within 1.96 of Greenwood's standard errors of ½.
    fn normal_interval(sample: &Sample) -> Interval {
        let near = |step: &crate::Step| (step.survival - 0.5).abs() <= HALF_INTERVAL * step.variance.sqrt();
        let steps: Vec<_> = sample.steps().collect();
        let lower = steps.iter().find(|step| near(step) || step.survival < 0.5).map(|step| step.time);
        let upper = steps.iter().find(|step| step.survival < 0.5 && !near(step)).map(|step| step.time);
        Interval { lower, upper, ..WIDE }
    }

    #[test]
    fn many_censored_members_have_the_interval_of_the_normal_law() {
        let sample = sample(20_000, 0, CENSORINGS[1]);
        let (found, normal) = (of_sample(&sample, 0.5).unwrap(), normal_interval(&sample));
        let [(low, high), (a, b)] = [found, normal].map(|interval| interval.bounds().unwrap());
        assert!((low - a).abs() < 0.03 * (b - a) && (high - b).abs() < 0.03 * (b - a), "{found:?} {normal:?}");
    }

    #[test]
    fn the_beta_law_is_that_of_the_product() {
        const DRAWS: u64 = 40_000;
        // Ten events of 24 members, others censored between them.
        let at_risk = [24_u32, 22, 21, 19, 16, 15, 13, 10, 8, 5];
        let law = at_risk.iter().fold(BetaProduct::WHOLE, |law, count| law.after_one_of(*count as usize));
        let drawn = |draw| -> f64 {
            let stream = Stream::new(4, draw, 0);
            at_risk.iter().zip(0..).map(|(count, i)| stream.uniforms(i)[0].powf(1.0 / f64::from(*count))).product()
        };
        let drawn: Vec<f64> = (0..DRAWS).map(drawn).collect();
        let apart = |law: BetaProduct| {
            let of = |level: f64| drawn.iter().filter(|share| **share <= level).count() as f64 / DRAWS as f64;
            [0.2, 0.3, 0.4, 0.5, 0.6]
                .map(|level| (of(level) - law.share_up_to(level)).abs())
                .into_iter()
                .fold(0.0, f64::max)
        };
        assert!(apart(law) < 0.01, "seed 4: {}", apart(law));
        assert!(apart(law.after_one_of(24)) > 0.03, "blind");
    }

    #[test]
    fn without_censoring_the_product_has_the_ends_of_the_sign_test() {
        for n in [6, 7, 25, 100, 613] {
            let sample = sample(n, 1, NEVER);
            for p in SHARES {
                let of_ranks = of_sample(&sample, p).unwrap();
                assert_eq!([lower_end(&sample, p), upper_end(&sample, p)], [of_ranks.lower, of_ranks.upper], "{n} {p}");
            }
        }
    }

    #[test]
    fn few_times_have_their_range_and_what_it_covers() {
        let range = |lower, upper, coverage| Some(Interval { lower, upper, coverage, range_of: Some(4) });
        assert_eq!(of_sample(&complete(&[0.3, 0.1, 0.4, 0.2]), 0.5), range(Some(0.1), Some(0.4), 0.875));
        let cut = |times: &[(f64, bool)]| {
            Sample::new(times.iter().map(|&(time, happened)| Observation { time, happened })).unwrap()
        };
        // The largest is not known if one is censored.
        let some = cut(&[(0.1, false), (0.2, true), (0.3, true), (0.4, true)]);
        assert_eq!(of_sample(&some, 0.5), range(Some(0.1), None, 0.9375));
        // One end with 1/32 on its side is surer than 95 %.
        let five = of_sample(&cut(&[(0.2, true), (0.3, true), (0.4, true), (0.5, false), (0.5, false)]), 0.5).unwrap();
        assert_eq!((five.lower, five.upper, five.coverage, five.range_of), (Some(0.2), None, 31.0 / 32.0, None));
        // No member relaxed, and still the median is not before.
        let none = of_sample(&cut(&[(0.7, false); 6]), 0.5).unwrap();
        assert_eq!((none.lower, none.upper, none.range_of), (Some(0.7), None, None));
        for sample in [cut(&[]), cut(&[(1.0, true)])] {
            assert_eq!(of_sample(&sample, 0.5), None);
        }
        for p in [0.0, 1.0, -1.0, f64::NAN] {
            assert_eq!(of_sample(&some, p), None, "{p}");
        }
    }

    #[test]
    fn equal_times_have_an_interval_without_width_and_rates_may_be_negative() {
        let equal = of_sample(&complete(&[0.3; 9]), 0.5).unwrap();
        assert_eq!(equal.bounds(), Some((0.3, 0.3)));
        let values = Description::new([-3.0, -1.0, -2.0, 5.0, 4.0, 6.0, 7.0]).unwrap();
        assert_eq!(of_values(&values, 0.5).unwrap().bounds(), Some((-3.0, 7.0)));
        assert_eq!(of_values(&Description::new([1.0]).unwrap(), 0.5), None);
    }
}
