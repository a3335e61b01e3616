//! Crystals: a surface energy γ and a mobility M that depend on the direction of the surface.
//!
//! ```text
//! β = -∂_s( M(ψ) ∂_s( (γ + γ″)(ψ) k ) ),    ψ the angle of the outward normal of a counter-clockwise curve
//! ```
//!
//! Both functions are 1 plus at most [`MOST_WAVES`] waves `ε cos m(ψ - ψ₀)`. The energy is `∮γ ds`. At rest the curve
//! is the Wulff shape of γ, with the support function γ/c for a scale c, the curvature c/(γ + γ″) and the area |W|/c².

use std::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    fmt,
    str::FromStr,
};

use glam::DVec2;
use serde::{Deserialize, Serialize};

use curvelax_base::{
    error::echo,
    text::{number, rounded},
};

/// Waves of one function: what the numbers of a law have room for.
pub const MOST_WAVES: usize = 2;
/// The highest wave. The corners of a higher one need more nodes than a curve has.
pub const HIGHEST_WAVE: u32 = 12;
/// The largest angle, ten turns: of a larger one few digits are left.
const LARGEST_ANGLE: f64 = 3600.0;
/// The function without waves, as text.
const CONSTANT: &str = "1";
/// Numbers of a wave in the law.
pub const WAVE: usize = 3;
/// Directions at which the least value of a function is looked for.
const DIRECTIONS: usize = 1440;
/// Directions in the theory of decay; odd, so that constants alone have no derivative.
const MODES: usize = 63;

/// A wave `ε cos m(ψ - ψ₀)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// m.
    pub mode: u32,
    /// ε.
    pub strength: f64,
    /// ψ₀ in degrees.
    pub degrees: f64,
}

/// A function of the direction: 1 plus waves of different m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Waves([Option<Wave>; MOST_WAVES]);

/// γ of the surface energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Energy(Waves);

/// M of the mobility.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Diffusivity(Waves);

/// A material: its energy and its mobility.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Crystal {
    /// γ.
    pub energy: Energy,
    /// M.
    pub diffusivity: Diffusivity,
}

impl Waves {
    fn iter(&self) -> impl Iterator<Item = &Wave> {
        self.0.iter().flatten()
    }

    /// Returns the waves that do something as `[m, a, b]`: `a Re z + b Im z`, with z the m-th power of the unit
    /// tangent, which the normal follows by a quarter of a turn. Others are 0.
    pub fn numbers(&self) -> [[f64; WAVE]; MOST_WAVES] {
        let mut numbers = [[0.0; WAVE]; MOST_WAVES];
        let waves = self.iter().filter(|wave| wave.strength != 0.0);
        for (to, wave) in numbers.iter_mut().zip(waves) {
            let mode = f64::from(wave.mode);
            let (sine, cosine) = (mode * (wave.degrees.to_radians() + FRAC_PI_2)).sin_cos();
            *to = [mode, wave.strength * cosine, wave.strength * sine];
        }
        numbers
    }

    /// Returns the function at the angle ψ of the normal, and its first and second derivatives.
    pub fn at(&self, psi: f64) -> [f64; 3] {
        let mut all = [1.0, 0.0, 0.0];
        for Wave { mode, strength, degrees } in self.iter() {
            let m = f64::from(*mode);
            let (sine, cosine) = (m * (psi - degrees.to_radians())).sin_cos();
            all[0] += strength * cosine;
            all[1] -= m * strength * sine;
            all[2] -= m * m * strength * cosine;
        }
        all
    }

    /// The highest m.
    pub fn highest_mode(&self) -> Option<u32> {
        self.iter().map(|wave| wave.mode).max()
    }

    fn least(of: impl Fn(f64) -> f64) -> f64 {
        (0..DIRECTIONS).map(|i| of(TAU * i as f64 / DIRECTIONS as f64)).fold(f64::INFINITY, f64::min)
    }
}

impl fmt::Display for Waves {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.iter().next().is_none() {
            return f.write_str(CONSTANT);
        }
        for (i, Wave { mode, strength, degrees }) in self.iter().enumerate() {
            let plus = if i == 0 { "" } else { "+" };
            write!(f, "{plus}cos:{mode},{}", number(*strength))?;
            if *degrees != 0.0 {
                write!(f, ",{}", number(*degrees))?;
            }
        }
        Ok(())
    }
}

impl FromStr for Waves {
    type Err = String;

    fn from_str(text: &str) -> Result<Waves, String> {
        let mut waves = Waves::default();
        if text.trim() == CONSTANT {
            return Ok(waves);
        }
        let words: Vec<&str> = split_sum(text);
        if words.len() > MOST_WAVES {
            return Err(format!("{} waves; at most {MOST_WAVES}", words.len()));
        }
        for (i, word) in words.into_iter().enumerate() {
            let usage =
                || format!("`{}` is not 1, cos:M,SIZE or cos:M,SIZE,DEGREES, for example `cos:4,0.03`", echo(word));
            let numbers = parse_numbers(word.trim().strip_prefix("cos:").ok_or_else(usage)?)?;
            let (mode, strength, degrees) = match numbers[..] {
                [mode, strength] => (mode, strength, 0.0),
                [mode, strength, degrees] => (mode, strength, degrees),
                _ => return Err(usage()),
            };
            if mode.fract() != 0.0 || !(1.0..=f64::from(HIGHEST_WAVE)).contains(&mode) {
                let problem = "is not a number M of waves: use a whole one up to";
                return Err(format!("{} {problem} {HIGHEST_WAVE}", number(mode)));
            }
            if degrees.abs() > LARGEST_ANGLE {
                return Err(format!(
                    "an angle of {} degrees; use -{LARGEST_ANGLE} to {LARGEST_ANGLE}",
                    number(degrees)
                ));
            }
            if waves.iter().any(|wave| f64::from(wave.mode) == mode) {
                return Err(format!("two waves of M = {mode} are one; write it once"));
            }
            waves.0[i] = Some(Wave { mode: mode as u32, strength, degrees });
        }
        Ok(waves)
    }
}

/// The words between signs `+` that are not those of exponents.
fn split_sum(text: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let mut rest = text;
    while let Some(at) = rest.find("+cos:") {
        words.push(&rest[..at]);
        rest = &rest[at + 1..];
    }
    words.push(rest);
    words
}

/// The conversions of a function with its own check.
macro_rules! function {
    ($name:ident) => {
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
                self.0.fmt(f)
            }
        }

        curvelax_base::as_text!($name);

        impl $name {
            /// Returns its waves.
            pub fn waves(&self) -> &Waves {
                &self.0
            }
        }
    };
}

function!(Energy);
function!(Diffusivity);

impl FromStr for Energy {
    type Err = String;

    /// Reads γ; refused where γ + γ″ is not positive in all directions.
    fn from_str(text: &str) -> Result<Energy, String> {
        let energy = Energy(text.parse()?);
        if energy.0.iter().any(|wave| wave.mode == 1) {
            return Err("a wave of M = 1 moves the curve and changes nothing else; use M from 2 on".into());
        }
        let least = 1.0 - energy.anisotropy();
        match least > 0.0 {
            true => Ok(energy),
            false => Err(format!(
                "the equation is ill-posed, since the stiffness 1 - EPS (M^2 - 1) cos M(psi - DEG) of the surface falls to \
                 {}: such crystals have corners and facets; use a smaller EPS, below {} for M = {}",
                number((1e4 * least).floor() / 1e4),
                rounded(1.0 / energy.highest_factor(), 4),
                energy.0.highest_mode().unwrap_or_default(),
            )),
        }
    }
}

impl FromStr for Diffusivity {
    type Err = String;

    /// Reads M; refused where it is not positive in all directions.
    fn from_str(text: &str) -> Result<Diffusivity, String> {
        let diffusivity = Diffusivity(text.parse()?);
        let least = match diffusivity.0.0 {
            [Some(wave), None] => 1.0 - wave.strength.abs(),
            _ => Waves::least(|psi| diffusivity.0.at(psi)[0]),
        };
        match least > 0.0 {
            true => Ok(diffusivity),
            false => Err(format!(
                "the mobility 1 + EPS cos M(psi - DEG) falls to {}, and atoms would run uphill; use an EPS below 1",
                number((1e4 * least).round() / 1e4)
            )),
        }
    }
}

impl Energy {
    /// Returns 1 - min(γ + γ″): 0 for an isotropic energy, `|ε|(m² - 1)` for one wave, and 1 where the equation ceases
    /// to be parabolic.
    pub fn anisotropy(&self) -> f64 {
        let factor = |wave: &Wave| f64::from(wave.mode * wave.mode) - 1.0;
        match self.0.0 {
            [Some(wave), None] => wave.strength.abs() * factor(&wave),
            _ => 1.0 - Waves::least(|psi| self.stiffness(psi)),
        }
    }

    fn highest_factor(&self) -> f64 {
        self.0.iter().map(|wave| f64::from(wave.mode * wave.mode) - 1.0).fold(1.0, f64::max)
    }

    /// Returns γ + γ″ at the angle ψ of the normal.
    pub fn stiffness(&self, psi: f64) -> f64 {
        let [value, _, second] = self.0.at(psi);
        value + second
    }

    /// Returns γ of an edge, times its length.
    pub fn of_edge(&self, edge: DVec2) -> f64 {
        self.0.at(edge.y.atan2(edge.x) - FRAC_PI_2)[0] * edge.length()
    }

    /// Returns `∮γ ds` of a closed polygon.
    pub fn of_polygon(&self, nodes: &[DVec2]) -> f64 {
        let n = nodes.len();
        (0..n).map(|i| self.of_edge(nodes[(i + 1) % n] - nodes[i])).sum()
    }

    /// Returns |W|, the area of the Wulff shape whose support function is γ: π for an isotropic energy.
    pub fn wulff_area(&self) -> f64 {
        let parts =
            self.0.iter().map(|Wave { mode, strength, .. }| strength * strength * (1.0 - f64::from(mode * mode)));
        PI + FRAC_PI_2 * parts.sum::<f64>()
    }

    /// Returns the point of the Wulff shape of support function γ whose outward normal has the angle ψ.
    pub fn wulff_point(&self, psi: f64) -> DVec2 {
        let [value, slope, _] = self.0.at(psi);
        let normal = DVec2::from_angle(psi);
        value * normal + slope * normal.perp()
    }

    /// Returns `n` nodes on that shape, evenly spaced along it.
    pub fn wulff_nodes(&self, n: usize) -> Vec<DVec2> {
        // The arclength is the integral of γ + γ″.
        let arclength = |psi: f64| {
            let waves = self.0.iter().map(|Wave { mode, strength, degrees }| {
                let m = f64::from(*mode);
                strength * (1.0 - m * m) / m * (m * (psi - degrees.to_radians())).sin()
            });
            psi + waves.sum::<f64>()
        };
        let node = |i: usize| {
            let target = TAU * i as f64 / n as f64;
            // It rises everywhere, and differs from ψ by at most 1 for every wave.
            let (mut low, mut high) = (target - 2.0 * MOST_WAVES as f64, target + 2.0 * MOST_WAVES as f64);
            let mut psi = target;
            for _ in 0..200 {
                let over = arclength(psi) - target;
                if over > 0.0 {
                    high = psi
                } else {
                    low = psi
                }
                let newton = psi - over / self.stiffness(psi);
                let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
                if (next - psi).abs() < 1e-15 * TAU {
                    break;
                }
                psi = next;
            }
            self.wulff_point(psi)
        };
        (0..n).map(node).collect()
    }
}

impl Crystal {
    /// Returns the two slowest rates at which small perturbations of the Wulff shape decay, over those of a circle of
    /// the same area, both 12/R⁴.
    ///
    /// A perturbation ρ(ψ) of the support function moves by `-(c⁴/g) ∂( (M/g) ∂( (ρ + ρ″)/g ) )`, g = γ + γ″. This has
    /// the eigenvalues of the symmetric `c⁴ S G (∂² + 1) G Sᵀ` with G = 1/g and S = √(M/g) ∂, here with trigonometric
    /// differences. Three are 0: two translations and the area.
    pub fn slowest_rates(&self) -> [f64; 2] {
        let n = MODES;
        let at = |i: usize| TAU * i as f64 / n as f64;
        let stiff: Vec<f64> = (0..n).map(|i| self.energy.stiffness(at(i))).collect();
        let root = |i: usize| (self.diffusivity.0.at(at(i))[0] / stiff[i]).sqrt();
        let roots: Vec<f64> = (0..n).map(root).collect();
        let slope = |i: usize, j: usize| match i == j {
            true => 0.0,
            false => 0.5 * if (i + j).is_multiple_of(2) { 1.0 } else { -1.0 } / (0.5 * (at(i) - at(j))).sin(),
        };
        let slopes: Vec<f64> = (0..n * n).map(|at| slope(at / n, at % n)).collect();
        // The middle, G (∂² + 1) G, then S on both sides.
        let product = |a: &[f64], b: &[f64]| {
            let mut c = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    let factor = a[i * n + j];
                    for (to, from) in c[i * n..(i + 1) * n].iter_mut().zip(&b[j * n..(j + 1) * n]) {
                        *to += factor * from;
                    }
                }
            }
            c
        };
        let mut middle = product(&slopes, &slopes);
        for i in 0..n {
            middle[i * n + i] += 1.0;
            for j in 0..n {
                middle[i * n + j] /= stiff[i] * stiff[j];
            }
        }
        // ∂ᵀ = -∂, so the product of both is -S (…) Sᵀ.
        let mut whole = product(&product(&slopes, &middle), &slopes);
        for i in 0..n {
            for j in 0..n {
                whole[i * n + j] *= roots[i] * roots[j];
            }
        }
        let size = (self.energy.wulff_area() / PI).powi(2);
        eigenvalues(whole, n, [3, 4]).map(|rate| size * rate / 12.0)
    }
}

/// The eigenvalues of a symmetric matrix with so many smaller ones, by Householder's reflections and Sturm's count.
fn eigenvalues<const K: usize>(mut a: Vec<f64>, n: usize, below: [usize; K]) -> [f64; K] {
    let mut off = vec![0.0; n];
    for k in 0..n.saturating_sub(2) {
        let norm = (k + 1..n).map(|i| a[i * n + k] * a[i * n + k]).sum::<f64>().sqrt();
        if norm == 0.0 {
            continue;
        }
        let mut v: Vec<f64> = (k + 1..n).map(|i| a[i * n + k]).collect();
        off[k + 1] = -norm.copysign(v[0]);
        v[0] -= off[k + 1];
        let square: f64 = v.iter().map(|x| x * x).sum();
        let m = v.len();
        let at = |i: usize, j: usize| (k + 1 + i) * n + k + 1 + j;
        let p: Vec<f64> = (0..m).map(|i| 2.0 / square * (0..m).map(|j| a[at(i, j)] * v[j]).sum::<f64>()).collect();
        let half = v.iter().zip(&p).map(|(v, p)| v * p).sum::<f64>() / square;
        let q: Vec<f64> = v.iter().zip(&p).map(|(v, p)| p - half * v).collect();
        for i in 0..m {
            for j in 0..m {
                a[at(i, j)] -= v[i] * q[j] + q[i] * v[j];
            }
        }
    }
    if n > 1 {
        off[n - 1] = a[(n - 1) * n + n - 2];
    }
    let diagonal = |i: usize| a[i * n + i];
    let bound = (0..n).map(|i| diagonal(i).abs() + off[i].abs() + off.get(i + 1).map_or(0.0, |o| o.abs()));
    let bound = bound.fold(0.0, f64::max);
    let smaller = |x: f64| {
        let mut pivot = 1.0;
        (0..n)
            .filter(|i| {
                pivot = diagonal(*i) - x - if *i == 0 { 0.0 } else { off[*i] * off[*i] / pivot };
                if pivot == 0.0 {
                    pivot = f64::EPSILON * bound;
                }
                pivot < 0.0
            })
            .count()
    };
    below.map(|below| {
        let (mut low, mut high) = (-bound, bound);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if smaller(middle) > below { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    })
}

/// Parses comma-separated finite numbers.
pub fn parse_numbers(list: &str) -> Result<Vec<f64>, String> {
    list.split(',')
        .map(|word| match word.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("`{}` is not a finite number", echo(word))),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn energy(text: &str) -> Energy {
        text.parse().unwrap()
    }

    fn crystal(gamma: &str, mobility: &str) -> Crystal {
        let diffusivity = if mobility.is_empty() { Diffusivity::default() } else { mobility.parse().unwrap() };
        Crystal { energy: if gamma.is_empty() { Energy::default() } else { energy(gamma) }, diffusivity }
    }

    #[test]
    fn a_function_prints_as_it_is_read() {
        for text in ["cos:4,0.03", "cos:2,-0.1,30", "cos:4,0.02+cos:6,0.005,15", "cos:4,1e-5"] {
            assert_eq!(energy(text).to_string(), text);
        }
        assert_eq!("cos:4,1e+0".parse::<Waves>().unwrap().to_string(), "cos:4,1");
    }

    #[test]
    fn what_is_no_function_or_ill_posed_is_refused_with_the_reason() {
        for (text, part) in [
            ("", "is not 1, cos:M,SIZE"),
            ("sin:4,0.1", "`sin:4,0.1` is not 1, cos:M,SIZE"),
            ("cos:4", "is not 1, cos:M,SIZE"),
            ("2", "`2` is not 1, cos:M,SIZE"),
            ("cos:4,x", "`x` is not a finite number"),
            ("cos:2.5,0.1", "2.5 is not a number M of waves: use a whole one up to 12"),
            ("cos:13,0.001", "13 is not a number"),
            ("cos:1,0.1", "use M from 2 on"),
            ("cos:4,0.01+cos:4,0.01,45", "two waves of M = 4 are one"),
            ("cos:2,0.01+cos:3,0.01+cos:4,0.01", "3 waves; at most 2"),
            (
                "cos:4,0.07",
                "ill-posed, since the stiffness 1 - EPS (M^2 - 1) cos M(psi - DEG) of the surface falls to -0.05",
            ),
            ("cos:2,-0.4", "use a smaller EPS, below 0.3333 for M = 2"),
            ("cos:4,0.04+cos:6,0.02", "ill-posed"),
        ] {
            let message = text.parse::<Energy>().expect_err(text);
            assert!(message.contains(part), "{text}: {message}");
        }
        assert!("cos:4,1".parse::<Diffusivity>().unwrap_err().contains("falls to 0, and atoms would run uphill"));
        assert_eq!((energy("1"), energy(" 1 ").to_string()), (Energy::default(), "1".to_string()));
        assert!("cos:1,0.5".parse::<Diffusivity>().is_ok() && "cos:4,0.06".parse::<Energy>().is_ok());
    }

    #[test]
    fn the_numbers_of_a_wave_give_its_values_by_powers_of_the_tangent() {
        let waves = *energy("cos:3,0.02,20+cos:4,-0.01,5").waves();
        for psi in [0.0, 0.7, 2.0, -1.3] {
            let value: f64 = waves
                .numbers()
                .iter()
                .map(|[m, a, b]| {
                    let (sine, cosine) = (m * (psi + FRAC_PI_2)).sin_cos();
                    a * cosine + b * sine
                })
                .sum();
            assert!((1.0 + value - waves.at(psi)[0]).abs() < 1e-15);
        }
        assert_eq!(energy("cos:4,0").waves().numbers(), [[0.0; 3]; 2]);
    }

    #[test]
    fn the_wulff_shape_has_its_area_and_no_nodes_of_its_polygon_crowd() {
        for text in ["cos:2,0.1,10", "cos:4,0.06", "cos:4,0.03+cos:3,0.02,7"] {
            let energy = energy(text);
            let n = 4000;
            let nodes = energy.wulff_nodes(n);
            let edges: Vec<f64> = (0..n).map(|i| nodes[i].distance(nodes[(i + 1) % n])).collect();
            let area: f64 = (0..n).map(|i| 0.5 * nodes[i].perp_dot(nodes[(i + 1) % n])).sum();
            assert!((area / energy.wulff_area() - 1.0).abs() < 1e-5, "{text}: {area}");
            let (low, high) = edges.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), e| (a.min(*e), b.max(*e)));
            assert!(high / low - 1.0 < 1e-3, "{text}: {low} {high}");
            // E² = 4|W|A at rest.
            let quotient = energy.of_polygon(&nodes).powi(2) / (4.0 * energy.wulff_area() * area);
            assert!((quotient - 1.0).abs() < 1e-5, "{text}: {quotient}");
        }
    }

    /// From an independent program, with 128 directions.
    #[test]
    fn the_slowest_rates_of_wulff_shapes_of_area_two_pi_are_those_of_a_spectral_program() {
        for (gamma, mobility, rates) in [
            ("", "", [3.0, 3.0]),
            ("cos:2,0.1", "", [2.9182802, 3.0068690]),
            ("cos:3,0.05", "", [3.0568598, 3.0568598]),
            ("cos:4,0.03", "", [2.4299444, 3.8050596]),
            ("cos:4,0.03", "cos:4,0.5", [2.3714632, 2.5536235]),
            ("cos:4,0.05", "", [2.1452046, 4.5002562]),
        ] {
            // 12/R⁴ is 3.
            let found = crystal(gamma, mobility).slowest_rates();
            for (found, rate) in found.into_iter().zip(rates) {
                assert!((3.0 * found / rate - 1.0).abs() < 1e-6, "{gamma} {mobility}: {found}");
            }
        }
    }
}
