//! Point clouds, in files and in memory, and what is made of them.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use terrane::{Cancel, CloudInput, Flags, Marks, Progress};
use terrane_options::{Options, fill};

use crate::error::told;
use crate::grid::{crs_of, inputs, prove};
use crate::mesh::crs_text;
use crate::operation::{self, options_of};
use crate::plan::Plan;
use crate::report::dictionary;
use crate::work::{Settings, run};

/// A point cloud.
#[pyclass(frozen, module = "terrane._terrane")]
pub(crate) struct Cloud(terrane::Cloud);

#[pymethods]
impl Cloud {
    /// The cloud in some files, or a synthetic one.
    #[staticmethod]
    fn open(py: Python<'_>, names: Vec<PathBuf>, reading: &Bound<'_, PyDict>) -> PyResult<Self> {
        let reading = options_of(CloudInput::TABLE, reading)?;
        let open = || terrane::open_cloud_as(inputs(names)?, fill(&reading?)?);
        told(py, py.detach(open)).map(Self)
    }

    /// The cloud of points in an array of three columns, with classes, and numbers of returns.
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
        let crs = told(py, crs_of(crs))?;
        let points = points.readonly();
        let (positions, _) = points.as_slice()?.as_chunks::<3>();
        let column = |of: Option<&Bound<'_, PyArray1<u8>>>| {
            of.map(|array| Ok::<_, PyErr>(array.readonly().as_slice()?.to_vec())).transpose()
        };
        let columns = [column(classes)?, column(numbers)?, column(returns)?, column(flags)?];
        let of = |column: usize, number: usize| {
            columns[column].as_ref().and_then(|all| all.get(number)).copied().unwrap_or(0)
        };
        let marks: Option<Vec<Marks>> = columns.iter().any(Option::is_some).then(|| {
            let mark = |number: usize| Marks {
                class: of(0, number),
                returns: [of(1, number), of(2, number)],
                flags: Flags(of(3, number)),
            };
            (0..positions.len()).map(mark).collect()
        });
        let open =
            || terrane::open_points(positions, marks.as_deref(), crs)?.read_as(fill(&reading?)?);
        told(py, py.detach(open)).map(Self)
    }

    /// What the cloud is.
    #[getter]
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (info, told) = (self.0.info(), PyDict::new(py));
        told.set_item("count", info.count)?;
        told.set_item("crs", crs_text(&info.crs))?;
        Ok(told)
    }

    /// Runs an operation with options by name.
    fn run<'py>(
        &self,
        py: Python<'py>,
        operation: &str,
        path: PathBuf,
        options: &Bound<'_, PyDict>,
        settings: Settings,
    ) -> PyResult<Bound<'py, PyAny>> {
        let operation = operation::named(operation)?;
        let options = told(py, options_of(operation.table, options)?)?;
        let report = run(py, settings, |machine| {
            self.0.run(operation, &path, &options, &machine.progress, &machine.cancel)
        })?;
        dictionary(py, &report)
    }

    /// Plans an operation with options by name.
    fn plan(
        &self,
        py: Python<'_>,
        operation: &str,
        folder: PathBuf,
        options: &Bound<'_, PyDict>,
        task_size: Option<u32>,
        settings: Settings,
    ) -> PyResult<Plan> {
        let operation = operation::named(operation)?;
        let options = told(py, options_of(operation.table, options)?)?;
        let planned = run(py, settings, |machine| {
            let watched: (&dyn Progress, &Cancel) = (&machine.progress, &machine.cancel);
            self.0.plan(operation, &folder, &options, task_size, watched)
        })?;
        Ok(Plan(planned))
    }

    /// The proof of a mesh in a file, with options by name.
    fn verify<'py>(
        &self,
        py: Python<'py>,
        mesh: PathBuf,
        options: &Bound<'_, PyDict>,
        settings: Settings,
    ) -> PyResult<Bound<'py, PyAny>> {
        prove(py, self.0.verify(mesh), options, settings)
    }

    /// The same of a folder of terrain tiles.
    fn verify_tiles<'py>(
        &self,
        py: Python<'py>,
        tiles: PathBuf,
        options: &Bound<'_, PyDict>,
        settings: Settings,
    ) -> PyResult<Bound<'py, PyAny>> {
        prove(py, self.0.verify_tiles(tiles), options, settings)
    }
}
