//! Values of keys that are a word, a number or a word, or a list: how flags and files write them.

use std::{fmt, marker::PhantomData, str::FromStr};

use serde::{
    Deserialize, Deserializer, Serialize,
    de::{self, Error, Unexpected, value::SeqAccessDeserializer},
};
use toml::Value;

use curvelax_backend::DeviceKind;
use curvelax_base::{error::echo, text};
use curvelax_flow::solver::Solver;

/// Where the members are advanced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BackendChoice {
    /// A hardware GPU if there is one, else the CPU.
    Auto,
    /// A GPU, including software ones.
    Gpu,
    /// The CPU back end.
    Cpu,
}

impl From<DeviceKind> for BackendChoice {
    fn from(kind: DeviceKind) -> BackendChoice {
        match kind {
            DeviceKind::Cpu => BackendChoice::Cpu,
            DeviceKind::Gpu => BackendChoice::Gpu,
        }
    }
}

/// The requested solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SolverChoice {
    /// Gauss–Seidel with a fixed τ, as in the paper; the direct solver with adaptive steps, because sweeps get more
    /// numerous as steps grow.
    Auto,
    /// This one.
    #[serde(untagged)]
    Only(Solver),
}

impl SolverChoice {
    /// Names in flags and files: `auto`, then the solvers.
    pub const NAMES: [&str; 1 + Solver::NAMES.len()] = {
        let [one, other] = Solver::NAMES;
        ["auto", one, other]
    };
}

impl From<Solver> for SolverChoice {
    fn from(solver: Solver) -> SolverChoice {
        SolverChoice::Only(solver)
    }
}

impl<'de> Deserialize<'de> for SolverChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match &*String::deserialize(deserializer)? {
            "auto" => Ok(SolverChoice::Auto),
            name => Solver::named(name, &SolverChoice::NAMES).map(SolverChoice::Only),
        }
    }
}

/// What moves the nodes: the right-hand side of the position equation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PositionForm {
    /// The scheme's own curvatures and lengths, as in the paper.
    Paper,
    /// The force of the polygon itself; curvatures and lengths only make the matrix.
    Geometric,
    /// The one that is right for every curve: the paper's.
    Auto,
}

/// A number, or that which suits each member's own relaxation time or the stiffness of each system.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrAuto {
    /// The one that suits.
    Auto,
    /// This one.
    #[serde(untagged)]
    Number(f64),
}

/// How time is cut into steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Steps of one length.
    Fixed(OrAuto),
    /// Extrapolated steps with this local error tolerance.
    Adaptive(f64),
}

/// When a member ends at the latest.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FinalTime {
    /// When it is relaxed, or at the time that its cell's curve gives as a cap.
    Auto,
    /// At this time.
    #[serde(untagged)]
    At(f64),
    /// For each cell of a sweep at its own time.
    #[serde(untagged)]
    OfCells(Vec<f64>),
}

/// How snapshots are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Store {
    /// The table `snapshots.csv`.
    Csv,
    /// The arrays of `snapshots.zarr`.
    Zarr,
}

/// How tables are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tables {
    /// As CSV, from which a run is resumed, merged and drawn again.
    Csv,
    /// At the end of the run as Parquet, too.
    Parquet,
}

impl Tables {
    pub(super) fn is_csv(&self) -> bool {
        *self == Tables::Csv
    }
}

/// Parses a number in the place of which `auto` is allowed, too.
fn beside_auto(word: &str) -> Result<f64, String> {
    let word = word.trim();
    word.parse().map_err(|_| format!("`{}` is neither a number nor `auto`", echo(word)))
}

impl FromStr for OrAuto {
    type Err = String;

    fn from_str(text: &str) -> Result<OrAuto, String> {
        if text.trim() == "auto" { Ok(OrAuto::Auto) } else { beside_auto(text).map(OrAuto::Number) }
    }
}

impl fmt::Display for OrAuto {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            OrAuto::Auto => f.write_str("auto"),
            OrAuto::Number(number) => f.write_str(&text::number(*number)),
        }
    }
}

impl From<f64> for OrAuto {
    fn from(number: f64) -> OrAuto {
        OrAuto::Number(number)
    }
}

impl<'de> Deserialize<'de> for OrAuto {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<OrAuto, D::Error> {
        read(deserializer, OR_AUTO, |value| match value {
            Value::String(text) => Some(text.parse()),
            value => number(value).map(|number| Ok(number.into())),
        })
    }
}

impl fmt::Display for FinalTime {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            FinalTime::Auto => write!(f, "auto"),
            FinalTime::At(t) => write!(f, "{}", text::number(*t)),
            FinalTime::OfCells(times) => {
                let (low, high) =
                    times.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), t| (low.min(*t), high.max(*t)));
                write!(f, "{} to {}", text::number(low), text::number(high))
            }
        }
    }
}

impl FromStr for FinalTime {
    type Err = String;

    /// Parses a time, `auto`, or a list of times with commas between them.
    fn from_str(text: &str) -> Result<FinalTime, String> {
        match text.trim() {
            "auto" => Ok(FinalTime::Auto),
            list if list.contains(',') => {
                list.split(',').map(beside_auto).collect::<Result<_, _>>().map(FinalTime::OfCells)
            }
            word => beside_auto(word).map(FinalTime::At),
        }
    }
}

impl From<f64> for FinalTime {
    fn from(t: f64) -> FinalTime {
        FinalTime::At(t)
    }
}

impl<'de> Deserialize<'de> for FinalTime {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<FinalTime, D::Error> {
        read(deserializer, OR_AUTO, |value| match value {
            Value::String(text) => Some(text.parse()),
            Value::Array(times) => Some(numbers(times).map(FinalTime::OfCells)),
            value => number(value).map(|t| Ok(t.into())),
        })
    }
}

const OR_AUTO: &str = "a number or \"auto\"";

/// Reads a value of a file by `meaning`, which is none for what is not `expected`.
pub(super) fn read<'de, D: Deserializer<'de>, T>(
    deserializer: D,
    expected: &str,
    meaning: impl FnOnce(&Value) -> Option<Result<T, String>>,
) -> Result<T, D::Error> {
    let value = Value::deserialize(deserializer)?;
    let found = match &value {
        Value::String(text) => Unexpected::Str(text),
        Value::Integer(number) => Unexpected::Signed(*number),
        Value::Float(number) => Unexpected::Float(*number),
        Value::Boolean(truth) => Unexpected::Bool(*truth),
        Value::Array(_) => Unexpected::Seq,
        Value::Table(_) | Value::Datetime(_) => Unexpected::Map,
    };
    meaning(&value).ok_or_else(|| D::Error::invalid_type(found, &expected))?.map_err(D::Error::custom)
}

/// The numbers in a list.
fn numbers(list: &[Value]) -> Result<Vec<f64>, String> {
    list.iter().map(|value| number(value).ok_or_else(|| format!("expected a number, found {value}"))).collect()
}

/// The number that a value of a file or a sweep is.
pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// What a list is in a file.
const LIST: &str = "an array of numbers, or numbers with commas between them in quotes";

/// Reads a list: a TOML array, or the comma-separated text of a flag.
pub(super) fn list<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr,
{
    deserializer.deserialize_any(ListVisitor(PhantomData))
}

/// Reads a list that may be absent.
pub(super) fn some_list<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<u64>>, D::Error> {
    list(deserializer).map(Some)
}

/// Reads a few numbers that may be absent, and of which one may stand alone, so that it can be swept.
pub(super) fn some_numbers<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<f64>>, D::Error> {
    let all = read(deserializer, LIST, |value| match value {
        Value::String(text) => Some(parsed(text)),
        Value::Array(items) => Some(numbers(items)),
        value => number(value).map(|number| Ok(vec![number])),
    });
    all.map(Some)
}

/// Each item with its place, should it be wrong.
struct ListVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de> + FromStr> de::Visitor<'de> for ListVisitor<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(LIST)
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, items: A) -> Result<Vec<T>, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(items))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Vec<T>, E> {
        parsed(text).map_err(E::custom)
    }
}

/// Parses numbers with commas between them.
fn parsed<T: FromStr>(text: &str) -> Result<Vec<T>, String> {
    let wrong = |word: &str| format!("`{}` in `{}` is not a number of this list", echo(word), echo(text));
    text.split(',').map(|word| word.trim().parse().map_err(|_| wrong(word))).collect()
}
