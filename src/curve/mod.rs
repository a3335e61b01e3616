//! Plane-curve mathematics in f64: shapes, perturbations, sampling into nodes, and measures of polygons.
//!
//! A [`Shape`] is what a user writes; [`Shape::resolve`] makes it a [`BaseCurve`], a closed curve that can be
//! evaluated at any parameter `u`. A [`RadialFactor`] moves the plane about the curve's centroid, which turns the
//! one base curve into a different curve for each member of an ensemble. A [`Sampler`] finally places n nodes on
//! it. Nothing here draws random numbers: the ensemble does, and hands amplitudes and phases down.
//!
//! Nodes are numbered i = 1…n, counter-clockwise, as in the paper, and stored at index i-1.

mod base;
mod crossing;
mod outline;
mod perturbation;
pub mod polygon;
mod sampling;
mod shape;

pub use base::BaseCurve;
pub use crossing::{Undecided, clearance, crossing, crossing_within};
pub use outline::{MAX_POINTS, Outline};
pub use perturbation::{MIN_FACTOR, Modes, RadialFactor, RadialLaw, check_directions};
pub use sampling::{Sampler, Sampling, resample};
pub use shape::{FlowerMode, Shape};

/// Highest mode of a flower or a perturbation. A mode takes four nodes at the very least, and far fewer than 4000
/// nodes are ever relaxed; the cap keeps the cost of a curve bounded before anything else is known about it.
pub const MAX_MODE: u32 = 1000;
