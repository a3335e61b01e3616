//! The clock of a movie: which time each moment of it shows.
//!
//! Relaxation is fast at first and then ever slower. At a constant speed most of a movie would be a still. The clock
//! therefore runs so that the curves move about equally fast throughout: with M(t) the way that they have gone along
//! their normals by the time t, and T the end, the moment s ∈ \[0, 1\] shows the t at which
//!
//! ```text
//! s = (1 - w)·M(t)/M(T) + w·t/T.
//! ```
//!
//! The share w of plain time lets the clock run where nothing moves. Motion along the curve does not count: it does not
//! show.

use glam::DVec2;

use super::moved::MovedMember;

/// The share w. At 0 the clock would jump over times in which nothing moves.
const PLAIN: f64 = 0.15;

/// Pixels that a member goes in a whole movie without anyone seeing it. If all together go no further, time is plain:
/// what is left of their motion is rounding.
const UNSEEN: f64 = 2.0;

/// The moments of a movie and their times.
#[derive(Clone, Debug, PartialEq)]
pub struct MoviePace {
    /// Ascending times from the first state of any member to the last, and the moment at which each is shown. Moments
    /// ascend from 0 to 1; between two of them the clock runs evenly.
    knots: Vec<(f64, f64)>,
}

impl MoviePace {
    /// The pace at which `members`, of which one has a state, move evenly.
    pub fn new(members: &[MovedMember]) -> MoviePace {
        let mut times: Vec<f64> = members.iter().flat_map(|member| member.times()).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let mut before: Vec<Vec<DVec2>> = Vec::new();
        let mut ways = Vec::new();
        for t in &times {
            let now: Vec<Vec<DVec2>> = members.iter().map(|member| member.at(*t)).collect();
            ways.push(before.iter().zip(&now).map(|(before, now)| way(before, now)).sum::<f64>());
            before = now;
        }
        let (all, whole) = (ways.iter().sum::<f64>(), times.last().unwrap_or(&0.0) - times.first().unwrap_or(&0.0));
        let plain = if all > UNSEEN * members.len() as f64 { PLAIN } else { 1.0 };
        let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        let mut moment = 0.0;
        let mut knots: Vec<(f64, f64)> = Vec::with_capacity(times.len());
        for (t, way) in times.iter().zip(ways) {
            if let Some((last, _)) = knots.last() {
                moment += (1.0 - plain) * share(way, all) + plain * share(t - last, whole);
            }
            knots.push((*t, moment));
        }
        // The sum is 1 up to rounding.
        let last = moment;
        knots.iter_mut().for_each(|(_, moment)| *moment = share(*moment, last));
        MoviePace { knots }
    }

    /// The last time.
    pub fn end(&self) -> f64 {
        self.knots.last().map_or(0.0, |(t, _)| *t)
    }

    /// The time that the moment `s` shows.
    pub fn time(&self, s: f64) -> f64 {
        let swapped: Vec<(f64, f64)> = self.knots.iter().map(|(t, s)| (*s, *t)).collect();
        along(&swapped, s)
    }

    /// The moment at which the time `t` is shown.
    pub fn moment(&self, t: f64) -> f64 {
        along(&self.knots, t)
    }
}

/// The value at `x` on the straight lines through `knots`, which ascend in x.
fn along(knots: &[(f64, f64)], x: f64) -> f64 {
    let after = knots.partition_point(|(at, _)| *at <= x);
    match (after.checked_sub(1).map(|i| knots[i]), knots.get(after).copied()) {
        (Some((low, from)), Some((high, to))) => from + (to - from) * ((x - low) / (high - low)),
        (None, Some((_, value))) | (Some((_, value)), None) => value,
        (None, None) => 0.0,
    }
}

/// Root mean square of the ways of the nodes along the normals of the curve.
fn way(before: &[DVec2], now: &[DVec2]) -> f64 {
    let n = before.len().min(now.len());
    let square = |i: usize| {
        // Of both together: to that of one, a curve that turns along itself would seem to move.
        let along = |nodes: &[DVec2]| nodes[(i + 1) % n] - nodes[(i + n - 1) % n];
        let tangent = (along(before) + along(now)).normalize_or_zero();
        tangent.perp_dot(now[i] - before[i]).powi(2)
    };
    if n > 0 { ((0..n).map(square).sum::<f64>() / n as f64).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use curvelax_ensemble::Status;

    /// A circle whose radius tends to 50, and that turns.
    fn circle(times: &[f64], decay: f64, turn: f64) -> MovedMember {
        let nodes = |t: &f64| {
            let radius = 50.0 + 20.0 * (-decay * t).exp();
            (0..100).map(|i| radius * DVec2::from_angle(TAU * f64::from(i) / 100.0 + turn * t)).collect()
        };
        MovedMember::new(Status::Relaxed, times.iter().map(|t| (*t, nodes(t))).collect())
    }

    #[test]
    fn curves_move_evenly_however_they_decay() {
        let times: Vec<f64> = (0..=200).map(|i| 0.01 * f64::from(i)).collect();
        let member = circle(&times, 6.0, 0.0);
        let pace = MoviePace::new(std::slice::from_ref(&member));
        let radius = |s: f64| member.at(pace.time(s))[0].length();
        let ways: Vec<f64> = (0..20).map(|i| radius(0.05 * f64::from(i)) - radius(0.05 * f64::from(i + 1))).collect();
        // In plain time the first twentieth would hold 45 % of the way, and the last 1 in 10⁵.
        assert!(ways[0] < 0.06 * 20.0 && ways[15] > 0.03 * 20.0, "{ways:?}");
        assert!(pace.time(0.85) < 1.2 && pace.time(1.0) == 2.0, "{pace:?}");
    }

    #[test]
    fn what_moves_along_itself_runs_in_plain_time() {
        let times: Vec<f64> = (0..=50).map(|i| 0.1 * f64::from(i * i)).collect();
        let pace = MoviePace::new(&[circle(&times, 0.0, 0.002)]);
        for s in [0.1, 0.5, 0.9] {
            assert!((pace.time(s) / (s * pace.end()) - 1.0).abs() < 0.1, "{s}: {}", pace.time(s));
        }
    }

    #[test]
    fn moments_and_times_belong_together() {
        let members = [circle(&[0.0, 0.1, 0.5], 6.0, 0.0), circle(&[0.0, 0.2, 3.0], 1.0, 0.0)];
        let pace = MoviePace::new(&members);
        assert_eq!((pace.time(0.0), pace.time(1.0), pace.end()), (0.0, 3.0, 3.0));
        assert_eq!((pace.moment(0.0), pace.moment(3.0), pace.moment(9.0)), (0.0, 1.0, 1.0));
        for t in [0.05, 0.1, 0.3, 2.0] {
            assert!((pace.time(pace.moment(t)) - t).abs() < 1e-12, "{t}");
        }
        let still = MoviePace::new(&[circle(&[0.0], 6.0, 0.0)]);
        assert_eq!((still.time(0.0), still.time(1.0), still.moment(0.0)), (0.0, 0.0, 0.0));
    }
}
