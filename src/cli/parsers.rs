//! Parsers of the values of flags, which say what is wrong with a word; ranges are checked on the resolved spec.

use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde::{Deserialize, de::value::StrDeserializer};

use crate::{ensemble::Shard, error::echo, solver::MULTIGRID};

/// The number of shards, if not all are in the array.
pub(super) const SHARDS: &str = "CURVELAX_SHARDS";

pub(super) fn real(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| "not a number".into())
}

pub(super) fn whole<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    let value = text.trim().parse::<u64>().ok().and_then(|value| T::try_from(value).ok());
    value.ok_or_else(|| format!("not a whole number from 0 to {}", u128::MAX >> (128 - 8 * size_of::<T>())))
}

/// Parses `I/N`, or `slurm`.
pub(super) fn shard(text: &str) -> Result<Shard, String> {
    match text.trim() {
        "slurm" => slurm(|name| std::env::var(name).ok()),
        text => text.parse(),
    }
}

/// The shard of this task of a Slurm job array. If an array of only some of the N shards is submitted again, its own
/// count is not N, and `CURVELAX_SHARDS` gives N.
fn slurm(variable: impl Fn(&str) -> Option<String>) -> Result<Shard, String> {
    let number = |name: &str| {
        let text = variable(name).ok_or_else(|| format!("no {name}: this is not a task of a Slurm job array"))?;
        text.parse::<u64>().map_err(|_| format!("{name}={} is not a whole number", echo(&text)))
    };
    let index = number("SLURM_ARRAY_TASK_ID")?;
    if variable(SHARDS).is_some() {
        return Shard::new(index, number(SHARDS)?);
    }
    let count = number("SLURM_ARRAY_TASK_COUNT")?;
    let (first, last) = (number("SLURM_ARRAY_TASK_MIN")?, number("SLURM_ARRAY_TASK_MAX")?);
    if first != 0 || last.checked_add(1) != Some(count) {
        return Err(format!(
            "the array has {count} tasks from {first} to {last}, and shards count from 0 to N - 1: use --array=0-{}, \
             or export {SHARDS}=N to run some of N",
            count.saturating_sub(1)
        ));
    }
    Shard::new(index, count)
}

/// Parses a time in hours, minutes and seconds: `1h30m`, `5m`, `90s`, or seconds alone.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || "not a time; write 90, 90s, 5m or 1h30m".to_string();
    let number =
        |digits: &str| digits.parse::<u64>().ok().filter(|_| digits.bytes().all(|digit| digit.is_ascii_digit()));
    let (mut rest, mut seconds) = (text.trim(), 0_u64);
    if let Some(all) = number(rest) {
        (rest, seconds) = ("", all);
    }
    for (unit, size) in [('h', 3600), ('m', 60), ('s', 1)] {
        if let Some((digits, after)) = rest.split_once(unit) {
            let part = number(digits).and_then(|count| count.checked_mul(size)).ok_or_else(wrong)?;
            seconds = seconds.checked_add(part).ok_or_else(wrong)?;
            rest = after;
        }
    }
    match seconds {
        1.. if rest.is_empty() => Ok(Duration::from_secs(seconds)),
        _ => Err(wrong()),
    }
}

pub(super) fn text_of<T: std::str::FromStr<Err = String>>(text: &str) -> Result<T, String> {
    text.parse()
}

/// Parses one of `names` as in the spec file, with clap's listing and suggestions.
pub(super) fn word<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: for<'de> Deserialize<'de> + Clone + Send + Sync + 'static,
{
    word_or_gone(names, &[])
}

/// The same for a solver. The name of one that is gone has a message of its own.
pub(super) fn solver<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: for<'de> Deserialize<'de> + Clone + Send + Sync + 'static,
{
    word_or_gone(names, &[MULTIGRID])
}

/// One of `names`; those that are `gone` are not shown, and reach the type, which refuses them.
fn word_or_gone<T>(names: &'static [&'static str], gone: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: for<'de> Deserialize<'de> + Clone + Send + Sync + 'static,
{
    let shown = names.iter().map(|&name| PossibleValue::new(name));
    let hidden = gone.iter().map(|&name| PossibleValue::new(name).hide(true));
    PossibleValuesParser::new(shown.chain(hidden).collect::<Vec<_>>())
        .try_map(|name| T::deserialize(StrDeserializer::<serde::de::value::Error>::new(&name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_in_hours_minutes_and_seconds() {
        for (text, seconds) in [("90", 90), ("90s", 90), ("5m", 300), ("1h30m", 5400), ("1h1s", 3601), (" 2h ", 7200)] {
            assert_eq!(duration(text), Ok(Duration::from_secs(seconds)), "{text}");
        }
        for text in [
            "",
            "0",
            "0s",
            "-1",
            "+5",
            "1.5h",
            "90x",
            "5m1h",
            "1m1m",
            "m",
            "1h30",
            "s90",
            "1d",
            "1 h",
            "18446744073709551615h",
        ] {
            assert!(duration(text).is_err_and(|message| message.contains("90s, 5m or 1h30m")), "{text}");
        }
    }
}
