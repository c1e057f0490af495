//! A model of the ground from a point cloud: as a grid, and as a mesh.
//!
//! `cargo run --example dtm_from_laz -- survey.laz`; without a file a synthetic survey is used.

use terrane::CloudInput;
use terrane::prelude::*;

fn main() -> terrane::Result<()> {
    let synthetic = || "synth:cloud,size=150,density=4,seed=7".to_owned();
    let input = std::env::args().nth(1).unwrap_or_else(synthetic);
    let folder = std::env::temp_dir().join(format!("terrane-dtm-{}", std::process::id()));
    let failed = |e| terrane::Error::write(&folder, e);
    std::fs::create_dir_all(&folder).map_err(failed)?;

    let cloud = terrane::open_cloud(input)?;
    println!("{} points", cloud.info().count);
    let dtm = cloud.grid(1.0).dtm(true).write(folder.join("dtm.tif"))?;
    println!("{}: {} x {} cells", dtm.output, dtm.width, dtm.height);

    let mut reading = CloudInput::default();
    reading.points.class = vec![2];
    let ground = cloud.read_as(reading)?;
    let mesh = ground.tin().max_error(0.2).write(folder.join("ground.ply"))?;
    println!("{}: {} vertices of {} points", mesh.output, mesh.vertices, mesh.points.kept);

    std::fs::remove_dir_all(&folder).map_err(failed)
}
