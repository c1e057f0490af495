//! Tiles of the globe by a job that is made by hand.

use terrane_engine::{Cancel, Silent};
use terrane_tiles::{TilesJob, run};

#[test]
fn a_mask_without_water_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let mut job = TilesJob::new("synth:rough,size=65", folder.path().join("tiles"));
    (job.tiles.water_mask, job.tiles.max_level) = (true, Some(4));
    run(&job, &Silent, &Cancel::default()).unwrap();
    let layer = std::fs::read_to_string(job.output.join("layer.json")).unwrap();
    assert!(layer.contains("octvertexnormals") && !layer.contains("watermask"), "{layer}");
}
