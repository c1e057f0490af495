//! Operations on grids: option tables for Python, and options from Python objects.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyByteArray, PyBytes, PyDict, PyString};
use serde_json::{Map, Value as Json, json};
use terrane::{AnyOperation, Error, OPERATIONS, Reads, TinOptions, check_named};
use terrane_files::name_of;
use terrane_options::{OptionArity, OptionField, OptionKind, OptionRole, OptionTable, fill};

use crate::error::to_python;
use crate::report::{REPORTS, dictionary, report_named};

/// The operation `name`.
pub(crate) fn named(name: &str) -> PyResult<&'static AnyOperation> {
    let found = OPERATIONS.iter().find(|operation| operation.name == name);
    found.ok_or_else(|| PyValueError::new_err(format!("unknown operation {name:?}")))
}

/// All operations, verifications and inspections by name: summary and options in order.
#[pyfunction]
pub(crate) fn operations(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let operations = OPERATIONS
        .iter()
        .map(|own| (own.name, described(own.table, own.reads, &(own.defaults)(), own.task_size())));
    let reports = REPORTS.iter();
    let reports =
        reports.map(|own| (own.name, described(own.table, own.reads, &(own.defaults)(), None)));
    let told = operations.chain(reports).map(|(name, told)| (name.to_owned(), told));
    dictionary(py, &told.collect::<Map<String, Json>>())
}

fn described(
    table: &'static OptionTable,
    reads: Reads,
    defaults: &Map<String, Json>,
    task_size: Option<&str>,
) -> Json {
    let fields = table.fields();
    let fields: Vec<Json> = fields.iter().map(|own| option(own, &defaults[own.name])).collect();
    let reads = match reads {
        Reads::Grid => "grid",
        Reads::Cloud => "cloud",
        Reads::Features => "features",
    };
    json!({ "about": table.about, "reads": reads, "options": fields, "task_size": task_size })
}

/// Options of runs that plans share.
const OF_MACHINES: [&str; 3] = ["threads", "memory", "temp_dir"];

fn option(field: &OptionField, default: &Json) -> Json {
    let is_several = matches!(field.shape, OptionArity::Repeated) || default.is_array();
    let default = if is_several || field.default_text.is_some() { &Json::Null } else { default };
    let mut ty = type_of(field.kind);
    let is_alone = matches!(field.kind, OptionKind::Shaped(text) if text.contains('['));
    if field.shape == OptionArity::Repeated && !is_alone {
        ty = format!("{ty} | Iterable[{ty}]");
    }
    if field.bare.is_some() {
        ty = format!("bool | {ty}");
    }
    if default.is_null() && !field.positional {
        ty += " | None";
    }
    json!({
        "name": field.name,
        "aliases": field.aliases,
        "about": field.about,
        "type": ty,
        "default": default,
        "default_text": field.default_text,
        "choices": choices_of(field.kind),
        "positional": field.positional,
        "of_runs": field.role == OptionRole::Run && !OF_MACHINES.contains(&field.name),
    })
}

/// Names of choices with their summaries.
fn choices_of(kind: OptionKind) -> Vec<(&'static str, &'static str)> {
    let OptionKind::Choice(choices) = kind else { return Vec::new() };
    choices().iter().map(|own| (own.name, own.about)).collect()
}

/// Type annotation of values in Python.
fn type_of(kind: OptionKind) -> String {
    match kind {
        OptionKind::Flag => "bool".to_owned(),
        OptionKind::Whole => "int".to_owned(),
        OptionKind::Number => "float".to_owned(),
        OptionKind::Text => "str".to_owned(),
        OptionKind::Path => "Path".to_owned(),
        OptionKind::Numbers => "float | Sequence[float]".to_owned(),
        OptionKind::Shaped(text) => text.to_owned(),
        OptionKind::Choice(choices) => {
            let names: Vec<String> =
                choices().iter().map(|own| format!("\"{}\"", own.name)).collect();
            format!("Literal[{}]", names.join(", "))
        }
    }
}

/// Validates the options of an operation or a verification before any file is opened; without a path a mesh
/// stays in memory.
#[pyfunction]
pub(crate) fn check_operation(
    py: Python<'_>,
    operation: &str,
    options: &Bound<'_, PyDict>,
    path: Option<PathBuf>,
) -> PyResult<()> {
    if let Ok(report) = report_named(operation) {
        let options = to_python(py, options_of(report.table, options)?)?;
        return to_python(py, (report.check)(&options));
    }
    let operation = named(operation)?;
    let options = to_python(py, options_of(operation.table, options)?)?;
    to_python(
        py,
        match path {
            Some(path) => (operation.check)(&options, &path),
            None => fill::<TinOptions>(&options)
                .and_then(|own| own.check_in_memory(&own.grid))
                .and_then(|()| check_named::<TinOptions>(&options)),
        },
    )
}

/// Options from keywords.
pub(crate) fn options_of(
    table: &'static OptionTable,
    given: &Bound<'_, PyDict>,
) -> PyResult<terrane::Result<Map<String, Json>>> {
    let mut options = Map::new();
    for (name, value) in given {
        let name = name.cast::<PyString>()?.to_string_lossy().into_owned();
        let Some(field) = table.find(&name) else {
            // Which is refused with the nearest one that there is.
            options.insert(name, true.into());
            continue;
        };
        match json_of(&value, matches!(field.kind, OptionKind::Path), MAX_NESTED)? {
            Some(value) => options.insert(name, value),
            None => {
                let kind = value.get_type().name()?;
                let error = Error::usage(format!("‹{}› is of type {kind}", field.name));
                return Ok(Err(error.remedy(match field.kind {
                    OptionKind::Path => "pass a path",
                    _ => "pass a number, a text, or a list of these",
                })));
            }
        };
    }
    Ok(Ok(options))
}

/// Nested lists of an option: pairs of keys and values.
const MAX_NESTED: u32 = 2;
/// Largest number of values of a list.
const MAX_VALUES: usize = 1 << 20;

/// A value as JSON, with non-finite numbers as text; `None` for unsupported types.
fn json_of(value: &Bound<'_, PyAny>, is_name: bool, nested: u32) -> PyResult<Option<Json>> {
    if value.is_none() {
        return Ok(Some(Json::Null));
    }
    let kind = value.get_type().name()?.to_string();
    if value.is_instance_of::<PyBool>() || kind == "bool" || kind == "bool_" {
        return Ok(Some(value.is_truthy()?.into()));
    }
    if is_name {
        let path: Result<PathBuf, _> = value.extract();
        return Ok(path.ok().and_then(|path| name_of(path).ok()).map(Json::from));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(text.to_str().ok().map(Json::from));
    }
    if value.is_instance_of::<PyBytes>() || value.is_instance_of::<PyByteArray>() {
        return Ok(None);
    }
    // As many digits as they have.
    if kind == "float32" || kind == "float16" {
        return Ok(value.str()?.to_string_lossy().parse::<f64>().ok().map(Json::from));
    }
    if let Ok(whole) = value.extract::<i64>() {
        return Ok(Some(whole.into()));
    }
    if let Ok(whole) = value.extract::<u64>() {
        return Ok(Some(whole.into()));
    }
    if let Ok(number) = value.extract::<f64>() {
        let number = if number.is_finite() { number.into() } else { number.to_string().into() };
        return Ok(Some(number));
    }
    let Some(nested) = nested.checked_sub(1) else { return Ok(None) };
    if let Ok(pairs) = value.cast::<PyDict>() {
        let mut map = Map::new();
        for (key, value) in pairs {
            let Some(value) = json_of(&value, false, nested)? else { return Ok(None) };
            map.insert(key.str()?.to_string_lossy().into_owned(), value);
        }
        return Ok(Some(map.into()));
    }
    let Ok(all) = value.try_iter() else { return Ok(None) };
    let all = all.take(MAX_VALUES + 1).map(|value| json_of(&value?, false, nested));
    let all = all.collect::<PyResult<Option<Vec<_>>>>()?;
    if all.as_ref().is_some_and(|all| all.len() > MAX_VALUES) {
        let error = Error::usage(format!("a list has more than {MAX_VALUES} values"));
        return to_python(value.py(), Err(error.remedy("pass fewer values")));
    }
    Ok(all.map(Json::from))
}
