//! What acts on a curve beside its flow: a driving force along its normal, and quantities that are kept.
//!
//! ```text
//! β = -∂²_s k + b(k) + F + λk + p,    F = const. or C (A - A₀)
//! ```
//!
//! F is positive inwards: a circle of radius R under surface diffusion has R(t) = R₀ - F t. λ and p are the Lagrange
//! multipliers that keep the length and the area.

use std::{
    f64::consts::{PI, TAU},
    fmt,
    str::FromStr,
};

use serde::{Deserialize, Serialize, Serializer};

use curvelax_base::text::number;

use crate::{
    crystal::parse_numbers,
    flow::{Flow, LAW},
};

/// The place of F among the numbers of a law.
pub const DRIVE: usize = crate::flow::QUOTIENT + 1;
/// The place of C.
pub const FEEDBACK: usize = DRIVE + 1;
/// The place of A₀.
pub const FEEDBACK_AREA: usize = DRIVE + 2;
/// The place of what is kept: 1 the area, 2 the length, 3 both, 0 nothing.
pub const CONSERVED: usize = DRIVE + 3;
/// The place of the area that is kept.
pub const KEPT_AREA: usize = DRIVE + 4;
/// The place of the length that is kept.
pub const KEPT_LENGTH: usize = DRIVE + 5;

/// A driving force along the normal, positive inwards, in units of length/time.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub enum Drive {
    /// F, the same everywhere and always.
    Constant(f64),
    /// `F = C (A - A₀)`: an area above A₀ shrinks.
    Feedback {
        /// C, in 1/(length·time).
        gain: f64,
        /// A₀.
        area: f64,
    },
}

/// Which of area and length a flow keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Conserved {
    /// The area.
    Area,
    /// The length.
    Length,
    /// Both.
    AreaAndLength,
}

/// All of it, for one member.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forcing {
    /// The driving force.
    pub drive: Option<Drive>,
    /// What is kept.
    pub conserved: Option<Conserved>,
    /// The area and the length at which it is kept, 0 if that of the start; of what is not kept, any number.
    pub kept: [f64; 2],
}

impl Forcing {
    /// Writes it into the numbers of a [law](crate::flow::Flow::law), for lengths in units of `unit` and times in units
    /// of its fourth power.
    pub fn write(&self, law: &mut [f64; LAW], unit: f64) {
        match self.drive {
            None => {}
            Some(Drive::Constant(force)) => law[DRIVE] = force * unit.powi(3),
            Some(Drive::Feedback { gain, area }) => {
                law[FEEDBACK] = gain * unit.powi(5);
                law[FEEDBACK_AREA] = area / (unit * unit);
            }
        }
        if let Some(conserved) = self.conserved {
            law[CONSERVED] = conserved.code();
            let [area, length] = self.kept;
            if conserved.keeps_area() {
                law[KEPT_AREA] = area / (unit * unit);
            }
            if conserved.keeps_length() {
                law[KEPT_LENGTH] = length / unit;
            }
        }
    }

    /// Returns whether anything acts besides the flow.
    pub fn acts(&self) -> bool {
        self.drive.is_some() || self.conserved.is_some()
    }

    /// Returns it with the area and the length of the start where none are given.
    pub fn kept_from(self, start: [f64; 2]) -> Forcing {
        let [area, length] = self.kept;
        let or_start = |given: f64, start: f64| if given == 0.0 { start } else { given };
        Forcing { kept: [or_start(area, start[0]), or_start(length, start[1])], ..self }
    }

    /// Returns the radius of the circle at which a curve comes to rest, if that follows from what is kept: by those of
    /// the circles of its area and of its length.
    pub fn radius_at_rest(&self, of_area: f64, of_length: f64) -> Option<f64> {
        let [area, length] = self.kept;
        match self.conserved? {
            Conserved::Area => Some(if area == 0.0 { of_area } else { (area / PI).sqrt() }),
            Conserved::Length => Some(if length == 0.0 { of_length } else { length / TAU }),
            Conserved::AreaAndLength => None,
        }
    }

    /// Returns dR/dt of a circle.
    pub fn growth(&self, flow: &Flow, radius: f64) -> f64 {
        match self.conserved {
            // Its area or its length is its radius.
            Some(_) => 0.0,
            None => -flow.b(1.0 / radius) - self.drive.map_or(0.0, |drive| drive.at(PI * radius * radius)),
        }
    }

    /// Returns the [rate](Flow::linear_rate) at which mode `m` of a circle decays. A force that is the same everywhere
    /// has no part in it, nor has p. The λ that keeps the length of a circle, `b(1/R) + λ/R = 0`, adds `λ(m²-1)/R²`.
    pub fn linear_rate(&self, flow: &Flow, m: u32, radius: f64) -> f64 {
        let free = flow.linear_rate(m, radius);
        match self.conserved {
            Some(Conserved::Length) => free - flow.b(1.0 / radius) * (f64::from(m * m) - 1.0) / radius,
            _ => free,
        }
    }
}

impl Drive {
    /// Returns it with `factor` times its strength.
    pub fn scaled(self, factor: f64) -> Drive {
        match self {
            Drive::Constant(force) => Drive::Constant(force * factor),
            Drive::Feedback { gain, area } => Drive::Feedback { gain: gain * factor, area },
        }
    }

    /// Returns the force F on a curve of this area.
    pub fn at(self, area: f64) -> f64 {
        match self {
            Drive::Constant(force) => force,
            Drive::Feedback { gain, area: target } => gain * (area - target),
        }
    }
}

impl Conserved {
    /// Whether the area is kept.
    pub const fn keeps_area(self) -> bool {
        matches!(self, Conserved::Area | Conserved::AreaAndLength)
    }

    /// Whether the length is kept.
    pub const fn keeps_length(self) -> bool {
        matches!(self, Conserved::Length | Conserved::AreaAndLength)
    }

    fn code(self) -> f64 {
        f64::from(u8::from(self.keeps_area()) + 2 * u8::from(self.keeps_length()))
    }
}

impl fmt::Display for Drive {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Drive::Constant(force) => write!(f, "{}", number(*force)),
            Drive::Feedback { gain, area } => write!(f, "feedback:{},{}", number(*gain), number(*area)),
        }
    }
}

/// A constant force is a number.
impl Serialize for Drive {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Drive::Constant(force) => serializer.serialize_f64(*force),
            Drive::Feedback { .. } => serializer.collect_str(self),
        }
    }
}

impl FromStr for Drive {
    type Err = String;

    fn from_str(text: &str) -> Result<Drive, String> {
        let Some((name, arguments)) = text.split_once(':') else {
            return match parse_numbers(text)?.as_slice() {
                [force] => Ok(Drive::Constant(*force)),
                _ => Err("drive takes one force, or feedback:C,A0".into()),
            };
        };
        match (name, parse_numbers(arguments)?.as_slice()) {
            ("feedback", [gain, area]) if *area > 0.0 => Ok(Drive::Feedback { gain: *gain, area: *area }),
            ("feedback", [_, area]) => Err(format!("feedback to an area of {area}, which must be above 0")),
            ("feedback", _) => Err("feedback takes C and the area A0, for example `feedback:1,3.14`".into()),
            _ => Err("a driving force is a number, or feedback:C,A0".into()),
        }
    }
}

impl fmt::Display for Conserved {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Conserved::Area => "area",
            Conserved::Length => "length",
            Conserved::AreaAndLength => "area,length",
        })
    }
}

impl FromStr for Conserved {
    type Err = String;

    fn from_str(text: &str) -> Result<Conserved, String> {
        match text {
            "area" => Ok(Conserved::Area),
            "length" => Ok(Conserved::Length),
            "area,length" | "length,area" => Ok(Conserved::AreaAndLength),
            _ => Err("area, length, or area,length".into()),
        }
    }
}

curvelax_base::as_text!(Drive Conserved);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_prints_as_it_is_parsed() {
        for text in ["0.5", "-2", "feedback:1,3.5"] {
            assert_eq!(text.parse::<Drive>().unwrap().to_string(), text);
        }
        for text in ["", "1,2", "feedback:1", "feedback:1,-2", "push:1", "nan"] {
            assert!(text.parse::<Drive>().is_err(), "{text}");
        }
    }

    #[test]
    fn what_is_kept_decides_on_the_rates_of_willmore_flow_and_a_force_on_the_radius_alone() {
        let (flow, radius) = (Flow::Willmore, 1.5_f64);
        let rate =
            |conserved, m| Forcing { conserved, ..Forcing::default() }.linear_rate(&flow, m, radius) * radius.powi(4);
        for m in [2, 3, 7] {
            let m2 = f64::from(m * m);
            assert!((rate(Some(Conserved::Area), m) - (m2 - 1.0) * (m2 - 1.5)).abs() < 1e-9);
            assert!((rate(Some(Conserved::Length), m) - (m2 - 1.0).powi(2)).abs() < 1e-9);
        }
        let driven = Forcing { drive: Some(Drive::Constant(0.25)), ..Forcing::default() };
        assert_eq!(driven.growth(&Flow::SurfaceDiffusion, radius), -0.25);
        assert_eq!(driven.growth(&flow, 1.0), 0.5 - 0.25);
        assert_eq!(driven.linear_rate(&flow, 3, radius), flow.linear_rate(3, radius));
        let kept = Forcing { conserved: Some(Conserved::Length), ..driven };
        assert_eq!(kept.growth(&flow, radius), 0.0);
    }

    #[test]
    fn what_is_kept_prints_as_it_is_parsed() {
        for text in ["area", "length", "area,length"] {
            assert_eq!(text.parse::<Conserved>().unwrap().to_string(), text);
        }
        assert_eq!("length,area".parse(), Ok(Conserved::AreaAndLength));
        assert!("energy".parse::<Conserved>().is_err());
    }
}
