//! Keywords become the text of a spec file, which the program reads as it reads any other.

use std::{fmt::Display, path::Path};

use curvelax::ensemble::Spec;
use pyo3::{
    exceptions::PyTypeError,
    prelude::*,
    types::{PyBool, PyDict, PyFloat, PyInt, PyString},
};
use toml::{Table, Value};

use crate::raise;

/// Deepest list in a list.
const DEEPEST: usize = 4;
/// Keys of which one takes the place of the other.
const EXCLUDING: [(&str, &str); 4] =
    [("tau", "adaptive"), ("adaptive", "tau"), ("relax-to", "relax-at"), ("relax-at", "relax-to")];

/// A spec as keywords give it.
pub struct Keys {
    /// The text of its file.
    pub text: String,
    /// The keys of the keywords.
    pub given: Vec<String>,
    /// Whether `accurate` is among them.
    pub accurate: bool,
}

/// The keywords, over the keys of the file `spec`.
///
/// # Errors
/// `TypeError` for a value that no spec file can hold, and those of the file.
pub fn read(spec: Option<&Path>, keywords: &Bound<'_, PyDict>) -> PyResult<Keys> {
    let mut table = spec.map_or_else(|| Ok(Table::new()), |path| file(path, keywords.py()))?;
    let (mut given, mut accurate) = (Vec::new(), false);
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
        // A keyword overrides the file, including the key that it excludes.
        for (_, other) in EXCLUDING.iter().filter(|(one, _)| **one == *name) {
            if !given.iter().any(|given| given == other) {
                table.remove(*other);
            }
        }
        given.push(name.clone());
        table.insert(name, value);
    }
    let text = toml::to_string(&table).map_err(|e| PyTypeError::new_err(e.to_string()))?;
    Ok(Keys { text, given, accurate })
}

/// The keys of a spec file.
fn file(path: &Path, py: Python<'_>) -> PyResult<Table> {
    let request = |problem: &dyn Display| {
        let error = curvelax::Error::Request(format!("in the spec {}: {problem}", path.display()));
        raise(py, error, None)
    };
    let text = std::fs::read_to_string(path).map_err(|e| request(&e))?;
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
    // A bool of Python is an int, too; numbers of NumPy know how to become Python's.
    let scalar = match value.getattr("item") {
        Ok(item) if value.getattr("ndim").and_then(|n| n.extract::<usize>()).is_ok_and(|n| n == 0) => item.call0()?,
        _ => value.clone(),
    };
    if scalar.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(scalar.extract()?));
    }
    if scalar.is_instance_of::<PyInt>() {
        return scalar.extract::<i64>().map(Value::Integer).or_else(|_| Ok(Value::String(scalar.str()?.extract()?)));
    }
    if scalar.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(scalar.extract()?));
    }
    if scalar.is_instance_of::<PyString>() {
        return Ok(Value::String(scalar.extract()?));
    }
    if let Ok(table) = scalar.cast::<PyDict>() {
        let entry = |(key, own): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> PyResult<_> {
            let key: String = key.extract()?;
            Ok((name(&key), self::value(&key, &own, depth + 1)?))
        };
        return table.iter().map(entry).collect::<PyResult<Table>>().map(Value::Table);
    }
    if let (true, Ok(items)) = (depth < DEEPEST, scalar.try_iter()) {
        let items = items.map(|item| self::value(key, &item?, depth + 1));
        return items.collect::<PyResult<Vec<_>>>().map(Value::Array);
    }
    if let Ok(path) = scalar.call_method0("__fspath__") {
        return Ok(Value::String(path.extract()?));
    }
    let (kind, shown) = (scalar.get_type().name()?, scalar.repr()?);
    Err(PyTypeError::new_err(format!("{key}: {kind} {shown} is neither a number, a text, a bool nor a list of these")))
}
