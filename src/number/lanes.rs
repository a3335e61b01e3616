//! Numbers side by side: one lane a member.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use super::{Mask, Number, Real};

/// `W` numbers, operated on together. An array: compilers turn such operations into the vector instructions that they
/// may use, and the same source serves all of them. That takes plain loops: a closure is a function of its own, which
/// need not be compiled into its caller, nor with the instructions of its caller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes<T, const W: usize>([T; W]);

/// One truth value a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneMask<const W: usize>([bool; W]);

/// `$result` of every lane `$l`, in an array that starts as `$start`.
macro_rules! each {
    ($start:expr, $l:ident => $result:expr) => {{
        let mut all = $start;
        for $l in 0..W {
            all[$l] = $result;
        }
        all
    }};
}

impl<const W: usize> Mask for LaneMask<W> {
    #[inline(always)]
    fn all_of(value: bool) -> Self {
        LaneMask([value; W])
    }
    #[inline(always)]
    fn any(self) -> bool {
        let mut any = false;
            for l in 0..W {
                any |= self.0[l];
            }
            any
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        LaneMask(each!(self.0, l => self.0[l] & other.0[l]))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        LaneMask(each!(self.0, l => self.0[l] | other.0[l]))
    }
    #[inline(always)]
    fn not(self) -> Self {
        LaneMask(each!(self.0, l => !self.0[l]))
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> bool {
        self.0[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: bool) {
        self.0[lane] = value;
    }
}

impl<T: Real, const W: usize> Default for Lanes<T, W> {
    #[inline(always)]
    fn default() -> Self {
        Lanes([T::default(); W])
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<T: Real, const W: usize> $trait for Lanes<T, W> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes(each!(self.0, l => self.0[l].$method(other.0[l])))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<T: Real, const W: usize> AddAssign for Lanes<T, W> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<T: Real, const W: usize> Neg for Lanes<T, W> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes(each!(self.0, l => -self.0[l]))
    }
}

impl<T: Real, const W: usize> Number for Lanes<T, W> {
    type Real = T;
    type Mask = LaneMask<W>;
    const LANES: usize = W;
    const EPSILON: f64 = T::EPSILON;

    #[inline(always)]
    fn of(value: f64) -> Self {
        Lanes([T::of(value); W])
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> T {
        self.0[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: T) {
        self.0[lane] = value;
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes(each!(self.0, l => self.0[l].sqrt()))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Lanes(each!(self.0, l => self.0[l].abs()))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Lanes(each!(self.0, l => self.0[l].max(other.0[l])))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Lanes(each!(self.0, l => self.0[l].min(other.0[l])))
    }
    #[inline(always)]
    fn small_floor(self) -> Self {
        Lanes(each!(self.0, l => self.0[l].small_floor()))
    }
    #[inline(always)]
    fn exp2_integral(self) -> Self {
        Lanes(each!(self.0, l => self.0[l].exp2_integral()))
    }
    #[inline(always)]
    fn le(self, other: Self) -> LaneMask<W> {
        LaneMask(each!([false; W], l => self.0[l] <= other.0[l]))
    }
    #[inline(always)]
    fn select(mask: LaneMask<W>, yes: Self, no: Self) -> Self {
        Lanes(each!(yes.0, l => if mask.0[l] { yes.0[l] } else { no.0[l] }))
    }
}
