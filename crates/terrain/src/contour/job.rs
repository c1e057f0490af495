//! A contour job: its options, its checks before any sample is read, and its report.

use std::path::{Path, PathBuf};

use serde::Serialize;

use terrane_base::error::{Error, Result};
use terrane_crs as crs;
use terrane_engine::Resources;
use terrane_engine::options::{FileOutput, FiniteNumber, GridInput, Reprojection};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::{Transformed, extent_of};
use terrane_files::folder_for;
use terrane_options::{OptionRange, OptionRule, Options};
use terrane_raster::{GridInfo, Inputs};
use terrane_simplify::{Length, LengthText, MetGoal};
use terrane_vector::{self as vector, VectorFormat};
use terrane_window::contour::ContourLevels;

/// The property that marks index contours.
pub(super) const INDEX: &str = "index";

/// Cells along the side of a tile, least to most.
const TILE_CELLS: [f64; 2] = [16.0, 8192.0];

/// Make contour lines of a grid
///
/// The surface is linear along the grid lines between samples; higher ground is on the right of each contour. Contours
/// end at voids and at the border and do not branch or touch, also when simplified with ‹tolerance›. The output does
/// not depend on threads or memory.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct ContourOptions {
    /// Contour interval, in the vertical unit of the data
    #[option(short = 'i', alias = "every", value = "HEIGHT", range = OptionRange::POSITIVE, heading = "Levels")]
    pub interval: Option<f64>,
    /// Contour levels, such as 10,50,100, instead of an interval
    #[option(alias = "at", value = "LIST", with = FiniteNumber, heading = "Levels")]
    pub levels: Vec<f64>,
    /// Base height of the interval
    #[option(alias = "offset", value = "HEIGHT", with = FiniteNumber, default_text = "0", heading = "Levels")]
    pub base: Option<f64>,
    /// Mark every N-th level from the base as an index contour: property "index" (true or false)
    #[option(value = "N", range = OptionRange::new(1.0, u32::MAX as f64), heading = "Levels")]
    pub index: Option<u32>,
    /// Simplification tolerance, in units of x and y or with a unit: 100m, 2km, 50ft (on the ellipsoid for longitude
    /// and latitude). Simplified lines do not cross or touch
    #[option(alias = "simplify", value = "LENGTH", with = LengthText, range = OptionRange::FROM_ZERO, heading = "Simplification")]
    pub tolerance: Option<Length>,
    /// Tile side in cells, 16 to 8192; simplification keeps the vertices on tile borders
    #[option(value = "CELLS", default = 1024, range = OptionRange::new(TILE_CELLS[0], TILE_CELLS[1]), heading = "Simplification")]
    pub tile: u32,
    /// Write polygons of the bands between levels, with properties "elev_min" and "elev_max", instead of lines
    #[option(short = 'p', heading = "Output")]
    pub polygons: bool,
    /// Name of the height property; polygons have NAME_min and NAME_max
    #[option(short = 'a', value = "NAME", default = "elev".to_owned(), heading = "Output")]
    pub attribute: String,
    /// Write the height as z of each vertex
    #[option(alias = "3d", heading = "Output")]
    pub with_z: bool,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// The coordinate reference system of the output.
    #[option(flatten)]
    pub reprojection: Reprojection,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[OptionRule] = &[
    OptionRule::OneOf(&["interval", "levels"], "contour levels"),
    OptionRule::NotWith("levels", &["base", "index"]),
    OptionRule::NotWith("polygons", &["index", "with_z"]),
];

impl ContourOptions {
    pub(super) fn heights(&self) -> Result<ContourLevels> {
        match self.interval {
            Some(interval) => ContourLevels::every(interval, self.base.unwrap_or(0.0)),
            None => ContourLevels::list(self.levels.clone()),
        }
    }

    /// The format to write.
    pub(super) fn format(&self, output: &Path) -> Result<&'static VectorFormat> {
        self.heights()?;
        if self.index.is_some() && self.attribute == INDEX {
            return Err(Error::usage(
                "‹attribute› is also the name of the attribute of index contours",
            )
            .remedy("choose another name"));
        }
        let format = vector::by_path(output, self.file.format.as_deref())?;
        let (kind, name) = match self.polygons {
            true => (vector::GeometryType::Polygon, "polygons"),
            false => (vector::GeometryType::LineString, "lines"),
        };
        if !format.holds.kinds.contains(&kind) {
            return Err(Error::usage(format!("{} does not support {name}", format.name))
                .in_file(output)
                .remedy("write GeoJSON, FlatGeobuf or Shapefile"));
        }
        Ok(format)
    }
}

/// Contour lines to make.
#[derive(Clone, Debug)]
pub struct ContourJob {
    /// Grid files, or a synthetic terrain by name.
    pub input: Inputs,
    /// File of features to write.
    pub output: PathBuf,
    /// Options of the contours.
    pub options: ContourOptions,
}

impl ContourJob {
    /// Checks the options before any sample is read; returns the format to write.
    pub(super) fn check(&self) -> Result<&'static VectorFormat> {
        terrane_options::check(&self.options)?;
        self.options.format(&self.output)
    }

    /// The operation to the target CRS, if there is one.
    pub(super) fn operation(&self, info: &GridInfo) -> Result<Option<crs::CoordinateOperation>> {
        let Some(transform) = self.options.reprojection.transform() else { return Ok(None) };
        let (input, extent) = (self.input.to_string(), Some(extent_of(info)));
        let (input, crs) = (Path::new(&input), &info.crs);
        let operation = transform.operation(input, crs, extent, &self.options.resources)?;
        match operation.keeps_heights() {
            true => Ok(Some(operation)),
            false => Err(Error::unsupported(
                "the target CRS changes heights: a contour would not stay level",
            )
            .remedy("pass a 2D CRS to keep the heights of the grid")),
        }
    }

    /// Folder for spilled pieces: the given one, or that of the output.
    pub(super) fn spill_folder(&self) -> &Path {
        folder_for(&self.output, self.options.resources.temp_dir.as_deref())
    }
}

/// What was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct ContourReport {
    pub input: String,
    pub output: String,
    /// Name of the written format.
    pub format: String,
    pub width: u32,
    pub height: u32,
    /// CRS of the grid.
    pub crs: String,
    /// Transformation to the CRS of the output, if it differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    /// Levels with a line, and the lowest and highest of them.
    pub levels: u64,
    pub lowest: Option<f64>,
    pub highest: Option<f64>,
    pub tolerance: Option<MetGoal>,
    /// Cells along the side of a tile.
    pub tile: u32,
    /// Lines written, rings among them.
    pub lines: u64,
    pub rings: u64,
    /// Polygons written, if asked for; lines are then those between them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polygons: Option<u64>,
    /// Lines left out because they enclose no cell: rings around samples that are exactly on a level, with all
    /// neighbours below.
    pub left_out: u64,
    /// Vertices written, and vertices before simplification (lines left out included).
    pub vertices: u64,
    pub original_vertices: u64,
    pub notes: Vec<String>,
    pub output_bytes: u64,
    pub samples: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub samples_per_second: f64,
}
