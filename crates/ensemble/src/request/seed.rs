//! A seed in a spec file and in `run.json`: integers in TOML end at 2⁶³, so larger seeds are written in quotes.

use std::fmt;

use serde::{Deserializer, Serializer, de};

/// The largest integer of TOML.
const LARGEST_WHOLE: u64 = i64::MAX as u64;

/// Writes `seed` as a number, or as its digits in quotes if TOML has no such number.
pub fn serialize<S: Serializer>(seed: &u64, serializer: S) -> Result<S::Ok, S::Error> {
    if *seed <= LARGEST_WHOLE { serializer.serialize_u64(*seed) } else { serializer.collect_str(seed) }
}

/// Reads a seed, with or without quotes.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    deserializer.deserialize_any(Seed)
}

struct Seed;

impl de::Visitor<'_> for Seed {
    type Value = u64;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a whole number from 0 to {}", u64::MAX)
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<u64, E> {
        Ok(number)
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<u64, E> {
        u64::try_from(number).map_err(|_| E::invalid_value(de::Unexpected::Signed(number), &self))
    }

    fn visit_str<E: de::Error>(self, digits: &str) -> Result<u64, E> {
        digits.trim().parse().map_err(|_| E::invalid_value(de::Unexpected::Str(digits), &self))
    }
}
