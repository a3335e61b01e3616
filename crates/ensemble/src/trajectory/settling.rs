//! When a member that keeps area and length is relaxed.
//!
//! Its excess stays as it is, and the curve at its end is no circle. What comes to rest is the energy; where is known
//! only at the end. The energy is therefore recorded at times that are dense from early to late ones, and when the
//! final time has come, t_relax is the time from which on it stays within a share of the largest distance that it had
//! from its end. Willmore flow lowers it all the way, and that distance is the one at the start; poly need not. It has
//! no t_relax if the energy still moves by then, or if it comes back near that share.

use crate::{Observables, Spec};

/// Times in each halving of the time, and halvings.
const PER_HALVING: u32 = 16;
const HALVINGS: u32 = 12;
/// The energy is at its end if this part of the share was left at half the time.
const AT_REST: f64 = 0.1;
/// Where the energy comes back this near to the share, relatively, after it was below, or has come from below, the time
/// jumps with the number of nodes, and is unknown.
const NEAR: f64 = 0.2;
/// A change of the energy, relatively, that is the rounding and the error of steps.
const NO_CHANGE: f64 = 1e-6;

/// The energy of a member over time.
#[derive(Clone, Debug)]
pub(super) struct Settling {
    /// Share of its largest distance from its end that is left when it is relaxed.
    share: f64,
    /// Times and energies.
    pub(super) energies: Vec<[f64; 2]>,
}

/// The times at which the energy of the members of a spec is recorded.
pub(crate) fn settling_times(spec: &Spec) -> Vec<f64> {
    let times = (0..PER_HALVING * HALVINGS).map(|i| f64::from(i) / f64::from(PER_HALVING) - f64::from(HALVINGS));
    if spec.keeps_both() { times.map(|power| power.exp2() * spec.final_time()).collect() } else { Vec::new() }
}

impl Settling {
    /// That of a member of `spec` that starts like this, if it keeps both.
    pub(super) fn of(spec: &Spec, start: &Observables) -> Option<Settling> {
        // Of what is relaxed at an excess nothing is kept.
        spec.keeps_both().then(|| Settling { share: spec.threshold(1.0), energies: vec![[0.0, start.energy]] })
    }

    /// When it was relaxed and from when on less than half of its largest distance was left, for this energy at the
    /// final time. Neither is known if that still moves, and each only if its share is crossed on one way.
    pub(super) fn times(&self, t_end: f64, end: f64) -> [Option<f64>; 2] {
        let farthest = self.energies.iter().map(|[_, energy]| (energy - end).abs()).fold(0.0, f64::max);
        if farthest <= NO_CHANGE * end.abs() {
            return [Some(0.0); 2];
        }
        let left: Vec<[f64; 2]> = self.energies.iter().map(|[t, energy]| [*t, (energy - end) / farthest]).collect();
        let late = left.iter().filter(|[t, _]| *t >= 0.5 * t_end * (1.0 - 1e-9));
        let settled = late.map(|[_, left]| left.abs()).fold(0.0, f64::max) <= AT_REST * self.share;
        // The end itself is the last.
        let rounding = NO_CHANGE * end.abs() / farthest;
        let within = |share| if is_steady(share, &left, rounding) { settles_within(share, &left) } else { None };
        if settled { [self.share, 0.5].map(within) } else { [None; 2] }
    }
}

/// Whether a number settles within `share` of 0 on the way on which it does within a share that is a little larger or
/// smaller: between these two it neither grows by more than `rounding` nor changes its sign.
fn is_steady(share: f64, values: &[[f64; 2]], rounding: f64) -> bool {
    let last_beyond = |factor: f64| values.iter().rposition(|[_, value]| value.abs() > factor * share);
    // Nothing may be beyond a large share; then it falls from its largest distance.
    let farthest = || (0..values.len()).max_by(|i, j| values[*i][1].abs().total_cmp(&values[*j][1].abs()));
    let (Some(from), Some(to)) = (last_beyond(1.0 + NEAR).or_else(farthest), last_beyond(1.0 - NEAR)) else {
        return true;
    };
    let mut least = f64::INFINITY;
    values.get(from..=to).unwrap_or_default().iter().all(|[_, value]| {
        let is_steady = value.abs() <= least + rounding && value * values[from][1] > 0.0;
        least = least.min(value.abs());
        is_steady
    })
}

/// From when on a number stays within `share` of 0, of its `values` at times: the time is a cubic in the logarithms of
/// four values, or linear in it where these do not fall all the way, or in the value where it passes 0.
fn settles_within(share: f64, values: &[[f64; 2]]) -> Option<f64> {
    let before = values.iter().rposition(|[_, value]| value.abs() > share)?;
    let sign = values[before][1].signum();
    let [t, above] = values[before].map(f64::abs);
    let [later, below] = values.get(before + 1).map(|[t, value]| [*t, sign * value])?;
    let four = values.get(before.wrapping_sub(1)..before + 3).unwrap_or_default();
    let four: Vec<[f64; 2]> = four.iter().map(|[t, value]| [*t, sign * value]).collect();
    let falls = four.windows(2).all(|pair| pair[0][1] > pair[1][1]) && four.last().is_some_and(|last| last[1] > 0.0);
    let found = match () {
        () if below <= 0.0 => t + (above - share) / (above - below) * (later - t),
        // Lagrange's polynomial for the time by the logarithm.
        () if falls => {
            let weight = |i: usize| {
                let others = four.iter().enumerate().filter(move |(j, _)| *j != i);
                others.map(|(_, [_, other])| (share / other).ln() / (four[i][1] / other).ln()).product::<f64>()
            };
            four.iter().enumerate().map(|(i, [t, _])| t * weight(i)).sum()
        }
        () => t + (above / share).ln() / (above / below).ln() * (later - t),
    };
    Some(found.clamp(t, later))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settling(energy: impl Fn(f64) -> f64, t_end: f64) -> [Option<f64>; 2] {
        let spec = Spec::from_toml(&format!("flow = 'willmore'\nconserve = 'area,length'\nt-end = {t_end}")).unwrap();
        let start = Observables { energy: energy(0.0), ..Observables::default() };
        let mut own = Settling::of(&spec, &start).unwrap();
        own.energies.extend(settling_times(&spec).into_iter().map(|t| [t, energy(t)]));
        own.times(t_end, energy(t_end))
    }

    #[test]
    fn a_share_of_the_way_is_found_where_the_energy_has_settled() {
        let falls = |t: f64| 3.0 + 0.4 * (-5.0 * t).exp() + 0.2 * (-40.0 * t).exp();
        let [relaxed, half] = settling(falls, 4.0).map(Option::unwrap);
        // On a straight line of logarithms the second would be off by 5e-5.
        assert!(((falls(relaxed) - 3.0) / 0.006 - 1.0).abs() < 1e-5, "{relaxed}");
        assert!(((falls(half) - 3.0) / 0.3 - 1.0).abs() < 1e-5, "{half}");
    }

    #[test]
    fn an_energy_that_passes_its_end_is_at_rest_from_when_on_it_stays_near() {
        // Below its end from 0.11 on, by 0.33 at most at 0.25; within 0.01 of the 0.7 of its start only late.
        let dips = |t: f64| 3.0 - 0.8 * (-4.0 * t).exp() + 1.5 * (-10.0 * t).exp();
        let [relaxed, half] = settling(dips, 4.0).map(Option::unwrap);
        assert!(((3.0 - dips(relaxed)) / 0.007 - 1.0).abs() < 1e-4 && relaxed > 1.0, "{relaxed}");
        assert!((dips(half) - 3.0 - 0.35).abs() < 1e-3 && half < 0.11, "{half}");
        let rises = |t: f64| 3.0 - 0.4 * (-5.0 * t).exp();
        let [relaxed, half] = settling(rises, 4.0).map(Option::unwrap);
        assert!(
            (relaxed - 100f64.ln() / 5.0).abs() < 1e-5 && (half - 2f64.ln() / 5.0).abs() < 1e-5,
            "{relaxed} {half}"
        );
    }

    #[test]
    fn an_energy_that_comes_back_near_the_share_has_no_time() {
        // Below its end from t = 0.08 on, by so many hundredths at 0.5.
        let dips = |depth: f64| {
            settling(
                |t| 3.0 + (1.0 - 0.01 * depth) * (-60.0 * t).exp() - depth * 0.01 * 2.0 * t * (1.0 - 2.0 * t).exp(),
                8.0,
            )
        };
        let [early, late] = [0.5, 2.0].map(|depth| dips(depth)[0].unwrap());
        assert!(early < 0.1 && late > 0.5, "{early} {late}");
        assert_eq!([dips(0.9)[0], dips(1.1)[0]], [None; 2]);
        assert!(dips(1.1)[1].is_some());
    }

    #[test]
    fn rounding_on_a_plateau_is_no_return_and_a_leap_over_the_end_is() {
        let values: Vec<[f64; 2]> = [1.0, 0.02, 0.013, -0.0095, -0.0092, -0.008, -0.001].map(|left| [0.0, left]).into();
        assert!(!is_steady(0.01, &values, 1e-6));
        let plateau = |noise: f64| {
            settling(
                |t| 3.0 + 0.5 * (-40.0 * t).exp() + 0.5 * (-(t / 2.0).powi(8)).exp() + noise * (1e3 * t).sin(),
                8.0,
            )
        };
        assert!(plateau(0.0)[1].is_some() && plateau(1e-6)[1].is_some(), "{:?}", plateau(1e-6));
        assert_eq!(plateau(1e-3)[1], None);
    }

    #[test]
    fn an_energy_that_still_moves_has_no_time_and_one_at_rest_is_relaxed() {
        assert_eq!(settling(|t| 3.0 + (-5.0 * t).exp(), 1.0), [None; 2]);
        assert_eq!(settling(|t| 3.0 - (-5.0 * t).exp(), 1.0), [None; 2]);
        assert_eq!(settling(|t| 3.0 + 1e-7 * (-5.0 * t).exp(), 1.0), [Some(0.0); 2]);
    }
}
