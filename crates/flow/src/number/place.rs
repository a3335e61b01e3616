//! Places: the coordinates of nodes as a state holds them. Twin of `shaders/place.wgsl`, and for short numbers of
//! `shaders/place_fixed.wgsl`.
//!
//! The scheme sees places by how far they are apart, and moves them; both are done here. In f64 a place is a number. In
//! f32 it is an integer, a multiple of 2⁻²⁷ of the member's unit, in the bits of the number: differences are exact
//! before they are rounded, and a small increment is not lost next to a large coordinate.

/// The bits of the place at 0. All places are then normal numbers, which no device alters.
pub const ORIGIN: i32 = 0x4000_0000;
/// Steps from there to the rim: 7.875 units. What would be beyond is at the rim.
pub const RIM: i32 = 0x3f00_0000;
/// Steps from there to the first places whose coordinates count as not finite: 7.5 units. A curve that grows comes to
/// them before it touches the rim.
pub const OUTSIDE: i32 = 0x3c00_0000;
/// Steps in a unit.
pub const PER_UNIT: f32 = 134_217_728.0;
/// The length of a step.
pub const STEP: f32 = 1.0 / PER_UNIT;
/// Largest increment, in steps: the sum with a place is below 2³¹.
pub const FARTHEST: f32 = 1_073_741_824.0;
/// The coordinate of places that count as not finite: its square is infinite.
pub const BEYOND: f64 = 1e30;

/// A number as a place, or the numbers of several lanes.
pub trait NodePlace: Sized {
    /// Returns how far it is to a place from another.
    fn apart(from: Self, to: Self) -> Self;
    /// Returns a place after an increment.
    fn moved(place: Self, by: Self) -> Self;
    /// Returns the coordinate of a place.
    fn coordinate(place: Self) -> Self;
    /// Returns the place at a coordinate.
    fn placed(at: Self) -> Self;
}

/// A single number as a place.
pub trait SingleNodePlace: NodePlace {
    /// Returns the exact coordinate of a place, and for any other bits a number from which [`nearest`] makes them.
    ///
    /// [`nearest`]: SingleNodePlace::nearest
    fn exact(place: Self) -> f64;
    /// Returns the place nearest to a coordinate.
    fn nearest(at: f64) -> Self;
}

#[inline(always)]
fn steps(place: f32) -> i32 {
    (place.to_bits() as i32).wrapping_sub(ORIGIN)
}

/// Returns the integer nearest to `way`, which is at most [`FARTHEST`] in size; of two as near, the even one.
///
/// By additions and bits, which become vector instructions: a cast that saturates is made lane by lane. A number near
/// `1.5·2^(23+s)` is a multiple of `2^s`, and its bits count them. First come multiples of 2¹², then what they leave.
#[inline(always)]
fn whole(way: f32) -> i32 {
    const FOR_ONE: f32 = 12_582_912.0;
    const SHIFT: u32 = 12;
    const FOR_MANY: f32 = FOR_ONE * (1 << SHIFT) as f32;
    let count = |sum: f32, of: f32| (sum.to_bits() as i32).wrapping_sub(of.to_bits() as i32);
    let many = way + FOR_MANY;
    let rest = way - (many - FOR_MANY);
    (count(many, FOR_MANY) << SHIFT).wrapping_add(count(rest + FOR_ONE, FOR_ONE))
}

#[inline(always)]
fn held(steps: i32) -> f32 {
    f32::from_bits((steps.clamp(-RIM, RIM) + ORIGIN) as u32)
}

impl NodePlace for f32 {
    #[inline(always)]
    fn apart(from: f32, to: f32) -> f32 {
        (to.to_bits() as i32).wrapping_sub(from.to_bits() as i32) as f32 * STEP
    }
    #[inline(always)]
    fn moved(place: f32, by: f32) -> f32 {
        let way = by * PER_UNIT;
        let end = steps(place).wrapping_add(whole(way));
        held(if way.abs() <= FARTHEST { end } else { RIM })
    }
    #[inline(always)]
    fn coordinate(place: f32) -> f32 {
        let steps = steps(place);
        if steps.wrapping_abs() < OUTSIDE { steps as f32 * STEP } else { BEYOND as f32 }
    }
    #[inline(always)]
    fn placed(at: f32) -> f32 {
        f32::moved(held(0), at)
    }
}

impl SingleNodePlace for f32 {
    fn exact(place: f32) -> f64 {
        (f64::from(place.to_bits() as i32) - f64::from(ORIGIN)) * f64::from(STEP)
    }
    fn nearest(at: f64) -> f32 {
        f32::from_bits(((at * f64::from(PER_UNIT)).round_ties_even() + f64::from(ORIGIN)) as i32 as u32)
    }
}

impl NodePlace for f64 {
    #[inline(always)]
    fn apart(from: f64, to: f64) -> f64 {
        to - from
    }
    #[inline(always)]
    fn moved(place: f64, by: f64) -> f64 {
        place + by
    }
    #[inline(always)]
    fn coordinate(place: f64) -> f64 {
        place
    }
    #[inline(always)]
    fn placed(at: f64) -> f64 {
        at
    }
}

impl SingleNodePlace for f64 {
    fn exact(place: f64) -> f64 {
        place
    }
    fn nearest(at: f64) -> f64 {
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::BIG;

    #[test]
    fn a_small_increment_is_not_lost_next_to_a_large_coordinate() {
        let (far, by) = (f32::nearest(3.0), 2.0_f32.powi(-26));
        assert_eq!(f32::apart(far, f32::moved(far, by)), by);
        assert_eq!(3.0 + by, 3.0, "which a number of f32 does lose");
        assert_eq!(f32::exact(f32::moved(far, by)), 3.0 + 2f64.powi(-26));
        assert_eq!(f32::moved(f32::moved(far, by), -by).to_bits(), far.to_bits());
    }

    #[test]
    fn an_increment_is_rounded_to_the_nearest_step_whatever_its_size() {
        let mut state = 1_u64;
        for i in 0..200_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let [a, b] = [32, 8].map(|shift| f64::from((state >> shift) as i32) / f64::from(i32::MAX));
            let (from, by) = (f32::nearest(3.7 * a), (3.7 * b * 0.5_f64.powi(i % 30)) as f32);
            let expected = f32::exact(from) + (f64::from(by) / f64::from(STEP)).round_ties_even() * f64::from(STEP);
            let to = f32::moved(from, by);
            assert_eq!(f32::exact(to), expected, "from {} by {by}", f32::exact(from));
            assert_eq!(f32::apart(from, to), (expected - f32::exact(from)) as f32, "from {} by {by}", f32::exact(from));
            assert_eq!(f32::coordinate(to), expected as f32, "{expected}");
        }
    }

    #[test]
    fn an_increment_half_way_between_two_steps_goes_to_the_even_one() {
        let ways = [0.5, 1.5, 2.5, -0.5, -1.5, -2.5, 2047.5, 2048.5, 6143.5, 4_194_303.5, FARTHEST, -FARTHEST];
        assert_eq!(ways.map(whole), ways.map(|way| way.round_ties_even() as i32));
        assert_ne!(ways.map(whole), ways.map(|way| way.round() as i32));
    }

    #[test]
    fn a_place_beyond_the_rim_is_at_it_and_far_too_large() {
        let bits = |place: f32| place.to_bits();
        for by in [7.876, 12.0, 1e9, f32::INFINITY, f32::NAN, -f32::NAN, -7.876, -12.0, f32::NEG_INFINITY] {
            let at = f32::placed(by);
            assert!(f32::coordinate(at).abs() > BIG as f32 && at.is_normal(), "{by}: {}", f32::coordinate(at));
            assert!([bits(held(RIM)), bits(held(-RIM))].contains(&bits(at)), "{by}: {}", f32::exact(at));
        }
        assert_eq!(f32::coordinate(f32::placed(7.49)), 7.49);
        assert_eq!(f32::coordinate(f32::placed(-7.51)), BEYOND as f32);
        assert_eq!(f32::coordinate(f32::moved(f32::nearest(-7.8), -7.9)), BEYOND as f32);
    }

    #[test]
    fn any_bits_survive_the_way_to_f64_and_back() {
        for bits in [0, 1, 0x007f_ffff, 0x3f80_0000, 0x4000_0000, 0x7f7f_ffff, 0x7f80_0000, 0x8000_0000, 0xffff_ffff] {
            assert_eq!(f32::nearest(f32::exact(f32::from_bits(bits))).to_bits(), bits, "{bits:#x}");
        }
    }
}
