//! Point clouds in files and in memory, and jobs on them.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use terrane::{CloudInput, Flags, PointFlags};
use terrane_options::{Options, fill};

use crate::error::to_python;
use crate::grid::{crs_of, inputs};
use crate::mesh::crs_text;
use crate::operation::options_of;

/// A point cloud.
#[pyclass(frozen, module = "terrane._terrane")]
pub(crate) struct Cloud(pub(crate) terrane::Cloud);

#[pymethods]
impl Cloud {
    /// Opens files, or a synthetic point cloud.
    #[staticmethod]
    fn open(py: Python<'_>, names: Vec<PathBuf>, reading: &Bound<'_, PyDict>) -> PyResult<Self> {
        let reading = options_of(CloudInput::TABLE, reading)?;
        let open = || terrane::open_cloud_as(inputs(names)?, fill(&reading?)?);
        to_python(py, py.detach(open)).map(Self)
    }

    /// A point cloud from an array of three columns, with classes and returns.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)]
    fn array(
        points: &Bound<'_, PyArray2<f64>>,
        classes: Option<&Bound<'_, PyArray1<u8>>>,
        numbers: Option<&Bound<'_, PyArray1<u8>>>,
        returns: Option<&Bound<'_, PyArray1<u8>>>,
        flags: Option<&Bound<'_, PyArray1<u8>>>,
        crs: Option<&str>,
        reading: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let reading = options_of(CloudInput::TABLE, reading)?;
        let py = points.py();
        let crs = to_python(py, crs_of(crs))?;
        let points = points.readonly();
        let (positions, _) = points.as_slice()?.as_chunks::<3>();
        let column = |of: Option<&Bound<'_, PyArray1<u8>>>| {
            of.map(|array| Ok::<_, PyErr>(array.readonly().as_slice()?.to_vec())).transpose()
        };
        let columns = [column(classes)?, column(numbers)?, column(returns)?, column(flags)?];
        let of = |column: usize, number: usize| {
            columns[column].as_ref().and_then(|all| all.get(number)).copied().unwrap_or(0)
        };
        let marks: Option<Vec<PointFlags>> = columns.iter().any(Option::is_some).then(|| {
            let mark = |number: usize| PointFlags {
                class: of(0, number),
                returns: [of(1, number), of(2, number)],
                flags: Flags(of(3, number)),
            };
            (0..positions.len()).map(mark).collect()
        });
        let open =
            || terrane::open_points(positions, marks.as_deref(), crs)?.read_as(fill(&reading?)?);
        to_python(py, py.detach(open)).map(Self)
    }

    /// Properties of the point cloud.
    #[getter]
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (info, told) = (self.0.info(), PyDict::new(py));
        told.set_item("count", info.count)?;
        told.set_item("crs", crs_text(&info.crs))?;
        Ok(told)
    }
}
