//! Pictures from plain numbers: SVG, its style, axes and charts. Nothing here depends on a run or a file.

pub mod axis;
pub mod chart;
pub mod charts;
pub mod plot;
pub mod style;
pub mod svg;
pub mod trace;
pub mod width;
