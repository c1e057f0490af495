//! Arrays of numpy as slices, and slices of meshes as arrays, without a copy.
#![allow(unsafe_code)]

use numpy::ndarray::ArrayView2;
use numpy::{Element, PyArray2, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Elements of an array in C order, kept alive by this value.
pub(crate) struct NumpyElements<T> {
    /// Keeps the memory.
    _array: Py<PyArrayDyn<T>>,
    first: *const T,
    count: usize,
}

// SAFETY: numbers are read through a shared pointer, by any thread, and the array they are in is not freed before
// this is dropped (which any thread may do: the count of references is left to the interpreter then).
unsafe impl<T: Sync> Send for NumpyElements<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for NumpyElements<T> {}

impl<T: Element> NumpyElements<T> {
    /// Elements of a contiguous array in C order.
    pub(crate) fn of(array: &Bound<'_, PyArrayDyn<T>>) -> PyResult<Self> {
        if !array.is_c_contiguous() {
            return Err(PyValueError::new_err("the array is not contiguous"));
        }
        let _array = array.clone().unbind();
        Ok(Self { _array, first: array.data(), count: array.len() })
    }
}

impl<T> AsRef<[T]> for NumpyElements<T> {
    fn as_ref(&self) -> &[T] {
        if self.count == 0 {
            return &[];
        }
        // SAFETY: a contiguous array has so many elements from its first one on, aligned as numpy says of arrays
        // that conversions to this type admit, and is kept alive. As everywhere with numpy, other Python threads
        // must not write to it meanwhile.
        unsafe { std::slice::from_raw_parts(self.first, self.count) }
    }
}

/// `rows` of three as a read-only array in the memory of `owner`, which never changes them.
pub(crate) fn view<'py, T: Element + bytemuck::Pod>(
    rows: &[[T; 3]],
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let all: &[T] = bytemuck::cast_slice(rows);
    let view = ArrayView2::from_shape((rows.len(), 3), all)
        .map_err(|e| PyValueError::new_err(e.to_string()))?;
    // SAFETY: `owner` holds the rows, never moves or changes them, and lives as long as the array does.
    let array = unsafe { PyArray2::borrow_from_array(&view, owner) };
    array.getattr("flags")?.setattr("writeable", false)?;
    Ok(array)
}
