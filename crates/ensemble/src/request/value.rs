//! How a word becomes the value of a key.

use serde::{Deserialize, de::value::StrDeserializer};

use super::{
    choices::{BackendChoice, FinalTime, OrAuto, PositionForm, SolverChoice, Store, Tables},
    drawn::Drawn,
    event::Event,
    shard::Shard,
    sweep::{Sweep, SweepAxis},
    units::Units,
};
use curvelax_base::random::Design;
use curvelax_curve::{Interpolation, Modes, Perturbation, Sampling, Shape};
use curvelax_flow::{
    crystal::{Diffusivity, Energy},
    flow::Flow,
    forcing::{Conserved, Drive},
    number::Precision,
    solver::{MULTIGRID, Order},
};

/// What a flag takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takes {
    /// A value that may begin with a hyphen, as a negative number does.
    Number,
    /// Any other value.
    Text,
    /// One of these names. Those that are gone are refused with a sentence of their own.
    Word {
        /// The names.
        names: &'static [&'static str],
        /// Names of what there was once.
        gone: &'static [&'static str],
    },
    /// `true` or `false`, or nothing for `true`.
    Switch,
    /// Numbers with commas between them.
    List,
    /// A value each time that it is given.
    Repeated,
}

/// The value of a key.
pub trait Value: Sized {
    /// What its flag takes.
    const TAKES: Takes;

    /// Reads a word, which is the whole value or one of several.
    ///
    /// # Errors
    /// What is wrong with it.
    fn read(word: &str) -> Result<Self, String>;

    /// Reads all words of a flag.
    ///
    /// # Errors
    /// As [`Value::read`].
    fn of(words: &[String]) -> Result<Self, String> {
        words.last().map_or(Err("no value".into()), |word| Self::read(word))
    }

    /// Puts `new` in the place of the value.
    fn put(&mut self, new: Self) {
        *self = new;
    }
}

/// Parses a number.
///
/// # Errors
/// That it is none.
pub fn real(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| "not a number".into())
}

/// Parses a whole number that `T` can hold.
///
/// # Errors
/// The range of such numbers.
pub fn whole<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    let value = text.trim().parse::<u64>().ok().and_then(|value| T::try_from(value).ok());
    value.ok_or_else(|| format!("not a whole number from 0 to {}", u128::MAX >> (128 - 8 * size_of::<T>())))
}

macro_rules! values {
    ($takes:expr, $read:expr; $($type:ty),* $(,)?) => {
        $(impl Value for $type {
            const TAKES: Takes = $takes;
            fn read(word: &str) -> Result<Self, String> {
                $read(word)
            }
        })*
    };
}

values! { Takes::Number, whole; u32, u64, usize }
values! { Takes::Number, real; f64 }
values! { Takes::Number, str::parse;
    Drawn<Diffusivity>, Drawn<Drive>, Drawn<Energy>, Drawn<Flow>, Drawn<Shape>, Drawn<f64>, FinalTime, Modes, OrAuto,
    Shard,
}
values! { Takes::Text, str::parse; Conserved, Units }
values! { Takes::Text, |word: &str| Ok(word.to_owned()); String }
values! { Takes::Switch, |word: &str| word.parse().map_err(|_| "neither true nor false".to_string()); bool }

macro_rules! words {
    ($($type:ty: $names:expr, $gone:expr;)*) => {
        $(impl Value for $type {
            const TAKES: Takes = Takes::Word { names: $names, gone: $gone };
            fn read(word: &str) -> Result<Self, String> {
                <$type>::deserialize(StrDeserializer::<serde::de::value::Error>::new(word)).map_err(|e| e.to_string())
            }
        })*
    };
}

words! {
    BackendChoice: &["auto", "gpu", "cpu"], &[];
    Design: &["random", "sobol", "lhs"], &[];
    Interpolation: &Interpolation::NAMES, &[];
    Order: &["coloured", "lexicographic"], &[];
    Perturbation: &["amplitude-phase", "gaussian"], &[];
    PositionForm: &["paper", "geometric", "auto"], &[];
    Precision: &["f32", "f64"], &[];
    Sampling: &["parameter", "arclength", "points"], &[];
    SolverChoice: &SolverChoice::NAMES, &[MULTIGRID];
    Store: &["csv", "zarr"], &[];
    Tables: &["csv", "parquet"], &[];
}

impl<T: Value> Value for Option<T> {
    const TAKES: Takes = T::TAKES;

    fn read(word: &str) -> Result<Self, String> {
        T::read(word).map(Some)
    }

    fn of(words: &[String]) -> Result<Self, String> {
        T::of(words).map(Some)
    }
}

macro_rules! lists {
    ($($item:ty: $takes:expr, $read:expr;)*) => {
        $(impl Value for Vec<$item> {
            const TAKES: Takes = $takes;

            fn read(word: &str) -> Result<Self, String> {
                Ok(vec![$read(word)?])
            }

            fn of(words: &[String]) -> Result<Self, String> {
                words.iter().map(|word| $read(word)).collect()
            }
        })*
    };
}

lists! {
    Event: Takes::Repeated, str::parse;
    f64: Takes::List, real;
    u64: Takes::List, whole;
}

/// Axes are set one by one: those of other keys stay.
impl Value for Sweep {
    const TAKES: Takes = Takes::Repeated;

    fn read(word: &str) -> Result<Self, String> {
        Self::of(&[word.to_owned()])
    }

    fn of(words: &[String]) -> Result<Self, String> {
        let mut sweep = Sweep::default();
        words.iter().try_for_each(|word| word.parse::<SweepAxis>().map(|axis| sweep.set(axis)))?;
        Ok(sweep)
    }

    fn put(&mut self, new: Self) {
        new.axes().iter().for_each(|axis| self.set(axis.clone()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names<T: Value>() -> &'static [&'static str] {
        match T::TAKES {
            Takes::Word { names, .. } => names,
            _ => &[],
        }
    }

    #[test]
    fn the_words_of_a_flag_are_those_of_its_type() {
        fn assert_all<T: Value + for<'de> Deserialize<'de> + std::fmt::Debug>() {
            let refused = T::deserialize(StrDeserializer::<serde::de::value::Error>::new("")).unwrap_err().to_string();
            let all: Vec<_> = refused.split('`').skip(3).step_by(2).collect();
            assert_eq!(all, names::<T>(), "{refused}");
        }
        assert_all::<BackendChoice>();
        assert_all::<Design>();
        assert_all::<Order>();
        assert_all::<Perturbation>();
        assert_all::<PositionForm>();
        assert_all::<Precision>();
        assert_all::<SolverChoice>();
        assert_all::<Store>();
        assert_all::<Tables>();
        for name in names::<Sampling>() {
            assert_eq!(serde_json::to_value(Sampling::read(name).unwrap()).unwrap(), *name);
        }
    }
}
