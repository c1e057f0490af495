//! Options of pictures.

use std::path::PathBuf;

use terrane_options::{OptionRange, Options};

use crate::render::MAX_PICTURE_SIDE;
use terrane_engine::Resources;
use terrane_engine::options::{FiniteNumber, GridInput, Replacing};
use terrane_raster::Inputs;

terrane_engine::has_within!(PictureOptions: Lighting => [Exaggeration]);

/// Vertical exaggeration
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
pub struct Exaggeration {
    /// Vertical exaggeration factor
    #[option(value = "FACTOR", range = OptionRange::POSITIVE, default_text = "fitted to the terrain")]
    pub exaggeration: Option<f64>,
}

/// Light direction and vertical exaggeration
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
pub struct Lighting {
    /// Azimuth of the light, in degrees clockwise from north
    #[option(value = "DEG", default = 315.0, with = FiniteNumber)]
    pub azimuth: f64,
    /// Altitude of the light above the horizon, in degrees from 1 to 90
    #[option(value = "DEG", default = 45.0, range = OptionRange::new(1.0, 90.0))]
    pub altitude: f64,
    /// Vertical exaggeration.
    #[option(flatten)]
    pub heights: Exaggeration,
}

/// Draw a shaded relief picture of a grid or mesh: PNG, transparent outside the surface, with the vertex colours of
/// coloured meshes
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct PictureOptions {
    /// Picture width in pixels; the height follows from the aspect ratio on the ground
    #[option(
        value = "PX",
        range = OptionRange::new(1.0, MAX_PICTURE_SIDE as f64),
        default_text = "1600; for grids at most 8 times the number of columns"
    )]
    pub width: Option<u32>,
    /// Draw triangle edges
    pub edges: bool,
    /// How it is lit.
    #[option(flatten)]
    pub lighting: Lighting,
    /// How the grid is read; within its bounds, which may be those of a part of a mesh, too.
    #[option(flatten)]
    pub grid: GridInput,
    /// Existing output.
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
