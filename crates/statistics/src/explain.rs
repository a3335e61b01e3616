//! How much of the variance of one quantity others explain, each alone and a few together.
//!
//! # Theory
//!
//! Alone: C. Spearman's rank correlation (*Am. J. Psychol.* 15, 1904, 72), the correlation of the ranks, where equal
//! numbers share the mean of their ranks; and R², the share of the variance that a straight line explains. The first is
//! ±1 for every monotone dependence, the second is 1 only for a straight one.
//!
//! Together: a linear regression on a few features, which are selected forward: the next one is that which leaves the
//! smallest sum of squared residuals. R² grows with every feature, even a meaningless one, so it is cross-validated (M.
//! Stone, *J. R. Stat. Soc. B* 36, 1974, 111): the members are dealt into [`FOLDS`] parts, each part is predicted by a
//! regression, *with its own selection*, on the others, and
//!
//! ```text
//! R² = 1 - Σ (y - predicted)² / Σ (y - mean)².
//! ```
//!
//! A feature more is used only if it raises this by [`GAIN`]. Without any dependence it is about 0 or below.
//!
//! # Practice
//!
//! Everything is computed from the sums of products of each part, of columns of mean 0 and variance 1, so that one pass
//! over the members serves all features. A feature that the ones before determine up to [`DEPENDENT`] is never
//! selected.

use super::{
    finite,
    sum::{Sum, mean},
};

/// Parts of a cross-validation.
pub const FOLDS: usize = 5;
/// Maximum features of a regression.
pub const MAX_FEATURES: usize = 4;
/// What a further feature must add to the cross-validated R².
pub const GAIN: f64 = 1e-3;
/// Minimum members for each feature of a regression.
pub const MEMBERS_PER_FEATURE: usize = 5;
/// Share of a feature's variance that the features before it leave, below which it tells nothing new.
const DEPENDENT: f64 = 1e-9;

/// The ranks of finite numbers, from 1; equal ones have the mean of theirs.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_unstable_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut before = 0;
    for equal in order.chunk_by(|a, b| values[*a] == values[*b]) {
        // Ranks before + 1 to before + count.
        let rank = before as f64 + 0.5 * (equal.len() as f64 + 1.0);
        equal.iter().for_each(|i| ranks[*i] = rank);
        before += equal.len();
    }
    ranks
}

/// The correlation of pairs of finite numbers, from -1 to 1; `None` if one side is constant, or beyond the range of
/// f64. Its square is the R² of a straight line.
pub fn correlation(x: &[f64], y: &[f64]) -> Option<f64> {
    let [x, y] = [standardised(x)?, standardised(y)?];
    let sum: Sum = x.iter().zip(&y).map(|(x, y)| x * y).collect();
    finite(sum.value() / x.len() as f64).map(|r| r.clamp(-1.0, 1.0))
}

/// Spearman's rank correlation, from -1 to 1; `None` if one side is constant.
pub fn spearman(x: &[f64], y: &[f64]) -> Option<f64> {
    correlation(&ranks(x), &ranks(y))
}

/// The values less their mean, over their standard deviation; `None` if they are equal, or beyond the range of f64.
fn standardised(values: &[f64]) -> Option<Vec<f64>> {
    let centre = mean(values.iter().copied())?;
    // In units of the largest distance, so that no square leaves the range of f64.
    let largest = finite(values.iter().map(|value| (value - centre).abs()).fold(0.0, f64::max)).filter(|d| *d > 0.0)?;
    let centred: Vec<f64> = values.iter().map(|value| (value - centre) / largest).collect();
    let squares: Sum = centred.iter().map(|value| value * value).collect();
    let deviation = (squares.value() / values.len() as f64).sqrt();
    Some(centred.into_iter().map(|value| value / deviation).collect())
}

/// A regression on a few features.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// The features, as indices, in the order in which they were selected.
    pub chosen: Vec<usize>,
    /// Cross-validated share of the variance.
    pub r2: f64,
}

impl Regression {
    /// Selects features for `y`; `keys` are the numbers of the members, by which they are dealt into parts. All slices
    /// have one number per member, and all numbers are finite.
    ///
    /// `None` if no feature or `y` varies, or with fewer than five members in all parts but one.
    pub fn forward(features: &[&[f64]], y: &[f64], keys: &[u64]) -> Option<Regression> {
        let varying = features.iter().enumerate().filter_map(|(i, feature)| Some((i, standardised(feature)?)));
        let (places, mut columns): (Vec<usize>, Vec<Vec<f64>>) = varying.unzip();
        columns.push(standardised(y)?);
        let parts = Products::of_parts(&columns, keys);
        let all = parts.iter().fold(Products::new(columns.len()), |all, part| all.plus(part, 1.0));
        let rest: Vec<Products> = parts.iter().map(|part| all.plus(part, -1.0)).collect();
        let least = rest.iter().map(|rest| rest.members() as usize).min()?;
        let most = (least / MEMBERS_PER_FEATURE).min(MAX_FEATURES).min(places.len());
        let paths: Vec<Vec<usize>> = rest.iter().map(|rest| rest.forward(most)).collect();
        let cross_validated = |count: usize| {
            let residuals = parts.iter().zip(&rest).zip(&paths).map(|((part, rest), path)| {
                let own = &path[..count.min(path.len())];
                part.residuals(own, &rest.solved(own))
            });
            // The variance of y is 1.
            1.0 - residuals.sum::<f64>() / all.members()
        };
        let own = all.forward(most);
        let mut best = (1, finite(cross_validated(1)).filter(|_| !own.is_empty())?);
        for count in 2..=own.len() {
            let r2 = cross_validated(count);
            if r2.is_nan() || r2 < best.1 + GAIN {
                break;
            }
            best = (count, r2);
        }
        Some(Regression { chosen: own[..best.0].iter().map(|i| places[*i]).collect(), r2: best.1 })
    }
}

/// The part of a member: neighbours, and members of any arithmetic progression, are spread over all (Fibonacci
/// hashing).
fn part_of(key: u64) -> usize {
    (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize % FOLDS
}

/// The sums of products over some members of a constant 1, the features and y, in this order: a symmetric matrix.
#[derive(Clone, Debug)]
struct Products {
    size: usize,
    sums: Vec<f64>,
}

impl Products {
    /// Those of no members, with this many columns.
    fn new(columns: usize) -> Products {
        let size = columns + 1;
        Products { size, sums: vec![0.0; size * size] }
    }

    /// Those of each part; the last of the columns is y.
    fn of_parts(columns: &[Vec<f64>], keys: &[u64]) -> Vec<Products> {
        let mut parts = vec![Products::new(columns.len()); FOLDS];
        let mut row = vec![1.0; columns.len() + 1];
        for (i, key) in keys.iter().enumerate() {
            row[1..].iter_mut().zip(columns).for_each(|(entry, column)| *entry = column[i]);
            let Products { size, sums } = &mut parts[part_of(*key)];
            for (a, sums) in row.iter().zip(sums.chunks_exact_mut(*size)) {
                sums.iter_mut().zip(&row).for_each(|(sum, b)| *sum += a * b);
            }
        }
        parts
    }

    /// These and `factor` times the others.
    fn plus(&self, other: &Products, factor: f64) -> Products {
        let sums = self.sums.iter().zip(&other.sums).map(|(own, other)| own + factor * other).collect();
        Products { size: self.size, sums }
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.sums[i * self.size + j]
    }

    fn members(&self) -> f64 {
        self.at(0, 0)
    }

    /// Takes what column `i` explains from all columns.
    fn sweep(&mut self, i: usize) {
        let Products { size, sums } = self;
        let pivot: Vec<f64> = sums[i * *size..(i + 1) * *size].to_vec();
        for (row, a) in sums.chunks_exact_mut(*size).zip(&pivot) {
            row.iter_mut().zip(&pivot).for_each(|(own, b)| *own -= a * b / pivot[i]);
        }
    }

    /// Up to `most` features, each the one that with those before leaves the smallest residuals.
    fn forward(&self, most: usize) -> Vec<usize> {
        let (mut left, y) = (self.clone(), self.size - 1);
        left.sweep(0);
        let variances: Vec<f64> = (0..self.size).map(|i| left.at(i, i)).collect();
        let mut chosen: Vec<usize> = Vec::new();
        while chosen.len() < most {
            let new = |i: &usize| left.at(*i, *i) > DEPENDENT * variances[*i] && variances[*i] > DEPENDENT;
            let taken = |i: usize| left.at(i, y).powi(2) / left.at(i, i);
            // Of equal ones the first.
            let best = (1..y).filter(new).rev().max_by(|a, b| taken(*a).total_cmp(&taken(*b)));
            let Some(best) = best.filter(|best| !chosen.contains(&(best - 1))) else { break };
            chosen.push(best - 1);
            left.sweep(best);
        }
        chosen
    }

    /// The regression of y on a constant and `features`, by Cholesky's decomposition; features that were selected
    /// forward are independent.
    fn solved(&self, features: &[usize]) -> Vec<f64> {
        let (at, y) = (columns_of(features), self.size - 1);
        let count = at.len();
        let mut lower = vec![vec![0.0; count]; count];
        for i in 0..count {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                let rest = self.at(at[i], at[j]) - known;
                lower[i][j] = if i == j { rest.sqrt() } else { rest / lower[j][j] };
            }
        }
        let mut solution = vec![0.0; count];
        for i in 0..count {
            let known: f64 = (0..i).map(|k| lower[i][k] * solution[k]).sum();
            solution[i] = (self.at(at[i], y) - known) / lower[i][i];
        }
        for i in (0..count).rev() {
            let known: f64 = (i + 1..count).map(|k| lower[k][i] * solution[k]).sum();
            solution[i] = (solution[i] - known) / lower[i][i];
        }
        solution
    }

    /// The sum of the squared distances of y from a [solution](Products::solved).
    fn residuals(&self, features: &[usize], solution: &[f64]) -> f64 {
        let places = columns_of(features).into_iter().chain([self.size - 1]);
        let terms: Vec<(usize, f64)> = places.zip(solution.iter().map(|b| -b).chain([1.0])).collect();
        terms.iter().flat_map(|(i, a)| terms.iter().map(move |(j, b)| a * b * self.at(*i, *j))).sum()
    }
}

/// The columns of a regression: the constant, and those of its features.
fn columns_of(features: &[usize]) -> Vec<usize> {
    [0].into_iter().chain(features.iter().map(|feature| feature + 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: u32 = 40;

    fn made(of: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..COUNT).map(|k| of(f64::from(k))).collect()
    }

    /// Five features, of which the fourth is a combination of the first two, and y.
    fn data() -> ([Vec<f64>; 5], Vec<f64>) {
        let (a, b) = (|k: f64| (k * k).sin(), |k: f64| (3.0 * k).cos());
        let c = |k: f64| (k * k) % 7.0;
        let y = |k: f64| (0.5 * a(k)).exp() + 0.3 * b(k) - 0.05 * c(k) + 0.1 * (5.0 * k * k).sin();
        let d = |k: f64| 2.0 * a(k) - b(k) + 1.0;
        ([made(a), made(b), made(c), made(d), made(|k| (11.0 * k).sin())], made(y))
    }

    fn forward(features: &[&[f64]], y: &[f64]) -> Option<Regression> {
        let keys: Vec<u64> = (7..7 + y.len() as u64).collect();
        Regression::forward(features, y, &keys)
    }

    fn near(found: Option<f64>, expected: f64) -> bool {
        found.is_some_and(|found| (found - expected).abs() < 1e-12)
    }

    #[test]
    fn equal_numbers_share_the_mean_of_their_ranks() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0, -0.0, 0.0]), [5.5, 3.0, 5.5, 4.0, 1.5, 1.5]);
        assert_eq!(ranks(&[]), [0.0; 0]);
        let (features, _) = data();
        // scipy.stats.rankdata
        assert_eq!(ranks(&features[2])[..8], [3.5, 12.0, 35.0, 23.5, 23.5, 35.0, 12.0, 3.5]);
    }

    #[test]
    fn correlations_are_those_of_scipy() {
        // scipy 1.17.1: spearmanr(x, y).statistic and linregress(x, y).rvalue².
        let (features, y) = data();
        let exact = [(0, 0.8326454033771109, 0.73217229498151), (2, -0.16938501378613496, 0.0352808466397947)];
        for (i, rho, r2) in exact {
            assert!(near(spearman(&features[i], &y), rho), "{i}: {:?}", spearman(&features[i], &y));
            let own = correlation(&features[i], &y).map(|r| r * r);
            assert!(near(own, r2), "{i}: {own:?}");
            assert!(!near(own, r2 + 1e-9));
        }
        let cubes: Vec<f64> = features[0].iter().map(|x| -1e300 * x.powi(3)).collect();
        assert!(near(spearman(&features[0], &cubes), -1.0));
        assert!(correlation(&features[0], &cubes).is_some_and(|r| r > -0.99));
        assert_eq!((correlation(&[0.1; 9], &y[..9]), spearman(&y[..9], &[0.1; 9])), (None, None));
        assert_eq!(correlation(&[f64::MAX, -f64::MAX], &[0.0, 1.0]), None);
    }

    #[test]
    fn the_regression_is_that_of_numpy() {
        // numpy 2.4.6: the same selection by lstsq on the columns themselves; 0.6943 with one feature, 0.9223 with two,
        // 0.9439 with four.
        let (features, y) = data();
        let all: Vec<&[f64]> = features.iter().map(Vec::as_slice).collect();
        let found = forward(&all, &y).unwrap();
        assert_eq!(found.chosen, [0, 1, 2]);
        assert!(near(Some(found.r2), 0.9442201662295544), "{found:?}");
        // Neither the unit of a feature nor one that never varies changes anything.
        let scaled: Vec<f64> = features[1].iter().map(|x| 1e9 - 1e5 * x).collect();
        let again = forward(&[all[0], &[3.0; COUNT as usize], &scaled, all[2]], &y).unwrap();
        assert_eq!(again.chosen, [0, 2, 3]);
        assert!((again.r2 - found.r2).abs() < 1e-9, "{again:?}");
    }

    #[test]
    fn a_meaningless_feature_explains_nothing() {
        // Draws of a linear congruential generator.
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let columns: Vec<Vec<f64>> = (0..21).map(|_| (0..60).map(|_| draw()).collect()).collect();
        let (y, features) = columns.split_first().unwrap();
        let all: Vec<&[f64]> = features.iter().map(Vec::as_slice).collect();
        let found = forward(&all, y).unwrap();
        // The best of twenty explains something of the members from which it was selected.
        let best = features.iter().filter_map(|x| correlation(x, y)).map(|r| r * r).fold(0.0, f64::max);
        assert!(found.r2 < 0.05 && best > 0.05, "{found:?} {best}");
    }

    #[test]
    fn too_few_members_and_constants_have_no_regression() {
        let (features, y) = data();
        assert_eq!(forward(&[&[1.0; COUNT as usize]], &y), None);
        assert_eq!(forward(&[], &y), None);
        assert_eq!(forward(&[&features[0]], &[1.0; COUNT as usize]), None);
        assert_eq!(forward(&[&features[0][..4]], &y[..4]), None);
        // All members in one part leave none for the regression.
        assert_eq!(Regression::forward(&[&features[0]], &y, &[7; COUNT as usize]), None);
    }

    #[test]
    fn the_parts_of_members_in_steps_are_of_like_size() {
        for step in [1, 2, 5, 10, 64, 1000] {
            let mut counts = [0; FOLDS];
            (0..1000).for_each(|i| counts[part_of(3 + i * step)] += 1);
            assert!(counts.iter().all(|count| (190..210).contains(count)), "{step}: {counts:?}");
        }
    }
}
