//! The random perturbation of a curve: a map of the plane that stretches every ray from a centre c,
//!
//! ```text
//! p ↦ c + (p - c)·(1 + Σ_m a_m cos(mθ + φ_m)),   m = low…high,
//! ```
//!
//! with θ the polar angle of `p - c`, `a_m ~ N(0, (σ m^-p)²)` and `φ_m` uniform; or, for [`Perturbation::Gaussian`],
//! with independent normal coefficients of cos and sin. The factor depends only on the angle. While it is positive, the
//! map therefore takes each ray onto itself, is one-to-one, and preserves embedding and orientation, whether or not the
//! curve is star-shaped about c. Draws whose factor falls below [`MIN_FACTOR`] are redrawn, which cuts off the tails of
//! the normal law.
//!
//! With `z = (p - c)/|p - c|`, a point of the unit circle in the complex plane, the sum is the real part of
//! `z^low·Σ_j d_j z^j`, `d_j = a_m e^{iφ_m}` at `m = low + j`: a complex polynomial, evaluated by Horner's rule,
//! without an angle or a cosine per point.

use std::{f64::consts::TAU, fmt, str::FromStr};

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::MAX_MODE;
use curvelax_base::{
    error::{Error, echo},
    text::number,
};

/// Minimum radial factor of an accepted draw. A larger bound would reject curves that relax well; a smaller one would
/// admit necks that no number of nodes resolves.
pub const MIN_FACTOR: f64 = 0.05;

/// Maximum standard deviation of the radial factor. [`MIN_FACTOR`] is then three deviations away at any one angle;
/// far beyond, rejection distorts the requested law.
const MAX_DEVIATION: f64 = 0.3;

/// Angles per period of the highest mode at which the factor is checked. Between them it can be lower by
/// at most (π/64)²/2 = 0.12 % of Σ|a_m|, far less than [`MIN_FACTOR`] for every permitted law.
const ANGLES_PER_PERIOD: u32 = 64;

/// How a mode is drawn. Both laws have the power `σ² m^-2p` in mode m, half of it in cos and half in sin, so that the
/// radius along the angle has the spectrum of a curve with Hurst exponent `H = p - 1/2`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Perturbation {
    /// A normal amplitude and a uniform phase. The coefficients of cos and sin are uncorrelated but not independent,
    /// with kurtosis 4.5.
    #[default]
    AmplitudePhase,
    /// Independent normal coefficients of cos and sin, with kurtosis 3: the radius is a Gaussian process.
    Gaussian,
}

impl Perturbation {
    /// Whether it is the default.
    pub fn is_default(&self) -> bool {
        *self == Perturbation::default()
    }
}

/// Modes `low..=high` of the perturbation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Modes {
    /// Lowest mode, at least 1.
    pub low: u32,
    /// Highest mode, at most [`MAX_MODE`].
    pub high: u32,
}

impl Modes {
    fn check(self) -> Result<(), String> {
        if 1 <= self.low && self.low <= self.high && self.high <= MAX_MODE {
            return Ok(());
        }
        Err(format!("`{self}` is out of range; write LO..=HI with 1 <= LO <= HI <= {MAX_MODE}, for example 2..=8"))
    }
}

impl fmt::Display for Modes {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}..={}", self.low, self.high)
    }
}

impl FromStr for Modes {
    type Err = String;

    fn from_str(text: &str) -> Result<Modes, String> {
        let wrong = || format!("`{}` is not a range of modes; write LO..=HI, for example 2..=8", echo(text));
        let (low, high) = text.split_once("..=").ok_or_else(wrong)?;
        let mode = |word: &str| word.trim().parse().map_err(|_| wrong());
        let modes = Modes { low: mode(low)?, high: mode(high)? };
        modes.check()?;
        Ok(modes)
    }
}

curvelax_base::as_text!(Modes);

/// The validated law of the perturbation: σ, the modes and p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialLaw {
    amplitude: f64,
    modes: Modes,
    decay: f64,
}

impl RadialLaw {
    /// Validates σ = `amplitude` ∈ [0, 0.5], `modes`, p = `decay` ∈ [-4, 20], and their combination.
    ///
    /// # Errors
    /// [`Error::Request`] with the key, its value and the allowed range; also if the standard deviation of the
    /// radial factor, `sqrt(½ Σ σ² m^-2p)`, exceeds 0.3.
    pub fn new(amplitude: f64, modes: Modes, decay: f64) -> Result<RadialLaw, Error> {
        if !(0.0..=0.5).contains(&amplitude) {
            return Err(Error::value(
                "amplitude",
                number(amplitude),
                "out of range",
                "allowed are 0 to 0.5, 0 for none",
            ));
        }
        modes.check().map_err(|message| Error::Request(format!("--modes {message}")))?;
        if !(-4.0..=20.0).contains(&decay) {
            return Err(Error::value("decay", number(decay), "out of range", "allowed are -4 to 20"));
        }
        let law = RadialLaw { amplitude, modes, decay };
        let deviation = law.radial_deviation();
        if deviation > MAX_DEVIATION {
            let problem = format!("with --modes {modes} --decay {decay} the radius deviates by {deviation:.3}");
            let allowed = format!("at most {MAX_DEVIATION}: lower --amplitude, raise --decay or use fewer modes");
            return Err(Error::value("amplitude", number(amplitude), &problem, &allowed));
        }
        Ok(law)
    }

    /// Returns whether the law leaves every curve unchanged (σ = 0).
    pub fn is_none(&self) -> bool {
        self.amplitude == 0.0
    }

    /// Returns σ.
    pub fn amplitude(&self) -> f64 {
        self.amplitude
    }

    /// Returns the modes that are drawn.
    pub fn modes(&self) -> Modes {
        self.modes
    }

    /// Returns the standard deviation `σ m^-p` of the amplitude of mode m.
    pub fn deviation(&self, mode: u32) -> f64 {
        self.amplitude * f64::from(mode).powf(-self.decay)
    }

    /// Returns the standard deviation of the radial factor at any one angle, before draws are rejected:
    /// `sqrt(½ Σ (σ m^-p)²)`.
    pub fn radial_deviation(&self) -> f64 {
        let variance: f64 = (self.modes.low..=self.modes.high).map(|mode| self.deviation(mode).powi(2)).sum();
        (0.5 * variance).sqrt()
    }
}

/// `1 + Σ a_m cos(mθ + φ_m)`: one draw of the perturbation, or none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RadialFactor {
    low: u32,
    /// `a_m e^{iφ_m}`, starting at m = `low`.
    coefficients: Vec<DVec2>,
}

impl RadialFactor {
    /// Creates the factor with amplitude and phase `(a_m, φ_m)` for each of `low`, `low + 1`, …
    pub fn new(low: u32, modes: impl IntoIterator<Item = (f64, f64)>) -> RadialFactor {
        let coefficients = modes.into_iter().map(|(a, phase)| a * DVec2::from_angle(phase)).collect();
        RadialFactor { low, coefficients }
    }

    /// Creates the factor with coefficients `(A_m, B_m)` of cos mθ and sin mθ for each of `low`, `low + 1`, …
    pub fn of_coefficients(low: u32, modes: impl IntoIterator<Item = DVec2>) -> RadialFactor {
        RadialFactor { low, coefficients: modes.into_iter().map(|c| DVec2::new(c.x, -c.y)).collect() }
    }

    /// Returns each mode with its coefficients `(A_m, B_m)` of cos mθ and sin mθ.
    pub fn coefficients(&self) -> impl Iterator<Item = (u32, DVec2)> + '_ {
        (self.low..).zip(self.coefficients.iter().map(|c| DVec2::new(c.x, -c.y)))
    }

    /// Returns `Σ a_m cos(mθ + φ_m)` in the `direction` (cos θ, sin θ).
    pub fn excursion(&self, direction: DVec2) -> f64 {
        let polynomial = |sum: DVec2, c: &DVec2| sum.rotate(direction) + *c;
        let sum = self.coefficients.iter().rev().fold(DVec2::ZERO, polynomial);
        power(direction, self.low).rotate(sum).x
    }

    /// Maps `point` about `centre`; without modes returns exactly `point`. The centre stays fixed.
    pub fn apply(&self, centre: DVec2, point: DVec2) -> DVec2 {
        self.apply_towards((point - centre).normalize_or_zero(), centre, point)
    }

    /// [`Self::apply`] with a known direction from centre to point.
    pub(super) fn apply_towards(&self, direction: DVec2, centre: DVec2, point: DVec2) -> DVec2 {
        point + (point - centre) * self.excursion(direction)
    }

    /// Returns whether the factor is at least [`MIN_FACTOR`] at each of `directions` (see [`check_directions`]).
    pub fn is_embedding(&self, directions: &[DVec2]) -> bool {
        let deepest: f64 = self.coefficients.iter().map(|c| c.length()).sum();
        // Most draws are so mild that no angle needs checking.
        let embeds = |direction: &DVec2| 1.0 + self.excursion(*direction) >= MIN_FACTOR;
        1.0 - deepest >= MIN_FACTOR || directions.iter().all(embeds)
    }
}

/// Returns the fixed directions at which a factor with modes up to `high` is checked: 64 per period of the highest.
pub fn check_directions(high: u32) -> Vec<DVec2> {
    let count = ANGLES_PER_PERIOD * high.max(8);
    (0..count).map(|j| DVec2::from_angle(TAU * f64::from(j) / f64::from(count))).collect()
}

/// `z^exponent` by repeated squaring.
fn power(z: DVec2, exponent: u32) -> DVec2 {
    let (mut result, mut square, mut rest) = (DVec2::X, z, exponent);
    while rest > 0 {
        if rest & 1 == 1 {
            result = result.rotate(square);
        }
        square = square.rotate(square);
        rest >>= 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(amplitude: f64, low: u32, high: u32, decay: f64) -> Result<RadialLaw, Error> {
        RadialLaw::new(amplitude, Modes { low, high }, decay)
    }

    #[test]
    fn the_polynomial_is_the_sum_of_cosines() {
        let modes = [(0.3, 0.2), (-0.1, 2.0), (0.05, -7.0)];
        for low in [1, 2, 5, 100] {
            let factor = RadialFactor::new(low, modes);
            for j in 0..50 {
                let theta = 0.13 * f64::from(j);
                let wave = |(m, (a, phase)): (u32, (f64, f64))| a * (f64::from(m) * theta + phase).cos();
                let expected: f64 = (low..).zip(modes).map(wave).sum();
                assert!((factor.excursion(DVec2::from_angle(theta)) - expected).abs() < 1e-13, "{low} {theta}");
            }
        }
    }

    #[test]
    fn coefficients_of_cos_and_sin_are_those_of_the_sum() {
        let coefficients = [DVec2::new(0.3, -0.1), DVec2::new(0.0, 0.2)];
        let factor = RadialFactor::of_coefficients(3, coefficients);
        assert!(factor.coefficients().eq([(3, coefficients[0]), (4, coefficients[1])]));
        for j in 0..50 {
            let theta = 0.13 * f64::from(j);
            let wave = |(m, c): (u32, DVec2)| c.dot(DVec2::from_angle(f64::from(m) * theta));
            let expected: f64 = factor.coefficients().map(wave).sum();
            assert!((factor.excursion(DVec2::from_angle(theta)) - expected).abs() < 1e-13, "{theta}");
        }
    }

    #[test]
    fn points_move_along_their_rays_and_the_centre_stays() {
        let (factor, centre) = (RadialFactor::new(2, [(0.4, 1.0)]), DVec2::new(3.0, -2.0));
        assert_eq!(factor.apply(centre, centre), centre);
        let point = DVec2::new(1.0, 1.0);
        let theta = (point - centre).to_angle();
        let expected = centre + (point - centre) * (1.0 + 0.4 * (2.0 * theta + 1.0).cos());
        assert!(factor.apply(centre, point).distance(expected) < 1e-15);
    }

    #[test]
    fn a_factor_without_modes_changes_no_bit() {
        let (centre, point) = (DVec2::new(0.1, 0.7), DVec2::new(1.0 / 3.0, 2e-17));
        assert_eq!(RadialFactor::default().apply(centre, point), point);
    }

    #[test]
    fn a_factor_that_vanishes_anywhere_is_no_embedding() {
        let directions = check_directions(8);
        let at_phase = |a: f64, phase: f64| RadialFactor::new(8, [(a, phase)]).is_embedding(&directions);
        for phase in [0.0, 0.037, 1.0, 4.0] {
            assert!(at_phase(0.949, phase) && !at_phase(0.952, phase), "phase {phase}");
        }
    }

    #[test]
    fn a_law_out_of_range_is_refused_with_key_value_and_range() {
        for (found, parts) in [
            (law(-0.1, 2, 8, 1.0), ["--amplitude -0.1", "0 to 0.5"]),
            (law(f64::NAN, 2, 8, 1.0), ["--amplitude NaN", "0 to 0.5"]),
            (law(0.51, 2, 8, 1.0), ["--amplitude 0.51", "0 to 0.5"]),
            (law(0.05, 0, 8, 1.0), ["--modes `0..=8`", "1 <= LO <= HI"]),
            (law(0.05, 9, 8, 1.0), ["--modes `9..=8`", "1 <= LO <= HI"]),
            (law(0.05, 2, 1001, 1.0), ["--modes `2..=1001`", "HI <= 1000"]),
            (law(0.05, 2, 8, f64::INFINITY), ["--decay inf", "-4 to 20"]),
            (law(0.05, 2, 8, -5.0), ["--decay -5", "-4 to 20"]),
            (law(0.5, 1, 8, 0.0), ["--amplitude 0.5", "deviates by 1.000; at most 0.3"]),
        ] {
            let message = found.unwrap_err().to_string();
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
        assert!(law(0.0, 1, 1000, -4.0).unwrap().is_none());
    }

    #[test]
    fn the_deviation_of_the_radius_adds_the_modes_up() {
        let law = law(0.1, 2, 3, 1.0).unwrap();
        assert!((law.radial_deviation() - (0.5 * (0.05_f64.powi(2) + (0.1_f64 / 3.0).powi(2))).sqrt()).abs() < 1e-16);
    }

    #[test]
    fn a_range_of_modes_prints_as_it_is_parsed() {
        assert_eq!("2..=8".parse::<Modes>().unwrap(), Modes { low: 2, high: 8 });
        assert_eq!(Modes { low: 1, high: 1000 }.to_string().parse::<Modes>().unwrap().high, 1000);
        for text in ["", "2..8", "2-8", "0..=3", "5..=4", "1..=1001", "-1..=3", "2..=99999999999"] {
            let message = text.parse::<Modes>().unwrap_err();
            assert!(message.contains("for example 2..=8") && message.contains(text), "{message}");
        }
    }
}
