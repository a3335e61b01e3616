//! The charts of a study, each from plain numbers to the text of an SVG file.
//!
//! Equal data give equal bytes. Values that are not finite are left out, and counted where they stand for members. Where
//! there is nothing to draw, the picture says why. However many members there are, a picture stays below about 100 kB:
//! members are counted in bins, and lines are thinned to what shows.

mod bins;
pub mod decay;
pub mod dependence;
pub mod mesh;
pub mod rates;
pub mod relaxation;
pub mod survival;

pub use decay::{Decay, DecayCurve, Law, Theory};
pub use dependence::{Dependence, Level, PowerLaw, Series, Setting};
pub use mesh::MeshQuality;
pub use rates::FittedRates;
pub use relaxation::RelaxationTimes;
pub use survival::{Survival, SurvivalCurve};

pub use super::{axis::Scale, chart::Estimate};

/// The unit of all times.
const TIME: &str = "length⁴";

#[cfg(test)]
pub mod tests;
