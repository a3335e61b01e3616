//! Pictures from plain numbers: SVG, its style, axes and charts; pixels and GIF. Nothing here depends on a run or a
//! file.

// Samples for tests name this crate as they do in tests of other crates.
#[cfg(test)]
extern crate self as curvelax_draw;

pub mod axis;
pub mod chart;
pub mod charts;
pub mod empty;
pub mod gif;
pub mod medium;
pub mod plot;
pub mod raster;
pub mod style;
pub mod svg;
pub mod trace;
pub mod width;
