//! Time: the steps of a run with fixed τ, and the output times between them.

/// Relative distance from a step at which an output time counts as on it.
const ON_A_STEP: f64 = 1e-9;

/// Steps of length τ from 0 to the final time; the last one is shorter where τ does not divide it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Length of every step but the last.
    pub tau: f64,
    /// Final time.
    pub t_end: f64,
    /// Number of steps.
    pub steps: u32,
}

impl Clock {
    /// The clock of a run; `t_end/tau` is at most 10⁹.
    pub fn new(tau: f64, t_end: f64) -> Clock {
        let ratio = t_end / tau;
        let whole = ratio.round();
        let steps = if (ratio - whole).abs() <= ON_A_STEP * whole { whole } else { ratio.ceil() };
        Clock { tau, t_end, steps: steps.max(1.0) as u32 }
    }

    /// Time after `step` steps.
    pub fn time(&self, step: u32) -> f64 {
        if step >= self.steps { self.t_end } else { f64::from(step) * self.tau }
    }

    /// Time at `fraction` of the step after `step` steps.
    pub fn inside(&self, step: u32, fraction: f64) -> f64 {
        let (before, after) = (self.time(step), self.time(step + 1));
        before + fraction.clamp(0.0, 1.0) * (after - before)
    }

    /// Whether the last step is shorter than τ.
    pub fn ends_short(&self) -> bool {
        self.t_end < f64::from(self.steps) * self.tau * (1.0 - ON_A_STEP)
    }

    /// Length of the last step.
    pub fn last(&self) -> f64 {
        self.t_end - f64::from(self.steps - 1) * self.tau
    }
}

/// An output time, `fraction` of a step after `step` steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// The time.
    pub t: f64,
    /// Steps before it.
    pub step: u32,
    /// Where in the next step it lies; 0 on a step.
    pub fraction: f64,
    /// A row of `series.csv` is due.
    pub series: bool,
    /// A snapshot is due.
    pub snapshot: bool,
}

impl Stop {
    fn new(clock: &Clock, t: f64, series: bool, snapshot: bool) -> Stop {
        let at = |t, step, fraction| Stop { t, step, fraction, series, snapshot };
        if t >= clock.t_end * (1.0 - ON_A_STEP) {
            return at(clock.t_end, clock.steps, 0.0);
        }
        let ratio = t / clock.tau;
        let near = ratio.round();
        // Where the last step is short, the step before it is the last that lies on a multiple of τ.
        if (ratio - near).abs() <= ON_A_STEP * near.max(1.0) && near < f64::from(clock.steps) {
            return at(t, near as u32, 0.0);
        }
        let step = (ratio.floor() as u32).min(clock.steps - 1);
        let inside = (t - clock.time(step)) / (clock.time(step + 1) - clock.time(step));
        at(t, step, inside.clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON))
    }
}

/// The output times of a run, in order: every `series` from 0 on, and each of `snapshots`.
pub fn stops(clock: &Clock, series: Option<f64>, snapshots: &[f64]) -> Vec<Stop> {
    let rows = series.map_or(0, |dt| (clock.t_end / dt * (1.0 + ON_A_STEP)) as u64 + 1);
    let series_times = (0..rows).map(|row| (row as f64 * series.unwrap_or(0.0)).min(clock.t_end));
    let mut stops: Vec<Stop> = series_times.map(|t| Stop::new(clock, t, true, false)).collect();
    stops.extend(snapshots.iter().map(|t| Stop::new(clock, *t, false, true)));
    stops.sort_by(|a, b| a.t.total_cmp(&b.t));
    stops.dedup_by(|later, earlier| {
        let same = later.t == earlier.t;
        if same {
            earlier.series |= later.series;
            earlier.snapshot |= later.snapshot;
        }
        same
    });
    stops
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_ends_at_the_final_time() {
        let even = Clock::new(1e-3, 2.0);
        assert_eq!((even.steps, even.ends_short(), even.time(2000)), (2000, false, 2.0));
        let short = Clock::new(0.3, 1.0);
        assert_eq!((short.steps, short.ends_short(), short.time(4)), (4, true, 1.0));
        assert!((short.last() - 0.1).abs() < 1e-15);
        assert!((short.inside(3, 0.5) - 0.95).abs() < 1e-15);
        assert_eq!(Clock::new(1e-7, 1e-4).steps, 1000);
    }

    #[test]
    fn output_times_fall_on_steps_or_between_them() {
        let clock = Clock::new(0.1, 1.0);
        let stops = stops(&clock, Some(0.25), &[0.3, 0.5, 1.0]);
        let brief: Vec<_> = stops.iter().map(|s| (s.t, s.step, s.series, s.snapshot)).collect();
        assert_eq!(
            brief,
            [
                (0.0, 0, true, false),
                (0.25, 2, true, false),
                (0.3, 3, false, true),
                (0.5, 5, true, true),
                (0.75, 7, true, false),
                (1.0, 10, true, true)
            ]
        );
        assert_eq!(stops[2].fraction, 0.0);
        assert!((stops[1].fraction - 0.5).abs() < 1e-12);
    }

    #[test]
    fn every_output_time_lies_in_a_step_and_the_last_one_at_the_end() {
        for exponent in 1..=9 {
            for m in [1, 2, 3, 5, 7] {
                let tau = f64::from(m) * 10f64.powi(-exponent);
                for (steps, rows) in [(10, 10), (10, 7), (97, 10), (1000, 100), (3, 30)] {
                    let t_end = tau * f64::from(steps);
                    let clock = Clock::new(tau, t_end);
                    let dt = t_end / f64::from(rows);
                    let stops = stops(&clock, Some(dt), &[t_end, 0.5 * t_end]);
                    for stop in &stops {
                        assert!((0.0..1.0).contains(&stop.fraction), "tau {tau}, t_end {t_end}: {stop:?}");
                        assert!(stop.step < clock.steps || stop.fraction == 0.0, "{stop:?}");
                        let t = clock.inside(stop.step, stop.fraction);
                        assert!((t - stop.t).abs() <= 1e-8 * tau.max(stop.t), "tau {tau}: {stop:?} is at {t}");
                    }
                    let last = stops[stops.len() - 1];
                    assert_eq!((last.t, last.step, last.series, last.snapshot), (t_end, clock.steps, true, true));
                    assert_eq!(stops.iter().filter(|stop| stop.series).count(), rows as usize + 1);
                }
            }
        }
    }

    #[test]
    fn an_output_time_in_the_short_last_step_is_inside_it() {
        let clock = Clock::new(0.3, 1.0);
        let stop = Stop::new(&clock, 0.95, true, false);
        assert_eq!(stop.step, 3);
        assert!((stop.fraction - 0.5).abs() < 1e-12);
        assert_eq!(Stop::new(&clock, 1.0, true, false).step, 4);
    }
}
