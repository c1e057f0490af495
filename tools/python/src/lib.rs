//! `terrane._terrane`: Python bindings. The public Python API and conversions of Python objects are in
//! `python/terrane`; this module has the classes, arrays and errors.

mod array;
mod cloud;
mod error;
mod grid;
mod interpreter;
mod lines;
mod mesh;
mod operation;
mod plan;
mod report;
mod source;
mod work;

use pyo3::prelude::*;

/// Runs the command line with these arguments (program name first) and returns its exit code.
#[pyfunction]
fn command_line(py: Python<'_>, args: Vec<std::ffi::OsString>) -> u8 {
    // What an exit code is, only a process can tell: codes are compared by how they are shown.
    let code = py.detach(|| terrane::command_line(args));
    (0..=u8::MAX).find(|number| std::process::ExitCode::from(*number) == code).unwrap_or(1)
}

#[pymodule(gil_used = true)]
fn _terrane(module: &Bound<'_, PyModule>) -> PyResult<()> {
    interpreter::refuse_others(module.py())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<cloud::Cloud>()?;
    module.add_class::<grid::Grid>()?;
    module.add_class::<mesh::Mesh>()?;
    module.add_class::<plan::Plan>()?;
    module.add_function(wrap_pyfunction!(command_line, module)?)?;
    module.add_function(wrap_pyfunction!(operation::operations, module)?)?;
    module.add_function(wrap_pyfunction!(operation::check_operation, module)?)?;
    module.add_function(wrap_pyfunction!(source::run_operation, module)?)?;
    module.add_function(wrap_pyfunction!(source::plan_operation, module)?)?;
    module.add_function(wrap_pyfunction!(source::report_on, module)?)?;
    module.add_function(wrap_pyfunction!(source::is_mesh, module)?)?;
    module.add_function(wrap_pyfunction!(lines::read_lines, module)?)?;
    module.add_function(wrap_pyfunction!(lines::simplify_places, module)?)?;
    module.add_function(wrap_pyfunction!(lines::write_geometries, module)?)?;
    Ok(())
}
