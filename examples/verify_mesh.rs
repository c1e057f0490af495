//! A mesh written, and proved by code that shares nothing with what made it.
//!
//! `cargo run --example verify_mesh`

use terrane::prelude::*;

fn main() -> terrane::Result<()> {
    let folder = std::env::temp_dir().join(format!("terrane-verify-{}", std::process::id()));
    let failed = |e| terrane::Error::write(&folder, e);
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let mesh = folder.join("mesh.ply");

    let dem = terrane::open("synth:rough,size=513,seed=7")?;
    let made = dem.tin().max_error(2.0).memory("256M").write(&mesh)?;
    println!("{} vertices, {:.1} % of the samples", made.vertices, 100.0 * made.kept);

    let proof = dem.verify(&mesh).run()?;
    assert!(proof.verdict.passed && proof.verdict.judged, "{:?}", proof.verdict.failures);
    println!("proved: no sample further than {:?}", proof.max_error);

    // A bound that the mesh was not made for is not kept, and the proof says where.
    let other = dem.verify(&mesh).max_error(0.5).run()?;
    assert!(!other.verdict.passed);
    println!("at 0.5: {}", other.verdict.failures.join("; "));

    std::fs::remove_dir_all(&folder).map_err(failed)
}
