//! Errors as `terrane.Error`: with kind, file, place and remedy.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use terrane::{Error, ErrorKind};
use terrane_base::frontend::Frontend;

/// The Python exception of an error; `terrane._errors` selects its class by kind.
pub(crate) fn exception(py: Python<'_>, error: &Error) -> PyErr {
    static MAKE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let make = || -> PyResult<Bound<'_, PyAny>> {
        let make = MAKE.get_or_try_init(py, || {
            Ok::<_, PyErr>(py.import("terrane._errors")?.getattr("make")?.unbind())
        })?;
        let file = error.path().map(|path| path.display().to_string());
        make.bind(py).call1((
            name(error.kind()),
            error.spelled(Frontend::Python).to_string(),
            file,
            error.place(),
            error.remedy_text().map(|remedy| Frontend::Python.spell(remedy)),
            error.is_missing(),
        ))
    };
    make().map_or_else(|failure| failure, PyErr::from_value)
}

/// The result of a call of the library, for Python.
pub(crate) fn to_python<T>(py: Python<'_>, result: terrane::Result<T>) -> PyResult<T> {
    result.map_err(|error| exception(py, &error))
}

fn name(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::CheckFailed => "check_failed",
        ErrorKind::Usage => "usage",
        ErrorKind::BadInput => "bad_input",
        ErrorKind::Unsupported => "unsupported",
        ErrorKind::Limit => "limit",
        ErrorKind::NotYet => "not_yet",
        ErrorKind::CannotWrite => "cannot_write",
        ErrorKind::Io => "io",
        ErrorKind::Resource => "resource",
        ErrorKind::Interrupted => "interrupted",
        _ => "internal",
    }
}
