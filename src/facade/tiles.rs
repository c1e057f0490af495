//! Tiles of the globe's terrain.

use std::path::PathBuf;

use super::grid::Grid;
use super::plan::Plan;
use super::run::{Run, overwrite_setting, run_settings};
use terrane_base::{Error, Result};
use terrane_jobs::tiles::{self, Format as TilesFormat, PlanJob, TilesJob, TilesReport};

/// Tiles of a grid in any system to be made, for viewers of the globe, at every level of detail:
/// quantized-mesh 1.0, 3D Tiles 1.1, or both. No sample is further from a tile, as a client decodes it, than clients take its level to be
/// off by. Sources: <https://github.com/CesiumGS/quantized-mesh>, <https://www.ogc.org/standards/3dtiles>.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let (dem, tiles) = (folder.path().join("dem.asc"), folder.path().join("tiles"));
/// # let row = "5 7 9 6\n";
/// # let text = format!("ncols 4\nnrows 4\nxllcenter 7\nyllcenter 46\ncellsize 0.01\n{}", row.repeat(4));
/// # std::fs::write(&dem, text).unwrap();
/// # std::fs::write(folder.path().join("dem.prj"), "EPSG:4326").unwrap();
/// let made = terrane::open(&dem)?.tiles().max_level(8).write(&tiles)?;
/// assert_eq!(made.levels.len(), 9);
/// assert!(made.levels.iter().all(|level| level.error <= level.tolerance)); // metres
/// assert!(tiles.join("layer.json").exists());
/// # Ok(())
/// # }
/// ```
pub struct TilesBuilder<'a> {
    grid: &'a Grid,
    geoid: Option<String>,
    formats: Vec<TilesFormat>,
    tile_edges: bool,
    meshopt: bool,
    water_mask: bool,
    max_level: Option<u8>,
    normals: bool,
    compress: bool,
    run: Run,
}

run_settings!([] TilesBuilder<'_>);
overwrite_setting!([] TilesBuilder<'_>);

impl<'a> TilesBuilder<'a> {
    pub(super) fn of(grid: &'a Grid) -> Self {
        let TilesJob {
            geoid,
            formats,
            tile_edges,
            meshopt,
            water_mask,
            max_level,
            normals,
            compress,
            ..
        } = TilesJob::new(grid.inputs.clone(), PathBuf::new());
        let run = Run::default();
        Self {
            grid,
            geoid,
            formats,
            tile_edges,
            meshopt,
            water_mask,
            max_level,
            normals,
            compress,
            run,
        }
    }

    /// A file with the heights of the geoid that those of the grid are counted from, above the ellipsoid, in metres
    /// (GTX). Heights are taken from the ellipsoid on without it.
    pub fn geoid(mut self, file: impl Into<String>) -> Self {
        self.geoid = Some(file.into());
        self
    }

    /// What to write (quantized-mesh unless told otherwise); of several formats, a folder for each in the output.
    pub fn formats(mut self, formats: &[TilesFormat]) -> Self {
        self.formats = formats.to_vec();
        self
    }

    /// Name the vertices of the sides of 3D Tiles (`CESIUM_tile_edges`), which CesiumJS needs to take them for its
    /// terrain.
    pub fn tile_edges(mut self, edges: bool) -> Self {
        self.tile_edges = edges;
        self
    }

    /// Compress what is in a tile of 3D Tiles (`EXT_meshopt_compression`), which clients then have to know.
    pub fn meshopt(mut self, meshopt: bool) -> Self {
        self.meshopt = meshopt;
        self
    }

    /// Tell in each tile of quantized-mesh which of its 256 x 256 pixels are water (the extension `watermask`): those
    /// whose middle lies in a polygon of the file of [`Grid::water`].
    pub fn water_mask(mut self, mask: bool) -> Self {
        self.water_mask = mask;
        self
    }

    /// The deepest level, from 0 to 20; the first whose tiles have at most 64 samples along a side unless told
    /// otherwise.
    pub fn max_level(mut self, level: u8) -> Self {
        self.max_level = Some(level);
        self
    }

    /// Write a normal for each vertex, which viewers light the ground by (so it is unless told otherwise).
    pub fn normals(mut self, normals: bool) -> Self {
        self.normals = normals;
        self
    }

    /// Compress each file (gzip; so it is unless told otherwise).
    pub fn compress(mut self, compress: bool) -> Self {
        self.compress = compress;
        self
    }

    /// Makes the tiles in a folder of this name, which appears whole or not at all.
    ///
    /// # Errors
    /// A grid whose place on the globe is not known, or that lies around a pole or across 180 degrees; damage in it; too little memory; an output that exists or cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<TilesReport> {
        let job = self.job(path.into())?;
        tiles::run(&job, &*self.run.progress, &self.run.cancel)
    }

    /// Writes down the work as tasks in a folder; each has so many tiles (`cut`), of about a million samples with all
    /// that is in them, or larger ones.
    ///
    /// # Errors
    /// Those of [`write`](Self::write) that are found before the work, and a folder that holds another plan or other
    /// files.
    pub fn plan(self, folder: impl Into<PathBuf>, cut: impl Into<Option<u32>>) -> Result<Plan> {
        if self.run.overwrite {
            return Err(Error::usage("a plan writes no tiles yet, to be in place of others")
                .remedy("leave overwrite out"));
        }
        let folder = folder.into();
        let job = self.job(folder.join("tiles"))?;
        let plan = PlanJob { job, folder: folder.clone(), cut: cut.into(), skipped: Vec::new() };
        tiles::plan_tiles(&plan)?;
        Plan::open(folder)
    }

    fn job(&self, output: PathBuf) -> Result<TilesJob> {
        Ok(TilesJob {
            reading: self.grid.reading.clone(),
            overwrite: self.run.overwrite,
            geoid: self.geoid.clone(),
            formats: self.formats.clone(),
            tile_edges: self.tile_edges,
            meshopt: self.meshopt,
            water_mask: self.water_mask,
            max_level: self.max_level,
            normals: self.normals,
            compress: self.compress,
            resources: self.run.resources()?,
            ..TilesJob::new(self.grid.inputs.clone(), output)
        })
    }
}
