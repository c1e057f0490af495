//! Options of meshes of grids.

use std::path::Path;

use terrane_options::{OptionCodec, OptionRange, OptionRule, Options, check, settled};

use super::baseline::TextbookMethod;
use super::goal::TinGoal;
use super::job::TinJob;
use super::layout::{TILE_CELLS, USUAL_TILE};
use super::names::{GREEDY, MeshMethodName};
use super::refinement::TinMethod;
use terrane_base::error::{Error, Result};
use terrane_base::registry;
use terrane_baselines::{BaselineMethod, METHODS, TriangulationRule};
use terrane_engine::Resources;
use terrane_engine::bands::MeshBands;
use terrane_engine::local_frame::LocalFrame;
use terrane_engine::options::{
    Constraints, FileOutput, FiniteNumber, GridInput, KeyValue, PrintLength, Reprojection, Resuming,
};
use terrane_engine::outputs::refuse_file_name;
use terrane_mesh::{self as mesh, MeshFormat, VertexCapabilities};
use terrane_raster::Inputs;

terrane_engine::has_within!(TinOptions: TinMethod => [Constraints]);

/// Target of a mesh
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Target", setters = group, rules = OF_TARGET)]
#[non_exhaustive]
pub struct TinTarget {
    /// Maximum vertical distance of any valid sample from the mesh, in the vertical unit of the data
    #[option(value = "E", range = OptionRange::FROM_ZERO)]
    pub max_error: Option<f64>,
    /// Vertex budget: the smallest error with at most N vertices
    #[option(value = "N", range = OptionRange::new(3.0, f64::MAX), role = Run)]
    pub max_vertices: Option<u64>,
    /// Triangle budget: the smallest error with at most N triangles
    #[option(value = "N", range = OptionRange::new(1.0, f64::MAX), role = Run)]
    pub max_triangles: Option<u64>,
}

const OF_TARGET: &[OptionRule] =
    &[OptionRule::OneOf(&["max_error", "max_vertices", "max_triangles"], "target")];

impl TinTarget {
    /// The goal of a job.
    ///
    /// # Errors
    /// Usage: there is none, or more than one.
    pub fn goal(&self) -> Result<TinGoal> {
        check(self)?;
        // Without the sign that a zero may have.
        let error = self.max_error.map(|error| TinGoal::MaxError(error.abs()));
        let vertices = self.max_vertices.map(TinGoal::MaxVertices);
        let goal = error.or(vertices).or(self.max_triangles.map(TinGoal::MaxTriangles));
        goal.ok_or_else(|| Error::usage("no target given").remedy("pass ‹max_error›"))
    }
}

/// Simplify a grid into a triangle mesh with a proven vertical error bound
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct TinOptions {
    /// Target of the mesh.
    #[option(flatten)]
    pub target: TinTarget,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// The mesh file.
    #[option(flatten)]
    pub file: FileOutput,
    /// Creation option of the format: SOLID_BASE=HEIGHT closes an STL or 3MF with walls and a flat bottom
    #[option(value = "KEY=VAL", with = KeyValue, role = Run, heading = "Output")]
    pub co: Vec<(String, String)>,
    /// Write a folder instead of one file: one mesh for every N x N tiles and an index (GeoJSON)
    #[option(value = "N", range = OptionRange::new(1.0, 65_536.0), role = Run, heading = "Output")]
    pub split: Option<u32>,
    /// How the mesh lies in its file.
    #[option(flatten)]
    pub placing: LocalFrame,
    /// Solid base of STL and 3MF: walls and a flat bottom this far below the lowest height, such as 3mm of the print
    #[option(value = "LENGTH", with = PrintLength, role = Run,
             heading = "Viewers and printers (STL, 3MF and GLB)")]
    pub base: Option<f64>,
    /// The system to write in.
    #[option(flatten)]
    pub reprojection: Reprojection,
    /// How the mesh is refined.
    #[option(flatten)]
    pub refinement: TinMethod,
    /// Meshing method; all methods except greedy hold the whole grid in memory
    #[option(value = "NAME", with = MeshMethodName, default = GREEDY.to_owned(), role = Run, heading = "Method")]
    pub method: String,
    /// Tile side in cells, 16 to 8192
    #[option(value = "CELLS", default = USUAL_TILE, heading = "Method",
             range = OptionRange::new(*TILE_CELLS.start() as f64, *TILE_CELLS.end() as f64))]
    pub tile: u32,
    /// Bands approximated by one mesh, such as 1,2,3 for the colours of an image. The error of a sample is the maximum
    /// over the bands of weight x |value - mesh|. Heights are those of ‹band›, which must be one of the bands, else 0
    #[option(value = "N,..", range = OptionRange::new(1.0, u32::MAX as f64), role = Run, heading = "Bands")]
    pub bands: Vec<u32>,
    /// Weight of the error in each band
    #[option(value = "W,..", range = OptionRange::POSITIVE, role = Run, heading = "Bands", default_text = "1 each")]
    pub weights: Vec<f64>,
    /// Where work is kept.
    #[option(flatten)]
    pub resuming: Resuming,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Options that only greedy insertion in tiles supports.
const OF_GREEDY: &[&str] = &[
    "workdir",
    "split",
    "keep_points",
    "breaklines",
    "strict",
    "drop",
    "fit_heights",
    "min_angle",
    "water",
    "tile",
    "bound=surface",
];

const RULES: &[OptionRule] = &[
    OptionRule::NotWith("workdir", &["max_vertices", "max_triangles"]),
    OptionRule::NotWith("workdir", &["base", "keep_degrees", "size", "scale", "exaggeration"]),
    OptionRule::Needs("base", &["size", "scale"]),
    OptionRule::NotWith("base", &["co"]),
    OptionRule::NotWith("water", &["min_angle", "fit_heights"]),
    OptionRule::Needs("weights", &["bands"]),
    OptionRule::NotWith("bands", &["method", "triangulation"]),
    OptionRule::NotWith("bands", OF_GREEDY),
    OptionRule::NotWith("method!=greedy", OF_GREEDY),
];

impl TinOptions {
    /// The method, where it is not greedy insertion in tiles.
    pub(super) fn textbook(&self) -> Result<Option<TextbookMethod>> {
        let triangulation = self.refinement.triangulation;
        if self.method == GREEDY {
            return match triangulation {
                Some(TriangulationRule::Split3) => Err(not_of(GREEDY, "triangulation=split3")
                    .remedy("leave it out, or choose another ‹method›")),
                _ => Ok(None),
            };
        }
        let method: &'static BaselineMethod = registry::named(METHODS, &self.method)?;
        let TinTarget { max_vertices, max_triangles, .. } = &self.target;
        let of_some = [
            ("triangulation", triangulation.is_some() && !method.takes_triangulation),
            ("max_vertices", max_vertices.is_some() && !method.takes_budget),
            ("max_triangles", max_triangles.is_some() && !method.takes_budget),
        ];
        match of_some.into_iter().find(|(_, is_missing)| *is_missing) {
            Some(("triangulation", _)) => Err(not_of(method.name, "triangulation")
                .remedy("leave it out, or choose another ‹method›")),
            Some((option, _)) => {
                Err(not_of(method.name, option).remedy("pass ‹max_error› instead"))
            }
            None => {
                let triangulation = triangulation.unwrap_or_default();
                Ok(Some(TextbookMethod { method, triangulation }))
            }
        }
    }

    /// The bands that share the mesh, if any do.
    ///
    /// # Errors
    /// Usage: bands and weights that do not fit together.
    pub fn shared(&self) -> Result<Option<MeshBands>> {
        match self.bands.is_empty() {
            true => Ok(None),
            false => MeshBands::new(&self.bands, &self.weights, self.grid.band).map(Some),
        }
    }

    /// The format to write. Fails if it does not support the options.
    fn format(&self, output: &Path) -> Result<&'static MeshFormat> {
        let usual = self.split.map(|_| "PLY");
        let format = mesh::by_path(output, self.file.format.as_deref().or(usual))?;
        if self.split.is_some() {
            refuse_file_name(output)?;
        }
        if !self.bands.is_empty() && format.carries == VertexCapabilities::Nothing {
            return Err(Error::usage(format!("{} does not support ‹bands›", format.name))
                .remedy("write PLY, or GLB for three or four 8-bit bands"));
        }
        let name = format.name;
        let (option, message) = match (self.solid_base()?, self.base) {
            _ if format.can_be_solid => return Ok(format),
            (None, None) => return Ok(format),
            (Some(_), _) => ("co", format!("{name} does not support the option SOLID_BASE")),
            (None, Some(_)) => ("base", format!("‹base› is not supported by {name}")),
        };
        Err(Error::usage(message).remedy(format!("write STL or 3MF, or leave out ‹{option}›")))
    }

    /// The height of the bottom of a solid.
    fn solid_base(&self) -> Result<Option<f64>> {
        let mut heights = self.co.iter().map(|(key, value)| solid_base_height(key, value));
        heights.next_back().transpose()
    }

    /// The job on some files.
    ///
    /// # Errors
    /// Conflicting options, or options that the output format does not support.
    pub fn job(&self, inputs: &Inputs, output: &Path) -> Result<TinJob> {
        let settled = settled(self)?;
        Ok(TinJob {
            transform: settled.reprojection.transform(),
            reading: settled.grid,
            refinement: settled.refinement,
            format: Some(self.format(output)?.name.to_owned()),
            overwrite: self.file.replacing.overwrite,
            split: self.split,
            solid_base: self.solid_base()?,
            base: self.base,
            placing: self.placing,
            tile: self.tile,
            resources: self.resources.clone(),
            ..TinJob::new(inputs.clone(), output, self.target.goal()?)
        })
    }
}

/// The height of a creation option `SOLID_BASE=HEIGHT`.
fn solid_base_height(key: &str, value: &str) -> Result<f64> {
    let height = match key.eq_ignore_ascii_case("SOLID_BASE") {
        true => FiniteNumber::parse(value).map_err(|_| "pass SOLID_BASE a number"),
        false => Err("the only supported option is SOLID_BASE=HEIGHT"),
    };
    height.map_err(|remedy| {
        Error::usage(format!("unknown or invalid ‹co› \"{key}={value}\"")).remedy(remedy)
    })
}

/// The error of an option that a method does not support.
fn not_of(method: &str, option: &str) -> Error {
    Error::usage(format!("the method {method} does not support ‹{option}›"))
}
