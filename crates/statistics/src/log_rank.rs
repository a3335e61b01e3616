//! The log-rank test: do groups lose their members alike?
//!
//! At each time t with d events among n members at risk, n_j of them in group j, equal groups would share the events
//! like a draw without replacement: d·n_j/n expected, with the covariances of the hypergeometric law. Over all times
//!
//! ```text
//! E_j = Σ d n_j/n,    V_jl = Σ d (n-d)/(n-1) · (δ_jl n_j/n - n_j n_l/n²),    χ² = (O-E)ᵀ V⁻ (O-E)
//! ```
//!
//! Since n_j(t) counts members, a sum of n_j n_l over times is a sum over *pairs* of members of the running sum at the
//! earlier of their two times, which is known when that member leaves. One pass thus computes V in members × groups
//! instead of times × groups²; the diagonal follows because rows of V add up to 0, which costs no digits, unlike a
//! difference.

use std::{borrow::Borrow, cmp::Reverse, collections::BinaryHeap};

use serde::Serialize;

use super::{finite, sample::Sample, special::chi_square_tail, sum::Sum};

/// Result of the test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogRank {
    /// χ², chi-square distributed if the groups are alike and there are enough events.
    #[serde(rename = "chi2")]
    pub statistic: f64,
    /// Number of groups with members at risk at the first event, minus one.
    pub degrees_of_freedom: usize,
    /// Probability of a statistic at least as large if the groups are alike; never 0, but the smallest normal number.
    #[serde(rename = "p")]
    pub p_value: f64,
    /// The groups, in the order given.
    #[serde(skip)]
    pub groups: Vec<GroupEvents>,
}

/// Event counts of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupEvents {
    /// Number that happened.
    pub observed: usize,
    /// Number expected if its members were like all others.
    pub expected: f64,
}

/// Compares any number of groups.
///
/// A group without members at risk at the first event is left out and adds no degree of freedom. `None` if fewer
/// than two groups remain, or all members at risk have their event at one time. Takes members × groups + groups³
/// operations and groups² numbers.
pub fn log_rank(samples: &[impl Borrow<Sample>]) -> Option<LogRank> {
    let samples: &[&Sample] = &samples.iter().map(Borrow::borrow).collect::<Vec<_>>();
    let tally = LogRankSums::of(samples);
    // All groups at risk at the first event are at risk together there, so V has the rank of their number, minus one.
    let compared: Vec<usize> = (0..samples.len()).filter(|j| tally.expected[*j].value() > 0.0).collect();
    let (_, free) = compared.split_last()?;
    if free.is_empty() {
        return None;
    }
    let groups: Vec<GroupEvents> = samples
        .iter()
        .zip(&tally.expected)
        .map(|(sample, expected)| GroupEvents { observed: sample.events(), expected: expected.value() })
        .collect();
    let surplus = free.iter().map(|j| groups[*j].observed as f64 - groups[*j].expected).collect();
    let variance = free.iter().map(|j| free.iter().map(|l| tally.variance(*j, *l)).collect()).collect();
    let statistic = finite(quadratic_form(variance, surplus)?)?;
    let degrees_of_freedom = free.len();
    Some(LogRank { statistic, degrees_of_freedom, p_value: chi_square_tail(statistic, degrees_of_freedom), groups })
}

/// The sums over all members.
struct LogRankSums {
    expected: Vec<Sum>,
    /// Σ over pairs, the first to leave in group j and the other in l.
    pairs: Vec<Vec<f64>>,
}

impl LogRankSums {
    fn of(samples: &[&Sample]) -> LogRankSums {
        let k = samples.len();
        let mut tally = LogRankSums { expected: vec![Sum::default(); k], pairs: vec![vec![0.0; k]; k] };
        let mut at_risk: Vec<f64> = samples.iter().map(|sample| sample.len() as f64).collect();
        let (mut n, mut hazard, mut covariance) = (at_risk.iter().sum::<f64>(), Sum::default(), Sum::default());
        let mut groups: Vec<_> = samples.iter().map(|sample| sample.times()).collect();
        // Times are not negative, so their bits have the same order.
        let mut after = |j: usize| {
            let (time, events, censored) = groups[j].next()?;
            Some(Reverse((time.to_bits(), j, events, events + censored)))
        };
        let mut next: BinaryHeap<_> = (0..k).filter_map(&mut after).collect();
        let mut tied = Vec::new();
        while let Some(Reverse((time, ..))) = next.peek().copied() {
            tied.clear();
            while let Some(Reverse((_, j, events, leaving))) = next.peek().copied().filter(|at| at.0.0 == time) {
                next.pop();
                tied.push((j, events as f64, leaving as f64));
                next.extend(after(j));
            }
            let events: f64 = tied.iter().map(|(_, events, _)| events).sum();
            if events > 0.0 {
                hazard.add(events / n);
                if events < n {
                    covariance.add(events * (n - events) / (n - 1.0) / (n * n));
                }
            }
            for &(j, _, leaving) in &tied {
                tally.expected[j].add(leaving * hazard.value());
                at_risk[j] -= leaving;
                n -= leaving;
                if covariance.value() > 0.0 {
                    for (pair, others) in tally.pairs[j].iter_mut().zip(&at_risk) {
                        *pair += leaving * covariance.value() * others;
                    }
                }
            }
        }
        tally
    }

    /// V_jl. Pairs with a group that is left out are 0, so the diagonal may sum over all.
    fn variance(&self, j: usize, l: usize) -> f64 {
        let pairs = |l: usize| self.pairs[j][l] + self.pairs[l][j];
        if j == l { (0..self.pairs.len()).filter(|l| *l != j).map(pairs).sum() } else { -pairs(l) }
    }
}

/// zᵀ V⁻¹ z by Cholesky's factors V = L Lᵀ, as |L⁻¹ z|²; `None` if V is not positive definite.
fn quadratic_form(mut v: Vec<Vec<f64>>, mut z: Vec<f64>) -> Option<f64> {
    for j in 0..z.len() {
        let (above, from_j) = v.split_at_mut(j);
        let row = &mut from_j[0];
        for (l, other) in above.iter().enumerate() {
            let dot: f64 = row[..l].iter().zip(&other[..l]).map(|(a, b)| a * b).sum();
            row[l] = (row[l] - dot) / other[l];
        }
        let pivot = row[j] - row[..j].iter().map(|a| a * a).sum::<f64>();
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        row[j] = pivot.sqrt();
        let dot: f64 = row[..j].iter().zip(&z).map(|(a, b)| a * b).sum();
        z[j] = (z[j] - dot) / row[j];
    }
    Some(z.iter().map(|z| z * z).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Observation;

    /// Times with `+` for censored.
    fn sample(times: &str) -> Sample {
        let seen = |word: &str| Observation {
            time: word.trim_end_matches('+').parse().unwrap(),
            happened: !word.ends_with('+'),
        };
        Sample::new(times.split_whitespace().map(seen)).unwrap()
    }

    fn test(groups: &[&str]) -> Option<LogRank> {
        log_rank(&groups.iter().map(|times| sample(times)).collect::<Vec<_>>())
    }

    #[test]
    fn two_groups_by_hand() {
        // t = 1: 1 of 3 in the first, variance 2/9; t = 2: 1/2 of them, variance 1/4; t = 3 leaves no choice.
        let found = test(&["1", "2 3"]).unwrap();
        let (surplus, variance) = (1.0 - 1.0 / 3.0, 2.0 / 9.0);
        assert!((found.statistic - surplus * surplus / variance).abs() < 1e-15, "{found:?}");
        assert_eq!(found.groups.iter().map(|group| group.observed).collect::<Vec<_>>(), [1, 2]);
        assert!((found.groups[0].expected - 1.0 / 3.0).abs() < 1e-15, "{found:?}");
        assert_eq!(found.degrees_of_freedom, 1);
    }

    #[test]
    fn groups_that_are_the_same_do_not_differ() {
        let found = test(&["1 2 2+ 5"; 4]).unwrap();
        assert!(found.statistic < 1e-28 && found.p_value == 1.0 && found.degrees_of_freedom == 3, "{found:?}");
    }

    #[test]
    fn a_group_without_members_at_risk_takes_no_degree_of_freedom() {
        let two = test(&["1 2 4", "3 5+"]).unwrap();
        let more = test(&["", "1 2 4", "0.5+ 0.9+", "3 5+"]).unwrap();
        assert!((two.statistic - more.statistic).abs() < 1e-14 && two.p_value == more.p_value, "{two:?} {more:?}");
        assert_eq!((more.degrees_of_freedom, more.groups.len()), (1, 4));
        assert_eq!(more.groups[2], GroupEvents { observed: 0, expected: 0.0 });
    }

    #[test]
    fn nothing_to_compare_is_none() {
        let cases: [&[&str]; 7] =
            [&[], &["1 2"], &["1 2", ""], &["1+ 2+", "1+"], &["1 1", "1"], &["1 2", "0.5+"], &["", "", ""]];
        for groups in cases {
            assert_eq!(test(groups), None, "{groups:?}");
        }
    }

    #[test]
    fn an_event_and_a_censoring_at_one_time_are_both_at_risk() {
        let found = test(&["1 2+", "1+ 2"]).unwrap();
        assert_eq!(found.groups.iter().map(|group| group.expected).collect::<Vec<_>>(), [1.0, 1.0]);
        assert_eq!(found.statistic, 0.0);
    }
}
