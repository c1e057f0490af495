//! The interpreter of the process.
#![allow(unsafe_code)]

use pyo3::exceptions::PyImportError;
use pyo3::{PyResult, Python, ffi};

/// Fails in subinterpreters: error classes belong to one interpreter.
pub(crate) fn refuse_others(_py: Python<'_>) -> PyResult<()> {
    // SAFETY: both only read the state of the interpreter that this thread is attached to, which `_py` proves.
    match unsafe { ffi::PyInterpreterState_GetID(ffi::PyInterpreterState_Get()) } {
        0 => Ok(()),
        _ => Err(PyImportError::new_err("terrane does not support subinterpreters")),
    }
}
