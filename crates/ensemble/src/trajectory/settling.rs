//! When a member that keeps area and length is relaxed.
//!
//! Its excess stays as it is, and the curve at its end is no circle. What falls is the energy; how far is known only at
//! the end. The energy is therefore recorded at times that are dense from early to late ones, and when the final time
//! has come, t_relax is the first at which only a share of its way is left. It has none if the energy still falls by
//! then.

use crate::{Observables, Spec};

/// Times in each halving of the time, and halvings.
const PER_HALVING: u32 = 16;
const HALVINGS: u32 = 12;
/// The energy is at its end if this part of the share of its way was left at half the time.
const AT_REST: f64 = 0.1;
/// A change of the energy, relatively, that is the rounding and the error of steps.
const NO_CHANGE: f64 = 1e-6;

/// The energy of a member over time.
#[derive(Clone, Debug)]
pub(super) struct Settling {
    /// Share of the way that is left when it is relaxed.
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

    /// When it was relaxed and when half of the way was left, for this energy at the final time; nothing if that still
    /// falls.
    pub(super) fn times(&self, t_end: f64, end: f64) -> [Option<f64>; 2] {
        let [_, start] = self.energies[0];
        let way = start - end;
        if way.abs() <= NO_CHANGE * end.abs() {
            return [Some(0.0); 2];
        }
        let left: Vec<[f64; 2]> = self.energies.iter().map(|[t, energy]| [*t, (energy - end) / way]).collect();
        let late = left.iter().filter(|[t, _]| *t >= 0.5 * t_end * (1.0 - 1e-9));
        let settled = late.map(|[_, left]| left.abs()).fold(0.0, f64::max) <= AT_REST * self.share;
        // The end itself is the last.
        if settled && way > 0.0 { [self.share, 0.5].map(|share| falls_to(share, &left)) } else { [None; 2] }
    }
}

/// When a number first falls to `share`, of its `values` at times: the time is a cubic in the logarithms of four
/// values, or linear in it where these do not fall all the way, or in the value where it reaches 0.
fn falls_to(share: f64, values: &[[f64; 2]]) -> Option<f64> {
    let after = (1..values.len()).find(|i| values[*i][1] <= share)?;
    let [[t, above], [later, below]] = [values[after - 1], values[after]];
    let four = values.get(after.wrapping_sub(2)..after + 2).unwrap_or_default();
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
    fn an_energy_that_still_falls_or_rises_has_no_time_and_one_at_rest_is_relaxed() {
        assert_eq!(settling(|t| 3.0 + (-5.0 * t).exp(), 1.0), [None; 2]);
        assert_eq!(settling(|t| 3.0 - (-50.0 * t).exp(), 1.0), [None; 2]);
        assert_eq!(settling(|t| 3.0 + 1e-7 * (-5.0 * t).exp(), 1.0), [Some(0.0); 2]);
    }
}
