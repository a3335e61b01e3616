//! Where sweeps start: increments predicted from those of the last two solves. Twin of `shaders/start.wgsl`.
//!
//! An increment over a time τ that ends at t is τ·v(t), and v is smooth. Two increments therefore predict the next one
//! to second order, which saves most of the sweeps needed with the last one alone. In an adaptive attempt of length h,
//! with the whole step W and the half steps H₁ and H₂:
//!
//! | start of | from | because |
//! |---|---|---|
//! | W, after an accepted step | H₁, H₂ | the line through v(t - h'/2) and v(t), extended to t + h |
//! | W, after a refused step | its H₁, H₂ | the line through v(t + h'/2) and v(t + h') |
//! | H₁ | (V + W)/4 | the mean of v(t) and v(t + h); V is h·v(t) |
//! | H₂ | W/2 | both end at t + h |

use super::Increments;
use crate::number::Number;

/// The matrix that turns the increments and the remembered ones into the start of the next solve, and what to remember
/// then.
#[derive(Clone, Copy, Debug)]
pub struct Start<N>([[N; 2]; 2]);

impl<N: Number> Start<N> {
    /// Starts from zero, whatever the increments are.
    #[inline(always)]
    pub fn nowhere() -> Self {
        Start([[N::of(0.0); 2]; 2])
    }

    /// After a fixed step: extrapolates linearly.
    #[inline(always)]
    pub fn after_fixed() -> Self {
        Start([[N::of(2.0), N::of(-1.0)], [N::of(1.0), N::of(0.0)]])
    }

    /// After an accepted attempt, for a whole step `ratio` times as long as one of its halves; remembers V.
    #[inline(always)]
    pub fn after_taken(ratio: N) -> Self {
        Start([[ratio * (N::of(1.0) + ratio), -(ratio * ratio)], [ratio, N::of(0.0)]])
    }

    /// After a refused attempt, for a whole step `ratio` times as long as one of its halves; remembers V.
    #[inline(always)]
    pub fn after_refused(ratio: N) -> Self {
        let from_end = ratio - N::of(2.0);
        Start([[ratio * (N::of(1.0) + from_end), -(ratio * from_end)], [-ratio, N::of(2.0) * ratio]])
    }

    /// After part 0 or 1 of an attempt, the whole step and the first half; remembers what that part computed.
    #[inline(always)]
    pub fn after_part(part: usize) -> Self {
        let quarter = N::of(0.25);
        let to_next = if part == 0 { [quarter, quarter] } else { [N::of(0.0), N::of(0.5)] };
        Start([to_next, [N::of(1.0), N::of(0.0)]])
    }

    /// Sets one lane.
    #[inline(always)]
    pub fn set_lane(&mut self, lane: usize, of: Start<N::Real>) {
        for row in 0..2 {
            for column in 0..2 {
                self.0[row][column].set_lane(lane, of.0[row][column]);
            }
        }
    }

    /// Puts the start into `increments` and what to remember into `earlier`.
    #[inline(always)]
    pub fn put(&self, increments: &mut Increments<N>, earlier: &mut Increments<N>) {
        let Start([[a, b], [c, d]]) = *self;
        let zero = N::of(0.0);
        let vanishes = (c.abs() + d.abs()).le(zero);
        let Increments { k, x, y } = earlier;
        for (own, earlier) in [(&mut increments.k, k), (&mut increments.x, x), (&mut increments.y, y)] {
            for i in 0..own.len() {
                let (last, before) = (own[i], earlier[i]);
                own[i] = N::select(vanishes, zero, a * last + b * before);
                earlier[i] = N::select(vanishes, zero, c * last + d * before);
            }
            own.close();
            earlier.close();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `[increments, earlier]` of one node after `start`.
    fn put(start: Start<f64>, [last, before]: [f64; 2]) -> [f64; 2] {
        let filled = |value: f64| {
            let mut all = Increments::zeros(6);
            for ring in [&mut all.k, &mut all.x, &mut all.y] {
                (0..6).for_each(|i| ring[i] = value);
            }
            all
        };
        let (mut increments, mut earlier) = (filled(last), filled(before));
        start.put(&mut increments, &mut earlier);
        [increments.y[3], earlier.x[2]]
    }

    #[test]
    fn starts_are_exact_where_the_velocity_is_a_straight_line() {
        let v = |t: f64| 0.7 - 1.3 * t;
        let (t, h, next) = (0.4, 0.25, 0.15);
        let halves = [0.5 * h * v(t + h), 0.5 * h * v(t + 0.5 * h)];
        let ratio = next / (0.5 * h);
        for (name, start, begin) in
            [("taken", Start::after_taken(ratio), t + h), ("refused", Start::after_refused(ratio), t)]
        {
            let [whole, present] = put(start, halves);
            assert!((whole - next * v(begin + next)).abs() < 1e-15, "{name}: whole step");
            assert!((present - next * v(begin)).abs() < 1e-15, "{name}: h·v(t)");
            let [first, whole] = put(Start::after_part(0), [whole, present]);
            assert!((first - 0.5 * next * v(begin + 0.5 * next)).abs() < 1e-15, "{name}: first half");
            let [second, first_again] = put(Start::after_part(1), [first, whole]);
            assert!((second - 0.5 * next * v(begin + next)).abs() < 1e-15, "{name}: second half");
            assert_eq!(first_again, first, "{name}");
        }
        let fixed = put(Start::after_fixed(), [h * v(t), h * v(t - h)]);
        assert!((fixed[0] - h * v(t + h)).abs() < 1e-15 && fixed[1] == h * v(t));
    }

    #[test]
    fn nothing_of_what_is_not_finite_is_left() {
        assert_eq!(put(Start::nowhere(), [f64::NAN, f64::INFINITY]), [0.0; 2]);
    }
}
