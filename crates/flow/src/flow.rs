//! The law of motion: normal velocity `β = -∂²_s k + b(k)` with a polynomial `b(k) = c₁k + c₂k² + …`, `b(0) = 0`.
//!
//! The paper's eq. (1). Surface diffusion has `b = 0`, Willmore flow `b = -k³/2`, elastic flow with length
//! penalty λ `b = -k³/2 + λk`. The scheme needs only `b(k)` and `φ(k) = k² - b(k)/k`; both are evaluated by
//! Horner's rule, so there is no division by a vanishing curvature. Units: `k` is 1/length, time is length⁴,
//! so `c_j` is length^(j-3).

use std::{f64::consts::PI, fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use curvelax_base::{error::did_you_mean, text::number};

use crate::{
    crystal::{Crystal, MOST_WAVES, WAVE, parse_numbers},
    equilibrium::Equilibrium,
};

/// Highest power of `k` in `b(k)`; the coefficients are the first numbers of [`Flow::law`].
pub const MAX_DEGREE: usize = 8;
/// Numbers of a law in the parameters that the kernel gets.
pub const LAW: usize = 32;
/// The place of λ among them, after the coefficients.
pub const LENGTH_PENALTY: usize = MAX_DEGREE;
/// The place of the waves of the surface energy, [`MOST_WAVES`] of them.
pub const ENERGY_WAVES: usize = LENGTH_PENALTY + 1;
/// The place of those of the mobility.
pub const DIFFUSIVITY_WAVES: usize = ENERGY_WAVES + MOST_WAVES * WAVE;
/// The place of the square of the unit of length, by which `∮γ ds` becomes an energy in units of 1/length.
pub const ENERGY_UNIT: usize = DIFFUSIVITY_WAVES + MOST_WAVES * WAVE;
/// The place of 4|W| of the [quotient](Equilibrium::quotient).
pub const QUOTIENT: usize = ENERGY_UNIT + 1;

/// Quotient of the two slowest rates of a crystal up to which they count as one.
const EQUAL_RATES: f64 = 1.05;

/// A fourth-order geometric flow, named as on the command line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Flow {
    /// `b = 0`: area constant, length falls.
    SurfaceDiffusion,
    /// `b = -k³/2`: gradient flow of `½∮k² ds`.
    Willmore,
    /// `b = -k³/2 + λk`: gradient flow of `∮(½k² + λ) ds`.
    Elastic(f64),
    /// `b = c₁k + c₂k² + …`, coefficients from the first power on, at most [`MAX_DEGREE`].
    Polynomial(Vec<f64>),
    /// Surface diffusion of a material whose energy and mobility depend on the direction. It has no name of its own:
    /// both functions are keys.
    Crystal(Crystal),
}

const NAMES: [&str; 4] = ["surface-diffusion", "willmore", "elastic", "poly"];

impl Flow {
    /// Returns the coefficients `c₁ … c_8` of `b(k)`.
    pub fn coefficients(&self) -> [f64; MAX_DEGREE] {
        let mut c = [0.0; MAX_DEGREE];
        match self {
            Flow::SurfaceDiffusion | Flow::Crystal(_) => {}
            Flow::Willmore => c[2] = -0.5,
            Flow::Elastic(lambda) => {
                c[0] = *lambda;
                c[2] = -0.5;
            }
            Flow::Polynomial(given) => c[..given.len()].copy_from_slice(given),
        }
        c
    }

    /// Returns the length penalty λ of the reported energy `∮(½k² + λ) ds`; 0 unless the flow is elastic.
    pub fn length_penalty(&self) -> f64 {
        if let Flow::Elastic(lambda) = self { *lambda } else { 0.0 }
    }

    /// Returns the numbers by which [forces](crate::scheme::forces) know the law, for lengths in units of `unit` and
    /// times in units of its fourth power: `c₁ … c_8`, of dimension length^(j-3), and λ of the energy, of dimension
    /// 1/length²; what else there is has a constant with its place. The rest is 0.
    pub fn law(&self, unit: f64) -> [f64; LAW] {
        let mut law = [0.0; LAW];
        for (j, (to, c)) in (1..).zip(law.iter_mut().zip(self.coefficients())) {
            *to = c * f64::powi(unit, 3 - j);
        }
        law[LENGTH_PENALTY] = self.length_penalty() * unit * unit;
        law[QUOTIENT] = 4.0 * self.equilibrium().area();
        if let Flow::Crystal(Crystal { energy, diffusivity }) = self {
            for (place, waves) in [(ENERGY_WAVES, energy.waves()), (DIFFUSIVITY_WAVES, diffusivity.waves())] {
                law[place..].iter_mut().zip(waves.numbers().iter().flatten()).for_each(|(to, number)| *to = *number);
            }
            law[ENERGY_UNIT] = unit * unit;
        }
        law
    }

    /// Returns whether energy or mobility are given as functions of the direction, perhaps constant ones.
    pub fn is_crystal(&self) -> bool {
        matches!(self, Flow::Crystal(_))
    }

    /// Returns the shape to which the flow relaxes closed curves, if it does.
    pub fn equilibrium(&self) -> Equilibrium {
        match self {
            Flow::Crystal(crystal) => Equilibrium::Wulff(crystal.energy),
            _ => Equilibrium::Circle,
        }
    }

    /// Evaluates `b(k)`.
    pub fn b(&self, k: f64) -> f64 {
        self.coefficients().iter().rev().fold(0.0, |sum, c| (sum + c) * k)
    }

    /// Linear decay rate of mode `m` on a circle of radius `radius`: `(m²-1)·(m²/R⁴ + b'(1/R)/R²)`, in 1/time. Of a
    /// crystal, whose modes are others: in proportion to the slowest rate at the Wulff shape of the same area, which is
    /// that of m = 2.
    pub fn linear_rate(&self, m: u32, radius: f64) -> f64 {
        let m2 = f64::from(m * m);
        if let Flow::Crystal(crystal) = self {
            return crystal.slowest_rates()[0] * (m2 - 1.0) * m2 * radius.powi(-4);
        }
        let k = 1.0 / radius;
        let slope: f64 =
            self.coefficients().iter().enumerate().map(|(j, c)| (j + 1) as f64 * c * k.powi(j as i32)).sum();
        (m2 - 1.0) * (m2 * k.powi(4) + slope * k * k)
    }

    /// Returns the time `growth` if a nearly round curve of area `area` grows so that its excess falls as a power of
    /// `growth + t`. Applies to Willmore flow, whose circles have `R⁴ = R₀⁴ + 2t`.
    pub fn growth(&self, area: f64) -> Option<f64> {
        (*self == Flow::Willmore).then(|| 0.5 * (area / PI).powi(2))
    }

    /// Rate at which the excess of a nearly round curve of area `area` falls in mode `m`, by linear theory, in 1/time:
    /// `24/R⁴` for m = 2 and surface diffusion; for Willmore flow the exponent of `1 + 2t/R₀⁴`. `None` if the
    /// radius of a circle changes in another way: see `crates/ensemble/src/outcome/linear_rate.rs` for elastic flow. Of
    /// a crystal for m = 2 the mean of the two slowest rates, if they are nearly equal: otherwise it depends on the
    /// direction.
    pub fn excess_rate(&self, m: u32, area: f64) -> Option<f64> {
        let radius = (area.abs() / PI).sqrt();
        match self {
            Flow::SurfaceDiffusion => Some(2.0 * self.linear_rate(m, radius)),
            Flow::Crystal(crystal) if m == 2 => {
                let [slow, fast] = crystal.slowest_rates();
                (fast <= EQUAL_RATES * slow).then(|| 12.0 * (slow + fast) * radius.powi(-4))
            }
            // The excess scales as the square of the mode's amplitude over the radius; both are powers of R₀⁴ + 2t.
            Flow::Willmore => Some(self.linear_rate(m, 1.0) + 0.5),
            _ => None,
        }
        .filter(|rate| rate.is_finite())
    }
}

impl fmt::Display for Flow {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Flow::SurfaceDiffusion | Flow::Crystal(_) => write!(f, "surface-diffusion"),
            Flow::Willmore => write!(f, "willmore"),
            Flow::Elastic(lambda) => write!(f, "elastic:{}", number(*lambda)),
            Flow::Polynomial(c) => {
                let list: Vec<String> = c.iter().copied().map(number).collect();
                write!(f, "poly:{}", list.join(","))
            }
        }
    }
}

curvelax_base::as_text!(Flow);

impl FromStr for Flow {
    type Err = String;

    fn from_str(text: &str) -> Result<Flow, String> {
        let (name, arguments) = text.split_once(':').map_or((text, None), |(name, rest)| (name, Some(rest)));
        let numbers = arguments.map(parse_numbers).transpose()?;
        match (name, numbers.as_deref()) {
            ("surface-diffusion", None) => Ok(Flow::SurfaceDiffusion),
            ("willmore", None) => Ok(Flow::Willmore),
            ("elastic", Some([lambda])) => Ok(Flow::Elastic(*lambda)),
            ("elastic", _) => Err("elastic takes one length penalty, for example `elastic:0.5`".into()),
            ("poly", Some(c)) if c.len() <= MAX_DEGREE => Ok(Flow::Polynomial(c.to_vec())),
            ("poly", Some(c)) => {
                Err(format!("{} coefficients; poly takes at most {MAX_DEGREE} (b = c1 k + c2 k^2 + ...)", c.len()))
            }
            ("poly", None) => Err("poly takes the coefficients of k, k^2, ..., for example `poly:0.5,0,-0.5`".into()),
            ("surface-diffusion" | "willmore", Some(_)) => Err(format!("{name} takes no argument")),
            _ => Err(format!(
                "unknown flow{}; one of surface-diffusion, willmore, elastic:LAMBDA, poly:C1,C2,...",
                did_you_mean(name, NAMES)
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flow_prints_as_it_is_parsed() {
        for text in ["surface-diffusion", "willmore", "elastic:0.25", "elastic:1e300", "poly:1,-2.5,0,3", "poly:1e-300"]
        {
            assert_eq!(text.parse::<Flow>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn a_wrong_flow_is_refused_with_the_nearest_name() {
        let message = "wilmore".parse::<Flow>().unwrap_err();
        assert!(message.contains("did you mean `willmore`?"), "{message}");
        for text in ["elastic", "elastic:1,2", "elastic:nan", "poly", "poly:", "poly:1,inf", "willmore:1", ""] {
            assert!(text.parse::<Flow>().is_err(), "{text}");
        }
        assert!("poly:1,1,1,1,1,1,1,1,1".parse::<Flow>().is_err());
    }

    #[test]
    fn linear_rates_match_the_named_flows() {
        let (m, radius) = (3, 1.5_f64);
        let r4 = radius.powi(4);
        assert!((Flow::SurfaceDiffusion.linear_rate(m, radius) - 72.0 / r4).abs() < 1e-12);
        assert!((Flow::Willmore.linear_rate(m, radius) - 8.0 * 7.5 / r4).abs() < 1e-12);
        let steady = 0.5 / (radius * radius);
        assert!((Flow::Elastic(steady).linear_rate(m, radius) - 64.0 / r4).abs() < 1e-12);
    }

    #[test]
    fn b_is_the_polynomial() {
        assert_eq!(Flow::Willmore.b(2.0), -4.0);
        assert_eq!(Flow::Polynomial(vec![1.0, 2.0, 3.0]).b(2.0), 2.0 + 8.0 + 24.0);
    }
}
