//! Operations on grids: what their tables say of options, and options from what Python has.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};
use serde_json::{Map, Value as Json, json};
use terrane::{Error, Listed, OPERATIONS, Reads};
use terrane_files::name_of;
use terrane_options::{Field, Kind, Shape};

use crate::report::dictionary;

/// The operation of a name.
pub(crate) fn named(name: &str) -> PyResult<&'static Listed> {
    let found = OPERATIONS.iter().find(|operation| operation.name == name);
    found.ok_or_else(|| PyValueError::new_err(format!("there is no operation {name:?}")))
}

/// All operations, by name: what each is for, and its options in their order.
#[pyfunction]
pub(crate) fn operations(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let told = OPERATIONS.iter().map(|operation| {
        let defaults = (operation.defaults)();
        let fields = operation.table.fields();
        let fields: Vec<Json> = fields.iter().map(|own| option(own, &defaults[own.name])).collect();
        let of_grids = operation.reads == Reads::Grid;
        let about = operation.table.about;
        let told = json!({ "about": about, "of_grids": of_grids, "options": fields });
        (operation.name.to_owned(), told)
    });
    dictionary(py, &told.collect::<Map<String, Json>>())
}

fn option(field: &Field, default: &Json) -> Json {
    let is_several = matches!(field.shape, Shape::Repeated) || default.is_array();
    let default = if is_several || field.usual.is_some() { &Json::Null } else { default };
    let mut ty = type_of(field.kind);
    if matches!((field.shape, field.kind), (Shape::Repeated, Kind::Choice(_))) {
        ty = format!("{ty} | Sequence[{ty}]");
    }
    if default.is_null() && !field.positional {
        ty += " | None";
    }
    json!({
        "name": field.name,
        "about": field.about,
        "type": ty,
        "default": default,
        "usual": field.usual,
        "positional": field.positional,
    })
}

/// The type of values, as Python's annotations have it.
fn type_of(kind: Kind) -> String {
    match kind {
        Kind::Flag => "bool".to_owned(),
        Kind::Whole => "int".to_owned(),
        Kind::Number => "float".to_owned(),
        Kind::Text => "str".to_owned(),
        Kind::Path => "Path".to_owned(),
        Kind::Numbers => "float | Sequence[float]".to_owned(),
        Kind::Shaped(text) => text.to_owned(),
        Kind::Choice(choices) => {
            let names: Vec<String> =
                choices().iter().map(|own| format!("\"{}\"", own.name)).collect();
            format!("Literal[{}]", names.join(", "))
        }
    }
}

/// Options from keywords.
pub(crate) fn options_of(
    operation: &Listed,
    given: &Bound<'_, PyDict>,
) -> PyResult<terrane::Result<Map<String, Json>>> {
    let mut options = Map::new();
    for (name, value) in given {
        let name: String = name.extract()?;
        let is_name = operation.table.find(&name).is_some_and(|own| matches!(own.kind, Kind::Path));
        match json_of(&value, is_name)? {
            Some(value) => options.insert(name, value),
            None => {
                let kind = value.get_type().name()?;
                let error = Error::usage(format!("‹{name}› is a {kind}"));
                return Ok(Err(error.remedy("pass a number, a text, or a list of these")));
            }
        };
    }
    Ok(Ok(options))
}

/// A value as JSON, in which numbers that are none are texts; `None` for what cannot be an option.
fn json_of(value: &Bound<'_, PyAny>, is_name: bool) -> PyResult<Option<Json>> {
    if value.is_none() {
        return Ok(Some(Json::Null));
    }
    let is_bool = value.is_instance_of::<PyBool>()
        || value.get_type().name()?.to_string().starts_with("bool");
    if is_bool {
        return Ok(Some(value.is_truthy()?.into()));
    }
    if is_name || value.hasattr("__fspath__")? {
        let path: Result<PathBuf, _> = value.extract();
        return Ok(path.ok().and_then(|path| name_of(path).ok()).map(Json::from));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Some(text.to_str()?.into()));
    }
    if let Ok(whole) = value.extract::<i64>() {
        return Ok(Some(whole.into()));
    }
    if let Ok(pairs) = value.cast::<PyDict>() {
        let mut map = Map::new();
        for (key, value) in pairs {
            let Some(value) = json_of(&value, false)? else { return Ok(None) };
            map.insert(key.str()?.to_string(), value);
        }
        return Ok(Some(map.into()));
    }
    if let Ok(number) = value.extract::<f64>() {
        let number = if number.is_finite() { number.into() } else { number.to_string().into() };
        return Ok(Some(number));
    }
    let Ok(all) = value.try_iter() else { return Ok(None) };
    let all = all.map(|value| json_of(&value?, false)).collect::<PyResult<Option<Vec<_>>>>()?;
    Ok(all.map(Json::from))
}
