//! Time: the clock of a run with fixed τ, the clock of adaptive steps, and the output times.

use std::ops::RangeInclusive;

use curvelax_flow::{
    number::Precision,
    scheme::{decay, member},
};

/// Relative distance from a step at which an output time counts as on it.
const ON_A_STEP: f64 = 1e-9;

/// Steps of length τ from 0 to the final time; the last is shorter if τ does not divide it.
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
    /// Creates the clock of a run; `t_end/tau` is at most 10⁹.
    pub fn new(tau: f64, t_end: f64) -> Clock {
        let ratio = t_end / tau;
        let whole = ratio.round();
        let steps = if (ratio - whole).abs() <= ON_A_STEP * whole { whole } else { ratio.ceil() };
        Clock { tau, t_end, steps: steps.max(1.0) as u32 }
    }

    /// Returns the time after `step` steps.
    pub fn time(&self, step: u32) -> f64 {
        if step >= self.steps { self.t_end } else { f64::from(step) * self.tau }
    }

    /// Returns the time at `fraction` of the step after `step` steps.
    pub fn inside(&self, step: u32, fraction: f64) -> f64 {
        let (before, after) = (self.time(step), self.time(step + 1));
        before + fraction.clamp(0.0, 1.0) * (after - before)
    }

    /// Returns whether the last step is shorter than τ.
    pub fn ends_short(&self) -> bool {
        self.t_end < f64::from(self.steps) * self.tau * (1.0 - ON_A_STEP)
    }

    /// Returns the length of the last step.
    pub fn last(&self) -> f64 {
        self.t_end - f64::from(self.steps - 1) * self.tau
    }

    /// Locates the output time `t`: the step that reaches it, and the fraction of that step, in (0, 1].
    pub fn locate(&self, t: f64) -> (u32, f64) {
        if t >= self.t_end * (1.0 - ON_A_STEP) {
            return (self.steps, 1.0);
        }
        let ratio = t / self.tau;
        let near = ratio.round();
        // If the last step is short, the one before it is the last to end on a multiple of τ.
        if (ratio - near).abs() <= ON_A_STEP * near.max(1.0) && near < f64::from(self.steps) {
            return (near as u32, 1.0);
        }
        let step = (ratio.floor() as u32).min(self.steps - 1);
        let inside = (t - self.time(step)) / (self.time(step + 1) - self.time(step));
        (step + 1, inside.clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON))
    }
}

/// The split of adaptive time into two parts that both fit the precision, see
/// [`scheme::pace`](curvelax_flow::scheme::pace).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ticks {
    /// Unit of the high part, a power of two.
    pub unit: f64,
    /// Unit of the low part, a power of two.
    pub tick: f64,
}

impl Ticks {
    /// Creates the parts for a run to `t_end`, one of the [`times`] of a precision, in its numbers: ticks of about 2ε²
    /// of the end, but not below its smallest normal number.
    pub fn new(t_end: f64, precision: Precision) -> Ticks {
        let epsilon = precision.epsilon();
        // The high part must count to the end without rounding.
        let unit = (2.0 * epsilon * t_end).log2().ceil().exp2().max(range(precision).start() / epsilon);
        Ticks { unit, tick: unit * epsilon }
    }

    /// Splits `t`, rounded up to a whole tick, into high and low part.
    pub fn split(&self, t: f64) -> (f64, f64) {
        let high = (t / self.unit).floor() * self.unit;
        (high, ((t - high) / self.tick).ceil() * self.tick)
    }
}

/// Returns the positive numbers of a precision, from the smallest normal to the largest one.
pub fn range(precision: Precision) -> RangeInclusive<f64> {
    match precision {
        Precision::F32 => f32::MIN_POSITIVE.into()..=f32::MAX.into(),
        Precision::F64 => f64::MIN_POSITIVE..=f64::MAX,
    }
}

/// Returns the times to which a precision counts in [`Ticks`]: their parts have all its digits.
pub fn times(precision: Precision) -> RangeInclusive<f64> {
    let (range, epsilon) = (range(precision), precision.epsilon());
    range.start() / epsilon..=range.end() * epsilon
}

/// An output time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// The time.
    pub t: f64,
    /// Whether a row of `series.csv` is due.
    pub series: bool,
    /// Whether a snapshot is due.
    pub snapshot: bool,
    /// Whether a picture of the member during the run is due.
    pub frame: bool,
    /// Whether its energy is recorded.
    pub energy: bool,
}

/// Returns the times at which every member's excess is recorded, both ends included.
pub fn grid(t_end: f64) -> impl Iterator<Item = f64> {
    (0..=member::PARTS).map(move |part| decay::share::<f64>(part) * t_end)
}

/// The output times of a run, in order. Times for series rows only are computed from their numbers: a million of them
/// take no memory.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    rows: SeriesTimes,
    others: Vec<Other>,
}

/// The times of the series.
#[derive(Clone, Copy, Debug, Default)]
struct SeriesTimes {
    t_end: f64,
    every: f64,
    count: usize,
}

/// An output other than a mere row of the series.
#[derive(Clone, Copy, Debug)]
struct Other {
    output: Output,
    /// Its index among all outputs.
    place: usize,
    /// Outputs without a row, up to and including this one.
    without_row: usize,
}

impl SeriesTimes {
    fn time(&self, row: usize) -> f64 {
        at_most(self.t_end, row as f64 * self.every)
    }

    /// The number of rows before `t`.
    fn before(&self, t: f64) -> usize {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low.midpoint(high);
            if self.time(middle) < t { low = middle + 1 } else { high = middle }
        }
        low
    }
}

/// `t`, or the end if they differ only by rounding.
fn at_most(t_end: f64, t: f64) -> f64 {
    if t >= t_end * (1.0 - ON_A_STEP) { t_end } else { t }
}

impl Outputs {
    /// Creates the outputs of a run to `t_end`: every `series` from 0 on, and the times of `others`: of snapshots, of
    /// frames, and of energies.
    pub fn new(t_end: f64, series: Option<f64>, others: [&[f64]; 3]) -> Outputs {
        let count = series.map_or(0, |dt| (t_end / dt * (1.0 + ON_A_STEP)) as usize + 1);
        let rows = SeriesTimes { t_end, every: series.unwrap_or(0.0), count };
        let output = |t: f64, kind: usize| Output {
            t: at_most(t_end, t),
            series: false,
            snapshot: kind == 0,
            frame: kind == 1,
            energy: kind == 2,
        };
        let all = others.into_iter().enumerate();
        let mut all: Vec<Output> = all.flat_map(|(kind, times)| times.iter().map(move |t| output(*t, kind))).collect();
        all.sort_by(|a, b| a.t.total_cmp(&b.t));
        all.dedup_by(|later, earlier| {
            let same = later.t == earlier.t;
            if same {
                earlier.snapshot |= later.snapshot;
                earlier.frame |= later.frame;
                earlier.energy |= later.energy;
            }
            same
        });
        let mut without_row = 0;
        let other = |mut output: Output| {
            let before = rows.before(output.t);
            output.series = before < rows.count && rows.time(before) == output.t;
            let place = before + without_row;
            without_row += usize::from(!output.series);
            Other { output, place, without_row }
        };
        let others = all.into_iter().map(other).collect();
        Outputs { rows, others }
    }

    /// Returns the number of outputs.
    pub fn len(&self) -> usize {
        self.rows.count + self.others.last().map_or(0, |last| last.without_row)
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the output at `place`, from 0.
    pub fn get(&self, place: usize) -> Option<Output> {
        let before = self.others.partition_point(|other| other.place < place);
        match self.others.get(before) {
            Some(other) if other.place == place => return Some(other.output),
            _ => {}
        }
        let row = place - self.others[..before].last().map_or(0, |last| last.without_row);
        let due = || Output { t: self.rows.time(row), series: true, snapshot: false, frame: false, energy: false };
        (row < self.rows.count).then(due)
    }

    /// Iterates over the outputs, starting at `place`.
    pub fn from(&self, place: usize) -> impl Iterator<Item = Output> {
        (place..).map_while(|place| self.get(place))
    }
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
        let outputs = Outputs::new(1.0, Some(0.25), [&[0.3, 0.5, 1.0], &[], &[]]);
        let brief: Vec<_> = outputs.from(0).map(|o| (o.t, clock.locate(o.t).0, o.series, o.snapshot)).collect();
        assert_eq!(
            brief,
            [
                (0.0, 0, true, false),
                (0.25, 3, true, false),
                (0.3, 3, false, true),
                (0.5, 5, true, true),
                (0.75, 8, true, false),
                (1.0, 10, true, true)
            ]
        );
        assert_eq!(clock.locate(0.3).1, 1.0);
        assert!((clock.locate(0.25).1 - 0.5).abs() < 1e-12);
    }

    /// The outputs of a run by sorting all of them.
    fn sorted(t_end: f64, series: Option<f64>, snapshots: &[f64], frames: &[f64]) -> Vec<(f64, [bool; 3])> {
        let rows = series.map_or(0, |dt| (t_end / dt * (1.0 + ON_A_STEP)) as u64 + 1);
        let rows = (0..rows).map(|row| (row as f64 * series.unwrap(), [true, false, false]));
        let all = rows.chain(snapshots.iter().map(|t| (*t, [false, true, false])));
        let all = all.chain(frames.iter().map(|t| (*t, [false, false, true])));
        let mut all: Vec<_> = all.map(|(t, due)| (at_most(t_end, t), due)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut merged: Vec<(f64, [bool; 3])> = Vec::new();
        for (t, due) in all {
            match merged.last_mut() {
                Some(last) if last.0 == t => (0..3).for_each(|i| last.1[i] |= due[i]),
                _ => merged.push((t, due)),
            }
        }
        merged
    }

    #[test]
    fn outputs_by_number_are_those_that_a_list_of_all_of_them_has() {
        let frames: Vec<f64> = grid(1.7).collect();
        for series in [None, Some(0.1), Some(0.17), Some(1.7 / 3.0), Some(1.7), Some(2.0), Some(1e-3)] {
            for snapshots in [&[][..], &[0.0], &[0.1, 0.17, 0.3, 0.5], &[0.0, 1.0, 1.7 * (1.0 - 1e-12), 1.7]] {
                for frames in [&[][..], &frames] {
                    let outputs = Outputs::new(1.7, series, [snapshots, frames, &[]]);
                    let found: Vec<_> = outputs.from(0).map(|o| (o.t, [o.series, o.snapshot, o.frame])).collect();
                    assert_eq!(found, sorted(1.7, series, snapshots, frames), "{series:?} {snapshots:?}");
                    assert_eq!(outputs.len(), found.len());
                }
            }
        }
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
                    let outputs = Outputs::new(t_end, Some(dt), [&[t_end, 0.5 * t_end], &[], &[]]);
                    for output in outputs.from(0) {
                        let (step, fraction) = clock.locate(output.t);
                        assert!(fraction > 0.0 && fraction <= 1.0, "tau {tau}, t_end {t_end}: {output:?}");
                        assert!(step <= clock.steps, "{output:?}");
                        let t = if step == 0 { 0.0 } else { clock.inside(step - 1, fraction) };
                        assert!((t - output.t).abs() <= 1e-8 * tau.max(output.t), "tau {tau}: {output:?} is at {t}");
                    }
                    let last = outputs.get(outputs.len() - 1).unwrap();
                    assert_eq!((last.t, last.series, last.snapshot), (t_end, true, true));
                    assert_eq!(clock.locate(last.t), (clock.steps, 1.0));
                    assert_eq!(outputs.from(0).filter(|output| output.series).count(), rows as usize + 1);
                }
            }
        }
    }

    #[test]
    fn an_output_time_in_the_short_last_step_is_inside_it() {
        let clock = Clock::new(0.3, 1.0);
        let (step, fraction) = clock.locate(0.95);
        assert_eq!(step, 4);
        assert!((fraction - 0.5).abs() < 1e-12);
        assert_eq!(clock.locate(1.0), (4, 1.0));
    }

    #[test]
    fn ticks_count_to_the_end_in_f32_and_f64() {
        for t_end in [2.0, 1e6, 1e-20, 0.17, 1e-30, 1e31] {
            for precision in [Precision::F32, Precision::F64] {
                let (ticks, epsilon) = (Ticks::new(t_end, precision), precision.epsilon());
                let (high, low) = ticks.split(t_end);
                assert!(high / ticks.unit <= 1.0 / epsilon, "the end is {} units", high / ticks.unit);
                assert!(low <= ticks.unit && (high + low - t_end).abs() <= ticks.tick.max(1e-15 * t_end));
                assert_eq!((ticks.unit.log2().fract(), ticks.tick.log2().fract()), (0.0, 0.0));
                assert!(ticks.tick >= *range(precision).start() && times(precision).contains(&t_end));
            }
        }
    }
}
