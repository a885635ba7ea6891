//! Settings, tasks and reports cross as JSON: `dict` to serde and back.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::InputError;

/// The value that `dict` describes. `InputError` names the field that is unknown, missing or of the wrong kind.
pub fn from_dict<T: DeserializeOwned>(what: &str, dict: &Bound<'_, PyDict>) -> PyResult<T> {
    let py = dict.py();
    let options = PyDict::new(py);
    options.set_item("allow_nan", false)?;
    let text: String = py
        .import("json")?
        .call_method("dumps", (dict,), Some(&options))
        .map_err(|error| refused(what, "", &error.value(py).to_string()))?
        .extract()?;
    let mut reader = serde_json::Deserializer::from_str(&text);
    serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let path = error.path().to_string();
        // The place in a text that the caller never saw would only puzzle.
        let reason = error.inner().to_string();
        let reason = reason.split(" at line ").next().unwrap_or_default();
        refused(what, if path == "." { "" } else { &path }, reason)
    })
}

/// [`from_dict`], and the default for `None`.
pub fn from_optional_dict<T: DeserializeOwned + Default>(
    what: &str,
    dict: Option<&Bound<'_, PyDict>>,
) -> PyResult<T> {
    dict.map_or_else(|| Ok(T::default()), |dict| from_dict(what, dict))
}

/// `value` as Python's plain dicts, lists, numbers and strings.
pub fn to_python<'py, T: Serialize>(py: Python<'py>, value: &T) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| InputError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

fn refused(what: &str, path: &str, reason: &str) -> PyErr {
    InputError::new_err(if path.is_empty() {
        format!("The {what} cannot be read: {reason}.")
    } else {
        format!("The {what} cannot be read: {path}: {reason}.")
    })
}
