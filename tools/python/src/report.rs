//! Reports of jobs as dictionaries.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use serde::Serialize;
use terrane_base::door::Door;

/// What `--json` tells of a job.
pub(crate) fn dictionary<'py>(
    py: Python<'py>,
    report: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(report).map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
    py.import("json")?.getattr("loads")?.call1((Door::Python.spell_report(&text),))
}
