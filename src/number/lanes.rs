//! Numbers side by side in the registers of vector instructions: one lane a member.
//!
//! The instructions are [`pulp`]'s, each behind a token that proves that the processor has them. An expression such as
//! `a + b` has nowhere to carry a token, so the type of the numbers stands for it: [`Lanes`] are only used behind
//! [`Vectors`](crate::backend::cpu::Vectors), which asks the processor first.

use std::{
    marker::PhantomData,
    ops::{Add, AddAssign, Div, Mul, Neg, Sub},
};

use bytemuck::cast;
use pulp::Simd;

use super::{Mask, Number, Real};

/// Vector instructions whose token can be had anywhere.
pub(crate) trait Instructions: Simd {
    /// As wide as a register and aligned like that: loads of a number that lies across two lines of the cache take twice
    /// the time, and padding would take twice the cache.
    type Aligned: Copy + Send + Sync;
    /// The token. Only in code that runs after the processor was asked for these instructions.
    fn token() -> Self;
}

macro_rules! instructions {
    ($($type:ty: $aligned:ident $bytes:literal),*) => {
        $(
            #[doc = concat!("Aligned to ", $bytes, " bytes.")]
            #[derive(Clone, Copy)]
            #[repr(align($bytes))]
            pub(crate) struct $aligned;

            impl Instructions for $type {
                type Aligned = $aligned;
                #[inline(always)]
                #[allow(unsafe_code)]
                fn token() -> Self {
                    debug_assert!(<$type>::is_available());
                    // SAFETY: the type asks for nothing but that the processor has the instructions. Tokens are taken by
                    // the operations on `Lanes` alone, which are private to this crate and instantiated in one place
                    // only, `abreast` of the CPU back end, behind a token made by `try_new`, that is by asking the processor.
                    unsafe { <$type>::new_unchecked() }
                }
            }
        )*
    };
}

#[cfg(target_arch = "x86_64")]
instructions!(pulp::x86::V2: To16 16, pulp::x86::V3: To32 32, pulp::x86::V4: To64 64);
#[cfg(target_arch = "aarch64")]
instructions!(pulp::aarch64::Neon: To16 16);

/// A number that fits into the lanes of `S`.
pub(crate) trait Element<S: Simd>: Real {
    type Register: bytemuck::Pod + Send + Sync;
    type Truth: Copy;
    fn splat(simd: S, value: Self) -> Self::Register;
    fn add(simd: S, a: Self::Register, b: Self::Register) -> Self::Register;
    fn sub(simd: S, a: Self::Register, b: Self::Register) -> Self::Register;
    fn mul(simd: S, a: Self::Register, b: Self::Register) -> Self::Register;
    fn div(simd: S, a: Self::Register, b: Self::Register) -> Self::Register;
    fn max(simd: S, a: Self::Register, b: Self::Register) -> Self::Register;
    fn min(simd: S, a: Self::Register, b: Self::Register) -> Self::Register;
    fn neg(simd: S, a: Self::Register) -> Self::Register;
    fn abs(simd: S, a: Self::Register) -> Self::Register;
    fn sqrt(simd: S, a: Self::Register) -> Self::Register;
    fn le(simd: S, a: Self::Register, b: Self::Register) -> Self::Truth;
    fn select(simd: S, mask: Self::Truth, yes: Self::Register, no: Self::Register) -> Self::Register;
    fn and(simd: S, a: Self::Truth, b: Self::Truth) -> Self::Truth;
    fn or(simd: S, a: Self::Truth, b: Self::Truth) -> Self::Truth;
    fn not(simd: S, a: Self::Truth) -> Self::Truth;
    fn any(simd: S, a: Self::Truth) -> bool;
}

macro_rules! element {
    ($real:ident, $register:ident, $mask:ident, $lanes:ident, $splat:ident, $first:ident,
     $add:ident $sub:ident $mul:ident $div:ident $max:ident $min:ident, $sqrt:ident,
     $bits_splat:ident $bits_xor:ident $bits_and:ident $bits_select:ident,
     $le:ident, $and:ident $or:ident $not:ident) => {
        impl<S: Simd> Element<S> for $real {
            type Register = S::$register;
            type Truth = S::$mask;
            element!(@binary S::$register: add $add, sub $sub, mul $mul, div $div, max $max, min $min);
            element!(@unary S::$register: sqrt $sqrt);
            element!(@binary S::$mask: and $and, or $or);
            element!(@unary S::$mask: not $not);
            #[inline(always)]
            fn splat(simd: S, value: $real) -> S::$register {
                simd.$splat(value)
            }
            #[inline(always)]
            fn le(simd: S, a: S::$register, b: S::$register) -> S::$mask {
                simd.$le(a, b)
            }
            // The next three are pulp's for whole numbers: those for floating-point ones are not compiled into their caller.
            #[inline(always)]
            fn neg(simd: S, a: S::$register) -> S::$register {
                cast(simd.$bits_xor(cast(a), simd.$bits_splat((-0.0 as $real).to_bits())))
            }
            #[inline(always)]
            fn abs(simd: S, a: S::$register) -> S::$register {
                cast(simd.$bits_and(cast(a), simd.$bits_splat(!(-0.0 as $real).to_bits())))
            }
            #[inline(always)]
            fn select(simd: S, mask: S::$mask, yes: S::$register, no: S::$register) -> S::$register {
                cast(simd.$bits_select(mask, cast(yes), cast(no)))
            }
            #[inline(always)]
            fn any(simd: S, a: S::$mask) -> bool {
                simd.$first(a) < S::$lanes
            }
        }
    };
    (@binary $type:ty: $($name:ident $of_simd:ident),*) => {
        $(
            #[inline(always)]
            fn $name(simd: S, a: $type, b: $type) -> $type {
                simd.$of_simd(a, b)
            }
        )*
    };
    (@unary $type:ty: $($name:ident $of_simd:ident),*) => {
        $(
            #[inline(always)]
            fn $name(simd: S, a: $type) -> $type {
                simd.$of_simd(a)
            }
        )*
    };
}

element!(f64, f64s, m64s, F64_LANES, splat_f64s, first_true_m64s,
    add_f64s sub_f64s mul_f64s div_f64s max_f64s min_f64s, sqrt_f64s,
    splat_u64s xor_u64s and_u64s select_u64s, less_than_or_equal_f64s, and_m64s or_m64s not_m64s);
element!(f32, f32s, m32s, F32_LANES, splat_f32s, first_true_m32s,
    add_f32s sub_f32s mul_f32s div_f32s max_f32s min_f32s, sqrt_f32s,
    splat_u32s xor_u32s and_u32s select_u32s, less_than_or_equal_f32s, and_m32s or_m32s not_m32s);

/// The numbers in `R` registers of the instructions `S`: where `R` is above 1, one is computed while the other waits.
#[derive(Clone, Copy)]
#[repr(C)]
pub(crate) struct Lanes<S: Instructions, T: Element<S>, const R: usize>(
    [T::Register; R],
    [S::Aligned; 0],
    PhantomData<S>,
);

/// One truth value a lane.
#[derive(Clone, Copy)]
pub(crate) struct LaneMask<S: Simd, T: Element<S>, const R: usize>([T::Truth; R], PhantomData<(S, T)>);

/// `$result` of every register `$r`, in an array that starts as `$start`. A loop: a closure need not be compiled with the
/// instructions of its caller.
macro_rules! each {
    ($start:expr, $r:ident => $result:expr) => {{
        let mut all = $start;
        for $r in 0..R {
            all[$r] = $result;
        }
        all
    }};
}

impl<S: Instructions, T: Element<S>, const R: usize> LaneMask<S, T, R> {
    /// 1 where it holds, 0 elsewhere.
    #[inline(always)]
    fn to_numbers(self) -> Lanes<S, T, R> {
        Lanes::select(self, Lanes::of(1.0), Lanes::of(0.0))
    }
}

impl<S: Instructions, T: Element<S>, const R: usize> Mask for LaneMask<S, T, R> {
    #[inline(always)]
    fn all_of(value: bool) -> Self {
        Lanes::<S, T, R>::of(if value { 0.0 } else { 1.0 }).le(Lanes::of(0.0))
    }
    #[inline(always)]
    fn any(self) -> bool {
        let mut any = false;
        for r in 0..R {
            any |= <T as Element<S>>::any(S::token(), self.0[r]);
        }
        any
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        LaneMask(each!(self.0, r => <T as Element<S>>::and(S::token(), self.0[r], other.0[r])), PhantomData)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        LaneMask(each!(self.0, r => <T as Element<S>>::or(S::token(), self.0[r], other.0[r])), PhantomData)
    }
    #[inline(always)]
    fn not(self) -> Self {
        LaneMask(each!(self.0, r => <T as Element<S>>::not(S::token(), self.0[r])), PhantomData)
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> bool {
        self.to_numbers().lane(lane) > T::of(0.0)
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: bool) {
        let mut numbers = self.to_numbers();
        numbers.set_lane(lane, T::of(if value { 1.0 } else { 0.0 }));
        *self = Lanes::of(1.0).le(numbers);
    }
}

impl<S: Instructions, T: Element<S>, const R: usize> Default for Lanes<S, T, R> {
    #[inline(always)]
    fn default() -> Self {
        Lanes([bytemuck::Zeroable::zeroed(); R], [], PhantomData)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<S: Instructions, T: Element<S>, const R: usize> $trait for Lanes<S, T, R> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes(each!(self.0, r => <T as Element<S>>::$method(S::token(), self.0[r], other.0[r])), [], PhantomData)
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<S: Instructions, T: Element<S>, const R: usize> AddAssign for Lanes<S, T, R> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Instructions, T: Element<S>, const R: usize> Neg for Lanes<S, T, R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::neg(S::token(), self.0[r])), [], PhantomData)
    }
}

impl<S: Instructions, T: Element<S>, const R: usize> Number for Lanes<S, T, R> {
    type Real = T;
    type Mask = LaneMask<S, T, R>;
    const LANES: usize = R * size_of::<T::Register>() / size_of::<T>();
    const EPSILON: f64 = T::EPSILON;
    const WHOLE: f64 = T::WHOLE;

    #[inline(always)]
    fn of(value: f64) -> Self {
        Lanes([<T as Element<S>>::splat(S::token(), T::of(value)); R], [], PhantomData)
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> T {
        bytemuck::cast_slice::<_, T>(&self.0)[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: T) {
        bytemuck::cast_slice_mut::<_, T>(&mut self.0)[lane] = value;
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::sqrt(S::token(), self.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::abs(S::token(), self.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::max(S::token(), self.0[r], other.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::min(S::token(), self.0[r], other.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn exp2_integral(mut self) -> Self {
        for value in bytemuck::cast_slice_mut::<_, T>(&mut self.0) {
            *value = value.exp2_integral();
        }
        self
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        let mut mask = [<T as Element<S>>::le(S::token(), self.0[0], other.0[0]); R];
        for r in 1..R {
            mask[r] = <T as Element<S>>::le(S::token(), self.0[r], other.0[r]);
        }
        LaneMask(mask, PhantomData)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Lanes(each!(yes.0, r => <T as Element<S>>::select(S::token(), mask.0[r], yes.0[r], no.0[r])), [], PhantomData)
    }
}
