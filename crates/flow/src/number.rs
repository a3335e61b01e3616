//! The number that the scheme is generic over: `f64` is the reference, `f32` mirrors the kernel, lanes are several of
//! either side by side.
//!
//! [`Number`] requires only what SIMD lanes can provide: arithmetic, and comparisons that return masks instead of
//! steering branches. [`Real`] is a single number. Rust never contracts `a*b + c`, so every expression rounds as
//! written, in every lane and on every machine.

use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

mod lanes;
pub mod place;

use place::{NodePlace, SingleNodePlace};

pub use lanes::{Element, Instructions, WithLanes, with_lanes};

/// Values above this bound count as not finite; far below the overflow of `f32`, so that squares do not overflow.
pub const BIG: f64 = 1e18;

/// The outcome of a comparison: one truth value per lane.
pub trait Mask: Copy {
    /// Returns a mask with `value` in every lane.
    fn all_of(value: bool) -> Self;
    /// Returns whether it holds in at least one lane.
    fn any(self) -> bool;
    /// Lane-wise and.
    fn and(self, other: Self) -> Self;
    /// Lane-wise or.
    fn or(self, other: Self) -> Self;
    /// Lane-wise negation.
    fn not(self) -> Self;
    /// Returns the value of one lane.
    fn lane(self, lane: usize) -> bool;
    /// Sets one lane.
    fn set_lane(&mut self, lane: usize, value: bool);

    /// Returns whether it holds in every lane.
    #[inline(always)]
    fn all(self) -> bool {
        !self.not().any()
    }
}

impl Mask for bool {
    #[inline(always)]
    fn all_of(value: bool) -> bool {
        value
    }
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
    #[inline(always)]
    fn and(self, other: bool) -> bool {
        self & other
    }
    #[inline(always)]
    fn or(self, other: bool) -> bool {
        self | other
    }
    #[inline(always)]
    fn not(self) -> bool {
        !self
    }
    #[inline(always)]
    fn lane(self, _lane: usize) -> bool {
        self
    }
    #[inline(always)]
    fn set_lane(&mut self, _lane: usize, value: bool) {
        *self = value;
    }
}

/// A number, or several side by side.
pub trait Number:
    Copy
    + Default
    + Send
    + Sync
    + 'static
    + NodePlace
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number in a lane.
    type Real: Real;
    /// Result of a comparison.
    type Mask: Mask;
    /// How many numbers are side by side.
    const LANES: usize;
    /// Machine epsilon.
    const EPSILON: f64;
    /// 1.5 times the smallest number above which there are no fractions.
    const WHOLE: f64;
    /// Whether it has so few digits that sums, differences and solves must be made with care.
    const IS_SHORT: bool = Self::EPSILON > 1e-10;

    /// Returns the number nearest to `value`, in every lane.
    fn of(value: f64) -> Self;
    /// Returns the number in one lane.
    fn lane(&self, lane: usize) -> Self::Real;
    /// Sets one lane.
    fn set_lane(&mut self, lane: usize, value: Self::Real);
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The larger of two; arguments must not be NaN.
    fn max(self, other: Self) -> Self;
    /// The smaller of two; arguments must not be NaN.
    fn min(self, other: Self) -> Self;
    /// `2^self` for an integral `self` in [-126, 127].
    fn exp2_integral(self) -> Self;
    /// `self <= other`; false if either is NaN.
    fn le(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Rounds down, for numbers below 2²¹ in size. SSE2 has no rounding instruction, and a call would cost more than
    /// the exponential that needs it.
    #[inline(always)]
    fn small_floor(self) -> Self {
        let whole = Self::of(Self::WHOLE);
        let nearest = (self + whole) - whole;
        Self::select(nearest.le(self), nearest, nearest - Self::of(1.0))
    }

    /// 1/self.
    #[inline(always)]
    fn recip(self) -> Self {
        Self::of(1.0) / self
    }

    /// `|self|`, or 2·[`BIG`] if that is NaN or above [`BIG`], so that maxima can be taken safely.
    #[inline(always)]
    fn bounded_abs(self) -> Self {
        let size = self.abs();
        Self::select(size.le(Self::of(BIG)), size, Self::of(2.0 * BIG))
    }

    /// `e^self` to 2 ulp for |self| ≤ 40, clamped beyond: reduction by ln 2, then a Horner polynomial.
    ///
    /// Written out because WGSL has no `exp` for `f64`; `shaders/number.wgsl` has the same steps. Not named `exp`,
    /// since the inherent method of `f64` would be called instead.
    #[inline(always)]
    fn exponential(self) -> Self {
        let [more, scale] = self.exponential_parts();
        (more + Self::of(1.0)) * scale
    }

    /// `e^x - 1` for the same x, with all its digits where x is small.
    #[inline(always)]
    fn exponential_less_one(self) -> Self {
        let [more, scale] = self.exponential_parts();
        more * scale + (scale - Self::of(1.0))
    }

    /// a and 2ⁿ with `e^x = (1 + a) 2ⁿ`.
    #[inline(always)]
    fn exponential_parts(self) -> [Self; 2] {
        let x = self.max(Self::of(-40.0)).min(Self::of(40.0));
        let n = (x * Self::of(std::f64::consts::LOG2_E) + Self::of(0.5)).small_floor();
        let reduced = (x - n * Self::of(LN2_HIGH)) - n * Self::of(LN2_LOW);
        let mut sum = Self::of(EXP_SERIES[0]);
        for coefficient in &EXP_SERIES[1..] {
            sum = sum * reduced + Self::of(*coefficient);
        }
        [sum * reduced, n.exp2_integral()]
    }

    /// The number itself, which no compiler merges with the sum that takes it: where nodes share the product of which
    /// it is the result, they must see the same one. That of Rust merges nothing.
    #[inline(always)]
    fn rounded(self) -> Self {
        self
    }

    /// `2 sin(θ/2)` for the angle θ with `tan(θ/2) = self`.
    #[inline(always)]
    fn twice_sin_atan(self) -> Self {
        let t = self.max(Self::of(-STEEPEST)).min(Self::of(STEEPEST));
        Self::of(2.0) * (t / (Self::of(1.0) + t * t).sqrt())
    }
}

/// Tangent of half an angle that is practically infinite, and whose square is finite in `f32`.
const STEEPEST: f64 = 1e9;
/// The leading nine bits of ln 2: `n · LN2_HIGH` is exact in `f32` and `f64` for |n| ≤ 64.
const LN2_HIGH: f64 = 0.693359375;
/// ln 2 - [`LN2_HIGH`].
const LN2_LOW: f64 = -2.121_944_400_546_905_8e-4;
/// 1/13!, 1/12!, …, 1/1!.
const EXP_SERIES: [f64; 13] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
];

/// A single number that can be copied to and from a device.
pub trait Real:
    Number<Real = Self, Mask = bool> + SingleNodePlace + bytemuck::Pod + PartialOrd + std::fmt::Display + std::fmt::Debug
{
    /// Its name in WGSL.
    const NAME: &'static str;
    /// Which precision it is.
    const PRECISION: Precision;
    /// Exact conversion.
    fn to_f64(self) -> f64;
    /// Rounds down to an integer.
    fn floor(self) -> Self;
}

/// The number type of the state and of all arithmetic on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Single precision.
    F32,
    /// Double precision.
    #[default]
    F64,
}

impl Precision {
    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        }
    }

    /// Returns the machine epsilon.
    pub fn epsilon(self) -> f64 {
        match self {
            Precision::F32 => f32::EPSILON.into(),
            Precision::F64 => f64::EPSILON,
        }
    }

    /// Returns the number of this precision nearest to `value`.
    pub fn rounded(self, value: f64) -> f64 {
        match self {
            Precision::F32 => f64::from(value as f32),
            Precision::F64 => value,
        }
    }

    /// Returns the default tolerance of the sweeps of fixed or adaptive steps. Those of adaptive steps in f32 are
    /// [refined](crate::solver::refinement).
    pub fn tolerance(self, adaptive: bool) -> f64 {
        match (self, adaptive) {
            (Precision::F32, false) => 1e-3,
            (Precision::F32, true) => 1e-6,
            (Precision::F64, _) => 1e-5,
        }
    }
}

macro_rules! real {
    ($type:ident, $precision:ident, $name:literal, $mantissa:expr, $bias:expr, $whole:expr) => {
        impl Number for $type {
            type Real = $type;
            type Mask = bool;
            const LANES: usize = 1;
            const EPSILON: f64 = <$type>::EPSILON as f64;
            const WHOLE: f64 = $whole;
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn lane(&self, _lane: usize) -> Self {
                *self
            }
            #[inline(always)]
            fn set_lane(&mut self, _lane: usize, value: Self) {
                *self = value;
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$type>::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$type>::abs(self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self > other { self } else { other }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if self < other { self } else { other }
            }
            #[inline(always)]
            fn exp2_integral(self) -> Self {
                // The lowest bits of the sum hold the integer; the shift drops the others.
                let integer = (self + $whole as $type).to_bits();
                <$type>::from_bits((integer << $mantissa).wrapping_add($bias << $mantissa))
            }
            #[inline(always)]
            fn le(self, other: Self) -> bool {
                self <= other
            }
            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }
        }
        impl Real for $type {
            const NAME: &'static str = $name;
            const PRECISION: Precision = Precision::$precision;
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self.into()
            }
            fn floor(self) -> Self {
                <$type>::floor(self)
            }
        }
    };
}

real!(f64, F64, "f64", 52, 1023, 6_755_399_441_055_744.0);
real!(f32, F32, "f32", 23, 127, 12_582_912.0);

/// Maximum number of halvings that bring a ratio near 1.
pub const LN_HALVINGS: u32 = 64;
/// Terms of the series of the logarithm; the last is below 10⁻¹⁶.
pub const LN_TERMS: u32 = 10;

/// `ln(b/a)` of positive numbers, by halvings and `2·artanh((q-1)/(q+1))` of the rest; WGSL has no logarithm in f64.
pub fn ln_ratio<T: Real>(a: T, b: T) -> T {
    let (one, half, two) = (T::of(1.0), T::of(0.5), T::of(2.0));
    let ln_2 = T::of(std::f64::consts::LN_2);
    let (mut q, mut whole) = (b / a, T::of(0.0));
    let (low, high) = (T::of(std::f64::consts::FRAC_1_SQRT_2), T::of(std::f64::consts::SQRT_2));
    for _ in 0..LN_HALVINGS {
        if !low.le(q) {
            q = two * q;
            whole = whole - ln_2;
        } else if !q.le(high) {
            q = half * q;
            whole += ln_2;
        } else {
            break;
        }
    }
    let z = (q - one) / (q + one);
    let square = z * z;
    let mut sum = T::of(0.0);
    for term in (0..LN_TERMS).rev() {
        sum = sum * square + one / T::of(f64::from(2 * term + 1));
    }
    whole + two * (z * sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst_ln<T: Real>() -> f64 {
        let mut worst = 0.0_f64;
        for j in -400..=400 {
            let (a, b) = (T::of(0.3), T::of((f64::from(j) * 0.03 + 0.01).exp()));
            let exact = (b.to_f64() / a.to_f64()).ln();
            worst = worst.max((ln_ratio(a, b).to_f64() - exact).abs() / (T::EPSILON * exact.abs().max(1.0)));
        }
        worst
    }

    #[test]
    fn the_logarithm_is_accurate_in_both_precisions() {
        assert!(worst_ln::<f64>() < 3.0, "{}", worst_ln::<f64>());
        assert!(worst_ln::<f32>() < 3.0, "{}", worst_ln::<f32>());
        assert_eq!(ln_ratio(2.0, 2.0), 0.0);
    }

    fn worst_exp<T: Real>() -> f64 {
        let mut worst = 0.0_f64;
        for j in -3999..=3999 {
            let x = T::of(f64::from(j) * 0.01 + 1.234e-4);
            let exact = x.to_f64().exp();
            worst = worst.max((x.exponential().to_f64() / exact - 1.0).abs() / T::EPSILON);
        }
        worst
    }

    #[test]
    fn exp_is_accurate_to_two_ulp_in_both_precisions() {
        assert!(worst_exp::<f64>() < 2.0, "{}", worst_exp::<f64>());
        assert!(worst_exp::<f32>() < 2.0, "{}", worst_exp::<f32>());
        assert_eq!(0.0_f64.exponential(), 1.0);
    }

    fn worst_less_one<T: Real>() -> f64 {
        let mut worst = 0.0_f64;
        for j in -2000..=2000 {
            for scale in [1e-2, 1e-5, 1e-8] {
                let x = T::of((f64::from(j) + 0.5) * scale);
                let exact = x.to_f64().exp_m1();
                worst = worst.max((x.exponential_less_one().to_f64() / exact - 1.0).abs() / T::EPSILON);
            }
        }
        worst
    }

    #[test]
    fn exp_less_one_keeps_its_digits_where_it_is_small() {
        assert!(worst_less_one::<f64>() < 4.0, "{}", worst_less_one::<f64>());
        assert!(worst_less_one::<f32>() < 4.0, "{}", worst_less_one::<f32>());
        let difference = 1e-6_f32.exponential() - 1.0;
        assert!((difference / 1e-6 - 1.0).abs() > 0.01, "the control: {difference:e}");
    }

    #[test]
    fn twice_the_sine_of_an_angle_is_accurate_from_its_tangent() {
        for angle in [1e-9, 0.01, 0.3, 1.0, 1.5, -0.7_f64] {
            assert!((angle.tan().twice_sin_atan() - 2.0 * angle.sin()).abs() < 1e-15, "{angle}");
        }
        assert!((f64::INFINITY.twice_sin_atan() - 2.0).abs() < 1e-15);
        assert_eq!((-0.0_f64).twice_sin_atan(), 0.0);
    }

    #[test]
    fn bounded_abs_makes_nan_and_infinity_large() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e19] {
            assert_eq!(bad.bounded_abs(), 2.0 * BIG);
        }
        assert_eq!((-3.0_f32).bounded_abs(), 3.0);
    }
}
