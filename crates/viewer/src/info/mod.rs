//! Reports on files: grids, meshes, point clouds, features.

mod cloud;
mod features;
mod grid;
mod mesh;

use std::path::{Path, PathBuf};

use terrane_options::{OptionRange, OptionRule, Options};

pub use cloud::CloudInfoReport;
pub use features::{FeaturesInfoReport, FieldStats};
pub use grid::GridInfoReport;
pub use mesh::MeshInfoReport;

use crate::cloud_picture::{PictureContent, PictureJob, PictureReport, draw};
use crate::cloud_stats::cloud_stats;
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as clouds, CloudFilter, CloudOpenOptions};
use terrane_engine::input::{grid_stats, is_mesh, mesh_bounds};
use terrane_engine::memory::cache_beside;
use terrane_engine::options::{CloudInput, FeatureInput, FileName, GridInput, Replacing};
use terrane_engine::outputs::{check_ending, not_among};
use terrane_engine::proof::Inspection;
use terrane_engine::skip_bad::LostPoints;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::path_of;
use terrane_mesh as meshes;
use terrane_raster::{self as raster, GridSource, Inputs};
use terrane_terrain::tin::cost;
use terrane_vector::VectorOpenOptions;
use terrane_verify::{MeasuredMesh, SlopeReference, quality};

/// Describe a grid, its anomalies, and the cost of a TIN
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct GridInfoOptions {
    /// Read all samples: share of valid samples, minimum, maximum and mean height
    pub stats: bool,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Describe a mesh
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_MESHES)]
#[non_exhaustive]
pub struct MeshInfoOptions {
    /// Read all triangles: angles, aspect ratios, vertex degrees, edge lengths, share of locally Delaunay edges in x
    /// and y
    pub quality: bool,
    /// Grid to compare triangle slopes with, for ‹quality›: a file, a synthetic terrain, a folder, a list or a quoted
    /// pattern. Options of grids then apply to it
    #[option(value = "GRID", alias = "grid", with = FileName, role = ReadsGrid)]
    pub against: Option<String>,
    /// How that grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const OF_MESHES: &[OptionRule] = &[
    OptionRule::Needs("against", &["quality"]),
    OptionRule::Needs("band", &["against"]),
    OptionRule::Needs("nodata", &["against"]),
    OptionRule::Needs("bounds", &["against"]),
    OptionRule::Needs("clip", &["against"]),
    OptionRule::Needs("water", &["against"]),
];

/// Describe a point cloud
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_CLOUDS)]
#[non_exhaustive]
pub struct CloudInfoOptions {
    /// Read all points: counts by class and return, bounds, histogram of heights (always, if filters such as ‹class›
    /// are given)
    pub stats: bool,
    /// Write a top view of the point cloud to this .png file
    #[option(value = "FILE", with = FileName, heading = "Pictures of clouds")]
    pub picture: Option<PathBuf>,
    /// Value of the picture in each cell
    #[option(value = "WHAT", heading = "Pictures of clouds")]
    pub picture_of: PictureContent,
    /// Cell size of the picture, in units of x and y
    #[option(
        value = "SIZE",
        range = OptionRange::POSITIVE,
        heading = "Pictures of clouds",
        default_text = "four points per cell on average, at most 1000 cells along a side"
    )]
    pub cell: Option<f64>,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const OF_CLOUDS: &[OptionRule] = &[
    OptionRule::Needs("picture_of", &["picture"]),
    OptionRule::Needs("cell", &["picture"]),
    OptionRule::Needs("overwrite", &["picture"]),
];

/// Describe a file of features; all of it is read
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct FeaturesInfoOptions {
    /// Read all features (always done)
    pub stats: bool,
    /// How the features are read.
    #[option(flatten)]
    pub features: FeatureInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

impl Inspection for GridInfoOptions {
    const OF: &'static str = "grids";
    type Report = GridInfoReport;

    fn inspect(
        &self,
        inputs: &Inputs,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<GridInfoReport> {
        let grid = open(inputs, &self.grid, &self.resources)?;
        let stats = match self.stats {
            true => Some(grid_stats(grid.as_ref(), &self.resources, progress, cancel)?),
            false => None,
        };
        let cost = cost(grid.as_ref(), &self.resources);
        Ok(GridInfoReport::new(&inputs.to_string(), grid.info(), stats, cost))
    }
}

impl Inspection for MeshInfoOptions {
    const OF: &'static str = "meshes";
    type Report = MeshInfoReport;

    fn inspect(
        &self,
        inputs: &Inputs,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<MeshInfoReport> {
        let [name] = inputs.names() else {
            return Err(
                Error::usage("only one mesh is supported").remedy("pass one mesh at a time")
            );
        };
        let file = &*path_of(name);
        let mesh = meshes::open(file)?;
        let bounds = mesh_bounds(mesh.as_ref(), progress, cancel)?;
        let measured = MeasuredMesh { file, mesh: mesh.as_ref(), bounds };
        let against = self.against.as_ref();
        let grid = against.map(|name| self.open_reference(name)).transpose()?;
        let path = against.map(|name| path_of(name));
        let reference = path.as_deref().zip(grid.as_deref());
        let reference = reference.map(|(name, grid)| SlopeReference { name, grid });
        let quality = match self.quality {
            true => Some(quality(measured, reference, &self.resources, progress, cancel)?),
            false => None,
        };
        Ok(MeshInfoReport::new(&inputs.to_string(), mesh.as_ref(), bounds, quality))
    }
}

impl MeshInfoOptions {
    /// The grid that slopes are compared with.
    fn open_reference(&self, name: &str) -> Result<Box<dyn GridSource>> {
        if is_mesh(name)? {
            return Err(Error::bad_input("is a mesh, not a grid")
                .in_file(&path_of(name))
                .remedy("name the source grid of the mesh"));
        }
        open(&Inputs::from(name), &self.grid, &self.resources)
    }
}

/// Rounding error allowed at a declared bound; positions that exceed it lie outside.
fn bound_slack(bound: f64) -> f64 {
    1e-9 * bound.abs().max(1.0)
}

fn open(inputs: &Inputs, grid: &GridInput, resources: &Resources) -> Result<Box<dyn GridSource>> {
    raster::open_all(inputs.names(), &grid.options(resources, cache_beside(resources.memory))?)
}

impl Inspection for CloudInfoOptions {
    const OF: &'static str = "point clouds";
    type Report = CloudInfoReport;

    /// Counts include withheld points; the picture leaves them out unless requested.
    fn inspect(
        &self,
        inputs: &Inputs,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<CloudInfoReport> {
        let mut options = self.cloud.options(&self.resources)?;
        let picture = match &self.picture {
            Some(output) => Some(self.draw(inputs, &options, output, progress, cancel)?),
            None => None,
        };
        // With filters the headers do not describe the points.
        let is_filtered = options.filter != CloudFilter::default();
        options.filter.keep_withheld = true;
        options.any_extent = true;
        let cloud = clouds::open(inputs.names(), &options)?;
        let stats = match self.stats || is_filtered {
            true => Some(cloud_stats(&cloud, &self.resources, progress, cancel)?),
            false => None,
        };
        let mut report =
            CloudInfoReport { picture, ..CloudInfoReport::new(&inputs.to_string(), &cloud, stats) };
        report.notes.extend(LostPoints::of(&cloud).notes());
        Ok(report)
    }
}

impl CloudInfoOptions {
    fn draw(
        &self,
        inputs: &Inputs,
        options: &CloudOpenOptions,
        output: &Path,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<PictureReport> {
        check_ending(output, &["png"], "a picture")?;
        not_among(&clouds::files(inputs.names())?, &[output])?;
        let job = PictureJob {
            output: output.to_path_buf(),
            overwrite: self.replacing.overwrite,
            shows: self.picture_of,
            cell: self.cell,
        };
        let cloud = clouds::open(inputs.names(), options)?;
        draw(&cloud, &job, &self.resources, progress, cancel)
    }
}

impl Inspection for FeaturesInfoOptions {
    const OF: &'static str = "files of features";
    type Report = FeaturesInfoReport;

    fn inspect(
        &self,
        inputs: &Inputs,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<FeaturesInfoReport> {
        let [name] = inputs.names() else {
            return Err(Error::usage("only one file of features is supported")
                .remedy("pass one file at a time"));
        };
        let options =
            VectorOpenOptions { layer: self.features.layer.clone(), ..Default::default() };
        features::read(name, &options, progress, cancel)
    }
}
