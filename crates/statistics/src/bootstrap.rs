//! The uncertainty of the median: the bootstrap's percentile interval.
//!
//! A resample is n members drawn with replacement, each with its time and its censoring. Only *how often* each is drawn
//! matters, and these numbers are multinomial. So a resample is not drawn member by member and sorted. Instead, the
//! sorted sample is halved recursively, and a binomial number gives the draws in the left half:
//!
//! - A range of events only, or of censorings only, needs just its number of draws, since the Kaplan–Meier product
//!   telescopes. It is halved further only if the median falls into it.
//! - A short range of both is drawn member by member.
//! - Nothing beyond the median is drawn.
//!
//! The law is that of drawing with replacement, to a millionth of each probability. If members are censored only at
//! the end of the run, a resample takes about log₂ n binomials instead of n draws.

use std::ops::Range;

use super::{
    Description, describe,
    draws::Draws,
    sample::{Sample, reaches},
};
use curvelax_base::threads;

/// Settings for resampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bootstrap {
    /// Number of resamples; with 1000, the ends of a 95 % interval are off by about 4 % of its half-width.
    pub resamples: u32,
    /// Coverage probability of the interval, in (0, 1).
    pub level: f64,
    /// Equal seeds give equal intervals, whatever the number of threads.
    pub seed: u64,
}

impl Default for Bootstrap {
    fn default() -> Bootstrap {
        Bootstrap { resamples: 1000, level: 0.95, seed: 1 }
    }
}

/// An interval for the median, in the unit of the times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Its lower end; `None` if even that many resamples have no median.
    pub lower: Option<f64>,
    /// Its upper end; `None` if it is open, because too many resamples have no median.
    pub upper: Option<f64>,
    /// Resamples whose S stays above ½. They count as larger than all others.
    pub unreached: usize,
}

impl Bootstrap {
    /// Returns the percentile interval of the Kaplan–Meier median.
    ///
    /// Its ends are quantiles of the resamples' medians, of type 7. `None` for fewer than two members, without an
    /// event, without resamples, and for a level outside (0, 1).
    pub fn median(&self, sample: &Sample) -> Option<Interval> {
        self.interval(&Ranges::new(sample), |place| sample.range(place..place + 1).next().map(|seen| seen.time))
    }

    /// Returns the interval for complete data; the median of a resample is its middle value, the lower of two.
    pub fn median_of(&self, values: &Description) -> Option<Interval> {
        self.interval(&Ranges::complete(values.count()), |place| values.sorted().get(place).copied())
    }

    /// The interval, where `value` gives the value at a place.
    fn interval(&self, ranges: &Ranges, value: impl Fn(usize) -> Option<f64> + Sync) -> Option<Interval> {
        let has_median = ranges.members > 1 && ranges.events(&(0..ranges.members)) > 0;
        if !has_median || self.resamples == 0 || !(self.level > 0.0 && self.level < 1.0) {
            return None;
        }
        let median = |resample: u32| ranges.median(Draws::new(self.seed, resample.into())).and_then(&value);
        let mut medians = threads::map(self.resamples, |resample| median(resample).unwrap_or(f64::INFINITY));
        medians.sort_unstable_by(f64::total_cmp);
        let end = |p| describe::quantile(&medians, p);
        let outside = 0.5 * (1.0 - self.level);
        let unreached = medians.len() - medians.partition_point(|median| median.is_finite());
        Some(Interval { lower: end(outside), upper: end(1.0 - outside), unreached })
    }
}

/// Places of a sorted sample, with quick access to the number of events in any range.
struct Ranges<'a> {
    members: usize,
    /// The sample if some members are censored, and the number of events before every [`BLOCK`]-th place.
    censored: Option<(&'a Sample, Vec<usize>)>,
    /// Maximum length of a range of both kinds that is drawn member by member.
    short: usize,
}

impl Ranges<'_> {
    fn complete(members: usize) -> Ranges<'static> {
        Ranges { members, censored: None, short: SHORT }
    }

    fn new(sample: &Sample) -> Ranges<'_> {
        let complete = Ranges::complete(sample.len());
        if sample.censored() == 0 {
            return complete;
        }
        let mut before = 0;
        let blocks = (0..=sample.len() / BLOCK).map(|block| {
            let here = before;
            before += events(sample, block * BLOCK..((block + 1) * BLOCK).min(sample.len()));
            here
        });
        Ranges { censored: Some((sample, blocks.collect())), ..complete }
    }

    fn events(&self, range: &Range<usize>) -> usize {
        let Some((sample, blocks)) = &self.censored else { return range.len() };
        let before = |place: usize| blocks[place / BLOCK] + events(sample, place - place % BLOCK..place);
        before(range.end) - before(range.start)
    }

    /// The place of the median of one resample, if its S comes down to ½.
    fn median(&self, draws: Draws) -> Option<usize> {
        let n = self.members;
        let curve = SurvivalPoint { survival: 1.0, at_risk: n as f64 };
        let mut resample = Resample { ranges: self, draws, curve, counts: Vec::new() };
        resample.crossing(0..n, n)
    }
}

fn events(sample: &Sample, range: Range<usize>) -> usize {
    sample.range(range).filter(|seen| seen.happened).count()
}

/// S and the members at risk, before the current range.
#[derive(Clone, Copy)]
struct SurvivalPoint {
    survival: f64,
    at_risk: f64,
}

impl SurvivalPoint {
    /// The point after `events` at times without censorings in between, among `leaving` members in all.
    ///
    /// Branch-free, since a resample is unpredictable; with none at risk, S is unchanged.
    fn after(self, events: f64, leaving: f64) -> SurvivalPoint {
        let at_risk = self.at_risk.max(1.0);
        SurvivalPoint { survival: self.survival * ((at_risk - events) / at_risk), at_risk: self.at_risk - leaving }
    }

    fn is_half_down(self) -> bool {
        reaches(self.survival, 0.5)
    }
}

/// A resample up to the current range.
struct Resample<'a> {
    ranges: &'a Ranges<'a>,
    draws: Draws,
    curve: SurvivalPoint,
    /// How often each member of a short range was drawn.
    counts: Vec<u32>,
}

impl Resample<'_> {
    /// Distributes `count` draws over the range, up to the member whose event brings S down to ½.
    fn crossing(&mut self, range: Range<usize>, count: usize) -> Option<usize> {
        if count == 0 {
            return None;
        }
        let events = self.ranges.events(&range);
        if events == 0 || events == range.len() {
            let after = self.curve.after(if events == 0 { 0.0 } else { count as f64 }, count as f64);
            if !after.is_half_down() {
                self.curve = after;
                return None;
            }
            if events == 1 {
                return Some(range.start);
            }
        } else if let Some((sample, _)) = self.ranges.censored.as_ref().filter(|_| range.len() <= self.ranges.short) {
            return self.short_crossing(sample, range, count);
        }
        let middle = range.start + range.len() / 2;
        let left = self.draws.binomial(count, (middle - range.start) as f64 / range.len() as f64);
        self.crossing(range.start..middle, left).or_else(|| self.crossing(middle..range.end, count - left))
    }

    fn short_crossing(&mut self, sample: &Sample, range: Range<usize>, count: usize) -> Option<usize> {
        self.counts.clear();
        self.counts.resize(range.len(), 0);
        self.draws.scatter(count, &mut self.counts);
        let mut curves = sample.range(range.clone()).zip(&self.counts).scan(self.curve, |curve, (seen, count)| {
            let leaving = f64::from(*count);
            *curve = curve.after(f64::from(u8::from(seen.happened)) * leaving, leaving);
            Some(*curve)
        });
        // The curve only falls: if it is not down at the end of the range it never was, so nothing before needs
        // checking.
        let after = curves.clone().last()?;
        if after.is_half_down() {
            return curves.position(SurvivalPoint::is_half_down).map(|i| range.start + i);
        }
        self.curve = after;
        None
    }
}

/// More would not fit the nearest cache with their numbers; fewer would cost more binomials.
const SHORT: usize = 4096;
/// Members between stored event counts.
const BLOCK: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{KaplanMeier, Observation};
    use curvelax_base::random::Stream;

    const RESAMPLES: u32 = 20_000;

    /// Exponential times, each censored with probability `censored`, and at `end` if not below it.
    fn sample(members: u64, censored: f64, end: f64) -> Sample {
        let seen = |index| {
            let [u, v] = Stream::new(5, index, 0).uniforms(0);
            let time = (-u.ln()).min(end);
            Observation { time, happened: v > censored && time < end }
        };
        Sample::new((0..members).map(seen)).unwrap()
    }

    /// Medians of resamples, in order; ranges up to `short` are drawn member by member.
    fn medians(sample: &Sample, short: usize) -> Vec<f64> {
        let ranges = Ranges { short, ..Ranges::new(sample) };
        let times: Vec<f64> = sample.observations().map(|seen| seen.time).collect();
        sorted((0..RESAMPLES.into()).map(|i| ranges.median(Draws::new(9, i)).map(|place| times[place])))
    }

    fn sorted(medians: impl Iterator<Item = Option<f64>>) -> Vec<f64> {
        let mut medians: Vec<f64> = medians.map(|median| median.unwrap_or(f64::INFINITY)).collect();
        medians.sort_unstable_by(f64::total_cmp);
        medians
    }

    /// Medians of resamples drawn member by member, sorted and estimated like any sample.
    fn plain_medians(sample: &Sample) -> Vec<f64> {
        let (n, observations) = (sample.len(), sample.observations().collect::<Vec<_>>());
        let draw = |i: u64| {
            let index = |draw| (Stream::new(10, i, 0).uniforms(draw)[0] * n as f64) as usize;
            let drawn = (0..n as u32).map(|draw| observations[index(draw)]);
            KaplanMeier::new(&Sample::new(drawn).unwrap()).median()
        };
        sorted((0..RESAMPLES.into()).map(draw))
    }

    /// Largest difference between two empirical distributions of equal size.
    fn distance(a: &[f64], b: &[f64]) -> f64 {
        let up_to = |all: &[f64], t: f64| all.partition_point(|median| *median <= t) as f64;
        a.iter().chain(b).map(|t| (up_to(a, *t) - up_to(b, *t)).abs()).fold(0.0, f64::max) / a.len() as f64
    }

    /// Kolmogorov–Smirnov distance that two samples of this size exceed once in 10⁵.
    fn chance() -> f64 {
        2.47 * (2.0 / f64::from(RESAMPLES)).sqrt()
    }

    #[test]
    fn halving_draws_the_same_law_as_drawing_member_by_member() {
        for (censored, end) in [(0.0, 9.0), (0.3, 9.0), (0.1, 0.8), (0.8, 9.0)] {
            let sample = sample(31, censored, end);
            let plain = plain_medians(&sample);
            for short in [1, 4, SHORT] {
                let apart = distance(&medians(&sample, short), &plain);
                assert!(apart < chance(), "seeds 5, 9, 10: {censored} {end} {short}: {apart}");
            }
        }
        let [one, other] = [0.3, 0.1].map(|censored| medians(&sample(31, censored, 9.0), SHORT));
        assert!(distance(&one, &other) > chance(), "blind");
    }

    #[test]
    fn medians_of_a_complete_sample_follow_the_binomial_law() {
        let n = 1001;
        let (sample, mut random) = (sample(n, 0.0, f64::INFINITY), Draws::new(11, 0));
        let (found, times) = (medians(&sample, SHORT), sample.observations().collect::<Vec<_>>());
        // The median of a resample is at or before the k-th time if at least 501 draws are.
        for k in [470, 490, 501, 510, 530] {
            let share = found.partition_point(|t| *t <= times[k - 1].time) as f64;
            let reached = (0..RESAMPLES).filter(|_| random.binomial(n as usize, k as f64 / n as f64) >= 501).count();
            let apart = (share - reached as f64).abs() / f64::from(RESAMPLES);
            assert!(apart < 4.5 * (0.5 / f64::from(RESAMPLES)).sqrt(), "seeds 5, 9, 11: {k}: {apart}");
        }
    }

    #[test]
    fn without_censorings_before_the_median_a_resample_takes_few_random_numbers() {
        for end in [f64::INFINITY, 1.0] {
            let (sample, n) = (sample(100_003, 0.0, end), 100_003);
            let (ranges, curve) = (Ranges::new(&sample), SurvivalPoint { survival: 1.0, at_risk: n as f64 });
            let mut resample = Resample { ranges: &ranges, draws: Draws::new(1, 0), curve, counts: Vec::new() };
            assert!(resample.crossing(0..n, n).is_some());
            // At most one per level of the tree.
            assert!(resample.draws.blocks() <= 17, "{end}: {}", resample.draws.blocks());
        }
    }

    #[test]
    fn too_little_to_resample_is_none() {
        let bootstrap = Bootstrap::default();
        let of = |seen: &[(f64, bool)]| {
            Sample::new(seen.iter().map(|&(time, happened)| Observation { time, happened })).unwrap()
        };
        for seen in [&[][..], &[(1.0, true)], &[(1.0, false), (2.0, false)]] {
            assert_eq!(bootstrap.median(&of(seen)), None, "{seen:?}");
        }
        let two = of(&[(1.0, true), (2.0, true)]);
        assert!(bootstrap.median(&two).is_some());
        for level in [0.0, 1.0, -1.0, f64::NAN] {
            assert_eq!(Bootstrap { level, ..bootstrap }.median(&two), None, "{level}");
        }
        assert_eq!(Bootstrap { resamples: 0, ..bootstrap }.median(&two), None);
    }

    #[test]
    fn complete_data_have_the_interval_of_a_sample_without_censorings() {
        let sample = sample(1001, 0.0, f64::INFINITY);
        let times = || sample.observations().map(|seen| seen.time);
        let of = |values: Vec<f64>| Bootstrap::default().median_of(&Description::new(values).unwrap());
        assert_eq!(of(times().collect()), Bootstrap::default().median(&sample));
        let moved = of(times().map(|t| t - 8.0).collect()).unwrap();
        let back = [moved.lower, moved.upper].map(|end| end.unwrap() + 8.0);
        let still = of(times().collect()).unwrap();
        assert!((back[0] - still.lower.unwrap()).abs() < 1e-14 && (back[1] - still.upper.unwrap()).abs() < 1e-14);
        assert_eq!([of(vec![]), of(vec![1.0])], [None, None]);
    }

    #[test]
    fn equal_times_have_an_interval_without_width() {
        let equal = Sample::new([Observation { time: 0.3, happened: true }; 9]).unwrap();
        let interval = Interval { lower: Some(0.3), upper: Some(0.3), unreached: 0 };
        assert_eq!(Bootstrap::default().median(&equal), Some(interval));
    }

    #[test]
    fn an_interval_is_open_where_resamples_do_not_reach_their_median() {
        let some = Bootstrap::default().median(&sample(60, 0.0, 0.8)).unwrap();
        assert!(some.lower.is_some() && some.upper.is_none() && some.unreached > 25, "{some:?}");
        let nearly_all = Bootstrap::default().median(&sample(60, 0.0, 0.3)).unwrap();
        assert_eq!((nearly_all.lower, nearly_all.upper, nearly_all.unreached > 975), (None, None, true));
    }

    #[test]
    fn the_interval_of_seed_1_never_changes() {
        let interval = Bootstrap::default().median(&sample(10_007, 0.3, 2.0)).unwrap();
        assert_eq!(
            (interval.lower, interval.upper, interval.unreached),
            (Some(0.9570141026000768), Some(1.022279972000998), 0)
        );
    }
}
