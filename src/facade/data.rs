//! Data for operations by name.

use std::path::Path;

use serde_json::{Map, Value as Json};
use terrane_base::Result;
use terrane_engine::operation::{AnyOperation, OperationCall, RunRequest};
use terrane_engine::plan::Plan;
use terrane_engine::{Cancel, Progress};
use terrane_raster::Inputs;

/// Input for [`OPERATIONS`](crate::OPERATIONS) by name, in files or in memory: a grid, a point cloud, features
/// or a mesh.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("slope.tif");
/// use terrane::Data;
/// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
/// let slope = terrane::OPERATIONS.iter().find(|operation| operation.name == "slope").unwrap();
/// let options = serde_json::json!({ "percent": true, "threads": 1 });
/// let (options, cancel) = (options.as_object().unwrap(), terrane::Cancel::default());
/// let report = dem.run(slope, &path, options, &terrane::Silent, &cancel)?;
/// assert_eq!(report["width"], 129);
/// # Ok(())
/// # }
/// ```
pub trait Data {
    /// File names.
    fn inputs(&self) -> Inputs;

    /// Input options by name.
    fn reading(&self) -> Map<String, Json>;

    /// Runs an operation with options by name, and returns its report as JSON.
    ///
    /// # Errors
    /// Unknown options; otherwise as [`Job::write`](crate::Job::write).
    fn run(
        &self,
        operation: &AnyOperation,
        output: &Path,
        options: &Map<String, Json>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Json> {
        let (inputs, reading) = (&self.inputs(), self.reading());
        let request =
            RunRequest { inputs, output, skipped: &[], is_measured: true, progress, cancel };
        (operation.run)(&OperationCall { request, reading, options })
    }

    /// Plans a divisible operation, as [`Job::plan`](crate::Job::plan).
    ///
    /// # Errors
    /// An operation that is not divisible; unknown options; otherwise as [`Job::plan`](crate::Job::plan).
    fn plan(
        &self,
        operation: &AnyOperation,
        folder: &Path,
        options: &Map<String, Json>,
        task_size: Option<u32>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Plan> {
        let (inputs, reading) = (&self.inputs(), self.reading());
        let request = RunRequest {
            inputs,
            output: folder,
            skipped: &[],
            is_measured: true,
            progress,
            cancel,
        };
        operation.plan(&OperationCall { request, reading, options }, task_size)
    }
}
