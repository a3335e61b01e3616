//! Events of one's own: the first time at which an observable of a member reaches a threshold.
//!
//! An event is written `NAME = OBSERVABLE <= THRESHOLD` or `… >= THRESHOLD`. The threshold is a number in the user's
//! units, or a multiple of the observable at the member's start, `FACTOR * start`.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use curvelax_base::{
    error::{did_you_mean, shortened},
    text::number,
};
use curvelax_flow::scheme::member::Observed;
use curvelax_statistics::TimeOf;

/// Maximum events of a spec.
pub const MAX_EVENTS: usize = 32;
/// Characters of a name, and of foreign text in a message.
const MAX_NAME: usize = 32;
const SHOWN: usize = 40;
/// Times that every member has, and words that readers of tables take for a missing value.
const RESERVED: [&str; 5] = ["t_relax", "t_half", "t_limit", "t_end", "self_crossing"];
const MISSING: [&str; 6] = ["na", "nan", "nil", "none", "null", "inf"];
const USAGE: &str = "write NAME = OBSERVABLE <= THRESHOLD or >= THRESHOLD, such as convex = k_min >= 0, or with a \
                     threshold relative to the start, slow = excess <= 0.5 * start";

/// A scalar of a curve, by its name in `series.csv`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observable {
    /// Length of the polygon.
    Length,
    /// Its signed area.
    Area,
    /// Its distance from [equilibrium](curvelax_flow::equilibrium).
    Excess,
    /// `∮(½k² + λ) ds`.
    Energy,
    /// Smallest curvature.
    MinCurvature,
    /// Largest curvature.
    MaxCurvature,
    /// Longest edge over the shortest.
    MeshRatio,
    /// How far the scheme's lengths have left the polygon's.
    MetricDrift,
}

/// A threshold of an observable, and from which side it is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// The observable.
    pub observable: Observable,
    /// Whether the condition is `<=`; otherwise it is `>=`.
    pub falls: bool,
    /// The threshold in the user's units, or as a multiple of the start.
    pub threshold: f64,
    /// Whether it is a multiple of the start.
    pub relative: bool,
}

/// A named condition. Written as it is parsed.
///
/// ```
/// use curvelax_ensemble::Event;
///
/// let event: Event = "slow=excess<=0.5*start".parse()?;
/// assert_eq!(event.to_string(), "slow = excess <= 0.5 * start");
/// assert!("slow = exces <= 0.5".parse::<Event>().unwrap_err().contains("did you mean `excess`?"));
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Event {
    /// Its name in the tables.
    pub name: String,
    /// When it happens.
    pub condition: Condition,
}

impl Observable {
    /// All of them, in the order of [`Observed`].
    pub const ALL: [Observable; 8] = [
        Observable::Length,
        Observable::Area,
        Observable::Excess,
        Observable::Energy,
        Observable::MinCurvature,
        Observable::MaxCurvature,
        Observable::MeshRatio,
        Observable::MetricDrift,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Observed::<f64>::FIELDS[self as usize]
    }

    /// Its value.
    pub fn of(self, at: &Observed<f64>) -> f64 {
        at.to_numbers()[self as usize]
    }

    /// What a time is at which it reaches a value.
    pub fn time_of(self) -> TimeOf {
        match self {
            Observable::Length | Observable::Excess => TimeOf::Shape,
            Observable::Area | Observable::Energy => TimeOf::Bending,
            Observable::MinCurvature | Observable::MaxCurvature | Observable::MeshRatio | Observable::MetricDrift => {
                TimeOf::Extreme
            }
        }
    }

    /// The power of a length that it is.
    pub fn power(self) -> i32 {
        match self {
            Observable::Length => 1,
            Observable::Area => 2,
            Observable::Energy | Observable::MinCurvature | Observable::MaxCurvature => -1,
            Observable::Excess | Observable::MeshRatio | Observable::MetricDrift => 0,
        }
    }
}

impl FromStr for Observable {
    type Err = String;

    fn from_str(text: &str) -> Result<Observable, String> {
        let found = Observable::ALL.into_iter().find(|observable| observable.name() == text);
        found.ok_or_else(|| {
            let (names, word) = (Observable::ALL.map(Observable::name), shortened(text, SHOWN));
            format!("no observable `{word}`{}; use one of {}", did_you_mean(text, names), names.join(", "))
        })
    }
}

impl Condition {
    /// The threshold in lengths of `unit`, for a member that starts with the observables `start` in that unit.
    pub fn threshold_in(&self, unit: f64, start: &Observed<f64>) -> f64 {
        match self.relative {
            true => self.threshold * self.observable.of(start),
            false => self.threshold / unit.powi(self.observable.power()),
        }
    }
}

impl FromStr for Condition {
    type Err = String;

    fn from_str(text: &str) -> Result<Condition, String> {
        let text = text.trim();
        let at =
            text.find(['<', '>']).ok_or_else(|| format!("`{}` has no threshold; {USAGE}", shortened(text, SHOWN)))?;
        let (left, falls) = (&text[..at], text[at..].starts_with('<'));
        // A threshold is reached or not: `<` and `<=` have the same first time.
        let right = text[at + 1..].strip_prefix('=').unwrap_or(&text[at + 1..]);
        let observable = left.trim().parse()?;
        let (factor, relative) = match right.trim().strip_suffix("start") {
            Some("") => ("1", true),
            Some(factor) => (factor.trim().strip_suffix('*').unwrap_or("").trim(), true),
            None => (right.trim(), false),
        };
        let threshold = factor.parse().ok().filter(|threshold: &f64| threshold.is_finite());
        let threshold = threshold.ok_or_else(|| {
            format!(
                "`{}` is not a threshold, which is a number or a number * start; {USAGE}",
                shortened(right.trim(), SHOWN)
            )
        })?;
        Ok(Condition { observable, falls, threshold, relative })
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Condition { observable, falls, threshold, relative } = self;
        let (sign, start) = (if *falls { "<=" } else { ">=" }, if *relative { " * start" } else { "" });
        write!(f, "{} {sign} {}{start}", observable.name(), number(*threshold))
    }
}

impl FromStr for Event {
    type Err = String;

    fn from_str(text: &str) -> Result<Event, String> {
        let parts = text.split_once('=').filter(|(name, _)| !name.contains(['<', '>']));
        let (name, condition) =
            parts.ok_or_else(|| format!("`{}` has no name; {USAGE}", shortened(text.trim(), SHOWN)))?;
        Ok(Event { name: checked(name.trim())?, condition: condition.parse()? })
    }
}

/// The name of an event, if it can stand in a table.
fn checked(name: &str) -> Result<String, String> {
    let refuse = |problem: &str| Err(format!("`{}` {problem}", shortened(name, SHOWN)));
    let is_word = |name: &str| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    match name {
        _ if RESERVED.contains(&name) => refuse("is a time that every member has; choose another name"),
        _ if MISSING.contains(&name.to_ascii_lowercase().as_str()) => {
            refuse("reads as a missing value in a table; choose another name")
        }
        _ if name.len() <= MAX_NAME && name.starts_with(|c: char| c.is_ascii_alphabetic()) && is_word(name) => {
            Ok(name.to_owned())
        }
        _ => refuse(&format!("is not a name: use a letter, then letters, digits, _ and -, up to {MAX_NAME} in all")),
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} = {}", self.name, self.condition)
    }
}

curvelax_base::as_text!(Event);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_print_as_they_are_read() {
        for (text, printed) in [
            ("convex = k_min >= 0", "convex = k_min >= 0"),
            ("slow=excess<=0.5*start", "slow = excess <= 0.5 * start"),
            ("small = length < 6.4", "small = length <= 6.4"),
            (" a-1_b =area>-1e-7 ", "a-1_b = area >= -1e-7"),
            ("x = energy >= start", "x = energy >= 1 * start"),
            ("x = k_max <= -2.50*start", "x = k_max <= -2.5 * start"),
        ] {
            let event: Event = text.parse().unwrap();
            assert_eq!(event.to_string(), printed);
            assert_eq!(printed.parse::<Event>().unwrap(), event);
        }
    }

    #[test]
    fn what_is_no_event_is_refused_with_the_remedy() {
        for (text, part) in [
            ("convex", "`convex` has no name; write NAME = OBSERVABLE <= THRESHOLD"),
            ("k_min >= 0", "`k_min >= 0` has no name"),
            ("convex = k_min", "`k_min` has no threshold"),
            ("convex = k_min = 0", "has no threshold"),
            ("convex = kmin >= 0", "no observable `kmin` (did you mean `k_min`?); use one of length, area, excess"),
            ("convex = >= 0", "no observable ``; use one of"),
            ("convex = k_min >=", "`` is not a threshold"),
            ("convex = k_min >= none", "`none` is not a threshold"),
            ("convex = k_min >= nan", "`nan` is not a threshold"),
            ("convex = k_min >= inf * start", "is not a threshold"),
            ("convex = k_min >= 2 start", "is not a threshold"),
            ("convex = k_min >= restart", "is not a threshold"),
            ("t_half = excess <= 1", "`t_half` is a time that every member has"),
            ("NaN = excess <= 1", "reads as a missing value"),
            (" = excess <= 1", "`` is not a name"),
            ("1st = excess <= 1", "is not a name"),
            ("a,b = excess <= 1", "is not a name"),
            ("über = excess <= 1", "is not a name"),
            ("abcdefghijabcdefghijabcdefghijabc = excess <= 1", "is not a name"),
        ] {
            let message = text.parse::<Event>().unwrap_err();
            assert!(message.contains(part) && !message.contains('\n'), "{text}: {message}");
        }
    }

    #[test]
    fn observables_are_those_of_the_report_and_have_its_units() {
        let numbers: Vec<f64> = (1..=8).map(f64::from).collect();
        let at = Observed::from_numbers(&numbers);
        assert_eq!(Observable::ALL.map(|observable| observable.of(&at)), numbers[..]);
        assert_eq!(Observable::ALL.map(Observable::name)[..], *Observed::<f64>::FIELDS);
        // As they are converted for the tables.
        let unit = 4.0;
        let user = crate::Observables::new(&at, 1.0, unit);
        let user = [user.length, user.area, user.excess, user.energy, user.k_min, user.k_max, user.mesh_ratio];
        for (observable, threshold) in Observable::ALL.into_iter().zip(user) {
            let condition = Condition { observable, falls: true, threshold, relative: false };
            assert_eq!(condition.threshold_in(unit, &at), observable.of(&at), "{condition}");
            let relative = Condition { threshold: 0.5, relative: true, ..condition };
            assert_eq!(relative.threshold_in(unit, &at), 0.5 * observable.of(&at));
        }
    }
}
