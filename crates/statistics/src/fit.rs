//! One quantity against another: the least-squares line, and the power law as a line of logarithms.

use std::fmt::Debug;

use super::{finite, special::chi_square_tail, sum::Sum};
use curvelax_base::error::{Error, Result};

/// y = intercept + slope·x, with the smallest sum of squared distances in y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Slope, in units of y over x.
    pub slope: f64,
    /// Value at x = 0.
    pub intercept: f64,
    /// Fraction of the variance of y that the line explains; `None` if all y are equal and there is none.
    pub r2: Option<f64>,
    /// Standard error of the slope, from the residuals with n - 2; `None` below three points.
    pub slope_error: Option<f64>,
    /// Number of points.
    pub count: usize,
}

impl Line {
    /// Fits a line through points (x, y), in any order.
    ///
    /// An error names the first point that is not finite. `None` if no slope is defined: fewer than two different
    /// x, or sums beyond the range of f64.
    pub fn fit(points: &[(f64, f64)]) -> Result<Option<Line>> {
        require(points, |(x, y)| x.is_finite() && y.is_finite(), "a straight line", "finite")?;
        let even: Vec<(f64, f64, f64)> = points.iter().map(|(x, y)| (*x, *y, 1.0)).collect();
        let with_error = |LeastSquares { line, xx, residual, degrees }| Line {
            slope_error: (degrees > 0).then(|| (residual / degrees as f64 / xx).sqrt()).and_then(finite),
            ..line
        };
        Ok(LeastSquares::of(&even).map(with_error))
    }

    /// Returns the line's y at x.
    pub fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

/// y = factor·x^exponent, the line of ln y against ln x: errors in y count in proportion to y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// y at x = 1.
    pub factor: f64,
    /// The power of x.
    pub exponent: f64,
    /// Standard error of the exponent, from the residuals or, if the fit is weighted, from the errors of the points;
    /// `None` below three points without weights.
    pub exponent_error: Option<f64>,
    /// Fraction of the (weighted) variance of ln y that the law explains; `None` if all y are equal.
    pub r2: Option<f64>,
    /// Number of points.
    pub count: usize,
    /// Whether the law fits the points within their errors; `None` below three points, and without errors.
    pub goodness: Option<GoodnessOfFit>,
}

/// The test that points lie on a law up to their errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoodnessOfFit {
    /// χ², the sum of squared distances in units of the errors.
    pub statistic: f64,
    /// Points less parameters.
    pub degrees_of_freedom: usize,
    /// Probability of a statistic at least as large if the law holds; never 0, but the smallest normal number.
    pub p_value: f64,
}

impl PowerLaw {
    /// Fits a power law through points (x, y), in any order.
    ///
    /// An error names the first point that is not finite and positive. `None` if no exponent is defined: fewer than
    /// two different x, or a factor beyond the range of f64.
    pub fn fit(points: &[(f64, f64)]) -> Result<Option<PowerLaw>> {
        require(points, |(x, y)| [*x, *y].into_iter().all(is_positive), "a power law", "finite and positive")?;
        let logarithms: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
        Ok(Line::fit(&logarithms)?.and_then(|line| PowerLaw::of(line, None)))
    }

    /// Fits a power law through points (x, y, standard error of ln y), in any order, weighted by 1 over the squared
    /// errors.
    ///
    /// An error names the first point that is not finite and positive. `None` as for [`PowerLaw::fit`].
    pub fn weighted(points: &[(f64, f64, f64)]) -> Result<Option<PowerLaw>> {
        let good = |(x, y, error): &(f64, f64, f64)| [*x, *y, *error].into_iter().all(is_positive);
        require(points, good, "a power law", "finite and positive")?;
        let weighted: Vec<_> = points.iter().map(|(x, y, error)| (x.ln(), y.ln(), error.powi(-2))).collect();
        let law = |LeastSquares { line, xx, residual: statistic, degrees: degrees_of_freedom }| {
            let p_value = chi_square_tail(statistic, degrees_of_freedom.max(1));
            let goodness = GoodnessOfFit { statistic, degrees_of_freedom, p_value };
            let line = Line { slope_error: finite(xx.sqrt().recip()), ..line };
            PowerLaw::of(line, (degrees_of_freedom > 0).then_some(goodness))
        };
        Ok(LeastSquares::of(&weighted).and_then(law))
    }

    /// The law of a line of logarithms.
    fn of(line: Line, goodness: Option<GoodnessOfFit>) -> Option<PowerLaw> {
        let factor = finite(line.intercept.exp()).filter(|factor| *factor > 0.0)?;
        let Line { slope: exponent, slope_error: exponent_error, r2, count, .. } = line;
        Some(PowerLaw { factor, exponent, exponent_error, r2, count, goodness })
    }

    /// Returns the law's y at x > 0.
    pub fn at(&self, x: f64) -> f64 {
        self.factor * x.powf(self.exponent)
    }
}

fn is_positive(v: f64) -> bool {
    v.is_finite() && v > 0.0
}

fn require<P: Debug>(points: &[P], good: impl Fn(&P) -> bool, fit: &str, asked: &str) -> Result<()> {
    let Some(i) = points.iter().position(|point| !good(point)) else { return Ok(()) };
    let (count, point) = (points.len(), &points[i]);
    Err(Error::Failed(format!(
        "fit of {fit}: point {i} (from 0) of {count} is {point:?}; each number must be {asked}: leave the point out"
    )))
}

/// A line through weighted points, still without the error of its slope, and what that follows from.
struct LeastSquares {
    line: Line,
    /// Weighted sum of the squared distances in x from the mean.
    xx: f64,
    /// The same in y from the line.
    residual: f64,
    /// Points less parameters.
    degrees: usize,
}

impl LeastSquares {
    /// The line through points (x, y, weight).
    fn of(points: &[(f64, f64, f64)]) -> Option<LeastSquares> {
        let sum = |term: &dyn Fn((f64, f64, f64)) -> f64| points.iter().map(|p| term(*p)).collect::<Sum>().value();
        let weight = sum(&|(.., w)| w);
        // From the first point, so that equal numbers have exactly their own mean.
        let (x_first, y_first, _) = *points.first()?;
        let x_mean = x_first + sum(&|(x, _, w)| w * (x - x_first)) / weight;
        let y_mean = y_first + sum(&|(_, y, w)| w * (y - y_first)) / weight;
        let about = |term: &dyn Fn(f64, f64) -> f64| sum(&|(x, y, w)| w * term(x - x_mean, y - y_mean));
        let (xx, xy, yy) = (about(&|x, _| x * x), about(&|x, y| x * y), about(&|_, y| y * y));
        if !(xx > 0.0 && [xx, xy, yy].iter().all(|sum| sum.is_finite())) {
            return None;
        }
        let slope = finite(xy / xx)?;
        let residual = about(&|x, y| (y - slope * x).powi(2));
        let intercept = finite(y_mean - slope * x_mean)?;
        let r2 = (yy > 0.0).then(|| (1.0 - residual / yy).clamp(0.0, 1.0));
        let line = Line { slope, intercept, r2, slope_error: None, count: points.len() };
        Some(LeastSquares { line, xx, residual, degrees: points.len().saturating_sub(2) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_give_it_back() {
        let points = [(0.0, 1.0), (1.0, 3.0), (4.0, 9.0)];
        let line = Line { slope: 2.0, intercept: 1.0, r2: Some(1.0), slope_error: Some(0.0), count: 3 };
        let found = Line::fit(&points).unwrap().unwrap();
        assert!((found.slope - 2.0).abs() < 1e-15 && (found.intercept - 1.0).abs() < 1e-15, "{found:?}");
        assert!(found.r2 > Some(1.0 - 1e-15) && found.slope_error < Some(1e-15), "{found:?}");
        assert_eq!((line.at(5.0), found.count), (11.0, 3));
    }

    #[test]
    fn too_few_points_have_no_line_and_two_have_no_error() {
        assert_eq!(Line::fit(&[]).unwrap(), None);
        assert_eq!(Line::fit(&[(1.0, 2.0)]).unwrap(), None);
        assert_eq!(Line::fit(&[(1.0, 2.0), (1.0, 3.0), (1.0, 4.0)]).unwrap(), None);
        let two = Line::fit(&[(1.0, 2.0), (2.0, 4.0)]).unwrap().unwrap();
        assert_eq!((two.slope, two.intercept, two.r2, two.slope_error), (2.0, 0.0, Some(1.0), None));
        assert_eq!(PowerLaw::fit(&[(2.0, 1.0)]).unwrap(), None);
    }

    #[test]
    fn equal_values_have_a_level_line_that_explains_nothing() {
        let level = Line::fit(&[(1.0, 0.1), (2.0, 0.1), (4.0, 0.1)]).unwrap().unwrap();
        assert_eq!((level.slope, level.intercept, level.r2, level.slope_error), (0.0, 0.1, None, Some(0.0)));
    }

    #[test]
    fn a_power_law_gives_its_exponent_and_factor() {
        let points: Vec<(f64, f64)> = (1..6).map(|i| (f64::from(i), 0.5 * f64::from(i).powi(-3))).collect();
        let law = PowerLaw::fit(&points).unwrap().unwrap();
        assert!((law.exponent + 3.0).abs() < 1e-14 && (law.factor - 0.5).abs() < 1e-14, "{law:?}");
        assert!((law.at(2.0) - 0.0625).abs() < 1e-15 && law.exponent_error < Some(1e-14) && law.count == 5);
    }

    #[test]
    fn a_weighted_law_is_that_of_repeated_points() {
        // A point of weight 3 counts as three points.
        let once = [(1.0, 2.0), (2.0, 3.0), (4.0, 9.0), (8.0, 10.0)];
        let weights = [1.0, 3.0, 2.0, 1.0];
        let repeated: Vec<(f64, f64)> =
            once.iter().zip(weights).flat_map(|(point, weight)| vec![*point; weight as usize]).collect();
        let errors = once.iter().zip(weights).map(|((x, y), weight): (_, f64)| (*x, *y, weight.sqrt().recip()));
        let errors: Vec<(f64, f64, f64)> = errors.collect();
        let found = PowerLaw::weighted(&errors).unwrap().unwrap();
        let expected = PowerLaw::fit(&repeated).unwrap().unwrap();
        assert!((found.exponent - expected.exponent).abs() < 1e-14 && (found.factor - expected.factor).abs() < 1e-14);
        assert!((found.r2.unwrap() - expected.r2.unwrap()).abs() < 1e-14, "{found:?} {expected:?}");
        // The residual variance of the seven points is χ²/5, so both errors follow from each other.
        let goodness = found.goodness.unwrap();
        let scaled = found.exponent_error.unwrap() * (goodness.statistic / 5.0).sqrt();
        assert!((scaled - expected.exponent_error.unwrap()).abs() < 1e-14 && goodness.degrees_of_freedom == 2);
        assert_eq!(goodness.p_value, chi_square_tail(goodness.statistic, 2));
        for bad in [(1.0, 1.0, 0.0), (1.0, 1.0, f64::NAN), (0.0, 1.0, 1.0), (1.0, -1.0, 1.0)] {
            let message = PowerLaw::weighted(&[(2.0, 2.0, 1.0), bad]).unwrap_err().to_string();
            assert!(message.contains("point 1 (from 0) of 2"), "{message}");
        }
        assert_eq!(PowerLaw::weighted(&[]).unwrap(), None);
    }

    #[test]
    fn points_that_do_not_fit_are_refused_by_their_place() {
        for point in [(f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            let message = Line::fit(&[(0.0, 0.0), point]).unwrap_err().to_string();
            assert!(message.contains("point 1 (from 0) of 2"), "{message}");
            assert!(PowerLaw::fit(&[(1.0, 1.0), point]).is_err());
        }
        for point in [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0)] {
            assert!(Line::fit(&[(2.0, 2.0), point]).is_ok());
            let message = PowerLaw::fit(&[(2.0, 2.0), point]).unwrap_err().to_string();
            assert!(message.contains("finite and positive"), "{message}");
        }
    }

    #[test]
    fn numbers_beyond_the_range_are_none() {
        assert_eq!(Line::fit(&[(1e300, 1.0), (-1e300, 2.0)]).unwrap(), None);
        assert_eq!(PowerLaw::fit(&[(1e-3, 1e-300), (1e-2, 1.0)]).unwrap(), None);
    }
}
