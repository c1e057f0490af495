//! Plans in folders.

use std::path::PathBuf;

use terrane_base::Result;
use terrane_engine::plan::Plan;

use crate::OPERATIONS;

/// Opens the plan in a folder, as [`Job::plan`](crate::Job::plan) or another machine wrote it.
///
/// # Errors
/// A folder without a plan, or with an unknown kind of plan. Other problems are reported when the plan is run
/// or its status is read.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let (work, mesh) = (folder.path().join("work"), folder.path().join("mesh.ply"));
/// # let dem = folder.path().join("dem.tif");
/// use terrane::prelude::*;
/// # terrane::open("synth:rough,size=257")?.convert().write(&dem)?;
/// terrane::open(&dem)?.tin().max_error(2.0).plan(&work, 2)?;
/// let plan = terrane::open_plan(&work)?;
/// assert_eq!(plan.status()?.done, 0);
/// assert!(plan.run().output(&mesh).run()?.written.is_some());
/// # Ok(())
/// # }
/// ```
pub fn open_plan(folder: impl Into<PathBuf>) -> Result<Plan> {
    Plan::open(folder, OPERATIONS)
}
