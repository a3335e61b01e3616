//! Which numbers can be drawn.

/// Differences of values larger than this, or smaller than its inverse, may over- or underflow.
const LARGEST: f64 = 1e100;

/// Returns whether `value` can be a coordinate of a picture.
pub fn is_drawable(value: f64) -> bool {
    value == 0.0 || (value.abs() > 1.0 / LARGEST && value.abs() < LARGEST)
}
