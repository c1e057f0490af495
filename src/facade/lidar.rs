//! Operations on point clouds: meshes, grids and files of points.

use terrane_engine::operation::Job;
use terrane_lidar::cloud_tin::CloudTinOptions;
use terrane_lidar::grid::GridOptions;
use terrane_lidar::points::PointsOptions;

use super::Cloud;

impl Cloud {
    /// A triangle mesh whose vertical error at all points is at most a tolerance: the Delaunay triangulation of
    /// a subset of the points and of anchor vertices on breaklines.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, kerb, work, other] = ["mesh.ply", "kerb.wkt", "work", "other.ply"].map(|name| folder.path().join(name));
    /// std::fs::write(&kerb, "LINESTRING (500010 4750010, 500040.5 4750033, 500055 4750020)").unwrap();
    /// std::fs::write(kerb.with_extension("prj"), "EPSG:32631").unwrap();
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?;
    /// let made = cloud.tin().max_error(0.5).breaklines(kerb.to_str().unwrap()).write(&path)?;
    /// assert!(made.max_error <= Some(0.5) && made.breaklines.unwrap().apart == 0);
    /// let proof = cloud.verify(&path).breaklines(kerb.to_str().unwrap()).run()?;
    /// assert!(proof.verdict.passed && proof.verdict.judged);
    ///
    /// let plan = cloud.tin().max_error(0.5).plan(&work, None)?;
    /// plan.run().task("choose-0").run()?; // anywhere, in any order
    /// plan.run().output(&other).run()?; // what is left, and the mesh
    /// assert!(cloud.verify(&other).run()?.verdict.passed);
    /// # Ok(())
    /// # }
    /// ```
    pub fn tin(&self) -> Job<'_, CloudTinOptions> {
        self.job(|_| {})
    }

    /// A grid with square cells of this size in units of the CRS, in one pass over the points. Each band is a
    /// statistic of the points in a cell, or a terrain model. Cell corners are multiples of the cell size. The
    /// result does not depend on the order of points or files.
    ///
    /// A [terrain model](crate::prelude::GridSetters::dtm) without a cell size (`None`) uses about the point
    /// spacing.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [work, path, high] = ["work", "dtm.tif", "chm.tif"].map(|name| folder.path().join(name));
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=5")?;
    /// let ground = || cloud.grid(1.0).dtm(true).ground("csf:rigidness=1".parse::<terrane::GroundFrom>().unwrap());
    /// ground().write(&path)?;
    /// let made = ground().plan(&work, 256)?.run().run()?; // by tasks, the same bytes
    /// assert!(std::fs::read(path).unwrap() == std::fs::read(made.written.unwrap()).unwrap());
    /// let canopy: terrane::Canopy = "spike-free:freeze=2".parse()?;
    /// let made = cloud.grid(1.0).chm(true).canopy(canopy).write(&high)?;
    /// assert!(made.notes.iter().any(|note| note.contains("spike-free")));
    /// # Ok(())
    /// # }
    /// ```
    pub fn grid(&self, cell: impl Into<Option<f64>>) -> Job<'_, GridOptions> {
        let cell = cell.into().map(|side| [side; 2]);
        self.job(|options: &mut GridOptions| options.cell = cell)
    }

    /// Writes the points with all attributes: one LAS, LAZ, COPC or text file by the ending (`.las`, `.laz`,
    /// `.copc.laz`, `.csv`), or a folder with one file per [tile](crate::prelude::PointsSetters::tile) or
    /// [attribute value](crate::prelude::PointsSetters::split). The order is that of file names and of points
    /// in the files unless another is requested; withheld points are kept.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, thin, high, parts, grid] = ["points.xyz", "thin.laz", "high.csv", "parts", "lowest.tif"].map(|name| folder.path().join(name));
    /// use terrane::{Assign, HeightsAs, CellThinning};
    /// std::fs::write(&path, "x y z class\n0 0 1 2\n4 0 3 2\n0 4 1 2\n1 1 9.25 5\n").unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// let made = cloud.points().thin("2:lowest".parse::<CellThinning>().unwrap()).write(&thin)?;
    /// assert_eq!(made.points, 3); // one of each square of 2 by 2
    /// let set: Assign = "intensity = 10 * (z + 1)".parse().unwrap();
    /// cloud.points().height_above_ground(HeightsAs::Z).attribute([set]).write(&high)?;
    /// let text = std::fs::read_to_string(&high).unwrap();
    /// assert!(text.lines().nth(4).unwrap().starts_with("1,1,7.75,")); // the ground is at 1.5 there
    /// assert_eq!(cloud.points().split("class").write(&parts)?.files, 2);
    /// // Stages run before grids, meshes and tiles, too.
    /// let stages = ["height-above-ground:z", "where:z > 2"].map(|text| text.parse::<terrane::StageText>().unwrap());
    /// assert_eq!(cloud.grid(2.0).stage(stages).write(&grid)?.points.read, 1);
    /// # Ok(())
    /// # }
    /// ```
    pub fn points(&self) -> Job<'_, PointsOptions> {
        self.job(|_| {})
    }
}
