//! Options of pictures.

use std::path::PathBuf;

use terrane_options::{OptionRange, Options};

use crate::render::MAX_PICTURE_SIDE;
use terrane_engine::Resources;
use terrane_engine::options::{FiniteNumber, GridInput, Replacing};
use terrane_raster::Inputs;

terrane_engine::has_within!(PictureOptions: Lighting => [Exaggeration]);

/// How high heights look
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
pub struct Exaggeration {
    /// Factor on heights
    #[option(value = "FACTOR", range = OptionRange::POSITIVE, default_text = "chosen from the terrain")]
    pub exaggeration: Option<f64>,
}

/// Where the light comes from, and how high heights look
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
pub struct Lighting {
    /// Where the light comes from, in degrees clockwise from north
    #[option(value = "DEG", default = 315.0, with = FiniteNumber)]
    pub azimuth: f64,
    /// Height of the light above the horizon, in degrees from 1 to 90
    #[option(value = "DEG", default = 45.0, range = OptionRange::new(1.0, 90.0))]
    pub altitude: f64,
    /// How high heights look.
    #[option(flatten)]
    pub heights: Exaggeration,
}

/// Draw a grid or a mesh as a shaded relief picture (PNG, transparent where there is no surface); a mesh whose vertices
/// have colours is drawn in these
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct PictureOptions {
    /// Columns of the picture; rows follow from the aspect on the ground
    #[option(value = "PX", default = 1600u32, range = OptionRange::new(1.0, MAX_PICTURE_SIDE as f64))]
    pub width: u32,
    /// Draw the edges of a mesh's triangles
    pub edges: bool,
    /// How it is lit.
    #[option(flatten)]
    pub lighting: Lighting,
    /// How the grid is read; within its bounds, which may be those of a part of a mesh, too.
    #[option(flatten)]
    pub grid: GridInput,
    /// What is there already.
    #[option(flatten)]
    pub replacing: Replacing,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// A picture to draw.
#[derive(Clone, Debug)]
pub struct ViewJob {
    /// Grid files or a mesh, or a synthetic terrain by name.
    pub input: Inputs,
    /// PNG file to write.
    pub output: PathBuf,
    /// How it is drawn.
    pub options: PictureOptions,
}
