//! When the events of a member happen.
//!
//! The back end pauses the member after the step in which an observable reaches the next level on either side. The host
//! then finds the place inside the step, to the order of the step: with fixed steps on the straight line between both
//! reports, with adaptive ones on the curves inside, whose first one past the level is found between two of them.

use super::{Time, Trajectory, watch::Watch};
use crate::scheme::State;

/// Parts of an adaptive step in which a crossing is looked for before it is narrowed down: an observable may turn round
/// inside a step.
const PARTS_OF_STEP: u32 = 8;
/// Width of the narrowed part, as a fraction of the step, and bounds on the attempts, by secants and in all.
const NARROW: f64 = 1e-12;
const MAX_SECANTS: u32 = 16;
const MAX_ATTEMPTS: u32 = 64;

impl Trajectory<'_> {
    /// Whether events happened in the last step that are found only by its curves.
    pub(super) fn events_need_state(&self) -> bool {
        matches!(self.time, Time::Adaptive(_)) && self.watches.iter().any(|watch| watch.is_due(&self.report.now))
    }

    /// Finds the times of the events in the last step; `state` is needed if
    /// [`events_need_state`](Trajectory::events_need_state).
    pub(super) fn locate_events(&mut self, state: Option<&State<f64>>) {
        for place in 0..self.watches.len() {
            let watch = self.watches[place];
            if watch.is_due(&self.report.now) {
                self.watches[place].t = Some(self.time_of(&watch, state));
            }
        }
    }

    /// When it is reached in the last step.
    fn time_of(&self, watch: &Watch, state: Option<&State<f64>>) -> f64 {
        let progress = &self.report.progress;
        match (self.time, state) {
            (Time::Fixed(clock), _) => {
                let fraction = watch.on_line(&self.report.before, &self.report.now);
                clock.inside(self.counters.steps.saturating_sub(1), fraction)
            }
            (Time::Adaptive(_), Some(state)) => {
                let past = (1.0 - self.first_past(watch, state)) * progress.taken;
                // The clock counts in ticks, and may end one of them late.
                ((progress.time_high + (progress.time_low - past)) * self.time_unit).clamp(0.0, self.now())
            }
            (Time::Adaptive(_), None) => self.now(),
        }
    }

    /// Where inside the last adaptive step it is first reached, as a fraction of it.
    fn first_past(&self, watch: &Watch, state: &State<f64>) -> f64 {
        let distance = |at: f64| watch.distance(&self.observe_inside(at, &self.curve_at(at, state)));
        let mut before = (0.0, watch.distance(&self.report.before));
        if before.1 <= 0.0 {
            return 0.0;
        }
        for part in 1..=PARTS_OF_STEP {
            let at = f64::from(part) / f64::from(PARTS_OF_STEP);
            let past = (at, if part < PARTS_OF_STEP { distance(at) } else { watch.distance(&self.report.now) });
            if past.1 <= 0.0 {
                return narrowed(before, past, distance);
            }
            before = past;
        }
        1.0
    }
}

/// The first place at which a distance is 0, between one before and one past it: by secants whose older end counts half
/// (Illinois), and halvings for distances that are not smooth.
fn narrowed(mut before: (f64, f64), mut past: (f64, f64), distance: impl Fn(f64) -> f64) -> f64 {
    // Distances as secants take them, which may be less than they are.
    let (mut start, mut end) = (before.1, past.1);
    for attempt in 0..MAX_ATTEMPTS {
        let width = past.0 - before.0;
        if width <= NARROW || past.1 == 0.0 {
            break;
        }
        // A jump would keep secants at its ends.
        let halves = attempt % 3 == 2 || attempt >= MAX_SECANTS;
        let share = if halves { 0.5 } else { start / (start - end) };
        // Not the ends themselves, of which nothing would be learnt.
        let at = (before.0 + share * width).clamp(before.0 + 0.25 * NARROW, past.0 - 0.25 * NARROW);
        let found = distance(at);
        if found <= 0.0 {
            past = (at, found);
            (start, end) = (0.5 * start, found);
        } else {
            before = (at, found);
            (start, end) = (found, 0.5 * end);
        }
    }
    past.0
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn a_place_is_narrowed_down_in_few_attempts_also_where_the_distance_has_a_corner_or_a_jump() {
        for (distance, root) in [
            ((|x: f64| 0.3 - x) as fn(f64) -> f64, 0.3),
            (|x: f64| (-20.0 * x).exp() - 0.01, 100_f64.ln() / 20.0),
            (|x: f64| 0.5 - x.powi(9), 0.5_f64.powf(1.0 / 9.0)),
            (|x: f64| if x < 0.7 { 1e-3 } else { -5.0 }, 0.7),
            (|x: f64| (0.2 - x).max(10.0 * (0.1 - x)), 0.2),
        ] {
            let attempts = Cell::new(0);
            let counted = |x| {
                attempts.set(attempts.get() + 1);
                distance(x)
            };
            let found = narrowed((0.0, distance(0.0)), (1.0, distance(1.0)), counted);
            assert!((found - root).abs() < 1e-11, "{found} {root}");
            assert!(distance(found) <= 0.0 && attempts.get() < 64, "{} attempts", attempts.get());
        }
    }
}
