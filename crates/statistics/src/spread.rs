//! Mean, deviation and quantiles of numbers that are not kept, and that may come in parts.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Moments;

/// Bins to an octave.
const PER_OCTAVE: i64 = 64;
/// Bits of the mantissa below those that number the bins of an octave.
const REST: u32 = f64::MANTISSA_DIGITS - 1 - PER_OCTAVE.trailing_zeros();

/// Sums and counts of numbers, from which follow their mean and deviation exactly, and their quantiles to 1 %: the
/// positive ones are counted in bins, 64 to an octave. No order and no grouping of the numbers matters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    moments: Moments,
    /// By the leading bits of the numbers, which ascend like the numbers themselves.
    bins: BTreeMap<u64, u64>,
    /// Numbers that are not positive, and taken for 0.
    others: u64,
}

impl Spread {
    /// Adds a number.
    pub fn add(&mut self, value: f64) {
        self.moments.add(value);
        match value > 0.0 {
            true => *self.bins.entry(value.to_bits() >> REST).or_default() += 1,
            false => self.others += 1,
        }
    }

    /// Adds the numbers of another instance.
    pub fn merge(&mut self, other: &Spread) {
        self.moments.merge(&other.moments);
        for (bin, count) in &other.bins {
            let own = self.bins.entry(*bin).or_default();
            *own = own.saturating_add(*count);
        }
        self.others = self.others.saturating_add(other.others);
    }

    /// Count, mean and deviation.
    pub fn moments(&self) -> &Moments {
        &self.moments
    }

    /// The number below which a share of all lies, the middle of its bin; `None` without numbers.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let mut left = (share * self.moments.count() as f64).ceil().max(1.0) as u64;
        if self.moments.count() == 0 {
            return None;
        }
        if left <= self.others {
            return Some(0.0);
        }
        left -= self.others;
        let bin = self.bins.iter().find(|(_, count)| {
            left = left.saturating_sub(**count);
            left == 0
        });
        let edge = |bin: u64| f64::from_bits(bin << REST);
        bin.map(|(bin, _)| 0.5 * (edge(*bin) + edge(bin.saturating_add(1)))).filter(|value| value.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(values: impl IntoIterator<Item = f64>) -> Spread {
        let mut spread = Spread::default();
        values.into_iter().for_each(|value| spread.add(value));
        spread
    }

    #[test]
    fn quantiles_are_right_to_a_hundredth_over_all_magnitudes() {
        for size in [1e-300, 1e-12, 1.0, 3e5, 1e300] {
            let all = spread((1..=10_000).map(|i| size * f64::from(i)));
            for share in [0.05, 0.25, 0.5, 0.95, 1.0] {
                let ratio = all.quantile(share).unwrap() / (size * 10_000.0 * share);
                assert!((ratio - 1.0).abs() < 0.009, "{share} of {size:e}: {ratio}");
            }
            let ratio = all.quantile(0.05).unwrap() / (size * 10_000.0 * 0.06);
            assert!((ratio - 1.0).abs() > 0.009, "the control: another quantile is told apart");
        }
    }

    #[test]
    fn numbers_that_are_not_positive_are_at_the_bottom() {
        let some = spread([-1.0, 0.0, 2.0, 4.0]);
        assert_eq!([0.25, 0.5].map(|share| some.quantile(share)), [Some(0.0); 2]);
        assert!((some.quantile(0.75).unwrap() / 2.0 - 1.0).abs() < 0.009);
        assert_eq!(spread([]).quantile(0.5), None);
        assert_eq!(spread([f64::INFINITY]).quantile(0.5), None);
    }

    #[test]
    fn parts_in_any_order_give_the_whole() {
        let values: Vec<f64> = (1..500).map(|i| (f64::from(i) * 0.7).sin() * 10f64.powi(i % 31 - 16)).collect();
        let mut parts = spread(values[200..].iter().rev().copied());
        parts.merge(&spread(values[..200].iter().copied()));
        assert_eq!(parts, spread(values.iter().copied()));
        assert_ne!(parts, spread(values[1..].iter().copied()));
    }
}
