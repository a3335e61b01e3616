//! When the events of a member happen.
//!
//! The back end pauses the member after the step in which an observable reaches the next level on either side. The host
//! then finds the place inside the step, to the order of the step: with fixed steps on the straight line between both
//! reports, with adaptive ones on the curves inside, whose first one past the level is found between two of them.
//!
//! It also pauses after an adaptive step in which an observable may have turned round beyond the level, though neither
//! end of the step is there: where it leaves the start towards the level and comes to the end from there, steeply
//! enough for both lines to meet beyond it ([`passes_level`](curvelax_flow::scheme::observe::passes_level)). The host
//! then looks for the extremum on the curves inside.

use super::{Time, Trajectory, watch::Watch};
use curvelax_flow::scheme::{State, dense::LOOKS, member::Observed, observe::falls_inside};

/// Parts of an adaptive step in which a crossing is looked for before it is narrowed down: an observable may turn round
/// inside a step, even more than once.
const PARTS_OF_STEP: u32 = 8;
/// Width of the narrowed part, as a fraction of the step, and bounds on the attempts, by secants and in all.
const NARROW: f64 = 1e-12;
const MAX_SECANTS: u32 = 16;
const MAX_ATTEMPTS: u32 = 64;
/// Cuts by the golden section that narrow down a turning point. The extremum is then known to the square of the width:
/// beyond the precision of the curves.
const CUTS: u32 = 32;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl Trajectory<'_> {
    /// Whether events happened in the last step that are found only by its curves.
    pub(super) fn events_need_state(&self) -> bool {
        let passed = self.may_have_passed();
        let wanted = |watch: &Watch| watch.is_due(&self.at.report.now) || (passed && watch.is_pending());
        matches!(self.time, Time::Adaptive(_)) && self.watches.iter().any(wanted)
    }

    /// Whether an observable may have reached a level inside the step after which the member paused, and left it again.
    /// In later dispatches the curves of that step may be gone.
    fn may_have_passed(&self) -> bool {
        self.at.counters.passed != 0 && self.needs_aim()
    }

    /// Finds the times of the events in the last step; `state` is needed if
    /// [`events_need_state`](Trajectory::events_need_state).
    pub(super) fn locate_events(&mut self, state: Option<&State<f64>>) {
        let passed = state.filter(|_| self.may_have_passed()).map(|state| (state, self.looks(state)));
        for place in 0..self.watches.len() {
            let watch = self.watches[place];
            if watch.is_due(&self.at.report.now) {
                self.watches[place].t = Some(self.time_of(&watch, state));
            } else if let Some((state, looks)) = passed.filter(|_| watch.is_pending()) {
                // Each by its own level, so that no event depends on what else is watched.
                let distances = looks.map(|at| watch.distance(&at));
                let found = if falls_inside(distances, 0.0) { self.first_past(&watch, state) } else { None };
                self.watches[place].t = found.map(|at| self.time_at(at));
            }
        }
    }

    /// The observables at both ends of the last adaptive step and at the two looks inside.
    fn looks(&self, state: &State<f64>) -> [Observed<f64>; 4] {
        let [early, late] = LOOKS.map(|at| self.observe_inside(at, &self.curve_at(at, state)));
        [self.at.report.before, early, late, self.at.report.now]
    }

    /// When it is reached in the last step.
    fn time_of(&self, watch: &Watch, state: Option<&State<f64>>) -> f64 {
        match (self.time, state) {
            (Time::Fixed(clock), _) => {
                let fraction = watch.on_line(&self.at.report.before, &self.at.report.now);
                clock.inside(self.at.counters.steps.saturating_sub(1), fraction)
            }
            (Time::Adaptive(_), Some(state)) => self.time_at(self.first_past(watch, state).unwrap_or(1.0)),
            (Time::Adaptive(_), None) => self.now(),
        }
    }

    /// The time at a fraction of the last adaptive step.
    fn time_at(&self, fraction: f64) -> f64 {
        let progress = &self.at.report.progress;
        let past = (1.0 - fraction) * progress.taken;
        // The clock counts in ticks, and may end one of them late.
        ((progress.time_high + (progress.time_low - past)) * self.time_unit).clamp(0.0, self.now())
    }

    /// Where inside the last adaptive step it is first reached, as a fraction of it.
    fn first_past(&self, watch: &Watch, state: &State<f64>) -> Option<f64> {
        let ends = [&self.at.report.before, &self.at.report.now].map(|at| watch.distance(at));
        first_past(ends, |at| watch.distance(&self.observe_inside(at, &self.curve_at(at, state))))
    }
}

/// The first place in a step at which a distance is 0 or less, if it is found, by the distances at both `ends` and
/// inside: from part to part, at the end of one or where the distance turns round.
fn first_past(ends: [f64; 2], distance: impl Fn(f64) -> f64) -> Option<f64> {
    let place = |part: u32| match part {
        0 => (0.0, ends[0]),
        PARTS_OF_STEP.. => (1.0, ends[1]),
        _ => (f64::from(part) / f64::from(PARTS_OF_STEP), distance(f64::from(part) / f64::from(PARTS_OF_STEP))),
    };
    let (mut before, mut own) = (place(0), place(0));
    if own.1 <= 0.0 {
        return Some(0.0);
    }
    for part in 1..=PARTS_OF_STEP + 1 {
        let next = place(part);
        if own.1 <= before.1 && own.1 <= next.1 {
            let turn = lowest(own, [before.0, next.0], &distance);
            if turn.1 <= 0.0 {
                return Some(narrowed(before, turn, distance));
            }
        }
        if next.1 <= 0.0 {
            return Some(narrowed(own, next, distance));
        }
        (before, own) = (own, next);
    }
    None
}

/// A place between `ends` with a low distance, by the golden section: the first that is found at 0 or below, or else
/// the lowest one.
fn lowest(known: (f64, f64), [mut low, mut high]: [f64; 2], distance: impl Fn(f64) -> f64) -> (f64, f64) {
    let mut best = known;
    let place = |at: f64| (at, distance(at));
    let (mut left, mut right) = (place(high - GOLDEN * (high - low)), place(low + GOLDEN * (high - low)));
    for _ in 0..CUTS {
        best = [left, right].into_iter().fold(best, |best, one| if one.1 < best.1 { one } else { best });
        if best.1 <= 0.0 {
            break;
        }
        if left.1 <= right.1 {
            (high, right) = (right.0, left);
            left = place(high - GOLDEN * (high - low));
        } else {
            (low, left) = (left.0, right);
            right = place(low + GOLDEN * (high - low));
        }
    }
    best
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
    fn a_distance_that_turns_round_inside_a_step_is_found_where_it_is_first_zero() {
        let parabola = |at: f64, depth: f64| move |x: f64| (x - at).powi(2) - depth * depth;
        let found = |distance: &dyn Fn(f64) -> f64| first_past([distance(0.0), distance(1.0)], distance);
        for (at, depth) in [(0.3, 0.01), (0.5, 1e-5), (0.02, 1e-3), (0.99, 1e-4), (0.4, 0.39), (0.125, 1e-4)] {
            let t = found(&parabola(at, depth)).expect("it turns round below 0");
            assert!((t - (at - depth)).abs() < 1e-9, "{at} {depth}: {t}");
        }
        // A smallest curvature has corners where it goes from one node to another.
        let corner = |x: f64| (x - 0.7).abs() - 1e-3;
        assert!((found(&corner).unwrap() - 0.699).abs() < 1e-9);
        // The first of two.
        let twice = |x: f64| parabola(0.3, 0.01)(x).min(parabola(0.8, 0.1)(x));
        assert!((found(&twice).unwrap() - 0.29).abs() < 1e-9);
        let above = |x: f64| parabola(0.3, 0.0)(x) + 1e-9;
        let falls = |x: f64| (-x).exp();
        assert_eq!((found(&above), found(&falls)), (None, None));
    }

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
