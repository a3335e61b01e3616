//! Places: the coordinates of nodes as a state holds them. Twin of `shaders/place.wgsl`.
//!
//! The scheme sees places by how far they are apart, and moves them; both are done here. So a state may hold something
//! else than the number that the scheme computes with. Here it holds that number.

use super::{Number, Real};

/// Returns how far it is to a place from another.
#[inline(always)]
pub fn apart<N: Number>(from: N, to: N) -> N {
    to - from
}

/// Returns a place after an increment.
#[inline(always)]
pub fn moved<N: Number>(place: N, by: N) -> N {
    place + by
}

/// Returns the coordinate of a place.
#[inline(always)]
pub fn coordinate<N: Number>(place: N) -> N {
    place
}

/// Returns the place at a coordinate.
#[inline(always)]
pub fn placed<N: Number>(at: N) -> N {
    at
}

/// Returns the exact coordinate of a place.
pub fn to_f64<T: Real>(place: T) -> f64 {
    place.to_f64()
}

/// Returns the place nearest to a coordinate.
pub fn of_f64<T: Real>(at: f64) -> T {
    T::of(at)
}
