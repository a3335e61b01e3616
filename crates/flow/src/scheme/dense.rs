//! What lies inside an adaptive step: a polynomial through both of its ends. Twin of `shaders/dense.wgsl`.

use super::{Curve, State, member::Progress, state::is_of_places};
use crate::number::{BIG, Number, Real, ln_ratio};

/// Multiple of ε below which the derivatives of ln excess are mostly rounding: their weights amplify it a thousand
/// times, and the excess is a small difference of numbers near 1.
pub const RESOLVED: f64 = 131_072.0;
/// Number of halvings that find the place of an event: beyond the precision of every number.
pub const BISECTIONS: u32 = 54;

/// Where inside a step, near its start and near its end, observables are computed to tell how they leave the one and
/// come to the other.
pub const LOOKS: [f64; 2] = [0.0625, 0.9375];

/// A value and its first and second derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet<T> {
    /// The value.
    pub value: T,
    /// The first derivative.
    pub slope: T,
    /// The second derivative.
    pub bend: T,
}

/// The polynomial of degree 5 with given values and derivatives at both ends of a step, with time from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arc<T> {
    /// At the start.
    pub start: Jet<T>,
    /// At the end.
    pub end: Jet<T>,
}

impl<T: Real> Jet<T> {
    /// Returns the jet with these derivatives, taken by a unit of time that is 1/`ratio` of that of the new one.
    fn scaled(value: T, slope: T, bend: T, ratio: T) -> Jet<T> {
        Jet { value, slope: ratio * slope, bend: ratio * ratio * bend }
    }
}

impl<T: Real> Arc<T> {
    /// Returns the cubic with a value at the start, and value and derivatives at the end: for the first step of all.
    pub fn first(start: T, end: Jet<T>) -> Arc<T> {
        let (three, six, half) = (T::of(3.0), T::of(6.0), T::of(0.5));
        let cube = end.value - start - end.slope + half * end.bend;
        let slope = end.slope - end.bend + three * cube;
        Arc { start: Jet { value: start, slope, bend: end.bend - six * cube }, end }
    }

    /// Returns the value at the fraction `at` of the step.
    pub fn at(&self, at: T) -> T {
        let [third, fourth, fifth] = self.powers();
        let Jet { value, slope, bend } = self.start;
        value + at * (slope + at * (T::of(0.5) * bend + at * (third + at * (fourth + at * fifth))))
    }

    /// Returns the coefficients of the third, fourth and fifth power.
    fn powers(&self) -> [T; 3] {
        let (three, four, six) = (T::of(3.0), T::of(4.0), T::of(6.0));
        let (seven, eight, ten, fifteen) = (T::of(7.0), T::of(8.0), T::of(10.0), T::of(15.0));
        let half = T::of(0.5);
        let Arc { start: a, end: b } = self;
        let rise = b.value - a.value;
        let third = ten * rise - six * a.slope - four * b.slope + half * (b.bend - three * a.bend);
        let fourth = eight * a.slope + seven * b.slope - fifteen * rise + half * (three * a.bend) - b.bend;
        let fifth = six * rise - three * (a.slope + b.slope) + half * (b.bend - a.bend);
        [third, fourth, fifth]
    }

    /// Returns how much of the value and the derivatives at each end goes into the value at the fraction `at` of a step
    /// of length h. Those at its start are in units of the step before, of length `before`; 0 if there was none.
    pub fn weights(at: T, h: T, before: T) -> Arc<T> {
        let none = Jet::default();
        let unit = T::of(1.0);
        let (one, sloped, bent) =
            (Jet { value: unit, ..none }, Jet { slope: unit, ..none }, Jet { bend: unit, ..none });
        let ends = |start: Jet<T>, end: Jet<T>| Arc { start, end }.at(at);
        let zero = T::of(0.0);
        if before.le(zero) {
            let first = |start: T, end: Jet<T>| Arc::first(start, end).at(at);
            let end = Jet { value: first(zero, one), slope: first(zero, sloped), bend: first(zero, bent) };
            return Arc { start: Jet { value: first(unit, none), ..none }, end };
        }
        let start = Jet::scaled(ends(one, none), ends(sloped, none), ends(bent, none), h / before);
        Arc { start, end: Jet { value: ends(none, one), slope: ends(none, sloped), bend: ends(none, bent) } }
    }

    /// Returns the slope at the fraction `at` of the step.
    fn slope_at(&self, at: T) -> T {
        let (three, four, five) = (T::of(3.0), T::of(4.0), T::of(5.0));
        let [third, fourth, fifth] = self.powers();
        self.start.slope + at * (self.start.bend + at * (three * third + at * (four * fourth + at * (five * fifth))))
    }

    /// Returns whether the value falls at the start and rises at the end.
    fn dips(&self) -> bool {
        !(T::of(0.0).le(self.start.slope) || self.end.slope.le(T::of(0.0)))
    }

    /// Returns the fraction of the step up to which the value falls: less than 1 if it rises at the end.
    fn turn(&self) -> T {
        let (zero, half) = (T::of(0.0), T::of(0.5));
        let (mut low, mut high) = (zero, T::of(1.0));
        if !self.dips() {
            return high;
        }
        for _ in 0..BISECTIONS {
            let middle = half * (low + high);
            if self.slope_at(middle).le(zero) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// Returns the fraction of the step at which the value falls to `target`, which lies between those at the start and
    /// at `high`.
    pub fn crossing(&self, target: T, mut high: T) -> T {
        let half = T::of(0.5);
        let mut low = T::of(0.0);
        for _ in 0..BISECTIONS {
            let middle = half * (low + high);
            if self.at(middle).le(target) {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    }

    /// Returns whether all derivatives are finite and of a size that the step can have.
    pub fn is_tame(&self) -> bool {
        let (Jet { slope: a, bend: b, .. }, Jet { slope: c, bend: d, .. }) = (self.start, self.end);
        let most = T::of(BIG);
        a.abs().le(most) && b.abs().le(most) && c.abs().le(most) && d.abs().le(most)
    }
}

impl<N: Number> Arc<N> {
    /// Sets one lane.
    #[inline(always)]
    pub(super) fn set_lane(&mut self, lane: usize, of: Arc<N::Real>) {
        for (own, of) in [(&mut self.start, of.start), (&mut self.end, of.end)] {
            own.value.set_lane(lane, of.value);
            own.slope.set_lane(lane, of.slope);
            own.bend.set_lane(lane, of.bend);
        }
    }

    /// Puts the curve inside the step to `new` into `state.part`, by the [`weights`](Arc::weights) that this is.
    #[inline(always)]
    pub(super) fn look(&self, state: &mut State<N>, new: &Curve<N>) {
        let Arc { start: a, end: b } = *self;
        let State { curve, slope, bend, slope_before, bend_before, part, .. } = state;
        let starts = curve.fields().into_iter().zip(slope.fields()).zip(bend.fields());
        // During an attempt the derivatives at its end are in the place of those before.
        let ends = new.fields().into_iter().zip(slope_before.fields()).zip(bend_before.fields());
        for (field, (to, (start, end))) in part.fields_mut().into_iter().zip(starts.zip(ends)).enumerate() {
            let is_place = is_of_places(field);
            let (((x0, u0), s0), ((x1, u1), s1)) = (start, end);
            for i in 0..x0.len() {
                let [from, end] = if is_place { [N::coordinate(x0[i]), N::coordinate(x1[i])] } else { [x0[i], x1[i]] };
                let inside = a.value * from
                    + a.slope * u0[i]
                    + a.bend * s0[i]
                    + b.value * end
                    + b.slope * u1[i]
                    + b.bend * s1[i];
                to[i] = if is_place { N::placed(inside) } else { inside };
            }
            to.close();
        }
    }
}

/// An accepted step.
pub(super) struct Taken<T> {
    /// Its length, if adaptive.
    pub(super) h: T,
    /// The excess before.
    pub(super) before: T,
    /// The excess after.
    pub(super) after: T,
    /// How the excess falls on the way.
    pub(super) fall: Fall<T>,
    /// The gap between k and the polygon.
    pub(super) gap: T,
}

/// The excess inside a step.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fall<T> {
    /// On a straight line.
    Straight,
    /// Its logarithm, relative to the start, on a straight line to this value.
    Exponential(T),
    /// Its logarithm, relative to the start, on a polynomial.
    Smooth(Arc<T>),
}

impl<T: Real> Fall<T> {
    /// The fall in an adaptive step of length h from `before` to `after`, with the derivatives of ln excess at its end,
    /// which are `exact` or a small difference.
    pub(super) fn of(
        progress: &Progress<T>,
        h: T,
        [before, after]: [T; 2],
        [slope, bend]: [T; 2],
        exact: bool,
    ) -> Fall<T> {
        let zero = T::of(0.0);
        if before.le(zero) || after.le(zero) {
            return Fall::Straight;
        }
        let fallen = ln_ratio(before, after);
        let end = Jet { value: fallen, slope, bend };
        let arc = if progress.taken.le(zero) {
            Arc::first(zero, end)
        } else {
            let ratio = h / progress.taken;
            Arc { start: Jet::scaled(zero, progress.slope, progress.bend, ratio), end }
        };
        let resolved = exact || T::of(RESOLVED * T::EPSILON).le(after);
        if resolved && arc.is_tame() { Fall::Smooth(arc) } else { Fall::Exponential(fallen) }
    }
}

impl<T: Real> Taken<T> {
    /// The excess at the fraction `at` of the step.
    pub(super) fn inside(&self, at: T) -> T {
        match self.fall {
            Fall::Straight => self.before + at * (self.after - self.before),
            Fall::Exponential(fallen) => self.before * (at * fallen).exponential(),
            Fall::Smooth(arc) => self.before * arc.at(at).exponential(),
        }
    }

    /// The fraction of the step at which the excess falls to `excess`; its end if it already had before.
    pub(super) fn fraction_at(&self, excess: T) -> T {
        if self.before.le(excess) {
            return T::of(1.0);
        }
        match self.fall {
            Fall::Straight => (self.before - excess) / (self.before - self.after),
            Fall::Exponential(fallen) => ln_ratio(self.before, excess) / fallen,
            Fall::Smooth(arc) => {
                let turn = if self.after.le(excess) { T::of(1.0) } else { arc.turn() };
                arc.crossing(ln_ratio(self.before, excess), turn)
            }
        }
    }

    /// Whether the excess falls to `excess`, even if it then rises again.
    pub(super) fn falls_to(&self, excess: T) -> bool {
        let dips = |arc: &Arc<T>| {
            if excess.le(T::of(0.0)) || !arc.dips() {
                return false;
            }
            let turn = arc.turn();
            !T::of(1.0).le(turn) && arc.at(turn).le(ln_ratio(self.before, excess))
        };
        self.after.le(excess) || matches!(&self.fall, Fall::Smooth(arc) if dips(arc))
    }
}

/// Returns the curve at the fraction `at` of the last adaptive step, on the host.
pub fn inside(state: &State<f64>, progress: &Progress<f64>, at: f64) -> Curve<f64> {
    let mut curve = state.curve.clone();
    if at == 1.0 {
        return curve;
    }
    let State { slope, bend, before, slope_before, bend_before, .. } = state;
    let ends = slope.fields().into_iter().zip(bend.fields());
    let starts = before.fields().into_iter().zip(slope_before.fields()).zip(bend_before.fields());
    // Derivatives are in units of their own steps.
    let ratio = progress.taken / progress.taken_before;
    for (field, ((slope, bend), ((start, slope_before), bend_before))) in
        curve.fields_mut().into_iter().zip(ends.zip(starts))
    {
        for i in 0..field.len() {
            let end = Jet { value: field[i], slope: slope[i], bend: bend[i] };
            let arc = if progress.taken_before > 0.0 {
                Arc { start: Jet::scaled(start[i], slope_before[i], bend_before[i], ratio), end }
            } else {
                Arc::first(start[i], end)
            };
            field[i] = arc.at(at);
        }
        field.close();
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jet([value, slope, bend]: [f64; 3]) -> Jet<f64> {
        Jet { value, slope, bend }
    }

    #[test]
    fn a_polynomial_of_degree_five_is_exact() {
        let p = |t: f64| 1.0 + t * (-2.0 + t * (0.5 + t * (3.0 + t * (-1.5 + t * 0.7))));
        let slope = |t: f64| -2.0 + t * (1.0 + t * (9.0 + t * (-6.0 + t * 3.5)));
        let bend = |t: f64| 1.0 + t * (18.0 + t * (-18.0 + t * 14.0));
        let [start, end] = [0.0, 1.0].map(|t| jet([p(t), slope(t), bend(t)]));
        let arc = Arc { start, end };
        for i in 0..=10 {
            let t = 0.1 * f64::from(i);
            assert!((arc.at(t) - p(t)).abs() < 1e-14, "{t}: {} {}", arc.at(t), p(t));
        }
    }

    #[test]
    fn without_derivatives_at_the_start_a_cubic_is_exact() {
        let p = |t: f64| 1.0 + t * (-2.0 + t * (0.5 - t * 3.0));
        let arc = Arc::first(1.0, jet([p(1.0), -10.0, -17.0]));
        for i in 0..=10 {
            let t = 0.1 * f64::from(i);
            assert!((arc.at(t) - p(t)).abs() < 1e-14, "{t}");
        }
    }

    #[test]
    fn weights_give_the_value_of_the_polynomial() {
        let [start, end] = [jet([1.0, -2.0, 0.5]), jet([0.3, -0.7, 1.1])];
        let dot = |a: Jet<f64>, b: Jet<f64>| a.value * b.value + a.slope * b.slope + a.bend * b.bend;
        for at in LOOKS {
            let weights = Arc::weights(at, 3.0, 2.0);
            let arc = Arc { start: Jet::scaled(start.value, start.slope, start.bend, 1.5), end };
            assert!((dot(weights.start, start) + dot(weights.end, end) - arc.at(at)).abs() < 1e-14, "{at}");
            let (weights, arc) = (Arc::weights(at, 3.0, 0.0), Arc::first(start.value, end));
            assert!((dot(weights.start, start) + dot(weights.end, end) - arc.at(at)).abs() < 1e-14, "{at}");
        }
    }

    #[test]
    fn an_event_is_found_where_an_exponential_is() {
        let at = |t: f64| [(-0.8 * t).exp(), -0.8 * (-0.8 * t).exp(), 0.64 * (-0.8 * t).exp()];
        let arc = Arc { start: jet(at(0.0)), end: jet(at(1.0)) };
        let found = arc.crossing(at(0.3)[0], 1.0);
        // A parabola or a cubic would be off by 10⁻³ or more.
        assert!((found - 0.3).abs() < 1e-5, "{found}");
        assert!((arc.crossing(at(1.0)[0], 1.0) - 1.0).abs() < 1e-12);
        let wild = Arc { start: jet([1.0, f64::NAN, 0.0]), end: jet([0.0; 3]) };
        assert!((0.0..=1.0).contains(&wild.crossing(0.5, 1.0)) && !wild.is_tame());
    }

    #[test]
    fn an_excess_that_dips_inside_a_step_falls_to_what_lies_above_the_dip() {
        // ln excess: down to -0.09 at 0.3, and up to 0.4 at the end.
        let log = |t: f64| (t - 0.3).powi(2) - 0.09;
        let arc = Arc { start: jet([0.0, -0.6, 2.0]), end: jet([log(1.0), 1.4, 2.0]) };
        let taken = Taken { h: 1.0, before: 2.0, after: 2.0 * log(1.0).exp(), fall: Fall::Smooth(arc), gap: 0.0 };
        assert!((arc.turn() - 0.3).abs() < 1e-12);
        let level = |t: f64| 2.0 * log(t).exp();
        for at in [0.1, 0.2, 0.29] {
            assert!(taken.falls_to(level(at)) && (taken.fraction_at(level(at)) - at).abs() < 1e-9, "{at}");
        }
        assert!(!taken.falls_to(0.999 * level(0.3)) && !taken.falls_to(0.0) && taken.falls_to(taken.after));
        // Nothing lies below the end of a fall.
        let fall = Fall::Smooth(Arc { start: jet([0.0, -1.0, 0.0]), end: jet([-1.0, -1.0, 0.0]) });
        let falls = Taken { after: 2.0 * (-1.0_f64).exp(), fall, ..taken };
        assert!(!falls.falls_to(0.99 * falls.after) && falls.falls_to(falls.after));
    }
}
