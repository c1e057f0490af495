//! Inputs of jobs of any kind.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use terrane::{Data, Reads};
use terrane_files::name_of;

use crate::cloud::Cloud;
use crate::error::to_python;
use crate::grid::{Grid, inputs};
use crate::operation::{named, options_of};
use crate::plan::Plan;
use crate::report::{dictionary, report_named};
use crate::work::{BuilderSettings, JobSettings, run};

/// An open grid or point cloud, the file of a mesh or of features, or the files of a grid.
#[derive(FromPyObject)]
pub(crate) enum PySource<'py> {
    Grid(PyRef<'py, Grid>),
    Cloud(PyRef<'py, Cloud>),
    File(PathBuf),
    Files(Vec<PathBuf>),
}

impl PySource<'_> {
    /// Runs a job on the input.
    fn run<T: Send>(
        &self,
        py: Python<'_>,
        reads: Reads,
        settings: JobSettings,
        work: impl FnOnce(&dyn Data, &BuilderSettings) -> terrane::Result<T> + Send,
    ) -> PyResult<T> {
        match self {
            Self::Grid(grid) => {
                let grid = &grid.0;
                run(py, settings, |machine| work(grid, machine))
            }
            Self::Cloud(cloud) => {
                let cloud = &cloud.0;
                run(py, settings, |machine| work(cloud, machine))
            }
            Self::Files(names) => {
                let files = terrane::open_files(to_python(py, inputs(names.clone()))?);
                run(py, settings, |machine| work(&files, machine))
            }
            Self::File(path) if reads == Reads::Features => {
                run(py, settings, |machine| work(&terrane::open_features(path)?, machine))
            }
            Self::File(path) => {
                run(py, settings, |machine| work(&terrane::open_mesh(path)?, machine))
            }
        }
    }
}

/// Runs an operation by its name, with options by theirs.
#[pyfunction]
pub(crate) fn run_operation<'py>(
    py: Python<'py>,
    operation: &str,
    source: PySource<'py>,
    path: PathBuf,
    options: &Bound<'py, PyDict>,
    settings: JobSettings,
) -> PyResult<Bound<'py, PyAny>> {
    let operation = named(operation)?;
    let options = to_python(py, options_of(operation.table, options)?)?;
    let report = source.run(py, operation.reads, settings, |data, machine| {
        data.run(operation, &path, &options, &machine.progress, &machine.cancel)
    })?;
    dictionary(py, &report)
}

/// Plans an operation by its name, with options by theirs.
#[pyfunction]
pub(crate) fn plan_operation(
    py: Python<'_>,
    operation: &str,
    source: PySource<'_>,
    folder: PathBuf,
    options: &Bound<'_, PyDict>,
    task_size: Option<u32>,
    settings: JobSettings,
) -> PyResult<Plan> {
    let operation = named(operation)?;
    let options = to_python(py, options_of(operation.table, options)?)?;
    let planned = source.run(py, operation.reads, settings, |data, machine| {
        let (progress, cancel) = (&machine.progress, &machine.cancel);
        data.plan(operation, &folder, &options, task_size, progress, cancel)
    })?;
    Ok(Plan(planned))
}

/// A verification by name of a file or folder against its original, or an inspection. Options are by name.
#[pyfunction]
pub(crate) fn report_on<'py>(
    py: Python<'py>,
    name: &str,
    source: PySource<'py>,
    file: Option<PathBuf>,
    options: &Bound<'py, PyDict>,
    settings: JobSettings,
) -> PyResult<Bound<'py, PyAny>> {
    let asked = report_named(name)?;
    let options = to_python(py, options_of(asked.table, options)?)?;
    let reads = asked.reads;
    let report = source
        .run(py, reads, settings, |data, machine| (asked.run)(data, file, &options, machine))?;
    dictionary(py, &report)
}

/// True for a mesh file, or a folder of its pieces.
#[pyfunction]
pub(crate) fn is_mesh(path: PathBuf) -> bool {
    name_of(path).and_then(|name| terrane::is_mesh(&name)).unwrap_or(false)
}
