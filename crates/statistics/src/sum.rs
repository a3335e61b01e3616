//! Sums whose error does not grow with the number of terms: A. Neumaier's compensation (1974).

/// A running sum and its rounding error.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        let sum = self.sum + term;
        let (large, small) = if self.sum.abs() >= term.abs() { (self.sum, term) } else { (term, self.sum) };
        self.lost += (large - sum) + small;
        self.sum = sum;
    }

    /// Returns the sum, accurate to about one rounding unless its terms cancel.
    pub fn value(self) -> f64 {
        self.sum + self.lost
    }
}

impl FromIterator<f64> for Sum {
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Sum {
        let mut sum = Sum::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

/// Returns the mean of finite numbers, exact if all are equal; `None` without numbers or beyond the largest number.
pub fn mean(values: impl Iterator<Item = f64> + Clone) -> Option<f64> {
    let first = values.clone().next()?;
    let count = values.clone().count() as f64;
    super::finite(first + values.map(|value| value - first).collect::<Sum>().value() / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_terms_are_not_lost_beside_large_ones() {
        let terms = [1.0, 1e100, 1.0, -1e100];
        assert_eq!(terms.into_iter().collect::<Sum>().value(), 2.0);
        assert_eq!(terms.iter().sum::<f64>(), 0.0);
    }

    #[test]
    fn the_mean_of_equal_numbers_is_that_number() {
        for count in [1, 3, 10, 49] {
            assert_eq!(mean(vec![0.1; count].into_iter()), Some(0.1));
        }
        assert_eq!(mean([].into_iter()), None);
        assert_eq!(mean([f64::MAX, -f64::MAX].into_iter()), None);
    }
}
