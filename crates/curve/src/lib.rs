//! Plane-curve mathematics in f64: shapes, perturbations, sampling into nodes, and measures of polygons.
//!
//! A [`Shape`] is what a user writes; [`outlines`] reads those of files. [`Shape::resolve`] turns it into a
//! [`BaseCurve`], a closed curve that can be evaluated at any parameter `u`. A [`RadialFactor`] maps the plane about
//! the curve's centroid, which turns the base curve into a different curve for each member of an ensemble. A
//! [`Sampler`] finally places n nodes on it. Nothing here draws random numbers: the ensemble does, and passes
//! amplitudes and phases.
//!
//! Nodes are numbered i = 1…n, counter-clockwise, as in the paper, and stored at index i-1.

mod base;
mod crossing;
mod descriptors;
mod interpolation;
mod outline;
pub mod outlines;
mod perturbation;
pub mod polygon;
mod sampling;
mod shape;
mod spline;

pub use base::BaseCurve;
pub use crossing::{Undecided, clearance, crossing, crossing_within};
pub use descriptors::{DESCRIPTOR_COUNT, DESCRIPTORS, descriptors};
pub use interpolation::Interpolation;
pub use outline::{MAX_POINTS, Outline};
pub use perturbation::{MIN_FACTOR, Modes, Perturbation, RadialFactor, RadialLaw, check_directions};
pub use sampling::{Sampler, Sampling, resample};
pub use shape::{FlowerMode, Shape};
pub use spline::{MAX_SMOOTH_TURN, Spline};

/// Highest mode of a flower or a perturbation. A mode needs at least four nodes, and runs use far fewer than 4000
/// nodes; the cap bounds the cost of a curve before anything else is known about it.
pub const MAX_MODE: u32 = 1000;
