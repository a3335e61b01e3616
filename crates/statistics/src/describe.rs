//! Complete data in a few numbers: count, mean, deviation, quantiles.

use super::{
    finite,
    sum::{Sum, mean},
};
use curvelax_base::error::{Error, Result};

/// Finite numbers in order, with descriptive statistics in their own unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Description {
    sorted: Vec<f64>,
}

impl Description {
    /// Describes any number of values, in any order; an error names the first that is not finite.
    pub fn new(values: impl IntoIterator<Item = f64>) -> Result<Description> {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        if let Some(i) = sorted.iter().position(|value| !value.is_finite()) {
            return Err(Error::Failed(format!(
                "statistics: value {i} (from 0) of {} is {}; only finite values can be described: leave it out",
                sorted.len(),
                sorted[i]
            )));
        }
        sorted.sort_unstable_by(f64::total_cmp);
        Ok(Description { sorted })
    }

    /// Returns the values, smallest first.
    pub fn sorted(&self) -> &[f64] {
        &self.sorted
    }

    /// Returns the number of values.
    pub fn count(&self) -> usize {
        self.sorted.len()
    }

    /// Returns the mean; `None` without values, or beyond the range of f64.
    pub fn mean(&self) -> Option<f64> {
        mean(self.sorted.iter().copied())
    }

    /// Returns the standard deviation of the sample, with n - 1; `None` below two values, or beyond the range of f64.
    pub fn standard_deviation(&self) -> Option<f64> {
        let (mean, degrees) = (self.mean()?, self.count() - 1);
        if degrees == 0 {
            return None;
        }
        let squares: Sum = self.sorted.iter().map(|value| (value - mean).powi(2)).collect();
        finite((squares.value() / degrees as f64).sqrt())
    }

    /// Returns the standard error of the mean, the standard deviation over √n; `None` likewise.
    pub fn standard_error(&self) -> Option<f64> {
        self.standard_deviation().map(|deviation| deviation / (self.count() as f64).sqrt())
    }

    /// Returns the value below which the fraction `p` ∈ [0, 1] lies; `None` without values and for any other p.
    ///
    /// Linear between the order statistics at (n - 1)p: type 7 of R. J. Hyndman and Y. Fan (*Am. Stat.* 50, 1996, 361),
    /// the default of numpy and R.
    pub fn quantile(&self, p: f64) -> Option<f64> {
        quantile(&self.sorted, p)
    }

    /// Returns the middle value, or the mean of the two in the middle.
    pub fn median(&self) -> Option<f64> {
        self.quantile(0.5)
    }
}

/// Type 7 quantile of sorted values, the largest of which may be +∞; `None` if these would matter.
pub(super) fn quantile(sorted: &[f64], p: f64) -> Option<f64> {
    if sorted.is_empty() || !(0.0..=1.0).contains(&p) {
        return None;
    }
    let place = (sorted.len() - 1) as f64 * p;
    let (low, share) = (place.floor() as usize, place.fract());
    let (a, b) = (sorted[low], if share > 0.0 { sorted[low + 1] } else { sorted[low] });
    // As two products, since b - a may overflow; equal neighbours must give exactly themselves.
    finite(if a == b { a } else { a * (1.0 - share) + b * share })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Description {
        Description::new(values.iter().copied()).unwrap()
    }

    #[test]
    fn few_values_have_what_they_can_have() {
        let none = of(&[]);
        assert_eq!(
            (none.count(), none.mean(), none.standard_deviation(), none.standard_error(), none.median()),
            (0, None, None, None, None)
        );
        let one = of(&[2.0]);
        assert_eq!(
            (one.mean(), one.standard_deviation(), one.standard_error(), one.median()),
            (Some(2.0), None, None, Some(2.0))
        );
        let two = of(&[3.0, 1.0]);
        assert_eq!(
            (two.mean(), two.standard_deviation(), two.standard_error()),
            (Some(2.0), Some(2.0_f64.sqrt()), Some(1.0))
        );
        assert_eq!((two.median(), two.sorted()), (Some(2.0), &[1.0, 3.0][..]));
    }

    #[test]
    fn equal_values_have_no_deviation_and_are_all_their_quantiles() {
        let equal = of(&[0.1; 7]);
        assert_eq!(
            (equal.mean(), equal.standard_deviation(), equal.standard_error()),
            (Some(0.1), Some(0.0), Some(0.0))
        );
        assert!((0..=100).all(|p| equal.quantile(f64::from(p) / 100.0) == Some(0.1)));
    }

    #[test]
    fn quantiles_are_linear_between_values_and_end_at_the_extremes() {
        let values = of(&[10.0, 0.0, 30.0]);
        let levels = [0.0, 0.25, 0.5, 0.75, 1.0, -0.01, 1.01, f64::NAN];
        let expected = [Some(0.0), Some(5.0), Some(10.0), Some(20.0), Some(30.0), None, None, None];
        assert_eq!(levels.map(|p| values.quantile(p)), expected);
    }

    #[test]
    fn what_is_not_finite_goes_neither_in_nor_out() {
        for value in [f64::NAN, f64::INFINITY] {
            let message = Description::new([0.0, value]).unwrap_err().to_string();
            assert!(message.contains("value 1 (from 0) of 2"), "{message}");
        }
        let large = of(&[-f64::MAX, f64::MAX, f64::MAX]);
        assert_eq!((large.mean(), large.standard_deviation(), large.quantile(0.25)), (None, None, Some(0.0)));
        assert_eq!(of(&[1e200, -1e200]).standard_deviation(), None);
    }

    #[test]
    fn infinite_values_at_the_end_are_never_mixed_in() {
        let open = [1.0, 2.0, f64::INFINITY, f64::INFINITY];
        assert_eq!([0.0, 1.0 / 3.0, 0.4, 1.0].map(|p| quantile(&open, p)), [Some(1.0), Some(2.0), None, None]);
    }
}
