//! Plans in folders.

use std::path::PathBuf;
use terrane::prelude::*;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::error::to_python;
use crate::work::{JobSettings, run, with_machine};

/// A plan in a folder.
#[pyclass(frozen, module = "terrane._terrane")]
pub(crate) struct Plan(pub(crate) terrane::Plan);

#[pymethods]
impl Plan {
    #[staticmethod]
    fn open(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        to_python(py, py.detach(|| terrane::open_plan(folder))).map(Self)
    }

    #[getter]
    fn folder(&self) -> PathBuf {
        self.0.folder().to_path_buf()
    }

    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let status = to_python(py, py.detach(|| self.0.status()))?;
        let report = PyDict::new(py);
        let tasks = PyList::empty(py);
        for task in &status.to_do {
            tasks.append((&task.id, &task.after))?;
        }
        report.set_item("to_do", tasks)?;
        report.set_item("done", status.done)?;
        report.set_item("damaged", status.damaged)?;
        report.set_item("seconds", status.seconds)?;
        report.set_item("least_memory", status.least_memory)?;
        report.set_item("disk_needed", status.disk_needed)?;
        report.set_item("written", status.written)?;
        report.set_item("fault", status.fault)?;
        Ok(report)
    }

    fn run<'py>(
        &self,
        py: Python<'py>,
        task: Option<String>,
        output: Option<PathBuf>,
        split: Option<u32>,
        overwrite: bool,
        settings: JobSettings,
    ) -> PyResult<Bound<'py, PyDict>> {
        let done = run(py, settings, |machine| {
            let mut builder = with_machine!(self.0.run(), machine).overwrite(overwrite);
            if let Some(task) = task {
                builder = builder.task(task);
            }
            if let Some(output) = output {
                builder = builder.output(output);
            }
            if let Some(tiles) = split {
                builder = builder.split(tiles);
            }
            builder.run()
        })?;
        let report = PyDict::new(py);
        report.set_item("tasks", done.tasks)?;
        report.set_item("found", done.found)?;
        report.set_item("damaged", done.damaged)?;
        report.set_item("made", done.made)?;
        report.set_item("written", done.written)?;
        Ok(report)
    }
}
