//! Groups of options shared by several operations.

mod codecs;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use terrane_options::{OptionRange, OptionRule, Options, changed};

use crate::disk::DiskCheck;
use crate::feature_files;
use crate::transform::TargetCrs;
pub use codecs::{
    AsFormula, AsNumber, BoundName, BoundsText, ByteSizeText, CellSize, CrsText, FileName,
    FileSize, FiniteNumber, FiniteOrNan, FlagName, Interval, KeyValue, PointFormatNumber,
    PositionText, PrintLength, PrintScale, SampleTypeName,
};
use terrane_base::attribute::Return;
use terrane_base::error::{Error, Result};
use terrane_cloud::{Condition, Flags};
use terrane_raster::SampleType;

/// Input grid
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
#[non_exhaustive]
pub struct GridInput {
    /// Band to read, from 1
    #[option(value = "N", range = OptionRange::new(1.0, u32::MAX as f64), default_text = "1")]
    pub band: Option<u32>,
    /// Nodata value, overriding the one in the file
    #[option(value = "VALUE", with = FiniteOrNan)]
    pub nodata: Option<f64>,
    /// Bounding box to read, in the coordinates of the grid, expanded to whole cells
    #[option(value = "XMIN,YMIN,XMAX,YMAX", alias = "bbox", with = BoundsText)]
    pub bounds: Option<[f64; 4]>,
    /// File of clip polygons in the CRS of the grid: samples outside become void, samples on a border are kept, inner
    /// rings are holes
    #[option(value = "FILE", alias = "polygon", with = FileName, role = Reads)]
    pub clip: Option<String>,
    /// File of water features in the CRS of the grid. Polygons are lakes, flattened to their lowest bank; polygons with
    /// a line inside are rivers, falling along the line (drawn downstream). In meshes, edges follow the banks
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub water: Option<String>,
}

impl GridInput {
    /// A whole grid with the water features of a file, if any.
    pub fn with_water(water: Option<String>) -> Self {
        Self { water, ..Self::default() }
    }

    /// The same without the bounding box.
    pub fn unbounded(&self) -> Self {
        Self { bounds: None, ..self.clone() }
    }

    /// Fails if options other than the bounding box are set, as the input is a mesh.
    pub fn refuse_for_meshes(&self) -> Result<()> {
        let given = changed(&self.unbounded());
        let Some(name) = given.keys().next() else { return Ok(()) };
        Err(Error::usage(format!("‹{name}› applies to grids, not to meshes"))
            .remedy(format!("leave ‹{name}› out")))
    }
}

/// Point filter
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Points", setters = group)]
#[non_exhaustive]
pub struct PointFilter {
    /// Classes to keep, such as 2,9 (2 ground, 6 building, 9 water)
    #[option(value = "CODES", alias = "classes")]
    pub class: Vec<u8>,
    /// Return to keep: first, last, only (single returns), or a return number from 1
    #[option(name = "return", alias = "returns", value = "WHICH", with = AsNumber)]
    pub returns: Option<Return>,
    /// Keep points flagged as withheld
    pub keep_withheld: bool,
    /// Drop points with these flags
    #[option(value = "FLAGS", with = FlagName)]
    pub drop_flag: Vec<Flags>,
    /// Height range to keep, inclusive
    #[option(value = "LOW,HIGH", with = Interval)]
    pub z_range: Option<[f64; 2]>,
    /// Condition on points, such as "intensity > 100 and point_source in (3, 7)". Operators: = != < <= > >= in, and or
    /// not, + - * / and parentheses; operands: numbers, x, y, z, attributes as in terrane grid ‹stat›, and extra bytes
    /// (in double quotes if the name has spaces). A missing value is neither equal nor unequal to any value
    #[option(name = "where", value = "CONDITION", with = AsFormula)]
    pub condition: Option<Condition>,
    /// Keep every N-th point of each file
    #[option(value = "N", range = OptionRange::new(1.0, u32::MAX as f64), default_text = "1")]
    pub every: Option<u32>,
    /// CRS of files that declare none, such as EPSG:2154 or WKT
    #[option(value = "CRS", with = CrsText)]
    pub crs: Option<String>,
    /// Read the intact part of damaged files; the number of lost points is reported
    pub salvage: bool,
}

/// Input point clouds
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Points", setters = group)]
#[non_exhaustive]
pub struct CloudInput {
    /// Bounding box of points to keep, inclusive
    #[option(value = "XMIN,YMIN,XMAX,YMAX", with = BoundsText)]
    pub bounds: Option<[f64; 4]>,
    /// File of clip polygons in the CRS of the point cloud: keeps points inside, or on western and southern borders
    #[option(value = "FILE", alias = "polygon", with = FileName, role = Reads)]
    pub clip: Option<String>,
    /// Which points.
    #[option(flatten)]
    pub points: PointFilter,
}

/// Constraints of a mesh
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Method", setters = group)]
#[non_exhaustive]
pub struct Constraints {
    /// File of points to keep as mesh vertices, in the CRS of the input: the sample or cloud point nearest to each
    /// point, or to each vertex of lines and polygons, is kept at its own height
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub keep_points: Option<String>,
    /// File of breaklines (lines or polygons) in the CRS of the input: mesh edges follow them from sample to sample. On
    /// point clouds edges run along anchor vertices on the lines, at the z of the lines if present
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub breaklines: Option<String>,
}

impl Constraints {
    /// The same with absolute paths.
    pub fn absolute(&self) -> Result<Self> {
        let absolute =
            |name: &Option<String>| name.as_deref().map(feature_files::absolute).transpose();
        let Self { keep_points, breaklines } = self;
        Ok(Self { keep_points: absolute(keep_points)?, breaklines: absolute(breaklines)? })
    }
}

/// Input features
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(setters = group)]
#[non_exhaustive]
pub struct FeatureInput {
    /// TopoJSON object to read
    #[option(value = "NAME", default_text = "the first")]
    pub layer: Option<String>,
}

/// Existing output
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Output", setters = group)]
pub struct Replacing {
    /// Overwrite existing output
    #[option(role = Run)]
    pub overwrite: bool,
}

/// Resumable work
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Resources", setters = group, rules = OF_RESUMING)]
pub struct Resuming {
    /// Folder for intermediate results: an interrupted run resumes from it. Delete it once the output is written
    #[option(value = "FOLDER", with = FileName, role = Run)]
    pub workdir: Option<PathBuf>,
    /// Check free disk space for task results and output before starting
    #[option(
        default = true,
        off = "Start even if free disk space looks too small for task results and output",
        role = Run
    )]
    pub disk_check: bool,
}

impl Resuming {
    /// Whether to check free disk space.
    pub fn disk(&self) -> DiskCheck {
        if self.disk_check { DiskCheck::On } else { DiskCheck::Off }
    }
}

const OF_RESUMING: &[OptionRule] = &[OptionRule::Needs("disk_check", &["workdir"])];

/// Output file
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Output", setters = group)]
pub struct FileOutput {
    /// Output format
    #[option(value = "NAME", short = 'f', default_text = "from the file extension")]
    pub format: Option<String>,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
}

/// Output grid
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Output", setters = group)]
pub struct GridOutput {
    /// Creation option of the format, named as in GDAL, such as COMPRESS=ZSTD
    #[option(value = "KEY=VAL", with = KeyValue, no_setter)]
    pub co: Vec<(String, String)>,
}

impl GridOutput {
    /// The format's creation options, sorted by name.
    pub fn in_order(&self) -> Vec<(String, String)> {
        let mut creation = self.co.clone();
        creation.sort();
        creation
    }
}

/// Output CRS
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Reference system", setters = group, rules = OF_REPROJECTION)]
pub struct Reprojection {
    /// CRS of the output, such as EPSG:4326 or WKT; processing uses the CRS of the input
    #[option(value = "CRS", with = CrsText)]
    pub to_crs: Option<String>,
    /// Files of the operation.
    #[option(flatten)]
    pub files: OperationFiles,
}

/// Files of a coordinate operation
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Options)]
#[options(heading = "Reference system", setters = group)]
pub struct OperationFiles {
    /// Datum shift grid between the two CRSs: an NTv2 file (.gsb)
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub shift_grid: Option<PathBuf>,
    /// Geoid model (GTX or GeoTIFF) to convert between ellipsoidal heights and heights above the geoid
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<PathBuf>,
}

/// Output samples
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Output", setters = group)]
pub struct SampleOutput {
    /// Output sample type, such as int16 or float32
    #[option(name = "type", alias = "dtype", value = "NAME", with = SampleTypeName,
             default_text = "as in the input; for differences float32 or float64")]
    pub sample_type: Option<SampleType>,
    /// Nodata value of the output
    #[option(value = "VALUE", with = FiniteOrNan, default_text = "as in the input; for differences -9999")]
    pub out_nodata: Option<f64>,
    /// Round heights that the sample type cannot hold exactly
    pub round: bool,
}

const OF_REPROJECTION: &[OptionRule] =
    &[OptionRule::Needs("shift_grid", &["to_crs"]), OptionRule::Needs("geoid", &["to_crs"])];

impl Reprojection {
    /// The reprojection, if any.
    pub fn transform(&self) -> Option<TargetCrs> {
        let files = self.files.clone();
        self.to_crs.clone().map(|target| TargetCrs { target, files })
    }
}
