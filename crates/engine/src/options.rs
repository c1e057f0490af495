//! Groups of options that several operations have.

mod codecs;

use std::path::PathBuf;

use terrane_options::{OptionRange, OptionRule, Options, changed};

use crate::beside;
use crate::disk::DiskCheck;
use crate::transform::TargetCrs;
pub use codecs::{
    AsFormula, AsNumber, BoundName, BoundsText, ByteSizeText, CellSize, CrsText, FileName,
    FileSize, FiniteNumber, FiniteOrNan, Interval, KeyValue, MarkName, PointFormatNumber,
    PositionText, PrintLength, PrintScale, SampleTypeName,
};
use terrane_base::attribute::Return;
use terrane_base::error::{Error, Result};
use terrane_cloud::{Condition, Flags};

/// How a grid is read
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
#[non_exhaustive]
pub struct GridInput {
    /// Band to read, from 1
    #[option(value = "N", range = OptionRange::new(1.0, u32::MAX as f64), default_text = "1")]
    pub band: Option<u32>,
    /// Stored value that means "no height", instead of the file's own
    #[option(value = "VALUE", with = FiniteOrNan)]
    pub nodata: Option<f64>,
    /// Part of the grid, in its coordinates, widened to whole cells (the square around each sample)
    #[option(value = "XMIN,YMIN,XMAX,YMAX", alias = "bbox", with = BoundsText)]
    pub bounds: Option<[f64; 4]>,
    /// Polygons of a file of features, in the system of the grid: samples outside of all of them are taken for voids;
    /// those on a border stay, and rings within a polygon are holes
    #[option(value = "FILE", alias = "polygon", with = FileName, role = Reads)]
    pub clip: Option<String>,
    /// Water of a file of features, in the system of the grid, made level: polygons are lakes, as high as their lowest
    /// bank, and those that a line of the file runs within are rivers, falling along it (drawn downstream). Edges of a mesh
    /// follow the banks
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub water: Option<String>,
}

impl GridInput {
    /// A whole grid with the water of a file, if any.
    pub fn with_water(water: Option<String>) -> Self {
        Self { water, ..Self::default() }
    }

    /// The same of the whole grid.
    pub fn unbounded(&self) -> Self {
        Self { bounds: None, ..self.clone() }
    }

    /// Fails when something else is said than which part is meant, as what is read is a mesh.
    pub fn refuse_for_meshes(&self) -> Result<()> {
        let given = changed(&self.unbounded());
        let Some(name) = given.keys().next() else { return Ok(()) };
        Err(Error::usage(format!("‹{name}› applies to grids, not to meshes"))
            .remedy(format!("leave ‹{name}› out")))
    }
}

/// Which points are read, and how
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Points", setters = group)]
#[non_exhaustive]
pub struct PointFilter {
    /// Only points of these classes, such as 2,9 (2 is ground, 6 buildings, 9 water)
    #[option(value = "CODES", alias = "classes")]
    pub class: Vec<u8>,
    /// Only this return of each pulse: first, last, only, or a number from 1
    #[option(name = "return", alias = "returns", value = "WHICH", with = AsNumber)]
    pub returns: Option<Return>,
    /// Points that are marked as withheld, too
    pub keep_withheld: bool,
    /// No points with these marks
    #[option(value = "MARKS", with = MarkName)]
    pub drop_flag: Vec<Flags>,
    /// Only points at these heights, the ends included
    #[option(value = "LOW,HIGH", with = Interval)]
    pub z_range: Option<[f64; 2]>,
    /// Only points of which this is true, such as "intensity > 100 and point_source in (3, 7)": = != < <= > >= and in, and
    /// or not, + - * / and parentheses, of numbers, attributes as of terrane grid ‹stat›, extra bytes (in double quotes
    /// where their names have spaces), x, y and z. A missing value is neither equal nor unequal to any
    #[option(name = "where", value = "CONDITION", with = AsFormula)]
    pub condition: Option<Condition>,
    /// Only every N-th point of each file
    #[option(value = "N", range = OptionRange::new(1.0, u32::MAX as f64), default_text = "1")]
    pub every: Option<u32>,
    /// The coordinate reference system of files that name none, such as EPSG:2154 or well-known text
    #[option(value = "CRS", with = CrsText)]
    pub crs: Option<String>,
    /// Go on with the good part of damaged files; the points lost are counted
    pub salvage: bool,
}

/// How clouds are read
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Points", setters = group)]
#[non_exhaustive]
pub struct CloudInput {
    /// Only points within this box, its borders included
    #[option(value = "XMIN,YMIN,XMAX,YMAX", with = BoundsText)]
    pub bounds: Option<[f64; 4]>,
    /// Only points inside the polygons of a file of features, in the system of the cloud, or on western and southern borders of
    /// these
    #[option(value = "FILE", alias = "polygon", with = FileName, role = Reads)]
    pub clip: Option<String>,
    /// Which points.
    #[option(flatten)]
    pub points: PointFilter,
}

/// What stays in a mesh
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Method", setters = group)]
#[non_exhaustive]
pub struct Constraints {
    /// Samples or points of a cloud that stay vertices, at their heights: the nearest one to each point of a file of
    /// features, and to each vertex of its lines and polygons, in the system of the grid or cloud
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub keep_points: Option<String>,
    /// Lines and polygons of a file of features, in the system of the grid or cloud, that edges of the mesh follow,
    /// from sample to sample; over a cloud along posts of their own, at the heights of the lines, if they have any
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub breaklines: Option<String>,
}

impl Constraints {
    /// The same wherever the process works.
    pub fn absolute(&self) -> Result<Self> {
        let absolute = |name: &Option<String>| name.as_deref().map(beside::absolute).transpose();
        let Self { keep_points, breaklines } = self;
        Ok(Self { keep_points: absolute(keep_points)?, breaklines: absolute(breaklines)? })
    }
}

/// How features are read
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(setters = group)]
#[non_exhaustive]
pub struct FeatureInput {
    /// The object of TopoJSON files to read
    #[option(value = "NAME", default_text = "their first")]
    pub layer: Option<String>,
}

/// What is there already
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Output", setters = group)]
pub struct Replacing {
    /// Replace what exists
    #[option(role = Run)]
    pub overwrite: bool,
}

/// Where work is kept that may be killed
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Resources", setters = group, rules = OF_RESUMING)]
pub struct Resuming {
    /// Keep what is done in this folder, so that the same work goes on after it was killed; it can be removed when
    /// the output is there
    #[option(value = "FOLDER", with = FileName, role = Run)]
    pub workdir: Option<PathBuf>,
    /// Begin only where the disk has room for the results of tasks and the output
    #[option(
        default = true,
        off = "Begin even where the disk seems to have too little room for the results of tasks and the output",
        role = Run
    )]
    pub disk_check: bool,
}

impl Resuming {
    /// Whether there has to be room on the disk.
    pub fn disk(&self) -> DiskCheck {
        if self.disk_check { DiskCheck::On } else { DiskCheck::Off }
    }
}

const OF_RESUMING: &[OptionRule] = &[OptionRule::Needs("disk_check", &["workdir"])];

/// A file that is written
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Output", setters = group)]
pub struct FileOutput {
    /// Format to write
    #[option(value = "NAME", short = 'f', default_text = "by the output's ending")]
    pub format: Option<String>,
    /// What is there already.
    #[option(flatten)]
    pub replacing: Replacing,
}

/// How a grid is written
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Output", setters = group)]
pub struct GridOutput {
    /// Option of the format, with GDAL's names, such as COMPRESS=ZSTD
    #[option(value = "KEY=VAL", with = KeyValue, no_setter)]
    pub co: Vec<(String, String)>,
}

impl GridOutput {
    /// The options of the format by name, in whatever order they were given.
    pub fn in_order(&self) -> Vec<(String, String)> {
        let mut creation = self.co.clone();
        creation.sort();
        creation
    }
}

/// The reference system of an output
#[derive(Clone, Debug, PartialEq, Eq, Options)]
#[options(heading = "Reference system", setters = group, rules = OF_REPROJECTION)]
pub struct Reprojection {
    /// Write in this reference system, such as EPSG:4326 or well-known text; processing uses that of the input
    #[option(value = "CRS", with = CrsText)]
    pub to_crs: Option<String>,
    /// Grid of shifts between the datums of the two systems: an NTv2 file (.gsb)
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub shift_grid: Option<PathBuf>,
    /// Heights of a geoid above the ellipsoid (GTX or GeoTIFF), for systems that count heights from different ones of
    /// the two
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<PathBuf>,
}

const OF_REPROJECTION: &[OptionRule] =
    &[OptionRule::Needs("shift_grid", &["to_crs"]), OptionRule::Needs("geoid", &["to_crs"])];

impl Reprojection {
    /// What is to be done, if anything.
    pub fn transform(&self) -> Option<TargetCrs> {
        let (shift_grid, geoid) = (self.shift_grid.clone(), self.geoid.clone());
        self.to_crs.clone().map(|target| TargetCrs { target, shift_grid, geoid })
    }
}
