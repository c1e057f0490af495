//! A mesh made by tasks that any machine may do, and that survive being killed.
//!
//! `cargo run --example plan_and_run`

use terrane::prelude::*;

fn main() -> terrane::Result<()> {
    let folder = std::env::temp_dir().join(format!("terrane-plan-{}", std::process::id()));
    let failed = |e| terrane::Error::write(&folder, e);
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let (dem, work, mesh) = (folder.join("dem.tif"), folder.join("work"), folder.join("mesh.ply"));
    terrane::open("synth:rough,size=1025,seed=7")?.convert().write(&dem)?;

    // One machine writes the plan down.
    terrane::open(&dem)?.tin().max_error(2.0).tile(128).plan(&work, 2)?;

    // Any other opens the folder and does what can be done: here one task, as if it was killed then.
    let plan = terrane::open_plan(&work)?;
    let status = plan.status()?;
    println!("{} tasks, about {:.1} s", status.to_do.len(), status.seconds);
    plan.run().task(&status.to_do[0].id).run()?;

    // The last one does what is left, and writes the mesh.
    let done = plan.run().output(&mesh).run()?;
    println!("{} of {} tasks were done before", done.found, done.tasks);
    let proof = terrane::open(&dem)?.verify(&mesh).run()?;
    assert!(proof.verdict.passed, "{:?}", proof.verdict.failures);
    println!("proved: no sample further than {:?}", proof.max_error);

    std::fs::remove_dir_all(&folder).map_err(failed)
}
