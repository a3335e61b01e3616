//! Sweeps: the keys of a spec that vary from cell to cell of a study, and their values.
//!
//! The cells are the cross product of all values; the last key changes fastest.

use std::{fmt, str::FromStr};

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{MapAccess, Visitor},
    ser::SerializeMap,
};
use toml::Value;

use super::choices::number;
use curvelax_base::error::{Error, Result, did_you_mean, echo, shortened};

/// Keys of which each replaces the other.
pub const EXCLUSIVE: [[&str; 2]; 2] = [["tau", "adaptive"], ["relax-to", "relax-at"]];
/// More cells than this are a typing error.
pub const MAX_CELLS: u64 = 10_000;

/// The swept keys in order, each with its values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sweep(Vec<SweepAxis>);

/// Characters of the values in a title, and of one of them.
const MAX_TITLE: usize = 80;
const MAX_LABEL: usize = 40;

/// One swept key with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepAxis {
    /// A key of the spec.
    pub key: String,
    /// Its values: numbers, words or booleans.
    pub values: Vec<Value>,
}

/// The key that `key` replaces.
pub(crate) fn replaced_by(key: &str) -> Option<&'static str> {
    let pair = EXCLUSIVE.into_iter().find(|pair| pair.contains(&key))?;
    pair.into_iter().find(|other| *other != key)
}

/// Checks that neither the swept `key` nor one that it replaces is among the keys `given` beside the sweep.
///
/// # Errors
/// [`Error::Request`] naming the key whose value would be lost.
pub fn check_not_given(key: &str, given: &[String]) -> Result<()> {
    let replaced = |other: &&String| *other == key || replaced_by(key) == Some(other);
    given.iter().find(replaced).map_or(Ok(()), |other| {
        Err(Error::Request(format!(
            "--sweep {key}: --{other} is given, too, and its value would be lost; leave one of them out"
        )))
    })
}

impl SweepAxis {
    /// The values as text for tables.
    pub fn labels(&self) -> Vec<String> {
        self.values.iter().map(label).collect()
    }

    /// The key with its values for a title. Of many only the first ones and the last one are named, with their number.
    pub fn title(&self) -> String {
        let labels: Vec<String> = self.labels().iter().map(|label| shortened(label, MAX_LABEL)).collect();
        let named = |count: usize| labels[..count].join(", ");
        let fits = |count: &usize| named(*count).chars().count() <= MAX_TITLE;
        let values = match (labels.last(), (1..=labels.len()).rfind(fits).unwrap_or(1)) {
            (Some(last), count) if count < labels.len() => {
                format!("{}, …, {last} ({} values)", named(count), labels.len())
            }
            _ => labels.join(", "),
        };
        format!("{} = {values}", self.key)
    }

    /// The values as numbers, if all of them are.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        self.values.iter().map(number).collect()
    }
}

/// A value as text for tables and messages.
pub(crate) fn label(value: &Value) -> String {
    match value {
        Value::String(word) => word.clone(),
        // 1e-12, not 0.000000000001; both read back exactly.
        Value::Float(number) if *number != 0.0 && !(1e-4..1e15).contains(&number.abs()) => format!("{number:e}"),
        Value::Float(number) => number.to_string(),
        other => other.to_string(),
    }
}

impl FromStr for SweepAxis {
    type Err = String;

    /// Parses `key=v1,v2`; if a value contains commas outside parentheses, semicolons separate the values.
    fn from_str(text: &str) -> Result<SweepAxis, String> {
        let (key, values) =
            text.split_once('=').ok_or_else(|| format!("`{}` has no `=`; write key=v1,v2,...", echo(text)))?;
        let separator = if values.contains(';') { ';' } else { ',' };
        let key = key.trim();
        let value = |word: &str| {
            let word = word.trim();
            match (word.parse::<u64>(), word.parse::<i64>(), word.parse::<f64>(), word.parse::<bool>()) {
                (Ok(whole), ..) => from_whole(key, whole),
                (_, Ok(whole), ..) => Value::Integer(whole),
                (.., Ok(real), _) => Value::Float(real),
                (.., Ok(truth)) => Value::Boolean(truth),
                _ => Value::String(word.to_string()),
            }
        };
        let words = split_outside(values, separator).into_iter().filter(|word| !word.trim().is_empty());
        Ok(SweepAxis { key: key.to_string(), values: words.map(value).collect() })
    }
}

/// The parts of `text` between separators, of which none is inside parentheses that are closed.
fn split_outside(text: &str, separator: char) -> Vec<&str> {
    let (mut parts, mut start, mut depth) = (Vec::new(), 0, 0_u32);
    for (at, c) in text.char_indices() {
        match c {
            '(' if text[at..].contains(')') => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            c if c == separator && depth == 0 => {
                parts.push(&text[start..at]);
                start = at + c.len_utf8();
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

/// An integer as a value of `key`. Integers in TOML end at 2⁶³: a larger seed becomes text, and other keys with values
/// as large are reals.
fn from_whole(key: &str, whole: u64) -> Value {
    match i64::try_from(whole) {
        Ok(whole) => Value::Integer(whole),
        Err(_) if key == "seed" => Value::String(whole.to_string()),
        Err(_) => Value::Float(whole as f64),
    }
}

/// A value as it is read.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number, a text, or true or false")]
enum Read {
    Value(Value),
    Whole(u64),
}

impl Sweep {
    /// Whether nothing is swept.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The keys and their values, in order.
    pub fn axes(&self) -> &[SweepAxis] {
        &self.0
    }

    /// The values of `key`, if it is swept.
    pub fn axis(&self, key: &str) -> Option<&SweepAxis> {
        self.0.iter().find(|axis| axis.key == key)
    }

    /// Whether `key` is swept.
    pub fn has(&self, key: &str) -> bool {
        self.axis(key).is_some()
    }

    /// Sets the values of a key; flags thus replace what the file says.
    pub fn set(&mut self, axis: SweepAxis) {
        match self.0.iter_mut().find(|own| own.key == axis.key) {
            Some(own) => *own = axis,
            None => self.0.push(axis),
        }
    }

    /// Number of cells: 1 without a sweep.
    pub fn cells(&self) -> u64 {
        self.0.iter().map(|axis| axis.values.len() as u64).fold(1, u64::saturating_mul)
    }

    /// The value of every key in cell `index`, in key order.
    pub fn values(&self, index: u64) -> Vec<&Value> {
        let mut rest = index;
        let mut values: Vec<&Value> = Vec::new();
        for axis in self.0.iter().rev() {
            let count = axis.values.len().max(1) as u64;
            values.extend(axis.values.get((rest % count) as usize));
            rest /= count;
        }
        values.reverse();
        values
    }

    /// The keys with their values in cell `index`.
    pub(crate) fn of_cell(&self, index: u64) -> impl Iterator<Item = (&str, &Value)> {
        self.0.iter().map(|axis| &*axis.key).zip(self.values(index))
    }

    /// Names the values of cell `index`, as `key = value`, as they are `shown`.
    fn named(&self, index: u64, shown: impl Fn(&Value) -> String) -> String {
        let parts = self.of_cell(index).map(|(key, value)| format!("{key} = {}", shown(value)));
        parts.collect::<Vec<_>>().join(", ")
    }

    /// Names the values of cell `index`, as `key = value`.
    pub fn name(&self, index: u64) -> String {
        self.named(index, label)
    }

    /// The values of cell `index` as text for tables.
    pub fn labels(&self, index: u64) -> Vec<String> {
        self.values(index).into_iter().map(label).collect()
    }

    /// Adds a cell to an error about its request, if anything is swept.
    pub(crate) fn in_cell(&self, error: Error, index: u64) -> Error {
        match error {
            // A message about a value of the sweep names it already.
            Error::Request(message) if !self.is_empty() && !message.starts_with("--sweep ") => Error::Request(format!(
                "{message} (in the cell {})",
                self.named(index, |value| shortened(&label(value), MAX_LABEL))
            )),
            error => error,
        }
    }

    /// Checks that the keys are among `keys` and not the same in every cell, and the numbers of values. The values
    /// themselves are checked cell by cell.
    ///
    /// # Errors
    /// [`Error::Request`] for a key that is unknown, cannot vary or has no values, and for too many cells.
    pub fn check(&self, keys: &[String], is_common: impl Fn(&str) -> bool) -> Result<()> {
        for (i, SweepAxis { key, values }) in self.0.iter().enumerate() {
            let shown = echo(key);
            if !keys.contains(key) {
                let hint = did_you_mean(key, keys.iter().map(String::as_str));
                return Err(Error::Request(format!(
                    "--sweep {shown}: no such key{hint}; see --print-spec for the keys"
                )));
            }
            if is_common(key) {
                let message = "it is the same for the whole run; run once for each value";
                return Err(Error::Request(format!("--sweep {shown}: {message}")));
            }
            if values.is_empty() {
                return Err(Error::Request(format!("--sweep {shown}: no values; write {shown}=v1,v2,...")));
            }
            if let Some(value) = values.iter().find(|value| value.is_array() || value.is_table()) {
                return Err(Error::Request(format!("--sweep {shown}: {} is not a single value", echo(value))));
            }
            if self.0[..i].iter().any(|before| before.key == *key) {
                return Err(Error::Request(format!("--sweep {shown}: named twice; put all its values behind one")));
            }
        }
        match self.cells() {
            0..=MAX_CELLS => Ok(()),
            cells => {
                Err(Error::value("sweep", format!("({cells} cells)"), "too many", &format!("at most {MAX_CELLS}")))
            }
        }
    }
}

impl Serialize for Sweep {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for SweepAxis { key, values } in &self.0 {
            map.serialize_entry(key, values)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Sweep {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Sweep, D::Error> {
        struct Axes;

        impl<'de> Visitor<'de> for Axes {
            type Value = Sweep;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                write!(f, "a table of keys, each with an array of values")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Sweep, A::Error> {
                let mut axes = Vec::new();
                while let Some((key, values)) = map.next_entry::<String, Vec<Read>>()? {
                    let value = |read| match read {
                        Read::Value(value) => value,
                        Read::Whole(whole) => from_whole(&key, whole),
                    };
                    let values = values.into_iter().map(value).collect();
                    axes.push(SweepAxis { key, values });
                }
                Ok(Sweep(axes))
            }
        }

        deserializer.deserialize_map(Axes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Spec;

    fn of_cell(sweep: &Sweep, base: &Spec, index: u64) -> Result<Spec> {
        Spec { sweep: sweep.clone(), ..base.clone() }.of_cell(index)
    }

    fn sweep(axes: &[&str]) -> Sweep {
        let mut sweep = Sweep::default();
        axes.iter().for_each(|axis| sweep.set(axis.parse().unwrap()));
        sweep
    }

    #[test]
    fn a_title_names_what_fits_and_counts_the_rest() {
        let title = |axis: &str| axis.parse::<SweepAxis>().unwrap().title();
        assert_eq!(title("amplitude=0.05,0.1"), "amplitude = 0.05, 0.1");
        let seeds = (1..=500).map(|seed| seed.to_string()).collect::<Vec<_>>().join(",");
        let many = title(&format!("seed={seeds}"));
        assert!(many.starts_with("seed = 1, 2, 3,") && many.ends_with(", …, 500 (500 values)"), "{many}");
        assert!(many.chars().count() < 120, "{many}");
        // One value too long for a title is cut, and still counted.
        let files = format!("shape=file:{0}.csv;file:{0}2.csv;circle:1", "long/".repeat(40));
        assert!(title(&files).ends_with(", …, circle:1 (3 values)"), "{}", title(&files));
    }

    #[test]
    fn cells_are_the_cross_product_with_the_last_key_fastest() {
        let sweep = sweep(&["shape=ellipse:2,1;circle:1", "amplitude=0.1,1"]);
        sweep.check(&Spec::keys(), Spec::is_common).unwrap();
        assert_eq!(sweep.cells(), 4);
        let names: Vec<String> = (0..4).map(|cell| sweep.name(cell)).collect();
        assert_eq!(
            names,
            [
                "shape = ellipse:2,1, amplitude = 0.1",
                "shape = ellipse:2,1, amplitude = 1",
                "shape = circle:1, amplitude = 0.1",
                "shape = circle:1, amplitude = 1"
            ]
        );
        let spec = of_cell(&sweep, &Spec::default(), 1).unwrap();
        assert_eq!(spec, Spec { amplitude: 1.0.into(), ..Spec::default() });
        let tiny = self::sweep(&["tolerance=1e-12,0.0001,0.0"]);
        assert_eq!(tiny.axes()[0].labels(), ["1e-12", "0.0001", "0"]);
    }

    #[test]
    fn commas_in_parentheses_separate_no_values() {
        let labels = |text: &str| text.parse::<SweepAxis>().unwrap().labels();
        assert_eq!(labels("amplitude=0.05,lognormal(0.05,0.2),0.1"), ["0.05", "lognormal(0.05,0.2)", "0.1"]);
        assert_eq!(labels("shape=ellipse:normal(3,0.1),1;circle:1"), ["ellipse:normal(3,0.1),1", "circle:1"]);
        assert_eq!(labels("adapter=a(b,c"), ["a(b", "c"]);
        let spec = of_cell(&sweep(&["amplitude=0.05,uniform(0.01..0.1)"]), &Spec::default(), 1).unwrap();
        assert!(spec.amplitude.is_drawn() && spec.values(0).unwrap().amplitude != spec.values(1).unwrap().amplitude);
    }

    #[test]
    fn a_sweep_reads_back_from_its_toml_in_its_order() {
        let spec = Spec { sweep: sweep(&["tau=0.01,0.1", "flow=willmore,elastic:0.5", "decay=1"]), ..Spec::default() };
        let text = spec.to_toml().unwrap();
        assert_eq!(Spec::from_toml(&text).unwrap(), spec, "{text}");
    }

    #[test]
    fn a_seed_that_is_no_number_of_toml_is_swept_and_reads_back() {
        let axis: SweepAxis = "seed=1,9223372036854775808,18446744073709551615".parse().unwrap();
        let large = [9_223_372_036_854_775_808, u64::MAX];
        assert_eq!(axis.labels(), ["1".into(), large[0].to_string(), large[1].to_string()]);
        let base = Spec { seed: u64::MAX - 1, sweep: Sweep(vec![axis]), ..Spec::default() };
        let unquoted = "seed = 18446744073709551614\n[sweep]\nseed = [1, 9223372036854775808, 18446744073709551615]";
        assert_eq!(Spec::from_toml(unquoted).unwrap(), base);
        assert_eq!(Spec::from_toml(&base.to_toml().unwrap()).unwrap(), base);
        assert_eq!(serde_json::from_str::<Spec>(&serde_json::to_string(&base).unwrap()).unwrap(), base);
        let seeds: Vec<u64> = (0..3).map(|cell| base.of_cell(cell).unwrap().seed).collect();
        assert_eq!(seeds, [1, large[0], large[1]]);
        assert!("omega=18446744073709551615".parse::<SweepAxis>().unwrap().values[0].is_float());
        let plain = Spec { sweep: Sweep::default(), ..base.clone() };
        let other = Spec { seed: u64::MAX, ..plain.clone() };
        assert!(plain.difference(&other, &[]).is_some_and(|(key, ..)| key == "seed"));
    }

    #[test]
    fn a_cell_keeps_the_lists_of_its_base() {
        let base = Spec { snapshots: vec![0.0, 0.5], only: Some(vec![3, 4]), ..Spec::default() };
        let spec = of_cell(&sweep(&["omega=2"]), &base, 0).unwrap();
        assert_eq!(spec, Spec { omega: Some(2.0.into()), ..base });
    }

    #[test]
    fn what_stands_instead_of_a_swept_key_makes_room() {
        let base = Spec { adaptive: Some(1e-3), relax_at: Some(0.01), ..Spec::default() };
        let spec = of_cell(&sweep(&["tau=0.01", "relax-to=0.1"]), &base, 0).unwrap();
        assert_eq!((spec.tau, spec.adaptive, spec.relax_to, spec.relax_at), (Some(0.01.into()), None, Some(0.1), None));
    }

    #[test]
    fn wrong_sweeps_are_refused_with_their_key() {
        for (axes, part) in [
            (&["amplitud=1"][..], "--sweep amplitud: no such key (did you mean `amplitude`?)"),
            (&["curves=1,2"], "--sweep curves: it is the same for the whole run"),
            (&["outlines=1,2"], "--sweep outlines: it is the same for the whole run"),
            (&["group-by=a,b"], "--sweep group-by: it is the same for the whole run"),
            (&["amplitude="], "--sweep amplitude: no values"),
            (&["seed=1,2,3,4,5,6,7,8,9,10", "decay=1,2,3,4,5,6,7,8,9,10"], ""),
        ] {
            match sweep(axes).check(&Spec::keys(), Spec::is_common) {
                Err(error) => assert!(!part.is_empty() && error.to_string().contains(part), "{error}"),
                Ok(()) => assert_eq!(part, "", "{axes:?}"),
            }
        }
        let thousand = format!("seed={}", (0..1000).map(|i| i.to_string()).collect::<Vec<_>>().join(","));
        let many = sweep(&[&thousand, &thousand.replace("seed", "omega")])
            .check(&Spec::keys(), Spec::is_common)
            .unwrap_err()
            .to_string();
        assert!(many.contains("--sweep (1000000 cells): too many; at most 10000"), "{many}");
        let wrong = of_cell(&sweep(&["amplitude=0.1,word"]), &Spec::default(), 1).unwrap_err().to_string();
        assert!(wrong.starts_with("--sweep amplitude=word: "), "{wrong}");
        assert!("amplitude".parse::<SweepAxis>().is_err());
    }
}
