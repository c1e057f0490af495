//! Point clouds in files and in memory.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value as Json};
use terrane_base::Result;
use terrane_base::geom::Crs;
use terrane_cloud::{self as cloud, CloudInfo, HeldCloud, Marks, OpenOptions};
use terrane_engine::Resources;
use terrane_engine::operation::{Has, Job};
use terrane_engine::options::CloudInput;
use terrane_engine::proof::{Proof, Written};
use terrane_files::name_of;
use terrane_lidar::cloud_tin::CloudTinOptions;
use terrane_lidar::grid::GridOptions;
use terrane_lidar::translate::PointsOptions;
use terrane_options::{Options, changed};
use terrane_raster::Inputs;
use terrane_tiles::CloudTilesOptions;
use terrane_verify::{CloudMeshProof, CloudTilesProof};
use terrane_viewer::info::CloudInfoOptions;
use terrane_viewer::page::CloudPageOptions;

use super::Data;

/// A point cloud, in one file or many: what [`open_cloud`] opens. Nothing of it is held.
pub struct Cloud {
    pub(super) inputs: Vec<String>,
    pub(super) reading: CloudInput,
    info: CloudInfo,
    /// Gives up what is in memory, once the last one of it is gone.
    held: Option<Arc<HeldCloud>>,
}

/// Opens a point cloud: LAS, LAZ, COPC or text, or a synthetic one by its name. Several files (a
/// `Vec<String>`), a folder, a list or a pattern are one cloud.
///
/// # Errors
/// A file that is missing, damaged or no cloud; files that do not fit together.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("dtm.tif");
/// let cloud = terrane::open_cloud("synth:cloud,size=100,density=2,seed=7")?;
/// let report = cloud.grid(1.0).stat("mean,count").write(&path)?;
/// assert_eq!(report.bands.len(), 2);
/// # Ok(())
/// # }
/// ```
pub fn open_cloud(input: impl Into<Inputs>) -> Result<Cloud> {
    open_cloud_as(input, CloudInput::default())
}

/// Opens a point cloud to be read in some way, as [`read_as`](Cloud::read_as) has it, which counts from the start: damaged
/// files open where their good part is enough, and files that name no reference system beside others that do.
///
/// # Errors
/// As [`open_cloud`]; polygons that cannot be read, or are in another system.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// # let folder = tempfile::tempdir().unwrap();
/// # let [las, text] = ["points.las", "points.xyz"].map(|name| folder.path().join(name));
/// std::fs::write(&text, "10 0 1\n20 5 3\n").unwrap();
/// let text = format!("cloud:{}", text.display());
/// let mut reading = terrane::CloudInput::default();
/// reading.points.crs = Some("EPSG:32631".to_owned());
/// terrane::open_cloud_as(text.as_str(), reading.clone())?.points().write(&las)?;
/// let both = || vec![las.display().to_string(), text.clone()];
/// assert!(terrane::open_cloud(both()).is_err());
/// assert_eq!(terrane::open_cloud_as(both(), reading)?.info().count, 4);
/// # Ok(())
/// # }
/// ```
pub fn open_cloud_as(input: impl Into<Inputs>, reading: CloudInput) -> Result<Cloud> {
    Cloud::open(input.into().names().to_vec(), reading)
}

/// Takes points in memory, x, y and z, for a cloud that jobs read as they read those in files; with what is known
/// of them, for filters. They are copied onto a lattice with the decimals they have, at most 9 and no more than
/// keep them within reach: 16 bytes a point.
///
/// # Errors
/// A coordinate that is not finite; marks of another number of points; points too far from each other.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("count.tif");
/// let points: Vec<[f64; 3]> = (0..5000).map(|i| [i as f64 % 71.0, i as f64 / 71.0, 0.25 * i as f64]).collect();
/// let cloud = terrane::open_points(&points, None, terrane::Crs::default())?;
/// let report = cloud.grid(10.0).stat("count,mean").write(&path)?;
/// assert_eq!(report.points.kept, 5000);
/// # Ok(())
/// # }
/// ```
pub fn open_points(positions: &[[f64; 3]], marks: Option<&[Marks]>, crs: Crs) -> Result<Cloud> {
    let held = HeldCloud::new(positions, marks, crs)?;
    let cloud = Cloud::open(vec![held.name().to_owned()], CloudInput::default())?;
    Ok(Cloud { held: Some(Arc::new(held)), ..cloud })
}

impl Cloud {
    fn open(inputs: Vec<String>, reading: CloudInput) -> Result<Self> {
        let options = reading.options(&Resources::default())?;
        // What a job cannot work on, it says.
        let any = OpenOptions { any_extent: true, ..options };
        let info = cloud::source(&inputs, &any)?.info().clone();
        Ok(Self { inputs, reading, info, held: None })
    }

    /// The same cloud, read otherwise: the points within bounds or polygons, of some classes, of which a condition is true,
    /// and more, instead of what was said before.
    ///
    /// # Errors
    /// As [`open_cloud`]; polygons that cannot be read, or are in another system.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// let cloud = terrane::open_cloud("synth:cloud,size=50,density=2,seed=7")?;
    /// let mut reading = terrane::CloudInput::default();
    /// reading.points.condition = Some("classification = 2 and intensity > 100".parse().unwrap());
    /// let strong = cloud.read_as(reading)?;
    /// # let _ = strong;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_as(self, reading: CloudInput) -> Result<Self> {
        let Self { inputs, held, .. } = self;
        Ok(Self { held, ..Self::open(inputs, reading)? })
    }

    /// The same cloud, of the points inside the polygons of a file of features alone.
    ///
    /// # Errors
    /// As [`read_as`](Self::read_as).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// let (areas, path) = (folder.path().join("areas.wkt"), folder.path().join("count.tif"));
    /// std::fs::write(&areas, "POLYGON ((500000 4750000, 500010 4750000, 500010 4750010, 500000 4750010))").unwrap();
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?.clip(&areas);
    /// assert!(cloud.is_err()); // which system that is, is not said
    /// std::fs::write(areas.with_extension("prj"), "EPSG:32631").unwrap();
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?.clip(&areas)?;
    /// let made = cloud.grid(10.0).stat("count").write(&path)?;
    /// assert!(made.points.kept < 300);
    /// # Ok(())
    /// # }
    /// ```
    pub fn clip(self, polygons: impl AsRef<Path>) -> Result<Self> {
        let mut reading = self.reading.clone();
        reading.clip = Some(name_of(polygons.as_ref().to_path_buf())?);
        self.read_as(reading)
    }

    /// The same cloud, of the points within the box (x low, y low, x high, y high) alone, its borders included.
    ///
    /// # Errors
    /// As [`read_as`](Self::read_as).
    pub fn bounds(self, bounds: [f64; 4]) -> Result<Self> {
        let mut reading = self.reading.clone();
        reading.bounds = Some(bounds);
        self.read_as(reading)
    }

    /// Bounds, number of points and reference system, as the headers claim.
    pub fn info(&self) -> &CloudInfo {
        &self.info
    }

    /// A triangle mesh of it, none of its points further from the mesh than a tolerance: the Delaunay triangulation of some
    /// of its points, and of posts on breaklines.
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

    /// A grid of it, with square cells of this side in units of the reference system: in one pass over the points, each band
    /// a statistic of the points in its cells, or a model of the terrain. Corners of cells are at multiples of their size. The
    /// result does not depend on the order of points or files.
    ///
    /// A [model](crate::prelude::GridSetters::dtm) without a side (`None`) has cells of about the distance between points.
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

    /// Its points in files of points, with all that is known of them: one file, LAS, LAZ, COPC or text by the name's ending
    /// (`.las`, `.laz`, `.copc.laz`, `.csv`), or a folder of one for each [square](crate::prelude::PointsSetters::tile) or
    /// [value of an attribute](crate::prelude::PointsSetters::split). Points stay in the order of the files' names and of the points in them unless
    /// another is asked for; those marked as withheld are kept.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, thin, high, parts] = ["points.xyz", "thin.laz", "high.csv", "parts"].map(|name| folder.path().join(name));
    /// use terrane::{Assign, HeightsAs, Thin};
    /// std::fs::write(&path, "x y z class\n0 0 1 2\n4 0 3 2\n0 4 1 2\n1 1 9.25 5\n").unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?;
    /// let made = cloud.points().thin("2:lowest".parse::<Thin>().unwrap()).write(&thin)?;
    /// assert_eq!(made.points, 3); // one of each square of 2 by 2
    /// let set: Assign = "intensity = 10 * (z + 1)".parse().unwrap();
    /// cloud.points().height_above_ground(HeightsAs::Z).attribute([set]).write(&high)?;
    /// let text = std::fs::read_to_string(&high).unwrap();
    /// assert!(text.lines().nth(4).unwrap().starts_with("1,1,7.75,")); // the ground is at 1.5 there
    /// assert_eq!(cloud.points().split("class").write(&parts)?.files, 2);
    /// # Ok(())
    /// # }
    /// ```
    pub fn points(&self) -> Job<'_, PointsOptions> {
        self.job(|_| {})
    }

    /// A job on it whose options are its reading, and what `change` makes of them.
    fn job<O: Options + Has<CloudInput> + Has<Resources>>(
        &self,
        change: impl FnOnce(&mut O),
    ) -> Job<'_, O> {
        Job::new(Data::inputs(self), self.options(change))
    }

    fn options<O: Options + Has<CloudInput>>(&self, change: impl FnOnce(&mut O)) -> O {
        let mut options = O::default();
        *options.part_mut() = self.reading.clone();
        change(&mut options);
        options
    }

    /// A page of it for a browser: one file that holds so many of its [points](crate::prelude::CloudPageSetters::points) and what is known of them.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, page, picture] = ["cloud.xyz", "cloud.html", "cloud.png"].map(|name| folder.path().join(name));
    /// # let text: String = (0..2000).map(|i| format!("{} {} {}\n", i % 50, i / 50, i % 7)).collect();
    /// # std::fs::write(&path, text).unwrap();
    /// let cloud = terrane::open_cloud(format!("cloud:{}", path.display()))?; // "cloud.xyz"
    /// assert_eq!(cloud.page().points(1000).write(&page)?.points, Some(1000));
    /// let known = cloud.inspect().picture(&picture).run()?;
    /// assert!(known.density.unwrap() > 1.0 && known.picture.unwrap().points > 1000);
    /// # Ok(())
    /// # }
    /// ```
    pub fn page(&self) -> Job<'_, CloudPageOptions> {
        self.job(|_| {})
    }

    /// What is known of it, by its headers, or by [all of its points](crate::prelude::CloudInfoSetters::stats); with a [picture](crate::prelude::CloudInfoSetters::picture) of it from
    /// above.
    pub fn inspect(&self) -> Job<'_, CloudInfoOptions> {
        self.job(|_| {})
    }

    /// Tiles for viewers of the globe of a model of its ground ([`grid`](Self::grid) with [`dtm`](crate::prelude::GridSetters::dtm)) with square cells of this side, in units
    /// of the reference system; about as wide as points are apart when `None`. What tiles promise is about samples
    /// of the model.
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

    /// The proof of a mesh in a file against this cloud.
    pub fn verify(&self, mesh: impl AsRef<Path>) -> Job<'_, CloudMeshProof, Written> {
        self.proof(mesh.as_ref())
    }

    /// The proof of a folder of terrain tiles against a model of the ground of this cloud, with [cells](crate::prelude::ModelSetters::cell) and
    /// [ground](crate::prelude::ModelSetters::ground) as they were when the tiles were made.
    pub fn verify_tiles(&self, tiles: impl AsRef<Path>) -> Job<'_, CloudTilesProof, Written> {
        self.proof(tiles.as_ref())
    }

    fn proof<O: Proof + Has<CloudInput>>(&self, file: &Path) -> Job<'_, O, Written> {
        let written = Written { file: file.to_path_buf(), original: Data::inputs(self) };
        Job::new(written, self.options(|_| {}))
    }
}

impl Data for Cloud {
    fn inputs(&self) -> Inputs {
        Inputs::from(self.inputs.clone())
    }

    fn reading(&self) -> Map<String, Json> {
        changed(&self.reading)
    }
}
