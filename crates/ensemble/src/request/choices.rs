//! Values of keys that are a word, a number or a word, or a list: how flags and files write them.

use std::{fmt, marker::PhantomData, str::FromStr};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolverChoice {
    /// Gauss–Seidel with a fixed τ, as in the paper; the direct solver with adaptive steps, because sweeps get more
    /// numerous as steps grow.
    Auto,
    /// This one.
    Only(Solver),
}

impl SolverChoice {
    /// Names in flags and files: `auto`, then the solvers.
    pub const NAMES: [&str; 1 + Solver::NAMES.len()] = {
        let mut names = ["auto"; 1 + Solver::NAMES.len()];
        let mut i = 0;
        while i < Solver::NAMES.len() {
            names[1 + i] = Solver::NAMES[i];
            i += 1;
        }
        names
    };
}

impl From<Solver> for SolverChoice {
    fn from(solver: Solver) -> SolverChoice {
        SolverChoice::Only(solver)
    }
}

impl Serialize for SolverChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            SolverChoice::Auto => serializer.serialize_str(SolverChoice::NAMES[0]),
            SolverChoice::Only(solver) => solver.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for SolverChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        match name == SolverChoice::NAMES[0] {
            true => Ok(SolverChoice::Auto),
            false => Solver::named(&name, &SolverChoice::NAMES).map(SolverChoice::Only),
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

/// The fixed time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tau {
    /// τ itself.
    Step(f64),
    /// From each member's own relaxation time.
    Auto,
}

/// How time is cut into steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Steps of one length.
    Fixed(Tau),
    /// Extrapolated steps with this local error tolerance.
    Adaptive(f64),
}

/// ω of the redistribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Omega {
    /// ω itself, in 1/time.
    Rate(f64),
    /// From each member's own relaxation time.
    Auto,
}

/// When a member ends at the latest.
#[derive(Clone, Debug, PartialEq)]
pub enum FinalTime {
    /// At this time.
    At(f64),
    /// When it is relaxed, or at the time that its cell's curve gives as a cap.
    Auto,
    /// For each cell of a sweep at its own time.
    OfCells(Vec<f64>),
}

/// κ of the metric pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pull {
    /// κ itself, in 1/time; 0 is the paper's scheme.
    Rate(f64),
    /// κ from each member's own relaxation time.
    Auto,
}

/// ω_SOR of the sweeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sor {
    /// The factor itself; 1 is the paper's.
    Factor(f64),
    /// From the stiffness of each system.
    Auto,
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

/// Reads and writes `$kind` as a number, `$kind::$number`, or as the word `auto`.
macro_rules! number_or_auto {
    ($kind:ident, $number:ident) => {
        impl FromStr for $kind {
            type Err = String;

            fn from_str(text: &str) -> Result<$kind, String> {
                match text.trim() {
                    "auto" => Ok($kind::Auto),
                    text => text
                        .parse()
                        .map($kind::$number)
                        .map_err(|_| format!("`{}` is neither a number nor `auto`", echo(text))),
                }
            }
        }

        impl fmt::Display for $kind {
            fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
                match self {
                    $kind::$number(number) => write!(f, "{}", text::number(*number)),
                    $kind::Auto => write!(f, "auto"),
                }
            }
        }

        impl FromNumbers for $kind {
            fn from_numbers(_: Vec<f64>) -> Option<$kind> {
                None
            }
        }

        impl From<f64> for $kind {
            fn from(number: f64) -> $kind {
                $kind::$number(number)
            }
        }

        impl Serialize for $kind {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                match self {
                    $kind::$number(number) => serializer.serialize_f64(*number),
                    $kind::Auto => serializer.serialize_str("auto"),
                }
            }
        }

        impl<'de> Deserialize<'de> for $kind {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<$kind, D::Error> {
                deserializer.deserialize_any(OrAuto(PhantomData))
            }
        }
    };
}

number_or_auto!(Tau, Step);
number_or_auto!(Omega, Rate);
number_or_auto!(Pull, Rate);
number_or_auto!(Sor, Factor);

impl fmt::Display for FinalTime {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            FinalTime::At(t) => write!(f, "{}", text::number(*t)),
            FinalTime::Auto => write!(f, "auto"),
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
        let number = |word: &str| {
            let number = word.trim().parse::<f64>();
            number.map_err(|_| format!("`{}` is neither a number nor `auto`", echo(word.trim())))
        };
        match text.trim() {
            "auto" => Ok(FinalTime::Auto),
            list if list.contains(',') => list.split(',').map(number).collect::<Result<_, _>>().map(FinalTime::OfCells),
            word => number(word).map(FinalTime::At),
        }
    }
}

impl From<f64> for FinalTime {
    fn from(t: f64) -> FinalTime {
        FinalTime::At(t)
    }
}

impl Serialize for FinalTime {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            FinalTime::At(t) => serializer.serialize_f64(*t),
            FinalTime::Auto => serializer.serialize_str("auto"),
            FinalTime::OfCells(times) => times.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for FinalTime {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<FinalTime, D::Error> {
        deserializer.deserialize_any(OrAuto(PhantomData))
    }
}

/// Kinds that may also be read from a list of numbers.
trait FromNumbers: Sized {
    /// The kind with these numbers, if it can have several.
    fn from_numbers(numbers: Vec<f64>) -> Option<Self>;
}

impl FromNumbers for FinalTime {
    fn from_numbers(numbers: Vec<f64>) -> Option<FinalTime> {
        Some(FinalTime::OfCells(numbers))
    }
}

struct OrAuto<T>(PhantomData<T>);

impl<'de, T: From<f64> + FromStr<Err = String> + FromNumbers> de::Visitor<'de> for OrAuto<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a number or \"auto\"")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<T, E> {
        Ok(number.into())
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<T, E> {
        Ok((number as f64).into())
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<T, E> {
        Ok((number as f64).into())
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
        text.parse().map_err(E::custom)
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut items: A) -> Result<T, A::Error> {
        let mut numbers = Vec::new();
        while let Some(number) = items.next_element()? {
            numbers.push(number);
        }
        T::from_numbers(numbers).ok_or_else(|| de::Error::invalid_type(de::Unexpected::Seq, &"a number or \"auto\""))
    }
}

/// Reads a list: a TOML array, or the comma-separated text of a flag.
pub(super) fn list<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr,
{
    deserializer.deserialize_any(ListVisitor { takes_one: false, of: PhantomData })
}

/// Reads a list that may be absent.
pub(super) fn some_list<'de, D, T>(deserializer: D) -> Result<Option<Vec<T>>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr,
{
    list(deserializer).map(Some)
}

/// Reads a list that may be absent, and of which one number is that number, so that it can be swept.
pub(super) fn some_numbers<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<f64>>, D::Error> {
    deserializer.deserialize_any(ListVisitor { takes_one: true, of: PhantomData }).map(Some)
}

struct ListVisitor<T> {
    takes_one: bool,
    of: PhantomData<T>,
}

impl<T: FromStr> ListVisitor<T> {
    /// A number alone.
    fn alone<E: de::Error>(self, found: de::Unexpected, text: &str) -> Result<Vec<T>, E> {
        match text.parse() {
            Ok(number) if self.takes_one => Ok(vec![number]),
            _ => Err(E::invalid_type(found, &"an array of numbers, or numbers with commas between them in quotes")),
        }
    }
}

impl<'de, T: Deserialize<'de> + FromStr> de::Visitor<'de> for ListVisitor<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "an array of numbers, or numbers with commas between them in quotes")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Vec<T>, E> {
        self.alone(de::Unexpected::Float(number), &number.to_string())
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Vec<T>, E> {
        self.alone(de::Unexpected::Signed(number), &number.to_string())
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<Vec<T>, E> {
        self.alone(de::Unexpected::Unsigned(number), &number.to_string())
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut items: A) -> Result<Vec<T>, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(list)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Vec<T>, E> {
        let item = |word: &str| {
            word.trim()
                .parse()
                .map_err(|_| E::custom(format!("`{}` in `{}` is not a number of this list", echo(word), echo(text))))
        };
        text.split(',').map(item).collect()
    }
}
