//! Terrain tiles of grids and point clouds, and their verification.

use std::path::Path;

use terrane_engine::operation::Job;
use terrane_engine::proof::WrittenOutput;
use terrane_tiles::{CloudTilesOptions, TilesOptions};
use terrane_verify::tiles::{CloudTilesProof, TilesProof};

use super::{Cloud, Grid};

impl Grid {
    /// Terrain tiles for globe viewers at all levels of detail, of a grid in any CRS: quantized-mesh 1.0, 3D
    /// Tiles 1.1, or both. The error of a decoded tile is at most the geometric error of its level. Sources:
    /// <https://github.com/CesiumGS/quantized-mesh>, <https://www.ogc.org/standards/3dtiles>.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
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
    pub fn tiles(&self) -> Job<'_, TilesOptions> {
        self.job()
    }

    /// Verification of a folder of terrain tiles against this grid.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let tiles = folder.path().join("tiles");
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// dem.tiles().max_level(11).write(&tiles)?;
    /// assert!(dem.verify_tiles(&tiles).run()?.verdict.passed);
    /// # Ok(())
    /// # }
    /// ```
    pub fn verify_tiles(&self, tiles: impl AsRef<Path>) -> Job<'_, TilesProof, WrittenOutput> {
        self.proof(tiles.as_ref())
    }
}

impl Cloud {
    /// Terrain tiles of a terrain model of the point cloud ([`grid`](Self::grid) with
    /// [`dtm`](crate::prelude::GridSetters::dtm)) with square cells of this size in units of the CRS; about the
    /// point spacing when `None`. The error bound of tiles refers to samples of the model.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let tiles = folder.path().join("tiles");
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?;
    /// let made = cloud.tiles(2.0).max_level(12).write(&tiles)?;
    /// assert!(made.levels.iter().all(|level| level.error <= level.tolerance)); // metres
    /// # Ok(())
    /// # }
    /// ```
    pub fn tiles(&self, cell: impl Into<Option<f64>>) -> Job<'_, CloudTilesOptions> {
        let cell = cell.into().map(|side| [side; 2]);
        self.job(|options: &mut CloudTilesOptions| options.model.cell = cell)
    }

    /// Verification of a folder of terrain tiles against a terrain model of this point cloud, with the same
    /// [cells](crate::prelude::ModelSetters::cell) and [ground](crate::prelude::ModelSetters::ground) as the
    /// tiles.
    pub fn verify_tiles(&self, tiles: impl AsRef<Path>) -> Job<'_, CloudTilesProof, WrittenOutput> {
        self.proof(tiles.as_ref())
    }
}
