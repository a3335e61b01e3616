//! Keywords become the text of a spec file, which the program reads as it reads any other.

use std::{fmt::Display, path::Path};

use curvelax::{
    Error,
    ensemble::{
        Spec,
        request::spec::DEFAULT_ADAPTIVE,
        request::sweep::{EXCLUSIVE, check_not_given},
    },
};
use pyo3::{
    prelude::*,
    types::{PyBool, PyDict, PyFloat, PyInt, PyString},
};
use toml::{Table, Value};

use crate::raise;

/// Maximum characters of a wrong key and value that a message echoes.
const ECHOED: usize = 200;

/// From here on a float no longer holds every whole number.
const MAX_WHOLE: f64 = 9_007_199_254_740_992.0;

/// Deepest list in a list.
const DEEPEST: usize = 4;

/// A spec as keywords give it.
pub struct Keys {
    /// The text of its file.
    text: String,
    /// The keys of the keywords.
    given: Vec<String>,
    /// Whether `accurate` is among them.
    accurate: bool,
}

/// Refuses `problem`.
fn refuse<T>(py: Python<'_>, problem: String) -> PyResult<T> {
    Err(raise(py, Error::Request(problem), None))
}

impl Keys {
    /// The keywords, over the keys of the file `spec`.
    ///
    /// # Errors
    /// `RequestError` for a value that no spec file can hold, for values that would be lost, and for those of the file.
    pub fn read(spec: Option<&Path>, keywords: &Bound<'_, PyDict>) -> PyResult<Keys> {
        let py = keywords.py();
        let mut table = spec.map_or_else(|| Ok(Table::new()), |path| file(path, py))?;
        let (mut given, mut swept, mut accurate) = (Vec::<String>::new(), Table::new(), false);
        for (key, value) in keywords {
            let key: String = key.extract()?;
            let (name, value) = match &*key {
                _ if value.is_none() => continue,
                "accurate" => {
                    accurate = value.is_truthy()?;
                    continue;
                }
                "events" => ("event".into(), events(&value)?),
                _ => (name(&key), self::value(&key, &value, 0)?),
            };
            if given.contains(&name) {
                return refuse(py, format!("{key}: given twice, by two names of one key; leave one of them out"));
            }
            given.push(name.clone());
            match (&*name, value) {
                // As by --adaptive without a value.
                ("adaptive", Value::Boolean(true)) => drop(table.insert(name, DEFAULT_ADAPTIVE.into())),
                ("adaptive", Value::Boolean(false)) => drop(table.remove("adaptive")),
                ("sweep", Value::Table(own)) => swept = own,
                (_, value) => drop(table.insert(name, value)),
            }
        }
        // A keyword overrides the file, including the key that it excludes.
        let is_given = |key: &str| given.iter().any(|given| given == key);
        for pair in EXCLUSIVE.iter().filter(|pair| pair.iter().any(|key| is_given(key))) {
            pair.iter().filter(|key| !is_given(key)).for_each(|key| drop(table.remove(*key)));
        }
        swept.keys().try_for_each(|key| check_not_given(key, &given)).map_err(|error| raise(py, error, None))?;
        if !swept.is_empty() {
            match table.entry("sweep").or_insert_with(|| Table::new().into()) {
                Value::Table(all) => all.extend(swept),
                other => *other = swept.into(),
            }
        }
        let text = toml::to_string(&table).or_else(|e| refuse(py, e.to_string()))?;
        Ok(Keys { text, given, accurate })
    }

    /// The spec.
    ///
    /// # Errors
    /// [`Error::Request`] with the key that is wrong.
    pub fn spec(&self) -> curvelax::Result<Spec> {
        let mut spec = Spec::from_toml(&self.text).map_err(|message| Error::Request(self.without_place(&message)))?;
        if self.accurate {
            spec.make_accurate(&self.given);
        }
        Ok(spec)
    }

    /// The message of toml with the line that is wrong instead of its number, in a text that no user wrote.
    fn without_place(&self, message: &str) -> String {
        let number = message.strip_prefix("TOML parse error at line ").and_then(|rest| rest.split(',').next());
        let line = number.and_then(|number| self.text.lines().nth(number.parse::<usize>().ok()?.checked_sub(1)?));
        match (line, message.lines().last()) {
            (Some(line), Some(problem)) => {
                // Of a long line the message has the place in front instead of the line above.
                let problem = match problem.strip_prefix("TOML parse error at ") {
                    Some(rest) => rest.split_once(": ").map_or(problem, |(_, problem)| problem),
                    None => problem,
                };
                let start: String = line.chars().take(ECHOED).collect();
                let more = if start.len() < line.len() { "..." } else { "" };
                format!("{start}{more}: {problem}")
            }
            _ => message.to_owned(),
        }
    }
}

/// The keys of a spec file.
fn file(path: &Path, py: Python<'_>) -> PyResult<Table> {
    let request =
        |problem: &dyn Display| raise(py, Error::Request(format!("in the spec {}: {problem}", path.display())), None);
    let text = std::fs::read_to_string(path)
        .map_err(|e| request(&format!("{e}; the first argument is a spec file, a shape is given by shape=…")))?;
    // With the line of what is wrong.
    Spec::from_toml(&text).map_err(|e| request(&e))?;
    text.parse().map_err(|e: toml::de::Error| request(&e))
}

/// The key as a spec file writes it.
fn name(key: &str) -> String {
    key.replace('_', "-")
}

/// Events by name: `{"half": "excess <= 0.5 * start"}`. A list holds them as the flag does.
fn events(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    let Ok(named) = value.cast::<PyDict>() else { return self::value("events", value, 0) };
    let event = |(name, condition): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> PyResult<Value> {
        Ok(Value::String(format!("{} = {}", name.extract::<String>()?, condition.extract::<String>()?)))
    };
    named.iter().map(event).collect::<PyResult<Vec<_>>>().map(Value::Array)
}

fn value(key: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    // Numbers of NumPy know how to become Python's.
    let scalar = match value.getattr("item") {
        Ok(item) if value.getattr("ndim").and_then(|n| n.extract::<usize>()).is_ok_and(|n| n == 0) => item.call0()?,
        _ => value.clone(),
    };
    // Before int, which a bool of Python is, too.
    if scalar.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(scalar.extract()?));
    }
    if scalar.is_instance_of::<PyInt>() {
        return scalar.extract::<i64>().map(Value::Integer).or_else(|_| Ok(Value::String(scalar.str()?.extract()?)));
    }
    if scalar.is_instance_of::<PyFloat>() {
        let number: f64 = scalar.extract()?;
        // `curves=1e3` is a count. Keys of real numbers take whole ones, too.
        let is_whole =
            number.fract() == 0.0 && number.abs() < MAX_WHOLE && !(number == 0.0 && number.is_sign_negative());
        return Ok(if is_whole { Value::Integer(number as i64) } else { Value::Float(number) });
    }
    if scalar.is_instance_of::<PyString>() {
        return Ok(Value::String(scalar.extract()?));
    }
    if let Ok(table) = scalar.cast::<PyDict>() {
        let mut all = Table::new();
        for (own, value) in table {
            let own: String = own.extract()?;
            if all.insert(name(&own), self::value(&own, &value, depth + 1)?).is_some() {
                return refuse(
                    value.py(),
                    format!("{key}: {own} is given twice, by two names of one key; leave one out"),
                );
            }
        }
        return Ok(Value::Table(all));
    }
    if let (true, Ok(items)) = (depth < DEEPEST, scalar.try_iter()) {
        let items = items.map(|item| self::value(key, &item?, depth + 1));
        return items.collect::<PyResult<Vec<_>>>().map(Value::Array);
    }
    if let Ok(path) = scalar.call_method0("__fspath__") {
        return Ok(Value::String(path.extract()?));
    }
    refuse(value.py(), format!("{key}: {} is neither a number, a text, a bool nor a list of these", scalar.repr()?))
}
