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
        let left = |[t, energy]: [f64; 2]| [t, (energy - end) / way];
        let late = self.energies.iter().copied().map(left).filter(|[t, _]| *t >= 0.5 * t_end * (1.0 - 1e-9));
        let settled = late.map(|[_, left]| left.abs()).fold(0.0, f64::max) <= AT_REST * self.share;
        let first = |share: f64| {
            let pair = self.energies.windows(2).map(|pair| [left(pair[0]), left(pair[1])]);
            pair.into_iter().find(|[_, [_, after]]| *after <= share).map(|pair| between(pair, share))
        };
        // The end itself is the last.
        if settled && way > 0.0 { [self.share, 0.5].map(first) } else { [None; 2] }
    }
}

/// When a number falls to `share` between two times, as an exponential does.
fn between([[t, before], [later, after]]: [[f64; 2]; 2], share: f64) -> f64 {
    let part =
        if after > 0.0 { (before / share).ln() / (before / after).ln() } else { (before - share) / (before - after) };
    t + part.clamp(0.0, 1.0) * (later - t)
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
        assert!(((falls(relaxed) - 3.0) / 0.006 - 1.0).abs() < 2e-3, "{relaxed}");
        assert!(((falls(half) - 3.0) / 0.3 - 1.0).abs() < 2e-3, "{half}");
    }

    #[test]
    fn an_energy_that_still_falls_or_rises_has_no_time_and_one_at_rest_is_relaxed() {
        assert_eq!(settling(|t| 3.0 + (-5.0 * t).exp(), 1.0), [None; 2]);
        assert_eq!(settling(|t| 3.0 - (-50.0 * t).exp(), 1.0), [None; 2]);
        assert_eq!(settling(|t| 3.0 + 1e-7 * (-5.0 * t).exp(), 1.0), [Some(0.0); 2]);
    }
}
