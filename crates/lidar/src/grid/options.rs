//! Options of grids of clouds.

use std::path::Path;
use std::time::Instant;

use terrane_options::{OptionRange, OptionRule, Options, settled};

use super::codecs::{AsText, StatisticList};
use super::geometry::{Compat, Placement};
use super::job::{GridJob, NODATA};
use super::make::run;
use super::report::GridReport;
use super::surface_model::kinds::{GroundFrom, SurfaceModel};
use crate::points::{CloudStages, StagedCloud, StagedPlace};
use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{
    BoundsText, CellSize, CloudInput, FileName, FileOutput, FiniteOrNan, GridOutput, PositionText,
    SampleTypeName,
};
use terrane_engine::plan::RunControl;
use terrane_files::atomic::refuse_existing;
use terrane_gridding::{Canopy, parse_list};
use terrane_raster::{Inputs, SampleType};

/// Make a grid from a point cloud: statistics of the points in each cell
///
/// Cells include their western and southern borders; corners are at multiples of the cell size. Points are read in one
/// pass. The output does not depend on the order of points and files, on threads or on memory. A .tif is a tiled
/// GeoTIFF.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct GridOptions {
    /// Statistics, one band each, such as mean,max,p95,idw:radius=2,power=1
    #[option(value = "LIST", with = StatisticList, default_text = "mean")]
    pub stat: Option<String>,
    /// Terrain model: triangulated ground points, interpolated linearly at cell centres
    #[option(heading = "Terrain and surface models")]
    pub dtm: bool,
    /// Surface model: triangulated first returns with canopy pits removed by the method of ‹canopy›
    #[option(heading = "Terrain and surface models")]
    pub dsm: bool,
    /// Canopy height model: ‹dsm› minus ‹dtm›, at least 0
    #[option(heading = "Terrain and surface models")]
    pub chm: bool,
    /// Ground points: class (class 2, or ‹class›), a method that classifies last returns such as csf:rigidness=1, or
    /// auto (by class if the cloud has ground points, else csf-ptd)
    #[option(value = "HOW", with = AsText, heading = "Terrain and surface models")]
    pub ground: GroundFrom,
    /// Pit removal for ‹dsm› and ‹chm›: pit-free, or spike-free (uses all returns) with parameters, such as
    /// spike-free:freeze=1.5
    #[option(value = "METHOD", with = AsText, heading = "Terrain and surface models")]
    pub canopy: Canopy,
    /// File of water features for ‹dtm›. Polygons are lakes, flattened to their lowest bank; polygons with a line
    /// inside are rivers, falling along the line (drawn downstream)
    #[option(value = "FILE", with = FileName, role = Reads, heading = "Terrain and surface models")]
    pub water: Option<String>,
    /// Cell size, or cell width and height, in CRS units
    #[option(value = "SIZE", with = CellSize, heading = "Cells",
             default_text = "for ‹dtm›, ‹dsm› and ‹chm› the point spacing, rounded up to 1, 2 or 5 times a power \
                 of ten")]
    pub cell: Option<[f64; 2]>,
    /// Grid origin: the corner of any cell
    #[option(value = "X,Y", with = PositionText, heading = "Cells", default_text = "0,0")]
    pub align: Option<[f64; 2]>,
    /// Output extent, expanded to whole cells, instead of the extent of the point cloud
    #[option(value = "XMIN,YMIN,XMAX,YMAX", alias = "bbox", with = BoundsText, heading = "Cells")]
    pub extent: Option<[f64; 4]>,
    /// Grid that defines the cells and the extent
    #[option(value = "GRID", with = FileName, role = ReadsGrid, heading = "Cells")]
    pub like: Option<String>,
    /// Grid conventions of another program, for comparisons cell by cell
    #[option(value = "PROGRAM", heading = "Cells")]
    pub compat: Compat,
    /// Search radius of idw and nearest around the cell centre
    #[option(value = "R", range = OptionRange::POSITIVE, heading = "Method",
             default_text = "the longer cell side times the square root of 2")]
    pub radius: Option<f64>,
    /// Exponent of the inverse-distance weights of idw, at most 4
    #[option(value = "P", range = OptionRange::POSITIVE, heading = "Method", default_text = "1")]
    pub power: Option<f64>,
    /// Maximum triangle edge of tin and of the models; cells in larger triangles are void
    #[option(value = "LENGTH", range = OptionRange::POSITIVE, heading = "Method", default_text = "no limit")]
    pub max_edge: Option<f64>,
    /// Fill voids from cells at most N columns and rows away, weighted by the inverse of the larger distance
    #[option(value = "N", alias = "window", range = OptionRange::new(0.0, 1024.0), heading = "Method")]
    pub fill: Option<u32>,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// Creation options.
    #[option(flatten)]
    pub creation: GridOutput,
    /// Output sample type; floats are rounded to the nearest value
    #[option(name = "type", alias = "dtype", value = "NAME", with = SampleTypeName, heading = "Output",
             default = SampleType::F32)]
    pub sample_type: SampleType,
    /// Round values that an integer type, or the format, cannot hold exactly
    #[option(heading = "Output")]
    pub round: bool,
    /// Nodata value of the output
    #[option(value = "VALUE", with = FiniteOrNan, heading = "Output", default = NODATA)]
    pub nodata: f64,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Stages before.
    #[option(flatten)]
    pub stages: CloudStages,
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
        presets.into_iter().find(|(is_given, _)| *is_given).map(|(_, preset)| preset)
    }

    /// Calls `act` with the job on some files, or on the points that stages make of them.
    ///
    /// # Errors
    /// Unknown statistics; polygons that cannot be read; those of the stages and of `act`.
    pub(super) fn with_job<R>(
        &self,
        RunRequest { inputs, progress, cancel, .. }: RunRequest<'_>,
        output: &Path,
        place: StagedPlace<'_>,
        act: impl FnOnce(GridJob) -> Result<R>,
    ) -> Result<(R, Vec<String>)> {
        let cloud = &self.cloud.options(&self.resources)?;
        let source = StagedCloud { inputs, cloud, has_ground_classes: self.preset().is_some() };
        let at = RunControl { progress, cancel };
        self.stages.before(source, place, &self.resources, at, |inputs, cloud| {
            act(GridJob { cloud, ..settled(self)?.unread(inputs, output)? })
        })
    }

    /// The job without its clip polygons.
    fn unread(&self, inputs: &Inputs, output: &Path) -> Result<GridJob> {
        let preset = self.preset();
        let stats = preset.map_or_else(
            || parse_list(self.stat.as_deref().unwrap_or("mean")),
            |own| Ok(vec![own.band()]),
        )?;
        Ok(GridJob {
            label: inputs.label().map(str::to_owned),
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
        let (start, RunRequest { output, progress, cancel, .. }) = (Instant::now(), request);
        refuse_existing(output, self.file.replacing.overwrite)?;
        let (mut report, notes) =
            self.with_job(request, output, StagedPlace::Beside(output), |job| {
                run(&job, progress, cancel)
            })?;
        report.run.wall_seconds = start.elapsed().as_secs_f64();
        Ok(GridReport { notes: [notes, report.notes].concat(), ..report })
    }
}
