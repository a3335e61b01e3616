//! The named shapes: their syntax, parameters and parametrisations.
//!
//! Every closed formula is a map of `u ∈ [0, 1]`, traversed counter-clockwise, with `u = 0` and `u = 1` the same
//! point. Lengths are in the user's unit; areas are in its square and times in its fourth power.

use std::{
    f64::consts::TAU,
    fmt,
    path::{Path, PathBuf},
    str::FromStr,
};

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::{
    BaseCurve, MAX_MODE, Outline,
    outlines::{self, Labelled},
};
use curvelax_base::{
    error::{Error, did_you_mean, echo, echo_path},
    text::number,
};

/// The curve from which an ensemble is made, before perturbation, named as on the command line.
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
    /// `R·(cos 2πu, sin 2πu)`.
    Circle {
        /// Radius R.
        radius: f64,
    },
    /// The paper's curve with three bays, of length 9.168307 and area 0.7π.
    Nonconvex,
    /// `(cos³ 2πu, sin³ 2πu)`, of length 6 and area 3π/8, with cusps at u = 0, ¼, ½ and ¾.
    Astroid,
    /// Bernoulli's lemniscate `(cos, sin·cos)·A/(1 + sin²)` of 2πu, a figure-eight of length 5.2441151 A whose
    /// curvature is 3/A at its two ends. It has no area and no orientation, and its centre is its double point.
    Lemniscate {
        /// Half-width A.
        half_width: f64,
    },
    /// `r(θ) = 1 + Σ a_m cos(mθ + φ_m)` in polar coordinates, θ = 2πu.
    Flower(Vec<FlowerMode>),
    /// A closed polygon read from a file; `u` is the fraction of its length, see [`outlines`]. A file may hold several,
    /// each a curve of its own.
    File(PathBuf),
    /// The closed polygons of all files that match a [pattern](outlines::glob).
    Files(String),
}

/// One term `a·cos(mθ + φ)` of a flower's radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowerMode {
    /// Mode m, 1 to [`MAX_MODE`].
    pub mode: u32,
    /// Amplitude a of either sign; the |a| of a flower sum to less than 1.
    pub amplitude: f64,
    /// Phase φ in radians.
    pub phase: f64,
}

const NAMES: [&str; 8] = ["ellipse", "circle", "nonconvex", "astroid", "lemniscate", "flower", "file", "files"];
const FORMS: &str = "one of ellipse:A,B, circle:R, nonconvex, astroid, lemniscate:A, flower:M:A[:PHASE],..., \
                     file:PATH, files:PATTERN";

/// Range of lengths in which fourth powers, the unit of times, and their inverses stay finite.
const SIZES: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

impl Shape {
    /// Checks the numbers and creates the curve, reading its file if it has one.
    ///
    /// # Errors
    /// [`Error::Request`] for numbers out of range, for everything that [`Outline::read`] refuses, and for files with
    /// several outlines.
    pub fn resolve(&self) -> Result<BaseCurve, Error> {
        self.check().map_err(|message| Error::Request(format!("--shape {}: {message}", echo(self))))?;
        Ok(match self.clone() {
            Shape::Ellipse { a, b } => BaseCurve::from_formula(move |u| ellipse(a, b, u)),
            Shape::Circle { radius } => BaseCurve::from_formula(move |u| ellipse(radius, radius, u)),
            Shape::Nonconvex => BaseCurve::from_formula(nonconvex),
            Shape::Astroid => BaseCurve::from_formula(astroid).with_cusps(&[0.25, 0.5, 0.75]),
            Shape::Lemniscate { half_width } => BaseCurve::from_formula(move |u| lemniscate(half_width, u)),
            Shape::Flower(modes) => BaseCurve::from_formula(move |u| flower(&modes, u)),
            Shape::File(path) => BaseCurve::from_outline(Outline::read(&path)?),
            Shape::Files(pattern) => {
                let [path] = &outlines::glob(Path::new(""), &pattern)?[..] else {
                    let problem = "several files match, and one curve is expected";
                    return Err(Error::Request(format!(
                        "--shape files:{}: {problem}; give one of them",
                        echo_path(Path::new(&pattern))
                    )));
                };
                BaseCurve::from_outline(Outline::read(path)?)
            }
        })
    }

    /// Reads all outlines of its file or files, named relative to the directory `base`; `None` for a formula.
    ///
    /// # Errors
    /// [`Error::Request`] for everything that [`outlines::read_files`] and [`outlines::glob`] refuse.
    pub fn outlines_from(&self, base: &Path) -> Option<Result<Vec<Labelled>, Error>> {
        match self {
            Shape::File(path) => Some(outlines::read_all(base, path)),
            Shape::Files(pattern) => {
                Some(outlines::glob(base, pattern).and_then(|paths| outlines::read_files(base, &paths)))
            }
            _ => None,
        }
    }

    /// Whether it is made of points rather than by a formula.
    pub fn is_outline(&self) -> bool {
        matches!(self, Shape::File(_) | Shape::Files(_))
    }

    /// Returns the lowest mode, 2 or more, by which the shape differs from a circle; it decays last. `None` for a
    /// circle, and for a lemniscate, which never becomes one.
    pub fn lowest_mode(&self) -> Option<u32> {
        match self {
            Shape::Ellipse { a, b } => (a != b).then_some(2),
            Shape::Circle { .. } | Shape::Lemniscate { .. } => None,
            Shape::Nonconvex | Shape::File(_) | Shape::Files(_) => Some(2),
            Shape::Astroid => Some(4),
            Shape::Flower(modes) => {
                modes.iter().filter(|term| term.amplitude != 0.0).map(|term| term.mode.max(2)).min()
            }
        }
    }

    /// Returns the highest mode of a shape made of modes.
    pub fn highest_mode(&self) -> Option<u32> {
        match self {
            Shape::Flower(modes) => modes.iter().map(|term| term.mode).max(),
            _ => None,
        }
    }

    /// Checks the ranges of the numbers; an error gives problem and remedy, without the key.
    fn check(&self) -> Result<(), String> {
        match self {
            Shape::Ellipse { a, b } => check_size("half-axis", *a).and(check_size("half-axis", *b)),
            Shape::Circle { radius } => check_size("radius", *radius),
            Shape::Nonconvex | Shape::Astroid => Ok(()),
            Shape::Lemniscate { half_width } => check_size("half-width", *half_width),
            Shape::Flower(modes) => check_flower(modes),
            Shape::File(path) if path.as_os_str().is_empty() => Err(MISSING_PATH.into()),
            Shape::Files(pattern) if pattern.is_empty() => Err(MISSING_PATTERN.into()),
            Shape::File(_) | Shape::Files(_) => Ok(()),
        }
    }
}

fn ellipse(a: f64, b: f64, u: f64) -> DVec2 {
    let (sin, cos) = (TAU * u).sin_cos();
    DVec2::new(a * cos, b * sin)
}

fn nonconvex(u: f64) -> DVec2 {
    let (sin, cos) = (TAU * u).sin_cos();
    let ripple = (3.0 * TAU * u).sin().powi(2);
    DVec2::new(cos, 0.5 * sin + cos.sin() + sin * (0.2 + sin * ripple))
}

fn astroid(u: f64) -> DVec2 {
    let (sin, cos) = (TAU * u).sin_cos();
    DVec2::new(cos.powi(3), sin.powi(3))
}

fn lemniscate(half_width: f64, u: f64) -> DVec2 {
    let (sin, cos) = (TAU * u).sin_cos();
    half_width * cos / (1.0 + sin * sin) * DVec2::new(1.0, sin)
}

fn flower(modes: &[FlowerMode], u: f64) -> DVec2 {
    let theta = TAU * u;
    let wave = |term: &FlowerMode| term.amplitude * (f64::from(term.mode) * theta + term.phase).cos();
    DVec2::from_angle(theta) * (1.0 + modes.iter().map(wave).sum::<f64>())
}

fn check_size(what: &str, value: f64) -> Result<(), String> {
    if SIZES.contains(&value) {
        return Ok(());
    }
    let value = number(value);
    Err(format!("the {what} {value} is out of range; allowed are {:e} to {:e}", SIZES.start(), SIZES.end()))
}

const MISSING_PATH: &str = "no path given; write for example file:outline.csv";
const MISSING_PATTERN: &str = "no pattern given; write for example 'files:outlines/*.csv'";
const MAX_PHASE: f64 = 1000.0;

fn check_flower(modes: &[FlowerMode]) -> Result<(), String> {
    if modes.is_empty() {
        return Err("a flower without modes; write for example flower:3:0.2,5:0.1".into());
    }
    if modes.len() > MAX_MODE as usize {
        return Err(format!("a flower of {} modes; allowed are at most {MAX_MODE}", modes.len()));
    }
    for term in modes {
        if !(1..=MAX_MODE).contains(&term.mode) {
            return Err(format!("the mode {} is out of range; allowed are 1 to {MAX_MODE}", term.mode));
        }
        if !(-MAX_PHASE..=MAX_PHASE).contains(&term.phase) {
            let limit = format!("allowed are -{MAX_PHASE} to {MAX_PHASE} radians");
            return Err(format!("the phase {} is out of range; {limit}", term.phase));
        }
    }
    let sum: f64 = modes.iter().map(|term| term.amplitude.abs()).sum();
    if !(0.0..1.0).contains(&sum) {
        return Err(format!("the amplitudes add up to {sum}; their sum must be less than 1, or the radius vanishes"));
    }
    Ok(())
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Shape::Ellipse { a, b } => write!(f, "ellipse:{},{}", number(*a), number(*b)),
            Shape::Circle { radius } => write!(f, "circle:{}", number(*radius)),
            Shape::Nonconvex => write!(f, "nonconvex"),
            Shape::Astroid => write!(f, "astroid"),
            Shape::Lemniscate { half_width } => write!(f, "lemniscate:{}", number(*half_width)),
            Shape::Flower(modes) => {
                let terms: Vec<String> = modes.iter().map(FlowerMode::to_string).collect();
                write!(f, "flower:{}", terms.join(","))
            }
            Shape::File(path) => write!(f, "file:{}", path.display()),
            Shape::Files(pattern) => write!(f, "files:{pattern}"),
        }
    }
}

impl fmt::Display for FlowerMode {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let FlowerMode { mode, amplitude, phase } = self;
        if *phase == 0.0 { write!(f, "{mode}:{amplitude}") } else { write!(f, "{mode}:{amplitude}:{phase}") }
    }
}

curvelax_base::as_text!(Shape);

impl FromStr for Shape {
    type Err = String;

    fn from_str(text: &str) -> Result<Shape, String> {
        let (name, arguments) = text.split_once(':').map_or((text, None), |(name, rest)| (name, Some(rest)));
        let shape = match name {
            "ellipse" => {
                let [a, b] = numbers(
                    arguments,
                    "ellipse takes its two half-axes, for example ellipse:2,1; in --sweep, semicolons separate shapes",
                )?;
                Shape::Ellipse { a, b }
            }
            "circle" => {
                let [radius] = numbers(arguments, "circle takes its radius, for example circle:1")?;
                Shape::Circle { radius }
            }
            "nonconvex" if arguments.is_none() => Shape::Nonconvex,
            "astroid" if arguments.is_none() => Shape::Astroid,
            "nonconvex" | "astroid" => return Err(format!("{name} takes no argument")),
            "lemniscate" => {
                let [half_width] = numbers(arguments, "lemniscate takes its half-width, for example lemniscate:1")?;
                Shape::Lemniscate { half_width }
            }
            "flower" => Shape::Flower(flower_modes(arguments.unwrap_or_default())?),
            "file" => Shape::File(arguments.ok_or(MISSING_PATH)?.into()),
            "files" => Shape::Files(arguments.ok_or(MISSING_PATTERN)?.into()),
            _ => return Err(format!("unknown shape `{}`{}; {FORMS}", echo(name), did_you_mean(name, NAMES))),
        };
        shape.check()?;
        Ok(shape)
    }
}

/// Parses exactly `N` comma-separated numbers; `usage` is the message if there are fewer or more.
fn numbers<const N: usize>(arguments: Option<&str>, usage: &str) -> Result<[f64; N], String> {
    let words: Vec<&str> = arguments.unwrap_or_default().split(',').collect();
    let words: [&str; N] = words.try_into().map_err(|_| usage.to_owned())?;
    let mut values = [0.0; N];
    for (value, word) in values.iter_mut().zip(words) {
        *value = word.trim().parse().map_err(|_| format!("`{}` is not a number; {usage}", echo(word)))?;
    }
    Ok(values)
}

fn flower_modes(list: &str) -> Result<Vec<FlowerMode>, String> {
    list.split(',').filter(|_| !list.is_empty()).map(flower_mode).collect()
}

/// Parses `M:A` or `M:A:PHASE`.
fn flower_mode(text: &str) -> Result<FlowerMode, String> {
    let wrong = || format!("`{}` is not MODE:AMPLITUDE or MODE:AMPLITUDE:PHASE; write for example 3:0.2", echo(text));
    let (mode, rest) = text.split_once(':').ok_or_else(wrong)?;
    let (amplitude, phase) = rest.split_once(':').unwrap_or((rest, "0"));
    let number = |word: &str| word.trim().parse::<f64>().map_err(|_| wrong());
    let mode = mode.trim().parse().map_err(|_| wrong())?;
    Ok(FlowerMode { mode, amplitude: number(amplitude)?, phase: number(phase)? })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{crossing, polygon};

    fn shape(text: &str) -> Shape {
        text.parse().unwrap()
    }

    fn refusal(text: &str) -> String {
        text.parse::<Shape>().expect_err(text)
    }

    fn points(text: &str, n: usize) -> Vec<DVec2> {
        let curve = shape(text).resolve().unwrap();
        (1..=n).map(|i| curve.point(i as f64 / n as f64)).collect()
    }

    #[test]
    fn a_shape_prints_as_it_is_parsed() {
        for text in [
            "ellipse:2,1",
            "ellipse:0.1,1234567.875",
            "circle:0.30000000000000004",
            "nonconvex",
            "astroid",
            "lemniscate:0.75",
            "flower:3:0.2",
            "flower:2:-0.3,5:0.1:1.5",
            "file:some folder/a:b,c.csv",
            "files:some folder/**/[ab]*.csv",
        ] {
            assert_eq!(shape(text).to_string(), text);
            let json = serde_json::to_string(&shape(text)).unwrap();
            assert_eq!(serde_json::from_str::<Shape>(&json).unwrap(), shape(text));
        }
    }

    #[test]
    fn an_unknown_shape_is_refused_with_the_list_and_the_nearest_name() {
        let message = refusal("elipse:2,1");
        assert!(message.contains("did you mean `ellipse`?") && message.contains(FORMS), "{message}");
        assert!(refusal("").contains(FORMS));
        assert!(refusal("deltoid").contains("unknown shape `deltoid`; one of"));
        for name in NAMES {
            assert!(FORMS.contains(name), "{name}");
        }
    }

    #[test]
    fn a_number_out_of_range_is_refused_with_its_value_and_what_is_allowed() {
        for (text, value) in [
            ("ellipse:0,1", "0"),
            ("ellipse:1,-2", "-2"),
            ("ellipse:NaN,1", "NaN"),
            ("circle:inf", "inf"),
            ("lemniscate:0", "0"),
            ("lemniscate:-1", "-1"),
            ("lemniscate:nan", "NaN"),
            ("circle:1e101", "the radius 1e101 is"),
            ("flower:0:0.1", "mode 0"),
            ("flower:1001:0.1", "mode 1001"),
            ("flower:2:0.5,3:-0.5", "add up to 1"),
            ("flower:2:nan", "NaN"),
            ("flower:2:0.1:inf", "phase inf"),
        ] {
            let message = refusal(text);
            let says_what_is_allowed = message.contains("allowed are") || message.contains("less than 1");
            assert!(message.contains(value) && says_what_is_allowed, "{text}: {message}");
        }
        let many = |count: usize| format!("flower:{}", vec!["3:0.0005"; count].join(","));
        assert!(refusal(&many(1001)).contains("a flower of 1001 modes; allowed are at most 1000"));
        assert_eq!(shape(&many(1000)).highest_mode(), Some(3));
    }

    #[test]
    fn a_wrong_form_is_refused_with_an_example() {
        for (text, example) in [
            ("ellipse", "ellipse:2,1"),
            ("ellipse:2", "ellipse:2,1"),
            ("ellipse:2,1,1", "ellipse:2,1"),
            ("ellipse:2,one", "ellipse:2,1"),
            ("circle:", "circle:1"),
            ("nonconvex:1", "nonconvex takes no argument"),
            ("astroid:1", "astroid takes no argument"),
            ("lemniscate", "lemniscate:1"),
            ("lemniscate:1,2", "lemniscate:1"),
            ("lemniscate:wide", "lemniscate:1"),
            ("flower", "flower:3:0.2"),
            ("flower:", "flower:3:0.2"),
            ("flower:3", "3:0.2"),
            ("flower:3:0.1:0:0", "3:0.2"),
            ("flower:-3:0.1", "3:0.2"),
            ("flower:3:0.1,", "3:0.2"),
            ("file", "file:outline.csv"),
            ("file:", "file:outline.csv"),
        ] {
            let message = refusal(text);
            assert!(message.contains(example), "{text}: {message}");
        }
    }

    #[test]
    fn a_shape_made_in_code_is_checked_before_it_is_used() {
        let message = Shape::Circle { radius: -1.0 }.resolve().err().unwrap().to_string();
        assert!(message.starts_with("--shape circle:-1: the radius -1 is out of range"), "{message}");
    }

    #[test]
    fn the_nonconvex_curve_has_the_length_and_area_of_the_paper() {
        let curve = points("nonconvex", 20_000);
        assert!((polygon::length(&curve) - 9.168307).abs() < 1e-6);
        assert!((polygon::signed_area(&curve) - 0.7 * PI).abs() < 1e-6);
    }

    #[test]
    fn the_astroid_has_its_length_area_and_four_cusps() {
        let curve = points("astroid", 20_000);
        assert!((polygon::length(&curve) - 6.0).abs() < 1e-6);
        assert!((polygon::signed_area(&curve) - 0.375 * PI).abs() < 1e-6);
        assert_eq!((polygon::turning_number(&curve), crossing(&curve)), (1, None));
        for (j, cusp) in [DVec2::X, DVec2::Y, -DVec2::X, -DVec2::Y].into_iter().enumerate() {
            let base = shape("astroid").resolve().unwrap();
            assert!(base.point(0.25 * j as f64).distance(cusp) < 1e-15);
        }
    }

    #[test]
    fn the_lemniscate_has_its_length_its_curvature_and_no_sense() {
        let (n, a) = (20_000, 0.75);
        let curve = points("lemniscate:0.75", n);
        assert!((polygon::length(&curve) / a - 5.244_115_1).abs() < 1e-6);
        assert!(polygon::signed_area(&curve).abs() < 1e-14);
        assert_eq!(polygon::turning_number(&curve), 0);
        assert!(crossing(&curve).is_some());
        for p in &curve {
            let (square, across) = (p.length_squared(), p.x * p.x - p.y * p.y);
            assert!((square * square - a * a * across).abs() < 1e-14, "{p}");
        }
        // Both ends have curvature 3/A, of opposite signs; node n is the right one.
        for (end, sense) in [(n, 1.0), (n / 2, -1.0)] {
            let [before, at, after] = [end - 1, end, end + 1].map(|i| curve[(i + n - 1) % n]);
            let curvature = (at - before).angle_to(after - at) / at.distance(after);
            assert!((curvature - sense * 3.0 / a).abs() < 1e-5, "{curvature}");
        }
        assert!(shape("lemniscate:0.75").resolve().unwrap().centroid().length() < 1e-13);
    }

    #[test]
    fn a_flower_has_its_radius_at_each_angle_and_its_area() {
        let curve = points("flower:2:0.2,3:-0.1:0.5", 20_000);
        for p in curve.iter().step_by(777) {
            let theta = p.to_angle();
            let radius = 1.0 + 0.2 * (2.0 * theta).cos() - 0.1 * (3.0 * theta + 0.5).cos();
            assert!((p.length() - radius).abs() < 1e-13);
        }
        assert!((polygon::signed_area(&curve) - PI * (1.0 + 0.5 * (0.04 + 0.01))).abs() < 1e-6);
    }

    #[test]
    fn every_formula_is_counter_clockwise_and_closed() {
        for text in ["ellipse:2,1", "circle:3", "nonconvex", "astroid", "flower:3:0.5,7:0.4:1"] {
            assert!(polygon::signed_area(&points(text, 500)) > 0.0, "{text}");
            let curve = shape(text).resolve().unwrap();
            assert!(curve.point(0.0).distance(curve.point(1.0)) < 1e-14, "{text}");
        }
    }
}
