//! What operations by name are done with.

use std::path::Path;

use serde_json::{Map, Value as Json};
use terrane_base::Result;
use terrane_engine::operation::{AnyOperation, OperationCall, RunRequest};
use terrane_engine::plan::Plan;
use terrane_engine::{Cancel, Progress};
use terrane_raster::Inputs;

/// Data in files or in memory that [`OPERATIONS`](crate::OPERATIONS) are done with by name: a grid, a cloud, features, or a
/// mesh.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("slope.tif");
/// use terrane::Data;
/// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
/// let slope = terrane::OPERATIONS.iter().find(|operation| operation.name == "slope").unwrap();
/// let options = serde_json::json!({ "percent": true, "threads": 1 });
/// let at: (&dyn terrane::Progress, _) = (&terrane::Silent, &terrane::Cancel::default());
/// let report = dem.run(slope, &path, options.as_object().unwrap(), at)?;
/// assert_eq!(report["width"], 129);
/// # Ok(())
/// # }
/// ```
pub trait Data {
    /// Its files.
    fn inputs(&self) -> Inputs;

    /// How they are read, by the names of options.
    fn reading(&self) -> Map<String, Json>;

    /// Runs an operation with options by name, and tells what its report is as JSON.
    ///
    /// # Errors
    /// Options that there are not; else those of [`Job::write`](crate::Job::write).
    fn run(
        &self,
        operation: &AnyOperation,
        output: &Path,
        options: &Map<String, Json>,
        (progress, cancel): (&dyn Progress, &Cancel),
    ) -> Result<Json> {
        let (inputs, reading) = (&self.inputs(), self.reading());
        let request =
            RunRequest { inputs, output, skipped: &[], is_measured: true, progress, cancel };
        (operation.run)(&OperationCall { request, reading, options })
    }

    /// Plans an operation that can be divided, as [`Job::plan`](crate::Job::plan) does.
    ///
    /// # Errors
    /// An operation that cannot be divided; options that there are not; else those of [`Job::plan`](crate::Job::plan).
    fn plan(
        &self,
        operation: &AnyOperation,
        folder: &Path,
        options: &Map<String, Json>,
        task_size: Option<u32>,
        (progress, cancel): (&dyn Progress, &Cancel),
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
