//! Proves a set of terrain tiles (quantized-mesh or 3D Tiles in a geodetic pyramid) against its source raster.
//!
//! Two passes: over the raster, each sample against the surfaces of all levels; and over the tiles, each alone and with
//! its neighbours ([`terrane_proof::tiles`]). Only times and memory in the report depend on threads, memory budget, or
//! the order of work.

mod availability;
mod cache;
mod context;
mod folder;
mod georeference;
mod layer;
mod level;
mod memory_shares;
mod options;
mod proofs;
mod report;
mod sweep;
mod tile_checks;
mod tiles_3d;
mod tileset;
mod water_polygons;

use std::path::Path;
use std::time::Instant;

use self::context::TilesProofContext;
use self::folder::FolderTiles;
use self::georeference::GlobeRaster;
use self::layer::{TilesetKind, TilesetPromises};
use self::memory_shares::TilesProofMemory;
use super::context::check_grid;
use super::options::ProofQuestion;
use terrane_base::error::{Error, Result};
use terrane_engine::memory::{cache_beside, too_little, with_polygons};
use terrane_engine::options::GridInput;
use terrane_engine::proof::WrittenOutput;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_proof::tiles::WaterShore;
use terrane_tiles::CloudModel;

pub use context::ROUNDING;
pub use options::{CloudTilesProof, CloudTilesProofSetters, TilesProof, TilesProofSetters};
pub use report::{CheckReport, LevelProofReport, TileFault, TilesVerifyReport};

/// Minimum memory of a proof.
const MIN_MEMORY: u64 = 32 << 20;

/// True for a folder with a `layer.json` or `tileset.json`, and for such a file.
pub fn is_tiles(path: &Path) -> bool {
    let file = tileset::file_of(path);
    let is_known =
        file.file_name().is_some_and(|name| name == folder::NAME || name == tiles_3d::NAME);
    is_known && file.is_file()
}

/// Proves a set of tiles. A broken promise is not an error: the verdict in the report has `passed` unset.
///
/// # Errors
/// A `layer.json` or `tileset.json` of another kind of tiles; a raster that lacks a georeference, reaches beyond the
/// globe or has no valid sample; too little memory for the number of tiles or the vertices of one. A tile that cannot
/// be decoded is a fault, and does not end the proof.
pub(super) fn verify_tiles(
    job: &ProofQuestion<'_, TilesProof>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TilesVerifyReport> {
    let start = Instant::now();
    check_memory(&job.options.resources)?;
    let mut memory = TilesProofMemory::new(&job.options.resources);
    let layer = TilesetPromises::read(&job.written.file, &memory, cancel)?;
    let tiles = match &layer.kind {
        TilesetKind::QuantizedMesh => FolderTiles::find(&layer.folder, &memory, cancel)?,
        TilesetKind::ThreeTiles(three) => three.find(&layer.folder, &memory, cancel)?,
    };
    memory.take_tiles(tiles.all.len());
    let name = job.written.original.to_string();
    let in_raster = |e: Error| e.in_file(Path::new(&name));
    let options = job
        .options
        .grid
        .options(&job.options.resources, cache_beside(job.options.resources.memory))?;
    let grid = terrane_raster::open_all(job.written.original.names(), &options)?;
    check_grid(&*grid).map_err(in_raster)?;
    let raster = GlobeRaster::of(&*grid, job.options.geoid.as_deref(), &job.options.resources)
        .map_err(|e| if e.path().is_some() { e } else { in_raster(e) })?;
    let shore = match &options.water {
        Some(water) if layer.has_water => {
            Some(water_polygons::shore(water, &raster, layer.finest, &memory)?)
        }
        _ => None,
    };
    memory.take(shore.as_ref().map_or(0, WaterShore::bytes));
    let memory = memory.divided(&raster, job.options.resources.threads);
    let (layer, tiles, memory, steep) = (&layer, &tiles, &memory, 0.0);
    let mut context =
        TilesProofContext { layer, tiles, raster, shore, steep, progress, cancel, memory };
    let (sweep, samples) = sweep::check(&context)?;
    if sweep.valid == 0 {
        return Err(in_raster(Error::bad_input("no valid sample")));
    }
    // Gaps that are allowed between levels depend on how steep the samples are.
    context.steep = sweep.steep(context.raster.spacing());
    let (alone, records) = tile_checks::check(&context)?;
    let findings = report::TilesProofFindings { alone, records, sweep, samples };
    let mut report = report::report(&context, &findings, &grid.info().crs);
    (report.tiles, report.raster) = (job.written.file.display().to_string(), name);
    let statistics = RunStatistics::since(start, &job.options.resources);
    report.run = statistics.with_threads(memory.threads);
    report.samples_per_second = report.run.rate(report.measured);
    Ok(report)
}

/// Proves a set of tiles of a point cloud against the model of its ground, which is made again in the folder for
/// temporary files, or next to the set. The promise holds at samples of the model, not at the points.
///
/// # Errors
/// Errors of [`verify_tiles`], and of making the model.
pub(super) fn verify_tiles_of_cloud(
    job: &ProofQuestion<'_, CloudTilesProof>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TilesVerifyReport> {
    let CloudTilesProof { geoid, water, model, cloud, resources } = job.options;
    check_memory(resources)?;
    let (input, cloud) = (job.written.original.clone(), cloud.options(resources)?);
    let model = CloudModel { input, cloud, model: model.clone() };
    let made = model.make(&job.written.file, resources, progress, cancel)?;
    let report = with_polygons(&model.cloud, resources, |resources| {
        let written =
            WrittenOutput { file: job.written.file.clone(), original: made.inputs.clone() };
        // Bounds and polygons apply to the points, not to the model.
        let grid = GridInput::with_water(water.clone());
        let options = TilesProof { geoid: geoid.clone(), grid, resources };
        verify_tiles(&ProofQuestion { written: &written, options: &options }, progress, cancel)
    });
    let mut report = report.map_err(|error| made.renamed(error))?;
    report.run.memory_budget = resources.memory;
    Ok(TilesVerifyReport { notes: [made.notes, report.notes].concat(), ..report })
}

fn check_memory(resources: &Resources) -> Result<()> {
    if resources.memory >= MIN_MEMORY {
        return Ok(());
    }
    Err(too_little(resources.memory, MIN_MEMORY))
}
