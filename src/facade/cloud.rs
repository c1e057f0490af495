//! Point clouds in files and in memory.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value as Json};
use terrane_base::Result;
use terrane_base::geom::Crs;
use terrane_cloud::{self as cloud, CloudInfo, CloudOpenOptions, InMemoryCloud, PointFlags};
use terrane_engine::Resources;
use terrane_engine::operation::{HasGroup, Job};
use terrane_engine::options::CloudInput;
use terrane_engine::proof::{OutputProof, WrittenOutput};
use terrane_files::name_of;
use terrane_options::{Options, changed};
use terrane_raster::Inputs;
use terrane_verify::CloudMeshProof;

use super::Data;

/// A point cloud in one file or many; see [`open_cloud`]. No points are held in memory.
pub struct Cloud {
    pub(super) inputs: Vec<String>,
    pub(super) reading: CloudInput,
    info: CloudInfo,
    /// Releases memory when the last copy is dropped.
    memory: Option<Arc<InMemoryCloud>>,
}

/// Opens a point cloud: LAS, LAZ, COPC or text, or a synthetic one by name. Several files (a `Vec<String>`), a
/// folder, a list or a pattern are read as one point cloud.
///
/// # Errors
/// A missing or damaged file, a file that is not a point cloud, or files that do not match.
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

/// Opens a point cloud with input options, as for [`read_as`](Cloud::read_as). The options apply when files are
/// opened: damaged files open if their good part suffices, and files without a CRS open beside files with one.
///
/// # Errors
/// As [`open_cloud`]; polygons that cannot be read or have another CRS.
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

/// Wraps points in memory (x, y, z) as a point cloud, with optional attributes for filters. Points are copied
/// onto a lattice with as many decimals as they have, at most 9 and within the range of the lattice; 16 bytes
/// per point.
///
/// # Errors
/// A coordinate that is not finite; attributes of another length; points too far apart.
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
pub fn open_points(
    positions: &[[f64; 3]],
    attributes: Option<&[PointFlags]>,
    crs: Crs,
) -> Result<Cloud> {
    let memory = InMemoryCloud::new(positions, attributes, crs)?;
    let cloud = Cloud::open(vec![memory.name().to_owned()], CloudInput::default())?;
    Ok(Cloud { memory: Some(Arc::new(memory)), ..cloud })
}

impl Cloud {
    fn open(inputs: Vec<String>, reading: CloudInput) -> Result<Self> {
        let options = reading.options(&Resources::default())?;
        // Jobs report what they do not support.
        let any = CloudOpenOptions { any_extent: true, ..options };
        let info = cloud::source(&inputs, &any)?.info().clone();
        Ok(Self { inputs, reading, info, memory: None })
    }

    /// The same point cloud with other input options (bounds, polygons, classes, a condition and others), which
    /// replace the earlier ones.
    ///
    /// # Errors
    /// As [`open_cloud`]; polygons that cannot be read or have another CRS.
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
        let Self { inputs, memory, .. } = self;
        Ok(Self { memory, ..Self::open(inputs, reading)? })
    }

    /// The points inside the polygons of a vector file.
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
    /// assert!(cloud.is_err()); // the polygons lack a CRS
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

    /// The points within the box (x low, y low, x high, y high), borders included.
    ///
    /// # Errors
    /// As [`read_as`](Self::read_as).
    pub fn bounds(self, bounds: [f64; 4]) -> Result<Self> {
        let mut reading = self.reading.clone();
        reading.bounds = Some(bounds);
        self.read_as(reading)
    }

    /// Bounds, number of points and CRS from the headers.
    pub fn info(&self) -> &CloudInfo {
        &self.info
    }

    /// A job with the input options of the point cloud, changed by `change`.
    #[cfg(any(feature = "lidar", feature = "viewer"))]
    pub(super) fn job<O: Options + HasGroup<CloudInput> + HasGroup<Resources>>(
        &self,
        change: impl FnOnce(&mut O),
    ) -> Job<'_, O> {
        Job::new(Data::inputs(self), self.options(change))
    }

    fn options<O: Options + HasGroup<CloudInput>>(&self, change: impl FnOnce(&mut O)) -> O {
        let mut options = O::default();
        *options.part_mut() = self.reading.clone();
        change(&mut options);
        options
    }

    /// Verification of a mesh file against this point cloud.
    pub fn verify(&self, mesh: impl AsRef<Path>) -> Job<'_, CloudMeshProof, WrittenOutput> {
        self.proof(mesh.as_ref())
    }

    pub(super) fn proof<O: OutputProof + HasGroup<CloudInput>>(
        &self,
        file: &Path,
    ) -> Job<'_, O, WrittenOutput> {
        let written = WrittenOutput { file: file.to_path_buf(), original: Data::inputs(self) };
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
