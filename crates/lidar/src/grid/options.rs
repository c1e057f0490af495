//! Options of grids of clouds.

use std::path::Path;

use terrane_options::{OptionRange, OptionRule, Options, settled};

use super::codecs::{AsText, StatisticList};
use super::job::{GridJob, NODATA};
use super::make::run;
use super::placement::{Compat, Placement};
use super::preset::kinds::{GroundFrom, SurfaceModel};
use super::report::GridReport;
use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{
    BoundsText, CellSize, CloudInput, FileName, FileOutput, FiniteOrNan, GridOutput, PositionText,
    SampleTypeName,
};
use terrane_gridding::{Canopy, parse_list};
use terrane_raster::{Inputs, SampleType};

/// Make a grid of a cloud of points: statistics of the points in each cell
///
/// Cells take points at their western and southern border, and their corners lie at multiples of the
/// cell size. One pass over the points, whatever the extent; the bytes are the same for any order of
/// points and files, any number of threads and any memory. A .tif is a GeoTIFF in tiles.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct GridOptions {
    /// Statistics, a band for each, such as mean,max,p95,idw:radius=2,power=1
    #[option(value = "LIST", with = StatisticList, default_text = "mean")]
    pub stat: Option<String>,
    /// The ground: its points, linear in their triangulation at the centres of cells
    #[option(heading = "Models of the terrain")]
    pub dtm: bool,
    /// What is seen from above: first returns, linear in their triangulation, without the pits that
    /// pulses leave which went deep into a crown; by another method with ‹canopy›
    #[option(heading = "Models of the terrain")]
    pub dsm: bool,
    /// The height of ‹dsm› above ‹dtm›, 0 where it would be below
    #[option(heading = "Models of the terrain")]
    pub chm: bool,
    /// Which points are ground: class (those of class 2, or of ‹class›), those that a method such as
    /// csf:rigidness=1 finds among last returns, or auto: by class if there are any, else by the method
    /// adaptive
    #[option(value = "HOW", with = AsText, heading = "Models of the terrain")]
    pub ground: GroundFrom,
    /// How ‹dsm› and ‹chm› get rid of returns from deep in crowns: pit-free, or spike-free with its parameters,
    /// such as spike-free:freeze=1.5, which is made of all returns
    #[option(value = "METHOD", with = AsText, heading = "Models of the terrain")]
    pub canopy: Canopy,
    /// Water of a file of features, made level in ‹dtm›: polygons are lakes, as high as their lowest bank, and
    /// those that a line of the file runs within are rivers, falling along it (drawn downstream)
    #[option(value = "FILE", with = FileName, role = Reads, heading = "Models of the terrain")]
    pub water: Option<String>,
    /// Side of a cell, or its width and height, in the units of the CRS
    #[option(value = "SIZE", with = CellSize, heading = "Cells",
             default_text = "of ‹dtm›, ‹dsm› and ‹chm› about the distance between points, rounded up to 1, 2 or 5 times a power of ten")]
    pub cell: Option<[f64; 2]>,
    /// A corner of some cell
    #[option(value = "X,Y", with = PositionText, heading = "Cells", default_text = "0,0")]
    pub align: Option<[f64; 2]>,
    /// All cells that this box overlaps, instead of those of the whole cloud
    #[option(value = "XMIN,YMIN,XMAX,YMAX", alias = "bbox", with = BoundsText, heading = "Cells")]
    pub extent: Option<[f64; 4]>,
    /// The very cells of this grid
    #[option(value = "GRID", with = FileName, role = ReadsGrid, heading = "Cells")]
    pub like: Option<String>,
    /// Whose conventions are followed: pdal takes all points within ‹radius› of a cell's
    /// centre for every statistic, from the lowest x and y on; lasr gives points on a border to the
    /// cell south of it
    #[option(value = "PROGRAM", heading = "Cells")]
    pub compat: Compat,
    /// Points nearer than this to a cell's centre, for idw and nearest
    #[option(value = "R", range = OptionRange::POSITIVE, heading = "Method",
             default_text = "the cell's longer side times the root of 2")]
    pub radius: Option<f64>,
    /// Weights of idw are distance to the power of minus P, 4 at most
    #[option(value = "P", range = OptionRange::POSITIVE, heading = "Method", default_text = "1")]
    pub power: Option<f64>,
    /// For tin and models of the terrain: triangles with an edge longer than this are no surface
    #[option(value = "LENGTH", range = OptionRange::POSITIVE, heading = "Method", default_text = "all are")]
    pub max_edge: Option<f64>,
    /// Fill voids from known cells at most N columns and rows away, weighted by the inverse of the
    /// larger of the two
    #[option(value = "N", alias = "window", range = OptionRange::new(0.0, 1024.0), heading = "Method")]
    pub fill: Option<u32>,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// Creation options.
    #[option(flatten)]
    pub creation: GridOutput,
    /// Type of the written samples; floats hold the nearest value
    #[option(name = "type", alias = "dtype", value = "NAME", with = SampleTypeName, heading = "Output",
             default = SampleType::F32)]
    pub sample_type: SampleType,
    /// Write the nearest value where a type of whole numbers, or the format, does not hold one exactly
    #[option(heading = "Output")]
    pub round: bool,
    /// Written value for voids
    #[option(value = "VALUE", with = FiniteOrNan, heading = "Output", default = NODATA)]
    pub nodata: f64,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[OptionRule] = &[
    OptionRule::NotWith("dtm", &["stat", "dsm", "chm"]),
    OptionRule::NotWith("dsm", &["stat", "chm"]),
    OptionRule::NotWith("chm", &["stat"]),
    OptionRule::Needs("ground", &["dtm", "dsm", "chm"]),
    OptionRule::Needs("canopy", &["dsm", "chm"]),
    OptionRule::Needs("water", &["dtm"]),
    OptionRule::NotWith("like", &["cell", "align", "extent"]),
];

impl GridOptions {
    fn preset(&self) -> Option<SurfaceModel> {
        let presets = [
            (self.dtm, SurfaceModel::Dtm),
            (self.dsm, SurfaceModel::Dsm),
            (self.chm, SurfaceModel::Chm),
        ];
        presets.into_iter().find(|(wanted, _)| *wanted).map(|(_, preset)| preset)
    }

    /// The job on some files.
    ///
    /// # Errors
    /// Unknown statistics; polygons that cannot be read.
    pub fn job(&self, inputs: &Inputs, output: &Path) -> Result<GridJob> {
        let cloud = self.cloud.options(&self.resources)?;
        Ok(GridJob { cloud, ..settled(self)?.unread(inputs, output)? })
    }

    /// The job without its clip polygons.
    fn unread(&self, inputs: &Inputs, output: &Path) -> Result<GridJob> {
        let preset = self.preset();
        let stats = preset.map_or_else(
            || parse_list(self.stat.as_deref().unwrap_or("mean")),
            |own| Ok(vec![own.band()]),
        )?;
        Ok(GridJob {
            format: self.file.format.clone(),
            creation: self.creation.in_order(),
            preset,
            ground: self.ground,
            canopy: self.canopy,
            water: self.water.clone(),
            placement: Placement {
                cell: self.cell,
                align: self.align,
                extent: self.extent,
                like: self.like.clone(),
                is_chosen: false,
            },
            compat: self.compat,
            radius: self.radius,
            power: self.power,
            max_edge: self.max_edge,
            fill: self.fill.unwrap_or(0),
            sample_type: self.sample_type,
            round: self.round,
            nodata: self.nodata,
            overwrite: self.file.replacing.overwrite,
            resources: self.resources.clone(),
            ..GridJob::new(inputs.names().to_vec(), output, stats, 1.0)
        })
    }
}

impl Operation for GridOptions {
    const NAME: &'static str = "grid";
    type Input = CloudInput;
    const WRITES: Writes = Writes::Grid;
    type Report = GridReport;

    fn check(&self, output: &Path) -> Result<()> {
        let job = self.unread(&Inputs::from(Vec::new()), output)?;
        let floats = [SampleType::F16, SampleType::F32, SampleType::F64];
        if self.round && job.format()?.holds_types && floats.contains(&self.sample_type) {
            return Err(Error::usage("‹round› has no effect on floating-point samples")
                .remedy("leave out ‹round›"));
        }
        job.check()
    }

    fn run(&self, request: RunRequest<'_>) -> Result<GridReport> {
        run(&self.job(request.inputs, request.output)?, request.progress, request.cancel)
    }
}
