//! Numbers side by side in the registers of vector instructions: one lane per member.
//!
//! The instructions are [`pulp`]'s, each behind a token that proves that the processor has them. An expression such as
//! `a + b` cannot carry a token, so the type of the numbers stands for it: no other module can name [`Lanes`], and
//! [`with_lanes`] provides them in exchange for a token.

use std::{
    marker::PhantomData,
    ops::{Add, AddAssign, Div, Mul, Neg, Sub},
};

use bytemuck::{cast, cast_slice, cast_slice_mut};
use pulp::Simd;

use super::{Mask, Number, Real, place::NodePlace};

/// Vector instructions whose token is available anywhere.
pub trait Instructions: Simd {
    /// As wide as a register and aligned to it: loads that cross a cache line take twice the time, and padding would
    /// take twice the cache.
    type Aligned: Copy + Send + Sync;
    /// Returns the token. For use in this file only, see `Here`.
    fn token(here: Here) -> Self;
}

/// Can be created in this file only: the operations of [`Lanes`] pass it to get a token.
#[derive(Clone, Copy)]
pub struct Here(());

/// For use in the operations of [`Lanes`] and [`LaneMask`] only: the proof of [`Instructions::token`] rests on this.
const HERE: Here = Here(());

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
macro_rules! instructions {
    ($($type:ty: $aligned:ident $bytes:literal),*) => {
        $(
            #[doc = concat!("Aligned to ", $bytes, " bytes.")]
            #[derive(Clone, Copy)]
            #[repr(align($bytes))]
            pub struct $aligned;

            impl Instructions for $type {
                type Aligned = $aligned;
                #[inline(always)]
                #[allow(unsafe_code)]
                fn token(_: Here) -> Self {
                    debug_assert!(<$type>::is_available());
                    // SAFETY: the function only requires that the processor has the instructions.
                    // 1. Any caller has a `Here`. Its field is private, and this file creates a single one, `HERE`,
                    //    used in the operations of `Lanes<S, ..>` and `LaneMask<S, ..>` for `S::token` only.
                    // 2. These two types are private. Other code gets them only as the type parameter of
                    //    `WithLanes::call`, or as its `Number::Mask`; and its caller, `with_lanes`, was given a value
                    //    of type `S`.
                    // 3. A value of type `S` proves the same: pulp creates one in `try_new`, which checks the
                    //    processor, and in unsafe functions, which this crate denies everywhere else.
                    // 4. This holds for the whole process until its end, so the value need not be stored: an
                    //    operation in another thread, or in a destructor, still comes after it.
                    unsafe { <$type>::new_unchecked() }
                }
            }
        )*
    };
}

#[cfg(target_arch = "x86_64")]
instructions!(pulp::x86::V3: To32 32, pulp::x86::V4: To64 64);
#[cfg(target_arch = "aarch64")]
instructions!(pulp::aarch64::Neon: To16 16);

/// A number that fits into the lanes of `S`: what `S` does with registers of it.
#[allow(missing_docs)] // instructions by their usual names
pub trait Element<S: Simd>: Real {
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
            // The next three use pulp's operations for integers: those for floating-point numbers are not inlined into
            // their caller.
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

/// Work on numbers of a type that exists only where its instructions do.
pub trait WithLanes<T: Real> {
    /// The result.
    type Output;
    /// Runs the work.
    fn call<N: Number<Real = T>>(self) -> Self::Output;
}

/// Calls `work` with the numbers in `R` registers of the instructions `S`, whose presence the token proves.
pub fn with_lanes<S: Instructions, T: Element<S>, const R: usize, W: WithLanes<T>>(_: S, work: W) -> W::Output {
    work.call::<Lanes<S, T, R>>()
}

/// The numbers in `R` registers of the instructions `S`; if `R` is above 1, one is computed while another waits.
#[derive(Clone, Copy)]
#[repr(C)]
struct Lanes<S: Instructions, T: Element<S>, const R: usize>([T::Register; R], [S::Aligned; 0], PhantomData<S>);

/// One truth value per lane.
#[derive(Clone, Copy)]
struct LaneMask<S: Simd, T: Element<S>, const R: usize>([T::Truth; R], PhantomData<(S, T)>);

/// `$result` of every register `$r`, in an array that starts as `$start`. A loop, since a closure need not be compiled
/// with the instructions of its caller.
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
    /// 1 where the mask holds, 0 elsewhere.
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
            any |= <T as Element<S>>::any(S::token(HERE), self.0[r]);
        }
        any
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        LaneMask(each!(self.0, r => <T as Element<S>>::and(S::token(HERE), self.0[r], other.0[r])), PhantomData)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        LaneMask(each!(self.0, r => <T as Element<S>>::or(S::token(HERE), self.0[r], other.0[r])), PhantomData)
    }
    #[inline(always)]
    fn not(self) -> Self {
        LaneMask(each!(self.0, r => <T as Element<S>>::not(S::token(HERE), self.0[r])), PhantomData)
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
                Lanes(each!(self.0, r => <T as Element<S>>::$method(S::token(HERE), self.0[r], other.0[r])), [], PhantomData)
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
        Lanes(each!(self.0, r => <T as Element<S>>::neg(S::token(HERE), self.0[r])), [], PhantomData)
    }
}

/// Places of f64 in vector instructions of its own; those of f32 lane by lane, which compilers make instructions of.
impl<S: Instructions, T: Element<S>, const R: usize> NodePlace for Lanes<S, T, R> {
    #[inline(always)]
    fn apart(mut from: Self, to: Self) -> Self {
        if !Self::IS_SHORT {
            return to - from;
        }
        for (from, to) in cast_slice_mut::<_, T>(&mut from.0).iter_mut().zip(cast_slice(&to.0)) {
            *from = T::apart(*from, *to);
        }
        from
    }
    #[inline(always)]
    fn moved(mut place: Self, by: Self) -> Self {
        if !Self::IS_SHORT {
            return place + by;
        }
        for (place, by) in cast_slice_mut::<_, T>(&mut place.0).iter_mut().zip(cast_slice(&by.0)) {
            *place = T::moved(*place, *by);
        }
        place
    }
    #[inline(always)]
    fn coordinate(mut place: Self) -> Self {
        if Self::IS_SHORT {
            for place in cast_slice_mut::<_, T>(&mut place.0) {
                *place = T::coordinate(*place);
            }
        }
        place
    }
    #[inline(always)]
    fn placed(mut at: Self) -> Self {
        if Self::IS_SHORT {
            for at in cast_slice_mut::<_, T>(&mut at.0) {
                *at = T::placed(*at);
            }
        }
        at
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
        Lanes([<T as Element<S>>::splat(S::token(HERE), T::of(value)); R], [], PhantomData)
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> T {
        cast_slice::<_, T>(&self.0)[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: T) {
        cast_slice_mut::<_, T>(&mut self.0)[lane] = value;
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::sqrt(S::token(HERE), self.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::abs(S::token(HERE), self.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::max(S::token(HERE), self.0[r], other.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Lanes(each!(self.0, r => <T as Element<S>>::min(S::token(HERE), self.0[r], other.0[r])), [], PhantomData)
    }
    #[inline(always)]
    fn exp2_integral(mut self) -> Self {
        for value in cast_slice_mut::<_, T>(&mut self.0) {
            *value = value.exp2_integral();
        }
        self
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        let mut mask = [<T as Element<S>>::le(S::token(HERE), self.0[0], other.0[0]); R];
        for r in 1..R {
            mask[r] = <T as Element<S>>::le(S::token(HERE), self.0[r], other.0[r]);
        }
        LaneMask(mask, PhantomData)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Lanes(
            each!(yes.0, r => <T as Element<S>>::select(S::token(HERE), mask.0[r], yes.0[r], no.0[r])),
            [],
            PhantomData,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers at which operations differ; more than any register holds.
    const VALUES: [f64; 19] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.1,
        -2.5,
        3.0,
        1e18,
        -1e18,
        1e-30,
        7.25,
        -0.3,
        126.0,
        -126.0,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        1e-300,
        65_536.5,
    ];

    /// Compares every operation in every lane with that of a single number.
    struct EveryOperation;

    impl<T: Real> WithLanes<T> for EveryOperation {
        type Output = usize;

        fn call<N: Number<Real = T>>(self) -> usize {
            assert_eq!(N::LANES * size_of::<T>(), size_of::<N>(), "no padding");
            assert_eq!(size_of::<N>() % align_of::<N>(), 0);
            let value = |i: usize| T::of(VALUES[i % VALUES.len()]);
            let (mut a, mut b) = (N::default(), N::default());
            let mut compared = 0;
            for shift in 0..VALUES.len() {
                for lane in 0..N::LANES {
                    a.set_lane(lane, value(lane + shift));
                    b.set_lane(lane, value(3 * lane + 5 * shift));
                }
                let mut sum = a;
                sum += b;
                let (below, above) = (a.le(b), b.le(a));
                let mut set = below;
                set.set_lane(shift % N::LANES, true);
                for lane in 0..N::LANES {
                    let (x, y) = (a.lane(lane), b.lane(lane));
                    let same = |name: &str, found: N, expected: T| {
                        let [found, expected] = [found.lane(lane), expected].map(|value| value.to_f64());
                        let equal = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
                        assert!(equal, "{name} of {x} and {y} in lane {lane} of {}: {found}, not {expected}", N::LANES);
                    };
                    same("+", a + b, x + y);
                    same("+=", sum, x + y);
                    same("-", a - b, x - y);
                    same("*", a * b, x * y);
                    same("/", a / b, x / y);
                    same("neg", -a, -x);
                    same("abs", a.abs(), x.abs());
                    same("sqrt", a.sqrt(), x.sqrt());
                    same("of", N::of(0.1), T::of(0.1));
                    same("apart", N::apart(a, b), T::apart(x, y));
                    same("moved", N::moved(a, b), T::moved(x, y));
                    same("coordinate", N::coordinate(a), T::coordinate(x));
                    same("placed", N::placed(a), T::placed(x));
                    same("select", N::select(below, a, b), if x <= y { x } else { y });
                    // Neither accepts NaN, nor distinguishes zeros.
                    if x <= y || y <= x {
                        assert!(a.max(b).lane(lane) == Number::max(x, y) && a.min(b).lane(lane) == Number::min(x, y));
                    }
                    if x.to_f64().abs() <= 126.0 && x.floor() == x {
                        same("exp2_integral", a.exp2_integral(), x.exp2_integral());
                    }
                    let truths = [below.lane(lane), above.lane(lane), set.lane(lane)];
                    assert_eq!(truths, [x <= y, y <= x, x <= y || lane == shift % N::LANES], "{x} {y}");
                    assert_eq!(below.and(above).lane(lane), x <= y && y <= x);
                    assert_eq!(below.or(above).lane(lane), x <= y || y <= x);
                    assert_eq!(below.not().lane(lane), !below.lane(lane));
                    compared += 1;
                }
                let any = (0..N::LANES).any(|lane| below.lane(lane));
                let all = (0..N::LANES).all(|lane| below.lane(lane));
                assert_eq!((below.any(), below.all()), (any, all));
                assert_eq!((N::Mask::all_of(true).all(), N::Mask::all_of(false).any()), (true, false));
            }
            compared
        }
    }

    fn every_operation<S: Instructions>(simd: Option<S>) -> usize
    where
        f64: Element<S>,
        f32: Element<S>,
    {
        let Some(simd) = simd else { return 0 };
        let doubles =
            with_lanes::<S, f64, 1, _>(simd, EveryOperation) + with_lanes::<S, f64, 2, _>(simd, EveryOperation);
        doubles + with_lanes::<S, f32, 1, _>(simd, EveryOperation) + with_lanes::<S, f32, 2, _>(simd, EveryOperation)
    }

    #[test]
    fn every_operation_on_lanes_is_that_on_one_number_in_each() {
        #[cfg(target_arch = "x86_64")]
        let compared = [every_operation(pulp::x86::V3::try_new()), every_operation(pulp::x86::V4::try_new())];
        #[cfg(target_arch = "aarch64")]
        let compared = [every_operation(pulp::aarch64::Neon::try_new())];
        println!("lanes compared, by instructions: {compared:?}");
        #[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
        assert!(compared[0] >= 18 * VALUES.len(), "no vector instructions here: {compared:?}");
    }

    /// The first step of the proof of `token`; the compiler checks the others.
    #[test]
    fn the_one_unsafe_block_is_shown_where_it_is_called_from() {
        let (code, _) = include_str!("lanes.rs").split_once("#[cfg(test)]").unwrap();
        let code: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        let lines = |part: &str| code.iter().filter(|line| line.contains(part)).count();
        assert_eq!((lines("unsafe {"), lines("Here(")), (1, 2), "Here is declared, and made in HERE");
        let uses = code.iter().filter(|line| line.contains("HERE")).count() - 1;
        let tokens = code.iter().filter(|line| line.contains("S::token(HERE)")).count();
        assert!(uses == tokens && uses > 10, "HERE is used in {uses} lines, in {tokens} of them for a token");
    }
}
