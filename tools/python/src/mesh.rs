//! Meshes in memory.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use terrane::{Crs, Surface, Tin, TinParts};
use terrane_mesh::{MeshHeader, Promises};

use crate::array::{NumpyElements, view};
use crate::error::to_python;

/// An immutable mesh in memory.
#[pyclass(frozen, module = "terrane._terrane")]
pub(crate) struct Mesh {
    tin: Arc<Tin>,
    surface: OnceLock<Surface>,
}

impl From<Tin> for Mesh {
    fn from(tin: Tin) -> Self {
        Self { tin: Arc::new(tin), surface: OnceLock::new() }
    }
}

#[pymethods]
impl Mesh {
    #[getter]
    fn vertices<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        view(this.get().tin.vertices(), this.clone().into_any())
    }

    #[getter]
    fn triangles<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        view(this.get().tin.triangles(), this.clone().into_any())
    }

    #[getter]
    fn error(&self) -> f64 {
        self.tin.max_error()
    }

    #[getter]
    fn rmse(&self) -> f64 {
        self.tin.rmse()
    }

    #[getter]
    fn tolerance(&self) -> f64 {
        self.tin.tolerance()
    }

    #[getter]
    fn shortfall(&self) -> Option<&str> {
        self.tin.shortfall()
    }

    #[getter]
    fn crs(&self) -> Option<String> {
        crs_text(self.tin.crs())
    }

    /// Heights at positions, for arrays x and y of the same shape.
    fn heights<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyArrayDyn<f64>>,
        y: &Bound<'py, PyArrayDyn<f64>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (x, y) = (NumpyElements::of(x)?, NumpyElements::of(y)?);
        let heights = py.detach(|| {
            let surface = self.surface.get_or_init(|| Surface::new(self.tin.clone()));
            let places = x.as_ref().iter().zip(y.as_ref());
            places.map(|(x, y)| surface.height(*x, *y).unwrap_or(f64::NAN)).collect::<Vec<_>>()
        });
        Ok(PyArray1::from_vec(py, heights))
    }

    /// Error bound of the mesh in a file at `path`.
    fn tolerance_in(&self, py: Python<'_>, path: PathBuf) -> PyResult<f64> {
        to_python(py, py.detach(|| self.tin.tolerance_in(path)))
    }

    fn write(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<u64> {
        let written = py.detach(|| match overwrite {
            true => self.tin.overwrite(path),
            false => self.tin.write(path),
        });
        to_python(py, written)
    }

    /// State without arrays, for pickles.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let TinParts { tolerance, max_error, rmse, shortfall, header, .. } =
            Tin::clone(&self.tin).into_parts();
        let MeshHeader { crs, origin, scale, bounds, promises, .. } = header;
        let state = PyDict::new(py);
        state.set_item("errors", [tolerance, max_error, rmse])?;
        state.set_item("shortfall", shortfall)?;
        state.set_item("crs", serde_json::to_string(&crs).unwrap_or_default())?;
        state.set_item("places", [origin, scale, bounds[0], bounds[1]])?;
        state.set_item("promises", promises.to_lines())?;
        Ok(state)
    }

    /// A mesh from two arrays and a state.
    #[staticmethod]
    fn restore(
        py: Python<'_>,
        vertices: &Bound<'_, PyArray2<f64>>,
        triangles: &Bound<'_, PyArray2<u32>>,
        state: MeshState,
    ) -> PyResult<Self> {
        let [tolerance, max_error, rmse] = state.errors;
        let [origin, scale, low, high] = state.places;
        let crs: Crs = serde_json::from_str(&state.crs)
            .map_err(|e| pyo3::exceptions::PyValueError::new_err(e.to_string()))?;
        let header = MeshHeader {
            crs,
            origin,
            scale,
            unit: None,
            bounds: [low, high],
            promises: to_python(py, Promises::parse(state.promises))?,
            channels: Vec::new(),
        };
        let parts = TinParts {
            vertices: vertices.readonly().as_slice()?.as_chunks().0.to_vec(),
            triangles: triangles.readonly().as_slice()?.as_chunks().0.to_vec(),
            tolerance,
            max_error,
            rmse,
            shortfall: state.shortfall,
            header,
        };
        to_python(py, Tin::from_parts(parts)).map(Self::from)
    }
}

/// State of [`Mesh::state`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct MeshState {
    errors: [f64; 3],
    shortfall: Option<String>,
    crs: String,
    places: [[f64; 3]; 4],
    promises: Vec<String>,
}

/// CRS for other packages: its code, or its text.
pub(crate) fn crs_text(crs: &Crs) -> Option<String> {
    match (crs.epsg, crs.vertical_epsg) {
        (Some(code), Some(vertical)) => Some(format!("EPSG:{code}+{vertical}")),
        (Some(code), None) => Some(format!("EPSG:{code}")),
        (None, _) => crs.to_wkt(),
    }
}

/// Rows of three, or of another number.
pub(crate) fn rows<'py>(
    py: Python<'py>,
    values: &[f64],
    width: usize,
) -> PyResult<Bound<'py, PyAny>> {
    values.to_pyarray(py).call_method1("reshape", ((-1_isize, width),))
}
