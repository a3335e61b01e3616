//! Differences of pairs: their median with an exact interval, and the signed-rank test that they are centred on 0.
//!
//! F. Wilcoxon (*Biometrics Bull.* 1, 1945, 80) ranks the differences that are not 0 by size; W⁺ is the sum of the
//! ranks of the positive ones. If the differences are symmetric about 0, each rank is in W⁺ with probability ½:
//!
//! ```text
//! E W⁺ = ½ Σ r_i,    var W⁺ = ¼ Σ r_i²
//! ```
//!
//! Equal sizes share the mean of their ranks. Up to [`MAX_EXACT`] differences the distribution is counted, ties
//! included, since twice a rank is a whole number. For more it is normal, with a continuity correction of ½.

use super::{
    describe::quantile,
    interval::Ranks,
    special::{LEAST, normal_tails},
};
use curvelax_base::error::{Error, Result};

/// Maximum number of differences for which all signs are counted: 2⁵⁰ is exact in f64.
const MAX_EXACT: usize = 50;

/// What the differences of pairs say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairedDifferences {
    /// Number of pairs.
    pub pairs: usize,
    /// Of these, pairs without a difference.
    pub equal: usize,
    /// The median: the middle difference, or the mean of the two in the middle.
    pub median: Option<f64>,
    /// The 95 % interval of the median, by the ranks of the sign test. `None` below 6 pairs, for which none is that
    /// sure, and if all differences are equal, which are no draws.
    pub interval: Option<(f64, f64)>,
    /// The signed-rank test; `None` if all differences are equal: copies of one pair are not several.
    pub test: Option<SignedRank>,
}

/// Result of the signed-rank test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignedRank {
    /// Number of differences that are not 0; the others are left out.
    pub ranked: usize,
    /// W⁺.
    pub statistic: f64,
    /// Probability of a W⁺ at least as far from its mean, on both sides; never 0, but the smallest normal number.
    pub p_value: f64,
    /// Whether `p_value` is exact.
    pub exact: bool,
}

impl PairedDifferences {
    /// Those of differences in any order.
    ///
    /// An error names the first that is not finite.
    pub fn new(mut differences: Vec<f64>) -> Result<PairedDifferences> {
        let pairs = differences.len();
        if let Some(i) = differences.iter().position(|difference| !difference.is_finite()) {
            return Err(Error::Failed(format!(
                "statistics of pairs: difference {i} (from 0) of {pairs} is {}; only finite ones can be ranked: leave the \
                 pair out",
                differences[i]
            )));
        }
        differences.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
        let equal = differences.partition_point(|difference| *difference == 0.0);
        let alike = differences.iter().all(|difference| *difference == differences[0]);
        let test = if alike { None } else { signed_rank(&differences[equal..]) };
        differences.sort_unstable_by(f64::total_cmp);
        let ranks = Ranks::new(pairs, 0.5).filter(|_| test.is_some());
        let interval =
            ranks.and_then(|Ranks { lower, upper, .. }| Some((differences[lower? - 1], differences[upper? - 1])));
        Ok(PairedDifferences { pairs, equal, median: quantile(&differences, 0.5), interval, test })
    }
}

/// The test of differences that are not 0, sorted by size.
fn signed_rank(by_size: &[f64]) -> Option<SignedRank> {
    if by_size.is_empty() {
        return None;
    }
    // Twice the ranks, which are whole.
    let (mut positive, mut squares, mut before) = (0.0, 0.0, 0.0);
    let mut doubled = Vec::new();
    for tied in by_size.chunk_by(|a, b| a.abs() == b.abs()) {
        let count = tied.len() as f64;
        let rank = 2.0 * before + count + 1.0;
        before += count;
        squares += count * rank * rank;
        positive += rank * tied.iter().filter(|difference| **difference > 0.0).count() as f64;
        if by_size.len() <= MAX_EXACT {
            doubled.extend(tied.iter().map(|_| rank as usize));
        }
    }
    let exact = by_size.len() <= MAX_EXACT;
    let p_value = if exact {
        counted(&doubled, positive as usize)
    } else {
        let all = before * (before + 1.0);
        // Of twice W⁺: the mean is half the sum of all, the deviation half the root of the squares.
        let surplus = ((positive - 0.5 * all).abs() - 1.0).max(0.0);
        normal_tails(surplus / (0.25 * squares).sqrt())
    };
    Some(SignedRank { ranked: by_size.len(), statistic: 0.5 * positive, p_value: p_value.clamp(LEAST, 1.0), exact })
}

/// The probability that a sum of `numbers`, each taken with probability ½, is as far from its mean as `found`.
fn counted(numbers: &[usize], found: usize) -> f64 {
    let all: usize = numbers.iter().sum();
    let mut ways = vec![0.0; all + 1];
    ways[0] = 1.0;
    let mut reached = 0;
    for number in numbers {
        for sum in (0..=reached).rev() {
            ways[sum + number] += ways[sum];
        }
        reached += number;
    }
    // The distribution is symmetric, so the smaller tail has twice its probability on both sides.
    let tail: f64 = ways[..=found.min(all - found)].iter().sum();
    2.0 * tail * (-(numbers.len() as f64)).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(differences: &[f64]) -> PairedDifferences {
        PairedDifferences::new(differences.to_vec()).unwrap()
    }

    /// The probability by trying all signs, with W⁺ as it is defined.
    fn by_all_signs(differences: &[f64]) -> f64 {
        let known: Vec<f64> = differences.iter().copied().filter(|d| *d != 0.0).collect();
        let rank = |d: f64| {
            let less = known.iter().filter(|other| other.abs() < d.abs()).count() as f64;
            let tied = known.iter().filter(|other| other.abs() == d.abs()).count() as f64;
            less + 0.5 * (tied + 1.0)
        };
        let mean = 0.5 * known.iter().map(|d| rank(*d)).sum::<f64>();
        let far = |positive: &dyn Fn(usize) -> bool| {
            let sum: f64 = known.iter().enumerate().filter(|(i, _)| positive(*i)).map(|(_, d)| rank(*d)).sum();
            (sum - mean).abs()
        };
        let found = far(&|i| known[i] > 0.0);
        let signs = 1_u32 << known.len();
        let as_far = (0..signs).filter(|signs| far(&|i| signs >> i & 1 == 1) >= found - 1e-9).count();
        as_far as f64 / f64::from(signs)
    }

    #[test]
    fn a_small_p_value_is_the_share_of_all_signs() {
        let samples: [&[f64]; 7] = [
            &[1.0, -2.0],
            &[0.3, -0.1, 0.25, 0.7, -0.02, 0.9],
            &[1.0, 1.0, -1.0, 2.0, 2.0, -3.0, 0.0],
            &[-5.0, -4.0, -3.0, -2.0, -1.0],
            &[0.0, 0.0, 1.0, 2.0, -3.0, 4.0, 5.0, 6.0, 7.0, -8.0, 9.0],
            &[1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0],
            &[1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5, 9.5, 10.5, 11.5, -0.5],
        ];
        for differences in samples {
            let test = of(differences).test.unwrap();
            let expected = by_all_signs(differences);
            assert!(
                test.exact && (test.p_value / expected - 1.0).abs() < 1e-12,
                "{differences:?}: {test:?} {expected}"
            );
        }
        assert_ne!(of(samples[1]).test, of(&samples[1][1..]).test, "blind");
    }

    #[test]
    fn the_normal_distribution_takes_over_smoothly() {
        for share in [3, 4, 5, 7] {
            let differences = |n: i32| -> Vec<f64> {
                (1..=n).map(|i| f64::from(i) * if i % share == 0 { -1.0 } else { 1.0 }).collect()
            };
            let exact = of(&differences(50)).test.unwrap();
            let by_size: Vec<f64> = differences(51);
            let normal = of(&by_size).test.unwrap();
            assert!(exact.exact && !normal.exact);
            let counted = {
                let positive: f64 = by_size.iter().filter(|d| **d > 0.0).sum();
                super::counted(&(1..=51).map(|rank| 2 * rank).collect::<Vec<_>>(), 2 * positive as usize)
            };
            let apart = (normal.p_value.ln() - counted.ln()).abs();
            assert!(apart < 0.02 + 0.1 * counted.ln().abs(), "{share}: {normal:?}, not {counted}");
        }
    }

    #[test]
    fn ties_narrow_the_distribution() {
        // By hand: 60 differences of one size have the rank 30.5 each, so W⁺ is 30.5 times a binomial number.
        let differences: Vec<f64> = (0..60).map(|i| if i < 20 { -1.0 } else { 1.0 }).collect();
        let test = of(&differences).test.unwrap();
        let deviation = 30.5 * 15.0_f64.sqrt();
        assert_eq!((test.statistic, test.ranked), (40.0 * 30.5, 60));
        assert!((test.p_value / normal_tails((10.0 * 30.5 - 0.5) / deviation) - 1.0).abs() < 1e-12, "{test:?}");
    }

    #[test]
    fn differences_of_one_sign_are_seen() {
        let differences: Vec<f64> =
            (0..512).map(|i| 1e-6 * (1.0 + f64::from(i % 17)) * (1.0 + 1e-3 * f64::from(i))).collect();
        let found = of(&differences);
        assert!(found.test.unwrap().p_value < 1e-80, "{:?}", found.test);
        let mixed: Vec<f64> = differences.iter().zip([1.0, -1.0].iter().cycle()).map(|(d, sign)| d * sign).collect();
        assert!(of(&mixed).test.unwrap().p_value > 0.1, "{:?}", of(&mixed).test);
    }

    #[test]
    fn the_interval_of_the_median_has_the_ranks_of_the_sign_test() {
        assert_eq!(of(&[1.0, 2.0, 3.0, 4.0, 5.0]).interval, None);
        let ten = of(&[10.0, 2.0, 3.0, 1.0, 5.0, 4.0, 7.0, 9.0, 8.0, 6.0]);
        assert_eq!((ten.median, ten.interval), (Some(5.5), Some((2.0, 9.0))));
    }

    #[test]
    fn copies_and_nothing_are_not_tested() {
        for (differences, median) in [(&[][..], None), (&[0.0; 9][..], Some(0.0)), (&[0.25; 99][..], Some(0.25))] {
            let found = of(differences);
            assert_eq!((found.median, found.interval, found.test), (median, None, None), "{differences:?}");
        }
        assert_eq!((of(&[0.0, 1.0, 0.0]).equal, of(&[0.0, 1.0, 0.0]).test.unwrap().p_value), (2, 1.0));
        let message = PairedDifferences::new(vec![1.0, f64::NAN]).unwrap_err().to_string();
        assert!(message.contains("difference 1 (from 0) of 2 is NaN"), "{message}");
    }
}
