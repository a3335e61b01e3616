//! Sums that do not depend on the order of their terms: fixed-point numbers of 256 bits.
//!
//! Members may be added in any order and parts of an ensemble merged; the sum is the same to the last bit.

use serde::{Deserialize, Serialize};

/// The least significant bit is 2 to this power: far below the rounding of any excess and of its square.
const QUANTUM: i32 = -140;
/// Terms are below 2 to this power, so that 2³² of them fit.
const MOST: i32 = 83;
/// Relative difference below which a variance is the rounding left by equal numbers.
const EQUAL: f64 = 4.0 * f64::EPSILON;

/// A running sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExactSum {
    low: u128,
    high: i128,
    /// Whether a term was out of range, so that the sum is unknown.
    lost: bool,
}

impl ExactSum {
    /// Adds a term; its part below 2⁻¹⁴⁰ is cut off.
    pub fn add(&mut self, term: f64) {
        if term.is_nan() || term.abs() >= f64::from(MOST).exp2() {
            self.lost = true;
            return;
        }
        let bits = term.abs().to_bits();
        let exponent = (bits >> 52) as i32;
        // A subnormal number is far below the quantum.
        let mantissa = if exponent == 0 { 0 } else { u128::from(bits & ((1 << 52) - 1) | 1 << 52) };
        let shift = exponent - 1075 - QUANTUM;
        let (low, high) = match shift {
            ..=-64 => (0, 0),
            -63..=0 => (mantissa >> -shift, 0),
            1..=127 => (mantissa << shift, mantissa >> (128 - shift)),
            _ => (0, mantissa << (shift - 128)),
        };
        self.add_parts(low, high as i128, term < 0.0);
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &ExactSum) {
        self.lost |= other.lost;
        self.add_parts(other.low, other.high, false);
    }

    fn add_parts(&mut self, low: u128, high: i128, negative: bool) {
        let (low, high) = if negative { negated(low, high) } else { (low, high) };
        let (sum, carry) = self.low.overflowing_add(low);
        self.low = sum;
        self.high = self.high.wrapping_add(high).wrapping_add(carry.into());
    }

    /// Returns the sum, rounded; `None` if a term was not finite or was 2⁸³ or above.
    pub fn value(&self) -> Option<f64> {
        let negative = self.high < 0;
        let (low, high) = if negative { negated(self.low, self.high) } else { (self.low, self.high) };
        let size = high as f64 * f64::from(QUANTUM + 128).exp2() + low as f64 * f64::from(QUANTUM).exp2();
        (!self.lost).then_some(if negative { -size } else { size })
    }
}

fn negated(low: u128, high: i128) -> (u128, i128) {
    let (low, carry) = (!low).overflowing_add(1);
    (low, (!high).wrapping_add(carry.into()))
}

/// Count, mean and deviation of numbers of size 2⁻⁴⁰ to 2⁴⁰, whatever their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Moments {
    count: u64,
    sum: ExactSum,
    squares: ExactSum,
}

impl Moments {
    /// Adds a number.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        self.sum.add(value);
        self.squares.add(value * value);
    }

    /// Adds the numbers of another instance.
    pub fn merge(&mut self, other: &Moments) {
        self.count = self.count.saturating_add(other.count);
        self.sum.merge(&other.sum);
        self.squares.merge(&other.squares);
    }

    /// Returns the count.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the mean; `None` without numbers, or if one was out of range.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then_some(self.sum.value()? / self.count as f64)
    }

    /// Returns the standard deviation, with n - 1; `None` likewise, and for one number.
    pub fn deviation(&self) -> Option<f64> {
        let (mean, count) = (self.mean()?, self.count as f64);
        let (of_squares, squared) = (self.squares.value()? / count, mean * mean);
        let variance = of_squares - squared;
        let variance = if variance <= EQUAL * squared { 0.0 } else { variance };
        (self.count > 1).then(|| (variance * (count / (count - 1.0))).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(terms: &[f64]) -> ExactSum {
        let mut sum = ExactSum::default();
        terms.iter().for_each(|term| sum.add(*term));
        sum
    }

    #[test]
    fn no_order_and_no_grouping_changes_a_bit() {
        let terms: Vec<f64> = (1..2000).map(|i| (f64::from(i) * 0.7).sin() * 10f64.powi(i % 31 - 16)).collect();
        let mut backwards = terms.clone();
        backwards.reverse();
        assert_eq!(sum(&terms), sum(&backwards));
        let (mut first, second) = (sum(&terms[..777]), sum(&terms[777..]));
        first.merge(&second);
        assert_eq!(first, sum(&terms));
        // The control: floating-point sums differ.
        assert_ne!(terms.iter().sum::<f64>(), backwards.iter().sum::<f64>());
        assert_ne!(sum(&terms), sum(&terms[1..]));
    }

    #[test]
    fn sums_are_right_to_the_last_bit_or_two() {
        assert_eq!(sum(&[1.0, 2.0f64.powi(-100), -1.0]).value(), Some(2.0f64.powi(-100)));
        assert_eq!(sum(&[0.1; 10]).value(), Some(1.0));
        assert_eq!(sum(&[-3.5, 1.25]).value(), Some(-2.25));
        assert_eq!(sum(&[2.0f64.powi(82), 1.0, -(2.0f64.powi(82))]).value(), Some(1.0));
        assert_eq!(sum(&[1e-300, -1e-300, 2.0f64.powi(-139)]).value(), Some(2.0f64.powi(-139)));
        assert_eq!(sum(&[0.0, -0.0, f64::MIN_POSITIVE / 4.0]).value(), Some(0.0));
        for bad in [f64::NAN, f64::INFINITY, -1e30] {
            assert_eq!(sum(&[1.0, bad]).value(), None, "{bad}");
        }
    }

    #[test]
    fn moments_are_mean_and_standard_deviation() {
        let of = |values: &[f64]| {
            let mut moments = Moments::default();
            values.iter().for_each(|value| moments.add(*value));
            moments
        };
        assert_eq!((of(&[]).mean(), of(&[]).deviation(), of(&[2.0]).deviation()), (None, None, None));
        let three = of(&[2.0, 4.0, 9.0]);
        assert_eq!((three.count(), three.mean()), (3, Some(5.0)));
        assert!((three.deviation().unwrap() - 13.0_f64.sqrt()).abs() < 1e-14);
        assert_eq!(of(&[0.1; 7]).deviation(), Some(0.0));
        assert!(of(&[0.1, 0.1 + 1e-6]).deviation().unwrap() > 7e-7);
        let mut merged = of(&[2.0]);
        merged.merge(&of(&[9.0, 4.0]));
        assert_eq!(merged, three);
    }
}
